# SPDX-License-Identifier: GPL-3.0-or-later
"""A source of several meshes as one object: joined copies, which last as long as a transfer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from .. import character, mesh_read
from ..mesh_read import UnusableObjectError
from ..mesh_write import COLOUR, read_attribute, read_places, sort_of, write_attribute
from ..typed import Flags, Floats, Integers, Values
from . import whole
from .armatures import MODIFIER_SETTINGS
from .copies import stand_in

# Marks the vertices of each piece while they are joined.
PIECE = "spectral_match_joined"


@dataclass(frozen=True)
class View:
    """What transfers see of a source: one object, and its triangles as the stored match counts them.

    `body` is the object whose mesh is its surface with all that it carries: the object itself, or where a
    Mirror modifier completes a source that is one mesh, the whole that was matched. `pieces` are the objects
    of which it is made, or itself, and `bodies` their surfaces.
    `triangle_corners` (m, 3) and `triangle_faces` (m,) are those of all bodies, wound the same way; those of
    a piece begin at its entry of `starts` and are wound the other way than its own where `turned_over`.
    `notes` are pairs of a piece and words on what of it is not seen.
    """

    object: bpy.types.Object
    body: bpy.types.Object
    pieces: tuple[bpy.types.Object, ...]
    bodies: tuple[whole.Body, ...]
    triangle_corners: Integers
    triangle_faces: Integers
    starts: Integers
    turned_over: Flags
    notes: tuple[tuple[bpy.types.Object, str], ...] = ()

    def places(
        self, piece: Integers, faces: Integers, barycentric: Floats, image: Integers
    ) -> tuple[Integers, Floats]:
        """Places on pieces, in modelled triangles and images in mirrors → places in these triangles."""
        faces, barycentric = self._on_bodies(
            piece, lambda body, here: body.triangles_of(faces[here], barycentric[here], image[here])
        )
        turned = self.turned_over[piece]
        return self.starts[piece] + faces, np.where(turned[:, None], barycentric[:, ::-1], barycentric)

    def in_pieces(self, faces: Integers, barycentric: Floats) -> tuple[Values, ...]:
        """Places in these triangles → the piece, its modelled triangle, the weights there, and the image."""
        piece = np.searchsorted(self.starts, faces, side="right") - 1
        turned = self.turned_over[piece]
        own = faces - self.starts[piece]
        weights = np.where(turned[:, None], barycentric[:, ::-1], barycentric)
        return piece, *self._on_bodies(piece, lambda body, here: body.as_stored(own[here], weights[here]))

    def _on_bodies(
        self, piece: Integers, values: Callable[[whole.Body, Integers], tuple[Values, ...]]
    ) -> tuple[Values, ...]:
        """What `values` tells of each body and of the places on it, in the order of the places."""
        on = [np.flatnonzero(piece == number) for number in range(len(self.bodies))]
        told = [values(body, here) for body, here in zip(self.bodies, on, strict=True)]
        back = np.argsort(np.concatenate(on))
        return tuple(np.concatenate(parts)[back] for parts in zip(*told, strict=True))

    def shown(self, points: Floats) -> Floats:
        """Places of the body's vertices where those of the object are at `points`, (n, 3)."""
        return points if self.body == self.object else self.bodies[0].shown(points)


def view_of(obj: bpy.types.Object, body: whole.Body) -> View:
    """What transfers see of a source that is one mesh, with this body."""
    return View(
        obj, body.obj, (obj,), (body,), body.corners, body.faces, np.zeros(1, np.int64), np.zeros(1, bool)
    )


@contextmanager
def seen(
    sources: Sequence[bpy.types.Object], name: str, targets: Iterable[bpy.types.Object] = ()
) -> Iterator[View]:
    """The view of a source with these meshes, the lead first, which have this name together.

    A piece that a Mirror modifier completes is whole where one of the targets was matched with its other
    half.
    """
    with ExitStack() as held:
        bodies = [
            held.enter_context(whole.body_of(obj, images))
            for obj, images in zip(sources, _images(len(sources), targets), strict=True)
        ]
        if len(sources) == 1:
            yield view_of(sources[0], bodies[0])
            return
        yield held.enter_context(_seen_joined(sources, bodies, name))


