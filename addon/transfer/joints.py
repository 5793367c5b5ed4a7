# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones of the source's rig, placed in the target: by the surface around their joints, or by other bones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ..mesh_write import image_points
from ..similarity import moved, similarity
from ..typed import Flags, Floats, Integers
from .rest_poses import AXES_COUNT
from .sides import flip_name
from .weights import read_weights

if TYPE_CHECKING:
    from .route import Route

# Images and vertices of the target, and the turn and scale between the bodies.
WholeBody = tuple[Floats, Floats, Floats, float]

# Ends of bones nearer than this share of the rig's size are one joint.
SAME_JOINT = 1e-5
# A bone holds the surface that moves so many vertices by more than this weight.
FEWEST_VERTICES, LEAST_WEIGHT = 3, 0.01
# A bone grows at most so many times more or less than its surroundings.
MOST_GROWTH = 2.0
# Cosine from which on two bones with one head run along each other.
PARALLEL = 0.99999
# Weighted least squares until the sum of distances settles (Weiszfeld, Tohoku Mathematical Journal 43, 1937).
REWEIGHTED = 30
# What stands near to a root, as a share of the rig's size.
SURROUNDINGS = 0.05
# A joint of bones without a side lies in the mirror if fitted nearer to it than this share of the rig's size.
IN_THE_MIDDLE = 0.02
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Placed:
    """A bone in the target's coordinates as seen: its ends, its axes (3, 3) and how much larger it is there.

    `turn` (3, 3) takes directions of the source to those of the target, mirroring if the map does. `firm` are
    bones placed by the surface, or with such bones.
    """

    head: Floats
    tail: Floats
    axes: Floats
    turn: Floats
    scale: float
    firm: bool = True


class _Bones:
    """The bones of a rig as the source's surface sees them: their ends (2, 3) and axes, by number.

    Ends in one place are one joint: `joint` (bones, 2) are those of each bone, `places` where they are.
    """

    def __init__(self, route: Route, rig: bpy.types.Object) -> None:
        to_source = np.array(route.source_to_world.inverted_safe() @ rig.matrix_world)
        self.rig, self.list = rig, list(rig.data.bones)
        self.number = {bone.name: number for number, bone in enumerate(self.list)}
        ends = np.array([[bone.head_local, bone.tail_local] for bone in self.list], np.float64)
        self.ends = ends @ to_source[:3, :3].T + to_source[:3, 3]
        ups = np.array([bone.matrix_local.col[2][:3] for bone in self.list]) @ to_source[:3, :3].T
        self.axes = [_axes(tail - head, up) for (head, tail), up in zip(self.ends, ups, strict=True)]
        self.lengths = np.maximum(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1), TINY)
        self.size = np.ptp(self.ends.reshape(-1, 3), axis=0).max()
        flat = np.round(self.ends.reshape(-1, 3) / max(self.size * SAME_JOINT, 1e-12))
        _, first, joint = np.unique(flat, axis=0, return_index=True, return_inverse=True)
        self.joint, self.places = joint.reshape(-1, 2), self.ends.reshape(-1, 3)[first]
        axes = to_source[:3, :3]
        self.turned_over = axes @ np.diag((-1.0, 1.0, 1.0)) @ np.linalg.inv(axes)


def fitted_bones(route: Route, rig: bpy.types.Object) -> dict[str, Placed]:
    """Every bone of a rig, `Placed` in the target, by name.

    Joints of bones that hold the surface go where the similarity of the surface around them takes them. Other
    bones keep how they stand to a bone that is placed: one with the same head, one that ends there, the
    nearest one above them, or the nearest that they lead by a constraint; what is left goes with the whole
    body. What was one joint stays one, unless a bone runs along another.
    """
    bones = _Bones(route, rig)
    rows = _influence(route.body, bones)
    known = np.array([len(row[0]) > 0 for row in rows])
    if not known.any():
        # Nothing holds the surface: every vertex counts for every joint.
        known[:] = True
    found = route.map_as_seen.joints(bones.places[known], [rows[joint] for joint in np.flatnonzero(known)])
    if len(route.target_mirrors) == 1:
        partner = _partners(bones, known)
        found = _on_both_halves(route, bones.places[known], partner, bones.turned_over, found)
    joints = {joint: values for joint, *values in zip(np.flatnonzero(known).tolist(), *found, strict=True)}
    settled = {joint: np.array(position) for joint, (position, _, _) in joints.items()}
    placed = {}
    for number, bone in enumerate(bones.list):
        head, tail = bones.joint[number].tolist()
        if head in joints and tail in joints and head != tail:
            placed[bone.name] = _between(bones, number, joints[head], settled[tail])
    # Worked out for the first bone that goes with the whole body, if there is one.
    whole = cache(partial(_whole_body, route, bones, bones.places[known], found))
    _place_others(whole, bones, placed, settled)
    return placed


