# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: weights carried by the core; locked groups and masked vertices keep what they have."""

from contextlib import contextmanager

import bmesh
import numpy as np
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from ..mesh_write import write_attribute
from .kind import Kind, Prepared
from .listed import listed

# Weights that sum to this much more than 1 are single precision's.
SUM_ROUNDING = 1e-3
# On the target, where vertices were filled from their neighbours because their images were rejected.
FILLED = "match_filled"


def names(source):
    return [group.name for group in source.vertex_groups]


def prepare(route, wanted, options):
    groups, notes = route.sides.of_all(wanted)
    locks = {group.name for group in route.target.vertex_groups if group.lock_weight}
    locked = np.array([name in locks for name in groups.values()], bool)
    own = read_weights(route.target)
    masked = _masked(route.target, own, options.group_mask)
    deforming = _deforming(route.source, wanted)
    carried = route.map.skin_weights(
        *_rows(route.body, wanted),
        len(groups),
        deforming=deforming,
        reject_below=options.reject_below,
        smoothing=options.smooth_weights,
        prune=options.prune,
        limit=options.limit if options.limit_total else None,
        normalize=options.normalize,
        locked=_locked(route, wanted, own, locked) if locks else None,
    )
    count = len(route.target_points)
    vertex = np.repeat(np.arange(count), np.diff(carried.starts))
    kept = masked[vertex]
    written = [name for name in groups.values() if name not in locks]
    place = np.cumsum(~locked) - 1
    weights = vertex[kept], place[carried.groups[kept]], carried.weights[kept]
    if options.mix < 1.0:
        weights = _mixed(route.target, own, masked, written, weights, options)
    filled = np.zeros(count, bool)
    filled[carried.filled] = True
    if locked.any():
        notes.append(f"{locked.sum()} locked vertex groups of '{route.target.name}' were left as they are")
    others, words = _others(route, own, masked, written, weights, options)
    notes += words
    if filled.any():
        notes.append(
            f"{filled.sum()} vertices of '{route.target.name}' were filled from their neighbours: "
            f"see the attribute {FILLED}"
        )

    def write():
        write_weights(route.target, written, weights, masked)
        for names, values, there in others:
            write_weights(route.target, names, values, there)
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


def _locked(route, wanted, own, locked):
    """What the target's locked deforming groups hold: which of ours they are, sum and number a vertex.

    Of the sum they first take what the source has in groups that are not wanted.
    """
    target = route.target
    held = np.array([group.lock_weight for group in target.vertex_groups], bool)
    bones = _bones(route.source) | _bones(target)
    held &= np.array([bones.get(group.name, not bones) for group in target.vertex_groups], bool)
    vertex, group, weight = own
    used = held[group]
    count = len(route.target_points)
    return (
        locked,
        np.clip(_sums(vertex[used], weight[used], count) - _left_behind(route, wanted), 0.0, None),
        np.bincount(vertex[used & (weight > 0.0)], minlength=count),
    )


def _mixed(target, own, masked, written, weights, options):
    """The share `mix` of the carried weights and the rest of what the target has in these groups."""
    place = np.full(max(len(target.vertex_groups), 1), -1)
    for at, name in enumerate(written):
        group = target.vertex_groups.get(name)
        if group is not None:
            place[group.index] = at
    vertex, group, weight = own
    kept = masked[vertex]
    kept[kept] = place[group[kept]] >= 0
    parts = (
        (weights[0], weights[1], options.mix * weights[2]),
        (vertex[kept], place[group[kept]], (1.0 - options.mix) * weight[kept]),
    )
    vertex, group, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
    entry, joined = np.unique(vertex * len(written) + group, return_inverse=True)
    weight = np.bincount(joined, weight, minlength=len(entry))
    held = weight >= options.prune
    return entry[held] // len(written), entry[held] % len(written), weight[held]


def _left_behind(route, wanted):
    """Weights of the source's deforming groups that are not wanted, at each vertex of the target."""
    bones = _bones(route.source)
    groups = [
        group.index
        for group in route.source.vertex_groups
        if bones.get(group.name, not bones) and group.name not in wanted
    ]
    vertex, group, weight = read_weights(route.body)
    left = np.isin(group, groups)
    return route.to_points(_sums(vertex[left], weight[left], len(route.source_points)))


