"""Data carried along known maps: what must come back does, and what must not happen does not."""

import numpy as np
import pytest
import sgmds
from sgmds import characters


def sphere(rings, segments, turn=0.0):
    """A ball of triangles with poles: vertices, triangles and their UVs, cut along a meridian."""
    vertices, uv = [(0.0, 0.0, 1.0)], []
    for i in range(1, rings):
        for j in range(segments):
            polar, angle = np.pi * i / rings, 2 * np.pi * j / segments + turn
            vertices.append((np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)))
    vertices.append((0.0, 0.0, -1.0))
    faces = []
    last = len(vertices) - 1

    def ring(i, j):
        return 1 + (i - 1) * segments + j % segments

    def place(i, j):
        return (j / segments, 1.0 - i / rings)

    for j in range(segments):
        faces.append((0, ring(1, j), ring(1, j + 1)))
        uv.append((place(0, j + 0.5), place(1, j), place(1, j + 1)))
        for i in range(1, rings - 1):
            faces.append((ring(i, j), ring(i + 1, j), ring(i + 1, j + 1)))
            uv.append((place(i, j), place(i + 1, j), place(i + 1, j + 1)))
            faces.append((ring(i, j), ring(i + 1, j + 1), ring(i, j + 1)))
            uv.append((place(i, j), place(i + 1, j + 1), place(i, j + 1)))
        faces.append((last, ring(rings - 1, j + 1), ring(rings - 1, j)))
        uv.append((place(rings, j + 0.5), place(rings - 1, j + 1), place(rings - 1, j)))
    return np.array(vertices), np.array(faces), np.array(uv)


def nearest(source, target):
    """The nearest point of the source for each target vertex, by trying every triangle."""
    vertices, faces = source
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    inverse = np.linalg.pinv(np.stack([u, v], axis=-1))
    found, weights = [], []
    for point in target[0]:
        d = point - a
        s, t = np.clip(np.einsum("mij,mj->mi", inverse, d), 0, 1).T
        over = np.maximum(s + t, 1.0)
        s, t = s / over, t / over
        place = a + s[:, None] * u + t[:, None] * v
        best = np.linalg.norm(place - point, axis=1).argmin()
        found.append(best)
        weights.append((1 - s[best] - t[best], s[best], t[best]))
    return np.array(found), np.array(weights)


def polygons(faces):
    return np.arange(len(faces) + 1) * 3, faces.ravel()


def copy_map(vertices, faces, seed=0, scale=2.0):
    """A turned, scaled, renumbered copy: map, old vertex of each new one, rotation, faces of the copy."""
    rng = np.random.default_rng(seed)
    old = rng.permutation(len(vertices))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    other = np.argsort(old)[faces]
    triangle, corner = np.empty(len(vertices), int), np.empty(len(vertices), int)
    for k in range(3):
        triangle[faces[:, k]], corner[faces[:, k]] = np.arange(len(faces)), k
    way = sgmds.SurfaceMap(
        (vertices, faces), (scale * vertices[old] @ turn.T, other), triangle[old], np.eye(3)[corner[old]]
    )
    return way, old, turn, other


@pytest.fixture(scope="module")
def character():
    return characters.make("biped", "plain", "wave", resolution=2000, seed=3)


def test_displacements_turn_and_grow_with_the_body(character):
    way, old, turn, _ = copy_map(character.vertices, character.faces)
    rng = np.random.default_rng(1)
    field = rng.normal(size=character.vertices.shape)
    field[character.vertices[:, 2] < 1.0] = 0.0
    carried = way.displacements(field)
    np.testing.assert_allclose(carried, 2.0 * field[old] @ turn.T, atol=1e-9)
    still = character.vertices[old][:, 2] < 1.0
    assert still.sum() > 500
    assert (carried[still] == 0.0).all()
    assert way.displacements(field[None]).shape == (1, *carried.shape)
    np.testing.assert_allclose(way.displacements(field, turn_only=True), field[old] @ turn.T, atol=1e-9)


def test_vertices_that_an_exporter_split_move_together(character):
    """Every triangle of the target alone, as in a flat-shaded export: as on the closed surface."""
    vertices, faces = character.vertices, character.faces
    narrower = vertices * (0.8, 1.0, 1.1)
    triangle, corner = np.empty(len(vertices), int), np.empty(len(vertices), int)
    for k in range(3):
        triangle[faces[:, k]], corner[faces[:, k]] = np.arange(len(faces)), k
    field = np.random.default_rng(1).normal(size=vertices.shape)
    given = faces.ravel()
    closed = sgmds.SurfaceMap((vertices, faces), (narrower, faces), triangle, np.eye(3)[corner])
    split = sgmds.SurfaceMap(
        (vertices, faces),
        (narrower[given], np.arange(len(given)).reshape(-1, 3)),
        triangle[given],
        np.eye(3)[corner[given]],
    )
    carried = [way.displacements(field, keep_contacts=False) for way in (split, closed)]
    # The same sums in another order.
    np.testing.assert_allclose(carried[0], carried[1][given], atol=1e-9)
    # What contacts are corrected by is solved to a residual of 1e-6, of displacements of size 1.
    np.testing.assert_allclose(split.displacements(field), closed.displacements(field)[given], atol=1e-5)


