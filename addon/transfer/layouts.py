# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps of the target: which are its own, which came from a source, and under which names more can come."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..mesh_read import UnusableObjectError
from ..typed import Floats, Options
from .copies import name_of

if TYPE_CHECKING:
    from .kind import Bodies
    from .route import Route

# On a mesh: the names of the UV maps that came from a source, each with the source's name for it.
CARRIED = "spectral_match_uv_maps"
# A layout covers less than this of its square, (in units of UV)², when it is none: all places are one.
EMPTY = 1e-12
# When the target is unwrapped anew for textures.
NEVER, NEEDED, OVERLAPS = "NEVER", "NEEDED", "OVERLAPS"
MOST_UV_MAPS = 8
# Longer names are cut by Blender, up to bytes of a sign.
LONGEST_NAME = 60


def read_uv(mesh: bpy.types.Mesh, name: str) -> Floats:
    """UVs of every face corner, (corners, 2)."""
    values = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers[name].uv.foreach_get("vector", values)
    return values.reshape(-1, 2).astype(np.float64)


def finite_uv(mesh: bpy.types.Mesh, name: str) -> Floats:
    """UVs as `read_uv` gives them, or `UnusableObjectError` names the map in which some are no numbers."""
    values = read_uv(mesh, name)
    if not np.isfinite(values).all():
        raise UnusableObjectError(
            f"UV map '{name}' of mesh '{mesh.name}' has places that are no numbers. Unwrap it anew"
        )
    return values


def carried_maps(mesh: bpy.types.Mesh) -> dict[str, str]:
    """The UV maps that came from a source and are still there: the source's name by the mesh's own."""
    kept = mesh.get(CARRIED)
    return {name: given for name, given in kept.items() if name in mesh.uv_layers} if kept else {}


def own_maps(mesh: bpy.types.Mesh) -> list[str]:
    """Names of the UV maps that are the mesh's own and lay it out, in Blender's order."""
    carried = carried_maps(mesh)
    return [layer.name for layer in mesh.uv_layers if layer.name not in carried and _is_laid_out(mesh, layer)]


def _is_laid_out(mesh: bpy.types.Mesh, layer: bpy.types.MeshUVLoopLayer) -> bool:
    uv = read_uv(mesh, layer.name)
    return len(uv) > 0 and not np.ptp(uv, axis=0).prod() < EMPTY


def names_on_target(
    source: bpy.types.Object, target: bpy.types.Object, wanted: Sequence[str], replace: bool
) -> dict[str, str]:
    """The target's name for each wanted UV map, beside its own ones.

    The same as on the source, or that under which it came before; where a map of the target's own has the
    name, and it shall not be replaced, that of the source object is added.
    """
    mesh = target.data
    before = {given: name for name, given in carried_maps(mesh).items()}
    own, named = set(own_maps(mesh)), {}
    taken = {layer.name for layer in mesh.uv_layers} | set(wanted)
    for name in wanted:
        if name in before:
            named[name] = before[name]
        elif name not in own or replace:
            named[name] = name
        else:
            named[name] = free_name(f"{name} {name_of(source)}"[:LONGEST_NAME], taken)
            taken.add(named[name])
    return named


def free_name(name: str, taken: Container[str]) -> str:
    """The name, with a number behind it where it is taken."""
    number, free = 1, name
    while free in taken:
        free = f"{name}.{number:03}"
        number += 1
    return free


def remember(mesh: bpy.types.Mesh, named: Mapping[str, str]) -> None:
    """Keep on the mesh which of its UV maps came from a source: their names by those on the source."""
    mesh[CARRIED] = carried_maps(mesh) | {own: given for given, own in named.items()}


def bake_map(route: Route, options: Options) -> str:
    """The UV map to bake into: one made for it, or as chosen, else of the target's own ones the active or the
    first.
    """
    if route.unwrapped:
        return route.unwrapped
    mesh = route.target.data
    if options.bake_uv or mesh.uv_layers.active is None:
        return options.bake_uv
    own = own_maps(mesh)
    active = mesh.uv_layers.active.name
    return active if active in own or not own else own[0]


def takes_over(route: Route, options: Options) -> bool:
    """Whether the UV map to bake into is one that comes from the source, or there is none but those."""
    carried = [route.uv_names[name] for name in route.wanted.get("uv", ())]
    name = bake_map(route, options)
    return name in carried or bool(carried and not name)


def bakes_into_own(route: Route, options: Options) -> bool:
    """Whether textures go into a layout of the target's own, which therefore stays the one that is shown."""
    name = bake_map(route, options)
    wanted = bool(route.wanted.get("textures"))
    return wanted and not takes_over(route, options) and name in route.target.data.uv_layers


def unwraps_bare(route: Route, options: Options) -> bool:
    """Whether a target without a layout gets one to bake textures into, instead of the source's alone."""
    return bool(route.wanted.get("textures")) and options.bake_unwrap == OVERLAPS


def may_bake(options: Options, bodies: Bodies | None) -> bool:
    """Whether textures may be baked for a target, rather than all shown by the source's UV map."""
    if bodies is None or options.bake_unwrap == OVERLAPS or not options.use_uv:
        return True
    meshes = [target.data for target in bodies.targets]
    own = any(mesh.uv_layers.keys() - carried_maps(mesh).keys() for mesh in meshes)
    return own or not any(source.data.uv_layers for source in bodies.sources)
