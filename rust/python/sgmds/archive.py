"""Files of arrays: .npz that numpy alone can read, written whole or not at all."""

import os
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import memory
from .errors import NotEnoughMemory, SgmdsError
from .whole_file import whole_file


def write(
    path: str | os.PathLike[str], kind: str, version: int, *, compressed: bool = True, **arrays: Any
) -> None:
    """Writes arrays beside `path` and moves them there when complete."""
    save = np.savez_compressed if compressed else np.savez
    with whole_file(path, binary=True) as file:
        save(file, format=kind, version=version, **arrays)


def read(
    path: str | os.PathLike[str], kind: str, version: int, names: Iterable[str]
) -> dict[str, NDArray[Any]]:
    """The named arrays of a file that `write` made; anything else is refused.

    The archive's checksums notice damage; nothing in the file is executed.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            # A small file may unpack to any size; no more is unpacked than its table of contents says.
            size, free = sum(entry.file_size for entry in file.zip.infolist()), memory.available()
            if free is not None and size > free:
                raise NotEnoughMemory(
                    f"{path}: unpacks to {size / memory.GIGABYTE:.1f} GB, "
                    f"{free / memory.GIGABYTE:.1f} GB are free: close other programs, or make it again"
                )
            arrays = {name: file[name] for name in file.files}
        for name, array in arrays.items():
            # What does not begin like an array is handed out as it is.
            if not isinstance(array, np.ndarray):
                raise ValueError(f"{name} is not an array")
    except (FileNotFoundError, NotEnoughMemory):
        raise
    except Exception as error:
        # zipfile, zlib, numpy and its tokenizer fail in many ways on damage; each is the file's fault.
        raise SgmdsError(f"{path}: not a readable {kind} file ({error}): make it again") from error
    if str(arrays.get("format")) != kind:
        raise SgmdsError(f"{path}: not a {kind} file: make it again")
    if (found := str(arrays.get("version"))) != str(version):
        if not found.isdecimal():
            raise SgmdsError(f"{path}: damaged, its version is {found!r}: make it again")
        age = "an older version" if int(found) < version else "a newer version"
        raise SgmdsError(f"{path}: of {age} ({found}, this one reads {version}): make it again")
    missing = set(names) - arrays.keys()
    if missing:
        raise SgmdsError(f"{path}: damaged, lacks {', '.join(sorted(missing))}: make it again")
    return arrays
