# SPDX-License-Identifier: GPL-3.0-or-later
"""Similarities of points in space, as matrices (4, 4)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]


def moved(points: Floats, matrix: Floats) -> Floats:
    """Points (n, 3) under a matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def similarity(points: Floats, aims: Floats) -> Floats | None:
    """The rotation, scale and shift that bring points (n, 3) nearest to aims (n, 3) by least squares.

    None where either are all at one place (Umeyama, IEEE PAMI 13, 1991).
    """
    from_mean, to_mean = points.mean(axis=0), aims.mean(axis=0)
    centred, aimed = points - from_mean, aims - to_mean
    left, stretch, right = np.linalg.svd(aimed.T @ centred)
    spread = np.square(centred).sum()
    if spread == 0.0 or stretch.sum() == 0.0:
        return None
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    made = np.eye(4)
    made[:3, :3] = (stretch * signs).sum() / spread * (left * signs) @ right
    made[:3, 3] = to_mean - made[:3, :3] @ from_mean
    return made
