"""The Rust core. Arrays are contiguous; only `shape.py`, `matching.py` and `correspondence.py` use it."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "PreparedShape",
    "RawMatch",
    "__version__",
    "match_pair",
    "prepare",
    "restore",
    "transfer_values",
]

__version__: str

_Floats = NDArray[np.float64]
_Ids = NDArray[np.int64]
_Progress = Callable[[str, float], object] | None

@final
class PreparedShape:
    @property
    def metric(self) -> str: ...
    @property
    def eigenvalues(self) -> _Floats: ...
    @property
    def eigenfunctions(self) -> _Floats: ...
    @property
    def mass(self) -> _Floats: ...
    @property
    def samples(self) -> _Ids: ...
    @property
    def geodesics(self) -> _Floats: ...
    @property
    def distance_operator(self) -> _Floats: ...
    @property
    def parts(self) -> dict[str, NDArray[Any]]: ...
    @property
    def vertex_count(self) -> int: ...
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
    @property
    def functional_map(self) -> _Floats: ...
    @property
    def quality(self) -> dict[str, Any]: ...
    @property
    def alternative_count(self) -> int: ...
    def alternative(self, index: int, progress: _Progress = None, threads: int | None = None) -> RawMatch: ...

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
def transfer_values(faces: _Ids, barycentric: _Floats, triangles: _Ids, values: _Floats) -> _Floats: ...
