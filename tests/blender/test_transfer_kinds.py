# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys, marks, materials, attributes, textures and rigs across a known map."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from conftest import choose, lumpy, new_object, renumbered, triangle_vertices, turned
from mathutils import Matrix
from test_transfer import ball, store_identity, store_map, store_nearest, transfer, weights_of, without_data

from addon import mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer import companions
from addon.transfer.layouts import read_uv
from addon.transfer.normals import corner_normals
from addon.transfer.shape_keys import read_key


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


@pytest.mark.parametrize("which", ["Source", "Target"])
def test_absolute_shape_keys_are_refused_in_words(copies, which):
    source, target, _, _ = copies
    for obj in (source, target):
        add_key(obj, f"Of {obj.name}", 0.0)
    bpy.data.objects[which].data.shape_keys.use_relative = False
    with pytest.raises(RuntimeError, match=f"'{which}' are absolute.*Check Relative"):
        transfer(source, target, kinds="keys")
    assert len(target.data.shape_keys.key_blocks) == 2


def test_shape_keys_replace_those_of_their_names(copies):
    """Ranges beyond the usual one, a driver that the source has not, a name that the target's basis has."""
    source, target, _, _ = copies
    source.shape_key_add(name="Reference", from_mix=False)
    add_key(source, "Wide", 0.1, slider_max=3.0, slider_min=2.0, value=2.5)
    add_key(source, "Deep", 0.1, slider_min=-5.0, slider_max=-2.0, value=-3.0)
    add_key(source, "Basis", 0.1)
    add_key(target, "Wide", 0.2).driver_add("value").driver.expression = "1.0"
    for _ in range(2):
        transfer(source, target, kinds="keys")
        keys = target.data.shape_keys
        assert [key.name for key in keys.key_blocks] == ["Basis", "Wide", "Deep", "Basis.001"]
        assert [(key.slider_min, key.slider_max, key.value) for key in keys.key_blocks[1:3]] == [
            (2.0, 3.0, 2.5),
            (-5.0, -2.0, -3.0),
        ]
        assert not keys.animation_data.drivers


def test_marks_come_back_on_a_copy(copies):
    """Curves on a renumbered copy are the very same edges, creases with their values."""
    source, target, old, _ = copies
    edges = mesh_read.edges(source.data)
    points = mesh_read.positions(source.data)
    rng = np.random.default_rng(4)
    low = points[edges].max(axis=1)[:, 2] < 0.1
    seam = low & (points[edges].min(axis=1)[:, 2] > -0.3) & (rng.random(len(edges)) < 0.6)
    crease = np.where(np.abs(points[edges][:, :, 0]).max(axis=1) < 1e-5, 0.7, 0.0)
    source.data.edges.foreach_set("use_seam", seam)
    write_attribute(source.data, "crease_edge", "FLOAT", "EDGE", crease)
    transfer(source, target, kinds="marks")
    same = same_edges(source, target, old)
    assert seam.sum() > 20
    carried = np.empty(len(seam), bool)
    target.data.edges.foreach_get("use_seam", carried)
    np.testing.assert_array_equal(carried, seam[same])
    np.testing.assert_allclose(read_attribute(target.data.attributes["crease_edge"]), crease[same], atol=1e-6)


def same_edges(source, target, old):
    """The source's edge of each edge of its renumbered copy."""
    place = {tuple(sorted(pair)): i for i, pair in enumerate(mesh_read.edges(source.data).tolist())}
    return [place[tuple(sorted(pair))] for pair in old[mesh_read.edges(target.data)].tolist()]


def same_faces(source, target, old):
    """The source's face of each face of its renumbered copy."""
    place = {frozenset(face.vertices): face.index for face in source.data.polygons}
    return [place[frozenset(old[list(face.vertices)].tolist())] for face in target.data.polygons]


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


