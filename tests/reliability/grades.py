"""What the grade rests on: figures of many maps whose truth is known, and a logistic regression on them.

    python tests/reliability/grades.py collect KIND HALF OUT.jsonl
        [--pairs 40] [--data DATA] [--characters FOLDER] [--poses 1]
    python tests/reliability/grades.py judge OUT.jsonl ...

`collect` matches pairs of one half of the bodies, 0 or 1, and adds a line a map to OUT. KIND is "wide",
"parts" or "holes", bodies of random_bodies.py; "solids", these with a torus, a sphere, a cube and a pipe, all
of whose maps are wrong; "sets", pairs of DATA as `sgmds evaluate` reads it; or
"characters", rigged ones of a FOLDER whose own evaluate.py reads and scores them and whose pairs.json tells
which can be compared: right is what has the bone, or its neighbour, of the matched point on 0.8 of the area.
`judge` fits the coefficients to the maps of half 0 and prints for both halves how well they tell right from
wrong: the area under the ROC curve, and the maps that each bound and the grade of each leave.
"""

import argparse
import importlib.util
import itertools
import json
import sys
from pathlib import Path

import numpy as np
import random_bodies as bodies
import sgmds
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from separation import area_under_roc, solids
from sgmds.evaluation import TruthDistances, find_sets, pair_errors
from verdict import WRONG_ABOVE

# Of `separation.py`: sets have truth that was drawn by hand.
WRONG_OF_SETS = 8
RIGHT_OF_CHARACTERS = 0.8


def drawn_as(kind, pairs, both_ways=True):
    """What random_bodies.py is told to draw pairs of a kind."""
    kinds = {name: name == kind for name in ("parts", "holes", "wide")}
    return argparse.Namespace(**kinds, both_ways=both_ways, pairs=pairs)


def generated(options):
    drawn = drawn_as(options.kind, options.pairs)
    rng = np.random.default_rng(100 + options.half)
    for number, kind, ((name, source), (other, target)) in bodies.drawn_pairs(drawn, rng):
        faces = bodies.faces_left(source, target, number, drawn, rng)
        found, away = bodies.matched(source, target, faces)
        error = 100 * away.mean() / np.sqrt(bodies.area(source.vertices, source.faces).sum())
        yield f"{kind} {name}", f"{kind} {other}", found, error, error < WRONG_ABOVE


def with_solids(options):
    drawn = drawn_as("wide", options.pairs, both_ways=False)
    rng = np.random.default_rng(50 + options.half)
    for _, kind, ((name, body), _) in bodies.drawn_pairs(drawn, rng):
        for other, solid in solids(2500):
            pair = [(f"{kind} {name}", (body.vertices, body.faces)), (other, solid)]
            (a, source), (b, target) = pair if rng.random() < 0.5 else pair[::-1]
            yield a, b, sgmds.match(source, target), np.nan, False


def of_sets(options):
    for folder in find_sets(options.data, None):
        own = [pair for pair in folder.pairs() if sum(map(ord, "".join(pair))) % 2 == options.half]
        for a, b in own[: options.pairs]:
            source, target = folder.mesh(b), folder.mesh(a)
            truth = folder.truth(a, b, len(target[0]))
            found = sgmds.match(source, target)
            errors = pair_errors(TruthDistances(*source), found.vertices, truth.a, truth.b)
            error = 100 * float(np.nanmean(errors))
            yield f"{folder.name}/{b}", f"{folder.name}/{a}", found, error, error < WRONG_OF_SETS


