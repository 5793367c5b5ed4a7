# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's rig, fitted to the target: each joint placed by the surface around it."""

from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..mesh_read import UnusableObjectError
from ..mesh_write import image_points
from .actions import actions_of, own_actions
from .copies import MADE_FOR, comes_from, copied, object_copy
from .kind import Kind, Prepared
from .sides import flip_name, rename
from .vertex_groups import read_weights

# Ends of bones nearer than this share of the rig's size are one joint.
SAME_JOINT = 1e-5
# A joint of bones without a side lies in the mirror if fitted nearer to it than this share of the rig's size.
IN_THE_MIDDLE = 0.02
# Blender deletes bones up to 1e-6 long.
SHORTEST_BONE = 2e-6
# What an Armature modifier is set to.
MODIFIER_SETTINGS = (
    "use_vertex_groups",
    "use_bone_envelopes",
    "use_deform_preserve_volume",
    "use_multi_modifier",
    "vertex_group",
    "invert_vertex_group",
)
# What places an object, as paths of its animation begin.
TRANSFORMS = ("location", "rotation", "scale", "delta_")
# Modifiers that refine or follow a surface that the rig has posed, or build on it what has no vertex groups.
AFTER_ARMATURE = frozenset(
    "SUBSURF MULTIRES SOLIDIFY CORRECTIVE_SMOOTH SMOOTH LAPLACIANSMOOTH CLOTH SOFT_BODY REMESH NODES".split()
)


def _modifiers(obj):
    return [m for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None]


def rigs(source):
    """The armature objects that deform the source, each once."""
    return list(dict.fromkeys(modifier.object for modifier in _modifiers(source)))


def names(source):
    return list(dict.fromkeys(rig.name for rig in rigs(source)))


def prepare(route, wanted, _options):
    fitted, notes = [], []
    for rig in rigs(route.source):
        if rig.name not in wanted:
            continue
        if rig.mode == "EDIT":
            rig.update_from_editmode()
        if not rig.data.bones:
            raise UnusableObjectError(f"'{rig.name}' has no bones. Add bones to it, or leave it unchecked")
        named, words = route.sides.of_all([bone.name for bone in rig.data.bones])
        notes += words
        before = fitted_rig(route.target, rig)
        if before is not None and not _has_bones(before, named):
            notes.append(
                f"'{rig.name}' has other bones now, so '{route.target.name}' got a new rig. '{before.name}' "
                "stays in the scene without it: take over what you added there, then delete it"
            )
        fitted.append((rig, named, *_fit(route, rig)))

    def write():
        for rig, named, joints, ends in fitted:
            _write(route, rig, named, joints, ends)

    return Prepared(write, tuple(notes))


def _fit(route, rig):
    """Fitted joints (positions, turns, scales in the target's space), and the joints of each bone's ends."""
    to_source = np.array(route.source_to_world.inverted_safe() @ rig.matrix_world)
    bones = list(rig.data.bones)
    ends = np.array([[bone.head_local, bone.tail_local] for bone in bones], np.float64).reshape(-1, 3)
    ends = ends @ to_source[:3, :3].T + to_source[:3, 3]
    size = np.ptp(ends, axis=0).max()
    _, first, joint = np.unique(
        np.round(ends / max(size * SAME_JOINT, 1e-12)), axis=0, return_index=True, return_inverse=True
    )
    joint = joint.reshape(-1, 2)
    fitted = route.map_as_seen.joints(ends[first], _influence(route.body, bones, joint))
    if len(route.target_mirrors) == 1:
        axes = to_source[:3, :3]
        turned_over = axes @ np.diag((-1.0, 1.0, 1.0)) @ np.linalg.inv(axes)
        fitted = _on_both_halves(route, ends[first], _partners(bones, joint), turned_over, fitted)
    return fitted, joint


def _partners(bones, joint):
    """The joint of the other side for each joint, by the names of bones; -1 where these have no side."""
    partner = np.full(joint.max() + 1, -1)
    ends_of = {bone.name: ends for bone, ends in zip(bones, joint, strict=True)}
    for name, ends in ends_of.items():
        other = flip_name(name, ends_of)
        if other != name and other in ends_of:
            partner[ends] = ends_of[other]
    return partner


