"""The Princeton protocol over folders of shapes with known correspondences.

A set is a folder with `pairs.txt`, a line "A B" for each map asked for: for every vertex of A a vertex of B,
so that B is the source and A the target of `match`. For a truth line (a, b) and a map f the error is

    d_B(f(a), b) / √area(B)

with geodesic distances d_B; reported times 100. Sets are read by
[their layout][sgmds.shape_sets].
"""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from . import pictures
from .matching import METHODS, check_method, listed
from .shape import METRICS, check_choice, checked_count, checked_number, checked_threads
from .shape_sets import TRUTH_LINES, ShapeSet, Truth, check_ids, find_sets, set_error
from .whole_file import whole_file

RIGHT_BELOW = 8.0
"""A pair is right when its direct error ×100 is below this."""

CURVE_THRESHOLDS = np.linspace(0.0, 0.25, 51)
SAVED = "saved:"
DISTANCES = ("heat", "exact")
MISSING_BEYOND = 0.05
"""A target vertex has no counterpart when it lies farther than this times √area from every vertex that has
one."""


# ------------------------------------------------------------------ distances


def surface_area(vertices, faces) -> float:
    edges = vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    return float(np.linalg.norm(np.cross(*edges), axis=1).sum() / 2)


class TruthDistances:
    """Geodesic distances on one mesh from the truth's vertices, in units of √area, each row computed once.

    `kind` is "heat" (potpourri3d, within about 1 % of exact) or "exact" (pygeodesic, some ten times slower).
    With a `cache` folder rows are kept between runs, under the content of the mesh.
    """

    def __init__(self, vertices, faces, kind: str = "heat", cache=None):
        check_choice("distances", kind, DISTANCES)
        self.vertices, self.faces, self.kind = vertices, faces, kind
        self.scale = np.sqrt(surface_area(vertices, faces))
        self._rows: dict[int, np.ndarray] = {}
        self._solver: Any = None
        self._file: Path | None = None
        if cache is not None:
            content = hashlib.sha256(kind.encode() + vertices.tobytes() + faces.tobytes()).hexdigest()[:24]
            self._file = Path(cache) / f"{content}.npz"
            if self._file.exists():
                try:
                    with np.load(self._file) as stored:
                        self._rows = dict(zip(stored["ids"].tolist(), stored["rows"], strict=True))
                except Exception as error:
                    # As in `archive.read`, damage shows in many ways.
                    raise set_error(f"{self._file}: is damaged ({error}); delete it") from error

    def between(self, origins, points) -> np.ndarray:
        """Distances from `origins[i]` to `points[i]`. Rows of the origins are kept, so put the truth
        there."""
        missing = [int(i) for i in np.unique(origins) if int(i) not in self._rows]
        if missing:
            for i in missing:
                self._rows[i] = (self._row(i) / self.scale).astype(np.float32)
            if self._file is not None:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                with whole_file(self._file, binary=True) as file:
                    np.savez(file, ids=np.array(list(self._rows)), rows=np.stack(list(self._rows.values())))
        return np.array(
            [self._rows[int(i)][j] for i, j in zip(origins, points, strict=True)], dtype=np.float64
        )

    def from_any(self, origins) -> np.ndarray:
        """Distance along edges of every vertex to the nearest of the origins: some percent too long, but
        sound for any number of origins, which the heat method is not."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra

        ends = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        ends = np.unique(np.sort(ends, axis=1), axis=0)
        lengths = np.linalg.norm(self.vertices[ends[:, 0]] - self.vertices[ends[:, 1]], axis=1)
        count = len(self.vertices)
        graph = coo_matrix((np.maximum(lengths, 1e-300), (ends[:, 0], ends[:, 1])), shape=(count, count))
        return dijkstra(graph.tocsr(), directed=False, indices=np.unique(origins), min_only=True) / self.scale

    def _row(self, origin: int) -> np.ndarray:
        if self.kind == "heat":
            if self._solver is None:
                import potpourri3d

                self._solver = potpourri3d.MeshHeatMethodDistanceSolver(self.vertices, self.faces)
            row = self._solver.compute_distance(origin)
        else:
            if self._solver is None:
                import pygeodesic.geodesic

                self._solver = pygeodesic.geodesic.PyGeodesicAlgorithmExact(self.vertices, self.faces)
            row = self._solver.geodesicDistances(np.array([origin], np.int32), None)[0]
        if not np.isfinite(row).all():
            remedy = 'try distances="exact"' if self.kind == "heat" else "join its parts or leave it out"
            raise set_error(f"{self.kind} distances on this mesh are not finite; {remedy}")
        return row


def random_rotation(seed: int, name: str) -> np.ndarray:
    """A rotation, (3, 3), uniform over all: that of a random unit quaternion, for a name always the same."""
    w, *v = np.random.default_rng([seed, crc32(name.encode())]).normal(size=4)
    scale = 2.0 / (w * w + np.dot(v, v))
    x, y, z = v
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + scale * (w * cross + cross @ cross)


# ------------------------------------------------------------------ one pair


def pair_errors(distances: TruthDistances, images, a, b) -> np.ndarray:
    """Error of each truth line; NaN where the map has no image (-1)."""
    check_ids(a, len(images))
    check_ids(b, len(distances.vertices))
    answers = np.asarray(images)[a]
    errors = np.full(len(a), np.nan)
    matched = answers >= 0
    check_ids(answers[matched], len(distances.vertices))
    errors[matched] = distances.between(b[matched], answers[matched])
    return errors


def error_summary(errors) -> dict[str, float]:
    """Mean ×100, fractions below 0.25, 0.10 and 0.05 among the matched lines, and the share of matched
    lines."""
    known = errors[~np.isnan(errors)]
    if len(known) == 0:
        nothing = float("nan")
        return {
            "mean": nothing,
            "under_0.25": nothing,
            "under_0.10": nothing,
            "under_0.05": nothing,
            "matched": 0.0,
        }
    return {
        "mean": float(100 * known.mean()),
        "under_0.25": float((known < 0.25).mean()),
        "under_0.10": float((known < 0.10).mean()),
        "under_0.05": float((known < 0.05).mean()),
        "matched": float(len(known) / len(errors)),
    }


def sparsification(errors, confidence) -> dict[str, float]:
    """How well confidence sorts the errors: mean ×100 of the most confident half, beside the best possible
    half, and the area between the two curves "mean error of the most confident share" (0 = perfect)."""
    known = ~np.isnan(errors)
    errors, confidence = errors[known], confidence[known]
    if len(errors) == 0:
        return {}
    counts = np.arange(1, len(errors) + 1)
    ours = np.cumsum(errors[np.argsort(-confidence, kind="stable")]) / counts
    ideal = np.cumsum(np.sort(errors)) / counts
    half = (len(errors) + 1) // 2 - 1
    return {
        "confident_half": float(100 * ours[half]),
        "ideal_half": float(100 * ideal[half]),
        "sparsification_gap": float(100 * (ours - ideal).mean()),
        "sparsification_ours": float(100 * ours.mean()),
        "sparsification_ideal": float(100 * ideal.mean()),
    }


@dataclass
class PairResult:
    """Figures of one pair; errors are ×100."""

    a: str
    b: str
    direct: float
    swapped: float | None
    status: str
    under: dict[str, float]
    lines: int
    matched: float
    seconds: float
    grade: str | None = None
    reasons: list[str] = field(default_factory=list)
    alternatives: list[float] = field(default_factory=list)
    flipped: float | None = None
    """Share of the truth lines that are nearer to the truth with the sides exchanged, where that is known."""
    confidence: dict[str, float] = field(default_factory=dict)
    energy: float | None = None
    """Where a minimisation ended, and the norm of the gradient there."""
    gradient_norm: float | None = None
    errors: np.ndarray | None = field(default=None, repr=False)
    swapped_errors: np.ndarray | None = field(default=None, repr=False)

    @property
    def best(self) -> float:
        return self.direct if self.swapped is None else min(self.direct, self.swapped)

    def row(self) -> str:
        swapped = "     –" if self.swapped is None else f"{self.swapped:6.2f}"
        text = (
            f"{self.a:>22} {self.b:<22} {self.direct:6.2f} {swapped}  {self.status:<8} {self.grade or '':<6}"
        )
        text += f"{self.seconds:8.2f} s"
        if self.alternatives:
            text += "  alternatives " + " ".join(f"{e:.1f}" for e in self.alternatives)
        return text


ROW_HEADER = (
    f"{'A (target)':>22} {'B (source)':<22} {'direct':>6} {'swapped':>6} {'status':<8} "
    f"{'grade':<6}{'time':>8}"
)


@dataclass
class SetResult:
    """Pairs of one set and what they come to."""

    name: str
    method: str
    distances: str
    bound: float
    pairs: list[PairResult] = field(default_factory=list)
    rotated: int | None = None
    """Seed of the rotations, where shapes were turned."""
    failed: dict[str, str] = field(default_factory=dict)
    prepare_seconds: dict[str, float] = field(default_factory=dict)
    saved: dict[str, list[np.ndarray]] = field(default_factory=dict, repr=False)

    def summary(self) -> dict:
        direct = np.array([p.direct for p in self.pairs])
        right = direct < self.bound
        status = Counter(p.status for p in self.pairs)
        result = {
            "pairs": len(self.pairs),
            "failed": len(self.failed),
            "direct": _mean(direct),
            "best": _mean([p.best for p in self.pairs]),
            "median": float(np.median(direct)) if len(direct) else float("nan"),
            "worst": float(direct.max()) if len(direct) else float("nan"),
            "right": status["right"],
            "mirrored": status["mirrored"],
            "broken": status["broken"],
            "direct_of_right": _mean(direct[right]),
            "under_0.25": _mean([p.under["0.25"] for p in self.pairs]),
            "under_0.10": _mean([p.under["0.10"] for p in self.pairs]),
            "under_0.05": _mean([p.under["0.05"] for p in self.pairs]),
            "median_seconds": _median([p.seconds for p in self.pairs]),
            "median_prepare_seconds": _median(list(self.prepare_seconds.values())),
            "grades": dict(Counter(p.grade for p in self.pairs if p.grade)),
            "wrong_but_green": sum(p.status != "right" and p.grade == "green" for p in self.pairs),
        }
        minimised = [p for p in self.pairs if p.gradient_norm is not None]
        if minimised:
            result["median_energy"] = _median([p.energy for p in minimised])
            result["median_gradient_norm"] = _median([p.gradient_norm for p in minimised])
        flipped = [p.flipped for p in self.pairs if p.flipped is not None]
        if flipped:
            result["flipped"] = _mean(flipped)
        for figure in sorted({key for p in self.pairs for key in p.confidence}):
            result[figure] = _mean([p.confidence[figure] for p in self.pairs if figure in p.confidence])
        return result

    def text(self) -> str:
        s = self.summary()
        mean = f"; their mean {s['direct_of_right']:.2f}" if s["right"] else ""
        # Maps that were saved took no time here.
        preparing = f", preparing a shape {s['median_prepare_seconds']:.2f} s" if self.prepare_seconds else ""
        lines = [
            f"{self.name}, method {self.method}: mean direct {s['direct']:.2f}, "
            f"best of both sides {s['best']:.2f}, median {s['median']:.2f}, worst {s['worst']:.2f} "
            f"(×100, {self.distances} distances)",
            f"  {s['right']} of {s['pairs']} right (below {self.bound:g}{mean}), {s['mirrored']} mirrored, "
            f"{s['broken']} broken, {s['failed']} failed",
            *([f"  every shape turned at random (seed {self.rotated})"] if self.rotated is not None else []),
            *([f"  nearer to the other side: {s['flipped']:.3f}"] if "flipped" in s else []),
            f"  below 0.25 / 0.10 / 0.05: {s['under_0.25']:.3f} / {s['under_0.10']:.3f} / "
            f"{s['under_0.05']:.3f}",
            f"  median time: match {s['median_seconds']:.2f} s{preparing}",
        ]
        if "median_energy" in s:
            lines.append(
                f"  minimisation ended at, median: energy {s['median_energy']:.4g}, gradient norm "
                f"{s['median_gradient_norm']:.2g}"
            )
        if s["grades"]:
            grades = ", ".join(f"{n} {g}" for g, n in s["grades"].items())
            lines.append(f"  grades: {grades}; green among the wrong: {s['wrong_but_green']}")
        if "confident_half" in s:
            lines.append(
                f"  confidence: best half {s['confident_half']:.2f} (ideal {s['ideal_half']:.2f}), "
                f"area under the sparsification curve {s['sparsification_ours']:.2f} "
                f"(ideal {s['sparsification_ideal']:.2f})"
            )
        if "missing_doubted" in s:
            lines.append(
                f"  vertices without a counterpart with confidence below 0.5: {s['missing_doubted']:.3f}, "
                f"others above 0.5: {s['present_trusted']:.3f}"
            )
        lines += [f"  failed {pair}: {reason}" for pair, reason in self.failed.items()]
        return "\n".join(lines)

    def curves(self) -> dict[str, np.ndarray]:
        """Share of truth lines within each of `CURVE_THRESHOLDS`: ours, and each saved method's on its
        pairs."""
        own = [p.errors for p in self.pairs if p.errors is not None]
        curves = {self.method: own} | self.saved
        return {name: error_curve(np.concatenate(errors)) for name, errors in curves.items() if errors}


@dataclass
class Evaluation:
    """Result of `evaluate`: a list of `SetResult` in `sets`, ready for printing, JSON and plots."""

    sets: list[SetResult] = field(default_factory=list)

    @property
    def pairs(self) -> list[PairResult]:
        return [p for s in self.sets for p in s.pairs]

    def summary(self) -> dict[str, dict]:
        return {s.name: s.summary() for s in self.sets}

    def text(self) -> str:
        return "\n".join(s.text() for s in self.sets)

    def as_json(self) -> dict:
        result = {}
        for s in self.sets:
            pairs = []
            for pair in s.pairs:
                record = asdict(pair)
                del record["errors"], record["swapped_errors"]
                pairs.append(record)
            result[s.name] = {
                "method": s.method,
                "distances": s.distances,
                "bound": s.bound,
                "rotated": s.rotated,
                "summary": s.summary(),
                "thresholds": CURVE_THRESHOLDS.tolist(),
                "curves": {name: curve.tolist() for name, curve in s.curves().items()},
                "prepare_seconds": s.prepare_seconds,
                "failed": s.failed,
                "pairs": pairs,
            }
        return {"sets": result}

    def plot(self, path) -> None:
        """Error curves, a panel for each set, beside those of the set's saved maps on the same pairs."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5.2 * len(self.sets), 4.4), layout="constrained")
        panels = figure.subplots(1, len(self.sets), squeeze=False)[0]
        for panel, s in zip(panels, self.sets, strict=True):
            curves = []
            for i, (name, curve) in enumerate(s.curves().items()):
                style = {"color": "#d1495b", "linewidth": 2.4} if i == 0 else {"linewidth": 1.3}
                (line,) = panel.plot(CURVE_THRESHOLDS, 100 * curve, **style)
                curves.append((line, f"sgmds {name}" if i == 0 else name))
            pictures.caption(panel, f"{s.name}, {len(s.pairs)} pairs")
            panel.set_xlabel("geodesic error / √area")
            panel.set_xlim(0, CURVE_THRESHOLDS[-1])
            panel.set_ylim(0, 100)
            panel.grid(alpha=0.25)
            pictures.legend(panel, curves)
        panels[0].set_ylabel("% of correspondences within")
        pictures.save(figure, path, dpi=160)


