# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, teeth, clothes and hair that are objects of their own: copies that follow the target's surface."""

import bpy
import numpy as np
from mathutils import Matrix

from .. import mesh_read
from .armatures import MADE_FOR, MADE_FROM, fitted_rig, hold_still, rigs
from .kind import Kind, Prepared
from .shape_keys import read_key
from .sides import name_on_target, names_on_target, rename

# A connected piece smaller than this share of the source's size is rigid: an eye stays round.
RIGID_SHARE = 0.1
# Objects that show something, but have no vertices to move.
OTHER_SHAPES = ("CURVES", "CURVE", "SURFACE", "META", "FONT", "POINTCLOUD")


def hanging(source, types=("MESH",)):
    """Objects that hang on the source, on its rig or on one of its bones, directly or on one another."""
    deforming = rigs(source)
    # Shapes in which bones are shown are no part of the character.
    shapes = {bone.custom_shape for rig in deforming for bone in (rig.pose.bones if rig.pose else ())}
    shown = {obj for scene in bpy.data.scenes for obj in scene.objects}
    return [
        obj
        for obj in bpy.data.objects
        if obj.type in types and _belongs(obj, source, deforming) and obj not in shapes and obj in shown
    ]


def names(source):
    return list(dict.fromkeys(obj.name for obj in hanging(source)))


def _belongs(obj, source, deforming):
    if obj == source:
        return False
    while obj is not None:
        if obj == source or obj in deforming:
            return True
        if MADE_FROM in obj or obj.spectral_match_source is not None:
            return False
        if any(m.type == "ARMATURE" and m.object in deforming for m in obj.modifiers):
            return True
        obj = obj.parent
    return False


def prepare(route, wanted, options):
    companions = [obj for obj in hanging(route.source) if obj.name in wanted]
    moved = [(companion, _moved(route, companion)) for companion in companions]
    notes = []
    left = [obj.name for obj in hanging(route.source, OTHER_SHAPES)]
    if left:
        notes.append(f"Only meshes can follow the target, so these were left: {', '.join(left)}")
    bound = [
        f"{modifier.name} of '{companion.name}'"
        for companion in companions
        for modifier in companion.modifiers
        if getattr(modifier, "is_bound", False) or getattr(modifier, "is_bind", False)
    ]
    if bound:
        notes.append(f"Modifiers have to be bound again on the copies: {', '.join(bound)}")
    constrained = [
        f"{constraint.name} of '{companion.name}'"
        for companion in companions
        for constraint in companion.constraints
    ]
    if constrained:
        notes.append(
            f"Constraints of objects were left, the copies follow the target: {', '.join(constrained)}"
        )

    def write():
        for companion, places in moved:
            _write(route, companion, places, options)

    return Prepared(write, tuple(notes))


def _moved(route, companion):
    """Coordinates of the companion's vertices, and of each of its shape keys, in the target's space."""
    to_source = np.array(route.source_to_world.inverted_safe() @ _unposed(route.source, companion))
    back = np.linalg.inv(route.target_stretch)

    def placed(points):
        return points.astype(np.float64) @ to_source[:3, :3].T + to_source[:3, 3]

    points = placed(mesh_read.positions(companion.data))
    pieces = _pieces(route, companion, points)
    keys = companion.data.shape_keys
    return route.map_as_seen.followed(points, pieces) @ back, {
        block.name: route.map_as_seen.followed(placed(read_key(block)), pieces) @ back
        for block in (keys.key_blocks if keys else ())
    }


def _bone_of(source, companion):
    """The rig and the bone on which a companion hangs at last, the bone None without one."""
    while companion != source and companion.parent is not None:
        rig = companion.parent
        if rig in rigs(source):
            bone = companion.parent_bone if companion.parent_type == "BONE" else ""
            return rig, rig.data.bones.get(bone)
        companion = rig
    return None, None


def _unposed(source, companion):
    """The companion's matrix in the world, with the bone on which it hangs at rest."""
    rig, bone = _bone_of(source, companion)
    if bone is None:
        return companion.matrix_world
    posed = rig.pose.bones[bone.name].matrix
    return (
        rig.matrix_world
        @ bone.matrix_local
        @ posed.inverted_safe()
        @ rig.matrix_world.inverted_safe()
        @ companion.matrix_world
    )


def _pieces(route, companion, points):
    """A number for each small connected piece; −1 for vertices of large ones."""
    piece = np.arange(len(points))
    edges = mesh_read.edges(companion.data)
    while True:
        lowest = piece[edges].min(axis=1)
        lower = piece.copy()
        for k in range(2):
            np.minimum.at(lower, edges[:, k], lowest)
        lower = lower[lower]
        if np.array_equal(lower, piece):
            break
        piece = lower
    low, high = np.full((len(points), 3), np.inf), np.full((len(points), 3), -np.inf)
    np.minimum.at(low, piece, points)
    np.maximum.at(high, piece, points)
    size = np.linalg.norm(np.ptp(route.source_points @ route.source_stretch, axis=0))
    small = np.linalg.norm(high[piece] - low[piece], axis=1) < RIGID_SHARE * size
    return np.where(small, piece, -1)


