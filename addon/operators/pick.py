# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks: pick a vertex on each mesh, go to one, remove one."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty, StringProperty
from bpy.types import Operator
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector
from mathutils.interpolate import poly_3d_calc

from .. import landmarks, mesh_read, overlay, pair
from ..mesh_read import UnusableObjectError
from ..overlay import Picking, Place, Point
from ..translation import said, spoken
from ..typed import Outcome
from .step import Step, going_on, needs_pair

if TYPE_CHECKING:
    from ..character import Character

# Where a modifier changes the vertices, the vertex nearest to the place under the pointer is taken, if the
# shown surface is no farther from the modelled one than this share of its size.
MODIFIER_MISS = 0.05
# Distance of the eye from a landmark gone to, in sizes of its object.
JUMP_DISTANCE = 0.6
VIEW_KEYS = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "MOUSEPAN", "MOUSEZOOM", "MOUSEROTATE"}
LEAVING = {"ESC", "RIGHTMOUSE"}
DONE = {"RET", "NUMPAD_ENTER"}


def region_under(context: bpy.types.Context, event: bpy.types.Event) -> bpy.types.Region | None:
    """The viewport region under the pointer, None over a sidebar or another editor."""
    for area in context.window.screen.areas:
        if area.type != "VIEW_3D":
            continue
        inside = [
            region
            for region in area.regions
            if region.x <= event.mouse_x < region.x + region.width
            and region.y <= event.mouse_y < region.y + region.height
            and region.width > 1
        ]
        if inside and all(region.type == "WINDOW" for region in inside):
            return inside[0]
    return None


def redraw(context: bpy.types.Context) -> None:
    for area in context.window.screen.areas:
        if area.type == "VIEW_3D":
            area.tag_redraw()


def hit(
    context: bpy.types.Context,
    region: bpy.types.Region,
    pixel: tuple[float, float],
    objects: Iterable[bpy.types.Object],
) -> Place | None:
    """The place on one of the objects under a pixel of a region, or None."""
    view: Any = region.data
    origin, direction = (
        region_2d_to_origin_3d(region, view, pixel),
        region_2d_to_vector_3d(region, view, pixel),
    )
    depsgraph = context.evaluated_depsgraph_get()
    nearest, best = None, np.inf
    for obj in objects:
        if not obj.visible_get():
            continue
        into = obj.matrix_world.inverted_safe()
        start, along = into @ origin, (into.to_3x3() @ direction).normalized()
        found, place, _, face = obj.ray_cast(start, along, depsgraph=depsgraph)
        distance = (obj.matrix_world @ place - origin).length if found else np.inf
        if distance < best:
            nearest, best = (obj, place, face), distance
    return None if nearest is None else _between_vertices(depsgraph, *nearest)


def _between_vertices(
    depsgraph: bpy.types.Depsgraph, obj: bpy.types.Object, place: Vector, face: int
) -> Place:
    """A place on face `face` of the surface as shown, by the vertices of the mesh."""
    shown = obj.evaluated_get(depsgraph).data
    if len(shown.vertices) == len(obj.data.vertices):
        corners = tuple(shown.polygons[face].vertices)
        shares = poly_3d_calc([shown.vertices[corner].co for corner in corners], place)
        return Place(obj.session_uid, corners, tuple(shares))
    miss = np.linalg.norm(mesh_read.positions(obj.data) - np.array(place), axis=1)
    vertex = int(miss.argmin())
    if miss[vertex] > MODIFIER_MISS * np.ptp(obj.bound_box, axis=0).max():
        raise UnusableObjectError(
            f"Modifiers show '{obj.name}' far from its mesh and with other vertices. Switch them off in the "
            "viewport to pick points"
        )
    return Place(obj.session_uid, (vertex,), (1.0,))


