# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters of several meshes: what belongs together, one match for all of it, data to every mesh."""

import json
from dataclasses import replace
from types import SimpleNamespace

import bpy
import figures
import numpy as np
import pytest
from conftest import choose, lumpy, new_object, turned
from figures import EYE, OFF, bend, character, hang_on, low_share, store_copy
from mathutils import Matrix
from test_completion import applied, half, mirrored, store_image

from addon import character as characters
from addon import command_line, figure, landmarks, mesh_read, morph, notice, pair, panels, stored_match
from addon.job import MatchJob
from addon.mesh_read import value_of
from addon.mesh_write import read_attribute, read_places, write_attribute, write_places
from addon.operators.match import summary
from addon.transfer.companions import hanging_on
from addon.transfer.joined import seen
from addon.transfer.layouts import read_uv
from addon.transfer.shape_keys import read_key
from addon.transfer.weights import read_weights

ROTATION = (turned(np.eye(3)) - turned(np.zeros((1, 3)))).T


def names(objects):
    return sorted(obj.name for obj in objects)


def resolved():
    return pair.resolve(bpy.context)


def weights_of(obj, group):
    """Weight of a group at each vertex."""
    vertex, groups, weight = read_weights(obj)
    here = groups == obj.vertex_groups[group].index
    found = np.zeros(len(obj.data.vertices))
    found[vertex[here]] = weight[here]
    return found


def transfer(source, target, **options):
    choose(source, target)
    assert bpy.ops.spectral_match.transfer(**options) == {"FINISHED"}


@pytest.fixture
def two(scene):
    """A character and its turned, renumbered copy without weights."""
    return character("Knight"), character("Mage", moved=True, weights=False)


@pytest.fixture
def known(two):
    """Both with the true map between them stored."""
    store_copy(*two)
    return two


# What belongs together.


@pytest.mark.parametrize("which", [0, 1, 2])
def test_any_piece_means_the_whole_character(two, which):
    knight, mage = two
    choose(knight.pieces[which], mage.pieces[2 - which])
    found = resolved()
    assert found.missing == "" and found.source.label == "Knight (3 meshes)"
    assert found.source.owner == knight.rig and names(found.source.pieces) == names(knight.pieces)
    assert [names(target.pieces) for target in found.targets] == [names(mage.pieces)]
    # The largest skinned mesh leads, whichever was selected.
    assert found.source.lead == knight.body


def test_all_meshes_of_both_selected_mean_two_characters(two):
    knight, mage = two
    choose(knight.shirt, knight.rig, *knight.pieces, mage.rig, *mage.pieces)
    found = resolved()
    assert found.source.owner == knight.rig and [target.owner for target in found.targets] == [mage.rig]


def test_armatures_may_be_chosen_instead_of_meshes(two, scene):
    knight, mage = two
    choose(knight.rig, mage.rig)
    assert resolved().missing == "" and names(resolved().source.pieces) == names(knight.pieces)
    settings = scene.spectral_match
    settings.pinned, settings.source, settings.target = True, mage.rig, knight.eye
    choose(knight.body)
    assert resolved().source.owner == mage.rig and resolved().targets[0].owner == knight.rig


def test_meshes_of_one_rig_are_matched_by_themselves(two):
    """As from a body to its new topology, which both follow one rig."""
    knight, _ = two
    choose(knight.body, knight.shirt)
    found = resolved()
    assert found.source.pieces == (knight.body,)
    assert [target.pieces for target in found.targets] == [(knight.shirt,)]


def test_meshes_by_themselves_if_that_is_wished(two, scene):
    knight, mage = two
    scene.spectral_match.whole_characters = False
    choose(knight.eye, mage.shirt, mage.body)
    found = resolved()
    assert found.source.pieces == (knight.eye,)
    assert {target.pieces for target in found.targets} == {(mage.shirt,), (mage.body,)}
    choose(knight.rig, mage.body)
    assert len(resolved().source.pieces) == 3 and resolved().targets[0].pieces == (mage.body,)


def below(name, *objects, parent=None):
    empty = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(empty)
    empty.parent = parent
    for obj in objects:
        obj.parent = empty
    return empty


def test_what_is_below_an_empty_is_a_character(scene):
    knight, mage = (character(name, rigged=False, moved=name == "Mage") for name in ("Knight", "Mage"))
    inner = below("Face", knight.eye)
    below("Hero", knight.body, knight.shirt, inner)
    below("Other", *mage.pieces)
    choose(knight.eye, mage.body)
    found = resolved()
    assert found.source.label == "Hero (3 meshes)" and names(found.source.pieces) == names(knight.pieces)
    # Below one empty more the two are told apart all the same.
    root = below("Scene", bpy.data.objects["Hero"], bpy.data.objects["Other"])
    assert names(resolved().source.pieces) == names(knight.pieces)
    assert [target.owner.name for target in resolved().targets] == ["Other"]
    choose(root, new_object("Alone", *lumpy(3)))
    assert len(resolved().source.pieces) == 6


def test_a_mesh_beside_the_rig_belongs_to_it(two):
    """Below one root are often a rig with the skin, and meshes that hang on the root alone."""
    knight, mage = two
    belt = new_object("Belt", *lumpy(3))
    below("Root", knight.rig, belt)
    choose(mage.body, belt)
    assert resolved().targets[0].owner == knight.rig and belt in resolved().targets[0].pieces


def test_a_collection_of_loose_meshes_is_a_character(scene):
    knight, mage = (character(name, rigged=False, moved=name == "Mage") for name in ("Knight", "Mage"))
    choose(knight.body, mage.body)
    # All in the scene's own collection: meshes by themselves.
    assert resolved().source.pieces == (knight.body,) and resolved().source.name == "Knight Body"
    collections = {}
    for name, made in (("Hero", knight), ("Other", mage)):
        collections[name] = bpy.data.collections.new(name)
        scene.collection.children.link(collections[name])
        for obj in made.pieces:
            scene.collection.objects.unlink(obj)
            collections[name].objects.link(obj)
    assert resolved().source.label == "Hero (3 meshes)" and len(resolved().targets[0].pieces) == 3
    # One with a lamp is a set.
    collections["Hero"].objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    assert resolved().source.pieces == (knight.body,)
    # Chosen itself it is what was chosen.
    settings = scene.spectral_match
    settings.pinned, settings.source_collection, settings.target = True, collections["Hero"], mage.eye
    assert resolved().source.label == "Hero (3 meshes)" and resolved().missing == ""


def test_a_collection_of_two_characters_is_none(scene):
    knight, mage = (character(name, rigged=False, moved=name == "Mage") for name in ("Knight", "Mage"))
    cast = bpy.data.collections.new("Cast")
    scene.collection.children.link(cast)
    for name, made in (("Hero", knight), ("Other", mage)):
        inner = bpy.data.collections.new(name)
        cast.children.link(inner)
        for obj in made.pieces:
            scene.collection.objects.unlink(obj)
            inner.objects.link(obj)
    choose(knight.eye, mage.eye)
    assert resolved().source.label == "Hero (3 meshes)" and resolved().targets[0].name == "Other"


