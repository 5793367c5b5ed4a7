"""Generated characters: closed bodies whose correspondences are exact."""

import sys

import numpy as np
import pytest
import sgmds
from sgmds import characters


def edges_of(faces):
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)


@pytest.mark.parametrize("kind", ["biped", "quadruped"])
@pytest.mark.parametrize("build, pose", [("slender", "wave"), ("stout", "walk"), ("plain", "rest")])
def test_is_one_closed_body_without_handles(kind, build, pose):
    character = characters.make(kind, build, pose, resolution=3000, seed=3)
    edges, uses = edges_of(character.faces)
    assert (uses == 2).all()
    # Limbs that touch would add a handle.
    assert len(character.vertices) - len(edges) + len(character.faces) == 2


@pytest.mark.parametrize(
    ("module", "work"),
    [
        ("skimage", lambda character: characters.make(resolution=100)),
        ("scipy", lambda character: characters.truth_vertices(character, character)),
    ],
)
def test_a_missing_package_is_named_with_its_extra(slender, monkeypatch, module, work):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf'{module} is missing: pip install "\.\[tools\]"'):
        work(slender)


def test_vertices_lie_on_the_surface_and_faces_look_outward(slender):
    distance, gradient, _ = slender.body.distance(slender.vertices)
    # Three Newton steps on a function of slope near 1.
    assert np.abs(distance).max() < 1e-6
    a, b, c = (slender.vertices[slender.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    assert ((normals * gradient[slender.faces[:, 0]]).sum(axis=1) > 0).mean() > 0.99


def test_truth_keeps_the_address(slender, stout):
    ids, points = characters.truth(slender, stout)
    assert len(ids) > 0.1 * len(slender.vertices)
    along, angle = stout.body.address(points, slender.part[ids])
    np.testing.assert_allclose(along, slender.axial[ids], atol=1e-12)
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * slender.angle[ids]), atol=1e-12)
    # Bisection over 0.13 lengths, forty halvings, and the gradient's slope.
    assert np.abs(stout.body.distance(points)[0]).max() < 1e-6


def test_truth_of_a_character_with_itself_is_the_identity(slender):
    ids, points = characters.truth(slender, slender)
    # Newton left the vertices within 1e-6 of the surface; a slanted one shifts a little more along the ray.
    assert np.abs(points - slender.vertices[ids]).max() < 1e-5


def test_truth_keeps_orientation(slender, stout):
    """Along a bone and around it turn the same way on both: the truth is not a mirrored map."""
    ids, points = characters.truth(slender, stout)
    image = np.full(slender.vertices.shape, np.nan)
    image[ids] = points
    parts = slender.part[slender.faces]
    # Across a joint two bones have addresses of their own, so a triangle there may fold.
    whole = np.isfinite(image[slender.faces]).all(axis=(1, 2)) & (parts == parts[:, :1]).all(axis=1)
    a, b, c = (image[slender.faces[whole, i]] for i in range(3))
    outward = stout.body.distance(a)[1]
    assert whole.sum() > 100
    # Coarse triangles lean in the creases at a joint; a mirrored map would keep next to none.
    assert ((np.cross(b - a, c - a) * outward).sum(axis=1) > 0).mean() > 0.95


def test_points_are_carried_to_their_counterparts_and_back(slender, stout):
    there = characters.carried(slender.vertices, slender.body, stout.body)
    assert np.abs(stout.body.distance(there)[0]).max() < 1e-6
    size = np.linalg.norm(np.ptp(stout.vertices, axis=0))
    ids, points = characters.truth(slender, stout)
    # Shares of other bones are up to a fifth where an address is exact, and move points by that much of
    # what these bones' own motions differ: a thousandth of the body on average for these two.
    assert np.linalg.norm(there[ids] - points, axis=1).mean() < 2e-3 * size
    back = characters.carried(there, stout.body, slender.body)
    # Steps are of first order, 64 in all, each off by some 1e-5. In the crease of a joint that closes
    # points may change sides, so that the mean says less than the median.
    away = np.linalg.norm(back - slender.vertices, axis=1)
    assert np.median(away) < 6e-4 * size


def test_corresponding_points_have_equal_weights(slender, stout):
    points = characters.carried(slender.vertices, slender.body, stout.body)
    nearest = np.linalg.norm(stout.vertices[None] - points[:, None], axis=2).argmin(axis=1)
    wrong = np.abs(stout.weights[nearest] - slender.weights).sum(axis=1) / 2
    # Weights fall from 1 to 0 over some 0.1 lengths; a vertex lies within half an edge, 0.02.
    assert wrong.mean() < 0.1


def test_a_body_of_another_kind_has_no_common_points(slender):
    with pytest.raises(ValueError, match="quadruped"):
        characters.carried(slender.vertices, slender.body, characters.make("quadruped", resolution=500).body)


def test_weights_sum_to_one_and_uvs_stay_in_their_island(slender):
    np.testing.assert_allclose(slender.weights.sum(axis=1), 1, rtol=1e-12)
    assert (slender.weights >= 0).all()
    assert slender.uv.shape == (len(slender.faces), 3, 2)
    columns = int(np.ceil(np.sqrt(len(slender.body.names))))
    cells = np.floor(slender.uv * columns)
    # All corners of a triangle fall in the cell of one bone.
    assert (cells == cells[:, :1]).all()
    assert (0 <= slender.uv).all() and (slender.uv <= 1).all()


def test_same_call_same_mesh_and_other_seed_other_mesh():
    first, again, other = (characters.make(resolution=1500, seed=s) for s in (5, 5, 6))
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)


def test_resolution_is_met_within_a_tenth():
    for wanted in (2000, 30_000):
        made = len(characters.make("quadruped", resolution=wanted).vertices)
        assert abs(made - wanted) < 0.1 * wanted


def test_unknown_names_are_told():
    with pytest.raises(ValueError, match="biped, quadruped"):
        characters.make("snake")
    with pytest.raises(ValueError, match="wing"):
        characters.make(build={"wing": (1, 1)})


@pytest.mark.parametrize(
    "wrong", [{"kind": "fish"}, {"build": "round"}, {"pose": "sits"}, {"resolution": 10}]
)
def test_what_cannot_be_made_is_named(wrong):
    (name,) = wrong
    with pytest.raises(sgmds.ArgumentError, match=f"`{name}`"):
        characters.make(**wrong)