@pytest.mark.parametrize("moved", [False, True])
def test_normals_of_a_whole_are_exact_on_pieces_that_lie_on_it(scene, moved):
    """Whatever the map is off, hard edges included; so the pieces show no seam where they meet."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    source.data.shade_smooth()
    rng = np.random.default_rng(2)
    sharp = rng.random(len(source.data.edges)) < 0.2
    write_attribute(source.data, "sharp_edge", "BOOLEAN", "EDGE", sharp)
    lean = corner_normals(source.data) + rng.normal(size=(len(source.data.loops), 3)) * 0.1
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    source.data.normals_split_custom_set(lean.tolist())
    given, rounding = corner_normals(source.data), 2e-3
    above = vertices[:, 2] > -0.2
    for chosen in (above, ~above):
        kept = [number for number, face in enumerate(faces) if chosen[face].sum() >= 2 + (chosen is above)]
        used, corners = np.unique(np.array(faces)[kept], return_inverse=True)
        places = turned(vertices[used]) if moved else vertices[used]
        piece = new_object("Piece", places, corners.reshape(-1, 4).tolist())
        piece.data.shade_smooth()
        # A map that is off by an edge at every third vertex.
        edges = np.array([edge.vertices[:] for edge in source.data.edges])
        neighbour = np.arange(len(vertices))
        neighbour[edges[:, 0]] = edges[:, 1]
        triangles = triangle_vertices(source.data)
        face, corner = np.empty((2, len(vertices)), int)
        for k in range(3):
            face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
        images = np.where(np.arange(len(used)) % 3, used, neighbour[used])
        store_map(source, piece, face[images], np.eye(3)[corner[images]])
        transfer(source, piece, kinds="normals")
        rotation = (turned(np.eye(3)) - turned(np.zeros((1, 3)))).T if moved else np.eye(3)
        expected = given.reshape(-1, 4, 3)[kept].reshape(-1, 3) @ rotation.T
        # Blender keeps two angles in 16 bits each, on the source and once more on the piece.
        assert np.linalg.norm(corner_normals(piece.data) - expected, axis=1).max() < 2 * rounding


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
    same_face = same_faces(source, target, old)
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
        transfer(source, target, kinds="textures", bake_unwrap="NEVER")


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


def test_uneven_scales_change_nothing_in_the_world(copies):
    """Keys, joints and eyes of a body whose object is stretched, onto one that is stretched otherwise."""
    source, target, old, rotation = copies
    points = mesh_read.positions(source.data).astype(float)
    for obj, scale in ((source, (1.0, 2.0, 0.5)), (target, (0.5, 0.7, 3.0))):
        obj.data.vertices.foreach_set("co", (mesh_read.positions(obj.data) / np.float32(scale)).ravel())
        obj.scale = scale
    bpy.context.view_layer.update()
    store_copy(source, target, old)
    rig = rigged(copies)
    field = smooth_field(points)
    add_key(source, "Smile", field / source.scale)
    eye = new_object("Eye", 0.08 * lumpy(3)[0] + (0.3, 0.4, 0.9), lumpy(3)[1])
    eye_points = mesh_read.positions(eye.data).astype(float)
    eye.parent, eye.matrix_parent_inverse = source, source.matrix_world.inverted()
    transfer(source, target, kinds="groups,keys,armature,objects")
    # Coordinates are single precision, and up to ten long.
    np.testing.assert_allclose(
        offsets_of(target, "Smile") * target.scale, field[old] @ rotation.T, rtol=0.0, atol=5e-6
    )
    fitted = target.find_armature()
    for bone, made in zip(rig.data.bones, fitted.data.bones, strict=True):
        np.testing.assert_allclose(
            fitted.matrix_world @ made.head_local, turned(np.array(bone.head_local)), atol=1e-5
        )
    (copy,) = copies_of("Eye")
    seen = [copy.matrix_world @ vertex.co for vertex in copy.data.vertices]
    np.testing.assert_allclose(seen, turned(eye_points), atol=1e-5)


def test_custom_normals_are_carried_as_uneven_scales_show_them(copies):
    source, target, old, rotation = copies
    lean = np.random.default_rng(10).normal(size=(len(source.data.vertices), 3)) * 0.2
    given = np.array([vertex.normal for vertex in source.data.vertices]) + lean
    given /= np.linalg.norm(given, axis=1, keepdims=True)

    def at_corners(obj, normals):
        return normals[mesh_read.corner_vertices(obj.data)]

    def unit(normals):
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def rounded(obj, normals):
        """Set the normals seen at the vertices; how far off they are as Blender keeps them."""
        obj.data.normals_split_custom_set_from_vertices(unit(normals * obj.scale).tolist())
        return np.linalg.norm(seen(obj) - at_corners(obj, normals), axis=1).max()

    def seen(obj):
        return unit(corner_normals(obj.data) / obj.scale)

    for obj, scale in ((source, (1.0, 2.0, 0.5)), (target, (0.5, 0.7, 1.5))):
        obj.data.vertices.foreach_set("co", (mesh_read.positions(obj.data) / np.float32(scale)).ravel())
        obj.scale = scale
    bpy.context.view_layer.update()
    store_copy(source, target, old)
    expected = given[old] @ rotation.T
    rounding = rounded(source, given) + rounded(target, expected)
    transfer(source, target, kinds="normals")
    found = seen(target)
    assert np.linalg.norm(found - at_corners(target, expected), axis=1).max() < 2 * rounding < 0.02


def copies_of(name):
    return [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") == name]


def rest_error(obj):
    """How far the evaluated mesh is from the modelled one."""
    bpy.context.view_layer.update()
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.abs(mesh_read.positions(shown) - mesh_read.positions(obj.data)).max()


@pytest.mark.parametrize("hidden", ["nothing", "rig", "target"])
def test_a_mirroring_or_hidden_rig_is_fitted_too(copies, hidden):
    """With X-Axis Mirror on, setting one of these bones would move the other one."""
    source, target, _, _ = copies
    rig = rigged(copies)
    rig.data.bones["Low"].name, rig.data.bones["High"].name = "Arm.L", "Arm.R"
    rig.data.use_mirror_x = True
    if hidden == "rig":
        rig.hide_viewport = True
    choose(source, target)
    if hidden == "target":
        bpy.ops.spectral_match.pin()
        away = bpy.data.collections.new("Away")
        bpy.context.scene.collection.children.link(away)
        away.objects.link(target)
        bpy.context.collection.objects.unlink(target)
        bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    assert bpy.ops.spectral_match.transfer(kinds="groups,armature") == {"FINISHED"}
    fitted = target.find_armature()
    for bone in rig.data.bones:
        for end in ("head_local", "tail_local"):
            found = fitted.matrix_world @ getattr(fitted.data.bones[bone.name], end)
            np.testing.assert_allclose(found, turned(np.array(getattr(bone, end))), atol=1e-4)
    assert fitted.data.use_mirror_x and fitted.hide_viewport == rig.hide_viewport
    assert set(fitted.users_collection) == set(target.users_collection)
    assert bpy.context.view_layer.objects.active == source and fitted.mode == "OBJECT"


def test_a_rig_without_bones_is_refused_in_words(copies):
    source, target, _, _ = copies
    rig = bpy.data.objects.new("Empty Rig", bpy.data.armatures.new("Empty Rig"))
    source.modifiers.new("Rig", "ARMATURE").object = rig
    source.vertex_groups.new(name="Group")
    with pytest.raises(RuntimeError, match="'Empty Rig' has no bones"):
        transfer(source, target, kinds="groups,armature")
    assert not target.vertex_groups and not target.modifiers


def add_bone(rig, name, head, tail):
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new(name)
    bone.head, bone.tail, bone.use_deform = head, tail, False
    bpy.ops.object.mode_set(mode="OBJECT")


def test_short_bones_keep_their_length(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    add_bone(rig, "Twig", (0.0, 0.1, 0.2), (0.0, 0.1, 0.20005))
    transfer(source, target, kinds="groups,armature")
    # Coordinates around 3 are rounded to 2.4e-7.
    assert target.find_armature().data.bones["Twig"].length == pytest.approx(5e-5, abs=5e-7)


def test_a_larger_body_is_at_rest_under_its_constraints(copies):
    """Each of these constraints stores a length or a matrix of the source's rig."""
    source, target, old, _ = copies
    larger = turned(2.0 * mesh_read.positions(source.data)[old])
    target.data.vertices.foreach_set("co", larger.astype(np.float32).ravel())
    store_copy(source, target, old)
    rig = rigged(copies)
    add_bone(rig, "Handle", (0.0, 0.1, 1.2), (0.0, 0.1, 1.5))
    made = [rig.pose.bones["High"].constraints.new(k) for k in ("STRETCH_TO", "CHILD_OF", "LIMIT_DISTANCE")]
    for constraint in made:
        constraint.target, constraint.subtarget = rig, "Handle"
    bpy.context.view_layer.update()
    made[1].inverse_matrix = (rig.matrix_world @ rig.pose.bones["Handle"].matrix).inverted()
    made[2].limit_mode = "LIMITDIST_ONSURFACE"
    made[2].distance = (rig.data.bones["Handle"].head_local - rig.data.bones["High"].head_local).length
    assert rest_error(source) < 1e-5
    for _ in range(2):
        transfer(source, target, kinds="groups,armature")
        assert rest_error(target) < 1e-4


