# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's rig, fitted to the target: each joint placed by the surface around it."""

from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .kind import Kind, Prepared
from .vertex_groups import read_weights

# On the armature data of a fitted rig, and on the copy of a companion: the name of what it was made from.
MADE_FROM = "spectral_match_made_from"
# Ends of bones nearer than this share of the rig's size are one joint.
SAME_JOINT = 1e-5
# A bone shorter than this would be deleted by Blender.
SHORTEST_BONE = 1e-4


def _modifiers(obj):
    return [m for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None]


def names(source):
    return list(dict.fromkeys(modifier.object.name for modifier in _modifiers(source)))


def prepare(route, wanted, _options):
    fitted = [(bpy.data.objects[name], *_fit(route, bpy.data.objects[name])) for name in wanted]

    def write():
        for rig, joints, ends in fitted:
            _write(route, rig, joints, ends)

    return Prepared(write)


def _fit(route, rig):
    """Fitted joints (positions, turns, scales in the target's space), and the joints of each bone's ends."""
    to_source = np.array(route.source.matrix_world.inverted_safe() @ rig.matrix_world)
    bones = list(rig.data.bones)
    ends = np.array([[bone.head_local, bone.tail_local] for bone in bones], np.float64).reshape(-1, 3)
    ends = ends @ to_source[:3, :3].T + to_source[:3, 3]
    size = np.ptp(ends, axis=0).max()
    _, first, joint = np.unique(
        np.round(ends / max(size * SAME_JOINT, 1e-12)), axis=0, return_index=True, return_inverse=True
    )
    joint = joint.reshape(-1, 2)
    return route.map.joints(ends[first], _influence(route.source, bones, joint)), joint


def _influence(source, bones, joint):
    """For each joint the vertices that its bones move, with their weights; parents count at a bone's head."""
    vertex, group, weight = read_weights(source)
    order = np.argsort(group, kind="stable")
    bounds = np.searchsorted(group[order], np.arange(len(source.vertex_groups) + 1))
    moved = {
        held.name: (vertex[order[a:b]], weight[order[a:b]])
        for held, a, b in zip(source.vertex_groups, bounds[:-1], bounds[1:], strict=True)
        if b > a
    }
    at = [set() for _ in range(joint.max() + 1)]
    for bone, (head, tail) in zip(bones, joint, strict=True):
        at[head].add(bone.name)
        at[tail].add(bone.name)
        if bone.parent is not None:
            at[head].add(bone.parent.name)
    rows = []
    for around in at:
        found = [moved[name] for name in sorted(around) if name in moved]
        rows.append(tuple(map(np.concatenate, zip(*found, strict=True))) if found else ((), ()))
    return rows


def _write(route, rig, fitted, ends):
    positions, turns, scales = fitted
    target = route.target
    own = _own_rig(route, rig)
    place = own.matrix_world.inverted() @ target.matrix_world
    # The source rig's axes as directions on the source's surface.
    axes = (route.source.matrix_world.inverted_safe() @ rig.matrix_world).to_3x3()
    wanted = {}
    for bone, (head, tail) in zip(rig.data.bones, ends, strict=True):
        up = Matrix(turns[head].tolist()) @ (axes @ bone.matrix_local.to_3x3().col[2])
        wanted[bone.name] = (
            place @ Vector(positions[head]),
            place @ Vector(positions[tail]),
            (place.to_3x3() @ up).normalized(),
            float(scales[head]),
        )
    with _editing(own):
        for bone in own.data.edit_bones:
            head, tail, up, scale = wanted[bone.name]
            if (tail - head).length < SHORTEST_BONE:
                tail = head + bone.vector.normalized() * SHORTEST_BONE
            before = bone.length
            bone.head, bone.tail = head, tail
            bone.align_roll(up)
            grown = bone.length / before if before > 0.0 else scale
            for radius in ("head_radius", "tail_radius", "envelope_distance"):
                setattr(bone, radius, getattr(bone, radius) * grown)


def _own_rig(route, rig):
    """The target's rig made from `rig` before, or a copy of it that deforms the target."""
    target = route.target
    bones = {bone.name for bone in rig.data.bones}
    for modifier in _modifiers(target):
        data = modifier.object.data
        if data.get(MADE_FROM) == rig.name and {bone.name for bone in data.bones} == bones:
            return modifier.object
    own = rig.copy()
    own.data = rig.data.copy()
    own.name = own.data.name = f"{rig.name} {target.name}"
    own.data[MADE_FROM] = rig.name
    own.parent = None
    for collection in target.users_collection:
        collection.objects.link(own)
    # A rig without the target's scale: poses are edited in it.
    location, rotation, _ = target.matrix_world.decompose()
    own.matrix_world = Matrix.LocRotScale(location, rotation, None)
    held = next((m for m in _modifiers(target) if m.object == rig), None)
    if held is None:
        held = target.modifiers.new(own.name, "ARMATURE")
    held.object = own
    if target.parent in (None, rig):
        there = target.matrix_world.copy()
        target.parent = own
        target.matrix_world = there
    bpy.context.view_layer.update()
    return own


@contextmanager
def _editing(rig):
    """The rig in edit mode; selection and active object are as before afterwards."""
    layer = bpy.context.view_layer
    active, selected = layer.objects.active, list(layer.objects.selected)
    for obj in selected:
        obj.select_set(False)
    layer.objects.active = rig
    rig.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        rig.select_set(False)
        for obj in selected:
            obj.select_set(True)
        layer.objects.active = active


KIND = Kind(
    "armature",
    "Armature",
    "ARMATURE_DATA",
    "Fit the source's armature to the target, which it then deforms",
    names,
    prepare,
    default=False,
)