def test_what_a_key_brings_together_meets_on_a_wider_body():
    """Two plates that face each other, in the target half as far apart again."""
    side = np.linspace(-1.0, 1.0, 17)
    x, y = (c.ravel() for c in np.meshgrid(side, side))
    cell = np.add.outer(17 * np.arange(16), np.arange(16)).ravel()
    low = np.concatenate(
        [np.stack([cell, cell + 1, cell + 18], 1), np.stack([cell, cell + 18, cell + 17], 1)]
    )
    faces = np.concatenate([low, low[:, ::-1] + len(x)])

    def plates(gap):
        return np.concatenate([np.stack([x, y, 0.0 * x], 1), np.stack([x, y, gap + 0.0 * x], 1)])

    triangle, corner = np.empty(2 * len(x), int), np.empty(2 * len(x), int)
    for k in range(3):
        triangle[faces[:, k]], corner[faces[:, k]] = np.arange(len(faces)), k
    way = sgmds.SurfaceMap((plates(1.0), faces), (plates(1.5), faces), triangle, np.eye(3)[corner])
    key = np.zeros((2 * len(x), 3))
    key[len(x) :, 2] = -0.98 * np.sqrt(np.maximum(1.0 - (x**2 + y**2) / 0.7, 0.0))
    # The other plate stirs at a corner: what stands still and is large takes no part.
    key[0] = -0.1, -0.1, 0.0
    middle = len(x) + len(x) // 2
    kept, plain = way.displacements(key), way.displacements(key, keep_contacts=False)
    np.testing.assert_allclose(plain, key, atol=1e-9)
    # Corrections are averaged over half an edge, a fourteenth of the way over which they fade.
    assert kept[middle, 2] == pytest.approx(-0.98 * 1.5, abs=0.03)
    np.testing.assert_array_equal(kept[(key == 0.0).all(axis=1)], 0.0)
    np.testing.assert_array_equal(way.displacements(key, turn_only=True)[middle], plain[middle])
    # Nothing meets at half of the key, which is carried as it is.
    np.testing.assert_array_equal(way.displacements(key / 2), way.displacements(key / 2, keep_contacts=False))
    both = way.displacements(np.stack([key, key]), keep_contacts=False)
    np.testing.assert_array_equal(both, np.stack([plain, plain]))


def test_a_mirrored_map_mirrors_what_it_carries(character):
    """A left half moved to the right: directions along the mirror's axis turn round, joints go across."""
    vertices, faces = character.vertices, character.faces
    mirror = np.array([-1.0, 1.0, 1.0])
    triangle, corner = np.empty(len(vertices), int), np.empty(len(vertices), int)
    for k in range(3):
        triangle[faces[:, k]], corner[faces[:, k]] = np.arange(len(faces)), k
    way = sgmds.SurfaceMap(
        (vertices, faces), (vertices * mirror, faces[:, ::-1]), triangle, np.eye(3)[corner]
    )
    field = np.random.default_rng(2).normal(size=vertices.shape)
    np.testing.assert_allclose(way.displacements(field), field * mirror, atol=1e-9)
    joints = character.body.starts
    places, turns, _ = way.joints(joints)
    np.testing.assert_allclose(places, joints * mirror, atol=1e-8)
    np.testing.assert_allclose(turns, np.broadcast_to(np.diag(mirror), turns.shape), atol=1e-8)
    piece = 0.1 * field + joints[0]
    moved = way.followed(piece, np.zeros(len(piece), int))
    np.testing.assert_allclose(moved, piece * mirror, atol=1e-8)


def strands_on(vertices, faces, count, seed=4):
    """Points of strands bent at random, the strand of each, and their roots within faces."""
    rng = np.random.default_rng(seed)
    chosen, weights = faces[rng.integers(len(faces), size=count)], rng.dirichlet(np.ones(3), size=count)
    roots = np.einsum("ik,ikc->ic", weights, vertices[chosen])
    strands = np.repeat(np.arange(count), 5)
    points = roots[strands] + 0.1 * rng.normal(size=(5 * count, 3))
    return points, strands, roots, chosen, weights


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_strands_turn_and_grow_with_the_body(character, mirror):
    vertices, faces = character.vertices, character.faces
    way, old, turn, other = copy_map(vertices, faces)
    if mirror < 0.0:
        turn = turn @ np.diag([-1.0, 1.0, 1.0])
        way = sgmds.SurfaceMap(
            (vertices, faces), (2.0 * vertices[old] @ turn.T, other[:, ::-1]), way.faces, way.barycentric
        )
    points, strands, roots, chosen, weights = strands_on(vertices, faces, 200)
    found = way.strands(roots, points, strands)
    np.testing.assert_allclose(found.points, 2.0 * points @ turn.T, atol=1e-9)
    np.testing.assert_allclose(found.scales, 2.0, rtol=1e-9)
    target = 2.0 * vertices[old] @ turn.T
    triangles = other if mirror > 0.0 else other[:, ::-1]
    places = np.einsum("ik,ikc->ic", found.barycentric, target[triangles[found.faces]])
    np.testing.assert_allclose(places, 2.0 * roots @ turn.T, atol=1e-9)
    np.testing.assert_allclose(found.confidence, 1.0, atol=1e-9)
    # What is lifted off the surface is as far from it afterwards, by the scale.
    lifted = way.strands(roots + (0.0, 0.0, 0.01), points, strands)
    np.testing.assert_allclose(lifted.points, found.points, atol=1e-9)


def test_strands_beyond_the_target_are_not_trusted():
    """The upper half of a ball has no counterpart of what grows below; one vertex is trusted by half."""
    vertices, faces, _ = sphere(24, 32)
    upper = vertices[:, 2] > -1e-9
    kept = faces[upper[faces].all(axis=1)]
    number = np.cumsum(upper) - 1
    triangle, weight = nearest((vertices, faces), (vertices[upper], None))
    trust = np.where(np.arange(upper.sum()) == 0, 0.5, 1.0)
    way = sgmds.SurfaceMap((vertices, faces), (vertices[upper], number[kept]), triangle, weight, trust)
    edge = np.pi / 24
    heights = np.array([1.0, 0.7, 0.1, -0.5 * edge, -3.0 * edge, -1.0])
    roots = np.stack([np.sqrt(1.0 - heights**2), 0.0 * heights, heights], axis=1)
    found = way.strands(roots, roots, np.arange(len(roots)))
    np.testing.assert_allclose(found.confidence, [0.5, 1, 1, 1, 0, 0], atol=1e-9)
    # All the same they stand on the rim.
    places = np.einsum("ik,ikc->ic", found.barycentric, vertices[upper][number[kept][found.faces]])
    np.testing.assert_allclose(places[-3:, 2], 0.0, atol=1e-9)


def test_uvs_come_back_on_a_copy():
    vertices, faces, uv = sphere(24, 32)
    way, _, _, other = copy_map(vertices, faces)
    layout = way.layout(*polygons(other), uv)
    np.testing.assert_allclose(layout.uv.reshape(-1, 3, 2), uv, atol=1e-9)
    assert not layout.straddles.any()


