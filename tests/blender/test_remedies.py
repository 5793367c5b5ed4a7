# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons beside refusals, doubts and notes: each helps against what is said, and changes nothing else."""

import re

import bpy
import pytest
from conftest import choose, lumpy, new_object
from test_transfer import store_identity
from test_translation import core_messages, messages, sentences

from addon import drawing, landmarks, notice, remedy
from addon.operators import step

ALL = [each for each in vars(remedy).values() if isinstance(each, remedy.Remedy)]


@pytest.fixture
def bodies(scene):
    """A source with a group, and a target that is its copy, matched."""
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(8))
    source.vertex_groups.new(name="Hand").add([0], 1.0, "REPLACE")
    store_identity(source, target)
    choose(source, target)
    return source, target


@pytest.mark.parametrize("known", ALL, ids=lambda each: each.label)
def test_each_remedy_is_an_operator_with_these_properties(registered, known):
    module, _, name = known.operator.partition(".")
    found = getattr(getattr(bpy.ops, module), name).get_rna_type().properties
    assert {key for key, _ in known.properties} | ({known.named} - {""}) <= set(found.keys())
    assert known in {each for _, each in remedy.TABLE}
    for key, value in known.properties:
        if found[key].type == "ENUM":
            assert value in found[key].enum_items


@pytest.mark.parametrize(("pattern", "known"), remedy.TABLE, ids=lambda each: getattr(each, "label", None))
def test_each_pattern_finds_words_that_are_said(pattern, known):
    said = sentences(messages()) | sentences(core_messages())
    found = [re.search(pattern, words.replace("{}", "Name")) for words in said]
    assert any(found)
    if known.named:
        assert all("Name" in sign.groups() for sign in found if sign)


def test_remedies_for_several_lines_are_each_given_once():
    words = "'A' was edited since it was read. Match again\n'B' was edited since it was read. Match again"
    assert remedy.remedies(words) == ((remedy.AGAIN, ""),)
    assert remedy.remedies("'A B' is scaled to nothing along an axis") == ((remedy.SCALE, "A B"),)
    assert remedy.remedies("All is well") == ()


