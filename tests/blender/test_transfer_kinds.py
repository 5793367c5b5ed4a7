# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys, marks, materials, attributes, textures and rigs across a known map."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object, renumbered, triangle_vertices, turned
from mathutils import Matrix
from test_transfer import ball, store_map, store_nearest, transfer, weights_of, without_data

from addon import mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer.normals import corner_normals
from addon.transfer.shape_keys import read_key
from addon.transfer.uv_maps import read_uv


def store_copy(source, target, old):
    """Each target vertex lies on the source vertex from which it was made."""
    triangles = triangle_vertices(source.data)
    face, corner = np.empty(len(old), int), np.empty(len(old), int)
    for k in range(3):
        face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
    store_map(source, target, face[old], np.eye(3)[corner[old]])


@pytest.fixture
def copies(scene):
    """A lumpy body, its turned and renumbered copy, the old vertex of each new one, and the rotation."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    moved, other_faces, old = renumbered(vertices, faces)
    target = new_object("Target", turned(moved), other_faces)
    store_copy(source, target, old)
    rotation = (turned(np.eye(3)) - turned(np.zeros((1, 3)))).T
    return source, target, old, rotation


def add_key(obj, name, offsets, **settings):
    if obj.data.shape_keys is None:
        obj.shape_key_add(name="Basis", from_mix=False)
    key = obj.shape_key_add(name=name, from_mix=False)
    for setting, value in settings.items():
        setattr(key, setting, value)
    key.data.foreach_set("co", (read_key(key.relative_key) + offsets).astype(np.float32).ravel())
    return key


def offsets_of(obj, name):
    key = obj.data.shape_keys.key_blocks[name]
    return read_key(key) - read_key(key.relative_key)


def smooth_field(points, seed=0):
    """Displacements that vary slowly and are exactly zero below."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(3, 3)) * 0.7
    return 0.05 * np.cos(points @ waves) * np.clip(points[:, 2:], 0.0, None)


def test_shape_keys_turn_with_the_body(copies):
    source, target, old, rotation = copies
    points = mesh_read.positions(source.data).astype(float)
    field = smooth_field(points)
    add_key(source, "Smile", field)
    transfer(source, target, kinds="keys")
    carried = offsets_of(target, "Smile")
    expected = field[old] @ rotation.T
    # Coordinates are single precision; frames of a rigid copy are exact up to that.
    assert np.abs(carried - expected).max() < 1e-4 * np.abs(field).max() + 1e-6
    still = (field[old] == 0.0).all(axis=1)
    assert still.sum() > 100
    assert not carried[still].any()


def test_shape_keys_keep_their_settings(copies):
    source, target, _, _ = copies
    source.vertex_groups.new(name="Mask").add([0, 1, 2], 1.0, "REPLACE")
    points = mesh_read.positions(source.data).astype(float)
    add_key(source, "Open", smooth_field(points))
    child = add_key(source, "Open more", 0.5 * smooth_field(points, 1))
    child.relative_key = source.data.shape_keys.key_blocks["Open"]
    child.slider_min, child.slider_max, child.value = -0.5, 1.5, 0.25
    child.mute, child.vertex_group = True, "Mask"
    driver = source.data.shape_keys.key_blocks["Open"].driver_add("value").driver
    variable = driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = source, "location[0]"
    driver.expression = "var * 2"
    for _ in range(2):
        transfer(source, target, kinds="keys,groups")
        keys = target.data.shape_keys.key_blocks
        assert [key.name for key in keys] == ["Basis", "Open", "Open more"]
        made = keys["Open more"]
        assert made.relative_key == keys["Open"]
        assert (made.slider_min, made.slider_max, made.mute, made.vertex_group) == (-0.5, 1.5, True, "Mask")
        (curve,) = target.data.shape_keys.animation_data.drivers
        assert curve.data_path == 'key_blocks["Open"].value' and curve.driver.expression == "var * 2"
        assert curve.driver.variables[0].targets[0].id == target


def test_absolute_shape_keys_are_refused_in_words(copies):
    source, target, _, _ = copies
    add_key(source, "Later", 0.0)
    source.data.shape_keys.use_relative = False
    with pytest.raises(RuntimeError, match="Check Relative"):
        transfer(source, target, kinds="keys")
    assert target.data.shape_keys is None


