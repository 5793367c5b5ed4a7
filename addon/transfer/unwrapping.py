# SPDX-License-Identifier: GPL-3.0-or-later
"""A new UV map beside the target's own ones, where textures that are baked into those would look wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import core, mesh_write
from ..mesh_read import UnusableObjectError
from ..typed import Flags, Floats, Options, Values
from .baking import cells_of, materials_of, triangles_used, uses_of
from .image_pixels import read_tiles
from .layouts import MOST_UV_MAPS, NEVER, OVERLAPS, bake_map, finite_uv, free_name, own_maps, takes_over
from .sheets import FLAT, OVERLAP, areas, covered, overlaps, sheets

if TYPE_CHECKING:
    from sgmds import SurfaceMap

    from .image_nodes import Laid
    from .route import Route

# On a mesh: the name of the UV map that was made for it.
MADE_MAP = "spectral_match_unwrapped"
MAP_NAME = "Unwrapped"
# Between islands, as a share of the square: eight texels of an image 2048 wide, half the margin baked there.
ISLAND_MARGIN = 8 / 2048
# A layout is judged by images of this side, in texels, of which the source's are made up to twice as large.
LOOKED_AT = 512
# Two colours differ for an eye that compares them where a channel does by this share of its range: chosen on
# one half of 17 meshes in painted skin and palettes, and with half as many mistakes as 0.1 on the other.
SEEN = 0.06
# Up to this share of the surface may depend on the order, half of which shows what belongs elsewhere: a scar
# or a badge on one of two halves. Chosen together with it.
WRONG = 0.02
# In more layers over whole squares something looks different, and to look at them takes long.
MOST_LAYERS = 4
# Where triangles are looked at, as weights of their corners.
PLACES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / [[3], [6], [6], [6]]


@contextmanager
def unwrapped(route: Route, textures: Sequence[str], options: Options) -> Iterator[list[str]]:
    """Give the target a UV map to bake these textures into where `options` ask for one; yields notes.

    A failure inside takes it away.
    """
    reason = _reason(route, textures, options) if textures else None
    if reason is None:
        yield []
        return
    layers, notes = route.target.data.uv_layers, []
    active, made = layers.active_index, route.target.data.get(MADE_MAP, "")
    is_new = made not in layers or overlaps(route.target.data, made)
    if is_new:
        coming = [name for name in route.uv_names.values() if name not in layers]
        if len(layers) + len(coming) >= MOST_UV_MAPS:
            yield [f"'{route.target.name}' has no room for one more UV map. Remove one"]
            return
        made = _new_map(route)
        notes = [
            f"Textures of '{route.target.name}' were baked into a new UV map, '{made}'. {reason}".rstrip()
        ]
    layers.active, route.unwrapped = layers[made], made
    try:
        yield notes
    except BaseException:
        if is_new:
            layers.remove(layers[made])
        if layers:
            layers.active_index = active
        raise


def _reason(route: Route, textures: Sequence[str], options: Options) -> str | None:
    """A sentence on why the target is unwrapped, or an empty one, or None where it is not."""
    mesh, wish = route.target.data, options.bake_unwrap
    name = bake_map(route, options)
    is_own = name in own_maps(mesh)
    if wish == NEVER or (options.bake_uv and wish != OVERLAPS):
        return None
    if wish == OVERLAPS:
        return "" if not is_own or overlaps(mesh, name) else None
    if takes_over(route, options):
        return None
    if name not in mesh.uv_layers:
        return ""
    try:
        share = _wrong(route, name, textures)
    except UnusableObjectError:
        # Baking meets it again, and says it.
        return None
    route.looks_right = share <= WRONG
    if route.looks_right:
        return None
    return f"In '{name}', {share:.0%} of it would show what belongs elsewhere"


def _wrong(route: Route, uv: str, textures: Sequence[str]) -> float:
    """Share of the surface with these textures that would show another place's where they are baked into a
    layout.

    They are baked twice, with the triangles in their order and against it: where several cover a texel, the
    last one's colour stays.
    """
    uses = materials_of(uses_of(route.source, textures, []))
    used = {use: triangles_used(route, materials) for use, materials in uses.items()}
    seen = np.logical_or.reduce([target for _, target in used.values()]) if used else np.zeros(0, bool)
    if not seen.any():
        return 0.0
    layout = finite_uv(route.target.data, uv)[route.target_corners]
    if covered(layout[seen]).sum() > MOST_LAYERS * len(cells_of(route.target, uv, layout[seen])):
        return 1.0
    flat = covered(layout) < FLAT
    area = areas(route.target_points[route.target_triangles]) * seen
    parts, _ = sheets(route, uv, seen)
    if parts.overlap <= OVERLAP and area[flat].sum() <= WRONG * area.sum():
        return 0.0
    wrong = flat.astype(float)
    backwards = core.load().SurfaceMap(
        (route.source_points, route.triangles),
        (route.target_points, route.target_triangles[::-1]),
        route.map.faces,
        route.map.barycentric,
        route.map.confidence,
    )
    # Normals of mirrored halves are other colours for the same shade.
    painted = [use for use in used if use.normals is None] or list(used)
    for use in painted:
        for number in parts.numbers:
            source_used, target_used = used[use]
            mask = target_used & (parts.triangles == number)
            if mask.any():
                clash = _clash(route, backwards, use, (source_used, mask), layout, uv)
                wrong[mask] = np.maximum(wrong, clash)[mask]
    return float((area * wrong).sum() / area.sum())


def _clash(
    route: Route, backwards: SurfaceMap, use: Laid, used: tuple[Flags, Flags], layout: Floats, uv: str
) -> Floats:
    """For each triangle of the target the share of its places whose texel depends on the order, (m,)."""
    source_used, target_used = used
    tiles = {cell: _smaller(pixels) for cell, pixels in read_tiles(use.image).items()}
    placing = np.array(use.placing)
    given = finite_uv(route.body.data, use.uv)[route.triangle_corners] @ placing[:, :2].T + placing[:, 2]
    places = np.einsum("pc,mcx->mpx", PLACES, layout)
    found = np.zeros(places.shape[:2], bool)
    for cell in cells_of(route.target, uv, layout[target_used]):
        pixels = [
            way.bake(
                given,
                (layout - cell)[::step],
                tiles,
                LOOKED_AT,
                LOOKED_AT,
                margin=0,
                extension=use.extension,
                closest=use.closest,
                source_triangles=source_used,
                target_triangles=target_used[::step],
            )
            for way, step in ((route.map, 1), (backwards, -1))
        ]
        differ = np.abs(pixels[0] - pixels[1]).max(axis=-1) > SEEN
        texel = np.floor((places - cell) * LOOKED_AT).astype(int)
        here = ((texel >= 0) & (texel < LOOKED_AT)).all(axis=2)
        found[here] |= differ[texel[here][:, 1], texel[here][:, 0]]
    return found.mean(axis=1)


def _smaller(pixels: Values) -> Values:
    """Every so many texels of an image that is more than twice as large as it is looked at."""
    step = max(1, max(pixels.shape[:2]) // (2 * LOOKED_AT))
    return np.ascontiguousarray(pixels[::step, ::step])


def _new_map(route: Route) -> str:
    """Unwrap the target into a UV map of its own under a name that nothing has, or will have."""
    places, mesh = _projected(route.target), route.target.data
    taken = {*mesh.attributes.keys(), *route.target.vertex_groups.keys(), *route.uv_names.values()}
    taken.update(name for names in route.wanted.values() for name in names)
    layer = mesh.uv_layers.new(name=free_name(MAP_NAME, taken), do_init=False)
    layer.uv.foreach_set("vector", places.astype(np.float32).ravel())
    mesh[MADE_MAP] = layer.name
    return str(layer.name)


def _projected(target: bpy.types.Object) -> Floats:
    """UVs of all face corners by Smart UV Project, (corners, 2); the target stays as it is."""
    context, objects = bpy.context, bpy.context.view_layer.objects
    active, selected = objects.active, list(objects.selected)
    mesh = target.data.copy()
    obj = bpy.data.objects.new(target.name, mesh)
    obj.matrix_world = target.matrix_world
    context.scene.collection.objects.link(obj)
    try:
        obj.shape_key_clear()
        while mesh.uv_layers:
            mesh.uv_layers.remove(mesh.uv_layers[0])
        mesh.uv_layers.new(name=MAP_NAME)
        # All that are selected, or in Edit Mode already, would be unwrapped.
        with mesh_write.object_mode(context, [each for each in objects if each.type == "MESH"]):
            for each in selected:
                each.select_set(False)
            objects.active = obj
            # In local view, which it is not in, an area's operators would not find it.
            with context.temp_override(area=None, region=None):
                bpy.ops.object.mode_set(mode="EDIT")
                bpy.ops.mesh.reveal()
                bpy.ops.mesh.select_all(action="SELECT")
                bpy.ops.uv.smart_project(island_margin=ISLAND_MARGIN)
                bpy.ops.object.mode_set(mode="OBJECT")
        places = finite_uv(mesh, mesh.uv_layers[0].name)
    finally:
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)
        objects.active = active
        for each in selected:
            each.select_set(True)
    if len(places) != len(target.data.loops) or not np.ptp(places, axis=0).all():
        raise UnusableObjectError(
            f"'{target.name}' could not be unwrapped. Unwrap it by hand and transfer again"
        )
    return places