def copy_of(target, companion):
    """The target's copy of a companion that was made before, or None."""
    return next(
        (
            obj
            for obj in bpy.data.objects
            if obj.get(MADE_FROM) == companion.name
            and obj.type == "MESH"
            and (obj.parent == target or obj.get(MADE_FOR) == target)
        ),
        None,
    )


def _write(route, companion, moved, options):
    own = copy_of(route.target, companion)
    parent, bone = _parent(route, companion, options)
    if own is None:
        own = _copied(route, companion)
        _hang(route, own, parent, bone)
    elif own.parent not in (None, parent) and (
        own.parent == route.target or (own.parent.type == "ARMATURE" and MADE_FROM in own.parent.data)
    ):
        # Carried before the present rig.
        _hang(route, own, parent, bone)
    named, _ = names_on_target(moved[1], options)
    if not _fits(own.data, companion.data, named):
        before = own.data
        own.data = companion.data.copy()
        own.data.name = own.name
        groups, _ = names_on_target([group.name for group in own.vertex_groups], options)
        # Modifiers of a copy that was made before name its own groups already.
        masks = list(_masks(own)) if before == companion.data else []
        rename(own.vertex_groups, groups)
        for modifier, setting, name in masks:
            setattr(modifier, setting, groups.get(name, name))
        if named:
            rename(own.data.shape_keys.key_blocks, named, own.data.shape_keys)
            for block in own.data.shape_keys.key_blocks:
                block.vertex_group = groups.get(block.vertex_group, block.vertex_group)
        if not before.users:
            bpy.data.meshes.remove(before)
    points, keys = moved
    for name, coordinates in keys.items():
        block = own.data.shape_keys.key_blocks[named[name]]
        block.data.foreach_set("co", coordinates.astype(np.float32).ravel())
    own.data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    own.data.update()


def _fits(own, mesh, named):
    """Whether a copy's mesh is of its own and can take the coordinates of the companion's."""
    keys = [block.name for block in own.shape_keys.key_blocks] if own.shape_keys else []
    topologies = {mesh_read.fingerprint(each).topology for each in (own, mesh)}
    return own != mesh and len(topologies) == 1 and keys == list(named.values())


def _masks(own):
    """Modifiers that ask vertex groups, the setting and the name of the group."""
    for modifier in own.modifiers:
        for prop in modifier.bl_rna.properties:
            if prop.type == "STRING" and "vertex_group" in prop.identifier:
                yield modifier, prop.identifier, getattr(modifier, prop.identifier)


def _copied(route, companion):
    target = route.target
    own = companion.copy()
    own.name = f"{companion.name} {target.name}"
    own[MADE_FROM], own[MADE_FOR] = companion.name, target
    for collection in target.users_collection:
        collection.objects.link(own)
    hold_still(own)
    return own


def _parent(route, companion, options):
    """What the copy hangs on: the target's rig and the name of a bone of it or None, or the target, None."""
    target = route.target
    parent, bone = _bone_of(route.source, companion)
    name = None if bone is None else name_on_target(bone.name, options)
    rig = None if parent is None else fitted_rig(target, parent) or target.find_armature()
    if rig is None or (name is not None and name not in rig.data.bones):
        return target, None
    return rig, name


def _hang(route, own, parent, name):
    """Parent the copy, whose space is the target's at rest, and let its modifiers ask the target's rigs."""
    target = route.target
    present = [fitted_rig(target, rig) for rig in rigs(route.source)]
    for modifier in own.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None and modifier.object not in present:
            fitted = fitted_rig(target, modifier.object) or target.find_armature()
            modifier.object = fitted or modifier.object
    own.matrix_basis = Matrix.Identity(4)
    own.delta_location, own.delta_rotation_euler, own.delta_scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    own.delta_rotation_quaternion = (1, 0, 0, 0)
    own.parent, own.parent_type = parent, "OBJECT"
    if parent == target:
        own.matrix_parent_inverse = Matrix.Identity(4)
        return
    place = parent.matrix_world.copy()
    if name is not None:
        own.parent_type, own.parent_bone = "BONE", name
        held = parent.data.bones[name]
        if not held.use_relative_parent:
            place = place @ held.matrix_local @ Matrix.Translation((0.0, held.length, 0.0))
    own.matrix_parent_inverse = place.inverted_safe() @ target.matrix_world


KIND = Kind(
    "objects",
    "Other Objects",
    "OUTLINER_OB_MESH",
    "Copy eyes, teeth, clothes and hair that are objects of their own, fitted to the target",
    names,
    prepare,
    default=False,
)
