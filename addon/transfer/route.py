# SPDX-License-Identifier: GPL-3.0-or-later
"""The way from source to target: a stored match together with both meshes' faces and corners."""

from functools import cached_property

import numpy as np

from .. import core, mesh_read, mesh_write, stored_match


class Route:
    """Everything that a kind of data needs to travel from `source` to `target`.

    `map` is the core's, in the coordinates of the two meshes; `faces` are the target's faces as the core
    takes them: first corners and vertices of corners. `wanted` names what is carried, by kind. Raises
    `UnusableObjectError` when the target has no match that still holds.
    """

    def __init__(self, target):
        mesh_read.check_usable(target, as_target=True)
        stored = stored_match.require(target)
        self.source, self.target = target.spectral_match_source, target
        self.wanted = {}
        self.swapped_sides = stored.swapped_sides
        self.triangle_corners, self.triangle_faces = mesh_read.triangle_corners(self.source.data)
        self.triangles = mesh_read.corner_vertices(self.source.data)[self.triangle_corners]
        self.faces = mesh_read.face_starts(target.data), mesh_read.corner_vertices(target.data)

    @cached_property
    def source_points(self):
        """Source coordinates, (n_source, 3)."""
        return mesh_read.positions(self.source.data).astype(np.float64)

    @cached_property
    def target_points(self):
        """Target coordinates, (n_target, 3)."""
        return mesh_read.positions(self.target.data).astype(np.float64)

    @cached_property
    def _target_fans(self):
        return mesh_read.triangle_corners(self.target.data)

    @property
    def target_corners(self):
        """Corners of the target's triangles, (m, 3)."""
        return self._target_fans[0]

    @property
    def target_triangle_faces(self):
        """Faces of the target's triangles, (m,)."""
        return self._target_fans[1]

    @cached_property
    def carried_slots(self):
        """The source's material slot that each face of the target gets, (faces,)."""
        return self.map.face_labels(*self.faces, mesh_read.slots_shown(self.source)[self.triangle_faces])

    @cached_property
    def target_triangles(self):
        """Vertices of the target's triangles, (m, 3)."""
        return mesh_read.corner_vertices(self.target.data)[self.target_corners]

    @cached_property
    def map(self):
        """The core's `SurfaceMap`; weights are brought back to a sum of one from single precision."""
        face, weights, confidence = (
            mesh_write.read_attribute(self.target.data.attributes[name]).astype(np.float64)
            for name in ("match_face", "match_barycentric", "match_confidence")
        )
        weights = np.clip(weights, 0.0, None)
        return core.load().SurfaceMap(
            (self.source_points, self.triangles),
            (self.target_points, self.target_triangles),
            face,
            weights / weights.sum(axis=1, keepdims=True),
            confidence,
        )

    @cached_property
    def face(self):
        """Source triangle of each target vertex, (n,)."""
        return self.map.faces

    @cached_property
    def barycentric(self):
        """Weights of that triangle's corners, (n, 3)."""
        return self.map.barycentric

    def to_points(self, values):
        """Values at source vertices → values at target vertices, weighted in the triangle: (n, ...) → (m,
        ...).
        """
        first, second, third = (values[self.triangles[self.face, k]] for k in range(3))
        weights = self.barycentric.reshape(-1, 3, *[1] * (values.ndim - 1))
        # Written so that equal corner values come through unchanged to the last bit.
        return first + weights[:, 1] * (second - first) + weights[:, 2] * (third - first)

    def nearest_vertices(self):
        """The source vertex nearest to each target vertex's image."""
        strongest = self.barycentric.argmax(axis=1)
        return self.triangles[self.face, strongest]
