# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn a Blender object into plain arrays, or say in words why it cannot be used."""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from . import character, completion, morph
from .typed import Flags, Floats, Integers, Values

Value = TypeVar("Value")


class UnusableObjectError(Exception):
    """An object cannot take part; the text names it and says what to do."""


@dataclass(frozen=True)
class Fingerprint:
    """Two hashes of a mesh: `topology` of its numbering and faces, `shape` of its coordinates."""

    topology: str
    shape: str

    def __str__(self) -> str:
        return f"{self.topology}:{self.shape}"

    @classmethod
    def parse(cls, text: str) -> Fingerprint:
        topology, _, shape = text.partition(":")
        return cls(topology, shape)


@dataclass(frozen=True)
class Surface:
    """What the core needs of one object, and what it takes to find that object again.

    `local` (n, 3) float32 are coordinates in object space, `triangles` (m, 3) int32 the mesh's
    `loop_triangles`, `placed` (3, 3) the object's rotation and scale. `completed` is the whole body where a
    Mirror modifier adds the other half, else None.
    """

    name: str
    object_uid: int
    mesh_uid: int
    local: Floats
    triangles: Integers
    placed: Floats
    completed: completion.Body | None
    fingerprint: Fingerprint

    @property
    def modelled(self) -> completion.Body:
        """The body as it is modelled."""
        return completion.Body.modelled(self.local.astype(np.float64), self.triangles)

    @property
    def mirrored(self) -> bool:
        """Whether the object's transform mirrors, which turns every face over."""
        return bool(np.linalg.det(self.placed) < 0.0)

    def for_core(self, body: completion.Body) -> tuple[Floats, Integers]:
        """Vertices of a body, turned and scaled as the object is, and its triangles, wound as seen."""
        # Not as a matrix product, whose threads would take the window's processor.
        vertices = np.einsum("ij,kj->ik", body.points, self.placed)
        return vertices, body.triangles[:, ::-1] if self.mirrored else body.triangles

    def from_core(
        self, body: completion.Body, faces: Integers, barycentric: Floats
    ) -> tuple[Integers, Floats]:
        """Places in those triangles → places in `triangles`."""
        return body.as_modelled(faces, barycentric[:, ::-1] if self.mirrored else barycentric)


def matched_bodies(source: Surface, target: Surface) -> tuple[completion.Body, completion.Body]:
    """Which bodies of two surfaces are matched: each whole where a Mirror modifier completes it."""
    return source.completed or source.modelled, target.completed or target.modelled


def check_usable(obj: bpy.types.Object, *, as_target: bool = False) -> None:
    """Raise `UnusableObjectError` when `obj` can be neither read nor, as a target, written to."""
    if obj.type != "MESH":
        raise UnusableObjectError(f"'{obj.name}' is not a mesh. Convert it to a mesh first")
    if as_target and not (obj.is_editable and obj.data.is_editable):
        # What a linked collection has becomes local with that collection only.
        what = "All" if any(held.library for held in obj.users_collection) else "Selected Objects and Data"
        raise UnusableObjectError(
            f"'{obj.name}' is linked from another file and cannot be written to. "
            f"Use Object > Relations > Make Local > {what}"
        )
    if as_target and (obj.override_library or obj.data.override_library):
        raise UnusableObjectError(
            f"'{obj.name}' is a library override, which cannot store a match. "
            "Use Object > Relations > Make Local > Selected Objects and Data"
        )
    if obj.mode == "SCULPT" and obj.use_dynamic_topology_sculpting:
        raise UnusableObjectError(
            f"'{obj.name}' is being sculpted with dynamic topology. Leave Sculpt Mode first"
        )
    if obj.data.is_editmode:
        obj.update_from_editmode()
    if not obj.data.polygons:
        raise UnusableObjectError(f"'{obj.name}' has no faces. Matching needs a surface")


