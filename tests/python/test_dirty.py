"""Damaged meshes: the map of the clean part, with what was ignored reported, or an error that says what is
wrong.

The damage is done here, to a generated character; tests/reliability/folder.py measures a folder of files.
"""

import os

import numpy as np
import pytest
import sgmds
from hypothesis import given
from hypothesis import strategies as st
from sgmds import characters

# Mean distance to the clean mesh's map over √area, ×100, on what is left of it. The edges of these meshes are
# about 3.6 long in this unit: damage moves a map by less than half an edge on average, or it is not repaired.
SAME = 1.8
# Cutting away limbs changes the shape itself.
ALIKE = 5.0


@pytest.fixture(scope="module")
def body():
    """The mesh that is damaged; 1,500 vertices."""
    return characters.make("biped", "plain", "walk", resolution=1500, seed=2)


@pytest.fixture(scope="module")
def source():
    made = characters.make("biped", "slender", "wave", resolution=1500, seed=0)
    return sgmds.Shape(made.vertices, made.faces)


@pytest.fixture(scope="module")
def clean_map(source, body):
    return sgmds.match(source, (body.vertices, body.faces))


def nonmanifold_edge(v, f):
    fins = v[f[0, :2]].mean(axis=0) + [[0, 0.1, 0.1], [0, 0.1, -0.1]]
    n = len(v)
    return np.concatenate([v, fins]), np.concatenate([f, [[*f[0, :2], n], [*f[0, :2], n + 1]]]), {}


def nonmanifold_vertex(v, f):
    n = len(v)
    fan = v[0] + [[0.1, 0, 0], [0.1, 0.05, 0]]
    return np.concatenate([v, fan]), np.concatenate([f, [[0, n, n + 1]]]), {}


def isolated_vertices(v, f):
    loose = np.random.default_rng(0).normal(size=(25, 3))
    return np.concatenate([loose[:5], v, loose[5:]]), f + 5, {"isolated_vertices": 25}


def repeated_index(v, f):
    return v, np.concatenate([f, [[0, 0, 1], [2, 2, 2]]]), {"zero_area_faces": 2}


def vertices_on_edges(v, f):
    """Twenty edges with a vertex in their middle on one side, and the flat triangle that closes the gap."""
    v, f = v.copy(), f.copy()
    for i in range(0, 20 * 37, 37):
        a, b, c = f[i]
        m = len(v)
        v = np.concatenate([v, [(v[a] + v[b]) / 2]])
        f[i] = a, m, c
        f = np.concatenate([f, [[m, b, c], [a, b, m]]])
    return v, f, {"bridging_faces": 20}


def coincident_vertices(v, f):
    """Two neighbours moved together: two triangles without an area."""
    v = v.copy()
    v[f[10, 0]] = v[f[10, 1]]
    return v, f, {"bridging_faces": 2}


def needles(v, f, length=1e-4):
    """Every tenth vertex almost on top of a neighbour."""
    v = v.copy()
    for a, b in f[::30, :2]:
        v[a] = v[b] + length * (v[a] - v[b])
    return v, f, {}


def second_body(v, f):
    far = 0.6 * v + [3, 0, 0]
    return np.concatenate([v, far]), np.concatenate([f, f + len(v)]), {"dropped_components": 1}


def ground_plane(v, f):
    """Two triangles with more area than the body."""
    n = len(v)
    plane = [[-20, -20, -1], [20, -20, -1], [20, 20, -1], [-20, 20, -1]]
    return (
        np.concatenate([v, plane]),
        np.concatenate([f, [[n, n + 1, n + 2], [n, n + 2, n + 3]]]),
        {"dropped_components": 1, "dropped_component_vertices": 4},
    )


def loose_triangle(v, f):
    n = len(v)
    return np.concatenate([v, v[:3] + 2]), np.concatenate([f, [[n, n + 1, n + 2]]]), {"dropped_components": 1}


def stray_vertex(v, f):
    """A slip of the hand."""
    v = v.copy()
    v[700] += 1e4
    return v, f, {"stray_vertices": 1}


def stray_vertices(v, f):
    v = v.copy()
    v[::300] += 20 * np.random.default_rng(0).normal(size=(len(v[::300]), 3))
    return v, f, {"stray_vertices": len(v[::300])}


def far_triangle(v, f):
    """Of all the vertices' bounding box the body is a millionth."""
    n = len(v)
    far = np.concatenate([v, v[:3] + 1e6])
    return far, np.concatenate([f, [[n, n + 1, n + 2]]]), {"dropped_components": 1}


