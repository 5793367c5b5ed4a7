# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a rig's actions for the rig that was fitted to the target, with turns and places fitted to it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion

from ..typed import Floats
from .actions import action_users, copy_tracks, curve_lists, curves_used, give_action
from .copies import MADE_FROM, ORIGINAL, copied
from .curve_maps import Curves, remap
from .rest_poses import scale_of, turn_of

if TYPE_CHECKING:
    from .actions import ActionUser
    from .rest_poses import Fitting

# A bone in the path of a curve, and its property.
POSE_PATH = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.(.*)')
# What places an object, as paths of its animation begin.
TRANSFORMS = ("location", "rotation", "scale", "delta_")
# Turns at rest below this, radians, and shifts below this share of a leg need no key.
AT_REST = 1e-3
# What differs from the identity by less than this does so by rounding: curves stay as they are.
ROUNDING = 1e-5


def fit_actions(fitting: Fitting, fresh: bool) -> Iterator[float]:
    """Give the fitted rig copies of the source rig's actions, with turns and places fitted.

    A generator, since there may be many: it yields how far it is.
    Not `fresh`: it has some from before, which are made anew from their originals; others are the artist's.
    """
    pairs, made = _pairs(fitting.rig, fitting.own, fresh), {}
    for user, action, slot in pairs:
        if action not in made:
            made[action] = copied(action)
            made[action][MADE_FROM], made[action][ORIGINAL] = action.name, action
            made[action].name = f"{action.name} {fitting.own.name}"
        _exchange(user, made[action], slot)
    users = {made[action]: user for user, action, _ in pairs}.values()
    for user in users:
        _rename(user, fitting)
    animated = {curve.data_path for user in users for curve in curves_used(user)}
    for number, user in enumerate(users):
        yield number / len(users)
        _fit(user, fitting, animated)
    # The pose at the scene's frame as well, which Blender works out anew at another frame only.
    fitting.own.update_tag(refresh={"OBJECT", "DATA", "TIME"})


def keep_actions(fitting: Fitting, fresh: bool) -> Iterator[float]:
    """Give the fitted rig the source rig's actions as they are, where it has fitted ones from before."""
    yield 0.0
    for user, action, slot in () if fresh else _pairs(fitting.rig, fitting.own, fresh):
        _exchange(user, action, slot)


def _exchange(user: ActionUser, action: bpy.types.Action, slot: Any) -> None:
    before = user.action
    give_action(user, action, slot)
    if before != action and MADE_FROM in before and not before.users:
        bpy.data.actions.remove(before)


def _pairs(
    rig: bpy.types.Object, own: bpy.types.Object, fresh: bool
) -> list[tuple[ActionUser, bpy.types.Action, Any]]:
    """Users of an action on the fitted rig, each with the original of the source rig, and its slot."""
    given = action_users(rig)
    held = rig.animation_data
    if not fresh and held is not None and not any(user.action for user in action_users(own)):
        # What moves the source's rig came after the fitted one.
        fresh = True
        copy_tracks(held, own.animation_data or own.animation_data_create())
    if fresh:
        users = zip(action_users(own), given, strict=True)
        pairs = [(user, other.action, getattr(other, "action_slot", None)) for user, other in users]
        return [pair for pair in pairs if pair[1] is not None]
    slots = {user.action: getattr(user, "action_slot", None) for user in given if user.action is not None}
    found = []
    for user in action_users(own):
        original = user.action.get(ORIGINAL, user.action) if user.action is not None else None
        if user == own.animation_data and MADE_FROM in (user.action or ()) and given and given[0].action:
            # Another one may play on the source's rig since.
            original = given[0].action
        if original in slots or (original is not None and MADE_FROM in user.action):
            found.append((user, original, slots.get(original, getattr(user, "action_slot", None))))
    return found


def _rename(user: ActionUser, fitting: Fitting) -> None:
    """Curves move the fitted bones, and nothing that moves the rig as an object."""
    for curves in curve_lists(user.action, getattr(user, "action_slot", None)):
        for curve in list(curves):
            found = POSE_PATH.match(curve.data_path)
            if found is None:
                if curve.data_path.startswith(TRANSFORMS):
                    curves.remove(curve)
                continue
            name = bpy.utils.unescape_identifier(found[1])
            if fitting.named.get(name, name) != name:
                curve.data_path = _path(fitting.named[name], found[2])


