"""What is done: one line of JSON a pair, added as soon as it is known, read when a run is taken up."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ..cache import core_hash
from .manifest import Batch, Pair
from .work import Outcome

NAME = "journal.jsonl"
BEGINNING = b'{"source": '
"""By which the file is known."""


class Journal:
    """The journal of a batch in its output folder.

    A line counts only for the very files, options and core that it was made with: pairs whose files changed
    are open again, and a manifest may grow. Memory does not grow with the pairs: the places of their lines
    are in a temporary file.
    """

    def __init__(self, batch: Batch):
        self.path = batch.folder / NAME
        self._batch = batch
        self._places = _Places()
        self._common = repr((core_hash().hex(), sorted(batch.options.items())))
        self._index = {shape.name: i for i, shape in enumerate(batch.shapes)}
        self._file = open(self.path, "ab+")
        self._read()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # Closing writes what is left, for which a disk may have no room.
        try:
            self._file.close()
        finally:
            self._places.close()

    def _read(self):
        self._file.seek(0)
        place = 0
        for line in self._file:
            number = self._number(line)
            if number is not None:
                self._places[number] = place
            place += len(line)
        if place and not line.endswith(b"\n"):
            # The last run was stopped while it wrote; its torn line is done again.
            self._file.write(b"\n")

    def add(self, number: int, outcome: Outcome):
        pair = self._batch.pair(number)
        shapes = self._batch.shapes
        line = {
            "source": shapes[pair.source].name,
            "target": shapes[pair.target].name,
            "inputs": self._inputs(pair),
            **outcome.record,
            "effort": outcome.effort,
        }
        self._places[number] = self._file.seek(0, 2)
        self._file.write(json.dumps(line, ensure_ascii=False).encode() + b"\n")
        self._file.flush()

    def records(self) -> Iterator[tuple[int, dict | None]]:
        """Every pair's number and what is known of it, in the order of the numbers."""
        for number in range(len(self._batch)):
            yield number, self.record(number)

    def record(self, number: int) -> dict | None:
        place = self._places[number]
        if place is None:
            return None
        self._file.seek(place)
        return json.loads(self._file.readline())

    def open_pairs(self) -> Iterator[int]:
        """Pairs without a result whose map is where it belongs, in the order of work."""
        for number in self._batch.order():
            record = self.record(number)
            place = self._batch.pair(number).map
            lost = place is not None and not place.exists()
            if record is None or record["status"] != "done" or lost:
                yield number

    def _number(self, line: bytes) -> int | None:
        """The pair that a line is about; None when the batch does not ask for it or its inputs changed."""
        try:
            entry = json.loads(line)
            ends = self._index[entry["source"]], self._index[entry["target"]]
            number = self._batch.number(*ends)
            inputs = entry["inputs"]
        except (ValueError, KeyError, TypeError):
            return None
        if number is None or inputs != self._inputs(self._batch.pair(number)):
            return None
        return number

    def _inputs(self, pair: Pair) -> str:
        shapes = self._batch.shapes
        told = (self._common, shapes[pair.source].digest, shapes[pair.target].digest, pair.landmarks)
        return hashlib.blake2b(repr(told).encode(), digest_size=12).hexdigest()


class _Places:
    """Where the line of each pair begins: eight bytes a pair in a nameless file, the place plus one."""

    def __init__(self):
        self._file = tempfile.TemporaryFile()
        self.close = self._file.close

    def __setitem__(self, number: int, place: int):
        self._file.seek(8 * number)
        self._file.write((place + 1).to_bytes(8, "little"))

    def __getitem__(self, number: int) -> int | None:
        self._file.seek(8 * number)
        # A hole in the file reads as zeros, and nothing is behind its end.
        place = int.from_bytes(self._file.read(8), "little")
        return place - 1 if place else None


def exists(folder: Path) -> bool:
    """Whether anything is written down: of a run that found no scheduler there is an empty journal."""
    place = folder / NAME
    return place.exists() and place.stat().st_size > 0
