"""Files that are there complete or not at all."""

import os
import re
import secrets
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

REMAINS = r"\.(.+)\.[0-9a-f]{8}"
"""Name of a file that is not yet complete, around the name that it will have."""


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
    except BaseException as error:
        temporary.unlink()
        if isinstance(error, OSError) and error.errno and error.filename is None:
            # As when the disk is full: it was this file that could not be written.
            error.filename = str(path)
        raise


def begins_with(path: str | os.PathLike[str], beginning: bytes) -> bool:
    """Whether a file begins so, or is the beginning of that: empty, or cut short."""
    with open(path, "rb") as file:
        head = file.read(len(beginning))
    return beginning.startswith(head)


def clear_remains(paths: Iterable[Path], ours: Callable[[Path], bool]) -> None:
    """Removes what killed processes left of new files of these names, which nobody may be writing now.

    Of such names only files go that are empty or `ours` by their content.
    """
    names: dict[Path, set[str]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add(path.name)
    for folder, wanted in names.items():
        for path in folder.glob(".*"):
            remains = re.fullmatch(REMAINS, path.name)
            if (
                remains
                and remains[1] in wanted
                and path.is_file()
                and (not path.stat().st_size or ours(path))
            ):
                path.unlink()
