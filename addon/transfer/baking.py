# SPDX-License-Identifier: GPL-3.0-or-later
"""How the source's images lie on both bodies, and the pixels that a UV map of the target would show."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from .. import core, mesh_read
from ..mesh_read import UnusableObjectError
from ..typed import Flags, Floats, Integers, Options, Values
from .image_nodes import image_nodes, laid
from .image_pixels import TILES_IN_A_ROW, has_straight_alpha, number_of, read_tiles
from .layouts import finite_uv
from .material_copies import is_made_from, slot_name
from .normals import matrices

if TYPE_CHECKING:
    from sgmds import SurfaceMap

    from .image_nodes import Laid, Normals
    from .route import Route

LARGEST_TRIANGULATED = 4
TILE_ROWS = 100
# A layout that reaches into the next unit of UV by less than this does not need its tile.
BEYOND = 1e-4


def materials_on(source: bpy.types.Object) -> list[bpy.types.Material]:
    """The source's materials, each once."""
    return list(dict.fromkeys(slot.material for slot in source.material_slots if slot.material is not None))


def uses_of(
    source: bpy.types.Object, wanted: Sequence[str], notes: list[str]
) -> dict[bpy.types.Material, list[Laid | None]]:
    """For each material how its image nodes lay the wanted images onto the source, None for other nodes."""
    uses: dict[bpy.types.Material, list[Laid | None]] = {}
    for material in materials_on(source):
        uses[material] = []
        for groups, node in image_nodes(material):
            use = None
            if node.image.name in wanted:
                try:
                    use = laid(source, material, groups, node)
                except UnusableObjectError as reason:
                    notes.append(str(reason))
            uses[material].append(use)
    return uses


def materials_of(
    uses: Mapping[bpy.types.Material, list[Laid | None]],
) -> dict[Laid, list[bpy.types.Material]]:
    """For each way in which an image is laid on, the materials with it."""
    materials: dict[Laid, list[bpy.types.Material]] = {}
    for material, found in uses.items():
        for use in dict.fromkeys(found):
            if use is not None:
                materials.setdefault(use, []).append(material)
    return materials


def triangles_used(route: Route, materials: Container[bpy.types.Material]) -> tuple[Flags, ...]:
    """The source's and the target's triangles that show these materials of the source, (m,) each."""
    slots = [place for place, slot in enumerate(route.source.material_slots) if slot.material in materials]
    return tuple(np.isin(shown, slots) for shown in _slots_shown(route))


def cells_of(target: bpy.types.Object, name: str, uv: Floats) -> list[tuple[int, int]]:
    """Units of UV that these triangles (m, 3, 2) of the map `name` reach into, (column, row) each: an image
    tile for each.
    """
    low = np.floor(uv.min(axis=1) + BEYOND).astype(int)
    high = np.maximum(np.ceil(uv.max(axis=1) - BEYOND).astype(int) - 1, low)
    if low.min() < 0 or (high.max(axis=0) >= (TILES_IN_A_ROW, TILE_ROWS)).any():
        raise UnusableObjectError(
            f"UV map '{name}' of '{target.name}' reaches out of the tiles that an image can have, from "
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


def bake(
    route: Route, mesh: bpy.types.Mesh, use: Laid, used: tuple[Flags, Flags], target_uv: str, options: Options
) -> dict[int, Values]:
    """Pixels of each tile of the baked image, by the tile's number, for the triangles used of both meshes.

    `mesh` is the target's as it will be.
    """
    image = use.image
    source_used, target_used = used
    if not target_used.any():
        raise UnusableObjectError(
            f"No face of '{route.target.name}' shows image '{image.name}': it was not baked"
        )
    tiles = read_tiles(image)
    # Each tile as large as the source's largest.
    height, width = (max(pixels.shape[axis] for pixels in tiles.values()) for axis in (0, 1))
    if options.bake_size != "SOURCE":
        width = height = int(options.bake_size)
    placing = np.array(use.placing)
    given = finite_uv(route.body.data, use.uv)[route.triangle_corners] @ placing[:, :2].T + placing[:, 2]
    wanted = finite_uv(route.target.data, target_uv)[route.target_corners]
    cells = cells_of(route.target, target_uv, wanted[target_used])
    way, turning = _turning(route, mesh, use.normals, target_uv)
    downwards = () if use.normals is None else use.normals.downwards
    tiles = {cell: _turned(pixels, downwards) for cell, pixels in tiles.items()}
    manager = bpy.context.window_manager
    manager.progress_begin(0.0, len(cells))
    baked = {}
    try:
        for done, cell in enumerate(cells):
            pixels = way.bake(
                given,
                wanted - cell,
                tiles,
                width,
                height,
                margin=options.bake_margin,
                straight_alpha=has_straight_alpha(image),
                extension=use.extension,
                closest=use.closest,
                source_triangles=source_used,
                target_triangles=target_used,
                progress=partial(_show_progress, manager, done),
                **turning,
            )
            baked[number_of(*cell)] = _turned(pixels, downwards)
    except core.load().SgmdsError as reason:
        raise UnusableObjectError(f"Image '{image.name}' cannot be baked: {reason}") from reason
    finally:
        manager.progress_end()
    return baked


def _show_progress(manager: bpy.types.WindowManager, done: int, _stage: str, fraction: float) -> None:
    manager.progress_update(done + fraction)


def _turned(pixels: Values, channels: Iterable[int]) -> Values:
    """Texels with these channels counting the other way; empty ones stay empty."""
    if not channels:
        return pixels
    turned = pixels.copy()
    for channel in channels:
        turned[..., channel] = np.where(pixels.any(axis=-1), 1.0 - pixels[..., channel], 0.0)
    return turned


def _slots_shown(route: Route) -> tuple[Integers, Integers]:
    """The source's slot that each triangle of the source, and of the target, shows: (m,) each."""
    carried, chosen = route.carried_slots, route.wanted.get("materials", ())
    slot, own = carried.copy(), mesh_read.slots_shown(route.target)
    # Where the target keeps its slots, those with a material of the source show that one.
    for at, held in enumerate(route.target.material_slots):
        for place, given in enumerate(route.source.material_slots):
            if is_made_from(held.material, given.material, route.target):
                slot[own == at] = place
    for place, given in enumerate(route.source.material_slots):
        if slot_name(given, place) in chosen:
            slot[carried == place] = place
    return mesh_read.slots_shown(route.body)[route.triangle_faces], slot[route.target_triangle_faces]


def _turning(
    route: Route, mesh: bpy.types.Mesh, normals: Normals | None, target_uv: str
) -> tuple[SurfaceMap, dict[str, Any]]:
    """The core's map to bake by, and what turns the image's normals, none for colours."""
    if normals is None:
        return route.map, {}
    if normals.space != "TANGENT":
        return route.map_as_seen, {"normal_spaces": matrices(route, normals.space)}
    frames = (
        *_tangent_frames(route.body.data, normals.uv, route.triangle_corners, route.source),
        *_tangent_frames(mesh, target_uv, route.target_corners, route.target),
    )
    return route.map, {"tangent_frames": frames}


def _tangent_frames(
    mesh: bpy.types.Mesh, uv: str, triangle_corners: Integers, obj: bpy.types.Object
) -> tuple[Floats, Floats]:
    """Normals (m, 3, 3) and tangents with sign (m, 3, 4) at the corners of triangles, as renderers use them.

    The mesh is the object's, or a copy of it.
    """
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
