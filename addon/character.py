# SPDX-License-Identifier: GPL-3.0-or-later
"""What belongs together: from any object the character that it is a piece of.

A character is an armature with all its meshes, the meshes below an empty, those of a collection, or one mesh.
"""

from __future__ import annotations

import os
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import bpy
import numpy as np
from bpy.app.handlers import persistent
from mathutils import Matrix, Vector

from .translation import said
from .typed import Floats

# On objects that are made for a target: the target, which a duplicate of it is not.
MADE_FOR = "spectral_match_made_for"
# The name of what it was made from.
MADE_FROM = "spectral_match_made_from"
# What hangs on a bone without skin is held in a hand if larger than this share of the character: an eye is
# not.
HELD_SHARE = 0.1
# What a collection of a scene's set has, and that of a character has not.
SET_TYPES = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
# Whether an object takes part in its character's matches.
AUTOMATIC, TAKEN, LEFT_OUT = "AUTOMATIC", "TAKEN", "LEFT_OUT"
# What importers and Blender call that which holds a character together, where nobody named it.
NO_NAMES = frozenset("armature rig metarig characterarmature root rootnode skeleton empty collection".split())


def _parted(name: str) -> tuple[str, str]:
    """A name, and the number that Blender adds where another object has it, as ".001"."""
    stem = re.sub(r"\.\d+$", "", name)
    return stem, name[len(stem) :]


def stem_of(name: str) -> str:
    """A name without the number that Blender adds where another object has it."""
    return _parted(name)[0]


def shared_name(objects: Sequence[bpy.types.Object]) -> str:
    """The words with which the names of all these objects begin, as "Knight" for "Knight_Body" and
    "Knight_Head", or "".
    """
    stems, numbers = zip(*(_parted(obj.name) for obj in objects), strict=True)
    words = os.path.commonprefix([re.split(r"([ _.:-]+)", stem) for stem in stems])
    begin = "".join(words).strip(" _.:-")
    if not begin or len(set(stems)) == 1:
        return ""
    # What was imported twice has the same number at each of its names.
    return begin + numbers[0] if len(set(numbers)) == 1 else begin


@dataclass(frozen=True)
class Character:
    """Mesh objects that are matched as one figure.

    `owner` is the armature, empty, collection or mesh that holds them together. `pieces` take part, the
    largest one, the lead, first; `left_out` are its other meshes.
    """

    owner: bpy.types.ID
    pieces: tuple[bpy.types.Object, ...]
    left_out: tuple[bpy.types.Object, ...] = ()

    @property
    def lead(self) -> bpy.types.Object:
        """The piece in whose space a figure of several pieces is."""
        return self.pieces[0]

    @property
    def whole(self) -> tuple[bpy.types.Object, ...]:
        """All meshes, those that take part first."""
        return self.pieces + self.left_out

    @property
    def name(self) -> str:
        if len(self.whole) == 1:
            return self.lead.name
        own = self.owner.name
        if MADE_FROM in self.owner:
            # A rig that came from a source, whose name stands behind that of the character.
            own = stem_of(own).removesuffix(f" {stem_of(self.owner[MADE_FROM])}")
        return own if stem_of(own).lower() not in NO_NAMES else shared_name(self.pieces) or own

    @property
    def label(self) -> str:
        """The name and, where there are several, how many meshes take part."""
        if len(self.whole) == 1:
            return self.name
        if self.left_out:
            return said("{} ({} of {})", self.name, len(self.pieces), len(self.whole))
        return said("{} ({} meshes)", self.name, len(self.whole))


def holds(body: Character | bpy.types.Object | None, obj: bpy.types.Object | None) -> bool:
    """Whether an object is a piece of a character, or is the object that is given instead of one."""
    return obj in body.whole if isinstance(body, Character) else obj == body