def _on_both_halves(route, ends, partner, turned_over, fitted):
    """Fitted joints of a target of which a modifier mirrors one half: symmetric as it is.

    A joint on the half that the map knows counts for its partner too, and one in the middle comes to lie in
    the mirror. `turned_over` is the rig's reflection as the source has it.
    """
    positions, turns, scales = (np.array(values) for values in fitted)
    (mirror,) = route.target_mirrors
    stretch = np.eye(4)
    stretch[:3, :3] = route.target_stretch
    reflection = stretch @ mirror.reflection @ np.linalg.inv(stretch)
    surface = image_points(
        route.source_points @ route.source_stretch, route.triangles, route.face, route.barycentric
    )
    away = np.array([np.linalg.norm(surface - end, axis=1).min() for end in ends])
    images = positions @ reflection[:3, :3].T + reflection[:3, 3]
    turned = reflection[:3, :3] @ turns @ turned_over
    off = np.linalg.norm(images - positions, axis=1) / 2.0
    own = np.arange(len(ends))
    partner = np.where((partner < 0) & (off < IN_THE_MIDDLE * np.ptp(positions, axis=0).max()), own, partner)
    for j in own[(partner == own) | ((partner >= 0) & (away > away[partner]))]:
        other = partner[j]
        share = 0.5 if other == j else 1.0
        positions[j] += share * (images[other] - positions[j])
        left, _, right = np.linalg.svd(turns[j] + share * (turned[other] - turns[j]))
        turns[j], scales[j] = left @ right, scales[other]
    return positions, turns, scales


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


def _write(route, rig, named, fitted, ends):
    positions, turns, scales = fitted
    own = _own_rig(route, rig, named)
    place = own.matrix_world.inverted() @ route.target_to_world
    # The source rig's axes as directions on the source's surface.
    axes = (route.source_to_world.inverted_safe() @ rig.matrix_world).to_3x3()
    wanted = {}
    for bone, (head, tail) in zip(rig.data.bones, ends, strict=True):
        up = Matrix(turns[head].tolist()) @ (axes @ bone.matrix_local.to_3x3().col[2])
        wanted[named[bone.name]] = (
            place @ Vector(positions[head]),
            place @ Vector(positions[tail]),
            (place.to_3x3() @ up).normalized(),
            float(scales[head]),
        )
    with _editing(own):
        for bone in own.data.edit_bones:
            head, tail, up, scale = wanted[bone.name]
            # In single precision a bone far from the origin has to be longer to have a length.
            shortest = max(SHORTEST_BONE, 4.0 * float(np.finfo(np.float32).eps) * head.length)
            if (tail - head).length < shortest:
                tail = head + bone.vector.normalized() * shortest
            before = bone.length
            bone.head, bone.tail = head, tail
            bone.align_roll(up)
            grown = bone.length / before if before > 0.0 else scale
            for radius in ("head_radius", "tail_radius", "envelope_distance"):
                setattr(bone, radius, getattr(bone, radius) * grown)


def fitted_rig(target, rig):
    """The target's rig that was made from `rig` before, or None."""
    made = _made_from(target, rig)
    return next((own for own in made if own.get(MADE_FOR) in (None, target)), None)


def _made_from(target, rig):
    """Rigs on the target made from `rig`; those of another target if this is its duplicate."""
    return [m.object for m in _modifiers(target) if comes_from(m.object, rig)]


def _has_bones(own, named):
    """Whether a rig has just the bones that a new copy would have."""
    return {bone.name for bone in own.data.bones} == set(named.values())


def _own_rig(route, rig, named):
    """The target's rig made from `rig` before, or a copy of it that deforms the target."""
    target = route.target
    before = fitted_rig(target, rig)
    if before is not None and _has_bones(before, named):
        return before
    own = object_copy(rig, target)
    own.data = copied(rig.data)
    own.data.name = own.name
    own.parent = None
    hold_still(own)
    # Before the target hangs on it, whose vertex groups Blender would rename with the bones.
    rename(own.data.bones, named, own, own.data)
    # A rig without the target's scale: poses are edited in it.
    location, rotation, _ = target.matrix_world.decompose()
    own.matrix_world = Matrix.LocRotScale(location, rotation, None)
    replaced = [rig, *_made_from(target, rig)]
    held = next((m for m in _modifiers(target) if m.object in replaced), None)
    if held is None:
        held = _new_modifier(route, rig, own.name)
    held.object = own
    if target.parent in (None, *replaced):
        there = target.matrix_world.copy()
        target.parent = own
        target.matrix_world = there
    bpy.context.view_layer.update()
    return own


