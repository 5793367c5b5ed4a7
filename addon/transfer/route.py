# SPDX-License-Identifier: GPL-3.0-or-later
"""The way from source to target: a stored match together with both meshes' faces and corners."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .. import character, completion, core, mesh_read, mesh_write
from ..mesh_read import UnusableObjectError
from ..outfit import wardrobe
from ..typed import Flags, Floats, Integers, Values
from .sides import Sides

if TYPE_CHECKING:
    from sgmds import SurfaceMap

    from .joined import View
    from .kind import Prepared

# A scale is even up to this: matrices are in single precision.
EVEN = 1e-5
# So much of the confidence in what is worn counts for what belongs to the whole character: a hat on one and a
# helmet on the other bent a head by 14.8 degrees, and bend it by 7. Without a body below, cloth tells.
WORN_COUNTS = 0.1


class Route:
    """Everything that a kind of data needs to travel from `source` to `target`.

    `body` is the object whose mesh is the source's surface with all that it carries: the source itself, or
    where a Mirror modifier completes it, the whole that was matched.

    `map` is the core's, in the coordinates of the two meshes, and `map_as_seen` that of the two bodies as the
    objects' scales stretch them, for what has directions and distances in space; `view` is what is seen of
    the source, in whose triangles the map leads; `faces` are the target's
    faces as the core takes them: first corners and vertices of corners. `wanted` names what is carried, by
    kind, `sides` how these names are written on the target, `uv_names` under which its UV maps come,
    `unwrapped` is the UV map that was made to bake into, if one was, `looks_right` whether textures were
    looked at in the one that is there, and `prepared` is what is ready of it.
    """

    def __init__(self, target: bpy.types.Object, view: View) -> None:
        self.view, self.source, self.body, self.target = view, view.object, view.body, target
        self.targets: Sequence[bpy.types.Object] = [target]
        # What is done with fitted rigs once all copies look at one another.
        self.fitted: list[Callable[[], Iterator[float]]] = []
        self.wanted: dict[str, list[str]] = {}
        self.sides = Sides()
        self.uv_names: dict[str, str] = {}
        self.unwrapped, self.looks_right = "", False
        self.prepared: list[Prepared] = []
        self.triangle_corners, self.triangle_faces = view.triangle_corners, view.triangle_faces
        self.triangles = mesh_read.corner_vertices(self.body.data)[self.triangle_corners]
        self.faces = mesh_read.face_starts(target.data), mesh_read.corner_vertices(target.data)

    def anew(self) -> Route:
        """The same way to the target as it is now, with nothing prepared."""
        route = Route(self.target, self.view)
        route.wanted, route.sides, route.uv_names = self.wanted, self.sides, self.uv_names
        return route

    @cached_property
    def source_points(self) -> NDArray[np.float64]:
        """Coordinates of the source's body, (n_source, 3)."""
        return mesh_read.positions(self.body.data).astype(np.float64)

    def shown_places(self, points: Floats) -> Floats:
        """Places of the body's vertices where the source's vertices are at `points`, (n, 3)."""
        return self.view.shown(points)

    @cached_property
    def target_points(self) -> NDArray[np.float64]:
        """Target coordinates, (n_target, 3)."""
        return mesh_read.positions(self.target.data).astype(np.float64)

    @cached_property
    def _target_fans(self) -> tuple[Integers, Integers]:
        return mesh_read.triangle_corners(self.target.data)

    @contextmanager
    def mesh_as_written(self) -> Iterator[bpy.types.Mesh]:
        """The target's mesh as what is `prepared` will shade it: a copy, removed in the end, or itself."""
        shades = [part.shade for part in self.prepared if part.shade is not None]
        if not shades:
            yield self.target.data
            return
        mesh = self.target.data.copy()
        try:
            for shade in shades:
                shade(mesh)
            mesh.update()
            yield mesh
        finally:
            bpy.data.meshes.remove(mesh)

    @cached_property
    def answering(self) -> list[bpy.types.Object]:
        """The meshes of the source on which the target has images, that with the most of them first."""
        piece, _, _, _ = mesh_write.read_places(self.target.data)
        count = np.bincount(piece, minlength=len(self.view.pieces))
        return [self.view.pieces[number] for number in np.argsort(-count, kind="stable") if count[number]]

    def keys_with(self, name: str) -> bpy.types.Key:
        """The source's own shape keys that one of this name comes from, of the first mesh that has it."""
        for obj in (*self.answering, *self.view.pieces):
            keys = obj.data.shape_keys
            if keys is not None and name in keys.key_blocks:
                return keys
        return self.source.data.shape_keys

    @property
    def target_corners(self) -> Integers:
        """Corners of the target's triangles, (m, 3)."""
        return self._target_fans[0]

    @property
    def target_triangle_faces(self) -> Integers:
        """Faces of the target's triangles, (m,)."""
        return self._target_fans[1]

    def surfaces(self, triangles: Integers) -> list[tuple[bpy.types.Object, Flags, Integers]]:
        """The target's meshes: the object, which of these triangles are on it, (m,), and their corners."""
        return [(self.target, np.ones(len(triangles), bool), self.target_corners[triangles])]

    @cached_property
    def carried_slots(self) -> Integers:
        """The source's material slot that each face of the target gets, (faces,)."""
        return self.map.face_labels(*self.faces, mesh_read.slots_shown(self.body)[self.triangle_faces])

    @cached_property
    def target_triangles(self) -> Integers:
        """Vertices of the target's triangles, (m, 3)."""
        return mesh_read.corner_vertices(self.target.data)[self.target_corners]

    @cached_property
    def map(self) -> SurfaceMap:
        """The core's `SurfaceMap`; weights are brought back to a sum of one from single precision."""
        return self._joined(self.source_points, self.target_points, *stored(self.view, self.target.data))

    def _joined(
        self,
        source_points: Floats,
        target_points: Floats,
        face: Integers,
        weights: Floats,
        confidence: Floats,
    ) -> SurfaceMap:
        return core.load().SurfaceMap(
            (source_points, self.triangles),
            (target_points, self.target_triangles),
            face,
            weights,
            confidence,
        )

    @cached_property
    def target_mirrors(self) -> list[completion.Mirror]:
        """The mirrors that complete the target, in the coordinates of its mesh."""
        return completion.mirrors(self.target, self.target_points)

    @cached_property
    def source_stretch(self) -> Floats:
        """How the object's scale stretches the source's coordinates, (3, 3); unity for an even scale."""
        return _stretch(self.source)

    @cached_property
    def target_stretch(self) -> Floats:
        """The same of the target."""
        return _stretch(self.target)

    @cached_property
    def map_as_seen(self) -> SurfaceMap:
        """The core's `SurfaceMap` of stretched coordinates: `map` itself where both scales are even."""
        if np.array_equal(self.source_stretch, np.eye(3)) and np.array_equal(self.target_stretch, np.eye(3)):
            return self.map
        return self._joined(
            self.source_points @ self.source_stretch,
            self.target_points @ self.target_stretch,
            self.map.faces,
            self.map.barycentric,
            self.map.confidence,
        )

    @property
    def source_to_world(self) -> Matrix:
        """Stretched coordinates of the source → world, 4 × 4."""
        return self.source.matrix_world @ Matrix(np.linalg.inv(self.source_stretch).tolist()).to_4x4()

    @property
    def target_to_world(self) -> Matrix:
        """Stretched coordinates of the target → world, 4 × 4."""
        return self.target.matrix_world @ Matrix(np.linalg.inv(self.target_stretch).tolist()).to_4x4()

    @cached_property
    def face(self) -> Integers:
        """Source triangle of each target vertex, (n,)."""
        return self.map.faces

    @cached_property
    def barycentric(self) -> Floats:
        """Weights of that triangle's corners, (n, 3)."""
        return self.map.barycentric

    def to_points(self, values: Values) -> Values:
        """Values at source vertices → values at target vertices, weighted in the triangle: (n, ...) → (m,
        ...).
        """
        first, second, third = (values[self.triangles[self.face, k]] for k in range(3))
        weights = self.barycentric.reshape(-1, 3, *[1] * (values.ndim - 1))
        # Written so that equal corner values come through unchanged to the last bit.
        return first + weights[:, 1] * (second - first) + weights[:, 2] * (third - first)

    def nearest_vertices(self) -> Integers:
        """The source vertex nearest to each target vertex's image."""
        strongest = self.barycentric.argmax(axis=1)
        return self.triangles[self.face, strongest]


