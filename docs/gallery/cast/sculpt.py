# SPDX-License-Identifier: GPL-3.0-or-later
"""Solids as signed distances, and their surfaces as meshes of quads.

A solid is a function from points (n, 3) to signed distances (n,), negative inside; lengths are metres.
Distances of blended solids are bounds, exact enough near the surface for Newton's steps.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Solid = Callable[[np.ndarray], np.ndarray]

COARSE = 4
"""Points of the fine grid between two of the coarse one, on which is found where the surface runs."""
BAND = 2.6
"""Half width of the band that is sampled finely, in steps of the coarse grid: more than its cell's
diagonal."""
DIFFERENCE = 1e-4
"""Step of the gradient's differences: far below all details, far above rounding."""
RELAXATIONS = 8
# Corners of a tetrahedron: four values give a gradient.
TETRAHEDRON = np.array([(1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1)], float)


def round_cone(start, end, first: float, second: float) -> Solid:
    """A capsule whose radius goes from `first` to `second`."""
    start, axis = np.array(start, float), np.subtract(end, start)
    long = axis @ axis

    def distance(points):
        relative = points - start
        along = np.clip(relative @ axis / long, 0.0, 1.0)
        return np.linalg.norm(relative - along[:, None] * axis, axis=1) - (first + along * (second - first))

    return distance


def ellipsoid(centre, radii, turn=None) -> Solid:
    """`turn` (3, 3) has the axes as rows. The distance is of first order near the surface."""
    centre, radii = np.array(centre, float), np.broadcast_to(np.array(radii, float), 3)

    def distance(points):
        local = points - centre if turn is None else (points - centre) @ turn.T
        near = np.linalg.norm(local / radii, axis=1)
        slope = np.linalg.norm(local / radii**2, axis=1)
        return np.where(near < 1e-6, -radii.min(), near * (near - 1.0) / np.maximum(slope, 1e-9))

    return distance


def ring(centre, normal, major: float, minor: float, squeeze=(1.0, 1.0, 1.0)) -> Solid:
    """A torus, squeezed along the axes of the world."""
    centre, normal = np.array(centre, float), np.array(normal, float) / np.linalg.norm(normal)

    def distance(points):
        local = (points - centre) / squeeze
        height = local @ normal
        outwards = np.linalg.norm(local - height[:, None] * normal, axis=1) - major
        return np.hypot(outwards, height) - minor

    return distance


def box(centre, half, rounding: float, turn=None) -> Solid:
    """A box with round edges; `turn` (3, 3) has its axes as rows."""
    centre, half = np.array(centre, float), np.array(half, float) - rounding

    def distance(points):
        local = points - centre if turn is None else (points - centre) @ turn.T
        beyond = np.abs(local) - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return outside + np.minimum(beyond.max(axis=1), 0.0) - rounding

    return distance


def tube(path, radii) -> Solid:
    """Round cones along a path (n, 3), joined softly."""
    cones = [
        round_cone(a, b, r, s) for a, b, r, s in zip(path[:-1], path[1:], radii[:-1], radii[1:], strict=True)
    ]
    return blend(0.3 * float(np.max(radii)), *cones) if len(cones) > 1 else cones[0]


def blend(softness: float, *solids: Solid) -> Solid:
    """The union, with fillets of about `softness`."""

    def distance(points):
        value = solids[0](points)
        for solid in solids[1:]:
            value = _soft_minimum(value, solid(points), softness)
        return value

    return distance


def carve(softness: float, solid: Solid, tool: Solid) -> Solid:
    """The solid without the tool."""
    return lambda points: -_soft_minimum(-solid(points), tool(points), softness)


def common(softness: float, first: Solid, second: Solid) -> Solid:
    """What both solids hold."""
    return lambda points: -_soft_minimum(-first(points), -second(points), softness)


def grown(solid: Solid, by: float) -> Solid:
    return lambda points: solid(points) - by


def bumped(solid: Solid, height: Callable[[np.ndarray], np.ndarray]) -> Solid:
    """The solid with a relief, small against its curvature."""
    return lambda points: solid(points) - height(points)


def bounded(solid: Solid, low, high, margin: float = 0.06) -> Solid:
    """The solid, asked only near the box that holds it; beyond, the way to the box."""
    low, high = np.array(low) - margin, np.array(high) + margin

    def distance(points):
        away = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
        near = away == 0.0
        away += margin
        if near.any():
            away[near] = solid(points[near])
        return away

    return distance


