# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of a match: colours that everyone can read, lines, and the morph through match_position."""

import bpy
import numpy as np
import pytest
from bipeds import Figure
from conftest import choose, lumpy, new_object
from mathutils import Euler, Matrix

from addon import morph, overlay, palette
from addon.mesh_write import read_attribute, write_attribute
from addon.operators import show

# Linear RGB as seen without the middle or the long cones (Vienot, Brettel, Mollon 1999).
DICHROMATS = {
    "deuteranope": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
    "protanope": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
}
LUMINANCE = (0.2126, 0.7152, 0.0722)


@pytest.mark.parametrize("eye", [None, *DICHROMATS])
def test_heat_map_grows_lighter_with_doubt_for_every_eye(eye):
    colours = palette.heat_colours(np.linspace(1.0, 0.0, 33))[:, :3]
    if eye is not None:
        colours = colours @ np.array(DICHROMATS[eye]).T
    luminance = colours @ LUMINANCE
    assert (np.diff(luminance) > 0.0).all()
    # The ends are as far apart as dark and light text on paper have to be (WCAG 2.1, contrast 7).
    assert (luminance[-1] + 0.05) / (luminance[0] + 0.05) > 7.0


@pytest.mark.parametrize("eye", [None, *DICHROMATS])
def test_line_colours_differ_for_every_eye(eye):
    sure, doubtful = palette.line_colours(np.array([1.0, 0.0]))[:, :3] ** 2.2
    if eye is not None:
        sure, doubtful = (np.array(DICHROMATS[eye]) @ colour for colour in (sure, doubtful))
    # One is blue and the other has next to none, which no common colour blindness hides.
    assert sure[2] - doubtful[2] > 0.5


def test_spread_takes_far_points():
    line = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros((101, 2))])
    assert sorted(overlay.spread(line, 3)) == [0, 50, 100]
    assert len(overlay.spread(line[:2], 9)) == 2


def test_lines_end_with_the_file(pair):
    bpy.ops.spectral_match.match()
    assert bpy.ops.spectral_match.lines() == {"FINISHED"} and overlay.lines_shown()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert not overlay.lines_shown()


def test_line_samples_follow_the_match(pair):
    source, target, _ = pair
    bpy.ops.spectral_match.match()
    samples = overlay._samples_of([source], target)
    assert len(samples.vertices) == overlay.LINES
    depsgraph = bpy.context.evaluated_depsgraph_get()
    corners = overlay.world_points(source, depsgraph, samples.corners.ravel().tolist()).reshape(-1, 3, 3)
    images = np.einsum("ij,ijc->ic", samples.weights, corners)
    expected = read_attribute(target.data.attributes["match_position"])[samples.vertices]
    np.testing.assert_allclose(images, expected, atol=1e-5)
    assert overlay._samples_of([source], target) is samples
    bpy.ops.spectral_match.match()
    assert overlay._samples_of([source], target) is not samples


def shown(obj):
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(len(evaluated.vertices) * 3, np.float32)
    evaluated.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def set_input(obj, name, value):
    morph.set_value(morph.modifier_of(obj), name, value)
    bpy.context.view_layer.update()


def test_morph_moves_the_target_onto_the_source(pair):
    source, target, _ = pair
    source.location, source.scale = (1.0, 2.0, 3.0), (1.0, 0.5, 2.0)
    source.rotation_euler, target.rotation_euler, target.scale = (
        (0.3, 0.0, 1.0),
        (0.0, 0.7, 0.0),
        (2.0, 2.0, 2.0),
    )
    bpy.context.view_layer.update()
    bpy.ops.spectral_match.match()
    own, users = shown(target).copy(), source.users
    image = read_attribute(target.data.attributes["match_position"])
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    # The first press shows the whole way, where the target stands.
    assert np.abs(shown(target) - own).max() > 0.0
    np.testing.assert_allclose(shown(target), read_attribute(target.data.attributes[morph.FITTED]), atol=1e-5)
    set_input(target, morph.IN_PLACE, False)
    placed = target.matrix_world.inverted() @ source.matrix_world
    there = image @ np.array(placed)[:3, :3].T + np.array(placed)[:3, 3]
    for factor in (1.0, 0.25, 0.0, 1.0):
        set_input(target, morph.FACTOR, factor)
        np.testing.assert_allclose(shown(target), own + factor * (there - own), atol=1e-4)
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    assert not target.modifiers and morph.GROUP not in bpy.data.node_groups
    assert source.users == users


