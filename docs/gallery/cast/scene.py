# SPDX-License-Identifier: GPL-3.0-or-later
"""Persons as Blender's objects: meshes with materials, UVs and a texture, a rig with weights, keys and a
walk."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from . import paint
from .anatomy import SKELETON
from .people import Person

TEXTURE = 2048
WALK_FRAMES = 24
ISLAND_MARGIN = 0.006
BARE = ("Head", "Hands", "Body", "Eyes", "Lids", "Lashes", "Mouth", "Brows")
"""Pieces of a person that are not worn."""


@dataclass
class Actor:
    """A person in the scene: its rig (or None) and its meshes by piece."""

    person: Person
    rig: bpy.types.Object | None
    meshes: dict[str, bpy.types.Object]

    @property
    def objects(self):
        return list(self.meshes.values())


def staged(person: Person, x: float = 0.0, *, rig=True, keys=True, texture=True, label=None) -> Actor:
    """A person at rest in the scene, at `x`. Without a rig it has no weights either."""
    label = label or person.name
    collection = bpy.data.collections.new(label)
    bpy.context.scene.collection.children.link(collection)
    meshes = {}
    for piece in person.pieces:
        mesh = bpy.data.meshes.new(f"{label} {piece.name}")
        mesh.from_pydata(piece.vertices.tolist(), [], piece.faces.tolist())
        mesh.shade_smooth()
        obj = bpy.data.objects.new(f"{label} {piece.name}", mesh)
        obj.location.x = x
        collection.objects.link(obj)
        meshes[piece.name] = obj
    if keys:
        for piece in person.pieces:
            _add_keys(meshes[piece.name], piece)
    _unwrap(person, meshes)
    if texture:
        _add_texture(person, meshes, label)
    armature = _add_rig(person, meshes, collection, x, label) if rig else None
    bpy.context.view_layer.update()
    return Actor(person, armature, meshes)


def leave_out_worn(*actors: Actor):
    """Untick under Pieces what the actors wear, so that the next match is one of bodies alone."""
    for actor in actors:
        for name, obj in actor.meshes.items():
            obj.spectral_match_part = "AUTOMATIC" if name in BARE else "LEFT_OUT"


def _add_keys(obj, piece):
    if not piece.keys:
        return
    obj.shape_key_add(name="Basis", from_mix=False)
    for name, shift in piece.keys.items():
        key = obj.shape_key_add(name=name, from_mix=False)
        key.data.foreach_set("co", (piece.vertices + shift).astype(np.float32).ravel())


# ------------------------------------------------------------------ layout and texture


def _unwrap(person, meshes):
    """Each piece's islands in the cell of the texture that is its own."""
    view = bpy.context.view_layer
    for piece in person.pieces:
        obj = meshes[piece.name]
        obj.data.uv_layers.new(name="UVMap")
        for other in view.objects:
            other.select_set(other == obj)
        view.objects.active = obj
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=ISLAND_MARGIN, area_weight=0.0)
        bpy.ops.object.mode_set(mode="OBJECT")
        left, bottom, side = piece.cell
        uv = corner_uv(obj.data)
        uv = (left, bottom) + side * (0.01 + 0.98 * uv)
        obj.data.uv_layers["UVMap"].uv.foreach_set("vector", uv.astype(np.float32).ravel())


def corner_uv(mesh, name="UVMap"):
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers[name].uv.foreach_get("vector", uv)
    return uv.reshape(-1, 2)


def triangles(mesh):
    """Vertices and corners of Blender's triangles, (m, 3) each."""
    mesh.calc_loop_triangles()
    found = []
    for what in ("vertices", "loops"):
        numbers = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get(what, numbers)
        found.append(numbers.reshape(-1, 3))
    return found


def _add_texture(person, meshes, label):
    pieces = []
    for piece in person.pieces:
        mesh = meshes[piece.name].data
        corners, loops = triangles(mesh)
        pieces.append((piece.brush, piece.places, piece.normals, corners, corner_uv(mesh)[loops]))
    pixels = np.ones((TEXTURE, TEXTURE, 4), np.float32)
    pixels[..., :3] = paint.painted(TEXTURE, pieces)
    image = bpy.data.images.new(f"{label} Colour", TEXTURE, TEXTURE)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    for piece in person.pieces:
        meshes[piece.name].data.materials.append(_material(f"{label} {piece.name}", image, piece))


