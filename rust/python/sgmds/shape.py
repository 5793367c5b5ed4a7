"""A surface prepared for matching."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Callable
from dataclasses import dataclass
from types import EllipsisType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from . import _core, archive, memory
from .errors import ArgumentError, MeshError, SgmdsError

FORMAT = "sgmds-shape"
VERSION = 5
"""2: distances in single precision, large meshes simplified, another operator where a mesh is not regular;
3: small meshes cut finer; 4: meshes above 9,000 vertices simplified, unevenly; 5: a checksum over all
arrays."""
METRICS = ("euclidean", "scale-invariant")
SMALLEST = 1e-140
"""Extent below which areas and eigenvalues leave the range of numbers, as they do above its inverse."""
LARGEST_COUNT = 2**63 - 1
"""What the core can count to."""
MOST_THREADS = 1024
"""As many as Blender uses. Starting them takes seconds already, and minutes when there are ten times more."""
PARTS = ("values", "functions", "farthest", "fields")


Floats = NDArray[np.float64]
Ids = NDArray[np.int64]
Progress = Callable[[str, float], bool | None]
"""Called with the stage's name and the fraction done (0…1); returning `False` cancels."""


def checked_mesh(vertices: ArrayLike, faces: ArrayLike, copy: bool = True) -> tuple[Floats, Ids]:
    """Read-only (n, 3) float64 and (m, 3) int64 arrays, or an error that names the argument.

    Without `copy` they may share the caller's memory: for a caller who does not keep them.
    """
    _check_unmasked(vertices=vertices, faces=faces)
    try:
        vertices, faces = np.asarray(vertices), np.asarray(faces)
    except ValueError as error:
        raise ArgumentError(
            f"`vertices` should be (n, 3) and `faces` (m, 3); cut polygons into triangles ({error})"
        ) from error
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ArgumentError(f"`vertices` should be (n, 3), got {vertices.shape}")
    if vertices.dtype.kind not in "fiu":
        raise ArgumentError(f"`vertices` should be numbers, got {vertices.dtype}")
    if faces.size == 0:
        faces = np.zeros((0, 3), np.int64)
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ArgumentError(f"`faces` should be (m, 3), got {faces.shape}; cut polygons into triangles")
    if faces.dtype.kind not in "iu":
        raise ArgumentError(f"`faces` should be integers, got {faces.dtype}")
    # What was computed from a mesh must not change with the caller's arrays, nor these become read-only.
    own = np.array if copy else np.asarray
    mesh = own(vertices, np.float64, order="C").view(), own(faces, np.int64, order="C").view()
    for array in mesh:
        array.flags.writeable = False
    with np.errstate(over="ignore"):
        extent = np.ptp(mesh[0], axis=0).max() if len(vertices) and np.isfinite(mesh[0]).all() else 0.0
    if extent and not SMALLEST < extent < 1 / SMALLEST:
        raise MeshError(f"the mesh is {extent:g} units large, its area no number: scale it to a usual size")
    return mesh


def mesh_of(name: str, mesh: Any, copy: bool = True) -> tuple[Floats, Ids]:
    """Vertices and faces of a `Shape` or a pair of arrays, as `checked_mesh`; errors begin with `name`."""
    if isinstance(mesh, Shape):
        return mesh.vertices, mesh.faces
    try:
        vertices, faces = mesh
    except (TypeError, ValueError):
        raise ArgumentError(f"`{name}` should be a Shape or (vertices, faces)") from None
    try:
        return checked_mesh(vertices, faces, copy)
    except (ArgumentError, MeshError) as error:
        raise type(error)(f"{name}: {error}") from error


def checked_array(
    name: str, values: ArrayLike, dtype: DTypeLike, *shape: int | EllipsisType | None
) -> NDArray[Any]:
    """A contiguous array of the shape, or an error that names it.

    In the shape None stands for any length, ... at its end for any further dimensions; without a type it
    keeps its own.
    """
    _check_unmasked(**{name: values})
    try:
        given = np.asarray(values)
        if given.dtype.kind not in "biufO":
            raise TypeError(f"got {given.dtype}")
        with np.errstate(invalid="ignore"):
            array = np.ascontiguousarray(given, dtype)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"`{name}` should be an array of numbers: {error}") from error
    if shape[-1:] == (...,):
        shape = (*shape[:-1], *[None] * (array.ndim - len(shape) + 1))
    fits = array.ndim == len(shape) and all(w in (None, f) for w, f in zip(shape, array.shape, strict=False))
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise ArgumentError(f"`{name}` should be ({wanted}), got {array.shape}")
    if array.dtype.kind in "iu" and array.dtype != given.dtype and not np.array_equal(array, given):
        least = ", none below 0" if array.dtype.kind == "u" else ""
        raise ArgumentError(f"`{name}` should be whole numbers{least}")
    return array


