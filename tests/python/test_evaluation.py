"""The protocol on a folder made here, against a second computation of it by other means."""

import json
import re
import shutil
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import sgmds
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from sgmds import characters
from sgmds.cli import main
from sgmds.evaluation import TruthDistances, evaluate, find_sets, random_rotation, sparsification


def write_off(path, vertices, faces):
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(repr(float(x)) for x in v) for v in vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, slender, stout):
    """A set of two shapes in `corr` form, with a line that does not exist on one, and a saved map."""
    root = tmp_path_factory.mktemp("sets") / "BODIES"
    (root / "corr").mkdir(parents=True)
    (root / "maps" / "TRUE").mkdir(parents=True)
    ids, images = characters.truth_vertices(stout, slender)
    for name, shape, column in (("stout1", stout, ids), ("slender1", slender, images)):
        write_off(root / f"{name}.off", shape.vertices, shape.faces)
        column = np.append(column, -1 if name == "stout1" else 5)
        np.savetxt(root / "corr" / f"{name}.txt", column, fmt="%d")
        np.savetxt(root / "corr" / f"{name}.sym.txt", column[::-1], fmt="%d")
    (root / "pairs.txt").write_text("stout1 slender1\n\n")
    saved = np.full(len(stout.vertices), -1)
    saved[ids] = images
    np.savetxt(root / "maps" / "TRUE" / "stout1__slender1.txt", saved, fmt="%d")
    return root


def test_true_map_has_no_error(folder):
    pair = evaluate(folder, method="saved:TRUE").pairs[0]
    assert pair.direct == 0 and pair.status == "right" and pair.matched == 1 and pair.lines == 400


def test_a_set_may_be_asked_for_by_name_where_the_folder_is_the_set_itself(folder):
    assert [found.folder for found in find_sets(folder, [folder.name])] == [folder]
    with pytest.raises(sgmds.SgmdsError, match="no set named OTHER"):
        find_sets(folder, ["OTHER"])


def published(root, bodies, to="corres"):
    """A set as remeshed ones are published: meshes in `off`, a file of ids that count from 1 for each."""
    (root / "off").mkdir(parents=True)
    (root / to).mkdir()
    for name, (shape, ids) in bodies.items():
        write_off(root / "off" / f"{name}.off", shape.vertices, shape.faces)
        if ids is not None:
            np.savetxt(root / to / f"{name}.vts", ids + 1, fmt="%d")
    return root


def truths(root):
    """Columns of the truth of each pair of a set."""
    (found,) = find_sets(root)
    told = {}
    for a, b in found.pairs():
        truth = found.truth(a, b, len(found.mesh(a)[0]), lines=None)
        told[a, b] = np.stack([truth.a, truth.b], axis=1)
    return told


def test_published_sets_are_read_as_they_come(tmp_path, slender, stout):
    ids, images = characters.truth_vertices(stout, slender)
    bodies = {"stout1": (stout, ids), "slender1": (slender, images)}
    there = np.stack([ids, images], axis=1)
    told = truths(published(tmp_path / "BODIES_r", bodies))
    assert set(told) == {("stout1", "slender1"), ("slender1", "stout1")}
    np.testing.assert_array_equal(told["stout1", "slender1"], there)
    np.testing.assert_array_equal(told["slender1", "stout1"], there[:, ::-1])
    # Pairs that are asked for, and one list for each class.
    (tmp_path / "BODIES_r" / "test_pairs.txt").write_text("slender1,stout1\n")
    assert set(truths(tmp_path / "BODIES_r")) == {("slender1", "stout1")}
    classes = tmp_path / "CLASSES"
    for kind in ("stout", "slender"):
        shape, lines = bodies[f"{kind}1"]
        inner = {f"{kind}1": (shape, lines), f"{kind}2": (shape, lines[::-1])}
        published(tmp_path / kind, inner)
        shutil.copytree(tmp_path / kind / "off", classes / "off" / kind)
        shutil.copytree(tmp_path / kind / "corres", classes / "corres" / kind)
    told = truths(classes)
    names = [(f"{kind}/{kind}{k}", f"{kind}/{kind}{3 - k}") for kind in ("slender", "stout") for k in (1, 2)]
    assert list(told) == names
    np.testing.assert_array_equal(told[names[0]], np.stack([images, images[::-1]], axis=1))
    # Between classes lines agree only through the map of their references: here the third line belongs to the
    # last, and the last but one to none.
    (classes / "test_pairs.txt").write_text("slender/slender1,stout/stout1\nstout/stout1,slender/slender1\n")
    with pytest.raises(sgmds.SgmdsError, match="no truth for the pair slender/slender1 stout/stout1"):
        truths(classes)
    between = np.arange(len(ids))
    between[2], between[-2] = len(ids) - 1, -1
    (classes / "corres" / "cross_category_corres").mkdir()
    path = classes / "corres" / "cross_category_corres" / "slender_stout.vts"
    np.savetxt(path, between + 1, fmt="%d")
    # 0 stands for a line without partner, and counts from 1 like the others.
    there = np.stack([images, ids[between]], axis=1)[between >= 0]
    told = truths(classes)
    np.testing.assert_array_equal(told["slender/slender1", "stout/stout1"], there)
    np.testing.assert_array_equal(told["stout/stout1", "slender/slender1"], there[:, ::-1])
    np.savetxt(path, between[:-1] + 1, fmt="%d")
    with pytest.raises(sgmds.SgmdsError, match="are not a line of stout/stout1"):
        truths(classes)


