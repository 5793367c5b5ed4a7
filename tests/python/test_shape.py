"""Per-shape quantities against closed forms and other libraries."""

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
import sgmds


def cotangent_stiffness(vertices, faces):
    """Written from the textbook formula, for comparison only."""
    count = len(vertices)
    total = scipy.sparse.csr_matrix((count, count))
    for i in range(3):
        a, b, c = faces[:, i], faces[:, (i + 1) % 3], faces[:, (i + 2) % 3]
        u, v = vertices[b] - vertices[a], vertices[c] - vertices[a]
        weight = (u * v).sum(axis=1) / np.linalg.norm(np.cross(u, v), axis=1) / 2
        half = scipy.sparse.coo_matrix((weight, (b, c)), shape=(count, count)).tocsr()
        total = total + half + half.T
    return scipy.sparse.diags(np.asarray(total.sum(axis=1)).ravel()) - total


@pytest.fixture(scope="module")
def body(slender):
    return sgmds.Shape(slender.vertices, slender.faces)


def test_eigenpairs_agree_with_scipy(body, slender):
    stiffness = cotangent_stiffness(slender.vertices, slender.faces)
    mass = scipy.sparse.diags(body.mass)
    count = 40
    expected = scipy.sparse.linalg.eigsh(stiffness.tocsc(), count, mass.tocsc(), sigma=-1e-8)[0]
    np.testing.assert_allclose(body.eigenvalues[1:count], expected[1:], rtol=1e-7)
    residual = stiffness @ body.eigenfunctions - mass @ body.eigenfunctions * body.eigenvalues
    norms = np.sqrt((residual**2 / body.mass[:, None]).sum(axis=0))
    # The core promises 1e-8 of the largest eigenvalue it computed, of which these are the first.
    assert norms.max() <= 2e-8 * body.eigenvalues[-1]


