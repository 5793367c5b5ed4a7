# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures of the source's materials, baked into the target's own UV layout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import core, mesh_read
from ..mesh_read import UnusableObjectError
from ..typed import Flags, Floats, Integers, Options, Values
from .copies import MADE_FROM, ORIGINAL
from .image_nodes import image_nodes, images, laid, normal_maps
from .image_pixels import TILES_IN_A_ROW, has_straight_alpha, number_of, read_tiles, store
from .kind import Kind, Prepared
from .layouts import bake_map, finite_uv, takes_over
from .listed import listed
from .material_copies import fitting, forget, is_made_from, made_title, own_copy, slot_name
from .normals import matrices
from .sheets import sheets

if TYPE_CHECKING:
    from sgmds import SurfaceMap

    from .image_nodes import Laid, Normals
    from .route import Route
    from .sheets import Sheets

LARGEST_TRIANGULATED = 4
TILE_ROWS = 100
# A layout that reaches into the next unit of UV by less than this does not need its tile.
BEYOND = 1e-4


def names(source: bpy.types.Object) -> list[str]:
    return sorted({image.name for image in images(_materials(source))})


def _materials(source: bpy.types.Object) -> list[bpy.types.Material]:
    """The source's materials, each once."""
    return list(dict.fromkeys(slot.material for slot in source.material_slots if slot.material is not None))


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    if takes_over(route, options):
        words = (
            f"Textures of '{route.target.name}' are shown by the source's UV map, which they fit as they "
            "are: they were not baked. To bake them, unwrap it, or choose a UV map of its own"
        )
        return Prepared(partial(_show_originals, route, options), (words,))
    notes: list[str] = []
    baked: dict[tuple[Laid, int], dict[int, Values]] = {}
    uses = _uses(route.source, wanted, notes)
    try:
        target_uv = _own_layout(route, options)
    except UnusableObjectError as reason:
        notes.append(str(reason))
    else:
        with route.mesh_as_written() as mesh:
            of = {use: _triangles_used(route, materials) for use, materials in _materials_of(uses).items()}
            try:
                parts, overlap = sheets(route, target_uv, _any([used for _, used in of.values()]))
                notes += overlap
            except UnusableObjectError as reason:
                notes.append(str(reason))
                of = {}
            for use, (source_used, target_used) in of.items():
                for number in parts.numbers:
                    used = source_used, target_used & (parts.triangles == number)
                    if number and not used[1].any():
                        continue
                    try:
                        baked[use, number] = _bake(route, mesh, use, used, target_uv, options)
                    except UnusableObjectError as reason:
                        notes.append(str(reason))
    # An image that several nodes or materials lay on in the same way is told of once.
    notes = list(dict.fromkeys(notes))
    if not baked and not any(others for kind, others in route.wanted.items() if kind != KIND.identifier):
        raise UnusableObjectError(" ".join(notes))
    if options.bake_material:
        notes += _unseen(route, uses, baked)

    def write() -> None:
        titles = _titles(route, baked, parts) if baked else {}
        images: dict[tuple[Laid | None, int], bpy.types.Image] = {
            key: store(title, baked[key], key[0].image) for key, title in titles.items()
        }
        if images and options.bake_material:
            _fill_slots(route)
            _replace_materials(route, uses, images, target_uv, parts)
        for image in images.values():
            # Without a user it would not be saved.
            image.use_fake_user = not image.users

    return Prepared(write, notes)


def _uses(
    source: bpy.types.Object, wanted: Sequence[str], notes: list[str]
) -> dict[bpy.types.Material, list[Laid | None]]:
    """For each material how its image nodes lay the wanted images onto the source, None for other nodes."""
    uses: dict[bpy.types.Material, list[Laid | None]] = {}
    for material in _materials(source):
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


def _materials_of(
    uses: Mapping[bpy.types.Material, list[Laid | None]],
) -> dict[Laid, list[bpy.types.Material]]:
    """For each way in which an image is laid on, the materials with it."""
    materials: dict[Laid, list[bpy.types.Material]] = {}
    for material, found in uses.items():
        for use in dict.fromkeys(found):
            if use is not None:
                materials.setdefault(use, []).append(material)
    return materials


def _any(masks: Sequence[Flags]) -> Flags:
    return np.logical_or.reduce(masks) if masks else np.zeros(0, bool)


def _triangles_used(route: Route, materials: Container[bpy.types.Material]) -> tuple[Flags, ...]:
    """The source's and the target's triangles that show these materials of the source, (m,) each."""
    slots = [place for place, slot in enumerate(route.source.material_slots) if slot.material in materials]
    return tuple(np.isin(shown, slots) for shown in _slots_shown(route))


def _titles(route: Route, baked: Iterable[tuple[Laid, int]], parts: Sheets) -> dict[tuple[Laid, int], str]:
    """A name for each baked image; those laid on in several ways are numbered."""
    titles: dict[tuple[Laid, int], str] = {}
    times: Counter[str] = Counter()
    for use, number in baked:
        title = _part_title(use.image, route.target, parts, number)
        times[title] += 1
        titles[use, number] = f"{title} {times[title]}" if times[title] > 1 else title
    return titles


def _part_title(original: bpy.types.ID, target: bpy.types.Object, parts: Sheets, number: int) -> str:
    """Name of what is made from an image or material for a part of the target."""
    return " ".join([made_title(original, target), parts.names[number]]).rstrip()