def test_maps_between_two_are_read_whichever_has_as_many_lines(tmp_path, slender, stout):
    ids, images = characters.truth_vertices(stout, slender)
    bodies = {"stout1": (stout, None), "slender1": (slender, None)}
    root = published(tmp_path / "set", bodies)
    lines = np.zeros(len(stout.vertices), dtype=int)
    lines[ids] = images + 1
    there = np.stack([ids, images], axis=1)[np.argsort(ids)]
    for name in ("stout1_slender1", "slender1_stout1"):
        np.savetxt(root / "corres" / f"{name}.map", lines, fmt="%d")
        # Without a list those are asked for of which there is a map.
        assert list(truths(root)) == [tuple(name.split("_"))]
        (root / "test_pairs.txt").write_text("stout1 slender1\nslender1 stout1\n")
        told = truths(root)
        np.testing.assert_array_equal(told["stout1", "slender1"], there)
        np.testing.assert_array_equal(told["slender1", "stout1"], there[:, ::-1])
        (root / "corres" / f"{name}.map").unlink()
        (root / "test_pairs.txt").unlink()
    np.savetxt(root / "corres" / "stout1_slender1.map", lines[:-1], fmt="%d")
    with pytest.raises(sgmds.SgmdsError, match="are not one for each vertex of one of stout1"):
        truths(root)


def test_parts_stand_beside_their_wholes(tmp_path, slender):
    kept = np.flatnonzero(slender.vertices[:, 2] < np.median(slender.vertices[:, 2]))
    number = np.full(len(slender.vertices), -1)
    number[kept] = np.arange(len(kept))
    faces = number[slender.faces]
    part = SimpleNamespace(vertices=slender.vertices[kept], faces=faces[(faces >= 0).all(axis=1)])
    published(tmp_path / "null", {"cat": (slender, None)})
    told = truths(published(tmp_path / "cuts", {"cuts_cat_shape_12": (part, kept)}))
    assert list(told) == [("cuts_cat_shape_12", "cat")]
    there = np.stack([np.arange(len(kept)), kept], axis=1)
    np.testing.assert_array_equal(told["cuts_cat_shape_12", "cat"], there)