def _path(name: str, setting: str) -> str:
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].{setting}'


def _fit(user: ActionUser, fitting: Fitting, animated: set[str]) -> None:
    """Fit the curves of an action; `animated` are the paths that this or another action of the rig moves."""
    rig, named = fitting.rig, fitting.named
    lists = curve_lists(user.action, getattr(user, "action_slot", None)) if curves_used(user) else ()
    if not lists or getattr(user, "blend_type", "REPLACE") != "REPLACE":
        # What is added to other strips is turned with them.
        return
    curves = Curves(lists[0])
    moved = {
        name for name in fitting.order if _path(named[name], _turning(rig.pose.bones[name])) in curves.paths
    }
    basis = {}
    for name in fitting.order:
        bone = rig.pose.bones[name]
        # How another action turns it now says nothing of this one.
        still = _path(named[name], _turning(bone)) not in animated
        basis[name] = turn_of(bone.matrix_basis) if still else np.eye(3)
    # What the surface hangs on shall be turned as the source's even where it only rests: by keys of this
    # action, or of that over which it is laid.
    whole = bool(moved & fitting.held) and not _is_laid_over(user, fitting.own)
    keyed = moved | {name for name in fitting.held if not fitting.is_led(name)}
    left, offset = fitting.rests_to_turn(keyed, basis)
    shift = fitting.shift() if whole else np.zeros(3)
    for name in fitting.order:
        own, bone = fitting.own.pose.bones[named[name]], rig.pose.bones[name]
        if name in moved:
            own.rotation_mode = bone.rotation_mode
            _fit_turn(curves, own, bone, left[name], offset[name], fitting.side)
        elif name in keyed and whole:
            _rest_turn(curves, own, left[name] @ fitting.side @ basis[name] @ fitting.side @ offset[name])
        _fit_place(curves, fitting, name, left[name], shift, whole)


def _is_laid_over(user: ActionUser, own: bpy.types.Object) -> bool:
    """Whether an action is laid over strips of other tracks, which then turn the bones that it does not."""
    held = own.animation_data
    shown = [track for track in held.nla_tracks if not track.mute and held.use_nla]
    if user == held:
        return any(not strip.mute for track in shown for strip in track.strips)
    below: list[bpy.types.NlaStrip] = []
    for track in shown:
        if user in track.strips.values():
            return any(
                strip.frame_start < user.frame_end and user.frame_start < strip.frame_end and not strip.mute
                for strip in below
            )
        below += track.strips
    return False