def test_what_a_hand_holds_and_what_is_hidden_is_left_out(two):
    knight, mage = two
    bpy.context.view_layer.objects.active = knight.rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = knight.rig.data.edit_bones.new("Slot")
    bone.head, bone.tail, bone.parent = (0, 0.8, 0), (0, 1.0, 0), knight.rig.data.edit_bones["High"]
    bpy.ops.object.mode_set(mode="OBJECT")
    sword = new_object("Sword", lumpy(3)[0] * (0.05, 1.0, 0.05) + (0, 1.2, 0), lumpy(3)[1])
    hang_on(sword, knight.rig, "Slot")
    # As small as an eye it is no weapon, and on a bone with skin it is a hat.
    ring = new_object("Ring", lumpy(3)[0] * 0.03 + (0, 0.8, 0), lumpy(3)[1])
    hang_on(ring, knight.rig, "Slot")
    hat = new_object("Hat", lumpy(3)[0] + (0, 0, 1.5), lumpy(3)[1])
    hang_on(hat, knight.rig, "High")
    knight.shirt.hide_set(True)
    choose(mage.body, knight.body)
    (target,) = resolved().targets
    assert names(target.left_out) == ["Knight Shirt", "Sword"] and target.label == "Knight (4 of 6)"
    for piece in ("Sword", "Knight Shirt", "Hat"):
        bpy.ops.spectral_match.toggle_piece(piece=piece)
    assert names(resolved().targets[0].left_out) == ["Hat"]
    bpy.ops.spectral_match.reset_pieces(end="TARGET")
    assert names(resolved().targets[0].left_out) == ["Knight Shirt", "Sword"]


def test_the_last_piece_cannot_be_left_out(two):
    knight, mage = two
    choose(knight.body, mage.body)
    for piece in (knight.shirt, knight.eye):
        bpy.ops.spectral_match.toggle_piece(piece=piece.name)
    with pytest.raises(RuntimeError, match="last mesh of 'Knight'"):
        bpy.ops.spectral_match.toggle_piece(piece=knight.body.name)
    assert resolved().source.pieces == (knight.body,) and resolved().source.label == "Knight (1 of 3)"


def test_shapes_of_bones_and_copies_for_targets_are_no_pieces(two):
    knight, mage = two
    shape = new_object("Circle", *lumpy(3))
    shape.parent = knight.rig
    knight.rig.pose.bones["Low"].custom_shape = shape
    copy = new_object("Copy", *lumpy(3))
    copy.parent, copy[characters.MADE_FOR] = knight.rig, knight.body
    choose(knight.body, mage.body)
    assert names(resolved().source.whole) == names(knight.pieces)


def test_a_rig_without_meshes_is_said(two):
    knight, _ = two
    empty = bpy.data.objects.new("Bare", bpy.data.armatures.new("Bare"))
    bpy.context.collection.objects.link(empty)
    choose(empty, knight.body)
    assert resolved().missing == "'Bare' has no meshes. Choose a mesh, or what holds some together"


# Read as one.


def read(made, **settings):
    bpy.context.view_layer.update()
    return value_of(figure.Reading(characters.of(made.body), **settings).steps(bpy.context))


def test_pieces_are_read_where_they_are_at_rest(two):
    knight, _ = two
    knight.rig.location = (2.0, 0.0, 1.0)
    expected = np.concatenate([mesh_read.positions(piece.data) for piece in knight.pieces])
    made = read(knight)
    for angle in (0.0, 0.8):
        bend(knight.rig, angle)
        np.testing.assert_allclose(read(knight).local, expected, atol=1e-6)
    # As shown everything stands as it is posed.
    posed = read(knight, evaluated=True).local
    eye = made.parts[2].vertices
    seen_at = np.array([knight.eye.matrix_world @ vertex.co for vertex in knight.eye.data.vertices])
    there = posed[eye] @ np.array(knight.body.matrix_world)[:3, :3].T + knight.body.matrix_world.translation
    np.testing.assert_allclose(there, seen_at, atol=1e-6)
    assert np.abs(posed - expected).max() > 0.3


