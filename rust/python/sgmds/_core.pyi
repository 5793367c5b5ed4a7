"""The Rust core. Arrays are contiguous; only the package's own modules use it."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Fitting",
    "Kernels",
    "PreparedShape",
    "RawMatch",
    "SurfaceMap",
    "__version__",
    "checked_size",
    "envelope",
    "facing",
    "fitted_turns",
    "judge_layout",
    "match_pair",
    "memory_for_spectrum",
    "memory_to_match",
    "memory_to_prepare",
    "nearest_axis",
    "polar",
    "posed_heads",
    "prepare",
    "provoke_panic",
    "restore",
    "similarity",
    "transfer_values",
    "triangulate",
    "uv_islands",
    "visible",
    "weld",
]

__version__: str

_Floats = NDArray[np.float64]
_Ids = NDArray[np.int64]
_Matrix = Sequence[Sequence[float]]
_Rig = tuple[NDArray[np.uint32], NDArray[np.uint32], _Floats, _Ids]
_Progress = Callable[[str, float], object] | None

@final
class PreparedShape:
    @property
    def metric(self) -> str: ...
    def public_arrays(self) -> dict[str, _Floats]: ...
    @property
    def mass(self) -> _Floats: ...
    @property
    def samples(self) -> _Ids: ...
    @property
    def working_vertices(self) -> int: ...
    @property
    def parts(self) -> dict[str, NDArray[Any]]: ...
    @property
    def checked_size(self) -> tuple[int, int]: ...
    @property
    def vertex_count(self) -> int: ...
    @property
    def made(self) -> dict[str, Any]: ...
    @property
    def report(self) -> dict[str, int]: ...

@final
class RawMatch:
    @property
    def faces(self) -> _Ids: ...
    @property
    def barycentric(self) -> _Floats: ...
    @property
    def vertices(self) -> _Ids: ...
    @property
    def confidence(self) -> _Floats: ...
    def functional_map(self) -> _Floats: ...
    @property
    def knows_functional_map(self) -> bool: ...
    @property
    def functional_map_is_quick(self) -> bool: ...
    @property
    def evidence(self) -> tuple[float, ...] | None: ...
    @property
    def quality(self) -> dict[str, Any]: ...
    @property
    def alternative_count(self) -> int: ...
    def alternative(self, index: int, progress: _Progress = None, threads: int | None = None) -> RawMatch: ...

@final
class Kernels:
    def __new__(cls, vertices: _Floats, faces: _Ids) -> Kernels: ...
    def eigenpairs(self, count: int) -> tuple[float, int]: ...
    def factorise(self) -> None: ...
    def bare_solves(self, count: int) -> None: ...
    def distances(self, sources: Sequence[int]) -> _Floats: ...

def prepare(
    vertices: _Floats, faces: _Ids, metric: str, progress: _Progress = None, threads: int | None = None
) -> PreparedShape: ...
def restore(
    vertices: _Floats,
    faces: _Ids,
    metric: str,
    values: NDArray[Any],
    functions: _Floats,
    farthest: NDArray[Any],
    fields: NDArray[np.float32],
) -> PreparedShape: ...
def match_pair(
    source: PreparedShape | tuple[_Floats, _Ids],
    target: PreparedShape | tuple[_Floats, _Ids],
    method: str,
    mirror: str,
    part: str | None,
    landmarks: Sequence[tuple[int, int]],
    same_axes: bool,
    without: Sequence[str],
    progress: _Progress = None,
    threads: int | None = None,
) -> RawMatch: ...
def triangulate(vertices: _Floats, corners: _Ids, sizes: _Ids) -> _Ids: ...
def memory_to_prepare(sizes: Sequence[tuple[int, int]]) -> int: ...
def memory_for_spectrum(vertices: int, faces: int) -> int: ...
def memory_to_match(source: int, target: int) -> int: ...
def checked_size(vertices: _Floats, faces: _Ids) -> tuple[int, int]: ...
def provoke_panic() -> None: ...
def weld(vertices: _Floats, faces: _Ids) -> tuple[_Floats, _Ids, _Ids, _Ids]: ...
def visible(vertices: _Floats, faces: _Ids) -> NDArray[np.float32]: ...
def envelope(
    vertices: _Floats,
    faces: _Ids,
    cells: int | None = None,
    offsets: Sequence[tuple[float, float, float]] | None = None,
    threads: int | None = None,
) -> tuple[_Floats, _Ids, dict[str, Any]]: ...
def transfer_values(faces: _Ids, barycentric: _Floats, triangles: _Ids, values: _Floats) -> _Floats: ...

@final
class Fitting:
    def place(self, distance: float, tightness: float, collide: bool) -> _Floats: ...
    def gaps(self, distance: float, tightness: float) -> _Floats: ...
    def clearance(self, positions: _Floats) -> _Floats: ...
    def clearance_before(self) -> _Floats: ...
    def displacements(self, offsets: _Floats) -> _Floats: ...
    def hidden(self, positions: _Floats, reach: float, margin: float) -> NDArray[np.bool_]: ...
    def on_target(self, positions: _Floats, triangles: _Ids) -> SurfaceMap: ...

@final
class SurfaceMap:
    def __new__(
        cls,
        source_vertices: _Floats,
        source_triangles: _Ids,
        target_vertices: _Floats,
        target_triangles: _Ids,
        faces: _Ids,
        barycentric: _Floats,
        confidence: _Floats,
    ) -> SurfaceMap: ...
    @property
    def faces(self) -> _Ids: ...
    @property
    def barycentric(self) -> _Floats: ...
    @property
    def confidence(self) -> _Floats: ...
    def images(self) -> _Floats: ...
    def frames(self) -> tuple[_Floats, _Floats]: ...
    def bind(
        self,
        vertices: _Floats,
        triangles: _Ids,
        stiff: NDArray[np.bool_] | None,
        progress: _Progress | None,
    ) -> Fitting: ...
    def bones(
        self,
        source: _Rig,
        target: _Rig,
    ) -> tuple[_Ids, _Floats, _Ids]: ...
    def guided(
        self,
        source: _Rig,
        target: _Rig,
        source_heads: _Floats,
        target_heads: _Floats,
    ) -> SurfaceMap: ...
    def displacements(self, offsets: _Floats, turn_only: bool, keep_contacts: bool) -> _Floats: ...
    def layout(
        self, starts: _Ids, corner_vertices: _Ids, uv: _Floats
    ) -> tuple[_Floats, _Ids, NDArray[np.bool_]]: ...
    def seam_cuts(
        self, starts: _Ids, corner_vertices: _Ids, values: _Floats, tolerance: float
    ) -> dict[str, NDArray[Any]]: ...
    def corner_values(
        self, starts: _Ids, corner_vertices: _Ids, values: _Floats, tolerance: float, nearest: bool
    ) -> _Floats: ...
    def skin_weights(
        self,
        starts: NDArray[np.uint32],
        groups: NDArray[np.uint32],
        weights: _Floats,
        group_count: int,
        deforming: NDArray[np.bool_],
        reject_below: float,
        smoothing: int,
        prune: float,
        limit: int | None,
        normalize: bool,
        locked: tuple[NDArray[np.bool_], _Floats, NDArray[np.uint32]] | None,
    ) -> tuple[_Ids, _Ids, _Floats, _Ids]: ...
    def face_labels(self, starts: _Ids, corner_vertices: _Ids, labels: _Ids) -> _Ids: ...
    def face_means(self, starts: _Ids, corner_vertices: _Ids, values: _Floats) -> _Floats: ...
    def marks(self, source_edges: _Ids, values: _Floats, target_edges: _Ids) -> _Floats: ...
    def nearest_edges(self, source_edges: _Ids, target_edges: _Ids) -> _Ids: ...
    def joints(
        self,
        joints: _Floats,
        starts: NDArray[np.uint32],
        vertices: NDArray[np.uint32],
        weights: _Floats,
    ) -> tuple[_Floats, _Floats, _Floats]: ...
    def fit_bones(
        self,
        heads: _Floats,
        tails: _Floats,
        ups: _Floats,
        rig: _Rig,
        leads: _Ids,
        partners: _Ids,
        sided: NDArray[np.bool_],
        mirrors: tuple[_Matrix, _Matrix] | None,
    ) -> tuple[_Floats, _Floats, _Floats, _Floats, _Floats, NDArray[np.bool_]]: ...
    def coincidence(
        self, corner_vertices: _Ids, triangle_corners: _Ids, standing: _Matrix
    ) -> tuple[_Floats, NDArray[np.bool_], _Ids, _Floats] | None: ...
    def followed(self, points: _Floats, pieces: _Ids) -> _Floats: ...
    def strands(
        self, roots: _Floats, points: _Floats, strands: NDArray[np.uint32]
    ) -> tuple[_Floats, _Floats, _Ids, _Floats, _Floats]: ...
    def bake(
        self,
        source_uv: _Floats,
        target_uv: _Floats,
        tiles: Sequence[tuple[tuple[int, int], NDArray[np.float32]]],
        width: int,
        height: int,
        margin: int,
        straight_alpha: bool,
        extension: str,
        closest: bool,
        used: tuple[NDArray[np.bool_] | None, NDArray[np.bool_] | None],
        frames: Sequence[_Floats] | None,
        spaces: Sequence[_Matrix] | None,
        progress: _Progress = None,
    ) -> tuple[NDArray[np.float32], int]: ...
    def filled(self, values: _Floats, unknown: NDArray[np.bool_]) -> _Floats: ...

def judge_layout(corners: _Floats, uv: _Floats) -> dict[str, float]: ...
def uv_islands(vertices: _Floats, triangles: _Ids, uv: _Floats) -> _Ids: ...
def similarity(points: _Floats, aims: _Floats, weights: _Floats | None) -> _Floats: ...
def polar(matrix: _Matrix) -> tuple[_Floats, _Floats]: ...
def facing(
    source: tuple[_Floats, _Floats],
    target: tuple[_Floats, _Floats],
    mirrors: bool,
    spaces: tuple[_Matrix, _Matrix],
) -> _Floats: ...
def nearest_axis(direction: Sequence[float], axes: _Floats) -> Sequence[float]: ...
def fitted_turns(
    axes: tuple[_Floats, _Floats],
    facing: _Matrix,
    parents: _Ids,
    limbs: tuple[_Floats, _Floats],
    fitted: NDArray[np.bool_],
    kept: _Floats,
) -> tuple[_Floats, _Floats]: ...
def posed_heads(
    heads: _Floats, axes: _Floats, parents: _Ids, loose: NDArray[np.bool_], turns: _Floats
) -> _Floats: ...