def test_no_triangle_is_wider_than_its_share_of_a_seam():
    """Around the ball u runs from 0 to 1; a triangle over the cut would be wide in u."""
    vertices, faces, uv = sphere(24, 48)
    other_vertices, other_faces, _ = sphere(17, 31, turn=0.1)
    way = sgmds.SurfaceMap(
        (vertices, faces),
        (other_vertices, other_faces),
        *nearest((vertices, faces), (other_vertices, other_faces)),
    )
    layout = way.layout(*polygons(other_faces), uv)
    found = layout.uv.reshape(-1, 3, 2)
    middle = np.abs(other_vertices[other_faces][:, :, 2]).max(axis=1) < 0.95
    # A triangle is 1/31 wide and 1/17 high.
    assert np.ptp(found[middle][:, :, 0], axis=1).max() < 1.3 / 31
    assert np.ptp(found[middle][:, :, 1], axis=1).max() < 1.3 / 17
    assert layout.straddles[middle].any()
    report = sgmds.judge_layout(other_vertices[other_faces[middle]], found[middle])
    assert report["flipped"] == 0.0
    # Beyond the cut a column of triangles may lie over the first one's texels, not more.
    assert report["overlap"] < 2 / 31


def test_faces_keep_to_one_island(character):
    """With the islands ten apart, a triangle over two of them would be at least that wide."""
    other = characters.make("biped", "plain", "wave", resolution=1500, seed=4)
    corners = character.vertices, character.faces
    target = other.vertices, other.faces
    way = sgmds.SurfaceMap(corners, target, *nearest(corners, target))
    islands = sgmds.uv_islands(character.vertices, character.faces, character.uv)
    assert islands.max() >= len(character.body.names) - 1
    apart = character.uv + 10.0 * islands[:, None, None]
    layout = way.layout(*polygons(other.faces), apart)
    found = layout.uv.reshape(-1, 3, 2)
    assert np.ptp(found, axis=1).max() < 1.0
    # UVs lie in the unit square, and extrapolation reaches a face's width beyond.
    np.testing.assert_array_equal(np.floor((found[:, 0] + 1.0) / 10.0)[:, 0], layout.island)
    assert layout.straddles.any()


def test_edges_take_after_the_nearest_that_runs_alike():
    """A grid, and edges in the middle of its squares: one lies nearer to a border that it crosses."""
    vertices = np.array([(x, y, 0.0) for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0)])
    faces = np.array([(0, 1, 3), (1, 4, 3), (1, 2, 4), (2, 5, 4)])
    edges = np.array([(0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5)])
    points = np.array([(0.5, 0.4, 0.0), (1.3, 0.4, 0.0), (0.4, 0.1, 0.0), (0.4, 0.7, 0.0)])
    source = vertices, faces
    target = points, np.array([(0, 1, 3), (1, 2, 3)])
    way = sgmds.SurfaceMap(source, target, *nearest(source, target))
    np.testing.assert_array_equal(way.nearest_edges(edges, [(0, 1), (2, 3), (1, 1)]), [0, 4, 5])
    with pytest.raises(sgmds.ArgumentError, match="edge 0 of the target"):
        way.nearest_edges(edges, [(0, 4)])


def test_marks_go_around_a_narrow_face_and_not_across_its_end():
    # Faces a tenth as wide as long; two long sides of one of them and the end between them are marked.
    across, along = np.arange(6) * 0.1, np.arange(4.0)
    vertices = np.array([(x, y, 0.0) for y in along for x in across])
    corner = np.array([6 * j + i for j in range(3) for i in range(5)])[:, None]
    mesh = vertices, np.vstack([corner + (0, 1, 7), corner + (0, 7, 6)])
    edges = np.array([(v, v + step) for step in (1, 6) for v in corner[:, 0]])
    marked = np.isin(edges, (8, 9, 14, 15)).all(axis=1) & ~(edges == (14, 15)).all(axis=1)
    assert marked.sum() == 3
    way = sgmds.SurfaceMap(mesh, mesh, *nearest(mesh, mesh))
    np.testing.assert_array_equal(way.marks(edges, marked.astype(float), edges) > 0, marked)


def test_limited_rows_sum_to_one(character):
    way, old, _, _ = copy_map(character.vertices, character.faces)
    table = character.weights
    vertex, group = np.nonzero(table)
    starts = np.append(0, np.cumsum((table > 0).sum(axis=1)))
    plain = way.skin_weights(starts, group, table[vertex, group], table.shape[1])
    np.testing.assert_allclose(plain.dense(table.shape[1]), table[old], atol=1e-12)
    few = way.skin_weights(
        starts, group, table[vertex, group], table.shape[1], limit=3, prune=0.01, smoothing=2
    )
    assert np.diff(few.starts).max() == 3
    np.testing.assert_allclose(few.dense(table.shape[1]).sum(axis=1), 1.0, atol=1e-12)


def test_carried_rows_share_what_locked_groups_leave(character):
    """Of every vertex the target keeps 0.3 in two groups, the first of which would be carried too."""
    way, old, _, _ = copy_map(character.vertices, character.faces)
    table = character.weights.copy()
    table[:, 0] = 0.25
    table /= table.sum(axis=1, keepdims=True)
    count, groups = table.shape
    vertex, group = np.nonzero(table)
    starts = np.append(0, np.cumsum((table > 0).sum(axis=1)))
    locked = np.arange(groups) == 0, np.full(count, 0.3), np.full(count, 2)
    rows = way.skin_weights(starts, group, table[vertex, group], groups, locked=locked)
    others = np.where(locked[0], 0.0, table)
    expected = 0.7 * others / others.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(rows.dense(groups), expected[old], atol=1e-12)
    few = way.skin_weights(starts, group, table[vertex, group], groups, locked=locked, limit=3)
    assert np.diff(few.starts).max() == 1
    np.testing.assert_allclose(few.dense(groups).sum(axis=1), 0.7, atol=1e-12)


def test_rejected_vertices_are_filled_between_their_neighbours(character):
    """Filled values lie within the range of the rim: the discrete maximum principle."""
    count = len(character.vertices)
    values = character.vertices[:, 2:].copy()
    unknown = np.zeros(count, bool)
    unknown[np.linalg.norm(character.vertices - character.vertices[100], axis=1) < 0.15] = True
    way, old, _, other = copy_map(character.vertices, character.faces)
    filled = way.filled(values[old], unknown[old])
    ends = np.concatenate([other[:, [0, 1]], other[:, [1, 2]], other[:, [2, 0]]])
    rim = np.unique(ends[unknown[old][ends[:, 0]] & ~unknown[old][ends[:, 1]], 1])
    inside = filled[unknown[old], 0]
    assert values[old][rim].min() <= inside.min() and inside.max() <= values[old][rim].max()
    np.testing.assert_array_equal(filled[~unknown[old]], values[old][~unknown[old]])