def ribbon(solid: Solid, centre, axes, turns, half_width: float, height: float, steps: int):
    """A band around a solid: for `steps` angles between two `turns` the surface is sought from `centre`
    outwards in the plane of the two `axes` (2, 3). Vertices and quads, open at its ends unless it goes all
    the way round."""
    first, second = np.array(axes, float)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    whole = abs(turns[1] - turns[0]) > 2 * np.pi - 1e-6
    angle = np.linspace(*turns, steps, endpoint=not whole)
    ray = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    rows = []
    for side, off in (
        (-1, -0.003),
        (-1, 0.75 * height),
        (-0.8, height),
        (0.8, height),
        (1, 0.75 * height),
        (1, -0.003),
    ):
        start = np.array(centre) + side * half_width * normal
        near, far = np.full(steps, 0.01), np.full(steps, 0.45)
        for _ in range(30):
            middle = (near + far) / 2
            inside = solid(start + middle[:, None] * ray) < off
            near, far = np.where(inside, middle, near), np.where(inside, far, middle)
        rows.append(start + near[:, None] * ray)
    vertices = np.stack(rows, axis=1)
    count = len(rows)
    k = np.arange(count - 1)
    along = np.arange(steps if whole else steps - 1)
    here, there = along[:, None] * count, ((along + 1) % steps)[:, None] * count
    quads = np.stack([here + k, there + k, there + k + 1, here + k + 1], axis=-1).reshape(-1, 4)
    vertices = vertices.reshape(-1, 3)
    # Outwards: the way of the normals has to be that of the rays.
    outwards = (normals(vertices, quads).reshape(steps, count, 3) * ray[:, None]).sum() > 0
    return vertices, quads if outwards else quads[:, ::-1]


def mirrored(solid: Solid) -> Solid:
    """The half with x > 0 on both sides."""
    return lambda points: solid(np.column_stack([np.abs(points[:, 0]), points[:, 1:]]))


def _soft_minimum(first, second, softness):
    share = np.clip(0.5 + 0.5 * (second - first) / softness, 0.0, 1.0)
    return second + share * (first - second) - softness * share * (1.0 - share)


def gradient(function: Solid, points) -> np.ndarray:
    total = np.zeros_like(points)
    for corner in TETRAHEDRON:
        total += function(points + DIFFERENCE * corner)[:, None] * corner
    return total / (4.0 * DIFFERENCE)


def laid_on(function: Solid, points, steps: int = 3) -> np.ndarray:
    """Points on the level 0 of a function, by Newton's steps along its gradient."""
    for _ in range(steps):
        slope = gradient(function, points)
        steep = np.maximum((slope**2).sum(axis=1), 0.05)
        points = points - (function(points) / steep)[:, None] * slope
    return points


def magnified(solid: Solid, view: Callable[[np.ndarray], np.ndarray], *box_and_grid):
    """As `surface`, on a grid that a map of space makes finer in places: `view` takes points of the grid's
    space to the solid's."""
    vertices, quads = surface(lambda points: solid(view(points)), *box_and_grid)
    return view(vertices), quads


