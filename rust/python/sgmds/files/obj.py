"""Wavefront OBJ: positions and faces; everything else of the file is left out."""

from __future__ import annotations

from array import array

import numpy as np

from .polygons import triangulated
from .source import WORDS_FACTOR, Source

LINES = 10_000
"""Between two looks at what is held."""
PART_BYTES = 50
"""What a part of a line takes beside its letters."""
NAME_BYTES = 200
"""What a name takes beside the others: a tuple, a string, a number."""


def read(source: Source) -> tuple[np.ndarray, np.ndarray, list[tuple[str, int]]]:
    """Vertices, triangles, and each object's name with the number of its first triangle."""
    positions, corners, sizes = array("d"), array("q"), array("q")
    names = [("", 0)]
    unfinished: list[bytes] = []
    letters = 0
    for count, (number, line) in enumerate(source.lines()):
        if count % LINES == 0:
            held = 8 * (len(positions) + len(corners) + len(sizes)) + NAME_BYTES * len(names)
            source.allow(held, "its vertices and faces")
        if line.endswith(b"\\"):
            unfinished.append(line[:-1])
            letters += len(line)
            source.allow(PART_BYTES * len(unfinished) + WORDS_FACTOR * letters, "its longest lines")
            continue
        if unfinished:
            line = b" ".join((*unfinished, line))
            unfinished, letters = [], 0
        words = line.split(b"#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] == b"v":
                positions.extend((float(words[1]), float(words[2]), float(words[3])))
            elif words[0] == b"f":
                ids = [int(word.split(b"/", 1)[0]) for word in words[1:]]
                if 0 in ids:
                    raise ValueError("vertices are counted from 1")
                if len(ids) < 3:
                    raise ValueError("a face has three corners or more")
                # Negative ids count back from the last vertex so far.
                known = len(positions) // 3
                corners.extend([i - 1 if i > 0 else known + i for i in ids])
                sizes.append(len(ids))
            elif words[0] == b"o":
                first = len(corners) - 2 * len(sizes)
                if names[-1][1] == first:
                    names.pop()
                names.append((b" ".join(words[1:]).decode(errors="replace"), first))
        except OverflowError as error:
            raise ValueError(f"line {number} is not understood: a number of a vertex is too large") from error
        except (ValueError, IndexError) as error:
            raise ValueError(f"line {number} is not understood: {error}") from error
    vertices = np.frombuffer(positions).reshape(-1, 3)
    return vertices, triangulated(source, vertices, np.frombuffer(corners, np.int64), sizes), names
