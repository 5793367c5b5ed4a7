"""What each of the numbers that steer the method does: each times 0.8 and times 1.2, and what changes.

    cargo build --release -p sgmds-python --features pyo3/abi3-py311,sgmds-core/vary
    cp target/release/lib_core.so rust/python/sgmds/_core.abi3.so
    PYTHONPATH=rust/python python tests/reliability/settings.py [--only matching.search] [--json OUT]

The numbers are those of docs/settings.md. Maps are between generated characters: in two poses, of two builds,
and of a part. The error is the mean distance in space of images from true counterparts, ×100 at
unit area of the source. A line gives a number, the maps of which a bit changes, and the largest change of an
error; a number that changes none either way does nothing on these, and is worth a look. With --json what is
measured is kept, and what is there is not measured again.
"""

import argparse
import json
import os
import pickle
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
ROW = re.compile(r"^\| `([\w.]+)` \|", re.MULTILINE)
FACTORS = (0.8, 1.2)
# In these every map differs: the module was built to be varied.
PROBE = "shape.shape.eigenpairs"


def made() -> list:
    """Of each map: name, source, target, target's vertices with a counterpart, and where that lies."""
    from map_hashes import cut
    from sgmds import characters

    def biped(build, pose, resolution, seed):
        return characters.make("biped", build, pose, resolution, seed=seed)

    rest, wave = biped("slender", "rest", 2500, 0), biped("slender", "wave", 2200, 1)
    stout = biped("stout", "wave", 2500, 2)
    found = []
    for name, target in (("pose", wave), ("build", stout)):
        mesh = (target.vertices, target.faces)
        found.append((name, (rest.vertices, rest.faces), mesh, *characters.truth(target, rest)))
    name, source, mesh, *truth = found[0]
    return [*found, ("part", source, cut(mesh), *truth)]


def measured(pairs: list) -> dict:
    """Hash and error of each map, in this process."""
    import numpy as np
    import sgmds
    from map_hashes import fingerprint

    found = {}
    for name, source, target, ids, truth in pairs:
        vertices, faces = source
        corr = sgmds.match(source, target)
        images = np.einsum("nk,nkd->nd", corr.barycentric, vertices[faces[corr.faces]])
        known = corr.confidence[ids] > 0
        away = np.linalg.norm(images[ids] - truth, axis=1)[known]
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        found[name] = {"map": fingerprint(corr), "error": float(100 * away.mean() / np.sqrt(area))}
    return found


def with_settings(varied: str, pairs: Path) -> dict:
    """What is measured in a process of its own, where settings are read once."""
    environment = {**os.environ, "SGMDS_VARY": varied}
    command = [sys.executable, __file__, "--measure", str(pairs)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        return {"failed": run.stderr.strip().splitlines()[-1]}
    return json.loads(run.stdout)


def line(name: str, usual: dict, varied: dict) -> str:
    """What a number does, by factor."""
    told = []
    for factor, found in varied.items():
        if "failed" in found:
            told.append(f"×{factor} fails: {found['failed'][:60]}")
            continue
        changed = [pair for pair, was in usual.items() if found[pair]["map"] != was["map"]]
        worse = [
            found[pair]["error"] - usual[pair]["error"]
            for pair in changed
            if usual[pair]["error"] is not None
        ]
        told.append(f"×{factor} {','.join(changed) or 'nothing'} {max(worse, key=abs, default=0):+.2f}")
    return f"{name:56} {'   '.join(told)}"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="settings whose name begins so")
    parser.add_argument("--json", type=Path, metavar="OUT")
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measured(pickle.loads(options.measure.read_bytes()))))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        pairs = Path(folder) / "pairs"
        pairs.write_bytes(pickle.dumps(made()))
        return compared(options, pairs)


def compared(options, pairs: Path) -> int:
    usual = with_settings("", pairs)
    if with_settings(f"{PROBE}=0.8", pairs) == usual:
        print("The module was built without the feature vary.", file=sys.stderr)
        return 2
    known = json.loads(options.json.read_text()) if options.json and options.json.is_file() else {}
    names = ROW.findall((ROOT / "docs" / "settings.md").read_text(encoding="utf-8"))
    for name in (name for name in names if name.startswith(options.only)):
        if name not in known:
            known[name] = {str(factor): with_settings(f"{name}={factor}", pairs) for factor in FACTORS}
            if options.json:
                options.json.write_text(json.dumps(known, indent=1))
        print(line(name, usual, known[name]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
