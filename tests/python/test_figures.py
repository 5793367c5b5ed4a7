"""Characters as artists have them: split at seams, in pieces, clothed; matched as one figure."""

import numpy as np
import pytest
import sgmds
import trimesh
from sgmds import characters
from sgmds.files import read_mesh


def shattered(vertices, faces):
    """Each face with three vertices of its own, as flat shading exports it."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def cut_at_seams(vertices, faces):
    """Along three planes faces of one side have vertices of their own, as exported texture islands do."""
    middles = vertices[faces].mean(axis=1)
    island = ((middles > np.median(middles, axis=0)) * [1, 2, 4]).sum(axis=1)
    pairs = faces + len(vertices) * island[:, None]
    used, numbers = np.unique(pairs, return_inverse=True)
    return vertices[used % len(vertices)], numbers.reshape(-1, 3)


def welded(vertices, faces):
    """The same with vertices at one place merged, in the order of their first appearance."""
    _, first, classes = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    numbers = np.argsort(order)[classes.ravel()]
    return vertices[first[order]], numbers[faces], numbers


def images(corr, source):
    return np.einsum("nk,nkd->nd", corr.barycentric, source[0][source[1][corr.faces]])


def area(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def offset(vertices, faces, chosen, gap):
    """The faces whose corners are all chosen, as a piece of its own, so far above the surface."""
    normals = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    faces = faces[chosen[faces].all(axis=1)]
    used, numbers = np.unique(faces, return_inverse=True)
    return vertices[used] + gap * normals[used], numbers.reshape(-1, 3), used


def joined(*pieces):
    starts = np.cumsum([0] + [len(p[0]) for p in pieces])
    vertices = np.concatenate([p[0] for p in pieces])
    return vertices, np.concatenate([p[1] + s for p, s in zip(pieces, starts[:-1], strict=True)])


@pytest.fixture(scope="module")
def resting():
    """The slender body in another pose: maps between poses are found soonest."""
    return characters.make("biped", "slender", "rest", resolution=2500, seed=3)


@pytest.fixture(scope="module")
def clothed(slender):
    """The slender body in shirt and trousers, with the skin below them deleted: three or more pieces, and the
    body's vertex that each vertex lies on.
    """
    vertices, faces = slender.vertices, slender.faces
    height = (vertices[:, 2] - vertices[:, 2].min()) / np.ptp(vertices[:, 2])
    gap = 0.004 * np.ptp(vertices[:, 2])
    shirt = offset(vertices, faces, (height > 0.48) & (height < 0.8), gap)
    trousers = offset(vertices, faces, (height > 0.1) & (height < 0.5), 2 * gap)
    skin = offset(vertices, faces, (height < 0.14) | (height > 0.76), 0.0)
    pieces = (shirt, trousers, skin)
    return joined(*pieces), np.concatenate([p[2] for p in pieces])


@pytest.mark.parametrize("split", [shattered, cut_at_seams])
def test_vertices_at_one_place_are_one_vertex(slender, resting, split):
    source, target = (resting.vertices, resting.faces), split(slender.vertices, slender.faces)
    vertices, faces, numbers = welded(*target)
    whole, parts = sgmds.match(source, (vertices, faces)), sgmds.match(source, target)
    for name in ("faces", "barycentric", "vertices", "confidence"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name)[numbers])
    assert parts.quality == whole.quality
    # As a source too: the same points of the same faces.
    vertices, faces, numbers = welded(*target)
    back, of_parts = sgmds.match((vertices, faces), source), sgmds.match(target, source)
    np.testing.assert_array_equal(of_parts.faces, back.faces)
    np.testing.assert_array_equal(of_parts.barycentric, back.barycentric)
    np.testing.assert_array_equal(numbers[of_parts.vertices], back.vertices)


@pytest.mark.parametrize("ending", ["obj", "off", "ply", "stl", "glb"])
def test_a_file_of_split_vertices_gives_the_map_of_the_whole(tmp_path, slender, resting, ending):
    path = tmp_path / f"body.{ending}"
    trimesh.Trimesh(*cut_at_seams(slender.vertices, slender.faces), process=False).export(path)
    target = read_mesh(path)
    vertices, faces, numbers = welded(*target)
    assert len(vertices) == len(slender.vertices)
    source = sgmds.Shape(resting.vertices, resting.faces)
    whole, parts = sgmds.match(source, (vertices, faces)), sgmds.match(source, target)
    np.testing.assert_array_equal(parts.faces, whole.faces[numbers])
    np.testing.assert_array_equal(parts.confidence, whole.confidence[numbers])


def test_what_a_shape_hands_out_is_in_given_numbering(slender):
    vertices, faces = cut_at_seams(slender.vertices, slender.faces)
    shape = sgmds.Shape(vertices, faces)
    figure = shape.figure
    assert figure.welded == len(vertices) - len(slender.vertices)
    assert (figure.pieces, figure.envelope, figure.handles, figure.seen) == (1, False, 0, 1.0)
    assert shape.mass.shape == (len(vertices),) and shape.mass.sum() == pytest.approx(area(vertices, faces))
    phi = shape.eigenfunctions
    # Areas are shared among vertices at one place, so that the functions stay orthonormal.
    gram = phi.T @ (shape.mass[:, None] * phi)
    np.testing.assert_allclose(gram, np.eye(phi.shape[1]), atol=1e-6)
    assert ((0 <= shape.samples) & (shape.samples < len(vertices))).all()


def test_a_landmark_may_be_any_of_the_vertices_at_a_place(slender, resting):
    target = shattered(slender.vertices, slender.faces)
    vertices, faces, numbers = welded(*target)
    source = sgmds.Shape(resting.vertices, resting.faces)
    # Where the first vertex really goes.
    known = int(sgmds.match(source, (vertices, faces)).vertices[numbers[0]])
    # The last of the vertices at the place of the first one.
    given = int(np.flatnonzero(numbers == numbers[0])[-1])
    whole = sgmds.match(source, (vertices, faces), landmarks=[(known, int(numbers[0]))])
    parts = sgmds.match(source, target, landmarks=[(known, given)])
    np.testing.assert_array_equal(parts.faces, whole.faces[numbers])


def test_a_clothed_figure_is_matched_as_one(clothed, slender, resting):
    """Against the same body, bare and in another pose: all of either has its place, in both directions."""
    dressed, below = clothed
    bare = resting
    shape = sgmds.Shape(*dressed)
    assert shape.figure.envelope and shape.figure.pieces > 2 and shape.figure.seen > 0.9
    size = np.sqrt(area(bare.vertices, bare.faces))

    corr = sgmds.match((bare.vertices, bare.faces), shape)
    true = characters.carried(slender.vertices, slender.body, bare.body)[below]
    error = np.linalg.norm(images(corr, (bare.vertices, bare.faces)) - true, axis=1) / size
    # A wrong limb is half of √area away, a grid cell of the envelope a fiftieth.
    assert np.median(error) < 0.03 and (error < 0.15).mean() > 0.95
    assert corr.quality.grade != "red" and corr.quality.unknown < 0.1
    assert any("pieces were matched as one figure" in reason for reason in corr.quality.reasons)

    back = sgmds.match(shape, (bare.vertices, bare.faces))
    true = characters.carried(bare.vertices, bare.body, slender.body)
    error = np.linalg.norm(images(back, dressed) - true, axis=1) / size
    assert np.median(error) < 0.03 and (error < 0.15).mean() > 0.95


def test_a_kept_figure_gives_the_same_map(clothed, resting, tmp_path):
    dressed, _ = clothed
    shape = sgmds.Shape(*dressed)
    shape.save(tmp_path / "dressed.npz")
    kept = sgmds.Shape.load(tmp_path / "dressed.npz")
    assert kept.figure == shape.figure
    target = sgmds.Shape(resting.vertices, resting.faces)
    first, second = sgmds.match(shape, target), sgmds.match(kept, target)
    np.testing.assert_array_equal(first.faces, second.faces)
    np.testing.assert_array_equal(first.confidence, second.confidence)


def test_what_is_seen_and_not_matched_keeps_the_grade_from_green(slender):
    """A second body of half the size beside the first: a quarter of what is seen, nothing of it matched."""
    body = slender.vertices, slender.faces
    beside = 0.6 * slender.vertices + [3 * np.ptp(slender.vertices[:, 0]), 0, 0], slender.faces
    corr = sgmds.match(body, joined(body, beside))
    assert corr.quality.unknown == pytest.approx(0.36 / 1.36, abs=0.03)
    assert corr.quality.grade != "green"
    assert any("beside what was matched" in reason for reason in corr.quality.reasons)
    assert sgmds.match(body, body).quality.unknown == 0.0


def test_what_is_worn_takes_what_lies_below_it(slender):
    body = slender.vertices, slender.faces
    height = slender.vertices[:, 2]
    chosen = (height > np.quantile(height, 0.3)) & (height < np.quantile(height, 0.6))
    for gap in (0.01, 0.03):
        *shirt, below = offset(*body, chosen, gap * np.ptp(height))
        corr = sgmds.match(body, tuple(shirt))
        away = np.linalg.norm(images(corr, body) - slender.vertices[below], axis=1)
        # Vertex normals lean, so that the foot of the offset lies beside the vertex by less than the gap.
        assert np.quantile(away, 0.95) < gap * np.ptp(height)
        assert corr.quality.grade == "green"
        assert any("as it is worn" in reason for reason in corr.quality.reasons)


def test_a_character_of_plates_in_another_pose_takes_its_own_plates():
    """Left and right plates are alike; each hangs on the trunk or on the plate before it, and turns there."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    rng = np.random.default_rng(7)

    def plate(*size):
        bumps = rng.uniform(0.9, 1.1, (len(ball.vertices), 1))
        return ball.vertices * bumps * size

    trunk, head, arm, leg = plate(1, 0.6, 1.5), plate(0.5, 0.5, 0.6), plate(0.3, 0.3, 1), plate(0.4, 0.4, 1)

    def robot(angles):
        """Vertices of the trunk, the head, and two plates of each of four limbs."""
        placed = [trunk, head + [0, 0, 2]]
        starts = ([1.2, 0, 1], [-1.2, 0, 1], [0.6, 0, -1.4], [-0.6, 0, -1.4])
        for limb, start, (first, second) in zip((arm, arm, leg, leg), starts, angles, strict=True):
            place = np.array(start, dtype=float)
            for angle in (first, second):
                c, s = np.cos(angle), np.sin(angle)
                turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
                placed.append(place + (limb - [0, 0, 1.05]) @ turn.T)
                place = place + turn @ [0, 0, -2.1]
        return np.concatenate(placed), np.concatenate(
            [ball.faces + len(ball.vertices) * i for i in range(len(placed))]
        )

    vertices, faces = robot([(0, 0)] * 4)
    posed, _ = robot([(0.9, 0.7), (-0.6, 1.1), (0.5, -0.8), (-0.7, 0.3)])
    order = rng.permutation(len(posed))
    source, target = (vertices, faces), (posed[order], np.argsort(order)[faces])
    for landmarks in ([], [(order[5], 5)]):
        corr = sgmds.match(source, target, landmarks=landmarks)
        np.testing.assert_array_equal(corr.vertices, order)
        assert corr.quality.grade == "green"
        assert any("a copy of" in reason for reason in corr.quality.reasons)
    # Who says that a hand is the head knows of another map.
    head, hand = np.flatnonzero(order == len(ball.vertices))[0], 4 * len(ball.vertices)
    corr = sgmds.match(source, target, landmarks=[(hand, head)])
    assert not any("a copy of" in reason for reason in corr.quality.reasons)