def test_marks_come_back_on_a_copy(copies):
    """Curves on a renumbered copy are the very same edges, creases with their values."""
    source, target, old, _ = copies
    edges = mesh_read.edges(source.data)
    points = mesh_read.positions(source.data)
    rng = np.random.default_rng(4)
    low = points[edges].max(axis=1)[:, 2] < 0.1
    seam = low & (points[edges].min(axis=1)[:, 2] > -0.3) & (rng.random(len(edges)) < 0.6)
    crease = np.where(np.abs(points[edges][:, :, 0]).max(axis=1) < 1e-5, 0.7, 0.0)
    write_attribute(source.data, "uv_seam", "BOOLEAN", "EDGE", seam)
    write_attribute(source.data, "crease_edge", "FLOAT", "EDGE", crease)
    transfer(source, target, kinds="marks")
    same = same_edges(source, target, old)
    assert seam.sum() > 20
    np.testing.assert_array_equal(read_attribute(target.data.attributes["uv_seam"]), seam[same])
    np.testing.assert_allclose(read_attribute(target.data.attributes["crease_edge"]), crease[same], atol=1e-6)


def same_edges(source, target, old):
    """The source's edge of each edge of its renumbered copy."""
    place = {tuple(sorted(pair)): i for i, pair in enumerate(mesh_read.edges(source.data).tolist())}
    return [place[tuple(sorted(pair))] for pair in old[mesh_read.edges(target.data)].tolist()]


def test_creases_of_most_edges_come_back_on_a_copy(copies):
    source, target, old, _ = copies
    rng = np.random.default_rng(7)
    crease = (rng.random(len(source.data.edges)) < 0.6) * rng.random(len(source.data.edges))
    write_attribute(source.data, "crease_edge", "FLOAT", "EDGE", crease)
    transfer(source, target, kinds="marks")
    np.testing.assert_allclose(
        read_attribute(target.data.attributes["crease_edge"]),
        crease[same_edges(source, target, old)],
        atol=1e-6,
    )


def test_numbers_of_edges_come_from_edges_that_run_alike(scene):
    """Not every edge of a finer mesh follows one of the source's, and yet none is without a number."""
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(13))
    store_nearest(source, target)

    def middles(obj):
        return mesh_read.positions(obj.data)[mesh_read.edges(obj.data)].mean(axis=1)

    number = np.where(middles(source)[:, 2] > 0.0, 2, -1)
    write_attribute(source.data, "number", "INT", "EDGE", number)
    transfer(source, target, kinds="attributes")
    carried = read_attribute(target.data.attributes["number"])
    assert set(carried.tolist()) == {-1, 2}
    ends = mesh_read.positions(source.data)[mesh_read.edges(source.data)]
    longest = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max()
    height = middles(target)[:, 2]
    sure = np.abs(height) > longest
    assert sure.sum() > 1000
    np.testing.assert_array_equal(carried[sure], np.where(height[sure] > 0.0, 2, -1))


def test_a_closed_seam_stays_closed_on_another_mesh(scene):
    """The equator of one ball is a closed curve of the other: every vertex on it has two marked edges."""
    source, target = ball("Source", 48, 24), ball("Target", 31, 17)
    edges, points = mesh_read.edges(source.data), mesh_read.positions(source.data)
    write_attribute(
        source.data, "sharp_edge", "BOOLEAN", "EDGE", np.abs(points[edges][:, :, 2]).max(axis=1) < 1e-5
    )
    store_nearest(source, target)
    transfer(source, target, kinds="marks")
    marked = mesh_read.edges(target.data)[read_attribute(target.data.attributes["sharp_edge"])]
    assert len(marked) >= 31
    assert set(np.bincount(marked.ravel())) <= {0, 2}
    # No vertex lies on the equator; the nearest rings are one step of 180°/17 apart.
    assert np.abs(mesh_read.positions(target.data)[marked][:, :, 2]).max() < 1.1 * np.sin(np.pi / 17)


def test_custom_normals_turn_with_the_body(copies):
    source, target, old, rotation = copies
    mesh = source.data
    lean = np.random.default_rng(10).normal(size=(len(mesh.vertices), 3)) * 0.2
    given = np.array([vertex.normal for vertex in mesh.vertices]) + lean
    given /= np.linalg.norm(given, axis=1, keepdims=True)
    mesh.normals_split_custom_set_from_vertices(given.tolist())
    rounding = np.linalg.norm(corner_normals(mesh) - given[mesh_read.corner_vertices(mesh)], axis=1).max()
    transfer(source, target)
    assert not target.data.has_custom_normals
    if bpy.app.version >= (4, 5):
        # Normals of points, as nodes set them, are replaced by those of corners.
        target.data.attributes.new("custom_normal", "FLOAT_VECTOR", "POINT")
    for _ in range(2):
        transfer(source, target, kinds="normals")
    found = corner_normals(target.data)
    expected = given[old][mesh_read.corner_vertices(target.data)] @ rotation.T
    # Blender keeps two angles in 16 bits each: on the source and once more on the target.
    assert np.linalg.norm(found - expected, axis=1).max() < 2 * rounding < 0.01


