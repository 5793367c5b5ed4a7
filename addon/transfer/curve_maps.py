# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves of several channels that belong together, as those of a rotation, taken through a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import bpy
import numpy as np

from ..typed import Floats, Integers, Values

# What becomes of values (n, width), or of times (n,).
Function = Callable[[Floats], Floats]

HANDLES = ("handle_left", "handle_right")
# Slopes of curves are differences over this part of a frame.
STEP = 0.02
# Handles that an artist did not place reach over this share of the way to the next key.
REACH = 1.0 / 3.0
# Inside of a segment the curves may be off by this much, in the function's own numbers.
TOLERANCE = 5e-3
# Where they are checked, as shares of a segment.
CHECKED = (0.25, 0.5, 0.75)


class Curves:
    """The curves of one ID in an action, found by path and channel."""

    def __init__(self, curves: Any) -> None:
        self._list = curves
        self._known = {(curve.data_path, curve.array_index): curve for curve in curves}
        self.paths = {curve.data_path for curve in curves}

    def get(self, path: str, channel: int) -> bpy.types.FCurve | None:
        return self._known.get((path, channel))

    def new(self, path: str, channel: int) -> bpy.types.FCurve:
        made = self._known[path, channel] = self._list.new(path, index=channel)
        return made


def remap(
    curves: Curves, path: str, width: int, defaults: Sequence[float], function: Function, linear: bool
) -> None:
    """Replace the values of `width` channels by what `function` makes of them, (n, width) → (n, width).

    `curves` are the action's `Curves`; channels that have none are `defaults` (width,) and get a curve. Keys
    stay where they are, with interpolation and handles; keys in between are added where the function is not
    `linear` and the curves would be off.
    """
    own = [curves.get(path, channel) for channel in range(width)]
    held = [curve for curve in own if curve is not None and len(curve.keyframe_points)]
    if not held:
        return
    times = np.unique(np.concatenate([_numbers(curve, "co")[:, 0] for curve in held]))
    alike = linear and all(
        len(curve.keyframe_points) == len(times) and np.array_equal(_numbers(curve, "co")[:, 0], times)
        for curve in held
    )
    if alike and len(held) == width:
        _remap_points(held, function)
    else:
        _remap_values(curves, own, path, defaults, function, times, linear)


def _numbers(curve: bpy.types.FCurve, name: str, width: int = 2) -> Floats:
    values = np.empty(len(curve.keyframe_points) * width, np.float32)
    curve.keyframe_points.foreach_get(name, values)
    return values.reshape(-1, width).astype(np.float64)


def _set_free(curve: bpy.types.FCurve) -> None:
    """Handles that Blender does not move."""
    free = np.zeros(len(curve.keyframe_points), np.int32)
    for name in ("handle_left_type", "handle_right_type"):
        curve.keyframe_points.foreach_set(name, free)


def _set(curve: bpy.types.FCurve, name: str, values: Values) -> None:
    curve.keyframe_points.foreach_set(name, values.astype(np.float32).ravel())


def _remap_points(own: Sequence[bpy.types.FCurve], function: Function) -> None:
    """Keys of all channels at the same times: the function of keys and handles is that of the curves."""
    points = {name: [_numbers(curve, name) for curve in own] for name in ("co", *HANDLES)}
    for values in points.values():
        made = function(np.stack([each[:, 1] for each in values], axis=1))
        for each, column in zip(values, made.T, strict=True):
            each[:, 1] = column
    for k, curve in enumerate(own):
        _set_free(curve)
        for name, values in points.items():
            _set(curve, name, values[k])


