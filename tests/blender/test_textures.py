# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked textures as Blender's renderer shows them: the same picture on the copy as on the source."""

import struct
import zlib

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object, renumbered, turned
from mathutils import Euler
from test_transfer import transfer
from test_transfer_kinds import give_texture, photo, psnr, store_copy, uv_cube

from addon import mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer.layouts import read_uv


class Body:
    """A lumpy body with a picture that shines, and a turned, renumbered copy with a layout of its own."""

    def __init__(self, pixels):
        vertices, faces = lumpy()
        moved, other_faces, self.old = renumbered(vertices, faces)
        self.source = new_object("Source", vertices, faces)
        self.target = new_object("Target", turned(moved), other_faces)
        store_copy(self.source, self.target, self.old)
        uv_cube(self.source)
        self.image = give_texture(self.source, pixels)
        self.material = self.source.data.materials[0]
        self.nodes, self.links = self.material.node_tree.nodes, self.material.node_tree.links
        self.node = self.nodes["Image Texture"]
        self.light = self.nodes.new("ShaderNodeEmission")
        self.links.new(self.node.outputs["Color"], self.light.inputs["Color"])
        self.links.new(self.light.outputs[0], self.nodes["Material Output"].inputs["Surface"])
        self.lay_out("Own")

    def lay_out(self, name):
        """Give the target the source's layout, turned by a right angle."""
        layer = self.target.data.uv_layers.new(name=name, do_init=False)
        uv = self.at_twins(read_uv(self.source.data, "UVMap"))
        layer.uv.foreach_set("vector", np.column_stack([uv[:, 1], 1.0 - uv[:, 0]]).astype(np.float32).ravel())
        return layer

    def at_twins(self, values):
        """Values at the source's corners, at the target's."""
        place = {frozenset(face.vertices): face for face in self.source.data.polygons}
        found = np.empty_like(values)
        for face in self.target.data.polygons:
            twin = place[frozenset(self.old[list(face.vertices)].tolist())]
            at = dict(zip(twin.vertices, twin.loop_indices, strict=True))
            for corner, vertex in zip(face.loop_indices, face.vertices, strict=True):
                found[corner] = values[at[self.old[vertex]]]
        return found

    def second_map(self):
        """A second UV map of the source, u and v exchanged."""
        uv = read_uv(self.source.data, "UVMap")[:, ::-1]
        layer = self.source.data.uv_layers.new(name="Second", do_init=False)
        layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).ravel())

    def chain(self, *nodes):
        """Link nodes one after the other, the last one to the image node's Vector."""
        for before, after in zip(nodes, (*nodes[1:], self.node), strict=True):
            into = after.inputs["Vector"] if "Vector" in after.inputs else after.inputs[0]
            out = next((out for out in before.outputs if out.name in {"UV", "Vector"}), before.outputs[0])
            self.links.new(out, into)

    def uv_map(self, name):
        node = self.nodes.new("ShaderNodeUVMap")
        node.uv_map = name
        return node

    def mapping(self, **settings):
        node = self.nodes.new("ShaderNodeMapping")
        node.vector_type = settings.pop("vector_type", "POINT")
        for name, value in settings.items():
            node.inputs[name].default_value = value
        return node

    def likeness(self):
        """How near what the target shows comes to what the source shows, dB."""
        return psnr(shown(self.target), self.at_twins(shown(self.source)))

    def baked(self):
        """The image nodes' images in the target's material."""
        nodes = self.target.material_slots[0].material.node_tree.nodes
        return [node.image for node in nodes if node.type == "TEX_IMAGE"]


@pytest.fixture
def body(scene):
    return Body(photo(256))


