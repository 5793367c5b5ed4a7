# SPDX-License-Identifier: GPL-3.0-or-later
"""What hangs on the bones of a rig that is replaced: it follows the rig that took its place."""

from __future__ import annotations

from collections.abc import Container

import bpy
import numpy as np
from mathutils import Matrix

from .listed import listed
from .weights import armature_modifiers


def hung_on(rigs: Container[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects that hang on bones of these rigs."""
    return [obj for obj in bpy.data.objects if obj.parent in rigs and obj.parent_type == "BONE"]


def rehang(rigs: Container[bpy.types.Object], own: bpy.types.Object) -> None:
    """Hang what hangs on bones of these rigs on the bones of `own` that stand there, where it is at rest.

    What `own` deforms hangs on it as a whole: else it would be moved twice.
    """
    for obj in hung_on(rigs):
        before = obj.parent
        bone = before.data.bones.get(obj.parent_bone) if before is not None else None
        if before is None or bone is None:
            continue
        offset = before.matrix_world @ _end(bone) @ obj.matrix_parent_inverse
        obj.parent, place = own, own.matrix_world
        if any(modifier.object == own for modifier in armature_modifiers(obj)):
            obj.parent_type, obj.parent_bone = "OBJECT", ""
        else:
            obj.parent_bone = _nearest(before, bone, own)
            place = place @ _end(own.data.bones[obj.parent_bone])
        obj.matrix_parent_inverse = place.inverted_safe() @ offset


def words(rigs: Container[bpy.types.Object], targets: Container[bpy.types.Object]) -> list[str]:
    """A note on what follows another rig, beside the meshes of the target."""
    names = [obj.name for obj in hung_on(rigs) if obj not in targets]
    return [f"These hung on the old rig and follow the new one now: {listed(names)}"] if names else []


def _end(bone: bpy.types.Bone) -> Matrix:
    """Where what hangs on a bone at rest is measured from: its tail."""
    matrix = bone.matrix_local.copy()
    matrix.translation = bone.tail_local
    return matrix


def _nearest(rig: bpy.types.Object, bone: bpy.types.Bone, own: bpy.types.Object) -> str:
    """The bone of `own` with the name of a bone of `rig`, else the one whose ends are nearest at rest."""
    places = [rig.matrix_world @ end for end in (bone.head_local, bone.tail_local)]
    same = own.data.bones.get(bone.name)
    if same is not None:
        return same.name

    def away(other: bpy.types.Bone) -> float:
        ends = [own.matrix_world @ end for end in (other.head_local, other.tail_local)]
        return np.sum([(a - b).length for a, b in zip(ends, places, strict=True)])

    return min(own.data.bones, key=away).name
