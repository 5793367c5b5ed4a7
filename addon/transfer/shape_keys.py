# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys: displacements in local frames, each relative to its own reference key, with their settings."""

import numpy as np
from bpy.props import BoolProperty

from ..mesh_read import UnusableObjectError
from .kind import Kind, Prepared

SETTINGS = ("slider_min", "slider_max", "value", "mute", "interpolation", "vertex_group")
DRIVEN = ("value", "mute", "slider_min", "slider_max")


def names(source):
    keys = source.data.shape_keys
    return [] if keys is None else [block.name for block in keys.key_blocks[1:]]


def prepare(route, wanted, options):
    keys = route.source.data.shape_keys
    if keys is None or not keys.use_relative:
        raise UnusableObjectError(
            f"The shape keys of '{route.source.name}' are absolute; only relative ones can be carried. "
            "Check Relative in its Shape Keys panel"
        )
    blocks = [keys.key_blocks[name] for name in _with_references(keys, wanted)]
    offsets = {}
    for block in blocks:
        delta = read_key(block) - read_key(block.relative_key)
        offsets[block.name] = route.map.displacements(delta, turn_only=not options.scale_keys)
    groups = {block.vertex_group for block in blocks if block.vertex_group}
    missing = [name for name in sorted(groups) if name not in route.target.vertex_groups]
    notes = []
    if missing:
        notes.append(
            f"Shape keys are masked by groups that '{route.target.name}' lacks, unless these are carried "
            f"too: {', '.join(missing)}"
        )
    return Prepared(lambda: _write(route, blocks, offsets), tuple(notes))


def _with_references(keys, wanted):
    """Wanted keys in an order in which each comes after the key it is relative to, those included."""
    ordered = []

    def add(block, above=()):
        if block == keys.reference_key or block.name in ordered or block.name in above:
            return
        add(block.relative_key, (*above, block.name))
        ordered.append(block.name)

    for name in wanted:
        add(keys.key_blocks[name])
    return ordered


def read_key(block):
    """Coordinates of a shape key, (n, 3)."""
    values = np.empty(len(block.data) * 3, np.float32)
    block.data.foreach_get("co", values)
    return values.reshape(-1, 3).astype(np.float64)


def _write(route, blocks, offsets):
    target = route.target
    if target.data.shape_keys is None:
        target.shape_key_add(name=blocks[0].id_data.reference_key.name, from_mix=False)
    keys = target.data.shape_keys
    shown = target.active_shape_key_index
    made = {}
    for block in blocks:
        own = keys.key_blocks.get(block.name)
        if own is None or own == keys.reference_key:
            own = target.shape_key_add(name=block.name, from_mix=False)
        # A key that is relative to itself in a circle has no reference of its own.
        own.relative_key = made.get(block.relative_key.name, keys.reference_key)
        # Single precision: where the displacement is zero, the sum is the reference itself.
        coordinates = read_key(own.relative_key) + offsets[block.name]
        own.data.foreach_set("co", coordinates.astype(np.float32).ravel())
        for setting in SETTINGS:
            setattr(own, setting, getattr(block, setting))
        made[block.name] = own
    target.active_shape_key_index = shown
    _copy_drivers(route, blocks, made)


def _copy_drivers(route, blocks, made):
    """Drivers of the keys' values and settings; those that look at the source look at the target now."""
    animation = blocks[0].id_data.animation_data
    if animation is None:
        return
    keys = route.target.data.shape_keys
    exchanged = {
        route.source: route.target,
        route.source.data: route.target.data,
        blocks[0].id_data: keys,
    }
    for curve in animation.drivers:
        for block in blocks:
            path = f'key_blocks["{_escaped(block.name)}"].'
            setting = curve.data_path.removeprefix(path)
            if setting == curve.data_path or setting not in DRIVEN:
                continue
            new_path = f'key_blocks["{_escaped(made[block.name].name)}"].{setting}'
            held = keys.animation_data_create()
            old = held.drivers.find(new_path)
            if old is not None:
                held.drivers.remove(old)
            copy = held.drivers.from_existing(src_driver=curve)
            copy.data_path = new_path
            for variable in copy.driver.variables:
                for seen in variable.targets:
                    if seen.id in exchanged:
                        seen.id = exchanged[seen.id]


def _escaped(name):
    return name.replace("\\", "\\\\").replace('"', '\\"')


KIND = Kind(
    "keys",
    "Shape Keys",
    "SHAPEKEY_DATA",
    "Carry shape keys with their ranges, drivers and masks",
    names,
    prepare,
    {
        "scale_keys": BoolProperty(
            name="Scale Shape Keys",
            default=True,
            description="Make movements larger or smaller with the parts they move. Off: turn them only",
        )
    },
)
