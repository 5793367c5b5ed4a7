# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys: displacements in local frames, each relative to its own reference key, with their settings."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty

from ..mesh_read import UnusableObjectError
from ..typed import Floats, Options
from .actions import carry_animation
from .kind import Kind, Prepared
from .listed import listed

if TYPE_CHECKING:
    from .route import Route

SETTINGS = ("slider_max", "slider_min", "value", "mute", "interpolation")
# A key that moves the target by less than this share of what it moves on the source does not reach it: what
# is left are roundings, and traces of faces that its border runs through.
STILL = 1e-3
# Lowest end of any key's range, as Blender allows it.
LOWEST = -10.0
# A key's property as drivers and curves name it.
KEY_PATH = re.compile(r'key_blocks\["((?:[^"\\]|\\.)*)"\](.*)')
DRIVEN = ("value", "mute", "slider_min", "slider_max")


def names(source: bpy.types.Object) -> list[str]:
    keys = source.data.shape_keys
    return [] if keys is None else [block.name for block in keys.key_blocks[1:]]


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    keys = route.source.data.shape_keys
    for obj in (route.source, route.target):
        held = obj.data.shape_keys
        if held is not None and not held.use_relative:
            raise UnusableObjectError(
                f"The shape keys of '{obj.name}' are absolute; only relative ones can be carried, and only "
                "beside relative ones. Check Relative in its Shape Keys panel"
            )
    blocks = [keys.key_blocks[name] for name in _with_references(keys, wanted)]
    named, notes = route.sides.of_all([block.name for block in blocks])
    back = np.linalg.inv(route.target_stretch)
    offsets, still, left = {}, [], []
    for block in blocks:
        delta = route.shown_places(read_key(block)) - route.shown_places(read_key(block.relative_key))
        delta = delta @ route.source_stretch
        # What a key adds to another one meets from there, not from the places at rest.
        meets = options.keep_contacts and block.relative_key == keys.reference_key
        carried = route.map_as_seen.displacements(
            delta, turn_only=not options.scale_keys, keep_contacts=meets
        )
        offsets[block.name] = _in_mirrors(route, carried @ back)
        # A key that moves nothing on the source either is there for something else.
        if _reach(carried) < STILL * _reach(delta):
            still.append(block.name)
    if options.skip_still:
        read = set().union(*map(_read_by_drivers, {route.keys_with(block.name) for block in blocks}))
        left = _left_out(route.target, blocks, named, set(still) - read)
        blocks = [block for block in blocks if block.name not in left]
        if left:
            notes.append(
                f"{len(left)} shape keys move nothing on '{route.target.name}' and were left out: "
                f"{listed(left)}"
                if len(left) > 1
                else f"1 shape key moves nothing on '{route.target.name}' and was left out: {left[0]}"
            )
    if not blocks:
        return Prepared(notes=tuple(notes), left_out=left)
    masks = {block.name: route.sides.of(block.vertex_group) for block in blocks}
    missing = sorted({mask for mask in masks.values() if mask and mask not in route.target.vertex_groups})
    if missing:
        notes.append(
            f"Masks of shape keys need groups that '{route.target.name}' lacks: {listed(missing)}. Carry "
            "these groups too"
        )
    return Prepared(lambda: _write(route, blocks, named, offsets, masks), tuple(notes), left_out=left)


def _reach(offsets: Floats) -> float:
    """The length of the longest of these displacements."""
    return np.linalg.norm(offsets, axis=1).max(initial=0.0)


def _read_by_drivers(keys: bpy.types.Key) -> set[str]:
    """Names of keys whose values drivers of the keys read."""
    drivers = keys.animation_data.drivers if keys.animation_data is not None else ()
    paths = [
        seen.data_path
        for curve in drivers
        for variable in curve.driver.variables
        for seen in variable.targets
    ]
    return {bpy.utils.unescape_identifier(found[1]) for path in paths for found in KEY_PATH.finditer(path)}


def _left_out(
    target: bpy.types.Object,
    blocks: Sequence[bpy.types.ShapeKey],
    named: Mapping[str, str],
    still: Container[str],
) -> list[str]:
    """Which of the still keys are not made: no other carried key builds on them, and the target has none."""
    own = target.data.shape_keys
    needed = set(own.key_blocks.keys()) if own is not None else set()
    left: list[str] = []
    # Backwards, since each comes after the one it is relative to.
    for block in reversed(blocks):
        if block.name in still and named[block.name] not in needed:
            left.insert(0, block.name)
        else:
            needed.add(named[block.relative_key.name] if block.relative_key.name in named else "")
    return left


def _in_mirrors(route: Route, offsets: Floats) -> Floats:
    """Displacements that leave in its place the rim along which a Mirror modifier completes the target."""
    for mirror in route.target_mirrors:
        rim = mirror.merged(route.target_points)
        offsets[rim] = (offsets[rim] + offsets[rim] @ mirror.reflection[:3, :3].T) / 2.0
    return offsets