def hold_still(own):
    """Take from a copy what would move it as an object, away from the place that it is made for."""
    own.constraints.clear()
    held = own.animation_data
    if held is None:
        return
    for action in own_actions(own, [action for action in actions_of(own) if any(_moving(action))]):
        for curves, curve in list(_moving(action)):
            curves.remove(curve)
    for curve in list(held.drivers):
        if curve.data_path.startswith(TRANSFORMS):
            held.drivers.remove(curve)


def _moving(action):
    """The curves of an action that move an object, each after the list that holds it."""
    if hasattr(action, "layers"):
        # From Blender 4.4, where `fcurves` are those of the first slot.
        lists = [
            bag.fcurves for layer in action.layers for strip in layer.strips for bag in strip.channelbags
        ]
    else:
        lists = [action.fcurves]
    return ((curves, curve) for curves in lists for curve in curves if curve.data_path.startswith(TRANSFORMS))


def _new_modifier(route, rig, name):
    """An Armature modifier set as that of the source, before those that take the posed surface.

    Yet after those that complete it: the two sides have poses of their own.
    """
    target = route.target
    model = next(m for m in _modifiers(route.source) if m.object == rig)
    types = [modifier.type for modifier in target.modifiers]
    whole = max((i + 1 for i, each in enumerate(types) if each == "MIRROR"), default=0)
    place = next((i for i, each in enumerate(types) if i >= whole and each in AFTER_ARMATURE), None)
    made = target.modifiers.new(name, "ARMATURE")
    for setting in MODIFIER_SETTINGS:
        setattr(made, setting, getattr(model, setting))
    made.vertex_group = route.sides.of(model.vertex_group)
    if place is not None:
        # Not the last one where another is pinned to that place.
        target.modifiers.move(target.modifiers.find(made.name), place)
    return made


def fit_constraints(rig, own, sides):
    """Lengths and matrices that constraints of the rig store, as they are for the fitted bones at rest."""
    for bone in rig.pose.bones:
        fitted = own.pose.bones[sides.of(bone.name)]
        for constraint in bone.constraints:
            copy = fitted.constraints.get(constraint.name)
            if copy is None or getattr(copy, "target", None) is None or constraint.target is None:
                continue
            there, here = at_rest(constraint), at_rest(copy)
            if constraint.type == "CHILD_OF" and constraint.inverse_matrix != Matrix():
                copy.inverse_matrix = here.inverted_safe() @ there @ constraint.inverse_matrix
            length = {"STRETCH_TO": "rest_length", "LIMIT_DISTANCE": "distance"}.get(constraint.type)
            if length is not None:
                before = (there.translation - _head_at_rest(rig, bone)).length
                after = (here.translation - _head_at_rest(own, fitted)).length
                if before > 0.0:
                    setattr(copy, length, getattr(constraint, length) * after / before)


def _head_at_rest(rig, bone):
    return rig.matrix_world @ bone.bone.head_local


def at_rest(constraint):
    """World matrix of what a constraint looks at, its bones at rest."""
    seen = constraint.target
    bone = seen.data.bones.get(constraint.subtarget) if seen.type == "ARMATURE" else None
    if bone is None:
        return seen.matrix_world.copy()
    along = getattr(constraint, "head_tail", 0.0) * bone.length
    return seen.matrix_world @ bone.matrix_local @ Matrix.Translation((0.0, along, 0.0))


@contextmanager
def _editing(rig):
    """The rig in edit mode, shown and without X-Axis Mirror meanwhile; all is as before afterwards."""
    layer, scene = bpy.context.view_layer, bpy.context.scene.collection
    active, selected = layer.objects.active, list(layer.objects.selected)
    mode = active.mode if active is not None else "OBJECT"
    unseen, mirror = rig.hide_viewport, rig.data.use_mirror_x
    rig.hide_viewport, rig.data.use_mirror_x = False, False
    # The scene's own collection cannot be hidden or excluded.
    added = not rig.visible_get() and all(obj != rig for obj in scene.objects)
    if added:
        scene.objects.link(rig)
    hidden = rig.hide_get()
    rig.hide_set(False)
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
        rig.hide_set(hidden)
        if added:
            scene.objects.unlink(rig)
        rig.hide_viewport, rig.data.use_mirror_x = unseen, mirror
        for obj in selected:
            obj.select_set(True)
        layer.objects.active = active
        if active is not None and active.mode != mode:
            bpy.ops.object.mode_set(mode=mode)


KIND = Kind(
    "armature",
    "Armature",
    "ARMATURE_DATA",
    "Fit the source's armature to the target, which it then deforms",
    names,
    prepare,
    default=False,
)
