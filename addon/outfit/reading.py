# SPDX-License-Identifier: GPL-3.0-or-later
"""A worn outfit, two bodies and the stored match between them as plain arrays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

from .. import character, mesh_read, stored_match
from ..mesh_read import UnusableObjectError
from ..transfer import joined
from ..transfer.route import FigureRoute, Route, stored
from ..transfer.shape_keys import names as key_names
from ..transfer.shape_keys import read_key
from ..transfer.weights import read_weights
from ..typed import Flags, Floats, Integers
from . import wardrobe

if TYPE_CHECKING:
    from sgmds.transfer import SkinWeights

    from ..character import Character

# On bones that an outfit brought along: the rig and the bone that they are copies of.
BROUGHT = "spectral_match_brought"
# A worn mesh under which so much of what is matched with it has no skin is skin itself: a body may end at the
# rim of its clothes. Suits, shoes and hair of bodies that end there have 0.17 to 0.48, what covers skin none.
BARE = 0.1


@dataclass(frozen=True)
class Rig:
    """An armature: the session id of its object, names and parents of its bones, −1 of a root.

    `heads` (bones, 3) are where they begin at rest, in the body's coordinates, and `brought` those bones that
    earlier outfits brought along, by the rig and bone that they come from.
    """

    uid: int
    name: str
    names: list[str]
    parents: Integers
    heads: Floats
    brought: dict[tuple[str, ...], str]


@dataclass(frozen=True)
class Rows:
    """Weights of vertices for bones: (vertex, bone, weight), sorted by vertex."""

    vertex: Integers
    bone: Integers
    weight: Floats

    def compressed(self, count: int, skin_weights: type[SkinWeights]) -> SkinWeights:
        """As the core's `SkinWeights` of so many vertices."""
        starts = np.searchsorted(self.vertex, np.arange(count + 1))
        return skin_weights(starts, np.asarray(self.bone, np.int64), self.weight, np.zeros(0, np.int64))


@dataclass(frozen=True)
class Garment:
    """One worn object in the source's coordinates.

    `vertices` is its slice of the whole outfit's, `keys` are displacements of its shape keys from the places
    of its vertices, `rig` is its armature, `rows` its weights for the bones of that, and `bone` the one on
    which it hangs without weights, or "".
    """

    uid: int
    mesh_uid: int
    name: str
    vertices: slice
    points: Floats
    triangles: Integers
    keys: dict[str, Floats]
    rig: Rig | None
    rows: Rows
    bone: str


