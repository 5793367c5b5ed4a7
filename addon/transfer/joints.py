# SPDX-License-Identifier: GPL-3.0-or-later
"""Joints of the source's rig, placed in the target by the surface around them."""

import numpy as np

from ..mesh_write import image_points
from .sides import flip_name
from .weights import read_weights

# Ends of bones nearer than this share of the rig's size are one joint.
SAME_JOINT = 1e-5
# A joint of bones without a side lies in the mirror if fitted nearer to it than this share of the rig's size.
IN_THE_MIDDLE = 0.02


def fitted_joints(route, rig):
    """Fitted joints (positions, turns, scales in the target's space), and the joints of each bone's ends."""
    to_source = np.array(route.source_to_world.inverted_safe() @ rig.matrix_world)
    bones = list(rig.data.bones)
    ends = np.array([[bone.head_local, bone.tail_local] for bone in bones], np.float64).reshape(-1, 3)
    ends = ends @ to_source[:3, :3].T + to_source[:3, 3]
    size = np.ptp(ends, axis=0).max()
    _, first, joint = np.unique(
        np.round(ends / max(size * SAME_JOINT, 1e-12)), axis=0, return_index=True, return_inverse=True
    )
    joint = joint.reshape(-1, 2)
    fitted = route.map_as_seen.joints(ends[first], _influence(route.body, bones, joint))
    if len(route.target_mirrors) == 1:
        axes = to_source[:3, :3]
        turned_over = axes @ np.diag((-1.0, 1.0, 1.0)) @ np.linalg.inv(axes)
        fitted = _on_both_halves(route, ends[first], _partners(bones, joint), turned_over, fitted)
    return fitted, joint


def _partners(bones, joint):
    """The joint of the other side for each joint, by the names of bones; -1 where these have no side."""
    partner = np.full(joint.max() + 1, -1)
    ends_of = {bone.name: ends for bone, ends in zip(bones, joint, strict=True)}
    for name, ends in ends_of.items():
        other = flip_name(name, ends_of)
        if other != name and other in ends_of:
            partner[ends] = ends_of[other]
    return partner


def _on_both_halves(route, ends, partner, turned_over, fitted):
    """Fitted joints of a target of which a modifier mirrors one half: symmetric as it is.

    A joint on the half that the map knows counts for its partner too, and one in the middle comes to lie in
    the mirror. `turned_over` is the rig's reflection as the source has it.
    """
    positions, turns, scales = (np.array(values) for values in fitted)
    (mirror,) = route.target_mirrors
    stretch = np.eye(4)
    stretch[:3, :3] = route.target_stretch
    reflection = stretch @ mirror.reflection @ np.linalg.inv(stretch)
    surface = image_points(
        route.source_points @ route.source_stretch, route.triangles, route.face, route.barycentric
    )
    away = np.array([np.linalg.norm(surface - end, axis=1).min() for end in ends])
    images = positions @ reflection[:3, :3].T + reflection[:3, 3]
    turned = reflection[:3, :3] @ turns @ turned_over
    off = np.linalg.norm(images - positions, axis=1) / 2.0
    own = np.arange(len(ends))
    partner = np.where((partner < 0) & (off < IN_THE_MIDDLE * np.ptp(positions, axis=0).max()), own, partner)
    for j in own[(partner == own) | ((partner >= 0) & (away > away[partner]))]:
        other = partner[j]
        share = 0.5 if other == j else 1.0
        positions[j] += share * (images[other] - positions[j])
        left, _, right = np.linalg.svd(turns[j] + share * (turned[other] - turns[j]))
        turns[j], scales[j] = left @ right, scales[other]
    return positions, turns, scales


def _influence(source, bones, joint):
    """For each joint the vertices that its bones move, with their weights; parents count at a bone's head."""
    vertex, group, weight = read_weights(source)
    order = np.argsort(group, kind="stable")
    bounds = np.searchsorted(group[order], np.arange(len(source.vertex_groups) + 1))
    moved = {
        held.name: (vertex[order[a:b]], weight[order[a:b]])
        for held, a, b in zip(source.vertex_groups, bounds[:-1], bounds[1:], strict=True)
        if b > a
    }
    at = [set() for _ in range(joint.max() + 1)]
    for bone, (head, tail) in zip(bones, joint, strict=True):
        at[head].add(bone.name)
        at[tail].add(bone.name)
        if bone.parent is not None:
            at[head].add(bone.parent.name)
    rows = []
    for around in at:
        found = [moved[name] for name in sorted(around) if name in moved]
        rows.append(tuple(map(np.concatenate, zip(*found, strict=True))) if found else ((), ()))
    return rows