def test_parts_are_told_by_points_on_their_wholes(tmp_path, slender):
    """As SHREC'16 has them: a triangle of the whole, which counts from 1, and weights of its corners."""
    kept = np.flatnonzero(slender.vertices[:, 2] < np.median(slender.vertices[:, 2]))
    number = np.full(len(slender.vertices), -1)
    number[kept] = np.arange(len(kept))
    faces = number[slender.faces]
    (tmp_path / "null").mkdir()
    write_off(tmp_path / "null" / "cat.off", slender.vertices, slender.faces)
    root = tmp_path / "holes"
    root.mkdir()
    write_off(root / "holes_cat_shape_3.off", slender.vertices[kept], faces[(faces >= 0).all(axis=1)])
    triangles = np.array([np.flatnonzero((slender.faces == v).any(axis=1))[0] for v in kept])
    weights = np.where(slender.faces[triangles] == kept[:, None], 0.6, 0.2)
    points = np.column_stack([triangles + 1, weights])
    for ending, lines in (("", points), ("_sym", points[::-1])):
        np.savetxt(root / f"holes_cat_shape_3.baryc_gt{ending}", lines, fmt=["%d", "%.6f", "%.6f", "%.6f"])
    told = truths(root)
    every = np.arange(len(kept))
    assert list(told) == [("holes_cat_shape_3", "cat")]
    np.testing.assert_array_equal(told["holes_cat_shape_3", "cat"], np.stack([every, kept], axis=1))
    truth = find_sets(tmp_path)[0].truth("holes_cat_shape_3", "cat", len(kept), lines=None)
    np.testing.assert_array_equal(truth.swapped_b, kept[::-1])
    points[0, 0] = len(slender.faces) + 1
    np.savetxt(root / "holes_cat_shape_3.baryc_gt", points)
    with pytest.raises(sgmds.SgmdsError, match="names a triangle that cat with its"):
        truths(root)


def test_error_agrees_with_shortest_paths(folder, slender, stout):
    """A map to a neighbour some edges away: the heat method against Dijkstra's on the mesh's edges."""
    shift = 40

    def away(source, target):
        ids, images = characters.truth_vertices(stout, slender)
        answer = np.zeros(len(target[0]), dtype=int)
        answer[ids] = np.roll(images, shift)
        return answer

    pair = evaluate(folder, method=away, lines=None).pairs[0]
    ids, images = characters.truth_vertices(stout, slender)
    faces, vertices = slender.faces, slender.vertices
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    lengths = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
    graph = coo_matrix((lengths / 2, ends.T), shape=(len(vertices),) * 2).tocsr()
    graph = graph + graph.T
    rows = dijkstra(graph, indices=images)
    edges = vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    area = np.linalg.norm(np.cross(*edges), axis=1).sum() / 2
    expected = 100 * rows[np.arange(len(ids)), np.roll(images, shift)].mean() / np.sqrt(area)
    # Paths along edges are up to 15 % too long, never too short; the heat method is within 1 %.
    assert 0.85 * expected < pair.direct < 1.01 * expected


def test_lines_are_spread_evenly_and_missing_ones_left_out(folder):
    shapes = find_sets(folder.parent, ["BODIES"])[0]
    whole = shapes.truth("stout1", "slender1", 10**6, lines=None)
    some = shapes.truth("stout1", "slender1", 10**6, lines=50)
    assert (whole.a >= 0).all() and (whole.b >= 0).all()
    assert np.array_equal(some.a, whole.a[np.linspace(0, len(whole.a) - 1, 50).astype(int)])


def test_shapes_are_matched_turned_and_measured_as_given(folder, slender):
    """Distances stay, so a right map has no error; each name has a rotation of its own."""
    seen = {}

    def true(source, target):
        seen["source"], seen["target"] = source[0], target[0]
        return find_sets(folder)[0].saved_map("TRUE", "stout1", "slender1")

    pair = evaluate(folder, method=true, rotate=7).pairs[0]
    assert pair.direct == 0 and pair.flipped is not None
    turned, given = seen["source"], np.asarray(slender.vertices)
    assert np.allclose(turned @ turned.T, given @ given.T) and not np.allclose(turned, given)
    rotation = random_rotation(7, "slender1")
    assert np.allclose(turned, given @ rotation.T)
    assert np.isclose(np.linalg.det(rotation), 1) and not np.allclose(rotation, random_rotation(7, "stout1"))


def test_lines_that_are_nearer_to_the_other_side_are_counted(tmp_path):
    """A row of points, mirrored at its middle: of five, two are exchanged and one is its own partner."""
    from sgmds.evaluation import Truth, _flipped

    a, b, other = np.arange(5), np.arange(5), np.arange(5)[::-1]
    images = np.array([4, 3, 2, 3, 4])
    truth = Truth(a, b, a, other, a)
    assert _flipped(truth, abs(images - b), abs(images - other)) == 0.5


