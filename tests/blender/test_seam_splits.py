# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of the target split along seams: the surface and all it carries stay, the UVs become right."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object, triangle_vertices
from mathutils.bvhtree import BVHTree
from test_transfer import store_nearest, transfer

from addon import mesh_read, notice, stored_match
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer.layouts import read_uv
from addon.transfer.shape_keys import read_key
from addon.transfer.weights import read_weights

TEXELS = 2048


def triangulated(vertices, faces):
    return vertices, [[f[0], f[k], f[k + 1]] for f in faces for k in (1, 2)]


def slope(points):
    """A number that is linear in space, between 0 and 1 on these bodies."""
    return 0.5 + points @ (0.1, 0.05, 0.15)


@pytest.fixture
def bodies(scene):
    """A body with an island for each octant, and the same surface in coarser triangles across them.

    The target has a weight, a shape key, colours and a UV map of its own, all linear in space.
    """
    vertices, faces = triangulated(*lumpy(16))
    source = new_object("Source", vertices, faces)
    layer = source.data.uv_layers.new(name="Map")
    corners = vertices[np.array(faces)]
    sign = np.sign(corners.mean(axis=1))
    octant = ((sign > 0) @ (1, 2, 4)).astype(int)
    # Each is seen along its diagonal.
    uv = np.empty((*corners.shape[:2], 2))
    for axis, (sx, sy, sz) in enumerate(((1, -1, 0), (1, 1, -2))):
        uv[..., axis] = (corners * (sign * (sx, sy, sz))[:, None]).sum(axis=2)
    for island in range(8):
        here = octant == island
        uv[here] -= uv[here].min(axis=(0, 1))
        uv[here] *= 0.3 / uv[here].max()
    uv += (np.stack([octant % 3, octant // 3], axis=1)[:, None] + 0.05) / 3
    layer.uv.foreach_set("vector", uv.astype(np.float32).ravel())
    target = new_object("Target", *triangulated(*lumpy(9)))
    own = mesh_read.positions(target.data).astype(float)
    group = target.vertex_groups.new(name="Slope")
    for vertex, weight in enumerate(slope(own).tolist()):
        group.add([vertex], weight, "REPLACE")
    target.shape_key_add(name="Basis", from_mix=False)
    key = target.shape_key_add(name="Lean", from_mix=False)
    key.data.foreach_set("co", leaning(own).astype(np.float32).ravel())
    write_attribute(target.data, "Tint", "FLOAT_COLOR", "POINT", np.repeat(slope(own)[:, None], 4, axis=1))
    write_attribute(target.data, "Own", "FLOAT2", "CORNER", flat_uv(target.data, own))
    store_nearest(source, target)
    return source, target


def leaning(points):
    return points + slope(points)[:, None] * (1.0, 0.0, 0.0)


def flat_uv(mesh, points):
    return slope(points)[mesh_read.corner_vertices(mesh)][:, None] * (1.0, -2.0)


def area(mesh):
    return sum(face.area for face in mesh.polygons)


def shown_and_true(source, target, rng):
    """At random places of all faces: the UV that the target shows there, and the source's at that place."""
    points, uv = mesh_read.positions(source.data).astype(float), read_uv(source.data, "Map").reshape(-1, 3, 2)
    faces = triangle_vertices(source.data)
    tree = BVHTree.FromPolygons(points.tolist(), faces.tolist(), all_triangles=True)
    corners, _ = mesh_read.triangle_corners(target.data)
    places = mesh_read.positions(target.data).astype(float)[mesh_read.corner_vertices(target.data)[corners]]
    size = np.linalg.norm(np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]), axis=1)
    face = rng.choice(len(corners), 20_000, p=size / size.sum())
    weights = rng.dirichlet(np.ones(3), len(face))
    shown = (weights[..., None] * read_uv(target.data, "Map")[corners[face]]).sum(axis=1)
    truth = []
    for place in (weights[..., None] * places[face]).sum(axis=1).tolist():
        at, _, index, _ = tree.find_nearest(place)
        a, b, c = points[faces[index]]
        share = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), np.array(at) - a, rcond=None)[0]
        truth.append(uv[index, 0] + share @ (uv[index, 1:] - uv[index, 0]))
    return shown, np.array(truth)


def island_of(uv):
    return np.floor(uv * 3).astype(int) @ (1, 3)


def test_faces_are_split_where_the_seams_run(bodies):
    source, target = bodies
    mesh = target.data
    count, before = len(mesh.vertices), area(mesh)
    points = mesh_read.positions(mesh)
    transfer(source, target, kinds="uv", split_seams=False)
    whole_shown, whole_true = shown_and_true(source, target, np.random.default_rng(0))
    assert len(mesh.vertices) == count
    transfer(source, target, kinds="uv", split_seams=True)
    assert len(mesh.vertices) > count
    assert stored_match.state(target).code == stored_match.MATCHED
    np.testing.assert_array_equal(mesh_read.positions(mesh)[:count], points)
    # Coordinates are single precision, and areas of slivers are sums of cancelling products.
    assert abs(area(mesh) - before) < 1e-5 * before
    corners, _ = mesh_read.triangle_corners(mesh)
    uv = read_uv(mesh, "Map")[corners]
    assert (np.ptp(island_of(0.999 * uv + 0.001 * uv.mean(axis=1, keepdims=True)), axis=1) == 0).all()
    shown, true = shown_and_true(source, target, np.random.default_rng(0))
    # What shows another island than it should, before and after.
    wrong = [(island_of(a) != island_of(b)).mean() for a, b in ((whole_shown, whole_true), (shown, true))]
    assert wrong[0] > 0.02
    assert wrong[1] < 0.25 * wrong[0]
    error = [
        TEXELS * np.linalg.norm(a - b, axis=1).mean() for a, b in ((whole_shown, whole_true), (shown, true))
    ]
    assert error[1] < 0.25 * error[0]


