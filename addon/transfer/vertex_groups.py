# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: weights carried by the core; locked groups and masked vertices keep what they have."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from ..mesh_write import write_attribute
from ..typed import Entries, Flags, Floats, Integers, Locks, Options
from .kind import Kind, Prepared
from .listed import listed
from .own_rig import (
    AUTO,
    KEEP,
    REPLACE,
    bones_after,
    has_own_rig,
    keeps_rig,
    kept_name,
    own_modifiers,
    translated,
)
from .weight_sums import finished, giving_way, mixed, sums
from .weights import copy_groups, deforming_bones, read_weights, rigs, write_weights

if TYPE_CHECKING:
    from .route import Route

# On the target, where vertices were filled from their neighbours because their images were rejected.
FILLED = "match_filled"


def names(source: bpy.types.Object) -> list[str]:
    return [group.name for group in source.vertex_groups]


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    target = route.target
    named, notes = route.sides.of_all(wanted)
    groups = list(named.values())
    locks = {group.name for group in target.vertex_groups if group.lock_weight}
    own = read_weights(target)
    masked = _masked(target, own, options.group_mask)
    if keeps_rig(route, options):
        groups, weights, filled, words = _translated(route, wanted, groups, own, locks, options)
        notes += words
    else:
        locked = np.array([name in locks for name in groups], bool)
        weights, filled = _carried(
            route,
            wanted,
            options,
            prune=options.prune,
            limit=options.limit if options.limit_total else None,
            normalize=options.normalize,
            locked=_locked(route, wanted, own, locked) if locks else None,
        )
    written = [name for name in groups if name not in locks]
    place = np.array([written.index(name) if name in written else -1 for name in groups], int)
    weights = weights[0], place[weights[1]], weights[2]
    kept = masked[weights[0]] & (weights[1] >= 0)
    weights = weights[0][kept], weights[1][kept], weights[2][kept]
    if options.mix < 1.0:
        weights = mixed(target, own, masked, written, weights, options)
    if len(written) < len(groups):
        notes.append(
            f"{len(groups) - len(written)} locked vertex groups of '{target.name}' were left as they are"
        )
    others, words = giving_way(route, own, masked, written, weights, options)
    notes += words
    if filled.any():
        notes.append(
            f"{filled.sum()} vertices of '{target.name}' had no sure match and got the weights of their "
            f"neighbors. The attribute {FILLED} marks them"
        )
    replaced, words = _replaced(route, written, options)
    notes += words

    def write() -> None:
        copy_groups(target, replaced)
        write_weights(target, written, weights, masked)
        for names, values, there in others:
            write_weights(target, names, values, there)
        if filled.any() or FILLED in target.data.attributes:
            write_attribute(target.data, FILLED, "BOOLEAN", "POINT", filled)

    return Prepared(write, tuple(notes))


def _carried(route: Route, wanted: Sequence[str], options: Options, **finish: Any) -> tuple[Entries, Flags]:
    """Weights of the wanted groups (vertex, place in `wanted`, weight), and which vertices were filled."""
    carried = route.map.skin_weights(
        *_rows(route.body, wanted),
        len(wanted),
        deforming=_deforming(route.source, wanted),
        reject_below=options.reject_below,
        smoothing=options.smooth_weights,
        **finish,
    )
    count = len(route.target_points)
    filled = np.zeros(count, bool)
    filled[carried.filled] = True
    vertex = np.repeat(np.arange(count), np.diff(carried.starts))
    return (vertex, np.asarray(carried.groups, int), carried.weights), filled


def _translated(
    route: Route,
    wanted: Sequence[str],
    groups: Sequence[str],
    own: Entries,
    locks: Container[str],
    options: Options,
) -> tuple[list[str], Entries, Flags, list[str]]:
    """What `_carried` gives on bones of a rig that the target keeps: their names, weights, filled, notes."""
    whole: dict[str, Any] = {"prune": 0.0, "limit": None, "normalize": False, "locked": None}
    weights, filled = _carried(route, wanted, options, **whole)
    known = names(route.source)
    moving = [name for name, moves in zip(known, _deforming(route.source, known), strict=True) if moves]
    every, _ = _carried(route, moving, options, **whole)
    everything = [route.sides.of(name) for name in moving], every
    called, weights, pairs = translated(route, groups, weights, everything)
    moved = dict(zip(groups, _deforming(route.source, wanted), strict=True)) | bones_after(route, options)
    locked = np.array([name in locks for name in called], bool)
    weights = finished(
        weights,
        np.array([moved.get(name, False) for name in called], bool),
        _locked(route, wanted, own, locked),
        options,
    )
    if not pairs:
        return called, weights, filled, []
    rig = own_modifiers(route)[0].object.name
    told = listed(f"{one} → {other}" for one, other in pairs)
    note = f"'{route.target.name}' keeps its rig '{rig}'. Weights went to bones at the same places: {told}"
    return called, weights, filled, [note]


