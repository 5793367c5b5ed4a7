# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps and materials of the target stay; those of the source come beside them, and overlap is told of."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object
from test_textures import FINER, SAME, Body
from test_transfer import store_identity, transfer
from test_transfer_kinds import photo

from addon import notice, remedy
from addon.mesh_write import read_attribute
from addon.transfer import uv_maps
from addon.transfer.layouts import own_maps, read_uv
from addon.transfer.materials import OWN_SLOT


@pytest.fixture
def body(scene):
    return Body(photo(256))


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


def test_an_unwrapped_target_is_baked_to(body):
    """The remedy beside the note that nothing was baked."""
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    transfer(body.source, body.target)
    found = [each for each in remedy.remedies(notice.words) if each[0] == remedy.UNWRAP]
    assert found == [(remedy.UNWRAP, body.target.name)]
    assert bpy.ops.spectral_match.unwrap(name=body.target.name) == {"FINISHED"}
    own = body.target.data.uv_layers.active.name
    assert own_maps(body.target.data) == [own]
    transfer(body.source, body.target)
    assert body.target.data.uv_layers.active.name == own and body.baked() != [body.image]
    assert remedy.UNWRAP not in dict(remedy.remedies(notice.words))


def test_an_overlapping_layout_is_unwrapped_anew(body):
    """A palette: all faces lie on one square, where they cannot show what they should."""
    layer = body.target.data.uv_layers["Own"]
    square = np.resize([[0.1, 0.1], [0.9, 0.1], [0.5, 0.9]], (len(body.target.data.loops), 2))
    layer.uv.foreach_set("vector", square.astype(np.float32).ravel())
    transfer(body.source, body.target)
    assert body.likeness() < SAME / 2
    ((known, name),) = remedy.remedies(notice.words)
    assert (known, name) == (remedy.UNWRAP_ANEW, "Target")
    assert bpy.ops.spectral_match.unwrap(name=name, **dict(known.properties)) == {"FINISHED"}
    assert body.target.data.uv_layers.active.name == "UVMap.001"
    transfer(body.source, body.target)
    assert remedy.remedies(notice.words) == () and body.likeness() > FINER
    assert read_uv(body.target.data, "Own") == pytest.approx(square)


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


def test_overlap_is_found_before_baking(body):
    """Half of the layout is mirrored onto the other half."""
    uv = read_uv(body.target.data, "Own")
    uv[:, 0] = np.abs(uv[:, 0] - 0.5)
    body.target.data.uv_layers["Own"].uv.foreach_set("vector", uv.astype(np.float32).ravel())
    transfer(body.source, body.target, kinds="textures")
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
