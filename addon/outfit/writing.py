# SPDX-License-Identifier: GPL-3.0-or-later
"""A fitted outfit in the scene: copies of its objects, on the target's rig."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import character, mesh_read, mesh_write
from ..mesh_read import UnusableObjectError
from ..transfer import attachment
from ..transfer.armatures import AFTER_ARMATURE
from ..transfer.companions import masks
from ..transfer.copies import copied
from ..transfer.listed import listed
from ..transfer.redirect import point, point_drivers
from ..transfer.shape_keys import LOWEST, read_key
from ..transfer.weights import write_weights
from ..typed import Exchanged, Flags, Floats
from . import bones as bones_module
from . import live

if TYPE_CHECKING:
    from .fitting import Fitted, Worn
    from .reading import Garment, Rig, Wish


def write(
    context: bpy.types.Context, fitted: Fitted, wearer_name: str
) -> tuple[list[bpy.types.Object], list[str]]:
    """Put a fitted outfit into the scene; returns the copies and words.

    Raises `UnusableObjectError`, before anything is written, where an object was edited or deleted since it
    was read.
    """
    wish = fitted.wish
    garments = [_unchanged(each.uid, each.name, each.mesh_uid, len(each.points)) for each in wish.garments]
    bodies = [_present(uid, name, own) for uid, name, own in wish.bodies]
    lead = bodies[0]
    given = [mesh_read.find_object(bpy.data.objects, rig.uid) for rig in _rigs(wish)]
    rigs_by_uid = {rig.session_uid: rig for rig in given if rig is not None}
    rig = None
    if wish.rigs[1] is not None:
        rig = mesh_read.present(wish.rigs[1].uid, wish.rigs[1].name)
    with mesh_write.object_mode(context, [*garments, *bodies]):
        new, notes = bones_module.bring(fitted, rig, rigs_by_uid) if rig is not None else ([], [])
        copies = []
        for garment, worn, obj in zip(wish.garments, fitted.worn, garments, strict=True):
            before = attachment.copy_of(lead, obj)
            own = before or attachment.new_copy(lead, obj)
            _fill(own, obj, garment, worn, fitted, lead, rig, new)
            copies.append(own)
        notes += _redirect(fitted, garments, copies, bodies, rig, given, new)
        for own, worn in zip(copies, fitted.worn, strict=True):
            _follow_body(own, worn, bodies)
        if fitted.hidden is not None:
            notes += _hide(fitted, wearer_name, bodies)
        context.view_layer.update()
    live.keep(fitted, copies)
    return copies, [*wish.notes, *notes]


def _rigs(wish: Wish) -> Iterable[Rig]:
    """The source's rigs, each once."""
    found = {rig.uid: rig for rig in (wish.rigs[0], *(each.rig for each in wish.garments)) if rig is not None}
    return found.values()


def _unchanged(uid: int, name: str, mesh_uid: int, count: int) -> bpy.types.Object:
    obj = mesh_read.present(uid, name)
    if obj.type != "MESH" or obj.data.session_uid != mesh_uid or len(obj.data.vertices) != count:
        raise UnusableObjectError(f"'{obj.name}' was edited since it was read. Fit it again")
    return obj


def _present(uid: int, name: str, own: slice) -> bpy.types.Object:
    obj = mesh_read.present(uid, name)
    if obj.type != "MESH" or len(obj.data.vertices) != own.stop - own.start:
        raise UnusableObjectError(f"'{obj.name}' was edited since it was read. Match and fit again")
    return obj


def _fill(
    own: bpy.types.Object,
    obj: bpy.types.Object,
    garment: Garment,
    worn: Worn,
    fitted: Fitted,
    lead: bpy.types.Object,
    rig: bpy.types.Object | None,
    new: Sequence[str],
) -> None:
    """Give a copy its mesh with places, keys, weights and modifiers, and hang it on the target."""
    _own_mesh(own, obj)
    live.put(own, fitted.places[garment.vertices] @ fitted.wish.back, _local(worn.keys, fitted.wish.back))
    for name, offsets in _local(worn.body_keys, fitted.wish.back).items():
        _add_key(own, name, offsets)
    bone = new[worn.bone] if isinstance(worn.bone, int) else worn.bone
    if rig is not None and not garment.bone:
        _write_groups(own, garment, worn, new)
    _deform(own, None if bone else rig)
    attachment.hang(own, lead, rig or lead, bone)


