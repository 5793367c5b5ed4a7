# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn a Blender object into plain arrays, or say in words why it cannot be used."""

import hashlib
from dataclasses import dataclass

import bpy
import numpy as np

from . import morph


class UnusableObjectError(Exception):
    """An object cannot take part; the text names it and says what to do."""


@dataclass(frozen=True)
class Fingerprint:
    """Two hashes of a mesh: `topology` of its numbering and faces, `shape` of its coordinates."""

    topology: str
    shape: str

    def __str__(self):
        return f"{self.topology}:{self.shape}"

    @classmethod
    def parse(cls, text):
        topology, _, shape = text.partition(":")
        return cls(topology, shape)


@dataclass(frozen=True)
class Surface:
    """What the core needs of one object, and what it takes to find that object again.

    `local` (n, 3) float32 are coordinates in object space, `vertices` (n, 3) float64 the same with the
    object's rotation and scale applied, `triangles` (m, 3) int32 the mesh's `loop_triangles`.
    """

    name: str
    object_uid: int
    mesh_uid: int
    local: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray
    mirrored: bool
    fingerprint: Fingerprint

    @property
    def outward_triangles(self):
        """Triangles wound as seen: a mirroring object transform turns every face over."""
        return self.triangles[:, ::-1] if self.mirrored else self.triangles

    def from_outward(self, barycentric):
        """Weights for the corners of `outward_triangles` → weights for the corners of `triangles`."""
        return barycentric[:, ::-1] if self.mirrored else barycentric


def check_usable(obj, *, as_target=False):
    """Raise `UnusableObjectError` when `obj` can be neither read nor, as a target, written to."""
    if obj.type != "MESH":
        raise UnusableObjectError(f"'{obj.name}' is not a mesh. Convert it to a mesh first")
    if as_target and not (obj.is_editable and obj.data.is_editable):
        raise UnusableObjectError(
            f"'{obj.name}' is linked from another file and cannot be written to. "
            "Use Object > Relations > Make Local > Selected Objects and Data"
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
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    if not obj.data.polygons:
        raise UnusableObjectError(f"'{obj.name}' has no faces. Matching needs a surface")


def positions(mesh):
    """Vertex coordinates, (n, 3) float32."""
    values = np.empty(len(mesh.vertices) * 3, np.float32)
    # The attribute is the fast path, and is absent while the mesh is open in edit mode.
    if mesh.is_editmode:
        mesh.vertices.foreach_get("co", values)
    else:
        mesh.attributes["position"].data.foreach_get("vector", values)
    return values.reshape(-1, 3)


def corner_vertices(mesh):
    """Vertex of every face corner, int32."""
    values = np.empty(len(mesh.loops), np.int32)
    if mesh.is_editmode:
        mesh.loops.foreach_get("vertex_index", values)
    else:
        mesh.attributes[".corner_vert"].data.foreach_get("value", values)
    return values


def face_starts(mesh):
    """First corner of every face and, at the end, the number of corners: (faces + 1,) int32."""
    values = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", values)
    return np.append(values, np.int32(len(mesh.loops)))


def edges(mesh):
    """Vertices of every edge, (edges, 2) int32."""
    values = np.empty(len(mesh.edges) * 2, np.int32)
    mesh.edges.foreach_get("vertices", values)
    return values.reshape(-1, 2)


def triangle_vertices(mesh):
    """`loop_triangles` as vertex ids, (m, 3) int32."""
    # Triangles stay as they are, and reading them this way is 50 times as fast; sculpts and scans are large.
    if 3 * len(mesh.polygons) == len(mesh.loops):
        return corner_vertices(mesh).reshape(-1, 3)
    mesh.calc_loop_triangles()
    # Their corners are read faster than their vertices: 125 ms instead of 150 for 500,000 quads.
    corners = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    return corner_vertices(mesh)[corners].reshape(-1, 3)


def triangle_corners(mesh):
    """`loop_triangles` as corner ids (m, 3), and the face of every triangle (m,), both int32."""
    mesh.calc_loop_triangles()
    corners = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    faces = np.empty(len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("polygon_index", faces)
    return corners.reshape(-1, 3), faces


def fingerprint(mesh):
    """Recognise the mesh later: changes with its numbering, faces or coordinates, and with nothing else."""
    return _fingerprint(positions(mesh), corner_vertices(mesh), face_starts(mesh))


def _fingerprint(points, corners, starts):
    topology = hashlib.blake2b(digest_size=12)
    topology.update(len(points).to_bytes(8, "little"))
    topology.update(corners.tobytes())
    topology.update(starts.tobytes())
    shape = hashlib.blake2b(points.tobytes(), digest_size=12)
    return Fingerprint(topology.hexdigest(), shape.hexdigest())


def reading(context, obj, *, evaluated=False, as_target=False):
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
    yield
    triangles = triangle_vertices(_same_mesh(object_uid, mesh_uid, name))
    yield
    return Surface(
        name=name,
        object_uid=object_uid,
        mesh_uid=mesh_uid,
        local=local,
        vertices=local.astype(np.float64) @ placed.T,
        triangles=triangles,
        mirrored=bool(np.linalg.det(placed) < 0.0),
        fingerprint=_fingerprint(*modelled),
    )


def _same_mesh(object_uid, mesh_uid, name):
    """The mesh that reading began with: the user may have deleted it between two steps."""
    obj = find_object(bpy.data.objects, object_uid)
    if obj is None or obj.type != "MESH" or obj.data.session_uid != mesh_uid:
        raise UnusableObjectError(f"'{name}' was deleted or got another mesh while it was read. Match again")
    return obj.data


# Below this the object is flat or a point for single precision, whatever its size in view.
SMALLEST_VOLUME_SCALE = 1e-18


def _evaluated_positions(context, obj):
    """Coordinates after modifiers and shape keys, which must leave numbering and faces as they are."""
    if morph.factor_of(obj) > 0.0:
        raise UnusableObjectError(f"'{obj.name}' is morphed. Set Morph to 0 and match again")
    shown = obj.evaluated_get(context.evaluated_depsgraph_get())
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


def find_object(scene_objects, uid):
    """The object with this session id, or None when it was deleted; a renamed object is still found."""
    return next((obj for obj in scene_objects if obj.session_uid == uid), None)
