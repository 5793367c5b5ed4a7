# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, teeth, clothes and hair that are objects of their own: copies that follow the target's surface."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix

from .. import mesh_read
from ..typed import Options
from . import splines, strands
from .attachment import attach, copy_of, held_by, in_source, new_copy, placed
from .copies import copied, stand_in, stands_in
from .kind import Kind, Prepared
from .listed import listed
from .pieces import pieces
from .shape_keys import read_key
from .sides import rename
from .weights import rigs

if TYPE_CHECKING:
    from .route import Route
    from .sides import Sides

# Objects that show something, but have no points that can be moved.
OTHER_SHAPES = ("META", "POINTCLOUD")


def hanging(source: bpy.types.Object, types: Container[str] | None = None) -> list[bpy.types.Object]:
    """Objects that hang on the source, on its rig or on one of its bones, directly or on one another."""
    # Shapes in which bones are shown are no part of the character.
    shapes = {bone.custom_shape for rig in rigs(source) for bone in (rig.pose.bones if rig.pose else ())}
    shown = {obj for scene in bpy.data.scenes for obj in scene.objects}
    return [
        obj
        for obj in bpy.data.objects
        if obj.type in (types or CARRIERS)
        and held_by(obj, source) is not None
        and obj not in shapes
        and not stands_in(obj)
        and obj in shown
    ]


def hanging_on(pieces: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects that hang on any of these meshes of a character, and are none of them."""
    with stand_in(pieces[0], pieces[1:], pieces[0].name):
        return hanging(pieces[0])


def names(source: bpy.types.Object) -> list[str]:
    return list(dict.fromkeys(obj.name for obj in hanging(source)))


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    companions = [obj for obj in hanging(route.source) if obj.name in wanted]
    notes: list[str] = []
    carried = [CARRIERS[companion.type](route, companion, options, notes) for companion in companions]
    left = [f"'{obj.name}'" for obj in hanging(route.source, OTHER_SHAPES)]
    left += [
        f"{modifier.name} of '{route.source.name}'"
        for modifier in route.source.modifiers
        if modifier.type == "PARTICLE_SYSTEM" and modifier.particle_system.settings.type == "HAIR"
    ]
    if left:
        notes.append(f"Metaballs, point clouds and particle hair cannot follow the target: {listed(left)}")
    bound = [
        f"{modifier.name} of '{companion.name}'"
        for companion in companions
        for modifier in companion.modifiers
        if getattr(modifier, "is_bound", False) or getattr(modifier, "is_bind", False)
    ]
    if bound:
        notes.append(f"Modifiers have to be bound again on the copies: {listed(bound)}")

    def write() -> None:
        copies = []
        for companion, (fill, _) in zip(companions, carried, strict=True):
            before = copy_of(route.target, companion)
            own = before or new_copy(route.target, companion)
            fill(own)
            copies.append((own, before is None))
        # Only now: constraints may look at other copies.
        freed = [
            f"{constraint.name} of '{companion.name}'"
            for companion, (own, fresh), (_, world) in zip(companions, copies, carried, strict=True)
            for constraint in attach(route, companion, own, fresh, world)
        ]
        if freed:
            notes.append(
                "These constraints were not copied. They are off, would move the copies away, or need "
                f"something that the target lacks: {listed(freed)}"
            )

    return Prepared(write, notes)


def _carry_mesh(
    route: Route, companion: bpy.types.Object, _options: Options, _notes: list[str]
) -> tuple[Callable[[bpy.types.Object], None], Matrix | None]:
    """What writes coordinates of the companion's vertices and shape keys into a copy of it."""
    matrix = in_source(route, companion)
    back = np.linalg.inv(route.target_stretch)
    points = placed(matrix, mesh_read.positions(companion.data))
    piece = pieces(route, points, mesh_read.edges(companion.data))
    keys = companion.data.shape_keys
    moved = route.map_as_seen.followed(points, piece) @ back
    moved_keys = {
        block.name: route.map_as_seen.followed(placed(matrix, read_key(block)), piece) @ back
        for block in (keys.key_blocks if keys else ())
    }
    named, _ = route.sides.of_all(moved_keys)

    def write(own: bpy.types.Object) -> None:
        _own_mesh(own, companion, named, route.sides)
        for name, coordinates in moved_keys.items():
            block = own.data.shape_keys.key_blocks[named[name]]
            block.data.foreach_set("co", coordinates.astype(np.float32).ravel())
        own.data.vertices.foreach_set("co", moved.astype(np.float32).ravel())
        own.data.update()

    return write, None


def _own_mesh(
    own: bpy.types.Object, companion: bpy.types.Object, named: Mapping[str, str], sides: Sides
) -> None:
    """Give the copy a mesh of its own, made anew where that of the companion is another since."""
    if _fits(own.data, companion.data, named):
        return
    before = own.data
    own.data = copied(companion.data)
    own.data.name = own.name
    groups, _ = sides.of_all([group.name for group in own.vertex_groups])
    # Modifiers of a copy that was made before name its own groups already.
    asked = list(masks(own)) if before == companion.data else []
    rename(own.vertex_groups, groups)
    for modifier, setting, name in asked:
        setattr(modifier, setting, groups.get(name, name))
    if named:
        rename(own.data.shape_keys.key_blocks, named, own.data.shape_keys)
        for block in own.data.shape_keys.key_blocks:
            block.vertex_group = groups.get(block.vertex_group, block.vertex_group)
    if not before.users:
        bpy.data.meshes.remove(before)


def _fits(own: bpy.types.Mesh, mesh: bpy.types.Mesh, named: Mapping[str, str]) -> bool:
    """Whether a copy's mesh is of its own and can take the coordinates of the companion's."""
    keys = [block.name for block in own.shape_keys.key_blocks] if own.shape_keys else []
    topologies = {mesh_read.fingerprint(each).topology for each in (own, mesh)}
    return own != mesh and len(topologies) == 1 and keys == list(named.values())


def masks(own: bpy.types.Object) -> Iterator[tuple[bpy.types.Modifier, str, str]]:
    """Modifiers that ask vertex groups, the setting and the name of the group."""
    for modifier in own.modifiers:
        for prop in modifier.bl_rna.properties:
            if prop.type == "STRING" and "vertex_group" in prop.identifier:
                yield modifier, prop.identifier, getattr(modifier, prop.identifier)


# How the objects of each type are carried: what writes into a copy, and its place if it moves as a whole.
CARRIERS = {
    "MESH": _carry_mesh,
    "CURVES": strands.carry,
    "CURVE": splines.carry,
    "SURFACE": splines.carry,
    "FONT": splines.carry,
}

KIND = Kind(
    "objects",
    "Other Objects",
    "OUTLINER_OB_MESH",
    "Copy eyes, teeth, clothes and hair that are objects of their own, fitted to the target",
    names,
    prepare,
    default=False,
    words=("object", "objects"),
)
