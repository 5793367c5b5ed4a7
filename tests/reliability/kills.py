"""A batch killed at random moments and taken up again: nothing may be lost, and the report is the same.

    python tests/reliability/kills.py [--kills 50] [--scheduler] [--seed 0]

Thirty-four pairs, two bodies to seventeen others. The whole run with its two jobs (--scheduler: the command,
while a dask scheduler and two workers of their own go on) gets SIGKILL when it has a random number of the
results that are left, none to all, and a random part of the time until the next has gone by: so kills fall
into the run whatever else the machine does. Every second round is killed once more before it may finish.
Exit status 1 when a round ends with fewer pairs or another report.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

from sgmds import characters

SOURCES, TARGETS, VERTICES = 2, 17, 120
PAIRS = SOURCES * TARGETS
POLL_SECONDS = 0.005
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


def results(output: Path) -> int:
    """Lines of the journal, torn ones too."""
    journal = output / "journal.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def waited(process, output: Path, count: int) -> float:
    """Seconds until there are so many results, or the process ends."""
    begun = time.monotonic()
    while process.poll() is None and results(output) < count:
        time.sleep(POLL_SECONDS)
    return time.monotonic() - begun


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--scheduler", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    choose = random.Random(options.seed)
    failed = 0
    moments = Counter()
    with ExitStack() as stack:
        home = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        write_bodies(home)
        manifest = home / "batch.toml"
        manifest.write_text(MANIFEST)
        worked_by = ["--scheduler", cluster(home, stack)] if options.scheduler else ["--jobs", "2"]

        def batch(output, *more):
            words = ["batch", manifest, "-o", output, "--cache", home / f"cache of {output.name}", *worked_by]
            return started("sgmds.command", *words, *more)

        process = batch(home / "reference")
        first = waited(process, home / "reference", 1)
        each = waited(process, home / "reference", PAIRS) / (PAIRS - 1)
        begun = time.monotonic()
        if process.wait():
            raise SystemExit("the undisturbed run failed")
        last = time.monotonic() - begun
        expected = report(home / "reference")
        for number in range(options.kills):
            output = home / f"round {number}"
            more = []
            for _ in range(1 + number % 2):
                process = batch(output, *more)
                had = results(output)
                # After each number of results as likely as after another.
                count = choose.randrange(PAIRS - had + 1)
                waited(process, output, had + count)
                until_next = first if count == 0 else last if had + count == PAIRS else each
                with suppress(subprocess.TimeoutExpired):
                    process.wait(choose.uniform(0, until_next))
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
                    there = results(output)
                    moment = "first" if there == had else "last" if there == PAIRS else "middle"
                    moments[moment] += 1
                more = ["--resume"]
            status = batch(output, "--resume").wait()
            maps = len(list(output.glob("maps/*.npz")))
            remains = [path.name for path in output.rglob(".*") if path.name != ".lock"]
            whole = maps == PAIRS and not status and report(output) == expected and not remains
            failed += not whole
            if not whole:
                print(f"round {number}: status {status}, {maps} maps, remains {remains}", flush=True)
    print(
        f"{options.kills} rounds, {moments.total()} kills: {moments['first']} before a result, "
        f"{moments['middle']} between two, {moments['last']} after all; {failed} rounds with something lost"
    )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