def pieces_of(body: Character | bpy.types.Object | None) -> tuple[bpy.types.Object, ...]:
    """The pieces of a character, or the object that is given instead of one; nothing for None."""
    if body is None:
        return ()
    return body.pieces if isinstance(body, Character) else (body,)


def alone(obj: bpy.types.Object) -> Character:
    """A mesh object by itself."""
    return Character(obj, (obj,))


def of(obj: bpy.types.Object) -> Character | None:
    """The character that an object is a piece, the armature or the empty of; None where there is no mesh."""
    return of_owner(owner(obj))


def of_owner(node: bpy.types.ID) -> Character | None:
    """The character that an armature, empty, collection or mesh holds together; None without any mesh."""
    if isinstance(node, bpy.types.Object) and node.type == "MESH":
        return alone(node)
    meshes = [obj for obj in _members(node) if _is_surface(obj)]
    shapes = _shapes(meshes)
    meshes = [obj for obj in meshes if obj not in shapes]
    return _arranged(node, meshes) if meshes else None


def groups(objects: Sequence[bpy.types.Object]) -> list[Character | None]:
    """The characters that these objects belong to, each once, in their order; None for one without a mesh.

    Where all belong to one they are told apart as far below as they can be: two bodies of one rig are two
    meshes.
    """
    owners = list(dict.fromkeys(owner(obj) for obj in objects))
    if len(owners) == 1 and len(objects) > 1:
        owners = list(dict.fromkeys(_apart(objects)))
    return [of_owner(node) for node in owners]


def _arranged(node: bpy.types.ID, meshes: list[bpy.types.Object]) -> Character:
    """The character of these meshes: which take part, and which one leads."""
    if len(meshes) == 1:
        return alone(meshes[0]) if isinstance(node, bpy.types.Object) else Character(node, tuple(meshes))
    in_hand = _held(meshes)
    taken = [obj for obj in meshes if _takes_part(obj, in_hand)]
    if not taken:
        taken = [obj for obj in meshes if obj.spectral_match_part != LEFT_OUT] or meshes
    taken.sort(key=lambda obj: (-(skin_of(obj) is not None), -len(obj.data.vertices), obj.name))
    return Character(node, tuple(taken), tuple(obj for obj in meshes if obj not in taken))


def _takes_part(obj: bpy.types.Object, in_hand: Container[bpy.types.Object]) -> bool:
    if obj.spectral_match_part != AUTOMATIC:
        return obj.spectral_match_part == TAKEN
    return _shown(obj) and obj not in in_hand


def _shown(obj: bpy.types.Object) -> bool:
    """Whether the object is not hidden in the scenes that have it."""
    if obj.hide_viewport:
        return False
    layer = bpy.context.view_layer
    return obj.name not in layer.objects or not obj.hide_get(view_layer=layer)


def _held(meshes: Sequence[bpy.types.Object]) -> set[bpy.types.Object]:
    """Those of the meshes that a hand holds: on a bone that moves no skin, though others do, and large."""
    skinned: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    found = set()
    for obj in meshes:
        rig = skin_of(obj)
        if rig is not None:
            skinned.setdefault(rig, []).append(obj)
    sizes = {rig: extent(on_rig) for rig, on_rig in skinned.items()}
    for obj in meshes:
        rig, bone = held_by_bone(obj)
        if rig in skinned and obj.dimensions.length > HELD_SHARE * sizes[rig]:
            if not any(_moves(other, bone) for other in skinned[rig]):
                found.add(obj)
    return found


def extent(objects: Iterable[bpy.types.Object]) -> float:
    """Diagonal of the box around objects in the world."""
    corners = [obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box]
    low, high = (Vector([*map(pick, zip(*corners, strict=True))]) for pick in (min, max))
    return (high - low).length


# Names of the groups in which a mesh has weights, by its session id: read anew when the mesh changed.
_groups_used: dict[int, frozenset[str]] = {}


