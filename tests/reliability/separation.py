"""How well the grade's score and the confidence tell right maps from wrong ones: area under the ROC curve.

    python tests/reliability/separation.py DATA [--sets A,B] [--every 10] [--unlike SET/A SET/B] [--json OUT]

DATA is a folder as `sgmds evaluate` reads it. Of every N-th of its pairs the chosen map and the
alternatives count, right when the mean error ×100 is below the bound. All maps between things that do not
match are wrong: each class of the data against solids (sphere, torus, cube, pipe), the pairs named by
--unlike, solids against solids, and a sphere against itself, all of whose maps are equally good, so that none
may be trusted. An area of 1 means that every right map scores above every wrong one, ½ that the figure says
nothing. Exit status 1 when a wrong map is graded green.
"""

import argparse
import itertools
import json
import re
import sys

import numpy as np
import sgmds
from sgmds.evaluation import TruthDistances, find_sets, pair_errors

GRADES = ("green", "amber", "red")


def grid(point, m, n, wrap=True):
    """Mesh of a parametrised surface, closed in u and, with `wrap`, in v."""
    u, v = np.meshgrid(np.arange(m) / m, np.arange(n) / (n if wrap else n - 1), indexing="ij")
    vertices = np.stack(point(2 * np.pi * u, v), axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(m), np.arange(n if wrap else n - 1), indexing="ij"))
    corner = lambda a, b: (i + a) % m * n + (j + b) % n  # noqa: E731
    a, b, c, d = corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def box_sphere(side, power):
    """A cube's surface, blown up to a sphere of the given norm: 2 a ball, large a cube."""
    vertices, faces = [], []
    line = np.linspace(-1, 1, side)
    for axis, sign in itertools.product(range(3), (-1, 1)):
        p, q = (x.ravel() for x in np.meshgrid(line, line, indexing="ij"))
        points = np.insert(np.stack([p, q], 1), axis, sign, axis=1)
        first = sum(map(len, vertices))
        cell = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel() + first
        quad = np.stack([cell, cell + side, cell + side + 1, cell + 1], 1)
        if (sign > 0) == (axis == 1):
            quad = quad[:, ::-1]
        vertices.append(points)
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    vertices, faces = np.concatenate(vertices), np.concatenate(faces)
    _, first, joined = np.unique(vertices.round(9), axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], joined.reshape(-1)[faces]
    size = (np.abs(vertices) ** power).sum(axis=1, keepdims=True) ** (1 / power)
    return vertices / size, faces


