# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of any domain and type, and the rule by which each travels."""

import numpy as np

from .. import mesh_read
from ..mesh_write import OURS, VALUE_LAYOUT, read_attribute, write_attribute
from .kind import Kind, Prepared

# Attributes that are carried by another kind, or are the mesh itself.
BUILT_IN = frozenset(
    "position material_index sharp_face sharp_edge uv_seam crease_edge crease_vert bevel_weight_edge "
    "bevel_weight_vert freestyle_edge freestyle_face shade_smooth custom_normal id".split()
)
# A mixture of two of these is neither; they come from one place.
DISCRETE = frozenset(("INT", "INT8", "BOOLEAN", "INT16_2D", "INT32_2D"))
# Edge data that is zero on most edges is a set of curves.
MARKED_SHARE = 0.5


def names(source):
    return [layer.name for layer in source.data.attributes if _is_plain(layer)]


def _is_plain(layer):
    if layer.is_required or layer.is_internal or layer.name.startswith((OURS, ".")) or layer.name in BUILT_IN:
        return False
    is_colour = layer.data_type in ("FLOAT_COLOR", "BYTE_COLOR") and layer.domain in ("POINT", "CORNER")
    is_uv = layer.data_type == "FLOAT2" and layer.domain == "CORNER"
    return layer.data_type in VALUE_LAYOUT and not is_colour and not is_uv


def prepare(route, wanted, _options):
    carried = [_carry(route, route.source.data.attributes[name]) for name in wanted]

    def write():
        for layer in carried:
            write_attribute(route.target.data, *layer)

    return Prepared(write)


def _carry(route, layer):
    """An attribute for the target: name, type, domain, values."""
    values = read_attribute(layer)
    discrete = layer.data_type in DISCRETE
    table = values.reshape(len(values), -1).astype(np.float64)
    carried = CARRIERS[layer.domain](route, table, discrete)
    if layer.data_type == "QUATERNION":
        length = np.linalg.norm(carried, axis=1, keepdims=True)
        nothing = np.tile([1.0, 0.0, 0.0, 0.0], (len(carried), 1))
        carried = np.divide(carried, length, out=nothing, where=length > 0.0)
    if discrete:
        carried = np.rint(carried)
    return layer.name, layer.data_type, layer.domain, carried.reshape(len(carried), *values.shape[1:])


def _points(route, table, discrete):
    return table[route.nearest_vertices()] if discrete else route.to_points(table)


def _corners(route, table, discrete):
    return route.map.corner_values(*route.faces, table[route.triangle_corners], nearest=discrete)


def _faces(route, table, discrete):
    if not discrete:
        return route.map.face_means(*route.faces, table[route.triangle_faces])
    kinds, label = np.unique(table, axis=0, return_inverse=True)
    return kinds[route.map.face_labels(*route.faces, label.reshape(-1)[route.triangle_faces])]


def _edges(route, table, discrete):
    source, target = mesh_read.edges(route.source.data), mesh_read.edges(route.target.data)
    marked = (table > 0.0).mean() < MARKED_SHARE and (table >= 0.0).all()
    if discrete or marked:
        columns = [route.map.marks(source, column, target) for column in table.T]
        return np.stack(columns, axis=1)
    # Numbers on all edges are no curves: by way of the vertices.
    count = len(route.source.data.vertices)
    total = np.zeros((count, table.shape[1]))
    for k in range(2):
        np.add.at(total, source[:, k], table)
    around = np.bincount(source.ravel(), minlength=count)[:, None]
    return route.to_points(total / np.maximum(around, 1))[target].mean(axis=1)


CARRIERS = {"POINT": _points, "CORNER": _corners, "FACE": _faces, "EDGE": _edges}

KIND = Kind(
    "attributes",
    "Attributes",
    "SPREADSHEET",
    "Carry other attributes of points, edges, corners and faces",
    names,
    prepare,
)