def test_a_new_armature_modifier_is_set_as_the_source_s(copies):
    source, target, _, _ = copies
    rigged(copies)
    source.modifiers["Rig"].use_deform_preserve_volume = True
    target.modifiers.new("Smooth", "SUBSURF")
    transfer(source, target, kinds="groups,armature")
    assert [modifier.type for modifier in target.modifiers] == ["ARMATURE", "SUBSURF"]
    assert target.modifiers[0].use_deform_preserve_volume


def test_both_sides_of_a_mirrored_target_are_posed_by_themselves(copies):
    source, target, _, _ = copies
    rigged(copies)
    given = ["SUBSURF", "MIRROR", "TRIANGULATE", "SOLIDIFY"]
    for kind in given:
        target.modifiers.new(kind.title(), kind)
    transfer(source, target, kinds="groups,armature")
    assert [modifier.type for modifier in target.modifiers] == [*given[:3], "ARMATURE", given[3]]


def test_a_pinned_modifier_stays_the_last(copies):
    """As Shade Auto Smooth makes one."""
    source, target, _, _ = copies
    rigged(copies)
    target.modifiers.new("Smooth", "SUBSURF")
    target.modifiers.new("Smooth by Angle", "NODES").use_pin_to_last = True
    transfer(source, target, kinds="groups,armature")
    assert [modifier.type for modifier in target.modifiers] == ["ARMATURE", "SUBSURF", "NODES"]


@pytest.mark.parametrize("built", ["REMESH", "NODES"])
def test_what_modifiers_build_on_the_target_follows_its_rig(copies, built):
    """A voxel mesh, which has no vertex groups, and instances, which no armature moves."""
    source, target, _, _ = copies
    rigged(copies)
    modifier = target.modifiers.new("Built", built)
    if built == "REMESH":
        modifier.voxel_size = 0.1
    else:
        modifier.node_group = group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
        for way in ("INPUT", "OUTPUT"):
            group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        names = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeRealizeInstances")
        incoming, instances, real = (group.nodes.new(name) for name in names)
        cube, outgoing = (group.nodes.new(name) for name in ("GeometryNodeMeshCube", "NodeGroupOutput"))
        cube.inputs["Size"].default_value = (0.01, 0.01, 0.01)
        group.links.new(incoming.outputs[0], instances.inputs["Points"])
        group.links.new(cube.outputs["Mesh"], instances.inputs["Instance"])
        group.links.new(instances.outputs[0], real.inputs[0])
        group.links.new(real.outputs[0], outgoing.inputs[0])
    transfer(source, target, kinds="groups,armature")

    def middle():
        bpy.context.view_layer.update()
        shown = target.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        return mesh_read.positions(shown).mean(axis=0)

    before = middle()
    target.find_armature().pose.bones["Low"].location = (0.0, 1.0, 0.0)
    assert np.linalg.norm(middle() - before) == pytest.approx(1.0, abs=0.05)