def shown(obj):
    """Colours that the renderer shows at the corners, (corners, 3)."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 1
    scene.render.bake.target = "VERTEX_COLORS"
    colours = obj.data.color_attributes
    colours.active_color = colours.new("Shown", "FLOAT_COLOR", "CORNER")
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.bake(type="EMIT")
    found = read_attribute(colours["Shown"])[:, :3].copy()
    colours.remove(colours["Shown"])
    return found


def texels(image):
    values = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], image.channels)


def reopened(tmp_path):
    path = str(tmp_path / "baked.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)


# Renderer and core filter differently: two pictures that are the same come to 50 dB.
SAME = 45.0
# Where the source's texels are half as large as the baked ones, detail of their size is lost.
FINER = 28.0


@pytest.mark.parametrize("name", [None, "UVMap", "Own"])
def test_textures_together_with_uv_maps_show_the_same_picture(body, name):
    """Baked into a map of the target's own, whatever its name; by the source's map where there is none."""
    layers = body.target.data.uv_layers
    if name is None:
        layers.remove(layers[0])
    else:
        layers[0].name = name
    transfer(body.source, body.target, kinds="uv,textures")
    assert body.likeness() > SAME
    baked = body.baked() != [body.image]
    assert baked == (name is not None)
    assert baked != ("were not baked" in notice.words)


def test_carrying_uv_maps_and_textures_twice_is_carrying_them_once(body):
    """The target's own map, into which is baked, stays the active one."""
    for _ in range(2):
        transfer(body.source, body.target, kinds="uv,materials,textures")
        assert body.target.data.uv_layers.active.name == "Own"
        assert body.target.data.uv_layers.keys() == ["Own", "UVMap"]
        assert body.baked() != [body.image]
        assert body.likeness() > SAME


def test_a_map_that_the_source_s_comes_over_shows_no_bake_any_more(body):
    body.target.data.uv_layers[0].name = "UVMap"
    transfer(body.source, body.target, kinds="textures")
    transfer(body.source, body.target, kinds="uv,materials,textures", replace_uv=True)
    assert body.likeness() > SAME
    assert len(body.target.material_slots) == 1


def test_a_bake_shows_through_its_own_map(body):
    body.target.data.uv_layers.new(name="First", do_init=False).active_render = True
    transfer(body.source, body.target, kinds="textures", bake_uv="Own")
    assert body.likeness() > SAME


def mapped(**settings):
    def lay(body):
        body.chain(body.nodes.new("ShaderNodeTexCoord"), body.mapping(**settings))

    return lay


def by_second_map(between):
    def lay(body):
        body.second_map()
        if between == "ATTRIBUTE":
            node = body.nodes.new("ShaderNodeAttribute")
            node.attribute_name = "Second"
            body.chain(node)
        else:
            body.chain(body.uv_map("Second"), *([body.nodes.new("NodeReroute")] if between else []))

    return lay


def twice(body):
    """One image through two UV maps, multiplied."""
    body.second_map()
    other = body.nodes.new("ShaderNodeTexImage")
    other.image = body.image
    body.links.new(body.uv_map("Second").outputs[0], other.inputs[0])
    product = body.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    for place, node in enumerate((body.node, other)):
        body.links.new(node.outputs["Color"], product.inputs[place])
    body.links.new(product.outputs[0], body.light.inputs["Color"])