class FigureRoute(Route):
    """The way to all meshes of a target at once, in the space of the first, which is `target`.

    It is for what belongs to the whole character: rigs, and objects that hang on it. These go by the body
    where it is known: what is worn counts less.
    """

    def __init__(self, targets: Sequence[bpy.types.Object], view: View) -> None:
        super().__init__(targets[0], view)
        self.targets = targets
        self._matrices = character.placed(targets)
        counts = [(len(obj.data.vertices), len(obj.data.loops), len(obj.data.polygons)) for obj in targets]
        self._before = np.cumsum([(0, 0, 0), *counts], axis=0)[:-1].tolist()
        starts = [mesh_read.face_starts(obj.data) for obj in targets]
        corners = [mesh_read.corner_vertices(obj.data) for obj in targets]
        self.faces = (
            np.concatenate(
                [own[:-1] + loops for own, (_, loops, _) in zip(starts, self._before, strict=True)]
                + [np.array([sum(map(len, corners))])]
            ).astype(np.int32),
            np.concatenate(
                [own + points for own, (points, _, _) in zip(corners, self._before, strict=True)]
            ).astype(np.int32),
        )

    @cached_property
    def target_points(self) -> NDArray[np.float64]:
        """Coordinates of all meshes in the space of the first, (n_target, 3)."""
        return np.concatenate(
            [
                mesh_read.positions(obj.data).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
                for obj, matrix in zip(self.targets, self._matrices, strict=True)
            ]
        )

    @cached_property
    def _target_fans(self) -> tuple[Integers, Integers]:
        corners, faces = [], []
        for obj, matrix, (_, loops, polygons) in zip(self.targets, self._matrices, self._before, strict=True):
            own_corners, own_faces = mesh_read.triangle_corners(obj.data)
            mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
            corners.append((own_corners[:, ::-1] if mirrored else own_corners) + loops)
            faces.append(own_faces + polygons)
        return np.concatenate(corners), np.concatenate(faces)

    def surfaces(self, triangles: Integers) -> list[tuple[bpy.types.Object, Flags, Integers]]:
        """As of one mesh, of each of them."""
        corners = self.target_corners[triangles]
        ends = [*(loops for _, loops, _ in self._before[1:]), len(self.faces[1])]
        found = []
        for obj, (_, begin, _), end in zip(self.targets, self._before, ends, strict=True):
            here = (corners[:, 0] >= begin) & (corners[:, 0] < end)
            found.append((obj, here, corners[here] - begin))
        return found

    @cached_property
    def target_triangles(self) -> Integers:
        """Vertices of the triangles of all meshes, (m, 3)."""
        return self.faces[1][self.target_corners]

    @cached_property
    def map(self) -> SurfaceMap:
        """The core's `SurfaceMap` onto all meshes."""
        found, worn = [], wardrobe.worn(character.of(self.target) or character.alone(self.target))
        for obj in self.targets:
            faces, weights, confidence = stored(self.view, obj.data)
            found.append((faces, weights, confidence * (WORN_COUNTS if obj in worn else 1.0)))
        return self._joined(
            self.source_points,
            self.target_points,
            *(np.concatenate(values) for values in zip(*found, strict=True)),
        )


def stored(view: View, mesh: bpy.types.Mesh) -> tuple[Integers, Floats, Floats]:
    """Triangles of the view, weights and confidence that a mesh has of its match."""
    face, weights = view.places(*mesh_write.read_places(mesh))
    weights = np.clip(weights.astype(np.float64), 0.0, None)
    confidence = mesh_write.read_attribute(mesh.attributes["match_confidence"]).astype(np.float64)
    return face, weights / weights.sum(axis=1, keepdims=True), confidence


def _stretch(obj: bpy.types.Object) -> Floats:
    """The symmetric factor of the object's scale, rotations and reflections, with unit volume: (3, 3).

    Reflections of an even scale are left to the map, which finds out whether it mirrors.
    """
    placed = np.array(obj.matrix_world, np.float64)[:3, :3]
    volume = abs(np.linalg.det(placed))
    if volume < mesh_read.SMALLEST_VOLUME_SCALE:
        raise UnusableObjectError(
            f"'{obj.name}' is scaled to nothing along an axis. Give it a scale other than 0"
        )
    stretch: Floats = core.load().poses.polar(placed)[1] / np.cbrt(volume)
    return np.eye(3) if np.linalg.norm(stretch - np.eye(3), 2) < EVEN else stretch
