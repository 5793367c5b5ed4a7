"""Damaged meshes of a folder against a clean one: what is refused, how far the maps of the others are off.

    python tests/reliability/folder.py CLEAN FOLDER

The clean mesh is matched to every mesh of the folder. The files should have its vertices in its order; how
many come before them is found by their places. The difference is the mean distance between the images in both
maps over √area, ×100.
"""

import sys
from pathlib import Path

import numpy as np
import sgmds
from sgmds.files import read_mesh


def images(corr, source):
    return (source.vertices[source.faces[corr.faces]] * corr.barycentric[:, :, None]).sum(axis=1)


def offset(clean, vertices):
    """How many vertices come before those of the clean mesh."""
    extra = len(vertices) - len(clean)
    fits = [
        first for first in range(extra + 1) if np.isclose(vertices[first : first + len(clean)], clean).all()
    ]
    return fits[0] if fits else 0


def main():
    clean_path, folder = map(Path, sys.argv[1:])
    source = sgmds.Shape(*read_mesh(clean_path))
    expected = images(sgmds.match(source, source), source)
    for path in sorted(p for p in folder.iterdir() if p.suffix in (".obj", ".off", ".ply", ".stl", ".glb")):
        try:
            vertices, faces = read_mesh(path)
            target = sgmds.Shape(vertices, faces)
            corr = sgmds.match(source, target)
        except sgmds.SgmdsError as error:
            print(f"{path.name}: refused: {error}")
            continue
        first = offset(source.vertices, vertices)
        count = min(len(source.vertices), len(vertices) - first)
        used = np.isin(np.arange(first, first + count), faces)
        found = images(corr, source)[first : first + count]
        apart = np.linalg.norm(found[used] - expected[:count][used], axis=1).mean()
        ignored = {entry: value for entry, value in target.report.items() if value}
        difference = 100 * apart / np.sqrt(source.mass.sum())
        print(
            f"{path.name}: difference {difference:.2f}, {corr.quality.grade}, "
            f"mean confidence {corr.confidence.mean():.2f}, {ignored}"
        )


if __name__ == "__main__":
    main()
