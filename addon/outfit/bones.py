# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that a garment brings along: added to the target's rig, with their constraints and drivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..transfer.armatures import SHORTEST_BONE, editing
from ..transfer.listed import listed
from ..transfer.redirect import point, point_drivers
from ..typed import Exchanged
from .reading import BROUGHT

if TYPE_CHECKING:
    from .fitting import Fitted

# What a bone keeps of the one that it is a copy of.
KEPT = ("use_deform", "inherit_scale", "use_inherit_rotation", "use_local_location")
POSED = ("rotation_mode", "lock_location", "lock_rotation", "lock_rotation_w", "lock_scale")


class Names:
    """The target's names for bones of the source, asked for as `Sides` are."""

    def __init__(self, table: Mapping[str, str]) -> None:
        self._table = table

    def of(self, name: str) -> str:
        return self._table.get(name, name)


def bring(
    fitted: Fitted, rig: bpy.types.Object, rigs_by_uid: Mapping[int, bpy.types.Object]
) -> tuple[list[str], list[str]]:
    """Add the new bones of a fitted outfit to a rig; returns their names there, and words.

    Where the rig cannot be edited, what they move follows the bones that they would hang on.
    """
    if not fitted.bones:
        return [], []
    wanted = [bone.name for bone in fitted.bones]
    if not (rig.is_editable and rig.data.is_editable) or rig.override_library or rig.data.override_library:
        names: list[str] = []
        for bone in fitted.bones:
            parent = names[bone.parent] if isinstance(bone.parent, int) else bone.parent
            names.append(parent or rig.data.bones[0].name)
        return names, [
            f"'{rig.name}' is linked or an override and takes no bones: what these move follows the bones "
            f"above them: {listed(wanted)}"
        ]
    ways = [Matrix(way.tolist()) for way in fitted.wish.to_world]
    into = rig.matrix_world.inverted_safe() @ ways[1]
    names = []
    with editing(rig):
        for bone in fitted.bones:
            given = rigs_by_uid[bone.rig_uid]
            move = into @ Matrix(np.vstack([bone.move, (0, 0, 0, 1)]).tolist()) @ ways[0].inverted_safe()
            move = move @ given.matrix_world
            model = given.data.bones[bone.name]
            made = rig.data.edit_bones.new(bone.name)
            made.head, made.tail = move @ model.head_local, move @ model.tail_local
            shortest = max(SHORTEST_BONE, 4.0 * float(np.finfo(np.float32).eps) * made.head.length)
            if made.length < shortest:
                made.tail = made.head + Vector((0.0, shortest, 0.0))
            made.align_roll(move.to_3x3() @ model.matrix_local.to_3x3().col[2])
            for setting in KEPT:
                setattr(made, setting, getattr(model, setting))
            grown = made.length / model.length if model.length > 0.0 else 1.0
            for radius in ("head_radius", "tail_radius", "envelope_distance"):
                setattr(made, radius, getattr(model, radius) * grown)
            parent = names[bone.parent] if isinstance(bone.parent, int) else bone.parent
            made.parent = rig.data.edit_bones.get(parent or "")
            names.append(made.name)
    for bone, name in zip(fitted.bones, names, strict=True):
        rig.data.bones[name][BROUGHT] = f"{bone.rig_name}\n{bone.name}"
    notes = [f"'{rig.name}' got bones that move the outfit: {listed(names)}"]
    left = _follow(fitted, rig, rigs_by_uid, names)
    if left:
        notes.append(
            f"'{rig.name}' lacks what these constraints and drivers need, so they were not copied: "
            f"{listed(left)}"
        )
    return names, notes


def _follow(
    fitted: Fitted, rig: bpy.types.Object, rigs_by_uid: Mapping[int, bpy.types.Object], names: Sequence[str]
) -> list[str]:
    """Give new bones the constraints and drivers of those that they are copies of; returns what was left."""
    table = dict(fitted.partners)
    table.update({bone.name: name for bone, name in zip(fitted.bones, names, strict=True)})
    exchanged: dict[bpy.types.ID, bpy.types.ID] = {}
    left = []
    for given in rigs_by_uid.values():
        exchanged |= {given: rig, given.data: rig.data}
    for bone, name in zip(fitted.bones, names, strict=True):
        given, own = rigs_by_uid[bone.rig_uid], rig.pose.bones[name]
        model = given.pose.bones[bone.name]
        for setting in POSED:
            setattr(own, setting, getattr(model, setting))
        for constraint in model.constraints:
            copy = own.constraints.copy(constraint)
            point(copy, exchanged, Names(table))
            if not _looks_at(copy, rig):
                left.append(f"{constraint.name} of {bone.name}")
                own.constraints.remove(copy)
        left += _copy_drivers(given, rig, bone.name, name, exchanged, Names(table))
    return left


def _looks_at(constraint: bpy.types.Constraint, rig: bpy.types.Object) -> bool:
    """Whether all that a constraint looks at is on this rig, or outside of any character's."""
    looks = list(constraint.targets) if hasattr(constraint, "targets") else [constraint]
    for look in looks:
        seen = getattr(look, "target", None)
        name = getattr(look, "subtarget", "")
        if seen is not None and seen.type == "ARMATURE" and seen != rig:
            return False
        if seen == rig and name and name not in rig.data.bones:
            return False
    return True


def _copy_drivers(
    given: bpy.types.Object,
    rig: bpy.types.Object,
    before: str,
    after: str,
    exchanged: Exchanged,
    names: Names,
) -> list[str]:
    """Copy the drivers of a bone; returns words on those whose variables do not find what they look at."""
    held, left = given.animation_data, []
    begin = f'pose.bones["{bpy.utils.escape_identifier(before)}"]'
    for curve in list(held.drivers) if held is not None else []:
        if not curve.data_path.startswith(begin):
            continue
        own = rig.animation_data or rig.animation_data_create()
        copy = own.drivers.from_existing(src_driver=curve)
        end = curve.data_path[len(begin) :]
        copy.data_path = f'pose.bones["{bpy.utils.escape_identifier(after)}"]{end}'
        point_drivers([copy], exchanged, names)
        if not finds_all(copy):
            own.drivers.remove(copy)
            left.append(f"driver of {before}{end}")
    return left


def finds_all(curve: bpy.types.FCurve) -> bool:
    """Whether the variables of a driver find the properties and bones that they look at."""
    for variable in curve.driver.variables:
        # A property of the scene is there whatever it is asked for.
        for seen in variable.targets if variable.type != "CONTEXT_PROP" else ():
            if seen.id is None:
                return False
            if variable.type == "SINGLE_PROP":
                try:
                    seen.id.path_resolve(seen.data_path)
                except ValueError:
                    return False
            elif seen.bone_target and seen.bone_target not in getattr(seen.id.data, "bones", ()):
                return False
    return True
