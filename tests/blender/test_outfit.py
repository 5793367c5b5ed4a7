# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit Outfit on copies of a character made by code, where it is known how the shirt has to sit."""

import json
from types import SimpleNamespace

import bpy
import figures
import numpy as np
import pytest
from bipeds import Figure, _known
from conftest import choose, new_object, turned
from mathutils import Matrix
from mathutils.bvhtree import BVHTree
from test_panel import drawn
from test_transfer import store_map, weights_of

from addon import character, command_line, mesh_read, mesh_write, notice, outfit_panel, pair, palette, remedy
from addon.mesh_write import HEAT, read_attribute, write_attribute
from addon.operators import show
from addon.operators.outfit import clothes_of
from addon.outfit import live, wardrobe

# Frames keep a thousandth of their ridge, over a body that is four high.
CLOSE = 4e-3


def known_map(source, target, old):
    """Store that each vertex of the target's body lies on that of the source that it is a copy of."""
    triangles = mesh_read.triangle_vertices(source.data)
    face, corner = np.empty((2, len(source.data.vertices)), int)
    for k in range(3):
        face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
    store_map(source, target, face[old], np.eye(3)[corner[old]])


@pytest.fixture
def dressed(scene, request):
    """A dressed character and its turned, renumbered copy without the shirt, with other names of bones.

    A parameter is how fine their meshes are.
    """
    cells = getattr(request, "param", 8)
    source = figures.character("Source", cells=cells)
    target = figures.character("Target", moved=True, cells=cells)
    bpy.data.objects.remove(target.shirt)
    for bone, name in (("Low", "Unten"), ("High", "Oben")):
        target.rig.data.bones[bone].name = name
    known_map(source.body, target.body, target.old["Body"])
    choose(source.body, target.body)
    bpy.context.view_layer.update()
    return source, target


def fit(**properties):
    assert bpy.ops.spectral_match.fit_outfit(**properties) == {"FINISHED"}