def positions(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
    """Vertex coordinates, (n, 3) float32."""
    values = np.empty(len(mesh.vertices) * 3, np.float32)
    # The attribute is the fast path, and is absent while the mesh is open in edit mode.
    if mesh.is_editmode:
        mesh.vertices.foreach_get("co", values)
    else:
        mesh.attributes["position"].data.foreach_get("vector", values)
    return values.reshape(-1, 3)


def moved(points: Floats, matrix: Floats) -> Floats:
    """Points (n, 3) under a matrix (4, 4)."""
    # Not as a matrix product, whose threads would take the window's processor.
    return np.einsum("ij,kj->ik", points, matrix[:3, :3]) + matrix[:3, 3]


def corner_vertices(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """Vertex of every face corner, int32."""
    values = np.empty(len(mesh.loops), np.int32)
    if mesh.is_editmode:
        mesh.loops.foreach_get("vertex_index", values)
    else:
        mesh.attributes[".corner_vert"].data.foreach_get("value", values)
    return values


def face_starts(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """First corner of every face and, at the end, the number of corners: (faces + 1,) int32."""
    values = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", values)
    return np.append(values, np.int32(len(mesh.loops)))


def slots_shown(obj: bpy.types.Object) -> NDArray[np.int32]:
    """Material slot that every face shows, int32: an index beyond the slots shows the last one."""
    index = np.empty(len(obj.data.polygons), np.int32)
    obj.data.polygons.foreach_get("material_index", index)
    return np.minimum(index, len(obj.material_slots) - 1)


def edges(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """Vertices of every edge, (edges, 2) int32."""
    values = np.empty(len(mesh.edges) * 2, np.int32)
    mesh.edges.foreach_get("vertices", values)
    return values.reshape(-1, 2)


def triangle_corners(mesh: bpy.types.Mesh) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """`loop_triangles` as corner ids (m, 3), and the face of every triangle (m,), both int32."""
    corners, faces, unsure = value_of(_fans(positions(mesh), corner_vertices(mesh), face_starts(mesh)))
    return _as_blender_has_them(mesh, corners, faces, unsure), faces


def triangle_vertices(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """Vertices of the `loop_triangles`, (m, 3) int32."""
    return corner_vertices(mesh)[triangle_corners(mesh)[0]]


def value_of(generator: Generator[Any, None, Value]) -> Value:
    """Go through a generator to its end at once and return its value."""
    while True:
        try:
            next(generator)
        except StopIteration as end:
            return end.value


# Faces whose triangles are found at a time, 0.03 s of work.
FACES_A_STEP = 100_000
# Two halves of a quad with a cosine of this between them may be folded for single precision.
FLAT = 1e-4
# Reading a triangle by itself takes a microsecond, reading all takes a tenth of one for each.
MOST_SINGLE_READS = 50_000


def _fans(points: Floats, corners: Integers, starts: Integers) -> Generator[None, None, tuple[Values, ...]]:
    """Triangles of all faces around their first corners, as Blender has those of triangles and of most quads.

    A generator of short steps, because Blender reads its own only all at once (0.2 s for 500,000 quads); its
    value are the triangles' corners and faces, and which triangles Blender may have otherwise: those of
    folded quads, and of faces with more corners.
    """
    made = []
    for begin in range(0, len(starts) - 1, FACES_A_STEP):
        made.append(_fans_of(points, corners, starts[begin : begin + FACES_A_STEP + 1], begin))
        yield
    return tuple(np.concatenate(parts) for parts in zip(*made, strict=True))


def _fans_of(
    points: Floats, corners: Integers, starts: Integers, begin: int
) -> tuple[Values, Values, Values]:
    first, size = starts[:-1], np.diff(starts)
    face = np.repeat(np.arange(len(size), dtype=np.int32), size - 2)
    # A face of c corners has c - 2 triangles, so the first one of each face follows from its first corner.
    before = first - first[0] - 2 * np.arange(len(size), dtype=np.int32)
    number = np.arange(len(face), dtype=np.int32) - before[face]
    apex = first[face]
    unsure = size > 4
    quads = np.flatnonzero(size == 4)
    places = points[corners[first[quads, None] + np.arange(4)]].astype(np.float64)
    along, diagonal, up = np.moveaxis(places[:, 1:] - places[:, :1], 1, 0)

    def dot(a: Floats, b: Floats) -> Floats:
        return np.einsum("ij,ij->i", a, b)

    # (along × diagonal) · (up × diagonal): negative where both halves face the same way.
    square = dot(diagonal, diagonal)
    folded = dot(along, up) * square - dot(along, diagonal) * dot(diagonal, up)
    unsure[quads] = folded >= -FLAT * square * np.sqrt(dot(along, along) * dot(up, up))
    triangles = np.stack([apex, apex + number + 1, apex + number + 2], axis=1)
    return triangles, face + np.int32(begin), unsure[face]


def _as_blender_has_them(
    mesh: bpy.types.Mesh, corners: NDArray[np.int32], faces: Integers, unsure: Flags
) -> NDArray[np.int32]:
    """The triangles' corners with the unsure ones read from the mesh."""
    numbers = np.flatnonzero(unsure).tolist()
    if numbers:
        mesh.calc_loop_triangles()
        if len(mesh.loop_triangles) != len(faces):
            raise UnusableObjectError(f"'{mesh.name}' was edited while it was read. Match again")
        if len(numbers) > MOST_SINGLE_READS:
            mesh.loop_triangles.foreach_get("loops", corners.ravel())
        else:
            corners[numbers] = [mesh.loop_triangles[number].loops for number in numbers]
    return corners


def fingerprint(mesh: bpy.types.Mesh) -> Fingerprint:
    """Recognise the mesh later: changes with its numbering, faces or coordinates, and with nothing else."""
    return _fingerprint(positions(mesh), corner_vertices(mesh), face_starts(mesh))


def _fingerprint(points: Floats, corners: Integers, starts: Integers) -> Fingerprint:
    topology = hashlib.blake2b(digest_size=12)
    topology.update(len(points).to_bytes(8, "little"))
    topology.update(corners.tobytes())
    topology.update(starts.tobytes())
    shape = hashlib.blake2b(points.tobytes(), digest_size=12)
    return Fingerprint(topology.hexdigest(), shape.hexdigest())


def reading(
    context: bpy.types.Context, obj: bpy.types.Object, *, evaluated: bool = False, as_target: bool = False
) -> Generator[None, None, Surface]:
    """Read `obj` for the core: as modelled, or with `evaluated` as its modifiers and shape keys show it.

    A generator of short steps, between which the window lives on; its value is the `Surface`. A mesh that is
    edited meanwhile has another fingerprint in the end, because that is of what the first step read.
    """
    check_usable(obj, as_target=as_target)
    mesh = obj.data
    placed = np.array(obj.matrix_world, np.float64)[:3, :3]
    if abs(np.linalg.det(placed)) < SMALLEST_VOLUME_SCALE:
        raise UnusableObjectError(
            f"'{obj.name}' is scaled to nothing along an axis. Give it a scale other than 0"
        )
    name, object_uid, mesh_uid = obj.name, obj.session_uid, mesh.session_uid
    modelled = positions(mesh), corner_vertices(mesh), face_starts(mesh)
    local = _evaluated_positions(context, obj) if evaluated else modelled[0]
    # A modifier that adds vertices is refused where the mesh is read as shown.
    mirrors = [] if evaluated else completion.mirrors(obj, local.astype(np.float64))
    yield
    fans, faces, unsure = yield from _fans(*modelled)
    mesh = _same_mesh(object_uid, mesh_uid, name)
    triangles = modelled[1][_as_blender_has_them(mesh, fans, faces, unsure)]
    yield
    completed = completion.Body.modelled(local.astype(np.float64), triangles) if mirrors else None
    for mirror in mirrors:
        completed = completed.completed(mirror)
        yield
    read_as = _fingerprint(*modelled)
    yield
    return Surface(
        name=name,
        object_uid=object_uid,
        mesh_uid=mesh_uid,
        local=local,
        triangles=triangles,
        placed=placed,
        completed=completed,
        fingerprint=read_as,
    )


def _same_mesh(object_uid: int, mesh_uid: int, name: str) -> bpy.types.Mesh:
    """The mesh that reading began with: the user may have deleted it between two steps."""
    obj = find_object(bpy.data.objects, object_uid)
    if obj is None or obj.type != "MESH" or obj.data.session_uid != mesh_uid:
        raise UnusableObjectError(f"'{name}' was deleted or got another mesh while it was read. Match again")
    return obj.data


# Below this the object is flat or a point for single precision, whatever its size in view.
SMALLEST_VOLUME_SCALE = 1e-18


def _evaluated_positions(context: bpy.types.Context, obj: bpy.types.Object) -> NDArray[np.float32]:
    """Coordinates after modifiers and shape keys, which must leave numbering and faces as they are."""
    if morph.factor_of(obj) > 0.0:
        raise UnusableObjectError(f"'{obj.name}' is morphed. Set Morph to 0 and match again")
    depsgraph = context.evaluated_depsgraph_get()
    # Only these are evaluated for themselves: with those that an eye hides, without those switched off.
    if obj.name not in depsgraph.view_layer_eval.objects:
        raise UnusableObjectError(
            f"'{obj.name}' is hidden in all viewports or not in this view layer. Show it, or set Shape to "
            "Original"
        )
    shown = obj.evaluated_get(depsgraph)
    mesh = shown.to_mesh()
    try:
        same = len(mesh.vertices) == len(obj.data.vertices) and np.array_equal(
            corner_vertices(mesh), corner_vertices(obj.data)
        )
        if not same:
            raise UnusableObjectError(
                f"A modifier of '{obj.name}' changes its vertices ({len(obj.data.vertices)} modelled, "
                f"{len(mesh.vertices)} shown), so a match could not be stored. Apply or switch off that "
                "modifier, or set Shape to Original"
            )
        return positions(mesh)
    finally:
        shown.to_mesh_clear()


def place(context: bpy.types.Context, objects: Iterable[bpy.types.Object]) -> None:
    """Have Blender tell where these objects stand, by showing those that it left out meanwhile.

    It leaves out what is switched off or not in the view layer: in a file just opened that stands nowhere.
    """
    layer, held = context.view_layer, context.scene.collection.objects
    shown = {obj.original for obj in context.evaluated_depsgraph_get().view_layer_eval.objects}
    hidden = [obj for obj in dict.fromkeys(objects) if obj not in shown]
    if not hidden:
        return
    off, there = [obj for obj in hidden if obj.hide_viewport], set(held)
    added = [obj for obj in hidden if obj not in there]
    for obj in off:
        obj.hide_viewport = False
    for obj in added:
        held.link(obj)
    layer.update()
    for obj in added:
        held.unlink(obj)
    for obj in off:
        obj.hide_viewport = True


def present(uid: int, name: str) -> bpy.types.Object:
    """The object with this session id; raises `UnusableObjectError` when it was deleted."""
    obj = find_object(bpy.data.objects, uid)
    if not character.is_there(obj):
        raise UnusableObjectError(f"'{name}' was deleted while the match was running. Undo, or match again")
    return obj


def find_object(scene_objects: Iterable[bpy.types.Object], uid: int) -> bpy.types.Object | None:
    """The object with this session id, or None when it was deleted; a renamed object is still found."""
    return next((obj for obj in scene_objects if obj.session_uid == uid), None)