def test_eigenfunctions_are_orthonormal_and_mass_sums_to_the_area(body, slender):
    gram = body.eigenfunctions.T @ (body.mass[:, None] * body.eigenfunctions)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-9)
    a, b, c = (slender.vertices[slender.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    np.testing.assert_allclose(body.mass.sum(), area, rtol=1e-9)


def test_sphere_spectrum(sphere):
    shape = sgmds.Shape(*sphere)
    expected = np.concatenate([[degree * (degree + 1)] * (2 * degree + 1) for degree in range(5)])
    # Second order in the edge length, 0.07 here: relative errors grow like h² λ / 12.
    np.testing.assert_allclose(shape.eigenvalues[1:25], expected[1:25], rtol=0.02)


def test_geodesics_agree_with_exact_ones(body, slender):
    geodesic = pytest.importorskip("pygeodesic.geodesic")
    exact = geodesic.PyGeodesicAlgorithmExact(slender.vertices, slender.faces)
    rows = np.stack([exact.geodesicDistances(np.array([s], np.int32), None)[0] for s in body.samples[:6]])
    rows = rows[:, body.samples]
    apart = rows > 0
    errors = np.abs(body.geodesics[:6] - rows)[apart] / rows[apart]
    # First-order marching on 2,500 vertices: about 0.5 % on average.
    assert errors.mean() < 0.015


def test_geodesics_on_the_sphere(sphere):
    shape = sgmds.Shape(*sphere)
    points = sphere[0][shape.samples]
    arcs = np.arccos(np.clip(points @ points.T, -1, 1))
    # Chords instead of arcs shorten by h²/24, marching lengthens by some 0.5 %.
    np.testing.assert_allclose(shape.geodesics, arcs, atol=0.02 * np.pi)


def test_scaling_laws(body, slender):
    larger = sgmds.Shape(3 * slender.vertices, slender.faces)
    np.testing.assert_allclose(larger.eigenvalues[1:] * 9, body.eigenvalues[1:], rtol=1e-6)
    np.testing.assert_allclose(larger.mass, 9 * body.mass, rtol=1e-9)
    np.testing.assert_allclose(larger.geodesics, 3 * body.geodesics, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_a_size_without_an_area_is_refused(slender, scale):
    with pytest.raises(sgmds.MeshError, match="units large"):
        sgmds.Shape(scale * slender.vertices, slender.faces)


@pytest.mark.parametrize("kind", [np.int16, np.float32])
def test_coordinates_of_any_kind_of_number_are_taken(slender, kind):
    """Also where the difference of two leaves the range of the kind."""
    vertices = slender.vertices - (slender.vertices.max(axis=0) + slender.vertices.min(axis=0)) / 2
    vertices = (np.iinfo(np.int16).max / np.abs(vertices).max() * vertices).astype(kind)
    area = sgmds.Shape(vertices, slender.faces).mass.sum()
    assert area == sgmds.Shape(vertices.astype(float), slender.faces).mass.sum()


def test_saved_shape_comes_back(body, tmp_path):
    path = tmp_path / "shape.bin"
    body.save(path)
    again = sgmds.Shape.load(path)
    for name in ("eigenvalues", "eigenfunctions", "mass", "samples", "geodesics"):
        assert np.array_equal(getattr(again, name), getattr(body, name))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(sgmds.SgmdsError):
        sgmds.Shape.load(path)


def test_scale_invariant_metric_on_the_sphere(sphere):
    shape = sgmds.Shape(*sphere, metric="scale-invariant")
    # |K| is constant, so only the unit changes, and with it the area: λ · area = 4π l(l + 1).
    expected = np.concatenate([[degree * (degree + 1)] * (2 * degree + 1) for degree in range(5)])
    found = shape.eigenvalues[1:25] * shape.mass.sum() / (4 * np.pi)
    np.testing.assert_allclose(found, expected[1:25], rtol=0.03)
    points = sphere[0][shape.samples]
    arcs = np.arccos(np.clip(points @ points.T, -1, 1))
    scale = np.sqrt(shape.mass.sum() / (4 * np.pi))
    np.testing.assert_allclose(shape.geodesics / scale, arcs, atol=0.03 * np.pi)
    # ∫|K| = 4π by Gauss and Bonnet, and |K| is raised a little to stay above zero.
    assert 4 * np.pi < shape.mass.sum() < 1.2 * 4 * np.pi


def test_scale_invariant_metric_has_no_unit(slender):
    # Four times is exact in binary, so that no decision of the marching falls otherwise.
    shape, larger = (
        sgmds.Shape(s * slender.vertices, slender.faces, metric="scale-invariant") for s in (1, 4)
    )
    for name in ("eigenvalues", "mass", "geodesics", "distance_operator"):
        np.testing.assert_allclose(getattr(larger, name), getattr(shape, name), rtol=1e-12, atol=1e-12)


def test_scale_invariant_shape_is_saved_with_its_metric(slender, tmp_path):
    shape = sgmds.Shape(slender.vertices, slender.faces, metric="scale-invariant")
    shape.save(tmp_path / "shape.bin")
    again = sgmds.Shape.load(tmp_path / "shape.bin")
    assert again.metric == "scale-invariant"
    for name in ("eigenvalues", "eigenfunctions", "mass", "geodesics", "distance_operator"):
        assert np.array_equal(getattr(again, name), getattr(shape, name))


def test_unknown_metric_is_refused(slender):
    with pytest.raises(sgmds.SgmdsError, match="metric"):
        sgmds.Shape(slender.vertices, slender.faces, metric="minkowski")


def test_masked_entries_are_refused(sphere):
    """What lies under the mask is anything, often 1e20, and would be taken for data."""
    vertices, faces = sphere
    masked = np.ma.array(vertices, mask=False)
    assert len(sgmds.Shape(masked, faces).vertices) == len(vertices)
    masked[3] = np.ma.masked
    with pytest.raises(sgmds.ArgumentError, match="`vertices` has masked entries"):
        sgmds.Shape(masked, faces)
    with pytest.raises(sgmds.ArgumentError, match="`uv` has masked entries"):
        sgmds.uv_islands(vertices, faces, np.ma.masked_less(vertices[faces][..., :2], 0))