def _images(count: int, targets: Iterable[bpy.types.Object]) -> list[int]:
    """Of each piece the last image in its mirrors that one of the targets was matched with."""
    last = np.zeros(count, int)
    for target in targets:
        piece, _, _, image = read_places(target.data)
        np.maximum.at(last, piece, image)
    return last.tolist()


@contextmanager
def _seen_joined(
    sources: Sequence[bpy.types.Object], bodies: Sequence[whole.Body], name: str
) -> Iterator[View]:
    matrices = character.placed(sources)
    uv_map, notes = _shown_uv_map(sources), []
    layouts: dict[str, tuple[str, str]] = {}
    meshes, objects = [], []
    try:
        for number, (obj, body, matrix) in enumerate(zip(sources, bodies, matrices, strict=True)):
            if body.is_whole:
                whole.give_keys(body, obj)
            meshes.append(body.obj.data.copy())
            _prepare(obj, meshes[-1], matrix, number, uv_map)
            notes += [(obj, words) for words in _agree(meshes[-1], layouts)]
            objects.append(bpy.data.objects.new(obj.name, meshes[-1]))
            bpy.context.scene.collection.objects.link(objects[-1])
            _follow_bone(obj, objects[-1])
        view = replace(_joined(sources, bodies, objects, matrices), notes=tuple(notes))
        view.object.name = f"{name} ({len(sources)} meshes)"
        # The window is drawn meanwhile: neither viewport nor outliner show what is in no collection.
        bpy.context.scene.collection.objects.unlink(view.object)
        with stand_in(view.object, sources, name):
            yield view
    finally:
        # Joining removes objects, but not their meshes.
        data: Any = bpy.data
        users = data.user_map(subset=set(meshes), value_types={"OBJECT"})
        bpy.data.batch_remove({*meshes, *(obj for mesh in meshes for obj in users.get(mesh, ()))})
        bpy.context.view_layer.update()


def _shown_uv_map(sources: Iterable[bpy.types.Object]) -> str:
    """The name of the UV map by which the lead's textures are laid on where their nodes name none."""
    for obj in sources:
        for layer in obj.data.uv_layers:
            if layer.active_render:
                return layer.name
    return ""


def _prepare(obj: bpy.types.Object, mesh: bpy.types.Mesh, matrix: Floats, number: int, uv_map: str) -> None:
    """Make a copy of a piece's mesh ready to be joined: in the lead's space, with a UV map of that name."""
    for place, slot in enumerate(obj.material_slots):
        # A slot may be linked to the object instead of to its mesh.
        mesh.materials[place] = slot.material
    if number:
        mesh.transform(Matrix(matrix.tolist()), shape_keys=True)
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            mesh.flip_normals()
    shown = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if shown is not None and uv_map not in mesh.uv_layers:
        values = np.empty(2 * len(mesh.loops), np.float32)
        shown.uv.foreach_get("vector", values)
        made = mesh.uv_layers.new(name=uv_map, do_init=False)
        if made is not None:
            made.uv.foreach_set("vector", values)
    if mesh.shape_keys is not None:
        # Drivers and actions are read from the pieces.
        mesh.shape_keys.animation_data_clear()
    mesh.attributes.new(PIECE, "INT", "FACE").data.foreach_set(
        "value", np.full(len(mesh.polygons), number, np.int32)
    )


def _agree(mesh: bpy.types.Mesh, layouts: dict[str, tuple[str, str]]) -> list[str]:
    """Let the attributes of a mesh have the types and domains in `layouts`, where those of their names are
    kept that come first. Colours are converted, others left out: returns words on these.
    """
    left_out = []
    own = [(layer.name, layer.data_type, layer.domain) for layer in mesh.attributes]
    for name, data_type, domain in own:
        wanted = layouts.setdefault(name, (data_type, domain))
        if wanted == (data_type, domain) or mesh.attributes[name].is_required:
            continue
        layer = mesh.attributes[name]
        values = None
        if sort_of(data_type, domain) == sort_of(*wanted) == COLOUR:
            values = _on_domain(mesh, read_attribute(layer), domain, wanted[1])
        mesh.attributes.remove(layer)
        if values is None:
            left_out.append(
                f"Attribute '{name}' is of another type on other meshes of the source: it is left out"
            )
        else:
            write_attribute(mesh, name, *wanted, values)
    return left_out