def solids(resolution):
    m = int(np.sqrt(2 * resolution))
    side = int(np.sqrt(resolution / 6)) + 2
    ring = lambda u, v: 1 + 0.4 * np.cos(2 * np.pi * v)  # noqa: E731
    yield (
        "torus",
        grid(
            lambda u, v: (ring(u, v) * np.cos(u), ring(u, v) * np.sin(u), 0.4 * np.sin(2 * np.pi * v)),
            m,
            m // 2,
        ),
    )
    yield "sphere", box_sphere(side, 2)
    yield "cube", box_sphere(side, 40)
    width = lambda v: 1 + 0.5 * v**2  # noqa: E731
    yield (
        "pipe",
        grid(lambda u, v: (width(v) * np.cos(u), width(v) * np.sin(u), 4 * v), m, m // 2, wrap=False),
    )


def area_under_roc(right, wrong):
    """Chance that a right map scores above a wrong one; ties count half."""
    first, second = np.asarray(right)[:, None], np.asarray(wrong)[None]
    return float(((first > second) + 0.5 * (first == second)).mean())


def record(corr, chosen, right, error=None):
    return {
        "chosen": chosen,
        "right": bool(right),
        "error": error,
        "grade": corr.quality.grade,
        "score": float(corr.quality.figures["score"]),
        "confidence": float(corr.confidence.mean()),
    }


class Collection:
    """Shapes of data and solids by name, each prepared once, and what was found of their maps."""

    def __init__(self, sets, resolution):
        self.sets = {s.name: s for s in sets}
        self.solids = dict(solids(resolution))
        self.shapes = {}
        self.rows = []

    def shape(self, name):
        if name not in self.shapes:
            folder, _, mesh = name.partition("/")
            self.shapes[name] = sgmds.Shape(*(self.sets[folder].mesh(mesh) if mesh else self.solids[name]))
        return self.shapes[name]

    def maps(self, source, target, alternatives):
        """The chosen map and alternatives; none when the pair is refused."""
        try:
            corr = sgmds.match(self.shape(source), self.shape(target))
        except sgmds.SgmdsError as refusal:
            print(f"{source} → {target}: refused: {refusal}", flush=True)
            return
        yield True, corr
        for index in range(min(alternatives, corr.alternative_count)):
            yield False, corr.alternative(index)

    def add(self, source, target, chosen, corr, right, error=None):
        row = {"source": source, "target": target, **record(corr, chosen, right, error)}
        self.rows.append(row)
        print(
            f"{source} → {target}: {'right' if right else 'wrong'} {row['grade']} score {row['score']:.2f} "
            f"confidence {row['confidence']:.2f}" + (f" error {error:.1f}" if error is not None else ""),
            flush=True,
        )

    def matching(self, folder, a, b, bound, alternatives):
        source, target = self.shape(f"{folder}/{b}"), self.shape(f"{folder}/{a}")
        distances = TruthDistances(source.vertices, source.faces)
        truth = self.sets[folder].truth(a, b, len(target.vertices))
        for chosen, corr in self.maps(f"{folder}/{b}", f"{folder}/{a}", alternatives):
            error = 100 * float(np.nanmean(pair_errors(distances, corr.vertices, truth.a, truth.b)))
            self.add(f"{folder}/{b}", f"{folder}/{a}", chosen, corr, error < bound, error)

    def unlike(self, a, b, alternatives):
        for chosen, corr in self.maps(a, b, alternatives):
            self.add(a, b, chosen, corr, False)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data")
    parser.add_argument("--sets", type=lambda names: names.split(","))
    parser.add_argument("--every", type=int, default=10, metavar="N")
    parser.add_argument("--unlike", nargs=2, action="append", default=[], metavar=("SET/A", "SET/B"))
    parser.add_argument("--right", type=float, default=8, help="bound on the mean error ×100 of a right map")
    parser.add_argument("--alternatives", type=int, default=3)
    parser.add_argument("--resolution", type=int, default=2500, help="vertices of the solids")
    parser.add_argument("--json")
    options = parser.parse_args()
    known = Collection(find_sets(options.data, options.sets), options.resolution)

    classes = {}
    for folder in known.sets:
        pairs = known.sets[folder].pairs()
        for a, b in pairs[:: options.every]:
            known.matching(folder, a, b, options.right, options.alternatives)
        for name in itertools.chain.from_iterable(pairs):
            classes.setdefault((folder, re.sub(r"\d.*$", "", name)), f"{folder}/{name}")
    unlike = list(itertools.product(classes.values(), known.solids)) + [
        tuple(pair) for pair in options.unlike
    ]
    unlike += [*itertools.combinations(known.solids, 2), ("sphere", "sphere")]
    for a, b in unlike:
        known.unlike(a, b, options.alternatives)

    for kind, rows in (("all maps", known.rows), ("chosen maps", [r for r in known.rows if r["chosen"]])):
        right, wrong = ([r for r in rows if r["right"] == value] for value in (True, False))
        print(f"\n{kind}: {len(right)} right, {len(wrong)} wrong; {len(unlike)} pairs that do not match")
        for figure in ("score", "confidence"):
            area = area_under_roc([r[figure] for r in right], [r[figure] for r in wrong])
            print(f"  area under the ROC curve of the {figure}: {area:.3f}")
        for word, group in (("right", right), ("wrong", wrong)):
            counts = ", ".join(f"{g} {sum(r['grade'] == g for r in group)}" for g in GRADES)
            print(f"  {word}: {counts}")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(known.rows, file, indent=1)
    # A proud wrong answer is what must not happen.
    return int(any(r["grade"] == "green" and not r["right"] for r in known.rows))


if __name__ == "__main__":
    sys.exit(main())
