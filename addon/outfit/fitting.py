# SPDX-License-Identifier: GPL-3.0-or-later
"""The work beside the window: arrays of a wish in, places, weights and shape keys on the target out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from mathutils.bvhtree import BVHTree

from ..job import Job
from ..typed import Flags, Floats, Integers
from .reading import Rows

if TYPE_CHECKING:
    from sgmds.transfer import Fitting, SkinWeights, SurfaceMap

    from .reading import Garment, Wish

# A bone of the target by its name, or a new one by its number.
BoneName = str | int

# A body's shape key is made for a garment when it moves skin under it by this share of what it moves at most:
# a smile does not move a hat.
COVERED = 0.05
# Skin under cloth counts as hidden up to this distance, and from this distance from skin that shows, in
# heights of a person: 7 cm and 2 cm.
REACH, MARGIN = 0.04, 0.012
# And where it is seen from none of so many sides, those around it: into a wide cuff one sees as far as it is
# wide. What sees out begins so far above the skin, in heights: a millimetre of a person.
SIDES, ABOVE = 64, 0.0006
# What is deeper than this in the target is counted as inside, in heights: a millimetre of a person.
INSIDE = 0.0006
# Rounds in which displacements of a body's key are averaged along the garment, which bridges what lies over
# two parts of a body.
SMOOTHING = 2


@dataclass(frozen=True)
class Options:
    """What the panel says. `distance` is in units of the world."""

    distance: float = 0.0
    tightness: float = 0.0
    body_keys: bool = True
    hide: bool = False


@dataclass(frozen=True)
class Bone:
    """A bone of a garment's rig that the target's lacks.

    `parent` is the name of one of the target's bones, or the number in the list of new ones, or None; `move`
    (3, 4) is how what it moves comes from the source to the target.
    """

    rig_uid: int
    rig_name: str
    name: str
    parent: str | int | None
    move: Floats


@dataclass(frozen=True)
class Worn:
    """One garment on the target: weights of its vertices for named bones, and shape keys.

    A name is one of the target's bones, or the number of a new one; `renamed` tells those for the names of
    the source's bones, and `bone` is the one on which the garment hangs without weights, or None.
    """

    names: list[BoneName]
    rows: Rows
    keys: dict[str, Floats]
    body_keys: dict[str, Floats]
    renamed: dict[str, BoneName]
    bone: str | int | None = None


@dataclass(frozen=True)
class Fitted:
    """An outfit on one target: `places` (n, 3) of its vertices, how many are inside, and new bones.

    `partners` are names of bones of the source's rig and those of the target's that do what these do.
    """

    wish: Wish
    fitting: Fitting
    places: Floats
    worn: list[Worn]
    bones: list[Bone]
    inside: int
    hidden: Flags | None
    partners: dict[str, str]


@dataclass
class OutfitJob(Job):
    """Fit the garments of each wish to its target."""

    wishes: list[Wish]
    options: Options
    results: list[Fitted] = field(default_factory=list, init=False)
    failures: list[tuple[str, Exception]] = field(default_factory=list, init=False)

    def _work(self, sgmds: ModuleType) -> None:
        for number, wish in enumerate(self.wishes):
            part = self._progress("Fitting the outfit", number / len(self.wishes), 1.0 / len(self.wishes))
            try:
                self.results.append(fit(sgmds, wish, self.options, part))
            except sgmds.Cancelled:
                raise
            except sgmds.SgmdsError as reason:
                self.failures.append((wish.label, reason))
            self._check_cancelled(sgmds)


def fit(
    sgmds: ModuleType, wish: Wish, options: Options, progress: Callable[[str, float], bool] | None = None
) -> Fitted:
    """One outfit on one target."""
    along = _guided(sgmds, wish, sgmds.SurfaceMap(wish.source, wish.target, *wish.places))
    points = np.concatenate([garment.points for garment in wish.garments])
    triangles = np.concatenate([each.triangles + each.vertices.start for each in wish.garments])
    stiff = np.concatenate([np.full(len(each.points), bool(each.bone)) for each in wish.garments])
    fitting = along.fitting(points, triangles, stiff=stiff if stiff.any() else None, progress=progress)
    places = place(fitting, wish, options)
    if progress is not None:
        progress("weights", 0.6)
    below = fitting.on_target(places)
    skin = _skin_weights(wish, below)
    partners, mapped, bones = _bones(sgmds, wish, along, points, places)
    keys = fitting_keys(fitting, wish)
    body_keys = _body_keys(wish, below, triangles) if options.body_keys else [{} for _ in wish.garments]
    worn = []
    for number, garment in enumerate(wish.garments):
        renamed = mapped.get(garment.name, {})
        names, rows = _weights(wish, garment, renamed, skin)
        bone = renamed.get(garment.bone)
        worn.append(Worn(names, rows, keys[number], body_keys[number], renamed, bone))
    hidden = None
    if options.hide:
        hidden = fitting.hidden(places, REACH * wish.height, MARGIN * wish.height)
        hidden = _closed_in(hidden, wish, places, triangles)
    inside = count_inside(fitting, wish, places)
    return Fitted(wish, fitting, places, worn, bones, inside, hidden, partners)


def _closed_in(hidden: Flags, wish: Wish, places: Floats, triangles: Integers) -> Flags:
    """Those hidden vertices of the target from which no straight way leads out past cloth and skin."""
    skin, own = wish.target
    around = np.concatenate([skin, places])
    tree = BVHTree.FromPolygons(
        around.tolist(), np.concatenate([own, triangles + len(skin)]).tolist(), all_triangles=True
    )
    normals = _normals(skin, own)
    starts = skin + ABOVE * wish.height * normals
    sides = _sides()
    found = hidden.copy()
    for vertex in np.flatnonzero(hidden):
        start = starts[vertex].tolist()
        outward = sides[sides @ normals[vertex] > 0.0].tolist()
        found[vertex] = all(tree.ray_cast(start, side)[0] is not None for side in outward)
    return found


def _normals(points: Floats, triangles: Integers) -> Floats:
    """Unit normals of vertices, of each the mean over its triangles' areas."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    facing = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], facing)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0.0, lengths, 1.0)


