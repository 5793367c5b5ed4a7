# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: weights carried by the core; locked groups and masked vertices keep what they have."""

from contextlib import contextmanager

import bmesh
import numpy as np
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from ..mesh_write import write_attribute
from .kind import Kind, Prepared
from .sides import names_on_target

# Weights that sum to this much more than 1 are single precision's.
SUM_ROUNDING = 1e-3
# On the target, where vertices were filled from their neighbours because their images were rejected.
FILLED = "match_filled"


def names(source):
    return [group.name for group in source.vertex_groups]


def prepare(route, wanted, options):
    groups, notes = names_on_target(wanted, options)
    locks = {group.name for group in route.target.vertex_groups if group.lock_weight}
    locked = np.array([name in locks for name in groups.values()], bool)
    own = read_weights(route.target)
    masked = _masked(route.target, own, options.group_mask)
    deforming = _deforming(route.source, wanted)
    carried = route.map.skin_weights(
        *_rows(route.source, wanted),
        len(groups),
        deforming=deforming,
        reject_below=options.reject_below,
        smoothing=options.smooth_weights,
        prune=options.prune,
        limit=options.limit if options.limit_total else None,
        normalize=options.normalize,
        locked=_locked(route, own, locked) if locks else None,
    )
    count = len(route.target_points)
    vertex = np.repeat(np.arange(count), np.diff(carried.starts))
    kept = masked[vertex]
    written = [name for name in groups.values() if name not in locks]
    place = np.cumsum(~locked) - 1
    weights = vertex[kept], place[carried.groups[kept]], carried.weights[kept]
    filled = np.zeros(count, bool)
    filled[carried.filled] = True
    if locked.any():
        notes.append(f"{locked.sum()} locked vertex groups of '{route.target.name}' were left as they are")
    notes += _beside(route, own, masked, written, weights)
    if filled.any():
        notes.append(
            f"{filled.sum()} vertices of '{route.target.name}' were filled from their neighbours: "
            f"see the attribute {FILLED}"
        )

    def write():
        write_weights(route.target, written, weights, masked)
        if filled.any() or FILLED in route.target.data.attributes:
            write_attribute(route.target.data, FILLED, "BOOLEAN", "POINT", filled)

    return Prepared(write, tuple(notes))


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


def _locked(route, own, locked):
    """What the target's locked deforming groups hold: which of ours they are, sum and number a vertex."""
    target = route.target
    held = np.array([group.lock_weight for group in target.vertex_groups], bool)
    bones = _bones(route.source) | _bones(target)
    held &= np.array([bones.get(group.name, not bones) for group in target.vertex_groups], bool)
    vertex, group, weight = own
    used = held[group]
    count = len(route.target_points)
    return (
        locked,
        np.bincount(vertex[used], weight[used], minlength=count),
        np.bincount(vertex[used & (weight > 0.0)], minlength=count),
    )


def _beside(route, own, masked, written, weights):
    """A note when groups of other bones, neither carried nor locked, lift the sums beyond one."""
    bones = _bones(route.source) | _bones(route.target)
    others = [
        group
        for group in route.target.vertex_groups
        if bones.get(group.name) and group.name not in written and not group.lock_weight
    ]
    count = len(route.target_points)
    vertex, group, weight = own
    kept = np.isin(group, [other.index for other in others]) & masked[vertex]
    ours = np.array([bones.get(name, False) for name in written], bool)[weights[1]]
    beside = np.bincount(vertex[kept], weight[kept], minlength=count)
    sums = np.bincount(weights[0][ours], weights[2][ours], minlength=count)
    over = (beside > 0.0) & (beside + sums > 1.0 + SUM_ROUNDING)
    if not over.any():
        return []
    named = [other.name for other in others if over[vertex[group == other.index]].any()]
    return [
        f"Weights of {over.sum()} vertices of '{route.target.name}' sum to more than 1, because groups of "
        f"other bones move them too: {', '.join(named)}. Remove these groups, or lock those that shall stay "
        "and transfer again"
    ]


def _bones(obj):
    """Whether each bone of the object's armatures deforms, by its name."""
    return {
        bone.name: bone.use_deform
        for modifier in obj.modifiers
        if modifier.type == "ARMATURE" and modifier.object is not None
        for bone in modifier.object.data.bones
    }


def _deforming(source, wanted):
    """True for each group that moves with a bone; all of them when the source has no armature to ask."""
    bones = _bones(source)
    return np.array([bones.get(name, not bones) for name in wanted], bool)


@contextmanager
def _kept_shapes(mesh):
    """Coordinates of mesh and shape keys stay: where they disagree, `BMesh.to_mesh` would move the keys."""
    blocks = [] if mesh.shape_keys is None else list(mesh.shape_keys.key_blocks)
    places = [mesh.vertices, *(block.data for block in blocks)]
    kept = [_coordinates(place) for place in places[:2]]
    if len(kept) < 2 or np.array_equal(*kept):
        yield
        return
    kept += [_coordinates(place) for place in places[2:]]
    yield
    for place, values in zip([mesh.vertices, *(block.data for block in blocks)], kept, strict=True):
        place.foreach_set("co", values)


def _coordinates(place):
    values = np.empty(len(place) * 3, np.float32)
    place.foreach_get("co", values)
    return values


def write_weights(target, wanted, weights, masked=None):
    """Replace these groups of the target at the masked vertices; its other groups stay."""
    slots = []
    for name in wanted:
        group = target.vertex_groups.get(name) or target.vertex_groups.new(name=name)
        slots.append(group.index)
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
            description="Exchange .L and .R in the names of vertex groups, shape keys and bones: for a match "
            "that turned left into right",
        ),
        "group_mask": StringProperty(
            name="Mask",
            description="A vertex group of the target: only its vertices are written. Empty: all are",
        ),
    },
)