def test_joints_of_a_rigid_copy_are_exact(character):
    way, _, turn, _ = copy_map(character.vertices, character.faces)
    joints = character.body.starts
    rows = [(np.flatnonzero(column), column[column > 0]) for column in character.weights.T]
    for influence in (None, rows):
        places, turns, scales = way.joints(joints, influence)
        np.testing.assert_allclose(places, 2.0 * joints @ turn.T, atol=1e-8)
        np.testing.assert_allclose(turns, np.broadcast_to(turn, turns.shape), atol=1e-8)
        np.testing.assert_allclose(scales, 2.0, rtol=1e-9)


def with_the_body_in_place(character, source, target):
    """The map of meshes that begin with the character: its vertices to themselves, all others unmatched."""
    triangle, corner = np.zeros(len(target[0]), int), np.zeros(len(target[0]), int)
    numbers = np.arange(len(character.faces))
    for k in range(3):
        triangle[character.faces[:, k]], corner[character.faces[:, k]] = numbers, k
    trust = np.where(np.arange(len(target[0])) < len(character.vertices), 1.0, 0.0)
    return sgmds.SurfaceMap(source, target, triangle, np.eye(3)[corner], trust)


def test_small_parts_go_to_their_counterparts(character):
    """Two unmatched balls beside the head: each goes to its own side, though numbered the other way round."""
    vertices, faces, _ = sphere(6, 8)
    head = character.body.starts[character.body.names.index("head")]
    sides = [head + (side * 0.12, -0.3, 0.1) for side in (1.0, -1.0)]

    def with_balls(order):
        points, triangles = [character.vertices], [character.faces]
        for centre in (sides[i] for i in order):
            triangles.append(faces + sum(map(len, points)))
            points.append(centre + 0.05 * vertices)
        return np.concatenate(points), np.concatenate(triangles)

    source, target = with_balls((0, 1)), with_balls((1, 0))
    count, extra = len(character.vertices), len(vertices)
    way = with_the_body_in_place(character, source, target)
    np.testing.assert_allclose(way.images[count:], target[0][count:], atol=1e-3)
    assert (way.confidence[count:] > 0.0).all()
    assert (way.confidence[count : count + extra] < 1.0).all()
    moved = way.followed(target[0][count:], np.zeros(2 * extra, int))
    np.testing.assert_allclose(moved, target[0][count:], atol=1e-6)


def test_a_small_part_goes_to_what_has_its_shape(character):
    """A plate and a ball, the plate where the other's ball is; without a plate there is no counterpart."""
    ball, triangles, _ = sphere(6, 8)
    plate = ball * (1.4, 1.4, 0.1)
    head = character.body.starts[character.body.names.index("head")]

    def beside(*pieces):
        points, faces = [character.vertices], [character.faces]
        for shape, x in pieces:
            faces.append(triangles + sum(map(len, points)))
            points.append(head + (x, -0.3, 0.1) + 0.05 * shape)
        return np.concatenate(points), np.concatenate(faces)

    n, extra = len(character.vertices), len(ball)
    source = beside((ball, 0.0), (plate, 0.06))
    way = with_the_body_in_place(character, source, beside((plate, 0.01), (ball, 0.05)))
    # The plate comes first on the target and second on the source.
    np.testing.assert_allclose(way.images[n : n + extra], source[0][n + extra :], atol=1e-3)
    np.testing.assert_allclose(way.images[n + extra :], source[0][n : n + extra], atol=1e-3)
    without = with_the_body_in_place(character, beside((ball, 0.0)), beside((plate, 0.01)))
    assert (without.confidence[n:] == 0.0).all()


def test_what_does_not_fit_is_refused_in_words(character):
    mesh = character.vertices, character.faces
    count = len(character.vertices)
    weights = np.tile([1.0, 0.0, 0.0], (count, 1))
    with pytest.raises(sgmds.ArgumentError, match="faces"):
        sgmds.SurfaceMap(mesh, mesh, np.zeros(3), weights)
    with pytest.raises(sgmds.ArgumentError, match="made for this source"):
        sgmds.SurfaceMap(mesh, mesh, np.full(count, 10**6), weights)
    for trust in (np.nan, 7.0, -1.0):
        with pytest.raises(sgmds.ArgumentError, match="`confidence` of target vertex 0"):
            sgmds.SurfaceMap(mesh, mesh, np.zeros(count), weights, np.full(count, trust))
    for bad in (np.nan * weights, 2 * weights, weights - 1 / 3):
        with pytest.raises(sgmds.ArgumentError, match="`barycentric` of target vertex 0"):
            sgmds.SurfaceMap(mesh, mesh, np.zeros(count), bad)
    for numbers, words in ((np.full(count, 0.5), "whole numbers"), (["x"] * count, "numbers")):
        with pytest.raises(sgmds.ArgumentError, match=f"`faces` should be .*{words}"):
            sgmds.SurfaceMap(mesh, mesh, numbers, weights)
    way = sgmds.SurfaceMap(mesh, mesh, np.zeros(count), weights)
    offsets = np.zeros((count, 3))
    offsets[5, 1] = np.nan
    with pytest.raises(sgmds.ArgumentError, match=r"`offsets` should be finite, but is nan at \(5, 1\)"):
        way.displacements(offsets)
    image = np.zeros((4, 4, 4))
    for change, words in (
        ({"image": image * np.nan}, "`image` should be finite"),
        ({"target_uv": character.uv[:3]}, "`target_uv`"),
        ({"width": -1}, "`width`"),
        ({"height": 4.5}, "`height`"),
        ({"margin": -1}, "`margin`"),
        ({"width": 2**70}, "`width`"),
        ({"image": {(0.5, 0): image}}, r"tile \(0.5, 0\)"),
        ({"image": {(2**40, 0): image}}, "too far out"),
        ({"image": {"": image}}, "tile ''"),
        ({"image": image + 0j}, "`image`"),
        ({"target_uv": np.nan * character.uv}, "`target_uv` should be finite"),
        ({"progress": "bar"}, "`progress` should be callable, got 'bar'"),
        ({"tangent_frames": [np.zeros((4, 3, 3))]}, "`tangent_frames` should be four"),
        ({"normal_spaces": [np.eye(3)]}, "`normal_spaces` should be two"),
        ({"normal_spaces": [np.eye(3), np.eye(4)]}, "`normal_spaces`"),
        ({"normal_spaces": [np.eye(3), np.full((3, 3), np.nan)]}, "`normal_spaces` should be finite"),
        ({"normal_spaces": [np.eye(3)] * 2, "tangent_frames": []}, "not both"),
    ):
        wanted = {"target_uv": character.uv, "image": image, "width": 4, "height": 4} | change
        with pytest.raises(sgmds.ArgumentError, match=words):
            way.bake(character.uv, **wanted)
    with pytest.raises(sgmds.ArgumentError, match="`uv`"):
        sgmds.uv_islands(*mesh, character.uv[:3])
    corners = character.vertices[character.faces]
    with pytest.raises(sgmds.ArgumentError, match="`uv`"):
        sgmds.judge_layout(corners, character.uv[:3])
    lost = character.uv.copy()
    lost[5, 1, 0] = np.nan
    for call, words in (
        (lambda: sgmds.judge_layout(corners, lost), "`uv`"),
        (lambda: sgmds.judge_layout(np.inf * corners, character.uv), "`corners`"),
        (lambda: sgmds.uv_islands(*mesh, lost), "`uv`"),
    ):
        with pytest.raises(sgmds.ArgumentError, match=f"{words} should be finite"):
            call()
    starts = np.arange(count + 1)
    with pytest.raises(sgmds.ArgumentError, match="`groups` should be whole numbers, none below 0"):
        way.skin_weights(starts, np.full(count, -1), np.ones(count), 1)
    with pytest.raises(sgmds.ArgumentError, match="offsets"):
        way.displacements(np.zeros((3, 3)))
    with pytest.raises(sgmds.ArgumentError, match="8192"):
        way.bake(character.uv, character.uv, np.zeros((4, 4, 4)), 9000, 4)
    with pytest.raises(sgmds.ArgumentError, match="extension"):
        way.bake(character.uv, character.uv, np.zeros((4, 4, 4)), 4, 4, extension="wrap")
    with pytest.raises(sgmds.ArgumentError, match="target_triangles"):
        way.bake(character.uv, character.uv, np.zeros((4, 4, 4)), 4, 4, target_triangles=[True])


