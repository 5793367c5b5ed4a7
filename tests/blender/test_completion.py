# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies of which one half is modelled and a Mirror modifier adds the other."""

import bpy
import numpy as np
import pytest
from conftest import choose, lumpy, new_object, renumbered, triangle_vertices
from mathutils import Matrix
from test_transfer import store_map, transfer, weights_of

from addon import completion, mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer.layouts import read_uv
from addon.transfer.shape_keys import read_key

# Of lengths between 1 and 3, by attributes in single precision.
ROUNDING = 1e-5
# Where the targets stand.
PLACE = Matrix.Translation((3, 1, 0)) @ Matrix.Rotation(0.4, 4, "X")


def half():
    """The half of a lumpy body at x ≥ 0, open along x = 0: vertices and quads."""
    vertices, faces = lumpy()
    vertices[np.abs(vertices[:, 0]) < 1e-9, 0] = 0.0
    faces = np.array(faces)
    faces = faces[(vertices[faces, 0] >= 0.0).all(axis=1)]
    kept, faces = np.unique(faces, return_inverse=True)
    return vertices[kept], faces.reshape(-1, 4)


def whole():
    """The half and its mirror image in one."""
    vertices, faces = half()
    inside = vertices[:, 0] > 0.0
    image = np.arange(len(vertices))
    image[inside] = len(vertices) + np.arange(inside.sum())
    return np.vstack([vertices, vertices[inside] * (-1, 1, 1)]), np.vstack([faces, image[faces][:, ::-1]])


def mirrored(obj, **settings):
    modifier = obj.modifiers.new("Mirror", "MIRROR")
    for name, value in settings.items():
        setattr(modifier, name, value)
    bpy.context.view_layer.update()
    return modifier


def completed(obj):
    return mesh_read.value_of(mesh_read.reading(bpy.context, obj)).completed


def shown_points(obj):
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = mesh_read.positions(shown).copy()
    obj.to_mesh_clear()
    return points


def in_order(points):
    return points[np.lexsort(np.round(points, 4).T)]


@pytest.mark.parametrize("about", ["itself", "a turned object", "two axes"])
def test_a_half_is_completed_as_blender_completes_it(scene, about):
    vertices, faces = half()
    settings = {}
    if about == "a turned object":
        mirror = bpy.data.objects.new("Plane", None)
        scene.collection.objects.link(mirror)
        mirror.matrix_world = Matrix.Translation((0.3, -0.2, 0.1)) @ Matrix.Rotation(0.7, 4, "Z")
        settings["mirror_object"] = mirror
        vertices = vertices @ np.array(mirror.matrix_world)[:3, :3].T + mirror.matrix_world.translation
    if about == "two axes":
        faces = faces[(vertices[faces, 2] >= -1e-9).all(axis=1)]
        kept, faces = np.unique(faces, return_inverse=True)
        vertices, faces = vertices[kept], faces.reshape(-1, 4)
        settings["use_axis"] = (True, False, True)
    obj = new_object("Half", vertices, faces)
    mirrored(obj, **settings)
    body = completed(obj)
    np.testing.assert_allclose(in_order(body.points), in_order(shown_points(obj)), atol=ROUNDING)
    # The modelled vertices come first, and every triangle shows a modelled one, wound as seen.
    np.testing.assert_allclose(body.points[: len(vertices)], vertices, atol=ROUNDING)
    modelled = mesh_read.value_of(mesh_read.reading(bpy.context, obj)).triangles
    assert (np.bincount(body.face) == (4 if about == "two axes" else 2)).all()
    corners = np.where(body.turned[:, None], modelled[body.face][:, ::-1], modelled[body.face])
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(body.points[body.triangles], axis=1), axis=2),
        np.linalg.norm(np.diff(body.points[corners], axis=1), axis=2),
        atol=ROUNDING,
    )
    edges = body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if about != "two axes":
        # Closed and wound one way: each edge is there once in each direction.
        assert {tuple(e) for e in edges.tolist()} == {tuple(e) for e in edges[:, ::-1].tolist()}
        assert len(np.unique(edges, axis=0)) == len(edges)


