# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of the target cut along the images of the source's seams, with everything that they carry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations
from typing import TYPE_CHECKING, Any

import bmesh
import bpy
import numpy as np

from .. import landmarks, mesh_read, mesh_write, stored_match
from ..mesh_read import UnusableObjectError
from ..mesh_write import read_attribute, write_attribute
from ..typed import Floats, Integers, Options, Values
from .layouts import finite_uv, own_maps, unwraps_bare
from .normals import corner_normals

if TYPE_CHECKING:
    from sgmds.transfer import SeamCuts

    from .route import Route

# A layer of face corners that holds custom normals while the mesh is cut.
NORMALS = "spectral_match_normals"
MOST_ROUNDS = 5


@contextmanager
def split(route: Route, uv_maps: Sequence[str], options: Options) -> Iterator[tuple[Route, list[str]]]:
    """The route onto the target after its faces were cut along seams of these UV maps, and notes.

    Without the options, or where no face straddles, it is the same route. A failure inside takes the cuts
    back.
    """
    target = route.target
    unasked = options.split_bare and not options.split_seams
    wished = options.split_seams or (
        options.split_bare and not own_maps(target.data) and not unwraps_bare(route, options)
    )
    cuts = _cuts(route, uv_maps) if uv_maps and wished else None
    if cuts is None or len(cuts.cuts) == 0:
        yield route, []
        return
    if any(modifier.type == "MULTIRES" for modifier in target.modifiers):
        words = (
            f"'{target.name}' has a Multiresolution modifier, whose sculpt would be lost when faces are "
            "split at seams"
        )
        if unasked:
            yield route, [f"{words}: they were left whole, and textures are off where a seam runs through"]
            return
        raise UnusableObjectError(f"{words}. Apply it, or switch Split Faces at Seams off")
    mesh = target.data
    before = mesh.copy()
    try:
        with _kept_landmarks(mesh):
            route = _split_all(route, uv_maps, cuts)
        words = (
            f"Faces of '{target.name}' were split along seams: {len(mesh.vertices)} vertices now "
            f"({len(before.vertices)} before) and {len(mesh.polygons)} faces ({len(before.polygons)})"
        )
        yield route, [words]
    except BaseException:
        with _kept_landmarks(mesh):
            _restore(mesh, before)
        raise
    finally:
        bpy.data.meshes.remove(before)


def _split_all(route: Route, uv_maps: Sequence[str], cuts: SeamCuts) -> Route:
    """Cut until nothing is left: where the map is folded, new edges show faces that straddle."""
    for _ in range(MOST_ROUNDS):
        faces = len(route.target.data.polygons)
        _apply(route, cuts)
        route = route.anew()
        cuts = _cuts(route, uv_maps)
        if len(cuts.cuts) == 0 or len(route.target.data.polygons) == faces:
            break
    return route


def _cuts(route: Route, uv_maps: Sequence[str]) -> SeamCuts:
    layers = [finite_uv(route.body.data, name)[route.triangle_corners] for name in uv_maps]
    return route.map.seam_cuts(*route.faces, np.concatenate(layers, axis=2))


@contextmanager
def _kept_landmarks(mesh: bpy.types.Mesh) -> Iterator[None]:
    """Vertices keep their numbers, so landmarks keep theirs."""
    old = mesh_read.fingerprint(mesh).topology
    yield
    landmarks.follow(mesh, old, mesh_read.fingerprint(mesh).topology)


def _restore(mesh: bpy.types.Mesh, before: bpy.types.Mesh) -> None:
    edited = bmesh.new()
    try:
        edited.from_mesh(before)
        edited.to_mesh(mesh)
    finally:
        edited.free()
    stored, kept = mesh.spectral_match, before.spectral_match
    stored.target_fingerprint, stored.identifier = kept.target_fingerprint, kept.identifier
    stored_match.forget_fingerprint(mesh)


def _apply(route: Route, cuts: SeamCuts) -> None:
    mesh = route.target.data
    before = route.view.places(*mesh_write.read_places(mesh))
    normals = corner_normals(mesh) if mesh.has_custom_normals else None
    edited = bmesh.new()
    try:
        edited.from_mesh(mesh)
        layer = edited.loops.layers.float_vector.new(NORMALS) if normals is not None else None
        if layer is not None:
            corners = (loop for face in edited.faces for loop in face.loops)
            for loop, normal in zip(corners, normals.tolist(), strict=True):
                loop[layer] = normal
        made = _cut(edited, cuts)
        edited.verts.index_update()
        number = np.array([-1 if vert is None else vert.index for vert in made])
        edited.to_mesh(mesh)
    finally:
        edited.free()
    mesh.update()
    if normals is not None:
        kept = mesh.attributes[NORMALS]
        mesh.normals_split_custom_set(read_attribute(kept).tolist())
        mesh.attributes.remove(mesh.attributes[NORMALS])
    _extend_match(route, cuts, number, *before)


