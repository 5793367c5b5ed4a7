# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions of an ID: which there are, copies of them for the target, and animation carried curve by curve."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import bpy
import numpy as np

from .copies import MADE_FROM, ORIGINAL, copied

# What has an action: the animation of an ID, or a strip of it.
ActionUser = bpy.types.AnimData | bpy.types.NlaStrip
CurvesByPath = dict[tuple[str, int], bpy.types.FCurve]
PathOf = Callable[[str], str | None]

# Of every key of a curve: values in pairs, plain numbers, and choices, which are numbers to `foreach_get`.
KEY_PAIRS = ("co", "handle_left", "handle_right")
KEY_NUMBERS = ("amplitude", "period", "back")
KEY_CHOICES = ("interpolation", "easing", "handle_left_type", "handle_right_type", "type")
CURVE_SETTINGS = ("extrapolation", "color_mode", "color", "lock", "mute", "hide", "auto_smoothing")
# How an action is laid over the tracks below it.
BLENDING = ("action_blend_type", "action_extrapolation", "action_influence", "use_nla")
TRACK_SETTINGS = ("name", "mute", "lock")
# Reach before extents: Blender keeps a strip's end behind its begin.
STRIP_SETTINGS = (
    "name", "action_frame_start", "action_frame_end", "scale", "repeat", "frame_start", "frame_end",
    "blend_type", "extrapolation", "use_auto_blend", "blend_in", "blend_out", "use_reverse", "influence",
    "mute",
)  # fmt: skip


def actions_of(holder: bpy.types.ID) -> list[bpy.types.Action]:
    """Actions that animate an ID, in its NLA strips too, each once."""
    return list(dict.fromkeys(user.action for user in action_users(holder) if user.action is not None))


def actions_from(given: bpy.types.ID, own: bpy.types.ID) -> list[str]:
    """Names of the actions of an ID that another one has too, as they are or as copies."""
    held = actions_of(own)
    there = {*held, *(action.get(ORIGINAL) for action in held)}
    return [action.name for action in actions_of(given) if action in there]


def own_actions(holder: bpy.types.ID, actions: Iterable[bpy.types.Action]) -> list[bpy.types.Action]:
    """Exchange these actions of an ID for copies; returns the copies."""
    made = {action: copied(action) for action in actions}
    for user in action_users(holder):
        if user.action in made:
            give_action(user, made[user.action], getattr(user, "action_slot", None))
    for action in actions:
        if not action.users:
            bpy.data.actions.remove(action)
    return list(made.values())


def action_users(holder: bpy.types.ID) -> list[ActionUser]:
    """What of an ID's animation has an action: itself and its NLA strips."""
    held = holder.animation_data
    return [] if held is None else [held, *(strip for track in held.nla_tracks for strip in track.strips)]


def curve_lists(action: bpy.types.Action, slot: Any = None) -> list[Any]:
    """The lists that hold an action's curves: all, or those of a slot, which there are from Blender 4.4."""
    if not hasattr(action, "layers"):
        return [action.fcurves]
    return [
        bag.fcurves
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        if slot is None or bag.slot_handle == slot.handle
    ]


def curves_used(user: ActionUser) -> list[bpy.types.FCurve]:
    """The curves by which an ID's animation, or a strip of it, moves the ID."""
    slot = getattr(user, "action_slot", None)
    if user.action is None or (hasattr(user, "action_slot") and slot is None):
        return []
    return [curve for curves in curve_lists(user.action, slot) for curve in curves]


def give_action(user: ActionUser, action: bpy.types.Action, slot: Any) -> None:
    """Let an animation or strip use an action, by the slot that is there called as `slot`."""
    user.action = action
    if slot is not None:
        user.action_slot = action.slots[slot.identifier]


def carry_animation(
    given: bpy.types.ID, own: bpy.types.ID, path_of: PathOf, target: bpy.types.Object
) -> None:
    """Give an ID copies of another one's animated properties: `path_of(path)` is the own path, or None.

    Curves of the same paths are replaced in an action that was made so before; one of the artist is copied,
    gets them in the copy, and stays in the file.
    """
    if given.animation_data is None and own.animation_data is None:
        return
    held = own.animation_data or own.animation_data_create()
    wanted = _wanted(given.animation_data, path_of)
    if wanted:
        if held.action is None:
            _set_alike(held, given.animation_data, BLENDING)
        action, curves = _curves_of(held, given.animation_data.action, own, target)
        _fill(curves, wanted)
        _mark(action, given.animation_data.action)
    _carry_tracks(given.animation_data, held, path_of, own, target)


def _wanted(user: ActionUser | None, path_of: PathOf) -> CurvesByPath:
    """The curves of a user of an action, by their own path and place in it."""
    found: CurvesByPath = {}
    curves: list[bpy.types.FCurve] = [] if user is None else curves_used(user)
    for curve in curves:
        path = path_of(curve.data_path)
        if path is not None:
            found[path, curve.array_index] = curve
    return found


