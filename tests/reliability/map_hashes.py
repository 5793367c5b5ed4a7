"""Whether a change leaves every map as it is, to the last bit: a hash a map.

    python tests/reliability/map_hashes.py [DATA] [--set NAME] [--every 1] [--against FILE] > FILE

Maps between generated bodies of random builds and poses, whole, cut and of several thousand vertices, and,
where DATA is a folder as `sgmds evaluate` reads it, between the pairs of its sets (every N-th with
`--every N`). A line names the pair and gives the hash of faces, barycentric weights and confidence, and the
grade. With `--against` the lines are compared with those of a run before the change; exit status 1 when one
differs.
"""

import argparse
import hashlib
import sys

import numpy as np
import sgmds
from sgmds import characters
from sgmds.evaluation import find_sets

BODIES = (
    ("biped", "slender", "rest", 2500),
    ("biped", "slender", "wave", 4000),
    ("biped", "stout", "rest", 6000),
    ("biped", "stout", "walk", 1500),
    ("quadruped", "slender", "rest", 2500),
    ("quadruped", "stout", "walk", 4000),
    ("biped", "slender", "sit", 12000),
)
"""Kind, build, pose and vertices: below and above the sizes at which meshes are refined and simplified."""


def fingerprint(corr) -> str:
    digest = hashlib.sha256()
    for array in (corr.faces, corr.barycentric, corr.confidence):
        digest.update(np.ascontiguousarray(array).tobytes())
    return f"{digest.hexdigest()[:16]} {corr.quality.grade}"


def cut(mesh):
    """The mesh without what lies above three quarters of its height."""
    vertices, faces = mesh
    height = vertices[:, 2]
    below = height < height.min() + 0.75 * np.ptp(height)
    return vertices, faces[below[faces].all(axis=1)]


def generated():
    meshes = []
    for seed, (kind, build, pose, resolution) in enumerate(BODIES):
        pose = pose if pose in characters.POSES[kind] else sorted(characters.POSES[kind])[0]
        body = characters.make(kind, build, pose, resolution, seed=seed)
        meshes.append((f"{kind} {build} {pose} {resolution}", (body.vertices, body.faces)))
    for (name_1, mesh_1), (name_2, mesh_2) in zip(meshes, meshes[1:] + meshes[:1], strict=True):
        yield f"{name_1} > {name_2}", mesh_1, mesh_2
    (name_1, mesh_1), (name_2, mesh_2) = meshes[:2]
    yield f"{name_1} > part of {name_2}", mesh_1, cut(mesh_2)
    yield f"part of {name_1} > {name_2}", cut(mesh_1), mesh_2


def measured(folder, name, every):
    for shapes in find_sets(folder, name and [name]):
        for a, b in list(shapes.pairs())[::every]:
            yield f"{shapes.name} {b} > {a}", shapes.mesh(b), shapes.mesh(a)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", nargs="?")
    parser.add_argument("--set", dest="name")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--against")
    options = parser.parse_args()
    known = {}
    if options.against:
        with open(options.against) as file:
            known = dict(line.rstrip("\n").split("\t") for line in file)
    pairs = list(generated())
    if options.data:
        pairs += measured(options.data, options.name, options.every)
    changed = []
    for name, source, target in pairs:
        try:
            found = fingerprint(sgmds.match(source, target))
        except sgmds.SgmdsError as error:
            found = f"refused: {error}"
        print(f"{name}\t{found}", flush=True)
        if name in known and known[name] != found:
            changed.append(f"{name}: {known[name]} became {found}")
    if changed:
        print("\n".join(changed), file=sys.stderr)
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