def volume(points, triangles):
    """Signed volume that closed triangles enclose."""
    a, b, c = np.moveaxis(points[triangles].astype(float), 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0


def test_a_mirrored_piece_is_turned_back(two):
    """An eye that is the other one's mirror image stands inside out in its own coordinates."""
    knight, _ = two
    other = bpy.data.objects.new("Other Eye", knight.eye.data)
    bpy.context.collection.objects.link(other)
    there = knight.eye.matrix_world.copy()
    other.matrix_world = Matrix.Scale(-1.0, 4, (1.0, 0.0, 0.0)) @ there
    hang_on(other, knight.rig, "High")
    made = read(knight)
    for part in made.parts:
        if part.surface.name != "Knight Shirt":
            assert volume(made.local, made.triangles[part.triangles]) > 0.0
    assert [part.turned_over for part in made.parts if "Eye" in part.surface.name] == [False, True]
    faces = np.arange(len(made.triangles))
    weights = np.random.default_rng(1).dirichlet(np.ones(3), size=len(faces))
    expected = np.einsum("ik,ikc->ic", weights, made.local[made.triangles])
    piece, own_faces, own_weights = figure.in_pieces(made, faces, weights)
    for number, part in enumerate(made.parts):
        here, surface = piece == number, part.surface
        own = made.local[part.vertices]
        found = np.einsum("ik,ikc->ic", own_weights[here], own[surface.triangles[own_faces[here]]])
        np.testing.assert_allclose(found, expected[here], atol=1e-6)
    # The joined source has the same triangles, by numbers of its own.
    objects = [mesh_read.find_object(bpy.data.objects, part.surface.object_uid) for part in made.parts]
    with seen(objects, "Knight") as view:
        points = mesh_read.positions(view.object.data)
        corners = mesh_read.corner_vertices(view.object.data)[view.triangle_corners]
        own = piece, own_faces, own_weights, np.zeros(len(piece), int)
        view_faces, view_weights = view.places(*own)
        found = np.einsum("ik,ikc->ic", view_weights, points[corners[view_faces]])
        np.testing.assert_allclose(found, expected, atol=1e-6)
        for back, given in zip(view.in_pieces(view_faces, view_weights), own, strict=True):
            np.testing.assert_array_equal(back, given)
        assert mesh_read.slots_shown(view.object).shape == (len(view.object.data.polygons),)


def test_joining_leaves_nothing_behind(two):
    knight, _ = two
    knight.shirt.shape_key_add(name="Basis")
    before = [set(held) for held in (bpy.data.objects, bpy.data.meshes, bpy.data.shape_keys)]
    with seen(knight.pieces, "Knight"):
        pass
    with pytest.raises(ZeroDivisionError), seen(knight.pieces, "Knight"):
        raise ZeroDivisionError
    assert [set(held) for held in (bpy.data.objects, bpy.data.meshes, bpy.data.shape_keys)] == before


# One match.

# Mean distance of the images of all meshes from where they belong, in edges of the body (0.25).
COPY_ERROR = 0.25
MAP = ("match_piece", "match_face", "match_barycentric", "match_position", "match_confidence", "match_color")


def images(made):
    return {piece.name: read_attribute(piece.data.attributes["match_position"]) for piece in made.pieces}


def mean_error(knight, mage):
    """Mean distance of the images from the vertices that they should be, in the space of the source."""
    apart = [
        np.linalg.norm(
            images(mage)[own.name] - mesh_read.positions(given.data)[mage.old[own.name.rpartition(" ")[2]]],
            axis=1,
        )
        for given, own in zip(knight.pieces, mage.pieces, strict=True)
    ]
    return np.concatenate(apart).mean()


def test_one_match_lies_on_every_mesh(two, tmp_path):
    knight, mage = two
    bend(knight.rig)
    bend(mage.rig, -0.5)
    choose(knight.eye, mage.shirt)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    for piece in mage.pieces:
        assert {*MAP} <= set(piece.data.attributes.keys())
        assert [each.object for each in piece.spectral_match_pieces] == knight.pieces
        assert stored_match.state(piece).code == stored_match.MATCHED
        faces, number = (read_attribute(piece.data.attributes[n]) for n in ("match_face", "match_piece"))
        weights = read_attribute(piece.data.attributes["match_barycentric"])
        for at, given in enumerate(knight.pieces):
            # Each face is one of the mesh that answers, by that mesh's own numbers.
            here, triangles = number == at, mesh_read.triangle_vertices(given.data)
            assert faces[here].max(initial=0) < len(triangles)
            own = mesh_read.positions(given.data)[triangles[faces[here]]]
            found = np.einsum("ik,ikc->ic", weights[here], own)
            np.testing.assert_allclose(
                found, read_attribute(piece.data.attributes["match_position"])[here], atol=1e-5
            )
    assert mean_error(knight, mage) < COPY_ERROR
    assert len({piece.data.spectral_match.figure for piece in mage.pieces}) == 1
    kept = images(mage)
    path = str(tmp_path / "matched.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    for name, before in kept.items():
        piece = bpy.data.objects[name]
        np.testing.assert_array_equal(read_attribute(piece.data.attributes["match_position"]), before)
        assert stored_match.state(piece).code == stored_match.MATCHED
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.objects = list(kept)
    for obj in wanted.objects:
        bpy.context.collection.objects.link(obj)
        for source in obj.spectral_match_pieces:
            if not source.object.users_scene:
                bpy.context.collection.objects.link(source.object)
    assert all(stored_match.state(bpy.data.objects[name]).usable for name in kept)


def test_a_piece_that_is_edited_is_named(known):
    knight, mage = known
    knight.shirt.data.vertices[0].co.x += 0.1
    knight.shirt.data.update()
    stored_match.forget_fingerprint(knight.shirt.data)
    assert stored_match.state(mage.body).code == stored_match.MOVED
    assert "Knight Shirt" in stored_match.state(mage.body).words
    bpy.data.objects.remove(knight.eye)
    assert stored_match.state(mage.eye).words.startswith("The source 'Knight Eye' is gone")


@pytest.fixture
def at_once(monkeypatch):
    """Instead of the core: every vertex of a turned target lies on the nearest vertex of the source."""

    def match(job, _sgmds, _number, target):
        source = job.source
        points = (target.local - turned(np.zeros((1, 3)))[0]) @ ROTATION
        near = np.linalg.norm(points[:, None] - source.local[None], axis=2).argmin(axis=1)
        face, corner = np.empty((2, len(source.local)), int)
        for k in range(3):
            face[source.triangles[:, k]], corner[source.triangles[:, k]] = np.arange(len(source.triangles)), k
        return SimpleNamespace(
            faces=face[near],
            barycentric=np.eye(3)[corner[near]],
            confidence=np.ones(len(near)),
            quality=SimpleNamespace(grade="green", reasons=[]),
            alternative_count=0,
        )

    monkeypatch.setattr(MatchJob, "_match", match)


def test_undo_takes_all_of_it_back(two, at_once):
    knight, mage = two
    choose(knight.body, mage.body)
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.spectral_match.match()
    bpy.ops.ed.undo_push(message="Match")
    bpy.ops.ed.undo()
    for piece in (bpy.data.objects[f"Mage {name}"] for name in ("Body", "Shirt", "Eye")):
        assert "match_face" not in piece.data.attributes and not piece.spectral_match_pieces


def test_meshes_shared_with_the_source_are_left_out(two, at_once):
    knight, mage = two
    mage.eye.data = knight.eye.data
    choose(knight.body, mage.body)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert "'Mage Eye' was left out: it shares the mesh of 'Knight Eye'" in notice.words
    assert "match_face" in mage.shirt.data.attributes and "match_face" not in mage.eye.data.attributes


def test_a_character_is_matched_to_a_mesh_and_back(two, at_once):
    knight, _ = two
    vertices, faces = lumpy(8)
    alone = new_object("Alone", turned(vertices), faces)
    choose(knight.eye, alone)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert len(alone.spectral_match_pieces) == 3 and "match_piece" in alone.data.attributes
    # From one mesh no piece has to be named.
    choose(alone, knight.eye)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert all("match_piece" not in piece.data.attributes for piece in knight.pieces)
    assert all(piece.spectral_match_source == alone for piece in knight.pieces)
    choose(knight.body, alone)
    bpy.ops.spectral_match.toggle_piece(piece=knight.shirt.name)
    bpy.ops.spectral_match.toggle_piece(piece=knight.eye.name)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert not alone.spectral_match_pieces and "match_piece" not in alone.data.attributes


# Data to every mesh.


def test_weights_come_over_the_whole_figure(known):
    knight, mage = known
    bend(knight.rig)
    transfer(knight.eye, mage.shirt, kinds="groups")
    for piece in (mage.body, mage.shirt):
        given = low_share(turned_back(piece))
        np.testing.assert_allclose(weights_of(piece, "Low"), given, atol=2e-3)
        np.testing.assert_allclose(weights_of(piece, "High"), 1.0 - given, atol=2e-3)
    # The eye has no weights: it hangs on a bone, which therefore moves all of it.
    np.testing.assert_allclose(weights_of(mage.eye, "High"), 1.0)


def turned_back(obj):
    return (mesh_read.positions(obj.data) - turned(np.zeros((1, 3)))[0]) @ ROTATION


def test_weights_of_another_piece_answer_where_the_map_leads_there(known):
    """Where the shirt's images lie on the body, the body's weights come."""
    knight, mage = known
    group = knight.body.vertex_groups.new(name="Skin")
    group.add(range(len(knight.body.data.vertices)), 0.5, "REPLACE")
    write = mage.shirt.data.attributes
    write["match_piece"].data.foreach_set("value", np.zeros(len(mage.shirt.data.vertices), np.int32))
    transfer(knight.body, mage.body, kinds="groups")
    np.testing.assert_allclose(weights_of(mage.shirt, "Skin"), 0.5, atol=1e-6)
    assert weights_of(mage.eye, "Skin").max() == 0.0


def test_shape_keys_come_to_every_mesh_that_they_move(known):
    knight, mage = known
    for piece, amount in ((knight.body, 0.1), (knight.shirt, 0.2)):
        piece.shape_key_add(name="Basis")
        key = piece.shape_key_add(name="Breathe", from_mix=False)
        points = mesh_read.positions(piece.data)
        key.data.foreach_set("co", (points + np.array((0.0, amount, 0.0))).astype(np.float32).ravel())
        key.slider_max = 2.0
    drive = knight.shirt.data.shape_keys.key_blocks["Breathe"].driver_add("value")
    drive.driver.type = "SUM"
    seen_by = drive.driver.variables.new()
    seen_by.type = "SINGLE_PROP"
    seen_by.targets[0].id_type, seen_by.targets[0].id = "KEY", knight.body.data.shape_keys
    seen_by.targets[0].data_path = 'key_blocks["Breathe"].value'
    transfer(knight.body, mage.body, kinds="keys")
    for piece, amount in ((mage.body, 0.1), (mage.shirt, 0.2)):
        key = piece.data.shape_keys.key_blocks["Breathe"]
        moved = read_key(key) - mesh_read.positions(piece.data)
        np.testing.assert_allclose(moved, np.tile(amount * ROTATION[:, 1], (len(moved), 1)), atol=2e-3)
        assert key.slider_max == 2.0
    # It moves nothing on the eye.
    assert mage.eye.data.shape_keys is None
    # The shirt's is driven by that of the body, on both.
    (curve,) = mage.shirt.data.shape_keys.animation_data.drivers
    assert curve.driver.variables[0].targets[0].id == mage.body.data.shape_keys
    assert mage.body.data.shape_keys.animation_data is None


@pytest.fixture
def halves(scene):
    """A character of two meshes of which Mirror modifiers add one half, and the same with these applied.

    The second stands in a mirrored, turned space of its own. With the true map, and by vertex of each target
    the modelled vertex and its mirrors.
    """
    points, faces = half()
    spaces = (
        Matrix(),
        Matrix.Translation((0.1, 0.2, 0.3)) @ Matrix.Rotation(0.5, 4, "Z") @ Matrix.Scale(-1, 4),
    )
    pieces, targets, shown = [], [], []
    for number, (name, space) in enumerate(zip(("Body", "Shirt"), spaces, strict=True)):
        piece = new_object(name, (1.0 + 0.1 * number) * points, faces)
        piece.matrix_world = space
        for group, values in (("Arm.R", None), ("Arm.L", points[:, 0]), ("Spine", 2.0 - points[:, 0])):
            made = piece.vertex_groups.new(name=group)
            for vertex, weight in enumerate(() if values is None else (values / 2.0).tolist()):
                if weight > 0.01:
                    made.add([vertex], weight, "REPLACE")
        mirrored(piece)
        whole = applied(piece, f"Shown {name}")
        target = new_object(
            f"Own {name}", mesh_read.positions(whole.data), [face.vertices[:] for face in whole.data.polygons]
        )
        target.matrix_world = space
        shown.append((whole, *store_image(piece, target, (0,))))
        write_attribute(
            target.data, "match_piece", "INT", "POINT", np.full(len(target.data.vertices), number)
        )
        target.data.spectral_match.figure = "known"
        pieces.append(piece)
        targets.append(target)
    for target in targets:
        target.spectral_match_source = pieces[0]
        for piece in pieces:
            kept = target.spectral_match_pieces.add()
            kept.object, kept.name = piece, piece.name
            kept.fingerprint = str(mesh_read.fingerprint(piece.data))
    below("Hero", *pieces)
    below("Other", *targets)
    bpy.context.view_layer.update()
    return pieces, targets, shown


def test_pieces_with_a_modelled_half_carry_what_their_modifiers_show(halves):
    pieces, targets, shown = halves
    lifts = []
    for piece in pieces:
        points = mesh_read.positions(piece.data).astype(float)
        lifts.append(np.stack([np.full(len(points), 0.1), 0.2 * points[:, 2], points[:, 0] ** 2], axis=1))
        piece.shape_key_add(name="Basis", from_mix=False)
        key = piece.shape_key_add(name="Lift", from_mix=False)
        key.data.foreach_set("co", (points + lifts[-1]).astype(np.float32).ravel())
    held = bpy.data.objects, bpy.data.meshes
    before = [set(each) for each in held]
    transfer(pieces[0], targets[0], kinds="groups,keys")
    assert [set(each) for each in held] == before
    for target, lift, (whole, old, image) in zip(targets, lifts, shown, strict=True):
        for group in ("Arm.L", "Arm.R", "Spine"):
            # Rows are scaled to their sum in single precision.
            np.testing.assert_allclose(weights_of(target, group), weights_of(whole, group), atol=1e-6)
        assert weights_of(target, "Arm.R")[image > 0].max() > 0.5
        key = target.data.shape_keys.key_blocks["Lift"]
        points = mesh_read.positions(target.data)
        expected = lift[old] * np.where(image[:, None] > 0, (-1, 1, 1), 1)
        expected[np.abs(points[:, 0]) < 1e-5, 0] = 0.0
        # A displacement is turned by frames that are averaged over neighbours; the map is the identity.
        np.testing.assert_allclose(read_key(key) - points, expected, atol=1e-4)


def test_characters_with_modelled_halves_are_matched_as_the_whole_they_show(halves):
    pieces, targets, shown = halves
    choose(pieces[0], targets[0])
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    into = pieces[0].matrix_world.inverted()
    for target, (_, _, image) in zip(targets, shown, strict=True):
        found = read_attribute(target.data.attributes["match_position"])
        place = np.array(into @ target.matrix_world)
        expected = mesh_read.positions(target.data) @ place[:3, :3].T + place[:3, 3]
        assert np.linalg.norm(found - expected, axis=1).mean() < COPY_ERROR
        beyond = np.abs(mesh_read.positions(target.data)[:, 0]) > COPY_ERROR
        mirrors = read_attribute(target.data.attributes["match_image"])
        assert np.mean(mirrors[beyond] == image[beyond]) > 0.95
    transfer(pieces[0], targets[0], kinds="groups")
    assert weights_of(targets[0], "Arm.R").max() > 0.4


def painted(obj, name, uv_map="UVMap"):
    """Give a mesh a material of its own and a UV map by which its coordinates can be read."""
    material = bpy.data.materials.new(name)
    obj.data.materials.append(material)
    flat = mesh_read.positions(obj.data)[mesh_read.corner_vertices(obj.data)][:, [0, 2]]
    obj.data.uv_layers.new(name=uv_map).uv.foreach_set("vector", flat.astype(np.float32).ravel())
    return material


def test_materials_and_uv_maps_come_from_the_piece_that_answers(known):
    knight, mage = known
    made = [painted(piece, piece.name) for piece in knight.pieces]
    knight.shirt.data.uv_layers.new(name="Pattern")
    transfer(knight.body, mage.body, kinds="uv,materials")
    for piece, material in zip(mage.pieces, made, strict=True):
        assert [slot.material for slot in piece.material_slots] == [material]
        assert ("Pattern" in piece.data.uv_layers) == (piece == mage.shirt)
        expected = turned_back(piece)[mesh_read.corner_vertices(piece.data)][:, [0, 2]]
        # At the outline of a flat projection a face may take another fold's.
        apart = np.abs(read_uv(piece.data, "UVMap") - expected).max(axis=1)
        assert np.mean(apart < 1e-4) > 0.99


def test_uv_maps_of_other_names_are_laid_on_by_their_own_textures(two):
    """A texture without a UV Map node goes by each mesh's own map, whatever its name is."""
    knight, _ = two
    for piece, uv_map in zip(knight.pieces, ("UVMap", "Cloth", "UVMap"), strict=True):
        painted(piece, piece.name, uv_map)
    with seen(knight.pieces, "Knight") as view:
        mesh = view.object.data
        assert set(mesh.uv_layers.keys()) == {"UVMap", "Cloth"}
        expected = mesh_read.positions(mesh)[mesh_read.corner_vertices(mesh)][:, [0, 2]]
        np.testing.assert_allclose(read_uv(mesh, "UVMap"), expected, atol=1e-6)


def test_colours_of_several_types_are_brought_together(known):
    knight, mage = known
    given = {knight.body: ("FLOAT_COLOR", "POINT"), knight.shirt: ("BYTE_COLOR", "CORNER")}
    for piece, layout in given.items():
        layer = piece.data.color_attributes.new("Paint", *layout)
        layer.data.foreach_set("color", np.tile((1.0, 0.0, 0.0, 1.0), len(layer.data)))
    knight.eye.data.attributes.new("Paint", "INT", "FACE")
    bpy.context.view_layer.objects.active = knight.rig
    bpy.ops.object.mode_set(mode="POSE")
    assert bpy.ops.spectral_match.pin() == {"FINISHED"}
    settings = bpy.context.scene.spectral_match
    settings.source, settings.target = knight.rig, mage.rig
    assert bpy.ops.spectral_match.transfer(kinds="colours,attributes") == {"FINISHED"}
    assert knight.rig.mode == "POSE"
    for piece in (mage.body, mage.shirt):
        layer = piece.data.color_attributes["Paint"]
        assert (layer.data_type, layer.domain) == given[knight.body]
        np.testing.assert_allclose(read_attribute(layer), np.tile((1.0, 0.0, 0.0, 1.0), (len(layer.data), 1)))
    assert "Paint" not in mage.eye.data.attributes and "'Paint' is of another type" in notice.words


def test_textures_are_baked_from_the_piece_that_answers(known):
    knight, mage = known
    colours = ((1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))
    for piece, own, colour in zip(knight.pieces, mage.pieces, colours, strict=True):
        material = painted(piece, piece.name)
        material.use_nodes = True
        image = bpy.data.images.new(piece.name, 16, 16)
        image.pixels.foreach_set(np.tile(np.array(colour, np.float32), 256))
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        principled = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        material.node_tree.links.new(node.outputs["Color"], principled.inputs["Base Color"])
        bpy.context.view_layer.objects.active = own
        flat = np.random.default_rng(3).uniform(0.1, 0.9, size=(len(own.data.loops), 2))
        own.data.uv_layers.new(name="Own").uv.foreach_set("vector", flat.astype(np.float32).ravel())
    transfer(knight.body, mage.body, kinds="textures")
    for own, colour in zip(mage.pieces, colours, strict=True):
        nodes = own.material_slots[0].material.node_tree.nodes
        (image,) = [node.image for node in nodes if node.type == "TEX_IMAGE"]
        pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(-1, 4)
        covered = pixels[:, 3] > 0.5
        assert covered.any()
        np.testing.assert_allclose(pixels[covered], np.tile(colour, (covered.sum(), 1)), atol=0.02)


def gather(scene, owner, name):
    """Move the pieces of a character into a collection of their own."""
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    for piece in owner.pieces:
        scene.collection.objects.unlink(piece)
        collection.objects.link(piece)
    bpy.context.view_layer.update()


def test_one_rig_is_fitted_for_all_meshes(scene):
    knight = character("Knight")
    mage = character("Mage", moved=True, weights=False, rigged=False)
    gather(scene, mage, "Mage")
    store_copy(knight, mage)
    for _ in range(2):
        transfer(knight.body, mage.eye, kinds="groups,armature")
    rigs = {modifier.object for piece in mage.pieces for modifier in piece.modifiers}
    assert len(rigs) == 1 and all(len(piece.modifiers) == 1 for piece in mage.pieces)
    (fitted,) = rigs
    assert fitted != knight.rig and {piece.parent for piece in mage.pieces} == {fitted}
    # Both characters stand alike in the same pose, the eye on its bone and that with weights.
    for rig in (knight.rig, fitted):
        bend(rig)
    graph = bpy.context.evaluated_depsgraph_get()
    for given, own in zip(knight.pieces, mage.pieces, strict=True):
        stand = []
        for obj in (given, own):
            points = mesh_read.positions(obj.evaluated_get(graph).data)
            matrix = np.array(obj.matrix_world)
            stand.append(points @ matrix[:3, :3].T + matrix[:3, 3])
        old = mage.old[own.name.rpartition(" ")[2]]
        # Joints of a coarse body are fitted to within a part of an edge (0.25).
        np.testing.assert_allclose(stand[1], turned(stand[0][old]), atol=0.05)


def test_a_rig_of_its_own_is_replaced_on_all_meshes(known):
    knight, mage = known
    transfer(knight.body, mage.body, kinds="groups,armature")
    for piece in (mage.body, mage.shirt):
        old, fitted = [modifier for modifier in piece.modifiers if modifier.type == "ARMATURE"]
        if old.object != mage.rig:
            old, fitted = fitted, old
        assert old.object == mage.rig and not old.show_viewport and not old.show_render
        assert fitted.object not in (knight.rig, mage.rig) and fitted.show_viewport
        assert piece.parent == fitted.object
    assert mage.body.parent == mage.shirt.parent


def test_a_rig_of_its_own_that_stays_gets_the_weights_on_all_meshes(known):
    knight, mage = known
    transfer(knight.body, mage.body, kinds="groups")
    for piece in (mage.body, mage.shirt):
        (modifier,) = piece.modifiers
        assert modifier.object == mage.rig and modifier.show_viewport
        np.testing.assert_allclose(weights_of(piece, "Low"), low_share(turned_back(piece)), atol=1e-5)


def test_what_is_no_piece_is_a_companion_of_the_whole(known):
    """A hat that does not take part is copied once, and lies as on the source."""
    knight, mage = known
    hat = new_object("Hat", 0.2 * lumpy(3)[0] + (0, 0.1, 1.9), lumpy(3)[1])
    hang_on(hat, knight.rig, "High")
    transfer(knight.body, mage.body, kinds="objects")
    copies = [obj for obj in bpy.data.objects if obj.name.startswith("Hat ")]
    assert len(copies) == 1
    matrix = np.array(copies[0].matrix_world)
    found = mesh_read.positions(copies[0].data) @ matrix[:3, :3].T + matrix[:3, 3]
    expected = turned(0.2 * lumpy(3)[0] + (0, 0.1, 1.9))
    np.testing.assert_allclose(found, expected, atol=0.05)


def test_a_transfer_to_a_character_leaves_nothing_behind(known):
    knight, mage = known
    before = names(bpy.data.objects), names(bpy.data.meshes)
    transfer(knight.body, mage.body, kinds="groups,attributes")
    assert (names(bpy.data.objects), names(bpy.data.meshes)) == before


def test_what_one_mesh_cannot_get_is_said_and_the_others_get_it(known):
    knight, mage = known
    for piece in knight.pieces:
        painted(piece, piece.name)
    for number in range(8):
        mage.eye.data.uv_layers.new(name=f"Own {number}")
    transfer(knight.body, mage.body, kinds="uv")
    assert "UVMap" in mage.body.data.uv_layers and "UVMap" not in mage.eye.data.uv_layers
    assert "'Mage Eye' has room for 0 more UV maps" in notice.words


def test_hair_of_a_character_is_attached_to_the_mesh_on_which_it_stands(known):
    knight, mage = known
    for piece in (*knight.pieces, *mage.pieces):
        painted(piece, piece.name)
    hair = bpy.data.hair_curves.new("Hair")
    if not hasattr(hair, "add_curves"):
        pytest.skip("Python cannot make hair curves in this Blender")
    roots = mesh_read.positions(knight.shirt.data)[::9]
    hair.add_curves([2] * len(roots))
    points = np.repeat(roots, 2, axis=0)
    points[1::2] += (0.0, 0.0, 0.1)
    write_attribute(hair, "position", "FLOAT_VECTOR", "POINT", points)
    hair.surface, hair.surface_uv_map = knight.shirt, "UVMap"
    obj = bpy.data.objects.new("Hair", hair)
    bpy.context.collection.objects.link(obj)
    obj.parent = knight.shirt
    transfer(knight.body, mage.body, kinds="objects")
    (copy,) = [each for each in bpy.data.objects if each.name.startswith("Hair ")]
    assert copy.data.surface == mage.shirt
    matrix = np.array(copy.matrix_world)
    found = read_attribute(copy.data.attributes["position"])[::2] @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(found, turned(roots), atol=1e-3)
    uv = read_attribute(copy.data.attributes["surface_uv_coordinate"])
    np.testing.assert_allclose(uv, turned(roots)[:, [0, 2]], atol=1e-3)


# Landmarks, alternatives, colours.


def test_landmarks_lie_on_any_piece(two):
    knight, mage = two
    choose(knight.body, mage.body)
    bpy.ops.spectral_match.add_landmark(
        source_vertex=3, source_mesh=knight.eye.name, target_vertex=5, target_mesh=mage.shirt.name
    )
    found = resolved()
    given = landmarks.vertex_pairs(bpy.context.scene.spectral_match, found.source, found.targets[0])
    surfaces = read(knight), read(mage)
    for (surface, vertex), (obj, own) in zip(
        zip(surfaces, given[0], strict=True), ((knight.eye, 3), (mage.shirt, 5)), strict=True
    ):
        part = next(part for part in surface.parts if part.surface.name == obj.name)
        assert vertex == part.vertices.start + own
    assert landmarks.listed(bpy.context) == [0]
    bpy.ops.spectral_match.toggle_piece(piece=knight.eye.name)
    with pytest.raises(RuntimeError, match="is on 'Knight Eye', which is left out"):
        bpy.ops.spectral_match.match()


def test_one_slider_morphs_all_meshes(two):
    knight, mage = two
    choose(knight.body, mage.body)
    bpy.ops.spectral_match.match()
    settings = bpy.context.scene.spectral_match
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    modifiers = [morph.modifier_of(piece) for piece in mage.pieces]
    assert len(modifiers) > 1 and all(modifiers)
    assert settings.morph_factor == 1.0 and settings.morph_in_place
    settings.morph_factor = 0.25
    settings.morph_in_place, settings.morph_wipe = False, True
    for way, value in ((morph.FACTOR, 0.25), (morph.IN_PLACE, False), (morph.WIPE, True)):
        assert {morph.value(modifier, way) for modifier in modifiers} == {value}
    assert settings.morph_wipe and not settings.morph_in_place
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    assert settings.morph_factor == 0.0 and not settings.morph_wipe


def test_an_older_match_of_a_piece_that_is_left_out_is_not_carried(known):
    knight, mage = known
    transfer(knight.body, mage.body, kinds="groups,armature")
    rig = mage.eye.find_armature()
    mage.eye.spectral_match_part = "LEFT_OUT"
    for piece in (mage.body, mage.shirt):
        piece.data.spectral_match.figure = "anew"
    mage.eye.vertex_groups.clear()
    transfer(knight.body, mage.body, kinds="groups,armature")
    assert [obj for obj in bpy.data.objects if obj.get(characters.MADE_FROM) == "Knight"] == [rig]
    assert mage.eye.find_armature() == rig and not mage.eye.vertex_groups
    # One that was matched with the others, and is left out since, is.
    mage.eye.data.spectral_match.figure = "anew"
    transfer(knight.body, mage.body, kinds="groups,armature")
    assert mage.eye.vertex_groups


def state_of(obj):
    """What a match may change of an object: attributes, properties and modifiers."""
    colours, stored = obj.data.color_attributes, obj.data.spectral_match
    return (
        sorted(obj.data.attributes.keys()),
        (colours.active_color_name, colours.default_color_name if colours else ""),
        [getattr(stored, name) for name in stored.bl_rna.properties.keys() if name != "rna_type"],
        (obj.spectral_match_source, len(obj.spectral_match_pieces), len(obj.modifiers)),
    )


def test_pieces_that_a_later_match_leaves_out_are_as_if_never_matched(two, at_once):
    knight, mage = two
    for shirt in (knight.shirt, mage.shirt):
        for name in ("Paint", "Dirt"):
            shirt.data.color_attributes.new(name, "FLOAT_COLOR", "POINT")
        shirt.data.attributes.new("match_height", "FLOAT", "POINT")
        shirt.data.color_attributes.active_color = shirt.data.color_attributes["Dirt"]
    left_out = (knight.shirt, mage.shirt, mage.eye)
    choose(knight.body, mage.body)
    before = [*map(state_of, left_out)]
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    for way in ("CONFIDENCE", "COLOURS"):
        assert bpy.ops.spectral_match.show(what=way) == {"FINISHED"}
    assert bpy.ops.spectral_match.morph() == {"FINISHED"}
    for piece in left_out:
        assert piece.data.color_attributes.active_color.name == "match_color"
        bpy.ops.spectral_match.toggle_piece(piece=piece.name)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert [*map(state_of, left_out)] == before
    assert pair.has_match(mage.body) and morph.modifier_of(mage.body)
    assert "match_color" in knight.eye.data.attributes and panels._leaves_white(resolved())


def test_pieces_that_another_match_needs_keep_their_colours(two, at_once):
    """A piece that is left out now may be the source of another target, or matched with another source."""
    knight, mage = two
    other = new_object("Other", *lumpy(4))
    choose(knight.body, mage.body, other)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    choose(other, mage.body)
    for piece in (mage.body, mage.shirt):
        bpy.ops.spectral_match.toggle_piece(piece=piece.name)
    # The eye alone with the other source, and then it alone is left out.
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    for piece in (mage.body, mage.shirt, mage.eye, knight.eye):
        choose(knight.body, mage.body)
        bpy.ops.spectral_match.toggle_piece(piece=piece.name)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert mage.eye.spectral_match_source == other and "match_color" in mage.eye.data.attributes
    assert "match_color" in knight.eye.data.attributes and stored_match.state(other).usable


def test_pieces_that_are_left_out_are_told_to_be_white(known):
    knight, mage = known
    found = pair.resolve(bpy.context)
    assert not panels._leaves_white(found)
    mage.shirt.spectral_match_part = "LEFT_OUT"
    assert panels._leaves_white(pair.resolve(bpy.context))
    mage.shirt.hide_set(True)
    assert not panels._leaves_white(pair.resolve(bpy.context))
    knight.shirt.data.color_attributes.new("match_color", "FLOAT_COLOR", "POINT")
    knight.shirt.spectral_match_part = "LEFT_OUT"
    # With the colors of an earlier match it is not white.
    assert not panels._leaves_white(pair.resolve(bpy.context))


def test_colours_are_those_of_the_whole_figure(known):
    knight, mage = known
    choose(knight.body, mage.body)
    assert bpy.ops.spectral_match.show(what="COLOURS") == {"FINISHED"}
    for given, own in zip(knight.pieces, mage.pieces, strict=True):
        colours = [read_attribute(obj.data.attributes["match_color"]) for obj in (given, own)]
        old = mage.old[own.name.rpartition(" ")[2]]
        np.testing.assert_allclose(colours[1], colours[0][old], atol=1e-6)
    # Where the shirt lies on the body, both have one colour.
    body, shirt = (mesh_read.positions(obj.data) for obj in (knight.body, knight.shirt))
    apart = np.linalg.norm(body[None] - shirt[:, None], axis=2)
    nearest = apart.argmin(axis=1)
    assert apart.min(axis=1).max() < 2 * OFF
    of_body, of_shirt = (
        read_attribute(o.data.attributes["match_color"]) for o in (knight.body, knight.shirt)
    )
    assert np.abs(of_body[nearest] - of_shirt).max() < 0.1
    assert np.abs(read_attribute(knight.eye.data.attributes["match_color"]) - of_shirt[0]).max() > 0.1
    assert EYE[2] > shirt[:, 2].max()


def test_other_maps_go_to_every_mesh(two):
    knight, mage = two
    choose(knight.body, mage.body)
    bpy.ops.spectral_match.match()
    if stored_match.maps_of(mage.shirt.data).best.alternative_count == 0:
        pytest.skip("there is one plausible map only")
    first = images(mage)
    assert bpy.ops.spectral_match.alternative() == {"FINISHED"}
    assert {piece.data.spectral_match.alternative for piece in mage.pieces} == {1}
    assert all(np.abs(images(mage)[name] - before).max() > 0.0 for name, before in first.items())


# Many at once, and by name.


def test_a_batch_takes_several_characters(scene, at_once):
    knight = character("Knight")
    others = [character(name, moved=True, weights=False) for name in ("Mage", "Monk")]
    settings = scene.spectral_match
    for kind in ("keys", "marks", "uv", "materials", "colours", "attributes", "armature"):
        setattr(settings, f"use_{kind}", False)
    choose(knight.eye, *(other.shirt for other in others))
    assert bpy.ops.spectral_match.batch() == {"FINISHED"}
    for other in others:
        assert weights_of(other.body, "Low").max() > 0.5 and "High" in other.eye.vertex_groups


@pytest.fixture
def files(scene, at_once, tmp_path):
    """A file with a knight in a collection, and one with a mage and a monk."""
    hall = bpy.data.collections.new("Hall")
    scene.collection.children.link(hall)
    knight = character("Knight")
    for obj in (knight.rig, *knight.pieces):
        scene.collection.objects.unlink(obj)
        hall.objects.link(obj)
    new_object("Stone", *lumpy(3))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "knight.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    for name in ("Mage", "Monk"):
        character(name, moved=True, weights=False)
    new_object("Pot", *lumpy(3))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "others.blend"))
    return tmp_path


