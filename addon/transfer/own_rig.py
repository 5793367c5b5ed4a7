# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that has a rig: it is replaced by the source's, or kept, and the weights go to its bones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..typed import Entries, Flags, Floats, Integers, Options, Values
from .copies import comes_from
from .joints import fitted_bones
from .weights import armature_modifiers, read_weights, rigs

if TYPE_CHECKING:
    from .route import Route

AUTO, REPLACE, KEEP = "AUTO", "REPLACE", "KEEP"
# Two bones of one name are others where what they hold shares less than this of the smaller.
ANOTHER = 0.05
# A group and a bone that hold surfaces are a pair when their weights have at least this cosine; a bone
# that holds nothing is one's partner when it lies so near to it.
ALIKE, NEAR = 0.15, 0.4


def own_modifiers(route: Route) -> list[bpy.types.Modifier]:
    """Armature modifiers of the target's meshes that are on, with rigs that do not come from the source."""
    return _own_modifiers(rigs(route.source), route.targets)


def has_own_rig(sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]) -> bool:
    """Whether one of these targets has a rig that does not come from the source."""
    return bool(_own_modifiers([rig for source in sources for rig in rigs(source)], targets))


def _own_modifiers(
    given: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> list[bpy.types.Modifier]:
    return [
        modifier
        for target in targets
        for modifier in armature_modifiers(target)
        if modifier.show_viewport
        and modifier.object not in given
        and not any(comes_from(modifier.object, rig) for rig in given)
    ]


def keeps_rig(route: Route, options: Options) -> bool:
    """Whether the target keeps a rig of its own: as chosen, by itself where the source's is not carried."""
    replaced = bool(route.wanted.get("armature"))
    keeps = options.own_rig == KEEP or (options.own_rig == AUTO and not replaced)
    return keeps and bool(own_modifiers(route))


def bones_after(route: Route, options: Options) -> dict[str, bool]:
    """Whether each bone that can move the target after the transfer deforms, by its name there."""
    if route.wanted.get("armature") and not keeps_rig(route, options):
        return {
            route.sides.of(bone.name): bone.use_deform
            for rig in rigs(route.source)
            for bone in rig.data.bones
        }
    return {bone.name: bone.use_deform for rig in rigs(route.target) for bone in rig.data.bones}


def kept_name(name: str, rig: bpy.types.Object) -> str:
    """The name under which a group of a rig that is replaced stays."""
    return f"{name} ({rig.name})"


def translated(
    route: Route, names: Sequence[str], entries: Entries, everything: tuple[Sequence[str], Entries]
) -> tuple[list[str], Entries, list[tuple[str, str]]]:
    """Weights of groups as weights of the target's own bones.

    `entries` (vertex, place in `names`, weight) are carried, `everything` the same of all deforming groups of
    the source, by which partners are found: the bone of the same name, else that which holds most of the same
    surface. Where several bones hold what one group does, it is divided in their proportions. Returns names,
    entries and pairs of names that are not the same.
    """
    bones, own = _own_weights(route.target)
    every, partners = everything[0], _partners(route, *everything, bones, own)
    none = np.zeros(len(bones), bool)
    linked = np.array([partners[every.index(name)] if name in every else none for name in names])
    # What holds no surface, as a mask, and what has no partner keeps its own name.
    alone = np.flatnonzero(~linked.any(axis=1))
    linked = np.hstack([linked, np.arange(len(names))[:, None] == alone])
    called = [*bones, *(names[number] for number in alone)]
    divided = _divided(entries, own, linked, len(route.target_points))
    # Only bones that take part are written.
    used = np.flatnonzero(linked.any(axis=0))
    place = np.full(len(called), -1)
    place[used] = np.arange(len(used))
    pairs = [(names[a], called[b]) for a, b in np.argwhere(linked) if names[a] != called[b]]
    return [called[number] for number in used], (divided[0], place[divided[1]], divided[2]), pairs


def _own_weights(target: bpy.types.Object) -> tuple[list[str], Entries]:
    """Names of the target's deforming bones, without locked ones, and its weights on them as entries."""
    locked = {group.name for group in target.vertex_groups if group.lock_weight}
    moving = [bone.name for rig in rigs(target) for bone in rig.data.bones if bone.use_deform]
    bones = list(dict.fromkeys(name for name in moving if name not in locked))
    place = np.full(len(target.vertex_groups) + 1, -1)
    for each in target.vertex_groups:
        place[each.index] = bones.index(each.name) if each.name in bones else -1
    vertex, group, weight = read_weights(target)
    held = (place[group] >= 0) & (weight > 0.0)
    return bones, (vertex[held], place[group[held]], weight[held])


def _together(entries: Entries, own: Entries, count: int) -> tuple[Integers, Integers]:
    """Numbers of all pairs of entries at one vertex: those of the first, and those of the second, sorted."""
    starts = np.searchsorted(own[0], np.arange(count + 1))
    first, many = starts[entries[0]], np.diff(starts)[entries[0]]
    entry = np.repeat(np.arange(len(entries[0])), many)
    within = np.arange(len(entry)) - np.repeat(np.cumsum(many) - many, many)
    return entry, first[entry] + within


def _partners(
    route: Route, names: Sequence[str], entries: Entries, bones: Sequence[str], own: Entries
) -> Flags:
    """Which bones of the target take part in what each group of the source moves: (groups, bones)."""
    area, shape = _vertex_areas(route), (len(names), len(bones))
    entry, other = _together(entries, own, len(area))
    both = entries[2][entry] * own[2][other] * area[entries[0][entry]]
    shared = np.bincount(entries[1][entry] * shape[1] + own[1][other], both, minlength=shape[0] * shape[1])
    shared = shared.reshape(shape)
    given = np.bincount(entries[1], entries[2] * area[entries[0]], minlength=shape[0])
    held = np.bincount(own[1], own[2] * area[own[0]], minlength=shape[1])
    linked = np.zeros(shape, bool)
    if 0 in shape:
        return linked
    for number, name in enumerate(names):
        if name in bones:
            at = bones.index(name)
            smaller = min(given[number], held[at])
            linked[number, at] = smaller == 0.0 or shared[number, at] >= ANOTHER * smaller
    free = np.where(~linked.any(axis=1)[:, None] & ~linked.any(axis=0)[None], shared, 0.0)
    # First a bone for each group: those that agree best, in what they hold and where they lie, come first.
    size = [
        np.bincount(group, weight**2 * area[vertex], minlength=many)
        for (vertex, group, weight), many in zip((entries, own), shape, strict=True)
    ]
    cosine = free / np.maximum(np.sqrt(size[0][:, None] * size[1][None]), np.finfo(float).tiny)
    near = _nearness(route, names, bones)
    empty = ~linked.any(axis=1)[:, None] & (~linked.any(axis=0) & (held == 0.0))[None]
    alike = np.where((cosine >= ALIKE) | (empty & (near >= NEAR)), cosine + near, 0.0)
    while alike.max() > 0.0:
        pair = np.unravel_index(alike.argmax(), shape)
        linked[pair] = True
        alike[pair[0]], alike[:, pair[1]] = 0.0, 0.0
    # Then what is left over joins what holds most of it, or lies nearest: groups bones, and bones groups.
    bare = ~linked.any(axis=1), ~linked.any(axis=0)
    for table, into, some in ((free, linked, bare[0]), (free.T, linked.T, bare[1]), (near, linked, bare[0])):
        there = np.flatnonzero(some & ~into.any(axis=1) & (table.max(axis=1) > 0.0))
        into[there, table[there].argmax(axis=1)] = True
    return linked


def _nearness(route: Route, names: Sequence[str], bones: Sequence[str]) -> Floats:
    """How near bones of the target lie to where those of the groups are fitted, (groups, bones), 1 at best.

    It falls by e where both ends are apart by the length of the bone; 0 for groups of no bone.
    """
    places, near = {}, np.zeros((len(names), len(bones)))
    for rig in rigs(route.target):
        to_target = np.array(route.target_to_world.inverted_safe() @ rig.matrix_world)
        for bone in rig.data.bones:
            ends = np.array([bone.head_local, bone.tail_local])
            places[bone.name] = ends @ to_target[:3, :3].T + to_target[:3, 3]
    ends = np.array([places[bone] for bone in bones])
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), np.finfo(float).tiny)
    for rig in rigs(route.source):
        fitted = {
            route.sides.of(name): np.array([bone.head, bone.tail])
            for name, bone in fitted_bones(route, rig).items()
        }
        for number, name in enumerate(names):
            if name in fitted:
                away = np.linalg.norm(ends - fitted[name], axis=2).mean(axis=1)
                near[number] = np.exp(-away / length)
    return near


