# SPDX-License-Identifier: GPL-3.0-or-later
"""The match operator: what it writes, and what it makes of objects that are not simple."""

import bpy
import numpy as np
import pytest
import sgmds
from conftest import choose, lumpy, new_object, triangle_vertices
from mathutils import Matrix

from addon import mesh_read, notice, stored_match
from addon.mesh_write import read_attribute
from addon.operators.match import summary

LAYOUT = {
    "match_color": ("FLOAT_COLOR", "POINT"),
    "match_position": ("FLOAT_VECTOR", "POINT"),
    "match_face": ("INT", "POINT"),
    "match_barycentric": ("FLOAT_VECTOR", "POINT"),
    "match_confidence": ("FLOAT", "POINT"),
}
# A copy's points come back to within a part of a typical edge (0.25); the body is about 4 long.
COPY_ERROR = 0.1


def values(obj, name):
    return read_attribute(obj.data.attributes[name])


def copy_error(source, target, old):
    """Mean distance in source object space between the images and the vertices that they should be."""
    return np.linalg.norm(
        values(target, "match_position") - mesh_read.positions(source.data)[old], axis=1
    ).mean()


def match():
    return bpy.ops.spectral_match.match()


def refusal():
    with pytest.raises(RuntimeError) as refused:
        match()
    return str(refused.value)


def test_register_and_unregister_twice(registered):
    for _ in range(2):
        registered.unregister()
        assert not hasattr(bpy.types, "VIEW3D_PT_spectral_match")
        assert not hasattr(bpy.types.Scene, "spectral_match")
        registered.register()
    assert hasattr(bpy.types, "VIEW3D_PT_spectral_match")


def test_copy_is_found_and_written(pair):
    source, target, old = pair
    assert match() == {"FINISHED"}
    for name, layout in LAYOUT.items():
        attribute = target.data.attributes[name]
        assert (attribute.data_type, attribute.domain) == layout
    assert copy_error(source, target, old) < COPY_ERROR
    barycentric = values(target, "match_barycentric")
    assert barycentric.min() >= -1e-6
    np.testing.assert_allclose(barycentric.sum(axis=1), 1.0, atol=1e-5)
    triangles = triangle_vertices(source.data)[values(target, "match_face")]
    rebuilt = np.einsum("ij,ijc->ic", barycentric, mesh_read.positions(source.data)[triangles])
    np.testing.assert_allclose(rebuilt, values(target, "match_position"), atol=1e-5)
    colours = np.einsum("ij,ijc->ic", barycentric, values(source, "match_color")[triangles])
    np.testing.assert_allclose(colours, values(target, "match_color"), atol=1e-5)
    stored = target.data.spectral_match
    assert (
        target.spectral_match_source == source
        and stored.grade in {"green", "amber", "red"}
        and stored.seconds > 0.0
    )
    assert 0.0 < stored.mean_confidence <= 1.0
    assert stored_match.state(target).code == stored_match.MATCHED


def test_source_is_coloured_smoothly_and_distinctly(pair):
    source, _, _ = pair
    match()
    colours, points = values(source, "match_color")[:, :3], mesh_read.positions(source.data)
    far = np.linalg.norm(points[:, None] - points[None], axis=2) > 1.5
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2)
    assert apart[far].min() > 0.02
    edges = np.array([edge.vertices[:] for edge in source.data.edges])
    assert np.median(np.linalg.norm(colours[edges[:, 0]] - colours[edges[:, 1]], axis=1)) < 0.1


