# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps and materials of the target stay; those of the source come beside them, and overlap is told of."""

import bpy
import numpy as np
import pytest
from conftest import choose, lumpy, new_object
from test_textures import FINER, SAME, Body, shown
from test_transfer import store_identity, store_map, store_nearest, transfer
from test_transfer_kinds import photo

from addon import notice, remedy, wording
from addon.mesh_write import read_attribute
from addon.transfer import unwrapping, uv_maps
from addon.transfer.layouts import MOST_UV_MAPS, own_maps, read_uv
from addon.transfer.materials import OWN_SLOT


@pytest.fixture
def body(scene):
    return Body(photo(256))


def right(body):
    """Share of the target's corners that show what the source does, up to what an eye tells apart."""
    error = np.abs(shown(body.target) - body.at_twins(shown(body.source)))
    return (error.max(axis=1) < unwrapping.SEEN).mean()


# A tenth of the corners lie on seams of one layout only, where filters mix in what is beside its islands.
MOST = 0.85


@pytest.fixture
def alike(body):
    """A target whose own map has the name of the source's, and a second material by name on the source."""
    body.target.data.uv_layers["Own"].name = "UVMap"
    return body


def test_a_map_of_the_target_stays_and_the_source_s_comes_beside_it(alike):
    target = alike.target.data
    own = read_uv(target, "UVMap")
    for _ in range(2):
        transfer(alike.source, alike.target, kinds="uv")
        assert target.uv_layers.keys() == ["UVMap", "UVMap Source"]
        np.testing.assert_array_equal(read_uv(target, "UVMap"), own)
        np.testing.assert_allclose(
            read_uv(target, "UVMap Source"), alike.at_twins(read_uv(alike.source.data, "UVMap")), atol=1e-5
        )
        assert target.uv_layers.active.name == "UVMap Source"
    assert own_maps(target) == ["UVMap"] and not notice.words


def test_the_first_time_it_is_said(alike):
    transfer(alike.source, alike.target, kinds="uv")
    assert "UV map 'UVMap' of 'Target' stays" in notice.words and "as 'UVMap Source'" in notice.words


def test_faults_of_a_map_are_told_where_something_is_seen_by_it(alike, monkeypatch):
    monkeypatch.setattr(uv_maps, "STRETCH_ROOM", 0.0)
    transfer(alike.source, alike.target, kinds="uv,textures")
    assert notice.words and "stretched" not in notice.words
    transfer(alike.source, alike.target, kinds="uv")
    assert "UV map 'UVMap Source' on 'Target' is stretched 1.0 times as much" in notice.words


def sheet(name, left, right, fold=1.0):
    """A grid of squares from `left` to `right`, folded back at the height `fold`."""
    x, y = np.meshgrid(np.arange(left, right + 0.01, 0.1), np.arange(-1.0, 1.01, 0.1), indexing="ij")
    points = np.stack([x, np.minimum(y, 2.0 * fold - y), 0.0 * x], axis=-1).reshape(-1, 3)
    corner = np.arange(x.size).reshape(x.shape)
    corners = [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]]
    return new_object(name, points, np.stack(corners, axis=-1).reshape(-1, 4))


@pytest.mark.parametrize("fold", [1.0, 0.5])
def test_flips_are_told_where_the_source_has_none(scene, fold):
    """Of what a target shows: a quarter of the left half is mirrored on the source, and nothing else."""
    source, target, folded = sheet("Source", -1, 1), sheet("Target", -1, 0), sheet("Folded", -1, 0, fold)
    uv = source.data.uv_layers.new(name="UVMap").uv
    for polygon in source.data.polygons:
        mirrored = polygon.center.x < 0.0 and polygon.center.y < -0.5
        for loop in polygon.loop_indices:
            x, y, _ = source.data.vertices[source.data.loops[loop].vertex_index].co
            uv[loop].vector = (-1.0 - x if mirrored else x) * 0.5 + 0.5, y * 0.5 + 0.5
    store_nearest(source, folded)
    face, weights = (
        read_attribute(folded.data.attributes[f"match_{name}"]) for name in ("face", "barycentric")
    )
    store_map(source, target, face, weights)
    transfer(source, target, kinds="uv")
    assert ("has 50% flipped area (source 25%)" in notice.words) == (fold < 1.0), notice.words
    assert ("flipped" in notice.words) == (fold < 1.0)