def _own_layout(route: Route, options: Options) -> str:
    name = bake_map(route, options)
    if name not in route.target.data.uv_layers:
        raise UnusableObjectError(
            f"'{route.target.name}' has no UV map '{name}' to bake textures into. Choose another one"
            if name
            else f"'{route.target.name}' has no UV map of its own to bake textures into. Unwrap it first"
        )
    return name


def _cells(route: Route, name: str, uv: Floats) -> list[tuple[int, int]]:
    """Units of UV that these triangles (m, 3, 2) reach into, (column, row) each: an image tile for each."""
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


def _bake(
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
    cells = _cells(route, target_uv, wanted[target_used])
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


def _unseen(
    route: Route, uses: Mapping[bpy.types.Material, list[Laid | None]], baked: Iterable[tuple[Laid, int]]
) -> list[str]:
    """Words about baked images that no material of the target will show."""
    slots = route.target.material_slots
    carried = route.wanted.get("materials", ())

    def seen(material: bpy.types.Material) -> bool:
        shown = any(is_made_from(slot.material, material, route.target) for slot in slots)
        return not slots or shown or material.name in carried

    materials = _materials_of(uses)
    unseen = sorted({use.image.name for use, _ in baked if not any(map(seen, materials[use]))})
    if not unseen:
        return []
    which = listed(f"'{name}'" for name in unseen)
    return [
        f"The materials of '{route.target.name}' do not show what was baked from {which}: use the baked "
        "images in them, or check Materials and transfer again"
    ]


def _fill_slots(route: Route) -> None:
    """Give a target without material slots those of the source; of one of several meshes those it shows."""
    if not route.target.material_slots:
        label, slots = route.carried_slots, route.source.material_slots
        given = np.arange(len(slots)) if len(route.view.starts) == 1 else np.unique(label)
        for place in given.tolist():
            route.target.data.materials.append(slots[place].material)
        index = np.searchsorted(given, label).astype(np.int32)
        route.target.data.polygons.foreach_set("material_index", index)


def _show_originals(route: Route, options: Options) -> None:
    """Give the target's slots the source's materials instead of copies with baked images."""
    if not options.bake_material:
        return
    _fill_slots(route)
    for material in _materials(route.source):
        shown = fitting(route, material)
        for slot in route.target.material_slots:
            if is_made_from(slot.material, material, route.target):
                slot.material = shown


def _replace_materials(
    route: Route,
    uses: Mapping[bpy.types.Material, list[Laid | None]],
    images: Mapping[tuple[Laid | None, int], bpy.types.Image],
    uv: str,
    parts: Sheets,
) -> None:
    """In the target's slots: copies of the source's materials with the baked images on the target's map.

    Where the target has several parts, their faces get a slot each.
    """
    target = route.target
    slots = target.material_slots
    for material, laid_on in uses.items():
        places = [at for at, slot in enumerate(slots) if is_made_from(slot.material, material, target)]
        numbers = [number for number in parts.numbers if any((use, number) in images for use in laid_on)]
        if not places or not numbers:
            continue
        earlier = [
            held for held in bpy.data.materials if held != material and is_made_from(held, material, target)
        ]
        replaced = {slots[at].material for at in places} - {material}
        copies = {}
        for number in numbers:
            copy = own_copy(route, material, _part_title(material, target, parts, number))
            _exchange(copy, [images.get((use, number)) for use in laid_on], uv)
            copies[number] = copy
        for held in bpy.data.materials:
            # What was baked from an earlier one for the next target in a chain.
            if held.get(ORIGINAL) in replaced:
                held[ORIGINAL] = copies[numbers[0]]
        _give_slots(target, places, copies, parts)
        forget(earlier)
        for copy in copies.values():
            copy.name = copy[MADE_FROM]


def _give_slots(
    target: bpy.types.Object, places: Sequence[int], copies: Mapping[int, bpy.types.Material], parts: Sheets
) -> None:
    """Show each part's copy of a material on the faces that show one of the slots at these places."""
    slots = target.material_slots
    for at in places:
        slots[at].material = next(iter(copies.values()))
    if len(copies) == 1:
        return
    index = np.empty(len(parts.faces), np.int32)
    target.data.polygons.foreach_get("material_index", index)
    shows = np.isin(index, places)
    free = list(places)
    for number, copy in copies.items():
        if free:
            at = free.pop(0)
            slots[at].material = copy
        else:
            at = len(slots)
            target.data.materials.append(copy)
        index[shows & (parts.faces == number)] = at
    target.data.polygons.foreach_set("material_index", index)


def _exchange(material: bpy.types.Material, images: Iterable[bpy.types.Image | None], uv: str) -> None:
    """Give the material's image nodes these images, None for none, and lay them on by the UV map."""
    named = {}
    for (groups, node), image in zip(image_nodes(material), images, strict=True):
        if image is None:
            continue
        node.image = image
        tree = node.id_data
        if tree not in named:
            named[tree] = tree.nodes.new("ShaderNodeUVMap")
            named[tree].uv_map = uv
            named[tree].parent, named[tree].location = node.parent, node.location
            named[tree].location.x -= node.width
        tree.links.new(named[tree].outputs["UV"], node.inputs["Vector"])
        for normal_map in normal_maps(groups, node):
            normal_map.uv_map = uv


KIND = Kind(
    "textures",
    "Textures",
    "TEXTURE",
    "Bake the source's image textures into the target's own UV layout. A target without one shows them by "
    "the source's UV map",
    names,
    prepare,
    {
        "bake_uv": StringProperty(
            name="UV Map",
            description="UV map of the target to bake into. Empty: the active one, or the first other one "
            "where the source's comes in its place",
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
    words=("texture", "textures"),
)
