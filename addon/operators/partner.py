# SPDX-License-Identifier: GPL-3.0-or-later
"""The partner of the point under the pointer: rest it on one character, see the point on the other."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from bpy.types import Operator

from .. import mesh_read, overlay, pair, stored_match
from ..mesh_read import UnusableObjectError
from ..mesh_write import read_places
from ..overlay import Point
from ..translation import said, spoken
from ..typed import Outcome
from .pick import hit, redraw, region_under
from .step import Step, going_on, needs_matched


def partner_of(point: Point, matched: Sequence[bpy.types.Object]) -> Point | None:
    """The vertex of the other character nearest to where the match takes a point, or None.

    `matched` are target meshes of one match.
    """
    sources = [obj for obj, _, _ in stored_match.sources_of(matched[0])]
    if point.object in matched:
        piece, faces, weights, _ = read_places(point.object.data)
        source = sources[piece[point.vertex]]
        corners = mesh_read.triangle_vertices(source.data)[faces[point.vertex]]
        return Point(source.session_uid, int(corners[weights[point.vertex].argmax()]))
    if point.object not in sources:
        return None
    own, best, nearest = sources.index(point.object), np.inf, None
    points = mesh_read.positions(point.object.data)
    triangles = mesh_read.triangle_vertices(point.object.data)
    for target in matched:
        piece, faces, weights, _ = read_places(target.data)
        here = np.flatnonzero(piece == own)
        if len(here) == 0:
            continue
        images = np.einsum("ij,ijc->ic", weights[here], points[triangles[faces[here]]])
        away = np.linalg.norm(images - points[point.vertex], axis=1)
        if away.min() < best:
            best, nearest = away.min(), Point(target.session_uid, int(here[away.argmin()]))
    return nearest


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
    ) -> tuple[Point | None, Point | None]:
        region = region_under(context, event)
        if region is None:
            return None, None
        figures = stored_match.matched_together(matched)
        sources = [obj for together in figures for obj, _, _ in stored_match.sources_of(together[0])]
        pixel = (event.mouse_x - region.x, event.mouse_y - region.y)
        point = hit(context, region, pixel, [*dict.fromkeys(sources), *matched])
        if point is None:
            return None, None
        found = (partner_of(point, together) for together in figures)
        return point, next(filter(None, found), None)

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