def test_a_ground_does_not_make_a_figure(slender):
    """A plane that reaches beyond the body on all sides is left out, however much of what is seen it is."""
    low, reach = slender.vertices[:, 2].min(), 1.2 * np.abs(slender.vertices).max()
    corners = [[-reach, -reach, low], [reach, -reach, low], [reach, reach, low], [-reach, reach, low]]
    ground = np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])
    body = slender.vertices, slender.faces
    shape = sgmds.Shape(*joined(body, ground))
    assert not shape.figure.envelope and shape.report["dropped_components"] == 1
    alone, grounded = sgmds.match(body, body), sgmds.match(body, shape)
    np.testing.assert_array_equal(grounded.vertices[: len(body[0])], alone.vertices)


def test_what_turns_onto_itself_is_said_and_never_green():
    """A round bar, turned and renumbered: every turn about its axis is as good a map as the right one."""
    around, along = 24, 40
    angle, height = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, 4, along))
    side = np.stack([np.cos(angle), np.sin(angle), height], axis=2).reshape(-1, 3)
    vertices = np.concatenate([side, [[0, 0, 0], [0, 0, 4]]])
    i, j = np.arange(around), (np.arange(around) + 1) % around
    faces = [np.stack([j, i, np.full(around, len(side))], axis=1)]
    for ring in around * np.arange(along - 1):
        faces += [np.stack([ring + i, ring + j, ring + around + i], axis=1)]
        faces += [np.stack([ring + j, ring + around + j, ring + around + i], axis=1)]
    top = around * (along - 1)
    faces = np.concatenate([*faces, np.stack([top + i, top + j, np.full(around, len(side) + 1)], axis=1)])
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    corr = sgmds.match((vertices, faces), (vertices @ (turn * np.sign(np.linalg.det(turn))).T, faces))
    assert corr.quality.grade != "green"
    assert any("turned about an axis" in reason for reason in corr.quality.reasons)


