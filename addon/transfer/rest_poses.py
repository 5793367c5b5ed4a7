# SPDX-License-Identifier: GPL-3.0-or-later
"""How a rig and the one fitted to the target rest, and what takes turns and places of one to the other.

In the world, a bone of the source is turned by `P₁` and its partner shall be turned by `P₂ = G P₁ S N`: `G`
turns the source's body to the target's, `S` mirrors a bone's own axes where `G` mirrors, and the constant `N`
takes the direction of the limb in the target's bone to that in the source's. What is keyed is the turn `B` of
a bone from its place at rest, `P = P_parent R B`. So

    B₂ = L (S B₁ S) N,    L = R₂⁻¹ F⁻¹ S R₁ S,

where the parent of the target's bone is turned by `G P₁ S F`: `F` is the parent's `N` if its turn is fitted
too. That is linear in quaternions, and `σ L S` takes places to places, `σ` being how much larger the target
is: its legs for what carries the body, its surroundings for other bones.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..typed import Floats
from .legs import legs_of

# Bodies whose axes differ by less than this, degrees, from whole quarter turns face alike.
QUARTERS = 12.0
# Weight of a bone's axes beside its place, as a share of the rig's size.
AXES_COUNT = 0.1
# A child whose head is nearer than this share of the bone's length is no end of a limb.
SHORTEST_LIMB = 1e-4


@dataclass
class Rest:
    """A bone at rest: `turn` (3, 3) and `head` (3,) in its rig, the same in the world, and its limb there."""

    turn: Floats
    head: Floats
    world_turn: Floats
    world_head: Floats
    limb: Floats


class Fitting:
    """What takes keys of a rig to keys of the fitted one."""

    def __init__(
        self,
        rig: bpy.types.Object,
        own: bpy.types.Object,
        named: Mapping[str, str],
        held: set[str],
        mirrors: bool,
        growth: Mapping[str, float],
        bodies: tuple[bpy.types.Object, bpy.types.Object],
    ) -> None:
        """`named` are the fitted bones' names, `held` the bones that move the surface, `mirrors` whether left
        became right, `growth` how much larger the surroundings of each bone are, and `bodies` the two mesh
        objects.
        """
        self.rig, self.own, self.named, self.held = rig, own, named, held
        self.growth = growth
        bones = list(rig.data.bones)
        self.order = sorted(
            (bone.name for bone in bones), key=lambda name: len(rig.data.bones[name].parent_recursive)
        )
        main = {bone.name: _main_child(bone) for bone in bones}
        self.source = {name: _rest(rig, name, main[name]) for name in self.order}
        ends = {name: None if child is None else named[child] for name, child in main.items()}
        self.target = {name: _rest(own, named[name], ends[name]) for name in self.order}
        self.facing = _facing(self.source, self.target, held, mirrors, bodies)
        rigs = [turn_of(obj.matrix_world) for obj in (rig, own)]
        side = np.sign(np.linalg.det(self.facing) * np.linalg.det(rigs[0]) * np.linalg.det(rigs[1]))
        self.side = np.diag((side, 1.0, 1.0))
        self.limb = {
            name: _shortest_turn(self.target[name].limb, self.side @ self.source[name].limb)
            for name in self.order
        }
        heads = [
            {name: rest.world_head for name, rest in rests.items()} for rests in (self.source, self.target)
        ]
        self.legs = legs_of(bones, held, heads[0])
        size = [np.ptp(np.array(list(places.values())), axis=0).max() for places in heads]
        self.leg = self.legs.length(heads[1]) if self.legs else size[1]
        before = self.legs.length(heads[0]) if self.legs else size[0]
        self.steps = self.leg / before if before > 0.0 else 1.0
        # Of lengths in the rigs' own units.
        self.units = scale_of(rig) / scale_of(own)
        self.carrying = self._carrying()

    def _carrying(self) -> set[str]:
        """The bones that carry the whole body: that on which the legs hang, and those above it."""
        if self.legs is None:
            return {name for name in self.order if self.rig.data.bones[name].parent is None}
        hips = self.rig.data.bones[self.legs.hips]
        return {hips.name, *(bone.name for bone in hips.parent_recursive)}

    def is_led(self, name: str) -> bool:
        """Whether a constraint, not a key, decides how a bone is turned."""
        return any(
            not constraint.mute and constraint.influence > 0.0
            for constraint in self.rig.pose.bones[name].constraints
        )

    def rests_to_turn(
        self, keyed: Container[str], basis: Mapping[str, Floats]
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """For each bone `L`, and `F`, which is `N` where its turn is fitted.

        `keyed` are the bones whose turns are fitted; the others keep `basis`, their turn as they are posed.
        """
        left: dict[str, Floats] = {}
        offset: dict[str, Floats] = {}
        world = [turn_of(obj.matrix_world) for obj in (self.rig, self.own)]
        for name in self.order:
            source, target, side = self.source[name], self.target[name], self.side
            bone = self.rig.data.bones[name]
            parent = bone.parent.name if bone.parent is not None and bone.use_inherit_rotation else None
            if parent is None:
                above = world[1] @ target.turn, self.facing @ world[0] @ source.turn
                left[name] = above[0].T @ above[1] @ side
            else:
                own = self.target[parent].turn.T @ target.turn
                given = self.source[parent].turn.T @ source.turn
                left[name] = own.T @ offset[parent].T @ side @ given @ side
            if name in keyed:
                offset[name] = self.limb[name]
            else:
                # It stays at `basis`: what that makes of P₂ beside G P₁ S.
                offset[name] = (left[name] @ side @ basis[name] @ side).T @ basis[name]
        return left, offset

    def shift(self) -> Floats:
        """How far the hips move up for the feet to stand as at rest when the target rests as the source."""
        if self.legs is None:
            return np.zeros(3)
        keyed = set(self.order)
        basis = {name: np.eye(3) for name in self.order}
        posed = self._posed_heads(*self.rests_to_turn(keyed, basis))
        rest = {name: each.world_head for name, each in self.target.items()}
        up = _squared(self.legs.up(rest), self.own)
        return ((self.legs.ankles(rest) - self.legs.ankles(posed)) @ up) * up

    def _posed_heads(self, left: Mapping[str, Floats], offset: Mapping[str, Floats]) -> dict[str, Floats]:
        """Heads of the target in the world while the source is at rest."""
        turns, heads = {}, {}
        for name in self.order:
            rest, bone = self.target[name], self.rig.data.bones[name]
            turn = left[name] @ offset[name]
            if bone.parent is None:
                turns[name], heads[name] = rest.world_turn @ turn, rest.world_head
                continue
            above = self.target[bone.parent.name]
            from_parent = above.world_turn.T @ rest.world_turn
            place = above.world_turn.T @ (rest.world_head - above.world_head)
            parent = bone.parent.name
            heads[name] = heads[parent] + turns[parent] @ place
            inherited = turns[parent] @ from_parent if bone.use_inherit_rotation else rest.world_turn
            turns[name] = inherited @ turn
        return heads

    def size(self, name: str) -> float:
        """How much longer places of a bone are, in the units of the two rigs."""
        return self.units * (self.steps if name in self.carrying else self.growth[name])


def _main_child(bone: bpy.types.Bone) -> str | None:
    """The name of the child in whose head the limb of a bone ends, or None where it is the bone's tail."""
    joined = [child for child in bone.children if child.use_connect]
    if joined:
        return joined[0].name
    apart = [
        child
        for child in bone.children
        if (child.head_local - bone.head_local).length > SHORTEST_LIMB * bone.length
    ]
    return apart[0].name if len(apart) == 1 else None