def test_numbers_without_a_value_and_lists_of_wrong_lengths_are_refused(character):
    vertices, faces, uv = character.vertices, character.faces, character.uv
    way, *_ = copy_map(vertices, faces)
    count, none = len(vertices), np.full(len(vertices), np.nan)
    rows = np.arange(count + 1), np.zeros(count), np.ones(count), 1
    starts, corners = polygons(faces)
    for call, words in (
        (lambda: way.layout(starts, corners, uv * np.nan), "`uv` should be finite"),
        (lambda: way.seam_cuts(starts, corners, uv * np.nan), "`uv` should be finite"),
        (lambda: way.seam_cuts(starts, corners, uv, tolerance=np.nan), "`tolerance`"),
        (lambda: way.corner_values(starts, corners, uv, tolerance=np.inf), "`tolerance`"),
        (lambda: way.skin_weights(*rows, prune=np.nan), "`prune`"),
        (lambda: way.skin_weights(*rows, reject_below="x"), "`reject_below`"),
        (
            lambda: way.skin_weights(*rows, locked=([True], none, 0 * rows[1])),
            "`locked sums` should be finite",
        ),
        (lambda: way.skin_weights(*rows, locked=([True], none)), "`locked` should be three"),
        (lambda: way.joints([[np.nan, 0, 0]]), "`positions` should be finite"),
        (lambda: way.joints(vertices[:1], [([0],)]), "`influence` should be a pair"),
        (lambda: way.joints(vertices[:2], [([0], [1, 1]), ([0, 1], [1])]), r"`influence` should be \(1\)"),
        (lambda: way.joints(vertices[:1], []), "`influence` should have 1 rows"),
        (lambda: way.followed([[0, np.inf, 0]]), "`points` should be finite"),
        (lambda: way.strands(vertices[:1] * np.nan, vertices[:1], [0]), "`roots` should be finite"),
        (
            lambda: way.strands(vertices[:1], vertices[:2], [0, 1]),
            "`strands` names strand 1, but there are 1",
        ),
        (lambda: way.displacements([[0, 0, 0], [0, 0]]), "`offsets`"),
    ):
        with pytest.raises(sgmds.ArgumentError, match=words):
            call()


def test_values_without_channels_come_back_without(character):
    way, *_ = copy_map(character.vertices, character.faces)
    starts, corners = polygons(character.faces)
    faces, count = len(character.faces), len(character.vertices)
    for nearest in (False, True):
        none = way.corner_values(starts, corners, np.zeros((faces, 3, 0)), nearest=nearest)
        assert none.shape == (len(corners), 0)
    assert way.face_means(starts, corners, np.zeros((faces, 0))).shape == (faces, 0)
    assert way.filled(np.zeros((count, 0)), np.zeros(count)).shape == (count, 0)
    assert len(way.seam_cuts(starts, corners, np.zeros((faces, 3, 0))).cuts) == 0


def test_a_table_of_weights_has_room_for_all_groups():
    rows = sgmds.transfer.SkinWeights(np.array([0, 1, 3]), np.array([4, 0, 2]), np.ones(3), np.zeros(0, int))
    assert rows.dense(5).tolist() == [[0, 0, 0, 0, 1], [1, 0, 1, 0, 0]] and rows.dense(7).shape == (2, 7)
    for groups, words in ((4, "`groups` should be 5 or more, got 4"), (2.5, "`groups` should be a whole")):
        with pytest.raises(sgmds.ArgumentError, match=words):
            rows.dense(groups)
    none = sgmds.transfer.SkinWeights(np.zeros(3, int), *[np.zeros(0, int)] * 3)
    assert none.dense(0).shape == (2, 0)


def test_a_map_leaves_the_arrays_of_its_caller_writable(character):
    vertices, faces = character.vertices.copy(), character.faces.astype(np.int64)
    way = sgmds.SurfaceMap(
        (vertices, faces), (vertices, faces), np.zeros(len(vertices)), np.eye(3)[[0] * len(vertices)]
    )
    before = way.images
    vertices *= 2
    faces += 1
    assert np.array_equal(way.images, before)


