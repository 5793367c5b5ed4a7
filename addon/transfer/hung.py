# SPDX-License-Identifier: GPL-3.0-or-later
"""What hangs on the bones of a rig that is replaced: it follows the rig that took its place."""

import bpy
import numpy as np

from .listed import listed


def hung_on(rigs):
    """Objects that hang on bones of these rigs."""
    return [obj for obj in bpy.data.objects if obj.parent in rigs and obj.parent_type == "BONE"]


def rehang(rigs, own):
    """Hang what hangs on bones of these rigs on the bones of `own` that stand there, where it is at rest."""
    for obj in hung_on(rigs):
        before, bone = obj.parent, obj.parent.data.bones.get(obj.parent_bone)
        if bone is None:
            continue
        after = own.data.bones[_nearest(before, bone, own)]
        offset = before.matrix_world @ _end(bone) @ obj.matrix_parent_inverse
        obj.parent, obj.parent_bone = own, after.name
        obj.matrix_parent_inverse = (own.matrix_world @ _end(after)).inverted_safe() @ offset


def words(rigs):
    """A note on what follows another rig."""
    names = [obj.name for obj in hung_on(rigs)]
    return [f"What hung on its bones follows the new rig: {listed(names)}"] if names else []


def _end(bone):
    """Where what hangs on a bone at rest is measured from: its tail."""
    matrix = bone.matrix_local.copy()
    matrix.translation = bone.tail_local
    return matrix


def _nearest(rig, bone, own):
    """The bone of `own` with the name of a bone of `rig`, else the one whose ends are nearest at rest."""
    places = [rig.matrix_world @ end for end in (bone.head_local, bone.tail_local)]
    same = own.data.bones.get(bone.name)
    if same is not None:
        return same.name

    def away(other):
        ends = [own.matrix_world @ end for end in (other.head_local, other.tail_local)]
        return np.sum([(a - b).length for a, b in zip(ends, places, strict=True)])

    return min(own.data.bones, key=away).name