def groups_used(obj: bpy.types.Object) -> frozenset[str]:
    """Names of the groups in which a mesh has weights."""
    uid = obj.data.session_uid
    if uid not in _groups_used:
        used = {entry.group for v in obj.data.vertices for entry in v.groups if entry.weight > 0.0}
        _groups_used[uid] = frozenset(group.name for group in obj.vertex_groups if group.index in used)
    return _groups_used[uid]


def _moves(obj: bpy.types.Object, bone: str) -> bool:
    """Whether a bone moves vertices of an object."""
    return bone in groups_used(obj)


# Who holds whom.


def skin_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that deforms an object, by a modifier that is on if any is, or None."""
    found = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None]
    return next((m.object for m in sorted(found, key=lambda m: not m.show_viewport)), None)


def held_by_bone(obj: bpy.types.Object) -> tuple[bpy.types.Object | None, str]:
    """The armature and the name of the bone that an object hangs on, by its parents; else None and ""."""
    while obj.parent is not None:
        if obj.parent_type == "BONE" and obj.parent.type == "ARMATURE":
            return obj.parent, obj.parent_bone
        obj = obj.parent
    return None, ""


def at_rest(obj: bpy.types.Object) -> Matrix:
    """The object's matrix in the world with the bone on which it hangs at rest."""
    rig, name = held_by_bone(obj)
    bone = rig.pose.bones.get(name) if rig is not None else None
    if bone is None:
        return obj.matrix_world.copy()
    # How the pose moves what hangs on the bone.
    moved = bone.matrix @ bone.bone.matrix_local.inverted_safe()
    return rig.matrix_world @ moved.inverted_safe() @ rig.matrix_world.inverted_safe() @ obj.matrix_world


def placed(pieces: Sequence[bpy.types.Object], *, posed: bool = False) -> list[Floats]:
    """Matrices (4, 4) from each piece's space to that of the first one, with bones at rest or as they are."""
    matrices = [obj.matrix_world if posed else at_rest(obj) for obj in pieces]
    first = matrices[0].inverted_safe()
    return [np.eye(4)] + [np.array(first @ matrix, np.float64) for matrix in matrices[1:]]


