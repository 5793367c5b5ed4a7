# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's rig, fitted to the target: each joint placed by the surface around it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.props import BoolProperty
from mathutils import Matrix, Vector

from .. import character
from ..mesh_read import UnusableObjectError
from ..typed import EnumItem, Options
from . import hung
from .actions import actions_of, own_actions
from .constraints import fit_constraints, settle
from .copies import MADE_FOR, comes_from, copied, object_copy
from .joints import fitted_bones
from .kind import Kind, Prepared
from .listed import listed
from .own_rig import keeps_rig, own_modifiers
from .rest_poses import Fitting
from .retarget import TRANSFORMS, fit_actions, keep_actions
from .sides import rename
from .weights import armature_modifiers, read_weights, rigs

if TYPE_CHECKING:
    from .joints import Placed
    from .route import Route

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
# Modifiers that refine or follow a surface that the rig has posed, or build on it what has no vertex groups.
AFTER_ARMATURE = frozenset(
    "SUBSURF MULTIRES SOLIDIFY CORRECTIVE_SMOOTH SMOOTH LAPLACIANSMOOTH CLOTH SOFT_BODY REMESH NODES".split()
)


def names(source: bpy.types.Object) -> list[str]:
    return list(dict.fromkeys(rig.name for rig in rigs(source)))


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    fitted, notes = [], []
    own = own_modifiers(route)
    if keeps_rig(route, options):
        return Prepared(
            notes=[
                f"'{route.target.name}' keeps its rig '{own[0].object.name}': {listed(wanted)} was not fitted"
            ],
            left_out=wanted,
        )
    if own:
        replaced = {modifier.object for modifier in own}
        old, name = own[0].object.name, route.target.name
        staying = [obj.name for obj in _moved_by(replaced) if obj not in route.targets]
        if staying:
            notes.append(
                f"The old rig '{old}' of '{name}' still moves what was left out: {listed(staying)}. To bring "
                "that too, undo, check it under Pieces and match again"
            )
        else:
            notes.append(
                f"The rig '{old}' of '{name}' was replaced: it stays in the scene, hidden, with its "
                "Armature modifier off"
            )
        notes += hung.words(replaced, route.targets)
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
        fitted.append((rig, named, fitted_bones(route, rig)))

    def write() -> None:
        replaced = [modifier.object for modifier in own]
        for rig, named, bones in fitted:
            _write(route, rig, named, bones, replaced, options)
            _share(route, rig, replaced)
        for modifier in own:
            modifier.show_viewport = modifier.show_render = False
        if fitted and replaced:
            made = fitted_rig(route.target, fitted[0][0])
            if made is not None:
                hung.rehang(set(replaced), made)
            for rig in _without_bodies(set(replaced)):
                rig.hide_set(True)

    return Prepared(write, tuple(notes))


def _without_bodies(replaced: set[bpy.types.Object]) -> list[bpy.types.Object]:
    """The rigs among those replaced that deform nothing any more and can be hidden here."""
    layer = bpy.context.view_layer.objects
    return [rig for rig in replaced if rig.name in layer and not _moved_by({rig})]


def _moved_by(moving: set[bpy.types.Object]) -> list[bpy.types.Object]:
    """The objects that these rigs deform."""
    return [
        obj
        for obj in bpy.data.objects
        if any(modifier.show_viewport and modifier.object in moving for modifier in armature_modifiers(obj))
    ]


def _write(
    route: Route,
    rig: bpy.types.Object,
    named: Mapping[str, str],
    bones: Mapping[str, Placed],
    replaced: Sequence[bpy.types.Object],
    options: Options,
) -> None:
    own, fresh = _own_rig(route, rig, named, replaced)
    place = own.matrix_world.inverted() @ route.target_to_world
    wanted = {
        named[name]: (
            place @ Vector([*bone.head]),
            place @ Vector([*bone.tail]),
            (place.to_3x3() @ Vector([*bone.axes[:, 2]])).normalized(),
            bone.scale,
        )
        for name, bone in bones.items()
    }
    with editing(own):
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
    if fresh:
        _fit_shapes(rig, own, named)
    route.fitted.append(partial(_finish, route, rig, own, named, bones, fresh, options))


