"""Figures of docs/batch.md: many targets from one source, collections against themselves, one job and more.

    python .ci/bench_batch.py cast [--targets 40] [--vertices 20000] [--jobs 2] [--singles 5]
    python .ci/bench_batch.py collection [--shapes 100] [--vertices 500] [--jobs 2] [--method paper]

Characters are generated; every run starts with an empty cache. Both wall and processor time are given, since
only the latter means something on a machine that does other things as well.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sgmds import characters


def write_cast(folder, count, vertices):
    """`count` bipeds of nearly one build in poses between rest, wave and walk, as OFF files."""
    folder.mkdir()
    poses = characters.POSES["biped"]
    named = sorted(poses)
    for number in range(count):
        made = characters.make(
            "biped", "slender", named[number % len(named)], resolution=vertices, seed=number
        )
        with open(folder / f"c{number:03d}.off", "w") as file:
            file.write(f"OFF\n{len(made.vertices)} {len(made.faces)} 0\n")
            file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in made.vertices.tolist())
            file.writelines(f"3 {a} {b} {c}\n" for a, b, c in made.faces.tolist())


def measured(*arguments):
    """Wall and processor seconds of one command of ours and of all its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    subprocess.run([sys.executable, "-m", "sgmds.cli", *map(str, arguments)], check=True)
    wall = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def batch(folder, manifest, jobs):
    """Runs a manifest anew; returns wall and processor seconds and what the run told of itself."""
    path = folder / "batch.toml"
    path.write_text(manifest)
    for old in ("batch", "cache"):
        shutil.rmtree(folder / old, ignore_errors=True)
    times = measured("batch", path, "--jobs", jobs, "--cache", folder / "cache")
    return *times, json.loads((folder / "batch" / "runs.jsonl").read_text().splitlines()[-1])


def cast(folder, options):
    write_cast(folder / "meshes", options.targets + 1, options.vertices)
    step = max(1, options.targets // options.singles)
    asked = [f"meshes/c{number:03d}.off" for number in range(1, options.targets + 1, step)]
    singles = [
        measured("match", folder / "meshes/c000.off", folder / f, "-o", folder / "m.npz") for f in asked
    ]
    wall, cpu = (sum(times) / len(singles) for times in zip(*singles, strict=True))
    print(f"single pair, mean of {len(singles)}: {wall:.2f} s, processor {cpu:.2f} s")
    targets = ", ".join(f'"meshes/c{number:03d}.off"' for number in range(1, options.targets + 1))
    manifest = f'[[pairs]]\nsource = "meshes/c000.off"\ntarget = [{targets}]\n'
    every_wall, every_cpu, run = batch(folder, manifest, options.jobs)
    count = run["pairs"]
    each_wall, each_cpu = every_wall / count, every_cpu / count
    print(f"{count} targets, {options.jobs} jobs, per pair: {each_wall:.2f} s, processor {each_cpu:.2f} s")
    print(f"share of a single pair: {each_wall / wall:.2f}, processor {each_cpu / cpu:.2f}")
    print(json.dumps(run))


def collection(folder, options):
    write_cast(folder / "meshes", options.shapes, options.vertices)
    manifest = (
        f'all_against_all = "meshes/*.off"\nmaps = {options.maps}\noptions.method = "{options.method}"\n'
    )
    wall, cpu, run = batch(folder, manifest, options.jobs)
    count = run["pairs"]
    print(f"{options.shapes} shapes of {options.vertices} vertices, {count} pairs, {options.jobs} jobs:")
    print(
        f"{wall:.0f} s, processor {cpu:.0f} s; per pair {wall / count:.3f} s, processor {cpu / count:.3f} s"
    )
    print(json.dumps(run))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("cast", "collection"))
    parser.add_argument("--targets", type=int, default=40)
    parser.add_argument("--singles", type=int, default=5)
    parser.add_argument("--shapes", type=int, default=100)
    parser.add_argument("--vertices", type=int)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--method", default="paper")
    parser.add_argument("--maps", choices=("true", "false"), default="false")
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    options.vertices = options.vertices or {"cast": 20_000, "collection": 500}[options.what]
    with tempfile.TemporaryDirectory() as folder:
        {"cast": cast, "collection": collection}[options.what](Path(folder), options)


if __name__ == "__main__":
    main()
