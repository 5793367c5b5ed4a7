"""Rigs fitted along known maps, and surfaces that lie on one another: what is known of either comes out."""

import numpy as np
import pytest
import sgmds
from sgmds import characters

MIRROR = np.diag((-1.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def character():
    return characters.make("biped", "plain", "wave", resolution=2000, seed=3)


def rig_of(character):
    """Heads, tails, weights and parents of a character's bones, and more bones that hold nothing.

    These are a root on the ground, a control along the first bone's, a pole in front of a knee, which a bone
    looks at, and an end of a hand without a length. Leads and number of the first of them come last.
    """
    body, bones = character.body, characters.SKELETONS["biped"]
    names = [bone.name for bone in bones]
    count = len(names)
    low = character.vertices[:, 2].min()
    root, knee, hand = np.array((0.0, 0.0, low)), names.index("shin.L"), names.index("hand.L")
    pole = body.starts[knee] + (0.0, -0.5, 0.0)
    heads = np.vstack([body.starts, root, body.starts[0], pole, body.ends[hand]])
    tails = np.vstack(
        [body.ends, root + (0.0, -0.2, 0.0), body.ends[0] + (0.0, 0.1, 0.0), pole + (0, 0, 0.1), heads[-1]]
    )
    parents = [-1 if bone.parent is None else names.index(bone.parent) for bone in bones]
    parents = [count if parent < 0 else parent for parent in parents] + [-1, count, count, hand]
    weights = np.hstack([character.weights, np.zeros((len(character.vertices), 4))])
    return heads, tails, weights, parents, [(count + 2, knee)], count


def to_itself(vertices, faces, moved, mirrored=False):
    """The map of a mesh to itself with its vertices moved, and turned inside out if they are mirrored."""
    triangle, corner = np.zeros(len(vertices), int), np.zeros(len(vertices), int)
    for k in range(3):
        triangle[faces[:, k]], corner[faces[:, k]] = np.arange(len(faces)), k
    target = moved, faces[:, ::-1] if mirrored else faces
    return sgmds.SurfaceMap((vertices, faces), target, triangle, np.eye(3)[corner])


def a_turn(seed):
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_similarity_takes_all_bones_with_it(character, mirrored):
    """Those that hold nothing and those without a length too, and axes stay right-handed ones."""
    heads, tails, weights, parents, leads, first = rig_of(character)
    turn = a_turn(1) @ (MIRROR if mirrored else np.eye(3))
    shift = np.array((3.0, -1.0, 0.5))
    moved = 2.0 * character.vertices @ turn.T + shift
    way = to_itself(character.vertices, character.faces, moved, mirrored)
    ups = np.random.default_rng(2).normal(size=heads.shape)
    found = way.fit_bones(heads, tails, weights, parents, ups=ups, leads=leads)
    # Roundings of a body of size 2, of turns fitted to it.
    np.testing.assert_allclose(found.heads, 2.0 * heads @ turn.T + shift, atol=1e-8)
    np.testing.assert_allclose(found.tails, 2.0 * tails @ turn.T + shift, atol=1e-8)
    np.testing.assert_allclose(found.turns, np.broadcast_to(turn, found.turns.shape), atol=1e-7)
    np.testing.assert_allclose(found.scales, 2.0, rtol=1e-8)
    assert found.firm.tolist() == [number != first for number in range(len(heads))]
    np.testing.assert_allclose(
        found.axes @ found.axes.transpose(0, 2, 1), np.broadcast_to(np.eye(3), found.axes.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(found.axes), 1.0, rtol=1e-12)
    # y along the bone and z in the plane of it and what was up.
    along = found.tails - found.heads
    length = np.linalg.norm(along, axis=1)
    np.testing.assert_allclose(along, length[:, None] * found.axes[:, :, 1], atol=1e-8)
    across = np.einsum("bi,bi->b", found.axes[:, :, 0], ups @ turn.T)
    np.testing.assert_allclose(across[length > 0.0], 0.0, atol=1e-7)


def test_a_bone_that_holds_nothing_keeps_how_it_stands_to_its_neighbour(character):
    """On a body that is half as tall again, where bones turn and grow each by itself."""
    heads, tails, weights, parents, leads, first = rig_of(character)
    way = to_itself(character.vertices, character.faces, character.vertices * (1.0, 1.0, 1.5))
    found = way.fit_bones(heads, tails, weights, parents, leads=leads)
    beside = {first + 1: 0, first + 2: leads[0][1]}
    for bone, other in beside.items():
        assert found.scales[bone] == found.scales[other]
        wanted = found.scales[other] * found.turns[other] @ (tails[bone] - heads[bone])
        np.testing.assert_allclose(found.tails[bone] - found.heads[bone], wanted, atol=1e-12)
    # What was one joint is one.
    for bone, parent in enumerate(parents[:first]):
        if parent < first and np.allclose(heads[bone], tails[parent]):
            np.testing.assert_array_equal(found.heads[bone], found.tails[parent])


def test_a_rig_that_moves_nothing_goes_with_the_surface(character):
    heads, tails, weights, parents, _, _ = rig_of(character)
    turn = a_turn(4)
    way = to_itself(character.vertices, character.faces, 0.5 * character.vertices @ turn.T)
    found = way.fit_bones(heads, tails, 0.0 * weights, parents)
    np.testing.assert_allclose(found.heads, 0.5 * heads @ turn.T, atol=1e-8)
    assert found.firm.all()
    none = way.fit_bones(np.zeros((0, 3)), np.zeros((0, 3)), weights[:, :0], [])
    assert none.heads.shape == (0, 3) and none.axes.shape == (0, 3, 3)


def test_a_mirror_makes_both_sides_alike():
    """One half of the target is right and the other is shifted: the one that the map knows counts."""
    character = characters.make("biped", "plain", "rest", resolution=2000, seed=3)
    names = [bone.name for bone in characters.SKELETONS["biped"]]
    body, count = character.body, len(names)
    flipped = [name[:-1] + {"L": "R", "R": "L"}[name[-1]] if name[-2:-1] == "." else "" for name in names]
    partners = [names.index(other) if other else -1 for other in flipped]
    # The map leads to the left half alone: there is nothing of the target on the right.
    left = character.vertices[:, 0] >= -1e-9
    if body.starts[names.index("hand.L"), 0] < 0.0:
        left = character.vertices[:, 0] <= 1e-9
    kept = left[character.faces].all(axis=1)
    faces = character.faces[kept]
    used, renumbered = np.unique(faces, return_inverse=True)
    triangle, corner = np.zeros(len(character.vertices), int), np.zeros(len(character.vertices), int)
    for k in range(3):
        triangle[character.faces[:, k]], corner[character.faces[:, k]] = np.arange(len(character.faces)), k
    shift = np.eye(4)
    shift[0, 3] = 0.3
    way = sgmds.SurfaceMap(
        (character.vertices, character.faces),
        (1.2 * character.vertices[used] + shift[:3, 3], renumbered.reshape(-1, 3)),
        triangle[used],
        np.eye(3)[corner[used]],
    )
    reflection = shift @ np.diag((-1.0, 1.0, 1.0, 1.0)) @ np.linalg.inv(shift)
    parents = np.full(count, -1)
    given = body.starts, body.ends, character.weights, parents
    found = way.fit_bones(*given, partners=partners, mirrors=(MIRROR, reflection))
    sided = np.flatnonzero(np.array(partners) >= 0)
    for ends in (found.heads, found.tails):
        other = ends @ reflection[:3, :3].T + reflection[:3, 3]
        # Both come from one joint of the half that is there.
        np.testing.assert_allclose(ends[np.array(partners)[sided]], other[sided], atol=1e-12)
        # And that half is the source's, as large again by a fifth.
    np.testing.assert_allclose(
        found.heads[sided], 1.2 * body.starts[sided] + shift[:3, 3], atol=0.02 * np.ptp(character.vertices)
    )


def test_rigs_that_do_not_fit_together_are_refused(character):
    heads, tails, weights, parents, leads, _ = rig_of(character)
    way = to_itself(character.vertices, character.faces, character.vertices)
    given = {"heads": heads, "tails": tails, "weights": weights, "parents": parents, "leads": leads}
    count = len(parents)
    circle = np.arange(count) - 1
    circle[0] = count - 1
    for changed, words in (
        ({"heads": heads[1:]}, rf"`heads` should be \({count}, 3\)"),
        ({"tails": tails * np.nan}, "`tails` should be finite"),
        ({"ups": heads[:, :2]}, "`ups`"),
        ({"weights": weights[:, 1:]}, "`weights`"),
        ({"weights": np.full_like(weights, np.inf)}, "`weights` should be finite"),
        ({"parents": circle}, f"`parents` of {count} bones should be bones above them"),
        ({"parents": np.full(count, count)}, f"`parents` of {count} bones should be bones above them"),
        ({"leads": [(0, count)]}, "`leads` names a bone that there is not"),
        ({"leads": [(-1, 0)]}, "`leads` names a bone that there is not"),
        ({"partners": np.full(count, -2)}, "`partners` names a bone that there is not"),
        ({"sided": [True]}, "`sided`"),
        ({"mirrors": np.eye(3)}, "`mirrors` should be two matrices"),
        ({"mirrors": (np.eye(3), np.eye(3))}, r"`mirrors\[1\]` should be \(4, 4\)"),
        ({"mirrors": (np.eye(3) * np.nan, np.eye(4))}, r"`mirrors\[0\]` should be finite"),
    ):
        with pytest.raises(sgmds.ArgumentError, match=words):
            way.fit_bones(**{**given, **changed})


def box(divisions=3):
    """A box of sides 1, 1.5 and 2.5, each a grid of squares cut in two: vertices and triangles."""
    square = [(i, j) for i in range(divisions) for j in range(divisions)]
    corners = []
    for axis in range(3):
        for side in (0.0, 1.0):
            for i, j in square:
                ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                quad = [np.insert(np.array(place) / divisions, axis, side) for place in ring]
                quad = quad if (side > 0.5) == (axis != 1) else quad[::-1]
                corners += [quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]]
    vertices, triangles = np.unique(np.round(corners, 9), axis=0, return_inverse=True)
    return vertices * (1.0, 1.5, 2.5), triangles.reshape(-1, 3)


def corners_of(triangles):
    return triangles.ravel(), np.arange(triangles.size).reshape(-1, 3)


def on_blurred_places(source, target, places):
    """The map of a target to the triangles of the source whose middles are nearest to its blurred places."""
    vertices, triangles = source
    blurred = places + np.random.default_rng(6).normal(scale=0.01, size=places.shape)
    middles = vertices[triangles].mean(axis=1)
    faces = [np.linalg.norm(middles - place, axis=1).argmin() for place in blurred]
    return sgmds.SurfaceMap(source, target, faces, np.full((len(faces), 3), 1.0 / 3.0))


def sides(corners):
    """Unit normals of triangles (m, 3, 3)."""
    normals = np.cross(*np.diff(corners, axis=1).transpose(1, 0, 2))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_corners_of_a_piece_lie_on_their_side_of_an_edge():
    """Of a piece of a box, as both stand in one place."""
    vertices, triangles = box()
    piece = triangles[vertices[triangles][:, :, 2].max(axis=1) < 1.7]
    used, own = np.unique(piece, return_inverse=True)
    own = own.reshape(-1, 3)
    way = on_blurred_places((vertices, triangles), (vertices[used], own), vertices[used])
    found = way.coincidence(*corners_of(own))
    np.testing.assert_array_equal(found.to_target, np.eye(4))
    assert found.there.all()
    lying = np.einsum("ij,ijc->ic", found.barycentric, vertices[triangles[found.faces]])
    np.testing.assert_allclose(lying, vertices[piece.ravel()], atol=1e-12)
    wanted = np.repeat(sides(vertices[piece]), 3, axis=0)
    np.testing.assert_allclose(sides(vertices[triangles[found.faces]]), wanted, atol=1e-12)


def test_a_piece_that_was_moved_is_laid_back(character):
    """Turned, scaled and moved as a whole, under a map that is off by triangles."""
    vertices, triangles = character.vertices, character.faces
    piece = triangles[vertices[triangles][:, :, 2].min(axis=1) > np.median(vertices[:, 2])]
    used, own = np.unique(piece, return_inverse=True)
    own, motion = own.reshape(-1, 3), np.eye(4)
    motion[:3, :3], motion[:3, 3] = 1.3 * a_turn(5), (4.0, -2.0, 1.0)
    target = vertices[used] @ motion[:3, :3].T + motion[:3, 3]
    found = on_blurred_places((vertices, triangles), (target, own), vertices[used]).coincidence(
        *corners_of(own)
    )
    # What the rounds leave is rounding.
    np.testing.assert_allclose(found.to_target, motion, atol=1e-9)
    assert found.there.all()
    lying = np.einsum("ij,ijc->ic", found.barycentric, vertices[triangles[found.faces]])
    np.testing.assert_allclose(lying, vertices[piece.ravel()], atol=1e-9)


def test_what_lies_elsewhere_is_not_taken_for_the_same_surface(character):
    taller = to_itself(character.vertices, character.faces, character.vertices * (1.0, 1.0, 1.2))
    assert taller.coincidence(*corners_of(character.faces)) is None
    vertices, triangles = box()
    corners = corners_of(triangles)
    # A piece that was modelled anew does not lie there, the rest does.
    bulged = vertices.copy()
    bulged[vertices[:, 2] > 2.4, 2] += 0.1
    found = to_itself(vertices, triangles, bulged).coincidence(*corners)
    np.testing.assert_array_equal(found.there, (vertices[:, 2] < 2.4)[triangles.ravel()])
    # Nor does a corner whose image is on another part.
    far = triangles[np.zeros(len(vertices), int)]
    strange = sgmds.SurfaceMap(
        (vertices, triangles), (vertices, triangles), np.zeros(len(vertices)), np.eye(3)[[0] * len(vertices)]
    )
    found = strange.coincidence(*corners)
    away = np.linalg.norm(vertices - vertices[far[:, 0]], axis=1)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    np.testing.assert_array_equal(found.there, (away < 0.2 * size)[triangles.ravel()])


def test_corners_that_do_not_fit_are_refused():
    vertices, triangles = box()
    way = to_itself(vertices, triangles, vertices)
    given, filled = corners_of(triangles)
    for call, words in (
        (lambda: way.coincidence(given + len(vertices), filled), "`corner_vertices` should be from 0"),
        (lambda: way.coincidence(given, filled - 1), "`triangle_corners` should be from 0"),
        (lambda: way.coincidence(given, filled[:, :2]), "`triangle_corners`"),
        (
            lambda: way.coincidence(given, filled, np.zeros((4, 4))),
            "`standing` should be a matrix with an inv",
        ),
        (lambda: way.coincidence(given, filled, np.eye(3)), r"`standing` should be \(4, 4\)"),
        (lambda: way.coincidence(given, filled, np.eye(4) * np.nan), "`standing` should be finite"),
    ):
        with pytest.raises(sgmds.ArgumentError, match=words):
            call()
    assert way.coincidence([], np.zeros((0, 3), int)).there.shape == (0,)
