# SPDX-License-Identifier: GPL-3.0-or-later
"""What an object of a character hangs on, by parent, surface or constraint, and its copy on the target."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Euler, Matrix

from ..typed import Floats, Values
from .armatures import fitted_rig, hold_still
from .constraints import at_rest
from .copies import MADE_FOR, MADE_FROM, comes_from, meant_by, object_copy
from .weights import rigs

if TYPE_CHECKING:
    from .route import Route

# What an object hangs on, the name of a bone of that or "", and the constraint that ties to it, if one does.
Held = tuple[bpy.types.Object, str, bpy.types.Constraint | None]

# Constraints that tie an object to another as parenting does.
TYING = ("CHILD_OF", "ARMATURE", "COPY_TRANSFORMS")
# Those of them that leave an object in its place while what they look at is at rest.
KEPT = ("CHILD_OF", "ARMATURE")
CHANNELS = ("location", "rotation", "scale")
AXES = "xyz"


def held_by(
    obj: bpy.types.Object, source: bpy.types.Object, passed: tuple[bpy.types.Object, ...] = ()
) -> Held | None:
    """What of the source an object hangs on at last, directly or by others, or None.

    The source or a rig of it, the name of its bone or "", and the constraint that ties to it or None.
    """
    if obj in meant_by(source) or obj.spectral_match_source is not None:
        return None
    if MADE_FROM in obj and obj.get(MADE_FOR) not in meant_by(source):
        # What another target got is no part of this source.
        return None
    found = _last_of(_ties(obj), source, (*passed, obj))
    if found is None and any(m.type == "ARMATURE" and m.object in rigs(source) for m in obj.modifiers):
        return source, "", None
    return found


def _last_of(
    ties: Iterable[Held], source: bpy.types.Object, passed: tuple[bpy.types.Object, ...]
) -> Held | None:
    """The first of the ties that leads to the source or a rig of it, as `held_by` has it."""
    for holder, bone, constraint in ties:
        if holder in meant_by(source):
            return source, bone, constraint
        if holder in rigs(source):
            return holder, bone, constraint
        found = None if holder in passed else held_by(holder, source, passed)
        if found is not None:
            return found
    return None


def _ties(obj: bpy.types.Object) -> Iterator[Held]:
    """What ties an object directly: holder, bone and constraint. The last constraint has the last word."""
    for constraint in reversed(obj.constraints):
        if _is_tying(constraint):
            looks = sorted(_looks(constraint), key=lambda look: -getattr(look, "weight", 1.0))
            for look in looks:
                if look.target is not None and getattr(look, "weight", 1.0) > 0.0:
                    yield look.target, look.subtarget, constraint
    yield from _parent_of(obj)
    surface = getattr(obj.data, "surface", None)
    if surface is not None:
        yield surface, "", None


def _parent_of(obj: bpy.types.Object) -> Iterator[Held]:
    if obj.parent is not None:
        yield obj.parent, obj.parent_bone if obj.parent_type == "BONE" else "", None


def _is_tying(constraint: bpy.types.Constraint) -> bool:
    return constraint.type in TYING and not constraint.mute and constraint.influence > 0.0


def _looks(constraint: bpy.types.Constraint) -> list[Any]:
    """What a constraint looks at: itself or its targets, each with `target` and `subtarget`."""
    return list(constraint.targets) if hasattr(constraint, "targets") else [constraint]


def in_source(route: Route, companion: bpy.types.Object) -> Floats:
    """The matrix from the companion's coordinates to stretched ones of the source, with bones at rest."""
    return np.array(route.source_to_world.inverted_safe() @ _unposed(route.source, companion))


