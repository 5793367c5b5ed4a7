"""Characters made by code, with known correspondences between any two of one kind.

A character is a skeleton of bones, each a tapered capsule, blended into one smooth surface. Two builds of a
kind have the same bones with other lengths, thicknesses and poses, so a surface point is known by its bone,
its place along the bone (0…1) and its angle around it. Points inside the blend of a joint have no such
address; `carried` follows every point while the body changes into another one by small steps.

Coordinates are Blender's: up is +Z, front is −Y, left is +X. Everything is deterministic.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from . import extras
from .errors import ArgumentError

BLEND = 0.022
"""Softness of the union of capsules, in body lengths: about the radius of the fillet at a joint."""
OWN_SHARE = 0.8
"""A surface point belongs to one bone when this share of the blend is that bone's."""
AXIAL_MARGIN = 0.08
"""Left out at both ends of a bone, where a perpendicular through the axis may meet the cap."""
BASE_VERTICES = 20_000
"""Larger meshes start from one of about this size and are subdivided on the surface."""
RELAXATIONS = 25
STEPS = 16
"""From any body to the plain one at rest: twice as many move points by less than 0.005 % of the body."""
WEIGHT_FLOOR = 1e-3


@dataclass(frozen=True)
class Bone:
    """A tapered capsule: where it starts on its parent, its rest direction, length and two radii.

    `group` names what a build scales; `.L` and `.R` bones share it.
    """

    name: str
    parent: str | None
    along: float
    offset: tuple[float, float, float]
    direction: tuple[float, float, float]
    length: float
    radii: tuple[float, float]

    @property
    def group(self) -> str:
        return self.name.split(".")[0]


def _both_sides(bones: list[Bone]) -> list[Bone]:
    """Left bones (`.L`) with their right partners after them."""
    result = []
    for bone in bones:
        result.append(bone)
        if bone.name.endswith(".L"):
            x, y, z = bone.offset
            u, v, w = bone.direction
            parent = bone.parent
            if parent is not None and parent.endswith(".L"):
                parent = parent[:-1] + "R"
            result.append(
                Bone(
                    bone.name[:-1] + "R", parent, bone.along, (-x, y, z), (-u, v, w), bone.length, bone.radii
                )
            )
    return result


