# SPDX-License-Identifier: GPL-3.0-or-later
"""Curve, surface and text objects: small and flat ones as a whole, large ones point by point."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix

from ..typed import EnumItem, Floats, Integers, Options
from .attachment import in_source, placed
from .copies import copied
from .pieces import is_small, pieces
from .sides import rename

if TYPE_CHECKING:
    from .route import Route

# A point has no turn of its own: it takes that of its surroundings this far around.
SMALLEST_REACH = 1e-6


def carry(
    route: Route, companion: bpy.types.Object, _options: Options, _notes: list[str]
) -> tuple[Callable[[bpy.types.Object], None], Matrix | None]:
    """What writes into a copy of the companion, and the copy's place in the world if it moves as a whole."""
    if companion.mode == "EDIT":
        companion.update_from_editmode()
    data, matrix = companion.data, in_source(route, companion)
    blocks = list(data.shape_keys.key_blocks) if data.shape_keys else []
    named, _ = route.sides.of_all([block.name for block in blocks])
    points = _read(_elements(data))
    # Only Blender knows where letters are.
    outline = np.array(companion.bound_box) if companion.type == "FONT" else points.reshape(-1, 3)
    places = placed(matrix, outline)
    flat = companion.type == "FONT" or (companion.type == "CURVE" and data.dimensions == "2D")
    if flat or not len(places) or is_small(route, np.ptp(places, axis=0)):
        world = _whole(route, matrix, places) if len(places) else None
        return lambda own: _own_data(own, companion, named), world
    piece = pieces(route, places, _edges(data))
    back = np.linalg.inv(route.target_stretch)

    def moved(points: Floats) -> Floats:
        places = placed(matrix, points.reshape(-1, 3))
        return (route.map_as_seen.followed(places, piece) @ back).reshape(points.shape)

    carried = moved(points)
    carried_keys = [moved(_read(block.data)) for block in blocks]
    grown = _growth(data, points, carried)

    def write(own: bpy.types.Object) -> None:
        _own_data(own, companion, named)
        _write(_elements(own.data), _elements(data), carried, grown)
        for block, places in zip(blocks, carried_keys, strict=True):
            _write(own.data.shape_keys.key_blocks[named[block.name]].data, block.data, places, grown)
        own.data.update_tag()

    return write, None


def _whole(route: Route, matrix: Floats, places: Floats) -> Matrix:
    """The matrix in the world of what moves as one rigid piece, which reaches as far as these places."""
    centre = (places.min(axis=0) + places.max(axis=0)) / 2.0
    reach = max(float(np.linalg.norm(np.ptp(places, axis=0))) / 2.0, SMALLEST_REACH)
    axes = reach * np.eye(3)
    probes = centre + np.vstack([axes, -axes])
    moved = route.map_as_seen.followed(probes, np.zeros(len(probes), int))
    turn = np.eye(4)
    turn[:3, :3] = (moved[:3] - moved[3:]).T / (2.0 * reach)
    turn[:3, 3] = moved.mean(axis=0) - turn[:3, :3] @ centre
    return route.target_to_world @ Matrix((turn @ matrix).tolist())


def _splines(data: bpy.types.Curve) -> list[Any]:
    return [spline.bezier_points if spline.type == "BEZIER" else spline.points for spline in data.splines]


def _elements(data: bpy.types.Curve) -> list[Any]:
    return [element for spline in _splines(data) for element in spline]


def _read(elements: Iterable[Any]) -> Floats:
    """Places of control points and of their handles, (n, 3, 3); those without handles three times."""
    places = [
        [element.co[:3], getattr(element, "handle_left", element.co)[:3]]
        + [getattr(element, "handle_right", element.co)[:3]]
        for element in elements
    ]
    return np.array(places, np.float64).reshape(-1, 3, 3)


def _edges(data: bpy.types.Curve) -> Integers:
    """Connections of the places of `_read`: handles with their point, points with the next of the spline."""
    starts = np.cumsum([0, *(len(spline) for spline in _splines(data))])
    along = [np.arange(a, b - 1) for a, b in zip(starts[:-1], starts[1:], strict=True)]
    point, before = 3 * np.arange(starts[-1]), 3 * np.concatenate([np.zeros(0, int), *along])
    return np.vstack(
        [np.stack(ends, axis=1) for ends in ((point, point + 1), (point, point + 2), (before, before + 3))]
    )


def _growth(data: bpy.types.Curve, points: Floats, carried: Floats) -> Floats:
    """How much larger the spline of each control point became, (n,)."""
    sizes, grown = [len(spline) for spline in _splines(data)], []
    bounds = np.cumsum(sizes)[:-1]
    for before, after in zip(np.split(points, bounds), np.split(carried, bounds), strict=True):
        spread = [float(np.linalg.norm(each - each.mean(axis=(0, 1)))) for each in (before, after)]
        grown.append(spread[1] / spread[0] if spread[0] > 0.0 else 1.0)
    return np.repeat(grown, sizes)


def _write(elements: Iterable[Any], given: Iterable[Any], places: Floats, grown: Floats) -> None:
    for element, other, (centre, left, right), growth in zip(
        elements, given, places.tolist(), grown.tolist(), strict=True
    ):
        element.co[:3] = centre
        if hasattr(element, "handle_left"):
            element.handle_left, element.handle_right = left, right
        element.radius = other.radius * growth


def _own_data(own: bpy.types.Object, companion: bpy.types.Object, named: Mapping[str, str]) -> None:
    """Give the copy data of its own, made anew where the companion has other splines or keys since."""
    before = own.data
    if before != companion.data and _build(before) == _build(companion.data, named):
        return
    own.data = copied(companion.data)
    own.data.name = own.name
    if named:
        rename(own.data.shape_keys.key_blocks, named, own.data.shape_keys)
    if not before.users:
        bpy.data.curves.remove(before)


def _build(
    data: bpy.types.Curve, named: Mapping[str, str] | None = None
) -> tuple[list[tuple[EnumItem, int]], str, list[str]]:
    """Kinds and lengths of the splines, the text, and the names of the keys, by `named` if given."""
    keys = [block.name for block in data.shape_keys.key_blocks] if data.shape_keys else []
    splines = [
        (spline.type, len(points)) for spline, points in zip(data.splines, _splines(data), strict=True)
    ]
    return splines, getattr(data, "body", ""), [(named or {}).get(key, key) for key in keys]