def test_split_faces_keep_what_they_carry(bodies):
    source, target = bodies
    mesh = target.data
    transfer(source, target, kinds="uv", split_seams=True)
    points = mesh_read.positions(mesh).astype(float)
    vertex, _, weight = read_weights(target)
    assert len(vertex) == len(points)
    expected = slope(points)
    # Everything is linear in space, and kept in single precision.
    near = {"atol": 1e-5}
    np.testing.assert_allclose(weight, expected, **near)
    np.testing.assert_allclose(read_key(mesh.shape_keys.key_blocks["Lean"]), leaning(points), **near)
    np.testing.assert_allclose(read_attribute(mesh.attributes["Tint"])[:, 0], expected, **near)
    np.testing.assert_allclose(read_uv(mesh, "Own"), flat_uv(mesh, points), **near)


def test_splitting_again_changes_nothing(bodies):
    source, target = bodies
    transfer(source, target, kinds="uv", split_seams=True)
    once = mesh_read.fingerprint(target.data)
    uv = read_uv(target.data, "Map")
    transfer(source, target, kinds="uv", split_seams=True)
    assert mesh_read.fingerprint(target.data) == once
    np.testing.assert_array_equal(read_uv(target.data, "Map"), uv)


def test_a_failure_takes_the_split_back(bodies):
    source, target = bodies
    mesh = target.data
    before = mesh_read.fingerprint(mesh)
    key = read_key(mesh.shape_keys.key_blocks["Lean"])
    meshes = len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match="no vertex group 'Nowhere'"):
        source.vertex_groups.new(name="Bone").add([0], 1.0, "REPLACE")
        transfer(source, target, kinds="uv,groups", split_seams=True, group_mask="Nowhere")
    assert mesh_read.fingerprint(mesh) == before
    assert stored_match.state(target).code == stored_match.MATCHED
    np.testing.assert_array_equal(read_key(mesh.shape_keys.key_blocks["Lean"]), key)
    assert len(bpy.data.meshes) == meshes and "Map" not in mesh.uv_layers


def test_splitting_is_one_undo_step(bodies):
    source, target = bodies
    before = mesh_read.fingerprint(target.data)
    bpy.ops.ed.undo_push(message="Before")
    transfer(source, target, kinds="uv", split_seams=True)
    bpy.ops.ed.undo_push(message="Transfer")
    assert mesh_read.fingerprint(target.data) != before
    bpy.ops.ed.undo()
    target = bpy.data.objects["Target"]
    assert mesh_read.fingerprint(target.data) == before
    assert stored_match.state(target).code == stored_match.MATCHED


def test_a_sculpt_in_levels_is_not_split(bodies):
    source, target = bodies
    target.modifiers.new("Levels", "MULTIRES")
    with pytest.raises(RuntimeError, match="Multiresolution"):
        transfer(source, target, kinds="uv", split_seams=True)


def test_a_target_that_is_not_unwrapped_is_split_at_seams(bodies):
    source, target = bodies
    count = len(target.data.vertices)
    transfer(source, target, kinds="uv")
    assert len(target.data.vertices) == count
    target.data.uv_layers.remove(target.data.uv_layers["Own"])
    target.data.uv_layers.remove(target.data.uv_layers["Map"])
    transfer(source, target, kinds="uv", split_bare=False)
    assert len(target.data.vertices) == count
    transfer(source, target, kinds="uv")
    assert len(target.data.vertices) > count and "were split along seams" in notice.words


def test_a_sculpt_in_levels_that_is_not_unwrapped_is_left_whole(bodies):
    source, target = bodies
    target.data.uv_layers.remove(target.data.uv_layers["Own"])
    target.modifiers.new("Levels", "MULTIRES")
    count = len(target.data.vertices)
    transfer(source, target, kinds="uv")
    assert len(target.data.vertices) == count and "left whole" in notice.words
    assert "Map" in target.data.uv_layers


def test_seams_that_run_from_vertex_to_vertex_need_no_new_ones(scene):
    """Quads whose diagonals are a seam on the source are cut in two, and get the islands on either side."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    points = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    number = np.arange(25).reshape(5, 5)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(
        -1, 4
    )
    source = new_object("Source", *triangulated(points, quads.tolist()))
    corners = points[triangle_vertices(source.data)]
    above = (corners.mean(axis=1) @ (-1.0, 1.0, 0.0) > 0.0)[:, None, None]
    expected = corners[..., :2] / 10.0 + 0.5 * above
    source.data.uv_layers.new(name="Map").uv.foreach_set("vector", expected.astype(np.float32).ravel())
    target = new_object("Target", points, quads.tolist())
    store_nearest(source, target)
    transfer(source, target, kinds="uv")
    mesh = target.data
    assert len(mesh.vertices) == 25 and len(mesh.polygons) == 16 + 4
    assert "were split along seams" in notice.words
    there = points[mesh_read.corner_vertices(mesh)]
    island = np.array(
        [np.mean([points[v] @ (-1.0, 1.0, 0.0) for v in face.vertices]) > 0.0 for face in mesh.polygons]
    )
    of = np.repeat(island, np.diff(mesh_read.face_starts(mesh)))
    np.testing.assert_allclose(read_uv(mesh, "Map"), there[:, :2] / 10.0 + 0.5 * of[:, None], atol=1e-6)