SKELETONS: dict[str, list[Bone]] = {
    "biped": _both_sides(
        [
            Bone("hips", None, 0, (0, 0, 0.95), (0, 0, 1), 0.26, (0.25, 0.26)),
            Bone("chest", "hips", 1, (0, 0, 0), (0, 0, 1), 0.28, (0.25, 0.18)),
            Bone("neck", "chest", 1, (0, 0, 0), (0, -0.1, 1), 0.26, (0.12, 0.11)),
            Bone("head", "neck", 1, (0, 0, 0), (0, -0.1, 1), 0.16, (0.25, 0.20)),
            Bone("snout", "head", 0.1, (0, -0.08, 0), (0, -1, -0.12), 0.36, (0.14, 0.075)),
            Bone("ear.L", "head", 0.9, (0.10, 0.02, 0.02), (0.6, 0.1, 1), 0.36, (0.085, 0.035)),
            Bone("upper_arm.L", "chest", 1, (0.14, 0, -0.04), (1, 0, -0.45), 0.40, (0.095, 0.08)),
            Bone("forearm.L", "upper_arm.L", 1, (0, 0, 0), (1, -0.1, -0.45), 0.34, (0.08, 0.062)),
            Bone("hand.L", "forearm.L", 1, (0, 0, 0), (1, -0.1, -0.45), 0.15, (0.09, 0.075)),
            Bone("thigh.L", "hips", 0, (0.15, 0, -0.04), (0.14, 0, -1), 0.42, (0.14, 0.105)),
            Bone("shin.L", "thigh.L", 1, (0, 0, 0), (0.02, 0.04, -1), 0.38, (0.10, 0.075)),
            Bone("foot.L", "shin.L", 1, (0, 0.02, 0), (0.12, -1, -0.06), 0.25, (0.09, 0.075)),
            Bone("tail_root", "hips", 0, (0, 0.12, 0.02), (0, 1, -0.25), 0.36, (0.10, 0.085)),
            Bone("tail", "tail_root", 1, (0, 0, 0), (0, 1, 0.15), 0.32, (0.085, 0.08)),
            Bone("tail_tip", "tail", 1, (0, 0, 0), (0, 0.8, 0.6), 0.30, (0.08, 0.04)),
        ]
    ),
    "quadruped": _both_sides(
        [
            Bone("hips", None, 0, (0, 0.45, 0.95), (0, -1, 0.02), 0.45, (0.23, 0.24)),
            Bone("chest", "hips", 1, (0, 0, 0), (0, -1, 0.02), 0.42, (0.24, 0.25)),
            Bone("neck", "chest", 1, (0, 0, 0.06), (0, -0.7, 1), 0.42, (0.16, 0.12)),
            Bone("head", "neck", 1, (0, 0, 0), (0, -0.8, 0.35), 0.20, (0.19, 0.17)),
            Bone("snout", "head", 1, (0, 0, -0.03), (0, -1, -0.25), 0.30, (0.12, 0.08)),
            Bone("ear.L", "head", 0.2, (0.10, 0.02, 0.10), (0.45, 0.25, 1), 0.30, (0.07, 0.03)),
            Bone("upper_arm.L", "chest", 1, (0.15, 0.02, -0.05), (0.05, 0.12, -1), 0.42, (0.12, 0.09)),
            Bone("forearm.L", "upper_arm.L", 1, (0, 0, 0), (0, -0.1, -1), 0.38, (0.09, 0.065)),
            Bone("hand.L", "forearm.L", 1, (0, 0, 0), (0, -1, -0.1), 0.13, (0.075, 0.065)),
            Bone("thigh.L", "hips", 0, (0.14, 0, -0.05), (0.05, -0.15, -1), 0.42, (0.15, 0.10)),
            Bone("shin.L", "thigh.L", 1, (0, 0, 0), (0, 0.3, -1), 0.40, (0.095, 0.065)),
            Bone("foot.L", "shin.L", 1, (0, 0, 0), (0, -1, -0.1), 0.14, (0.075, 0.065)),
            Bone("tail_root", "hips", 0, (0, 0.14, 0.1), (0, 1, 0.4), 0.30, (0.085, 0.07)),
            Bone("tail", "tail_root", 1, (0, 0, 0), (0, 1, -0.1), 0.30, (0.07, 0.065)),
            Bone("tail_tip", "tail", 1, (0, 0, 0), (0, 1, -0.5), 0.28, (0.065, 0.035)),
        ]
    ),
}

LEAST_RESOLUTION = 100
"""Coarser, limbs fall between the points of the grid."""

Scales = dict[str, tuple[float, float]]

BUILDS: dict[str, Scales] = {
    "plain": {},
    # group: (length, thickness)
    "slender": {
        "hips": (1.05, 0.78),
        "chest": (1.1, 0.8),
        "neck": (1.1, 0.85),
        "head": (0.95, 0.9),
        "snout": (1.15, 0.9),
        "ear": (1.25, 0.95),
        "upper_arm": (1.1, 0.82),
        "forearm": (1.12, 0.85),
        "hand": (1.0, 0.9),
        "thigh": (1.12, 0.85),
        "shin": (1.15, 0.85),
        "foot": (1.1, 0.9),
        "tail_root": (1.15, 0.9),
        "tail": (1.2, 1.0),
        "tail_tip": (1.2, 1.0),
    },
    "stout": {
        "hips": (1.0, 1.25),
        "chest": (0.95, 1.2),
        "neck": (0.95, 1.2),
        "head": (1.0, 1.12),
        "snout": (0.95, 1.2),
        "ear": (0.8, 1.2),
        "upper_arm": (0.95, 1.15),
        "forearm": (0.95, 1.2),
        "hand": (1.0, 1.2),
        "thigh": (0.85, 1.1),
        "shin": (0.88, 1.2),
        "foot": (1.0, 1.2),
        "tail_root": (0.9, 1.15),
        "tail": (0.85, 1.15),
        "tail_tip": (0.85, 1.2),
    },
}

Pose = dict[str, tuple[float, float, float]]