def test_materials_and_attributes_come_back_on_a_copy(copies):
    source, target, old, _ = copies
    rng = np.random.default_rng(5)
    mesh = source.data
    for name in ("Skin", "Cloth"):
        mesh.materials.append(bpy.data.materials.new(name))
    target.data.materials.append(bpy.data.materials.new("Own"))
    faces = len(mesh.polygons)

    def words(count):
        return np.array([f"ä{number}".encode() for number in rng.integers(0, 3, count)], object)

    index = rng.integers(0, 2, faces).astype(np.int32)
    mesh.polygons.foreach_set("material_index", index)
    given = {
        ("float", "FLOAT", "POINT"): rng.normal(size=len(mesh.vertices)),
        ("vector", "FLOAT_VECTOR", "POINT"): rng.normal(size=(len(mesh.vertices), 3)),
        ("whole", "INT", "POINT"): rng.integers(-5, 5, len(mesh.vertices)),
        ("flag", "BOOLEAN", "FACE"): rng.random(faces) < 0.5,
        ("number", "FLOAT", "FACE"): rng.normal(size=faces),
        ("corner", "FLOAT", "CORNER"): np.repeat(rng.normal(size=faces), 4),
        ("count", "INT", "CORNER"): np.repeat(rng.integers(0, 9, faces), 4),
        ("along", "FLOAT", "EDGE"): rng.normal(size=len(mesh.edges)),
        ("below", "INT", "EDGE"): rng.integers(-5, 5, len(mesh.edges)),
        ("part", "BOOLEAN", "EDGE"): rng.random(len(mesh.edges)) < 0.7,
        ("bone", "STRING", "POINT"): words(len(mesh.vertices)),
        ("side", "STRING", "EDGE"): words(len(mesh.edges)),
        ("zone", "STRING", "FACE"): words(faces),
        ("piece", "STRING", "CORNER"): np.repeat(words(faces), 4),
    }
    for layer, values in given.items():
        write_attribute(mesh, *layer, values)
    transfer(source, target, kinds="materials,attributes")
    place = {frozenset(face.vertices): face.index for face in mesh.polygons}
    same_face = [place[frozenset(old[list(face.vertices)].tolist())] for face in target.data.polygons]
    assert [slot.material.name for slot in target.material_slots] == ["Own", "Skin", "Cloth"]
    np.testing.assert_array_equal(
        [face.material_index for face in target.data.polygons], index[same_face] + 1
    )
    same = {
        "POINT": old,
        "EDGE": same_edges(source, target, old),
        "FACE": same_face,
        "CORNER": np.repeat(np.array(same_face) * 4, 4),
    }
    for (name, kind, domain), values in given.items():
        carried = target.data.attributes[name]
        assert (carried.data_type, carried.domain) == (kind, domain)
        expected = values[same[domain]]
        if kind == "STRING":
            np.testing.assert_array_equal(read_attribute(carried), expected)
        else:
            np.testing.assert_allclose(
                read_attribute(carried), expected.astype(np.float32), rtol=1e-6, atol=1e-7
            )


@pytest.mark.parametrize("domain", ["POINT", "FACE", "CORNER"])
def test_rotations_are_mixed_whatever_their_signs(scene, domain):
    """Minus a quaternion is the same rotation: a field comes across the same with signs at random."""
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(13))
    store_nearest(source, target)
    mesh = source.data
    points = mesh_read.positions(mesh)
    corners = mesh_read.corner_vertices(mesh)
    points = {"POINT": points, "CORNER": points[corners], "FACE": points[corners].reshape(-1, 4, 3)[:, 0]}
    # Half turns and more and less, so that no number keeps its sign.
    angle = np.pi / 2 + points[domain][:, 2] / 2
    field = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=1)
    rng = np.random.default_rng(8)
    write_attribute(mesh, "plain", "QUATERNION", domain, field)
    write_attribute(mesh, "mixed", "QUATERNION", domain, field * rng.choice([-1, 1], len(field))[:, None])
    transfer(source, target, kinds="attributes")
    plain, mixed = (read_attribute(target.data.attributes[name]) for name in ("plain", "mixed"))
    np.testing.assert_allclose(np.abs((plain * mixed).sum(axis=1)), 1.0, atol=1e-6)
    assert (plain[:, 1] > 0.0).all()