def _mean(values) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _median(values) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def error_curve(errors) -> np.ndarray:
    """Share of the errors within each of `CURVE_THRESHOLDS`."""
    known = np.sort(errors[~np.isnan(errors)])
    return np.searchsorted(known, CURVE_THRESHOLDS, side="right") / max(len(known), 1)


# ------------------------------------------------------------------ the whole run


def evaluate(
    folder,
    set: str | Iterable[str] | None = None,  # noqa: A002 - the word users know from the data
    limit: int | None = None,
    method: str | Callable = "auto",
    *,
    every: int = 1,
    bound: float = RIGHT_BELOW,
    lines: int | None = TRUTH_LINES,
    distances: str = "heat",
    reverse: bool = False,
    rotate: int | None = None,
    metric: str = "euclidean",
    compare: bool = False,
    cache=None,
    report: Callable[[str], object] | None = None,
    **match_options,
) -> Evaluation:
    """Match the pairs of one or more sets and measure the maps by the Princeton protocol.

    `folder` is a set or holds several, of which `set` picks some; `limit` takes the first pairs of each,
    `every=4` every fourth of them.
    `method` is one of `match`'s, "saved:NAME" for the maps stored with the set, or a callable `(source,
    target) -> vertex ids` given (vertices, faces) twice. A pair is *right* when its direct error ×100 is
    below `bound`, else *mirrored* when the error against the swapped truth is, else *broken*. `distances` is
    "heat" or "exact", `lines` the truth lines asked of a pair, `reverse` exchanges source and target of every
    pair. With `rotate`, a seed, every shape is matched turned at random, so that nothing can be read off how
    it stands. `metric` is that of the prepared shapes; errors are always measured in space. `compare`
    measures saved maps of other methods on the same pairs too, `cache` is a folder that keeps truth distances
    between runs. `report` receives each line of the table. Everything else goes to `match`.

    Each shape is prepared once and let go after its last pair. A pair that cannot be matched is listed in
    `failed`.
    """
    if isinstance(method, str) and not method.startswith(SAVED):
        check_choice("method", method, METHODS)
    check_choice("distances", distances, DISTANCES)
    check_choice("metric", metric, METRICS)
    checked_count("every", every, 1)
    checked_number("bound", bound)
    for name, count in (("limit", limit), ("lines", lines)):
        if count is not None:
            checked_count(name, count, 1)
    if rotate is not None:
        checked_count("rotate", rotate, 0)
    checked_threads(match_options.get("threads"))
    for name in ("landmarks", "without"):
        if name in match_options:
            match_options[name] = listed(name, match_options[name])
    check_method(method if isinstance(method, str) else "a function", match_options)
    names = [set] if isinstance(set, str) else set
    result = Evaluation()
    for shapes in find_sets(folder, names):
        result.sets.append(
            _evaluate_set(
                shapes,
                limit,
                every,
                method,
                bound,
                lines,
                distances,
                reverse,
                rotate,
                metric,
                compare,
                cache,
                report,
                match_options,
            )
        )
    return result


