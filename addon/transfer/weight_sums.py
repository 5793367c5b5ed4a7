# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of weights a vertex: what mixes, what gives way, and how many weights are left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

from ..typed import Entries, Flags, Floats, Integers, Locks, Options
from .listed import listed
from .own_rig import bones_after
from .weights import deforming_bones

if TYPE_CHECKING:
    from .route import Route

# Weights that sum to this much more than 1 are single precision's.
SUM_ROUNDING = 1e-3


def mixed(
    target: bpy.types.Object,
    own: Entries,
    masked: Flags,
    written: Sequence[str],
    weights: Entries,
    options: Options,
) -> Entries:
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
    weight = np.asarray(np.bincount(joined, weight, minlength=len(entry)), float)
    held = weight >= options.prune
    return entry[held] // len(written), entry[held] % len(written), weight[held]


def finished(weights: Entries, deforming: Flags, locked: Locks, options: Options) -> Entries:
    """Weights limited, pruned and scaled back to their sums, beside locked ones, as the core finishes others.

    `deforming` tells of each group whether it counts; `locked` is which groups stay as they are, and sum and
    number of the locked weights of each vertex.
    """
    vertex, group, weight = weights
    stay, taken, many = locked
    count = len(taken)
    counted = deforming[group]
    wanted = np.clip(sums(vertex[counted], weight[counted], count) - taken, 0.0, None)
    entries: Integers = np.flatnonzero(counted & ~stay[group])
    if options.limit_total:
        entries = _strongest(entries, vertex, weight, options.limit - many)
    entries = entries[weight[entries] >= options.prune]
    scale = np.ones(count)
    if options.normalize:
        left = sums(vertex[entries], weight[entries], count)
        scale = np.divide(wanted, left, out=np.zeros(count), where=left > 0.0)
    kept = np.concatenate([entries, np.flatnonzero(~counted & ~stay[group] & (weight >= options.prune))])
    scaled = np.where(deforming[group[kept]], weight[kept] * scale[vertex[kept]], weight[kept])
    order = np.argsort(vertex[kept], kind="stable")
    kept, scaled = kept[order], scaled[order]
    return vertex[kept], group[kept], scaled


def giving_way(
    route: Route, own: Entries, masked: Flags, written: Sequence[str], weights: Entries, options: Options
) -> tuple[list[tuple[list[str], Entries, Flags]], list[str]]:
    """What becomes of groups of other bones, neither carried nor locked, where sums rise beyond one.

    On a rigged target they give way: what the carried groups and the locked ones leave is shared among them
    in their proportions, the weakest left out beyond the limit of weights a vertex. Returns arguments of
    `write_weights`, names, weights and vertices, and notes.
    """
    target = route.target
    bones = bones_after(route, options)
    rigged, bones = bool(bones), bones or deforming_bones(route.source)
    groups = list(target.vertex_groups)
    others = [group for group in groups if bones.get(group.name) and group.name not in written]
    locked = [group for group in others if group.lock_weight]
    others = [group for group in others if not group.lock_weight]
    count = len(route.target_points)
    vertex, group, weight = own
    ours = np.array([bones.get(name, False) for name in written], bool)[weights[1]]
    used = np.isin(group, [held.index for held in locked])
    taken = sums(weights[0][ours], weights[2][ours], count) + sums(vertex[used], weight[used], count)
    entries: Integers = np.flatnonzero(
        np.isin(group, [other.index for other in others]) & masked[vertex] & (weight > 0.0)
    )
    beside = sums(vertex[entries], weight[entries], count)
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
    beside = sums(vertex[entries], weight[entries], count)
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


def sums(vertex: Integers, weight: Floats, count: int) -> NDArray[np.float64]:
    """Sum of these weights at each of `count` vertices."""
    return np.bincount(vertex, weight, minlength=count).astype(np.float64)


def _strongest(entries: Integers, vertex: Integers, weight: Floats, room: Integers) -> Integers:
    """Of these entries those that are among the strongest `room` (n,) of their vertices."""
    order = entries[np.lexsort((-weight[entries], vertex[entries]))]
    first = np.searchsorted(vertex[order], vertex[order])
    return order[np.arange(len(order)) - first < room[vertex[order]]]