def _remap_values(
    curves: Curves,
    own: Sequence[bpy.types.FCurve | None],
    path: str,
    defaults: Sequence[float],
    function: Function,
    times: Floats,
    linear: bool,
) -> None:
    def given(at: Floats) -> Floats:
        columns = [
            np.full(len(at), default) if curve is None else np.array([curve.evaluate(t) for t in at.tolist()])
            for curve, default in zip(own, defaults, strict=True)
        ]
        return np.stack(columns, axis=1)

    kinds = _interpolations(own, times)
    if linear or len(times) == 1:
        found = _sampled(times, given, function)
    else:
        inside = times[:-1, None] + np.diff(times)[:, None] * CHECKED
        found, wanted = _sampled(times, given, function, inside)
        # Slopes at both ends tell of any kind of interpolation what it was, but for steps.
        kinds = np.where(kinds == CONSTANT, CONSTANT, BEZIER).astype(np.int32)
        off = [
            kinds[at] != CONSTANT and np.abs(_between(found, at, inside[at]) - wanted[at]).max() > TOLERANCE
            for at in range(len(inside))
        ]
        times, kinds = _filled(times, kinds, off)
        found = _sampled(times, given, function)
    extrapolation = next(curve.extrapolation for curve in own if curve is not None)
    for k, curve in enumerate(own):
        if curve is None:
            curve = curves.new(path, k)
            curve.extrapolation = extrapolation
        curve.keyframe_points.clear()
        curve.keyframe_points.add(len(times))
        _set_free(curve)
        curve.keyframe_points.foreach_set("interpolation", kinds)
        for name, (x, y) in found.items():
            _set(curve, name, np.stack([x, y[:, k]], axis=1))


def _interpolations(own: Iterable[bpy.types.FCurve | None], times: Floats) -> Integers:
    """The kind of interpolation after each time, by its number, of the first channel with a key there."""
    kinds = np.full(len(times), -1, np.int32)
    for curve in own:
        if curve is not None and len(curve.keyframe_points):
            values = np.empty(len(curve.keyframe_points), np.int32)
            curve.keyframe_points.foreach_get("interpolation", values)
            at = np.searchsorted(times, _numbers(curve, "co")[:, 0])
            kinds[at] = np.where(kinds[at] < 0, values, kinds[at])
    return kinds


def _sampled(times: Floats, given: Function, function: Function, inside: Floats | None = None) -> Any:
    """Times (n,) and values (n, width) of keys and handles; beside them the values at `inside`, if asked."""
    asked = [times - STEP, times, times + STEP, np.zeros(0) if inside is None else inside.ravel()]
    # In one go and in order: angles are continuous along the values that the function is given.
    at = np.concatenate(asked)
    order = np.argsort(at, kind="stable")
    made = function(given(at[order]))
    values = np.empty_like(made)
    values[order] = made
    left, middle, right, within = np.split(values, np.cumsum([len(each) for each in asked])[:-1])
    gap = np.diff(times) if len(times) > 1 else np.ones(1)
    before, after = np.append(gap[:1], gap)[: len(times)], np.append(gap, gap[-1:])[: len(times)]
    found = {
        "co": (times, middle),
        "handle_left": (times - REACH * before, middle + (left - middle) / STEP * REACH * before[:, None]),
        "handle_right": (times + REACH * after, middle + (right - middle) / STEP * REACH * after[:, None]),
    }
    return found if inside is None else (found, within.reshape(*inside.shape, -1))


# Blender's numbers of kinds of interpolation.
CONSTANT, LINEAR, BEZIER = range(3)


def _between(found: Mapping[str, tuple[Floats, Floats]], segment: int | Integers, at: Floats) -> Floats:
    """Values of a Bézier segment at times `at`, for handles at thirds, where it is a cubic in time."""
    (times, values), (_, right), (_, left) = (found[name] for name in ("co", "handle_right", "handle_left"))
    begin, end = times[segment], times[segment + 1]
    u = ((at - begin) / (end - begin))[:, None]
    return (
        (1 - u) ** 3 * values[segment]
        + 3 * (1 - u) ** 2 * u * right[segment]
        + 3 * (1 - u) * u**2 * left[segment + 1]
        + u**3 * values[segment + 1]
    )


def _filled(times: Floats, kinds: Integers, off: Iterable[bool]) -> tuple[Floats, Integers]:
    """Times with a key at each frame inside of the segments that are off, straight in between."""
    parts, kept = [], []
    for at, (time, inside) in enumerate(zip(times.tolist(), [*off, False], strict=True)):
        frames = np.arange(np.floor(time) + 1.0, times[at + 1]) if inside else np.zeros(0)
        parts.append(np.append(time, frames))
        kept.append(np.full(1 + len(frames), LINEAR if inside else kinds[at], np.int32))
    return np.concatenate(parts), np.concatenate(kept)