def turned_solid(radius, rings=20, height=2.0, around=60):
    """A solid of a radius by angle and height in 0…1, and the same turned and renumbered."""
    rng = np.random.default_rng(5)
    angle, level = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, 1, rings))
    out = radius(angle, level) * np.ones_like(angle)
    side = np.stack([out * np.cos(angle), out * np.sin(angle), height * level], axis=2).reshape(-1, 3)
    vertices = np.concatenate([side, [[0, 0, 0], [0, 0, height]]])
    i, j = np.arange(around), (np.arange(around) + 1) % around
    faces = [np.stack([j, i, np.full(around, len(side))], axis=1)]
    for ring in around * np.arange(rings - 1):
        faces += [np.stack([ring + i, ring + j, ring + around + i], axis=1)]
        faces += [np.stack([ring + j, ring + around + j, ring + around + i], axis=1)]
    top = around * (rings - 1)
    faces = np.concatenate([*faces, np.stack([top + i, top + j, np.full(around, len(side) + 1)], axis=1)])
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    old = rng.permutation(len(vertices))
    renumbered = np.argsort(old)[faces]
    return (vertices, faces), (vertices[old] @ (turn * np.sign(np.linalg.det(turn))).T, renumbered), old


@pytest.mark.parametrize(
    ("name", "radius", "height"),
    [
        ("propeller", lambda a, z: 1 + 0.5 * np.cos(2 * a) + 0.2 * np.sin(2 * a) * z, 1.0),
        ("twisted blade", lambda a, z: 1 + 0.5 * np.cos(2 * a + 2 * z), 3.0),
        ("handle", lambda a, z: 0.3 + 0.1 * np.sin(7 * z) + 0.05 * np.cos(2 * a) * (z > 0.5), 8.0),
        ("pliers", lambda a, z: 0.1 + (0.2 + 0.6 * z * (1 - z)) * np.abs(np.cos(a)), 5.0),
    ],
)
def test_what_a_half_turn_takes_onto_itself_is_said_and_never_green(name, radius, height):
    """Their spectra have no equal pairs, as those of prisms have: only how they lie tells."""
    source, target, _ = turned_solid(radius, height=height)
    corr = sgmds.match(source, target)
    assert corr.quality.grade != "green"
    for role in ("source", "target"):
        assert any(role in r and "turned about an axis" in r for r in corr.quality.reasons), name