@pytest.fixture
def twins(pair):
    """Source and target of the same shape in the world, however they are turned, moved and scaled."""
    source, target, _ = pair
    bpy.ops.spectral_match.match()
    target.matrix_world = Matrix.LocRotScale((4.0, 1.0, -2.0), Euler((0.0, 1.2, 0.3)), (0.01,) * 3)
    source.matrix_world = Matrix.LocRotScale((-3.0, 0.0, 1.0), Euler((1.5, 0.0, -0.7)), (100.0,) * 3)
    bpy.context.view_layer.update()
    return source, target


@pytest.mark.parametrize("way", [morph.IN_PLACE, morph.WIPE])
def test_source_of_the_target_s_shape_laid_over_it_changes_nothing(twins, way):
    _, target = twins
    own = shown(target).copy()
    bpy.ops.spectral_match.morph()
    for factor in (1.0, 0.4):
        set_input(target, morph.FACTOR, factor)
        for each in (morph.IN_PLACE, morph.WIPE):
            set_input(target, each, each == way)
        # A match of two copies takes vertices to their places to within 1 % of the body's size of 4.
        assert np.abs(shown(target) - own).max() < 0.04
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    assert not {morph.FITTED, morph.ALONG} & set(target.data.attributes.keys())


def test_wipe_has_both_surfaces_beside_an_edge(pair):
    source, target, _ = pair
    bpy.ops.spectral_match.match()
    # What is laid over the target is another shape than its own.
    image = read_attribute(target.data.attributes["match_position"]) * (1.0, 1.0, 2.0)
    write_attribute(target.data, "match_position", "FLOAT_VECTOR", "POINT", image)
    own = shown(target).copy()
    bpy.ops.spectral_match.morph()
    laid = read_attribute(target.data.attributes[morph.FITTED])
    along = read_attribute(target.data.attributes[morph.ALONG])
    assert along.min() == 0.0 and along.max() == 1.0 and np.abs(laid - own).max() > 0.2
    set_input(target, morph.WIPE, True)
    for factor in (0.0, 0.3, 1.0):
        set_input(target, morph.FACTOR, factor)
        edge = factor * (1.0 + morph.WIPE_EDGE)
        past, before = along < edge - morph.WIPE_EDGE, along > edge
        now = shown(target)
        np.testing.assert_allclose(now[past], laid[past], atol=1e-5)
        np.testing.assert_allclose(now[before], own[before], atol=1e-5)
        assert past.any() == (factor > 0.0) and before.any() == (factor < 1.0)


def test_a_morph_in_place_follows_a_new_match(pair):
    _, target, _ = pair
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.morph()
    before = read_attribute(target.data.attributes[morph.FITTED])
    write_attribute(target.data, morph.FITTED, "FLOAT_VECTOR", "POINT", np.zeros_like(before))
    bpy.ops.spectral_match.match()
    np.testing.assert_allclose(read_attribute(target.data.attributes[morph.FITTED]), before, atol=1e-5)


