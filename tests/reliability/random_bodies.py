"""Errors and grades between generated characters of random proportions, where every counterpart is known.

    python tests/reliability/random_bodies.py [--pairs 40] [--seed 11] [--json OUT]

Each pair is of one kind, every fourth a quadruped. Each body has a named build or one whose lengths and
thicknesses are scaled by exp(s·N(0, 1)), s from 0.1 to 0.2, a named pose and 2,500 to 6,000 vertices of its
own sampling; about every seventh pair is the slender biped at rest and the stout one that waves. The error is
the mean distance in space from the true counterpart, ×100 at unit area. Exit status 1 when a pair beyond
the bound is graded green.
"""

import argparse
import json
import sys

import numpy as np
import sgmds
from sgmds import characters

WRONG_ABOVE = 6.0
"""A limb turned or swapped adds as much."""
SPREAD = (0.7, 1.4)
"""Bounds of a random scale, between which limbs neither vanish nor swallow their neighbours."""


def random_build(kind: str, rng) -> dict:
    spread = rng.choice([0.1, 0.15, 0.2])
    groups = sorted({bone.group for bone in characters.SKELETONS[kind]})
    scales = np.clip(np.exp(rng.normal(0, spread, (len(groups), 2))), *SPREAD)
    return dict(zip(groups, map(tuple, scales), strict=True))


def random_body(kind: str, rng):
    named = rng.random() < 0.3
    build = str(rng.choice(["slender", "stout"])) if named else random_build(kind, rng)
    pose = str(rng.choice(sorted(characters.POSES[kind])))
    resolution = int(rng.choice([2500, 4000, 6000]))
    name = f"{build if named else 'random'} {pose}"
    return name, characters.make(kind, build, pose, resolution, seed=int(rng.integers(100)))


def pair(number: int, rng):
    if number % 7 == 6:
        seeds = rng.integers(100, size=2)
        slender = characters.make("biped", "slender", "rest", 4000, seed=int(seeds[0]))
        stout = characters.make("biped", "stout", "wave", 5000, seed=int(seeds[1]))
        return "biped", ("slender rest", slender), ("stout wave", stout)
    kind = "biped" if number % 4 else "quadruped"
    return kind, random_body(kind, rng), random_body(kind, rng)


def error(found, source, target) -> float:
    ids, truth = characters.truth(target, source)
    corners = source.vertices[source.faces]
    images = np.einsum("ni,nij->nj", found.barycentric, corners[found.faces])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1).sum() / 2
    return float(100 * np.linalg.norm(images[ids] - truth, axis=1).mean() / np.sqrt(area))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--json")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    records = []
    for number in range(options.pairs):
        kind, (source_name, source), (target_name, target) = pair(number, rng)
        found = sgmds.match((source.vertices, source.faces), (target.vertices, target.faces))
        record = {
            "kind": kind,
            "source": source_name,
            "target": target_name,
            "vertices": [len(source.vertices), len(target.vertices)],
            "error": error(found, source, target),
            "grade": found.quality.grade,
        }
        records.append(record)
        sizes = f"{len(source.vertices)} and {len(target.vertices)} vertices"
        print(
            f"{kind:<10} {source_name:<13} {target_name:<13} {sizes:<28} "
            f"{record['error']:6.2f} {record['grade']}",
            flush=True,
        )
    errors = np.array([record["error"] for record in records])
    wrong = errors > WRONG_ABOVE
    trusted = sum(w and record["grade"] == "green" for w, record in zip(wrong, records, strict=True))
    grades = {g: sum(r["grade"] == g for r in records) for g in ("green", "amber", "red")}
    print(
        f"{len(errors)} pairs: mean {errors.mean():.2f}, median {np.median(errors):.2f}, worst "
        f"{errors.max():.2f}; {wrong.sum()} beyond {WRONG_ABOVE:g}, {trusted} of them green; {grades}"
    )
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(records, file, indent=1)
    return 1 if trusted else 0


if __name__ == "__main__":
    sys.exit(main())
