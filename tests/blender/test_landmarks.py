# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks: pairs of vertices that the next match holds together."""

from contextlib import nullcontext
from functools import partial
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
import sgmds
from conftest import choose, lumpy, new_object
from mathutils import Vector

from addon import landmarks, mesh_read, overlay, stored_match
from addon.mesh_read import UnusableObjectError
from addon.mesh_write import read_attribute
from addon.operators import pick
from addon.overlay import Picking, Point
from addon.pair import resolve


def add(source_vertex, target_vertex):
    return bpy.ops.spectral_match.add_landmark(source_vertex=source_vertex, target_vertex=target_vertex)


def image_of(target, vertex):
    return read_attribute(target.data.attributes["match_position"])[vertex]


def test_a_right_landmark_is_kept(pair, scene):
    source, target, old = pair
    for vertex in (0, 40):
        assert add(int(old[vertex]), vertex) == {"FINISHED"}
    assert [mark.name for mark in scene.spectral_match.landmarks] == ["Orange", "Blue"]
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    for vertex in (0, 40):
        right = mesh_read.positions(source.data)[old[vertex]]
        assert np.linalg.norm(image_of(target, vertex) - right) < 0.1


def test_landmarks_reach_the_core_for_their_target_alone(pair, monkeypatch):
    source, target, _ = pair
    add(3, 7)
    second = new_object("Second", *lumpy(8))
    choose(source, target, second)
    asked = []
    real = sgmds.match

    def asking(*arguments, **options):
        asked.append(list(options["landmarks"]))
        return real(*arguments, **options)

    monkeypatch.setattr(sgmds, "match", asking)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert sorted(asked) == [[], [(3, 7)]]


def test_roles_exchanged_exchange_the_ends(pair, scene):
    source, target, _ = pair
    add(3, 7)
    assert landmarks.vertex_pairs(scene.spectral_match, source, target) == [(3, 7)]
    assert landmarks.vertex_pairs(scene.spectral_match, target, source) == [(7, 3)]
    other = new_object("Other", *lumpy(6))
    assert landmarks.vertex_pairs(scene.spectral_match, source, other) == []


def test_names_stay_apart(pair, scene):
    for vertex in range(3):
        add(vertex, vertex)
    scene.spectral_match.landmark_index = 0
    bpy.ops.spectral_match.remove_landmark()
    add(5, 5)
    names = [mark.name for mark in scene.spectral_match.landmarks]
    assert len(set(names)) == 3


def test_a_point_is_picked_once(pair, scene):
    add(3, 7)
    for ends in ((3, 8), (4, 7)):
        with pytest.raises(RuntimeError, match="Landmark 'Orange' is there already"):
            add(*ends)
    assert len(scene.spectral_match.landmarks) == 1


def test_colours_are_taken_in_turn_and_kept(pair, scene):
    for vertex in range(7):
        add(vertex, vertex)
    marks = scene.spectral_match.landmarks
    assert [mark.colour for mark in marks] == [0, 1, 2, 3, 4, 5, 0] and marks[6].name == "Orange 2"
    marks.remove(1)
    assert [mark.colour for mark in marks] == [0, 2, 3, 4, 5, 0]
    add(20, 20)
    assert marks[6].name == "Blue"


