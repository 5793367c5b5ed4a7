# SPDX-License-Identifier: GPL-3.0-or-later
"""The way from source to target: a stored match together with both meshes' faces and corners."""

from functools import cached_property

import numpy as np
from mathutils.bvhtree import BVHTree

from .. import mesh_read, mesh_write, stored_match


class Route:
    """Everything that a kind of data needs to travel from `source` to `target`.

    For target vertices: `face` (n,) and `barycentric` (n, 3) in the source's triangles, `confidence` (n,).
    Raises `UnusableObjectError` when the target has no match that still holds.
    """

    def __init__(self, target):
        mesh_read.check_usable(target, as_target=True)
        stored = stored_match.require(target)
        self.source, self.target = target.spectral_match_source, target
        self.swapped_sides = stored.swapped_sides
        attributes = target.data.attributes
        self.face = mesh_write.read_attribute(attributes["match_face"])
        self.barycentric = mesh_write.read_attribute(attributes["match_barycentric"]).astype(np.float64)
        self.confidence = mesh_write.read_attribute(attributes["match_confidence"])
        self.triangles = mesh_read.triangle_vertices(self.source.data)
        self.triangle_corners, self.triangle_faces = mesh_read.triangle_corners(self.source.data)
        self.corner_vertex = mesh_read.corner_vertices(target.data)
        self.face_starts = mesh_read.face_starts(target.data)

    @cached_property
    def source_points(self):
        """Source coordinates, (n_source, 3)."""
        return mesh_read.positions(self.source.data).astype(np.float64)

    @cached_property
    def image(self):
        """Where each target vertex lies on the source, (n_target, 3)."""
        return self.to_points(self.source_points)

    @cached_property
    def corner_face(self):
        """Target face of each target corner."""
        return np.repeat(np.arange(len(self.face_starts) - 1), np.diff(self.face_starts))

    @cached_property
    def next_corner(self):
        """The corner that follows in the same target face."""
        following = np.arange(1, len(self.corner_vertex) + 1)
        following[self.face_starts[1:] - 1] = self.face_starts[:-1]
        return following

    @cached_property
    def face_centre(self):
        """Mean image of each target face's corners, (faces, 3): near the source's surface, not on it."""
        total = np.add.reduceat(self.image[self.corner_vertex], self.face_starts[:-1], axis=0)
        return total / np.diff(self.face_starts)[:, None]

    @cached_property
    def _surface_tree(self):
        return BVHTree.FromPolygons(self.source_points.tolist(), self.triangles.tolist(), all_triangles=True)

    def to_points(self, values):
        """Values at source vertices → values at target vertices, weighted in the triangle: (n, ...) → (m,
        ...).
        """
        corners = self.triangles[self.face]
        return sum(
            self.barycentric[:, k].reshape(-1, *[1] * (values.ndim - 1)) * values[corners[:, k]]
            for k in range(3)
        )

    def nearest(self, points):
        """Nearest places on the source: triangle (q,), point (q, 3)."""
        find = self._surface_tree.find_nearest
        triangle, place = np.empty(len(points), np.int64), np.empty((len(points), 3))
        for i, point in enumerate(points.tolist()):
            found, _, index, _ = find(point)
            triangle[i], place[i] = index, found
        return triangle, place

    def weights_at(self, triangle, points):
        """Barycentric weights of points in the plane of their triangles, (q, 3)."""
        a, b, c = (self.source_points[self.triangles[triangle, k]] for k in range(3))
        along, up, offset = b - a, c - a, points - a
        aa, ab, bb = _dot(along, along), _dot(along, up), _dot(up, up)
        ao, bo = _dot(along, offset), _dot(up, offset)
        area = aa * bb - ab * ab
        area = np.where(area > 0.0, area, np.inf)
        second, third = (bb * ao - ab * bo) / area, (aa * bo - ab * ao) / area
        return np.stack([1.0 - second - third, second, third], axis=1)

    def face_places(self):
        """Source triangle under the centre of each target face, (faces,)."""
        return self.nearest(self.face_centre)[0]

    def inward_places(self, corners):
        """Places of target corners on their own face's side of a hard border: triangle (q,), weights (q, 3).

        At the border a corner's image belongs to both sides. A point a little further into the face tells the
        side; the weights are those of the image itself, held within that triangle.
        """
        centre = self.face_centre[self.corner_face[corners]]
        image = self.image[self.corner_vertex[corners]]
        triangle, _ = self.nearest(centre + INWARD_SHARE * (image - centre))
        weights = np.clip(self.weights_at(triangle, image), 0.0, None)
        return triangle, weights / weights.sum(axis=1, keepdims=True)


# How far from a face's centre to its corner a corner's own side is asked for: close to the corner, but safely
# inside.
INWARD_SHARE = 0.95


def _dot(first, second):
    return np.einsum("ij,ij->i", first, second)
