# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: weights carried by the core; locked groups and masked vertices keep what they have."""

import bmesh
import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from ..mesh_write import write_attribute
from .kind import Kind, Prepared

# On the target, where vertices were filled from their neighbours because their images were rejected.
FILLED = "match_filled"


def names(source):
    return [group.name for group in source.vertex_groups]


def prepare(route, wanted, options):
    groups = _targets(route, wanted, options)
    own = read_weights(route.target)
    masked = _masked(route.target, own, options.group_mask)
    deforming = _deforming(route.source, list(groups))
    carried = route.map.skin_weights(
        *_rows(route.source, list(groups)),
        len(groups),
        deforming=deforming,
        reject_below=options.reject_below,
        smoothing=options.smooth_weights,
        prune=options.prune,
        limit=options.limit if options.limit_total else None,
        normalize=options.normalize,
        room=_room(route, own, deforming.any()),
    )
    count = len(route.target_points)
    vertex = np.repeat(np.arange(count), np.diff(carried.starts))
    kept = masked[vertex]
    weights = vertex[kept], carried.groups[kept], carried.weights[kept]
    filled = np.zeros(count, bool)
    filled[carried.filled] = True
    notes = []
    locked = len(wanted) - len(groups)
    if locked:
        notes.append(f"{locked} locked vertex groups of '{route.target.name}' were left as they are")
    if filled.any():
        notes.append(
            f"{filled.sum()} vertices of '{route.target.name}' were filled from their neighbours: "
            f"see the attribute {FILLED}"
        )

    def write():
        write_weights(route.target, list(groups.values()), weights, masked)
        if filled.any() or FILLED in route.target.data.attributes:
            write_attribute(route.target.data, FILLED, "BOOLEAN", "POINT", filled)

    return Prepared(write, tuple(notes))


def _targets(route, wanted, options):
    """The target's name for each of the source's groups, without those that are locked there."""
    named = {name: bpy.utils.flip_name(name) if options.mirror_names else name for name in wanted}
    locks = {group.name for group in route.target.vertex_groups if group.lock_weight}
    return {name: other for name, other in named.items() if other not in locks}


def read_weights(obj):
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


def _rows(source, wanted):
    """Compressed rows (starts, place in `wanted`, weight) of the wanted groups."""
    vertex, group, weight = read_weights(source)
    place = np.full(max(len(source.vertex_groups), group.max(initial=-1) + 1), -1)
    place[[source.vertex_groups[name].index for name in wanted]] = np.arange(len(wanted))
    kept = place[group] >= 0
    counts = np.bincount(vertex[kept], minlength=len(source.data.vertices))
    return np.append(0, np.cumsum(counts)), place[group[kept]], weight[kept]


def _masked(target, own, name):
    """Vertices that may be written: all, or those of the group `name`."""
    count = len(target.data.vertices)
    if not name:
        return np.ones(count, bool)
    group = target.vertex_groups.get(name)
    if group is None:
        raise UnusableObjectError(
            f"'{target.name}' has no vertex group '{name}' for the mask. Choose another one or none"
        )
    vertex, groups, weight = own
    masked = np.zeros(count, bool)
    masked[vertex[(groups == group.index) & (weight > 0.0)]] = True
    return masked


def _room(route, own, any_deforming):
    """What the target's locked deforming groups leave of each vertex's sum, or None without such groups."""
    target = route.target
    locked = np.array([group.lock_weight for group in target.vertex_groups], bool)
    if not any_deforming or not locked.any():
        return None
    locked &= _deforming(route.source, [group.name for group in target.vertex_groups])
    vertex, group, weight = own
    used = locked[group]
    return 1.0 - np.bincount(vertex[used], weight[used], minlength=len(route.target_points))


def _deforming(source, wanted):
    """True for each group that moves with a bone; all of them when the source has no armature to ask."""
    bones = {
        bone.name: bone.use_deform
        for modifier in source.modifiers
        if modifier.type == "ARMATURE" and modifier.object is not None
        for bone in modifier.object.data.bones
    }
    return np.array([bones.get(name, not bones) for name in wanted], bool)


def write_weights(target, wanted, weights, masked=None):
    """Replace these groups of the target at the masked vertices; its other groups stay."""
    slots = []
    for name in wanted:
        group = target.vertex_groups.get(name) or target.vertex_groups.new(name=name)
        slots.append(group.index)
    vertex, group, weight = weights
    entries = np.array(slots, np.int64)[group].tolist()
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


KIND = Kind(
    "groups",
    "Vertex Groups",
    "GROUP_VERTEX",
    "Carry vertex groups and their weights",
    names,
    prepare,
    {
        "limit_total": BoolProperty(
            name="Limit Total", default=False, description="Keep only the strongest weights of each vertex"
        ),
        "limit": IntProperty(
            name="Weights per Vertex", default=4, min=1, soft_max=8, description="Game engines usually take 4"
        ),
        "normalize": BoolProperty(
            name="Normalize",
            default=True,
            description="Scale each vertex's weights back to the sum that came across: 1 if the source's "
            "weights sum to 1",
        ),
        "prune": FloatProperty(
            name="Prune Below",
            default=0.001,
            min=0.0,
            max=0.5,
            precision=3,
            description="Drop weights smaller than this",
        ),
        "smooth_weights": IntProperty(
            name="Smooth",
            default=0,
            min=0,
            soft_max=20,
            description="Rounds of smoothing along the target's surface",
        ),
        "reject_below": FloatProperty(
            name="Reject Below",
            default=0.0,
            min=0.0,
            max=1.0,
            subtype="FACTOR",
            description="Where the match is less sure than this, fill weights from the surroundings instead; "
            "0 takes every image",
        ),
        "mirror_names": BoolProperty(
            name="Mirror Names",
            default=False,
            description="Exchange .L and .R in the names: for a match that turned left into right",
        ),
        "group_mask": StringProperty(
            name="Mask",
            description="A vertex group of the target: only its vertices are written. Empty: all are",
        ),
    },
)
