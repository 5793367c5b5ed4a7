"""Errors and grades between generated characters of random proportions, where every counterpart is known.

    python tests/reliability/random_bodies.py [--parts | --holes] [--wide] [--both-ways] [--pairs 40]
        [--seed 11] [--json OUT]

Each pair is of one kind, every fourth a quadruped. Each body has a named build or one whose lengths and
thicknesses are scaled by exp(s·N(0, 1)), s from 0.1 to 0.2 (with --wide 0.2 or 0.3), a named pose and 2,500
to 6,000 vertices of its own sampling; about every seventh pair is the slender biped at rest and the stout
one that waves. The error is the mean distance in space from the true counterpart, ×100 at unit area of the
source. Exit status 1 when a pair beyond the bound is graded green.

With --parts both bodies of a pair have one build. From one, the target and the source by turns, either
everything within a distance along the surface of a random point is cut away, 15 to 45 % of its area, or as
much around three to six points as makes 10 to 25 %. Only points that have a counterpart count.
"""

import argparse
import sys
from typing import NamedTuple

import numpy as np
import sgmds
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree
from sgmds import characters
from verdict import told


class Scales(NamedTuple):
    """Of lengths and thicknesses of a random build."""

    spreads: tuple
    bounds: tuple
    """Between which limbs do not vanish."""


USUAL = Scales((0.1, 0.15, 0.2), (0.7, 1.4))
WIDE = Scales((0.2, 0.3), (0.5, 2.0))


def random_build(kind: str, scaled: Scales, rng) -> dict:
    spread = rng.choice(scaled.spreads)
    groups = sorted({bone.group for bone in characters.SKELETONS[kind]})
    scales = np.clip(np.exp(rng.normal(0, spread, (len(groups), 2))), *scaled.bounds)
    return dict(zip(groups, map(tuple, scales), strict=True))


def random_body(kind: str, scaled: Scales, rng):
    named = rng.random() < 0.3
    build = str(rng.choice(["slender", "stout"])) if named else random_build(kind, scaled, rng)
    pose = str(rng.choice(sorted(characters.POSES[kind])))
    resolution = int(rng.choice([2500, 4000, 6000]))
    name = f"{build if named else 'random'} {pose}"
    return name, characters.make(kind, build, pose, resolution, seed=int(rng.integers(100)))


def pair(number: int, scaled: Scales, rng):
    if number % 7 == 6:
        seeds = rng.integers(100, size=2)
        slender = characters.make("biped", "slender", "rest", 4000, seed=int(seeds[0]))
        stout = characters.make("biped", "stout", "wave", 5000, seed=int(seeds[1]))
        return "biped", ("slender rest", slender), ("stout wave", stout)
    kind = "biped" if number % 4 else "quadruped"
    return kind, random_body(kind, scaled, rng), random_body(kind, scaled, rng)


def pair_of_one_build(number: int, scaled: Scales, rng):
    kind = "biped" if number % 4 else "quadruped"
    build = random_build(kind, scaled, rng)

    def body():
        pose = str(rng.choice(sorted(characters.POSES[kind])))
        resolution = int(rng.choice([2500, 4000, 6000]))
        return f"random {pose}", characters.make(kind, build, pose, resolution, seed=int(rng.integers(100)))

    return kind, body(), body()