def weighted(name):
    return all(
        "High" in bpy.data.objects[f"{name} {piece}"].vertex_groups for piece in ("Body", "Shirt", "Eye")
    )


@pytest.mark.parametrize("source", ["Knight", "Hall"])
@pytest.mark.parametrize(
    ("target", "reached"), [("Mage", ["Mage"]), ("M*k,Nobody", ["Monk"]), ("Mage,Monk", ["Mage", "Monk"])]
)
def test_the_command_line_takes_armatures_and_collections(files, source, target, reached):
    report = files / "report.json"
    words = ["--source", source, "--source-file", str(files / "knight.blend"), "--target", target]
    words += ["--transfer", "groups", "--output", str(files / "out.blend"), "--json", str(report)]
    assert command_line.run(["batch", *words]) == ("Nobody" in target)
    done = [pair for pair in json.loads(report.read_text())["files"][0]["pairs"] if pair["status"] == "done"]
    assert [pair["target"] for pair in done] == reached
    assert all(pair["source"] == source and len(pair["meshes"]) == 3 for pair in done)
    bpy.ops.wm.open_mainfile(filepath=str(files / "out.blend"))
    assert {name: weighted(name) for name in ("Mage", "Monk")} == {
        name: name in reached for name in ("Mage", "Monk")
    }
    # The source left again, with its rig.
    assert not [obj.name for obj in bpy.data.objects if obj.name.startswith(("Knight", "Stone"))]
    assert {piece.name for piece in bpy.data.objects["Mage Body"].spectral_match_pieces} == (
        {"Knight Body", "Knight Shirt", "Knight Eye"} if "Mage" in reached else set()
    )