POSES: dict[str, dict[str, Pose]] = {
    # bone: degrees about X, Y, Z of the body; children follow.
    "biped": {
        "rest": {},
        "wave": {
            "upper_arm.L": (0, -40, 0),
            "forearm.L": (0, -55, 0),
            "upper_arm.R": (0, -25, 15),
            "forearm.R": (0, 0, 35),
            "head": (4, 8, 12),
            "chest": (0, -4, 4),
            "thigh.R": (8, 0, 0),
            "tail": (0, 0, 25),
            "tail_tip": (0, 0, 25),
        },
        "walk": {
            "thigh.L": (-34, 0, 0),
            "shin.L": (24, 0, 0),
            "thigh.R": (22, 0, 0),
            "shin.R": (28, 0, 0),
            "upper_arm.L": (0, 15, 35),
            "forearm.L": (0, 0, -20),
            "upper_arm.R": (0, -12, 38),
            "forearm.R": (0, 0, 35),
            "chest": (4, 0, -8),
            "head": (-4, 0, 14),
            "tail_root": (0, 0, -22),
            "tail": (12, 0, -26),
            "tail_tip": (18, 0, -20),
        },
    },
    "quadruped": {
        "rest": {},
        "wave": {
            "head": (0, 10, 12),
            "tail_root": (20, 0, 15),
            "tail": (15, 0, 20),
            "upper_arm.L": (-30, 0, 0),
        },
        "walk": {
            "upper_arm.L": (-28, 0, 0),
            "forearm.L": (22, 0, 0),
            "upper_arm.R": (20, 0, 0),
            "thigh.L": (22, 0, 0),
            "thigh.R": (-22, 0, 0),
            "shin.R": (14, 0, 0),
            "neck": (12, 0, 10),
            "head": (0, 0, 12),
            "tail_root": (-20, 0, -15),
            "tail": (-10, 0, -20),
        },
    },
}