def test_on_request_a_map_is_replaced(alike):
    transfer(alike.source, alike.target, kinds="uv", replace_uv=True)
    assert alike.target.data.uv_layers.keys() == ["UVMap"] and not notice.words
    expected = alike.at_twins(read_uv(alike.source.data, "UVMap"))
    np.testing.assert_allclose(read_uv(alike.target.data, "UVMap"), expected, atol=1e-5)


def test_a_map_in_which_all_lies_in_one_point_is_no_layout(alike):
    target = alike.target.data
    target.uv_layers["UVMap"].uv.foreach_set("vector", np.zeros(2 * len(target.loops), np.float32))
    transfer(alike.source, alike.target, kinds="uv")
    assert target.uv_layers.keys() == ["UVMap"]


@pytest.mark.parametrize("named", ["UVMAP", "ATTRIBUTE", "in a group"])
def test_materials_that_name_a_map_show_it_under_its_new_name(alike, named):
    """The source's own images on the carried map; materials and groups of the source stay as they are."""
    if named == "in a group":
        group = bpy.data.node_groups.new("Place", "ShaderNodeTree")
        group.interface.new_socket("Place", in_out="OUTPUT", socket_type="NodeSocketVector")
        node, end = group.nodes.new("ShaderNodeUVMap"), group.nodes.new("NodeGroupOutput")
        node.uv_map = "UVMap"
        group.links.new(node.outputs[0], end.inputs[0])
        around = alike.nodes.new("ShaderNodeGroup")
        around.node_tree = group
        alike.links.new(around.outputs[0], alike.node.inputs["Vector"])
    elif named == "ATTRIBUTE":
        node = alike.nodes.new("ShaderNodeAttribute")
        node.attribute_name = "UVMap"
        alike.chain(node)
    else:
        alike.chain(alike.uv_map("UVMap"))
    for _ in range(2):
        transfer(alike.source, alike.target, kinds="uv,materials")
        assert alike.baked() == [alike.image]
        assert alike.likeness() > SAME
    assert len(bpy.data.materials) == 2 and len(alike.target.material_slots) == 1
    assert len(bpy.data.node_groups) == 2 * (named == "in a group")


def test_textures_are_baked_into_the_target_s_own_map_by_default(alike):
    for _ in range(2):
        transfer(alike.source, alike.target)
        assert alike.target.data.uv_layers.active.name == "UVMap"
        assert alike.baked() != [alike.image]
        assert alike.likeness() > SAME


def test_a_target_that_is_not_unwrapped_shows_the_source_s_images(body):
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    transfer(body.source, body.target)
    assert [slot.material for slot in body.target.material_slots] == [body.material]
    assert body.likeness() > SAME


def test_a_target_without_a_layout_is_unwrapped_and_baked_to_at_one_press(body):
    """The remedy beside the note that nothing was baked."""
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    transfer(body.source, body.target)
    (known,) = [each for each, _ in remedy.remedies(notice.words) if each == remedy.UNWRAP]
    transfer(body.source, body.target, **dict(known.properties))
    assert own_maps(body.target.data) == ["Unwrapped"]
    assert body.target.data.uv_layers.active.name == "Unwrapped" and body.baked() != [body.image]
    assert right(body) > MOST and remedy.UNWRAP not in dict(remedy.remedies(notice.words))
    carried = body.at_twins(read_uv(body.source.data, "UVMap"))
    np.testing.assert_allclose(read_uv(body.target.data, "UVMap"), carried, atol=1e-5)


def test_textures_alone_come_to_a_target_without_a_layout(body):
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    transfer(body.source, body.target, kinds="textures")
    assert own_maps(body.target.data) == ["Unwrapped"] and right(body) > MOST
    assert "'Target' were baked into a new UV map, 'Unwrapped'" in notice.words


def squares(obj, uv):
    obj.data.uv_layers["Own"].uv.foreach_set("vector", np.asarray(uv, np.float32).ravel())


