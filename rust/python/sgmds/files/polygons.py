"""Polygons cut into triangles as they lie in space."""

from __future__ import annotations

import heapq
import itertools
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator

import numpy as np

from .source import Source

CORNERS = 2**16
"""Corners of polygons of one size that are worked on together: some megabytes."""
HOLLOW = 1e-9
"""A corner is hollow when it turns back by more than this share of the polygon's largest turn: rounding in
double precision stays below, and what is less hollow than that does not show."""
ROUNDS = 8
"""How often corners that were no ears are looked at again. A polygon that does not cross itself needs two or
three."""


def triangulated(source: Source, vertices: np.ndarray, corners: np.ndarray, sizes: array | np.ndarray):
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
    count = len(corners) - 2 * len(sizes)
    # What there is, the triangles, and of each polygon where it and they begin, and its rank by size.
    held = vertices.nbytes + corners.nbytes + sizes.nbytes
    source.allow(held + 24 * count + 32 * len(sizes), "its faces cut into triangles")
    starts = np.cumsum(sizes) - sizes
    first = starts - 2 * np.arange(len(sizes))
    triangles = np.zeros((count, 3), dtype=np.int64)
    for size, chosen in _alike(sizes):
        group = corners[starts[chosen][:, None] + np.arange(size)]
        for k in range(1, size - 1):
            triangles[first[chosen] + k - 1] = group[:, [0, k, k + 1]]
        known = (group.min(axis=1) >= 0) & (group.max(axis=1) < len(vertices))
        if size == 3 or not known.any():
            continue
        chosen, group = chosen[known], group[known]
        points = vertices[group]
        with np.errstate(all="ignore"):
            points = points - points.mean(axis=1, keepdims=True)
            edges = np.roll(points, -1, axis=1) - points
            turns = np.cross(edges, np.roll(edges, -1, axis=1))
            # Newell's normal: right for polygons that are hollow or not quite plane.
            normals = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
            along = np.einsum("pkc,pc->pk", turns, normals)
            hollow = along.min(axis=1) < -HOLLOW * np.abs(along).max(axis=1)
        for i in np.flatnonzero(hollow):
            ears = _ears(points[i], normals[i])
            triangles[first[chosen[i]] : first[chosen[i]] + size - 2] = group[i][ears]
    return triangles


def _alike(sizes: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Numbers of polygons of the same size, not too many together, with that size."""
    order = np.argsort(sizes, kind="stable")
    ends = [*(np.flatnonzero(np.diff(sizes[order])) + 1).tolist(), len(order)]
    for start, end in itertools.pairwise([0, *ends]):
        size = int(sizes[order[start]])
        step = max(CORNERS // size, 1)
        for place in range(start, end, step):
            yield size, order[place : min(place + step, end)]


def _ears(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Triangles (k − 2, 3) of a polygon of k corners, projected along its normal, by cutting ears off.

    The ear with the shortest cut goes first. Only hollow corners can lie in an ear (Meisters 1975), and they
    are looked up by their place, so that a polygon of 20,000 corners takes seconds. What is left without an
    ear, when a polygon crosses itself, becomes a fan.
    """
    axis = np.argmax(np.abs(normal))
    flat = np.delete(points, axis, axis=1) * (1, 1 if (normal[axis] > 0) == (axis != 1) else -1)
    count = len(flat)
    xs, ys = flat.T.tolist()
    before, after = [*range(-1, count - 1)], [*range(1, count), 0]
    before[0] = count - 1
    left = np.ones(count, dtype=bool)
    triangles: list[tuple[int, int, int]] = []
    hollow = _Hollow(flat)
    for corner in range(count):
        hollow.put(corner, _turn(xs, ys, before[corner], corner, after[corner]) <= 0)

    def length_of_cut(corner: int) -> float | None:
        """None for a corner that is no ear."""
        a, c = before[corner], after[corner]
        if _turn(xs, ys, a, corner, c) <= 0 or hollow.is_any_in(a, corner, c):
            return None
        return (xs[c] - xs[a]) ** 2 + (ys[c] - ys[a]) ** 2

    # Cuts by their length, with the ends that they had: a cut of other ends is of the past.
    waiting: list[tuple[float, int, int, int]] = []

    def judge(corner: int) -> None:
        hollow.put(corner, _turn(xs, ys, before[corner], corner, after[corner]) <= 0)
        cut = length_of_cut(corner)
        if cut is not None:
            heapq.heappush(waiting, (cut, corner, before[corner], after[corner]))

    for _ in range(ROUNDS):
        # Corners that were blocked may have come free.
        waiting.clear()
        rest = np.flatnonzero(left).tolist()
        for corner in rest:
            judge(corner)
        if len(rest) == 3 or not waiting:
            break
        while waiting and len(triangles) < count - 3:
            _, corner, a, c = heapq.heappop(waiting)
            if not left[corner] or (before[corner], after[corner]) != (a, c):
                continue
            triangles.append((a, corner, c))
            left[corner] = False
            hollow.drop(corner)
            after[a], before[c] = c, a
            judge(a)
            judge(c)
    rest = np.flatnonzero(left).tolist()
    triangles += [(rest[0], b, c) for b, c in itertools.pairwise(rest[1:])]
    return np.array(triangles)


def _turn(xs: list[float], ys: list[float], a: int, b: int, c: int) -> float:
    """Twice the area of a triangle, negative when it turns to the right."""
    return (xs[b] - xs[a]) * (ys[c] - ys[a]) - (ys[b] - ys[a]) * (xs[c] - xs[a])


class _Hollow:
    """The hollow corners of a polygon in the plane, by place: sorted along both axes."""

    def __init__(self, flat: np.ndarray):
        self._flat = flat
        self._is_hollow = np.zeros(len(flat), dtype=bool)
        self._left = np.ones(len(flat), dtype=bool)
        self._dropped = 0
        self._sort(np.arange(len(flat)))

    def put(self, corner: int, is_hollow: bool) -> None:
        self._is_hollow[corner] = is_hollow

    def drop(self, corner: int) -> None:
        """The corner was cut off."""
        self._is_hollow[corner] = self._left[corner] = False
        self._dropped += 1
        if 2 * self._dropped > len(self._orders[0]):
            self._dropped = 0
            self._sort(np.flatnonzero(self._left))

    def _sort(self, corners: np.ndarray) -> None:
        self._orders = [corners[np.argsort(self._flat[corners, k], kind="stable")] for k in (0, 1)]
        self._sorted = [self._flat[order, k].tolist() for k, order in enumerate(self._orders)]

    def is_any_in(self, a: int, b: int, c: int) -> bool:
        """Whether a hollow corner lies in a triangle or on its sides, and not at one of its corners."""
        triangle = self._flat[[a, b, c]]
        lows, highs = triangle.min(axis=0).tolist(), triangle.max(axis=0).tolist()
        spans = [
            (bisect_left(places, low), bisect_right(places, high))
            for places, low, high in zip(self._sorted, lows, highs, strict=True)
        ]
        along = min((0, 1), key=lambda k: spans[k][1] - spans[k][0])
        near = self._orders[along][slice(*spans[along])]
        near = near[self._is_hollow[near]]
        if not len(near):
            return False
        x, y = self._flat[near].T
        inside = np.ones(len(near), dtype=bool)
        for (px, py), (qx, qy) in itertools.pairwise([*triangle.tolist(), triangle[0].tolist()]):
            inside &= (qx - px) * (y - py) - (qy - py) * (x - px) >= 0
            # Doubles of the triangle's corners: a bridge to a hole passes its ends twice.
            inside &= (x != px) | (y != py)
        return bool(inside.any())