def _rest(rig: bpy.types.Object, name: str, child: str | None) -> Rest:
    bone = rig.data.bones[name]
    turn, head = np.array(bone.matrix_local.to_3x3()), np.array(bone.head_local)
    world = np.array(rig.matrix_world)
    end = rig.data.bones[child].head_local if child is not None else bone.tail_local
    limb = turn.T @ (np.array(end) - head)
    length = np.linalg.norm(limb)
    limb = limb / length if length > 0.0 else np.array([0.0, 1.0, 0.0])
    return Rest(turn, head, turn_of(rig.matrix_world) @ turn, world[:3, :3] @ head + world[:3, 3], limb)


def turn_of(matrix: Matrix | Floats) -> Floats:
    """The turn, or mirroring turn, of a matrix, (3, 3)."""
    left, _, right = np.linalg.svd(np.array(matrix, np.float64)[:3, :3])
    return left @ right


def scale_of(obj: bpy.types.Object) -> float:
    return float(np.cbrt(abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3]))))


def _shortest_turn(direction: Floats, wanted: Floats) -> Floats:
    """The smallest turn, (3, 3), that takes one unit vector to another."""
    return np.array(Vector([*direction]).rotation_difference(Vector([*wanted])).to_matrix())


def _facing(
    source: Mapping[str, Rest],
    target: Mapping[str, Rest],
    held: set[str],
    mirrors: bool,
    bodies: tuple[bpy.types.Object, bpy.types.Object],
) -> Floats:
    """What turns the source's body as it stands at rest to the target's, (3, 3), mirroring if the map does.

    Joints and bones' axes tell it up to what differs in their poses. Bodies that stand by quarter turns to
    each other, in the scene or in their objects' axes, stand exactly so.
    """
    names = [name for name in source if name in held] or list(source)
    size = np.ptp([source[name].world_head for name in names], axis=0).max()
    left, _, right = np.linalg.svd(_marks(target, names, size).T @ _marks(source, names, size))
    side = np.linalg.det(left @ right) * (-1.0 if mirrors else 1.0)
    found = left @ np.diag((1.0, 1.0, np.sign(side))) @ right
    first, second = (turn_of(body.matrix_world) for body in bodies)
    quarters = [second @ quarter @ first.T for quarter in _quarters(second.T @ found @ first)]
    quarters += _quarters(found)
    nearest = min(quarters, key=lambda turn: np.linalg.norm(turn - found), default=found)
    return nearest if _angle(nearest @ found.T) < QUARTERS else found


def _marks(rests: Mapping[str, Rest], names: Sequence[str], size: float) -> Floats:
    """Heads of bones, and places beside them along those axes of theirs that no mirroring turns over."""
    middle = np.mean([rests[name].world_head for name in names], axis=0)
    ends = [rests[name].world_head - middle for name in names]
    axes = [AXES_COUNT * size * rests[name].world_turn[:, k] for name in names for k in (1, 2)]
    return np.array(ends + axes)


def _quarters(turn: Floats) -> list[Floats]:
    """The whole quarter turn, mirroring or not, next to a turn, in a list: none between two of them."""
    nearest = np.rint(turn)
    return [nearest] if np.allclose(nearest @ nearest.T, np.eye(3)) else []


def _angle(turn: Floats) -> float:
    """Of a turn that is no mirroring one, degrees."""
    return np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))


def _squared(direction: Floats, obj: bpy.types.Object) -> Floats:
    """The axis of the scene or of an object next to a direction, or itself where none is near."""
    axes = np.vstack([np.eye(3), turn_of(obj.matrix_world).T])
    axes = np.vstack([axes, -axes])
    nearest = axes[(axes @ direction).argmax()]
    return nearest if nearest @ direction > np.cos(np.radians(QUARTERS)) else direction
