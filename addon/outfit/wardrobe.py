# SPDX-License-Identifier: GPL-3.0-or-later
"""What a character wears: its meshes that lie over others of its meshes."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.app.handlers import persistent
from mathutils.bvhtree import BVHTree

from .. import character, mesh_read
from ..typed import Floats

if TYPE_CHECKING:
    from ..character import Character

AUTOMATIC, WORN, NOT_WORN = "AUTOMATIC", "WORN", "NOT_WORN"
# Smaller meshes belong to the body unless they are checked: eyes, teeth and lashes.
SMALLEST = 0.1
# What is worn lies over other meshes with so much of its vertices, up to this share of the character's size:
# half the width of a wide skirt. So many vertices are asked.
COVERING, UNDER, PROBES = 0.3, 0.06, 100
# Of so many the other mesh is straight below: of clothes, hats and hair 0.33 to 1, of hands, arms and legs
# that come near cuffs and skirts up to 0.16.
STRAIGHT = 0.25
# So many of the bones that move what is worn move what it lies on too: a glove is worn, an arm is not.
SHARED = 0.5
# Of what replaces another piece either lies at the other with more than this share. Of shirts, trousers and
# shoes it is 0.8 to 1, of a hat and a helmet 0.58, of a belt and a coat 0.48, of hands and a coat 0.15.
REPLACED = 0.4
# Session ids of the meshes of a character → the ids of the objects that are worn, if no box says otherwise.
# After `OF_COPIES`: those of what was fitted and what was worn before → the ids of what is in the way.
_found: dict[tuple[int, ...], frozenset[int]] = {}
OF_COPIES = -1


def wearer(source: Character, targets: Iterable[Character]) -> Character:
    """The whole character that a chosen source belongs to, itself where that has meshes of the targets."""
    whole = character.of(source.lead)
    taken = {piece for target in targets for piece in target.whole}
    if whole is None or taken.intersection(whole.whole):
        return source
    return whole


def body_of(body: Character) -> bpy.types.Object:
    """The large mesh of a character that many bones move and that is not worn.

    A body of one mesh is moved by most; of one in parts the trunk is, rather than an arm with its fingers.
    """
    wearing = [obj for obj in body.pieces if obj not in worn(body)] or body.pieces
    return max(wearing, key=lambda obj: (1 + len(character.groups_used(obj))) * _size(obj) ** 2)


def _size(obj: bpy.types.Object) -> float:
    """Diagonal of a mesh in the world, the same in any pose."""
    points = mesh_read.positions(obj.data) @ np.array(obj.matrix_world)[:3, :3].T
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def others(body: Character) -> list[bpy.types.Object]:
    """What may be worn: all meshes of a character beside its body, or all where it has none.

    What lies over others comes first, whatever the boxes say.
    """
    wearing, checked, over = body_of(body), worn(body), _over(_seen(body))
    found = [obj for obj in body.whole if obj != wearing or len(body.whole) == 1 or obj in checked]
    return sorted(found, key=lambda obj: obj.session_uid not in over)


def worn(body: Character) -> list[bpy.types.Object]:
    """What a character wears: as the boxes say, else the larger of its meshes that lie over others."""
    seen = _seen(body)
    over = _over(seen)
    return [obj for obj in body.whole if _is_worn(obj, seen, over)]


def worn_in_match(bodies: Iterable[Character]) -> list[bpy.types.Object]:
    """What is worn and takes part in a match, of characters of which something is left without it."""
    found = []
    for body in bodies:
        taking = [obj for obj in worn(body) if obj in body.pieces]
        found += taking if len(taking) < len(body.pieces) else []
    return found


def undress(bodies: Iterable[Character]) -> bool:
    """Leave out of the next match what is worn; returns whether there was something."""
    found = worn_in_match(bodies)
    for obj in found:
        obj.spectral_match_part = character.LEFT_OUT
    return bool(found)


def _over(seen: Sequence[bpy.types.Object]) -> frozenset[int]:
    """Session ids of the larger meshes that lie over others, as found before."""
    key = tuple(obj.data.session_uid for obj in seen)
    if key not in _found:
        _found[key] = _lying_over(seen)
    return _found[key]


def replaced(body: Character, copies: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """What a character wears of its own where these copies are, and what was hidden for such; by name, so
    that each keeps its place when it is hidden.
    """
    own = [obj for obj in worn(body) if obj not in copies and obj.visible_get()]
    # Sliders change the copies' meshes, but nothing of this.
    key = (OF_COPIES, *(obj.session_uid for obj in copies), *(obj.data.session_uid for obj in own))
    if own and key not in _found:
        _found[key] = _lying_at(copies, own)
    hidden = [obj for obj in body.whole if obj.spectral_match_hidden and not obj.visible_get()]
    found = [obj for obj in own if obj.session_uid in _found[key]]
    return sorted(found + hidden, key=lambda obj: obj.name)


def _lying_at(copies: Sequence[bpy.types.Object], own: Sequence[bpy.types.Object]) -> frozenset[int]:
    """Session ids of those pieces that lie at a copy as it does at them: of hands and sleeves one does."""
    both = [*copies, *own]
    trees, points, _ = _surfaces(both)
    corners = np.concatenate(points)
    reach = UNDER * float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))

    def share(number: int, other: int) -> float:
        asked = points[number][:: max(1, len(points[number]) // PROBES)].tolist()
        return sum(trees[other].find_nearest(place, reach)[0] is not None for place in asked) / len(asked)

    found = set()
    for number in range(len(copies), len(both)):
        for other in range(len(copies)):
            if share(number, other) > REPLACED and share(other, number) > REPLACED:
                found.add(both[number].session_uid)
    return frozenset(found)


def _seen(body: Character) -> tuple[bpy.types.Object, ...]:
    """Pieces, and what a check box leaves out of the match: bodies matched alone are still dressed."""
    unchecked = (obj for obj in body.left_out if obj.spectral_match_part == character.LEFT_OUT)
    return (*body.pieces, *(obj for obj in unchecked if obj.visible_get()))


def _is_worn(obj: bpy.types.Object, seen: Container[bpy.types.Object], found: Container[int]) -> bool:
    if obj.spectral_match_worn != AUTOMATIC:
        return obj.spectral_match_worn == WORN
    return obj in seen and obj.session_uid in found


def _lying_over(pieces: Sequence[bpy.types.Object]) -> frozenset[int]:
    """Session ids of the larger pieces that lie over others, at rest."""
    trees, points, normals = _surfaces(pieces)
    corners = np.concatenate(points)
    size = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))
    share, probes = np.zeros((len(pieces), len(pieces))), []
    for number, (own, facing) in enumerate(zip(points, normals, strict=True)):
        every = slice(None, None, max(1, len(own) // PROBES))
        probes.append(list(zip(own[every].tolist(), facing[every].tolist(), strict=True)))
        for probe in probes[number]:
            other = _below(*probe, trees, number, UNDER * size)
            if other is not None:
                share[number, other] += 1.0 / len(probes[number])
    # Of two that lie in one another, as thick cloth and skin may, the one that does so more.
    share[share <= share.T] = 0.0
    found = set()
    for number, (obj, own) in enumerate(zip(pieces, points, strict=True)):
        large = np.linalg.norm(own.max(axis=0) - own.min(axis=0)) > SMALLEST * size
        under = [pieces[other] for other in np.flatnonzero(share[number])]
        if not (large and share[number].sum() >= COVERING and _shares_bones(obj, under)):
            continue
        straight = sum(_is_straight_below(*probe, trees, number, UNDER * size) for probe in probes[number])
        if straight >= STRAIGHT * len(probes[number]):
            found.add(obj.session_uid)
    return frozenset(found)


def _surfaces(pieces: Sequence[bpy.types.Object]) -> tuple[list[BVHTree], list[Floats], list[Floats]]:
    """A search tree of each piece, its vertices and their normals, in the space of the first."""
    trees: list[BVHTree] = []
    points, normals = [], []
    for obj, matrix in zip(pieces, character.placed(pieces), strict=True):
        local = mesh_read.positions(obj.data).astype(np.float64)
        points.append(local @ matrix[:3, :3].T + matrix[:3, 3])
        facing = np.empty(3 * len(local), np.float32)
        obj.data.vertex_normals.foreach_get("vector", facing)
        normals.append(facing.reshape(-1, 3) @ np.linalg.inv(matrix[:3, :3]))
        triangles = mesh_read.triangle_vertices(obj.data)
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            triangles = triangles[:, ::-1]
        trees.append(BVHTree.FromPolygons(points[-1].tolist(), triangles.tolist(), all_triangles=True))
    return trees, points, normals


def _below(
    place: Sequence[float], facing: Sequence[float], trees: Sequence[BVHTree], own: int, reach: float
) -> int | None:
    """Which other surface is nearest to a place, up to a distance, if the place is on its outer side.

    It has to face as the place does: skin lies over the lining of a skirt, which faces it.
    """
    hits = [(tree.find_nearest(place, reach), other) for other, tree in enumerate(trees) if other != own]
    near = [(hit[3], other, hit) for hit, other in hits if hit[0] is not None]
    if not near:
        return None
    _, other, (at, normal, _, _) = min(near, key=lambda each: each[:2])
    height = sum(n * (p - q) for n, p, q in zip(normal, place, at, strict=True))
    agreement = sum(n * m for n, m in zip(normal, facing, strict=True))
    return other if height > 0.0 and agreement > 0.0 else None


def _is_straight_below(
    place: Sequence[float], facing: Sequence[float], trees: Sequence[BVHTree], own: int, reach: float
) -> bool:
    """Whether another surface that faces as a place does is straight below it, up to a distance."""
    inward = [-n for n in facing]
    hits = (tree.ray_cast(place, inward, reach) for other, tree in enumerate(trees) if other != own)
    normals = (normal for _, normal, _, _ in hits if normal is not None)
    return any(sum(n * m for n, m in zip(normal, facing, strict=True)) > 0.0 for normal in normals)


def _shares_bones(obj: bpy.types.Object, under: Iterable[bpy.types.Object]) -> bool:
    """Whether enough of the bones that move an object move what it lies on, or none is known to."""
    used = character.groups_used(obj) if character.skin_of(obj) is not None else frozenset()
    held = frozenset().union(*map(character.groups_used, under))
    return not used or len(used & held) >= SHARED * len(used)


@persistent
def _forget_changed(_scene: object, depsgraph: bpy.types.Depsgraph) -> None:
    for update in depsgraph.updates if _found else ():
        if update.is_updated_geometry:
            changed = update.id.original
            mesh = changed.data if isinstance(changed, bpy.types.Object) else changed
            if isinstance(mesh, bpy.types.Mesh):
                for key in [key for key in _found if mesh.session_uid in key]:
                    del _found[key]


@persistent
def forget(_scene: object = None, _unused: object = None) -> None:
    _found.clear()


HANDLERS = (
    ("depsgraph_update_post", _forget_changed),
    ("undo_post", forget),
    ("redo_post", forget),
    ("load_pre", forget),
)