def finite(name: str, array: NDArray[Any]) -> NDArray[Any]:
    """The array, or an error that names the first place at which it is not finite."""
    if not np.isfinite(array).all():
        place = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        raise ArgumentError(f"`{name}` should be finite, but is {array[place]} at {place}")
    return array


def checked_matrix(name: str, given: ArrayLike, size: int) -> list[list[float]]:
    """The rows of a square matrix of finite numbers, or an error that names it."""
    rows: list[list[float]] = finite(name, checked_array(name, given, np.float64, size, size)).tolist()
    return rows


def _check_unmasked(**arrays: ArrayLike) -> None:
    """Raises `ArgumentError` for masked entries: what lies under a mask would be taken for data."""
    for name, array in arrays.items():
        if isinstance(array, np.ma.MaskedArray) and np.any(array.mask):
            raise ArgumentError(f"`{name}` has masked entries: fill them, or leave them out")


def checked_count(name: str, value: Any, least: int = 0, most: int = LARGEST_COUNT) -> int:
    """A whole number from `least` to `most`, or an error that names the argument."""
    try:
        count = operator.index(value)
    except TypeError:
        raise ArgumentError(f"`{name}` should be a whole number, got {value!r}") from None
    if count < least:
        raise ArgumentError(f"`{name}` should be {least} or more, got {count}")
    if count > most:
        raise ArgumentError(f"`{name}` should be {most} or less, got {count}")
    return count


def check_choice(name: str, value: Any, choices: tuple[Any, ...]) -> None:
    """Raises `ArgumentError` for a value that is none of the choices."""
    if value not in choices:
        raise ArgumentError(f"`{name}` should be one of {choices}, got {value!r}")


def checked_number(name: str, value: Any) -> float:
    """A finite number, or an error that names the argument."""
    try:
        finite = math.isfinite(value)
    except (TypeError, OverflowError):
        finite = False
    if not finite:
        raise ArgumentError(f"`{name}` should be a finite number, got {value!r}")
    return float(value)


def checked_threads(threads: Any) -> int | None:
    return None if threads is None else checked_count("threads", threads, 1, MOST_THREADS)


@dataclass(frozen=True)
class Figure:
    """How a mesh of whatever pieces became one surface."""

    welded: int
    """Vertices that were joined to another at the same place."""
    pieces: int
    """Connected pieces after that."""
    envelope: bool
    """Whether the closed envelope of all pieces is matched, as no piece carries nearly all that is seen."""
    handles: int
    """Handles of the envelope; 0 without one."""
    seen: float
    """Share of the area visible from outside that lies on what is matched."""