def _evaluate_set(
    shapes,
    limit,
    every,
    method,
    bound,
    lines,
    distances,
    reverse,
    rotate,
    metric,
    compare,
    cache,
    report,
    match_options,
) -> SetResult:
    from sgmds import SgmdsError

    report = report or (lambda line: None)
    pairs = shapes.pairs()[:limit:every]
    if reverse:
        pairs = [(b, a) for a, b in pairs]
    label = method if isinstance(method, str) else getattr(method, "__name__", "callable")
    result = SetResult(shapes.name, label, distances, bound, rotated=rotate)
    pool = _ShapePool(shapes, pairs, distances, metric, rotate, cache, match_options.get("threads"))
    others = [m for m in shapes.saved_maps() if SAVED + m != label] if compare else []
    report(ROW_HEADER)
    for a, b in pairs:
        try:
            pair = _evaluate_pair(shapes, pool, a, b, method, bound, lines, match_options)
        except SgmdsError as error:
            result.failed[f"{a} {b}"] = str(error)
            report(f"{a:>22} {b:<22} failed: {error}")
        else:
            result.pairs.append(pair)
            report(pair.row())
            for other in others:
                images = shapes.saved_map(other, a, b)
                if images is not None:
                    truth = shapes.truth(a, b, len(pool.mesh(a)[0]), lines)
                    errors = pair_errors(pool.distances(b), images, truth.a, truth.b)
                    result.saved.setdefault(other, []).append(errors)
        pool.done(a)
        pool.done(b)
    result.prepare_seconds = pool.prepare_seconds
    return result