def placed(matrix: Floats, points: Values) -> Floats:
    """Points (n, 3) under a matrix (4, 4)."""
    return points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _unposed(source: bpy.types.Object, companion: bpy.types.Object) -> Matrix:
    """The companion's matrix in the world, with the bones on which it hangs at rest."""
    held = held_by(companion, source)
    if held is None:
        return companion.matrix_world
    rig, bone, constraint = held
    if rig == source or not (bone or constraint):
        return companion.matrix_world
    if constraint is not None and constraint.type == "CHILD_OF":
        if bone not in rig.pose.bones:
            return companion.matrix_world
        posed = _followed(constraint, rig.matrix_world @ rig.pose.bones[bone].matrix)
        rest = _followed(constraint, at_rest(constraint))
        return rest @ posed.inverted_safe() @ companion.matrix_world
    shares = [(bone, 1.0)]
    if constraint is not None and constraint.type == "ARMATURE":
        shares = [(look.subtarget, look.weight) for look in constraint.targets if look.target == rig]
    total = sum(share for _, share in shares)
    moved = sum(share / total * np.array(_pose(rig, bone)) for bone, share in shares)
    return Matrix(moved.tolist()).inverted_safe() @ companion.matrix_world


def _pose(rig: bpy.types.Object, bone: str) -> Matrix:
    """How the pose of a bone moves what hangs on it, in the world."""
    if bone not in rig.pose.bones:
        return Matrix()
    posed, rest = rig.pose.bones[bone].matrix, rig.data.bones[bone].matrix_local
    return rig.matrix_world @ posed @ rest.inverted_safe() @ rig.matrix_world.inverted_safe()


def _followed(constraint: bpy.types.Constraint, matrix: Matrix) -> Matrix:
    """What a Child Of follows of a matrix: channels that are not checked are those of unity."""
    used = [[getattr(constraint, f"use_{channel}_{axis}") for axis in AXES] for channel in CHANNELS]
    if np.all(used):
        return matrix
    holder = constraint.target
    if constraint.subtarget and holder.pose:
        holder = holder.pose.bones[constraint.subtarget]
    order = holder.rotation_mode if sorted(holder.rotation_mode) == list("XYZ") else "XYZ"
    parts = np.array([matrix.to_translation(), matrix.to_euler(order), matrix.to_scale()])
    location, turn, scale = np.where(used, parts, [[0.0] * 3, [0.0] * 3, [1.0] * 3]).tolist()
    return Matrix.LocRotScale(location, Euler(turn, order), scale)


def copy_of(target: bpy.types.Object, companion: bpy.types.Object) -> bpy.types.Object | None:
    """The target's copy of a companion that was made before, or None."""
    return next(
        (
            obj
            for obj in bpy.data.objects
            if comes_from(obj, companion)
            and obj.type == companion.type
            and (obj.parent == target or obj.get(MADE_FOR) == target)
        ),
        None,
    )


def new_copy(target: bpy.types.Object, companion: bpy.types.Object) -> bpy.types.Object:
    """A new copy of the companion, which nothing moves."""
    own = object_copy(companion, target)
    hold_still(own)
    return own


def attach(
    route: Route,
    companion: bpy.types.Object,
    own: bpy.types.Object,
    fresh: bool = False,
    world: Matrix | None = None,
) -> list[bpy.types.Constraint]:
    """Hang the copy on the target as the companion hangs on the source; returns the constraints left out.

    `fresh` is a copy just made; `world`, by default the target's matrix, its place with all bones at rest.
    """
    kept = [constraint for constraint in companion.constraints if _can_keep(route, constraint)]
    if kept:
        # Beside its constraints the copy hangs only on what the companion has for a parent.
        held = _last_of(_parent_of(companion), route.source, (companion,))
    else:
        held = held_by(companion, route.source)
    parent, bone = _on_target(route, held)
    outdated = own.parent not in (None, parent) and (
        own.parent == route.target or (own.parent.type == "ARMATURE" and MADE_FROM in own.parent)
    )
    if fresh or outdated:
        _hang(route, own, parent, bone)
    if own.parent == parent:
        if world is not None:
            _put(route.target, own, parent, bone, world)
        for constraint in kept:
            mine = own.constraints.get(constraint.name) or own.constraints.copy(constraint)
            _look_at_target(route, constraint, mine)
    return [constraint for constraint in companion.constraints if constraint not in kept]


