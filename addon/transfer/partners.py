# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones, vertex groups and shape keys that are each other's mirror image, by where they lie on the source."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..typed import Floats, Options
from . import companions, shape_keys
from .sides import Sides, flip_name
from .weights import read_weights, rigs

if TYPE_CHECKING:
    from .route import Route

# Two places are mirror images up to this share of the body's size, and a body is symmetric that MOST of it
# is its own image up to that.
SAME_PLACE, MOST = 0.02, 0.9
# Vertices by which a body is judged.
PROBES = 500


def sides(route: Route, options: Options) -> Sides:
    """How names of the source are written on the target."""
    if not options.mirror_names:
        return Sides()
    places = _places(route)
    known = {name for obj in _named(route) for name in _names(obj)}
    by_place = _mirrored(places, route.source_points)
    partners = {
        name: other
        for name, other in by_place.items()
        if flip_name(name, known) == name and flip_name(other, known) == other
    }
    return Sides(True, frozenset(known), partners)


def _named(route: Route) -> list[bpy.types.Object]:
    """The objects whose names count: both bodies, their rigs, and what hangs on the source."""
    bodies = [route.source, route.target]
    return bodies + [rig for body in bodies for rig in rigs(body)] + companions.hanging(route.source)


def _names(obj: bpy.types.Object) -> list[str]:
    keys = getattr(obj.data, "shape_keys", None)
    lists = [
        obj.vertex_groups,
        keys.key_blocks if keys else (),
        obj.data.bones if obj.type == "ARMATURE" else (),
    ]
    return [item.name for items in lists for item in items]


def _places(route: Route) -> dict[str, Floats]:
    """Two points for each name, (2, 3), in the source's coordinates.

    The ends of a bone; of a group the middle of what it moves, and of a key that and where it moves to.
    """
    source, points = route.source, route.source_points
    places: dict[str, Floats] = {}
    for rig in rigs(source):
        to_source = np.array(source.matrix_world.inverted_safe() @ rig.matrix_world)
        for bone in rig.data.bones:
            ends = np.array([bone.head_local, bone.tail_local])
            places.setdefault(bone.name, ends @ to_source[:3, :3].T + to_source[:3, 3])
    vertex, group, weight = read_weights(route.body)
    for held in source.vertex_groups:
        here = group == held.index
        total = weight[here].sum()
        if total > 0.0:
            middle = weight[here] @ points[vertex[here]] / total
            places.setdefault(held.name, np.array([middle, middle]))
    for name in shape_keys.names(source):
        block = source.data.shape_keys.key_blocks[name]
        here, there = (route.shown_places(shape_keys.read_key(each)) for each in (block.relative_key, block))
        moved = there - here
        length = np.linalg.norm(moved, axis=1)
        if length.sum() > 0.0:
            middle = length @ points / length.sum()
            places.setdefault(name, np.array([middle, middle + length @ moved / length.sum()]))
    return places


def _mirrored(places: Mapping[str, Floats], points: Floats) -> dict[str, str]:
    """For each name that of its mirror image across the plane of symmetry, {} for a body without one."""
    names, at = list(places), np.array(list(places.values()))
    low, high = points.min(axis=0), points.max(axis=0)
    reach = SAME_PLACE * np.linalg.norm(high - low)
    mirrors = dict.fromkeys(
        (axis, middle) for axis in range(3) for middle in (0.0, (low[axis] + high[axis]) / 2.0)
    )
    off = {mirror: _asymmetry(points, *mirror) for mirror in mirrors} if names else {}
    mirror = min(off, key=off.__getitem__, default=None)
    if mirror is None or off[mirror] > reach:
        return {}
    # What lies in the mirror is its own image.
    apart = np.array([np.linalg.norm(at - each, axis=2).max(axis=1) for each in _image(at, *mirror)])
    nearest = apart.argmin(axis=1)
    own = np.arange(len(names))
    found = (nearest != own) & (nearest[nearest] == own) & (apart[own, nearest] < reach)
    return {names[k]: names[nearest[k]] for k in own[found]}


def _image(points: Floats, axis: int, middle: float) -> Floats:
    image = points.copy()
    image[..., axis] = 2.0 * middle - image[..., axis]
    return image


def _asymmetry(points: Floats, axis: int, middle: float) -> float:
    """How far most of the body's vertices lie from its mirror image."""
    tree = KDTree(len(points))
    for number, point in enumerate(points.tolist()):
        tree.insert(point, number)
    tree.balance()
    chosen = points[:: max(1, len(points) // PROBES)]
    away = [tree.find(image)[2] for image in _image(chosen, axis, middle).tolist()]
    return float(np.quantile(away, MOST))
