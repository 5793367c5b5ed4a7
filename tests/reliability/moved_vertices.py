"""How much of a set's errors is chance: every pair again with vertices moved by far less than an edge.

    python tests/reliability/moved_vertices.py DATA --set NAME [--rounds 4] [--both-ways] [--json OUT]

DATA is a folder as `sgmds evaluate` reads it. Whether a hard pair comes out right may turn on the last digits
of a distance, so that one pair more or less says nothing of a change; the share over many rounds does. The
first round has the vertices as they are. Errors are means ×100 over 200 lines of the truth. Exit status 1
when a map beyond the bound is graded green.
"""

import argparse
import sys

import numpy as np
import sgmds
from sgmds.evaluation import TruthDistances, find_sets, pair_errors, surface_area
from verdict import told

# Standard deviation in each direction as a fraction of √area; an edge of 5,000 vertices has 0.015.
MOVED = 4e-4
LINES = 200


def moved(mesh, seed):
    """The mesh with its vertices moved; as it is with seed 0."""
    vertices, faces = mesh
    if not seed:
        return mesh
    step = MOVED * np.sqrt(surface_area(vertices, faces))
    return vertices + step * np.random.default_rng(seed).normal(size=vertices.shape), faces


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data")
    parser.add_argument("--set", required=True, dest="name")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--both-ways", action="store_true", help="each pair from either side")
    parser.add_argument("--json")
    options = parser.parse_args()
    (shapes,) = find_sets(options.data, [options.name])
    pairs = list(shapes.pairs())
    if options.both_ways:
        pairs += [(b, a) for a, b in pairs]
    meshes = {name: shapes.mesh(name) for pair in pairs for name in pair}
    distances = {b: TruthDistances(*meshes[b]) for _, b in pairs}
    truths = {(a, b): shapes.truth(a, b, len(meshes[a][0]), LINES) for a, b in pairs}
    records = []
    for seed in range(options.rounds):
        for a, b in pairs:
            target, source = moved(meshes[a], 2 * seed), moved(meshes[b], seed and 2 * seed + 1)
            corr = sgmds.match(source, target)
            truth = truths[a, b]
            error = 100 * float(np.nanmean(pair_errors(distances[b], corr.vertices, truth.a, truth.b)))
            records.append({"a": a, "b": b, "round": seed, "error": error, "grade": corr.quality.grade})
            print(f"{a:<16} {b:<16} {seed:2} {error:6.2f} {corr.quality.grade}", flush=True)
    return told(records, options.json)


if __name__ == "__main__":
    sys.exit(main())