def _fit_shapes(rig: bpy.types.Object, own: bpy.types.Object, named: Mapping[str, str]) -> None:
    """Shapes in which bones are shown, as large beside the bones as on the source's rig."""
    for bone in rig.pose.bones:
        shown = own.pose.bones[named[bone.name]]
        grown = shown.bone.length / bone.bone.length
        shown.custom_shape_translation = bone.custom_shape_translation * grown
        if not bone.use_custom_shape_bone_size:
            shown.custom_shape_scale_xyz = bone.custom_shape_scale_xyz * grown


def _finish(
    route: Route,
    rig: bpy.types.Object,
    own: bpy.types.Object,
    named: Mapping[str, str],
    bones: Mapping[str, Placed],
    fresh: bool,
    options: Options,
) -> Iterator[float]:
    """Once all copies look at one another: constraints at rest, and actions; yields how far it is."""
    holding = _holding(route.body, rig)
    fit_constraints(rig, own, named)
    if settle(rig, own, named, holding, editing):
        fit_constraints(rig, own, named)
    if not (actions_of(rig) or actions_of(own)):
        return
    ways, some = (route.source_to_world, route.target_to_world), next(iter(bones.values()))
    size = np.cbrt(abs(ways[1].determinant() / ways[0].determinant()))
    fitting = Fitting(
        rig,
        own,
        named,
        held=holding,
        mirrors=bool(np.prod([np.linalg.det(some.turn), *(way.determinant() for way in ways)]) < 0.0),
        growth={name: size * bone.scale for name, bone in bones.items()},
        bodies=(route.source, route.target),
    )
    yield from (fit_actions if options.fit_animation else keep_actions)(fitting, fresh)


def _share(route: Route, rig: bpy.types.Object, replaced: Sequence[bpy.types.Object]) -> None:
    """Let the rig that was fitted to the lead of a character deform its other meshes too."""
    own = fitted_rig(route.target, rig)
    for target in route.targets[1:]:
        if own is not None and all(modifier.object != own for modifier in armature_modifiers(target)):
            _hang_on(route, target, rig, own, replaced)
    bpy.context.view_layer.update()


def _holding(source: bpy.types.Object, rig: bpy.types.Object) -> set[str]:
    """Names of the bones that move the surface."""
    _, group, weight = read_weights(source)
    used = np.unique(group[weight > 0.0]).tolist()
    bones = rig.data.bones
    held = [source.vertex_groups[number].name for number in used if number < len(source.vertex_groups)]
    return {name for name in held if name in bones and bones[name].use_deform}


def fitted_rig(target: bpy.types.Object, rig: bpy.types.Object) -> bpy.types.Object | None:
    """The target's rig that was made from `rig` before, or None."""
    made = _made_from(target, rig)
    return next((own for own in made if own.get(MADE_FOR) in (None, target)), None)


def _made_from(target: bpy.types.Object, rig: bpy.types.Object) -> list[bpy.types.Object]:
    """Rigs on the target made from `rig`; those of another target if this is its duplicate."""
    return [m.object for m in armature_modifiers(target) if comes_from(m.object, rig)]


def _has_bones(own: bpy.types.Object, named: Mapping[str, str]) -> bool:
    """Whether a rig has just the bones that a new copy would have."""
    return {bone.name for bone in own.data.bones} == set(named.values())


