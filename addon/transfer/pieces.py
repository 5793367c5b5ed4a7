# SPDX-License-Identifier: GPL-3.0-or-later
"""What of an object is rigid while it follows the target's surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..typed import Flags, Floats, Integers

if TYPE_CHECKING:
    from .route import Route

# A connected piece smaller than this share of the source's size is rigid: an eye stays round.
RIGID_SHARE = 0.1


def is_small(route: Route, extents: Floats) -> Flags | np.bool_:
    """Whether pieces of these extents (..., 3), in the source's stretched coordinates, are rigid."""
    size = np.linalg.norm(np.ptp(route.source_points @ route.source_stretch, axis=0))
    return np.linalg.norm(extents, axis=-1) < RIGID_SHARE * size


def pieces(route: Route, points: Floats, edges: Integers) -> Integers:
    """A number for each small piece of points that edges connect; −1 for points of large ones."""
    piece = np.arange(len(points))
    while True:
        lowest = piece[edges].min(axis=1)
        lower = piece.copy()
        for k in range(2):
            np.minimum.at(lower, edges[:, k], lowest)
        lower = lower[lower]
        if np.array_equal(lower, piece):
            break
        piece = lower
    low, high = np.full((len(points), 3), np.inf), np.full((len(points), 3), -np.inf)
    np.minimum.at(low, piece, points)
    np.maximum.at(high, piece, points)
    return np.where(is_small(route, high[piece] - low[piece]), piece, -1)