def area(vertices, faces):
    """Of each face."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(across, axis=1) / 2


def largest_piece(faces, vertices: int):
    """Those of the faces that are connected and the most."""
    sides = np.concatenate([faces[:, :2], faces[:, 1:]])
    joined = coo_array((np.ones(len(sides)), sides.T), shape=(vertices, vertices))
    _, piece = connected_components(joined, directed=False)
    return faces[piece[faces[:, 0]] == np.bincount(piece[faces[:, 0]]).argmax()]


def cut(vertices, faces, rng):
    """Faces of the largest piece that a cut or some large holes leave, in the given numbering."""
    edges = np.concatenate([faces, np.roll(faces, 1, axis=1)]).reshape(-1, 3)[:, :2]
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = coo_array((lengths, edges.T), shape=(len(vertices),) * 2).tocsr()
    holes = rng.random() < 0.5
    points = rng.choice(len(vertices), rng.integers(3, 7) if holes else 1, replace=False)
    away = dijkstra(graph, directed=False, indices=points).min(axis=0)[faces].min(axis=1)
    order = np.argsort(away)
    removed = rng.uniform(0.1, 0.25) if holes else rng.uniform(0.15, 0.45)
    within = np.cumsum(area(vertices, faces)[order])
    return largest_piece(faces[order[within > removed * within[-1]]], len(vertices))


def with_small_holes(vertices, faces, rng):
    """Faces of the largest piece that two to four small holes leave, in the given numbering."""
    unit = np.sqrt(area(vertices, faces).sum())
    centres = vertices[faces].mean(axis=1)
    left = np.ones(len(faces), dtype=bool)
    for point in rng.choice(len(vertices), rng.integers(2, 5), replace=False):
        left &= np.linalg.norm(centres - vertices[point], axis=1) > rng.uniform(0.02, 0.07) * unit
    return largest_piece(faces[left], len(vertices))


def faces_left(source, target, number: int, options, rng):
    """Faces of both bodies that take part."""
    bodies = (source, target)
    if options.holes:
        return [with_small_holes(body.vertices, body.faces, rng) for body in bodies]
    left = [body.faces for body in bodies]
    if options.parts:
        which = (number + 1) % 2
        left[which] = cut(bodies[which].vertices, bodies[which].faces, rng)
    return left


def without_unused(vertices, faces):
    """The vertices that faces use, the faces in their numbering, and the new number of each vertex, or -1."""
    used = np.unique(faces)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    return vertices[used], number[faces], number


def matched(source, target, faces):
    """The match of what is left of two bodies, and the distances of images from true counterparts."""
    *source_mesh, of_source = without_unused(source.vertices, faces[0])
    *target_mesh, of_target = without_unused(target.vertices, faces[1])
    ids, truth = characters.truth(target, source)
    # Points whose nearest vertex is left have a counterpart.
    nearest = KDTree(source.vertices).query(truth)[1]
    kept = (of_source[nearest] >= 0) & (of_target[ids] >= 0)
    found = sgmds.match(tuple(source_mesh), tuple(target_mesh))
    images = found.transfer(source_mesh[0])[of_target[ids[kept]]]
    return found, np.linalg.norm(images - truth[kept], axis=1)


def drawn_pairs(options, rng):
    """Number, kind and two bodies of each pair."""
    draw = pair_of_one_build if options.parts else pair
    for number in range(options.pairs):
        kind, *bodies = draw(number, WIDE if options.wide else USUAL, rng)
        yield number, kind, bodies
        if options.both_ways:
            yield number, kind, bodies[::-1]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    missing = parser.add_mutually_exclusive_group()
    missing.add_argument("--parts", action="store_true", help="one body is cut")
    missing.add_argument("--holes", action="store_true", help="both bodies have small holes")
    parser.add_argument("--wide", action="store_true", help="builds that differ more")
    parser.add_argument("--both-ways", action="store_true", help="each pair from either side")
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--json")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    records = []
    for number, kind, ((source_name, source), (target_name, target)) in drawn_pairs(options, rng):
        found, away = matched(source, target, faces_left(source, target, number, options, rng))
        record = {
            "kind": kind,
            "source": source_name,
            "target": target_name,
            "vertices": [len(source.vertices), len(target.vertices)],
            "error": float(100 * away.mean() / np.sqrt(area(source.vertices, source.faces).sum())),
            "grade": found.quality.grade,
        }
        records.append(record)
        sizes = f"{len(source.vertices)} and {len(target.vertices)} vertices"
        print(
            f"{kind:<10} {source_name:<13} {target_name:<13} {sizes:<28} "
            f"{record['error']:6.2f} {record['grade']}",
            flush=True,
        )
    return told(records, options.json)


if __name__ == "__main__":
    sys.exit(main())
