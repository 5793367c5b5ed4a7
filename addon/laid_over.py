# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's surface laid over the target, for the morph that stays in place."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import character, core, mesh_read, morph, stored_match
from .mesh_read import moved
from .mesh_write import read_attribute, read_places, write_attribute
from .morph import ALONG, CORNERS, FITTED, PIECE

Floats = NDArray[np.floating[Any]]


def refresh(targets: Sequence[bpy.types.Object]) -> None:
    """Have the morphs among these targets, which were matched together, show the map that they have now."""
    morphed = [target for target in targets if morph.modifier_of(target) is not None]
    if morphed:
        write(targets)
    for target in morphed:
        morph.add(target, sources_of(target))


def sources_of(target: bpy.types.Object) -> list[bpy.types.Object]:
    return [obj for obj, _, _ in stored_match.sources_of(target)]


def write(targets: Sequence[bpy.types.Object]) -> None:
    """Write what a morph reads for the meshes of a target: `FITTED` and `ALONG`, `PIECE` and `CORNERS`.

    The source's surface is laid over them by the similarity, without mirroring, that brings the images of
    their vertices nearest to these in the least squares sense: so it does not matter how the two objects are
    turned and scaled. Both are taken at rest: what is laid over is moved by the target's rig.
    """
    first, sources = np.array(targets[0].matrix_world), sources_of(targets[0])
    placed = [first @ matrix for matrix in character.placed(targets)]
    there = np.array(sources[0].matrix_world)
    own = [moved(mesh_read.positions(t.data), matrix) for t, matrix in zip(targets, placed, strict=True)]
    images = [moved(read_attribute(t.data.attributes["match_position"]), there) for t in targets]
    found, wanted = np.concatenate(images), np.concatenate(own)
    laid = moved(found, core.load().poses.similarity(found, wanted))
    low, high = wanted.min(axis=0), wanted.max(axis=0)
    axis = int((high - low).argmax())
    split = np.split(laid, np.cumsum([len(points) for points in own])[:-1])
    for target, matrix, points, over in zip(targets, placed, own, split, strict=True):
        local = moved(over, np.linalg.inv(matrix))
        write_attribute(target.data, FITTED, "FLOAT_VECTOR", "POINT", local)
        along = (points[:, axis] - low[axis]) / max(high[axis] - low[axis], np.finfo(np.float32).tiny)
        write_attribute(target.data, ALONG, "FLOAT", "POINT", along)
        _write_corners(target.data, sources)
        target.data.update()


def _write_corners(mesh: bpy.types.Mesh, sources: Sequence[bpy.types.Object]) -> None:
    """Where on the source as shown each vertex of a target belongs."""
    piece, faces, _, _ = read_places(mesh)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shown, corners = np.full(len(faces), -1), np.zeros((len(faces), 3), int)
    for number, source in enumerate(sources):
        here = piece == number
        if not here.any() or len(source.evaluated_get(depsgraph).data.vertices) != len(source.data.vertices):
            continue
        shown[here] = number
        corners[here] = mesh_read.triangle_vertices(source.data)[faces[here]]
    write_attribute(mesh, PIECE, "INT", "POINT", shown)
    for name, vertices in zip(CORNERS, corners.T, strict=True):
        write_attribute(mesh, name, "INT", "POINT", vertices)