def cut_open(v, f):
    """Crown and feet cut away."""
    height = v[:, 2]
    low, high = height.min(), height.max()
    kept = (height > low + 0.05 * (high - low)) & (height < low + 0.95 * (high - low))
    return v, f[kept[f].all(axis=1)], {}


def holes(v, f):
    centres = v[::150]
    kept = (np.linalg.norm(v[f].mean(axis=1)[:, None] - centres, axis=2) > 0.06).all(axis=1)
    return v, f[kept], {}


def flipped(v, f):
    f = f.copy()
    f[::2] = f[::2, ::-1]
    return v, f, {"flipped_faces": len(f) // 2}


def duplicated(v, f):
    return v, np.concatenate([f, np.roll(f[:200], 1, axis=1), f[100:160]]), {"duplicate_faces": 260}


def inner_wall(v, f):
    """Faces between opposite sides of the body: edges with three faces, inside."""
    # Around the trunk: vertices of one height would be those of hands and legs too.
    near = np.argsort(np.linalg.norm(v - v.mean(axis=0), axis=1), kind="stable")[:60]
    walls = np.sort(np.random.default_rng(1).choice(near, (4, 3), replace=True), axis=1)
    walls = walls[(np.diff(walls, axis=1) > 0).all(axis=1)]
    return v, np.concatenate([f, walls]), {}


def huge(v, f):
    return 1e6 * v + 3e7, f, {}


def tiny(v, f):
    return 1e-6 * v, f, {}


def far_away(v, f):
    # 1e9 times its size from the origin: seven digits of every coordinate are left.
    return v + [1e9, -1e9, 1e9], f, {}


DAMAGE = {
    damage.__name__: (damage, bound)
    for bound, group in (
        (
            SAME,
            (
                nonmanifold_edge,
                nonmanifold_vertex,
                isolated_vertices,
                repeated_index,
                vertices_on_edges,
                coincident_vertices,
                needles,
                second_body,
                ground_plane,
                loose_triangle,
                stray_vertex,
                stray_vertices,
                far_triangle,
                holes,
                flipped,
                duplicated,
                huge,
                tiny,
                far_away,
            ),
        ),
        (ALIKE, (cut_open, inner_wall)),
    )
    for damage in group
}


def difference(source, first, second):
    """Mean distance between two lists of source vertices over √area, ×100."""
    points = source.vertices
    return 100 * np.linalg.norm(points[first] - points[second], axis=1).mean() / np.sqrt(source.mass.sum())


def assert_sound(corr, vertices, source):
    assert len(corr.faces) == len(vertices)
    assert (corr.faces >= 0).all() and (corr.faces < len(source.faces)).all()
    assert (corr.barycentric >= 0).all() and np.allclose(corr.barycentric.sum(axis=1), 1, atol=1e-9)
    assert ((0 <= corr.confidence) & (corr.confidence <= 1)).all()
    assert np.isfinite(corr.functional_map).all()


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_leaves_the_map_of_the_clean_part(name, body, source, clean_map, record_property):
    damage, bound = DAMAGE[name]
    vertices, faces, expected = damage(body.vertices, body.faces)
    target = sgmds.Shape(vertices, faces)
    for entry, count in expected.items():
        assert target.report[entry] == count, entry
    corr = sgmds.match(source, target)
    assert_sound(corr, vertices, source)
    first = 5 if name == "isolated_vertices" else 0
    n = len(body.vertices)
    own = np.isin(np.arange(first, first + n), faces)
    error = difference(source, corr.vertices[first : first + n][own], clean_map.vertices[own])
    record_property("error", round(float(error), 2))
    print(f"{name}: {error:.2f}, {corr.quality.grade}")
    assert error < bound
    said = [reason for reason in corr.quality.reasons if "of the target" in reason and "left out" in reason]
    assert len(said) == (target.report["dropped_components"] > 0)
    # What has no image of its own says so.
    assert (corr.confidence[~np.isin(np.arange(len(vertices)), faces)] == 0).all()


def test_damaged_source(body, clean_map, source):
    """The other way round: the damaged mesh carries the data."""
    back = sgmds.match((body.vertices, body.faces), source)
    for damage in (nonmanifold_edge, vertices_on_edges, flipped):
        vertices, faces, _ = damage(body.vertices, body.faces)
        corr = sgmds.match((vertices, faces), source)
        apart = np.linalg.norm(vertices[corr.vertices] - body.vertices[back.vertices], axis=1)
        area = sgmds.Shape(body.vertices, body.faces).mass.sum()
        assert 100 * apart.mean() / np.sqrt(area) < SAME


@pytest.mark.parametrize("scales", [((1, 1, 3), (1, 2, 0.5)), ((3, 1, 1), (0.5, 2, 1))])
def test_bodies_of_other_proportions_are_met_or_not_praised(body, scales):
    """Scaled unevenly one body is two, of which a map may well be wrong: then the grade must not be green."""
    source, target = (body.vertices * scale for scale in scales)
    order = np.random.default_rng(1).permutation(len(target))
    faces = np.argsort(order)[body.faces]
    corr = sgmds.match((source, body.faces), (target[order], faces))
    shape = sgmds.Shape(source, body.faces)
    assert corr.quality.grade != "green" or difference(shape, corr.vertices, order) < ALIKE


def bent(vertices, value):
    vertices = vertices.copy()
    vertices[7, 1] = value
    return vertices


REFUSED = {
    "nan": (lambda v, f: (bent(v, np.nan), f), "vertex 7 .*not finite.*repair"),
    "infinite": (lambda v, f: (bent(v, -np.inf), f), "vertex 7 .*not finite.*repair"),
    "empty": (lambda v, f: (v[:0], f[:0]), "no surface.*triangles"),
    "points only": (lambda v, f: (v, f[:0]), "no surface.*triangles"),
    "index too high": (lambda v, f: (v, np.concatenate([f, [[0, 1, len(v)]]])), "face .* refers to vertex"),
    "negative index": (lambda v, f: (v, np.concatenate([f, [[0, 1, -1]]])), "face .* refers to vertex -1"),
    "one triangle": (lambda v, f: (v[:3], np.array([[0, 1, 2]])), "3 vertices, at least .* merging"),
    "all in one place": (lambda v, f: (0 * v, f), "no surface"),
    "all on a line": (lambda v, f: (v * [1, 0, 0], f), "no surface"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_hopeless_meshes_are_refused_with_advice(name, body):
    damage, words = REFUSED[name]
    with pytest.raises(sgmds.MeshError, match=words):
        sgmds.Shape(*damage(body.vertices, body.faces))


def test_flat_mesh_is_matched_or_refused(body, source):
    """Folded into a plane: no left and right are left, so whatever comes out must not be proud."""
    try:
        corr = sgmds.match(source, (body.vertices * [1, 0, 1], body.faces))
    except sgmds.SgmdsError:
        return
    assert_sound(corr, body.vertices, source)
    assert corr.quality.grade != "green"


def test_needles_near_the_end_of_precision_are_matched_or_named(body, source, clean_map):
    vertices, faces, _ = needles(body.vertices, body.faces, 1e-7)
    try:
        corr = sgmds.match(source, (vertices, faces))
    except sgmds.MatchError as error:
        assert "clean up needle triangles" in str(error)
        return
    assert difference(source, corr.vertices, clean_map.vertices) < SAME


def test_loose_triangles(body, source, clean_map):
    """Confetti around the body: dropped and counted; its vertices get the nearest image, no confidence. A
    million of them in the long run."""
    random = np.random.default_rng(0)
    count = 1_000_000 if os.environ.get("HYPOTHESIS_PROFILE") == "long" else 20_000
    confetti = (random.normal(size=(count, 1, 3)) + 1e-3 * random.normal(size=(count, 3, 3))).reshape(-1, 3)
    n = len(body.vertices)
    vertices = np.concatenate([body.vertices, confetti])
    faces = np.concatenate([body.faces, n + np.arange(3 * count).reshape(-1, 3)])
    target = sgmds.Shape(vertices, faces)
    assert target.report["dropped_components"] == count
    corr = sgmds.match(source, target)
    assert difference(source, corr.vertices[:n], clean_map.vertices) < SAME
    assert corr.quality.figures["unmatched"] == 3 * count and (corr.confidence[n:] == 0).all()


@given(data=st.data())
def test_property_any_soup_is_prepared_or_refused(data):
    """Whatever triangles over whatever points: the call ends with sound arrays, or with an error of ours."""
    coordinate = st.one_of(
        st.integers(-3, 3).map(float), st.floats(-1, 1), st.floats(allow_nan=True, allow_infinity=True)
    )
    vertices = data.draw(st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=60))
    index = st.integers(0, len(vertices) - 1)
    faces = data.draw(st.lists(st.tuples(index, index, index), max_size=200))
    try:
        shape = sgmds.Shape(np.array(vertices), np.array(faces, dtype=np.int64).reshape(-1, 3))
    except sgmds.InternalError:
        raise
    except sgmds.SgmdsError:
        return
    assert np.isfinite(shape.eigenfunctions).all() and (np.diff(shape.eigenvalues) >= 0).all()
    assert (shape.mass >= 0).all() and np.isfinite(shape.geodesics).all()
