# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom normals, turned as the map turns the surface around each vertex."""

import bpy
import numpy as np

from .kind import Kind, Prepared


def names(source):
    return ["Custom Normals"] if source.data.has_custom_normals else []


def prepare(route, _wanted, _options):
    # Where coordinates are stretched, what stands on the surface shrinks.
    given = _unit(corner_normals(route.source.data) @ np.linalg.inv(route.source_stretch))
    carried = route.map.corner_values(*route.faces, given[route.triangle_corners])
    turn, _ = route.map_as_seen.frames
    carried = _unit(np.einsum("cij,cj->ci", turn[route.faces[1]], carried) @ route.target_stretch)
    return Prepared(lambda: _write(route.target.data, carried))


def _unit(normals):
    """Normals of unit length, as Blender wants them. Where opposite ones cancelled out, zero stands for the
    surface's own.
    """
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)


def _write(mesh, normals):
    # Since 4.5 custom normals are kept in this attribute: those of another domain would stay, unseen by what
    # Blender then sets. Before, an attribute of that name is the artist's.
    own = mesh.attributes.get("custom_normal")
    if own is not None and bpy.app.version >= (4, 5):
        mesh.attributes.remove(own)
    mesh.normals_split_custom_set(normals.tolist())


def corner_normals(mesh):
    """Normal of every face corner as shown, (corners, 3) float32."""
    values = np.empty(len(mesh.loops) * 3, np.float32)
    mesh.corner_normals.foreach_get("vector", values)
    return values.reshape(-1, 3)


KIND = Kind(
    "normals",
    "Custom Normals",
    "NORMALS_VERTEX_FACE",
    "Carry custom normals, which replace those of the target. Edges between which they differ become sharp",
    names,
    prepare,
    default=False,
)
