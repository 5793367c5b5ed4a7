# SPDX-License-Identifier: GPL-3.0-or-later
"""What came from the source looks at the target: drivers, constraints and modifiers of the copies."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy

from .. import mesh_read
from ..typed import Exchanged
from . import armatures, attachment, companions, shape_keys
from .weights import rigs

if TYPE_CHECKING:
    from ..outfit.bones import Names
    from .route import Route
    from .sides import Sides

# A bone or shape key in a data path.
NAMED = re.compile(r'((?:bones|key_blocks)\[")((?:[^"\\]|\\.)*)("\])')

# Properties that point to an object → those that name a bone or vertex group of it.
PARTS = {
    "target": "subtarget",
    "pole_target": "pole_subtarget",
    "space_object": "space_subtarget",
    "object": "subtarget",
    "object_from": "bone_from",
    "object_to": "bone_to",
}


def redirect(route: Route, routes: Sequence[Route]) -> Iterator[float]:
    """Exchange the source, its mesh, keys, rigs and companions for the target's, where copies name them.

    A generator that yields how far it is with the animation of rigs, which comes last. `routes` lead to all
    meshes of the target, each of which stands for what answers to it most.
    """
    target = route.target
    exchanged = _with_data(route.source, target)
    for way in (route, *reversed(routes)):
        for given in way.view.pieces if way is route else way.answering[:1]:
            exchanged |= _with_data(given, way.target)
    fitted, copies = [], []
    for rig in rigs(route.source):
        own = armatures.fitted_rig(target, rig)
        if own is not None:
            fitted.append((rig, own))
            exchanged |= _with_data(rig, own)
    for companion in companions.hanging(route.source):
        own = attachment.copy_of(target, companion)
        if own is not None:
            copies.append(own)
            exchanged |= _with_data(companion, own)
    carried = {route.sides.of(name) for name in shape_keys.names(route.source)}
    for way in routes:
        keys = way.target.data.shape_keys
        if keys is not None and keys.animation_data is not None:
            there = exchanged | _with_data(way.answering[0], way.target)
            point_drivers([c for c in keys.animation_data.drivers if _key(c) in carried], there, route.sides)
    for obj in [own for _, own in fitted] + copies:
        for held in (obj, obj.data, getattr(obj.data, "shape_keys", None)):
            if held is not None and held.animation_data is not None:
                point_drivers(held.animation_data.drivers, exchanged, route.sides)
        for modifier in obj.modifiers:
            point(modifier, exchanged, route.sides)
        if obj.type != "MESH":
            # The surface of hair, what a curve is bevelled with.
            point(obj.data, exchanged, route.sides)
        for bone in obj.pose.bones if obj.pose else []:
            for constraint in bone.constraints:
                point(constraint, exchanged, route.sides)
    # Copies that were just hung are in their places from here.
    bpy.context.view_layer.update()
    mesh_read.place(bpy.context, [own for _, own in fitted] + copies)
    for number, finish in enumerate(route.fitted):
        for share in finish():
            yield (number + share) / len(route.fitted)


def _with_data(before: bpy.types.Object, after: bpy.types.Object) -> Exchanged:
    """An object, its data and its shape keys → the other's."""
    exchanged = {before: after, before.data: after.data}
    keys, own = (getattr(obj.data, "shape_keys", None) for obj in (before, after))
    if keys is not None and own is not None:
        exchanged[keys] = own
    return exchanged


def _key(curve: bpy.types.FCurve) -> str | None:
    """Name of the shape key that a driver moves, or None."""
    found = NAMED.search(curve.data_path)
    return found and bpy.utils.unescape_identifier(found[2])


def point_drivers(curves: Iterable[bpy.types.FCurve], exchanged: Exchanged, sides: Sides | Names) -> None:
    """Exchange what drivers look at, and the side of bones and keys named there."""
    for curve in curves:
        for variable in curve.driver.variables:
            for seen in variable.targets:
                if seen.id not in exchanged:
                    continue
                seen.id = exchanged[seen.id]
                seen.bone_target = sides.of(seen.bone_target)
                seen.data_path = NAMED.sub(partial(_named, sides), seen.data_path)


def _named(sides: Sides | Names, found: re.Match[str]) -> str:
    begin, name, end = found.groups()
    name = sides.of(bpy.utils.unescape_identifier(name))
    return begin + bpy.utils.escape_identifier(name) + end


def point(holder: Any, exchanged: Exchanged, sides: Sides | Names) -> None:
    """Exchange what a modifier or constraint points to, and the side of a bone or group named in that."""
    for item in [holder, *getattr(holder, "targets", ())]:
        for prop in item.bl_rna.properties:
            if prop.type == "POINTER" and not prop.is_readonly:
                value = getattr(item, prop.identifier)
                if isinstance(value, bpy.types.ID) and value in exchanged:
                    setattr(item, prop.identifier, exchanged[value])
                    part = PARTS.get(prop.identifier)
                    if part is not None and hasattr(item, part):
                        setattr(item, part, sides.of(getattr(item, part)))
    if getattr(holder, "type", "") == "NODES":
        for name, value in holder.items():
            if isinstance(value, bpy.types.ID) and value in exchanged:
                holder[name] = exchanged[value]
