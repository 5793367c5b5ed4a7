# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the viewport: lines between matched points, landmarks, and the point being picked.

Everything follows the objects as shown, posed or morphed, and is drawn only with the viewport's overlays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import blf
import bpy
import gpu
import numpy as np
from bpy.app.handlers import persistent
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from . import completion, landmarks, mesh_read, pair, palette, stored_match
from .mesh_write import read_attribute, read_places
from .typed import Floats, Integers, Landmark

LINES = 80
# Each mesh of a character has at least so many of them.
FEWEST_LINES = 2
# Sample points are spread over at most so many vertices, to be found in a few milliseconds.
CANDIDATES = 6000
LINE_WIDTH = 1.6
BEHIND_OPACITY = 0.2
DISC_RADIUS, RING_RADIUS = 9.0, 13.0
FACING_AWAY_OPACITY = 0.3
CORNERS = np.linspace(0.0, 2.0 * np.pi, 25)
CIRCLE = np.stack([np.cos(CORNERS), np.sin(CORNERS)], axis=1)
DARK = (0.05, 0.05, 0.05)


@dataclass
class Point:
    """A vertex of an object, found again by its session id after undo."""

    object_uid: int
    vertex: int

    @property
    def object(self) -> bpy.types.Object | None:
        return mesh_read.find_object(bpy.data.objects, self.object_uid)


@dataclass(frozen=True)
class Place:
    """A place between vertices of an object, which is found again by its session id: the share of each."""

    object_uid: int
    vertices: Sequence[int]
    shares: Sequence[float]

    @property
    def object(self) -> bpy.types.Object | None:
        return mesh_read.find_object(bpy.data.objects, self.object_uid)


@dataclass
class Picking:
    """The pick under way: the vertex under the pointer, and the first one clicked."""

    hovered: Point | None = None
    first: Point | None = None


picking: Picking | None = None
# The place under the pointer and its partner, while `follow_pointer` is on; or (None, None).
partners: tuple[Place | None, Place | None] | None = None


@dataclass(frozen=True)
class _Samples:
    """Sampled vertices of a target; piece of the source, corners and weights of their images; and colours.

    `mirroring` (n, 4, 4) takes an image to the half that a Mirror modifier of its piece shows.
    """

    fingerprints: tuple[Any, ...]
    vertices: list[int]
    pieces: Integers
    corners: Integers
    weights: Floats
    mirroring: Floats
    colours: Floats


_samples: dict[int, _Samples] = {}
_lines_handle = None
_marks_handle = None


def lines_shown() -> bool:
    return _lines_handle is not None


def show_lines(shown: bool) -> None:
    global _lines_handle
    if shown and _lines_handle is None:
        _lines_handle = bpy.types.SpaceView3D.draw_handler_add(_draw_lines, (), "WINDOW", "POST_VIEW")
    elif not shown and _lines_handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_lines_handle, "WINDOW")
        _lines_handle = None
        _samples.clear()


def spread(points: Floats, many: int) -> Integers:
    """Indices of up to `many` points, each the farthest from those before it."""
    distance = np.full(len(points), np.inf)
    chosen = [0]
    while len(chosen) < min(many, len(points)):
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return np.array(chosen)


def _samples_of(sources: Sequence[bpy.types.Object], target: bpy.types.Object, many: int = LINES) -> _Samples:
    """What to draw for this target; sampled anew when a mesh or the match changed."""
    prints = tuple(stored_match.current_fingerprint(obj.data) for obj in (*sources, target))
    known = _samples.get(target.data.session_uid)
    # The very same objects: a new match drops them even when the meshes are as before.
    if known is not None and (
        len(known.fingerprints) == len(prints)
        and all(a is b for a, b in zip(known.fingerprints, prints, strict=True))
    ):
        return known
    mesh = target.data
    points = mesh_read.positions(mesh)
    candidates = np.linspace(0, len(points) - 1, min(len(points), CANDIDATES)).astype(int)
    vertices = candidates[spread(points[candidates], many)]
    piece, faces, barycentric, image = read_places(mesh)
    confidence = read_attribute(mesh.attributes["match_confidence"])[vertices]
    triangles = []
    for source in sources:
        source.data.calc_loop_triangles()
        triangles.append(source.data.loop_triangles)
    made = _samples[mesh.session_uid] = _Samples(
        prints,
        vertices.tolist(),
        piece[vertices],
        np.array(
            [
                triangles[number][face].vertices[:]
                for number, face in zip(piece[vertices].tolist(), faces[vertices].tolist(), strict=True)
            ]
        ),
        barycentric[vertices],
        _mirroring(sources, piece[vertices], image[vertices]),
        palette.line_colours(confidence),
    )
    return made