def grouped(body):
    """The image in a node group, its UVs from a second map outside."""
    body.second_map()
    group = bpy.data.node_groups.new("Painting", "ShaderNodeTree")
    group.interface.new_socket("Place", in_out="INPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    node = group.nodes.new("ShaderNodeTexImage")
    node.image = body.image
    group.links.new(begin.outputs[0], node.inputs["Vector"])
    group.links.new(node.outputs["Color"], end.inputs[0])
    body.nodes.remove(body.node)
    around = body.nodes.new("ShaderNodeGroup")
    around.node_tree = group
    body.links.new(body.uv_map("Second").outputs[0], around.inputs[0])
    body.links.new(around.outputs[0], body.light.inputs["Color"])


@pytest.mark.parametrize(
    "lay",
    [
        by_second_map(None),
        by_second_map("REROUTE"),
        by_second_map("ATTRIBUTE"),
        mapped(Location=(0.3, 0.1, 0.0), Rotation=(0.0, 0.0, 0.4), Scale=(0.8, 0.6, 1.0)),
        mapped(
            vector_type="TEXTURE", Location=(0.3, 0.1, 0.0), Rotation=(0.0, 0.3, 0.4), Scale=(1.2, 1.5, 1.0)
        ),
        twice,
        grouped,
    ],
)
def test_an_image_is_baked_as_its_nodes_lay_it_on(body, lay):
    lay(body)
    for _ in range(2):
        transfer(body.source, body.target, kinds="textures")
    assert body.likeness() > SAME


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
def test_beyond_its_borders_an_image_is_baked_as_it_shows(body, extension):
    mapped(Location=(-0.3, -0.7, 0.0), Scale=(2.0, 1.5, 1.0))(body)
    body.node.extension = extension
    transfer(body.source, body.target, kinds="textures", bake_size="512")
    assert body.likeness() > FINER


def test_closest_texels_are_not_mixed(scene):
    body = Body(np.round(photo(32)))
    body.node.interpolation = "Closest"
    transfer(body.source, body.target, kinds="textures", bake_size="512", bake_margin=0)
    assert set(np.unique(texels(body.baked()[0])).tolist()) == {0.0, 1.0}


def box(body):
    body.node.projection = "BOX"


def by_generated_place(body):
    body.links.new(body.nodes.new("ShaderNodeTexCoord").outputs["Generated"], body.node.inputs["Vector"])


def moving(body):
    body.image.source = "SEQUENCE"


def by_a_circle(body):
    mapping, reroute = body.mapping(), body.nodes.new("NodeReroute")
    body.chain(mapping)
    body.links.new(mapping.outputs["Vector"], reroute.inputs[0])
    body.links.new(reroute.outputs[0], mapping.inputs["Vector"])


def in_two_spaces(body):
    for space in ("OBJECT", "BLENDER_OBJECT"):
        normal_map = body.nodes.new("ShaderNodeNormalMap")
        normal_map.space = space
        body.links.new(body.node.outputs["Color"], normal_map.inputs["Color"])


def with_channels_exchanged(body):
    normal_map = body.nodes.new("ShaderNodeNormalMap")
    normal_map.space = "OBJECT"
    separate, combine = (body.nodes.new(f"ShaderNode{kind}Color") for kind in ("Separate", "Combine"))
    body.links.new(body.node.outputs["Color"], separate.inputs[0])
    for out, into in ((0, 0), (1, 2), (2, 1)):
        body.links.new(separate.outputs[out], combine.inputs[into])
    body.links.new(combine.outputs[0], normal_map.inputs["Color"])


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (box, "'Paint' of material 'Painted' is laid on by Box projection"),
        (by_generated_place, "'Paint' of material 'Painted' is laid on by Generated of 'Texture Coordinate'"),
        (by_a_circle, "'Paint' of material 'Painted' is laid on by the fixed value of"),
        (moving, "'Paint' has frames"),
        (in_two_spaces, "'Paint' of material 'Painted' holds normals for nodes of different spaces"),
        (
            with_channels_exchanged,
            "holds normals whose channels are exchanged on the way to node 'Normal Map'",
        ),
    ],
)
def test_an_image_that_cannot_be_baked_is_left_out_in_words(body, spoil, words):
    """The other image and the other kinds arrive; alone it is refused."""
    spoil(body)
    with pytest.raises(RuntimeError, match=words):
        transfer(body.source, body.target, kinds="textures")
    other = body.nodes.new("ShaderNodeTexImage")
    other.image = bpy.data.images.new("Other", 8, 8)
    body.source.vertex_groups.new(name="Group").add([0], 1.0, "REPLACE")
    transfer(body.source, body.target, kinds="groups,textures")
    assert words in notice.words
    assert [group.name for group in body.target.vertex_groups] == ["Group"]
    assert [image.name for image in body.baked()] == [body.image.name, "Other Target"]


