# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of still images: read as texels, tile by tile, and stored as packed images.

Blender holds the texels of an image with 8 bits a channel in the image's own colour space, their colours
apart from alpha; those of a float image in scene-linear numbers, their colours multiplied with alpha. The
latter are therefore read from their file, as data, where they have one.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..mesh_read import UnusableObjectError
from ..typed import EnumItem, Values
from .copies import MADE_FROM

FIRST_TILE, TILES_IN_A_ROW = 1001, 10


def has_straight_alpha(image: bpy.types.Image) -> bool:
    """Whether the texels' colours are apart from an alpha that belongs to them."""
    if image.colorspace_settings.is_data or image.alpha_mode not in ALPHA_OF_COLOURS:
        return False
    return image.alpha_mode == "STRAIGHT" if _is_read_from_file(image) else not image.is_float


# Alpha modes in which alpha says how much of a colour there is.
ALPHA_OF_COLOURS = {"STRAIGHT", "PREMUL"}


def _is_read_from_file(image: bpy.types.Image) -> bool:
    return image.source == "TILED" or (image.source == "FILE" and image.is_float and not image.is_dirty)


def read_tiles(image: bpy.types.Image) -> dict[tuple[int, int], Values]:
    """Texels (height, width, 4) of each tile by its column and row; an untiled image is one at (0, 0)."""
    if image.source != "TILED":
        if _is_read_from_file(image):
            return {(0, 0): _read_file(image, image.filepath_raw, image.packed_file, "Image")}
        return {(0, 0): read_pixels(image)}
    if image.is_dirty:
        raise UnusableObjectError(
            f"The tiles of image '{image.name}' were changed and not saved. Save or pack the image first"
        )
    return {cell_of(tile.number): _read_tile(image, tile.number) for tile in image.tiles}


def cell_of(number: int) -> tuple[int, int]:
    """Column and row of the tile with that number."""
    return (number - FIRST_TILE) % TILES_IN_A_ROW, (number - FIRST_TILE) // TILES_IN_A_ROW


def number_of(column: int, row: int) -> int:
    return FIRST_TILE + column + TILES_IN_A_ROW * row


def _read_tile(image: bpy.types.Image, number: int) -> Values:
    # Blender gives scripts the pixels of the first tile alone: the others are read from their files.
    column, row = cell_of(number)
    name = image.filepath_raw.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    packed = next((held.packed_file for held in image.packed_files if held.tile_number == number), None)
    return _read_file(image, name, packed, f"Tile {number} of image")


def _read_file(image: bpy.types.Image, name: str, packed: bpy.types.PackedFile | None, what: str) -> Values:
    """Texels of the image's file of that name, or of the packed one, as they are in it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(bpy.path.abspath(name, library=image.library))
        if packed is not None:
            path = Path(folder) / "packed"
            content: Any = packed.data
            path.write_bytes(content)
        try:
            saved = bpy.data.images.load(str(path))
        except RuntimeError:
            raise UnusableObjectError(
                f"{what} '{image.name}' is not at {path}. Save the image, or find its file: "
                "File > External Data"
            ) from None
        try:
            saved.colorspace_settings.name = "Non-Color"
            return read_pixels(saved)
        finally:
            bpy.data.images.remove(saved)


def read_pixels(image: bpy.types.Image) -> Values:
    """Texels (height, width, 4), rows from the bottom, as Blender holds them."""
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


def store(title: str, tiles: Mapping[int, Values], image: bpy.types.Image) -> bpy.types.Image:
    """A packed image of that title with texels as `read_tiles` gives them for `image`, by the tiles' numbers.

    It takes the place of the one stored before under the same title; others of that name stay.
    """
    earlier = next((held for held in bpy.data.images if held.get(MADE_FROM) == title), None)
    if set(tiles) == {FIRST_TILE}:
        made = _new_image(title, tiles[FIRST_TILE], image.is_float)
        made.pack()
    else:
        made = _new_tiled_image(title, tiles, image.is_float)
    _set_meaning(made, image)
    made[MADE_FROM] = title
    if earlier is not None:
        earlier.user_remap(made)
        bpy.data.images.remove(earlier)
        made.name = title
    return made


def _set_meaning(made: bpy.types.Image, image: bpy.types.Image) -> None:
    """Colour space and alpha mode for the texels that were read of `image`."""
    made.colorspace_settings.name, made.alpha_mode = image.colorspace_settings.name, image.alpha_mode
    if _is_read_from_file(image):
        return
    if image.alpha_mode in ALPHA_OF_COLOURS:
        made.alpha_mode = "PREMUL" if image.is_float else "STRAIGHT"
    if image.is_float and not image.colorspace_settings.is_data:
        made.colorspace_settings.name = _scene_linear()


def _scene_linear() -> str:
    """Name of the colour space of new float images."""
    image = bpy.data.images.new("Linear", 1, 1, float_buffer=True)
    try:
        return image.colorspace_settings.name
    finally:
        bpy.data.images.remove(image)


def _new_image(title: str, pixels: Values, is_float: bool) -> bpy.types.Image:
    """An image of data: numbers go into its file as they are."""
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(title, width, height, alpha=True, float_buffer=is_float)
    made.colorspace_settings.name = "Non-Color"
    made.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    made.update()
    return made


def _new_tiled_image(title: str, tiles: Mapping[int, Values], is_float: bool) -> bpy.types.Image:
    # Scripts reach the pixels of the first tile alone: tiles go through files, which pack() takes in.
    kind: EnumItem
    kind, suffix = ("OPEN_EXR", "exr") if is_float else ("PNG", "png")
    stem = bpy.path.clean_name(title)
    with tempfile.TemporaryDirectory() as folder:
        for number, pixels in tiles.items():
            tile = _new_image(title, pixels, is_float)
            try:
                tile.filepath_raw, tile.file_format = str(Path(folder) / f"{stem}.{number}.{suffix}"), kind
                tile.save()
            finally:
                bpy.data.images.remove(tile)
        made = bpy.data.images.new(title, 1, 1, alpha=True, float_buffer=is_float, tiled=True)
        made.filepath = str(Path(folder) / f"{stem}.<UDIM>.{suffix}")
        made.colorspace_settings.name = "Non-Color"
        made.pack()
    made.filepath_raw = f"//{stem}.<UDIM>.{suffix}"
    for packed in made.packed_files:
        packed.filepath = f"//{stem}.{packed.tile_number}.{suffix}"
    return made