def of_characters(options):
    """Each with others of its class, at rest or in a pose."""
    spec = importlib.util.spec_from_file_location("scorer", Path(options.characters) / "evaluate.py")
    scorer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scorer)
    known = json.loads((Path(options.characters) / "pairs.json").read_text(encoding="utf-8"))
    names = sorted({pair[role] for pair in known for role in "ab"})
    sides = [[names.index(pair[role]) for pair in known] for role in "ab"]
    compared = coo_array((np.ones(len(known)), sides), shape=(len(names),) * 2)
    classes = connected_components(compared, directed=False)[1]
    rng = np.random.default_rng(7)
    pairs = []
    for one in range(classes.max() + 1):
        own = np.array(names)[classes == one][options.half :: 2]
        for pair in itertools.permutations(own, 2):
            poses = [["rest", *np.load(scorer.find(name))["pose_names"]] for name in pair]
            drawn = [tuple(str(rng.choice(p)) for p in poses) for _ in range(options.poses)]
            pairs += [(pair, ("rest", "rest")), *((pair, pose) for pose in drawn)]
    for i in rng.permutation(len(pairs))[: options.pairs]:
        (a, b), poses = pairs[i]
        source, target = (scorer.shape(n, p, "weld", None) for n, p in zip((a, b), poses, strict=True))
        found = sgmds.match(source[:2], target[:2])
        vertices, faces, weights, labels, _ = target
        whole = np.ones(len(vertices), bool)
        areas = scorer.areas(vertices, faces)[0]
        image = found.faces, found.barycentric
        near = scorer.score(*image, *source[1:3], labels, weights, areas, whole)["near"]
        yield f"{a}/{poses[0]}", f"{b}/{poses[1]}", found, near, near >= RIGHT_OF_CHARACTERS


def collect(options):
    known = {"solids": with_solids, "sets": of_sets, "characters": of_characters}
    drawn = known.get(options.kind, generated)
    for source, target, found, error, right in drawn(options):
        row = {
            "kind": options.kind,
            "half": options.half,
            "source": source,
            "target": target,
            "error": float(error),
            "right": bool(right),
            "grade": found.quality.grade,
            "figures": found.quality.figures,
            "evidence": found._raw.evidence,
        }
        with open(options.out, "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(f"{source} → {target}: {error:.2f} {'right' if right else 'wrong'} {row['grade']}", flush=True)


def fitted(x, y, ridge=0.3, steps=60):
    """Coefficients of a logistic regression; the ridge keeps those of few maps finite."""
    coefficients = np.zeros(x.shape[1])
    ridges = np.full(len(coefficients), ridge)
    ridges[0] = 1e-9
    for _ in range(steps):
        p = probability(x, coefficients)
        gradient = x.T @ (p - y) + ridges * coefficients
        coefficients -= np.linalg.solve((x.T * (p * (1 - p))) @ x + np.diag(ridges), gradient)
    return coefficients


def probability(x, coefficients):
    return 1 / (1 + np.exp(-x @ coefficients))


def judge(options):
    rows = [json.loads(line) for path in options.files for line in open(path, encoding="utf-8")]
    rows = [row for row in rows if row["evidence"]]
    halves = [[row for row in rows if row["half"] == half] for half in (0, 1)]

    def known(rows):
        return np.array([(1.0, *row["evidence"]) for row in rows]), np.array([row["right"] for row in rows])

    coefficients = fitted(*known(halves[0])).round(1)
    print("constant, agreement, orientation, distortion, clarity, torn:", *coefficients)
    for half, own in enumerate(halves):
        x, right = known(own)
        p = probability(x, coefficients)
        area = area_under_roc(p[right], p[~right])
        print(f"half {half}: {right.sum()} right, {(~right).sum()} wrong, area {area:.3f}", end="")
        print(f", wrong ones up to {p[~right].max(initial=0):.3f}")
        for bound in (0.5, 0.9, 0.95, 0.97, 0.99):
            print(f"  from {bound}: {(p[right] >= bound).sum()} right, {(p[~right] >= bound).sum()} wrong")
        for grade in ("green", "amber", "red"):
            given = np.array([row["grade"] == grade for row in own])
            print(f"  graded {grade}: {(given & right).sum()} right, {(given & ~right).sum()} wrong")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    collecting = commands.add_parser("collect")
    collecting.add_argument("kind", choices=("wide", "parts", "holes", "solids", "sets", "characters"))
    collecting.add_argument("half", type=int, choices=(0, 1))
    collecting.add_argument("out")
    collecting.add_argument("--pairs", type=int, default=40)
    collecting.add_argument("--data")
    collecting.add_argument("--characters")
    collecting.add_argument("--poses", type=int, default=1, help="draws of poses of two characters")
    collecting.set_defaults(run=collect)
    judging = commands.add_parser("judge")
    judging.add_argument("files", nargs="+")
    judging.set_defaults(run=judge)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    sys.exit(main())
