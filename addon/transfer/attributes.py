# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of any domain and type, and the rule by which each travels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import mesh_read
from ..mesh_write import OURS, PLAIN, VALUE_LAYOUT, check_name, read_attribute, sort_of, write_attribute
from ..typed import Floats, Options, Values
from .kind import Kind, Prepared

if TYPE_CHECKING:
    from .route import Route

# Where Blender keeps seams, and where it kept them up to 4.3 at least.
SEAMS, OLD_SEAMS = "uv_seam", ".uv_seam"
# Attributes that are carried by another kind, or are the mesh itself.
BUILT_IN = frozenset(
    "position material_index sharp_face sharp_edge crease_edge crease_vert bevel_weight_edge "
    "bevel_weight_vert freestyle_edge freestyle_face shade_smooth custom_normal id".split()
) | {SEAMS}
# A mixture of two of these is neither; they come from one place.
DISCRETE = frozenset(("INT", "INT8", "BOOLEAN", "INT16_2D", "INT32_2D", "STRING"))
# Marks of edges are curves, however many there are; other numbers of edges are not.
CURVES = frozenset((SEAMS, OLD_SEAMS, "sharp_edge", "crease_edge", "bevel_weight_edge", "freestyle_edge"))


def names(source: bpy.types.Object) -> list[str]:
    return [layer.name for layer in source.data.attributes if _is_plain(layer)]


def _is_plain(layer: bpy.types.Attribute) -> bool:
    if layer.is_required or layer.is_internal or layer.name.startswith((OURS, ".")) or layer.name in BUILT_IN:
        return False
    known = layer.data_type in VALUE_LAYOUT or layer.data_type == "STRING"
    return known and sort_of(layer.data_type, layer.domain) == PLAIN


def prepare(route: Route, wanted: Sequence[str], _options: Options) -> Prepared:
    return Prepared(partial(carried(route, wanted), route.target.data))


def carried(route: Route, wanted: Sequence[str]) -> Callable[[bpy.types.Mesh], None]:
    """A function that writes these attributes of the source onto a mesh with the target's faces."""
    layers = [route.body.data.attributes[name] for name in wanted]
    for layer in layers:
        check_name(route.target, layer.name, layer.data_type, layer.domain)
    values = [(layer.name, layer.data_type, layer.domain, _carry(route, layer)) for layer in layers]

    def write(mesh: bpy.types.Mesh) -> None:
        for layer in values:
            write_attribute(mesh, *layer)

    return write


def _carry(route: Route, layer: bpy.types.Attribute) -> Values:
    """Values of an attribute for the target."""
    values = read_attribute(layer)
    if layer.name in CURVES and layer.domain == "EDGE":
        edges = mesh_read.edges(route.body.data), mesh_read.edges(route.target.data)
        return route.map.marks(edges[0], values, edges[1])
    carry = CARRIERS[layer.domain]
    if layer.data_type in DISCRETE:
        kinds, label = np.unique(values, axis=0 if values.ndim > 1 else None, return_inverse=True)
        return kinds[np.rint(carry(route, label.reshape(-1, 1), True)[:, 0]).astype(int)]
    table = values.reshape(len(values), -1).astype(np.float64)
    carried = carry(route, table, False)
    if layer.data_type == "QUATERNION":
        carried = _rotations(carried, carry(route, _products(table), False))
    return carried.reshape(len(carried), *values.shape[1:])


def _products(quaternions: Floats) -> Floats:
    """q qᵀ for each, (n, 16): the same for q and -q, which are one rotation."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    unit = np.divide(quaternions, length, out=np.zeros_like(quaternions), where=length > 0.0)
    return (unit[:, :, None] * unit[:, None, :]).reshape(-1, 16)


def _rotations(mixed: Floats, products: Floats) -> Floats:
    """Mean rotations from mean products: their main axes, with the sign of the mixed numbers."""
    axes = np.linalg.eigh(products.reshape(-1, 4, 4))[1][:, :, -1]
    axes[np.einsum("ij,ij->i", axes, mixed) < 0.0] *= -1.0
    axes[~products.any(axis=1)] = (1.0, 0.0, 0.0, 0.0)
    return axes


def _points(route: Route, table: Values, discrete: bool) -> Values:
    return table[route.nearest_vertices()] if discrete else route.to_points(table)


def _corners(route: Route, table: Values, discrete: bool) -> Values:
    return route.map.corner_values(*route.faces, table[route.triangle_corners], nearest=discrete)


def _faces(route: Route, table: Values, discrete: bool) -> Values:
    if discrete:
        return route.map.face_labels(*route.faces, table[route.triangle_faces, 0])[:, None]
    return route.map.face_means(*route.faces, table[route.triangle_faces])


def _edges(route: Route, table: Values, _discrete: bool) -> Values:
    edges = mesh_read.edges(route.body.data), mesh_read.edges(route.target.data)
    return table[route.map.nearest_edges(*edges)]


CARRIERS = {"POINT": _points, "CORNER": _corners, "FACE": _faces, "EDGE": _edges}

KIND = Kind(
    "attributes",
    "Attributes",
    "SPREADSHEET",
    "Carry other attributes of points, edges, corners and faces",
    names,
    prepare,
    words=("attribute", "attributes"),
)