def _on_domain(mesh: bpy.types.Mesh, values: Values, domain: str, wanted: str) -> Values:
    """Values of points for their corners, means of corners for their points, or the values as they are."""
    corner_points = mesh_read.corner_vertices(mesh)
    if (domain, wanted) == ("POINT", "CORNER"):
        return values[corner_points]
    if (domain, wanted) == ("CORNER", "POINT"):
        sums = np.zeros((len(mesh.vertices), values.shape[1]))
        np.add.at(sums, corner_points, values)
        count = np.bincount(corner_points, minlength=len(sums))
        return sums / np.maximum(count, 1)[:, None]
    return values


def _follow_bone(obj: bpy.types.Object, copy: bpy.types.Object) -> None:
    """Give the copy of a piece that hangs on a bone, without skin, the weights with which it follows it."""
    rig, bone = character.held_by_bone(obj)
    if rig is not None and character.skin_of(obj) is None and bone not in copy.vertex_groups:
        copy.vertex_groups.new(name=bone).add(range(len(copy.data.vertices)), 1.0, "REPLACE")


def _joined(
    sources: Sequence[bpy.types.Object],
    bodies: Sequence[whole.Body],
    copies: Sequence[bpy.types.Object],
    matrices: Sequence[Floats],
) -> View:
    """Join the copies into the first of them, and find the triangles of each piece again."""
    lead, first = copies[0], sources[0]
    bpy.context.view_layer.update()
    with bpy.context.temp_override(
        object=lead, active_object=lead, selected_objects=copies, selected_editable_objects=copies
    ):
        try:
            bpy.ops.object.join()
        except RuntimeError as reason:
            raise UnusableObjectError(f"The meshes of the source could not be joined: {reason}") from reason
    order = np.empty(len(lead.data.polygons), np.int32)
    lead.data.attributes[PIECE].data.foreach_get("value", order)
    lead.data.attributes.remove(lead.data.attributes[PIECE])
    corners, faces, starts = [], [], []
    turned_over = np.array([np.linalg.det(matrix[:3, :3]) < 0.0 for matrix in matrices])
    count = 0
    face_starts = mesh_read.face_starts(lead.data)
    for number, (obj, body) in enumerate(zip(sources, bodies, strict=True)):
        own_corners, own_faces, mesh = body.corners, body.faces, body.obj.data
        place = np.flatnonzero(order == number)
        size = len(mesh.polygons)
        if len(place) != size or (size and place[-1] - place[0] != size - 1):
            raise UnusableObjectError(
                f"The meshes of the source could not be joined at '{obj.name}'. Join a copy of them by hand "
                "and match with that"
            )
        if turned_over[number]:
            own_corners = _turned(own_corners, own_faces, mesh_read.face_starts(mesh))[:, ::-1]
        corners.append(own_corners + face_starts[place[0]])
        faces.append(own_faces + place[0])
        starts.append(count)
        count += len(own_faces)
    lead.matrix_world = first.matrix_world
    for rig_modifier in _rig_modifiers(sources):
        made = lead.modifiers.new(rig_modifier.name, "ARMATURE")
        made.object, made.show_viewport = rig_modifier.object, rig_modifier.show_viewport
        for setting in MODIFIER_SETTINGS:
            setattr(made, setting, getattr(rig_modifier, setting))
    bpy.context.view_layer.update()
    return View(
        lead,
        lead,
        tuple(sources),
        tuple(bodies),
        np.concatenate(corners),
        np.concatenate(faces),
        np.array(starts, np.int64),
        turned_over,
    )


def _turned(corners: Integers, faces: Integers, starts: Integers) -> Integers:
    """Where the corners of triangles are once their faces are turned over around their first corners."""
    first, size = starts[faces][:, None], np.diff(starts)[faces][:, None]
    return first + (size - (corners - first)) % size


def _rig_modifiers(sources: Iterable[bpy.types.Object]) -> Iterable[bpy.types.Modifier]:
    """One Armature modifier for each rig of the pieces, one that is on if any is."""
    found: dict[bpy.types.Object, bpy.types.Modifier] = {}
    for obj in sources:
        for modifier in obj.modifiers:
            if modifier.type == "ARMATURE" and modifier.object is not None:
                held = found.setdefault(modifier.object, modifier)
                if modifier.show_viewport and not held.show_viewport:
                    found[modifier.object] = modifier
    return found.values()
