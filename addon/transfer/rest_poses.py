# SPDX-License-Identifier: GPL-3.0-or-later
"""How a rig and the one fitted to the target rest, and what takes turns and places of one to the other.

The turn `B` of a bone from its place at rest becomes `L (S B S) N`: the core's `fitted_turns` says what these
are. That is linear in quaternions, and `σ L S` takes places to places, `σ` being how much larger the target
is: its legs for what carries the body, its surroundings for other bones.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .. import core
from ..typed import Flags, Floats, Integers
from .legs import legs_of

# A child whose head is nearer than this share of the bone's length is no end of a limb.
SHORTEST_LIMB = 1e-4


@dataclass
class Rest:
    """A bone at rest: `turn` (3, 3) and `head` (3,) in its rig, the same in the world, and `limb` (3,), the
    way to where its limb ends, in its own axes.
    """

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
        self.parents, self.loose = _hierarchy(rig, self.order)
        rigs = [turn_of(obj.matrix_world) for obj in (rig, own)]
        side = np.sign(np.linalg.det(self.facing) * np.linalg.det(rigs[0]) * np.linalg.det(rigs[1]))
        self.side = np.diag((side, 1.0, 1.0))
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
        still = [name not in keyed for name in self.order]
        left, offset = core.load().poses.fitted_turns(
            *(_stacked(rests, self.order)[1] for rests in (self.source, self.target)),
            np.where(self.loose, -1, self.parents),
            self.facing,
            source_limbs=[self.source[name].limb for name in self.order],
            target_limbs=[self.target[name].limb for name in self.order],
            kept=(still, [basis[name] for name in self.order]),
        )
        return dict(zip(self.order, left, strict=True)), dict(zip(self.order, offset, strict=True))

    def shift(self) -> Floats:
        """How far the hips move up for the feet to stand as at rest when the target rests as the source."""
        if self.legs is None:
            return np.zeros(3)
        keyed = set(self.order)
        basis = {name: np.eye(3) for name in self.order}
        posed = self._posed_heads(*self.rests_to_turn(keyed, basis))
        rest = {name: each.world_head for name, each in self.target.items()}
        axes = np.vstack([np.eye(3), turn_of(self.own.matrix_world).T])
        up = core.load().poses.nearest_axis(self.legs.up(rest), axes)
        return ((self.legs.ankles(rest) - self.legs.ankles(posed)) @ up) * up

    def _posed_heads(self, left: Mapping[str, Floats], offset: Mapping[str, Floats]) -> dict[str, Floats]:
        """Heads of the target in the world while the source is at rest."""
        turns = [left[name] @ offset[name] for name in self.order]
        heads = core.load().poses.posed_heads(
            *_stacked(self.target, self.order), self.parents, turns, loose=self.loose
        )
        return dict(zip(self.order, heads, strict=True))

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
    return Rest(turn, head, turn_of(rig.matrix_world) @ turn, world[:3, :3] @ head + world[:3, 3], limb)


def _stacked(rests: Mapping[str, Rest], names: Iterable[str]) -> tuple[Floats, Floats]:
    """Heads (n, 3) and axes (n, 3, 3) of bones in the world."""
    some = [rests[name] for name in names]
    return np.array([rest.world_head for rest in some]), np.array([rest.world_turn for rest in some])


def _hierarchy(rig: bpy.types.Object, order: Iterable[str]) -> tuple[Integers, Flags]:
    """Numbers (n,) of the bones' parents, −1 of roots, and which bones do not turn with theirs (n,)."""
    number = {name: place for place, name in enumerate(order)}
    bones = [rig.data.bones[name] for name in number]
    parents = [-1 if bone.parent is None else number[bone.parent.name] for bone in bones]
    return np.array(parents), np.array([not bone.use_inherit_rotation for bone in bones])


def turn_of(matrix: Matrix | Floats) -> Floats:
    """The turn, or mirroring turn, of a matrix, (3, 3)."""
    turn: Floats = core.load().poses.polar(np.array(matrix, np.float64)[:3, :3])[0]
    return turn


def scale_of(obj: bpy.types.Object) -> float:
    return float(np.cbrt(abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3]))))


def _facing(
    source: Mapping[str, Rest],
    target: Mapping[str, Rest],
    held: set[str],
    mirrors: bool,
    bodies: tuple[bpy.types.Object, bpy.types.Object],
) -> Floats:
    """What turns the source's body as it stands at rest to the target's, (3, 3), mirroring if the map does.

    The bones that move the surface tell it; bodies that stand by quarter turns to each other, in the scene or
    in their objects' axes, stand exactly so.
    """
    names = [name for name in source if name in held] or list(source)
    spaces = [np.array(body.matrix_world)[:3, :3] for body in bodies]
    found: Floats = core.load().poses.facing(
        *_stacked(source, names), *_stacked(target, names), mirrors=mirrors, spaces=spaces
    )
    return found
