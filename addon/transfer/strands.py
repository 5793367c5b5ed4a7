# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves: strands that stand on the target where the map takes their roots, and keep their shape."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix
from mathutils.kdtree import KDTree

from .. import core, mesh_read
from ..mesh_write import read_attribute, write_attribute
from ..typed import Floats, Integers, Options
from .attachment import in_source, placed
from .copies import copied, meant_by
from .layouts import read_uv
from .uv_maps import SHARE_ROOM

if TYPE_CHECKING:
    from .route import Route

# Attributes of points that are places, as far as hair has them.
PLACES = ("position", "handle_left", "handle_right")
SURFACE_UV = "surface_uv_coordinate"


def carry(
    route: Route, companion: bpy.types.Object, _options: Options, notes: list[str]
) -> tuple[Callable[[bpy.types.Object], None], Matrix | None]:
    """What writes the strands into a copy of the companion; `notes` get what needs attention."""
    hair, matrix = companion.data, in_source(route, companion)
    first, count = _strands(hair)
    strand = np.repeat(np.arange(len(count)), count)
    names = [name for name in PLACES if _has(hair, name, "FLOAT_VECTOR")]
    places = np.array([placed(matrix, read_attribute(hair.attributes[name])) for name in names])
    found = route.map_as_seen.strands(places[0, first], places.reshape(-1, 3), np.tile(strand, len(names)))
    unsure = np.count_nonzero(found.confidence == 0.0)
    if unsure:
        notes.append(
            f"The roots of {unsure} of {len(count)} strands of '{companion.name}' have no counterpart on "
            f"'{route.target.name}' and were put onto the nearest place that has one. Check or delete them"
        )
    carried = (found.points @ np.linalg.inv(route.target_stretch)).reshape(places.shape)
    values = {name: ("FLOAT_VECTOR", "POINT", points) for name, points in zip(names, carried, strict=True)}
    if _has(hair, "radius", "FLOAT"):
        # As thick as before beside their length.
        grown = np.cbrt(abs(np.linalg.det(matrix[:3, :3]))) * found.scales[strand]
        values["radius"] = ("FLOAT", "POINT", read_attribute(hair.attributes["radius"]) * grown)
    surface, here, corners = max(route.surfaces(found.faces), key=lambda each: np.count_nonzero(each[1]))
    # A strand on another mesh goes with the nearest one that stands on this.
    roots = found.points.reshape(places.shape)[0, first]
    mate = np.arange(len(count)) if here.all() else _nearest(roots, roots[here])
    apart = np.count_nonzero(~here)
    corners, weights = corners[mate], found.barycentric[here][mate]

    def write(own: bpy.types.Object) -> None:
        _own_data(own, companion)
        for name, value in values.items():
            write_attribute(own.data, name, *value)
        if hair.surface in meant_by(route.source):
            notes.extend(_attach(route, surface, hair.surface_uv_map, own, corners, weights))
            if apart:
                notes.append(
                    f"{apart} of {len(count)} strands of '{own.name}' stand on other meshes than "
                    f"'{surface.name}', to which hair nodes attach all of them"
                )
        own.data.update_tag()

    return write, None


def _nearest(points: Floats, others: Floats) -> Integers:
    """Which of the others is the nearest to each point."""
    tree = KDTree(len(others))
    for number, point in enumerate(others.tolist()):
        tree.insert(point, number)
    tree.balance()
    return np.array([tree.find(point)[1] for point in points.tolist()], int)


def _has(hair: bpy.types.Curves, name: str, data_type: str) -> bool:
    layer = hair.attributes.get(name)
    return layer is not None and (layer.data_type, layer.domain) == (data_type, "POINT")


def _strands(hair: bpy.types.Curves) -> tuple[Integers, Integers]:
    """First point and number of points of each strand."""
    first, count = np.empty((2, len(hair.curves)), np.int32)
    hair.curves.foreach_get("first_point_index", first)
    hair.curves.foreach_get("points_length", count)
    return first, count


def _own_data(own: bpy.types.Object, companion: bpy.types.Object) -> None:
    """Give the copy hair of its own, made anew where the strands of the companion are others since."""
    before = own.data
    if before != companion.data and all(map(np.array_equal, _strands(before), _strands(companion.data))):
        return
    own.data = copied(companion.data)
    own.data.name = own.name
    if not before.users:
        bpy.data.hair_curves.remove(before)


def _attach(
    route: Route,
    target: bpy.types.Object,
    wanted: str,
    own: bpy.types.Object,
    corners: Integers,
    weights: Floats,
) -> list[str]:
    """Tell the copy where on the UV map of this mesh each strand stands, as hair nodes ask; returns notes."""
    if any(piece.add_rest_position_attribute for piece in meant_by(route.source)):
        target.add_rest_position_attribute = True
    own.data.surface = target
    if not wanted:
        return []
    layers = target.data.uv_layers
    if not layers:
        return [
            f"Strands of '{own.name}' are attached by the UV map '{wanted}', and '{target.name}' has none. "
            "For hair nodes carry UV Maps, then Other Objects again"
        ]
    # The source's map may have come under another name, beside one of the target's own.
    known = route.uv_names.get(wanted, wanted)
    name = known if known in layers else layers.active.name
    own.data.surface_uv_map = name
    uv = read_uv(target.data, name)
    places = np.einsum("ik,ikc->ic", weights, uv[corners])
    write_attribute(own.data, SURFACE_UV, "FLOAT2", "CURVE", places)
    notes = []
    if name != known:
        notes.append(
            f"'{target.name}' has no UV map '{wanted}': strands of '{own.name}' are attached by '{name}'"
        )
    if not np.isfinite(uv).all():
        notes.append(
            f"UV map '{name}' of '{target.name}' has places that are no numbers, by which strands of "
            f"'{own.name}' cannot be attached. Unwrap it anew"
        )
        return notes
    fans, _ = mesh_read.triangle_corners(target.data)
    points = mesh_read.positions(target.data)[mesh_read.corner_vertices(target.data)[fans]]
    surface = points.astype(np.float64), uv[fans]
    overlap = core.load().judge_layout(*surface)["overlap"]
    if overlap > SHARE_ROOM:
        notes.append(
            f"UV map '{name}' of '{target.name}' has {overlap:.0%} overlapping area, where hair nodes leave "
            f"strands of '{own.name}' as they are. Attach them by another one"
        )
    return notes
