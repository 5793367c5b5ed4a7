# SPDX-License-Identifier: GPL-3.0-or-later
"""The source as a Mirror modifier shows it: both halves in one mesh, with everything that they carry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from .. import completion, mesh_read
from ..mesh_read import UnusableObjectError
from ..mesh_write import OURS, read_attribute, write_attribute
from ..typed import Flags, Floats, Integers
from .copies import copied
from .shape_keys import read_key

# On the whole mesh: the modelled vertex, face and corner that each of its own shows.
VERTEX, FACE, CORNER = (f"{OURS}whole_{what}" for what in ("vertex", "face", "corner"))


@dataclass(frozen=True)
class Body:
    """The source's surface: an object, and its triangles in terms of those that are modelled.

    `corners` (m, 3) and `faces` (m,) are the triangles of the object's mesh; each shows the modelled triangle
    `modelled` (m,), in the mirror `image` (m,), 0 for none, with `turned` (m,) corners. `vertex` (n,) and
    `vertex_image` (n,) tell the same of vertices. `mirrors` are those that make images: image i is turned
    around by those of its bits.
    """

    obj: bpy.types.Object
    corners: Integers
    faces: Integers
    modelled: Integers
    image: Integers
    turned: Flags
    vertex: Integers
    vertex_image: Integers
    mirrors: tuple[completion.Mirror, ...] = ()

    @classmethod
    def as_modelled(cls, source: bpy.types.Object) -> Body:
        corners, faces = mesh_read.triangle_corners(source.data)
        none = np.zeros(len(faces), int)
        vertex = np.arange(len(source.data.vertices))
        return cls(
            source, corners, faces, np.arange(len(faces)), none, none > 0, vertex, np.zeros_like(vertex)
        )

    @property
    def is_whole(self) -> bool:
        """Whether it has more than what is modelled."""
        return bool(self.mirrors)

    def triangles_of(self, faces: Integers, weights: Floats, images: Integers) -> tuple[Integers, Floats]:
        """Places in modelled triangles, in these images → triangles of this body and weights there."""
        count = self.modelled.max(initial=-1) + 1
        own = np.full((self.image.max(initial=0) + 1, count), -1)
        own[self.image, self.modelled] = np.arange(len(self.modelled))
        found = own[images, faces]
        # A face that lies in the mirror is there once.
        found = np.where(found < 0, own.max(axis=0)[faces], found)
        return found, np.where(self.turned[found, None], weights[:, ::-1], weights)

    def as_stored(self, faces: Integers, weights: Floats) -> tuple[Integers, Floats, Integers]:
        """Places in this body's triangles → modelled triangles, weights there, and images."""
        weights = np.where(self.turned[faces, None], weights[:, ::-1], weights)
        return self.modelled[faces], weights, self.image[faces]

    def shown(self, points: Floats) -> Floats:
        """Places of this body's vertices for those of the modelled ones, (n, 3), closed along the mirrors."""
        basis, points = mesh_read.positions(self.obj.data).astype(np.float64), points.copy()
        modelled = basis[np.unique(self.vertex, return_index=True)[1]]
        for mirror in self.mirrors:
            rim = mirror.merged(modelled)
            points[rim] = (points[rim] + mirror.reflected(points[rim])) / 2.0
        return self._placed(points[self.vertex])

    def _placed(self, points: Floats) -> Floats:
        for bit, mirror in enumerate(self.mirrors):
            turned = self.vertex_image >> bit & 1 > 0
            points[turned] = mirror.reflected(points[turned])
        return points


@contextmanager
def body_of(source: bpy.types.Object, images: int) -> Iterator[Body]:
    """The source's body that has all images in mirrors up to this one, 0 for none, as a match stored them.

    An object made for it is removed in the end.
    """
    if images == 0:
        yield Body.as_modelled(source)
        return
    mirrors = completion.mirrors(source, mesh_read.positions(source.data).astype(np.float64))
    if images >= 1 << len(mirrors):
        raise UnusableObjectError(
            f"'{source.name}' was matched as the whole that its Mirror modifier made of it, which it does no "
            "more. Match again"
        )
    obj = _whole(source, mirrors)
    try:
        yield _described(obj, source, tuple(mirrors))
    finally:
        mesh = obj.data
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)


