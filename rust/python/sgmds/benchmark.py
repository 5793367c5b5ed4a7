"""Times of the stages and of the whole, beside peers, on one generated character pair of growing size.

A time is wall time from arrays in memory to the finished result, median of the runs; ours and the peers'
runs alternate, so that a busy machine slows both. What takes a fraction of a second is measured several
times a run, since such a machine changes from one moment to the next. Stages are those that the core tells
of, of one shape prepared alone and of the match of prepared ones; factorisation, a part of the eigenpairs,
is a kernel. Every run of a peer is a process of its own, which can be stopped when it takes too long.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np

SIZES = (5_000, 20_000, 50_000, 200_000, 1_000_000)
RUNS = 5
EIGENPAIRS = 200
SOURCES = 20
PEER_LIMIT_SECONDS = 120
# Above, the kernels are not run on the given mesh, since a match runs them on a simplified one.
LARGEST_FOR_KERNELS = 60_000
# Up to there ours are so short that they are measured so often in a run.
TIMES_A_RUN = 3
# Growth is fitted from here on, where the fixed part of the work no longer counts most.
FITTED_FROM = 45_000
# Larger characters are finer meshes of one of this size.
LARGEST_MESHED = 70_000
TRUTH_POINTS = 4_000

PEERS = {
    "eigsh": f"scipy eigsh, {EIGENPAIRS} pairs, one shape",
    "fast marching": f"potpourri3d fast marching, {SOURCES} sources",
    "heat": f"potpourri3d heat method, {SOURCES} sources",
    "pyfmaps": "pyfmaps, the whole pair",
}


# Our counterparts of the component peers, and what the eigenpairs cannot do without.
KERNELS = {
    "our factor": "one factorisation, a part of the eigenpairs",
    "our eigenpairs": f"eigenpairs, {EIGENPAIRS}, one shape",
    "our solves": "as many sparse solves in blocks, nothing else",
    "our marching": f"fast marching, {SOURCES} sources",
}
RATIOS = (("eigsh", "our eigenpairs"), ("our eigenpairs", "our solves"), ("fast marching", "our marching"))


def run(
    sizes=SIZES, runs: int = RUNS, peers: bool = True, report: Callable[[str], object] = print
) -> list[dict]:
    """One record a size, each measured in a process of its own, so that peak memory is that size's alone."""
    cores = os.cpu_count() or 1
    report(f"load {os.getloadavg()[0]:.1f} on {cores} cores; medians of {runs} alternating runs")
    records = []
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            pair = Path(folder) / "pair.npz"
            np.savez(pair, **_pair(size))
            out = _python(f"from sgmds.benchmark import measure; measure({str(pair)!r}, {runs}, {peers})")
            if out.returncode:
                from sgmds import SgmdsError

                reason = out.stderr.strip().splitlines()[-1:] or ["no reason given"]
                raise SgmdsError(f"the bench at {size} vertices stopped: {reason[0]}")
            records.append(json.loads(out.stdout))
        report(text(records[-1]))
    for line in summary(records):
        report(line)
    if peers:
        for name, error in sphere_errors().items():
            report(f"fast marching on a sphere, {name}: mean error {100 * error:.2f} %")
    return records


def summary(records: list[dict]) -> list[str]:
    """Growth with the vertices, and errors relative to the one near 20,000 vertices."""
    lines = []
    large = [r for r in records if r["vertices"] >= FITTED_FROM]
    if len(large) > 1:
        counts, times = (np.log([r[name] for r in large]) for name in ("vertices", "pair"))
        lines.append(
            f"a pair's time from {large[0]['vertices']} to {large[-1]['vertices']} vertices grows with the "
            f"exponent {np.polyfit(counts, times, 1)[0]:.2f}"
        )
    reference = [r for r in records if 15_000 < r["vertices"] < 30_000]
    for record in large if reference else []:
        lines.append(
            f"mean error at {record['vertices']} vertices: {record['error']:.2f}, "
            f"{record['error'] / reference[0]['error']:.2f} of the one at {reference[0]['vertices']}"
        )
    return lines


