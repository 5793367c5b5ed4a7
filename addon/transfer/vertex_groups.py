# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: weights carried barycentrically, then pruned, limited and normalised."""

import bmesh
import numpy as np
from bpy.props import BoolProperty, FloatProperty, IntProperty

from .kind import Kind, Prepared


def names(source):
    return [group.name for group in source.vertex_groups]


def prepare(route, wanted, options):
    groups = [route.source.vertex_groups[name].index for name in wanted]
    weights = _carry_weights(route, read_weights(route.source.data), groups)
    weights = _prune(weights, options.prune)
    if options.limit_total:
        weights = limit(weights, options.limit, _deforming(route.source, wanted), options.normalize)
    return Prepared(lambda: _write_weights(route.target, wanted, weights))


def read_weights(mesh):
    """All weights of a mesh as arrays (vertex, group, weight), sorted by vertex."""
    counts, group, weight = [], [], []
    for vertex in mesh.vertices:
        entries = vertex.groups
        counts.append(len(entries))
        for entry in entries:
            group.append(entry.group)
            weight.append(entry.weight)
    vertex = np.repeat(np.arange(len(counts)), counts)
    return vertex, np.array(group, np.int64), np.array(weight, np.float64)


def _carry_weights(route, weights, groups):
    """Sum the weights of the three corners of each vertex's triangle: (vertex, place in `groups`, weight)."""
    vertex, group, weight = weights
    place = np.full(max([*groups, *group.tolist()], default=0) + 1, -1)
    place[groups] = np.arange(len(groups))
    kept = place[group] >= 0 if len(group) else np.zeros(0, bool)
    vertex, group, weight = vertex[kept], place[group[kept]] if len(group) else group, weight[kept]
    count = np.bincount(vertex, minlength=len(route.source.data.vertices))
    first = np.cumsum(count) - count
    keys, parts = [], []
    for k in range(3):
        corner = route.triangles[route.face, k]
        many = count[corner]
        receiver = np.repeat(np.arange(len(corner)), many)
        # Entry number: first entry of the corner's vertex, plus 0, 1, 2 … within it.
        within = np.arange(len(receiver)) - np.repeat(np.cumsum(many) - many, many)
        entry = np.repeat(first[corner], many) + within
        keys.append(receiver * len(groups) + group[entry])
        parts.append(np.repeat(route.barycentric[:, k], many) * weight[entry])
    key, inverse = np.unique(np.concatenate(keys), return_inverse=True)
    total = np.bincount(inverse, np.concatenate(parts), minlength=len(key))
    return key // max(len(groups), 1), key % max(len(groups), 1), total


def _prune(weights, threshold):
    vertex, group, weight = weights
    kept = weight > threshold
    return vertex[kept], group[kept], weight[kept]


def _deforming(source, wanted):
    """True for each group that moves with a bone; all of them when the source has no armature to ask."""
    bones = {
        bone.name: bone.use_deform
        for modifier in source.modifiers
        if modifier.type == "ARMATURE" and modifier.object is not None
        for bone in modifier.object.data.bones
    }
    return np.array([bones.get(name, not bones) for name in wanted], bool)


def limit(weights, most, deforming, normalize):
    """Keep each vertex's `most` strongest deforming weights; with `normalize` scale them to their earlier
    sum.
    """
    vertex, group, weight = weights
    counted = deforming[group] if len(group) else np.zeros(0, bool)
    limited = np.flatnonzero(counted)
    order = limited[np.lexsort((-weight[limited], vertex[limited]))]
    sorted_vertex = vertex[order]
    start = np.searchsorted(sorted_vertex, sorted_vertex)
    strong = order[np.arange(len(order)) - start < most]
    kept = ~counted
    kept[strong] = True
    if normalize and len(vertex):
        size = vertex.max() + 1
        before = np.bincount(vertex[limited], weight[limited], minlength=size)
        after = np.bincount(vertex[strong], weight[strong], minlength=size)
        scale = np.divide(before, after, out=np.ones(size), where=after > 0.0)
        weight = np.where(counted, weight * scale[vertex], weight)
    return vertex[kept], group[kept], np.minimum(weight[kept], 1.0)


def _write_weights(target, wanted, weights):
    """Replace these groups of the target; its other groups stay."""
    every = list(range(len(target.data.vertices)))
    slots = []
    for name in wanted:
        group = target.vertex_groups.get(name)
        if group is None:
            group = target.vertex_groups.new(name=name)
        else:
            group.remove(every)
        slots.append(group.index)
    vertex, group, weight = weights
    slot = np.array(slots, np.int64)[group].tolist() if len(group) else []
    edited = bmesh.new()
    try:
        edited.from_mesh(target.data)
        deform = edited.verts.layers.deform.verify()
        edited.verts.ensure_lookup_table()
        layer = [vert[deform] for vert in edited.verts]
        for where, index, value in zip(vertex.tolist(), slot, weight.tolist(), strict=True):
            layer[where][index] = value
        edited.to_mesh(target.data)
    finally:
        edited.free()


OPTIONS = {
    "limit_total": BoolProperty(
        name="Limit Total", default=False, description="Keep only the strongest weights of each vertex"
    ),
    "limit": IntProperty(
        name="Weights per Vertex", default=4, min=1, soft_max=8, description="Game engines usually take 4"
    ),
    "normalize": BoolProperty(
        name="Normalize",
        default=True,
        description="After limiting, scale each vertex's weights back to the sum that came across: 1 if the "
        "source's weights sum to 1",
    ),
    "prune": FloatProperty(
        name="Prune Below",
        default=0.001,
        min=0.0,
        max=0.5,
        precision=3,
        description="Drop weights smaller than this",
    ),
}

KIND = Kind(
    "groups",
    "Vertex Groups",
    "GROUP_VERTEX",
    "Carry vertex groups and their weights",
    names,
    prepare,
    OPTIONS,
)
