# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps: every target face takes all its UVs from one side of a seam, extrapolated in that side's own
chart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty

from .. import core
from ..mesh_read import UnusableObjectError
from ..mesh_write import check_name
from ..typed import Flags, Floats, Options
from .attributes import SEAMS
from .baking import materials_on
from .image_nodes import images
from .kind import Bodies, Kind, Prepared
from .layouts import MOST_UV_MAPS, OVERLAPS, bakes_into_own, carried_maps, finite_uv, own_maps, remember

if TYPE_CHECKING:
    from .route import Route

# Worse than the source's by more than this is said: stretch as a factor, shares of area as a difference.
STRETCH_ROOM, SHARE_ROOM = 1.25, 0.02
# More flipped than the places on the source by so much: half as much again as right transfers are at most,
# between 14 pairs of characters and their limbs, by layouts of which parts are mirrored (decision 081).
FLIP_ROOM = 0.03


def names(source: bpy.types.Object) -> list[str]:
    return [layer.name for layer in source.data.uv_layers]


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    source, target = route.body.data, route.target.data
    named = {name: route.uv_names[name] for name in wanted}
    for name in named.values():
        check_name(route.target, name, "FLOAT2", "CORNER")
    if options.mark_seams:
        check_name(route.target, SEAMS, "BOOLEAN", "EDGE")
    room = MOST_UV_MAPS - len(target.uv_layers)
    if sum(name not in target.uv_layers for name in named.values()) > room:
        raise UnusableObjectError(
            f"'{route.target.name}' has room for {room} more UV maps only; {MOST_UV_MAPS} are the most there "
            "can be. Remove one"
        )
    carried, notes = {}, []
    shown = not bakes_into_own(route, options)
    for name in wanted:
        uv = finite_uv(source, name)[route.triangle_corners]
        layout = route.map.layout(*route.faces, uv)
        carried[name] = layout.uv
        if shown:
            # Of a map by which nothing is seen its faults are no trouble.
            notes += _faults(route, named[name], uv, layout.uv)
    seams = _seams(route, carried[_active(source, wanted)]) if options.mark_seams else None
    notes += _beside(route, named)
    return Prepared(lambda: _write(source, target, named, carried, seams, shown), tuple(notes))


def _beside(route: Route, named: Mapping[str, str]) -> list[str]:
    """Words about maps that come under other names for the first time."""
    known = carried_maps(route.target.data)
    return [
        f"UV map '{name}' of '{route.target.name}' stays; that of '{route.source.name}' came beside it as "
        f"'{own}'"
        for name, own in named.items()
        if own != name and own not in known
    ]


def _active(mesh: bpy.types.Mesh, wanted: Sequence[str]) -> str:
    active = mesh.uv_layers.active
    return active.name if active is not None and active.name in wanted else wanted[0]


def _faults(route: Route, name: str, source_uv: Floats, target_uv: Floats) -> list[str]:
    """Words about what became worse on the way."""
    judge = core.load().judge_layout
    # What only other meshes of the source show says nothing about this one.
    mesh = np.searchsorted(route.view.starts, np.arange(len(route.triangles)), side="right")
    there = np.isin(mesh, mesh[route.face])
    before = judge(route.source_points[route.triangles[there]], source_uv[there])
    after = judge(route.target_points[route.target_triangles], target_uv[route.target_corners])
    found, of_map = [], f"UV map '{name}' on '{route.target.name}'"
    if after["stretch"] > STRETCH_ROOM * before["stretch"]:
        times = after["stretch"] / before["stretch"]
        found.append(f"{of_map} is stretched {times:.1f} times as much as on the source")
    flipped = _flipped_there(route, source_uv, target_uv)
    if after["flipped"] > flipped + FLIP_ROOM:
        found.append(f"{of_map} has {after['flipped']:.0%} flipped area (source {flipped:.0%})")
    if after["overlap"] > before["overlap"] + SHARE_ROOM:
        found.append(f"{of_map} has {after['overlap']:.0%} overlapping area (source {before['overlap']:.0%})")
    return found