def _material(name, image, piece):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    shader, texture = nodes["Principled BSDF"], nodes.new("ShaderNodeTexImage")
    texture.image = image
    nodes.active = texture
    material.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    shader.inputs["Roughness"].default_value = piece.roughness
    if piece.name in ("Head", "Hands", "Body", "Lids"):
        shader.inputs["Subsurface Weight"].default_value = 0.12
        shader.inputs["Subsurface Radius"].default_value = (0.02, 0.008, 0.005)
    return material


# ------------------------------------------------------------------ rig and walk


def _add_rig(person, meshes, collection, x, label):
    rig = bpy.data.objects.new(label, bpy.data.armatures.new(label))
    rig.location.x = x
    collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    heads, tails = person.build.joints()
    for bone, head, tail in zip(SKELETON, heads, tails, strict=True):
        made = rig.data.edit_bones.new(person.bones[bone.name])
        made.head, made.tail = head, tail
        made.align_roll(
            Vector((0, -1, 0)) if abs((made.tail - made.head).normalized().y) < 0.8 else Vector((0, 0, 1))
        )
        if bone.parent:
            made.parent = rig.data.edit_bones[person.bones[bone.parent]]
            made.use_connect = (made.head - made.parent.tail).length < 1e-4
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.data.display_type = "STICK"
    for piece in person.pieces:
        obj = meshes[piece.name]
        for number, bone in enumerate(SKELETON):
            held = np.flatnonzero(piece.weights[:, number])
            if held.size:
                group = obj.vertex_groups.new(name=person.bones[bone.name])
                for vertex, weight in zip(held.tolist(), piece.weights[held, number].tolist(), strict=True):
                    group.add([vertex], weight, "REPLACE")
        obj.modifiers.new("Rig", "ARMATURE").object = rig
        obj.parent = rig
        obj.location.x = 0.0
    return rig


def _walk_turns(phase):
    """Radians about x, y and z of the character by which each bone is turned, and the way of the hips."""
    turns = {}
    for side, sign, own in (("L", 1.0, phase), ("R", -1.0, phase + np.pi)):
        swing = np.sin(own)
        turns[f"thigh.{side}"] = (-0.08 - 0.46 * swing, 0, 0)
        turns[f"shin.{side}"] = (0.14 + 0.62 * max(0.0, np.cos(own)) ** 1.5 + 0.10 * swing, 0, 0)
        turns[f"foot.{side}"] = (-0.10 * swing + 0.30 * max(0.0, -np.sin(own + 0.5)) - 0.08, 0, 0)
        turns[f"toes.{side}"] = (-0.35 * max(0.0, -np.sin(own + 0.3)), 0, 0)
        turns[f"upper_arm.{side}"] = (0.50 * swing, 0.50 * sign, 0)
        turns[f"forearm.{side}"] = (-0.30 + 0.22 * swing, 0.12 * sign, 0)
        turns[f"hand.{side}"] = (0.08 * swing, 0.0, 0)
        for finger in ("index", "middle", "ring", "little"):
            for part in (1, 2):
                turns[f"{finger}_{part}.{side}"] = (0, 0.28 * sign, 0)
    turns["hips"] = (0.0, 0.05 * np.sin(phase), 0.10 * np.sin(phase))
    turns["spine"] = (0.03, -0.04 * np.sin(phase), -0.10 * np.sin(phase))
    turns["chest"] = (0.02, -0.03 * np.sin(phase), -0.14 * np.sin(phase))
    turns["head"] = (0.03 * np.sin(2 * phase), 0.03 * np.sin(phase), 0.12 * np.sin(phase))
    return turns, (0.012 * np.sin(phase), 0.0, 0.018 * np.cos(2 * phase) - 0.016)


def add_walk(actor: Actor, cycles: int = 1):
    """An action of the actor's rig: a walk on the spot that repeats after `WALK_FRAMES`."""
    rig, bones = actor.rig, actor.person.bones
    for frame in range(cycles * WALK_FRAMES + 1):
        turns, way = _walk_turns(2 * np.pi * frame / WALK_FRAMES)
        for name, (x, y, z) in turns.items():
            bone = rig.pose.bones[bones[name]]
            turn = Quaternion((0, 0, 1), z) @ Quaternion((0, 1, 0), y) @ Quaternion((1, 0, 0), x)
            rest = bone.bone.matrix_local.to_quaternion()
            bone.rotation_mode = "QUATERNION"
            bone.rotation_quaternion = rest.inverted() @ turn @ rest
            bone.keyframe_insert("rotation_quaternion", frame=frame + 1)
        hips = rig.pose.bones[bones["hips"]]
        hips.location = hips.bone.matrix_local.to_3x3().inverted() @ Vector(way)
        hips.keyframe_insert("location", frame=frame + 1)
    rig.animation_data.action.name = f"{actor.person.name} Walk"