def _between(bones: _Bones, number: int, begin: Sequence[Any], tail: Floats) -> Placed:
    """A bone between two joints, turned about itself as the surface around its head."""
    head, turn, scale = (np.array(value) for value in begin)
    axes = _axes(tail - head, turn @ bones.axes[number][:, 2])
    grown = np.linalg.norm(tail - head) / bones.lengths[number]
    grown = float(np.clip(grown, scale / MOST_GROWTH, scale * MOST_GROWTH))
    return Placed(head, tail, axes, _turned(axes, bones.axes[number], turn), grown)


def _axes(along: Floats, up: Floats) -> Floats:
    """Axes (3, 3) of a bone, y along it and z as near to `up` as can be."""
    y = along / max(float(np.linalg.norm(along)), TINY)
    z = up - (up @ y) * y
    if np.linalg.norm(z) < 1e-9 * np.linalg.norm(up):
        across = np.eye(3)[np.abs(y).argmin()]
        z = across - (across @ y) * y
    z = z / np.linalg.norm(z)
    return np.stack([np.cross(y, z), y, z], axis=1)


def _turned(axes: Floats, before: Floats, turn: Floats) -> Floats:
    """What takes a bone's axes to those that it got, mirroring if `turn` does."""
    return axes @ np.diag((np.sign(np.linalg.det(turn)), 1.0, 1.0)) @ before.T


def _place_others(
    whole: Callable[[], WholeBody], bones: _Bones, placed: dict[str, Placed], settled: dict[int, Floats]
) -> None:
    """Place the bones that are not yet, each by one that is; joints that are `settled` stay."""
    led = _led(bones.rig)
    pending = [bone for bone in bones.list if bone.name not in placed]
    pending.sort(key=lambda bone: len(bone.parent_recursive))
    while pending:
        left = []
        for bone in pending:
            by = _firm_one(bones, placed, led, bone)
            if by is None:
                left.append(bone)
            else:
                placed[bone.name] = _beside(bones, placed[by], bones.number[by], bone, settled)
        if len(left) == len(pending):
            # Nothing firm is near: the topmost bone goes with what is above it, or with the body.
            bone = left.pop(0)
            by = next((above.name for above in bone.parent_recursive if above.name in placed), None)
            if by is None:
                placed[bone.name] = _with_body(bones, bone, whole(), settled)
            else:
                placed[bone.name] = _beside(bones, placed[by], bones.number[by], bone, settled)
        pending = left


def _firm_one(
    bones: _Bones, placed: Mapping[str, Placed], led: Mapping[str, list[str]], bone: bpy.types.Bone
) -> str | None:
    """The bone, placed by the surface, by which another one is placed, or None."""
    own = bones.number[bone.name]
    firm = [name for name, each in placed.items() if each.firm]
    beside = [name for name in firm if bones.joint[bones.number[name], 0] == bones.joint[own, 0]]
    if beside:

        def unlike(name: str) -> tuple[float, float]:
            """How little two bones of one head point alike and, in steps of that, are alike in length."""
            other = bones.number[name]
            cosine = round(float(bones.axes[own][:, 1] @ bones.axes[other][:, 1]), 3)
            return -cosine, abs(np.log(bones.lengths[own] / bones.lengths[other]))

        return min(beside, key=unlike)
    above = [each.name for each in bone.parent_recursive]
    ending = [name for name in firm if bones.joint[bones.number[name], 1] == bones.joint[own, 0]]
    # A control of the trunk leads limbs too: what it leads nearby, and on its side, tells where it is.
    leads = sorted(
        led.get(bone.name, ()),
        key=lambda name: (_has_side(name, bones) != _has_side(bone.name, bones), _gap(bones, name, own)),
    )
    ways = ([name for name in above[:1] if name in ending], ending, above, leads)
    return next((name for way in ways for name in way if name in placed and placed[name].firm), None)


def _has_side(name: str, bones: _Bones) -> bool:
    return flip_name(name, bones.number) != name


def _gap(bones: _Bones, name: str, own: int) -> float:
    """From the head of a bone to the nearer end of another."""
    return np.linalg.norm(bones.ends[bones.number[name]] - bones.ends[own, 0], axis=1).min()


def _led(rig: bpy.types.Object) -> dict[str, list[str]]:
    """For each bone those whose constraints look at it."""
    led: dict[str, list[str]] = {}
    for bone in rig.pose.bones:
        for constraint in bone.constraints:
            looks = getattr(constraint, "targets", None) or [constraint]
            names = [look.subtarget for look in looks if getattr(look, "target", None) == rig]
            if getattr(constraint, "pole_target", None) == rig:
                names.append(constraint.pole_subtarget)
            for name in names:
                led.setdefault(name, []).append(bone.name)
    return led


def _beside(
    bones: _Bones, by: Placed, other: int, bone: bpy.types.Bone, settled: dict[int, Floats]
) -> Placed:
    """A bone that keeps how it stands to another one, number `other`, which is placed as `by`."""
    own = bones.number[bone.name]
    # From that end of the other one which is nearer.
    near = np.linalg.norm(bones.ends[other] - bones.ends[own, 0], axis=1).argmin()
    anchor, there = bones.ends[other, near], (by.head, by.tail)[near]
    moved = [there + by.scale * by.turn @ (end - anchor) for end in bones.ends[own]]
    one_head = bones.joint[own, 0] == bones.joint[other, 0]
    parallel = bool(one_head) and bool(bones.axes[own][:, 1] @ bones.axes[other][:, 1] > PARALLEL)
    return _settle(bones, own, moved, by.turn, by.scale, by.firm, settled, parallel)