def _can_keep(route: Route, constraint: bpy.types.Constraint) -> bool:
    """Whether all that a constraint looks at is on the target too, and it leaves the copy in its place."""

    def found(look: Any) -> bool:
        there = _counterpart(route, look.target)
        if there is None or not look.subtarget:
            return there is not None
        # The place of a vertex group is not known.
        return there.type == "ARMATURE" and route.sides.of(look.subtarget) in there.data.bones

    looks = _looks(constraint)
    return constraint.type in KEPT and _is_tying(constraint) and bool(looks) and all(map(found, looks))


def _counterpart(route: Route, obj: bpy.types.Object | None) -> bpy.types.Object | None:
    """What stands for the source, a rig of it or a companion on the target, or None."""
    if obj is None or obj in meant_by(route.source):
        return obj and route.target
    if obj in rigs(route.source):
        return _rig_on_target(route, obj)
    return copy_of(route.target, obj) if held_by(obj, route.source) is not None else None


def _rig_on_target(route: Route, rig: bpy.types.Object) -> bpy.types.Object | None:
    return fitted_rig(route.target, rig) or route.target.find_armature()


def _on_target(route: Route, held: Held | None) -> tuple[bpy.types.Object | None, str | None]:
    """What the copy hangs on, and a bone of it or None: the target's rig, else the target."""
    if held is None:
        return None, None
    holder, bone, _ = held
    if holder == route.source:
        return route.target, None
    rig = _rig_on_target(route, holder)
    name = route.sides.of(bone) if bone in holder.data.bones else None
    if rig is None or (name is not None and name not in rig.data.bones):
        return route.target, None
    return rig, name


def _look_at_target(route: Route, constraint: bpy.types.Constraint, own: bpy.types.Constraint) -> None:
    """Let a copied constraint look at the target's, and hold the copy where it is."""
    for theirs, mine in zip(_looks(constraint), _looks(own), strict=True):
        mine.target = _counterpart(route, theirs.target)
        mine.subtarget = route.sides.of(theirs.subtarget)
    if own.type == "CHILD_OF":
        # Copies of other companions are where the target is while its bones are at rest.
        there = at_rest(own) if own.target.type == "ARMATURE" else route.target.matrix_world
        own.inverse_matrix = _followed(own, there).inverted_safe()


def _hang(route: Route, own: bpy.types.Object, parent: bpy.types.Object | None, name: str | None) -> None:
    """Parent the copy, whose space is the target's at rest, and let its modifiers ask the target's rigs."""
    target = route.target
    present = [fitted_rig(target, rig) for rig in rigs(route.source)]
    for modifier in own.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None and modifier.object not in present:
            modifier.object = _rig_on_target(route, modifier.object) or modifier.object
    hang(own, target, parent, name)


def hang(
    own: bpy.types.Object, target: bpy.types.Object, parent: bpy.types.Object | None, name: str | None = None
) -> None:
    """Parent an object, or leave it free, in the place where a target is with all bones at rest."""
    own.matrix_basis = Matrix.Identity(4)
    own.delta_location, own.delta_rotation_euler, own.delta_scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    own.delta_rotation_quaternion = (1, 0, 0, 0)
    own.parent, own.parent_type = parent, "OBJECT"
    if name is not None:
        own.parent_type, own.parent_bone = "BONE", name
    if parent == target:
        own.matrix_parent_inverse = Matrix.Identity(4)
    elif parent is None:
        own.matrix_basis = target.matrix_world
    else:
        own.matrix_parent_inverse = parent_at_rest(parent, name).inverted_safe() @ target.matrix_world


def _put(
    target: bpy.types.Object,
    own: bpy.types.Object,
    parent: bpy.types.Object | None,
    name: str | None,
    world: Matrix,
) -> None:
    """Place the copy itself in the world, where its parent is at rest."""
    if parent is not None:
        own.matrix_parent_inverse = parent_at_rest(parent, name).inverted_safe()
    own.matrix_basis = world


def parent_at_rest(parent: bpy.types.Object, name: str | None) -> Matrix:
    """The matrix to which children of a parent, or of a bone of it at rest, are relative."""
    if name is None:
        return parent.matrix_world
    held = parent.data.bones[name]
    if held.use_relative_parent:
        return parent.matrix_world
    return parent.matrix_world @ held.matrix_local @ Matrix.Translation((0.0, held.length, 0.0))