def _replaced(route: Route, written: Iterable[str], options: Options) -> tuple[dict[str, str], list[str]]:
    """Groups of a rig that is replaced which are written: under which names they are kept, and a note."""
    target = route.target
    own = own_modifiers(route) if route.wanted.get("armature") and not keeps_rig(route, options) else []
    present = target.vertex_groups
    kept: dict[str, str] = {}
    for rig in dict.fromkeys(modifier.object for modifier in own):
        for name in (bone.name for bone in rig.data.bones if bone.name in written):
            if name in present and kept_name(name, rig) not in present:
                kept.setdefault(name, kept_name(name, rig))
    if not kept:
        return kept, []
    return kept, [
        f"The old weights of '{target.name}' stay beside the new ones, in groups of their own: "
        f"{listed(kept.values())}"
    ]


def _rows(source: bpy.types.Object, wanted: Sequence[str]) -> tuple[Integers, Integers, Floats]:
    """Compressed rows (starts, place in `wanted`, weight) of the wanted groups."""
    vertex, group, weight = read_weights(source)
    place = np.full(max(len(source.vertex_groups), group.max(initial=-1) + 1), -1)
    place[[source.vertex_groups[name].index for name in wanted]] = np.arange(len(wanted))
    kept = place[group] >= 0
    counts = np.bincount(vertex[kept], minlength=len(source.data.vertices))
    return np.append(0, np.cumsum(counts)), place[group[kept]], weight[kept]


def _masked(target: bpy.types.Object, own: Entries, name: str) -> Flags:
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


def _locked(route: Route, wanted: Sequence[str], own: Entries, locked: Flags) -> Locks:
    """What the target's locked deforming groups hold: which of ours they are, sum and number a vertex.

    Of the sum they first take what the source has in groups that are not wanted.
    """
    target = route.target
    held = np.array([group.lock_weight for group in target.vertex_groups], bool)
    bones = deforming_bones(route.source) | deforming_bones(target)
    held &= np.array([bones.get(group.name, not bones) for group in target.vertex_groups], bool)
    vertex, group, weight = own
    used = held[group]
    count = len(route.target_points)
    return (
        locked,
        np.clip(sums(vertex[used], weight[used], count) - _left_behind(route, wanted), 0.0, None),
        np.bincount(vertex[used & (weight > 0.0)], minlength=count),
    )


def _left_behind(route: Route, wanted: Sequence[str]) -> Floats:
    """Weights of the source's deforming groups that are not wanted, at each vertex of the target."""
    bones = deforming_bones(route.source)
    groups = [
        group.index
        for group in route.source.vertex_groups
        if bones.get(group.name, not bones) and group.name not in wanted
    ]
    vertex, group, weight = read_weights(route.body)
    left = np.isin(group, groups)
    return route.to_points(sums(vertex[left], weight[left], len(route.source_points)))


def _deforming(source: bpy.types.Object, wanted: Sequence[str]) -> Flags:
    """True for each group that moves with a bone; all of them when the source has no armature to ask."""
    bones = deforming_bones(source)
    return np.array([bones.get(name, not bones) for name in wanted], bool)


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
            name="Max Weights", default=4, min=1, soft_max=8, description="Game engines usually take 4"
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
        "own_rig": EnumProperty(
            name="Target's Rig",
            items=(
                (AUTO, "Automatic", "Replaced where Armature is carried, else kept"),
                (
                    REPLACE,
                    "Replace",
                    "The source's rig takes its place where Armature is carried; its own stays, with the "
                    "modifier off and its groups beside the new ones",
                ),
                (KEEP, "Keep", "It stays, and weights go to those of its bones that hold the same surface"),
            ),
            default=AUTO,
            description="What becomes of a rig that the target has already",
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
    words=("group", "groups"),
    effects={
        "limit": lambda options, _: options.limit_total,
        "own_rig": lambda _, bodies: bodies is None or has_own_rig(*bodies),
        "others_give_way": lambda options, bodies: (
            bodies is None
            or any(rigs(target) for target in bodies.targets)
            or (options.use_armature and any(rigs(source) for source in bodies.sources))
        ),
    },
)