@pytest.fixture
def posed(scene):
    """A source and a target of its shape, matched, each with a rig in a pose of its own."""
    given, own = Figure("Source"), Figure("Target")
    rigs = given.rigged(), own.rigged(0.01, y_up=True)
    rigs[1].location.x = 3.0
    own.store_known(given)
    write_attribute(own.obj.data, "match_position", "FLOAT_VECTOR", "POINT", own.made.vertices)
    for rig, bone, turn in zip(rigs, ("upper_arm.L", "thigh.R"), (-0.9, 0.7), strict=True):
        rig.pose.bones[bone].rotation_mode = "XYZ"
        rig.pose.bones[bone].rotation_euler.z = turn
        rig.pose.bones[bone].rotation_euler.x = turn
    bpy.context.view_layer.update()
    choose(given.obj, own.obj)
    return given, own, rigs[0]


def in_world(obj):
    return shown(obj) @ np.array(obj.matrix_world)[:3, :3].T + np.array(obj.matrix_world)[:3, 3]


def test_a_morph_goes_to_the_source_as_posed(posed):
    given, own, rig = posed
    before = in_world(own.obj).copy()
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    set_input(own.obj, morph.IN_PLACE, False)
    np.testing.assert_allclose(in_world(own.obj), in_world(given.obj), atol=1e-4)
    set_input(own.obj, morph.FACTOR, 0.5)
    np.testing.assert_allclose(in_world(own.obj), (before + in_world(given.obj)) / 2.0, atol=1e-4)
    set_input(own.obj, morph.FACTOR, 1.0)
    rig.pose.bones["thigh.L"].rotation_mode = "XYZ"
    rig.pose.bones["thigh.L"].rotation_euler.x = 0.8
    bpy.context.view_layer.update()
    # It follows.
    np.testing.assert_allclose(in_world(own.obj), in_world(given.obj), atol=1e-4)


@pytest.mark.parametrize("way", [morph.IN_PLACE, morph.WIPE])
def test_what_is_laid_over_a_target_takes_its_pose(posed, way):
    _, own, _ = posed
    before = in_world(own.obj).copy()
    bpy.ops.spectral_match.morph()
    for each in (morph.IN_PLACE, morph.WIPE):
        set_input(own.obj, each, each == way)
    np.testing.assert_allclose(in_world(own.obj), before, atol=1e-4)
    set_input(own.obj, way, False)
    assert [each.type for each in own.obj.modifiers] == ["ARMATURE", "NODES"]


def test_a_morph_to_a_source_that_is_shown_with_other_vertices_goes_to_it_at_rest(posed):
    given, own, _ = posed
    given.obj.modifiers.new("Fine", "SUBSURF")
    bpy.ops.spectral_match.morph()
    set_input(own.obj, morph.IN_PLACE, False)
    rest = read_attribute(own.obj.data.attributes["match_position"])
    placed = np.array(given.obj.matrix_world)
    np.testing.assert_allclose(in_world(own.obj), rest @ placed[:3, :3].T + placed[:3, 3], atol=1e-4)


def test_morphed_target_is_not_matched_as_shown(pair, scene):
    _, target, _ = pair
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.morph()
    set_input(target, morph.FACTOR, 0.5)
    scene.spectral_match.shape = "EVALUATED"
    with pytest.raises(RuntimeError, match="'Target' is morphed"):
        bpy.ops.spectral_match.match()
    set_input(target, morph.FACTOR, 0.0)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}


def test_one_group_serves_all_targets(pair):
    source, target, _ = pair
    second = new_object("Second", *lumpy(8))
    for obj in (source, target, second):
        obj.select_set(True)
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.morph()
    groups = {morph.modifier_of(obj).node_group for obj in (target, second)}
    assert len(groups) == 1


def test_colours_off_brings_the_earlier_layer_back(pair):
    _, target, _ = pair
    target.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    target.data.color_attributes.active_color = target.data.color_attributes["Paint"]
    bpy.ops.spectral_match.match()
    assert target.data.color_attributes.active_color.name == "match_color"
    bpy.ops.spectral_match.show(what="NOTHING")
    assert target.data.color_attributes.active_color.name == "Paint"


