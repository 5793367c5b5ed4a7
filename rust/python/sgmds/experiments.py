"""The experiments of the paper, with its method and others beside it; what the parts of the automatic
method contribute.

Aflalo, Dubrovina, Kimmel, "Spectral Generalized Multi-Dimensional Scaling", arXiv:1311.2187: error curves on
TOSCA, robustness against noise along the normals and against missing triangles, run time by mesh size.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import pictures
from .evaluation import (
    CURVE_THRESHOLDS,
    RIGHT_BELOW,
    TRUTH_LINES,
    TruthDistances,
    error_curve,
    evaluate,
    find_sets,
    pair_errors,
)
from .matching import METHODS, PARTS

NOISE = (0.0, 0.1, 0.2, 0.4, 0.8)
"""Standard deviations of the noise along the normals, in mean edge lengths."""
MISSING = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Shares of triangles taken away at random."""
RUNTIME_VERTICES = 4344
"""Smallest mesh of the paper's table; the others come from the sets asked for."""


def curves(
    folder, names, methods=METHODS, every: int = 1, plot=None, cache=None, report: Callable = print
) -> dict:
    """Error curves of each method on every `every`-th pair of the sets, against the truth as it stands and
    against the better of it and its mirror image, which distances alone cannot tell apart."""
    results: dict[str, dict[str, dict]] = {}
    for method in methods:
        for found in evaluate(folder, names, method=method, every=every, cache=cache).sets:
            results.setdefault(found.name, {})[method] = {
                "pairs": len(found.pairs),
                "direct": found.summary()["direct"],
                "best": found.summary()["best"],
                "direct_curve": _curve(p.errors for p in found.pairs),
                "best_curve": _curve(
                    p.errors if p.direct <= p.best else p.swapped_errors for p in found.pairs
                ),
            }
            line = results[found.name][method]
            report(
                f"{found.name:<20} {method:<16} {line['pairs']:4d} pairs: direct {line['direct']:6.2f}, "
                f"lower of direct and mirrored {line['best']:6.2f}"
            )
    if plot:
        _plot_curves(results, plot)
    return results


def _curve(errors) -> list[float]:
    return error_curve(np.concatenate(list(errors))).tolist()


def _plot_curves(results, path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4 * len(results), 4.4), layout="constrained")
    panels = figure.subplots(1, len(results), squeeze=False)[0]
    for panel, (name, methods) in zip(panels, results.items(), strict=True):
        curves = []
        for i, (method, found) in enumerate(methods.items()):
            (line,) = panel.plot(CURVE_THRESHOLDS, 100 * np.array(found["best_curve"]), color=f"C{i}")
            curves.append((line, method))
            panel.plot(CURVE_THRESHOLDS, 100 * np.array(found["direct_curve"]), color=f"C{i}", ls=":")
        (dotted,) = panel.plot([], [], color="grey", ls=":")
        curves.append((dotted, "mirrored maps count as wrong"))
        pictures.caption(panel, name)
        panel.set(xlabel="geodesic error / √area", xlim=(0, CURVE_THRESHOLDS[-1]), ylim=(0, 100))
        panel.grid(alpha=0.25)
        pictures.legend(panel, curves)
    panels[0].set_ylabel("% of correspondences within")
    pictures.save(figure, path)


