# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the target that lie over each other in its layout: what is baked for one shows on the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import core, mesh_read
from ..typed import Flags, Integers
from .layouts import finite_uv
from .listed import listed
from .materials import own_slots

if TYPE_CHECKING:
    from .route import Route

# Overlap beyond this share of the covered texels is said: below, islands only touch.
OVERLAP = 0.005
# Materials lie over each other where taking them apart leaves less than this share of the overlap.
APART = 0.5


@dataclass(frozen=True)
class Sheets:
    """Which part of the target each of its triangles and faces belongs to, and what the parts are called.

    There is one without a name, or a part for each of the target's own materials where these were laid out
    over each other.
    """

    triangles: Integers
    faces: Integers
    names: tuple[str, ...] = ("",)

    @property
    def numbers(self) -> range:
        return range(len(self.names))


def sheets(route: Route, uv: str, used: Flags) -> tuple[Sheets, list[str]]:
    """The parts in which the layout `uv` is baked onto the triangles `used` (m,), and notes on overlap."""
    target = route.target
    whole = Sheets(np.zeros(len(used), int), np.zeros(len(target.data.polygons), int))
    overlap = _overlap(route, uv, used)
    if overlap <= OVERLAP:
        return whole, []
    slot = own_slots(route)
    shown = slot[route.target_triangle_faces]
    slots = np.unique(shown[used])
    parts = [_overlap(route, uv, used & (shown == number)) for number in slots]
    if len(slots) < 2 or max(parts) > APART * overlap:
        return whole, [_shared(target, uv, overlap)]
    names = tuple(_name_of(target, number) for number in slots.tolist())
    # Faces that show nothing baked go with the first part.
    number = np.where(np.isin(slot, slots), np.searchsorted(slots, slot), 0)
    apart = Sheets(number[route.target_triangle_faces], number, names)
    notes = [
        f"Materials of '{target.name}' overlap in UV map '{uv}': each of them got images of its own "
        f"({listed(names)})"
    ]
    return apart, notes + ([_shared(target, uv, max(parts))] if max(parts) > OVERLAP else [])


def overlaps(mesh: bpy.types.Mesh, uv: str) -> bool:
    """Whether parts of a mesh lie over each other in its UV map of this name."""
    corners, _ = mesh_read.triangle_corners(mesh)
    points = mesh_read.positions(mesh)[mesh_read.corner_vertices(mesh)[corners]]
    return core.load().judge_layout(points, finite_uv(mesh, uv)[corners])["overlap"] > OVERLAP


def _overlap(route: Route, uv: str, used: Flags) -> float:
    """Share of the texels covered by these triangles that more than one of them covers."""
    if not used.any():
        return 0.0
    places = finite_uv(route.target.data, uv)[route.target_corners][used]
    return core.load().judge_layout(route.target_points[route.target_triangles][used], places)["overlap"]


def _shared(target: bpy.types.Object, uv: str, overlap: float) -> str:
    return (
        f"UV map '{uv}' of '{target.name}' overlaps: {overlap:.0%} of it is used more than once, and shows "
        "the same texels there. That is right for halves that look alike. If others look wrong, unwrap anew "
        "and transfer again"
    )


def _name_of(target: bpy.types.Object, number: int) -> str:
    material = target.material_slots[number].material if number >= 0 else None
    return material.name if material is not None else "Plain"