def _local(keys: Mapping[str, Floats], back: Floats) -> dict[str, Floats]:
    return {name: offsets @ back for name, offsets in keys.items()}


def _own_mesh(own: bpy.types.Object, obj: bpy.types.Object) -> None:
    """A fresh copy of the garment's mesh in place of the one that the copy has."""
    before = own.data
    own.data = copied(obj.data)
    own.data.name = own.name
    if before != obj.data and not before.users:
        bpy.data.meshes.remove(before)
    # It is no target of any match.
    own.data.spectral_match.target_fingerprint = ""
    own.spectral_match_source = None
    own.spectral_match_pieces.clear()
    own.spectral_match_worn = "AUTOMATIC"
    for name in [each.name for each in own.data.attributes if each.name.startswith(mesh_write.OURS)]:
        own.data.attributes.remove(own.data.attributes[name])


def _add_key(own: bpy.types.Object, name: str, offsets: Floats) -> None:
    """A shape key by which a garment follows the body, unless it has one of this name."""
    if own.data.shape_keys is None:
        own.shape_key_add(name="Basis", from_mix=False)
    held = own.data.shape_keys
    if name in held.key_blocks:
        return
    shown = own.active_shape_key_index
    block = own.shape_key_add(name=name, from_mix=False)
    own.active_shape_key_index = shown
    block.data.foreach_set("co", (read_key(held.reference_key) + offsets).astype(np.float32).ravel())


def _write_groups(own: bpy.types.Object, garment: Garment, worn: Worn, new: Sequence[str]) -> None:
    """Weights for the target's bones in place of those for the source's."""
    named = [new[name] if isinstance(name, int) else name for name in worn.names]
    asked = list(masks(own))
    if garment.rig is not None:
        for name in garment.rig.names:
            if name in own.vertex_groups and len(garment.rows.weight):
                own.vertex_groups.remove(own.vertex_groups[name])
    used, number = np.unique(worn.rows.bone, return_inverse=True)
    write_weights(own, [named[bone] for bone in used], (worn.rows.vertex, number, worn.rows.weight))
    table = {before: new[to] if isinstance(to, int) else to for before, to in worn.renamed.items()}
    for modifier, setting, name in asked:
        setattr(modifier, setting, table.get(name, name))


def _deform(own: bpy.types.Object, rig: bpy.types.Object | None) -> None:
    """Leave one Armature modifier, on this rig, or none."""
    held = [modifier for modifier in own.modifiers if modifier.type == "ARMATURE"]
    for modifier in held[0 if rig is None else 1 :]:
        own.modifiers.remove(modifier)
    if rig is None:
        return
    if held:
        held[0].object = rig
        held[0].show_viewport = held[0].show_render = True
        return
    types = [modifier.type for modifier in own.modifiers]
    whole = max((i + 1 for i, each in enumerate(types) if each == "MIRROR"), default=0)
    place = next((i for i, each in enumerate(types) if i >= whole and each in AFTER_ARMATURE), None)
    made = own.modifiers.new(rig.name, "ARMATURE")
    made.object = rig
    if place is not None:
        own.modifiers.move(own.modifiers.find(made.name), place)


