"""Everything a character carries, taken from the source to the target of a map.

`SurfaceMap` joins two meshes and the map between them; each kind of data has a method. Meshes are given as
they are, in their own units and with all their parts.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .correspondence import Correspondence, check_weights
from .errors import ArgumentError
from .shape import (
    Floats,
    Ids,
    Progress,
    Shape,
    checked_array,
    checked_count,
    checked_matrix,
    checked_number,
    finite,
    mesh_of,
)

Mesh = Shape | tuple[ArrayLike, ArrayLike]
"""A shape, or vertices (n, 3) and triangles (m, 3)."""
_LARGEST_CELL = 2**31 - 1


@dataclass(frozen=True)
class Layout:
    """A UV map on the target's face corners.

    `uv` (corners, 2); `island` (faces,) is the source's island from which a face took its UVs; `straddles`
    (faces,) tells the faces that lie across the image of a seam, whose corners beyond it were extrapolated.
    """

    uv: Floats
    island: Ids
    straddles: NDArray[np.bool_]


@dataclass(frozen=True)
class SeamCuts:
    """Cuts that separate the target's faces along the images of the source's seams.

    New points: `edges` (points, 2), the vertices of the edge that each divides, −1 where it lies within a
    face; `shares` (points,) of the way from the first to the second; `positions` (points, 3); and their
    images on the source, `faces` (points,) and `barycentric` (points, 3). `cuts` (cuts, 3): a face and the
    two ends, vertices of the target or, from n_target up, new points. `moved` (vertices,) lay just beside a
    seam: their images on it are `moved_faces` and `moved_barycentric`.
    """

    edges: Ids
    shares: Floats
    positions: Floats
    faces: Ids
    barycentric: Floats
    cuts: Ids
    moved: Ids
    moved_faces: Ids
    moved_barycentric: Floats


@dataclass(frozen=True)
class SkinWeights:
    """Weights in compressed rows: those of vertex v are entries `starts[v]` to `starts[v + 1]`.

    `filled` are the vertices whose images were rejected and which were filled from their neighbours.
    """

    starts: Ids
    groups: Ids
    weights: Floats
    filled: Ids

    def dense(self, groups: int) -> Floats:
        """As a table (vertices, groups), of at least as many groups as there are weights of."""
        groups = checked_count("groups", groups, int(self.groups.max(initial=-1)) + 1)
        table = np.zeros((len(self.starts) - 1, groups))
        table[np.repeat(np.arange(len(table)), np.diff(self.starts)), self.groups] = self.weights
        return table


@dataclass(frozen=True)
class Strands:
    """Hair on the target.

    `points` (n, 3) are those that were given. For each strand: `scales` (strands,), by which it grew;
    `faces` (strands,) and `barycentric` (strands, 3), the target's triangle on which it stands and the
    weights of its corners; `confidence` (strands,) in that place, 0 where the target has no counterpart.
    """

    points: Floats
    scales: Floats
    faces: Ids
    barycentric: Floats
    confidence: Floats


@dataclass(frozen=True)
class BoneMap:
    """Bones of the source's rig and those of the target's.

    For each bone of the source: `partners` (bones,), the bone of the target that does what it does, −1
    without one, no bone twice; `shares` (bones,), the intersection over union of what the two move; `nearest`
    (bones,), the bone that moves most of what it moves, whoever else's partner that is, −1 for a bone that
    moves no skin.
    """

    partners: Ids
    shares: Floats
    nearest: Ids


@dataclass(frozen=True)
class FittedBones:
    """Bones of a rig in the target.

    `heads` and `tails` (bones, 3); `axes` (bones, 3, 3), whose columns are x, y along the bone, and z;
    `turns` (bones, 3, 3), which take directions of the source to those of the target, mirroring ones where
    the map mirrors; `scales` (bones,), length on the target for a unit of length on the source; `firm`
    (bones,) tells those placed by the surface, or beside such ones, from those that go with the whole body.
    """

    heads: Floats
    tails: Floats
    axes: Floats
    turns: Floats
    scales: Floats
    firm: NDArray[np.bool_]


@dataclass(frozen=True)
class Coincidence:
    """Where the target lies on the source.

    `to_target` (4, 4) takes the source's coordinates to the target's. Of the target's face corners those
    `there` (corners,) lie on the source: each in the triangle `faces` (corners,), with the weights
    `barycentric` (corners, 3) of its corners.
    """

    to_target: Floats
    there: NDArray[np.bool_]
    faces: Ids
    barycentric: Floats


class Fitting:
    """Garments bound to the two bodies of a `SurfaceMap`, as `SurfaceMap.fitting` makes them.

    Its vertices (n,) are those that were given, of all garments together. Placing them anew at another
    distance to the skin takes a fraction of the time of binding.
    """

    def __init__(self, core: _core.Fitting, faces: Ids, count: int, skin: tuple[int, int]) -> None:
        self._core, self._faces, self._count, self._skin = core, faces, count, skin

    def place(self, *, distance: float | None = None, tightness: float = 0.0, collide: bool = True) -> Floats:
        """The garments on the target, (n, 3); the options are those of `SurfaceMap.fit`."""
        distance = 0.0 if distance is None else checked_number("distance", distance)
        return self._core.place(distance, checked_number("tightness", tightness), bool(collide))

    def gaps(self, *, distance: float | None = None, tightness: float = 0.0) -> Floats:
        """Distance (n,) to the target's skin that the garments' vertices keep at least in `place`."""
        distance = 0.0 if distance is None else checked_number("distance", distance)
        return self._core.gaps(distance, checked_number("tightness", tightness))

    def clearance(self, vertices: ArrayLike) -> Floats:
        """Distance (n,) to the target's skin of the garments' vertices at places (n, 3), negative within."""
        return self._core.clearance(self._vertices("vertices", vertices))

    @property
    def clearance_before(self) -> Floats:
        """Distance (n,) to the source's skin of the garments' vertices, in the target's units."""
        return self._core.clearance_before()

    def displacements(self, offsets: ArrayLike) -> Floats:
        """The garments' own shape keys: displacements (n, 3) on the source as those on the target."""
        return self._core.displacements(self._vertices("offsets", offsets))

    def hidden(self, vertices: ArrayLike, reach: float, margin: float) -> NDArray[np.bool_]:
        """Which of the target's vertices the garments hide, (n_target,), their vertices at places (n, 3).

        Hidden is what lies under cloth at most `reach` above it, and along the edges at least `margin` from
        skin that does not, both in the target's units.
        """
        vertices = self._vertices("vertices", vertices)
        return self._core.hidden(vertices, checked_number("reach", reach), checked_number("margin", margin))

    def on_target(self, vertices: ArrayLike) -> SurfaceMap:
        """The map from the target's skin, here the source, to the garments with their vertices at (n, 3).

        Along it travels what the skin has, such as its `skin_weights`.
        """
        core = self._core.on_target(self._vertices("vertices", vertices), self._faces)
        return SurfaceMap._made(core, self._skin, (self._count, len(self._faces)))

    def _vertices(self, name: str, values: ArrayLike) -> Floats:
        return finite(name, checked_array(name, values, np.float64, self._count, 3))


