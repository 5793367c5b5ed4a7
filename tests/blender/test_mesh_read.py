# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles are found in steps, yet they are those that Blender has."""

import bpy
import numpy as np
import pytest
from conftest import new_object

from addon import mesh_read


def blenders_own(mesh):
    mesh.calc_loop_triangles()
    corners = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    faces = np.empty(len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    mesh.loop_triangles.foreach_get("polygon_index", faces)
    return corners.reshape(-1, 3), faces


def crowd(count, seed):
    """Faces apart from each other, of three to seven corners: convex, hollow, folded and flat to a line."""
    rng = np.random.default_rng(seed)
    vertices, faces = [], []
    for number in range(count):
        size = int(rng.integers(3, 8))
        angle = np.sort(rng.uniform(0, 2 * np.pi, size))
        ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(size)], axis=1) * rng.uniform(
            0.05, 1, (size, 1)
        )
        if number % 3 == 0:
            ring += rng.normal(size=ring.shape) * 10.0 ** rng.integers(-7, 1)
        if number % 11 == 0:
            ring[:, 1:] *= 1e-7
        faces.append(np.arange(size) + len(vertices))
        vertices += (ring + rng.uniform(-100, 100, 3)).tolist()
    return np.array(vertices), faces


@pytest.mark.parametrize("single_reads", [0, 10**6])
def test_triangles_are_those_of_blender(scene, monkeypatch, single_reads):
    """Whether unsure ones are read one by one or all at once, and however many steps there are."""
    monkeypatch.setattr(mesh_read, "FACES_A_STEP", 700)
    monkeypatch.setattr(mesh_read, "MOST_SINGLE_READS", single_reads)
    mesh = new_object("Crowd", *crowd(5000, seed=1)).data
    corners, faces = mesh_read.triangle_corners(mesh)
    expected_corners, expected_faces = blenders_own(mesh)
    np.testing.assert_array_equal(faces, expected_faces)
    np.testing.assert_array_equal(corners, expected_corners)


def test_most_quads_need_not_be_asked_for(scene):
    """Of a plain body none, so that no step is longer than a hundred thousand faces take."""
    bpy.ops.mesh.primitive_monkey_add()
    mesh = bpy.context.object.data
    starts = mesh_read.face_starts(mesh)
    fans = mesh_read._fans(mesh_read.positions(mesh), mesh_read.corner_vertices(mesh), starts)
    corners, faces, unsure = mesh_read.value_of(fans)
    assert unsure.mean() < 0.02
    np.testing.assert_array_equal(corners[~unsure], blenders_own(mesh)[0][~unsure])
