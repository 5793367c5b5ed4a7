"""STL, as text and binary, whose equal corners are joined to vertices."""

from __future__ import annotations

from array import array

import numpy as np

from .source import BLOCK, Source

_HEAD = 84
"""Bytes before the triangles of a binary file: a remark, and how many there are."""
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LINES = 10_000
"""Between two looks at what is held."""
_JOINING = 200
"""Bytes a triangle that are held while its corners are joined: their numbers, order, places and ids."""


def read(source: Source) -> tuple[np.ndarray, np.ndarray, list[tuple[str, int]]]:
    """Vertices in order of first appearance, triangles, and the one piece without a name."""
    head = source.read(_HEAD)
    announced = int.from_bytes(head[80:], "little") if len(head) == _HEAD else 0
    # Some binary files begin with the word of the text, but no text has a zero or just this size.
    is_binary = b"\0" in head or source.size == _HEAD + 50 * announced
    is_text = head.lstrip()[:5].lower() == b"solid" and not is_binary
    corners = _text(source, head) if is_text else _binary(source, head, announced)
    source.allow(_JOINING * (len(corners) // 3), "its triangles")
    vertices, ids = _joined(corners)
    return vertices, ids.reshape(-1, 3), [("", 0)]


def _binary(source: Source, head: bytes, announced: int) -> np.ndarray:
    found = (source.size - _HEAD) // _TRIANGLE.itemsize
    if len(head) < _HEAD or found < announced:
        raise ValueError(
            f"its header announces {announced} triangles, {max(found, 0)} are there; it may be cut short"
        )
    source.allow(_JOINING * announced, "its triangles")
    corners = np.empty((announced, 3, 3), np.float32)
    step = BLOCK // _TRIANGLE.itemsize
    for first in range(0, announced, step):
        part = source.read(min(step, announced - first) * _TRIANGLE.itemsize)
        corners[first : first + step] = np.frombuffer(part, _TRIANGLE)["corners"]
    return corners.reshape(-1, 3)


def _text(source: Source, head: bytes) -> np.ndarray:
    positions = array("d")
    in_loop = 0
    is_ended = False
    for count, (number, line) in enumerate(source.lines(head + source.read(BLOCK))):
        if count % _LINES == 0:
            source.allow(8 * len(positions), "its triangles")
        match line.split(None, 4):
            case [word, x, y, z] if word.lower() == b"vertex":
                try:
                    positions.extend((float(x), float(y), float(z)))
                except ValueError as error:
                    raise ValueError(f"line {number} is not understood: {error}") from error
                in_loop += 1
            case [word, *_] if word.lower() == b"vertex":
                raise ValueError(f"line {number} is not understood: a vertex has three numbers")
            case [word, *_] if word.lower() == b"endloop":
                if in_loop != 3:
                    raise ValueError(f"line {number} ends a facet of {in_loop} corners; it should have 3")
                in_loop = 0
            case [word, *_]:
                is_ended = word.lower() == b"endsolid"
    if not is_ended:
        raise ValueError(
            f"it does not end with endsolid, after {len(positions) // 9} triangles; it may be cut short"
        )
    return np.frombuffer(positions).reshape(-1, 3)


def _joined(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners' different places in order of first appearance, and the number of each corner's place."""
    if not len(corners):
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    # Stable, so that of equal corners the first comes first.
    order = np.lexsort(corners.T[::-1])
    differs = np.ones(len(corners), dtype=bool)
    differs[1:] = False
    for axis in range(3):
        along = corners[order, axis]
        differs[1:] |= along[1:] != along[:-1]
    first = order[differs]
    rank = np.empty(len(first), np.int64)
    appearance = np.argsort(first)
    rank[appearance] = np.arange(len(first))
    ids = np.empty(len(corners), np.int64)
    ids[order] = rank[np.cumsum(differs) - 1]
    return corners[first[appearance]].astype(np.float64), ids