def test_reverse_asks_the_other_way(folder):
    pair = evaluate(folder, method=lambda source, target: np.zeros(len(target[0]), int), reverse=True).pairs[
        0
    ]
    assert (pair.a, pair.b) == ("slender1", "stout1")
    assert pair.status == "broken"


def test_matcher_is_measured_and_written(folder, tmp_path):
    lines = []
    result = evaluate(folder, limit=1, compare=True, cache=tmp_path / "cache", report=lines.append)
    pair = result.pairs[0]
    assert pair.status == "right" and pair.grade in ("green", "amber", "red")
    assert any("stout1" in line for line in lines)
    assert set(result.sets[0].curves()) == {"auto", "TRUE"}
    assert len(list((tmp_path / "cache").iterdir())) == 1
    assert result.as_json()["sets"]["BODIES"]["summary"]["right"] == 1
    result.plot(tmp_path / "curves.svg")
    assert (tmp_path / "curves.svg").read_text().startswith("<?xml")


def test_what_was_not_measured_is_not_told(folder):
    """Saved maps take no preparation, and where none is right there is no mean of right ones."""
    saved = evaluate(folder, method="saved:TRUE").text()
    broken = evaluate(folder, method=lambda source, target: np.zeros(len(target[0]), int)).text()
    assert "preparing" not in saved and "their mean" not in broken and "nan" not in saved + broken


def test_names_in_pictures_are_as_they_are_written(folder, tmp_path):
    """No formula, which \\frac alone is not, no curve left out, no end of a line, no warning."""
    root = tmp_path / "one $\\frac$ two"
    shutil.copytree(folder, root)
    for name in ("_kept", "by $x_{$\nhand", "手"):
        shutil.copytree(root / "maps" / "TRUE", root / "maps" / name)
    result = evaluate(root, method="saved:TRUE", compare=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result.plot(tmp_path / "curves.svg")
    drawn = (tmp_path / "curves.svg").read_text()
    # Beside its outlines each text stands in a comment.
    for text in (r"one $\frac$ two, 1 pairs", "_kept", "by $x_{$ hand", "手"):
        assert f"<!-- {text} -->" in drawn


def test_errors_are_told(folder, tmp_path):
    with pytest.raises(sgmds.SgmdsError, match="no such folder; see docs/evaluation.md$"):
        evaluate(tmp_path / "none")
    with pytest.raises(sgmds.SgmdsError, match="BODIES"):
        evaluate(folder.parent, set="OTHER")


def test_perfect_confidence_leaves_no_gap():
    errors = np.random.default_rng(0).random(100)
    figures = sparsification(errors, -errors)
    assert figures["sparsification_gap"] == 0 and figures["confident_half"] == figures["ideal_half"]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("pairs.txt", b"stout1 \xff\n", "is not UTF-8 text"),
        ("corr/stout1.txt", b"first\nsecond\n", "stout1.txt: should have 1 vertex"),
        ("corr/stout1.txt", b"99999999\n", "names vertex 99999999"),
        ("corr/slender1.txt", b"99999999\n", "names vertex 99999999"),
        ("corr_pairs/stout1__slender1.txt", b"1\n2\n", "should have 2 vertex"),
        ("maps/TRUE/stout1__slender1.txt", b"one\n", "should have 1 vertex"),
    ],
)
def test_damaged_sets_are_told_in_words(folder, tmp_path, capsys, name, content, words):
    own = tmp_path / "BODIES"
    shutil.copytree(folder, own)
    if name.startswith("corr/"):
        for other in (own / "corr").iterdir():
            other.write_text("1\n" * content.count(b"\n"))
    (own / name).parent.mkdir(exist_ok=True)
    (own / name).write_bytes(content)
    assert main(["evaluate", str(own), "--method", "saved:TRUE", "--quiet"]) == 1
    told = capsys.readouterr()
    assert words in told.out + told.err


def test_options_that_the_method_would_ignore_are_refused_at_once(folder):
    for method in ("paper", "saved:TRUE", lambda source, target: None):
        with pytest.raises(sgmds.ArgumentError, match="`part` is for the method"):
            evaluate(folder, method=method, part="source")
    with pytest.raises(sgmds.ArgumentError, match="`landmarks` is for the method"):
        evaluate(folder, method="paper", landmarks=np.array([[0, 0], [1, 1]]))