def write_png(path, pixels):
    """A PNG of 16 bits a channel, rows from the bottom as given."""
    height, width = pixels.shape[:2]
    values = np.round(pixels[::-1] * 65535).astype(">u2")

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 16, 6, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("alpha", [1.0, 0.5])
@pytest.mark.parametrize("kind", ["PNG16", "UNSAVED", "PREMUL"])
def test_colours_and_alpha_stay_after_saving_and_opening(scene, tmp_path, kind, alpha):
    """One colour everywhere: Blender holds the same numbers for the baked image as for the source's."""
    pixels = np.full((32, 32, 4), 0.4, np.float32)
    pixels[..., 3] = alpha
    body = Body(pixels)
    if kind == "UNSAVED":
        body.node.image = bpy.data.images.new("Light", 32, 32, alpha=True, float_buffer=True)
        body.node.image.colorspace_settings.name = "sRGB"
        body.node.image.pixels.foreach_set(pixels.ravel())
    else:
        write_png(tmp_path / "colour.png", pixels)
        body.node.image = bpy.data.images.load(str(tmp_path / "colour.png"))
    if kind == "PREMUL":
        body.image.filepath_raw, body.image.file_format = str(tmp_path / "byte.png"), "PNG"
        body.image.save()
        body.node.image = bpy.data.images.load(str(tmp_path / "byte.png"))
        body.node.image.alpha_mode = "PREMUL"
    assert body.node.image.is_float == (kind != "PREMUL")
    expected = texels(body.node.image)[0, 0].copy()
    transfer(body.source, body.target, kinds="textures", bake_margin=64)
    (made,) = body.baked()
    # Half floats keep 11 bits.
    np.testing.assert_allclose(texels(made)[16, 16], expected, rtol=1e-3)
    name = made.name
    reopened(tmp_path)
    np.testing.assert_allclose(texels(bpy.data.images[name])[16, 16], expected, rtol=1e-3)