class SPECTRAL_MATCH_OT_pick_landmarks(Step, Operator):
    """Click a point on one mesh and the same point on the other, as often as you like"""

    bl_idname = "spectral_match.pick_landmarks"
    bl_label = "Add Landmarks"
    bl_description = (
        "Click a point on one mesh and the same point on the other, as often as you like. The next match "
        "takes the map that keeps them together"
    )
    bl_options = {"INTERNAL"}

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        words = needs_pair(context)
        if words:
            return words
        if overlay.picking is not None:
            return "Already picking. Click in the viewport, or press Esc to end"
        found = pair.resolve(context)
        for obj in (*found.source_pieces, *found.target_pieces):
            if obj.mode != "OBJECT":
                return f"'{obj.name}' is in {obj.mode.replace('_', ' ').title()} Mode. Use Object Mode first"
        for pieces in (found.source_pieces, found.target_pieces):
            if not any(piece.visible_get() for piece in pieces):
                return "Show both meshes in the viewport first"
        return ""

    def act(self, _context: bpy.types.Context) -> Outcome:
        raise UnusableObjectError("Landmarks are picked in the window; scripts can call add_landmark")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        overlay.picking = Picking()
        self._added = 0
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        going_on.add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        found = pair.resolve(context)
        if found.missing or overlay.picking is None:
            return self._end(context)
        region = region_under(context, event)
        if event.value == "PRESS" and event.type in DONE:
            return self._end(context)
        if event.value == "PRESS" and event.type in LEAVING and (region or event.type == "ESC"):
            if overlay.picking.first is None:
                return self._end(context)
            overlay.picking.first = None
            self._show(context)
            return {"RUNNING_MODAL"}
        if event.value == "PRESS" and (
            event.type == "BACK_SPACE" or event.type == "Z" and (event.ctrl or event.oskey)
        ):
            self._take_back(context)
            return {"RUNNING_MODAL"}
        if event.type in VIEW_KEYS or event.type.startswith(("NUMPAD_", "NDOF_")) or event.alt:
            return {"PASS_THROUGH"}
        if event.type == "LEFTMOUSE" and region is not None:
            if event.value == "PRESS":
                self.forget()
                self.attempt(self._click, context, found, region, event)
            return {"RUNNING_MODAL"}
        if event.type == "MOUSEMOVE":
            try:
                overlay.picking.hovered = self._under(context, found, region, event)
                self._show(context)
            except UnusableObjectError as reason:
                # Said where the pointer is; a click says it aloud.
                overlay.picking.hovered = None
                context.workspace.status_text_set(spoken(str(reason)))
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._end(context)

    @staticmethod
    def _under(
        context: bpy.types.Context, found: pair.Pair, region: bpy.types.Region | None, event: bpy.types.Event
    ) -> Point | None:
        """The vertex under the pointer, or None."""
        if region is None:
            return None
        pixel = (event.mouse_x - region.x, event.mouse_y - region.y)
        place = hit(context, region, pixel, (*found.source_pieces, *found.target_pieces))
        if place is None:
            return None
        return Point(place.object_uid, place.vertices[int(np.argmax(place.shares))])

    def _click(
        self,
        context: bpy.types.Context,
        found: pair.Pair,
        region: bpy.types.Region | None,
        event: bpy.types.Event,
    ) -> None:
        point = self._under(context, found, region, event)
        if point is None:
            return
        state = overlay.picking
        ends = {p.object: p.vertex for p in (state.first, point) if p is not None and p.object is not None}
        sources = [obj for obj in ends if obj in found.source.whole]
        targets = [obj for obj in ends if obj not in found.source.whole]
        if sources and targets:
            source, target = sources[0], targets[0]
            # Also where the pair is refused: it may be for the first point.
            state.first = None
            landmarks.add(context.scene.spectral_match, source, ends[source], target, ends[target])
            self._added += 1
            bpy.ops.ed.undo_push(message="Add Landmark")
        else:
            state.first = point
        self._show(context)

    def _take_back(self, context: bpy.types.Context) -> None:
        settings = context.scene.spectral_match
        if overlay.picking.first is not None:
            overlay.picking.first = None
        elif self._added and settings.landmarks:
            settings.landmarks.remove(len(settings.landmarks) - 1)
            settings.landmark_index = len(settings.landmarks) - 1
            self._added -= 1
            bpy.ops.ed.undo_push(message="Take Back Landmark")
        self._show(context)

    def _show(self, context: bpy.types.Context) -> None:
        context.workspace.status_text_set(
            f"{hint(context)}   |   Enter, Esc: {said('Done')}   |   Backspace: {said('Take Back')}"
        )
        redraw(context)

    def _end(self, context: bpy.types.Context) -> Outcome:
        overlay.picking = None
        going_on.discard(self)
        # There is no window any more when another file is being opened.
        if context.window is not None:
            context.window.cursor_modal_restore()
            context.workspace.status_text_set(None)
            redraw(context)
        if self._added:
            self.tell({"INFO"}, "1 landmark added" if self._added == 1 else f"{self._added} landmarks added")
        return {"FINISHED"}


def hint(context: bpy.types.Context) -> str:
    """What to click next."""
    found = pair.resolve(context)
    first = overlay.picking.first
    if first is None:
        return said("Click a point on '{}'", found.source.name)
    if first.object in found.source.whole:
        if len(found.targets) > 1:
            return said("Click the same point on a target")
        return said("Click the same point on '{}'", found.targets[0].name)
    return said("Click the same point on '{}'", found.source.name)