def _mirroring(sources: Sequence[bpy.types.Object], piece: Integers, image: Integers) -> Floats:
    """What takes each image to the half that shows it, in the space of its piece: (n, 4, 4)."""
    made = np.empty((len(image), 4, 4))
    for number in np.unique(piece).tolist():
        here = piece == number
        made[here] = completion.reflections(sources[number], image[here])
    return made


def shown_mesh(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Mesh:
    """The mesh as the viewport shows it where that has the same vertices, else as modelled."""
    shown = obj.evaluated_get(depsgraph).data
    return shown if len(shown.vertices) == len(obj.data.vertices) else obj.data


def world_points(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, vertices: Sequence[int]) -> Floats:
    """Where vertices of an object are in the scene, (n, 3)."""
    mesh = shown_mesh(obj, depsgraph)
    local = np.array([mesh.vertices[vertex].co for vertex in vertices]).reshape(-1, 3)
    placed = np.array(obj.matrix_world)
    return local @ placed[:3, :3].T + placed[:3, 3]


def _overlays_shown(context: bpy.types.Context) -> bool:
    return context.space_data is not None and context.space_data.overlay.show_overlays


def _draw_lines() -> None:
    context = bpy.context
    if not _overlays_shown(context):
        return
    depsgraph = context.evaluated_depsgraph_get()
    ends, colours = [], []
    chosen = pair.shown(context).source
    matched = [(piece, body) for body in pair.matched(context) for piece in body.pieces]
    for target, body in matched:
        share = LINES / sum(len(piece.data.vertices) for piece in body.pieces)
        if not stored_match.state(target, chosen).usable:
            continue
        sources = [obj for obj, _, _ in stored_match.sources_of(target)]
        if any(obj.data.is_editmode for obj in (*sources, target)) or not target.visible_get():
            continue
        samples = _samples_of(sources, target, max(FEWEST_LINES, round(share * len(target.data.vertices))))
        start = world_points(target, depsgraph, samples.vertices)
        for number, source in enumerate(sources):
            here = samples.pieces == number
            if not here.any() or not source.visible_get():
                continue
            corners = world_points(source, depsgraph, samples.corners[here].ravel().tolist())
            images = np.einsum("ij,ijc->ic", samples.weights[here], corners.reshape(-1, 3, 3))
            placed = np.array(source.matrix_world)
            shown = placed @ samples.mirroring[here] @ np.linalg.inv(placed)
            images = np.einsum("ijk,ik->ij", shown[:, :3, :3], images) + shown[:, :3, 3]
            ends.append(np.stack([start[here], images], axis=1).reshape(-1, 3))
            colours.append(np.repeat(samples.colours[here], 2, axis=0))
    if not ends:
        return
    ends, colours = np.concatenate(ends).astype(np.float32), np.concatenate(colours)
    gpu.state.blend_set("ALPHA")
    # Faint where a body hides them, so that their ends can be told.
    for depth, opacity in (("LESS_EQUAL", 1.0), ("GREATER", BEHIND_OPACITY)):
        gpu.state.depth_test_set(depth)
        _polyline("POLYLINE_SMOOTH_COLOR", "LINES", ends, LINE_WIDTH, colours * (1.0, 1.0, 1.0, opacity))
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _polyline(shader_name: str, kind: str, points: Floats, width: float, colour: Any) -> None:
    shader = gpu.shader.from_builtin(shader_name)
    each = shader_name.endswith("SMOOTH_COLOR")
    content = {"pos": points, "color": colour.astype(np.float32)} if each else {"pos": points}
    batch = batch_for_shader(shader, kind, content)
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width * bpy.context.preferences.system.ui_scale)
    if not each:
        shader.uniform_float("color", colour)
    batch.draw(shader)


