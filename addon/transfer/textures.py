# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures of the source's materials, baked into the target's own UV layout."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from .kind import Kind, Prepared
from .uv_maps import read_uv

LARGEST_TRIANGULATED = 4


def _nodes(source):
    """Image texture nodes of the source's materials with an image."""
    for slot in source.material_slots:
        if slot.material is not None and slot.material.node_tree is not None:
            for node in slot.material.node_tree.nodes:
                if node.type == "TEX_IMAGE" and node.image is not None:
                    yield slot.material, node


def names(source):
    return sorted({node.image.name for _, node in _nodes(source)})


def prepare(route, wanted, options):
    target_uv = _own_layout(route, options)
    cells = _cells(route, target_uv)
    baked = {}
    for _, node in _nodes(route.source):
        if node.image.name in wanted and node.image.name not in baked:
            baked[node.image.name] = _bake(route, node, target_uv, cells, options)

    def write():
        images = {name: _store(route, name, tiles) for name, tiles in baked.items()}
        if options.bake_material:
            _replace_materials(route, images, target_uv)

    return Prepared(write)


def _own_layout(route, options):
    layers = route.target.data.uv_layers
    name = options.bake_uv or (layers.active.name if layers.active else "")
    if name not in layers:
        what = f"has no UV map '{name}'" if name else "has no UV map of its own"
        raise UnusableObjectError(f"'{route.target.name}' {what} to bake textures into. Unwrap it first")
    return name


def _target_uv(route, name):
    """UVs of the target's triangles, (m, 3, 2)."""
    return read_uv(route.target.data, name)[route.target_corners]


def _cells(route, name):
    """Units of UV that the target's layout reaches into, (column, row) each: one image tile for each."""
    uv = _target_uv(route, name)
    low = np.floor(uv.min(axis=1) + BEYOND).astype(int)
    high = np.maximum(np.ceil(uv.max(axis=1) - BEYOND).astype(int) - 1, low)
    if low.min() < 0 or (high.max(axis=0) >= (TILES_IN_A_ROW, TILE_ROWS)).any():
        raise UnusableObjectError(
            f"UV map '{name}' of '{route.target.name}' reaches out of the tiles that an image can have, from "
            f"0 to {TILES_IN_A_ROW} across and 0 to {TILE_ROWS} up. Move its islands there"
        )
    spans = np.unique(np.hstack([low, high]), axis=0).tolist()
    return sorted(
        {
            (column, row)
            for left, bottom, right, top in spans
            for column in range(left, right + 1)
            for row in range(bottom, top + 1)
        }
    )


def _bake(route, node, target_uv, cells, options):
    """Pixels of each tile of the baked image, by the tile's number."""
    image = node.image
    tiled = image.source == "TILED"
    pixels, place = read_tiles(image) if tiled else (read_pixels(image), WHOLE)
    # Each tile as large as one of the source.
    height, width = (np.array(pixels.shape[:2]) / place[1][::-1]).astype(int).tolist()
    if options.bake_size != "SOURCE":
        width = height = int(options.bake_size)
    source_uv = _uv_of(route.source, node)
    given = (read_uv(route.source.data, source_uv)[route.triangle_corners] - place[0]) / place[1]
    wanted = _target_uv(route, target_uv)
    frames = None
    if _is_normal_map(node):
        frames = (
            *_tangent_frames(route.source, source_uv, route.triangle_corners),
            *_tangent_frames(route.target, target_uv, route.target_corners),
        )
    manager = bpy.context.window_manager
    manager.progress_begin(0.0, len(cells))
    try:
        return {
            FIRST_TILE + column + TILES_IN_A_ROW * row: route.map.bake(
                given,
                wanted - (column, row),
                pixels,
                width,
                height,
                margin=options.bake_margin,
                straight_alpha=image.alpha_mode == "STRAIGHT",
                tangent_frames=frames,
                progress=lambda _stage, fraction, done=done: manager.progress_update(done + fraction),
            )
            for done, (column, row) in enumerate(cells)
        }
    finally:
        manager.progress_end()