def _settle(
    bones: _Bones,
    own: int,
    moved: Sequence[Floats],
    turn: Floats,
    scale: float,
    firm: bool,
    settled: dict[int, Floats],
    parallel: bool = False,
) -> Placed:
    """A bone whose ends were moved, but for joints that are settled; what it ends in is settled then.

    One that runs along another keeps its direction.
    """
    head, tail = bones.joint[own].tolist()
    begin = settled.setdefault(head, moved[0])
    end = begin + moved[1] - moved[0]
    end = end if parallel else settled.setdefault(tail, end)
    axes = _axes(end - begin, turn @ bones.axes[own][:, 2])
    return Placed(begin, end, axes, _turned(axes, bones.axes[own], turn), scale, firm)


def _whole_body(
    route: Route, bones: _Bones, places: Floats, fitted: tuple[Floats, Floats, Floats]
) -> WholeBody:
    """Images and vertices of the target, and the turn and scale between the joints as they were and are.

    By the least sum of distances, not of squares: what one of the two carries or wears, and arms that hang on
    one and are stretched out on the other, turn no body.
    """
    images = image_points(
        route.source_points @ route.source_stretch, route.triangles, route.face, route.barycentric
    )
    positions, turns, scales = (np.asarray(values) for values in fitted)
    size = AXES_COUNT * bones.size
    before = np.concatenate([places, *(places + size * axis for axis in np.eye(3))])
    after = [positions + size * scales[:, None] * turns[:, :, k] for k in range(3)]
    mirrored = bool(np.linalg.det(turns[0]) < 0.0)
    aims, weights = np.concatenate([positions, *after]), np.ones(len(before))
    for _ in range(REWEIGHTED):
        found = similarity(before, aims, weights, mirrored)
        weights = 1.0 / (np.linalg.norm(moved(before, found) - aims, axis=1) + SAME_JOINT * bones.size)
    turn = found[:3, :3]
    scale = float(np.cbrt(abs(np.linalg.det(turn))))
    return images, route.target_points @ route.target_stretch, turn / scale, scale


def _with_body(bones: _Bones, bone: bpy.types.Bone, whole: WholeBody, settled: dict[int, Floats]) -> Placed:
    """A bone that goes with the whole body, from the nearest part of it: a root stays on the ground."""
    images, target, turn, scale = whole
    own = bones.number[bone.name]
    away = np.linalg.norm(images - bones.ends[own, 0], axis=1)
    near = np.exp(-((away - away.min()) ** 2) / (2.0 * (SURROUNDINGS * bones.size) ** 2))
    near /= near.sum()
    moved = [near @ target + scale * turn @ (end - near @ images) for end in bones.ends[own]]
    return _settle(bones, own, moved, turn, scale, False, settled)


def _partners(bones: _Bones, known: Flags) -> Integers:
    """The joint of the other side for each known joint, by names of bones; -1 where these have no side."""
    partner = np.full(len(known), -1)
    joints = {bone.name: ends for bone, ends in zip(bones.list, bones.joint, strict=True)}
    for name, ends in joints.items():
        other = flip_name(name, joints)
        if other != name and other in joints:
            partner[ends] = joints[other]
    place = np.where(known, np.cumsum(known) - 1, -1)
    return np.where(partner[known] >= 0, place[partner[known]], -1)


def _on_both_halves(
    route: Route, ends: Floats, partner: Integers, turned_over: Floats, fitted: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
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


def _influence(source: bpy.types.Object, bones: _Bones) -> list[tuple[Any, ...]]:
    """For each joint the vertices that move with the bones there, with their weights; none for other joints.

    At the head of a bone that holds the surface its parent counts too.
    """
    vertex, group, weight = read_weights(source)
    order = np.argsort(group, kind="stable")
    bounds = np.searchsorted(group[order], np.arange(len(source.vertex_groups) + 1))
    moved = {
        held.name: (vertex[order[a:b]], weight[order[a:b]])
        for held, a, b in zip(source.vertex_groups, bounds[:-1], bounds[1:], strict=True)
        if np.count_nonzero(weight[order[a:b]] > LEAST_WEIGHT) >= FEWEST_VERTICES
    }
    at: list[set[str]] = [set() for _ in bones.places]
    for bone, (head, tail) in zip(bones.list, bones.joint, strict=True):
        if bone.name in moved:
            at[head].add(bone.name)
            at[tail].add(bone.name)
            if bone.parent is not None:
                at[head].add(bone.parent.name)
    rows = []
    for around in at:
        found = [moved[name] for name in sorted(around) if name in moved]
        rows.append(tuple(map(np.concatenate, zip(*found, strict=True))) if found else ((), ()))
    return rows
