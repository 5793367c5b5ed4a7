# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks of edges, carried as curves, and those of vertices and faces that belong to the same work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy

from ..mesh_write import read_attribute
from ..typed import Options
from . import attributes
from .kind import Kind, shading

if TYPE_CHECKING:
    from .kind import Prepared
    from .route import Route

# What an artist calls it → the mesh attribute that Blender keeps it in.
MARKS = {
    "Seams": attributes.SEAMS,
    "Sharp Edges": "sharp_edge",
    "Edge Creases": "crease_edge",
    "Edge Bevel Weights": "bevel_weight_edge",
    "Freestyle Edges": "freestyle_edge",
    "Vertex Creases": "crease_vert",
    "Vertex Bevel Weights": "bevel_weight_vert",
    "Flat Faces": "sharp_face",
    "Freestyle Faces": "freestyle_face",
}


def names(source: bpy.types.Object) -> list[str]:
    present = source.data.attributes
    kept = {name: _kept(source.data, name) for name in MARKS}
    return [name for name in MARKS if kept[name] in present and read_attribute(present[kept[name]]).any()]


def _kept(mesh: bpy.types.Mesh, name: str) -> str:
    """The attribute in which this mesh keeps a mark."""
    if MARKS[name] == attributes.SEAMS and attributes.OLD_SEAMS in mesh.attributes:
        return attributes.OLD_SEAMS
    return MARKS[name]


def prepare(route: Route, wanted: Sequence[str], _options: Options) -> Prepared:
    kept = [_kept(route.body.data, name) for name in wanted]
    return shading(route.target, attributes.carried(route, kept))


KIND = Kind(
    "marks",
    "Marks",
    "EDGESEL",
    "Carry seams, sharp edges, creases and bevel weights along the curves they form",
    names,
    prepare,
    words=("marks",),
)
