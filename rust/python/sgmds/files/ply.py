"""PLY, as text and binary: positions, faces and triangle strips; everything else is passed over."""

from __future__ import annotations

import codecs
import re
import struct
from array import array
from dataclasses import dataclass, field

import numpy as np

from .polygons import triangulated
from .source import BLOCK, Source

_KINDS = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"},
    **{"float": "f", "double": "d", "float32": "f", "float64": "d"},
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_IDS = ("vertex_indices", "vertex_index")
"""What the list of corners is called."""
ROWS = 2**16
"""Rows of an element, or corners, that are looked at together."""
_RESTART = -1
"""Begins another strip within a list."""


@dataclass
class _Property:
    name: str
    kind: str
    """Of its numbers, in the letters of `struct`."""
    length_kind: str = ""
    """Of a list's length; empty for a single number."""


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read(source: Source) -> tuple[np.ndarray, np.ndarray, list[tuple[str, int]]]:
    """Vertices, triangles, and the one piece without a name."""
    order, elements, ahead = _header(source)
    body: memoryview
    if order == "=":
        # The numbers of a text are read as if they were binary ones.
        numbers = array("d")
        for block in source.blocks(ahead, words=True):
            numbers.extend(map(float, block.split()))
            source.allow(8 * len(numbers), "its numbers")
        body = memoryview(numbers).cast("B")
        for element in elements:
            for entry in element.properties:
                entry.kind, entry.length_kind = "d", "d" if entry.length_kind else ""
    else:
        body = memoryview(source.rest(ahead))
    reader = _Reader(source, body, order)
    vertices, faces, strips = np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros((0, 3), np.int64)
    corners = sizes = np.zeros(0, np.int64)
    for element in elements:
        if not element.count or not element.properties:
            continue
        if element.name == "vertex":
            vertices = reader.columns(element, "xyz")
        elif element.name == "face":
            corners, sizes = reader.lists(element, _IDS)
        elif element.name == "tristrips":
            strips = _strips(source, *reader.lists(element, _IDS))
        else:
            reader.skip(element)
    source.allow(len(body) + vertices.nbytes + 3 * corners.nbytes + strips.nbytes, "its vertices and faces")
    if len(sizes) and sizes.min() < 3:
        # A face of two corners is an edge.
        corners, sizes = corners[np.repeat(sizes >= 3, sizes)], sizes[sizes >= 3]
    faces = triangulated(source, vertices, corners, sizes)
    return vertices, np.concatenate([faces, strips]) if len(strips) else faces, [("", 0)]