def test_a_flat_object_gets_a_scale(bodies):
    source, target = bodies
    target.scale = (2.0, 0.0, 1.0)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError):
        bpy.ops.spectral_match.match()
    ((known, name),) = remedy.remedies(notice.words)
    assert (known, name) == (remedy.SCALE, "Target")
    assert bpy.ops.spectral_match.unit_scale(name=name) == {"FINISHED"}
    assert target.scale[:] == (2.0, 1.0, 1.0) and source.scale[:] == (1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    with pytest.raises(RuntimeError, match="its parent has none"):
        bpy.ops.spectral_match.unit_scale(name="Target")


def hidden(obj, way):
    """Hide an object in one of the ways that a scene has."""
    collection = bpy.data.collections.new("Costumes")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(obj)
    bpy.context.scene.collection.objects.unlink(obj)
    layer = bpy.context.view_layer.layer_collection.children["Costumes"]
    if way == "eye":
        obj.hide_set(True)
    elif way == "viewport":
        obj.hide_viewport = True
    elif way == "excluded":
        layer.exclude = True
    elif way == "layer":
        layer.hide_viewport = True
    else:
        collection.hide_viewport = True


@pytest.mark.parametrize("way", ["eye", "viewport", "excluded", "layer", "collection"])
def test_what_is_hidden_is_shown(bodies, way):
    _, target = bodies
    hidden(target, way)
    assert bpy.ops.spectral_match.show_object(name="Target") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert target.visible_get()


def test_an_object_of_another_scene_is_not_shown_here(bodies):
    other = bpy.data.scenes.new("Other")
    thing = bpy.data.objects.new("Thing", None)
    other.collection.objects.link(thing)
    with pytest.raises(RuntimeError, match="another scene"):
        bpy.ops.spectral_match.show_object(name="Thing")
    with pytest.raises(RuntimeError, match="no object named 'Nobody'"):
        bpy.ops.spectral_match.show_object(name="Nobody")


def test_one_press_unwraps_all_meshes_of_a_character_that_have_no_layout():
    """What is said of several meshes has the button too, which is for all of them."""
    for words in (
        "'Body' and 1 more mesh has no UV map of its own to bake textures into. Unwrap it first",
        "Textures of 'Left 'n Right' and 3 more meshes are shown by the source's UV map, which they fit",
    ):
        assert remedy.remedies(words) == ((remedy.UNWRAP, ""),)
    for known in (remedy.UNWRAP, remedy.UNWRAP_ANEW):
        assert dict(known.properties) == {"bake_unwrap": "OVERLAPS"}


def test_outdated_landmarks_go_and_others_stay(bodies):
    source, target = bodies
    settings = bpy.context.scene.spectral_match
    for vertex in (1, 2, 3):
        landmarks.add(settings, source, vertex, target, vertex)
    settings.landmarks[0].target_topology = settings.landmarks[2].source_topology = "other"
    names = [mark.name for mark in settings.landmarks]
    with pytest.raises(RuntimeError, match="got other vertices"):
        bpy.ops.spectral_match.match()
    ((known, _),) = remedy.remedies(notice.words)
    assert known == remedy.OUTDATED
    assert bpy.ops.spectral_match.remove_outdated() == {"FINISHED"}
    assert [mark.name for mark in settings.landmarks] == names[1:2]
    assert bpy.ops.spectral_match.match() == {"FINISHED"}


def test_a_match_as_modelled_needs_no_visible_object(bodies, scene):
    _, target = bodies
    scene.spectral_match.shape = "EVALUATED"
    target.modifiers.new("More", "SUBSURF").levels = 1
    with pytest.raises(RuntimeError, match="changes its vertices"):
        bpy.ops.spectral_match.match()
    assert (remedy.MODELLED, "") in remedy.remedies(notice.words)
    assert bpy.ops.spectral_match.match(**dict(remedy.MODELLED.properties)) == {"FINISHED"}
    assert scene.spectral_match.shape == "ORIGINAL"


def test_a_match_may_be_mirrored(bodies, scene):
    assert bpy.ops.spectral_match.match(**dict(remedy.MIRRORED.properties)) == {"FINISHED"}
    assert scene.spectral_match.allow_mirror


def test_a_transfer_without_the_mask_that_the_target_lacks(bodies, scene):
    _, target = bodies
    scene.spectral_match.group_mask = "Nowhere"
    with pytest.raises(RuntimeError, match="no vertex group 'Nowhere'"):
        bpy.ops.spectral_match.transfer()
    ((known, _),) = remedy.remedies(notice.words)
    assert bpy.ops.spectral_match.transfer(**dict(known.properties)) == {"FINISHED"}
    assert "Hand" in target.vertex_groups


def test_a_piece_that_is_left_out_is_told():
    """A landmark on a piece that is left out names the piece to take."""
    words = (
        "Landmark 'Blue' is on 'Left Boot', which is left out. Check 'Left Boot' under Pieces, or remove the "
        "landmark under Fix"
    )
    assert (remedy.TAKE, "Left Boot") in remedy.remedies(words)


@pytest.mark.parametrize(("pressed", "panel", "kind"), [(1, 1, "WARNING"), (1, 0, "ERROR"), (0, 1, "ERROR")])
def test_a_refusal_is_told_once(registered, monkeypatch, pressed, panel, kind):
    """By the panel where somebody pressed a button and it is open; an error, which pops up, tells others."""

    class Refused(step.Step):
        def __init__(self):
            self.pressed, self.told = bool(pressed), []

        def report(self, kinds, words):
            self.told.append((kinds, words))

    monkeypatch.setattr(drawing, "is_open", lambda context: bool(panel))
    refused = Refused()
    assert refused.fail("No") == {"CANCELLED"}
    assert refused.told == [({kind}, "No")] and notice.words == "No"
    notice.clear()
