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
from .shape import Floats, Ids, Progress, checked_array, checked_count, checked_threads

FORMAT = "sgmds-correspondence"
VERSION = 1
ARRAYS = ("faces", "barycentric", "vertices", "confidence")
GRADES = ("green", "amber", "red")
WEIGHT_ROUNDING = 1e-6
"""By which weights may miss 0 or a sum of 1: they may have been kept in single precision."""


@dataclass(frozen=True)
class Quality:
    """How far a whole map can be trusted."""

    grade: str
    """"green" (use it), "amber" (look first) or "red" (probably wrong)."""
    reasons: list[str]
    """The reasons in words."""
    figures: dict[str, Any] = field(default_factory=dict)
    """The figures behind them; a saved map comes back without.

    Of every map: `unknown`, share of the target's visible area that was placed without having been matched;
    `unmatched`, target vertices that belong to no part matched, and `sgmds_energy`, 0 for isometric shapes.
    Of the automatic method: `score`, how likely the map is right, in [0, 1]; `orientation`,
    in [−1, 1], 1 where the surface never turns over; `local_distortion`, mean change of short distances over
    √area; `contradiction`, how far the map misses landmarks and common axes; `margin`, by how many times the
    best other map fits worse, at most 2; `apart`, mean distance of an alternative from the chosen map over
    √area; `agreement`, correlation of curvatures at matched points; `extrinsic_agreement`, the same of what
    distances on the surfaces do not tell of them; `mirrored_gain`, by how many times the best mirrored map
    fits better; `torn`, share of the target's area where the images of neighbours lie more than 0.15 √area
    farther apart than they. Of methods that minimise: `energy` at the end, `gradient_norm`, `steps` and
    `converged`.
    """

    @property
    def unknown(self) -> float:
        """Share of the target's visible area that was placed without being matched; nan of a saved map."""
        return float(self.figures.get("unknown", np.nan))


class Correspondence:
    """For every target vertex one point of the source surface.

    It is kept with `save` and `load`, not by pickling.
    """

    faces: Ids
    """(n_target,) source triangle holding the image."""
    barycentric: Floats
    """(n_target, 3) weights in that triangle, non-negative, summing to 1."""
    vertices: Ids
    """(n_target,) source vertex that this point belongs to most: the corner with the largest weight."""
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
        quality = Quality(figures.pop("grade"), figures.pop("reasons"), figures)
        arrays.update(triangles=triangles, source_count=source_count)
        return cls(arrays, quality, raw)

    @property
    def functional_map(self) -> Floats:
        """(k_target, k_source) coefficients on source → coefficients on target, both in the shapes'
        public eigenfunctions. For a mesh of fewer than 2,000 or more than 9,000 vertices these are computed
        when this is first asked for; a file saved before that has no functional map between large ones."""
        if self._functional_map is None:
            if self._raw is None:
                raise SgmdsError("the file has no functional map, since none had been asked for: match again")
            self._functional_map = self._raw.functional_map()
        return self._functional_map

    @property
    def alternative_count(self) -> int:
        """How many other plausible maps were found; a saved map comes back without."""
        return self._raw.alternative_count if self._raw is not None else 0

    def alternative(
        self, index: int, *, progress: Progress | None = None, threads: int | None = None
    ) -> Self:
        """One of the other plausible maps, 0 the best of them; completed when first asked for.

        `progress` and `threads` are those of `match`.
        """
        if self._raw is None or checked_count("index", index) >= self.alternative_count:
            raise ArgumentError(f"`index` should be below {self.alternative_count}, got {index}")
        threads = checked_threads(threads)
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
        values = checked_array("values", values, np.float64, self._source_count, ...)
        flat = values.reshape(len(values), -1)
        carried = _core.transfer_values(self.faces, self.barycentric, self._triangles, flat)
        return carried.reshape(len(self.faces), *values.shape[1:])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an .npz that numpy alone can read: all but the alternatives and the quality's figures.

        Raises
        ------
        OSError
            When it cannot be written, or a file is there that this package did not write: that one stays.
        """
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
        """Reads what `save` wrote; anything else is refused.

        Raises
        ------
        SgmdsError
            When the file is not ours, of another version, or damaged.
        """
        arrays = archive.read(
            path, FORMAT, VERSION, (*ARRAYS, "triangles", "source_count", "grade", "reasons")
        )
        try:
            return cls(_checked(arrays), Quality(str(arrays["grade"]), [str(r) for r in arrays["reasons"]]))
        except ArgumentError as error:
            raise SgmdsError(f"{path}: damaged, {error}: make it again") from error

    def __repr__(self) -> str:
        return (
            f"Correspondence({len(self.faces)} target vertices, {self.quality.grade}, "
            f"mean confidence {self.confidence.mean():.2f})"
        )


def is_map(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as a saved map does, which may be damaged further on."""
    return archive.kind_of(path) == FORMAT


def check_weights(barycentric: Floats, confidence: Floats) -> None:
    """Raises `ArgumentError` unless weights are non-negative and sum to 1 and confidence is in [0, 1]."""
    # Compared so that NaN fails.
    whole = np.abs(barycentric.sum(axis=1) - 1) <= WEIGHT_ROUNDING
    for name, rows, good in (
        ("barycentric", barycentric, whole & (barycentric >= -WEIGHT_ROUNDING).all(axis=1)),
        ("confidence", confidence, (confidence >= 0) & (confidence <= 1)),
    ):
        if not good.all():
            wanted = "non-negative and sum to 1" if name == "barycentric" else "in [0, 1]"
            bad = int(np.argmin(good))
            raise ArgumentError(f"`{name}` of target vertex {bad} should be {wanted}, got {rows[bad]}")


def _checked(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """The arrays of a file, or `ArgumentError` says what is wrong with them."""
    if arrays["source_count"].ndim or arrays["source_count"].dtype.kind not in "iu":
        raise ArgumentError("`source_count` should be a whole number")
    count, n = int(arrays["source_count"]), arrays["faces"].size
    forms: dict[str, tuple[Any, ...]] = {
        "triangles": (np.int64, None, 3),
        "faces": (np.int64, n),
        "barycentric": (np.float64, n, 3),
        "vertices": (np.int64, n),
        "confidence": (np.float64, n),
        "functional_map": (np.float64, None, None),
    }
    good = {name: checked_array(name, arrays[name], *form) for name, form in forms.items() if name in arrays}
    for name, limit in (("triangles", count), ("faces", len(good["triangles"])), ("vertices", count)):
        if not ((good[name] >= 0) & (good[name] < limit)).all():
            raise ArgumentError(f"`{name}` should be 0 or more and below {limit}")
    check_weights(good["barycentric"], good["confidence"])
    if not np.isfinite(good.get("functional_map", 0.0)).all():
        raise ArgumentError("`functional_map` should be finite")
    if str(arrays["grade"]) not in GRADES or arrays["reasons"].ndim != 1:
        raise ArgumentError(f"its grade should be one of {GRADES}, with a list of reasons")
    return good | {"source_count": count}