@pytest.mark.parametrize(("pattern", "meant"), [("*", 3), ("M*[ty]", 2), ("Monk B*", 1)])
def test_wildcards_mean_the_figures_of_the_meshes_that_they_name(files, pattern, meant):
    """Every mesh of a mage, a monk and a pot; bodies and shirts of the two; the body of the monk alone."""
    words = ["--source", "Knight", "--source-file", str(files / "knight.blend"), "--target", pattern]
    report = files / "report.json"
    words += ["--output", str(files / "out.blend"), "--json", str(report)]
    assert command_line.run(["match", *words]) == 0
    pairs = json.loads(report.read_text())["files"][0]["pairs"]
    expected = {"*": ["Mage", "Monk", "Pot"], "M*[ty]": ["Mage", "Monk"], "Monk B*": ["Monk Body"]}[pattern]
    assert sorted(pair["target"] for pair in pairs) == expected
    assert max(len(pair.get("meshes", [0])) for pair in pairs) == meant


def test_a_mesh_named_on_the_command_line_is_meant_alone(files):
    words = ["--source", "Mage Body", "--target", "Monk Body", "--output", str(files / "out.blend")]
    assert command_line.run(["match", *words]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(files / "out.blend"))
    body = bpy.data.objects["Monk Body"]
    assert body.spectral_match_source.name == "Mage Body" and not body.spectral_match_pieces
    assert not pair.has_match(bpy.data.objects["Monk Shirt"])


