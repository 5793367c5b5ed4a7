# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks of edges, carried as curves, and those of vertices and faces that belong to the same work."""

from ..mesh_write import read_attribute
from . import attributes
from .kind import Kind

# What an artist calls it → the mesh attribute that Blender keeps it in.
MARKS = {
    "Seams": "uv_seam",
    "Sharp Edges": "sharp_edge",
    "Edge Creases": "crease_edge",
    "Edge Bevel Weights": "bevel_weight_edge",
    "Freestyle Edges": "freestyle_edge",
    "Vertex Creases": "crease_vert",
    "Vertex Bevel Weights": "bevel_weight_vert",
    "Flat Faces": "sharp_face",
    "Freestyle Faces": "freestyle_face",
}


def names(source):
    present = source.data.attributes
    return [name for name, kept in MARKS.items() if kept in present and read_attribute(present[kept]).any()]


def prepare(route, wanted, options):
    return attributes.prepare(route, [MARKS[name] for name in wanted], options)


KIND = Kind(
    "marks",
    "Marks",
    "EDGESEL",
    "Carry seams, sharp edges, creases and bevel weights along the curves they form",
    names,
    prepare,
)