def give_keys(body: Body, source: bpy.types.Object) -> None:
    """Give the object made for a body the source's shape keys, as they move the whole."""
    keys = source.data.shape_keys
    if keys is None:
        return
    for block in keys.key_blocks:
        own = body.obj.shape_key_add(name=block.name, from_mix=False)
        own.data.foreach_set("co", body.shown(read_key(block)).astype(np.float32).ravel())
    made = body.obj.data.shape_keys
    made.use_relative = keys.use_relative
    for block, own in zip(keys.key_blocks, made.key_blocks, strict=True):
        own.relative_key = made.key_blocks[block.relative_key.name]


def _whole(source: bpy.types.Object, mirrors: Sequence[completion.Mirror]) -> bpy.types.Object:
    """A copy of the source whose mesh has the halves that its Mirror modifiers add; in no scene."""
    obj = copied(source)
    obj.data = copied(source.data)
    obj.animation_data_clear()
    if obj.data.shape_keys is not None:
        obj.shape_key_clear()
    for name, domain, count in (
        (VERTEX, "POINT", len(obj.data.vertices)),
        (FACE, "FACE", len(obj.data.polygons)),
        (CORNER, "CORNER", len(obj.data.loops)),
    ):
        write_attribute(obj.data, name, "INT", domain, np.arange(count))
    axes: dict[str, list[completion.Mirror]] = {}
    for mirror in mirrors:
        axes.setdefault(mirror.modifier, []).append(mirror)
    for modifier in list(obj.modifiers):
        if modifier.name not in axes:
            obj.modifiers.remove(modifier)
            continue
        used = [mirror.axis for mirror in axes[modifier.name]]
        modifier.use_axis = [axis in used for axis in range(3)]
        modifier.use_mirror_merge = True
        points = mesh_read.positions(obj.data).astype(np.float64)
        modifier.merge_threshold = max(mirror.reach(points) for mirror in axes[modifier.name])
    obj.hide_viewport = False
    held = bpy.context.scene.collection.objects
    held.link(obj)
    modelled = obj.data
    try:
        graph = bpy.context.evaluated_depsgraph_get()
        whole = bpy.data.meshes.new_from_object(
            obj.evaluated_get(graph), preserve_all_data_layers=True, depsgraph=graph
        )
        obj.modifiers.clear()
        obj.data = whole
    finally:
        held.unlink(obj)
        if obj.data != modelled:
            bpy.data.meshes.remove(modelled)
    return obj


def _described(
    obj: bpy.types.Object, source: bpy.types.Object, mirrors: tuple[completion.Mirror, ...]
) -> Body:
    vertex, face, corner = (read_attribute(obj.data.attributes[name]) for name in (VERTEX, FACE, CORNER))
    vertex_image, face_image = _images(vertex), _images(face)
    faces = np.repeat(np.arange(len(face)), np.diff(mesh_read.face_starts(obj.data)))
    modelled, _ = mesh_read.triangle_corners(source.data)
    parts = []
    for number in range(1 << len(mirrors)):
        of = np.full(len(source.data.loops), -1)
        here = face_image[faces] == number
        of[corner[here]] = np.flatnonzero(here)
        corners = of[modelled]
        there = np.flatnonzero((corners >= 0).all(axis=1))
        odd = bool(number.bit_count() & 1)
        corners = corners[there][:, ::-1] if odd else corners[there]
        parts.append((corners, there, np.full(len(there), number), np.full(len(there), odd)))
    corners, there, image, turned = (np.concatenate(values) for values in zip(*parts, strict=True))
    return Body(obj, corners, faces[corners[:, 0]], there, image, turned, vertex, vertex_image, mirrors)


def _images(modelled: Integers) -> Integers:
    """The image of each element: Blender puts each one, in the modelled order, after those before it."""
    return np.append(0, np.cumsum(np.diff(modelled) <= 0))