def test_survives_save_and_reload(pair, tmp_path):
    _, target, _ = pair
    match()
    before = {name: values(target, name).copy() for name in LAYOUT}
    path = str(tmp_path / "matched.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    target = bpy.data.objects["Target"]
    for name, kept in before.items():
        np.testing.assert_array_equal(values(target, name), kept)
    assert stored_match.state(target).code == stored_match.MATCHED
    assert target.spectral_match_source == bpy.data.objects["Source"]


def test_survives_being_appended(pair, tmp_path):
    match()
    path = str(tmp_path / "matched.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.objects = ["Target", "Source"]
    for obj in wanted.objects:
        bpy.context.collection.objects.link(obj)
    assert stored_match.state(bpy.data.objects["Target"]).code == stored_match.MATCHED


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.5, 0.4, 1.3), (-1.0, 1.0, 1.0)])
def test_unapplied_transform_is_seen(scene, scale):
    """The target's mesh is squeezed, and its object scale brings it back to the source's shape."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    turned_over = [face[::-1] for face in faces] if np.prod(scale) < 0.0 else faces
    target = new_object("Target", vertices / scale, turned_over)
    target.scale, target.location, target.rotation_euler = scale, (5.0, 0.0, 0.0), (0.3, 0.2, 1.0)
    bpy.context.view_layer.update()
    choose(source, target)
    assert match() == {"FINISHED"}
    assert copy_error(source, target, np.arange(len(vertices))) < COPY_ERROR


def test_mirrored_source_keeps_its_triangles_corners(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices * (-1.0, 1.0, 1.0), [face[::-1] for face in faces])
    source.scale = (-1.0, 1.0, 1.0)
    target = new_object("Target", vertices, faces)
    bpy.context.view_layer.update()
    choose(source, target)
    match()
    assert copy_error(source, target, np.arange(len(vertices))) < COPY_ERROR


def test_edit_mode_goes_on(pair):
    source, target, old = pair
    bpy.ops.object.mode_set(mode="EDIT")
    assert source.mode == "EDIT" and target.mode == "EDIT"
    assert match() == {"FINISHED"}
    assert source.mode == "EDIT" and target.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert copy_error(source, target, old) < COPY_ERROR
    assert stored_match.state(target).code == stored_match.MATCHED


def test_modifier_that_keeps_vertices_is_followed(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    target = new_object("Target", vertices * 0.5, faces)
    target.modifiers.new("Cast", "CAST").factor = 0.2
    choose(source, target)
    scene.spectral_match.shape = "EVALUATED"
    assert match() == {"FINISHED"}
    assert len(values(target, "match_face")) == len(vertices)


def test_modifier_that_adds_vertices_is_refused_in_words(pair, scene):
    _, target, _ = pair
    target.modifiers.new("Subdivision", "SUBSURF")
    scene.spectral_match.shape = "EVALUATED"
    assert "set Shape to Original" in refusal()
    scene.spectral_match.shape = "ORIGINAL"
    assert match() == {"FINISHED"}


def test_ngons_are_matched_by_their_triangles(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    bpy.context.view_layer.objects.active = source
    source.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.dissolve_limited(angle_limit=0.12)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert max(face.loop_total for face in source.data.polygons) > 4
    target = new_object("Target", vertices, faces)
    choose(source, target)
    assert match() == {"FINISHED"}
    assert values(target, "match_face").max() < len(source.data.loop_triangles)


def test_several_targets_at_once(pair):
    source, target, _ = pair
    second = new_object("Second", *lumpy(10))
    twin = bpy.data.objects.new("Twin", target.data)
    bpy.context.collection.objects.link(twin)
    choose(source, target, second, twin)
    assert match() == {"FINISHED"}
    for obj in (target, second, twin):
        assert obj.spectral_match_source == source


def test_one_bad_target_does_not_stop_the_others(pair):
    source, target, _ = pair
    broken = new_object("Broken", *lumpy(6))
    broken.data.vertices[0].co.x = float("nan")
    choose(source, target, broken)
    assert match() == {"FINISHED"}
    assert target.data.spectral_match.grade and not broken.data.spectral_match.grade
    assert "'Broken' was not matched" in notice.words
    choose(source, target)
    match()
    assert notice.words == ""


def test_alternatives_are_completed_on_demand(pair):
    source, target, _ = pair
    match()
    stored = target.data.spectral_match
    best = values(target, "match_position").copy()
    if stored.alternatives == 1:
        assert not bpy.ops.spectral_match.alternative.poll()
        return
    assert bpy.ops.spectral_match.alternative() == {"FINISHED"}
    assert stored.alternative == 1
    assert np.abs(values(target, "match_position") - best).max() > COPY_ERROR
    assert bpy.ops.spectral_match.alternative(step=-1) == {"FINISHED"}
    assert stored.alternative == 0
    np.testing.assert_array_equal(values(target, "match_position"), best)


def test_alternatives_belong_to_their_match(pair):
    """What undo does: the mesh has an older match, whose other maps are still known."""
    _, target, _ = pair
    match()
    stored = target.data.spectral_match
    first = stored.identifier
    older = stored_match.maps_of(target.data)
    match()
    assert stored_match.maps_of(target.data) is not older
    stored.identifier = first
    assert stored_match.maps_of(target.data) is older


def test_swapped_sides_mirror_the_map(pair):
    _, target, _ = pair
    match()
    direct = values(target, "match_position").copy()
    assert bpy.ops.spectral_match.swap_sides() == {"FINISHED"}
    assert target.data.spectral_match.swapped_sides
    assert "swapped" in summary([target], 1, False)
    assert np.linalg.norm(values(target, "match_position") - direct, axis=1).mean() > COPY_ERROR
    assert bpy.ops.spectral_match.swap_sides() == {"FINISHED"}
    np.testing.assert_allclose(values(target, "match_position"), direct, atol=1e-5)
    assert "swapped" not in summary([target], 1, False)


def test_a_match_to_be_checked_is_not_called_sure(pair):
    """A map may hang together everywhere and be wrong as a whole."""
    _, target, _ = pair
    match()
    assert target.data.spectral_match.grade == "green" and ", confidence " in summary([target], 1, False)
    target.data.spectral_match.grade = "amber"
    assert summary([target], 1, False).endswith("s: Check this match")


def test_the_options_of_the_panel_reach_the_core(pair, scene, monkeypatch):
    seen, core_match = {}, sgmds.match
    monkeypatch.setattr(
        sgmds, "match", lambda *shapes, **given: seen.update(given) or core_match(*shapes, **given)
    )
    settings = scene.spectral_match
    settings.same_axes, settings.allow_mirror, settings.part = True, True, "TARGET"
    assert match() == {"FINISHED"}
    assert (seen["same_axes"], seen["mirror"], seen["part"]) == (True, "allow", "target")


def add_stretched_key(obj):
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Flat")
    for point, vertex in zip(key.points, obj.data.vertices, strict=True):
        point.co = vertex.co.x, vertex.co.y, 0.1 * vertex.co.z
    key.value = 1.0


def test_shape_keys_are_left_out_or_followed(pair, scene):
    source, target, old = pair
    add_stretched_key(source)
    bpy.context.view_layer.update()
    match()
    assert copy_error(source, target, old) < COPY_ERROR
    scene.spectral_match.shape = "EVALUATED"
    match()
    assert np.abs(values(target, "match_position")[:, 2]).max() < 0.5


def test_sculpt_mode_goes_on(pair):
    source, target, old = pair
    bpy.ops.object.mode_set(mode="SCULPT")
    assert match() == {"FINISHED"}
    assert source.mode == "SCULPT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert copy_error(source, target, old) < COPY_ERROR


def test_hidden_objects_are_matched_when_pinned(pair, scene):
    source, target, old = pair
    bpy.ops.spectral_match.pin()
    for obj in (source, target):
        obj.hide_set(True)
        obj.hide_viewport = True
    assert match() == {"FINISHED"}
    assert copy_error(source, target, old) < COPY_ERROR


def test_a_hidden_mirrored_source_of_an_opened_file_is_seen(pair, scene, tmp_path):
    """Blender does not place it before it is shown."""
    source, target, old = pair
    source.data.transform(Matrix.Scale(-1.0, 4, (1.0, 0.0, 0.0)))
    source.data.flip_normals()
    source.scale.x, source.hide_viewport = -1.0, True
    settings = scene.spectral_match
    settings.pinned, settings.source, settings.target = True, source, target
    path = str(tmp_path / "hidden.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source, target = bpy.data.objects["Source"], bpy.data.objects["Target"]
    assert match() == {"FINISHED"}
    assert copy_error(source, target, old) < COPY_ERROR and source.hide_viewport


def test_collection_instance_is_explained(pair):
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type = "COLLECTION"
    instance.instance_collection = bpy.data.collections.new("Body")
    bpy.context.scene.collection.objects.link(instance)
    choose(instance)
    assert "Make Instances Real" in refusal()


@pytest.mark.parametrize("which", [0, 1])
def test_a_pinned_object_that_is_in_no_scene_is_explained(pair, which):
    """Its collection is only instanced, or it was deleted."""
    bpy.ops.spectral_match.pin()
    collection = bpy.data.collections.new("Only Instanced")
    collection.objects.link(pair[which])
    bpy.context.collection.objects.unlink(pair[which])
    instance = bpy.data.objects.new("Instance", None)
    bpy.context.collection.objects.link(instance)
    instance.instance_type, instance.instance_collection = "COLLECTION", collection
    assert f"'{pair[which].name}' is in no scene" in refusal()


def test_library_override_is_refused_in_words(pair, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Target"]
    override = wanted.objects[0].override_create()
    bpy.context.collection.objects.link(override)
    source = new_object("Source", *lumpy())
    choose(source, override)
    assert "Make Local" in refusal()


def test_linked_match_is_shown_but_not_written_to(pair, tmp_path):
    source, target, _ = pair
    source.vertex_groups.new(name="All").add([0], 1.0, "REPLACE")
    match()
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Source", "Target"]
    for obj in wanted.objects:
        bpy.context.collection.objects.link(obj)
    linked = bpy.data.objects["Target"]
    assert stored_match.state(linked).code == stored_match.MATCHED
    choose(bpy.data.objects["Source"], linked)
    with pytest.raises(RuntimeError, match="linked from another file"):
        bpy.ops.spectral_match.transfer()


def test_failure_is_kept_for_the_panel(pair):
    _, target, _ = pair
    target.scale = (1.0, 0.0, 1.0)
    bpy.context.view_layer.update()
    assert refusal().strip().endswith(notice.words) and notice.words
    bpy.ops.spectral_match.dismiss()
    assert notice.words == ""


def test_shared_mesh_is_refused_in_words(pair):
    source, _, _ = pair
    twin = bpy.data.objects.new("Twin", source.data)
    bpy.context.collection.objects.link(twin)
    choose(source, twin)
    assert not bpy.ops.spectral_match.match.poll()
    assert "share one mesh" in refusal()


def test_no_target_says_how_to_select(pair):
    source, _, _ = pair
    choose(source)
    assert "Shift-click" in refusal()


def test_mesh_without_faces_is_refused_in_words(pair):
    source, _, _ = pair
    wire = new_object("Wire", [(0, 0, 0), (1, 0, 0)], [])
    choose(source, wire)
    assert "no faces" in refusal()


def test_undefined_coordinates_are_refused_in_words(pair):
    _, target, _ = pair
    target.data.vertices[3].co.x = float("nan")
    words = refusal()
    assert "unexpected" not in words and "match_face" not in target.data.attributes


def test_scale_of_zero_is_refused_in_words(pair):
    _, target, _ = pair
    target.scale = (1.0, 0.0, 1.0)
    bpy.context.view_layer.update()
    assert "scale" in refusal()


def test_linked_target_is_refused_and_linked_source_is_read(pair, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Source", "Target"]
    for obj in wanted.objects:
        bpy.context.collection.objects.link(obj)
    linked = bpy.data.objects["Source"]
    local = new_object("Local", *lumpy())
    settings = bpy.context.scene.spectral_match
    settings.pinned = True
    settings.source, settings.target = local, linked
    assert "linked from another file" in refusal()
    settings.source, settings.target = linked, local
    assert match() == {"FINISHED"}


def test_an_object_of_a_linked_collection_becomes_local_with_all(pair, tmp_path):
    """Make Local of the selected ones does nothing to it."""
    path = str(tmp_path / "library.blend")
    character = bpy.data.collections.new("Character")
    character.objects.link(bpy.data.objects["Target"])
    bpy.data.libraries.write(path, {character})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Character"]
    bpy.context.scene.collection.children.link(wanted.collections[0])
    bpy.context.view_layer.update()
    source = new_object("Local", *lumpy())
    choose(source, bpy.data.objects["Target"])
    assert refusal().strip().endswith("Make Local > All")
    bpy.ops.object.make_local(type="ALL")
    choose(source, bpy.data.objects["Target"])
    assert match() == {"FINISHED"}


@pytest.mark.parametrize("which", [0, 1])
def test_a_mesh_may_be_open_through_another_object(pair, scene, which):
    source, target, _ = pair
    source.vertex_groups.new(name="Group").add(range(50), 1.0, "REPLACE")
    other = bpy.data.objects.new("Other", pair[which].data)
    bpy.context.collection.objects.link(other)
    settings = scene.spectral_match
    settings.pinned, settings.source, settings.target = True, source, target
    choose(other)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.spectral_match.batch() == {"FINISHED"}
    assert other.mode == "EDIT" and [group.name for group in target.vertex_groups] == ["Group"]


def test_attribute_name_taken_by_a_vertex_group_is_said(pair):
    _, target, _ = pair
    target.vertex_groups.new(name="match_face")
    assert "Rename it" in refusal()


def test_rematch_after_an_edit(pair):
    _, target, _ = pair
    match()
    target.data.vertices[0].co.z += 0.1
    target.data.update()
    stored_match.forget_fingerprint(target.data)
    assert stored_match.state(target).code == stored_match.MOVED
    bpy.context.view_layer.objects.active = target
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.quads_convert_to_tris()
    bpy.ops.object.mode_set(mode="OBJECT")
    stored_match.forget_fingerprint(target.data)
    stale = stored_match.state(target)
    assert stale.code == stored_match.STALE and "Match again" in stale.words
    choose(bpy.data.objects["Source"], target)
    assert match() == {"FINISHED"}
    assert stored_match.state(target).code == stored_match.MATCHED


def test_lost_source_is_said(pair):
    source, target, _ = pair
    match()
    # As Blender deletes it: the target still refers to it.
    bpy.context.scene.collection.objects.unlink(source)
    other = bpy.data.objects.new("Other", source.data)
    bpy.context.scene.collection.objects.link(other)
    assert stored_match.state(target, other).code == stored_match.LOST
    assert stored_match.matched_elsewhere(target, other) == ""
    bpy.data.objects.remove(source)
    assert stored_match.state(target).code == stored_match.LOST


def test_a_target_alone_says_that_its_source_is_lost(pair):
    source, target, _ = pair
    match()
    bpy.data.objects.remove(source)
    bpy.context.view_layer.update()
    choose(target)
    with pytest.raises(RuntimeError, match="The source 'Source' is gone"):
        bpy.ops.spectral_match.transfer()


def test_swapping_roles(pair):
    source, target, _ = pair
    assert bpy.ops.spectral_match.swap_roles() == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == target and source.select_get()


def test_pinning_keeps_the_pair(pair, scene):
    source, target, _ = pair
    bpy.ops.spectral_match.pin()
    choose(target)
    assert match() == {"FINISHED"}
    assert target.spectral_match_source == source


def test_confidence_is_shown_as_colours(pair):
    _, target, _ = pair
    match()
    assert bpy.ops.spectral_match.show(what="CONFIDENCE") == {"FINISHED"}
    assert target.data.color_attributes.active_color.name == "match_heat"
    assert bpy.ops.spectral_match.show(what="COLOURS") == {"FINISHED"}
    assert target.data.color_attributes.active_color.name == "match_color"
    assert bpy.ops.spectral_match.show(what="NOTHING") == {"FINISHED"}


def test_swapping_with_a_hidden_source_is_refused_in_words(pair):
    source, target, _ = pair
    match()
    choose(target)
    source.hide_set(True)
    with pytest.raises(RuntimeError, match="'Source' is hidden"):
        bpy.ops.spectral_match.swap_roles()


def test_a_copy_has_no_other_maps(pair):
    """Shift D copies the match with its identifier; a map of the original is none of the copy."""
    source, target, _ = pair
    match()
    copy = bpy.data.objects.new("Copy", target.data.copy())
    bpy.context.collection.objects.link(copy)
    copy.spectral_match_source = source
    assert stored_match.maps_of(target.data) is not None and stored_match.maps_of(copy.data) is None
    choose(source, copy)
    with pytest.raises(RuntimeError, match="Match again to find them"):
        bpy.ops.spectral_match.alternative()


def test_a_target_with_the_source_s_mesh_needs_no_transfer(pair, scene):
    source, target, _ = pair
    match()
    other = bpy.data.objects.new("Other", source.data)
    bpy.context.collection.objects.link(other)
    choose(source, target, other)
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert notice.words == "'Other' shares the mesh of 'Source', so it has the same data already"


def test_target_that_shares_the_mesh_is_named(pair):
    source, target, _ = pair
    twin = bpy.data.objects.new("Twin", source.data)
    bpy.context.collection.objects.link(twin)
    choose(source, target, twin)
    assert match() == {"FINISHED"}
    assert "'Twin' was left out" in notice.words and target.data.spectral_match.grade


@pytest.mark.parametrize("pinned", [False, True])
def test_hidden_object_has_no_shown_form(pair, scene, pinned):
    """A script can name hidden objects; those of the pin are in the dependency graph, but not evaluated."""
    source, target, _ = pair
    if pinned:
        bpy.ops.spectral_match.pin()
    target.modifiers.new("Cast", "CAST").factor = 1.0
    target.hide_viewport = True
    bpy.context.view_layer.update()
    with pytest.raises(mesh_read.UnusableObjectError, match="'Target' is hidden"):
        mesh_read.value_of(mesh_read.reading(bpy.context, target, evaluated=True))
    target.hide_viewport = False
    target.hide_set(True)
    bpy.context.view_layer.update()
    shown = mesh_read.value_of(mesh_read.reading(bpy.context, target, evaluated=True))
    assert np.abs(shown.local - mesh_read.positions(target.data)).max() > 0.5


def test_match_and_transfer_in_edit_mode(pair):
    source, target, _ = pair
    source.vertex_groups.new(name="Group").add(range(50), 1.0, "REPLACE")
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.spectral_match.batch() == {"FINISHED"}
    assert target.mode == "EDIT" and [group.name for group in target.vertex_groups] == ["Group"]


def test_undo_in_edit_mode_leaves_no_match(pair):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="Edit Mode")
    match()
    bpy.ops.ed.undo_push(message="Match")
    target = bpy.data.objects["Target"]
    assert stored_match.state(target).code == stored_match.MATCHED
    bpy.ops.ed.undo()
    target = bpy.data.objects["Target"]
    assert target.mode == "EDIT" and not stored_match.state(target).usable
