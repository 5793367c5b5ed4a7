# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's surface laid over the target, for the morph that stays in place."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import mesh_read
from .mesh_write import read_attribute, write_attribute
from .morph import ALONG, FITTED
from .similarity import moved, similarity

Floats = NDArray[np.floating[Any]]


def refresh(targets: Sequence[bpy.types.Object]) -> None:
    """Have the morphs among these targets, which were matched together, show the map that they have now."""
    if any(FITTED in target.data.attributes for target in targets):
        write(targets)


def write(targets: Sequence[bpy.types.Object]) -> None:
    """Write `FITTED` and `ALONG` for the meshes of a target.

    The source's surface is laid over them by the similarity, without mirroring, that brings the images of
    their vertices nearest to these in the least squares sense: so it does not matter how the two objects are
    turned and scaled.
    """
    placed = [np.array(target.matrix_world) for target in targets]
    there = np.array(targets[0].spectral_match_source.matrix_world)
    own = [moved(mesh_read.positions(t.data), matrix) for t, matrix in zip(targets, placed, strict=True)]
    images = [moved(read_attribute(t.data.attributes["match_position"]), there) for t in targets]
    found, wanted = np.concatenate(images), np.concatenate(own)
    fitting = similarity(found, wanted)
    laid = found - found.mean(axis=0) + wanted.mean(axis=0) if fitting is None else moved(found, fitting)
    low, high = wanted.min(axis=0), wanted.max(axis=0)
    axis = int((high - low).argmax())
    split = np.split(laid, np.cumsum([len(points) for points in own])[:-1])
    for target, matrix, points, over in zip(targets, placed, own, split, strict=True):
        local = moved(over, np.linalg.inv(matrix))
        write_attribute(target.data, FITTED, "FLOAT_VECTOR", "POINT", local)
        along = (points[:, axis] - low[axis]) / max(high[axis] - low[axis], np.finfo(np.float32).tiny)
        write_attribute(target.data, ALONG, "FLOAT", "POINT", along)
        target.data.update()
