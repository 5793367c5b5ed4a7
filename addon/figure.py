# SPDX-License-Identifier: GPL-3.0-or-later
"""The surfaces of a character's pieces as one, and the way back from it to each of them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from . import character, completion, mesh_read
from .mesh_read import Surface, moved
from .typed import Floats, Integers


@dataclass(frozen=True)
class Part:
    """Where a piece is in a figure: its slices of the vertices and triangles.

    `turned_over` triangles are wound the other way there than in the piece, whose transform mirrors.
    """

    surface: Surface
    vertices: slice
    triangles: slice
    turned_over: bool = False


@dataclass(frozen=True)
class Figure(Surface):
    """Several surfaces in the space of the first one, which gives the fields of a `Surface`.

    `parts` are in the order of the vertices and of the triangles.
    """

    parts: tuple[Part, ...] = ()


def parts(surface: Surface) -> tuple[Part, ...]:
    """The pieces of a figure; a surface alone is its own."""
    if isinstance(surface, Figure):
        return surface.parts
    return (Part(surface, slice(0, len(surface.local)), slice(0, len(surface.triangles))),)


class Reading:
    """Reading a character's pieces as one. All that is asked of the objects at once is asked here.

    With `evaluated` they are read as they are shown and posed, else as modelled with bones at rest.
    """

    def __init__(
        self, figure: character.Character, evaluated: bool = False, *, as_target: bool = False
    ) -> None:
        self._name, self._settings = figure.label, {"evaluated": evaluated, "as_target": as_target}
        self._pieces = [(obj.session_uid, obj.name) for obj in figure.pieces]
        self._matrices = character.placed(figure.pieces, posed=evaluated)

    def steps(self, context: bpy.types.Context) -> Generator[None, None, Surface]:
        """A generator as `mesh_read.reading` is, whose value is the surface."""
        surfaces = []
        for uid, name in self._pieces:
            obj = mesh_read.present(uid, name)
            surfaces.append((yield from mesh_read.reading(context, obj, **self._settings)))
            if len(self._pieces) > 1:
                yield
        return surfaces[0] if len(surfaces) == 1 else joined(self._name, surfaces, self._matrices)


def joined(name: str, surfaces: Sequence[Surface], matrices: Sequence[Floats]) -> Figure:
    """One figure of surfaces and the matrices (4, 4) that lead from their spaces to that of the first."""
    made, placed, triangles = [], [], []
    vertex = triangle = 0
    for surface, matrix in zip(surfaces, matrices, strict=True):
        turned_over = bool(np.linalg.det(matrix[:3, :3]) < 0.0)
        points = moved(surface.local.astype(np.float64), matrix)
        own = surface.triangles[:, ::-1] if turned_over else surface.triangles
        made.append(
            Part(
                surface,
                slice(vertex, vertex + len(points)),
                slice(triangle, triangle + len(own)),
                turned_over,
            )
        )
        placed.append(points)
        triangles.append(own + np.int32(vertex))
        vertex, triangle = vertex + len(points), triangle + len(own)
    first = surfaces[0]
    return Figure(
        name=name,
        object_uid=first.object_uid,
        mesh_uid=first.mesh_uid,
        local=np.concatenate(placed).astype(np.float32),
        triangles=np.concatenate(triangles),
        placed=first.placed,
        completed=_completed(made, matrices),
        fingerprint=first.fingerprint,
        parts=tuple(made),
    )


def _completed(made: Sequence[Part], matrices: Sequence[Floats]) -> completion.Body | None:
    """The whole body where Mirror modifiers add halves of some pieces, else None.

    As in the body of one surface the modelled vertices are the first: all images come after them.
    """
    if all(part.surface.completed is None for part in made):
        return None
    modelled, images, triangles, faces, turned, image = [], [], [], [], [], []
    count = made[-1].vertices.stop
    for part, matrix in zip(made, matrices, strict=True):
        body = part.surface.completed or part.surface.modelled
        own = len(part.surface.local)
        number = np.concatenate(
            [np.arange(own) + part.vertices.start, np.arange(len(body.points) - own) + count]
        )
        count += len(body.points) - own
        points = moved(body.points, matrix)
        modelled.append(points[:own])
        images.append(points[own:])
        corners = number[body.triangles]
        triangles.append(corners[:, ::-1] if part.turned_over else corners)
        faces.append(body.face + part.triangles.start)
        turned.append(body.turned)
        image.append(body.image)
    return completion.Body(
        np.concatenate([*modelled, *images]),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(faces),
        np.concatenate(turned),
        np.concatenate(image),
    )


def in_pieces(surface: Surface, faces: Integers, barycentric: Floats) -> tuple[Integers, Integers, Floats]:
    """Places in a figure's triangles → the piece that each is on, and its triangle and weights there."""
    found = parts(surface)
    starts = np.array([part.triangles.start for part in found])
    piece = np.searchsorted(starts, faces, side="right") - 1
    turned = np.array([part.turned_over for part in found])[piece]
    return piece, faces - starts[piece], np.where(turned[:, None], barycentric[:, ::-1], barycentric)
