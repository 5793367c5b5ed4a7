# SPDX-License-Identifier: GPL-3.0-or-later
"""Constraints of a fitted rig: what they store, and bones that they would move at rest."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from contextlib import AbstractContextManager
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

# Rounds in which bones that constraints lead come to rest.
ROUNDS = 4
# A bone rests that is turned by less than this, radians, and moved by less than this share of its length.
TURNED, MOVED = 2e-3, 2e-3


def fit_constraints(rig: bpy.types.Object, own: bpy.types.Object, named: Mapping[str, str]) -> None:
    """Lengths, angles and matrices that constraints of the rig store, as fitted bones have them at rest."""
    for bone in rig.pose.bones:
        fitted = own.pose.bones[named[bone.name]]
        for constraint in bone.constraints:
            copy = fitted.constraints.get(constraint.name)
            if copy is None or getattr(copy, "target", None) is None or constraint.target is None:
                continue
            there, here = at_rest(constraint), at_rest(copy)
            if constraint.type == "CHILD_OF" and constraint.inverse_matrix != Matrix():
                copy.inverse_matrix = here.inverted_safe() @ there @ constraint.inverse_matrix
            if constraint.type == "IK" and constraint.pole_target and copy.pole_target:
                turned = _pole(copy, fitted, own) - _pole(constraint, bone, rig)
                copy.pole_angle = constraint.pole_angle + turned
            length = {"STRETCH_TO": "rest_length", "LIMIT_DISTANCE": "distance"}.get(constraint.type)
            if length is not None:
                before = (there.translation - _head_at_rest(rig, bone)).length
                after = (here.translation - _head_at_rest(own, fitted)).length
                if before > 0.0:
                    setattr(copy, length, getattr(constraint, length) * after / before)


def _head_at_rest(rig: bpy.types.Object, bone: bpy.types.PoseBone) -> Vector:
    return rig.matrix_world @ bone.bone.head_local


def at_rest(constraint: bpy.types.Constraint) -> Matrix:
    """World matrix of what a constraint looks at, its bones at rest."""
    seen = constraint.target
    bone = seen.data.bones.get(constraint.subtarget) if seen.type == "ARMATURE" else None
    if bone is None:
        return seen.matrix_world.copy()
    along = getattr(constraint, "head_tail", 0.0) * bone.length
    return seen.matrix_world @ bone.matrix_local @ Matrix.Translation((0.0, along, 0.0))


def _pole(constraint: bpy.types.Constraint, bone: bpy.types.PoseBone, rig: bpy.types.Object) -> float:
    """The pole angle at which a limb would rest, all bones at rest.

    The solver turns the limb about the line from its root to its tip until the direction at the pole angle,
    from the x axis of the first bone to its z axis, lies in the plane of that line and the pole.
    """
    chain = [bone, *bone.parent_recursive]
    first = (chain[: constraint.chain_count] if constraint.chain_count else chain)[-1].bone
    tip = bone.bone.tail_local if constraint.use_tail else bone.bone.head_local
    seen = constraint.pole_target
    there = seen.matrix_world
    if seen.type == "ARMATURE" and constraint.pole_subtarget in seen.data.bones:
        there = there @ seen.data.bones[constraint.pole_subtarget].matrix_local
    to_pole = rig.matrix_world.inverted_safe() @ there.translation - first.head_local
    line = (tip - first.head_local).normalized()
    x, _, z = first.matrix_local.to_3x3().col
    normal, up = line.cross(to_pole), to_pole - to_pole.project(line)
    angle = np.arctan2(-x.dot(normal), z.dot(normal))
    return angle if (x * np.cos(angle) + z * np.sin(angle)).dot(up) >= 0.0 else angle + np.pi


def settle(
    rig: bpy.types.Object,
    own: bpy.types.Object,
    named: Mapping[str, str],
    held: Container[str],
    editing: Callable[[bpy.types.Object], AbstractContextManager[None]],
) -> bool:
    """Let the fitted rig rest under its constraints as the source's does; whether any bone was laid anew.

    Bones that are led by constraints are laid where these hold them while all else rests: first those that
    hold no surface, as the mechanism of generated rigs, which moves nothing that hangs on them, and then what
    is left. `editing` opens a rig's edit mode.
    """
    if not any(bone.constraints for bone in rig.pose.bones):
        return False
    resting = {named[name] for name, matrix in _off(rig).items() if matrix is None}
    led = {
        named[bone.name]: bone.name in held
        for bone in rig.pose.bones
        if any(constraint.type != "IK" and not constraint.mute for constraint in bone.constraints)
    }
    free = {name for name, holds in led.items() if not holds}
    changed = False
    for names in (free & resting, led.keys() & resting):
        for _ in range(ROUNDS):
            moved = {name: at for name, at in _off(own).items() if at is not None and name in names}
            if not moved:
                break
            with editing(own):
                _lay(own.data.edit_bones, moved)
            changed = True
    return changed


def _lay(bones: Any, places: Mapping[str, Matrix]) -> None:
    """Lay edit bones as these matrices are, as long as they stretch them, those above first.

    Others that begin where one of them ends stay, and it ends there.
    """
    for name in sorted(places, key=lambda name: len(bones[name].parent_recursive)):
        bone, matrix = bones[name], places[name].normalized()
        length = bone.length * places[name].col[1].to_3d().length
        joined = [child for child in bone.children if child.use_connect and child.name not in places]
        heads = [child.head.copy() for child in joined]
        bone.head = matrix.translation
        bone.tail = matrix.translation + length * matrix.col[1].to_3d()
        bone.align_roll(matrix.col[2].to_3d())
        for child, head in zip(joined, heads, strict=True):
            child.head = head


def _off(rig: bpy.types.Object) -> dict[str, Matrix | None]:
    """For each bone where constraints hold it while all bones are in their places, None where it rests."""
    probe = rig.copy()
    probe.animation_data_clear()
    held = bpy.context.scene.collection.objects
    held.link(probe)
    probe.hide_viewport = False
    try:
        for bone in probe.pose.bones:
            bone.matrix_basis = Matrix()
            for constraint in bone.constraints:
                for look in [constraint, *getattr(constraint, "targets", ())]:
                    for name in ("target", "pole_target", "space_object"):
                        if getattr(look, name, None) == rig:
                            setattr(look, name, probe)
        shown = probe.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return {bone.name: _moved(bone) for bone in shown.pose.bones}
    finally:
        held.unlink(probe)
        bpy.data.objects.remove(probe)


def _moved(bone: bpy.types.PoseBone) -> Matrix | None:
    """The matrix of a posed bone in its rig where it is another one than at rest, else None."""
    rest, posed = bone.bone.matrix_local, bone.matrix
    turned = rest.to_quaternion().rotation_difference(posed.to_quaternion()).angle
    turned = min(turned, 2.0 * np.pi - turned)
    away = (posed.translation - rest.translation).length
    return posed.copy() if turned > TURNED or away > MOVED * bone.bone.length else None