def test_a_margin_beyond_the_image_fills_it(character):
    """At once, and as the side of the image does."""
    way, *_ = copy_map(character.vertices, character.faces)
    image = np.random.default_rng(0).random((8, 8, 4))
    full, huge = (way.bake(character.uv, character.uv, image, 16, 16, margin=m) for m in (16, 10**9))
    assert np.array_equal(full, huge) and (full[..., 3] > 0).all()


def test_shapes_stand_for_their_meshes_and_no_keys_give_none(character):
    shape = sgmds.Shape(character.vertices, character.faces)
    corr = sgmds.match(shape, shape, method="paper")
    way = sgmds.SurfaceMap.of(corr, shape, shape)
    mesh = character.vertices, character.faces
    assert np.array_equal(way.images, sgmds.SurfaceMap.of(corr, mesh, mesh).images)
    count = len(character.vertices)
    assert way.displacements(np.zeros((0, count, 3))).shape == (0, count, 3)


def grid(count, turn=0.0):
    """A square of `count` × `count` cells around the origin, of triangles, turned in its plane."""
    line = np.linspace(-1.0, 1.0, count + 1)
    x, y = (values.ravel() for values in np.meshgrid(line, line, indexing="ij"))
    flat = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=1)
    number = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    return np.pad(flat, ((0, 0), (0, 1))), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_tiles_are_baked_where_they_lie_and_only_where_they_are_used():
    """A square over two tiles, each of one colour, baked onto the one square of its copy."""
    mesh = grid(8)
    square = mesh[0][mesh[1]][..., :2] * 0.5 + 0.5
    way = sgmds.SurfaceMap(mesh, mesh, *nearest(mesh, mesh))
    tiles = {(0, 0): np.full((2, 2, 4), 0.25), (1, 0): np.ones((4, 4, 4))}
    baked = way.bake(square * (2.0, 1.0), square, tiles, 32, 32)[..., 0]
    expected = np.tile(np.repeat([0.25, 1.0], 16), (32, 1))
    np.testing.assert_array_equal(baked, expected)
    left = square[..., 0].mean(axis=1) < 0.5
    half = way.bake(square * (2.0, 1.0), square, tiles, 32, 32, margin=0, target_triangles=left)[..., 0]
    np.testing.assert_array_equal(half, np.where(np.arange(32) < 16, expected, 0.0))
    # Looked up on the left half alone, the right half shows the place nearest to it.
    near = way.bake(square * (2.0, 1.0), square, tiles, 32, 32, source_triangles=left)[..., 0]
    np.testing.assert_array_equal(near, np.full((32, 32), 0.25))


def baked_normals(way, uv, given, matrices, side):
    """What is baked of one normal a texel, (side, side, 3), of a map that lays out its two surfaces alike."""
    image = np.dstack([given * 0.5 + 0.5, np.ones(given.shape[:2])])
    return way.bake(uv, uv, image, side, side, margin=0, normal_spaces=matrices)[..., :3] * 2.0 - 1.0


@pytest.mark.parametrize(
    "plane",
    [
        np.array([[0.8, -0.6], [0.6, 0.8]]),
        np.array([[3.0, 0.0], [0.0, 0.5]]),
        np.array([[1.0, 0.7], [0.0, 1.0]]),
        np.array([[0.3, 1.0], [1.5, 0.2]]),
    ],
    ids=["turned", "stretched", "sheared", "mirrored"],
)
def test_a_normal_in_object_space_is_turned_by_the_rotation_nearest_to_the_map(plane):
    """A square taken elsewhere by a linear map: within it the orthogonal factor of that map turns a normal.

    Across it is the square's own normal, which looks down where the square was turned over.
    """
    mesh = grid(4)
    vertices = np.pad(mesh[0][:, :2] @ plane.T, ((0, 0), (0, 1)))
    way = sgmds.SurfaceMap(mesh, (vertices, mesh[1]), *nearest(mesh, mesh))
    left, _, right = np.linalg.svd(plane)
    turn = np.zeros((3, 3))
    turn[:2, :2], turn[2, 2] = left @ right, np.sign(np.linalg.det(plane))
    given = np.array([0.48, -0.36, 0.8])
    square = mesh[0][mesh[1]][..., :2] * 0.5 + 0.5
    found = baked_normals(way, square, np.tile(given, (8, 8, 1)), (np.eye(3), np.eye(3)), 16)
    # Single precision.
    np.testing.assert_allclose(found, np.tile(turn @ given, (16, 16, 1)), atol=1e-6)
    # In spaces of their own: y up on the source, and an inverted z on the target.
    up, inverted = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.diag([1.0, 1.0, -1.0])
    found = baked_normals(way, square, np.tile(up.T @ given, (8, 8, 1)), (up, inverted), 16)
    np.testing.assert_allclose(found, np.tile(inverted @ turn @ given, (16, 16, 1)), atol=1e-6)