def _draw_marks() -> None:
    context = bpy.context
    settings = context.scene.spectral_match
    if not _overlays_shown(context) or not (settings.landmarks or picking or partners):
        return
    depsgraph = context.evaluated_depsgraph_get()
    gpu.state.blend_set("ALPHA")
    found = pair.shown(context)
    chosen = settings.landmark_index
    for target in found.targets if found.source is not None else ():
        for landmark, ends in landmarks.of_pair(settings, found.source, target):
            number = settings.landmarks.find(landmark.name)
            for obj, vertex in ((ends.source, ends.source_vertex), (ends.target, ends.target_vertex)):
                if vertex < len(obj.data.vertices) and obj.visible_get():
                    _draw_mark(context, depsgraph, obj, vertex, landmark, number == chosen)
    if picking is not None:
        for point in filter(None, (picking.first, picking.hovered)):
            _draw_picked(context, depsgraph, Place(point.object_uid, (point.vertex,), (1.0,)))
    for place in filter(None, partners or ()):
        _draw_picked(context, depsgraph, place)
    gpu.state.blend_set("NONE")


def _on_screen(
    context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, obj: bpy.types.Object, vertex: int
) -> tuple[Vector | None, bool]:
    """Pixel of a vertex in this region or None, and whether its surface looks towards the viewer."""
    place = Vector(world_points(obj, depsgraph, [vertex])[0])
    view = context.region_data
    pixel = location_3d_to_region_2d(context.region, view, place)
    normal = obj.matrix_world.inverted_safe().transposed().to_3x3() @ obj.data.vertices[vertex].normal
    eye = view.view_matrix.inverted()
    towards = eye.translation - place if view.is_perspective else eye.col[2].to_3d()
    return pixel, normal.dot(towards) > 0.0


def _draw_mark(
    context: bpy.types.Context,
    depsgraph: bpy.types.Depsgraph,
    obj: bpy.types.Object,
    vertex: int,
    landmark: Landmark,
    chosen: bool,
) -> None:
    pixel, facing = _on_screen(context, depsgraph, obj, vertex)
    if pixel is None:
        return
    opacity = 1.0 if facing else FACING_AWAY_OPACITY
    scale = context.preferences.system.ui_scale
    colour = palette.landmark_colour(landmark.colour)
    disc = CIRCLE * DISC_RADIUS * scale + pixel
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "TRIS", {"pos": _fan(disc)})
    shader.bind()
    shader.uniform_float("color", (*colour, opacity))
    batch.draw(shader)
    _ring(pixel, DISC_RADIUS * scale, 1.5, (*DARK, opacity))
    if chosen:
        _ring(pixel, RING_RADIUS * scale, 2.0, (1.0, 1.0, 1.0, opacity))
    if chosen:
        blf.size(0, 12.0 * scale)
        blf.color(0, 1.0, 1.0, 1.0, opacity)
        blf.position(0, pixel.x + 1.5 * RING_RADIUS * scale, pixel.y - 4.0 * scale, 0.0)
        blf.draw(0, landmark.name)


def _draw_picked(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, place: Place) -> None:
    obj = place.object
    if obj is None or max(place.vertices) >= len(obj.data.vertices):
        return
    point = np.array(place.shares) @ world_points(obj, depsgraph, place.vertices)
    pixel = location_3d_to_region_2d(context.region, context.region_data, Vector(point.tolist()))
    if pixel is None:
        return
    scale = context.preferences.system.ui_scale
    colour = (1.0, 1.0, 1.0)
    _ring(pixel, RING_RADIUS * scale, 4.0, (*DARK, 1.0))
    _ring(pixel, RING_RADIUS * scale, 2.0, (*colour, 1.0))
    _ring(pixel, 1.5 * scale, 3.0, (*colour, 1.0))


def _ring(centre: Vector, radius: float, width: float, colour: tuple[float, ...]) -> None:
    _polyline("POLYLINE_UNIFORM_COLOR", "LINE_STRIP", _flat(CIRCLE * radius + centre), width, colour)


def _fan(outline: Floats) -> Floats:
    """Triangles from an outline's first point."""
    flat = _flat(outline)
    return np.stack([np.broadcast_to(flat[0], flat[1:-1].shape), flat[1:-1], flat[2:]], axis=1).reshape(-1, 3)


def _flat(points: Floats) -> Floats:
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


@persistent
def _forget_file(_path: object, _unused: object = None) -> None:
    global picking, partners
    picking = partners = None
    show_lines(False)


HANDLERS = (("load_pre", _forget_file),)


def register() -> None:
    global _marks_handle
    # In background there is nothing to draw on.
    if not bpy.app.background:
        _marks_handle = bpy.types.SpaceView3D.draw_handler_add(_draw_marks, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    global _marks_handle, picking, partners
    picking = partners = None
    show_lines(False)
    if _marks_handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_marks_handle, "WINDOW")
        _marks_handle = None