def test_each_mesh_of_a_character_takes_another_colour(pair, scene):
    source, target, _ = pair
    marks = scene.spectral_match.landmarks
    other = new_object("Other", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    for piece in (source, other):
        landmarks.add(scene.spectral_match, piece, 1, target, len(marks))
    assert [(mark.name, mark.colour) for mark in marks] == [("Orange", 0), ("Blue", 1)]


@pytest.mark.parametrize("taken", ["first", "second", ""])
def test_a_refused_pair_is_clicked_anew(pair, scene, monkeypatch, taken):
    """Either of its points may be the one that is taken: both are forgotten."""
    source, target, _ = pair
    add(3, 7)
    points = [Point(source.session_uid, 3 if taken == "first" else 4)]
    points.append(Point(target.session_uid, 7 if taken == "second" else 8))
    monkeypatch.setattr(overlay, "picking", Picking())
    clicks = iter(points)
    operator = SimpleNamespace(_under=lambda *_: next(clicks), _show=lambda _context: None, _added=0)
    click = partial(pick.SPECTRAL_MATCH_OT_pick_landmarks._click, operator, bpy.context)
    click(resolve(bpy.context), None, None)
    assert overlay.picking.first == points[0]
    with pytest.raises(UnusableObjectError, match="is there already") if taken else nullcontext():
        click(resolve(bpy.context), None, None)
    assert overlay.picking.first is None and len(scene.spectral_match.landmarks) == (1 if taken else 2)


def test_outdated_landmark_is_refused_in_words(pair):
    _, target, _ = pair
    add(0, 0)
    choose(target)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    stored_match.forget_fingerprint(target.data)
    choose(bpy.data.objects["Source"], target)
    with pytest.raises(RuntimeError, match="'Target' got other vertices since landmark 'Orange'"):
        bpy.ops.spectral_match.match()
    assert "match_face" not in target.data.attributes


def test_vertex_that_is_not_there_is_refused_in_words(pair, scene):
    with pytest.raises(RuntimeError, match="so there is no vertex 1000000"):
        add(0, 1_000_000)
    assert not scene.spectral_match.landmarks


def test_landmarks_survive_save_and_reload(pair, tmp_path):
    add(3, 7)
    path = str(tmp_path / "landmarks.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source, target = bpy.data.objects["Source"], bpy.data.objects["Target"]
    assert landmarks.vertex_pairs(bpy.context.scene.spectral_match, source, target) == [(3, 7)]


def test_deleted_object_leaves_a_harmless_landmark(pair, scene):
    source, target, _ = pair
    add(3, 7)
    bpy.data.objects.remove(target)
    other = new_object("Other", *lumpy(6))
    assert landmarks.vertex_pairs(scene.spectral_match, source, other) == []


def test_a_landmark_that_is_not_listed_is_not_removed(pair, scene):
    add(3, 7)
    choose(new_object("A", *lumpy(4)), new_object("B", *lumpy(4)))
    assert not bpy.ops.spectral_match.remove_landmark.poll()
    for vertex in (1, 2):
        add(vertex, vertex)
    settings = scene.spectral_match
    settings.landmark_index = 0
    assert not bpy.ops.spectral_match.remove_landmark.poll()
    settings.landmark_index = 1
    # The next one of the list follows, and after its last one there is none to remove.
    for many in (2, 1):
        assert bpy.ops.spectral_match.remove_landmark() == {"FINISHED"}
        assert len(settings.landmarks) == many
    assert not bpy.ops.spectral_match.remove_landmark.poll()
    assert settings.landmarks[0].source.name == "Source"


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_picking_below_a_scaled_parent(scene, scale):
    vertices, faces = lumpy(6)
    body = new_object("Body", vertices / scale, faces)
    body.parent = bpy.data.objects.new("Root", None)
    bpy.context.collection.objects.link(body.parent)
    body.parent.scale = (scale, scale, scale)
    modifier = body.modifiers.new("Subdivision", "SUBSURF")
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    top = mesh_read.positions(body.data)[:, 2].argmax()
    place = body.data.vertices[top].co
    hit, near, _, face = body.closest_point_on_mesh(place, depsgraph=depsgraph)
    assert hit and pick._between_vertices(depsgraph, body, near, face).vertices == (top,)
    # Far from every vertex of the mesh itself there is nothing to pick.
    modifier.show_viewport = False
    body.modifiers.new("Screw", "SCREW").screw_offset = 10.0 / scale
    bpy.context.view_layer.update()
    with pytest.raises(UnusableObjectError, match="far from its mesh"):
        far = place + Vector((0.0, 0.0, 9.0 / scale))
        pick._between_vertices(bpy.context.evaluated_depsgraph_get(), body, far, 0)
