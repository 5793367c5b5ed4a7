"""The characters that demo and gallery show: their surfaces, and the maps of space that make them."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "gallery"))

from cast import anatomy, paint, people, sculpt, wardrobe  # noqa: E402


def euler(vertices, quads):
    edges = np.unique(np.sort(sculpt.edges(quads), axis=1), axis=0)
    return len(vertices) - len(edges) + len(quads)


def test_surface_of_a_sphere_is_one():
    ball = sculpt.ellipsoid((0.1, 0, 0), (0.5, 0.5, 0.5))
    vertices, quads = sculpt.surface(ball, (-0.5, -0.6, -0.6), (0.7, 0.6, 0.6), 0.07, 0.3)
    # Newton's steps end within the square of their last one.
    np.testing.assert_allclose(np.linalg.norm(vertices - (0.1, 0, 0), axis=1), 0.5, atol=1e-6)
    assert euler(vertices, quads) == 2 and len(sculpt.border_edges(quads)) == 0
    assert ((sculpt.normals(vertices, quads) * (vertices - (0.1, 0, 0))).sum(axis=1) > 0).all()


def test_trimmed_sphere_ends_at_the_plane():
    ball = sculpt.ellipsoid((0, 0, 0), (0.5, 0.5, 0.5))
    whole = sculpt.surface(ball, (-0.6,) * 3, (0.6,) * 3, 0.07)
    vertices, quads = sculpt.trimmed(ball, lambda points: points[:, 2] - 0.1, *whole)
    rim = np.unique(sculpt.border_edges(quads))
    np.testing.assert_allclose(vertices[rim, 2], 0.1, atol=2e-3)
    assert euler(vertices, quads) == 1
    thick, faces = sculpt.hemmed(vertices, quads, 0.02)
    assert len(thick) == len(vertices) + len(rim) and len(sculpt.border_edges(faces)) == len(rim)


@pytest.mark.parametrize("build", [people.MIA, people.BRUNO], ids=["Mia", "Bruno"])
def test_builds_keep_space_the_right_way_round(build):
    """At places on and over the skin the map's derivative has a positive determinant."""
    random = np.random.default_rng(0)
    bones = random.integers(0, len(anatomy.SKELETON), 3000)
    along = random.random((3000, 1))
    axis = anatomy.HEADS[bones] + along * (anatomy.TAILS - anatomy.HEADS)[bones]
    places = sculpt.laid_on(anatomy.skin_solid(), axis + 0.02 * random.standard_normal(axis.shape))
    for off in (0.0, 0.02):
        out = places + off * sculpt.gradient(anatomy.skin_solid(), places)
        step = 1e-5
        derivative = np.stack(
            [(build(out + step * e) - build(out - step * e)) / (2 * step) for e in np.eye(3)], 2
        )
        assert (np.linalg.det(derivative) > 0.0).mean() > 0.995


def test_plain_build_moves_nothing():
    plain = anatomy.Build({})
    places = anatomy.HEADS + (0.0, 0.01, 0.0)
    np.testing.assert_allclose(plain(places), places, atol=1e-12)
    np.testing.assert_allclose(plain.joints()[1], anatomy.TAILS, atol=1e-12)


def test_weights_sum_to_one_and_sides_mirror():
    places = wardrobe.hands(0.014, 0.0)[0]
    weights = anatomy.skin_weights(places)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    other = anatomy.skin_weights(places * (-1, 1, 1))
    swapped = [
        anatomy.INDEX[b.name[:-1] + {"L": "R", "R": "L"}.get(b.name[-1], b.name[-1])]
        for b in anatomy.SKELETON
    ]
    np.testing.assert_allclose(other, weights[:, swapped], atol=1e-9)


def test_painting_fills_what_a_triangle_covers():
    """Half of the image, in the colour that a linear brush has there."""
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
    layout = np.array([[(0.0, 0), (1, 0), (0, 1)]])

    def brush(places, normals):
        return np.column_stack([places[:, 0], places[:, 1], np.ones(len(places))])

    image = paint.painted(64, [(brush, corners, corners, np.array([[0, 1, 2]]), layout)])
    y, x = (np.mgrid[:64, :64] + 0.5) / 64
    inside = x + y < 1.0
    np.testing.assert_allclose(image[inside], np.stack([x, y, np.ones_like(x)], -1)[inside], atol=1e-6)