def _strips(source: Source, ids: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Triangles of strips: of each three corners that follow one another, every second turned round.

    A list may hold several strips, with −1 between them. Triangles with a corner twice, which only lead from
    one strip to the next, are left out.
    """
    # Corners, strips and places, and the triangles twice.
    source.allow(80 * len(ids), "its triangle strips")
    begins = np.zeros(len(ids), dtype=bool)
    begins[(np.cumsum(lengths) - lengths)[lengths > 0]] = True
    begins[1:] |= ids[:-1] == _RESTART
    place = np.arange(len(ids))
    start = np.maximum.accumulate(np.where(begins, place, 0))
    triangles = (
        np.stack([ids[:-2], ids[1:-1], ids[2:]], axis=1) if len(ids) > 2 else np.zeros((0, 3), np.int64)
    )
    odd = (place - start)[: len(triangles)] % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    a, b, c = triangles.T
    whole = (start[: len(triangles)] == start[2:]) & (triangles != _RESTART).all(axis=1)
    return triangles[whole & (a != b) & (b != c) & (c != a)]


def _header(source: Source) -> tuple[str, list[_Element], bytes]:
    """Byte order ("=" for text), elements, and what was read of the body."""
    head = source.read(BLOCK).removeprefix(codecs.BOM_UTF8)
    header = re.match(rb"ply\s(.*?)\send_header[ \t]*(\r\n|\n|\r)", head, re.DOTALL)
    if not header:
        if head.startswith(b"ply") and len(head) > BLOCK - 4:
            raise ValueError(f"its header does not end within {BLOCK:,} bytes")
        raise ValueError("it has no whole header of a PLY file")
    order = ""
    elements: list[_Element] = []
    for line in header[1].decode("latin-1").splitlines():
        match line.split():
            case ["format", name, _]:
                if name not in _ORDERS:
                    raise ValueError(f"its format is {name!r}; known are {', '.join(_ORDERS)}")
                order = _ORDERS[name]
            case ["element", name, count]:
                if any(element.name == name for element in elements):
                    raise ValueError(f"its header has element {name} twice; it is damaged")
                elements.append(_Element(name, int(count)))
                if elements[-1].count < 0:
                    raise ValueError(f"its header announces {count} of element {name}; it is damaged")
            case ["property", *words]:
                if not elements:
                    raise ValueError("its header has a property before any element; it is damaged")
                if wrong := [word for word in words[:-1] if word not in _KINDS and word != "list"]:
                    raise ValueError(f"its header has a property of kind {wrong[0]!r}; it is damaged")
                match words:
                    case ["list", length, kind, name]:
                        elements[-1].properties.append(_Property(name, _KINDS[kind], _KINDS[length]))
                    case [kind, name]:
                        elements[-1].properties.append(_Property(name, _KINDS[kind]))
    if not order:
        raise ValueError("its header does not say its format; it is damaged")
    return order, elements, head[header.end() :]


class _Reader:
    """Reads the elements of a body one after the other."""

    def __init__(self, source: Source, body: memoryview, order: str):
        self._source, self._body, self._order = source, body, order
        self._place = 0

    def columns(self, element: _Element, names: str) -> np.ndarray:
        """The numbers of these properties (rows, names) of an element without lists."""
        if any(entry.length_kind for entry in element.properties):
            raise ValueError(f"its element {element.name} has lists, which is not known")
        kinds = {}
        size = 0
        for entry in element.properties:
            kinds[entry.name] = np.dtype(self._order + entry.kind), size
            size += kinds[entry.name][0].itemsize
        if missing := [name for name in names if name not in kinds]:
            raise ValueError(f"its element {element.name} has no property {missing[0]!r}")
        self._check_whole(element, size)
        self._source.allow(len(self._body) + 8 * len(names) * element.count, "its vertices")
        values = np.empty((element.count, len(names)))
        for k, name in enumerate(names):
            kind, offset = kinds[name]
            form = np.dtype({"names": ["v"], "formats": [kind], "offsets": [offset], "itemsize": size})
            values[:, k] = np.frombuffer(self._body, form, element.count, self._place)["v"]
        self._place += size * element.count
        return values

    def skip(self, element: _Element) -> None:
        """Goes on behind an element."""
        if any(entry.length_kind for entry in element.properties):
            self.lists(element, ())
        else:
            size = self._size(element.properties)
            self._check_whole(element, size)
            self._place += size * element.count

    def lists(self, element: _Element, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """The whole numbers of the list of one of these names, row after row, and how many each row has.

        Both are empty without names.
        """
        wanted = next((e for e in element.properties if e.name in names and e.length_kind), None)
        if names and wanted is None:
            raise ValueError(f"its element {element.name} has no list {names[0]!r}")
        ids, sizes = array("q"), array("q")
        row = 0
        while row < element.count:
            row, places, lengths = self._walk(element, row, wanted)
            if wanted is not None:
                sizes.extend(lengths)
                self._gather(ids, np.array(places), np.array(lengths), wanted.kind)
            held = len(self._body) + 8 * (len(ids) + len(sizes))
            self._source.allow(held, f"its element {element.name}")
        return np.frombuffer(ids, np.int64), np.frombuffer(sizes, np.int64)

    def _walk(
        self, element: _Element, row: int, wanted: _Property | None
    ) -> tuple[int, list[int], list[int]]:
        """Goes through rows from `row` until there are many, or many numbers in the wanted list.

        Returns the row that comes then, and of each row where in the body that list begins and how many
        numbers it has.
        """
        # Of each list: bytes before it, how its length is read, bytes of that and of each of its numbers.
        steps: list[tuple[int, struct.Struct, int, int, bool]] = []
        before: list[_Property] = []
        for entry in element.properties:
            if entry.length_kind:
                form = struct.Struct(self._order + entry.length_kind)
                width = struct.calcsize(self._order + entry.kind)
                steps.append((self._size(before), form, form.size, width, entry is wanted))
                before = []
            else:
                before.append(entry)
        behind = self._size(before)
        places, lengths, total = [], [], 0
        body, place, end = self._body, self._place, len(self._body)
        first = row
        for row in range(first, min(first + ROWS, element.count)):
            for skipped, form, length_size, width, is_wanted in steps:
                place += skipped
                if place + length_size > end:
                    raise _cut_short(element, row)
                value = form.unpack_from(body, place)[0]
                # A number that is none compares false.
                if not value >= 0:
                    raise ValueError(f"row {row} of its element {element.name} has a list of {value}")
                length = int(value)
                place += length_size
                if is_wanted:
                    places.append(place)
                    lengths.append(length)
                    total += length
                place += length * width
            place += behind
            if place > end:
                raise _cut_short(element, row)
            if total > ROWS:
                break
        self._place = place
        return row + 1, places, lengths

    def _gather(self, ids: array, places: np.ndarray, lengths: np.ndarray, kind: str) -> None:
        """Adds the numbers of lists that begin at these places of the body."""
        form = np.dtype(self._order + kind)
        for first, last in ((0, len(places) - 1), (len(places) - 1, len(places))):
            # The last list may be long by itself.
            own = lengths[first:last]
            count = int(own.sum())
            if last == first + 1:
                found = np.frombuffer(self._body, form, count, int(places[first])) if count else ()
            else:
                shift = places[first:last] - form.itemsize * (np.cumsum(own) - own)
                at = np.repeat(shift, own) + form.itemsize * np.arange(count)
                data = np.frombuffer(self._body, np.uint8)
                found = data[at[:, None] + np.arange(form.itemsize)].reshape(-1).view(form)
            for start in range(0, count, ROWS):
                with np.errstate(invalid="ignore"):
                    ids.frombytes(np.asarray(found[start : start + ROWS]).astype(np.int64).tobytes())

    def _size(self, properties: list[_Property]) -> int:
        return sum(struct.calcsize(self._order + entry.kind) for entry in properties)

    def _check_whole(self, element: _Element, size: int) -> None:
        there = (len(self._body) - self._place) // size
        if there < element.count:
            raise _cut_short(element, there)


def _cut_short(element: _Element, found: int) -> ValueError:
    return ValueError(
        f"its header announces {element.count} of element {element.name}, {found} are there; "
        "it may be cut short"
    )
