"""Surfaces that lie on one another: what is known of them comes out."""

import numpy as np
import pytest
import sgmds
from sgmds import characters


@pytest.fixture(scope="module")
def character():
    return characters.make("biped", "plain", "wave", resolution=2000, seed=3)


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
