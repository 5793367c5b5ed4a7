"""Matching of two shapes."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from numpy.typing import ArrayLike

from . import _core, memory
from .correspondence import Correspondence
from .errors import ArgumentError, MeshError
from .shape import Ids, Progress, Shape, check_choice, checked_threads, mesh_of

METHODS = ("auto", "paper", "gmds", "functional-map")
PARTS = (
    "geodesic",
    "orientation",
    "extrinsic",
    "detour",
    "rigid",
    "descriptors",
    "search",
    "vote",
    "upsampling",
    "symmetry",
    "retry",
    "wide",
    "standing",
    "turned",
    "located",
    "narrow",
    "in_place",
    "fingers",
    "sliding",
    "convexity",
    "overlap",
    "relocation",
    "uncovered",
    "detail",
)
"""Parts of the automatic method that can be left out."""
AUTOMATIC_ONLY = ("landmarks", "part", "mirror", "same_axes", "without")
"""Options that the other methods have no use for."""


def match(
    source: Shape | tuple[ArrayLike, ArrayLike],
    target: Shape | tuple[ArrayLike, ArrayLike],
    *,
    landmarks: Iterable[tuple[int, int]] = (),
    method: Literal["auto", "paper", "gmds", "functional-map"] = "auto",
    part: Literal["source", "target"] | None = None,
    mirror: Literal["forbid", "allow"] = "forbid",
    same_axes: bool = False,
    without: Iterable[str] = (),
    progress: Progress | None = None,
    threads: int | None = None,
    seed: int = 0,
) -> Correspondence:
    """Dense correspondence from every vertex of `target` to a point of `source`, fully automatic.

    Parameters
    ----------
    source, target : Shape, or (vertices (n, 3), triangles (m, 3))
        The source carries the data, the target receives it.
    landmarks : sequence of (source_vertex, target_vertex)
        Known pairs; a target vertex has one source vertex.
    method : {"auto", "paper", "gmds", "functional-map"}
        Our best; the published algorithm from an automatic initialisation; or, to compare with,
        multidimensional scaling of sampled points and a functional map from descriptors. Only the
        first takes `landmarks`, `part`, `mirror`, `same_axes` and `without`, and judges its map.
    part : {None, "source", "target"}
        Which shape is a part of the other: then only its own points ask for an image while the map
        is sought. ``None`` finds out: parts are tried where the map between wholes is poor.
    mirror : {"forbid", "allow"}
        Whether a map that exchanges left and right may be chosen.
    same_axes : bool
        Whether left, front and up are the same directions on both shapes. Tells the sides of a character
        apart that is symmetric to the last vertex; harms shapes that lie differently in space.
    without : sequence of str
        Parts of the automatic method that are not used, to see what they contribute.
    progress : callable, optional
        ``progress(stage, fraction)``; returning ``False`` cancels.
    threads : int, optional
        Worker threads, at most 1024; the result does not depend on them.
    seed : int
        The method draws no random numbers; kept so that calls stay valid when one does.

    Returns
    -------
    Correspondence

    Raises
    ------
    ArgumentError
        When an argument has the wrong shape, type or value, or the method does not take it.
    MeshError
        When a mesh has no usable surface; the words begin with "source: " or "target: ".
    MatchError
        When no plausible map was found, or a spectrum cannot be computed, as with needle triangles.
    NotEnoughMemory
        When the meshes are too large for the memory that is free.
    Cancelled
    """
    check_choice("method", method, METHODS)
    check_choice("part", part, (None, "source", "target"))
    check_choice("mirror", mirror, ("forbid", "allow"))
    try:
        operator.index(seed)
    except TypeError:
        raise ArgumentError(f"`seed` should be a whole number, got {seed!r}") from None
    threads = checked_threads(threads)
    sides = [_side(name, s) for name, s in (("source", source), ("target", target))]
    counts = [len(vertices) for vertices, _, _ in sides]
    pairs, without = _pairs(landmarks, counts), listed("without", without)
    check_method(
        method,
        {"landmarks": pairs, "part": part, "mirror": mirror, "same_axes": same_axes, "without": without},
    )
    source_core, target_core = (side[2] for side in sides)
    # Both are prepared at the same time.
    if unprepared := [c for c in (source_core, target_core) if not isinstance(c, _core.PreparedShape)]:
        try:
            memory.require_to_prepare(*unprepared)
        except MeshError:
            _check_each(source=source_core, target=target_core)
            raise
    memory.require_to_match(source_core, target_core)
    raw = _core.match_pair(
        source_core,
        target_core,
        method,
        mirror,
        part,
        pairs,
        bool(same_axes),
        without,
        progress,
        threads,
    )
    return Correspondence._from_core(raw, sides[0][1], counts[0])


def check_method(method: str, options: Mapping[str, Any]) -> None:
    """Raises `ArgumentError` for an option that is given though the method would ignore it."""
    for name in AUTOMATIC_ONLY:
        if method != "auto" and options.get(name) and options[name] != "forbid":
            raise ArgumentError(f'`{name}` is for the method "auto" alone: leave it out with "{method}"')


def _check_each(**meshes: Any) -> None:
    """Raises `MeshError` for the first mesh, prepared or not, that has no usable surface, with its name."""
    for name, mesh in meshes.items():
        if not isinstance(mesh, _core.PreparedShape):
            try:
                _core.checked_size(*mesh)
            except MeshError as error:
                raise MeshError(f"{name}: {error}") from error


def _side(name: str, shape: Any) -> tuple[Any, Ids, Any]:
    """(vertices, faces, what the core takes)"""
    arrays = mesh_of(name, shape)
    return *arrays, shape._core if isinstance(shape, Shape) else arrays


def listed(name: str, values: Any) -> list[Any]:
    """The values of an option that is a sequence, or `ArgumentError` names it."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ArgumentError(f"`{name}` should be a sequence, got {values!r}")
    return list(values)


def _pairs(landmarks: Iterable[Any], counts: list[int]) -> list[tuple[int, int]]:
    pairs: list[Any] = []
    images: dict[int, int] = {}
    for entry in listed("landmarks", landmarks):
        try:
            pair = tuple(operator.index(v) for v in entry)
        except TypeError:
            raise ArgumentError(f"landmark {entry!r} should be (source_vertex, target_vertex)") from None
        if len(pair) != 2 or not all(0 <= v < n for v, n in zip(pair, counts, strict=True)):
            raise ArgumentError(
                f"landmark {entry!r} should be (source_vertex, target_vertex) below {tuple(counts)}"
            )
        image, vertex = pair
        if images.setdefault(vertex, image) != image:
            raise ArgumentError(
                f"landmarks give target vertex {vertex} two source vertices, {images[vertex]} and {image}: "
                "leave one out"
            )
        pairs.append(pair)
    return pairs