def _own_rig(
    route: Route, rig: bpy.types.Object, named: Mapping[str, str], replaced: Sequence[bpy.types.Object]
) -> tuple[bpy.types.Object, bool]:
    """The target's rig made from `rig` before, or a copy of it that deforms the target instead of others.

    And whether it was made now.
    """
    target = route.target
    before = fitted_rig(target, rig)
    if before is not None and _has_bones(before, named):
        return before, False
    # Before the rig is in the target's collection, which is the character only while it holds meshes alone.
    name = character.of(target).name
    own = object_copy(rig, target)
    # The target's name first: panels that are narrow show the beginning, and name the character by its rig.
    own.name = f"{name} {character.stem_of(rig.name)}"
    own.data = copied(rig.data)
    own.data.name = own.name
    own.parent = None
    hold_still(own)
    # Before the target hangs on it, whose vertex groups Blender would rename with the bones.
    rename(own.data.bones, named, own, own.data)
    # In the units of the source's rig, so that keys, limits and shapes of bones mean what they meant.
    location, rotation, _ = target.matrix_world.decompose()
    units = float(np.cbrt(abs(np.linalg.det(np.array(rig.matrix_world)[:3, :3]))))
    own.matrix_world = Matrix.LocRotScale(location, rotation, (units, units, units))
    _hang_on(route, target, rig, own, replaced)
    bpy.context.view_layer.update()
    return own, True


def _hang_on(
    route: Route,
    target: bpy.types.Object,
    rig: bpy.types.Object,
    own: bpy.types.Object,
    replaced: Sequence[bpy.types.Object],
) -> None:
    """Let the rig `own`, made from `rig`, deform a mesh of the target, as its parent in place of others."""
    given = [rig, *_made_from(target, rig)]
    held = next((m for m in armature_modifiers(target) if m.object in given), None)
    if held is None:
        held = _new_modifier(route, target, rig, own.name)
    held.object = own
    if target.parent in (None, *given, *replaced) and target.parent_type != "BONE":
        there = target.matrix_world.copy()
        target.parent, target.parent_type = own, "OBJECT"
        target.matrix_world = there


def hold_still(own: bpy.types.Object) -> None:
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


def _moving(action: bpy.types.Action) -> Iterator[tuple[Any, bpy.types.FCurve]]:
    """The curves of an action that move an object, each after the list that holds it."""
    if hasattr(action, "layers"):
        # From Blender 4.4, where `fcurves` are those of the first slot.
        lists = [
            bag.fcurves for layer in action.layers for strip in layer.strips for bag in strip.channelbags
        ]
    else:
        lists = [action.fcurves]
    return ((curves, curve) for curves in lists for curve in curves if curve.data_path.startswith(TRANSFORMS))


def _new_modifier(
    route: Route, target: bpy.types.Object, rig: bpy.types.Object, name: str
) -> bpy.types.Modifier:
    """An Armature modifier set as that of the source, before those that take the posed surface.

    Yet after those that complete it: the two sides have poses of their own.
    """
    model = next(m for m in armature_modifiers(route.source) if m.object == rig)
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


@contextmanager
def editing(rig: bpy.types.Object) -> Iterator[None]:
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
    _set_mode(rig, "EDIT")
    try:
        yield
    finally:
        _set_mode(rig, "OBJECT")
        rig.select_set(False)
        rig.hide_set(hidden)
        if added:
            scene.objects.unlink(rig)
        rig.hide_viewport, rig.data.use_mirror_x = unseen, mirror
        for obj in selected:
            obj.select_set(True)
        layer.objects.active = active
        if active is not None and active.mode != mode:
            _set_mode(active, mode)


def _set_mode(obj: bpy.types.Object, mode: EnumItem) -> None:
    """Set the mode of an active object, in whichever scene: operators take that of the window's scene."""
    with bpy.context.temp_override(active_object=obj, object=obj):
        bpy.ops.object.mode_set(mode=mode)


KIND = Kind(
    "armature",
    "Armature",
    "ARMATURE_DATA",
    "Fit the source's armature to the target, which it then deforms",
    names,
    prepare,
    {
        "fit_animation": BoolProperty(
            name="Fit Animation",
            default=True,
            description="Give the fitted rig copies of the actions, fitted to the target's rest pose and the "
            "length of its legs. Off: they play as they are",
        ),
    },
    words=("rig",),
    borrowed=("own_rig",),
    effects={
        "fit_animation": lambda _, bodies: (
            bodies is None or any(actions_of(rig) for source in bodies.sources for rig in rigs(source))
        ),
    },
)
