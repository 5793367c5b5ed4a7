"""Polygons of a file cut into triangles."""

from __future__ import annotations

from array import array

import numpy as np

from .. import _core
from .source import Source


def triangulated(
    source: Source, vertices: np.ndarray, corners: np.ndarray, sizes: array | np.ndarray
) -> np.ndarray:
    """Triangles (m, 3) of polygons, in their order: fans where the polygon is convex, else ears are cut.

    Parameters
    ----------
    source : Source
        The file that they are of, which says how much may be held.
    vertices : (n, 3) float64
    corners : (c,) int64
        Vertices of the polygons' corners, one polygon after the other. One that is out of range makes a
        polygon a fan; the caller reports it.
    sizes : (p,) int64
        Corners of each polygon, three or more.
    """
    sizes = np.frombuffer(sizes, np.int64) if isinstance(sizes, array) else sizes
    if not len(sizes) or (sizes.min() == 3 and sizes.max() == 3):
        return corners.reshape(-1, 3)
    held = vertices.nbytes + corners.nbytes + sizes.nbytes
    # Where ears are cut, some ten numbers for each corner of one polygon.
    held += 24 * (len(corners) - 2 * len(sizes)) + 80 * int(sizes.max())
    source.allow(held, "its faces cut into triangles")
    return _core.triangulate(vertices, corners, sizes)
