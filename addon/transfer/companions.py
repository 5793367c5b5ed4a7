# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, teeth, clothes and hair that are objects of their own: copies that follow the target's surface."""

import bpy
import numpy as np
from mathutils import Matrix

from .. import mesh_read
from .armatures import MADE_FROM
from .armatures import names as rigs_of
from .kind import Kind, Prepared
from .shape_keys import read_key

# A connected piece smaller than this share of the source's size is rigid: an eye stays round.
RIGID_SHARE = 0.1


def names(source):
    """Meshes that hang on the source or on its rig."""
    rigs = set(rigs_of(source))
    return [
        obj.name
        for obj in bpy.data.objects
        if obj.type == "MESH" and obj != source and obj.users_scene and _belongs(obj, source, rigs)
    ]


def _belongs(obj, source, rigs):
    if MADE_FROM in obj or obj.spectral_match_source is not None:
        return False
    return obj.parent == source or bool(rigs.intersection(rigs_of(obj)))


def prepare(route, wanted, _options):
    moved = [(bpy.data.objects[name], _moved(route, bpy.data.objects[name])) for name in wanted]

    def write():
        for companion, places in moved:
            _write(route, companion, places)

    return Prepared(write)


def _moved(route, companion):
    """Coordinates of the companion's vertices, and of each of its shape keys, in the target's space."""
    to_source = np.array(route.source.matrix_world.inverted_safe() @ companion.matrix_world)

    def placed(points):
        return points.astype(np.float64) @ to_source[:3, :3].T + to_source[:3, 3]

    points = placed(mesh_read.positions(companion.data))
    pieces = _pieces(route, companion, points)
    keys = companion.data.shape_keys
    return route.map.followed(points, pieces), {
        block.name: route.map.followed(placed(read_key(block)), pieces)
        for block in (keys.key_blocks if keys else ())
    }


def _pieces(route, companion, points):
    """A number for each small connected piece; −1 for vertices of large ones."""
    piece = np.arange(len(points))
    edges = mesh_read.edges(companion.data)
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
    size = np.linalg.norm(np.ptp(route.source_points, axis=0))
    small = np.linalg.norm(high[piece] - low[piece], axis=1) < RIGID_SHARE * size
    return np.where(small, piece, -1)


def _write(route, companion, moved):
    target = route.target
    own = next(
        (obj for obj in target.children if obj.get(MADE_FROM) == companion.name and obj.type == "MESH"), None
    )
    if own is None:
        own = companion.copy()
        own.data = companion.data.copy()
        own.name = own.data.name = f"{companion.name} {target.name}"
        own[MADE_FROM] = companion.name
        for collection in target.users_collection:
            collection.objects.link(own)
        own.parent, own.parent_type = target, "OBJECT"
        own.matrix_parent_inverse = Matrix.Identity(4)
        own.matrix_basis = Matrix.Identity(4)
        rig = target.find_armature()
        for modifier in own.modifiers:
            if modifier.type == "ARMATURE" and rig is not None:
                modifier.object = rig
    points, keys = moved
    for name, coordinates in keys.items():
        block = own.data.shape_keys.key_blocks[name]
        block.data.foreach_set("co", coordinates.astype(np.float32).ravel())
    own.data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    own.data.update()


KIND = Kind(
    "objects",
    "Other Objects",
    "OUTLINER_OB_MESH",
    "Copy eyes, teeth, clothes and hair that are objects of their own, fitted to the target",
    names,
    prepare,
    default=False,
)