def test_a_ball_s_own_normals_become_an_ellipsoid_s():
    """A sixth of a ball, whose map of normals is x/|x|, taken to A x, whose normals are A⁻ᵀx."""
    a = 0.6
    turn = np.array([[np.cos(a), 0.0, -np.sin(a)], [0.0, 1.0, 0.0], [np.sin(a), 0.0, np.cos(a)]])
    stretch = turn @ np.diag([1.0, 1.6, 0.7])

    def unit(points):
        return points / np.linalg.norm(points, axis=-1, keepdims=True)

    def on_ball(uv):
        return unit(np.concatenate([uv * 2.0 - 1.0, np.ones_like(uv[..., :1])], axis=-1))

    side = 96
    texel = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1) + 0.5) / side
    expected = unit(on_ball(texel) @ np.linalg.inv(stretch))
    errors = []
    for cells in (8, 16, 32):
        flat, faces = grid(cells)
        uv = flat[:, :2] * 0.5 + 0.5
        ball = on_ball(uv)
        way = sgmds.SurfaceMap(
            (ball, faces), (ball @ stretch.T, faces), *nearest((flat, faces), (flat, faces))
        )
        found = baked_normals(way, uv[faces], on_ball(texel), (np.eye(3), np.eye(3)), side)
        # At the border a vertex lacks the triangles of one side, which makes its normal one of first order.
        inner = slice(side // 4, -side // 4)
        errors.append(np.abs(found - expected)[inner, inner].max())
    # Normals of vertices, and what lies between them, are of second order.
    assert errors[0] < 0.05
    assert all(before / after > 3.0 for before, after in zip(errors, errors[1:], strict=False)), errors


def test_seams_cut_the_faces_that_they_cross():
    """Four islands around a cross of seams: on a turned grid every triangle over an arm is cut along it."""
    source, target = grid(8), grid(5, turn=0.4)
    target = target[0] * 0.6, target[1]
    corners = source[0][source[1]]
    side = np.sign(corners.mean(axis=1)[:, :2])
    uv = corners[..., :2] + 10.0 * side[:, None]
    way = sgmds.SurfaceMap(source, target, *nearest(source, target))
    cuts = way.seam_cuts(*polygons(target[1]), uv)
    images = (corners[cuts.faces] * cuts.barycentric[..., None]).sum(axis=1)
    assert np.abs(images[:, :2]).min(axis=1).max() < 1e-12
    middle = (cuts.edges < 0).all(axis=1)
    assert middle.sum() == 1 and np.abs(images[middle]).max() < 1e-12
    # The map is the identity, so points of edges lie on their images; a way starts 1e-7 off a vertex.
    # Vertices just beside a seam were moved onto it in the map alone.
    plain = ~middle & ~np.isin(cuts.edges, cuts.moved).any(axis=1)
    assert plain.sum() > 20
    np.testing.assert_allclose(cuts.positions[plain], images[plain], atol=1e-7)
    # A triangle is crossed where two of its vertices lie on two sides of an arm, wherever the third one is.
    place = target[0].copy()
    place[cuts.moved] = np.nan
    spread = place[target[1]][..., :2]
    crossed = (spread.min(axis=1) < 0.0) & (spread.max(axis=1) > 0.0)
    assert crossed.sum() > 20
    assert set(np.flatnonzero(crossed.any(axis=1))) <= set(cuts.cuts[:, 0].tolist())


class TestGarments:
    """A sleeve around a cylinder, on cylinders of other sizes, where each point's place is known."""

    @staticmethod
    def tube(radius, low, high, around=40, along=60):
        angle, height = np.meshgrid(
            2 * np.pi * np.arange(around) / around, np.linspace(low, high, along), indexing="xy"
        )
        vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2).reshape(-1, 3)
        i, j = np.arange(around), (np.arange(around) + 1) % around
        rings = around * np.arange(along - 1)[:, None]
        lower = np.stack([rings + i, rings + j, rings + around + j], axis=2).reshape(-1, 3)
        upper = np.stack([rings + i, rings + around + j, rings + around + i], axis=2).reshape(-1, 3)
        return vertices, np.concatenate([lower, upper])

    def test_a_sleeve_follows_the_body_and_keeps_its_gap(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(1.03, -1, 1, along=30)
        target = source * [1.4, 1.4, 1.0]
        known = np.arange(len(source))
        corners = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in known])
        weights = (faces[corners] == known[:, None]).astype(float)
        along = sgmds.SurfaceMap((source, faces), (target, faces), corners, weights)
        fitted = along.fit(sleeve, cloth)
        radius = np.hypot(fitted[:, 0], fitted[:, 1])
        # A wider body stretches the gap by the mean of its stretches, between 1 and 1.4.
        assert (radius > 1.4 + 0.02).all() and (radius < 1.4 + 0.06).all()
        assert np.abs(fitted[:, 2] - sleeve[:, 2]).max() < 0.05
        same = sgmds.SurfaceMap((source, faces), (source, faces), corners, weights).fit(sleeve, cloth)
        np.testing.assert_allclose(same, sleeve, atol=5e-3)

    def test_cloth_stays_out_of_the_body_and_distances_are_added(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(0.97, -1, 1, along=30)
        known = np.arange(len(source))
        corners = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in known])
        weights = (faces[corners] == known[:, None]).astype(float)
        along = sgmds.SurfaceMap((source, faces), (source, faces), corners, weights)
        outer, cloth = self.tube(1.03, -1, 1, along=30)
        bound = along.fitting(outer, cloth)
        near, far = bound.place(), bound.place(distance=0.05)
        away = np.hypot(*far[:, :2].T) - np.hypot(*near[:, :2].T)
        np.testing.assert_allclose(away, 0.05, atol=0.01)
        tight = np.hypot(*bound.place(tightness=1.0)[:, :2].T)
        # The flat sides of the body of forty corners lie 0.3 % inside the circle.
        assert (tight > 0.996).all() and tight.mean() < 1.02

    @classmethod
    def between(cls, source, target, faces, confidence=None):
        """The map between two tubes of the same vertices that takes each to itself."""
        known = np.arange(len(source))
        corners = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in known])
        weights = (faces[corners] == known[:, None]).astype(float)
        return sgmds.SurfaceMap((source, faces), (target, faces), corners, weights, confidence)

    def test_a_turned_and_scaled_body_takes_its_garment_with_it(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(1.03, -1, 1, along=30)
        turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        along = self.between(source, 2.5 * source @ turn.T + [1.0, -2.0, 0.5], faces)
        fitted = along.fit(sleeve, cloth, collide=False)
        # A similarity of the bodies is one of everything beside them, but for the ridge of the frames: a
        # thousandth of the width of a frame.
        np.testing.assert_allclose(fitted, 2.5 * sleeve @ turn.T + [1.0, -2.0, 0.5], atol=2e-3)
        mirror = np.diag([-1.0, 1.0, 1.0])
        # Faces are wound the other way, so that they are seen from outside.
        mirrored = sgmds.SurfaceMap(
            (source, faces), (source @ mirror, faces[:, ::-1]), along.faces, along.barycentric
        )
        np.testing.assert_allclose(mirrored.fit(sleeve, cloth, collide=False), sleeve @ mirror, atol=2e-3)

    def test_layers_leave_a_fatter_body_in_their_order(self):
        source, faces = self.tube(1.0, -3, 3)
        inner, cloth = self.tube(1.01, -1, 1, along=30)
        outer, _ = self.tube(1.02, -0.95, 1.05, along=30)
        both = np.concatenate([outer, inner])
        along = self.between(source, source * [1.3, 1.1, 1.0], faces)
        fitted = along.fit(both, np.concatenate([cloth, cloth + len(outer)]))
        bound = along.fitting(both, np.concatenate([cloth, cloth + len(outer)]))
        above = bound.clearance(fitted)
        assert above.min() > 0.0
        assert above[: len(outer)].mean() > above[len(outer) :].mean() + 0.005

    def test_stiff_pieces_keep_their_shape(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(1.05, -1, 1, along=30)
        # A plate on one side, which can leave the body as a whole.
        plate = cloth[(sleeve[cloth][..., 0] > 0.5).all(axis=1)]
        used, corners = np.unique(plate, return_inverse=True)
        sleeve, cloth = sleeve[used], corners.reshape(plate.shape)
        along = self.between(source, source * [1.5, 1.0, 0.8], faces)
        fitted = along.fit(sleeve, cloth, stiff=np.ones(len(sleeve), bool))

        def shape(points):
            lengths = np.linalg.norm(points[:, None] - points[::37], axis=2)
            return lengths / lengths.mean()

        np.testing.assert_allclose(shape(fitted), shape(sleeve), atol=1e-9)
        assert along.fitting(sleeve, cloth).clearance(fitted).min() > 0.0

    def test_what_the_skin_and_the_garment_have_comes_with_it(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(1.03, -1, 1, along=30)
        target = source * [1.2, 1.2, 2.0]
        along = self.between(source, target, faces)
        # Two bones that change places along the tube.
        upper = np.clip(target[:, 2:] / 4.0 + 0.5, 0.0, 1.0)
        weights = along.fit_weights(sleeve, cloth, np.hstack([upper, 1.0 - upper]))
        np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
        # The weights bend at ±1, between rings of the body: a quarter of their distance times the slope.
        np.testing.assert_allclose(weights[:, 0], sleeve[:, 2] / 2.0 + 0.5, atol=0.5 * 6 / 59 / 4)
        bound = along.fitting(sleeve, cloth)
        raised = bound.displacements(np.tile([0.0, 0.0, 0.1], (len(sleeve), 1)))
        np.testing.assert_allclose(raised, np.tile([0.0, 0.0, 0.2], (len(sleeve), 1)), atol=0.01)
        hidden = bound.hidden(bound.place(), reach=0.1, margin=0.3)
        # The sleeve reaches from −2 to 2 on the target, whose rings are a fifth apart.
        assert hidden[np.abs(target[:, 2]) < 1.3].all() and not hidden[np.abs(target[:, 2]) > 1.75].any()

    def test_bones_find_their_partners_in_order(self):
        source, faces = self.tube(1.0, -3, 3)
        along = self.between(source, source * [1.3, 1.3, 1.0], faces)

        def chain(bones):
            bone = np.clip(((source[:, 2] + 3.0) / 6.0 * bones).astype(int), 0, bones - 1)
            return np.eye(bones)[bone], np.arange(bones) - 1

        for one, other in ((5, 5), (5, 4), (4, 6)):
            (weights, parents), (other_weights, other_parents) = chain(one), chain(other)
            found = along.bones(weights, other_weights, parents, other_parents)
            taken = found.partners[found.partners >= 0]
            assert len(taken) == min(one, other) and (np.diff(taken) > 0).all()
            assert found.nearest[0] == 0 and found.nearest[-1] == other - 1
        # A chain's rows have one bone each.
        rows = [
            sgmds.transfer.SkinWeights(
                np.arange(len(w) + 1), w.argmax(axis=1), np.ones(len(w)), np.zeros(0, int)
            )
            for w in (weights, other_weights)
        ]
        again = along.bones(*rows, parents, other_parents)
        np.testing.assert_array_equal(again.partners, found.partners)
        np.testing.assert_array_equal(again.shares, found.shares)
        with pytest.raises(sgmds.ArgumentError, match="`source_parents` of"):
            along.bones(weights, other_weights, np.roll(parents, 1) + 1, other_parents)

    def test_rigs_tell_where_the_map_is_unsure(self):
        source, faces = self.tube(1.0, -3, 3)
        target = 1.7 * source
        # The upper third is unsure, and lies half a unit too low on the source.
        upper = source[:, 2] > 1.0
        places = np.where(upper, np.arange(len(source)) - 5 * 40, np.arange(len(source)))
        corners = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in places])
        weights = (faces[corners] == places[:, None]).astype(float)
        trust = np.where(upper, 0.3, 1.0)
        slid = sgmds.SurfaceMap((source, faces), (target, faces), corners, weights, trust)
        bone = np.clip(((source[:, 2] + 3.0) / 2.0).astype(int), 0, 2)
        skin, parents = np.eye(3)[bone], np.array([-1, 0, 1])
        heads = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
        along = slid.guided(skin, skin, parents, parents, heads, 1.7 * heads)
        off = np.linalg.norm(along.images - source, axis=1)
        assert np.linalg.norm(slid.images - source, axis=1)[upper].min() > 0.49
        # Ways are averaged over a quarter of a unit: a unit away from the border they are whole, or none.
        assert off[source[:, 2] > 2.0].max() < 0.02 and off[source[:, 2] < 0.0].max() < 0.02
        sure = sgmds.SurfaceMap((source, faces), (target, faces), corners, weights)
        kept = sure.guided(skin, skin, parents, parents, heads, 1.7 * heads)
        np.testing.assert_array_equal(kept.faces, sure.faces)
        np.testing.assert_array_equal(kept.barycentric, sure.barycentric)
        with pytest.raises(sgmds.ArgumentError, match="target_heads"):
            slid.guided(skin, skin, parents, parents, heads, heads[:2])

    def test_binding_tells_of_itself_and_stops(self):
        source, faces = self.tube(1.0, -3, 3)
        sleeve, cloth = self.tube(1.03, -1, 1, along=30)
        along = self.between(source, source, faces)
        told = []
        along.fitting(sleeve, cloth, progress=lambda stage, fraction: told.append((stage, fraction)))
        assert told and {stage for stage, _ in told} == {"garments"}
        with pytest.raises(sgmds.Cancelled):
            along.fitting(sleeve, cloth, progress=lambda *_: False)

    def test_nonsense_is_named(self):
        source, faces = self.tube(1.0, -3, 3)
        known = np.zeros(len(source), int)
        weights = np.tile([1.0, 0, 0], (len(source), 1))
        along = sgmds.SurfaceMap((source, faces), (source, faces), known, weights)
        with pytest.raises(sgmds.SgmdsError):
            along.fit(source, faces)
