"""A batch killed at random moments and taken up again: nothing may be lost, and the report is the same.

    python tests/reliability/kills.py [--kills 50] [--scheduler] [--seed 0]

Thirty-four pairs, two bodies to seventeen others. The whole run with its two jobs (--scheduler: the command,
while a dask scheduler and two workers of their own go on) gets SIGKILL after a random part of the time that
an undisturbed run takes; every second time it is killed once more before it may finish. Exit status 1 when
a round ends with fewer pairs or another report.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from sgmds import characters

SOURCES, TARGETS, VERTICES = 2, 17, 120
MANIFEST = """
options = { method = "paper" }
[[pairs]]
source = ["s*.off"]
target = "t*.off"
"""
REPORT = ("pairs.csv", "energy.csv", "confidence.csv", "report.json")


def write_bodies(folder: Path):
    poses = sorted(characters.POSES["biped"])
    for number in range(SOURCES + TARGETS):
        build = "slender" if number % 2 else "stout"
        made = characters.make("biped", build, poses[number % len(poses)], resolution=VERTICES, seed=number)
        name = f"s{number}" if number < SOURCES else f"t{number - SOURCES:02}"
        with open(folder / f"{name}.off", "w") as file:
            file.write(f"OFF\n{len(made.vertices)} {len(made.faces)} 0\n")
            file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in made.vertices.tolist())
            file.writelines(f"3 {a} {b} {c}\n" for a, b, c in made.faces.tolist())


def started(*command, **more):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(
        [sys.executable, "-m", *map(str, command)], start_new_session=True, **quiet | more
    )


def cluster(folder: Path, stack: ExitStack) -> str:
    """Address of a scheduler with two workers, which end with the stack."""
    place = folder / "scheduler.json"
    common = ["--scheduler-file", place, "--host", "127.0.0.1", "--no-dashboard"]
    roles = [("scheduler", "--port", "0"), *[("worker", "--nthreads", "1", "--no-nanny")] * 2]
    for role, *more in roles:
        process = started(f"distributed.cli.dask_{role}", *common, *more, cwd=folder)
        stack.callback(process.wait)
        stack.callback(process.kill)
        while role == "scheduler" and not (place.exists() and place.read_text()):
            if process.poll() is not None:
                raise SystemExit("the scheduler ended")
            time.sleep(0.05)
    return place.read_text().split('"address": "')[1].split('"')[0]


def report(folder: Path) -> dict:
    return {name: (folder / name).read_bytes() for name in REPORT}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--scheduler", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    choose = random.Random(options.seed)
    failed = killed = 0
    with ExitStack() as stack:
        home = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        write_bodies(home)
        manifest = home / "batch.toml"
        manifest.write_text(MANIFEST)
        worked_by = ["--scheduler", cluster(home, stack)] if options.scheduler else ["--jobs", "2"]

        def batch(output, *more):
            words = ["batch", manifest, "-o", output, "--cache", home / f"cache of {output.name}", *worked_by]
            return started("sgmds.command", *words, *more)

        begun = time.monotonic()
        if batch(home / "reference").wait():
            raise SystemExit("the undisturbed run failed")
        usual = time.monotonic() - begun
        expected = report(home / "reference")
        for number in range(options.kills):
            output = home / f"round {number}"
            more = []
            for _ in range(1 + number % 2):
                begun = time.monotonic()
                process = batch(output, *more)
                try:
                    process.wait(choose.uniform(0, usual))
                    if not more:
                        # The machine does less besides than during the undisturbed run.
                        usual = time.monotonic() - begun
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
                    killed += 1
                process.wait()
                more = ["--resume"]
            status = batch(output, "--resume").wait()
            maps = len(list(output.glob("maps/*.npz")))
            remains = [path.name for path in output.rglob(".*") if path.name != ".lock"]
            whole = maps == SOURCES * TARGETS and not status and report(output) == expected and not remains
            failed += not whole
            if not whole:
                print(f"round {number}: status {status}, {maps} maps, remains {remains}", flush=True)
    print(f"{options.kills} rounds, {killed} kills, {failed} with something lost or changed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