def state(obj):
    return (
        {(layer.name, layer.data_type, layer.domain) for layer in obj.data.attributes},
        [group.name for group in obj.vertex_groups],
        [slot.material for slot in obj.material_slots],
    )


GIVEN = {
    "group": lambda obj: obj.vertex_groups.new(name="Dirt"),
    "attribute": lambda obj: obj.data.attributes.new("Dirt", "FLOAT", "POINT"),
    "uv": lambda obj: obj.data.uv_layers.new(name="Dirt"),
    "colour": lambda obj: obj.data.color_attributes.new("Dirt", "FLOAT_COLOR", "CORNER"),
}


@pytest.mark.parametrize(
    ("given", "own"),
    [
        (["attribute"], "group"),
        (["attribute"], "uv"),
        (["attribute"], "colour"),
        (["colour"], "group"),
        (["colour"], "uv"),
        (["uv"], "attribute"),
        (["uv"], "colour"),
        (["attribute", "group"], None),
    ],
)
def test_a_name_that_is_taken_is_refused_before_anything_is_written(copies, given, own):
    source, target, _, _ = copies
    source.vertex_groups.new(name="Bone").add([0], 1.0, "REPLACE")
    source.data.materials.append(bpy.data.materials.new("Skin"))
    for name in given:
        GIVEN[name](source)
    if own is not None:
        GIVEN[own](target)
    before = state(target)
    with pytest.raises(RuntimeError, match="named 'Dirt'.* Rename"):
        transfer(source, target)
    assert state(target) == before


def test_attributes_of_one_sort_replace_each_other(copies):
    source, target, _, _ = copies
    target.vertex_groups.new(name="UVMap")
    source.data.uv_layers.new(name="UVMap")
    source.data.attributes.new("Dirt", "FLOAT", "POINT")
    target.data.attributes.new("Dirt", "INT", "FACE")
    transfer(source, target)
    kept = target.data.attributes["Dirt"]
    assert (kept.data_type, kept.domain) == ("FLOAT", "POINT")
    assert [layer.name for layer in target.data.uv_layers] == ["UVMap"]


def test_materials_are_found_by_what_the_target_shows(copies, tmp_path):
    """Nothing piles up; the same name from another file, or hidden by the object's own, is another one."""
    source, target, _, _ = copies
    own = bpy.data.materials.new("Skin")
    bpy.data.libraries.write(str(tmp_path / "other.blend"), {own})
    with bpy.data.libraries.load(str(tmp_path / "other.blend"), link=True) as (_, linked):
        linked.materials = ["Skin"]
    cloth = bpy.data.materials.new("Cloth")
    given = [linked.materials[0], None, cloth]
    for material in given:
        source.data.materials.append(material)
    source.data.polygons.foreach_set("material_index", np.arange(len(source.data.polygons)) % 3)
    for material in (own, cloth):
        target.data.materials.append(material)
    target.material_slots[1].link = "OBJECT"
    for _ in range(2):
        transfer(source, target, kinds="materials")
        assert [slot.material for slot in target.material_slots] == [own, None, given[0], cloth]
    shown = {target.material_slots[face.material_index].material for face in target.data.polygons}
    assert shown == set(given)


def photo(side):
    """A picture with detail at all scales, but none finer than a few texels."""
    rng = np.random.default_rng(6)
    y, x = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    picture = np.zeros((side, side, 4), np.float32)
    for c in range(3):
        for frequency in (1, 3, 7, 15, 31):
            a, b, phase = rng.integers(-frequency, frequency + 1, 2).tolist() + [rng.uniform(0, 6.3)]
            picture[..., c] += np.cos(2 * np.pi * (a * x + b * y) / side + phase) / frequency
    picture = (picture - picture.min()) / np.ptp(picture)
    picture[..., 3] = 1.0
    return picture


def give_texture(obj, pixels, normal_map=False):
    side = len(pixels)
    image = bpy.data.images.new("Paint", side, side, alpha=True)
    if normal_map:
        image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    material = bpy.data.materials.new("Painted")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = nodes["Principled BSDF"]
    if normal_map:
        bump = nodes.new("ShaderNodeNormalMap")
        links.new(texture.outputs["Color"], bump.inputs["Color"])
        links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    else:
        links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    obj.data.materials.append(material)
    return image