def surface(solid: Solid, low, high, spacing: float, turn: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and quads (m, 4) of a solid within a box, by surface nets on a grid turned about the vertical.

    # Source
    S. Gibson, "Constrained Elastic Surface Nets", MICCAI 1998: one vertex in each cell that the surface
    crosses, relaxed along the surface.
    """
    about = np.array([(np.cos(turn), -np.sin(turn), 0), (np.sin(turn), np.cos(turn), 0), (0, 0, 1)])
    corners = np.array(
        [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    corners = corners @ about
    origin = corners.min(axis=0) - spacing
    counts = (
        COARSE * (np.ceil((corners.max(axis=0) + spacing - origin) / (COARSE * spacing)).astype(int) + 1) + 1
    )
    values = _sampled(lambda points: solid(points @ about.T), origin, counts, spacing)
    vertices, quads = _nets(values)
    vertices = (origin + spacing * vertices) @ about.T
    used, number = np.unique(quads, return_inverse=True)
    vertices, quads = vertices[used], number.reshape(-1, 4)
    for _ in range(RELAXATIONS):
        vertices = laid_on(solid, vertices + 0.5 * (means(quads, vertices) - vertices), 1)
    return laid_on(solid, vertices), quads


def _sampled(solid, origin, counts, spacing):
    """Values at all grid points: exact in a band around the surface, those of the coarse grid beyond."""
    coarse = (counts - 1) // COARSE + 1
    places = np.stack(np.meshgrid(*(np.arange(n) for n in coarse), indexing="ij"), axis=-1)
    rough = _in_blocks(solid, origin + COARSE * spacing * places.reshape(-1, 3)).reshape(coarse)
    near = [
        np.minimum((np.arange(n) + COARSE // 2) // COARSE, m - 1) for n, m in zip(counts, coarse, strict=True)
    ]
    values = rough[np.ix_(*near)]
    wanted = np.argwhere(np.abs(values) < BAND * COARSE * spacing)
    values[tuple(wanted.T)] = _in_blocks(solid, origin + spacing * wanted)
    return values


def _in_blocks(solid, points, size: int = 400_000):
    return np.concatenate([solid(points[i : i + size]) for i in range(0, len(points), size)])


def _nets(values):
    inside = values < 0.0
    cube = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    size = np.array(values.shape) - 1
    count = np.zeros(size, np.int8)
    for i, j, k in cube:
        count += inside[i : i + size[0], j : j + size[1], k : k + size[2]]
    cells = np.argwhere((count > 0) & (count < 8))
    at = values[tuple((cells[:, None] + cube).transpose(2, 0, 1))]
    total, crossings = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a in range(8):
        for b in range(a + 1, 8):
            if np.abs(cube[a] - cube[b]).sum() != 1:
                continue
            crossed = (at[:, a] < 0) != (at[:, b] < 0)
            share = np.where(crossed, at[:, a] / np.where(crossed, at[:, a] - at[:, b], 1.0), 0.0)
            total += crossed[:, None] * (cube[a] + share[:, None] * (cube[b] - cube[a]))
            crossings += crossed
    vertices = cells + total / crossings[:, None]
    number = np.full(size, -1)
    number[tuple(cells.T)] = np.arange(len(cells))
    quads = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        changed = np.argwhere(np.diff(inside.astype(np.int8), axis=axis))
        within = (changed[:, [first, second]] > 0) & (changed[:, [first, second]] < size[[first, second]])
        changed = changed[within.all(axis=1)]
        back = np.eye(3, dtype=int)
        around = [
            changed - back[first] - back[second],
            changed - back[second],
            changed,
            changed - back[first],
        ]
        quad = np.stack([number[tuple(cell.T)] for cell in around], axis=1)
        starts_inside = inside[tuple(changed.T)]
        quads.append(np.where(starts_inside[:, None], quad, quad[:, ::-1]))
    return vertices, np.concatenate(quads)


def edges(quads) -> np.ndarray:
    """Directed edges (4 m, 2)."""
    return np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)


def means(quads, vertices) -> np.ndarray:
    """The mean of each vertex's neighbours; along the border, of those on the border."""
    directed = edges(quads)
    border, on_border = border_edges(quads), np.zeros(len(vertices), bool)
    on_border[border] = True
    both = np.concatenate([directed, directed[:, ::-1]])
    both = np.concatenate([both[~on_border[both[:, 0]]], border, border[:, ::-1]])
    valence = np.maximum(np.bincount(both[:, 0], minlength=len(vertices)), 1)
    total = [np.bincount(both[:, 0], vertices[both[:, 1], i], len(vertices)) for i in range(3)]
    return np.stack(total, axis=1) / valence[:, None]


def border_edges(quads) -> np.ndarray:
    """Directed edges that only one face has."""
    directed = edges(quads)
    size = int(quads.max()) + 1
    partners = np.isin(directed[:, 0] * size + directed[:, 1], directed[:, 1] * size + directed[:, 0])
    return directed[~partners]


def trimmed(solid: Solid, region: Solid, vertices, quads) -> tuple[np.ndarray, np.ndarray]:
    """What of a surface lies where `region` is positive, its border laid onto the region's."""
    kept = quads[region(vertices)[quads].mean(axis=1) > 0.0]
    # A face that hangs on by a corner or by one edge makes no smooth hem.
    for _ in range(4):
        directed, border = edges(kept), border_edges(kept)
        size = int(kept.max()) + 1
        single = np.isin(directed[:, 0] * size + directed[:, 1], border[:, 0] * size + border[:, 1])
        kept = kept[single.reshape(-1, 4).sum(axis=1) < 3]
    used, number = np.unique(kept, return_inverse=True)
    vertices, kept = vertices[used], number.reshape(-1, 4)
    on_border = np.zeros(len(vertices), bool)
    on_border[border_edges(kept)] = True
    for _ in range(RELAXATIONS):
        vertices = vertices + 0.5 * (means(kept, vertices) - vertices)
        for _ in range(3):
            vertices[on_border] = laid_on(region, vertices[on_border], 1)
            vertices = laid_on(solid, vertices, 1)
    return vertices, kept


def hemmed(vertices, quads, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """A sheet with its border folded inwards, so that it looks as thick as that."""
    border = border_edges(quads)
    rim = np.unique(border)
    number = np.full(len(vertices), -1)
    number[rim] = len(vertices) + np.arange(len(rim))
    inner = vertices[rim] - thickness * normals(vertices, quads)[rim]
    strip = np.stack([border[:, 1], border[:, 0], number[border[:, 0]], number[border[:, 1]]], axis=1)
    return np.concatenate([vertices, inner]), np.concatenate([quads, strip])


def normals(vertices, quads) -> np.ndarray:
    crossed = np.cross(
        vertices[quads[:, 2]] - vertices[quads[:, 0]], vertices[quads[:, 3]] - vertices[quads[:, 1]]
    )
    total = np.zeros_like(vertices)
    for corner in range(4):
        np.add.at(total, quads[:, corner], crossed)
    return total / np.maximum(np.linalg.norm(total, axis=1), 1e-12)[:, None]


def joined(*meshes) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([quads + start for (_, quads), start in zip(meshes, starts, strict=False)]),
    )
