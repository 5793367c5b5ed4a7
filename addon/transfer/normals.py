# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom normals, turned as the map turns the surface around each vertex."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

from ..typed import Floats, Options
from .kind import Kind, shading

if TYPE_CHECKING:
    from sgmds.transfer import Coincidence

    from .kind import Prepared
    from .route import Route


def names(source: bpy.types.Object) -> list[str]:
    return ["Custom Normals"] if source.data.has_custom_normals else []


def prepare(route: Route, _wanted: Sequence[str], _options: Options) -> Prepared:
    to_source, from_target = matrices(route)
    shown = corner_normals(route.body.data).astype(np.float64)
    given = _unit(shown @ to_source.T)
    carried = route.map.corner_values(*route.faces, given[route.triangle_corners])
    turn, _ = route.map_as_seen.frames
    carried = _unit(np.einsum("cij,cj->ci", turn[route.faces[1]], carried) @ from_target.T)
    standing = np.array(route.target.matrix_world.inverted_safe() @ route.source.matrix_world)
    lying = route.map.coincidence(route.faces[1], route.target_corners, standing)
    if lying is not None:
        carried[lying.there] = _as_they_lie(route, shown, lying)[lying.there]
    return shading(route.target, lambda mesh: _write(mesh, carried))


def _as_they_lie(route: Route, shown: Floats, lying: Coincidence) -> Floats:
    """The source's normals at the places where the target's corners lie on it."""
    normals = np.einsum("ij,ijc->ic", lying.barycentric, shown[route.triangle_corners[lying.faces]])
    # What stands on a surface is moved by the inverse transpose.
    return _unit(normals @ np.linalg.inv(lying.to_target[:3, :3]))


def matrices(route: Route, space: str = "OBJECT") -> tuple[Floats, Floats]:
    """What takes normals in a space of the source to its surface as seen, and those of the target's surface
    as seen to its space: (3, 3) each. Lengths do not count. `space` is OBJECT or WORLD.
    """
    # Where coordinates are stretched, what stands on the surface shrinks.
    to_source, from_target = np.linalg.inv(route.source_stretch), route.target_stretch
    if space == "WORLD":
        source, target = (np.array(obj.matrix_world)[:3, :3] for obj in (route.source, route.target))
        to_source, from_target = to_source @ source.T, np.linalg.inv(target).T @ from_target
    return to_source, from_target


def _unit(normals: Floats) -> Floats:
    """Normals of unit length, as Blender wants them. Where opposite ones cancelled out, zero stands for the
    surface's own.
    """
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)


def _write(mesh: bpy.types.Mesh, normals: Floats) -> None:
    # Since 4.5 custom normals are kept in this attribute: those of another domain would stay, unseen by what
    # Blender then sets. Before, an attribute of that name is the artist's.
    own = mesh.attributes.get("custom_normal")
    if own is not None and bpy.app.version >= (4, 5):
        mesh.attributes.remove(own)
    mesh.normals_split_custom_set(normals.tolist())


def corner_normals(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
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
    words=("custom normals",),
)
