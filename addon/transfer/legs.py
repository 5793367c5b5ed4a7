# SPDX-License-Identifier: GPL-3.0-or-later
"""The legs of a rig at rest: their length, by which steps are scaled, and the direction up."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import bpy
import numpy as np

from ..typed import Floats

# Places (3,) of the heads of bones.
Heads = Mapping[str, Floats]

# Two limbs are a pair when each of their bones is as long as the other's up to this share of the limb.
ALIKE = 0.05
# A limb is at least this share as long as the longest one.
LONG = 0.5
# A foot leaves the line of its leg by more than this, degrees.
BEND = 35.0


@dataclass(frozen=True)
class Legs:
    """`joints` are the bones of each leg whose heads are its joints, from hip to ankle; `hips` is the bone
    on which all legs hang.
    """

    joints: tuple[Sequence[str], ...]
    hips: str

    def length(self, heads: Heads) -> float:
        """Mean length of the legs, for the places (3,) of all heads."""
        return float(np.mean([_length(leg, heads) for leg in self.joints]))

    def up(self, heads: Heads) -> Floats:
        """From the ankles to the joints of the hips, a unit vector."""
        along = np.sum([heads[leg[0]] - heads[leg[-1]] for leg in self.joints], axis=0)
        return along / max(np.linalg.norm(along), np.finfo(float).tiny)

    def ankles(self, heads: Heads) -> Floats:
        """The middle of the ankles."""
        return np.mean([heads[leg[-1]] for leg in self.joints], axis=0)


def legs_of(bones: Iterable[bpy.types.Bone], held: Container[str], heads: Heads) -> Legs | None:
    """The legs among bones with these heads; those `held` by the surface, and those above such, count.

    They are the pair of long limbs that branches off nearest to the root: the legs of a biped, whose root is
    at the hips, hind legs of a quadruped. None where there is no such pair.
    """
    counted = {name for bone in bones if bone.name in held for name in _upwards(bone)}
    children = {
        bone.name: [child.name for child in bone.children if child.name in counted]
        for bone in bones
        if bone.name in counted
    }
    paths = {}

    def path(name: str) -> list[str]:
        if name not in paths:
            ways = [path(child) for child in children[name]]
            paths[name] = [name, *max(ways, key=lambda way: _length([name, *way], heads), default=[])]
        return paths[name]

    longest = max((_length(path(name), heads) for name in children), default=0.0)
    depth = {bone.name: len(bone.parent_recursive) for bone in bones}
    pairs = []
    for hips, limbs in children.items():
        long = [path(limb) for limb in limbs if _length(path(limb), heads) >= LONG * longest]
        alike = [pair for pair in combinations(long, 2) if _alike(*pair, heads)]
        pairs += [(depth[hips], -_length(pair[0], heads), hips, pair) for pair in alike]
    if not pairs:
        return None
    _, _, hips, found = min(pairs, key=lambda pair: pair[:3])
    return Legs(tuple(_to_ankle(limb, heads) for limb in found), hips)


def _upwards(bone: bpy.types.Bone) -> list[str]:
    return [bone.name, *(above.name for above in bone.parent_recursive)]


def _steps(path: Sequence[str], heads: Heads) -> list[float]:
    return [float(np.linalg.norm(heads[b] - heads[a])) for a, b in pairwise(path)]


def _length(path: Sequence[str], heads: Heads) -> float:
    return sum(_steps(path, heads))


def _alike(one: Sequence[str], other: Sequence[str], heads: Heads) -> bool:
    steps = _steps(one, heads), _steps(other, heads)
    if len(one) != len(other):
        return False
    return np.abs(np.subtract(*steps)).max(initial=0.0) <= ALIKE * max(map(sum, steps))


def _to_ankle(limb: Sequence[str], heads: Heads) -> Sequence[str]:
    """The joints of a limb up to that at which it bends for good, as a leg does into the foot."""
    for number in range(2, len(limb) - 1):
        leg = heads[limb[number]] - heads[limb[0]]
        foot = heads[limb[number + 1]] - heads[limb[number]]
        size = np.linalg.norm(leg) * np.linalg.norm(foot)
        if size > 0.0 and np.degrees(np.arccos(np.clip(leg @ foot / size, -1.0, 1.0))) > BEND:
            return limb[: number + 1]
    return limb[:-1] if len(limb) > 3 else limb