@pytest.mark.parametrize("option", ["method", "distances", "metric"])
def test_choices_that_there_are_not_are_refused_at_once(folder, option):
    with pytest.raises(sgmds.ArgumentError, match=f"`{option}` should be one of .* got 'best'"):
        evaluate(folder, **{"method": "paper", option: "best"})


@pytest.mark.parametrize("option", ["every", "limit", "lines", "threads"])
def test_counts_that_mean_nothing_are_refused_at_once(folder, option):
    for count in (0, -3, 1.5):
        with pytest.raises(sgmds.ArgumentError, match=f"`{option}` should be"):
            evaluate(folder, method="paper", **{option: count})


def test_a_bound_that_is_no_number_is_refused_at_once(folder):
    with pytest.raises(sgmds.ArgumentError, match="`bound` should be a finite number, got 'x'"):
        evaluate(folder, method="paper", bound="x")


@pytest.mark.parametrize(("kind", "remedy"), [("heat", "try distances"), ("exact", "join its parts")])
def test_distances_without_end_are_told_with_another_way(kind, remedy):
    distances = TruthDistances(np.eye(3), np.array([[0, 1, 2]]), kind)
    lost = np.full(3, np.inf)
    distances._solver = SimpleNamespace(
        compute_distance=lambda origin: lost, geodesicDistances=lambda origins, ends: [lost]
    )
    with pytest.raises(sgmds.SgmdsError, match=f"{kind} distances .* not finite; {remedy}"):
        distances.between([0], [1])


@pytest.fixture
def broken(folder, tmp_path):
    """A copy of the set, to be damaged."""
    return shutil.copytree(folder, tmp_path / "set")


@pytest.mark.parametrize(
    ("pairs", "reason"), [("\n", "asks for no map"), ("\nstout1,slender1\n", r"line 2 should be .*'stout1,")]
)
def test_pairs_that_are_none_are_told_at_once(broken, pairs, reason):
    (broken / "pairs.txt").write_text(pairs)
    with pytest.raises(sgmds.SgmdsError, match=f"pairs.txt: {reason}"):
        evaluate(broken, method="saved:TRUE")


@pytest.mark.parametrize(
    ("name", "words", "reason"),
    [
        ("corr_pairs/stout1__slender1.txt", "-1 5\n", "the truth for the pair stout1 slender1 has no line"),
        ("corr/IDENTITY", "*\n", r"IDENTITY: '\*' is no regular expression"),
        ("samples/stout.txt", "1\n", r"stout.sym.txt: should have 1 vertex id"),
    ],
)
def test_a_truth_that_cannot_be_used_fails_its_pair(broken, tmp_path, capsys, name, words, reason):
    if "pairs" not in name:
        shutil.rmtree(broken / "corr")
        shutil.copy(broken / "stout1.off", broken / "stout2.off")
        (broken / "pairs.txt").write_text("stout1 stout2\n")
    (broken / name).parent.mkdir(exist_ok=True)
    (broken / name).write_text(words)
    if "samples" in name:
        (broken / "corr").mkdir()
        (broken / "corr" / "IDENTITY").write_text(".*\n")
    figures = tmp_path / "figures.json"
    arguments = ["evaluate", str(broken), "--method", "paper", "--json", str(figures), "-q"]
    assert main(arguments) == 1
    printed = capsys.readouterr()
    assert printed.err == "sgmds: 1 of 1 pairs could not be matched: see above\n"

    def refused(constant):
        raise AssertionError(f"{constant} is not JSON")

    record = json.loads(figures.read_text(), parse_constant=refused)["sets"]["set"]
    assert record["summary"]["direct"] is None
    (told,) = record["failed"].values()
    assert re.search(reason, told)


def test_kept_distances_that_are_damaged_are_named(folder, tmp_path, slender):
    cache = tmp_path / "cache"
    mesh = slender.vertices, slender.faces
    first = TruthDistances(*mesh, cache=cache).between([3], [5])
    (kept,) = cache.iterdir()
    assert TruthDistances(*mesh, cache=cache).between([3], [5]) == first
    kept.write_bytes(kept.read_bytes()[:100])
    with pytest.raises(sgmds.SgmdsError, match=f"{kept.name}: is damaged .*; delete it"):
        TruthDistances(*mesh, cache=cache)
