"""A file that is read in parts, and what reading it may hold in memory."""

from __future__ import annotations

import codecs
import gzip
import os
import stat
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .. import memory
from ..errors import NotEnoughMemory

FACTOR = 11
"""Bytes of what is read that may be held for each byte of the file. The shortest triangle of a text,
"f 1 2 3" with its line end, has 8 bytes; its corners take 24, as many as the triangle that is made of
them."""
BASE = 140 * 10**6
"""The same whatever the size of the file. With both, memory stays below 12 times the file and 200 MB: arrays
take a sixteenth more than is in them while they grow, and the places that they leave 32 MB; the words of a
block that is looked at take some 20 MB."""
BLOCK = 2**20
"""Bytes of a file that are looked at together."""
HEAD = 1000
"""Bytes at the beginning of a text by which it is seen to be one: none of them is zero."""
WORDS_FACTOR = 36
"""Bytes that the words of a line and their numbers take for each byte of it, when each has one letter."""
MEGABYTE = 1e6
SHOWN = 200
"""Letters of a reason that are shown: some hold what was found in the file."""


class Source:
    """An open file, plain or gzipped.

    `size` is that of the file as it is. A reader asks `allow` before it holds more.
    """

    def __init__(self, path: str | os.PathLike[str], zipped: bool = False):
        state = Path(path).stat()
        # A pipe or a device has no end, and opening a pipe waits for somebody to write.
        if not stat.S_ISREG(state.st_mode):
            raise ValueError("it is no regular file but a device or a pipe: copy its content to a file")
        self.size = state.st_size
        self.zipped = zipped
        self.limit = FACTOR * self.size + BASE
        self._free = memory.available()
        self._file: Any = gzip.open(path, "rb") if zipped else open(path, "rb")  # noqa: SIM115

    def __enter__(self) -> Source:
        return self

    def __exit__(self, *_: Any) -> None:
        self._file.close()

    def allow(self, count: int, what: str) -> None:
        """Raises when `what` (said in the plural) takes so many bytes that they may not be held.

        Raises
        ------
        ValueError
            When it is more than a file of this size may take.
        NotEnoughMemory
            When it is more than is free.
        """
        if count > self.limit:
            remedy = (
                "unpack it first" if self.zipped else "it is damaged, or describes far more than it holds"
            )
            raise ValueError(
                f"{what} would take {amount(count)}; a file of {amount(self.size)} may take "
                f"{amount(self.limit)}: {remedy}"
            )
        if self._free is not None and count > self._free:
            raise NotEnoughMemory(
                f"{what} take {amount(count)}, {amount(self._free)} are free: close other programs"
            )

    def read(self, count: int) -> bytes:
        """The next bytes, fewer at the end of the file."""
        try:
            return self._file.read(count)
        except (zlib.error, EOFError, gzip.BadGzipFile) as error:
            raise ValueError(f"its gzip is damaged or cut short ({error}): copy or pack it again") from error

    def seek(self, place: int) -> None:
        """Goes to a place, counted from the beginning."""
        self._file.seek(place)

    def rest(self, ahead: bytes = b"") -> bytearray:
        """All that follows `ahead`, which was read before, with it, if it may be held."""
        whole = bytearray(ahead)
        while part := self.read(BLOCK):
            whole += part
            self.allow(len(whole), "its unpacked bytes" if self.zipped else "its bytes")
        return whole

    def blocks(self, ahead: bytes = b"", *, words: bool = False) -> Iterator[bytes]:
        """The text after `ahead`, which was read before, in blocks that end where a line or a word ends."""
        tail, held, unpacked = [], 0, 0
        block = ahead or self.read(BLOCK).removeprefix(codecs.BOM_UTF8)
        if b"\0" in block[:HEAD]:
            raise ValueError(
                "it should be text and has bytes of zero, as UTF-16 has: export it again, as UTF-8"
            )
        while block:
            unpacked += len(block)
            if self.zipped:
                # Nothing of what was read needs be held any more, but time has an end too.
                self.allow(unpacked, "its unpacked bytes")
            # A carriage return at the end may be half of a line's end.
            cut = max(block.rfind(b"\n"), block.rfind(b"\r", 0, len(block) - 1)) + 1
            if words:
                cut = max(cut, block.rfind(b" ") + 1, block.rfind(b"\t") + 1)
            if cut:
                tail.append(block[:cut])
                yield b"".join(tail)
                tail, held, block = [], 0, block[cut:]
            tail.append(block)
            held += len(block)
            # Once in parts, once joined.
            self.allow(2 * held, "its longest lines")
            block = self.read(BLOCK)
        yield b"".join(tail)

    def lines(self, ahead: bytes = b"") -> Iterator[tuple[int, bytes]]:
        """Number and content of each line that is not empty, whatever system's ends of lines it has."""
        number = 0
        for block in self.blocks(ahead):
            for line in block.splitlines():
                number += 1
                if line:
                    if len(line) > BLOCK:
                        self.allow(WORDS_FACTOR * len(line), "the words of its longest line")
                    yield number, line


def amount(count: int) -> str:
    """Bytes in words."""
    return f"{count / MEGABYTE:,.0f} MB" if count >= MEGABYTE else f"{count:,} bytes"


def about(words: str) -> str:
    """A reason in one line, cut where it is long."""
    line = " ".join(words.split())
    return line if len(line) <= SHOWN else line[:SHOWN] + "…"