def _others(route, own, masked, written, weights, options):
    """What becomes of groups of other bones, neither carried nor locked, where sums rise beyond one.

    On a rigged target they give way: what the carried groups and the locked ones leave is shared among them
    in their proportions, the weakest left out beyond the limit of weights a vertex. Returns arguments of
    `write_weights`, names, weights and vertices, and notes.
    """
    target = route.target
    rigged = bool(_bones(target))
    bones = _bones(target) or _bones(route.source)
    groups = list(target.vertex_groups)
    others = [group for group in groups if bones.get(group.name) and group.name not in written]
    locked = [group for group in others if group.lock_weight]
    others = [group for group in others if not group.lock_weight]
    count = len(route.target_points)
    vertex, group, weight = own
    ours = np.array([bones.get(name, False) for name in written], bool)[weights[1]]
    used = np.isin(group, [held.index for held in locked])
    taken = _sums(weights[0][ours], weights[2][ours], count) + _sums(vertex[used], weight[used], count)
    entries = np.flatnonzero(
        np.isin(group, [other.index for other in others]) & masked[vertex] & (weight > 0.0)
    )
    beside = _sums(vertex[entries], weight[entries], count)
    over = (beside > 0.0) & (beside + taken > 1.0 + SUM_ROUNDING)
    if not over.any():
        return [], []
    entries = entries[over[vertex[entries]]]
    touched = [other for other in others if np.any(group[entries] == other.index)]
    named = listed(other.name for other in touched)
    if not (rigged and options.others_give_way):
        return [], [
            f"Weights of {over.sum()} vertices of '{target.name}' sum to more than 1, because groups of "
            f"other bones move them too: {named}. Remove these groups, or lock those that shall stay and "
            "transfer again"
        ]
    if options.limit_total:
        held = np.bincount(weights[0][ours], minlength=count) + np.bincount(vertex[used], minlength=count)
        entries = _strongest(entries, vertex, weight, options.limit - held)
    beside = _sums(vertex[entries], weight[entries], count)
    left = np.clip(1.0 - taken, 0.0, None)
    shared = weight[entries] * left[vertex[entries]] / beside[vertex[entries]]
    kept = shared >= max(options.prune, SUM_ROUNDING * SUM_ROUNDING)
    place = np.full(len(groups), -1)
    place[[other.index for other in touched]] = np.arange(len(touched))
    values = vertex[entries[kept]], place[group[entries[kept]]], shared[kept]
    note = (
        f"Weights of other bones gave way at {over.sum()} vertices of '{target.name}': {named}. Lock groups "
        "that shall stay as they are"
    )
    return [([other.name for other in touched], values, over)], [note]


def _sums(vertex, weight, count):
    """Sum of these weights at each of `count` vertices."""
    return np.bincount(vertex, weight, minlength=count).astype(np.float64)


def _strongest(entries, vertex, weight, room):
    """Of these entries those that are among the strongest `room` (n,) of their vertices."""
    order = entries[np.lexsort((-weight[entries], vertex[entries]))]
    first = np.searchsorted(vertex[order], vertex[order])
    return order[np.arange(len(order)) - first < room[vertex[order]]]


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
        "mix": FloatProperty(
            name="Mix",
            default=1.0,
            min=0.0,
            max=1.0,
            subtype="FACTOR",
            description="How much of the source's weights the groups get; the rest is what they have",
        ),
        "others_give_way": BoolProperty(
            name="Others Give Way",
            default=True,
            description="On a target with a rig, weights of its other bones make room for what is carried, "
            "so that they sum to 1. Locked groups stay",
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
            description="Exchange left and right, however they are written, in the names of vertex groups, "
            "shape keys and bones: for a match that turned left into right",
        ),
        "group_mask": StringProperty(
            name="Mask",
            description="A vertex group of the target: only its vertices are written. Empty: all are",
        ),
    },
)