def _evaluate_pair(shapes, pool, a, b, method, bound, lines, match_options) -> PairResult:
    vertices_a = len(pool.mesh(a)[0])
    corr = None
    if callable(method):
        started = time.perf_counter()
        images = method(pool.turned(b), pool.turned(a))
    elif method.startswith(SAVED):
        started = time.perf_counter()
        images = shapes.saved_map(method[len(SAVED) :], a, b)
        if images is None:
            raise set_error(f"no saved map of {method[len(SAVED) :]} for this pair")
    else:
        import sgmds

        source, target = pool.shape(b), pool.shape(a)
        started = time.perf_counter()
        corr = sgmds.match(source, target, method=method, **match_options)
        images = corr.vertices
    seconds = time.perf_counter() - started
    if len(images) != vertices_a:
        raise set_error(f"the map has {len(images)} images for {vertices_a} vertices")

    truth = shapes.truth(a, b, vertices_a, lines)
    on_b = pool.distances(b)
    errors = pair_errors(on_b, images, truth.a, truth.b)
    figures = error_summary(errors)
    swapped = swapped_errors = flipped = None
    if truth.swapped_a is not None:
        swapped_errors = pair_errors(on_b, images, truth.swapped_a, truth.swapped_b)
        swapped = error_summary(swapped_errors)["mean"]
        flipped = _flipped(truth, errors, swapped_errors)
    status = "broken"
    if figures["mean"] < bound:
        status = "right"
    elif swapped is not None and swapped < bound:
        status = "mirrored"
    pair = PairResult(
        a,
        b,
        figures["mean"],
        swapped,
        status,
        {key[6:]: figures[key] for key in figures if key.startswith("under_")},
        len(truth.a),
        figures["matched"],
        seconds,
        flipped=flipped,
        errors=errors,
        swapped_errors=swapped_errors,
    )
    if corr is not None:
        pair.grade = getattr(corr.quality, "grade", None)
        pair.reasons = list(getattr(corr.quality, "reasons", ()))
        figures = getattr(corr.quality, "figures", {})
        pair.energy, pair.gradient_norm = figures.get("energy"), figures.get("gradient_norm")
        pair.alternatives = [
            error_summary(pair_errors(on_b, other.vertices, truth.a, truth.b))["mean"]
            for other in corr.alternatives
        ]
        confidence = np.asarray(corr.confidence)
        pair.confidence = sparsification(errors, confidence[truth.a]) | _missing_parts(
            pool.distances(a), truth.all_a, confidence
        )
    return pair