def _sides() -> Floats:
    """Directions spread evenly over a sphere, along a spiral."""
    number = np.arange(SIDES) + 0.5
    height, angle = 1.0 - 2.0 * number / SIDES, np.pi * (1.0 + np.sqrt(5.0)) * number
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def _guided(sgmds: ModuleType, wish: Wish, along: SurfaceMap) -> SurfaceMap:
    """The map, where it is unsure by the rigs of both bodies."""
    if not _have_rigs(wish):
        return along
    given, own = wish.rigs
    return along.guided(*_skins(sgmds, wish), given.parents, own.parents, given.heads, own.heads)


def _have_rigs(wish: Wish) -> bool:
    """Whether both bodies are moved by bones."""
    return None not in wish.rigs and all(len(rows.weight) for rows in wish.skins)


def _skins(sgmds: ModuleType, wish: Wish) -> tuple[SkinWeights, SkinWeights]:
    """Weights of both bodies as the core takes them."""
    given, own = (
        rows.compressed(len(body[0]), sgmds.transfer.SkinWeights)
        for rows, body in zip(wish.skins, (wish.source, wish.target), strict=True)
    )
    return given, own


def place(fitting: Fitting, wish: Wish, options: Options) -> Floats:
    """Places of all garments' vertices at a distance and tightness."""
    return fitting.place(distance=_distance(wish, options), tightness=options.tightness)


def _distance(wish: Wish, options: Options) -> float:
    """The distance that the panel says, in the target's units."""
    return options.distance / float(np.cbrt(abs(np.linalg.det(wish.to_world[1][:3, :3]))))


def _counts_as_inside(fitting: Fitting, wish: Wish) -> Floats:
    """Distance to the target's skin below which each vertex is inside: deeper than it was in the source and
    than a millimetre of a person. Soles and linings were inside on purpose.
    """
    return np.minimum(fitting.clearance_before, 0.0) - INSIDE * wish.height


def count_inside(fitting: Fitting, wish: Wish, places: Floats) -> int:
    """How many vertices are inside the target."""
    return int((fitting.clearance(places) < _counts_as_inside(fitting, wish)).sum())


def shares_kept(fitting: Fitting, wish: Wish, places: Floats, options: Options) -> Floats:
    """How much each vertex has of the distance to the skin that it should have, from 0 inside the target."""
    least, before = _counts_as_inside(fitting, wish), fitting.clearance_before
    gaps = fitting.gaps(distance=_distance(wish, options), tightness=options.tightness)
    wanted = np.where(before < 0.0, before, gaps)
    return np.clip((fitting.clearance(places) - least) / (wanted - least), 0.0, 1.0)


