# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters of several meshes made by code: a rig, a body, a shirt over it, and an eye on a bone."""

from dataclasses import dataclass

import bpy
import numpy as np
from conftest import lumpy, new_object, renumbered, turned
from mathutils import Matrix
from test_transfer import store_map

from addon import mesh_read
from addon.mesh_write import write_attribute

# The shirt covers what lies between these heights of the body, so far off its skin.
SHIRT_FROM, SHIRT_TO, OFF = -0.9, 0.3, 0.04
EYE = np.array([0.15, 0.35, 1.3])


@dataclass(frozen=True)
class Made:
    """A character, and for each vertex of each mesh the number that it has in the first one made."""

    rig: bpy.types.Object
    body: bpy.types.Object
    shirt: bpy.types.Object
    eye: bpy.types.Object
    old: dict

    @property
    def pieces(self):
        return [self.body, self.shirt, self.eye]


def meshes(cells=8):
    """Vertices and faces of body, shirt and eye."""
    body, faces = lumpy(cells)
    faces = np.array(faces)
    outwards = body / np.linalg.norm(body, axis=1, keepdims=True)
    height = body[faces][..., 2]
    worn = faces[(height > SHIRT_FROM).all(axis=1) & (height < SHIRT_TO).all(axis=1)]
    used, number = np.unique(worn, return_inverse=True)
    shirt = (body + OFF * outwards)[used], number.reshape(worn.shape).tolist()
    points, quads = lumpy(3)
    return {
        "Body": (body, faces.tolist()),
        "Shirt": shirt,
        "Eye": (0.06 * points + EYE, quads),
    }


def low_share(points):
    """How much of each vertex follows the lower bone."""
    return np.clip(0.5 - points[:, 2], 0.0, 1.0)


def character(name, *, moved=False, weights=True, rigged=True, cells=8):
    """A character at rest; `moved` turns and renumbers all its meshes."""
    made, old = {}, {}
    for seed, (piece, (points, faces)) in enumerate(meshes(cells).items()):
        old[piece] = np.arange(len(points))
        given = points
        if moved:
            given, faces, old[piece] = renumbered(points, faces, seed)
        made[piece] = new_object(f"{name} {piece}", turned(given) if moved else given, faces)
        if weights and piece != "Eye":
            share = low_share(given)
            for bone, values in (("Low", share), ("High", 1.0 - share)):
                group = made[piece].vertex_groups.new(name=bone)
                for vertex, weight in enumerate(values.tolist()):
                    if weight > 0.0:
                        group.add([vertex], weight, "REPLACE")
    rig = rig_for(name, made, moved) if rigged else None
    bpy.context.view_layer.update()
    return Made(rig, made["Body"], made["Shirt"], made["Eye"], old)


def rig_for(name, made, moved):
    """Two bones, of which body and shirt follow both and the eye hangs on the upper one."""
    rig = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for bone, ends in (("Low", ((0, 0, -1.2), (0.05, 0, 0))), ("High", ((0.05, 0, 0), (0, 0.1, 1.2)))):
        edited = rig.data.edit_bones.new(bone)
        edited.head, edited.tail = turned(np.array(ends)) if moved else np.array(ends)
    rig.data.edit_bones["High"].parent = rig.data.edit_bones["Low"]
    bpy.ops.object.mode_set(mode="OBJECT")
    for piece in ("Body", "Shirt"):
        made[piece].modifiers.new("Rig", "ARMATURE").object = rig
        made[piece].parent = rig
    hang_on(made["Eye"], rig, "High")
    return rig


def hang_on(obj, rig, bone):
    """Parent an object to a bone, where it stands."""
    there = obj.matrix_world.copy()
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", bone
    bpy.context.view_layer.update()
    obj.matrix_world = there
    bpy.context.view_layer.update()


def bend(rig, angle=0.8):
    """Pose the upper bone."""
    rig.pose.bones["High"].matrix_basis = Matrix.Rotation(angle, 4, "X")
    bpy.context.view_layer.update()


def store_copy(source, target):
    """Store that every vertex of the target lies on the vertex of the source that it is a copy of."""
    for number, (given, own) in enumerate(zip(source.pieces, target.pieces, strict=True)):
        triangles = mesh_read.triangle_vertices(given.data)
        face, corner = np.empty((2, len(given.data.vertices)), int)
        for k in range(3):
            face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
        old = target.old[own.name.rpartition(" ")[2]]
        store_map(source.body, own, face[old], np.eye(3)[corner[old]])
        write_attribute(own.data, "match_piece", "INT", "POINT", np.full(len(old), number))
        own.data.spectral_match.figure = "known"
        for piece in source.pieces:
            kept = own.spectral_match_pieces.add()
            kept.object, kept.name = piece, piece.name
            kept.fingerprint = str(mesh_read.fingerprint(piece.data))
