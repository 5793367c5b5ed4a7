"""OFF as text, with or without colours, normals and texture coordinates."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator

import numpy as np

from .polygons import triangulated
from .source import Source

ROWS = 10_000
"""Between two looks at what is held."""


def read(source: Source) -> tuple[np.ndarray, np.ndarray, list[tuple[str, int]]]:
    """Vertices, triangles, and the one piece without a name."""
    rows = _rows(source)
    header = next(rows, [b""])
    name = re.fullmatch(rb"(ST)?C?N?OFF", header[0])
    if not name or header[1:2] == [b"BINARY"]:
        raise ValueError('it should be text that begins with "OFF"')
    counts = header[1:] or next(rows, [])
    if len(counts) < 2:
        raise ValueError("it does not say how many vertices and faces it has; it may be cut short")
    count, announced = (int(word) for word in counts[:2])
    if count < 0 or announced < 0:
        raise ValueError(f"its header announces {count} vertices and {announced} faces; it is damaged")
    positions, corners, sizes = array("d"), array("q"), array("q")
    found, faces = 0, 0
    for row in rows:
        if found < count:
            if len(row) < 3:
                break
            positions.extend((float(row[0]), float(row[1]), float(row[2])))
            found += 1
        elif faces < announced:
            size = int(row[0])
            if not 0 <= size < len(row):
                break
            faces += 1
            if size >= 3:
                corners.extend([int(word) for word in row[1 : size + 1]])
                sizes.append(size)
        else:
            break
        if (found + faces) % ROWS == 0:
            source.allow(8 * (len(positions) + len(corners) + len(sizes)), "its vertices and faces")
    for what, wanted, whole in (("vertices", count, found), ("faces", announced, faces)):
        if whole < wanted:
            raise ValueError(f"its header announces {wanted} {what}, {whole} are there; it may be cut short")
    vertices = np.frombuffer(positions).reshape(-1, 3)
    return vertices, triangulated(source, vertices, np.frombuffer(corners, np.int64), sizes), [("", 0)]


def _rows(source: Source) -> Iterator[list[bytes]]:
    """The words of each line that has any, without remarks."""
    for _, line in source.lines():
        if words := line.split(b"#", 1)[0].split():
            yield words
