# SPDX-License-Identifier: GPL-3.0-or-later
"""The template that all characters share: a skeleton, the skin around it, and how a build changes both.

Every character is the template, meshed in its own way and then changed by a smooth map of space. So each
point of each character has one place on the template, and points of two characters with the same place
correspond: that is the truth, known by construction, for every vertex. Up is +Z, front is −Y, left is +X;
the template is 1.6 m tall.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .sculpt import blend, bounded, box, carve, common, ellipsoid, mirrored, round_cone

FINGERS = ("thumb", "index", "middle", "ring", "little")
FACE = np.array((0.0, -0.105, 1.40))
EYE = np.array((0.060, -0.111, 1.412))
EYE_RADII = np.array((0.036, 0.030, 0.043))
EYE_TURN = 0.22
"""Radians by which an eye looks outwards, as the face bends there."""
MOUTH = np.array((0.0, -0.128, 1.302))


@dataclass(frozen=True)
class Bone:
    name: str
    parent: str | None
    head: np.ndarray
    tail: np.ndarray
    radii: tuple[float, float]


def _skeleton() -> list[Bone]:
    bones: list[Bone] = []

    def add(name, parent, head, tail, *radii):
        bones.append(Bone(name, parent, np.array(head, float), np.array(tail, float), radii))

    add("hips", None, (0, 0.01, 0.80), (0, 0.01, 0.90), 0.11, 0.10)
    add("spine", "hips", (0, 0.01, 0.90), (0, 0.005, 1.01), 0.095, 0.095)
    add("chest", "spine", (0, 0.005, 1.01), (0, 0.015, 1.16), 0.105, 0.08)
    add("neck", "chest", (0, 0.015, 1.16), (0, 0.0, 1.26), 0.05, 0.048)
    add("head", "neck", (0, 0.0, 1.26), (0, 0.0, 1.60), 0.13, 0.13)
    add("shoulder.L", "chest", (0.025, 0.01, 1.125), (0.115, 0.012, 1.125), 0.05, 0.05)
    shoulder, elbow, wrist = arm_joints()
    add("upper_arm.L", "shoulder.L", shoulder, elbow, 0.044, 0.036)
    add("forearm.L", "upper_arm.L", elbow, wrist, 0.036, 0.026)
    along, across, front = arm_frame()
    palm = wrist + 0.075 * along
    add("hand.L", "forearm.L", wrist, palm, 0.03, 0.034)
    for number, finger in enumerate(FINGERS[1:]):
        side = (number - 1.5) * 0.0235
        spread = along - 0.16 * (number - 1.5) / 1.5 * front
        spread /= np.linalg.norm(spread)
        base = wrist + (0.078 - 0.006 * abs(number - 1)) * along - side * front
        length = (0.062, 0.070, 0.064, 0.050)[number]
        middle, tip = base + 0.52 * length * spread, base + length * (spread + 0.10 * across)
        add(f"{finger}_1.L", "hand.L", base, middle, 0.0125, 0.0118)
        add(f"{finger}_2.L", f"{finger}_1.L", middle, tip, 0.0118, 0.0105)
    base = wrist + 0.022 * along + 0.026 * front + 0.004 * across
    way = 0.72 * along + 0.66 * front + 0.22 * across
    way /= np.linalg.norm(way)
    add("thumb_1.L", "hand.L", base, base + 0.036 * way, 0.0155, 0.0135)
    add(
        "thumb_2.L",
        "thumb_1.L",
        base + 0.036 * way,
        base + 0.036 * way + 0.030 * along + 0.01 * front,
        0.0135,
        0.0115,
    )
    add("thigh.L", "hips", (0.080, 0.01, 0.79), (0.090, 0.0, 0.44), 0.085, 0.056)
    add("shin.L", "thigh.L", (0.090, 0.0, 0.44), (0.096, 0.02, 0.085), 0.055, 0.036)
    add("foot.L", "shin.L", (0.096, 0.02, 0.085), (0.106, -0.085, 0.032), 0.042, 0.034)
    add("toes.L", "foot.L", (0.106, -0.085, 0.032), (0.112, -0.15, 0.028), 0.034, 0.026)
    flip = np.array((-1.0, 1.0, 1.0))
    for bone in list(bones):
        if bone.name.endswith(".L"):
            parent = bone.parent[:-1] + "R" if bone.parent and bone.parent.endswith(".L") else bone.parent
            bones.append(Bone(bone.name[:-1] + "R", parent, bone.head * flip, bone.tail * flip, bone.radii))
    return bones


def arm_frame():
    """Directions of the left arm at rest: along it, to the back of the hand's inner side (down), to the
    front."""
    along = np.array((0.74, -0.02, -0.67))
    along /= np.linalg.norm(along)
    front = np.array((0.0, -1.0, 0.0)) - along * along[1] * -1.0
    front /= np.linalg.norm(front)
    return along, np.cross(front, along), front


def arm_joints():
    along, _, _ = arm_frame()
    shoulder = np.array((0.115, 0.012, 1.125))
    elbow = shoulder + 0.215 * along + (0, 0.006, 0)
    return shoulder, elbow, elbow + 0.195 * along + (0, -0.012, 0)


SKELETON = _skeleton()
INDEX = {bone.name: number for number, bone in enumerate(SKELETON)}
HEADS = np.array([bone.head for bone in SKELETON])
TAILS = np.array([bone.tail for bone in SKELETON])


def joint(name):
    return HEADS[INDEX[name]]


def cone(name, first, second, start=0.0, end=1.0):
    """A round cone along a bone."""
    bone = SKELETON[INDEX[name]]
    axis = bone.tail - bone.head
    return round_cone(bone.head + start * axis, bone.head + end * axis, first, second)


# ------------------------------------------------------------------ skin


def head_solid():
    """Skull, cheeks, nose, ears and an open mouth, with the neck below."""
    skull = blend(
        0.07,
        ellipsoid((0, 0.015, 1.448), (0.148, 0.158, 0.150)),
        ellipsoid((0, -0.040, 1.345), (0.112, 0.098, 0.098)),
        ellipsoid((0.060, -0.072, 1.338), (0.050, 0.052, 0.046)),
    )
    skull = blend(0.05, skull, ellipsoid((0, -0.098, 1.264), (0.040, 0.036, 0.030)))
    # Shallow orbits, so that the brow stands out.
    skull = carve(0.03, skull, ellipsoid((0.060, -0.150, 1.410), (0.042, 0.022, 0.042)))
    nose = blend(
        0.012,
        ellipsoid((0, -0.156, 1.362), (0.021, 0.024, 0.018)),
        round_cone((0, -0.125, 1.42), (0, -0.148, 1.368), 0.010, 0.012),
    )
    skull = blend(0.022, skull, nose)
    lean = np.array([(0.90, 0.30, 0.30), (-0.36, 0.92, 0.14), (-0.23, -0.25, 0.94)])
    lean, _ = np.linalg.qr(lean.T)
    lean = (lean * np.sign(np.diag(lean))).T
    ear = ellipsoid((0.150, 0.020, 1.385), (0.015, 0.028, 0.040), lean)
    ear = carve(0.008, ear, ellipsoid((0.164, 0.006, 1.388), (0.010, 0.016, 0.025), lean))
    skull = blend(0.018, skull, ear)
    # Lips around a smile, and the cavity behind it.
    lip = ellipsoid(MOUTH + (0, -0.002, -0.002), (0.054, 0.030, 0.030))
    skull = blend(0.030, skull, lip)
    hollow = ellipsoid(MOUTH + (0, -0.022, 0.004), (0.039, 0.046, 0.020))
    return carve(
        0.014, skull, common(0.014, hollow, lambda p: p[:, 2] - MOUTH[2] - 0.004 - 7.0 * p[:, 0] ** 2)
    )


def neck_solid():
    return round_cone((0, 0.018, 1.12), (0, 0.005, 1.30), 0.056, 0.046)


def trunk_solid():
    trunk = blend(
        0.06,
        ellipsoid((0, 0.012, 0.82), (0.122, 0.098, 0.085)),
        ellipsoid((0, 0.008, 0.94), (0.098, 0.080, 0.110)),
        ellipsoid((0, 0.008, 1.06), (0.118, 0.088, 0.100)),
        round_cone((0.03, 0.012, 1.130), (0.108, 0.012, 1.120), 0.042, 0.046),
    )
    return blend(0.035, trunk, neck_solid(), ellipsoid((0.055, 0.045, 0.80), (0.058, 0.055, 0.062)))


def leg_solid():
    leg = blend(0.03, cone("thigh.L", 0.082, 0.054), cone("shin.L", 0.053, 0.036))
    return blend(0.03, leg, ellipsoid((0.094, 0.022, 0.33), (0.043, 0.045, 0.10)))


def foot_solid():
    ankle, ball, toe = joint("foot.L"), joint("toes.L"), TAILS[INDEX["toes.L"]]
    foot = blend(
        0.03,
        round_cone(ankle + (0, 0.018, -0.042), ball + (0, 0, 0.004), 0.038, 0.037),
        round_cone(ball, toe, 0.036, 0.029),
        round_cone(ankle, ball + (0, 0.02, 0.012), 0.036, 0.030),
    )
    return bounded(
        common(0.012, foot, lambda points: 0.002 - points[:, 2]), (0.04, -0.20, 0.0), (0.16, 0.08, 0.15)
    )


def arm_solid():
    return blend(0.03, cone("upper_arm.L", 0.046, 0.036, -0.06), cone("forearm.L", 0.037, 0.027))


def hand_solid():
    wrist = joint("hand.L")
    along, across, front = arm_frame()
    frame = np.stack([along, across, front])
    palm = blend(
        0.02,
        box(wrist + 0.046 * along, (0.043, 0.0155, 0.043), 0.015, frame),
        cone("forearm.L", 0.03, 0.0255, 0.8, 1.02),
        ellipsoid(wrist + 0.03 * along + 0.02 * front + 0.004 * across, (0.03, 0.018, 0.022), frame),
    )
    fingers = []
    for finger in FINGERS:
        first, second = (SKELETON[INDEX[f"{finger}_{part}.L"]] for part in (1, 2))
        start = first.head - (first.tail - first.head) * 0.3
        fingers.append(
            blend(
                0.006,
                round_cone(start, first.tail, first.radii[0], first.radii[1]),
                round_cone(second.head, second.tail, *second.radii),
            )
        )
    # Fingers are joined to the palm, and hardly to one another.
    union = fingers[0]
    for finger in fingers[1:]:
        union = blend(0.003, union, finger)
    reach = [
        each
        for bone in SKELETON
        if bone.parent == "hand.L" or "_2.L" in bone.name
        for each in (bone.head, bone.tail)
    ]
    reach.append(wrist - 0.05 * along)
    hand = blend(0.010, palm, union)
    return bounded(hand, np.min(reach, axis=0) - 0.03, np.max(reach, axis=0) + 0.03)


def skin_solid():
    """The whole body, both sides."""
    limbs = blend(0.025, leg_solid(), foot_solid())
    arm = blend(0.02, arm_solid(), hand_solid())
    return mirrored(blend(0.035, blend(0.04, trunk_solid(), arm), limbs))


NECK_CUT = 1.205
WRIST_CUT = 0.02
"""Head and hands are meshes of their own, cut below the collar and inside of the cuffs."""


def below_wrist(points):
    """Way past the left or right wrist, along the hand; negative on trunk and legs."""
    along = arm_frame()[0]
    folded = np.column_stack([np.abs(points[:, 0]), points[:, 1:]])
    return np.minimum((folded - joint("hand.L")) @ along + WRIST_CUT, folded[:, 0] - 0.26)


# ------------------------------------------------------------------ weights

SHARE = 0.32
"""Weights of two bones blend over this share of their radius."""
FLOOR = 0.02


def shares(points, softness: float = 1.0, bones=None) -> np.ndarray:
    """Weight of each bone (n, bones) at any place around the template, rows summing to 1."""
    chosen = range(len(SKELETON)) if bones is None else bones
    far = np.empty((len(chosen), len(points)))
    thick = np.empty((len(chosen), len(points)))
    for row, number in enumerate(chosen):
        bone = SKELETON[number]
        axis = bone.tail - bone.head
        along = np.clip((points - bone.head) @ axis / (axis @ axis), 0.0, 1.0)
        radius = bone.radii[0] + along * (bone.radii[1] - bone.radii[0])
        far[row] = np.linalg.norm(points - bone.head - along[:, None] * axis, axis=1) - radius
        thick[row] = radius
    nearest = far.min(axis=0)
    near = np.exp((nearest - far) / 0.012)
    width = softness * SHARE * (near * thick).sum(axis=0) / near.sum(axis=0)
    weights = np.exp((nearest - far) / width)
    return (weights / weights.sum(axis=0)).T


def skin_weights(points) -> np.ndarray:
    """As `shares`, without what is next to nothing."""
    weights = shares(points)
    weights[weights < FLOOR] = 0.0
    return weights / weights.sum(axis=1, keepdims=True)


# ------------------------------------------------------------------ builds


@dataclass(frozen=True)
class Puff:
    """A local change: around `centre`, within about `reach`, space is scaled and shifted; on both sides of
    the body."""

    centre: tuple[float, float, float]
    reach: tuple[float, float, float]
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __call__(self, points):
        moved = np.zeros_like(points)
        for side in (1.0, -1.0) if self.centre[0] else (1.0,):
            flip = np.array((side, 1.0, 1.0))
            relative = points - flip * self.centre
            weight = np.exp(-((relative / self.reach) ** 2).sum(axis=1))[:, None]
            moved += weight * (relative * (np.array(self.scale) - 1.0) + flip * self.shift)
        return points + moved


# Bones that a build scales: fingers go with their hand, toes with their foot.
SHAPING = [n for n, bone in enumerate(SKELETON) if "_1" not in bone.name and "_2" not in bone.name]
TRUNK = ("hips", "spine", "chest", "neck", "head", "shoulder", "hand", "foot", "toes")


@dataclass(frozen=True)
class Build:
    """A map of space: first the puffs, then a scale for each bone, blended as weights are.

    Of limbs `scales` has (thickness, length); of the trunk, head, hands and feet scales along x, y, z.
    `turns` are degrees about the y axis by which a left limb is turned at rest; the right one mirrors it.
    """

    scales: dict[str, tuple[float, ...]]
    turns: dict[str, float] = field(default_factory=dict)
    puffs: tuple[Puff, ...] = ()

    @cached_property
    def _moves(self):
        """For each shaping bone its affine map: (3, 3) and (3,)."""
        moves = {}
        for number in SHAPING:
            bone = SKELETON[number]
            group, side = bone.name.partition(".")[0], -1.0 if bone.name.endswith("R") else 1.0
            scale = self.scales.get(group, (1.0, 1.0, 1.0) if group in TRUNK else (1.0, 1.0))
            matrix = np.diag(scale) if len(scale) == 3 else _stretch(bone.tail - bone.head, *scale)
            turn = np.eye(3)
            head = self._puffed(bone.head[None])[0]
            place = head
            if bone.parent is not None:
                parent_matrix, parent_place, turn = moves[bone.parent]
                place = parent_matrix @ head + parent_place
            turn = turn @ _about_y(side * self.turns.get(group, 0.0))
            matrix = turn @ matrix
            moves[bone.name] = matrix, place - matrix @ head, turn
        return moves

    def _puffed(self, points):
        for puff in self.puffs:
            points = puff(points)
        return points

    def __call__(self, points) -> np.ndarray:
        """Places on the character of places on the template."""
        points = np.asarray(points, float)
        weights = shares(points, 2.4, SHAPING)
        puffed = self._puffed(points)
        moved = np.zeros_like(points)
        for column, number in enumerate(SHAPING):
            matrix, place, _ = self._moves[SKELETON[number].name]
            moved += weights[:, column, None] * (puffed @ matrix.T + place)
        return moved - (0.0, 0.0, self.floor)

    def joints(self):
        """Heads and tails of all bones."""
        ends = []
        for each in (HEADS, TAILS):
            puffed = self._puffed(each)
            rows = []
            for bone, point in zip(SKELETON, puffed, strict=True):
                name = bone.name
                while name not in self._moves:
                    name = SKELETON[INDEX[name]].parent
                matrix, place, _ = self._moves[name]
                rows.append(matrix @ point + place)
            ends.append(np.array(rows) - (0.0, 0.0, self.floor))
        return ends

    @cached_property
    def floor(self):
        """Height of the sole, which comes to stand on the ground."""
        matrix, place, _ = self._moves["foot.L"]
        return float((matrix @ (joint("foot.L") * (1, 1, 0)) + place)[2])


def _stretch(axis, thickness, length):
    axis = axis / np.linalg.norm(axis)
    return thickness * np.eye(3) + (length - thickness) * np.outer(axis, axis)


def _about_y(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([(c, 0, s), (0, 1, 0), (-s, 0, c)])


def eye_turn(side):
    """Axes of an eye as rows: to its side, backwards, up."""
    c, s = np.cos(EYE_TURN), side * np.sin(EYE_TURN)
    return np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)])