def test_colours_beside_transparent_ones_stay(scene):
    """White chequers on transparent black: whatever can be seen is white."""
    pixels = np.zeros((256, 256, 4), np.float32)
    pixels[np.add.outer(np.arange(256) // 16, np.arange(256) // 16) % 2 == 0] = 1.0
    body = Body(pixels)
    transfer(body.source, body.target, kinds="textures", bake_size="512")
    found = texels(body.baked()[0])
    assert (found[found[..., 3] > 0.0][:, :3] == 1.0).all()


def test_materials_that_share_the_square_keep_their_own_images(body):
    """The lower three sides of the body lie over the upper three and have another picture."""
    other = bpy.data.images.new("Below", 256, 256, alpha=True)
    other.pixels.foreach_set(np.ascontiguousarray(photo(256)[::-1, :, [1, 2, 0, 3]]).ravel())
    material = body.material.copy()
    material.name = "Lower"
    material.node_tree.nodes["Image Texture"].image = other
    body.source.data.materials.append(material)
    lower = np.arange(len(body.source.data.polygons)) >= len(body.source.data.polygons) // 2
    body.source.data.polygons.foreach_set("material_index", lower.astype(np.int32))
    uv = read_uv(body.source.data, "UVMap")
    uv[:, 1] = uv[:, 1] * 2.0 % 1.0
    body.source.data.uv_layers["UVMap"].uv.foreach_set("vector", uv.astype(np.float32).ravel())
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    body.lay_out("Own")
    transfer(body.source, body.target, kinds="textures")
    slots = np.repeat(mesh_read.slots_shown(body.source), 4)
    np.testing.assert_array_equal(np.repeat(mesh_read.slots_shown(body.target), 4), body.at_twins(slots))
    assert body.likeness() > SAME


def tiled(body, tmp_path, name, tiles):
    """An image of tiles, {number: (file's name, side)}, in place of the body's image; all show one colour."""
    for place, (file, side) in enumerate(tiles.values()):
        tile = bpy.data.images.new("Tile", side, side)
        tile.pixels.foreach_set(np.tile(np.float32([(place + 1) / 16, 0.5, 0.5, 1.0]), side * side))
        tile.filepath_raw, tile.file_format = str(tmp_path / file), "PNG"
        tile.save()
        bpy.data.images.remove(tile)
    first, *others = tiles
    image = bpy.data.images.load(str(tmp_path / tiles[first][0]))
    image.source, image.filepath = "TILED", str(tmp_path / name)
    for number in others:
        if image.tiles.get(number) is None:
            image.tiles.new(number)
    body.node.image = image
    columns = np.array([number - 1001 for number in tiles])
    uv = read_uv(body.source.data, "UVMap")
    # Whole faces go into the tiles by turns.
    uv[:, 0] += columns[np.arange(len(uv)) // 4 % len(columns)]
    body.source.data.uv_layers["UVMap"].uv.foreach_set("vector", uv.astype(np.float32).ravel())
    return image


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    ("name", "tiles"),
    [
        ("skin.<UDIM>.png", {number: (f"skin.{number}.png", 1024) for number in range(1001, 1010)}),
        ("skin.<UDIM>.png", {1001: ("skin.1001.png", 32), 1003: ("skin.1003.png", 64)}),
        ("skin.<UVTILE>.png", {1001: ("skin.u1_v1.png", 32), 1002: ("skin.u2_v1.png", 32)}),
    ],
)
def test_tiles_of_any_number_size_and_name_are_baked(scene, tmp_path, name, tiles, packed):
    """Each quad has its tile's colour in its middle."""
    body = Body(photo(8))
    image = tiled(body, tmp_path, name, tiles)
    if packed:
        image.pack()
        for file, _ in tiles.values():
            (tmp_path / file).unlink()
    transfer(body.source, body.target, kinds="textures", bake_size="512", bake_margin=0)
    # By turns of the source's faces, at the target's.
    corner = np.arange(len(body.source.data.loops))
    turn = body.at_twins(corner // 4 % len(tiles)).reshape(-1, 4)[:, 0]
    middle = read_uv(body.target.data, "Own").reshape(-1, 4, 2).mean(axis=1)
    column, row = (middle * 512).astype(int).T
    found = texels(body.baked()[0])[row, column, 0]
    np.testing.assert_allclose(found, (turn + 1) / 16, atol=0.5 / 255)


def test_painted_tiles_that_were_not_saved_are_refused_in_words(body, tmp_path):
    image = tiled(body, tmp_path, "skin.<UDIM>.png", {1001: ("skin.1001.png", 16)})
    image.pixels.foreach_set(np.ones(16 * 16 * image.channels, np.float32))
    image.update()
    with pytest.raises(RuntimeError, match="changed and not saved"):
        transfer(body.source, body.target, kinds="textures")


def test_an_image_that_is_too_large_is_refused_in_words(body):
    body.node.image = bpy.data.images.new("Wide", 8200, 1)
    with pytest.raises(RuntimeError, match="Image 'Wide' cannot be baked: .*8192"):
        transfer(body.source, body.target, kinds="textures")


def through_mix(body, normal_map):
    reroute, mix = body.nodes.new("NodeReroute"), body.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    body.links.new(body.node.outputs["Color"], reroute.inputs[0])
    body.links.new(reroute.outputs[0], mix.inputs[6])
    body.links.new(mix.outputs[2], normal_map.inputs["Color"])


def with_green_turned(body, normal_map):
    separate, combine = (body.nodes.new(f"ShaderNode{kind}Color") for kind in ("Separate", "Combine"))
    minus = body.nodes.new("ShaderNodeMath")
    minus.operation, minus.inputs[0].default_value = "SUBTRACT", 1.0
    body.links.new(body.node.outputs["Color"], separate.inputs[0])
    body.links.new(separate.outputs[0], combine.inputs[0])
    body.links.new(separate.outputs[1], minus.inputs[1])
    body.links.new(minus.outputs[0], combine.inputs[1])
    body.links.new(separate.outputs[2], combine.inputs[2])
    body.links.new(combine.outputs[0], normal_map.inputs["Color"])


def with_blue_made_anew(body, normal_map):
    """Blue from one minus green, to which green itself stays as it is."""
    separate, combine = (body.nodes.new(f"ShaderNode{kind}Color") for kind in ("Separate", "Combine"))
    minus = body.nodes.new("ShaderNodeMath")
    minus.operation, minus.inputs[0].default_value = "SUBTRACT", 1.0
    body.links.new(body.node.outputs["Color"], separate.inputs[0])
    for place in (0, 1):
        body.links.new(separate.outputs[place], combine.inputs[place])
    body.links.new(separate.outputs[1], minus.inputs[1])
    body.links.new(minus.outputs[0], combine.inputs[2])
    body.links.new(combine.outputs[0], normal_map.inputs["Color"])


def by_curves(body, normal_map):
    curves = body.nodes.new("ShaderNodeRGBCurve")
    green = curves.mapping.curves[1].points
    green[0].location, green[1].location = (0.0, 1.0), (1.0, 0.0)
    body.links.new(body.node.outputs["Color"], curves.inputs["Color"])
    body.links.new(curves.outputs[0], normal_map.inputs["Color"])


@pytest.mark.parametrize(
    ("link", "is_turned"),
    [(through_mix, False), (with_green_turned, True), (by_curves, True), (with_blue_made_anew, False)],
)
def test_a_normal_map_is_known_through_the_nodes_on_its_way(body, link, is_turned):
    """It is baked as one that is linked directly; one with green down as its counterpart with green up."""
    pixels = photo(256) * np.float32([0.4, 0.4, 0.2, 1.0]) + np.float32([0.3, 0.3, 0.8, 0.0])
    body.image.colorspace_settings.name = "Non-Color"
    normal_map = body.nodes.new("ShaderNodeNormalMap")

    def baked(values):
        body.image.pixels.foreach_set(np.ascontiguousarray(values).ravel())
        transfer(body.source, body.target, kinds="textures", bake_margin=0)
        return texels(body.baked()[0]).copy()

    body.links.new(body.node.outputs["Color"], normal_map.inputs["Color"])
    expected = baked(pixels)
    down = pixels.copy()
    down[..., 1] = 1.0 - down[..., 1]
    link(body, normal_map)
    found = baked(down if is_turned else pixels)
    if is_turned:
        covered = found.any(axis=-1)
        found[covered, 1] = 1.0 - found[covered, 1]
    # Both are rounded to 8 bits.
    np.testing.assert_allclose(found, expected, atol=1.01 / 255)
    copy = body.target.material_slots[0].material.node_tree.nodes[normal_map.name]
    assert copy.uv_map == "Own"


def directly(body, normal_map):
    body.links.new(body.node.outputs["Color"], normal_map.inputs["Color"])


def with_blue_inverted(body, normal_map):
    separate, combine = (body.nodes.new(f"ShaderNode{kind}Color") for kind in ("Separate", "Combine"))
    invert = body.nodes.new("ShaderNodeInvert")
    body.links.new(body.node.outputs["Color"], separate.inputs[0])
    for place in (0, 1):
        body.links.new(separate.outputs[place], combine.inputs[place])
    body.links.new(separate.outputs[2], invert.inputs["Color"])
    body.links.new(invert.outputs[0], combine.inputs[2])
    body.links.new(combine.outputs[0], normal_map.inputs["Color"])


def place_unevenly(body):
    """Stretch and turn the two objects; returns the rotation between the bodies as seen in the world."""
    vertices, _ = lumpy()
    moved = turned(vertices)[body.old]
    about = (Euler((0.3, -0.5, 0.8)).to_matrix(), Euler((-0.4, 0.2, 2.0)).to_matrix())
    for obj, points, scale, turn in zip(
        (body.source, body.target), (vertices, moved), ((1.0, 2.0, 0.5), (-0.5, 0.7, 3.0)), about, strict=True
    ):
        obj.data.vertices.foreach_set("co", (points / scale).astype(np.float32).ravel())
        obj.scale, obj.rotation_euler = scale, turn.to_euler()
        obj.data.update()
    if np.prod(body.target.scale) < 0.0:
        body.target.data.flip_normals()
    bpy.context.view_layer.update()
    store_copy(body.source, body.target, body.old)
    between = (turned(np.eye(3)) - turned(np.zeros((1, 3)))).T
    return np.array(about[1]) @ between @ np.array(about[0]).T


@pytest.mark.parametrize("link", [directly, with_green_turned, with_blue_inverted, by_curves])
@pytest.mark.parametrize("space", ["OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"])
def test_normals_in_object_and_world_space_turn_with_the_body(scene, space, link):
    """The renderer shows the same directions on the copy, turned as the copy is turned in the world.

    Both objects are scaled unevenly, one in a mirror, and turned.
    """
    body = Body(photo(8))
    turn = place_unevenly(body)
    y, x = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(256) + 0.5) / 256, indexing="ij")
    given = np.dstack([np.sin(7 * x + 2 * y), np.cos(5 * y - x), np.sin(4 * x * y + 1.0)])
    given /= np.linalg.norm(given, axis=-1, keepdims=True)
    image = bpy.data.images.new("Normals", 256, 256, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.dstack([given * 0.5 + 0.5, np.ones_like(x)]).astype(np.float32).ravel())
    body.node.image = image
    normal_map = body.nodes.new("ShaderNodeNormalMap")
    normal_map.space = space
    link(body, normal_map)
    half = body.nodes.new("ShaderNodeVectorMath")
    half.operation = "MULTIPLY_ADD"
    half.inputs[1].default_value = half.inputs[2].default_value = (0.5, 0.5, 0.5)
    body.links.new(normal_map.outputs["Normal"], half.inputs[0])
    body.links.new(half.outputs[0], body.light.inputs["Color"])
    expected = body.at_twins(shown(body.source) * 2.0 - 1.0) @ turn.T
    transfer(body.source, body.target, kinds="textures")
    assert psnr(shown(body.target), expected * 0.5 + 0.5) > SAME
    assert not notice.words


@pytest.mark.parametrize("brings", ["sharp edges", "flat faces", "custom normals", "all"])
def test_normal_maps_are_baked_to_the_shading_that_comes_with_them(body, brings):
    """At once as after it."""
    mesh = body.source.data
    body.image.colorspace_settings.name = "Non-Color"
    normal_map = body.nodes.new("ShaderNodeNormalMap")
    body.links.new(body.node.outputs["Color"], normal_map.inputs["Color"])
    for obj in (body.source, body.target):
        obj.data.shade_smooth()
    rng = np.random.default_rng(3)
    if brings in {"sharp edges", "all"}:
        write_attribute(mesh, "sharp_edge", "BOOLEAN", "EDGE", rng.random(len(mesh.edges)) < 0.3)
    if brings in {"flat faces", "all"}:
        write_attribute(mesh, "sharp_face", "BOOLEAN", "FACE", rng.random(len(mesh.polygons)) < 0.3)
    if brings in {"custom normals", "all"}:
        lean = np.array([vertex.normal for vertex in mesh.vertices])
        lean += rng.normal(size=lean.shape) * 0.2
        lean /= np.linalg.norm(lean, axis=1, keepdims=True)
        mesh.normals_split_custom_set_from_vertices(lean.tolist())

    def baked(kinds):
        transfer(body.source, body.target, kinds=kinds, bake_uv="Own")
        assert not notice.words
        return texels(body.baked()[0]).copy()

    meshes = len(bpy.data.meshes)
    before = baked("textures")
    everything = "groups,keys,marks,normals,uv,materials,colours,attributes,textures"
    at_once = baked(everything if brings == "all" else "marks,normals,textures")
    np.testing.assert_array_equal(at_once, baked("textures"))
    # More than ten steps of 8 bits.
    assert np.abs(at_once - before).max() > 10 / 255
    assert len(bpy.data.meshes) == meshes


def test_faces_of_materials_that_stay_are_baked_as_they_show(body):
    """The second material alone is carried: the target's faces of the first one keep what they show."""
    material = body.material.copy()
    material.name = "Second"
    image = bpy.data.images.new("Other", 8, 8)
    material.node_tree.nodes[body.node.name].image = image
    body.source.data.materials.append(material)
    index = (np.arange(len(body.source.data.polygons)) % 2).astype(np.int32)
    body.source.data.polygons.foreach_set("material_index", index)
    for held in (body.material, material):
        body.target.data.materials.append(held)
    body.target.data.polygons.foreach_set("material_index", np.ones_like(index))
    transfer(body.source, body.target, kinds="textures", items="materials/Second")
    np.testing.assert_array_equal(mesh_read.slots_shown(body.target), 1)
    assert "No face of 'Target' shows image 'Paint'" in notice.words


def test_what_cannot_be_baked_is_said_once(body):
    """One image through two nodes that lay it on differently; the other image is baked."""
    again, other = (body.nodes.new("ShaderNodeTexImage") for _ in range(2))
    again.image, again.extension = body.image, "CLIP"
    other.image = bpy.data.images.new("Other", 8, 8)
    body.image.source = "SEQUENCE"
    transfer(body.source, body.target, kinds="textures")
    assert notice.words.count("'Paint' has frames") == 1


def test_what_the_artist_made_under_the_same_name_stays(body):
    image, material = bpy.data.images.new("Paint Target", 8, 8), bpy.data.materials.new("Painted Target")
    image["own"] = material["own"] = True
    image.use_fake_user = True
    transfer(body.source, body.target, kinds="textures")
    assert bpy.data.images["Paint Target"].get("own") and bpy.data.materials["Painted Target"].get("own")
    assert body.likeness() > SAME


def test_baking_again_follows_the_source_and_leaves_nothing_behind(body):
    """Names are as long as they can be: what was made before is known though its name is cut."""
    body.image.name, body.material.name, body.target.name = "I" * 60, "M" * 60, "T" * 60
    grouped(body)
    for _ in range(3):
        transfer(body.source, body.target, kinds="materials,textures")
    kept = [len(data) for data in (bpy.data.images, bpy.data.materials, bpy.data.node_groups)]
    assert kept == [2, 2, 2]
    assert len(body.target.material_slots) == 1
    light = body.nodes.new("ShaderNodeTexImage")
    light.image = bpy.data.images.new("Second", 8, 8)
    transfer(body.source, body.target, kinds="materials,textures")
    assert len(body.target.material_slots) == 1
    assert [image.name[:8] for image in body.baked()] == ["Second T"]


@pytest.mark.parametrize("renamed", ["material", "target", "source", "baked"])
@pytest.mark.parametrize("kinds", ["textures", "materials,textures"])
def test_baking_again_takes_the_same_slots_whatever_was_renamed(body, tmp_path, renamed, kinds):
    transfer(body.source, body.target, kinds=kinds)
    named = {"material": body.material, "target": body.target, "source": body.source}
    named.get(renamed, body.target.material_slots[0].material).name = "Renamed"
    transfer(body.source, body.target, kinds=kinds)
    assert "do not show" not in notice.words
    (slot,) = body.target.material_slots
    assert slot.name == f"{body.material.name} {body.target.name}" and len(bpy.data.materials) == 2
    assert [image.name for image in body.baked()] == [f"Paint {body.target.name}"]
    assert body.likeness() > SAME
    reopened(tmp_path)
    assert len(bpy.data.materials) == len(bpy.data.images) == 2


@pytest.mark.parametrize(
    ("kinds", "side"), [("uv", "source"), ("textures", "source"), ("textures", "target")]
)
def test_a_layout_without_numbers_is_named(body, kinds, side):
    mesh = getattr(body, side).data
    mesh.uv_layers[0].uv[5].vector = (np.nan, 0.0)
    with pytest.raises(RuntimeError, match=f"UV map '{mesh.uv_layers[0].name}' of mesh .* Unwrap it anew"):
        transfer(body.source, body.target, kinds=kinds)


def test_baking_again_along_a_chain_leaves_nothing_behind(body):
    """What was baked for the first target, and is made anew, is the original of what the next one has."""
    last = body.target.copy()
    last.data, last.name = body.target.data.copy(), "Last"
    bpy.context.collection.objects.link(last)
    store_copy(body.target, last, np.arange(len(last.data.vertices)))
    for _ in range(3):
        transfer(body.source, body.target, kinds="materials,textures")
        transfer(body.target, last, kinds="materials,textures")
    names = ["Painted", "Painted Target", "Painted Target Last"]
    assert [material.name for material in bpy.data.materials] == names
    assert [slot.name for obj in (body.target, last) for slot in obj.material_slots] == names[1:]


def test_a_bake_that_no_material_shows_is_kept_and_said(body, tmp_path):
    body.target.data.materials.append(bpy.data.materials.new("Plain"))
    transfer(body.source, body.target, kinds="textures")
    assert "do not show what was baked from 'Paint'" in notice.words
    reopened(tmp_path)
    assert "Paint Target" in bpy.data.images


def test_textures_alone_bring_the_faces_materials(body):
    """Onto a target without slots; see also the test of materials that share the square."""
    body.source.data.materials.append(bpy.data.materials.new("Plain"))
    index = (np.arange(len(body.source.data.polygons)) % 7 == 0).astype(np.int32)
    body.source.data.polygons.foreach_set("material_index", index)
    transfer(body.source, body.target, kinds="textures")
    expected = body.at_twins(np.repeat(index, 4)).reshape(-1, 4)[:, 0]
    np.testing.assert_array_equal(mesh_read.slots_shown(body.target), expected)