@pytest.fixture(params=["one square", "points"])
def palette(body, request):
    """All faces of the target lie on one square, or each on one of three points: no place for a picture."""
    corners = len(body.target.data.loops)
    if request.param == "one square":
        uv = np.resize([[0.1, 0.1], [0.2, 0.1], [0.2, 0.2], [0.1, 0.2]], (corners, 2))
    else:
        uv = np.repeat(np.resize([[0.2, 0.2], [0.5, 0.8], [0.8, 0.5]], (corners // 4, 2)), 4, axis=0)
    squares(body.target, uv)
    body.own = read_uv(body.target.data, "Own")
    return body


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_what_is_laid_out_as_a_palette_gets_a_map_beside_its_own(palette, mode):
    """In the same transfer; the next ones bake into that map, whichever is active."""
    target, source = palette.target, palette.source
    target.data.polygons[3].hide = True
    bpy.context.view_layer.objects.active = source
    bpy.ops.object.mode_set(mode=mode)
    transfer(source, target)
    assert source.mode == mode and bpy.context.view_layer.objects.active == source
    bpy.ops.object.mode_set(mode="OBJECT")
    layers = target.data.uv_layers
    assert layers.keys() == ["Own", "Unwrapped", "UVMap"] and layers.active.name == "Unwrapped"
    assert "baked into a new UV map, 'Unwrapped'. In 'Own', " in notice.words
    assert not remedy.remedies(notice.words) and right(palette) > MOST
    assert [face.index for face in target.data.polygons if face.hide] == [3]
    np.testing.assert_array_equal(read_uv(target.data, "Own"), palette.own)
    made = read_uv(target.data, "Unwrapped")
    assert made.min() >= 0.0 and made.max() <= 1.0
    for active in ("Own", "Unwrapped"):
        layers.active = layers[active]
        transfer(source, target)
        assert layers.keys() == ["Own", "Unwrapped", "UVMap"] and layers.active.name == "Unwrapped"
        np.testing.assert_array_equal(read_uv(target.data, "Unwrapped"), made)
        assert "new UV map" not in notice.words


def test_one_undo_takes_the_map_made_for_a_palette(palette):
    bpy.ops.ed.undo_push(message="Before")
    choose(palette.source, palette.target)
    assert bpy.ops.spectral_match.transfer("EXEC_DEFAULT", True) == {"FINISHED"}
    assert "Unwrapped" in bpy.data.objects["Target"].data.uv_layers
    bpy.ops.ed.undo()
    assert bpy.data.objects["Target"].data.uv_layers.keys() == ["Own"]


def test_a_transfer_that_fails_leaves_no_map(palette):
    target, objects, meshes = palette.target, set(bpy.data.objects), set(bpy.data.meshes)
    target.vertex_groups.new(name="Dirt")
    palette.source.data.attributes.new("Dirt", "FLOAT", "POINT")
    with pytest.raises(RuntimeError, match="Dirt"):
        transfer(palette.source, target)
    assert target.data.uv_layers.keys() == ["Own"] and target.data.uv_layers.active.name == "Own"
    assert set(bpy.data.objects) == objects and set(bpy.data.meshes) == meshes


@pytest.mark.parametrize("wish", [{"bake_unwrap": "NEVER"}, {"bake_uv": "Own"}])
def test_on_request_a_palette_is_baked_into_and_unwrapped_at_one_press(palette, wish):
    transfer(palette.source, palette.target, **wish)
    assert palette.target.data.uv_layers.keys() == ["Own", "UVMap"] and right(palette) < 0.5
    ((known, _),) = remedy.remedies(notice.words)
    assert known == remedy.UNWRAP_ANEW
    transfer(palette.source, palette.target, **dict(known.properties))
    assert remedy.remedies(notice.words) == () and right(palette) > MOST


def test_a_target_with_all_the_maps_that_there_can_be_is_baked_to_as_it_is(palette):
    layers = palette.target.data.uv_layers
    while len(layers) < MOST_UV_MAPS - 1:
        layers.new(name="Other")
    layers.active = layers["Own"]
    transfer(palette.source, palette.target)
    assert "'Target' has no room for one more UV map" in notice.words
    assert "UVMap" in layers and "Unwrapped" not in layers


def test_which_face_had_which_material_is_kept(scene):
    vertices, faces = lumpy(6)
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    for obj, names in ((source, ("Skin", "Cloth")), (target, ("Wood", "Iron"))):
        for name in names:
            obj.data.materials.append(bpy.data.materials.new(name))
    own, given = np.random.default_rng(4).integers(0, 2, (2, len(faces))).astype(np.int32)
    target.data.polygons.foreach_set("material_index", own)
    source.data.polygons.foreach_set("material_index", given)
    for number in range(2):
        transfer(source, target, kinds="materials")
        assert [slot.name for slot in target.material_slots] == ["Wood", "Iron", "Skin", "Cloth"]
        np.testing.assert_array_equal(read_attribute(target.data.attributes[OWN_SLOT]), own)
        assert ("had which" in notice.words) == (number == 0)


def mirrored(body, picture):
    """Half of the target's layout lies on the other half, and the source shows `picture`."""
    uv = read_uv(body.target.data, "Own")
    uv[:, 0] = np.abs(uv[:, 0] - 0.5)
    squares(body.target, uv)
    body.image.pixels.foreach_set(np.ascontiguousarray(picture, np.float32).ravel())
    return uv


def test_halves_that_look_alike_keep_their_layout(body):
    """The source shows the same on both sides of the line about which the target's layout is mirrored."""
    picture = photo(256).copy()
    picture[128:] = picture[:128][::-1]
    own = mirrored(body, picture)
    transfer(body.source, body.target, kinds="textures")
    assert body.target.data.uv_layers.keys() == ["Own"] and body.baked() != [body.image]
    assert body.likeness() > FINER
    np.testing.assert_allclose(read_uv(body.target.data, "Own"), own, atol=1e-6)
    assert notice.words == "Parts of 'Target' share 100% of UV map 'Own', and look alike there"
    assert wording.notes_in_order([notice.words]) == ([], [notice.words])


def test_halves_that_differ_do_not(body):
    mirrored(body, photo(256))
    transfer(body.source, body.target, kinds="textures")
    assert body.target.data.uv_layers.active.name == "Unwrapped" and right(body) > MOST


def test_overlap_is_told_where_it_is_baked_into(body):
    mirrored(body, photo(256))
    transfer(body.source, body.target, kinds="textures", bake_unwrap="NEVER")
    assert "UV map 'Own' of 'Target' overlaps: 100% of it" in notice.words
    assert body.baked() != [body.image]


def test_materials_that_lie_over_each_other_get_an_image_each(body):
    """As those of game characters do: each fills the square by itself."""
    target = body.target
    for name in ("Head", "Limbs"):
        target.data.materials.append(bpy.data.materials.new(name))
    uv = read_uv(target.data, "Own")
    half = uv.reshape(-1, 4, 2).mean(axis=1)[:, 1] > 0.5
    target.data.polygons.foreach_set("material_index", half.astype(np.int32))
    uv[:, 1] = 2.0 * uv[:, 1] - np.repeat(half, 4)
    target.data.uv_layers["Own"].uv.foreach_set("vector", uv.astype(np.float32).ravel())
    for _ in range(2):
        transfer(body.source, target, kinds="materials,textures")
        assert "Materials of 'Target' overlap in UV map 'Own'" in notice.words
        # Baked texels are half as high as the source's, whose detail both filters see differently.
        assert body.likeness() > FINER
        names = ["Head", "Limbs", "Painted Target Head", "Painted Target Limbs"]
        assert [slot.name for slot in target.material_slots] == names
        assert {image.name for image in bpy.data.images} == {
            "Paint",
            "Paint Target Head",
            "Paint Target Limbs",
        }
    # Taken apart on the layout, one image shows all.
    uv[:, 1] = (uv[:, 1] + np.repeat(half, 4)) / 2.0
    target.data.uv_layers["Own"].uv.foreach_set("vector", uv.astype(np.float32).ravel())
    transfer(body.source, target, kinds="materials,textures")
    assert body.likeness() > SAME and not notice.words
    assert {slot.name for slot in target.material_slots} == {"Head", "Limbs", "Painted Target"}