def test_landmarks_tell_which_way_round_it_goes():
    """A round bar: every turn is as good a map until two places a quarter of a turn apart are known."""
    around = 24
    source, target, old = turned_solid(lambda a, z: 1.0, rings=12, around=around)
    new = np.argsort(old)
    # Rings as far below the centre as above it: half a turn apart, both lie on one line with it.
    first, apart, opposite = 4 * around, 7 * around + around // 4, 7 * around + around // 2
    for second, is_told in ((apart, True), (opposite, False)):
        corr = sgmds.match(source, target, landmarks=[(int(v), int(new[v])) for v in (first, second)])
        said = [reason for reason in corr.quality.reasons if "turned about an axis" in reason]
        assert len(said) == (0 if is_told else 2)
        assert (corr.quality.grade == "green") == is_told
        if is_told:
            error = np.linalg.norm(images(corr, source) - source[0][old], axis=1)
            # An edge around the bar is 0.26 long.
            assert error.max() < 0.26


def test_bodies_and_solids_with_a_mark_do_not_turn_onto_themselves(slender):
    """A bump on one blade of a propeller, and not in its middle, tells all turns apart."""
    bump = turned_solid(
        lambda a, z: 1 + 0.5 * np.cos(2 * a) + 0.3 * np.exp(-20 * ((a - 2.8) ** 2 + (z - 0.8) ** 2)),
        height=1.0,
    )[:2]
    body = slender.vertices, slender.faces
    for source, target in (bump, (body, body)):
        reasons = sgmds.match(source, target).quality.reasons
        assert not any("turned about an axis" in reason for reason in reasons)


def test_a_cap_on_one_head_does_not_take_the_other_head_to_itself(resting):
    """Head and trunk are pieces; the source wears a cap, the target a scarf."""
    stout = characters.make("biped", "stout", "rest", resolution=2500, seed=4)

    def parts(body):
        height = body.vertices[:, 2] - body.vertices[:, 2].min()
        height /= height.max()
        return height > 0.81, height < 0.79, height > 0.9, (height > 0.82) & (height < 0.88)

    def pieces(body):
        return [offset(body.vertices, body.faces, part, 0.0) for part in parts(body)[:2]]

    cap = offset(resting.vertices, resting.faces, parts(resting)[2], 0.03)
    scarf = offset(stout.vertices, stout.faces, parts(stout)[3], 0.03)
    source, target = joined(*pieces(resting), cap), joined(*pieces(stout), scarf)
    corr = sgmds.match(source, target)
    heads = [len(pieces(body)[0][0]) for body in (resting, stout)]
    assert (source[1][corr.faces[: heads[1]]] < heads[0]).all()