def _with_references(keys: bpy.types.Key, wanted: Sequence[str]) -> list[str]:
    """Wanted keys in an order in which each comes after the key it is relative to, those included."""
    ordered = []

    def add(block: bpy.types.ShapeKey, above: tuple[str, ...] = ()) -> None:
        if block == keys.reference_key or block.name in ordered or block.name in above:
            return
        add(block.relative_key, (*above, block.name))
        ordered.append(block.name)

    for name in wanted:
        add(keys.key_blocks[name])
    return ordered


def read_key(block: bpy.types.ShapeKey) -> Floats:
    """Coordinates of a shape key, (n, 3)."""
    values = np.empty(len(block.data) * 3, np.float32)
    block.data.foreach_get("co", values)
    return values.reshape(-1, 3).astype(np.float64)


def _write(
    route: Route,
    blocks: Sequence[bpy.types.ShapeKey],
    named: Mapping[str, str],
    offsets: Mapping[str, Floats],
    masks: Mapping[str, str],
) -> None:
    target = route.target
    if target.data.shape_keys is None:
        target.shape_key_add(name=blocks[0].id_data.reference_key.name, from_mix=False)
    keys = target.data.shape_keys
    shown = target.active_shape_key_index
    made: dict[str, bpy.types.ShapeKey] = {}
    for block in blocks:
        name = named[block.name]
        if name == keys.reference_key.name:
            # Blender's next name, so that the same key is found again.
            name += ".001"
        own = keys.key_blocks.get(name) or target.shape_key_add(name=name, from_mix=False)
        # A key that is relative to itself in a circle has no reference of its own.
        own.relative_key = made.get(block.relative_key.name, keys.reference_key)
        # Single precision: where the displacement is zero, the sum is the reference itself.
        coordinates = read_key(own.relative_key) + offsets[block.name]
        own.data.foreach_set("co", coordinates.astype(np.float32).ravel())
        # Each end of a range is held back by the other.
        own.slider_min = LOWEST
        for setting in SETTINGS:
            setattr(own, setting, getattr(block, setting))
        own.vertex_group = masks[block.name]
        made[block.name] = own
    target.active_shape_key_index = shown
    _copy_drivers(route, blocks, made)
    by_keys: dict[bpy.types.Key, dict[str, str]] = {}
    for block in blocks:
        by_keys.setdefault(route.keys_with(block.name), {})[block.name] = made[block.name].name
    # The tracks are those of the last.
    for given, named in reversed(by_keys.items()):
        carry_animation(given, keys, partial(_own_path, named), target)


def _own_path(named: Mapping[str, str], path: str) -> str | None:
    """Path of the carried key's property for that of the source's key, None for keys that are not carried."""
    found = KEY_PATH.match(path)
    if found is None:
        return None
    name = bpy.utils.unescape_identifier(found[1])
    if name not in named:
        return None
    return f'key_blocks["{bpy.utils.escape_identifier(named[name])}"]{found[2]}'


def _copy_drivers(
    route: Route, blocks: Sequence[bpy.types.ShapeKey], made: Mapping[str, bpy.types.ShapeKey]
) -> None:
    """Drivers of the keys' values and settings, instead of those that the target's keys had."""
    held = route.target.data.shape_keys.animation_data
    for block in blocks:
        given = route.keys_with(block.name).animation_data
        if given is None and held is None:
            continue
        held = held or route.target.data.shape_keys.animation_data_create()
        for setting in DRIVEN:
            path = _path(made[block.name], setting)
            old = held.drivers.find(path)
            if old is not None:
                held.drivers.remove(old)
            curve = given.drivers.find(_path(block, setting)) if given else None
            if curve is not None:
                held.drivers.from_existing(src_driver=curve).data_path = path


def _path(block: bpy.types.ShapeKey, setting: str) -> str:
    return f'key_blocks["{bpy.utils.escape_identifier(block.name)}"].{setting}'


KIND = Kind(
    "keys",
    "Shape Keys",
    "SHAPEKEY_DATA",
    "Carry shape keys with their ranges, animation, drivers and masks",
    names,
    prepare,
    {
        "scale_keys": BoolProperty(
            name="Scale Shape Keys",
            default=True,
            description="Make movements larger or smaller with the parts they move. Off: turn them only",
        ),
        "keep_contacts": BoolProperty(
            name="Keep Contacts",
            default=True,
            description="What a key brings together, as lids or lips, meets on the target too. Off, or where "
            "movements are turned only: it may stay apart or overlap",
        ),
        "skip_still": BoolProperty(
            name="Leave Out Still Keys",
            default=True,
            description="Make no keys that move nothing on the target, as those of a face on a shirt. Keys "
            "that move nothing on the source are carried",
        ),
    },
    words=("key", "keys"),
    effects={"keep_contacts": lambda options, _: options.scale_keys},
)