@dataclass(frozen=True)
class Wish:
    """What it takes to fit an outfit to one target, in the stretched coordinates of both leads.

    `to_world` (4, 4) lead from these to the world, of source and target, `back` (3, 3) from the target's to
    its mesh coordinates; `bodies` are the session ids, names and vertex slices of the target's meshes, the
    lead first, and `body_keys` displacements of all their vertices for each shape key.
    """

    label: str
    source_uid: int
    source: tuple[Floats, Integers]
    target: tuple[Floats, Integers]
    places: tuple[Integers, Floats, Floats]
    to_world: tuple[Floats, ...]
    back: Floats
    bodies: list[tuple[int, str, slice]]
    garments: list[Garment]
    rigs: tuple[Rig | None, Rig | None]
    skins: tuple[Rows, Rows]
    body_keys: dict[str, Floats]
    notes: list[str] = field(default_factory=list)

    @property
    def height(self) -> float:
        """Height of a standing person with as much skin as the target."""
        points, triangles = self.target
        a, b, c = (points[triangles[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
        return HEIGHT * np.sqrt(area)


# Height of a standing person over the square root of the area of the skin, as the core has it.
HEIGHT = 1.3


def read(
    context: bpy.types.Context, wearer: Character, garments: Sequence[bpy.types.Object], target: Character
) -> Wish:
    """What it takes to fit these objects of the wearer to a target character.

    Raises `UnusableObjectError` where there is no match that can be used.
    """
    bodies = _bodies(wearer, target)
    lead = bodies[0]
    for body in bodies:
        mesh_read.check_usable(body, as_target=True)
    stored_match.require(lead)
    sources = [obj for obj, _, _ in stored_match.sources_of(lead)]
    if not any(obj in wearer.whole for obj in sources):
        raise UnusableObjectError(
            f"'{target.name}' was matched with '{sources[0].name}', which is not of '{wearer.name}'. "
            "Match again"
        )
    for garment in garments:
        mesh_read.check_usable(garment)
    mesh_read.place(
        context, [*sources, *bodies, *garments, *character.holders([*sources, *bodies, *garments])]
    )
    worn = [*garments, *wardrobe.worn(wearer)]
    with joined.seen(sources, wearer.name, bodies) as view:
        route = Route(lead, view) if len(bodies) == 1 else FigureRoute(bodies, view)
        triangles, places, notes = _on_skin(route, bodies, worn, wearer.name)
        rig_1, rig_2 = _rig_of([*sources, *garments]), _rig_of(bodies)
        return Wish(
            label=target.name,
            source_uid=sources[0].session_uid,
            source=(route.source_points @ route.source_stretch, triangles),
            target=(route.target_points @ route.target_stretch, route.target_triangles),
            places=places,
            to_world=tuple(np.array(way) for way in (route.source_to_world, route.target_to_world)),
            back=np.linalg.inv(route.target_stretch),
            bodies=_slices(bodies),
            garments=_garments(route, sources[0], garments),
            rigs=(_rig(rig_1, route.source_to_world), _rig(rig_2, route.target_to_world)),
            skins=(_rows(view.body, rig_1), _rows_of_all(bodies, rig_2)),
            body_keys=_body_keys(route, bodies),
            notes=notes,
        )


def _bodies(wearer: Character, target: Character) -> list[bpy.types.Object]:
    """The matched meshes of a target that are its skin, the lead first."""
    matched = [obj for obj in target.whole if obj.data.spectral_match.target_fingerprint]
    if not matched:
        raise UnusableObjectError(f"'{target.name}' has no match yet. Press Match first")
    body = wardrobe.body_of(target)
    together = stored_match.matched_together(matched)
    found = next((group for group in together if body in group), max(together, key=len))
    worn = wardrobe.worn(target)
    return [obj for obj in found if obj not in worn] or found


def _on_skin(
    route: Route, bodies: Sequence[bpy.types.Object], worn: Sequence[bpy.types.Object], wearer: str
) -> tuple[Integers, tuple[Integers, Floats, Floats], list[str]]:
    """Triangles of the source's skin, where the target's vertices lie on it, and words.

    Images on what is worn go to the skin under it. Where there is none nothing is known, unless the body ends
    at the rim of the clothes, which are its skin then.
    """
    view, triangles = route.view, route.triangles
    notes: list[str] = []
    found = [stored(view, obj.data) for obj in bodies]
    face, weights, confidence = (np.concatenate(values) for values in zip(*found, strict=True))
    piece = np.searchsorted(view.starts, np.arange(len(triangles)), side="right") - 1
    cloth = {number for number, obj in enumerate(view.pieces) if obj in worn}
    if len(cloth) == len(view.pieces):
        notes.append(f"'{wearer}' has no body: the outfit was fitted by what it covers")
    if not cloth or len(cloth) == len(view.pieces):
        return triangles, (face, weights, confidence), notes
    points = route.source_points @ route.source_stretch
    images = np.einsum("ij,ijc->ic", weights, points[triangles[face]])
    reach = wardrobe.UNDER * np.linalg.norm(points.max(axis=0) - points.min(axis=0))
    bare = ~np.isin(piece, list(cloth))
    nearest, apart = _nearest(
        points, triangles, np.flatnonzero(bare), images, np.isin(piece[face], list(cloth))
    )
    for number in sorted(cloth):
        on = piece[face] == number
        if on.any() and (apart[on] > reach).mean() > BARE:
            cloth.discard(number)
            notes.append(
                f"There is no skin under '{view.pieces[number].name}': what lies over it was fitted to its "
                "surface"
            )
    bare = ~np.isin(piece, list(cloth))
    moved = ~bare[face]
    nearest, apart = _nearest(points, triangles, np.flatnonzero(bare), images, moved)
    face, weights, confidence = face.copy(), weights.copy(), confidence.copy()
    face[moved], weights[moved] = nearest[0][moved], nearest[1][moved]
    confidence[moved & (apart > reach)] = 0.0
    place = np.cumsum(bare) - 1
    return triangles[bare], (place[face], weights, confidence), notes


def _nearest(
    points: Floats, triangles: Integers, allowed: Integers, places: Floats, wanted: Flags
) -> tuple[tuple[Integers, Floats], Floats]:
    """For each wanted place the nearest of the allowed triangles, weights there, and how far away it is."""
    tree = BVHTree.FromPolygons(points.tolist(), triangles[allowed].tolist(), all_triangles=True)
    faces, weights, apart = np.zeros(len(places), np.int64), np.zeros((len(places), 3)), np.zeros(len(places))
    weights[:, 0] = 1.0
    chosen = np.flatnonzero(wanted)
    if not len(chosen):
        return (faces, weights), apart
    hits = [tree.find_nearest(place) for place in places[chosen].tolist()]
    faces[chosen] = allowed[[hit[2] for hit in hits]]
    apart[chosen] = [hit[3] for hit in hits]
    weights[chosen] = _barycentric(np.array([hit[0] for hit in hits]), points[triangles[faces[chosen]]])
    return (faces, weights), apart


def _barycentric(places: Floats, corners: Floats) -> Floats:
    """Weights of the corners (n, 3, 3) of triangles in which places (n, 3) lie."""
    origin, along, up = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    off = places - origin

    def dot(a: Floats, b: Floats) -> Floats:
        return np.einsum("ij,ij->i", a, b)

    aa, ab, bb, ao, bo = dot(along, along), dot(along, up), dot(up, up), dot(along, off), dot(up, off)
    area = aa * bb - ab * ab
    safe = np.where(area > 0.0, area, 1.0)
    second, third = (bb * ao - ab * bo) / safe, (aa * bo - ab * ao) / safe
    weights = np.clip(np.stack([1.0 - second - third, second, third], axis=1), 0.0, None)
    return weights / weights.sum(axis=1, keepdims=True)


def _rig_of(objects: Iterable[bpy.types.Object]) -> bpy.types.Object | None:
    """The first armature that deforms one of the objects, or holds it by a bone."""
    found = (character.skin_of(obj) or character.held_by_bone(obj)[0] for obj in objects)
    return next(filter(None, found), None)


def _rig(rig: bpy.types.Object | None, to_world: Matrix) -> Rig | None:
    if rig is None:
        return None
    names = [bone.name for bone in rig.data.bones]
    number = {name: place for place, name in enumerate(names)}
    parents = np.array([number[bone.parent.name] if bone.parent else -1 for bone in rig.data.bones], np.int64)
    into = to_world.inverted_safe() @ rig.matrix_world
    heads = np.array([into @ bone.head_local for bone in rig.data.bones], np.float64).reshape(-1, 3)
    brought = {tuple(bone[BROUGHT].splitlines()): bone.name for bone in rig.data.bones if BROUGHT in bone}
    return Rig(rig.session_uid, rig.name, names, parents, heads, brought)


def _rows(obj: bpy.types.Object, rig: bpy.types.Object | None) -> Rows:
    """Weights of an object's mesh for the bones of a rig."""
    vertex, group, weight = read_weights(obj)
    bone_of = np.full(max([len(obj.vertex_groups), *(group + 1)], default=0), -1)
    number = {} if rig is None else {bone.name: place for place, bone in enumerate(rig.data.bones)}
    for held in obj.vertex_groups:
        bone_of[held.index] = number.get(held.name, -1)
    bone = bone_of[group]
    kept = (bone >= 0) & (weight > 0.0)
    return Rows(vertex[kept], bone[kept], weight[kept])


def _rows_of_all(objects: Iterable[bpy.types.Object], rig: bpy.types.Object | None) -> Rows:
    """The same of several meshes, one after the other; what hangs on a bone follows that."""
    made, before = [], 0
    for obj in objects:
        rows, count = _rows(obj, rig), len(obj.data.vertices)
        holder, name = character.held_by_bone(obj)
        if character.skin_of(obj) is None and holder is not None and holder == rig:
            bone = rig.data.bones.find(name)
            rows = Rows(np.arange(count), np.full(count, bone), np.ones(count))
        made.append((rows.vertex + before, rows.bone, rows.weight))
        before += count
    return Rows(*(np.concatenate(values) for values in zip(*made, strict=True)))


def _slices(objects: Iterable[bpy.types.Object]) -> list[tuple[int, str, slice]]:
    found, before = [], 0
    for obj in objects:
        count = len(obj.data.vertices)
        found.append((obj.session_uid, obj.name, slice(before, before + count)))
        before += count
    return found


def _garments(route: Route, lead: bpy.types.Object, garments: Iterable[bpy.types.Object]) -> list[Garment]:
    made, before = [], 0
    for obj in garments:
        matrix = character.placed([lead, obj])[1]
        turn = matrix[:3, :3].T @ route.source_stretch
        local = mesh_read.positions(obj.data).astype(np.float64)
        keys = obj.data.shape_keys
        basis = local if keys is None else read_key(keys.reference_key)
        rig = character.skin_of(obj)
        holder, bone = character.held_by_bone(obj)
        if rig is None and holder is not None:
            rig = holder
        else:
            bone = ""
        triangles = mesh_read.triangle_vertices(obj.data)
        if np.linalg.det(turn) < 0.0:
            triangles = triangles[:, ::-1]
        made.append(
            Garment(
                uid=obj.session_uid,
                mesh_uid=obj.data.session_uid,
                name=obj.name,
                vertices=slice(before, before + len(local)),
                points=basis @ turn + matrix[:3, 3] @ route.source_stretch,
                triangles=triangles,
                keys={
                    block.name: (read_key(block) - basis) @ turn
                    for block in (keys.key_blocks[1:] if keys else ())
                },
                rig=_rig(rig, route.source_to_world),
                rows=_rows(obj, rig),
                bone=bone,
            )
        )
        before += len(local)
    return made


def _body_keys(route: Route, bodies: Sequence[bpy.types.Object]) -> dict[str, Floats]:
    """Displacements of all vertices of the target for each relative shape key of its meshes."""
    found: dict[str, Floats] = {}
    matrices = character.placed(bodies)
    count = len(route.target_points)
    for (_, _, own), obj, matrix in zip(_slices(bodies), bodies, matrices, strict=True):
        keys = obj.data.shape_keys
        if keys is None or not keys.use_relative:
            continue
        for name in key_names(obj):
            block = keys.key_blocks[name]
            offsets = (read_key(block) - read_key(block.relative_key)) @ matrix[:3, :3].T
            found.setdefault(name, np.zeros((count, 3)))[own] = offsets @ route.target_stretch
    return found
