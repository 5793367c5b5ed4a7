# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of a mesh as arrays, and the bones by which they move it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import bmesh
import bpy
import numpy as np
from numpy.typing import NDArray

from ..typed import Entries, Flags
from .copies import meant_by


def read_weights(obj: bpy.types.Object) -> Entries:
    """All weights of an object's mesh as arrays (vertex, group, weight), sorted by vertex."""
    counts, group, weight = [], [], []
    for vertex in obj.data.vertices:
        entries = vertex.groups
        counts.append(len(entries))
        for entry in entries:
            group.append(entry.group)
            weight.append(entry.weight)
    vertex = np.repeat(np.arange(len(counts)), counts)
    return vertex, np.array(group, np.int64), np.array(weight, np.float64)


@contextmanager
def _kept_shapes(mesh: bpy.types.Mesh) -> Iterator[None]:
    """Coordinates of mesh and shape keys stay: where they disagree, `BMesh.to_mesh` would move the keys."""
    blocks = [] if mesh.shape_keys is None else list(mesh.shape_keys.key_blocks)
    places = [mesh.vertices, *(block.data for block in blocks)]
    kept = [_coordinates(place) for place in places[:2]]
    if len(kept) < 2 or np.array_equal(kept[0], kept[1]):
        yield
        return
    kept += [_coordinates(place) for place in places[2:]]
    yield
    for place, values in zip([mesh.vertices, *(block.data for block in blocks)], kept, strict=True):
        place.foreach_set("co", values)


def _coordinates(place: Any) -> NDArray[np.float32]:
    values = np.empty(len(place) * 3, np.float32)
    place.foreach_get("co", values)
    return values


def write_weights(
    target: bpy.types.Object, wanted: Sequence[str], weights: Entries, masked: Flags | None = None
) -> None:
    """Replace these groups of the target at the masked vertices; its other groups stay."""
    slots = []
    for name in wanted:
        held = target.vertex_groups.get(name) or target.vertex_groups.new(name=name)
        slots.append(held.index)
    vertex, group, weight = weights
    entries = np.array(slots, np.int64)[group].tolist()
    with _kept_shapes(target.data):
        edited = bmesh.new()
        try:
            edited.from_mesh(target.data)
            deform = edited.verts.layers.deform.verify()
            rows = [vert[deform] for vert in edited.verts]
            chosen = range(len(rows)) if masked is None else np.flatnonzero(masked).tolist()
            ours = set(slots)
            for place in chosen:
                row = rows[place]
                for slot in ours.intersection(row.keys()):
                    del row[slot]
            for place, slot, value in zip(vertex.tolist(), entries, weight.tolist(), strict=True):
                rows[place][slot] = value
            edited.to_mesh(target.data)
        finally:
            edited.free()


def copy_groups(target: bpy.types.Object, copies: Mapping[str, str]) -> None:
    """Second vertex groups with the weights of others: their names by those of the first."""
    if not copies:
        return
    vertex, group, weight = read_weights(target)
    place = np.full(len(target.vertex_groups), -1)
    place[[target.vertex_groups[name].index for name in copies]] = np.arange(len(copies))
    held = place[group] >= 0
    write_weights(target, list(copies.values()), (vertex[held], place[group[held]], weight[held]))


def deforming_bones(obj: bpy.types.Object) -> dict[str, bool]:
    """Whether each bone of the object's armatures deforms, by its name."""
    return {bone.name: bone.use_deform for rig in rigs(obj) for bone in rig.data.bones}


def armature_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    return [m for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None]


def rigs(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The armature objects that deform an object, each once: those of modifiers that are on, if any is."""
    modifiers = [modifier for each in meant_by(obj) for modifier in armature_modifiers(each)]
    shown = [modifier for modifier in modifiers if modifier.show_viewport]
    return list(dict.fromkeys(modifier.object for modifier in shown or modifiers))