def _flipped(truth: Truth, errors, swapped_errors) -> float | None:
    """Share of the lines that are nearer to the other side, of those with an image and a partner there."""
    if truth.swapped_a is None or not np.array_equal(truth.a, truth.swapped_a):
        return None
    known = ~np.isnan(errors) & (truth.b != truth.swapped_b)
    return float((swapped_errors[known] < errors[known]).mean()) if known.any() else None


def _missing_parts(on_a: TruthDistances, present, confidence) -> dict[str, float]:
    """Where A is more than B: how many vertices without a counterpart are doubted, how many others
    trusted."""
    has_truth = np.zeros(len(confidence), dtype=bool)
    has_truth[present] = True
    if has_truth.all():
        return {}
    missing = on_a.from_any(present) > MISSING_BEYOND
    # A truth given on scattered samples leaves gaps of that size by chance; a missing part is larger than
    # that.
    if missing.mean() < 0.01:
        return {}
    return {
        "missing_doubted": float((confidence[missing] < 0.5).mean()),
        "present_trusted": float((confidence[~missing] > 0.5).mean()),
    }


class _ShapePool:
    """Meshes, prepared shapes and truth distances, each made when first needed and dropped after its last
    pair."""

    def __init__(
        self,
        shapes: ShapeSet,
        pairs,
        distances: str,
        metric: str,
        rotate: int | None,
        cache,
        threads: int | None,
    ):
        self._shapes, self._kind, self._metric, self._cache = shapes, distances, metric, cache
        self._threads, self._rotate = threads, rotate
        self._uses = Counter(name for pair in pairs for name in pair)
        self._meshes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._made: dict[str, Any] = {}
        self._distances: dict[str, TruthDistances] = {}
        self.prepare_seconds: dict[str, float] = {}

    def mesh(self, name):
        if name not in self._meshes:
            self._meshes[name] = self._shapes.mesh(name)
        return self._meshes[name]

    def turned(self, name):
        """The mesh as it is matched."""
        vertices, faces = self.mesh(name)
        if self._rotate is None:
            return vertices, faces
        return vertices @ random_rotation(self._rotate, name).T, faces

    def shape(self, name):
        if name not in self._made:
            import sgmds

            mesh = self.turned(name)
            started = time.perf_counter()
            self._made[name] = sgmds.Shape(*mesh, metric=self._metric, threads=self._threads)
            self.prepare_seconds[name] = time.perf_counter() - started
        return self._made[name]

    def distances(self, name) -> TruthDistances:
        if name not in self._distances:
            vertices, faces = self.mesh(name)
            self._distances[name] = TruthDistances(vertices, faces, self._kind, self._cache)
        return self._distances[name]

    def done(self, name):
        self._uses[name] -= 1
        if self._uses[name] <= 0:
            for kept in (self._meshes, self._made, self._distances):
                kept.pop(name, None)