def test_object_animation_does_not_move_what_was_fitted(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    target.location = (5.0, 0.0, 0.0)
    eye = small_ball("Eye", source)
    for obj in (rig, eye, rig.pose.bones["High"]):
        for frame in (1, 2):
            obj.location[0] += 0.1
            obj.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    transfer(source, target, kinds="groups,armature,objects")
    fitted, (copy,) = target.find_armature(), copies_of("Eye")
    before = [obj.matrix_world.copy() for obj in (fitted, copy)]
    bpy.context.scene.frame_set(2)
    for obj, matrix in zip((fitted, copy), before, strict=True):
        np.testing.assert_allclose(obj.matrix_world, matrix, atol=1e-6)
    # Poses stay animated, and the source as it was.
    assert fitted.pose.bones["High"].location[0] == rig.pose.bones["High"].location[0] == np.float32(0.2)
    assert rig.location[0] == np.float32(0.2)


def small_ball(name, parent=None, bone=""):
    obj = ball(name, 8, 6)
    obj.scale, obj.location = (0.1, 0.1, 0.1), (0.3, 0.4, 0.9)
    bpy.context.view_layer.update()
    there = obj.matrix_world.copy()
    if parent is not None:
        obj.parent = parent
        if bone:
            obj.parent_type, obj.parent_bone = "BONE", bone
        obj.matrix_world = there
    bpy.context.view_layer.update()
    return obj


def test_drivers_look_at_what_the_target_got(copies):
    """A key driven by a bone, lashes driven by that key; the rig comes after the keys."""
    source, target, _, _ = copies
    rig = rigged(copies)
    lash = small_ball("Lash", source)
    for obj, kind, seen, path in (
        (source, "OBJECT", rig, 'pose.bones["High"].location[0]'),
        (lash, "KEY", None, 'key_blocks["Blink"].value'),
    ):
        driver = add_key(obj, "Blink", 0.05).driver_add("value").driver
        variable = driver.variables.new()
        variable.targets[0].id_type = kind
        variable.targets[0].id = seen or source.data.shape_keys
        variable.targets[0].data_path, driver.expression = path, "var"
    transfer(source, target, kinds="groups,keys,objects")
    transfer(source, target, kinds="armature")
    (copy,) = copies_of("Lash")
    for obj, seen in ((target, target.find_armature()), (copy, target.data.shape_keys)):
        (curve,) = obj.data.shape_keys.animation_data.drivers
        assert curve.driver.variables[0].targets[0].id == seen
    target.find_armature().pose.bones["High"].location[0] = 0.5
    graph = bpy.context.evaluated_depsgraph_get()
    assert copy.evaluated_get(graph).data.shape_keys.key_blocks["Blink"].value == pytest.approx(0.5)


def test_a_mirrored_match_mirrors_rig_and_eyes_and_names(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    target = new_object("Target", vertices * (-1, 1, 1), [face[::-1] for face in faces])
    from test_transfer import store_identity

    store_identity(source, target)
    rig = rigged((source, target, None, None))
    add_bone(rig, "hand_l_01", (0.3, 0.1, 0.2), (0.4, 0.1, 0.3))
    rig.data.bones["Low"].name, rig.data.bones["High"].name = "mixamorig:LeftArm", "Arm.R"
    add_key(source, "Blink.L", 0.05, vertex_group="Arm.R")
    driver = source.data.shape_keys.key_blocks["Blink.L"].driver_add("value").driver
    variable = driver.variables.new()
    variable.type = "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].bone_target = rig, "Arm.R"
    eye = small_ball("Eye", rig, "Arm.R")
    eye.vertex_groups.new(name="Arm.R")
    add_key(eye, "Wide.L", 0.0)
    for _ in range(2):
        transfer(source, target, kinds="groups,keys,armature,objects", mirror_names=True)
    fitted, named = target.find_armature(), {"mixamorig:LeftArm": "mixamorig:RightArm", "Arm.R": "Arm.L"}
    named["hand_l_01"] = "hand_r_01"
    for bone in rig.data.bones:
        for end in ("head_local", "tail_local"):
            found = fitted.matrix_world @ getattr(fitted.data.bones[named.get(bone.name, bone.name)], end)
            np.testing.assert_allclose(found, np.array(getattr(bone, end)) * (-1, 1, 1), atol=1e-5)
    assert [group.name for group in target.vertex_groups] == list(named.values())[:2]
    key = target.data.shape_keys.key_blocks[1]
    assert (key.name, key.vertex_group) == ("Blink.R", "Arm.L")
    seen = target.data.shape_keys.animation_data.drivers[0].driver.variables[0].targets[0]
    assert (seen.id, seen.bone_target) == (fitted, "Arm.L")
    assert not notice.words
    (copy,) = copies_of("Eye")
    assert (copy.parent, copy.parent_bone) == (fitted, "Arm.L")
    assert copy.vertex_groups.keys() == ["Arm.L"]
    assert copy.data.shape_keys.key_blocks.keys() == ["Basis", "Wide.R"]
    bpy.context.view_layer.update()
    found = [copy.matrix_world @ vertex.co for vertex in copy.data.vertices]
    expected = [eye.matrix_world @ vertex.co for vertex in eye.data.vertices]
    # The surface is a polyhedron: where the eye hangs, frames of its vertices differ by a hundredth.
    np.testing.assert_allclose(found, np.array(expected) * (-1, 1, 1), atol=0.02 * 0.1 + 1e-3)


def paths_of(action):
    if not hasattr(action, "layers"):
        return [curve.data_path for curve in action.fcurves]
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve.data_path for bag in bags for curve in bag.fcurves]


def stripped(holder):
    """The animation of an ID as an NLA strip of the same action twice."""
    held = holder.animation_data
    action, held.action = held.action, None
    for start in (1, 50):
        held.nla_tracks.new().strips.new(action.name, start, action)
    return action


def test_mirrored_names_leave_actions_and_masks_of_the_source_alone(scene):
    """Animation of bones and keys, in strips and as the action, is the source's own."""
    source = ball("Source", 16, 8)
    target = without_data(source, "Target")
    from test_transfer import store_identity

    store_identity(source, target)
    rig = rigged((source, target, None, None))
    rig.data.bones["High"].name = "Arm.L"
    rig.pose.bones["Arm.L"].keyframe_insert("location", frame=1)
    posing = stripped(rig)
    rig.pose.bones["Arm.L"].keyframe_insert("location", frame=1)
    rig.keyframe_insert("location", frame=1)
    moving = stripped(rig)
    rig.pose.bones["Arm.L"].keyframe_insert("scale", frame=1)
    other = bpy.data.objects.new("Other", bpy.data.armatures.new("Other"))
    bpy.context.collection.objects.link(other)
    add_bone(other, "Hand.L", (0, 0, 0), (0, 0, 0.5))
    source.modifiers.new("Other", "ARMATURE").object = other
    source.modifiers["Other"].vertex_group = "Arm.L"
    constraint = rig.pose.bones["Arm.L"].constraints.new("IK")
    constraint.target = constraint.pole_target = other
    constraint.subtarget = constraint.pole_subtarget = "Hand.L"
    eye = small_ball("Eye", source)
    eye.vertex_groups.new(name="Lid.L")
    eye.modifiers.new("Mask", "MASK").vertex_group = "Lid.L"
    wide = add_key(eye, "Wide.L", 0.1, vertex_group="Lid.L")
    wide.keyframe_insert("value", frame=1)
    transfer(source, target, kinds="groups,armature,objects", mirror_names=True)
    assert set(paths_of(posing)) == {'pose.bones["Arm.L"].location'}
    assert set(paths_of(moving)) == {'pose.bones["Arm.L"].location', "location"}
    assert set(paths_of(rig.animation_data.action)) == {'pose.bones["Arm.L"].scale'}
    assert paths_of(eye.data.shape_keys.animation_data.action) == ['key_blocks["Wide.L"].value']
    fitted, own = (modifier.object for modifier in target.modifiers)
    strips = [strip for track in fitted.animation_data.nla_tracks for strip in track.strips]
    assert len(strips) == 4 and len({strip.action for strip in strips}) == 2
    for strip in strips:
        # What moves the object is gone from the copies.
        assert set(paths_of(strip.action)) == {'pose.bones["Arm.R"].location'}
        # From Blender 4.4.
        if hasattr(strip, "action_slot"):
            assert strip.action_slot == strip.action.slots[0]
    assert set(paths_of(fitted.animation_data.action)) == {'pose.bones["Arm.R"].scale'}
    (held,) = fitted.pose.bones["Arm.R"].constraints
    assert (held.target, held.subtarget, held.pole_subtarget) == (own, "Hand.R", "Hand.R")
    assert target.modifiers[1].vertex_group == "Arm.R"
    (copy,) = copies_of("Eye")
    assert paths_of(copy.data.shape_keys.animation_data.action) == ['key_blocks["Wide.R"].value']
    assert copy.modifiers["Mask"].vertex_group == "Lid.R"
    assert copy.data.shape_keys.key_blocks["Wide.R"].vertex_group == "Lid.R"


@pytest.mark.skipif(bpy.app.version < (4, 4), reason="actions have slots from Blender 4.4")
def test_object_animation_of_any_slot_is_taken_from_a_copy(copies):
    """Two rigs share an action: the curves of the second slot move the second rig."""
    source, target, _, _ = copies
    rig = rigged(copies)
    first = bpy.data.objects.new("First", None)
    first.keyframe_insert("location", frame=1)
    rig.animation_data_create().action = first.animation_data.action
    rig.animation_data.action_slot = rig.animation_data.action.slots.new("OBJECT", "Rig")
    for frame in (1, 2):
        rig.location[0] = frame
        rig.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    transfer(source, target, kinds="groups,armature")
    fitted = target.find_armature()
    before = fitted.matrix_world.copy()
    bpy.context.scene.frame_set(2)
    np.testing.assert_allclose(fitted.matrix_world, before, atol=1e-6)


def test_a_rig_that_is_replaced_is_told_of(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    transfer(source, target, kinds="groups,armature")
    first = target.find_armature()
    add_bone(rig, "Jaw", (0, 0, 0), (0, 0, 0.5))
    transfer(source, target, kinds="groups,armature")
    assert target.find_armature() == target.parent != first
    assert "'Target' got a new rig. 'Target Rig' stays in the scene" in notice.words
    transfer(source, target, kinds="groups,armature")
    assert not notice.words


def test_a_duplicate_of_a_target_gets_a_rig_of_its_own(copies):
    source, target, _, _ = copies
    rigged(copies)
    transfer(source, target, kinds="groups,armature")
    first = target.find_armature()
    second = target.copy()
    second.data = target.data.copy()
    bpy.context.collection.objects.link(second)
    transfer(source, second, kinds="groups,armature")
    assert target.find_armature() == target.parent == first
    assert second.find_armature() == second.parent != first
    assert [len(obj.modifiers) for obj in (target, second)] == [1, 1]


def test_copies_move_to_a_rig_that_is_carried_later(copies):
    """Objects first: they hang on the target; of two rigs each gets what hangs on it."""
    source, target, _, _ = copies
    rig = rigged(copies)
    other = bpy.data.objects.new("Other", bpy.data.armatures.new("Other"))
    bpy.context.collection.objects.link(other)
    add_bone(other, "Jaw", (0, 0, 0), (0, 0, 0.5))
    source.modifiers.new("Other", "ARMATURE").object = other
    bpy.context.view_layer.update()
    for name, held, bone in (("Eye", rig, "High"), ("Tooth", other, "Jaw")):
        small_ball(name, held, bone).constraints.new("LIMIT_LOCATION").name = f"On {name}"
    transfer(source, target, kinds="groups,objects")
    assert "On Eye of 'Eye', On Tooth of 'Tooth'" in notice.words
    before = {}
    for name in ("Eye", "Tooth"):
        (copy,) = copies_of(name)
        assert copy.parent == target
        before[name] = copy.matrix_world.copy()
    transfer(source, target, kinds="groups,armature,objects")
    fitted, own = (modifier.object for modifier in target.modifiers)
    for name, held, bone in (("Eye", fitted, "High"), ("Tooth", own, "Jaw")):
        (copy,) = copies_of(name)
        assert (copy.parent, copy.parent_bone) == (held, bone)
        np.testing.assert_allclose(copy.matrix_world, before[name], atol=1e-5)


def test_constraints_are_fitted_to_what_the_target_got(copies):
    """A bone stretched to a ball that hangs on the body is at rest where the ball's copy is."""
    source, target, _, _ = copies
    rig = rigged(copies)
    ball_there = small_ball("Goal", source)
    tip = rig.pose.bones["High"]
    held = tip.constraints.new("STRETCH_TO")
    held.target = ball_there
    distance = (ball_there.matrix_world.translation - rig.matrix_world @ tip.bone.head_local).length
    held.rest_length = distance
    transfer(source, target, kinds="groups,armature,objects")
    (copy,) = copies_of("Goal")
    fitted = target.find_armature()
    made = fitted.pose.bones["High"]
    assert made.constraints[0].target == copy
    reach = (copy.matrix_world.translation - fitted.matrix_world @ made.bone.head_local).length
    assert made.constraints[0].rest_length == pytest.approx(reach, rel=1e-5)


def test_drivers_of_keys_that_were_never_carried_stay(copies):
    source, target, _, _ = copies
    add_key(source, "Smile", 0.1)
    variable = add_key(target, "Own", 0.1).driver_add("value").driver.variables.new()
    variable.targets[0].id = source
    transfer(source, target, kinds="keys")
    assert variable.targets[0].id == source


def test_what_hangs_on_rig_bones_and_other_objects_comes_along(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    eye = small_ball("Eye", rig, "High")
    small_ball("Pupil", eye)
    small_ball("Hat", rig)
    shape = small_ball("Shape", rig)
    rig.pose.bones["Low"].custom_shape = shape
    small_ball("Stone")
    cloud = bpy.data.objects.new("Cloud", bpy.data.pointclouds.new("Cloud"))
    bpy.context.collection.objects.link(cloud)
    cloud.parent = source
    points = [eye.matrix_world @ vertex.co for vertex in eye.data.vertices]
    assert companions.names(source) == ["Eye", "Hat", "Pupil"]
    # A posed source counts as it is at rest.
    rig.pose.bones["High"].matrix_basis = Matrix.Rotation(0.8, 4, "X")
    bpy.context.view_layer.update()
    transfer(source, target, kinds="groups,armature,objects")
    assert "cannot follow the target: 'Cloud'" in notice.words
    fitted = target.find_armature()
    for name, bone in (("Eye", "High"), ("Pupil", "High"), ("Hat", "")):
        (copy,) = copies_of(name)
        assert (copy.parent, copy.parent_bone) == (fitted, bone)
    (copy,) = copies_of("Eye")
    for pose in (0.0, 0.8):
        fitted.pose.bones["High"].matrix_basis = Matrix.Rotation(pose, 4, "X")
        bpy.context.view_layer.update()
        held = fitted.matrix_world @ fitted.pose.bones["High"].matrix
        rest = fitted.matrix_world @ fitted.data.bones["High"].matrix_local
        moved = np.array(held @ rest.inverted())
        found = [copy.matrix_world @ vertex.co for vertex in copy.data.vertices]
        expected = turned(np.array(points)) @ moved[:3, :3].T + moved[:3, 3]
        np.testing.assert_allclose(found, expected, atol=1e-4)


def test_an_edited_companion_is_copied_anew(copies):
    """Its copy hangs where it hung; a Shrinkwrap onto the source is one onto the target."""
    source, target, _, _ = copies
    eye = small_ball("Eye", source)
    eye.modifiers.new("Wrap", "SHRINKWRAP").target = source
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Eye")
    assert copy.modifiers["Wrap"].target == target
    before = copy.data.name
    choose(eye)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    add_key(eye, "Wide", 0.1)
    transfer(source, target, kinds="objects")
    assert copies_of("Eye") == [copy] and copy.data.name.startswith(before)
    np.testing.assert_array_equal(mesh_read.edges(copy.data), mesh_read.edges(eye.data))
    assert [key.name for key in copy.data.shape_keys.key_blocks] == ["Basis", "Wide"]
    points = [eye.matrix_world @ vertex.co for vertex in eye.data.vertices]
    np.testing.assert_allclose(mesh_read.positions(copy.data), turned(np.array(points)), atol=1e-4)


def test_linked_data_is_taken_before_local_data_of_its_name(copies, tmp_path):
    source, target, _, _ = copies
    rigged(copies)
    small_ball("Eye", source)
    file = str(tmp_path / "hero.blend")
    bpy.data.libraries.write(file, {source, bpy.data.objects["Eye"]})
    for name in ("Source", "Rig", "Eye"):
        bpy.data.objects.remove(bpy.data.objects[name])
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    new_object("Eye", *lumpy(4))
    with bpy.data.libraries.load(file, link=True) as (_, here):
        here.objects = ["Source", "Eye"]
    for obj in here.objects:
        bpy.context.collection.objects.link(obj)
    source = here.objects[0]
    target.spectral_match_source = source
    bpy.context.view_layer.update()
    transfer(source, target, kinds="groups,armature,objects")
    assert [bone.name for bone in target.find_armature().data.bones] == ["Low", "High"]
    (copy,) = copies_of("Eye")
    assert len(copy.data.vertices) == len(here.objects[1].data.vertices)


def overridden(tmp_path, *objects):
    """A local override of a linked collection with these objects, which leave this file."""
    file = str(tmp_path / "character.blend")
    character = bpy.data.collections.new("Character")
    for obj in objects:
        character.objects.link(obj)
    bpy.data.libraries.write(file, {character})
    for obj in objects:
        bpy.data.objects.remove(obj)
    bpy.data.collections.remove(character)
    with bpy.data.libraries.load(file, link=True) as (_, here):
        here.collections = ["Character"]
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.collection.children.link(here.collections[0])
    own = here.collections[0].override_hierarchy_create(scene, layer, do_fully_editable=True)
    layer.update()
    return own


def test_copies_of_library_overrides_are_local(copies, tmp_path):
    source, target, _, _ = copies
    rig = rigged(copies)
    character = overridden(tmp_path, source, rig, small_ball("Eye", rig, "High"))
    source = target.spectral_match_source = character.all_objects["Source"]
    transfer(source, target, kinds="groups,armature,objects")
    (eye,) = copies_of("Eye")
    fitted = target.find_armature()
    assert (eye.parent, eye.parent_bone) == (fitted, "High")
    assert not any(made.override_library for obj in (eye, fitted) for made in (obj, obj.data))
    assert rest_error(target) < 1e-5


def test_copies_are_put_beside_a_target_in_an_overridden_collection(copies, tmp_path):
    """As Make Local leaves an override."""
    source, target, _, _ = copies
    rig = rigged(copies)
    small_ball("Eye", rig, "High")
    character = overridden(tmp_path, target)
    target = character.all_objects["Target"]
    for made in (target, target.data):
        made.make_local(clear_liboverride=True)
    target.spectral_match_source = source
    transfer(source, target, kinds="groups,armature,objects")
    scene = bpy.context.scene.collection.objects
    assert target.find_armature().name in scene and copies_of("Eye")[0].name in scene


def test_renamed_originals_are_known_by_their_copies(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    eye = small_ball("Eye", rig, "High")
    transfer(source, target, kinds="groups,armature,objects")
    rig.name, eye.name, target.name = "Skeleton", "Left Eye", "Orc"
    small_ball("Eye", rig, "Low")
    before = set(bpy.data.objects)
    transfer(source, target, kinds="groups,armature,objects")
    (other,) = set(bpy.data.objects) - before
    assert other.parent_bone == "Low" and [m.type for m in target.modifiers] == ["ARMATURE"]


def test_an_original_that_comes_back_is_known_by_its_name(copies):
    source, target, _, _ = copies
    small_ball("Eye", source)
    transfer(source, target, kinds="objects")
    bpy.data.objects.remove(bpy.data.objects["Eye"])
    small_ball("Eye", source)
    transfer(source, target, kinds="objects")
    assert len(copies_of("Eye")) == 1


def test_what_a_target_got_goes_on_to_the_next(copies):
    source, target, _, _ = copies
    rig = rigged(copies)
    small_ball("Eye", rig, "High")
    transfer(source, target, kinds="groups,armature,objects")
    third = new_object(
        "Third", 2.0 * mesh_read.positions(target.data), [p.vertices for p in target.data.polygons]
    )
    store_copy(target, third, np.arange(len(third.data.vertices)))
    assert companions.names(source) == ["Eye"] and companions.names(target) == ["Eye Target"]
    transfer(target, third, kinds="groups,armature,objects")
    (copy,) = copies_of("Eye Target")
    assert (copy.parent, copy.parent_bone) == (third.find_armature(), "High")
    (first,) = copies_of("Eye")
    places = [mesh_read.positions(obj.data) for obj in (first, copy)]
    np.testing.assert_allclose(places[1], 2.0 * places[0], atol=1e-4)


@pytest.mark.parametrize("hidden", ["excluded", "switched off"])
def test_a_hidden_source_of_an_opened_file_stands_where_it_stood(copies, tmp_path, hidden):
    """Blender does not place it before it is shown."""
    source, target, _, _ = copies
    rig = rigged(copies)
    small_ball("Eye", rig, "High")
    root = bpy.data.objects.new("Root", None)
    root.matrix_world = Matrix.LocRotScale((1.0, 2.0, 3.0), Matrix.Rotation(0.7, 3, "X"), (2.0, 2.0, 2.0))
    rig.parent = root
    source.location.x += 0.5
    kept = bpy.data.collections.new("Kept")
    bpy.context.scene.collection.children.link(kept)
    for obj in (source, rig, root, bpy.data.objects["Eye"]):
        kept.objects.link(obj)
        if obj != root:
            bpy.context.scene.collection.objects.unlink(obj)
    settings = bpy.context.scene.spectral_match
    settings.pinned, settings.source, settings.target = True, source, target
    found = []
    for hide in (False, True):
        if hidden == "excluded":
            bpy.context.view_layer.layer_collection.children["Kept"].exclude = hide
        else:
            for obj in kept.objects:
                obj.hide_viewport = hide
        file = str(tmp_path / f"{hide}.blend")
        bpy.ops.wm.save_as_mainfile(filepath=file)
        bpy.ops.wm.open_mainfile(filepath=file)
        assert bpy.ops.spectral_match.transfer(kinds="groups,armature,objects") == {"FINISHED"}
        bpy.context.view_layer.update()
        target, (eye,) = bpy.data.objects["Target"], copies_of("Eye")
        fitted, source = target.find_armature(), target.spectral_match_source
        joints = [fitted.matrix_world @ bone.tail_local for bone in fitted.data.bones]
        found.append(np.array([*joints, *(eye.matrix_world @ vertex.co for vertex in eye.data.vertices)]))
        assert source.hide_viewport == (hide and hidden != "excluded")
        assert not hide or source.name not in bpy.context.scene.collection.objects
        # Undone for the second way.
        bpy.ops.wm.open_mainfile(filepath=file)
        kept = bpy.data.collections["Kept"]
    np.testing.assert_allclose(found[1], found[0], atol=1e-4)


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


def test_locked_groups_of_bones_of_the_target_alone_count_too(scene):
    """A locked group of a bone that only the target has; with a rig to ask, a locked mask does not count."""
    source = ball("Source", 16, 8)
    count = len(source.data.vertices)
    target = without_data(source, "Target")
    from test_transfer import store_identity

    store_identity(source, target)
    for obj, bone in ((source, "Arm"), (target, "Tail")):
        rig = bpy.data.objects.new(bone, bpy.data.armatures.new(bone))
        bpy.context.collection.objects.link(rig)
        add_bone(rig, bone, (0, 0, 0), (0, 0, 1))
        rig.data.bones[bone].use_deform = True
        obj.modifiers.new(bone, "ARMATURE").object = rig
    source.vertex_groups.new(name="Arm").add(range(count), 1.0, "REPLACE")
    for name, weight in (("Tail", 0.4), ("Mask", 0.5)):
        target.vertex_groups.new(name=name).add(range(count), weight, "REPLACE")
        target.vertex_groups[name].lock_weight = True
    for _ in range(2):
        transfer(source, target, kinds="groups")
        assert weights_of(target)[0, "Arm"] == pytest.approx(0.6)
        # Without a rig of the source the target's is asked.
        source.modifiers.clear()


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
    # What counts is the name that a group gets on the target.
    source.data.attributes.new("Hand.R", "FLOAT", "POINT")
    target.vertex_groups.clear()
    with pytest.raises(RuntimeError, match="both a vertex group and an attribute named 'Hand.R'"):
        transfer(source, target, kinds="groups,attributes", mirror_names=True)
    assert not target.vertex_groups


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


def test_keys_that_move_nothing_on_the_target_are_left_out(scene):
    """Those that it does not reach; not those that others build on, that are empty on purpose, or there."""
    vertices, faces = lumpy()
    above = vertices[:, 2] > -0.5
    kept = [face for face in faces if above[face].all()]
    used = np.unique(kept)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    source = new_object("Source", vertices, faces)
    target = new_object("Target", vertices[used], number[np.array(kept)].tolist())
    store_nearest(source, target)
    low = np.where(vertices[:, 2:] < -0.9, 0.2, 0.0)
    high = np.where(vertices[:, 2:] > 0.6, 0.2, 0.0)
    for name, offsets in (("Low", low), ("High", high), ("Empty", 0.0), ("Base", low), ("Read", low)):
        add_key(source, name, offsets)
    add_key(source, "Upon", high).relative_key = source.data.shape_keys.key_blocks["Base"]
    add_key(source, "Own", low)
    add_key(target, "Own", 0.1)
    driver = source.data.shape_keys.key_blocks["High"].driver_add("value").driver
    seen = driver.variables.new().targets[0]
    seen.id_type, seen.id, seen.data_path = "KEY", source.data.shape_keys, 'key_blocks["Read"].value'
    transfer(source, target, kinds="keys")
    keys = target.data.shape_keys.key_blocks.keys()
    assert sorted(keys) == ["Base", "Basis", "Empty", "High", "Own", "Read", "Upon"]
    assert "1 shape key moves nothing on 'Target' and was left out: Low" in notice.words
    assert notice.done() == "Done: 6 keys"
    assert not offsets_of(target, "Own").any()
    transfer(source, target, kinds="keys", skip_still=False)
    assert "Low" in target.data.shape_keys.key_blocks and not notice.words


def test_what_keys_bring_together_meets_unless_told_otherwise(scene):
    """Two plates, farther apart on the target. A key upon another one is carried as it is."""
    side = np.linspace(-1.0, 1.0, 17)
    x, y = (c.ravel() for c in np.meshgrid(side, side))
    cell = np.add.outer(17 * np.arange(16), np.arange(16)).ravel()
    low = np.stack([cell, cell + 1, cell + 18, cell + 17], 1)
    faces = np.concatenate([low, low[:, ::-1] + len(x)])
    n, middle = len(x), len(x) + len(x) // 2
    source, target = (
        new_object(
            name,
            np.concatenate([np.stack([x, y, 0.0 * x], 1), np.stack([x, y, gap + 0.0 * x], 1)]),
            faces.tolist(),
        )
        for name, gap in (("Source", 1.0), ("Target", 1.5))
    )
    store_identity(source, target)
    down = np.zeros((2 * n, 3))
    down[n:, 2] = -0.98 * np.sqrt(np.maximum(1.0 - (x**2 + y**2) / 0.7, 0.0))
    # The other plate stirs at a corner: what stands still and is large takes no part.
    down[0] = -0.1, -0.1, 0.0
    add_key(source, "Shut", down)
    add_key(source, "Upon", 2.0 * down).relative_key = source.data.shape_keys.key_blocks["Shut"]
    for option, wanted in (({}, -0.98 * 1.5), ({"keep_contacts": False}, -0.98)):
        transfer(source, target, kinds="keys", **option)
        # Corrections are averaged over half an edge, a fourteenth of the way over which they fade.
        shut = offsets_of(target, "Shut")
        assert shut[middle, 2] == pytest.approx(wanted, abs=0.03)
        assert not shut[1:n].any()
        assert offsets_of(target, "Upon")[middle, 2] == pytest.approx(-0.98, abs=1e-5)
