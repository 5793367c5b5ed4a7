"""Times of the stages and of the whole, beside peers, on generated characters of growing size.

A time is wall time from arrays in memory to the finished result, median of the runs; ours and the peers'
runs alternate, so that a busy machine slows both. Stages are read from the progress reports of the core.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

SIZES = (5_000, 20_000, 50_000)
RUNS = 3
EIGENPAIRS = 200
SOURCES = 20
PEER_LIMIT_SECONDS = 120


def run(
    sizes=SIZES, runs: int = RUNS, peers: bool = True, report: Callable[[str], object] = print
) -> list[dict]:
    """One record a size, each measured in a process of its own, so that peak memory is that size's alone."""
    report(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; medians of {runs} runs")
    records = []
    for size in sizes:
        code = (
            "import json; from sgmds.benchmark import measure; "
            f"print(json.dumps(measure({size}, {runs}, {peers})))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        if done.returncode:
            from sgmds import SgmdsError

            raise SgmdsError(f"the bench at {size} vertices stopped: {done.stderr.strip().splitlines()[-1]}")
        records.append(json.loads(done.stdout))
        report(text(records[-1]))
    if len(records) > 1:
        counts = np.log([r["vertices"] for r in records])
        exponent = np.polyfit(counts, np.log([r["pair"] for r in records]), 1)[0]
        report(f"growth of a pair's time with its vertices: exponent {exponent:.2f}")
    return records


def measure(size: int, runs: int, peers: bool) -> dict:
    """Times in seconds and peak memory in MB for two characters of `size` vertices each."""
    import sgmds

    from . import characters

    first = characters.make("biped", "slender", "wave", resolution=size, seed=0)
    second = characters.make("biped", "stout", "walk", resolution=size, seed=1)
    before = _peak_memory()
    times = defaultdict(list)
    for _ in range(runs):
        stages = _StageClock()
        started = time.perf_counter()
        corr = sgmds.match((first.vertices, first.faces), (second.vertices, second.faces), progress=stages)
        times["pair"].append(time.perf_counter() - started)
        stages.finish()
        for stage, seconds in stages.seconds.items():
            times["stage " + stage].append(seconds)

        started = time.perf_counter()
        corr.transfer(first.weights)
        times["transfer"].append(time.perf_counter() - started)

        started = time.perf_counter()
        shapes = [sgmds.Shape(c.vertices, c.faces) for c in (first, second)]
        times["prepare"].append((time.perf_counter() - started) / 2)
        started = time.perf_counter()
        sgmds.match(*shapes)
        times["match_prepared"].append(time.perf_counter() - started)
        if peers:
            for name, peer in _PEERS.items():
                # A peer beyond the limit is not asked again.
                if times[name] and times[name][0] > PEER_LIMIT_SECONDS:
                    continue
                started = time.perf_counter()
                peer(first.vertices, first.faces, shapes[0].mass)
                times[name].append(time.perf_counter() - started)
    # Peak memory counts the peers too when they ran.
    record: dict[str, Any] = {
        "vertices": len(second.vertices),
        "runs": runs,
        "peak_mb": _peak_memory() - before,
        "peers": peers,
    }
    record |= {name: float(np.median(values)) for name, values in times.items()}
    for name in _PEERS:
        if record.get(name, 0) > PEER_LIMIT_SECONDS:
            record[name] = None
    return record


def text(record: dict) -> str:
    lines = [
        f"{record['vertices']} vertices: pair {record['pair']:.2f} s, prepared shapes "
        f"{record['match_prepared']:.2f} s, preparing one {record['prepare']:.2f} s, "
        f"transfer {1000 * record['transfer']:.1f} ms, peak {record['peak_mb']:.0f} MB more than the meshes"
    ]
    for name, seconds in record.items():
        if name.startswith("stage "):
            lines.append(f"    {name[6:]:<34} {seconds:8.3f} s")
    for name in _PEERS:
        if name in record:
            seconds = "       –" if record[name] is None else f"{record[name]:8.2f}"
            ratio = (
                "" if record[name] is None else f"  = {record[name] / record['pair']:.2f} × our whole pair"
            )
            lines.append(f"    peer: {name:<28} {seconds} s{ratio}")
    return "\n".join(lines)


class _StageClock:
    """A progress callback that adds up the time between reports for the stage reported."""

    def __init__(self):
        self.seconds: dict[str, float] = defaultdict(float)
        self._stage, self._since = "start", time.perf_counter()

    def __call__(self, stage, fraction):
        now = time.perf_counter()
        self.seconds[self._stage] += now - self._since
        self._stage, self._since = stage, now

    def finish(self):
        self.seconds[self._stage] += time.perf_counter() - self._since


def _peak_memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _scipy_eigenpairs(vertices, faces, mass):
    """Shift-invert Lanczos of scipy; the operator by potpourri3d."""
    import potpourri3d
    import scipy.sparse
    import scipy.sparse.linalg

    stiffness = potpourri3d.cotan_laplacian(vertices, faces).tocsc()
    scipy.sparse.linalg.eigsh(stiffness, EIGENPAIRS, scipy.sparse.diags(mass).tocsc(), sigma=-1e-8)


def _heat_geodesics(vertices, faces, mass):
    import potpourri3d

    solver = potpourri3d.MeshHeatMethodDistanceSolver(vertices, faces)
    for source in np.linspace(0, len(vertices) - 1, SOURCES).astype(int):
        solver.compute_distance(int(source))


_PEERS = {
    f"scipy eigsh, {EIGENPAIRS} pairs, one shape": _scipy_eigenpairs,
    f"heat geodesics, {SOURCES} sources": _heat_geodesics,
}
