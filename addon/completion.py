# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies of which one half is modelled and a Mirror modifier adds the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Integers = NDArray[np.integer[Any]]

# Vertices this near to their images, as a share of the body's size, lie on the mirror even if Merge is off.
ON_MIRROR = 1e-6
# Of a half at most this share of the vertices lies behind the mirror.
BEHIND = 0.05


@dataclass(frozen=True)
class Mirror:
    """One axis of a Mirror modifier.

    `to_mirror` (4, 4) leads from the object's space to that in which `axis` is turned around; vertices
    within `merged_within` of their images become one with them. `modifier` is its name.
    """

    to_mirror: Floats
    axis: int
    merged_within: float
    modifier: str = ""

    @property
    def reflection(self) -> Floats:
        """In the object's space, (4, 4)."""
        flip = np.eye(4)
        flip[self.axis, self.axis] = -1.0
        return np.linalg.inv(self.to_mirror) @ flip @ self.to_mirror

    def sides(self, points: Floats) -> Floats:
        """How far each point lies before the mirror, negative behind it, in the mirror's space: (n,)."""
        return points @ self.to_mirror[self.axis, :3] + self.to_mirror[self.axis, 3]

    def reflected(self, points: Floats) -> Floats:
        reflection = self.reflection
        return points @ reflection[:3, :3].T + reflection[:3, 3]

    def merged(self, points: Floats) -> NDArray[np.bool_]:
        """Which points become one with their images, (n,)."""
        return np.linalg.norm(self.reflected(points) - points, axis=1) <= self.reach(points)

    def reach(self, points: Floats) -> float:
        """How far from its image a point of these may lie to become one with it."""
        return max(self.merged_within, ON_MIRROR * np.ptp(points, axis=0).max())

    def completes(self, points: Floats) -> bool:
        """Whether a body with these points is a half that is joined to its image."""
        merged = self.merged(points)
        before = self.sides(points[~merged]) > 0.0
        behind = min(np.count_nonzero(before), np.count_nonzero(~before))
        return 0 < np.count_nonzero(merged) < len(points) and behind <= BEHIND * len(points)


@dataclass(frozen=True)
class Body:
    """What of an object the core is given.

    `points` (n, 3) float64 are coordinates in object space, the modelled vertices first; `triangles` (m, 3).
    `face` (m,) is the modelled triangle that each shows, `turned` (m,) whether it is wound the other way, and
    `image` (m,) in which mirrors: bit k is set where the k-th one turned it around.
    """

    points: Floats
    triangles: Integers
    face: Integers
    turned: NDArray[np.bool_]
    image: Integers

    @classmethod
    def modelled(cls, points: Floats, triangles: Integers) -> Body:
        """A body as it is modelled."""
        none = np.zeros(len(triangles), int)
        return cls(points, triangles, np.arange(len(triangles)), none > 0, none)

    def completed(self, mirror: Mirror) -> Body:
        """This body and its mirror image in one, joined where they meet."""
        count = len(self.points)
        merged = mirror.merged(self.points)
        image = np.where(merged, np.arange(count), count - 1 + np.cumsum(~merged))
        points = self.points.copy()
        points[merged] = (points[merged] + mirror.reflected(points[merged])) / 2.0
        # A face in the mirror, which is its own image, would be a wall inside of the whole.
        kept = ~merged[self.triangles].all(axis=1)
        triangles, before = self.triangles[kept], self.image[kept]
        return Body(
            np.concatenate([points, mirror.reflected(self.points[~merged])]),
            np.concatenate([triangles, image[triangles][:, ::-1]]).astype(np.int32),
            np.tile(self.face[kept], 2),
            np.concatenate([self.turned[kept], ~self.turned[kept]]),
            np.concatenate([before, before + (1 << int(self.image.max(initial=0)).bit_length())]),
        )

    def as_modelled(self, faces: Integers, barycentric: Floats) -> tuple[Integers, Floats]:
        """Places in these triangles → the same in the modelled triangles that they show."""
        turned = self.turned[faces]
        return self.face[faces], np.where(turned[:, None], barycentric[:, ::-1], barycentric)


def mirrors(obj: bpy.types.Object, points: Floats) -> list[Mirror]:
    """The mirrors that complete an object with these points (n, 3), in Blender's order.

    One that cuts one side away completes nothing, since both are modelled, nor one whose image lies apart.
    """
    found = []
    for modifier in obj.modifiers:
        if modifier.type != "MIRROR" or not modifier.show_viewport:
            continue
        to_mirror = np.eye(4)
        if modifier.mirror_object is not None:
            to_mirror = np.array(modifier.mirror_object.matrix_world.inverted_safe() @ obj.matrix_world)
        within = modifier.merge_threshold if modifier.use_mirror_merge else 0.0
        for axis in range(3):
            mirror = Mirror(to_mirror, axis, within, modifier.name)
            if modifier.use_axis[axis] and not modifier.use_bisect_axis[axis] and mirror.completes(points):
                found.append(mirror)
    return found


def reflections(obj: bpy.types.Object, images: Integers) -> Floats:
    """What takes a place of the modelled half to each of these images, in the object's space: (n, 4, 4)."""
    made = np.tile(np.eye(4), (len(images), 1, 1))
    if images.any():
        points = np.array([vertex.co for vertex in obj.data.vertices], np.float64)
        for bit, mirror in enumerate(mirrors(obj, points)):
            turned = images >> bit & 1 > 0
            made[turned] = mirror.reflection @ made[turned]
    return made


def mirror_objects(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The objects about which its Mirror modifiers mirror."""
    return [m.mirror_object for m in obj.modifiers if m.type == "MIRROR" and m.mirror_object is not None]
