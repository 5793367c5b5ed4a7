# SPDX-License-Identifier: GPL-3.0-or-later
"""Bipeds with rigs, the known map between any two of them, and a walk."""

from functools import lru_cache

import bpy
import numpy as np
from conftest import new_object
from mathutils import Euler, Matrix, Vector
from mathutils.bvhtree import BVHTree
from sgmds import characters
from test_transfer import store_map

from addon.transfer.weights import write_weights

# At rest: arms out to the sides, or hanging at an angle and legs apart. Degrees about x, y, z of a bone.
POSES = {
    "T": {"upper_arm.L": (0, -24, 0), "upper_arm.R": (0, 24, 0)},
    "A": {
        "upper_arm.L": (0, 20, 0),
        "upper_arm.R": (0, -20, 0),
        "thigh.L": (0, -12, 0),
        "thigh.R": (0, 12, 0),
    },
}
FRAMES = range(1, 21)
# How far each bone swings, radians about its own axes.
SWINGS = {
    "hips": (0.05, 0.3, 0.1),
    "chest": (0.1, 0.2, 0.1),
    "head": (-0.2, 0.3, 0.0),
    "thigh.L": (0.6, 0.0, 0.1),
    "thigh.R": (-0.6, 0.0, 0.1),
    "shin.L": (0.5, 0.1, 0.0),
    "shin.R": (-0.4, 0.0, 0.0),
    "upper_arm.L": (0.3, 0.8, 0.4),
    "upper_arm.R": (-0.5, 0.6, -0.4),
    "forearm.L": (0.7, 0.2, 0.5),
    "forearm.R": (0.2, -0.6, 0.4),
}
TURNING = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}


@lru_cache
def _made(build, pose, seed):
    return characters.make("biped", build, POSES.get(pose, {}), 1500, seed)


@lru_cache
def _known(source, target):
    """For each vertex of one character its triangle on another and the weights there."""
    given, own = _made(*source), _made(*target)
    points = characters.carried(own.vertices, own.body, given.body)
    tree = BVHTree.FromPolygons(given.vertices.tolist(), given.faces.tolist(), all_triangles=True)
    faces, weights = [], []
    for point in points.tolist():
        place, _, index, _ = tree.find_nearest(point)
        corners = given.vertices[given.faces[index]]
        solved = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), [*place, 1.0], rcond=None)[0]
        faces.append(index)
        weights.append(np.clip(solved, 0.0, None) / np.clip(solved, 0.0, None).sum())
    return np.array(faces), np.array(weights)


class Figure:
    """A biped made by code: its mesh object `obj`, `size` times as large."""

    def __init__(self, name, build="plain", pose="", seed=0, size=1.0):
        self.key, self.size = (build, pose, seed), size
        self.made = _made(*self.key)
        self.obj = new_object(name, size * self.made.vertices, self.made.faces.tolist())

    def store_known(self, source):
        """Store the known map from a source figure as the match."""
        store_map(source.obj, self.obj, *_known(source.key, self.key))

    def rigged(self, scale=1.0, y_up=False):
        """A rig whose object has a scale, and is turned where its bones have y for up."""
        body = self.made.body
        rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
        bpy.context.collection.objects.link(rig)
        turn = Matrix.Rotation(np.pi / 2, 4, "X") if y_up else Matrix.Identity(4)
        rig.matrix_world = turn @ Matrix.Scale(scale, 4)
        bpy.context.view_layer.objects.active = rig
        bpy.context.view_layer.update()
        into = rig.matrix_world.inverted() @ Matrix.Scale(self.size, 4)
        bpy.ops.object.mode_set(mode="EDIT")
        for number, bone in enumerate(characters.SKELETONS["biped"]):
            made = rig.data.edit_bones.new(bone.name)
            made.head, made.tail = (into @ Vector(each[number]) for each in (body.starts, body.ends))
            made.roll = 0.3 * (number % 5)
            made.parent = rig.data.edit_bones.get(bone.parent or "")
        bpy.ops.object.mode_set(mode="OBJECT")
        group, vertex = np.nonzero(self.made.weights.T)
        write_weights(self.obj, body.names, (vertex, group, self.made.weights[vertex, group]))
        self.obj.modifiers.new("Rig", "ARMATURE").object = rig
        self.obj.parent, self.obj.matrix_parent_inverse = rig, rig.matrix_world.inverted()
        bpy.context.view_layer.update()
        return rig


def walk(rig, modes=("QUATERNION", "XYZ", "AXIS_ANGLE"), every=1, only=tuple(SWINGS)):
    """Animate the rig: limbs swing, and the hips go forward, up and down, by metres of the world."""
    units = np.cbrt(abs(np.linalg.det(np.array(rig.matrix_world)[:3, :3])))
    for number, name in enumerate(only):
        rig.pose.bones[name].rotation_mode = modes[number % len(modes)]
    for frame in FRAMES[::every]:
        phase = np.sin(2 * np.pi * frame / 20.0)
        for name in only:
            turn_bone(
                rig.pose.bones[name], Euler([phase * angle for angle in SWINGS[name]]).to_quaternion(), frame
            )
        if "hips" in only:
            hips = rig.pose.bones["hips"]
            way = np.array([0.05 * phase, -0.04 * frame, 0.04 * np.cos(2 * phase)])
            axes = np.array(rig.matrix_world.to_3x3() @ hips.bone.matrix_local.to_3x3()) / units
            hips.location = axes.T @ way / units
            hips.keyframe_insert("location", frame=frame)


def turn_bone(bone, turn, frame):
    """Key a bone's turn in its own rotation mode."""
    path = TURNING.get(bone.rotation_mode, "rotation_euler")
    if bone.rotation_mode == "QUATERNION":
        bone.rotation_quaternion = turn
    elif bone.rotation_mode == "AXIS_ANGLE":
        axis, angle = turn.to_axis_angle()
        bone.rotation_axis_angle = (angle, *axis)
    else:
        bone.rotation_euler = turn.to_euler(bone.rotation_mode, bone.rotation_euler)
    bone.keyframe_insert(path, frame=frame)


def limbs(rig):
    """Directions of all bones of a posed rig in the world, by name; of one with a child, to that."""
    found = {}
    for bone in rig.pose.bones:
        end = bone.children[0].head if len(bone.children) == 1 else bone.tail
        found[bone.name] = np.array((rig.matrix_world.to_3x3() @ (end - bone.head)).normalized())
    return found


def head_of(rig, name, posed=True):
    """A joint in the world, posed or at rest."""
    return np.array(
        rig.matrix_world @ (rig.pose.bones[name].head if posed else rig.data.bones[name].head_local)
    )


def leg_of(rig):
    """Length of a leg at rest."""
    hip, knee, ankle = (head_of(rig, name, posed=False) for name in ("thigh.L", "shin.L", "foot.L"))
    return np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)


def apart(first, second):
    """Angle between two directions, degrees."""
    return float(np.degrees(np.arccos(np.clip(first @ second, -1.0, 1.0))))
