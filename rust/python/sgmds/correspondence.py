"""A dense map from the vertices of a target to points of a source."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core, archive
from .errors import ArgumentError, SgmdsError
from .shape import Floats, Ids, Progress

FORMAT = "sgmds-correspondence"
VERSION = 1
ARRAYS = ("faces", "barycentric", "vertices", "confidence")


@dataclass(frozen=True)
class Quality:
    """How far a whole map can be trusted."""

    grade: str
    """"green" (use it), "amber" (look first) or "red" (probably wrong)."""
    reasons: list[str]
    """The reasons in words."""
    figures: dict[str, Any] = field(default_factory=dict)
    """The figures behind them."""


class Correspondence:
    """For every target vertex one point of the source surface."""

    faces: Ids
    """(n_target,) source triangle holding the image."""
    barycentric: Floats
    """(n_target, 3) weights in that triangle, non-negative, summing to 1."""
    vertices: Ids
    """(n_target,) nearest source vertex of that point."""
    confidence: Floats
    """(n_target,) in [0, 1]."""
    quality: Quality
    """Grade, reasons, figures."""

    def __init__(
        self, arrays: Mapping[str, Any], quality: Quality, raw: _core.RawMatch | None = None
    ) -> None:
        for name in ARRAYS:
            setattr(self, name, arrays[name])
        self._functional_map: Floats | None = arrays.get("functional_map")
        self._triangles = arrays["triangles"]
        self._source_count = int(arrays["source_count"])
        self.quality = quality
        self._raw = raw
        self._alternatives: dict[int, Self] = {}

    @classmethod
    def _from_core(cls, raw: _core.RawMatch, triangles: Ids, source_count: int) -> Self:
        arrays: dict[str, Any] = {name: getattr(raw, name) for name in ARRAYS}
        if raw.knows_functional_map:
            arrays["functional_map"] = raw.functional_map()
        figures = raw.quality
        grade = figures.pop("grade", "amber")
        reasons = figures.pop("reasons", ["the published method does not judge its map"])
        arrays.update(triangles=triangles, source_count=source_count)
        return cls(arrays, Quality(grade, reasons, figures), raw)

    @property
    def functional_map(self) -> Floats:
        """(k_target, k_source) coefficients on source → coefficients on target, both in the shapes'
        public eigenfunctions. For a mesh of fewer than 2,000 or more than 20,000 vertices these are computed
        when this is first asked for; a file saved before that has no functional map between large ones."""
        if self._functional_map is None:
            if self._raw is None:
                raise SgmdsError("the file has no functional map, since none had been asked for: match again")
            self._functional_map = self._raw.functional_map()
        return self._functional_map

    @property
    def alternative_count(self) -> int:
        """How many other plausible maps were found; after loading none are left."""
        return self._raw.alternative_count if self._raw is not None else 0

    def alternative(
        self, index: int, *, progress: Progress | None = None, threads: int | None = None
    ) -> Self:
        """One of the other plausible maps, 0 the best of them; completed when first asked for.

        `progress` and `threads` are those of `match`.
        """
        if self._raw is None or not 0 <= index < self.alternative_count:
            raise ArgumentError(f"`index` should be below {self.alternative_count}, got {index}")
        if index not in self._alternatives:
            raw = self._raw.alternative(index, progress, threads)
            self._alternatives[index] = self._from_core(raw, self._triangles, self._source_count)
        return self._alternatives[index]

    @property
    def alternatives(self) -> list[Self]:
        """The other plausible maps found, best first; completed when first asked for."""
        return [self.alternative(index) for index in range(self.alternative_count)]

    def transfer(self, values: ArrayLike) -> NDArray[np.float64]:
        """Carries (n_source, ...) values to (n_target, ...), linear within source triangles."""
        values = np.asarray(values)
        if values.ndim == 0 or len(values) != self._source_count:
            raise ArgumentError(f"`values` should have {self._source_count} rows, got {values.shape}")
        flat = np.ascontiguousarray(values.reshape(len(values), -1), np.float64)
        carried = _core.transfer_values(self.faces, self.barycentric, self._triangles, flat)
        return carried.reshape(len(self.faces), *values.shape[1:])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an .npz that numpy alone can read."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        if self._functional_map is not None or (self._raw is not None and self._raw.functional_map_is_quick):
            arrays["functional_map"] = self.functional_map
        archive.write(
            path,
            FORMAT,
            VERSION,
            **arrays,
            triangles=self._triangles,
            source_count=self._source_count,
            grade=self.quality.grade,
            reasons=np.array(self.quality.reasons, dtype=str),
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads what `save` wrote; anything else is refused."""
        arrays = archive.read(
            path, FORMAT, VERSION, (*ARRAYS, "triangles", "source_count", "grade", "reasons")
        )
        found = cls(arrays, Quality(str(arrays["grade"]), [str(r) for r in arrays["reasons"]]))
        found._check(path)
        return found

    def _check(self, path: str | os.PathLike[str]) -> None:
        n, m = len(self.faces), len(self._triangles)
        shapes_fit = self.barycentric.shape == (n, 3) and self.vertices.shape == self.confidence.shape == (n,)
        if not shapes_fit or (n and (self.faces.min() < 0 or self.faces.max() >= m)):
            raise SgmdsError(f"{path}: damaged, its arrays do not fit together: make it again")
        if m and (self._triangles.min() < 0 or self._triangles.max() >= self._source_count):
            raise SgmdsError(f"{path}: damaged, a triangle names a missing vertex: make it again")

    def __repr__(self) -> str:
        return (
            f"Correspondence({len(self.faces)} target vertices, {self.quality.grade}, "
            f"mean confidence {self.confidence.mean():.2f})"
        )
