# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that lies on the source's surface, as pieces on the body they were joined to: exact places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

from ..similarity import moved, similarity
from ..typed import Flags, Floats, Integers

if TYPE_CHECKING:
    from .route import Route

# One surface lies on the other up to this share of the target's size: roundings of files and of moving.
ON = 1e-4
# It lies on it where so much of it does; the rest may be modelled anew.
MOST = 0.5
# A corner is looked up this share of the way to the middle of its triangle, on its side of a hard edge.
INTO_FACE = 0.05
# An image further from where the vertex lies than this share of the target's size is of another part.
SAME_PART = 0.2
# Vertices by which two surfaces are laid onto each other, and rounds of it.
PROBES, ROUNDS = 2000, 15


@dataclass(frozen=True)
class Coincidence:
    """Where the target lies on the source.

    `to_target` (4, 4) takes the source's coordinates to the target's. Corners `there` (corners,) lie on the
    source: each in the triangle `triangles` (corners,), with `weights` (corners, 3).
    """

    to_target: Floats
    there: Flags
    triangles: Integers
    weights: Floats


def coincidence(route: Route) -> Coincidence | None:
    """How the target lies on the source, as they stand in the scene or moved, or None."""
    tree = BVHTree.FromPolygons(route.source_points.tolist(), route.triangles.tolist(), all_triangles=True)
    step = max(1, len(route.target_points) // PROBES)
    probes = route.target_points[::step]
    images = np.einsum("ij,ijc->ic", route.barycentric, route.source_points[route.triangles[route.face]])
    standing = np.array(route.target.matrix_world.inverted_safe() @ route.source.matrix_world)
    for to_target in (standing, _laid(tree, probes, images[::step])):
        reach = _reach(route.target_points, to_target)
        if np.mean(_nearest(tree, moved(probes, np.linalg.inv(to_target)))[2] < reach) >= MOST:
            return _corners(route, tree, images, to_target, reach)
    return None


def _reach(points: Floats, to_target: Floats) -> float:
    """How near is on, in the source's units."""
    return ON * np.linalg.norm(np.ptp(points, axis=0)) / np.cbrt(abs(np.linalg.det(to_target[:3, :3])))


def _nearest(tree: BVHTree, points: Floats) -> tuple[Floats, Integers, Floats]:
    """Nearest places (n, 3), their triangles (n,) and distances (n,)."""
    found = [tree.find_nearest(point) for point in points.tolist()]
    places = np.array([place for place, _, _, _ in found]).reshape(-1, 3)
    return places, np.array([index for _, _, index, _ in found]), np.array([away for *_, away in found])


def _laid(tree: BVHTree, probes: Floats, images: Floats) -> Floats:
    """The similarity that lays the source onto the target best, from the map and then by nearest planes.

    Chen, Medioni, "Object modelling by registration of multiple range images" (1992), by the nearer half.
    """
    to_source = similarity(probes, images)
    for _ in range(ROUNDS):
        points = moved(probes, to_source)
        found = [tree.find_nearest(point) for point in points.tolist()]
        places, normals = (np.array([each[k] for each in found]) for k in (0, 1))
        off = np.einsum("ij,ij->i", places - points, normals)
        away = np.linalg.norm(places - points, axis=1)
        near = away <= np.median(away)
        # A small turn, shift and growth by which the points come onto the planes.
        columns = [np.cross(points, normals), normals, np.einsum("ij,ij->i", points, normals)[:, None]]
        step = np.linalg.lstsq(np.hstack(columns)[near], off[near], rcond=None)[0]
        angle = float(np.linalg.norm(step[:3]))
        grown = Matrix.Rotation(angle, 4, step[:3]) if angle > 0.0 else Matrix.Identity(4)
        change = np.array(grown) * np.append(np.full(3, 1.0 + np.clip(step[6], -0.5, 0.5)), 1.0)
        change[:3, 3] = step[3:6]
        to_source = change @ to_source
    return np.linalg.inv(to_source)


def _corners(route: Route, tree: BVHTree, images: Floats, to_target: Floats, reach: float) -> Coincidence:
    _, vertex = route.faces
    places, middles = route.target_points[vertex], np.empty((len(vertex), 3))
    # Faces need not be flat: of each corner one triangle.
    middles[route.target_corners] = places[route.target_corners].mean(axis=1, keepdims=True)
    back = np.linalg.inv(to_target)
    places, middles = moved(places, back), moved(middles, back)
    _, triangles, away = _nearest(tree, places + INTO_FACE * (middles - places))
    corners = route.source_points[route.triangles[triangles]]
    weights = _barycentric(corners, places)
    off = np.linalg.norm(np.einsum("ij,ijc->ic", weights, corners) - places, axis=1)
    apart = np.linalg.norm(images[vertex] - places, axis=1)
    there = (away < reach) & (off < reach) & (apart < SAME_PART / ON * reach)
    return Coincidence(to_target, there, triangles, weights)


def _barycentric(corners: Floats, places: Floats) -> Floats:
    """Weights of the corners of triangles (n, 3, 3) for places in or beside them, none below zero: (n, 3)."""
    along, up, to = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], places - corners[:, 0]
    a, b, c = (np.einsum("ij,ij->i", *pair) for pair in ((along, along), (along, up), (up, up)))
    d, e = np.einsum("ij,ij->i", along, to), np.einsum("ij,ij->i", up, to)
    area = np.maximum(a * c - b * b, np.finfo(float).tiny)
    second, third = (c * d - b * e) / area, (a * e - b * d) / area
    weights = np.clip(np.stack([1.0 - second - third, second, third], axis=1), 0.0, None)
    return weights / weights.sum(axis=1, keepdims=True)