def test_a_manifest_takes_characters(files):
    (files / "cast.toml").write_text(
        "output = 'out'\ntransfer = ['groups']\n[[jobs]]\nfiles = 'others.blend'\n"
        "source_file = 'knight.blend'\nsource = 'Hall'\ntargets = ['Mage', 'Monk']\nkeep_source = true\n"
    )
    assert command_line.run(["batch", "--manifest", str(files / "cast.toml")]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(files / "out" / "others.blend"))
    assert weighted("Mage") and weighted("Monk") and "Knight Eye" in bpy.context.scene.objects
    assert stored_match.state(bpy.data.objects["Mage Eye"]).code == stored_match.MATCHED


def test_the_joined_source_hangs_on_nothing(two):
    """The panel is drawn while a transfer has it, and lists what hangs on the rig."""
    knight, _ = two
    before = hanging_on(knight.pieces)
    with seen(knight.pieces, "Knight") as view:
        assert view.object not in hanging_on(knight.pieces) and hanging_on(knight.pieces) == before


def test_the_joined_source_is_not_shown(two, scene):
    """The window lives meanwhile: neither viewport nor outliner show what is in no collection."""
    knight, _ = two
    before = set(scene.objects)
    stands = knight.body.matrix_world.copy()
    with seen(knight.pieces, "Knight") as view:
        assert set(scene.objects) == before and not view.object.users_collection
        bpy.context.view_layer.update()
        assert view.object.matrix_world == stands