def _flipped_there(route: Route, source_uv: Floats, target_uv: Floats) -> float:
    """The flipped share that the target has where each face is wound as its place on the source is.

    Of the whole source it would tell nothing of one limb, of which all or nothing may be mirrored.
    """
    labels = (_wound(source_uv) < 0.0).astype(np.int64)
    flipped = route.map.face_labels(*route.faces, labels)[route.target_triangle_faces] != 0
    areas = np.abs(_wound(target_uv[route.target_corners]))
    share = float(areas[flipped].sum()) / (float(areas.sum()) or 1.0)
    return min(share, 1.0 - share)


def _wound(uv: Floats) -> Floats:
    """Twice the area of triangles in UV, (m,), below zero for those that are wound the other way."""
    (x, y), (u, v) = ((uv[:, k] - uv[:, 0]).T for k in (1, 2))
    return x * v - y * u


def _seams(route: Route, uv: Floats) -> Flags:
    """For each edge of the target whether its two faces lie apart in the layout."""
    starts, vertex = route.faces
    following = np.arange(1, len(vertex) + 1)
    following[starts[1:] - 1] = starts[:-1]
    edge = np.empty(len(vertex), np.int32)
    route.target.data.loops.foreach_get("edge_index", edge)
    # Each side's UVs, in the order of the edge's vertices.
    swap = (vertex > vertex[following])[:, None]
    ends = np.hstack([np.where(swap, uv[following], uv), np.where(swap, uv, uv[following])])
    count = len(route.target.data.edges)
    low, high = np.full((count, 4), np.inf), np.full((count, 4), -np.inf)
    np.minimum.at(low, edge, ends)
    np.maximum.at(high, edge, ends)
    return (high - low > SAME_UV).any(axis=1)


# Corners further apart than this in UV are on two sides of a seam.
SAME_UV = 1e-5


def _write(
    source: bpy.types.Mesh,
    target: bpy.types.Mesh,
    named: Mapping[str, str],
    carried: Mapping[str, Floats],
    seams: Flags | None,
    shown: bool,
) -> None:
    for name, values in carried.items():
        own = named[name]
        layer = target.uv_layers.get(own) or target.uv_layers.new(name=own, do_init=False)
        layer.uv.foreach_set("vector", values.astype(np.float32).ravel())
    remember(target, named)
    active = source.uv_layers.active
    if shown and active is not None and active.name in carried:
        target.uv_layers.active = target.uv_layers[named[active.name]]
    for layer in source.uv_layers:
        if shown and layer.active_render and layer.name in carried:
            target.uv_layers[named[layer.name]].active_render = True
    if seams is not None:
        marked = np.empty(len(seams), bool)
        target.edges.foreach_get("use_seam", marked)
        target.edges.foreach_set("use_seam", seams | marked)


def _may_split_bare(options: Options, bodies: Bodies | None) -> bool:
    """Whether a target may be split at seams because it has no layout of its own."""
    if options.split_seams:
        return False
    if bodies is None:
        return True
    textured = options.use_textures and any(images(materials_on(source)) for source in bodies.sources)
    if textured and options.bake_unwrap == OVERLAPS:
        return False
    return not all(own_maps(target.data) for target in bodies.targets)


KIND = Kind(
    "uv",
    "UV Maps",
    "GROUP_UVS",
    "Carry UV maps, cut where the source's seams fall",
    names,
    prepare,
    {
        "mark_seams": BoolProperty(
            name="Mark Seams",
            default=True,
            description="Mark the target's edges as seams where the carried UV map is cut. Those that are "
            "seams already stay seams",
        ),
        "replace_uv": BoolProperty(
            name="Replace Own",
            default=False,
            description="Write over UV maps of the target that have the names of the source's. Off: those "
            "stay, and the source's come beside them",
        ),
        "split_bare": BoolProperty(
            name="Split If No UV Map",
            default=True,
            description="Cut the faces of a target that has no UV map of its own where a seam of the source "
            "runs through them, so that textures fit. Off: its topology stays",
        ),
        "split_seams": BoolProperty(
            name="Split Faces at Seams",
            default=False,
            description="Cut the target's faces where a seam of the source runs through them, whatever UV "
            "maps it has. Changes the target's topology: it gets more vertices and faces",
        ),
    },
    words=("UV map", "UV maps"),
    effects={
        "replace_uv": lambda _, bodies: (
            bodies is None
            or any(
                name in own_maps(target.data)
                for source in bodies.sources
                for name in names(source)
                for target in bodies.targets
            )
        ),
        "split_bare": _may_split_bare,
    },
)