def fitting_keys(fitting: Fitting, wish: Wish) -> list[dict[str, Floats]]:
    """Displacements of each garment's own shape keys on the target."""
    count = sum(len(garment.points) for garment in wish.garments)
    found = []
    for garment in wish.garments:
        own = {}
        for name, offsets in garment.keys.items():
            padded = np.zeros((count, 3))
            padded[garment.vertices] = offsets
            own[name] = fitting.displacements(padded)[garment.vertices]
        found.append(own)
    return found


def _at_anchors(along: SurfaceMap, triangles: Integers, values: Floats) -> Floats:
    """Values of the target's vertices under each of the garments'."""
    return np.einsum("ij,ijc->ic", along.barycentric, values[triangles[along.faces]])


def _body_keys(wish: Wish, below: SurfaceMap, triangles: Integers) -> list[dict[str, Floats]]:
    """For each garment the displacements by which it follows shape keys of the body."""
    averaged = _averaging(triangles, len(below.faces))
    found: list[dict[str, Floats]] = [{} for _ in wish.garments]
    for name, offsets in wish.body_keys.items():
        least = COVERED * np.linalg.norm(offsets, axis=1).max(initial=0.0)
        moved = _at_anchors(below, wish.target[1], offsets)
        length = np.linalg.norm(moved, axis=1)
        chosen = [least > 0.0 and length[each.vertices].max(initial=0.0) >= least for each in wish.garments]
        if any(chosen):
            for _ in range(SMOOTHING):
                moved = averaged(moved)
        for own, garment, follows in zip(found, wish.garments, chosen, strict=True):
            if follows:
                own[name] = moved[garment.vertices]
    return found


def _averaging(triangles: Integers, count: int) -> Callable[[Floats], Floats]:
    """What takes the mean of each vertex's value and its neighbours'."""
    pairs = np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    edges = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    starts = np.flatnonzero(np.diff(edges[:, 0], prepend=-1))
    held = edges[starts, 0]
    many = np.ones(count)
    many[held] += np.diff(np.append(starts, len(edges)))

    def averaged(values: Floats) -> Floats:
        sums = values.copy()
        if len(edges):
            sums[held] += np.add.reduceat(values[edges[:, 1]], starts, axis=0)
        return sums / many[:, None]

    return averaged