def _turning(bone: bpy.types.PoseBone) -> str:
    """The property by which a posed bone is turned."""
    return {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(
        bone.rotation_mode, "rotation_euler"
    )


def _fit_turn(
    curves: Curves,
    own: bpy.types.PoseBone,
    bone: bpy.types.PoseBone,
    left: Floats,
    right: Floats,
    side: Floats,
) -> None:
    """Curves of a bone's turn: `B` becomes `left (S B S) right`."""
    setting = _turning(bone)
    matrix = _product(left, right, side)
    if np.abs(matrix - np.eye(4)).max() < ROUNDING:
        return
    defaults = list(getattr(bone, setting))
    path = _path(own.name, setting)
    if setting == "rotation_quaternion":
        remap(curves, path, 4, defaults, lambda values: values @ matrix.T, linear=True)
    elif setting == "rotation_axis_angle":

        def turned_axis(values: Floats) -> Floats:
            given = np.array([Quaternion(value[1:], value[0]) for value in values.tolist()]) @ matrix.T
            return _continuous_axes(given)

        remap(curves, path, 4, defaults, turned_axis, linear=False)
    else:
        order = bone.rotation_mode

        def turned(values: Floats) -> Floats:
            given = np.array([Euler(value, order).to_quaternion() for value in values.tolist()]) @ matrix.T
            return _continuous_eulers(given, order)

        remap(curves, path, 3, defaults, turned, linear=False)


def _product(left: Floats, right: Floats, side: Floats) -> Floats:
    """What takes quaternions to `left (S q S) right`, (4, 4)."""
    a, b = (np.array(Matrix(turn.tolist()).to_quaternion()) for turn in (left, right))
    mirrored = np.diag((1.0, 1.0, 1.0, 1.0) if side[0, 0] > 0.0 else (1.0, 1.0, -1.0, -1.0))

    def columns(product: Callable[[Quaternion], Quaternion]) -> Floats:
        return np.array([product(Quaternion(one)) for one in np.eye(4).tolist()]).T

    first = columns(lambda one: Quaternion(a.tolist()) @ one)
    second = columns(lambda one: one @ Quaternion(b.tolist()))
    return first @ second @ mirrored


def _continuous_eulers(quaternions: Floats, order: str) -> Floats:
    """Angles in which no step is longer than it has to be."""
    found, before = [], None
    for value in quaternions.tolist():
        turn = Quaternion(value)
        before = turn.to_euler(order, before) if before is not None else turn.to_euler(order)
        found.append(before[:])
    return np.array(found).reshape(-1, 3)


def _continuous_axes(quaternions: Floats) -> Floats:
    found, before = [], None
    for value in quaternions.tolist():
        turn = Quaternion(value)
        if before is not None and turn.dot(before) < 0.0:
            turn.negate()
        before = turn
        axis, angle = turn.to_axis_angle()
        found.append((angle, *axis[:]))
    return np.array(found).reshape(-1, 4)


def _rest_turn(curves: Curves, own: bpy.types.PoseBone, turn: Floats) -> None:
    """One key for a bone that is not keyed, where the target rests otherwise than the source."""
    quaternion = Matrix(turn.tolist()).to_quaternion()
    if quaternion.angle < AT_REST:
        return
    setting = _turning(own)
    if setting == "rotation_quaternion":
        values = quaternion[:]
    elif setting == "rotation_axis_angle":
        axis, angle = quaternion.to_axis_angle()
        values = (angle, *axis[:])
    else:
        values = quaternion.to_euler(own.rotation_mode)[:]
    _one_key(curves, _path(own.name, setting), values)


def _one_key(curves: Curves, path: str, values: Iterable[float]) -> None:
    for index, value in enumerate(values):
        curves.new(path, index).keyframe_points.insert(1.0, value)


def _fit_place(curves: Curves, fitting: Fitting, name: str, left: Floats, shift: Floats, whole: bool) -> None:
    """Curves of a bone's place, and its shift where it carries the body or leads limbs."""
    own, bone = fitting.own.pose.bones[fitting.named[name]], fitting.rig.pose.bones[name]
    path = _path(own.name, "location")
    turn = left @ fitting.side
    if not bone.bone.use_local_location:
        # Along the axes of the rigs.
        turn = fitting.target[name].turn @ turn @ fitting.source[name].turn.T
    matrix = fitting.size(name) * turn
    constant = _constant(fitting, name, shift)
    if np.abs(matrix - np.eye(3)).max() < ROUNDING and not constant.any():
        return
    if path in curves.paths:
        remap(curves, path, 3, bone.location[:], lambda values: values @ matrix.T + constant, linear=True)
    elif whole and np.linalg.norm(constant) * scale_of(fitting.own) > AT_REST * fitting.leg:
        _one_key(curves, path, matrix @ np.array(bone.location) + constant)


def _constant(fitting: Fitting, name: str, shift: Floats) -> Floats:
    """What is added to a bone's place, in its own axes at rest and the rig's units."""
    if fitting.legs is not None and name == fitting.legs.hips:
        added = shift
    elif name in _leading(fitting):
        source, target = fitting.source[name], fitting.target[name]
        hips = fitting.legs.hips if fitting.legs is not None else fitting.order[0]
        away = fitting.steps * fitting.facing @ (source.world_head - fitting.source[hips].world_head)
        added = fitting.target[hips].world_head + shift + away - target.world_head
    else:
        return np.zeros(3)
    local = fitting.rig.data.bones[name].use_local_location
    axes = fitting.target[name].world_turn if local else turn_of(fitting.own.matrix_world)
    return axes.T @ added / scale_of(fitting.own)


def _leading(fitting: Fitting) -> set[str]:
    """Bones that lead limbs by inverse kinematics, and neither they nor bones above them hold the surface."""
    found = set()
    for bone in fitting.rig.pose.bones:
        for constraint in bone.constraints:
            if constraint.type != "IK" or getattr(constraint, "target", None) != fitting.rig:
                continue
            for name in (constraint.subtarget, constraint.pole_subtarget):
                leader = fitting.rig.data.bones.get(name)
                if leader is None or name in fitting.held:
                    continue
                if not any(above.name in fitting.held for above in leader.parent_recursive):
                    found.add(name)
    return found
