"""Files of arrays: .npz that numpy alone can read, written whole or not at all."""

import hashlib
import io
import os
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import memory
from .errors import NotEnoughMemory, SgmdsError
from .whole_file import whole_file

OURS = "sgmds-"
"""How the kinds of all our files begin."""
CHECKSUM = "checksum"
HEAD_BYTES = 1024
"""Of a file, to see whose it is: its first member, the name of its kind, ends before."""
_MEMBER = struct.Struct("<4s5H3L2H")
"""What stands before the name of a member of a zip archive (APPNOTE.TXT 4.3.7)."""
_DEFLATED = 8


def write(
    path: str | os.PathLike[str], kind: str, version: int, *, compressed: bool = True, **arrays: Any
) -> None:
    """Writes arrays beside `path` and moves them there when complete, if `check_replaceable` agrees."""
    check_replaceable(path)
    npy: Any = np.lib.format
    with whole_file(path, binary=True) as file:
        packed = zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED)
        try:
            # The kind goes first, where `kind_of` finds it also in a file that was cut short.
            for name, array in {"format": kind, "version": version, **arrays}.items():
                with packed.open(f"{name}.npy", "w", force_zip64=True) as member:
                    npy.write_array(member, np.asanyarray(array), allow_pickle=False)
            packed.close()
        except BaseException:
            # Else it tries to write its end once more when it is forgotten, and tells of it.
            packed.fp = None
            raise


def check_replaceable(path: str | os.PathLike[str]) -> None:
    """Raises `FileExistsError` for a file that is not empty and, by its beginning, not of `write`."""
    path = Path(path)
    if path.is_file() and path.stat().st_size and not kind_of(path).startswith(OURS):
        raise FileExistsError(
            f"{path}: is there already and was not saved by sgmds, so it stays: choose another name"
        )


def kind_of(path: str | os.PathLike[str]) -> str:
    """The kind that a file says it is where `write` says it, also when damaged further on; else empty."""
    # Its functions have no types.
    npy: Any = np.lib.format
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD_BYTES)
        signature, _, _, method, *_, name_length, more_length = _MEMBER.unpack_from(head)
        name_end = _MEMBER.size + name_length
        if signature != b"PK\3\4" or head[_MEMBER.size : name_end] != b"format.npy":
            return ""
        content = head[name_end + more_length :]
        if method == _DEFLATED:
            content = zlib.decompressobj(-zlib.MAX_WBITS).decompress(content, HEAD_BYTES)
        array = io.BytesIO(content)
        npy.read_magic(array)
        shape, _, dtype = npy.read_array_header_1_0(array)
        if shape != () or dtype.kind != "U":
            return ""
        return str(np.frombuffer(array.read(dtype.itemsize), dtype)[0])
    except Exception:
        # As in `read`; what cannot be understood is not ours.
        return ""


def checksum(arrays: Mapping[str, Any]) -> str:
    """Hexadecimal BLAKE2b digest of the names, types, shapes and values of arrays, whatever their order."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays.keys() - {CHECKSUM}):
        array = np.asarray(arrays[name], order="C")
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(array.reshape(-1).view(np.uint8).data)
    return digest.hexdigest()


def read(
    path: str | os.PathLike[str], kind: str, version: int, names: Iterable[str]
) -> dict[str, NDArray[Any]]:
    """The named arrays of a file that `write` made; anything else is refused.

    The archive's checksums notice damage; nothing in the file is executed.
    """
    try:
        # Numpy leaves a file open that it cannot read.
        with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
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