def _divided(entries: Entries, own: Entries, linked: Values, count: int) -> Entries:
    """Entries of groups as entries of the bones linked to them, in the proportions of those bones' own."""
    vertex, group, weight = entries
    entry, other = _together(entries, own, count)
    kept = linked[group[entry], own[1][other]]
    entry, other = entry[kept], other[kept]
    total = np.bincount(entry, own[2][other], minlength=len(weight))
    alone = np.flatnonzero(total == 0.0)
    parts = (
        (vertex[entry], own[1][other], weight[entry] * own[2][other] / total[entry]),
        # Where none of them holds anything, all goes to the first of them.
        (vertex[alone], linked.argmax(axis=1)[group[alone]], weight[alone]),
    )
    vertex, bone, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
    key, joined = np.unique(vertex * linked.shape[1] + bone, return_inverse=True)
    return (
        key // linked.shape[1],
        key % linked.shape[1],
        np.asarray(np.bincount(joined, weight, minlength=len(key)), float),
    )


def _vertex_areas(route: Route) -> Floats:
    """A third of the triangles around each vertex of the target, (n,)."""
    a, b, c = (route.target_points[route.target_triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    corner = route.target_triangles.ravel()
    return np.asarray(np.bincount(corner, np.repeat(area, 3), minlength=len(route.target_points)), float)