def uv_cube(obj, name="UVMap"):
    """The layout of the lumpy body that its making suggests: six sides in a grid."""
    layer = obj.data.uv_layers.new(name=name)
    sides = len(obj.data.polygons) // 6
    cells = int(sides**0.5)
    uv = np.empty((len(obj.data.loops), 2), np.float32)
    for face in obj.data.polygons:
        side, within = divmod(face.index, sides)
        i, j = divmod(within, cells)
        square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        if side % 2:
            square = square[::-1]
        for corner, (u, v) in zip(face.loop_indices, square, strict=True):
            uv[corner] = (
                (side % 3 + 0.05 + 0.9 * u / cells) / 3,
                (side // 3 + 0.05 + 0.9 * v / cells) / 2,
            )
    layer.uv.foreach_set("vector", uv.ravel())


def psnr(a, b):
    return 10 * np.log10(1.0 / np.mean((a - b) ** 2))


def rebaked(copies, scene, pixels, normal_map=False, exchange=None):
    """The texture baked onto the copy, in the copy's own numbering of faces but the same layout."""
    source, target, old, _ = copies
    uv_cube(source)
    source.data.uv_layers.active = source.data.uv_layers[0]
    image = give_texture(source, pixels, normal_map)
    before = read_uv(source.data, source.data.uv_layers[0].name)
    if exchange is not None:
        image = exchange(source)
    place = {frozenset(face.vertices): face for face in source.data.polygons}
    layer = target.data.uv_layers.new(name="Own")
    for face in target.data.polygons:
        twin = place[frozenset(old[list(face.vertices)].tolist())]
        at = dict(zip(twin.vertices, twin.loop_indices, strict=True))
        for corner, vertex in zip(face.loop_indices, face.vertices, strict=True):
            u, v = before[at[old[vertex]]]
            # The copy's layout is the source's, turned by a right angle.
            layer.uv[corner].vector = (v, 1.0 - u)
    transfer(source, target, kinds="textures", bake_margin=4)
    made = bpy.data.images[f"{image.name} Target"]
    result = np.empty(len(pixels) ** 2 * 4, np.float32)
    made.pixels.foreach_get(result)
    assert made.colorspace_settings.name == image.colorspace_settings.name
    assert target.data.materials[0].node_tree.nodes["Image Texture"].image == made
    # Turned back: texel (x, y) of the copy is (1 - y, x) of the source.
    return np.rot90(result.reshape(pixels.shape), k=-1), made


def covered(copies, side):
    """Texels whose centres lie well inside the six islands."""
    at = (np.arange(side) + 0.5) / side
    u, v = np.meshgrid(at * 3 % 1, at * 2 % 1)
    return (np.abs(u - 0.5) < 0.44) & (np.abs(v - 0.5) < 0.44)


def test_a_texture_baked_onto_a_renumbered_copy_is_the_same_picture(copies, scene):
    """At least 35 dB; 8 bits a channel alone leave 59."""
    pixels = photo(384)
    baked, _ = rebaked(copies, scene, pixels)
    inside = covered(copies, 384)
    assert psnr(baked[inside][:, :3], pixels[inside][:, :3]) > 40.0
    assert (baked[inside][:, 3] == 1.0).all()


def test_tiles_are_baked_as_one_picture(copies, scene, tmp_path):
    """A picture over two tiles, two texels of it for each texel of the baked one."""
    wide = photo(768)[::2]

    def tiled(source):
        for number, part in ((1001, wide[:, :384]), (1002, wide[:, 384:])):
            tile = bpy.data.images.new("Tile", 384, 384)
            tile.pixels.foreach_set(np.ascontiguousarray(part).ravel())
            tile.filepath_raw, tile.file_format = str(tmp_path / f"skin.{number}.png"), "PNG"
            tile.save()
        image = bpy.data.images.load(str(tmp_path / "skin.1001.png"))
        image.source, image.filepath = "TILED", str(tmp_path / "skin.<UDIM>.png")
        if len(image.tiles) < 2:
            image.tiles.new(1002)
        source.data.materials[0].node_tree.nodes["Image Texture"].image = image
        layer = source.data.uv_layers[0]
        uv = read_uv(source.data, layer.name) * (2.0, 1.0)
        layer.uv.foreach_set("vector", uv.astype(np.float32).ravel())
        return image

    expected = (wide[:, ::2] + wide[:, 1::2]) / 2
    baked, _ = rebaked(copies, scene, expected, exchange=tiled)
    inside = covered(copies, 384)
    assert psnr(baked[inside][:, :3], expected[inside][:, :3]) > 35.0


@pytest.mark.parametrize("is_float", [False, True])
def test_a_layout_over_two_tiles_is_baked_into_two(copies, scene, tmp_path, is_float):
    """Upper islands one unit further up than lower ones: each tile has its half of the picture and no more.

    What was baked is in the file: it is there after saving and opening, without the tiles' own files.
    """
    source, target, old, _ = copies
    uv_cube(source)
    pixels = photo(192)
    image = give_texture(source, pixels)
    if is_float:
        image = bpy.data.images.new("Light", 192, 192, alpha=True, float_buffer=True)
        image.pixels.foreach_set(pixels.ravel())
        source.data.materials[0].node_tree.nodes["Image Texture"].image = image
    place = {frozenset(face.vertices): face for face in source.data.polygons}
    before = read_uv(source.data, "UVMap")
    layer = target.data.uv_layers.new(name="Own")
    for face in target.data.polygons:
        twin = place[frozenset(old[list(face.vertices)].tolist())]
        upper = before[list(twin.loop_indices), 1].mean() > 0.5
        at = dict(zip(twin.vertices, twin.loop_indices, strict=True))
        for corner, vertex in zip(face.loop_indices, face.vertices, strict=True):
            layer.uv[corner].vector = before[at[old[vertex]]] + ((0.0, 1.0) if upper else (0.0, 0.0))
    for _ in range(2):
        transfer(source, target, kinds="textures", bake_margin=0)
    name, space = f"{image.name} Target", image.colorspace_settings.name
    assert len([made for made in bpy.data.images if made.name.startswith(name)]) == 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    made = bpy.data.images[name]
    assert (made.source, [tile.number for tile in made.tiles]) == ("TILED", [1001, 1011])
    assert made.colorspace_settings.name == space and made.is_float == is_float
    assert (
        bpy.data.objects["Target"].material_slots[0].material.node_tree.nodes["Image Texture"].image == made
    )
    inside = covered(copies, 192)
    row = np.arange(192)[:, None] >= 96
    for packed in made.packed_files:
        path = tmp_path / Path(packed.filepath).name
        path.write_bytes(packed.packed_file.data)
        tile = bpy.data.images.load(str(path))
        tile.colorspace_settings.name, tile.alpha_mode = space, made.alpha_mode
        values = np.empty(192 * 192 * 4, np.float32)
        tile.pixels.foreach_get(values)
        values = values.reshape(192, 192, 4)
        here = row == (packed.tile_number == 1011)
        assert psnr(values[inside & here][:, :3], pixels[inside & here][:, :3]) > 35.0
        assert not values[~here[:, 0]].any()


def test_a_layout_beyond_all_tiles_is_refused_in_words(copies):
    source, target, _, _ = copies
    uv_cube(source)
    give_texture(source, photo(32))
    layer = target.data.uv_layers.new(name="Own")
    layer.uv[0].vector = (-0.5, 0.0)
    with pytest.raises(RuntimeError, match="UV map 'Own' of 'Target' reaches out of the tiles"):
        transfer(source, target, kinds="textures")


def test_a_missing_tile_is_refused_in_words(copies, tmp_path):
    source, target, _, _ = copies
    uv_cube(source)
    image = give_texture(source, photo(32))
    image.source, image.filepath = "TILED", str(tmp_path / "skin.<UDIM>.png")
    target.data.uv_layers.new(name="Own")
    with pytest.raises(RuntimeError, match="Tile 1001 of image .* Save the image"):
        transfer(source, target, kinds="textures")


def normals_in_space(obj, uv, pixels):
    """Directions in object space that a normal map shows in the middle of each quad, (faces, 3)."""
    mesh = obj.data
    mesh.calc_tangents(uvmap=uv)
    parts = []
    for what, size in (("tangent", 3), ("normal", 3), ("bitangent_sign", 1)):
        values = np.empty(len(mesh.loops) * size, np.float32)
        mesh.loops.foreach_get(what, values)
        parts.append(values.reshape(-1, 4, size).astype(float))
    mesh.free_tangents()
    normal = parts[1].mean(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tangent = parts[0].mean(axis=1)
    tangent -= (tangent * normal).sum(axis=1, keepdims=True) * normal
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = parts[2][:, 0] * np.cross(normal, tangent)
    middle = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers[uv].uv.foreach_get("vector", middle)
    column, row = (middle.reshape(-1, 4, 2).mean(axis=1) * len(pixels)).astype(int).T
    local = pixels[row, column, :3] * 2.0 - 1.0
    found = local[:, :1] * tangent + local[:, 1:2] * bitangent + local[:, 2:] * normal
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def test_a_normal_map_is_expressed_in_the_new_tangents(copies, scene):
    """The copy's body and layout are turned: the directions that the two maps show are the same ones."""
    source, target, old, rotation = copies
    side = 384
    y, x = np.meshgrid(np.arange(side) / side, np.arange(side) / side, indexing="ij")
    lean = np.stack([0.5 * np.sin(8 * np.pi * x), 0.3 * np.cos(8 * np.pi * y)], axis=-1)
    normal = np.dstack([lean, np.sqrt(1 - (lean**2).sum(axis=-1))])
    pixels = np.dstack([normal * 0.5 + 0.5, np.ones((side, side))]).astype(np.float32)
    for obj in (source, target):
        obj.data.shade_smooth()
    baked, _ = rebaked(copies, scene, pixels, normal_map=True)
    # The picture as it is on the copy, whose layout `rebaked` turned back.
    shown = normals_in_space(target, "Own", np.rot90(baked, k=1))
    place = {frozenset(face.vertices): face.index for face in source.data.polygons}
    same = [place[frozenset(old[list(face.vertices)].tolist())] for face in target.data.polygons]
    expected = normals_in_space(source, "UVMap", pixels)[same] @ rotation.T
    angle = np.degrees(np.arccos(np.clip((shown * expected).sum(axis=1), -1.0, 1.0)))
    # A texel of the picture turns the normal by up to 2°, and its middle lies half a texel aside.
    assert np.mean(angle) < 1.5


def test_textures_need_a_layout_in_words(copies):
    source, target, _, _ = copies
    uv_cube(source)
    give_texture(source, photo(32))
    with pytest.raises(RuntimeError, match="Unwrap it first"):
        transfer(source, target, kinds="textures")


def rigged(copies):
    """Two bones in the body, connected, with weights that change along z."""
    source, target, old, rotation = copies
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail, roll in (
        ("Low", (0, 0, -1.2), (0.05, 0, 0), 0.3),
        ("High", (0.05, 0, 0), (0, 0.1, 1.2), -0.2),
    ):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.roll = head, tail, roll
    data.edit_bones["High"].parent = data.edit_bones["Low"]
    data.edit_bones["High"].use_connect = True
    bpy.ops.object.mode_set(mode="OBJECT")
    points = mesh_read.positions(source.data)
    for name, share in (
        ("Low", np.clip(0.5 - points[:, 2], 0, 1)),
        ("High", np.clip(0.5 + points[:, 2], 0, 1)),
    ):
        group = source.vertex_groups.new(name=name)
        for vertex, weight in enumerate(share.tolist()):
            if weight > 0.0:
                group.add([vertex], weight, "REPLACE")
    source.modifiers.new("Rig", "ARMATURE").object = rig
    source.parent = rig
    bpy.context.view_layer.update()
    return rig


def test_a_rig_follows_a_rigid_copy_exactly(copies):
    source, target, old, rotation = copies
    rig = rigged(copies)
    for _ in range(2):
        transfer(source, target, kinds="groups,armature")
    fitted = target.find_armature()
    assert fitted != rig and len([m for m in target.modifiers if m.type == "ARMATURE"]) == 1
    shift = turned(np.zeros((1, 3)))[0]
    for bone, made in zip(rig.data.bones, fitted.data.bones, strict=True):
        for end in ("head_local", "tail_local"):
            expected = rotation @ np.array(getattr(bone, end)) + shift
            np.testing.assert_allclose(fitted.matrix_world @ getattr(made, end), expected, atol=1e-4)
        z = rotation @ np.array(bone.matrix_local.to_3x3().col[2])
        assert np.dot(fitted.matrix_world.to_3x3() @ made.matrix_local.to_3x3().col[2], z) > 0.9999
        assert bone.use_connect == made.use_connect
    # The same pose moves both bodies alike.
    for armature in (rig, fitted):
        armature.pose.bones["High"].matrix_basis = Matrix.Rotation(0.8, 4, "X")
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    posed = [mesh_read.positions(obj.evaluated_get(graph).data).astype(float) for obj in (source, target)]
    expected = posed[0][old] @ rotation.T + shift
    np.testing.assert_allclose(posed[1], expected, atol=2e-4)


def test_locked_groups_and_masked_vertices_keep_what_they_have(scene):
    source = ball("Source", 16, 8)
    count = len(source.data.vertices)
    for name in ("A", "B"):
        source.vertex_groups.new(name=name).add(range(count), 0.5, "REPLACE")
    target = without_data(source, "Target")
    from test_transfer import store_identity

    store_identity(source, target)
    target.vertex_groups.new(name="A").add(range(count), 0.2, "REPLACE")
    target.vertex_groups["A"].lock_weight = True
    target.vertex_groups.new(name="Mask").add(range(10), 1.0, "REPLACE")
    transfer(source, target, kinds="groups", group_mask="Mask")
    carried = weights_of(target)
    assert all(carried[v, "A"] == pytest.approx(0.2) for v in range(count))
    assert {v for v, name in carried if name == "B"} == set(range(10))
    # As Normalize All leaves it: the row sums to 1 as the source's does.
    assert carried[0, "B"] == pytest.approx(0.8)
    transfer(source, target, kinds="groups", mirror_names=True)
    assert (50, "B") in weights_of(target)


def test_weights_of_other_bones_are_told_of(copies):
    """The target still hangs on a bone that is not carried, in a group that is not locked."""
    source, target, _, _ = copies
    rigged(copies)
    data = source.modifiers["Rig"].object.data
    data.bones["High"].name = "Old"
    source.vertex_groups["Old"].name = "Other"
    target.vertex_groups.new(name="Old").add(range(7), 1.0, "REPLACE")
    transfer(source, target, kinds="groups", items="groups/Low")
    low = {v for (v, name), weight in weights_of(target).items() if name == "Low" and weight > 1e-3}
    assert f"Weights of {len(low & set(range(7)))} vertices" in notice.words
    assert "other bones move them too: Old." in notice.words


def test_weights_leave_shape_keys_as_they_are(copies):
    """The mesh may differ from its Basis, as scripts leave it."""
    source, target, _, _ = copies
    source.vertex_groups.new(name="A").add(range(9), 1.0, "REPLACE")
    add_key(target, "Open", 0.1)
    apart = mesh_read.positions(target.data) + np.float32(0.05)
    target.data.vertices.foreach_set("co", apart.ravel())
    before = [read_key(key) for key in target.data.shape_keys.key_blocks]
    transfer(source, target, kinds="groups")
    np.testing.assert_array_equal([read_key(key) for key in target.data.shape_keys.key_blocks], before)
    np.testing.assert_array_equal(mesh_read.positions(target.data), apart)


def test_names_are_mirrored_on_request(scene):
    source = ball("Source", 16, 8)
    source.vertex_groups.new(name="Hand.L").add([1], 1.0, "REPLACE")
    target = without_data(source, "Target")
    from test_transfer import store_identity

    store_identity(source, target)
    transfer(source, target, kinds="groups", mirror_names=True)
    assert weights_of(target) == {(1, "Hand.R"): 1.0}


def test_rejected_vertices_are_filled_and_shown(scene):
    """Weights that are a linear function on a flat region come back there, though the map is wrong."""
    side = 20
    grid = np.arange(side * side).reshape(side, side)
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    source, target = new_object("Source", points, quads), new_object("Target", points, quads)
    first, second = source.vertex_groups.new(name="A"), source.vertex_groups.new(name="B")
    for v in range(len(points)):
        first.add([v], float(0.1 + 0.8 * points[v, 0]), "REPLACE")
        second.add([v], float(0.9 - 0.8 * points[v, 0]), "REPLACE")
    wrong = grid[5:12, 5:12].ravel()
    old = np.arange(side * side)
    old[wrong] = 0
    store_copy(source, target, old)
    trust = np.ones(side * side)
    trust[wrong] = 0.1
    write_attribute(target.data, "match_confidence", "FLOAT", "POINT", trust)
    transfer(source, target, kinds="groups", reject_below=0.3)
    carried = weights_of(target)
    for v in range(len(points)):
        assert carried[v, "A"] == pytest.approx(0.1 + 0.8 * points[v, 0], abs=1e-5)
        assert carried[v, "A"] + carried[v, "B"] == pytest.approx(1.0, abs=1e-6)
    shown = read_attribute(target.data.attributes["match_filled"])
    np.testing.assert_array_equal(np.flatnonzero(shown), wrong)