class Body:
    """A posed skeleton and the surface around it.

    For each bone: `names`, start and end of the axis (`starts`, `ends`), `radii` (b, 2), and `frames` (b, 3,
    3) whose rows are the axis, the direction of angle 0 and the one of angle 90°.
    """

    def __init__(self, kind: str, build: Scales, pose: Pose):
        bones = SKELETONS[kind]
        self.kind, self.build, self.pose = kind, build, pose
        self.names = [bone.name for bone in bones]
        for given, what in ((pose, "pose"), (build, "build")):
            known = set(self.names) if what == "pose" else {bone.group for bone in bones}
            for name in given:
                if name not in known:
                    raise ValueError(f"{what} names {name!r}; a {kind} has {', '.join(sorted(known))}")
        placed: dict[str, tuple] = {}
        starts, ends, radii, frames = [], [], [], []
        for bone in bones:
            long, thick = build.get(bone.group, (1.0, 1.0))
            offset = np.array(bone.offset)
            start, turn = offset, np.eye(3)
            if bone.parent is not None:
                parent_start, parent_end, parent_turn, parent_thick = placed[bone.parent]
                turn = parent_turn
                start = parent_start + bone.along * (parent_end - parent_start)
                start = start + turn @ (offset * parent_thick)
            turn = turn @ _rotation(pose.get(bone.name, (0, 0, 0)))
            axis = np.array(bone.direction) / np.linalg.norm(bone.direction)
            end = start + turn @ axis * (bone.length * long)
            placed[bone.name] = start, end, turn, thick
            starts.append(start)
            ends.append(end)
            radii.append(np.array(bone.radii) * thick)
            frames.append(_frame(axis) @ turn.T)
        self.starts, self.ends, self.radii = np.array(starts), np.array(ends), np.array(radii)
        self.frames = np.array(frames)

    def towards_template(self, share: float) -> Body:
        """This body with `share` of its build and pose taken back; at 1 it is the plain one at rest."""
        left = 1 - share
        build = {name: (1 + left * (a - 1), 1 + left * (b - 1)) for name, (a, b) in self.build.items()}
        pose = {name: (left * x, left * y, left * z) for name, (x, y, z) in self.pose.items()}
        return Body(self.kind, build, pose)

    def level(self, points) -> np.ndarray:
        """Signed distance to the surface."""
        points = np.ascontiguousarray(np.asarray(points, dtype=np.float64).T)
        distances = np.stack([self._capsule(bone, points)[0] for bone in range(len(self.names))])
        return self._blended(distances)[0]

    def distance(self, points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signed distance to the surface, its gradient, and each bone's share (n, b) of the blend there."""
        points = np.ascontiguousarray(np.asarray(points, dtype=np.float64).T)
        distances = np.empty((len(self.names), points.shape[1]))
        gradients = np.empty((len(self.names), *points.shape))
        for bone in range(len(self.names)):
            distances[bone], along, outward, length = self._capsule(bone, points)
            axis = self.ends[bone] - self.starts[bone]
            slope = (self.radii[bone, 1] - self.radii[bone, 0]) / (axis @ axis)
            gradients[bone] = outward / np.maximum(length, 1e-12)
            gradients[bone] -= axis[:, None] * (slope * ((along > 0) & (along < 1)))
        distance, shares = self._blended(distances)
        return distance, np.einsum("bn,bdn->nd", shares, gradients), shares.T

    def _capsule(self, bone: int, points) -> tuple[np.ndarray, ...]:
        """Of points (3, n): distance to a capsule, place along its axis, way from there, its length."""
        axis = self.ends[bone] - self.starts[bone]
        outward = points - self.starts[bone][:, None]
        along = (axis @ outward / (axis @ axis)).clip(0, 1)
        outward -= axis[:, None] * along
        length = np.sqrt((outward**2).sum(axis=0))
        first, second = self.radii[bone]
        return length - first - (second - first) * along, along, outward, length

    def _blended(self, distances) -> tuple[np.ndarray, np.ndarray]:
        """The distance to the blend of all capsules from those to each (b, n), and each one's share of it."""
        nearest = distances.min(axis=0)
        shares = np.exp((nearest - distances) / BLEND)
        total = shares.sum(axis=0)
        return nearest - BLEND * np.log(total), shares / total

    def address(self, points, bones) -> tuple[np.ndarray, np.ndarray]:
        """Place along the given bones (0…1 between their ends) and angle around them (−π…π)."""
        axis = self.ends[bones] - self.starts[bones]
        relative = points - self.starts[bones]
        along = (relative * axis).sum(axis=1) / (axis**2).sum(axis=1)
        turned = np.einsum("nij,nj->ni", self.frames[bones], relative)
        return along, np.arctan2(turned[:, 2], turned[:, 1])

    def surface_point(self, bones, along, angle) -> np.ndarray:
        """The first point of the surface seen from the axis at an address."""
        origin = self.starts[bones] + along[:, None] * (self.ends[bones] - self.starts[bones])
        frames = self.frames[bones]
        ray = np.cos(angle)[:, None] * frames[:, 1] + np.sin(angle)[:, None] * frames[:, 2]
        radius = self.radii[bones, 0] + along * (self.radii[bones, 1] - self.radii[bones, 0])
        # The blend only adds to a capsule, so that the surface lies beyond its radius, and by little at an
        # address.
        near, far = 0.999 * radius, radius + 6 * BLEND
        for _ in range(40):
            middle = (near + far) / 2
            inside = self.level(origin + middle[:, None] * ray) < 0
            near, far = np.where(inside, middle, near), np.where(inside, far, middle)
        return origin + ((near + far) / 2)[:, None] * ray


@dataclass(frozen=True)
class Character:
    """A mesh of a `Body` and what is known of it.

    `part` is the bone of each vertex (index into `body.names`), `axial` and `angle` its address, `addressed`
    where that address is exact. `uv` (m, 3, 2) are the corners of the triangles in a layout with one island
    for each bone and a seam along it.
    """

    vertices: np.ndarray
    faces: np.ndarray
    part: np.ndarray
    axial: np.ndarray
    angle: np.ndarray
    addressed: np.ndarray
    uv: np.ndarray = field(repr=False)
    body: Body = field(repr=False)

    @cached_property
    def weights(self) -> np.ndarray:
        """Skin weights (n, bones), rows summing to 1: each bone's share of the blend on the plain body at
        rest. Corresponding points of two builds or poses have equal weights, as in any family of characters
        that share one template."""
        template = self.body.towards_template(1)
        points = carried(self.vertices, self.body, template)
        shares = _in_blocks(lambda block: template.distance(block)[2], points)
        weights = np.where(shares < WEIGHT_FLOOR, 0.0, shares)
        return weights / weights.sum(axis=1, keepdims=True)


def make(
    kind: str = "biped",
    build: str | Scales = "plain",
    pose: str | Pose = "rest",
    resolution: int = 5000,
    seed: int = 0,
) -> Character:
    """A character of about `resolution` vertices. `build` and `pose` are names or dictionaries like
    `BUILDS["stout"]` and `POSES["biped"]["walk"]`; `seed` turns and shifts the sampling grid, so that each
    has a mesh of its own."""
    named = (("kind", kind, SKELETONS), ("build", build, BUILDS), ("pose", pose, POSES.get(kind, {})))
    for name, value, known in named:
        if isinstance(value, str) and value not in known:
            raise ArgumentError(f"`{name}` should be one of {', '.join(known)}, got {value!r}")
    if resolution < LEAST_RESOLUTION:
        raise ArgumentError(f"`resolution` should be {LEAST_RESOLUTION} vertices or more, got {resolution}")
    scales = BUILDS[build] if isinstance(build, str) else build
    angles = POSES[kind][pose] if isinstance(pose, str) else pose
    body = Body(kind, scales, angles)
    vertices, faces = _mesh(body, resolution, seed)
    shares = _in_blocks(lambda block: body.distance(block)[2], vertices)
    part = shares.argmax(axis=1)
    axial, angle = body.address(vertices, part)
    addressed = _addressed(axial, shares, part)
    uv = _layout(body, vertices, faces, shares)
    return Character(vertices, faces, part, axial, angle, addressed, uv, body)


def truth(a: Character, b: Character) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of `a` with a known counterpart on `b`, and that counterpart's position (k, 3) on b's
    surface."""
    if a.body.kind != b.body.kind:
        raise ValueError(f"a {a.body.kind} and a {b.body.kind} have no common truth")
    ids = np.flatnonzero(a.addressed)
    part, axial = a.part[ids], a.axial[ids]
    points = b.body.surface_point(part, axial, a.angle[ids])
    distance, _, shares = b.body.distance(points)
    kept = _addressed(axial, shares, part) & (np.abs(distance) < 1e-6)
    return ids[kept], points[kept]


def carried(points, start: Body, end: Body) -> np.ndarray:
    """Where points of the surface of `start` lie on that of `end`, (n, 3): by way of the plain body at rest,
    in `STEPS` steps each way. In every step a point follows the bones by their shares of the blend, stretched
    along each bone and thickened around it, and is then laid onto the surface. Where `truth` knows the
    counterpart, this one lies some 0.1 % of the body from it on average."""
    if start.kind != end.kind:
        raise ValueError(f"a {start.kind} and a {end.kind} have no common points")
    there = np.arange(STEPS + 1) / STEPS
    way = [start.towards_template(share) for share in there]
    if end.build or end.pose:
        way += [end.towards_template(share) for share in there[-2::-1]]
    points = np.asarray(points, dtype=np.float64)
    for before, after in itertools.pairwise(way):
        points = _in_blocks(lambda block, a=before, b=after: _project(b, _following(block, a, b)), points)
    return points


def _following(points, before: Body, after: Body) -> np.ndarray:
    shares = before.distance(points)[2]
    moved = np.zeros_like(points)
    for i in range(len(before.names)):
        lengths = [np.linalg.norm(body.ends[i] - body.starts[i]) for body in (before, after)]
        local = (points - before.starts[i]) @ before.frames[i].T
        inside = np.clip(local[:, 0], 0, lengths[0])
        along = inside / lengths[0]
        radii = [body.radii[i, 0] + along * (body.radii[i, 1] - body.radii[i, 0]) for body in (before, after)]
        local[:, 0] -= inside
        local *= (radii[1] / radii[0])[:, None]
        local[:, 0] += along * lengths[1]
        moved += shares[:, i, None] * (after.starts[i] + local @ after.frames[i])
    return moved


def truth_vertices(a: Character, b: Character) -> tuple[np.ndarray, np.ndarray]:
    """As `truth`, but with the nearest vertex of `b` instead of the exact point."""
    extras.require("scipy")
    from scipy.spatial import cKDTree

    ids, points = truth(a, b)
    return ids, cKDTree(b.vertices).query(points)[1]


def _addressed(axial, shares, part) -> np.ndarray:
    own = shares[np.arange(len(part)), part]
    return (own > OWN_SHARE) & (axial > AXIAL_MARGIN) & (axial < 1 - AXIAL_MARGIN)


def _rotation(degrees) -> np.ndarray:
    x, y, z = np.radians(degrees)
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _frame(axis) -> np.ndarray:
    reference = np.eye(3)[np.argmin(np.abs(axis))]
    second = np.cross(axis, reference)
    second /= np.linalg.norm(second)
    return np.stack([axis, second, np.cross(axis, second)])


def _in_blocks(function, points, size: int = 200_000) -> np.ndarray:
    return np.concatenate([function(points[i : i + size]) for i in range(0, len(points), size)])


# ------------------------------------------------------------------ meshing


def _mesh(body: Body, resolution: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    levels = max(0, int(np.ceil(np.log2(resolution / BASE_VERTICES) / 2)))
    wanted = resolution / 4**levels
    # Vertices grow with 1/spacing²; a coarse mesh gives the factor for this body.
    coarse = 0.06
    spacing = coarse * np.sqrt(len(_march(body, coarse, seed)[0]) / wanted)
    vertices, faces = _march(body, spacing, seed)
    vertices = _relax(body, vertices, faces)
    for _ in range(levels):
        vertices, faces = subdivide(vertices, faces)
        vertices = _project(body, vertices)
    return vertices, faces


def _march(body: Body, spacing: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Isosurface on a grid turned and shifted by `seed`."""
    extras.require("skimage")
    from skimage.measure import marching_cubes

    random = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    shift = random.random(3)
    joints = np.concatenate([body.starts, body.ends]) @ turn
    reach = body.radii.max() + 4 * BLEND
    low = joints.min(axis=0) - reach - spacing * (1 + shift)
    counts = np.ceil((joints.max(axis=0) + reach - low) / spacing).astype(int) + 2
    steps = [low[i] + spacing * np.arange(counts[i]) for i in range(3)]
    values = np.empty(counts)
    plane = np.stack(np.meshgrid(steps[1], steps[2], indexing="ij"), axis=-1).reshape(-1, 2)
    for i, x in enumerate(steps[0]):
        points = np.column_stack([np.full(len(plane), x), plane]) @ turn.T
        values[i] = body.level(points).reshape(counts[1:])
    vertices, faces, _, _ = marching_cubes(values, 0.0, spacing=(spacing,) * 3, allow_degenerate=False)
    vertices = (vertices.astype(np.float64) + low) @ turn.T
    faces = faces.astype(np.int64)
    corners = vertices[faces]
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    return vertices, faces if volume > 0 else faces[:, ::-1]


def _relax(body: Body, vertices, faces) -> np.ndarray:
    """Even out the triangles: each vertex towards the mean of its neighbours, then back onto the surface."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    valence = np.bincount(ends[:, 0], minlength=len(vertices))
    for _ in range(RELAXATIONS):
        mean = np.stack(
            [np.bincount(ends[:, 0], vertices[ends[:, 1], i], len(vertices)) / valence for i in range(3)],
            axis=1,
        )
        vertices = _project(body, vertices + 0.6 * (mean - vertices))
    return vertices


def _project(body: Body, vertices, steps: int = 3) -> np.ndarray:
    def newton(block):
        for _ in range(steps):
            distance, gradient, _ = body.distance(block)
            block = block - (distance / np.maximum((gradient**2).sum(axis=1), 1e-9))[:, None] * gradient
        return block

    return _in_blocks(newton, vertices)


def subdivide(vertices, faces) -> tuple[np.ndarray, np.ndarray]:
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, ids = np.unique(edges, axis=0, return_inverse=True)
    middles = vertices[edges].mean(axis=1)
    ab, bc, ca = (ids.reshape(-1) + len(vertices)).reshape(3, -1)
    a, b, c = faces.T
    finer = np.concatenate(
        [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    )
    return np.concatenate([vertices, middles]), finer


def _layout(body: Body, vertices, faces, shares) -> np.ndarray:
    """One island for each bone, unrolled around its axis, in a grid of cells with a margin for the seam."""
    part = shares[faces].sum(axis=1).argmax(axis=1)
    corner_part = np.repeat(part, 3)
    along, angle = body.address(vertices[faces].reshape(-1, 3), corner_part)
    angle = angle.reshape(-1, 3)
    # A triangle across the seam keeps to the side of its first corner.
    turns = angle - angle[:, :1]
    angle = angle[:, :1] + turns - 2 * np.pi * np.round(turns / (2 * np.pi))
    columns = int(np.ceil(np.sqrt(len(body.names))))
    cell = np.stack([part % columns, part // columns], axis=1)[:, None, :]
    inside = np.stack([angle / (2 * np.pi) + 0.5, along.reshape(-1, 3)], axis=-1)
    # Caps reach beyond 0…1 along the axis, seam triangles around it; both stay within the cell.
    inside = 0.2 + 0.6 * np.clip(inside, -0.3, 1.3)
    return (cell + inside) / columns
