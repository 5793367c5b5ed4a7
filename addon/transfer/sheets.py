# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the target that lie over each other in its layout: what is baked for one shows on the others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import core, mesh_read
from ..typed import Flags, Floats, Integers
from .layouts import finite_uv
from .listed import listed
from .materials import own_slots

if TYPE_CHECKING:
    from .route import Route

# Triangles that cover less than this of the square, (in units of UV)², show one texel and no picture.
FLAT = 1e-10
# So may this share of the surface, as where needles are.
MOST_FLAT = 0.02
# Overlap beyond this share of the covered texels is said: below, islands only touch.
OVERLAP = 0.005
# Materials lie over each other where taking them apart leaves less than this share of the overlap.
APART = 0.5


@dataclass(frozen=True)
class Sheets:
    """Which part of the target each of its triangles and faces belongs to, and what the parts are called.

    There is one without a name, or a part for each of the target's own materials where these were laid out
    over each other. `overlap` is the share of the texels covered that several triangles of a part cover.
    """

    triangles: Integers
    faces: Integers
    names: tuple[str, ...] = ("",)
    overlap: float = 0.0

    @property
    def numbers(self) -> range:
        return range(len(self.names))


def sheets(route: Route, uv: str, used: Flags) -> tuple[Sheets, list[str]]:
    """The parts in which the layout `uv` is baked onto the triangles `used` (m,), and notes on overlap."""
    target = route.target
    whole = Sheets(np.zeros(len(used), int), np.zeros(len(target.data.polygons), int))
    overlap = _overlap(route, uv, used)
    if overlap <= OVERLAP:
        places = finite_uv(target.data, uv)[route.target_corners][used]
        share = flat_share(route.target_points[route.target_triangles][used], places)
        return whole, [_pointlike(target, uv, share)] if share > MOST_FLAT else []
    slot = own_slots(route)
    shown = slot[route.target_triangle_faces]
    slots = np.unique(shown[used])
    parts = [_overlap(route, uv, used & (shown == number)) for number in slots]
    if len(slots) < 2 or max(parts) > APART * overlap:
        whole = replace(whole, overlap=overlap)
        return whole, [_shared(route, uv, overlap)]
    names = tuple(_name_of(target, number) for number in slots.tolist())
    # Faces that show nothing baked go with the first part.
    number = np.where(np.isin(slot, slots), np.searchsorted(slots, slot), 0)
    apart = Sheets(number[route.target_triangle_faces], number, names, max(parts))
    notes = [
        f"Materials of '{target.name}' overlap in UV map '{uv}': each of them got images of its own "
        f"({listed(names)})"
    ]
    return apart, notes + ([_shared(route, uv, max(parts))] if max(parts) > OVERLAP else [])


def overlaps(mesh: bpy.types.Mesh, uv: str) -> bool:
    """Whether parts of a mesh lie over each other in its UV map of this name, or in single points."""
    corners, _ = mesh_read.triangle_corners(mesh)
    points = mesh_read.positions(mesh)[mesh_read.corner_vertices(mesh)[corners]]
    places = finite_uv(mesh, uv)[corners]
    overlap: float = core.load().judge_layout(points, places)["overlap"]
    return overlap > OVERLAP or flat_share(points, places) > MOST_FLAT


def covered(places: Floats) -> Floats:
    """Area that triangles cover in a layout, (m,), from the places of their corners, (m, 3, 2)."""
    sides = np.diff(places, axis=1)
    return 0.5 * np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])


def areas(points: Floats) -> Floats:
    """Area of triangles, (m,), from their corners, (m, 3, 3)."""
    sides = np.diff(points, axis=1)
    return 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)


def flat_share(points: Floats, places: Floats) -> float:
    """Share of the surface of these triangles that a layout has in single points, where no picture is."""
    area = areas(points.astype(np.float64))
    return float(area[covered(places) < FLAT].sum() / max(area.sum(), np.finfo(float).tiny))


def _overlap(route: Route, uv: str, used: Flags) -> float:
    """Share of the texels covered by these triangles that more than one of them covers."""
    if not used.any():
        return 0.0
    places = finite_uv(route.target.data, uv)[route.target_corners][used]
    return core.load().judge_layout(route.target_points[route.target_triangles][used], places)["overlap"]


def _shared(route: Route, uv: str, overlap: float) -> str:
    name = route.target.name
    if route.looks_right:
        return f"Parts of '{name}' share {overlap:.0%} of UV map '{uv}', and look alike there"
    return (
        f"UV map '{uv}' of '{name}' overlaps: {overlap:.0%} of it is used more than once, and shows the same "
        "texels there. That is right for halves that look alike. If others look wrong, unwrap anew"
    )


def _pointlike(target: bpy.types.Object, uv: str, share: float) -> str:
    return (
        f"UV map '{uv}' of '{target.name}' has {share:.0%} of the surface in single points, which show one "
        "texel each. Unwrap anew"
    )


def _name_of(target: bpy.types.Object, number: int) -> str:
    material = target.material_slots[number].material if number >= 0 else None
    return material.name if material is not None else "Plain"