def test_faces_between_images_on_several_meshes_are_split(scene, monkeypatch):
    """A vertex that a split makes has its own image, not numbers that Blender mixed of its neighbours'."""
    # A shirt on the skin: ways lead from one to the other. Mixed numbers of these two pieces lead to the eye,
    # which has fewer triangles.
    monkeypatch.setattr(figures, "OFF", 0.0)
    pair = character("Knight"), character("Mage", moved=True, weights=False)
    knight, mage = (replace(each, shirt=each.eye, eye=each.shirt) for each in pair)
    store_copy(knight, mage)
    centres = []
    for obj in knight.pieces:
        corners = mesh_read.positions(obj.data)[mesh_read.corner_vertices(obj.data)]
        sides = np.repeat([face.center.x > 0.05 for face in obj.data.polygons], 4)
        flat = 0.1 * corners[:, 1:] + 0.5 * sides[:, None]
        obj.data.uv_layers.new(name="Map").uv.foreach_set("vector", flat.astype(np.float32).ravel())
        centres.append(mesh_read.positions(obj.data)[mesh_read.triangle_vertices(obj.data)].mean(axis=1))
    mesh = mage.body.data
    piece, faces, weights, image = read_places(mesh)
    # Every third image under the shirt lies on it; all are within triangles, so that seams run between them.
    away = np.linalg.norm(centres[0][faces][:, None] - centres[2], axis=2)
    worn = (away.min(axis=1) < 1e-6) & (np.arange(len(piece)) % 3 == 0)
    piece[worn], faces[worn] = 2, away.argmin(axis=1)[worn]
    write_places(mesh, True, piece, faces, np.full_like(weights, 1 / 3), image)
    count = len(mesh.vertices)
    transfer(knight.body, mage.body, kinds="uv")
    piece, faces, weights, _ = read_places(mesh)
    assert len(piece) > count and "were split along seams" in notice.words
    assert (faces < np.array([len(triangles) for triangles in centres])[piece]).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize(
    ("owner", "meshes", "name"),
    [
        ("Rig", ["Knight_Body", "Knight_Head"], "Knight"),
        ("Armature.001", ["Beta_Joints.001", "Beta_Surface.001"], "Beta.001"),
        ("Steve", ["Knight_Body", "Knight_Head"], "Steve"),
        ("Rig", ["Body", "Head"], "Rig"),
        ("Rig", ["HeroBody", "HeroHead"], "Rig"),
        ("Rig.001", ["Body.001", "Body.002"], "Rig.001"),
        ("Rig", ["Big Bad Wolf", "Big Bad Hat"], "Big Bad"),
    ],
)
def test_a_character_that_nobody_named_is_called_as_its_meshes_are(scene, owner, meshes, name):
    rig = bpy.data.objects.new(owner, None)
    bpy.context.collection.objects.link(rig)
    for each in meshes:
        new_object(each, *lumpy(3)).parent = rig
    assert rig.name == owner and characters.of(rig).name == name