def _skin_weights(wish: Wish, below: SurfaceMap) -> Rows:
    """Weights of the target's skin at all garments' vertices, as rows."""
    skin, rig = wish.skins[1], wish.rigs[1]
    if rig is None or not len(skin.weight):
        return Rows(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    starts = np.searchsorted(skin.vertex, np.arange(len(wish.target[0]) + 1))
    found = below.skin_weights(starts, skin.bone, skin.weight, len(rig.names))
    vertex = np.repeat(np.arange(len(found.starts) - 1), np.diff(found.starts))
    return Rows(vertex, np.asarray(found.groups, np.int64), found.weights)


def _bones(
    sgmds: ModuleType, wish: Wish, along: SurfaceMap, points: Floats, places: Floats
) -> tuple[dict[str, str], dict[str, dict[str, BoneName]], list[Bone]]:
    """What stands on the target for bones of the source's rig, and for those that move each garment, by its
    name: a name, or the number of a new bone; and the new bones.
    """
    given, own = wish.rigs
    if own is None:
        return {}, {}, []
    partners, nearest = {}, {}
    if _have_rigs(wish):
        found = along.bones(*_skins(sgmds, wish), given.parents, own.parents)
        for number, name in enumerate(given.names):
            if found.partners[number] >= 0:
                partners[name] = own.names[found.partners[number]]
            if found.nearest[number] >= 0:
                nearest[name] = own.names[found.nearest[number]]
    mapped: dict[str, dict[str, BoneName]] = {}
    bones: list[Bone] = []
    for garment in wish.garments:
        if garment.rig is not None:
            mapped[garment.name] = _mapped(wish, garment, partners, nearest, bones)
    _put(sgmds, wish, bones, mapped, points, places)
    return nearest | partners, mapped, bones


def _mapped(
    wish: Wish, garment: Garment, partners: Mapping[str, str], nearest: Mapping[str, str], bones: list[Bone]
) -> dict[str, BoneName]:
    """Names of a garment's bones → names of the target's, or numbers of new bones, appended to `bones`."""
    rig, own = garment.rig, wish.rigs[1]
    used = {rig.names[bone] for bone in np.unique(garment.rows.bone)} | ({garment.bone} - {""})
    parent_of = {
        name: rig.names[p] if p >= 0 else None for name, p in zip(rig.names, rig.parents, strict=True)
    }
    own_parent = {
        name: own.names[p] if p >= 0 else None for name, p in zip(own.names, own.parents, strict=True)
    }
    found: dict[str, BoneName] = {}

    def settle(name: str | None) -> BoneName | None:
        """Names of parents are settled before those of their children."""
        if name is None:
            return None
        if name in found:
            return found[name]
        target = partners.get(name) or nearest.get(name) or own.brought.get((rig.name, name))
        if target is None:
            parent = settle(parent_of[name])
            if name in own_parent and own_parent[name] == parent and name not in partners.values():
                target = name
            else:
                target = next(
                    (k for k, bone in enumerate(bones) if (bone.rig_uid, bone.name) == (rig.uid, name)), None
                )
            if target is None:
                target = len(bones)
                bones.append(Bone(rig.uid, rig.name, name, parent, np.eye(3, 4)))
        found[name] = target
        return target

    for name in rig.names:
        if name in used:
            settle(name)
    return found


def _put(
    sgmds: ModuleType,
    wish: Wish,
    bones: Sequence[Bone],
    mapped: Mapping[str, Mapping[str, BoneName]],
    points: Floats,
    places: Floats,
) -> None:
    """Place new bones as what they move was moved."""
    for number, bone in enumerate(bones):
        weight = np.zeros(len(points))
        for garment in wish.garments:
            table = mapped.get(garment.name, {})
            if garment.rig is None or garment.rig.uid != bone.rig_uid:
                continue
            below = {name for name, target in table.items() if _hangs_on(bones, target, number)}
            moving = np.isin(garment.rows.bone, [garment.rig.names.index(name) for name in below])
            np.add.at(weight[garment.vertices], garment.rows.vertex[moving], garment.rows.weight[moving])
            if garment.bone in below:
                weight[garment.vertices] = 1.0
        bone.move[:] = sgmds.poses.similarity(points, places, weight)[:3]


def _hangs_on(bones: Sequence[Bone], target: BoneName | None, number: int) -> bool:
    """Whether a new bone is the one of this number, or below it."""
    while isinstance(target, int):
        if target == number:
            return True
        target = bones[target].parent
    return False


def _weights(
    wish: Wish, garment: Garment, mapped: Mapping[str, BoneName], skin: Rows
) -> tuple[list[BoneName], Rows]:
    """Names of bones and the weights of a garment's vertices for them: its own, else those of the skin."""
    own = wish.rigs[1]
    if own is None or garment.bone:
        return [], Rows(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    count = len(garment.points)
    names: list[BoneName] = list(own.names)
    here = (skin.vertex >= garment.vertices.start) & (skin.vertex < garment.vertices.stop)
    below = skin.vertex[here] - garment.vertices.start, skin.bone[here], skin.weight[here]
    if not len(garment.rows.weight):
        return names, Rows(*below)
    new = sorted({target for target in mapped.values() if isinstance(target, int)})
    place: dict[BoneName, int] = {name: number for number, name in enumerate(own.names)} | {
        number: len(own.names) + k for k, number in enumerate(new)
    }
    names += new
    table = np.full(len(garment.rig.names), -1)
    for name, target in mapped.items():
        table[garment.rig.names.index(name)] = place[target]
    vertex, bone, weight = garment.rows.vertex, table[garment.rows.bone], garment.rows.weight
    weighted = np.bincount(vertex, weight, minlength=count) > 0.0
    bare = ~weighted[below[0]]
    parts = ((vertex, bone, weight), tuple(values[bare] for values in below))
    vertex, bone, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
    key, together = np.unique(vertex * len(names) + bone, return_inverse=True)
    return names, Rows(
        key // len(names),
        key % len(names),
        np.asarray(np.bincount(together, weight, minlength=len(key)), float),
    )