class SPECTRAL_MATCH_OT_add_landmark(Step, Operator):
    """For scripts: say that a vertex of the source and a vertex of the first target correspond"""

    bl_idname = "spectral_match.add_landmark"
    bl_label = "Add Landmark"
    bl_options = {"UNDO", "INTERNAL"}

    source_vertex: IntProperty(name="Source Vertex", min=0)
    target_vertex: IntProperty(name="Target Vertex", min=0)
    source_mesh: StringProperty(name="Source Mesh", description="Of a character: which mesh has the vertex")
    target_mesh: StringProperty(name="Target Mesh", description="Of a character: which mesh has the vertex")

    obstacle = staticmethod(needs_pair)

    def act(self, context: bpy.types.Context) -> Outcome:
        found = pair.resolve(context)
        assert found.source is not None
        source = self._piece(found.source, self.source_mesh)
        target = self._piece(found.targets[0], self.target_mesh)
        for obj, vertex in ((source, self.source_vertex), (target, self.target_vertex)):
            if vertex >= len(obj.data.vertices):
                raise UnusableObjectError(
                    f"'{obj.name}' has {len(obj.data.vertices)} vertices, so there is no vertex {vertex}"
                )
        landmarks.add(context.scene.spectral_match, source, self.source_vertex, target, self.target_vertex)
        return {"FINISHED"}

    @staticmethod
    def _piece(body: "Character", name: str) -> bpy.types.Object:
        """The mesh of a character that has this name, its lead for none."""
        found = next((piece for piece in body.pieces if piece.name == name), None)
        if name and found is None:
            raise UnusableObjectError(f"'{body.label}' has no mesh named '{name}' that takes part")
        return found or body.lead


def _needs_landmark(context: bpy.types.Context) -> str:
    chosen = context.scene.spectral_match.landmark_index in landmarks.listed(context)
    return "" if chosen else "Choose a landmark in the list"


class SPECTRAL_MATCH_OT_remove_landmark(Step, Operator):
    """Remove the chosen landmark"""

    bl_idname = "spectral_match.remove_landmark"
    bl_label = "Remove Landmark"
    bl_options = {"UNDO", "INTERNAL"}

    obstacle = staticmethod(_needs_landmark)

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        removed = settings.landmark_index
        settings.landmarks.remove(removed)
        # The next one of the list, or its last one.
        settings.landmark_index = min(
            landmarks.listed(context), key=lambda place: (place < removed, abs(place - removed)), default=-1
        )
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_go_to_landmark(Step, Operator):
    """Turn the view to the chosen landmark, seen from straight above the surface"""

    bl_idname = "spectral_match.go_to_landmark"
    bl_label = "Go to Landmark"
    bl_options = {"INTERNAL"}

    end: EnumProperty(
        name="End",
        items=(("SOURCE", "Source", "On the source"), ("TARGET", "Target", "On the target")),
    )

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        in_view = context.space_data is not None and context.space_data.type == "VIEW_3D"
        return _needs_landmark(context) if in_view else "Use this in a 3D viewport"

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        landmark = settings.landmarks[settings.landmark_index]
        found = pair.resolve(context)
        ends = next(
            ends
            for target in found.targets
            if (ends := landmarks.ends(landmark, found.source, target)) is not None
        )
        on_source = self.end == "SOURCE"
        obj, vertex = (ends.source, ends.source_vertex) if on_source else (ends.target, ends.target_vertex)
        if vertex >= len(obj.data.vertices):
            raise UnusableObjectError(
                f"'{obj.name}' got other vertices since landmark '{landmark.name}' was picked. "
                "Remove the landmark under Fix, or pick it again"
            )
        view = context.space_data.region_3d
        depsgraph = context.evaluated_depsgraph_get()
        normal = obj.matrix_world.inverted_safe().transposed().to_3x3() @ obj.data.vertices[vertex].normal
        view.view_location = overlay.world_points(obj, depsgraph, [vertex])[0]
        view.view_distance = max(JUMP_DISTANCE * max(obj.dimensions[:]), 1e-3)
        if normal.length > 0.0:
            view.view_rotation = normal.to_track_quat("Z", "Y")
        return {"FINISHED"}


CLASSES = (
    SPECTRAL_MATCH_OT_pick_landmarks,
    SPECTRAL_MATCH_OT_add_landmark,
    SPECTRAL_MATCH_OT_remove_landmark,
    SPECTRAL_MATCH_OT_go_to_landmark,
)