def _pair(size: int) -> dict:
    """Two poses of one body with about `size` vertices each, and points whose images are known."""
    from . import characters

    levels = 0
    while size > LARGEST_MESHED * 4**levels:
        levels += 1
    made = [
        characters.make("biped", "plain", pose, resolution=size // 4**levels, seed=seed)
        for seed, pose in enumerate(("wave", "walk"))
    ]
    ids, points = characters.truth(made[1], made[0])
    chosen = np.linspace(0, len(ids) - 1, min(TRUTH_POINTS, len(ids))).astype(int)
    arrays = {"ids": ids[chosen], "points": points[chosen]}
    for name, character in zip(("source", "target"), made, strict=True):
        vertices, faces = character.vertices, character.faces
        for _ in range(levels):
            vertices, faces = characters.subdivide(vertices, faces)
        arrays |= {f"{name}_vertices": vertices, f"{name}_faces": faces}
    return arrays


def measure(path: str, runs: int, peers: bool) -> None:
    """Prints one record: times in seconds, peak memory in MB, mean error ×100 √area."""
    pair = np.load(path)
    source, target = ((pair[f"{n}_vertices"], pair[f"{n}_faces"]) for n in ("source", "target"))
    before = _peak_memory()
    times: dict[str, list[float]] = defaultdict(list)
    threads: dict[str, int] = {}
    peaks: dict[str, float] = {}
    corr = None
    is_short = len(source[0]) <= LARGEST_FOR_KERNELS
    for _ in range(runs):
        for _ in range(TIMES_A_RUN if is_short else 1):
            # The shapes of the last one would count in this one's memory.
            corr = None
            corr = _time_ours(source, target, times, peaks)
            if peers and is_short:
                _time_kernels(source, times)
        for peer in PEERS if peers else ():
            _time_peer(peer, path, times, threads)
    assert corr is not None
    triangles = source[0][source[1][corr.faces[pair["ids"]]]]
    images = np.einsum("nc,nci->ni", corr.barycentric[pair["ids"]], triangles)
    a, b, c = (source[0][source[1][:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    record = {
        "vertices": len(target[0]),
        "runs": runs,
        "load": os.getloadavg()[0],
        "peak_mb": _peak_memory() - before,
        "error": float(100 * np.linalg.norm(images - pair["points"], axis=1).mean() / np.sqrt(area)),
        "grade": corr.quality.grade,
        "threads": threads,
        "stage_peaks_mb": {stage: peak - before for stage, peak in peaks.items()},
    }
    record |= {name: float(np.median(values)) for name, values in times.items() if values}
    # A peer that was stopped has no times.
    record |= {peer: None for peer in PEERS if peers and not times[peer]}
    print(json.dumps(record))


def _time_ours(source, target, times: dict, peaks: dict[str, float]):
    """Times of a pair, of what can be prepared of it, and of each stage, with the memory until its end."""
    import sgmds

    started = time.perf_counter()
    corr = sgmds.match(source, target)
    times["pair"].append(time.perf_counter() - started)

    started = time.perf_counter()
    corr.transfer(source[0])
    times["transfer"].append(time.perf_counter() - started)

    stages = _StageClock()
    started = time.perf_counter()
    shapes = [sgmds.Shape(*source, progress=stages)]
    times["prepare"].append(time.perf_counter() - started)
    stages.finish()
    shapes.append(sgmds.Shape(*target))
    started = time.perf_counter()
    sgmds.match(*shapes)
    times["match_prepared"].append(time.perf_counter() - started)
    # Once more for its stages: told of them, a match takes a few milliseconds more.
    stages.resume()
    sgmds.match(*shapes, progress=stages)
    stages.finish()
    for stage, seconds in stages.seconds.items():
        times["stage " + stage].append(seconds)
        peaks.setdefault(stage, stages.peaks[stage])
    return corr


def _time_kernels(mesh, times: dict) -> None:
    from ._core import Kernels

    vertices, faces = mesh
    kernels = Kernels(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64))
    solves = 0

    def eigenpairs():
        nonlocal solves
        solves = kernels.eigenpairs(EIGENPAIRS)[1]

    work = {
        "our factor": kernels.factorise,
        "our eigenpairs": eigenpairs,
        "our solves": lambda: kernels.bare_solves(solves),
        "our marching": lambda: kernels.distances(_sources(mesh)),
    }
    for name, run_once in work.items():
        started = time.perf_counter()
        run_once()
        times[name].append(time.perf_counter() - started)


def _sources(mesh) -> list[int]:
    return np.linspace(0, len(mesh[0]) - 1, SOURCES).astype(int).tolist()


def sphere_errors(size: int = 10_000) -> dict[str, float]:
    """Mean relative error of fast marching on an irregular sphere of about `size` vertices, where the
    distance is an angle: ours and potpourri3d's."""
    import potpourri3d
    from scipy.spatial import ConvexHull

    from ._core import Kernels

    points = np.random.default_rng(0).normal(size=(size, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    faces = ConvexHull(points).simplices.astype(np.int64)
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward, ::-1]
    sources = _sources((points, faces))
    solver = potpourri3d.MeshFastMarchingDistanceSolver(points, faces)
    found = {
        "ours": Kernels(points, np.ascontiguousarray(faces)).distances(sources),
        "potpourri3d": np.stack([solver.compute_distance([[(s, [])]]) for s in sources], axis=1),
    }
    true = np.arccos(np.clip(points @ points[sources].T, -1, 1))
    # Near a source every distance is short and a relative error says little.
    far = true > 0.1
    return {name: float((np.abs(d - true)[far] / true[far]).mean()) for name, d in found.items()}


def _time_peer(peer: str, path: str, times: dict, threads: dict[str, int]) -> None:
    """One run of a peer, with the number of threads that was fastest for it in the first."""
    if peer in threads and not times[peer]:
        return
    choices = [threads[peer]] if peer in threads else sorted({1, os.cpu_count() or 1})
    runs = []
    for count in choices:
        code = f"from sgmds.benchmark import run_peer; run_peer({peer!r}, {path!r})"
        try:
            done = _python(code, threads=count, limit=PEER_LIMIT_SECONDS)
        except subprocess.TimeoutExpired:
            continue
        if done.returncode:
            print(f"{peer}: {(done.stderr.strip().splitlines() or ['?'])[-1]}", file=sys.stderr)
            continue
        runs.append((float(done.stdout.splitlines()[-1]), count))
    threads[peer] = min(runs)[1] if runs else choices[0]
    if runs:
        times[peer].append(min(runs)[0])


def run_peer(peer: str, path: str) -> None:
    """Runs a peer once and prints its seconds, import and reading excluded."""
    pair = np.load(path)
    source, target = ((pair[f"{n}_vertices"], pair[f"{n}_faces"]) for n in ("source", "target"))
    work = _PEERS[peer](source, target)
    started = time.perf_counter()
    work()
    print(time.perf_counter() - started)


def text(record: dict) -> str:
    share = record["match_prepared"] / record["pair"]
    lines = [
        f"{record['vertices']} vertices: pair {record['pair']:.3f} s, prepared shapes "
        f"{record['match_prepared']:.3f} s ({share:.2f} of it), preparing one {record['prepare']:.3f} s, "
        f"transfer {1000 * record['transfer']:.1f} ms, peak {record['peak_mb']:.0f} MB more than the meshes, "
        f"error {record['error']:.2f} ({record['grade']}), load {record['load']:.1f}"
    ]
    for name, seconds in record.items():
        if name.startswith("stage "):
            peak = record["stage_peaks_mb"][name[6:]]
            lines.append(f"    {name[6:]:<46} {seconds:8.3f} s, peak until then {peak:6.0f} MB")
    for kernel, name in KERNELS.items():
        if kernel in record:
            lines.append(f"    kernel: {name:<48} {1000 * record[kernel]:8.1f} ms")
    for slow, fast in RATIOS:
        if record.get(slow) and record.get(fast):
            lines.append(f"    {PEERS.get(slow, slow)} / {fast}: {record[slow] / record[fast]:.1f}")
    for peer, name in PEERS.items():
        if record.get(peer) is not None:
            ratio, threads = record[peer] / record["pair"], record["threads"][peer]
            lines.append(
                f"    peer: {name:<40} {record[peer]:8.2f} s  = {ratio:.2f} × our pair, {threads} threads"
            )
        elif peer in record:
            lines.append(f"    peer: {name:<40}        –")
    return "\n".join(lines)


class _StageClock:
    """A progress callback that adds up the time between reports for the stage reported."""

    def __init__(self):
        self.seconds: dict[str, float] = defaultdict(float)
        self.peaks: dict[str, float] = {}
        self._stage, self._since = "start", time.perf_counter()

    def __call__(self, stage, fraction):
        now = time.perf_counter()
        self.seconds[self._stage] += now - self._since
        self.peaks[self._stage] = _peak_memory()
        self._stage, self._since = stage, now

    def finish(self):
        self("start", 1.0)

    def resume(self):
        self._since = time.perf_counter()


def _python(code: str, threads: int | None = None, limit: float | None = None):
    environment = dict(os.environ)
    if threads is not None:
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        environment |= {name: str(threads) for name in names}
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=limit
    )


def _peak_memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _scipy_eigenpairs(source, target):
    """Shift-invert Lanczos of scipy; the operator by potpourri3d."""
    import potpourri3d
    import scipy.sparse
    import scipy.sparse.linalg

    vertices, faces = source
    stiffness = potpourri3d.cotan_laplacian(vertices, faces).tocsc()
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    mass = np.bincount(faces.ravel(), np.repeat(area / 3, 3), len(vertices))
    masses = scipy.sparse.diags(mass).tocsc()
    return lambda: scipy.sparse.linalg.eigsh(stiffness, EIGENPAIRS, masses, sigma=-1e-8)


def _fast_marching(source, target):
    import potpourri3d

    def work():
        solver = potpourri3d.MeshFastMarchingDistanceSolver(*source)
        for vertex in _sources(source):
            solver.compute_distance([[(vertex, [])]])

    return work


def _heat(source, target):
    import potpourri3d

    def work():
        solver = potpourri3d.MeshHeatMethodDistanceSolver(*source)
        for vertex in _sources(source):
            solver.compute_distance(vertex)

    return work


def _pyfmaps(source, target):
    """150 eigenpairs, 20 basis functions, orientation term, 10 ICP, ZoomOut to 100 in steps of 5."""
    from pyFM.functional import FunctionalMapping
    from pyFM.mesh import TriMesh

    def work():
        model = FunctionalMapping(*(TriMesh(*mesh, area_normalize=True) for mesh in (source, target)))
        model.preprocess(descr_type="WKS", k_process=150)
        model.fit(K=(20, 20), w_orient=1)
        refined = model.zoomout_refine(model.icp_refine(nit=10), nit=16, step=5)
        model.get_p2p(refined)

    return work


_PEERS = {"eigsh": _scipy_eigenpairs, "fast marching": _fast_marching, "heat": _heat, "pyfmaps": _pyfmaps}
