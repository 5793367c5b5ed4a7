"""How long a cancelled computation goes on: random moments, the worst of each stage.

    python tests/reliability/cancellation.py [--vertices N | --files SOURCE TARGET] [--tries N] [--bound S]

Each try starts a preparation or a match and asks to stop at a random moment, as a user would, between two
calls of the progress function. Wall time is what the user waits; half of the process's CPU time is the least
it would be on two cores with nothing else running. Exit status 1 when the smaller of both exceeds the bound
anywhere.
"""

import argparse
import random
import sys
import threading
import time

import sgmds


def shapes(options):
    if options.files:
        from sgmds.files import read_mesh

        return [read_mesh(path) for path in options.files]
    from sgmds import characters

    pair = [
        characters.make("biped", build, pose, resolution=options.vertices, seed=seed)
        for seed, (build, pose) in enumerate([("slender", "wave"), ("stout", "walk")])
    ]
    return [(p.vertices, p.faces) for p in pair]


class Stopwatch:
    """Asks to stop after a delay and remembers when, and in which stage that was."""

    def __init__(self, delay):
        self.asked = None
        self.stage = "start"
        self.timer = threading.Timer(delay, self.ask)
        self.timer.daemon = True

    def ask(self):
        self.asked = (time.perf_counter(), time.process_time(), self.stage)

    def __call__(self, stage, fraction):
        self.stage = stage
        return self.asked is None

    def waited(self):
        wall, cpu, stage = self.asked
        return stage, time.perf_counter() - wall, (time.process_time() - cpu) / 2


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--vertices", type=int, default=50_000)
    parser.add_argument("--files", nargs=2)
    parser.add_argument("--tries", type=int, default=60)
    parser.add_argument("--bound", type=float, default=0.2, help="seconds")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    source, target = shapes(options)

    started = time.perf_counter()
    ready = sgmds.Shape(*source), sgmds.Shape(*target)
    preparing = time.perf_counter() - started
    started = time.perf_counter()
    sgmds.match(*ready)
    matching = time.perf_counter() - started
    jobs = [
        (preparing / 2, lambda watch: sgmds.Shape(*source, progress=watch)),
        (matching, lambda watch: sgmds.match(*ready, progress=watch)),
    ]
    worst = {}
    for index in range(options.tries):
        seconds, job = jobs[index % 2]
        watch = Stopwatch(draw.uniform(0, seconds))
        watch.timer.start()
        try:
            job(watch)
            watch.timer.cancel()
        except sgmds.Cancelled:
            stage, wall, cpu = watch.waited()
            worst.setdefault(stage, []).append((min(wall, cpu), wall, cpu))
    print(f"prepared in {preparing:.1f} s, matched in {matching:.1f} s")
    print(f"{'stage':<20} tries  worst wall  worst CPU / 2")
    late = False
    for stage, waits in worst.items():
        wall, cpu = (max(column) for column in list(zip(*waits, strict=True))[1:])
        print(f"{stage:<20} {len(waits):5} {wall:9.3f} s {cpu:12.3f} s")
        late |= max(waits)[0] > options.bound
    return int(late)


if __name__ == "__main__":
    sys.exit(main())