def with_noise(vertices, faces, deviation: float, seed: int = 0) -> np.ndarray:
    """Vertices moved along their normals by normal noise of so many mean edge lengths."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces, across[:, None, :])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean()
    shifts = np.random.default_rng(seed).normal(0, deviation * edge, len(vertices))
    return vertices + shifts[:, None] * normals


def without_triangles(faces, share: float, seed: int = 0) -> np.ndarray:
    """Triangles left when a share of them is taken away at random."""
    order = np.random.default_rng(seed).permutation(len(faces))
    return faces[np.sort(order[round(share * len(faces)) :])]


def noise(
    folder,
    names,
    methods=("paper", "auto"),
    every: int = 1,
    cache=None,
    levels=NOISE,
    shares=MISSING,
    report: Callable = print,
) -> list[dict]:
    """Mean errors ×100 when the target is damaged: its vertices moved along their normals, or triangles
    missing. Truth and distances are those of the whole meshes."""
    import sgmds

    damages = [("noise", level) for level in levels]
    damages += [("missing", share) for share in shares if share > 0]
    records = []
    for shapes in find_sets(folder, names):
        errors = defaultdict(list)
        for a, b in shapes.pairs()[::every]:
            (vertices, faces), whole = shapes.mesh(a), shapes.mesh(b)
            truth = shapes.truth(a, b, len(vertices), TRUTH_LINES)
            source = sgmds.Shape(*whole)
            distances = TruthDistances(*whole, cache=cache)
            for kind, size in damages:
                damaged = (vertices, without_triangles(faces, size))
                if kind == "noise":
                    damaged = (with_noise(vertices, faces, size), faces)
                target = sgmds.Shape(*damaged)
                for method in methods:
                    images = sgmds.match(source, target, method=method).vertices
                    direct = 100 * pair_errors(distances, images, truth.a, truth.b).mean()
                    best = direct
                    if truth.swapped_a is not None:
                        swapped = pair_errors(distances, images, truth.swapped_a, truth.swapped_b)
                        best = min(direct, 100 * swapped.mean())
                    errors[kind, size, method].append((direct, best))
        for (kind, size, method), found in errors.items():
            direct, best = np.mean(found, axis=0)
            records.append(
                {
                    "set": shapes.name,
                    "pairs": len(found),
                    "damage": kind,
                    "size": size,
                    "method": method,
                    "direct": float(direct),
                    "best": float(best),
                }
            )
            what = f"noise of {size:g} edges" if kind == "noise" else f"{100 * size:g} % missing"
            report(
                f"{shapes.name:<20} {what:<20} {method:<8} {len(found):4d} pairs: direct {direct:6.2f}, "
                f"lower of direct and mirrored {best:6.2f}"
            )
    return records


def ablation(
    folder,
    names,
    left_out=PARTS,
    every: int = 1,
    cache=None,
    bound: float = RIGHT_BELOW,
    report: Callable = print,
) -> list[dict]:
    """Mean direct error ×100 and pairs right when parts of the automatic method are left out, each alone,
    beside the whole method: what a part contributes. A pair without any map counts as wrong and not in the
    mean."""
    import sgmds

    records = []
    for shapes in find_sets(folder, names):
        errors = defaultdict(list)
        for a, b in shapes.pairs()[::every]:
            (vertices, faces), whole = shapes.mesh(a), shapes.mesh(b)
            truth = shapes.truth(a, b, len(vertices), TRUTH_LINES)
            source, target = sgmds.Shape(*whole), sgmds.Shape(vertices, faces)
            distances = TruthDistances(*whole, cache=cache)
            for without in ((), *((part,) for part in left_out)):
                try:
                    images = sgmds.match(source, target, without=without).vertices
                except sgmds.MatchError:
                    errors[without].append(np.nan)
                    continue
                errors[without].append(100 * pair_errors(distances, images, truth.a, truth.b).mean())
        for without, found in errors.items():
            record = {
                "set": shapes.name,
                "without": list(without),
                "pairs": len(found),
                "direct": float(np.nanmean(found)),
                "right": int((np.array(found) < bound).sum()),
                "errors": found,
            }
            records.append(record)
            report(
                f"{shapes.name:<20} {'without ' + without[0] if without else 'the whole method':<24} "
                f"{record['right']:3d} of {len(found):3d} right, mean direct {record['direct']:6.2f}"
            )
    return records


@dataclass
class _StageTimes:
    """A progress callback that adds up user CPU time and wall time by stage.

    The core is asked for its stage twenty times a second or so: shorter stages count for their neighbours.
    """

    user: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    wall: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _stage: str = "start"

    def __post_init__(self):
        self._since = self._now()

    def __call__(self, stage, fraction):
        now = self._now()
        self.user[self._stage] += now[0] - self._since[0]
        self.wall[self._stage] += now[1] - self._since[1]
        self._stage, self._since = stage, now

    @staticmethod
    def _now():
        return os.times().user, time.perf_counter()


def runtime(folder, names, method: Any = "paper", report: Callable = print) -> list[dict]:
    """User CPU time of every stage, one thread, for a generated pair of 4,344 vertices and for the pairs of
    the sets: both shapes prepared, then matched."""
    import sgmds

    from . import characters

    pairs = []
    small = [characters.make("biped", "plain", p, resolution=RUNTIME_VERTICES) for p in ("rest", "walk")]
    target, source = ((c.vertices, c.faces) for c in small)
    pairs.append(("generated", "generated", target, source))
    for shapes in find_sets(folder, names):
        pairs += [(a, b, shapes.mesh(a), shapes.mesh(b)) for a, b in shapes.pairs()]
    records = []
    for a, b, target, source in sorted(pairs, key=lambda p: len(p[2][0])):
        clock = _StageTimes()
        prepared = [sgmds.Shape(*mesh, progress=clock, threads=1) for mesh in (source, target)]
        clock("match", 0)
        corr = sgmds.match(*prepared, method=method, progress=clock, threads=1)
        clock("end", 1)
        record = {
            "target": a,
            "source": b,
            "vertices": len(target[0]),
            "steps": corr.quality.figures.get("steps"),
            "user": dict(clock.user),
            "user_total": sum(clock.user.values()),
            "wall_total": sum(clock.wall.values()),
        }
        records.append(record)
        stages = ", ".join(f"{stage} {s:.2f}" for stage, s in clock.user.items() if s > 0)
        report(
            f"{a} {b}: {record['vertices']} vertices, user CPU {record['user_total']:.2f} s, wall "
            f"{record['wall_total']:.2f} s under load {os.getloadavg()[0]:.0f} ({stages})"
        )
    return records