class SurfaceMap:
    """A map between two meshes, along which data travels.

    Faces of the target, of any number of corners, are given as `corner_vertices` (corners,), the vertices of
    one face after the other, and `face_starts` (faces + 1,): the corners of face i are `face_starts[i]` to
    `face_starts[i + 1]`. Triangles (m, 3) are ``triangles.ravel()`` with ``3 * np.arange(m + 1)``.

    Parameters
    ----------
    source, target : Shape, or (vertices (n, 3), triangles (m, 3))
    faces : (n_target,) array of int
        For each target vertex its source triangle, as in `Correspondence`.
    barycentric : (n_target, 3) array of float
        The weights of that triangle's corners.
    confidence : (n_target,) array of float, optional
        In [0, 1], by default 1 everywhere.

    Raises
    ------
    ArgumentError
        When an array has the wrong shape or values, as from all methods.
    MeshError
        When a mesh has no usable surface.
    """

    def __init__(
        self,
        source: Mesh,
        target: Mesh,
        faces: ArrayLike,
        barycentric: ArrayLike,
        confidence: ArrayLike | None = None,
    ) -> None:
        source, target = mesh_of("source", source, copy=False), mesh_of("target", target, copy=False)
        self._source_count, self._target_count = len(source[0]), len(target[0])
        self._source_triangles, self._target_triangles = len(source[1]), len(target[1])
        if confidence is None:
            confidence = np.ones(self._target_count)
        faces = checked_array("faces", faces, np.int64, self._target_count)
        barycentric = checked_array("barycentric", barycentric, np.float64, self._target_count, 3)
        confidence = checked_array("confidence", confidence, np.float64, self._target_count)
        check_weights(barycentric, confidence)
        self._core = _core.SurfaceMap(*source, *target, faces, barycentric, confidence)

    @classmethod
    def of(cls, correspondence: Correspondence, source: Mesh, target: Mesh) -> SurfaceMap:
        """The map of a `Correspondence` between the meshes, or shapes, that it was made for."""
        return cls(
            source, target, correspondence.faces, correspondence.barycentric, correspondence.confidence
        )

    @classmethod
    def _made(cls, core: _core.SurfaceMap, source: tuple[int, int], target: tuple[int, int]) -> SurfaceMap:
        """One that the core made, between meshes of so many vertices and triangles."""
        made = cls.__new__(cls)
        made._core = core
        made._source_count, made._source_triangles = source
        made._target_count, made._target_triangles = target
        return made

    @property
    def faces(self) -> Ids:
        """Source triangle of each target vertex, (n_target,).

        Parts of the target without any confidence were put onto their counterparts on the source, as eyes
        and teeth are; the rest is as given.
        """
        return self._core.faces

    @property
    def barycentric(self) -> Floats:
        """Weights of the corners of `faces`, (n_target, 3)."""
        return self._core.barycentric

    @property
    def confidence(self) -> Floats:
        """Confidence of each target vertex, (n_target,)."""
        return self._core.confidence

    @property
    def images(self) -> Floats:
        """Where each target vertex lies on the source, (n_target, 3)."""
        return self._core.images()

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """How the map turns (n_target, 3, 3) and scales (n_target,) directions of the source."""
        return self._core.frames()

    def fitting(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        stiff: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Fitting:
        """Garments that the source wears, vertices (n, 3) and triangles (m, 3), bound to both bodies.

        Several garments, such as the layers of an outfit, are given as one mesh: its pieces keep their order
        over one another. They are taken as worn in the state of the source that was matched, and come to the
        target in its own. `stiff` (n,) is true for vertices of pieces that keep their shape, such as hats and
        glasses, as those do that are smaller than some five centimetres of a person. `progress` is as in
        `match`.
        """
        vertices, faces = mesh_of("garment", (vertices, faces))
        if stiff is not None:
            stiff = checked_array("stiff", stiff, np.bool_, len(vertices))
        bodies = (self._target_count, self._target_triangles)
        return Fitting(self._core.bind(vertices, faces, stiff, progress), faces, len(vertices), bodies)

    def fit(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        distance: float | None = None,
        tightness: float = 0.0,
        collide: bool = True,
        stiff: ArrayLike | None = None,
    ) -> Floats:
        """Garments of the source, vertices (n, 3) and triangles (m, 3), as the target wears them, (n, 3).

        They follow the target's build around each of their points, keep their own shape as far as that
        allows, and stay out of the body and in their order; garments and `stiff` are as in `fitting`.
        `distance` is added to the gap to the skin, in the target's units; `tightness` takes so much of the
        gap away, 1 all of it, and below 0 widens it; with `collide` false cloth may enter the body.
        """
        bound = self.fitting(vertices, faces, stiff=stiff)
        return bound.place(distance=distance, tightness=tightness, collide=collide)

    def fit_weights(
        self, vertices: ArrayLike, faces: ArrayLike, weights: ArrayLike, *, reject_below: float = 0.0
    ) -> Floats:
        """Weights of the target's vertices for its bones (n_target, bones) at those of garments, (n, bones).

        The garments, vertices (n, 3) and triangles (m, 3), are as the source wears them. Each vertex takes
        the weights of the skin under it; with `reject_below` what lies over skin whose image is trusted less
        is filled from the rest of its garment.
        """
        weights = checked_array("weights", weights, np.float64, self._target_count, None)
        skin = _rows(finite("weights", weights))
        bound = self.fitting(vertices, faces)
        along = bound.on_target(bound.place(collide=False))
        found = along.skin_weights(*skin, weights.shape[1], reject_below=reject_below, normalize=False)
        return found.dense(weights.shape[1])

    def bones(
        self,
        source_weights: ArrayLike | SkinWeights,
        target_weights: ArrayLike | SkinWeights,
        source_parents: ArrayLike,
        target_parents: ArrayLike,
    ) -> BoneMap:
        """Which bone of the target's rig does what each bone of the source's does, by what they move.

        `source_weights` (n_source, bones) and `target_weights` (n_target, bones) are those of the two skins,
        as tables or as `SkinWeights`; `source_parents` and `target_parents` (bones,) the parent of each bone,
        −1 of a root. Two bones share C/(A₁ + A₂ − C), with C = Σ area · min(w₁, w₂) and A₁ and A₂ the
        sums Σ area · w of each. Of all assignments in which what hangs on a bone goes to what hangs on its
        partner the one that shares most is taken, so that a spine keeps its order whatever the number of its
        bones.
        """
        source = _rig("source_", source_weights, source_parents, self._source_count)
        target = _rig("target_", target_weights, target_parents, self._target_count)
        return BoneMap(*self._core.bones(source, target))

    def guided(
        self,
        source_weights: ArrayLike | SkinWeights,
        target_weights: ArrayLike | SkinWeights,
        source_parents: ArrayLike,
        target_parents: ArrayLike,
        source_heads: ArrayLike,
        target_heads: ArrayLike,
    ) -> SurfaceMap:
        """The map in which doubtful vertices lie where the rigs of both bodies put them.

        Rigs are as in `bones`; `source_heads` and `target_heads` (bones, 3) are the places where their bones
        begin, with the bodies as they are. A vertex of confidence c goes min(1, 2 (1 − c)) of the way from
        its image to where the bones put it, of which those with a partner that hold 2 % of the skin tell: a
        head that is many times as large is found by its bone. Sure vertices stay.
        """
        source = _rig("source_", source_weights, source_parents, self._source_count)
        target = _rig("target_", target_weights, target_parents, self._target_count)
        heads = [
            finite(name, checked_array(name, given, np.float64, len(rig[3]), 3))
            for name, given, rig in (
                ("source_heads", source_heads, source),
                ("target_heads", target_heads, target),
            )
        ]
        bodies = (
            (self._source_count, self._source_triangles),
            (self._target_count, self._target_triangles),
        )
        return SurfaceMap._made(self._core.guided(source, target, *heads), *bodies)

    def displacements(
        self, offsets: ArrayLike, turn_only: bool = False, *, keep_contacts: bool = True
    ) -> Floats:
        """Shape keys: displacements (n_source, 3), or of several keys (keys, n_source, 3), of the source's
        vertices from where they rest.

        They are turned and scaled as the map does around each vertex; `turn_only` keeps their length. A
        vertex whose image does not move stays exactly still. With `keep_contacts` what a key brings
        together on the source, as lids in a blink, meets on the target too: of each gap it leaves the share
        that it leaves there, or up to a quarter less. Without it, and with `turn_only`, keys are linear in
        the displacements.
        """
        offsets = checked_array("offsets", offsets, None, ...)
        if offsets.ndim == 3:
            keys = [self.displacements(key, turn_only, keep_contacts=keep_contacts) for key in offsets]
            return np.array(keys).reshape(len(keys), self._target_count, 3)
        offsets = finite("offsets", checked_array("offsets", offsets, np.float64, self._source_count, 3))
        return self._core.displacements(offsets, turn_only, keep_contacts)

    def layout(self, face_starts: ArrayLike, corner_vertices: ArrayLike, uv: ArrayLike) -> Layout:
        """A UV map, given at the corners of the source's triangles (m, 3, 2), at the target's face corners.

        `face_starts` (faces + 1,) and `corner_vertices` (corners,) are the target's faces. All corners of a
        face come from one island; beyond a seam they continue its chart.
        """
        uv = finite("uv", checked_array("uv", uv, np.float64, self._source_triangles, 3, 2))
        return Layout(*self._core.layout(*_faces(face_starts, corner_vertices), uv))

    def seam_cuts(
        self, face_starts: ArrayLike, corner_vertices: ArrayLike, uv: ArrayLike, tolerance: float = 1e-5
    ) -> SeamCuts:
        """Where seams of UVs at the corners of the source's triangles (m, 3, channels) cross the target.

        Several UV maps side by side give the seams of all. After these cuts no face straddles, except where a
        seam ends within it.
        """
        uv = finite("uv", checked_array("uv", uv, np.float64, self._source_triangles, 3, None))
        tolerance = checked_number("tolerance", tolerance)
        return SeamCuts(**self._core.seam_cuts(*_faces(face_starts, corner_vertices), uv, tolerance))

    def corner_values(
        self,
        face_starts: ArrayLike,
        corner_vertices: ArrayLike,
        values: ArrayLike,
        tolerance: float = 1e-4,
        nearest: bool = False,
    ) -> Floats:
        """Other data of face corners, (m, 3, channels): hard borders stay hard, nothing is extrapolated.

        Corner values at one vertex that differ by more than `tolerance` are a border. With `nearest` a value
        comes from one source corner, unmixed.
        """
        values = checked_array("values", values, np.float64, self._source_triangles, 3, None)
        tolerance = checked_number("tolerance", tolerance)
        return self._core.corner_values(*_faces(face_starts, corner_vertices), values, tolerance, nearest)

    def skin_weights(
        self,
        starts: ArrayLike,
        groups: ArrayLike,
        weights: ArrayLike,
        group_count: int,
        *,
        deforming: ArrayLike | None = None,
        reject_below: float = 0.0,
        smoothing: int = 0,
        prune: float = 0.0,
        limit: int | None = None,
        normalize: bool = True,
        locked: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    ) -> SkinWeights:
        """Vertex groups, given in compressed rows of the source's vertices.

        Images trusted less than `reject_below` are rejected and their vertices filled from the others;
        `smoothing` counts rounds along the surface. Weights below `prune` are dropped, of the `deforming`
        groups (all by default) at most `limit` stay, and `normalize` scales these back to the sum that came
        across. `locked` are deforming groups that the target keeps: which of the given groups are among them
        (group_count,), and their sum and number at each target vertex, (n_target,) each. The carried weights
        share what these leave of sum and limit.
        """
        group_count = checked_count("group_count", group_count)
        deforming = np.ones(group_count, bool) if deforming is None else deforming
        if locked is not None:
            try:
                which, sums, counts = locked
            except (TypeError, ValueError):
                raise ArgumentError("`locked` should be three arrays: groups, sums and counts") from None
            sums = checked_array("locked sums", sums, np.float64, self._target_count)
            locked = (
                checked_array("locked groups", which, np.bool_, group_count),
                finite("locked sums", sums),
                checked_array("locked counts", counts, np.uint32, self._target_count),
            )
        found = self._core.skin_weights(
            checked_array("starts", starts, np.uint32, self._source_count + 1),
            checked_array("groups", groups, np.uint32, None),
            checked_array("weights", weights, np.float64, None),
            group_count,
            checked_array("deforming", deforming, np.bool_, group_count),
            checked_number("reject_below", reject_below),
            checked_count("smoothing", smoothing),
            checked_number("prune", prune),
            None if limit is None else checked_count("limit", limit),
            normalize,
            locked,
        )
        return SkinWeights(*found)

    def face_labels(self, face_starts: ArrayLike, corner_vertices: ArrayLike, labels: ArrayLike) -> Ids:
        """The commonest label of the source's triangles (m,) under each target face: material slots."""
        labels = checked_array("labels", labels, np.int64, self._source_triangles)
        return self._core.face_labels(*_faces(face_starts, corner_vertices), labels)

    def face_means(self, face_starts: ArrayLike, corner_vertices: ArrayLike, values: ArrayLike) -> Floats:
        """The mean of values of the source's triangles (m, channels) under each target face."""
        values = checked_array("values", values, np.float64, self._source_triangles, None)
        return self._core.face_means(*_faces(face_starts, corner_vertices), values)

    def marks(self, source_edges: ArrayLike, values: ArrayLike, target_edges: ArrayLike) -> Floats:
        """Marks of edges as curves: values (source edges,) above 0 mark, as values (target edges,).

        An edge of the target is marked where it follows a marked curve of the source.
        """
        return self._core.marks(
            checked_array("source_edges", source_edges, np.int64, None, 2),
            checked_array("values", values, np.float64, None),
            checked_array("target_edges", target_edges, np.int64, None, 2),
        )

    def nearest_edges(self, source_edges: ArrayLike, target_edges: ArrayLike) -> Ids:
        """The source's edge from which each target edge (edges,) takes what is no curve: `values[ids]`.

        It is the nearest to the middle of the edge's image, of those that run like it.
        """
        return self._core.nearest_edges(
            checked_array("source_edges", source_edges, np.int64, None, 2),
            checked_array("target_edges", target_edges, np.int64, None, 2),
        )

    def joints(
        self, positions: ArrayLike, influence: Sequence[tuple[ArrayLike, ArrayLike]] | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Joints of a rig (joints, 3) placed in the target, each by the surface around it.

        `influence` is a pair of source vertices and weights for each joint; with it only these vertices and
        their surroundings place the joint. Returns positions (joints, 3), rotations (joints, 3, 3), mirroring
        ones where the map mirrors, and scales (joints,) of the body there.
        """
        positions = finite("positions", checked_array("positions", positions, np.float64, None, 3))
        given = [((), ())] * len(positions) if influence is None else influence
        try:
            rows = [(ids, shares) for ids, shares in given]
        except (TypeError, ValueError):
            raise ArgumentError("`influence` should be a pair (vertices, weights) for each joint") from None
        if len(rows) != len(positions):
            raise ArgumentError(f"`influence` should have {len(positions)} rows, got {len(rows)}")
        vertices = [checked_array("influence", ids, np.uint32, None) for ids, _ in rows]
        weights = [
            checked_array("influence", shares, np.float64, len(ids))
            for ids, (_, shares) in zip(vertices, rows, strict=True)
        ]
        starts = np.append(0, np.cumsum([len(row) for row in vertices])).astype(np.uint32)
        return self._core.joints(
            positions,
            starts,
            np.concatenate([np.zeros(0, np.uint32), *vertices]),
            np.concatenate([np.zeros(0), *weights]),
        )

    def fit_bones(
        self,
        heads: ArrayLike,
        tails: ArrayLike,
        weights: ArrayLike | SkinWeights,
        parents: ArrayLike,
        *,
        ups: ArrayLike | None = None,
        leads: ArrayLike | None = None,
        partners: ArrayLike | None = None,
        sided: ArrayLike | None = None,
        mirrors: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> FittedBones:
        """A rig of the source fitted to the target: all its bones, from `heads` to `tails`, (bones, 3) each.

        `weights` (n_source, bones) are those of the source's skin, as a table or as `SkinWeights`, and
        `parents` (bones,) the parent of each bone, −1 of a root; `ups` (bones, 3) are directions of their z
        axes, by default any across the bone.

        Ends in one place are one joint. Joints of bones that hold the surface go where the surface around
        them takes them, as in `joints`. Other bones keep how they stand to one that is placed: with the same
        head, ending there, above them, or the nearest that they lead by a constraint (`leads` (n, 2), a bone
        and the one that it leads). What is left goes with the whole body, so that a root stays on the ground.

        `mirrors` makes the joints symmetric: the reflection (3, 3) of the source's directions and that (4, 4)
        of the target's points. `partners` (bones,) are then the bones of the other side, −1 without one.
        `sided` (bones,) tells which bones are of one side, by default those with a partner: a bone goes by
        those that it leads on its side first.
        """
        rig = _rig("", weights, parents, self._source_count)
        count = len(rig[3])
        heads, tails, ups = (
            finite(name, checked_array(name, given, np.float64, count, 3))
            for name, given in (
                ("heads", heads),
                ("tails", tails),
                ("ups", np.zeros((count, 3)) if ups is None else ups),
            )
        )
        leads = np.zeros((0, 2), np.int64) if leads is None else leads
        partners = np.full(count, -1) if partners is None else partners
        partners = checked_array("partners", partners, np.int64, count)
        found = self._core.fit_bones(
            heads,
            tails,
            ups,
            rig,
            checked_array("leads", leads, np.int64, None, 2),
            partners,
            checked_array("sided", partners >= 0 if sided is None else sided, np.bool_, count),
            None if mirrors is None else _reflections(mirrors),
        )
        return FittedBones(*found)

    def coincidence(
        self, corner_vertices: ArrayLike, triangle_corners: ArrayLike, standing: ArrayLike | None = None
    ) -> Coincidence | None:
        """Where the target lies on the source, as a piece lies on the body that it was joined to, or None.

        `standing` (4, 4) takes the source's coordinates to the target's as both stand, by default unchanged.
        Where the target does not lie on the source so, it may be moved, turned and scaled as a whole. At
        least half of its vertices have to lie within a ten-thousandth of its size.

        `corner_vertices` (corners,) are the target's faces, `triangle_corners` (m, 3) the corners of the
        triangles that fill them: a corner is looked up on its side of a hard edge. Triangles (m, 3) are
        ``triangles.ravel()`` with ``np.arange(3 * m).reshape(m, 3)``.
        """
        found = self._core.coincidence(
            checked_array("corner_vertices", corner_vertices, np.int64, None),
            checked_array("triangle_corners", triangle_corners, np.int64, None, 3),
            checked_matrix("standing", np.eye(4) if standing is None else standing, 4),
        )
        return None if found is None else Coincidence(*found)

    def followed(self, points: ArrayLike, pieces: ArrayLike | None = None) -> Floats:
        """Points beside the source (n, 3), such as those of clothes, where the target's surface takes them.

        Points with the same number in `pieces` (n,) move together, as one rigid piece of the local size, as
        eyes do; negative numbers, and all without `pieces`, leave each point to itself.
        """
        points = finite("points", checked_array("points", points, np.float64, None, 3))
        pieces = np.full(len(points), -1) if pieces is None else pieces
        return self._core.followed(points, checked_array("pieces", pieces, np.int64, len(points)))

    def strands(self, roots: ArrayLike, points: ArrayLike, strands: ArrayLike) -> Strands:
        """Hair: points (n, 3) of strands that have their roots (strands, 3) on or beside the source.

        `strands` (n,) is the strand of each point. A strand stands on the target where the map takes the
        surface under its root, and keeps its shape: it is turned and scaled as a whole, as the surface there.
        """
        roots = finite("roots", checked_array("roots", roots, np.float64, None, 3))
        points = finite("points", checked_array("points", points, np.float64, None, 3))
        strands = checked_array("strands", strands, np.uint32, len(points))
        if len(strands) and strands.max() >= len(roots):
            raise ArgumentError(f"`strands` names strand {strands.max()}, but there are {len(roots)} roots")
        return Strands(*self._core.strands(roots, points, strands))

    def bake(
        self,
        source_uv: ArrayLike,
        target_uv: ArrayLike,
        image: ArrayLike | Mapping[tuple[int, int], ArrayLike],
        width: int,
        height: int,
        *,
        margin: int = 16,
        straight_alpha: bool = True,
        extension: str = "repeat",
        closest: bool = False,
        source_triangles: ArrayLike | None = None,
        target_triangles: ArrayLike | None = None,
        tangent_frames: Sequence[ArrayLike] | None = None,
        normal_spaces: Sequence[ArrayLike] | None = None,
        progress: Progress | None = None,
    ) -> NDArray[np.float32]:
        """A texture of the source baked into the target's own layout: (height, width, 4) float32.

        UVs are given at the corners of the triangles, (m, 3, 2) each; the image (h, w, 4) has its rows from
        the bottom. Tiles are given as a mapping of (column, row), the unit of UV over which each lies, to
        images; a place outside of all shows the nearest. Images and the result have at most 8192 texels a
        side. `extension` says what shows beyond an image's borders: "repeat", "mirror", "extend" or "clip".
        `closest` takes the nearest texel instead of filtering. Numbers, which have to be finite, come through
        in the colour space in which they are; with `straight_alpha` colours count by their alpha in a
        mixture. `margin` texels extend the islands.

        `source_triangles` (m_source,) and `target_triangles` (m_target,) are true where a triangle has the
        texture, by default everywhere: it is looked up on those of the source alone, and baked over those of
        the target alone. For a tangent-space normal map give `tangent_frames`: normals (m_source, 3, 3) and
        tangents (m_source, 3, 4) of the source's triangle corners, then those of the target's; the tangent's
        fourth number is the sign of the bitangent. For a map of normals in object space, or another one that
        is the same all over, give `normal_spaces`: a matrix (3, 3) that takes the image's normals to the
        coordinates of the source's vertices, and one that takes normals in those of the target to the
        result's. `progress` is as in `match`.
        """
        width, height = checked_count("width", width, 1), checked_count("height", height, 1)
        if tangent_frames is not None and normal_spaces is not None:
            raise ArgumentError("give `tangent_frames` or `normal_spaces`, not both")
        frames = None
        if tangent_frames is not None:
            names = ("source normals", "source tangents", "target normals", "target tangents")
            if not isinstance(tangent_frames, Sequence) or len(tangent_frames) != len(names):
                raise ArgumentError(f"`tangent_frames` should be four arrays: {', '.join(names)}")
            frames = [
                finite(name, checked_array(name, values, np.float64, None, 3, 3 if "normals" in name else 4))
                for name, values in zip(names, tangent_frames, strict=True)
            ]
        spaces = None
        if normal_spaces is not None:
            if not isinstance(normal_spaces, Sequence) or len(normal_spaces) != 2:
                raise ArgumentError("`normal_spaces` should be two matrices, of source and target")
            spaces = [
                finite("normal_spaces", checked_array("normal_spaces", space, np.float64, 3, 3)).tolist()
                for space in normal_spaces
            ]
        tiles = image if isinstance(image, Mapping) else {(0, 0): image}
        used = [
            None if mask is None else checked_array(name, mask, np.bool_, count)
            for name, mask, count in (
                ("source_triangles", source_triangles, self._source_triangles),
                ("target_triangles", target_triangles, self._target_triangles),
            )
        ]
        source_uv = checked_array("source_uv", source_uv, np.float64, self._source_triangles, 3, 2)
        target_uv = checked_array("target_uv", target_uv, np.float64, self._target_triangles, 3, 2)
        pixels, _ = self._core.bake(
            finite("source_uv", source_uv),
            finite("target_uv", target_uv),
            [
                (_cell(cell), finite("image", checked_array("image", pixels, np.float32, None, None, 4)))
                for cell, pixels in tiles.items()
            ],
            width,
            height,
            # A larger one would fill nothing more.
            min(checked_count("margin", margin), max(width, height)),
            straight_alpha,
            extension,
            closest,
            (used[0], used[1]),
            frames,
            spaces,
            progress,
        )
        return pixels

    def filled(self, values: ArrayLike, unknown: ArrayLike) -> Floats:
        """Values of the target's vertices (n_target, channels) with `unknown` ones filled from the others."""
        values = checked_array("values", values, np.float64, self._target_count, None)
        return self._core.filled(values, checked_array("unknown", unknown, np.bool_, self._target_count))


def _faces(starts: ArrayLike, vertices: ArrayLike) -> tuple[Ids, Ids]:
    return (
        checked_array("face_starts", starts, np.int64, None),
        checked_array("corner_vertices", vertices, np.int64, None),
    )


def _rows(table: Floats) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Floats]:
    """Starts, columns and numbers of what is not zero in a table, row by row."""
    rows, columns = np.nonzero(table)
    starts = np.searchsorted(rows, np.arange(len(table) + 1)).astype(np.uint32)
    return starts, columns.astype(np.uint32), table[rows, columns]


def _rig(
    of: str, weights: ArrayLike | SkinWeights, parents: ArrayLike, count: int
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Floats, Ids]:
    """Rows of weights of so many vertices, checked, and parents of their bones; `of` begins their names."""
    parents = checked_array(f"{of}parents", parents, np.int64, None)
    name = f"{of}weights"
    if not isinstance(weights, SkinWeights):
        table = finite(name, checked_array(name, weights, np.float64, count, len(parents)))
        return (*_rows(table), parents)
    starts = checked_array(name, weights.starts, np.uint32, count + 1)
    bones = checked_array(name, weights.groups, np.uint32, None)
    return starts, bones, checked_array(name, weights.weights, np.float64, None), parents


def _reflections(
    mirrors: tuple[ArrayLike, ArrayLike],
) -> tuple[list[list[float]], list[list[float]]]:
    try:
        directions, points = mirrors
    except (TypeError, ValueError):
        raise ArgumentError("`mirrors` should be two matrices, (3, 3) and (4, 4)") from None
    return checked_matrix("mirrors[0]", directions, 3), checked_matrix("mirrors[1]", points, 4)


def _cell(tile: Any) -> tuple[int, int]:
    try:
        column, row = (operator.index(number) for number in tile)
    except (TypeError, ValueError):
        raise ArgumentError(f"tile {tile!r} should be (column, row), two whole numbers") from None
    if max(abs(column), abs(row)) > _LARGEST_CELL:
        raise ArgumentError(f"tile {tile!r} lies too far out")
    return column, row


def judge_layout(corners: ArrayLike, uv: ArrayLike) -> dict[str, float]:
    """Faults of a UV map, from the corners (m, 3, 3) of triangles and their UVs (m, 3, 2).

    "stretch": mean over the surface of the larger of σ₁ and 1/σ₂ at equal areas, 1 at best; "flipped": share
    of the UV area wound against the rest; "overlap": share of the covered texels that are covered twice.
    """
    corners = finite("corners", checked_array("corners", corners, np.float64, None, 3, 3))
    uv = finite("uv", checked_array("uv", uv, np.float64, len(corners), 3, 2))
    return _core.judge_layout(corners, uv)


def uv_islands(vertices: ArrayLike, triangles: ArrayLike, uv: ArrayLike) -> Ids:
    """Number of the UV island of each triangle, from the UVs of its corners (m, 3, 2)."""
    vertices = checked_array("vertices", vertices, np.float64, None, 3)
    triangles = checked_array("triangles", triangles, np.int64, None, 3)
    uv = finite("uv", checked_array("uv", uv, np.float64, len(triangles), 3, 2))
    return _core.uv_islands(vertices, triangles, uv)
