"""Files that are there complete or not at all."""

import os
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any


@contextmanager
def whole_file(path: str | os.PathLike[str], *, binary: bool = False) -> Iterator[IO[Any]]:
    """A new file beside `path` that takes its name, and its place, when the block ends well."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    # Not the tempfile module's: those can be read by nobody else.
    try:
        file = open(temporary, "xb") if binary else open(temporary, "x", encoding="utf-8", newline="")
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink()
        raise


def clear_remains(paths: Iterable[Path]) -> None:
    """Removes what killed processes left of new files of these names, which nobody may be writing now."""
    names: dict[Path, set[str]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add(path.name)
    for folder, wanted in names.items():
        for path in folder.glob(".*"):
            remains = re.fullmatch(r"\.(.+)\.[0-9a-f]{8}", path.name)
            if remains and remains[1] in wanted:
                path.unlink()