def _holders(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """What holds an object, from the nearest on: its armature or parent, what holds that, and so on."""
    passed = [obj]
    while True:
        holder = (skin_of(obj) if obj.type == "MESH" else None) or obj.parent
        if holder is None or holder in passed:
            return passed[1:]
        passed.append(holder)
        obj = holder


def holders(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """The armatures and empties that hold these objects, each once."""
    held = dict.fromkeys(holder for obj in objects for holder in _holders(obj))
    return [holder for holder in held if holder.type in {"ARMATURE", "EMPTY"}]


def names_in(body: Character) -> frozenset[str]:
    """Names of a character, of its meshes and of what holds them."""
    held = {obj.name for obj in (*body.whole, *holders(body.whole))}
    return frozenset({body.name, body.label, body.owner.name} | held)


def owner(obj: bpy.types.Object) -> bpy.types.ID:
    """The armature, empty, collection or object itself that holds together what the object is a piece of."""
    return _owner(obj, _rigs_below())


def _owner(
    obj: bpy.types.Object, rigs_below: Mapping[bpy.types.Object, list[bpy.types.Object]]
) -> bpy.types.ID:
    held = [obj, *_holders(obj)]
    armatures = [holder for holder in held if holder.type == "ARMATURE"]
    empties = [holder for holder in held if holder.type == "EMPTY"]
    if armatures:
        return armatures[-1]
    if empties and len(rigs_below.get(empties[-1], ())) == 1:
        # Beside the skinned meshes those that hang on nothing but the root of both.
        return rigs_below[empties[-1]][0]
    empties = [holder for holder in empties if holder not in rigs_below]
    if empties:
        return empties[-1]
    collections = _collections(held[-1]) if obj.type == "MESH" else []
    return collections[-1] if collections else obj


def _rigs_below() -> dict[bpy.types.Object, list[bpy.types.Object]]:
    """The outermost armatures below each empty."""
    below: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in bpy.data.objects:
        if obj.type == "ARMATURE" and is_there(obj):
            held = _holders(obj)
            if not any(holder.type == "ARMATURE" for holder in held):
                for holder in held:
                    below.setdefault(holder, []).append(obj)
    return below


def _collections(obj: bpy.types.Object) -> list[bpy.types.Collection]:
    """The collections of the object that hold loose meshes alone, the outermost last."""
    for nearest in obj.users_collection:
        collection: bpy.types.Collection | None = nearest
        found = []
        while collection is not None and _is_loose(collection):
            found.append(collection)
            collection = _above(collection)
        if found:
            return found
    return []


def _above(collection: bpy.types.Collection) -> bpy.types.Collection | None:
    return next((other for other in bpy.data.collections if collection.name in other.children), None)


def _is_loose(collection: bpy.types.Collection) -> bool:
    """Whether a collection is a character by itself: no scene's own, no set, and all in it is loose."""
    if collection.is_embedded_data:
        return False
    objects = collection.all_objects
    if any(obj.type in SET_TYPES | {"ARMATURE", "EMPTY"} for obj in objects):
        return False
    return not any(holder.type in {"ARMATURE", "EMPTY"} for obj in objects for holder in _holders(obj))


def _members(node: bpy.types.ID) -> list[bpy.types.Object]:
    """The mesh objects that a node holds together."""
    if isinstance(node, bpy.types.Collection):
        return [obj for obj in node.all_objects if obj.type == "MESH"]
    rigs_below, scenes, scene = _rigs_below(), node.users_scene, bpy.context.scene
    if scenes and scene not in scenes:
        scene = scenes[0]
    return [
        obj
        for obj in scene.objects
        if obj.type == "MESH" and (node in _holders(obj) or _owner(obj, rigs_below) == node)
    ]


def _is_surface(obj: bpy.types.Object) -> bool:
    return bool(obj.data.polygons) and MADE_FOR not in obj


def _shapes(meshes: Iterable[bpy.types.Object]) -> set[bpy.types.Object | None]:
    """Objects that bones are shown as."""
    rigs = {holder for obj in meshes for holder in _holders(obj) if holder.type == "ARMATURE"}
    return {bone.custom_shape for rig in rigs for bone in (rig.pose.bones if rig.pose else ())} - {None}


def _apart(objects: Iterable[bpy.types.Object]) -> Iterator[bpy.types.ID]:
    """What holds each object as far up as not all of them are below it."""
    chains = []
    for obj in objects:
        held = [obj, *_holders(obj)]
        chains.append(held + (_collections(held[-1]) if obj.type == "MESH" else []))
    common = set(chains[0]).intersection(*chains[1:])
    # A rig is not taken apart, but its meshes are.
    split = any(node.bl_rna.identifier == "Object" and node.type == "ARMATURE" for node in common)
    for chain in chains:
        below = [node for node in chain if node not in common]
        yield chain[0] if split or not below else below[-1]


def is_there(obj: bpy.types.Object | None) -> TypeGuard[bpy.types.Object]:
    """False for None and for an object that was deleted and is only kept by a reference to it."""
    return obj is not None and bool(obj.users_scene)


@persistent
def _forget_changed(_scene: object, depsgraph: bpy.types.Depsgraph) -> None:
    for update in depsgraph.updates:
        if update.is_updated_geometry:
            changed = update.id.original
            mesh = changed.data if isinstance(changed, bpy.types.Object) else changed
            if isinstance(mesh, bpy.types.Mesh):
                _groups_used.pop(mesh.session_uid, None)


@persistent
def forget(_scene: object = None, _unused: object = None) -> None:
    _groups_used.clear()


HANDLERS = (
    ("depsgraph_update_post", _forget_changed),
    ("undo_post", forget),
    ("redo_post", forget),
    ("load_pre", forget),
)
