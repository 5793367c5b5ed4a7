# SPDX-License-Identifier: GPL-3.0-or-later
"""The partner of the place under the pointer: rest it on one character, see the place on the other."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from bpy.types import Operator
from mathutils import Vector
from mathutils.geometry import closest_point_on_tri
from mathutils.interpolate import poly_3d_calc

from .. import mesh_read, overlay, pair, stored_match
from ..mesh_read import UnusableObjectError
from ..mesh_write import image_points, read_places
from ..overlay import Place
from ..translation import said, spoken
from ..typed import Floats, Outcome
from .pick import hit, redraw, region_under
from .step import Step, going_on, needs_matched


def partner_of(place: Place, matched: Sequence[bpy.types.Object]) -> Place | None:
    """Where the match takes a place of one character on the other, or None.

    `matched` are target meshes of one match.
    """
    sources = [obj for obj, _, _ in stored_match.sources_of(matched[0])]
    if place.object in matched:
        return _image_of(place, sources)
    if place.object not in sources:
        return None
    own = sources.index(place.object)
    point = np.array(place.shares) @ mesh_read.positions(place.object.data)[list(place.vertices)]
    found = (_with_image(point, sources, own, target) for target in matched)
    return min(filter(None, found), key=lambda each: each[0], default=(np.inf, None))[1]


def _image_of(place: Place, sources: Sequence[bpy.types.Object]) -> Place:
    """Where a place of a target goes, on the piece of the source that answers for most of it."""
    piece, faces, weights, _ = read_places(place.object.data)
    vertices, shares = np.array(place.vertices), np.array(place.shares)
    source = sources[piece[vertices[shares.argmax()]]]
    there = piece[vertices] == sources.index(source)
    vertices, shares = vertices[there], shares[there] / shares[there].sum()
    corners = mesh_read.triangle_vertices(source.data)[faces[vertices]]
    return Place(source.session_uid, corners.ravel().tolist(), (shares[:, None] * weights[vertices]).ravel())


def _with_image(
    point: Floats, sources: Sequence[bpy.types.Object], own: int, target: bpy.types.Object
) -> tuple[float, Place] | None:
    """The place of a target, around the vertex with the nearest image, that goes nearest to a point of the
    source's piece `own`, and how near; None where none goes to that piece.
    """
    piece, faces, weights, _ = read_places(target.data)
    here = np.flatnonzero(piece == own)
    if len(here) == 0:
        return None
    points, there = mesh_read.positions(sources[own].data), mesh_read.triangle_vertices(sources[own].data)
    images = np.full((len(piece), 3), np.inf)
    images[here] = image_points(points, there, faces[here], weights[here])
    away = np.linalg.norm(images[here] - point, axis=1)
    # Vertices at one place, as along seams, have one image.
    nearest = here[away == away.min()]
    best = float(away.min()), Place(target.session_uid, (int(nearest[0]),), (1.0,))
    triangles = mesh_read.triangle_vertices(target.data)
    around = triangles[np.isin(triangles, nearest).any(axis=1)]
    aim = Vector(point.tolist())
    for corners in around[np.isfinite(images[around]).all(axis=(1, 2))].tolist():
        seen = [Vector(images[corner].tolist()) for corner in corners]
        near = closest_point_on_tri(aim, *seen)
        gap, shares = (near - aim).length, poly_3d_calc(seen, near)
        # Of a triangle that goes to one point they are no numbers.
        if gap < best[0] and np.isfinite(shares).all():
            best = gap, Place(target.session_uid, corners, shares)
    return best


class SPECTRAL_MATCH_OT_follow_pointer(Step, Operator):
    """Rest the pointer on one character and see the matching point on the other. Esc ends it"""

    bl_idname = "spectral_match.follow_pointer"
    bl_label = "Partner Under Pointer"
    bl_options = {"INTERNAL"}

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        if overlay.picking is not None:
            return "Landmarks are being picked. Press Esc to end that"
        return needs_matched(context)

    def act(self, _context: bpy.types.Context) -> Outcome:
        raise UnusableObjectError("Points are shown in the window alone")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Outcome:
        if overlay.partners is not None:
            # Pressed again: the one that goes on sees it and ends.
            overlay.partners = None
            redraw(context)
            return {"FINISHED"}
        overlay.partners = (None, None)
        context.window_manager.modal_handler_add(self)
        going_on.add(self)
        context.workspace.status_text_set(
            f"{said('Rest the pointer on a character')}   |   Esc: {said('Done')}"
        )
        redraw(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        matched = pair.matched_pieces(context)
        if overlay.partners is None or not matched or (event.type == "ESC" and event.value == "PRESS"):
            return self._end(context)
        if event.type == "MOUSEMOVE":
            try:
                overlay.partners = self._under(context, event, matched)
            except UnusableObjectError as reason:
                overlay.partners = (None, None)
                context.workspace.status_text_set(spoken(str(reason)))
            redraw(context)
        return {"PASS_THROUGH"}

    @staticmethod
    def _under(
        context: bpy.types.Context, event: bpy.types.Event, matched: Sequence[bpy.types.Object]
    ) -> tuple[Place | None, Place | None]:
        region = region_under(context, event)
        if region is None:
            return None, None
        figures = stored_match.matched_together(matched)
        sources = [obj for together in figures for obj, _, _ in stored_match.sources_of(together[0])]
        pixel = (event.mouse_x - region.x, event.mouse_y - region.y)
        place = hit(context, region, pixel, [*dict.fromkeys(sources), *matched])
        if place is None:
            return None, None
        found = (partner_of(place, together) for together in figures)
        return place, next(filter(None, found), None)

    def cancel(self, context: bpy.types.Context) -> None:
        self._end(context)

    def _end(self, context: bpy.types.Context) -> Outcome:
        overlay.partners = None
        going_on.discard(self)
        if context.window is not None:
            context.workspace.status_text_set(None)
            redraw(context)
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_follow_pointer,)