def test_colours_off_leaves_the_colours_that_a_file_was_saved_with(pair):
    """It opens as the viewport was: what was before is the studio light and the materials."""
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.show(what="COLOURS")
    show._forget_file("")
    bpy.ops.spectral_match.show(what="CONFIDENCE")
    bpy.ops.spectral_match.show(what="NOTHING")
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    (shading,) = (area.spaces.active.shading for area in areas if area.type == "VIEW_3D")
    assert (shading.color_type, shading.light) == ("MATERIAL", "STUDIO")


def test_undo_of_painted_colours_shows_those_of_the_match_flat_again(pair):
    """And redo the painted ones in the light that there was."""
    source, target, _ = pair
    source.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    bpy.ops.spectral_match.match()
    # Whatever other tests left in the viewport.
    bpy.ops.spectral_match.show(what="NOTHING")
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    (shading,) = (area.spaces.active.shading for area in areas if area.type == "VIEW_3D")
    shading.light = "STUDIO"
    bpy.ops.spectral_match.show(what="COLOURS")
    bpy.ops.ed.undo_push(message="Colors")
    assert shading.light == "FLAT"
    bpy.ops.spectral_match.transfer(kinds="colours")
    bpy.ops.ed.undo_push(message="Transfer")
    for step, light, active in ((None, "STUDIO", "Paint"), ("undo", "FLAT", "match_color")) * 2:
        if step is not None:
            getattr(bpy.ops.ed, step)()
        elif active != bpy.data.objects["Target"].data.color_attributes.active_color.name:
            bpy.ops.ed.redo()
        assert (shading.color_type, shading.light) == ("VERTEX", light)
        assert bpy.data.objects["Target"].data.color_attributes.active_color.name == active


def test_morph_survives_renamed_and_removed_inputs(pair):
    _, target, _ = pair
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.morph()
    modifier = morph.modifier_of(target)
    inputs = modifier.node_group.interface
    factor = next(item for item in inputs.items_tree if item.identifier == morph.FACTOR)
    factor.name = "Amount"
    set_input(target, morph.FACTOR, 0.5)
    assert morph.factor_of(target) == 0.5
    inputs.remove(factor)
    assert morph.factor_of(target) == 0.0 and not morph.is_whole(modifier)
    modifier.node_group.use_fake_user = True
    # Off and on again it has a group of its own that works.
    for _ in range(2):
        assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    set_input(target, morph.FACTOR, 1.0)
    assert morph.factor_of(target) == 1.0


def test_a_chain_is_coloured_for_the_pair_that_is_shown(pair):
    """The second body is target of the first and source of the third."""
    source, target, _ = pair
    bpy.ops.spectral_match.match()

    def colours():
        return [read_attribute(obj.data.attributes["match_color"]) for obj in (source, target)]

    before = colours()
    third = target.copy()
    third.data = target.data.copy()
    bpy.context.collection.objects.link(third)
    choose(target, third)
    bpy.ops.spectral_match.match()
    assert np.abs(colours()[1] - before[1]).max() > 0.1
    choose(source, target)
    bpy.ops.spectral_match.show(what="COLOURS")
    np.testing.assert_allclose(colours(), before, atol=1e-6)


@pytest.mark.parametrize("what", ["COLOURS", "CONFIDENCE", "NOTHING"])
def test_a_target_is_shown_without_its_source(pair, what):
    source, _, _ = pair
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.pin()
    bpy.data.objects.remove(source)
    assert bpy.ops.spectral_match.show(what=what) == {"FINISHED"}


def test_another_source_than_the_matched_one_is_not_shown(pair):
    _, target, _ = pair
    bpy.ops.spectral_match.match()
    choose(new_object("Other", *lumpy(4)), target)
    for step in (lambda: bpy.ops.spectral_match.show(what="COLOURS"), bpy.ops.spectral_match.morph):
        with pytest.raises(RuntimeError, match="'Target' was matched with 'Source'"):
            step()
    assert not target.modifiers and bpy.ops.spectral_match.show(what="NOTHING") == {"FINISHED"}