@pytest.mark.parametrize(
    ("owner", "made_from", "meshes", "name"),
    [
        ("Mage Rig", "Rig.001", ["Mage_Body", "Mage_Head"], "Mage"),
        ("Mage Rig.002", "Rig", ["Mage_Body", "Mage_Head"], "Mage"),
        ("Bruno Mia", "Mia", ["Body", "Head"], "Bruno"),
        # Renamed since.
        ("Merlin", "Rig.001", ["Mage_Body", "Mage_Head"], "Merlin"),
    ],
)
def test_a_character_keeps_its_name_on_the_rig_that_came(scene, owner, made_from, meshes, name):
    rig = bpy.data.objects.new(owner, None)
    rig[characters.MADE_FROM] = made_from
    bpy.context.collection.objects.link(rig)
    for each in meshes:
        new_object(each, *lumpy(3)).parent = rig
    assert characters.of(rig).name == name


def test_a_collection_keeps_its_name_on_the_rig_that_came(scene):
    knight = character("Knight")
    mage = character("Mage", rigged=False, weights=False, moved=True)
    gather(scene, mage, "Stranger")
    store_copy(knight, mage)
    assert summary([mage.body], 1, False, 3).startswith("Matched 'Stranger' in ")
    transfer(knight.body, mage.body, kinds="groups,armature")
    assert mage.body.find_armature().name == "Stranger Knight"
    assert characters.of(mage.body).name == "Stranger"