def copy_of(name):
    (found,) = [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") == name]
    return found


def places(obj, evaluated=False):
    """Coordinates in the world."""
    if not evaluated:
        points = mesh_read.positions(obj.data)
    else:
        shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        points = mesh_read.positions(shown.to_mesh())
    matrix = np.array(obj.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def group_names(obj):
    used = {entry.group for vertex in obj.data.vertices for entry in vertex.groups if entry.weight > 0.0}
    return {group.name for group in obj.vertex_groups if group.index in used}


def test_a_shirt_sits_on_a_copy_as_it_did_and_moves_with_its_rig(dressed):
    source, target = dressed
    assert [obj.name for obj in wardrobe.worn(wardrobe_of(source))] == [source.shirt.name]
    material = bpy.data.materials.new("Cloth")
    source.shirt.data.materials.append(material)
    fit()
    shirt = copy_of(source.shirt.name)
    np.testing.assert_allclose(places(shirt), turned(places(source.shirt)), atol=CLOSE)
    assert shirt.parent == target.rig and list(shirt.data.materials) == [material]
    assert [m.object for m in shirt.modifiers if m.type == "ARMATURE"] == [target.rig]
    assert shirt.data != source.shirt.data
    # Its own weights, for the bones that do the same.
    assert group_names(shirt) == {"Unten", "Oben"}
    renamed = {"Low": "Unten", "High": "Oben"}
    given = {(v, renamed[name]): w for (v, name), w in weights_of(source.shirt).items()}
    assert weights_of(shirt) == pytest.approx(given, abs=1e-6)
    figures.bend(source.rig)
    turn = turned(np.eye(3)) - turned(np.zeros((1, 3)))
    axes = np.array(target.rig.data.bones["Oben"].matrix_local)[:3, :3]
    given = np.array(source.rig.data.bones["High"].matrix_local)[:3, :3]
    basis = np.array(source.rig.pose.bones["High"].matrix_basis)[:3, :3]
    turning = turn.T @ given @ basis @ given.T @ turn
    target.rig.pose.bones["Oben"].matrix_basis = Matrix((axes.T @ turning @ axes).tolist()).to_4x4()
    bpy.context.view_layer.update()
    np.testing.assert_allclose(
        places(shirt, evaluated=True), turned(places(source.shirt, evaluated=True)), atol=2 * CLOSE
    )


def test_a_doubtful_match_names_what_is_worn_and_one_press_leaves_it_out(scene, monkeypatch):
    source, target = figures.character("Source"), figures.character("Target", moved=True)
    choose(source.body, target.body)
    bpy.context.view_layer.update()
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert target.body.data.spectral_match.grade == "green" and "worn" not in notice.words
    write = mesh_write.write_match

    def doubted(sources, targets, *given):
        write(sources, targets, *given)
        for obj in targets:
            obj.data.spectral_match.grade = "amber"

    monkeypatch.setattr(mesh_write, "write_match", doubted)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    names = f"{source.shirt.name}, {target.shirt.name}"
    assert notice.words == f"What is worn may mislead the match: {names}"
    assert remedy.remedies(notice.words) == ((remedy.BARE, ""),)
    assert bpy.ops.spectral_match.match(**dict(remedy.BARE.properties)) == {"FINISHED"}
    assert "worn" not in notice.words
    for each in (source, target):
        assert each.shirt.spectral_match_part == character.LEFT_OUT
        assert each.shirt not in character.of(each.body).pieces
    assert pair.has_match(target.body) and not pair.has_match(target.shirt)


def test_a_rig_goes_by_the_body_more_than_by_what_is_worn(scene):
    """The target's shirt is drawn aside, which leans a bone that goes by both."""
    source, target = figures.character("Source"), figures.character("Target", moved=True)
    choose(source.body, target.body)
    bpy.context.view_layer.update()
    assert bpy.ops.spectral_match.match() == {"FINISHED"}

    def high():
        assert bpy.ops.spectral_match.transfer(kinds="groups,armature") == {"FINISHED"}
        return np.array(target.body.find_armature().data.bones["High"].vector)

    upright, points = high(), mesh_read.positions(target.shirt.data).copy()
    points[:, 0] += points[:, 2] - points[:, 2].min()
    target.shirt.data.vertices.foreach_set("co", points.ravel())
    target.shirt.data.update()
    leans = []
    for word in (wardrobe.NOT_WORN, wardrobe.WORN):
        target.shirt.spectral_match_worn = word
        along = high()
        cosine = upright @ along / np.linalg.norm(upright) / np.linalg.norm(along)
        leans.append(np.degrees(np.arccos(min(cosine, 1.0))))
    # A tenth of its confidence counts, beside what the body says.
    assert leans[0] > 5.0 and leans[1] < leans[0] / 2.0


def wardrobe_of(made):
    return character.of(made.body)


def test_what_the_match_leaves_out_is_worn_while_it_is_seen(dressed):
    source, _ = dressed
    source.shirt.spectral_match_part = character.LEFT_OUT
    worn = wardrobe_of(source)
    assert worn.left_out == (source.shirt,) and wardrobe.worn(worn) == [source.shirt]
    fit()
    assert len(copy_of(source.shirt.name).data.vertices) == len(source.shirt.data.vertices)
    source.shirt.hide_set(True)
    assert wardrobe.worn(wardrobe_of(source)) == []


def test_cloth_without_groups_takes_those_of_the_body_under_it(dressed):
    source, target = dressed
    source.shirt.vertex_groups.clear()
    fit()
    shirt = copy_of(source.shirt.name)
    points = figures.meshes()["Shirt"][0]
    rows = [sum(entry.weight for entry in vertex.groups) for vertex in shirt.data.vertices]
    np.testing.assert_allclose(rows, 1.0, atol=1e-5)
    # By which share the body's nearest skin follows the lower bone; the bend lies between vertices.
    low = np.array([weights_of(shirt).get((v, "Unten"), 0.0) for v in range(len(points))])
    np.testing.assert_allclose(low, figures.low_share(points), atol=0.06)


def test_bones_that_the_target_lacks_come_along_with_what_follows_them(dressed):
    source, target = dressed
    bpy.context.view_layer.objects.active = source.rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, parent, ends in (
        ("Root", "Low", ((0, 0, -0.5), (0, 0, -0.7))),
        ("Hem", "Root", ((0, 0, -0.7), (0, 0.1, -0.9))),
    ):
        made = source.rig.data.edit_bones.new(name)
        made.head, made.tail = ends
        made.parent = source.rig.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    source.shirt.vertex_groups.new(name="Hem").add(range(10), 0.5, "REPLACE")
    limit = source.rig.pose.bones["Hem"].constraints.new("COPY_ROTATION")
    limit.target, limit.subtarget = source.rig, "High"
    curve = source.rig.pose.bones["Hem"].driver_add("location", 0)
    seen = curve.driver.variables.new()
    seen.type = "TRANSFORMS"
    seen.targets[0].id, seen.targets[0].bone_target = source.rig, "Low"
    choose(source.body, target.body)
    for _ in range(2):
        fit()
    bones = target.rig.data.bones
    assert set(bones.keys()) == {"Unten", "Oben", "Root", "Hem"}
    assert bones["Root"].parent == bones["Unten"] and bones["Hem"].parent == bones["Root"]
    for name in ("Root", "Hem"):
        given = source.rig.data.bones[name]
        ends = np.array([given.head_local, given.tail_local])
        np.testing.assert_allclose(
            np.array([bones[name].head_local, bones[name].tail_local]), turned(ends), atol=2 * CLOSE
        )
    (constraint,) = target.rig.pose.bones["Hem"].constraints
    assert (constraint.target, constraint.subtarget) == (target.rig, "Oben")
    (driver,) = target.rig.animation_data.drivers
    seen = driver.driver.variables[0].targets[0]
    assert (driver.data_path, seen.id, seen.bone_target) == (
        'pose.bones["Hem"].location',
        target.rig,
        "Unten",
    )
    assert "Hem" in group_names(copy_of(source.shirt.name))


def test_shape_keys_of_the_shirt_and_of_the_body_are_there(dressed):
    source, target = dressed
    source.shirt.shape_key_add(name="Basis")
    puff = source.shirt.shape_key_add(name="Puff")
    for entry in puff.data:
        entry.co.x += 0.1
    target.body.shape_key_add(name="Basis")
    for name, moved in (("Fat", slice(None)), ("Nose", None)):
        key = target.body.shape_key_add(name=name)
        points = np.array([entry.co for entry in key.data])
        heights = figures.meshes()["Body"][0][target.old["Body"], 2]
        chosen = np.arange(len(points)) if moved else np.flatnonzero(heights > 1.0)
        for vertex in chosen.tolist():
            key.data[vertex].co.y += 0.2
    # A shape key does not change the mesh, but a match notices when its coordinates are other ones.
    known_map(source.body, target.body, target.old["Body"])
    fit()
    shirt = copy_of(source.shirt.name)
    blocks = shirt.data.shape_keys.key_blocks
    assert set(blocks.keys()) == {"Basis", "Puff", "Fat"}

    def moved(name):
        values = [np.empty(len(shirt.data.vertices) * 3, np.float32) for _ in range(2)]
        for block, each in zip(("Basis", name), values, strict=True):
            blocks[block].data.foreach_get("co", each)
        return (values[1] - values[0]).reshape(-1, 3)

    way = (turned(np.array([[0.1, 0.0, 0.0]])) - turned(np.zeros((1, 3))))[0]
    np.testing.assert_allclose(moved("Puff"), np.tile(way, (len(moved("Puff")), 1)), atol=1e-3)
    np.testing.assert_allclose(moved("Fat"), np.tile((0.0, 0.2, 0.0), (len(moved("Fat")), 1)), atol=1e-5)
    before = places(shirt, evaluated=True)
    target.body.data.shape_keys.key_blocks["Fat"].value = 0.5
    bpy.context.view_layer.update()
    np.testing.assert_allclose(places(shirt, evaluated=True) - before, moved("Fat") / 2.0, atol=1e-5)


def test_drivers_of_the_shirts_keys_look_at_the_target(dressed):
    source, target = dressed
    source.body.shape_key_add(name="Basis")
    source.body.shape_key_add(name="Breath")
    known_map(source.body, target.body, target.old["Body"])
    source.shirt.shape_key_add(name="Basis")
    for name, path in (("Bent", ""), ("Lost", 'key_blocks["Breath"].value')):
        block = source.shirt.shape_key_add(name=name)
        for entry in block.data:
            entry.co.x += 0.1
        variable = block.driver_add("value").driver.variables.new()
        variable.type = "SINGLE_PROP" if path else "TRANSFORMS"
        seen = variable.targets[0]
        if path:
            seen.id_type = "KEY"
            seen.id, seen.data_path = source.body.data.shape_keys, path
        else:
            seen.id, seen.bone_target, seen.transform_type = source.rig, "High", "ROT_X"
    fit()
    keys = copy_of(source.shirt.name).data.shape_keys
    (curve,) = keys.animation_data.drivers
    seen = curve.driver.variables[0].targets[0]
    assert (curve.data_path, seen.id, seen.bone_target) == ('key_blocks["Bent"].value', target.rig, "Oben")
    # The target has no such key: the driver is left, and said.
    assert "Lost" in keys.key_blocks and 'key_blocks["Lost"]' in notice.words
    assert len(source.shirt.data.shape_keys.animation_data.drivers) == 2


def test_sliders_move_a_fitted_shirt_and_keep_its_keys(dressed):
    source, target = dressed
    settings = bpy.context.scene.spectral_match
    source.shirt.shape_key_add(name="Basis")
    for entry in source.shirt.shape_key_add(name="Puff").data:
        entry.co.x += 0.1
    fit()
    shirt = copy_of(source.shirt.name)
    first = places(shirt)
    settings.outfit_distance = 0.05
    further = places(shirt)
    # Cloth at a distance of a tenth of its reach follows by all but a hundredth.
    np.testing.assert_allclose(np.linalg.norm(further - first, axis=1), 0.05, rtol=0.1)
    blocks = shirt.data.shape_keys.key_blocks
    offset = np.array(blocks["Puff"].data[0].co) - np.array(blocks["Basis"].data[0].co)
    assert np.linalg.norm(offset) == pytest.approx(0.1, rel=0.02)
    settings.outfit_distance = 0.0
    np.testing.assert_allclose(places(shirt), first, atol=1e-6)
    settings.outfit_tightness = 1.0
    tight = places(shirt)
    assert np.linalg.norm(tight - first, axis=1).max() < 1.1 * figures.OFF
    assert np.linalg.norm(tight - first, axis=1).mean() > 0.3 * figures.OFF
    live.forget()
    settings.outfit_tightness = 0.0
    np.testing.assert_array_equal(places(shirt), tight)


def test_a_closer_look_tells_what_is_inside(dressed):
    source, target = dressed
    with pytest.raises(RuntimeError, match="Press Fit Outfit first"):
        bpy.ops.spectral_match.closer_look()
    fit()
    shirt = copy_of(source.shirt.name)
    pushed = slice(0, 10)
    for vertex in shirt.data.vertices[pushed]:
        vertex.co -= 3.0 * figures.OFF * vertex.normal
    assert bpy.ops.spectral_match.closer_look() == {"FINISHED"}

    def heat():
        return read_attribute(shirt.data.attributes[HEAT])

    sure, inside = palette.heat_colours(np.array([1.0, 0.0]))
    np.testing.assert_allclose(heat()[pushed], np.tile(inside, (10, 1)), atol=1e-6)
    np.testing.assert_allclose(heat()[10:], np.tile(sure, (len(heat()) - 10, 1)), atol=1e-6)
    assert shirt.data.color_attributes.active_color.name == HEAT
    # Nor is there a default, which would be shown then; the source is as plain.
    for body in (source.body, target.body):
        assert body.data.color_attributes.active_color is None
        assert not body.data.attributes.default_color_name
    # The sliders put all vertices where they should be.
    bpy.context.scene.spectral_match.outfit_distance = 0.02
    np.testing.assert_allclose(heat(), np.tile(sure, (len(heat()), 1)), atol=1e-6)
    assert bpy.ops.spectral_match.closer_look() == {"FINISHED"}
    assert HEAT not in shirt.data.attributes


def test_the_panel_says_what_was_fitted_and_what_is_in_the_way(dressed, monkeypatch):
    source, target = dressed
    monkeypatch.setattr("addon.drawing.wrapped", lambda text, _fits: [text])
    points, faces = figures.meshes()["Shirt"]
    scarf = new_object("Scarf", turned(points), faces)
    scarf.parent, scarf.matrix_world = target.rig, target.body.matrix_world
    scarf.spectral_match_part, scarf.spectral_match_worn = "LEFT_OUT", wardrobe.WORN
    # What is elsewhere is in nobody's way.
    ring = new_object("Ring", turned(0.3 * points), faces)
    ring.parent, ring.matrix_world = target.rig, target.body.matrix_world
    ring.spectral_match_part, ring.spectral_match_worn = "LEFT_OUT", wardrobe.WORN
    bpy.context.view_layer.update()

    def words():
        return {words for words, _ in drawn(outfit_panel.VIEW3D_PT_spectral_match_outfit)}

    assert "Done: 1 garment" not in words()
    fit()
    in_the_way = "'Target' wears clothes of its own there. Hide what is in the way:"
    assert {"Done: 1 garment", "Nothing is inside the body", in_the_way} <= words()
    outfits = outfit_panel.VIEW3D_PT_spectral_match_outfit
    assert [name for name, _ in drawn(outfits)].count("spectral_match.hide_worn") == 1
    (copies,) = (copies for _, copies in live.kept_on(pair.resolve(bpy.context).targets))
    assert wardrobe.replaced(character.of(target.body), copies) == [scarf]
    bpy.ops.ed.undo_push(message="Fit Outfit")
    before = drawn(outfits)
    for hidden in (True, False, True):
        assert bpy.ops.spectral_match.hide_worn(name=scarf.name) == {"FINISHED"}
        # The button stays where it is, so that a second press on it is no other one's.
        assert drawn(outfits) == before
        assert scarf.hide_get() == scarf.hide_render == hidden
    # What the artist hides is none of the panel's.
    ring.hide_set(True)
    assert drawn(outfits) == before
    ring.hide_set(False)
    bpy.ops.ed.undo_push(message="Hide")
    bpy.ops.ed.undo()
    scarf = bpy.data.objects["Scarf"]
    assert not scarf.hide_get() and not scarf.hide_render
    assert {in_the_way, "spectral_match.hide_worn"} <= words()


@pytest.mark.parametrize("dressed", [20], indirect=True)
def test_hidden_skin_is_masked_and_nothing_is_deleted(dressed):
    source, target = dressed
    count = len(target.body.data.vertices)
    bpy.context.scene.spectral_match.outfit_hide = True
    for _ in range(2):
        fit()
    (mask,) = [m for m in target.body.modifiers if m.type == "MASK"]
    assert mask.invert_vertex_group and mask.vertex_group == "Hidden by Source"
    hidden = {vertex for vertex, name in weights_of(target.body) if name == mask.vertex_group}
    heights = figures.meshes(20)["Body"][0][target.old["Body"], 2]
    assert len(target.body.data.vertices) == count and hidden
    inside = (heights > figures.SHIRT_FROM) & (heights < figures.SHIRT_TO)
    assert inside[list(hidden)].all()


@pytest.mark.parametrize("dressed", [20], indirect=True)
@pytest.mark.parametrize("distance", [0.0, 0.03])
def test_skin_that_is_seen_stays(dressed, distance):
    """Into wide openings one sees far, and a face goes as a whole: what is gone is seen from nowhere."""
    source, target = dressed
    settings = bpy.context.scene.spectral_match
    settings.outfit_hide, settings.outfit_distance = True, distance
    fit()
    shirt, mesh = copy_of(source.shirt.name), target.body.data
    group = next(m.vertex_group for m in target.body.modifiers if m.type == "MASK")
    gone = {vertex for vertex, name in weights_of(target.body) if name == group}
    skin, cloth = places(target.body), places(shirt)
    triangles = [mesh_read.triangle_vertices(each) for each in (mesh, shirt.data)]
    tree = BVHTree.FromPolygons(
        np.concatenate([skin, cloth]).tolist(),
        np.concatenate([triangles[0], triangles[1] + len(skin)]).tolist(),
        all_triangles=True,
    )
    sides = np.random.default_rng(3).normal(size=(100, 3))
    turn = np.array(target.body.matrix_world.to_3x3())
    faces = [face for face in mesh.polygons if gone.intersection(face.vertices)]
    assert len(faces) > 20
    for face in faces:
        facing = turn @ face.normal
        start = skin[list(face.vertices)].mean(axis=0) + 0.01 * facing
        outward = sides[sides @ facing > 0.0]
        seen = [tree.ray_cast(start.tolist(), side.tolist())[0] is None for side in outward]
        # Between the sides that were looked from there are others.
        assert np.mean(seen) < 0.1


def test_originals_stay_and_a_second_press_fits_again(dressed):
    source, target = dressed
    before = {obj.name: (places(obj).tolist(), weights_of(obj)) for obj in (*source.pieces, target.body)}
    groups = {obj.name: obj.vertex_groups.keys() for obj in (*source.pieces, target.body)}
    fit()
    shirt, count = copy_of(source.shirt.name), len(bpy.data.meshes)
    shirt.name = "Mine"
    fit()
    assert copy_of(source.shirt.name) == shirt and len(bpy.data.meshes) == count
    for obj in (*source.pieces, target.body):
        assert (places(obj).tolist(), weights_of(obj)) == before[obj.name]
        assert obj.vertex_groups.keys() == groups[obj.name]


def test_characters_are_shown_as_they_are_once_dressed(dressed, monkeypatch):
    source, target = dressed
    asked = []
    monkeypatch.setattr(show, "show_nothing", lambda _context, *objects: asked.append(objects))
    fit()
    assert asked == [([source.body], [target.body])]


def test_undo_takes_an_outfit_back(dressed):
    source, target = dressed
    names = set(bpy.data.objects.keys())
    bpy.ops.ed.undo_push(message="Before")
    fit()
    bpy.ops.ed.undo_push(message="Fit Outfit")
    assert set(bpy.data.objects.keys()) != names
    bpy.ops.ed.undo()
    assert set(bpy.data.objects.keys()) == names


def test_a_match_made_with_the_shirt_on_leads_to_the_skin_under_it(dressed):
    source, target = dressed
    fit()
    wanted = places(copy_of(source.shirt.name))
    # Images under the shirt are on the shirt, as a match of whole characters finds them.
    shirt = mesh_read.positions(source.shirt.data).astype(float)
    body = mesh_read.positions(source.body.data).astype(float)[target.old["Body"]]
    apart = np.linalg.norm(body[:, None] - shirt[None], axis=2)
    under = apart.min(axis=1) < 1.01 * figures.OFF
    triangles = mesh_read.triangle_vertices(source.shirt.data)
    face, corner = np.empty((2, len(shirt)), int)
    for k in range(3):
        face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
    nearest = apart.argmin(axis=1)
    mesh = target.body.data
    faces = np.empty(len(body), np.int32)
    weights = np.empty(len(body) * 3, np.float32)
    mesh.attributes["match_face"].data.foreach_get("value", faces)
    mesh.attributes["match_barycentric"].data.foreach_get("vector", weights)
    weights = weights.reshape(-1, 3)
    faces[under], weights[under] = face[nearest[under]], np.eye(3)[corner[nearest[under]]]
    write_attribute(mesh, "match_face", "INT", "POINT", faces)
    write_attribute(mesh, "match_barycentric", "FLOAT_VECTOR", "POINT", weights)
    write_attribute(mesh, "match_piece", "INT", "POINT", under.astype(np.int32))
    for piece in (source.body, source.shirt):
        kept = target.body.spectral_match_pieces.add()
        kept.object, kept.name = piece, piece.name
        kept.fingerprint = str(mesh_read.fingerprint(piece.data))
    fit()
    # The skin under a place of the cloth is found up to the angle between skin and cloth.
    np.testing.assert_allclose(places(copy_of(source.shirt.name)), wanted, atol=0.03)


def test_boxes_decide_what_is_fitted(dressed):
    source, target = dressed
    for piece in (source.eye, source.shirt):
        assert bpy.ops.spectral_match.toggle_worn(garment=piece.name) == {"FINISHED"}
    fit()
    eye = copy_of(source.eye.name)
    assert eye.parent_type == "BONE" and eye.parent_bone == "Oben" and eye.parent == target.rig
    bpy.context.view_layer.update()
    np.testing.assert_allclose(places(eye), turned(places(source.eye)), atol=0.02)
    assert not [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") == source.shirt.name]


def test_the_panel_keeps_what_it_found_until_a_box_is_pressed(dressed, monkeypatch):
    source, _ = dressed
    asked = []
    real = wardrobe.others
    monkeypatch.setattr(wardrobe, "others", lambda body: asked.append(body) or real(body))
    found = pair.resolve(bpy.context)
    for worn in (True, False, True):
        for _ in range(2):
            assert (source.shirt in clothes_of(found).worn) == worn
        assert bpy.ops.spectral_match.toggle_worn(garment=source.shirt.name) == {"FINISHED"}
    assert len(asked) == 3
    assert (
        clothes_of(pair.resolve(bpy.context)).worn == wardrobe.worn(wardrobe_of(source)) and len(asked) == 4
    )


def test_the_panel_follows_what_is_hidden(dressed, monkeypatch):
    """A piece that is unticked for the match is worn while it is seen, also in what a window keeps."""
    source, _ = dressed
    source.shirt.spectral_match_part = "LEFT_OUT"
    monkeypatch.setattr(pair, "KEPT_SECONDS", float("inf"))
    window = SimpleNamespace(
        app=SimpleNamespace(background=False), types=bpy.types, context=bpy.context, data=bpy.data
    )
    monkeypatch.setattr(pair, "bpy", window)
    collection = bpy.data.collections.new("Clothes")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(source.shirt)
    bpy.context.collection.objects.unlink(source.shirt)
    layer = bpy.context.view_layer.layer_collection.children["Clothes"]
    bpy.context.view_layer.update()

    def worn():
        return source.shirt in clothes_of(pair.shown(bpy.context)).worn

    assert worn()
    for held in (source.shirt, layer, collection):
        for hidden in (True, False):
            held.hide_viewport = hidden
            bpy.context.view_layer.update()
            assert worn() == (not hidden), held
    for hidden in (True, False):
        source.shirt.hide_set(hidden)
        bpy.context.view_layer.update()
        assert worn() == (not hidden)


def test_the_list_of_clothes_begins_with_what_is_worn(dressed):
    """It stays as it is when boxes are pressed, and All and None mean what the search finds."""
    source, _ = dressed
    panel = bpy.context.window_manager.spectral_match_panel

    def listed():
        clothes = clothes_of(pair.resolve(bpy.context))
        return [obj.name for obj in clothes.others], {obj.name for obj in clothes.worn}

    names, worn = listed()
    assert names[0] == source.shirt.name and worn == {names[0]} and len(names) > 1
    assert bpy.ops.spectral_match.toggle_worn(garment=names[0]) == {"FINISHED"}
    assert listed() == (names, set())
    assert bpy.ops.spectral_match.choose_worn(take=True) == {"FINISHED"}
    assert listed() == (names, set(names))
    panel.worn_search = names[-1].upper()
    assert bpy.ops.spectral_match.choose_worn(take=False) == {"FINISHED"}
    panel.worn_search = ""
    assert listed() == (names, set(names[:-1]))


def test_what_is_worn_lies_over_what_the_same_bones_move(scene):
    made = figures.character("Source")
    points, faces = figures.lumpy(6)
    # An arm beside the body, a glove over it, and a thumb off its end, half of which faces as the arm does.
    arm = new_object("Arm", 0.3 * points + (1.3, 0.0, 0.0), faces)
    glove = new_object("Glove", 0.34 * points + (1.3, 0.0, 0.0), faces)
    end = 0.36 * points[points[:, 0].argmax()] + (1.3, 0.0, 0.0)
    thumb = new_object("Thumb", (0.25, 0.1, 0.1) * points + end + (0.1, 0.0, 0.0), faces)
    for obj in (arm, glove, thumb):
        obj.vertex_groups.new(name="Hand").add(range(len(points)), 1.0, "REPLACE")
        obj.modifiers.new("Rig", "ARMATURE").object = made.rig
        obj.parent = made.rig
    bpy.context.view_layer.update()
    body = wardrobe_of(made)
    added = {"Arm", "Glove", "Thumb"}
    assert {obj.name for obj in body.whole} == {"Source Body", "Source Shirt", "Source Eye"} | added
    assert {obj.name for obj in wardrobe.worn(body)} == {"Source Shirt", "Glove"}
    assert wardrobe.body_of(body) == made.body
    glove.hide_viewport = True
    assert [obj.name for obj in wardrobe.worn(wardrobe_of(made))] == ["Source Shirt"]


def test_of_a_body_in_parts_the_trunk_is_the_body(scene):
    points, faces = figures.lumpy(6)
    made = figures.character("Source")
    for obj in (made.body, made.shirt, made.eye):
        bpy.data.objects.remove(obj)
    parts = {"Arm": (0.4, (1.5, 0.0, 0.0), 5), "Trunk": (1.0, (0.0, 0.0, 0.0), 3)}
    for name, (size, place, bones) in parts.items():
        obj = new_object(name, size * points + place, faces)
        for number in range(bones):
            obj.vertex_groups.new(name=f"{name} {number}").add(range(len(points)), 1.0 / bones, "REPLACE")
        obj.modifiers.new("Rig", "ARMATURE").object = obj.parent = made.rig
    bpy.context.view_layer.update()
    body = character.of(bpy.data.objects["Arm"])
    assert wardrobe.body_of(body).name == "Trunk"
    assert [obj.name for obj in wardrobe.others(body)] == ["Arm"]


def test_skin_does_not_lie_over_the_lining_around_it(scene):
    points, faces = figures.lumpy(6)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(rig)
    # A body that ends at its waist, in a sack of a sheet that faces outward and a lining that faces inward.
    low = [face for face in faces if points[list(face), 2].mean() < 0.5 * points[:, 2].max()]
    used = np.unique(np.concatenate(low))
    body = new_object("Body", points[used], [np.searchsorted(used, face).tolist() for face in low])
    lining = [[corner + len(points) for corner in face[::-1]] for face in faces]
    sack = new_object("Sack", np.concatenate([1.12 * points, 1.06 * points]), [*faces, *lining])
    for obj in (body, sack):
        obj.parent = rig
    bpy.context.view_layer.update()
    assert wardrobe.worn(character.of(body)) == [sack]


def test_what_cannot_be_fitted_is_said_and_changes_nothing(dressed):
    source, target = dressed
    names = set(bpy.data.objects.keys())

    def refused(words):
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.spectral_match.fit_outfit()
        assert set(bpy.data.objects.keys()) == names

    with pytest.raises(RuntimeError, match="does not have Coat"):
        bpy.ops.spectral_match.fit_outfit(garments="Coat")
    source.shirt.spectral_match_worn = wardrobe.NOT_WORN
    refused("Nothing that 'Source' wears is checked")
    assert "checked" in notice.words
    source.shirt.spectral_match_worn = wardrobe.AUTOMATIC
    target.body.data.vertices.add(1)
    refused("Match again")


def dress(source, rig, layers=("Suit", "Coat")):
    """Clothes of a biped with a rig, cut from its skin and moved off it."""
    made, found = source.made, []
    normals = np.array([vertex.normal for vertex in source.obj.data.vertices])
    names = list(made.body.names)
    moving = np.array(names)[made.weights.argmax(axis=1)]
    for name, off, parts in (
        ("Suit", 0.006, ("hips", "chest", "thigh", "upper_arm", "shin")),
        ("Coat", 0.02, ("hips", "chest", "upper_arm")),
    ):
        if name not in layers:
            continue
        chosen = np.array([bone.startswith(parts) for bone in moving])
        faces = made.faces[chosen[made.faces].all(axis=1)]
        used, number = np.unique(faces, return_inverse=True)
        points = source.size * (made.vertices + off * normals)[used]
        obj = new_object(name, points, number.reshape(faces.shape).tolist())
        for bone, column in zip(names, made.weights.T, strict=True):
            group = obj.vertex_groups.new(name=bone)
            for vertex, weight in enumerate(column[used].tolist()):
                if weight > 0.0:
                    group.add([vertex], weight, "REPLACE")
        obj.modifiers.new("Rig", "ARMATURE").object = rig
        obj.parent, obj.matrix_parent_inverse = rig, rig.matrix_world.inverted()
        found.append(obj)
    bpy.context.view_layer.update()
    return found


def test_a_body_of_another_build_is_left_by_cloth_of_every_layer(scene):
    """A suit and a coat over it go to a wider body in another pose."""
    source, target = Figure("Source"), Figure("Target", build="stout", pose="A", seed=3)
    rig_1, rig_2 = source.rigged(), target.rigged()
    layers = dress(source, rig_1)
    target.store_known(source)
    choose(source.obj, target.obj)
    fit()
    copies = [copy_of(obj.name) for obj in layers]
    ((fitted, _),) = live.kept_for([target.obj])
    assert fitted.inside == 0
    for own in copies:
        assert [m.object for m in own.modifiers if m.type == "ARMATURE"] == [rig_2]
        assert group_names(own) <= set(rig_2.data.bones.keys())
    above = fitted.fitting.clearance(fitted.places)
    suit, coat = (above[garment.vertices] for garment in fitted.wish.garments)
    assert suit.min() > 0.0 and coat.min() > 0.0
    assert coat.mean() > suit.mean()


def pose(rig, turns):
    for name, angle in turns.items():
        rig.pose.bones[name].matrix_basis = Matrix.Rotation(angle, 4, "Z")
    bpy.context.view_layer.update()


WALKING = {"thigh.L": 0.5, "thigh.R": -0.4, "upper_arm.L": 0.5, "upper_arm.R": -0.4, "chest": 0.3}
SITTING = {"thigh.L": 0.9, "thigh.R": 0.9, "forearm.L": 0.8, "chest": -0.2}
REST = dict.fromkeys(WALKING | SITTING, 0.0)


def test_an_outfit_without_a_body_goes_by_what_it_covers(scene):
    source, target = Figure("Source"), Figure("Target", build="stout", pose="A", seed=3)
    rig = source.rigged()
    target.rigged()
    (suit,) = dress(source, rig, ("Suit",))
    skin = places(source.obj)[source.made.faces]
    bpy.data.objects.remove(source.obj)
    bpy.context.view_layer.update()
    choose(suit, target.obj)
    # Where each vertex of the target lies on the body that was there, and the cloth over that.
    faces, weights = _known(source.key, target.key)
    images = np.einsum("ij,ijc->ic", weights, skin[faces])
    cloth = places(suit)
    triangles = mesh_read.triangle_vertices(suit.data)
    tree = BVHTree.FromPolygons(cloth.tolist(), triangles.tolist(), all_triangles=True)
    hits = [tree.find_nearest(image) for image in images.tolist()]
    solved = [
        np.linalg.lstsq(np.vstack([cloth[triangles[hit[2]]].T, np.ones(3)]), [*hit[0], 1.0], rcond=None)[0]
        for hit in hits
    ]
    shares = np.clip(solved, 0.0, None)
    store_map(suit, target.obj, np.array([hit[2] for hit in hits]), shares / shares.sum(axis=1)[:, None])
    covered = np.array([hit[3] for hit in hits]) < 0.02
    write_attribute(target.obj.data, "match_confidence", "FLOAT", "POINT", covered.astype(np.float32))
    with pytest.raises(RuntimeError, match="is one mesh"):
        bpy.ops.spectral_match.fit_outfit()
    assert wardrobe.others(character.of(suit)) == [suit]
    assert bpy.ops.spectral_match.toggle_worn(garment=suit.name) == {"FINISHED"}
    fit()
    assert "has no body" in notice.words
    own = copy_of(suit.name)
    heights = above(target, own)
    # It lies on the skin as near as cloth is let.
    assert heights.min() > 0.0 and np.median(heights) < 0.01
    assert group_names(own) <= set(bpy.data.objects["Target"].modifiers["Rig"].object.data.bones.keys())


def above(target, own):
    """Signed distances of an object's vertices, as they are shown, to a figure's skin as it is shown."""
    tree = BVHTree.FromPolygons(places(target.obj, True).tolist(), target.made.faces.tolist())
    points = places(own, True)
    hits = [tree.find_nearest(point) for point in points.tolist()]
    return np.array([(point - hit[0]) @ hit[1] for point, hit in zip(points, hits, strict=True)])


def test_poses_in_which_characters_are_dressed_do_not_matter(scene):
    """Both walk or sit when they are fitted, and even when they are matched as shown."""
    source, target = Figure("Source"), Figure("Target", build="stout", pose="A", seed=3)
    rigs = source.rigged(), target.rigged()
    (suit,) = dress(source, rigs[0], ("Suit",))
    target.store_known(source)
    choose(source.obj, target.obj)
    fit()
    own = copy_of(suit.name)
    wanted = places(own)
    pose(rigs[0], WALKING)
    pose(rigs[1], SITTING)
    fit()
    np.testing.assert_array_equal(places(own), wanted)
    scene.spectral_match.shape = "EVALUATED"
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    fit()
    # A found map slides along the limbs by a few hundredths of the figure's height, which is 1.8.
    assert np.linalg.norm(places(own) - wanted, axis=1).mean() < 0.05 * 1.8
    pose(rigs[1], REST)
    assert above(target, own).min() > 0.0
    for turns in (WALKING, SITTING):
        pose(rigs[1], REST | turns)
        # Cloth keeps the source's weights: at the joints it bends otherwise than the skin.
        heights = above(target, own)
        assert (heights > 0.0).mean() > 0.9 and abs(np.median(heights)) < 0.03


@pytest.mark.parametrize(("scale", "y_up"), [(0.01, False), (1.0, True), (100.0, True)])
def test_units_and_axes_of_rigs_do_not_matter(scene, scale, y_up):
    source, target = Figure("Source"), Figure("Target", size=2.5)
    rig_1, rig_2 = source.rigged(), target.rigged(scale, y_up)
    (suit,) = dress(source, rig_1, ("Suit",))
    target.store_known(source)
    choose(source.obj, target.obj)
    fit()
    own = copy_of("Suit")
    # A larger copy of itself: the least distance to the skin, a thousandth of the height, is kept besides.
    np.testing.assert_allclose(places(own), 2.5 * places(suit), atol=2.5 * 4e-3)
    rig_2.pose.bones["chest"].matrix_basis = Matrix.Rotation(0.4, 4, "Z")
    rig_1.pose.bones["chest"].matrix_basis = Matrix.Rotation(0.4, 4, "Z")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(places(own, True), 2.5 * places(suit, True), atol=2.5 * 6e-3)


def test_targets_without_a_rig_get_the_outfit_as_their_child(scene):
    source = figures.character("Source")
    targets = [figures.character(name, moved=True, rigged=False) for name in ("One", "Two")]
    for target in targets:
        bpy.data.objects.remove(target.shirt)
        known_map(source.body, target.body, target.old["Body"])
    targets[1].body.location.x = 7.0
    scene.spectral_match.whole_characters = False
    choose(source.body, *(target.body for target in targets))
    fit()
    copies = [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") == source.shirt.name]
    assert {obj.parent for obj in copies} == {target.body for target in targets}
    for obj in copies:
        assert not [m for m in obj.modifiers if m.type == "ARMATURE"]
        shift = np.array(obj.parent.location)
        np.testing.assert_allclose(places(obj), turned(places(source.shirt)) + shift, atol=CLOSE)


def test_a_linked_rig_takes_no_bones_and_cloth_follows_the_bone_above(dressed, tmp_path):
    source, target = dressed
    bpy.context.view_layer.objects.active = source.rig
    bpy.ops.object.mode_set(mode="EDIT")
    made = source.rig.data.edit_bones.new("Hem")
    made.head, made.tail, made.parent = (0, 0, -0.7), (0, 0.1, -0.9), source.rig.data.edit_bones["Low"]
    bpy.ops.object.mode_set(mode="OBJECT")
    source.shirt.vertex_groups.new(name="Hem").add(range(10), 0.5, "REPLACE")
    file = tmp_path / "rig.blend"
    bpy.data.libraries.write(str(file), {target.rig}, fake_user=True)
    with bpy.data.libraries.load(str(file), link=True) as (there, here):
        here.objects = there.objects[:1]
    linked = here.objects[0]
    bpy.context.collection.objects.link(linked)
    for obj in (target.body, target.eye):
        obj.parent = None
    target.body.modifiers["Rig"].object = linked
    bpy.data.objects.remove(target.rig)
    scene = bpy.context.scene
    scene.spectral_match.whole_characters = False
    choose(source.body, target.body)
    fit()
    assert set(linked.data.bones.keys()) == {"Unten", "Oben"} and "takes no bones" in notice.words
    assert group_names(copy_of(source.shirt.name)) == {"Unten", "Oben"}


def test_the_command_line_fits_outfits(dressed, tmp_path):
    source, target = dressed
    report, output = tmp_path / "report.json", tmp_path / "out.blend"
    words = ["transfer", "--source", source.body.name, "--target", target.body.name, "--transfer", "outfit"]
    assert command_line.run([*words, "--output", str(output), "--json", str(report)]) == 0
    (pair,) = json.loads(report.read_text())["files"][0]["pairs"]
    assert pair["outfit"].startswith("Fitted 1 garment to ") and pair["transferred"] == ["outfit"]
    bpy.ops.wm.open_mainfile(filepath=str(output))
    shirt = copy_of("Source Shirt")
    np.testing.assert_allclose(places(shirt), turned(places(bpy.data.objects["Source Shirt"])), atol=CLOSE)