def _cut(edited: bmesh.types.BMesh, cuts: SeamCuts) -> list[Any]:
    """Make the points and cuts; returns vertices and points by number, None for a point that was not made."""
    count = len(edited.verts)
    made: list[Any] = list(edited.verts)
    faces = list(edited.faces)
    last, reached = (-1, -1), 0.0
    for (a, b), share in zip(cuts.edges.tolist(), cuts.shares.tolist(), strict=True):
        if a < 0:
            made.append(None)
            continue
        # Several points of one edge come in order: each divides what the last one left.
        again = (a, b) == last
        near, reached = (made[-1], reached) if again else (made[a], 0.0)
        edge = edited.edges.get([near, made[b]])
        _, vert = bmesh.utils.edge_split(edge, near, (share - reached) / (1.0 - reached))
        made.append(vert)
        last, reached = (a, b), share
    pieces: dict[int, list[bmesh.types.BMFace]] = {}
    rims: dict[int, tuple[int, list[bmesh.types.BMVert]]] = {}
    for face, begin, end in cuts.cuts.tolist():
        pieces.setdefault(face, [faces[face]])
        if made[end] is None:
            rims.setdefault(end, (face, []))[1].append(made[begin])
        else:
            _split(pieces[face], made[begin], made[end])
    for centre, (face, rim) in rims.items():
        made[centre] = _star(pieces[face], rim, cuts.positions[centre - count].tolist())
    return made


def _split(
    pieces: list[bmesh.types.BMFace],
    begin: bmesh.types.BMVert,
    end: bmesh.types.BMVert,
    coords: Any = (),
) -> tuple[bmesh.types.BMFace, bmesh.types.BMFace] | None:
    """Split whichever of the pieces of a face has both vertices; returns its halves, or None."""
    for piece in pieces:
        around = list(piece.verts)
        if begin in around and end in around:
            apart = abs(around.index(begin) - around.index(end))
            if apart not in (1, len(around) - 1):
                half, _ = bmesh.utils.face_split(piece, begin, end, coords=coords)
                pieces.append(half)
                return piece, half
    return None


def _star(
    pieces: list[bmesh.types.BMFace], rim: Sequence[bmesh.types.BMVert], position: Sequence[float]
) -> bmesh.types.BMVert | None:
    """Join a new vertex within a face to vertices on its rim."""
    for begin, end in combinations(rim, 2):
        known = {vert for piece in pieces for vert in piece.verts}
        halves = _split(pieces, begin, end, coords=[position])
        if halves is not None:
            (centre,) = set(halves[1].verts) - known
            for vert in rim:
                if vert not in (begin, end):
                    _split(pieces, centre, vert)
            return centre
    return None


def _extend_match(
    route: Route, cuts: SeamCuts, number: Values, old_faces: Integers, old_weights: Floats
) -> None:
    """The stored match of the new vertices, and of those that were moved onto a seam. Blender has mixed what
    is stored of a new vertex out of its neighbours' numbers, which says nothing.
    """
    mesh = route.target.data
    new = number[len(number) - len(cuts.shares) :]
    made = new >= 0
    place = np.concatenate([cuts.moved, new[made]])
    more = len(mesh.vertices) - len(old_faces)
    faces = np.concatenate([old_faces, np.zeros(more, old_faces.dtype)])
    weights = np.concatenate([old_weights, np.zeros((more, 3))])
    faces[place] = np.concatenate([cuts.moved_faces, cuts.faces[made]])
    weights[place] = np.concatenate([cuts.moved_barycentric, cuts.barycentric[made]])
    mesh_write.write_places(mesh, len(route.view.pieces) > 1, *route.view.in_pieces(faces, weights))
    if "match_position" in mesh.attributes:
        positions = mesh_write.image_points(route.source_points, route.triangles, faces, weights)
        write_attribute(mesh, "match_position", "FLOAT_VECTOR", "POINT", positions)
    stored = mesh.spectral_match
    stored.target_fingerprint = str(mesh_read.fingerprint(mesh))
    stored_match.forget_fingerprint(mesh)
    # The other maps found have no images for the new vertices.
    stored.identifier = ""