class Shape:
    """All per-shape work of a match: spectrum, samples, distances, descriptors.

    Reusable for many pairs. Public arrays are in the mesh's own units and numbering; vertices that
    were dropped (loose ones, smaller components) have zero mass and zero eigenfunctions.

    A mesh of more than 9,000 vertices is matched through a simplified one, one of fewer than 2,000
    through a finer one of the same surface. Public arrays are
    nevertheless those of the given mesh; eigenvalues, eigenfunctions, geodesics and the distance
    operator are then computed when one of them is first asked for.

    Parameters
    ----------
    vertices : (n, 3) array of float
    faces : (m, 3) array of int
        Triangles, 0-based. Both are copied: changing them later changes nothing here.
    metric : {"euclidean", "scale-invariant"}
        Lengths as in space, or times √|K|, K the Gaussian curvature, which no change of scale of
        the whole or of a part alters: for shapes with parts of other proportions (a large head).
        Then lengths have no unit. Both shapes of a match should have the same metric.
    progress : callable, optional
        ``progress(stage, fraction)``; returning ``False`` cancels.
    threads : int, optional
        Worker threads, at most 1024; the result does not depend on them.

    Raises
    ------
    ArgumentError
        When an argument has the wrong shape, type or value.
    MeshError
        When the mesh has no usable surface.
    MatchError
        When its spectrum cannot be computed, as with needle triangles.
    NotEnoughMemory
        When the mesh is too large for the memory that is free.
    Cancelled
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        metric: str = "euclidean",
        progress: Progress | None = None,
        threads: int | None = None,
    ) -> None:
        check_choice("metric", metric, METRICS)
        self.vertices, self.faces = checked_mesh(vertices, faces)
        threads = checked_threads(threads)
        memory.require_to_prepare((self.vertices, self.faces))
        self._core = _core.prepare(self.vertices, self.faces, metric, progress, threads)
        self._kept: dict[str, NDArray[Any]] = {}

    def _array(self, name: str) -> NDArray[Any]:
        if name not in self._kept:
            self._kept[name] = getattr(self._core, name)
        return self._kept[name]

    def _spectral(self, name: str) -> Floats:
        if name not in self._kept:
            if self._core.working_vertices < self._core.checked_size[0]:
                memory.require_for_spectrum(self._core)
            self._kept.update(self._core.public_arrays())
        return self._kept[name]

    @property
    def metric(self) -> str:
        """How lengths are measured: "euclidean" or "scale-invariant"."""
        return self._core.metric

    @property
    def eigenvalues(self) -> Floats:
        """(k,) smallest eigenvalues of the Laplace–Beltrami operator, in 1/length²."""
        return self._spectral("eigenvalues")

    @property
    def eigenfunctions(self) -> Floats:
        """(n, k) eigenfunctions, ``Φᵀ A Φ = I`` with ``A = diag(mass)``."""
        return self._spectral("eigenfunctions")

    @property
    def mass(self) -> Floats:
        """(n,) lumped mixed-Voronoi areas."""
        return self._array("mass")

    @property
    def samples(self) -> Ids:
        """(s,) farthest-point sample vertices from which distances were marched."""
        return self._array("samples")

    @property
    def geodesics(self) -> Floats:
        """(s, s) geodesic distances between the samples, in length units."""
        return self._spectral("geodesics")

    @property
    def distance_operator(self) -> Floats:
        """(q, q) matrix α with ``D ≈ Φ α Φᵀ`` over the first q eigenfunctions."""
        return self._spectral("distance_operator")

    @property
    def figure(self) -> Figure:
        """What was done to match the mesh as one figure."""
        return Figure(**self._core.made)

    @property
    def report(self) -> dict[str, int]:
        """What was ignored or mended when the mesh was read, as counts.

        `zero_area_faces`, `duplicate_faces` and `isolated_vertices`, which belong to no face, were left out;
        so were `dropped_components`, connected parts but for the largest, with `dropped_component_vertices`
        in all. `stray_vertices`, far out over a narrow foot, were taken to be between their neighbours.
        `bridging_faces` have no area and were kept since they close the surface; `flipped_faces`
        were turned round. `nonmanifold_edges`, of more than two faces, and `boundary_edges`, of one, are
        told only.
        """
        return self._core.report

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an .npz that `load` reads; an earlier one is replaced when the new one is complete.

        Raises
        ------
        OSError
            When it cannot be written, or a file is there that this package did not write: that one stays.
        """
        arrays: dict[str, Any] = {
            "vertices": self.vertices,
            "faces": self.faces,
            "metric": np.array(self.metric),
            **self._core.parts,
        }
        arrays[archive.CHECKSUM] = archive.checksum(arrays)
        # Packing would save 4 % of the bytes and take as long as preparing the shape.
        archive.write(path, FORMAT, VERSION, compressed=False, **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads what `save` wrote.

        Raises
        ------
        SgmdsError
            When the file is not ours, of another version, or damaged: its checksum covers every array, so
            that no array counts that was saved with others.
        """
        names = ("vertices", "faces", "metric", *PARTS)
        arrays = archive.read(path, FORMAT, VERSION, (*names, archive.CHECKSUM))
        told = str(arrays[archive.CHECKSUM])
        if archive.checksum({name: arrays[name] for name in names}) != told:
            raise SgmdsError(f"{path}: damaged, its arrays are not those of its checksum: make it again")
        shape = cls.__new__(cls)
        try:
            shape.vertices, shape.faces = checked_mesh(arrays["vertices"], arrays["faces"], copy=False)
            shape._core = _core.restore(
                shape.vertices,
                shape.faces,
                str(arrays["metric"]),
                *(np.ascontiguousarray(arrays[name]) for name in PARTS),
            )
        except (SgmdsError, TypeError, ValueError, OverflowError) as error:
            raise SgmdsError(f"{path}: damaged ({error}): make it again") from error
        shape._kept = {}
        return shape

    def __repr__(self) -> str:
        return f"Shape({len(self.vertices)} vertices, {len(self.faces)} faces)"