# Where a picture begins in UV, and over how many units it goes.
WHOLE = np.zeros(2), np.ones(2)
FIRST_TILE, TILES_IN_A_ROW, TILE_ROWS = 1001, 10, 100
# A layout that reaches into the next unit of UV by less than this does not need its tile.
BEYOND = 1e-4


def read_tiles(image):
    """All tiles of a UDIM image as one picture, and where in UV it lies: (begin, extent)."""
    numbers = np.array([tile.number for tile in image.tiles]) - FIRST_TILE
    cells = np.stack([numbers % TILES_IN_A_ROW, numbers // TILES_IN_A_ROW], axis=1)
    tiles = [_read_tile(image, number + FIRST_TILE) for number in numbers.tolist()]
    if len({tile.shape for tile in tiles}) > 1:
        raise UnusableObjectError(f"The tiles of image '{image.name}' differ in size. Scale them to one size")
    height, width = tiles[0].shape[:2]
    begin = cells.min(axis=0)
    extent = cells.max(axis=0) - begin + 1
    whole = np.zeros((extent[1] * height, extent[0] * width, 4), np.float32)
    for (column, row), tile in zip((cells - begin).tolist(), tiles, strict=True):
        whole[row * height : (row + 1) * height, column * width : (column + 1) * width] = tile
    return whole, (begin.astype(float), extent.astype(float))


def _read_tile(image, number):
    # Blender gives scripts the pixels of the first tile alone: the others are read from their files.
    path = bpy.path.abspath(image.filepath_raw.replace("<UDIM>", str(number)), library=image.library)
    try:
        tile = bpy.data.images.load(path)
    except RuntimeError:
        raise UnusableObjectError(
            f"Tile {number} of image '{image.name}' is not at {path}. Save the image's tiles to files first"
        ) from None
    try:
        tile.colorspace_settings.name = image.colorspace_settings.name
        tile.alpha_mode = image.alpha_mode
        return read_pixels(tile)
    finally:
        bpy.data.images.remove(tile)


def read_pixels(image):
    """Texels (height, width, 4), rows from the bottom, in the image's own colour space."""
    if image.source in {"SEQUENCE", "MOVIE"}:
        raise UnusableObjectError(
            f"Image '{image.name}' has frames; only still images can be baked. "
            "Leave it out, or replace it with a still image"
        )
    width, height = image.size
    if not image.has_data and not image.pixels:
        raise UnusableObjectError(f"Image '{image.name}' has no pixels. Find its file: File > External Data")
    channels = image.channels
    values = np.empty(width * height * channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, channels)
    if channels == 4:
        return values
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = values[..., :3] if channels >= 3 else values[..., :1]
    return full


def _uv_of(source, node):
    """Name of the UV map by which the node is laid onto the source."""
    layers = source.data.uv_layers
    if not layers:
        raise UnusableObjectError(f"'{source.name}' has no UV map, so its textures have no place on it")
    for link in node.inputs["Vector"].links:
        if link.from_node.type == "UVMAP" and link.from_node.uv_map in layers:
            return link.from_node.uv_map
    return next((layer.name for layer in layers if layer.active_render), layers[0].name)


def _is_normal_map(node):
    return any(
        link.to_node.type == "NORMAL_MAP" and link.to_node.space == "TANGENT"
        for link in node.outputs["Color"].links
    )


def _tangent_frames(obj, uv, triangle_corners):
    """Normals (m, 3, 3) and tangents with sign (m, 3, 4) at the triangles' corners, as renderers use them."""
    mesh = obj.data
    if any(face.loop_total > LARGEST_TRIANGULATED for face in mesh.polygons):
        raise UnusableObjectError(
            f"'{obj.name}' has faces with more than {LARGEST_TRIANGULATED} corners, which have no tangents. "
            "Triangulate them to bake a normal map"
        )
    mesh.calc_tangents(uvmap=uv)
    try:
        count = len(mesh.loops)
        normal, tangent = np.empty(count * 3, np.float32), np.empty(count * 3, np.float32)
        sign = np.empty(count, np.float32)
        mesh.loops.foreach_get("normal", normal)
        mesh.loops.foreach_get("tangent", tangent)
        mesh.loops.foreach_get("bitangent_sign", sign)
    finally:
        mesh.free_tangents()
    tangents = np.column_stack([tangent.reshape(-1, 3), sign])
    return normal.reshape(-1, 3)[triangle_corners], tangents[triangle_corners]


def _store(route, name, tiles):
    """A new image beside the source's, in place of the one baked before."""
    image = bpy.data.images[name]
    title = f"{name} {route.target.name}"
    if set(tiles) == {FIRST_TILE}:
        made = _new_image(title, tiles[FIRST_TILE], image.is_float, image.colorspace_settings.name)
        made.alpha_mode = image.alpha_mode
        made.pack()
    else:
        made = _new_tiled_image(title, tiles, image)
    earlier = bpy.data.images.get(title)
    if earlier not in (None, made):
        earlier.user_remap(made)
        bpy.data.images.remove(earlier)
        made.name = title
    return made


def _new_image(title, pixels, is_float, space):
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(title, width, height, alpha=True, float_buffer=is_float)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    made.update()
    return made


def _new_tiled_image(title, tiles, image):
    # Scripts reach the pixels of the first tile alone: tiles go through files, which pack() takes in.
    kind, suffix = ("OPEN_EXR", "exr") if image.is_float else ("PNG", "png")
    stem = bpy.path.clean_name(title)
    with tempfile.TemporaryDirectory() as folder:
        for number, pixels in tiles.items():
            # Without a colour space, numbers go into the file as they are.
            tile = _new_image(title, pixels, image.is_float, "Non-Color")
            try:
                tile.filepath_raw, tile.file_format = str(Path(folder) / f"{stem}.{number}.{suffix}"), kind
                tile.save()
            finally:
                bpy.data.images.remove(tile)
        made = bpy.data.images.new(title, 1, 1, alpha=True, float_buffer=image.is_float, tiled=True)
        made.filepath = str(Path(folder) / f"{stem}.<UDIM>.{suffix}")
        made.colorspace_settings.name = image.colorspace_settings.name
        made.alpha_mode = image.alpha_mode
        made.pack()
    made.filepath_raw = f"//{stem}.<UDIM>.{suffix}"
    for packed in made.packed_files:
        packed.filepath = f"//{stem}.{packed.tile_number}.{suffix}"
    return made


def _replace_materials(route, images, uv):
    """In the target's slots: copies of the source's materials with the baked images and the target's UVs."""
    if not route.target.material_slots:
        for slot in route.source.material_slots:
            route.target.data.materials.append(slot.material)
    used = {material for material, node in _nodes(route.source) if node.image.name in images}
    for slot in route.target.material_slots:
        if slot.material not in used:
            continue
        title = f"{slot.material.name} {route.target.name}"
        copy = bpy.data.materials.get(title) or slot.material.copy()
        copy.name = title
        for node in copy.node_tree.nodes:
            if node.type == "TEX_IMAGE" and node.image is not None and node.image.name in images:
                node.image = images[node.image.name]
            elif node.type in {"UVMAP", "NORMAL_MAP"}:
                node.uv_map = uv
        slot.material = copy


KIND = Kind(
    "textures",
    "Textures",
    "TEXTURE",
    "Bake the source's image textures into the target's own UV layout",
    names,
    prepare,
    {
        "bake_uv": StringProperty(
            name="UV Map", description="UV map of the target to bake into. Empty: the active one"
        ),
        "bake_size": EnumProperty(
            name="Size",
            items=[
                ("SOURCE", "As Source", "As large as the source's image"),
                *(
                    (str(side), f"{side} px", f"{side} by {side} pixels")
                    for side in (512, 1024, 2048, 4096, 8192)
                ),
            ],
            default="SOURCE",
            description="Size of the baked images",
        ),
        "bake_margin": IntProperty(
            name="Margin",
            default=16,
            min=0,
            soft_max=64,
            description="Pixels by which islands are extended into the empty space around them",
        ),
        "bake_material": BoolProperty(
            name="Replace Materials",
            default=True,
            description="Give the target copies of the materials that show the baked images",
        ),
    },
    default=False,
)
