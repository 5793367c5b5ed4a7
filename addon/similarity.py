# SPDX-License-Identifier: GPL-3.0-or-later
"""Similarities of points in space, as matrices (4, 4)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]


def moved(points: Floats, matrix: Floats) -> Floats:
    """Points (n, 3) under a matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def similarity(points: Floats, aims: Floats, weights: Floats | None = None) -> Floats:
    """The turn, scale and shift that bring points (n, 3) nearest to aims (n, 3) by least squares.

    Points count by weights (n,), alike where these are all zero; a shift alone is left where points or aims
    are all at one place (Umeyama, IEEE PAMI 13, 1991).
    """
    counted = np.ones(len(points)) if weights is None or not weights.any() else weights
    share = counted / counted.sum()
    from_mean, to_mean = share @ points, share @ aims
    centred, aimed = points - from_mean, aims - to_mean
    left, stretch, right = np.linalg.svd((aimed * share[:, None]).T @ centred)
    spread = share @ np.square(centred).sum(axis=1)
    made = np.eye(4)
    if stretch.sum() > np.finfo(float).eps * spread:
        side = np.sign(np.linalg.det(left @ right))
        signs = np.array([1.0, 1.0, side])
        made[:3, :3] = (stretch * signs).sum() / spread * (left * signs) @ right
    made[:3, 3] = to_mean - made[:3, :3] @ from_mean
    return made