@pytest.mark.parametrize("why", ["cut", "apart", "whole", "hidden", "none"])
def test_what_no_modifier_completes_stays_as_modelled(scene, why):
    vertices, faces = whole() if why in ("whole", "cut") else half()
    obj = new_object("Body", vertices + ((5.0, 0, 0) if why == "apart" else 0.0), faces)
    if why != "none":
        mirrored(obj, use_bisect_axis=(why == "cut", False, False), show_viewport=why != "hidden")
    assert completed(obj) is None


def test_a_face_in_the_mirror_is_no_wall_inside(scene):
    """A half that is closed by a face along the mirror, and merged although Merge is off."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    box = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    obj = new_object("Box", corners, box)
    mirrored(obj, use_mirror_merge=False)
    body = completed(obj)
    assert len(body.points) == 12 and len(body.triangles) == 20
    assert not (body.points[body.triangles][..., 0] == 0.0).all(axis=1).any()


def halves(scene, source_is_half, other_side=False):
    """A symmetric body and the modelled half of its turned copy; the vertex of each half that it was."""
    vertices, faces = half()
    source = new_object("Source", *(half() if source_is_half else whole()))
    if source_is_half:
        mirrored(source)
    if other_side:
        vertices, faces = vertices * (-1, 1, 1), faces[:, ::-1]
    moved, other_faces, old = renumbered(vertices, faces)
    target = new_object("Target", moved, other_faces)
    target.matrix_world = PLACE
    mirrored(target)
    choose(source, target)
    return source, target, moved


def stretch(obj, scale):
    """Give an object a scale that its mesh takes back."""
    obj.data.transform(Matrix.Diagonal((*(1.0 / np.array(scale)), 1.0)))
    obj.matrix_world = obj.matrix_world @ Matrix.Diagonal((*scale, 1.0))
    bpy.context.view_layer.update()


@pytest.mark.parametrize("source_is_half", [False, True])
def test_a_modelled_half_is_matched_as_the_whole_it_shows(scene, source_is_half):
    source, target, moved = halves(scene, source_is_half)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    # Between bodies that are symmetric to the last vertex a mirrored map fits as well: a doubt for the grade.
    assert target.data.spectral_match.grade != "red" and not notice.words
    found = read_attribute(target.data.attributes["match_position"])
    # As between whole copies: a tenth of an edge, with single vertices along the mirror on its other side.
    assert np.linalg.norm(found - moved, axis=1).mean() < 0.02
    face = read_attribute(target.data.attributes["match_face"])
    assert face.max() < len(mesh_read.triangle_corners(source.data)[0])


def test_halves_of_different_sides_are_matched_as_the_modifier_shows_them(scene):
    """What the target's half gets is of the half that the source's modifier adds, by the names of that."""
    source, target, moved = halves(scene, source_is_half=True, other_side=True)
    source.vertex_groups.new(name="Arm.R")
    near = np.flatnonzero(mesh_read.positions(source.data)[:, 0] > 0.5).tolist()
    source.vertex_groups.new(name="Arm.L").add(near, 1.0, "REPLACE")
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    found = read_attribute(target.data.attributes["match_position"])
    assert np.linalg.norm(found - moved, axis=1).mean() < 0.02
    transfer(source, target, kinds="groups")
    assert {name for _, name in weights_of(target)} == {"Arm.R"} and not notice.words


def applied(obj, name):
    """A copy in which Blender applied the modifiers."""
    copy = obj.copy()
    copy.data, copy.name = obj.data.copy(), name
    bpy.context.collection.objects.link(copy)
    if copy.data.shape_keys is not None:
        copy.shape_key_clear()
    choose(copy)
    for modifier in list(copy.modifiers):
        bpy.ops.object.modifier_apply(modifier=modifier.name)
    return copy


def store_image(source, target, axes):
    """The known map: each vertex of the target is one of the half, in the mirrors behind which it lies."""
    points, places = (mesh_read.positions(obj.data).astype(float) for obj in (source, target))
    image = sum((places[:, axis] < -1e-6).astype(int) << bit for bit, axis in enumerate(axes))
    places[:, axes] = np.abs(places[:, axes])
    old = [int(np.linalg.norm(points - place, axis=1).argmin()) for place in places]
    triangles = triangle_vertices(source.data)
    face, corner = np.empty(len(points), int), np.empty(len(points), int)
    for k in range(3):
        face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
    store_map(source, target, face[old], np.eye(3)[corner[old]])
    write_attribute(target.data, "match_image", "INT", "POINT", image)
    return old, image


@pytest.mark.parametrize("axes", [(0,), (0, 2)])
def test_what_a_half_carries_is_what_its_modifier_shows(scene, axes):
    """Onto the whole that Blender makes of it: weights, colours, UVs, normals and faces as they are there."""
    vertices, faces = half()
    if 2 in axes:
        faces = faces[(vertices[faces, 2] >= -1e-9).all(axis=1)]
        kept, faces = np.unique(faces, return_inverse=True)
        vertices, faces = vertices[kept], faces.reshape(-1, 4)
        vertices[np.abs(vertices[:, 2]) < 1e-9, 2] = 0.0
    source = new_object("Source", vertices, faces)
    rng = np.random.default_rng(3)
    mesh = source.data
    for name in ("Arm.L", "Arm.R", "Spine"):
        group = source.vertex_groups.new(name=name)
        # Above the threshold of Prune.
        for vertex, weight in enumerate(rng.uniform(0.01, 1.0, len(vertices)).tolist()):
            if name != "Arm.R":
                group.add([vertex], weight, "REPLACE")
    uv = mesh.uv_layers.new(name="Map", do_init=False)
    seen = 0.4 + 0.1 * vertices[mesh_read.corner_vertices(mesh)][:, 1:]
    uv.uv.foreach_set("vector", seen.astype(np.float32).ravel())
    write_attribute(mesh, "Paint", "FLOAT_COLOR", "CORNER", rng.random((len(mesh.loops), 4)))
    write_attribute(mesh, "Zone", "INT", "FACE", rng.integers(0, 5, len(mesh.polygons)))
    mirrored(source, use_axis=[axis in axes for axis in range(3)], use_mirror_u=True)
    whole = applied(source, "Whole")
    target = new_object(
        "Target", mesh_read.positions(whole.data), [f.vertices[:] for f in whole.data.polygons]
    )
    store_image(source, target, axes)
    before = len(bpy.data.objects), len(bpy.data.meshes)
    transfer(source, target, kinds="groups,uv,colours,attributes", split_bare=False)
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before
    found, expected = weights_of(target), weights_of(whole)
    # Rows are scaled to their sum in single precision.
    assert found == pytest.approx(expected, abs=1e-6)
    # Where a vertex lies on the mirror, its triangle is that of one half: faces away from there are exact.
    points = mesh_read.positions(target.data)
    away = [f.index for f in target.data.polygons if (np.abs(points[list(f.vertices)][:, axes]) > 1e-4).all()]
    corners = np.concatenate([list(target.data.polygons[f].loop_indices) for f in away])
    np.testing.assert_allclose(
        read_uv(target.data, "Map")[corners], read_uv(whole.data, "Map")[corners], atol=1e-5
    )
    for name, at in (("Paint", corners), ("Zone", away)):
        found, expected = (read_attribute(obj.data.attributes[name])[at] for obj in (target, whole))
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_keys_of_a_half_move_both_sides(scene):
    source = new_object("Source", *half())
    points = mesh_read.positions(source.data).astype(float)
    source.shape_key_add(name="Basis", from_mix=False)
    key = source.shape_key_add(name="Lift", from_mix=False)
    lift = np.stack([np.full(len(points), 0.1), 0.2 * points[:, 2], points[:, 0] ** 2], axis=1)
    key.data.foreach_set("co", (points + lift).astype(np.float32).ravel())
    mirrored(source)
    whole = applied(source, "Whole")
    target = new_object(
        "Target", mesh_read.positions(whole.data), [f.vertices[:] for f in whole.data.polygons]
    )
    old, image = store_image(source, target, (0,))
    transfer(source, target, kinds="keys")
    own = target.data.shape_keys.key_blocks["Lift"]
    moved = read_key(own) - read_key(own.relative_key)
    expected = lift[old] * np.where(image[:, None] > 0, (-1, 1, 1), 1)
    rim = np.abs(mesh_read.positions(target.data)[:, 0]) < ROUNDING
    expected[rim, 0] = 0.0
    # A displacement is turned by frames that are averaged over neighbours; the map is the identity.
    np.testing.assert_allclose(moved, expected, atol=1e-4)


def test_a_mirror_that_was_taken_away_is_told_of(scene):
    source = new_object("Source", *half())
    mirrored(source)
    whole = applied(source, "Whole")
    target = new_object(
        "Target", mesh_read.positions(whole.data), [f.vertices[:] for f in whole.data.polygons]
    )
    store_image(source, target, (0,))
    source.vertex_groups.new(name="A").add([0], 1.0, "REPLACE")
    source.modifiers.clear()
    with pytest.raises(RuntimeError, match="Match again"):
        transfer(source, target, kinds="groups")


def test_the_whole_gets_a_rig_with_both_sides_from_a_half(scene):
    source, target, _ = halves(scene, source_is_half=True)
    target.modifiers.clear()
    whole_vertices, whole_faces = whole()
    target = new_object("Whole", whole_vertices, whole_faces)
    target.matrix_world = PLACE
    rig = symmetric_rig(source)
    choose(source, target)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    transfer(source, target, kinds="groups,armature")
    assert not notice.words
    fitted = target.find_armature()
    for bone, own in zip(rig.data.bones, fitted.data.bones, strict=True):
        for point, at in ((own.head_local, bone.head_local), (own.tail_local, bone.tail_local)):
            assert (fitted.matrix_world @ point - PLACE @ at).length < 0.05, bone.name


def symmetric_rig(source):
    """A spine in the middle and an arm at each side, which move what is near to them."""
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail, roll in (
        ("Spine", (0, 0, -1.0), (0, 0.1, 0.8), 0.0),
        ("Arm.L", (0.3, 0, 0.2), (1.0, 0.3, 0.5), 0.4),
        ("Arm.R", (-0.3, 0, 0.2), (-1.0, 0.3, 0.5), -0.4),
        ("Badge", (0.2, -0.4, 0.0), (0.3, -0.6, 0.0), 0.0),
    ):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.roll = head, tail, roll
        if name != "Spine":
            bone.parent = data.edit_bones["Spine"]
    bpy.ops.object.mode_set(mode="OBJECT")
    points = mesh_read.positions(source.data)
    left = np.clip(2.0 * points[:, 0], 0, 1)
    right = np.clip(-2.0 * points[:, 0], 0, 1)
    for name, share in (("Arm.L", left), ("Arm.R", right), ("Spine", 1.0 - left - right)):
        group = source.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(share).tolist():
            group.add([vertex], float(share[vertex]), "REPLACE")
    source.modifiers.new("Rig", "ARMATURE").object = rig
    return rig


@pytest.mark.parametrize("source_is_half", [False, True])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 1.0, 0.5)])
def test_the_rig_of_a_modelled_half_has_both_sides(scene, source_is_half, scale):
    source, target, _ = halves(scene, source_is_half)
    stretch(target, scale)
    rig = symmetric_rig(source)
    choose(source, target)
    bpy.ops.spectral_match.match()
    transfer(source, target, kinds="groups,armature")
    assert not notice.words
    bpy.context.view_layer.update()
    fitted = target.find_armature()
    # A joint is off by less than the map.
    for bone, own in zip(rig.data.bones, fitted.data.bones, strict=True):
        for point, at in ((own.head_local, bone.head_local), (own.tail_local, bone.tail_local)):
            assert (fitted.matrix_world @ point - PLACE @ at).length < 0.05, bone.name
        turn = (fitted.matrix_world @ own.matrix_local).to_3x3().inverted() @ (
            PLACE @ bone.matrix_local
        ).to_3x3()
        assert turn.to_quaternion().angle < 0.15, bone.name
    joints = {bone.name: (bone.head_local, bone.tail_local) for bone in fitted.data.bones}
    to_mirror = PLACE.inverted() @ fitted.matrix_world
    for one, other in zip(joints["Arm.L"], joints["Arm.R"], strict=True):
        one, other = to_mirror @ one, to_mirror @ other
        np.testing.assert_allclose(np.array(one) * (-1, 1, 1), other, atol=ROUNDING)
    for middle in joints["Spine"]:
        assert abs((to_mirror @ middle).x) < ROUNDING
    assert max(weight for (_, name), weight in weights_of(target).items() if name == "Arm.L") > 0.99


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 1.0, 0.5)])
def test_shape_keys_do_not_open_a_modelled_half(scene, scale):
    """A key that moves the whole body across the mirror, as an asymmetric smile moves lips."""
    source, target, _ = halves(scene, source_is_half=False)
    stretch(target, scale)
    source.shape_key_add(name="Basis")
    smile = source.shape_key_add(name="Smile")
    given = mesh_read.positions(source.data) + np.float32((0.3, 0.2, 0.1))
    smile.data.foreach_set("co", given.ravel())
    bpy.ops.spectral_match.match()
    transfer(source, target, kinds="keys")
    key = target.data.shape_keys.key_blocks["Smile"]
    moved = read_key(key) - read_key(key.relative_key)
    rim = mesh_read.positions(target.data)[:, 0] == 0.0
    assert rim.sum() > 20 and (moved[rim, 0] == 0.0).all()
    assert (moved[~rim, 0] > 0.1).all() and (np.linalg.norm(moved[rim], axis=1) > 0.1).all()
    key.value = 1.0
    bpy.context.view_layer.update()
    inside = np.count_nonzero(~rim)
    assert len(shown_points(target)) == len(moved) + inside


def test_objects_of_the_half_that_a_modifier_adds_are_told_of(scene):
    source, target, _ = halves(scene, source_is_half=False)
    eye = new_object("Eye", 0.1 * half()[0] + (0.5, -0.5, 0.9), half()[1])
    eye.parent = source
    choose(source, target)
    bpy.ops.spectral_match.match()
    transfer(source, target, kinds="groups")
    assert not notice.words
    transfer(source, target, kinds="objects")
    assert "'Target' is completed by a Mirror modifier" in notice.words


def test_landmarks_and_a_swap_of_sides_count_for_the_whole(scene):
    source, target, moved = halves(scene, source_is_half=False)
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.swap_sides()
    found = read_attribute(target.data.attributes["match_position"])
    assert np.linalg.norm(found - moved * (-1, 1, 1), axis=1).mean() < 0.02


def test_mirrors_of_objects_are_seen_by_themselves(scene):
    obj = new_object("Half", *half())
    points = mesh_read.positions(obj.data).astype(float)
    mirrored(obj, use_axis=(True, True, False))
    (mirror,) = completion.mirrors(obj, points)
    np.testing.assert_allclose(mirror.reflection, np.diag((-1.0, 1, 1, 1)))
