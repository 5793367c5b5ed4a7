# SPDX-License-Identifier: GPL-3.0-or-later
"""What came from the source looks at the target: drivers, constraints and modifiers of the copies."""

import re

import bpy

from . import armatures, companions
from .sides import flip_name

# A bone or shape key in a data path.
NAMED = re.compile(r'((?:bones|key_blocks)\[")((?:[^"\\]|\\.)*)("\])')


def redirect(route, options):
    """Exchange the source, its mesh, keys, rigs and companions for the target's, where copies name them."""
    target = route.target
    exchanged = _with_data(route.source, target)
    rigs, copies = [], []
    for rig in armatures.rigs(route.source):
        own = armatures.fitted_rig(target, rig)
        if own is not None:
            rigs.append(own)
            exchanged |= _with_data(rig, own)
    for companion in companions.hanging(route.source):
        own = companions.copy_of(target, companion)
        if own is not None:
            copies.append(own)
            exchanged |= _with_data(companion, own)
    keys = target.data.shape_keys
    for held in [keys] if keys else []:
        _drivers(held, exchanged, options)
    for obj in rigs + copies:
        for held in (obj, obj.data, getattr(obj.data, "shape_keys", None)):
            if held is not None:
                _drivers(held, exchanged, options)
        for modifier in obj.modifiers:
            point(modifier, exchanged)
        for bone in obj.pose.bones if obj.pose else []:
            for constraint in bone.constraints:
                point(constraint, exchanged)


def _with_data(before, after):
    """An object, its data and its shape keys → the other's."""
    exchanged = {before: after, before.data: after.data}
    keys, own = (getattr(obj.data, "shape_keys", None) for obj in (before, after))
    if keys is not None and own is not None:
        exchanged[keys] = own
    return exchanged


def _drivers(held, exchanged, options):
    for curve in held.animation_data.drivers if held.animation_data else []:
        for variable in curve.driver.variables:
            for seen in variable.targets:
                if seen.id not in exchanged:
                    continue
                seen.id = exchanged[seen.id]
                if options.mirror_names:
                    seen.bone_target = flip_name(seen.bone_target)
                    seen.data_path = NAMED.sub(_flipped, seen.data_path)


def _flipped(found):
    begin, name, end = found.groups()
    return begin + flip_name(name) + end


def point(holder, exchanged):
    """Exchange what a modifier or constraint points to."""
    for item in [holder, *getattr(holder, "targets", ())]:
        for prop in item.bl_rna.properties:
            if prop.type == "POINTER" and not prop.is_readonly:
                value = getattr(item, prop.identifier)
                if isinstance(value, bpy.types.ID) and value in exchanged:
                    setattr(item, prop.identifier, exchanged[value])
    if getattr(holder, "type", "") == "NODES":
        for name, value in holder.items():
            if isinstance(value, bpy.types.ID) and value in exchanged:
                holder[name] = exchanged[value]