def _curves_of(
    held: bpy.types.AnimData, original: bpy.types.Action, own: bpy.types.ID, target: bpy.types.Object
) -> tuple[bpy.types.Action, Any]:
    """An action of the target's own, made from another one, and the list of its curves for this ID."""
    before, slot = held.action, getattr(held, "action_slot", None)
    if before is not None and MADE_FROM in before and before.users == 1:
        action = before
    elif before is not None:
        action = copied(before)
        before.use_fake_user = True
        give_action(held, action, slot)
    else:
        action = bpy.data.actions.new(f"{original.name} {target.name}")
        held.action = action
    return action, _curve_list(held, action, own)


def _curve_list(user: ActionUser, action: bpy.types.Action, own: bpy.types.ID) -> Any:
    """The list of an action's curves for an ID, made where it is missing."""
    if not hasattr(action, "layers"):
        return action.fcurves
    slot = user.action_slot or action.slots.new(id_type=own.id_type, name=own.name)
    user.action_slot = slot
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(slot, ensure=True).fcurves


def _mark(action: bpy.types.Action, original: bpy.types.Action) -> None:
    action[MADE_FROM], action[ORIGINAL] = original.name, original


def _fill(curves: Any, wanted: CurvesByPath) -> None:
    """Put copies of these curves into a list, in place of those of their paths."""
    for curve in [curve for curve in curves if (curve.data_path, curve.array_index) in wanted]:
        curves.remove(curve)
    for (path, index), curve in wanted.items():
        copy_keys(curve, curves.new(path, index=index))


def copy_keys(curve: bpy.types.FCurve, own: bpy.types.FCurve) -> None:
    """Keys, settings and modifiers of a curve for another one, which is empty."""
    _set_alike(own, curve, CURVE_SETTINGS)
    own.keyframe_points.add(len(curve.keyframe_points))
    # Places last: settings and kinds of handles let Blender move these.
    for names, width, number in ((KEY_CHOICES, 1, np.int32), (KEY_NUMBERS, 1, np.float32)):
        for name in names:
            _copy_values(curve.keyframe_points, own.keyframe_points, name, width, number)
    for name in KEY_PAIRS:
        _copy_values(curve.keyframe_points, own.keyframe_points, name, 2, np.float32)
    for modifier in curve.modifiers:
        made = own.modifiers.new(modifier.type)
        for prop in modifier.bl_rna.properties:
            if not prop.is_readonly and prop.type in {"BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"}:
                setattr(made, prop.identifier, getattr(modifier, prop.identifier))


def _copy_values(points: Any, own: Any, name: str, width: int, number: type[np.generic]) -> None:
    values = np.empty(len(points) * width, number)
    points.foreach_get(name, values)
    own.foreach_set(name, values)


def _carry_tracks(
    given: bpy.types.AnimData | None,
    held: bpy.types.AnimData,
    path_of: PathOf,
    own: bpy.types.ID,
    target: bpy.types.Object,
) -> None:
    """NLA tracks with copies of the strips that move what is carried, in place of those made before."""
    made_before = [
        track
        for track in held.nla_tracks
        if len(track.strips) and all(strip.action and MADE_FROM in strip.action for strip in track.strips)
    ]
    for track in made_before:
        actions = [strip.action for strip in track.strips]
        held.nla_tracks.remove(track)
        for action in actions:
            if not action.users:
                bpy.data.actions.remove(action)
    for track in given.nla_tracks if given is not None else ():
        strips = [(strip, _wanted(strip, path_of)) for strip in track.strips if strip.type == "CLIP"]
        strips = [(strip, wanted) for strip, wanted in strips if wanted]
        if not strips:
            continue
        own_track = _new_track(held, track)
        for strip, wanted in strips:
            action = bpy.data.actions.new(f"{strip.action.name} {target.name}")
            _mark(action, strip.action)
            own_strip = own_track.strips.new(strip.name, int(strip.frame_start), action)
            _fill(_curve_list(own_strip, action, own), wanted)
            _set_alike(own_strip, strip, STRIP_SETTINGS)


def copy_tracks(given: bpy.types.AnimData, held: bpy.types.AnimData) -> None:
    """Give an ID's animation the action and tracks of another one's."""
    _set_alike(held, given, BLENDING)
    if given.action is not None:
        give_action(held, given.action, getattr(given, "action_slot", None))
    for track in given.nla_tracks:
        own_track = _new_track(held, track)
        for strip in track.strips:
            own_strip = own_track.strips.new(strip.name, int(strip.frame_start), strip.action)
            give_action(own_strip, strip.action, getattr(strip, "action_slot", None))
            _set_alike(own_strip, strip, STRIP_SETTINGS)


def _new_track(held: bpy.types.AnimData, track: bpy.types.NlaTrack) -> bpy.types.NlaTrack:
    made = held.nla_tracks.new()
    _set_alike(made, track, TRACK_SETTINGS)
    return made


def _set_alike(own: Any, given: Any, settings: Iterable[str]) -> None:
    for setting in settings:
        setattr(own, setting, getattr(given, setting))