def _redirect(
    fitted: Fitted,
    garments: Sequence[bpy.types.Object],
    copies: Sequence[bpy.types.Object],
    bodies: Sequence[bpy.types.Object],
    rig: bpy.types.Object | None,
    given: Sequence[bpy.types.Object | None],
    new: Sequence[str],
) -> list[str]:
    """Let what the copies look at be the target's; returns words on what has to be bound or was left."""
    wish = fitted.wish
    source = mesh_read.find_object(bpy.data.objects, wish.source_uid)
    whole = character.of(source) if source is not None else None
    exchanged: dict[bpy.types.ID, bpy.types.ID] = {}
    worn_by = whole.whole if whole is not None else ()
    for obj in worn_by:
        exchanged |= _with_data(obj, bodies[0])
    if rig is not None:
        for each in filter(None, given):
            exchanged |= {each: rig, each.data: rig.data}
    for obj, own in zip(garments, copies, strict=True):
        exchanged |= _with_data(obj, own)
    table = dict(fitted.partners)
    table.update({bone.name: name for bone, name in zip(fitted.bones, new, strict=False)})
    names, notes = bones_module.Names(table), []
    # Keys of the source for which the target has none at all.
    lost = {obj.data.shape_keys for obj in worn_by if obj.data.shape_keys is not None} - set(exchanged)
    left, bound = [], []
    for obj, own in zip(garments, copies, strict=True):
        for modifier in own.modifiers:
            point(modifier, exchanged, names)
            if getattr(modifier, "is_bound", False) or getattr(modifier, "is_bind", False):
                bound.append(f"{modifier.name} of '{own.name}'")
        for held in (own, own.data.shape_keys):
            animated = getattr(held, "animation_data", None)
            for curve in list(animated.drivers) if animated is not None else ():
                point_drivers([curve], exchanged, names)
                if not bones_module.finds_all(curve) or _sees(curve, lost):
                    left.append(f"{curve.data_path} of '{obj.name}'")
                    animated.drivers.remove(curve)
    if bound:
        notes.append(f"Modifiers have to be bound again on the copies: {listed(bound)}")
    if left:
        notes.append(f"'{wish.label}' lacks what these drivers need, so they were not copied: {listed(left)}")
    return notes


def _sees(curve: bpy.types.FCurve, ids: Container[bpy.types.ID]) -> bool:
    """Whether a driver looks at one of these."""
    return any(seen.id in ids for variable in curve.driver.variables for seen in variable.targets)


def _with_data(before: bpy.types.Object, after: bpy.types.Object) -> Exchanged:
    found = {before: after, before.data: after.data}
    keys, own = before.data.shape_keys, after.data.shape_keys
    if keys is not None and own is not None:
        found[keys] = own
    return found


def _follow_body(own: bpy.types.Object, worn: Worn, bodies: Sequence[bpy.types.Object]) -> None:
    """Drive the keys that a garment has for those of the body by them."""
    for name in worn.body_keys:
        model = next(
            block
            for obj in bodies
            if obj.data.shape_keys is not None
            and (block := obj.data.shape_keys.key_blocks.get(name)) is not None
        )
        block = own.data.shape_keys.key_blocks[name]
        animated = own.data.shape_keys.animation_data
        path = f'key_blocks["{bpy.utils.escape_identifier(name)}"].value'
        if animated is not None and animated.drivers.find(path) is not None:
            continue
        block.slider_min = LOWEST
        block.slider_max, block.slider_min = model.slider_max, model.slider_min
        driver = block.driver_add("value").driver
        driver.type = "AVERAGE"
        variable = driver.variables.new()
        variable.type = "SINGLE_PROP"
        seen = variable.targets[0]
        seen.id_type, seen.id, seen.data_path = "KEY", model.id_data, path


def _with_all_around(mesh: bpy.types.Mesh, hidden: Flags) -> Flags:
    """Hidden vertices whose faces have hidden ones alone: a Mask modifier leaves out whole faces."""
    if not len(mesh.polygons):
        return hidden
    corners = mesh_read.corner_vertices(mesh)
    starts, counts = np.empty((2, len(mesh.polygons)), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", counts)
    shown = np.repeat(~np.logical_and.reduceat(hidden[corners], starts), counts)
    found = hidden.copy()
    found[corners[shown]] = False
    return found


def _hide(fitted: Fitted, wearer_name: str, bodies: Sequence[bpy.types.Object]) -> list[str]:
    """A group of what nobody sees of each body, and a Mask modifier that leaves it out."""
    name, notes = f"Hidden by {wearer_name}", []
    assert fitted.hidden is not None
    for obj, (_, _, own) in zip(bodies, fitted.wish.bodies, strict=True):
        here = np.flatnonzero(_with_all_around(obj.data, fitted.hidden[own]))
        group = obj.vertex_groups.get(name)
        if not len(here) and group is None:
            continue
        if name in obj.data.attributes:
            notes.append(f"'{obj.name}' has an attribute named '{name}': its skin was not hidden")
            continue
        group = group or obj.vertex_groups.new(name=name)
        group.remove(range(len(obj.data.vertices)))
        group.add(here.tolist(), 1.0, "REPLACE")
        modifier = obj.modifiers.get(name)
        if modifier is None:
            modifier = obj.modifiers.new(name, "MASK")
        if modifier.type == "MASK":
            modifier.vertex_group, modifier.invert_vertex_group = name, True
    return notes
