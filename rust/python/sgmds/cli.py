"""The command `sgmds`. Exit status: 0 done, 1 failed with one line on standard error, 2 wrong usage, 130
cancelled."""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

from . import __version__, extras
from .command import CANCELLED
from .errors import in_one_line
from .matching import METHODS, PARTS
from .shape import METRICS, MOST_THREADS
from .whole_file import whole_file

PICTURES = (".svg", ".pdf", ".png", ".eps", ".jpg", ".webp")
UNUSED = {"noise": ("plot",), "ablation": ("plot", "method"), "runtime": ("plot", "cache", "every")}
"""Options that an experiment of `reproduce` does not have."""


def main(arguments: list[str] | None = None) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        # As standard error does: a letter that the encoding lacks is no reason to fail.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = _run(_parser().parse_args(arguments))
    except SystemExit as end:
        # Help, the version, or wrong usage.
        if fault := _fault_of_output():
            return _fail(fault)
        raise end
    fault = _fault_of_output()
    return _fail(fault) if fault and status == 0 else status


def _run(options) -> int:
    import sgmds

    try:
        if fault := _fault_of_replacing(options):
            return _fail(fault)
        return options.run(options) or 0
    except (KeyboardInterrupt, sgmds.Cancelled):
        print("cancelled", file=sys.stderr)
        return CANCELLED
    except ImportError as error:
        return _fail(extras.missing(error.name) if error.name else str(error))
    except sgmds.SgmdsError as error:
        return _fail(str(error))
    except OSError as error:
        named = error.filename is not None and error.strerror
        return _fail(f"{error.filename}: {error.strerror}" if named else str(error))
    except MemoryError:
        return _fail("not enough memory: close other programs")


def _fail(reason: str) -> int:
    print(f"sgmds: {in_one_line(reason)}", file=sys.stderr)
    return 1


def _fault_of_output() -> str | None:
    """Words when what was printed cannot be written, as to a full disk; then nothing more is tried."""
    try:
        # Of an output that is closed there is none.
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        # Else Python itself tries again, and tells of it, when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return f"standard output: {error.strerror or error}"
    return None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="sgmds", description="Dense maps between deformable surfaces.")
    parser.add_argument("--version", action="version", version=f"sgmds {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    match = commands.add_parser("match", help="match two mesh files", description=_match.__doc__)
    match.add_argument(
        "source",
        type=Path,
        help="mesh that carries the data: .obj .off .ply .stl .glb, or .gz of the first three",
    )
    match.add_argument("target", type=Path, help="mesh that receives it")
    match.add_argument(
        "-o", "--output", type=Path, required=True, metavar="MAP.npz", help="a map that is there is replaced"
    )
    match.add_argument("--method", choices=METHODS, default="auto")
    match.add_argument(
        "--part", choices=("source", "target"), help="which of the two is only a part of the other"
    )
    match.add_argument("--mirror", choices=("forbid", "allow"), default="forbid")
    match.add_argument(
        "--same-axes",
        action="store_true",
        help="left, front and up are the same directions on both: for a body that is its own mirror image",
    )
    match.add_argument(
        "--metric", choices=METRICS, default="euclidean", help="how lengths on both surfaces are measured"
    )
    match.add_argument(
        "--landmark",
        type=_landmark,
        action="append",
        default=[],
        metavar="SOURCE:TARGET",
        help="a pair of vertices known to belong together; repeatable",
    )
    match.add_argument(
        "--alternatives",
        action="store_true",
        help="save the other plausible maps too, best first: as MAP.2.npz, MAP.3.npz and so on",
    )
    _add_common(match)
    match.set_defaults(run=_match)

    evaluate = commands.add_parser(
        "evaluate", help="measure maps where the truth is known", description=_evaluate.__doc__
    )
    evaluate.add_argument(
        "folder", type=Path, help="a set (has pairs.txt), or a folder of sets; see docs/evaluation.md"
    )
    evaluate.add_argument("--set", action="append", metavar="NAME", help="only this set; repeatable")
    evaluate.add_argument("--limit", type=_positive, metavar="N", help="only the first N pairs of each set")
    evaluate.add_argument("--every", type=_positive, default=1, metavar="N", help="only every Nth of them")
    evaluate.add_argument(
        "--method",
        default="auto",
        type=_method,
        help=f'one of {", ".join(METHODS)}, or "saved:NAME" for maps stored with the set',
    )
    evaluate.add_argument(
        "--bound", type=_error, default=8.0, help="a pair is right below this error (default 8)"
    )
    evaluate.add_argument(
        "--lines", type=_natural, default=400, help="truth lines asked of a pair, 0 for all (default 400)"
    )
    evaluate.add_argument("--distances", choices=("heat", "exact"), default="heat")
    evaluate.add_argument("--reverse", action="store_true", help="every pair the other way round")
    evaluate.add_argument(
        "--rotate", type=_natural, metavar="SEED", help="every shape is matched turned at random"
    )
    evaluate.add_argument("--metric", choices=METRICS, default="euclidean")
    evaluate.add_argument("--part", choices=("source", "target"))
    evaluate.add_argument(
        "--without",
        action="append",
        choices=PARTS,
        help="leave a part of the automatic method out; repeatable",
    )
    evaluate.add_argument("--mirror", choices=("forbid", "allow"))
    evaluate.add_argument("--same-axes", action="store_true", default=None)
    evaluate.add_argument("--cache", type=Path, metavar="DIR", help="keep truth distances there between runs")
    evaluate.add_argument("--json", type=_output, metavar="OUT", help="all figures")
    evaluate.add_argument(
        "--plot", type=_picture, metavar="OUT.svg", help="error curves, beside those of the saved maps"
    )
    evaluate.add_argument("-q", "--quiet", action="store_true", help="the summary only")
    _add_common(evaluate)
    _add_overwrite(evaluate)
    evaluate.set_defaults(run=_evaluate)

    reproduce = commands.add_parser(
        "reproduce", help="the paper's experiments, and an ablation", description=_reproduce.__doc__
    )
    reproduce.add_argument("experiment", choices=("curves", "noise", "runtime", "ablation"))
    reproduce.add_argument("folder", type=Path, help="a set (has pairs.txt), or a folder of sets")
    reproduce.add_argument("--set", action="append", metavar="NAME", help="only this set; repeatable")
    reproduce.add_argument("--method", action="append", choices=METHODS, help="repeatable")
    reproduce.add_argument("--every", type=_positive, metavar="N", help="only every Nth pair")
    reproduce.add_argument(
        "--cache", type=Path, metavar="DIR", help="keep truth distances there between runs"
    )
    reproduce.add_argument("--json", type=_output, metavar="OUT", help="all figures")
    reproduce.add_argument("--plot", type=_picture, metavar="OUT.svg", help="the error curves")
    _add_overwrite(reproduce)
    reproduce.set_defaults(run=_reproduce, error=reproduce.error)

    batch = commands.add_parser("batch", help="match many pairs, unattended", description=_batch.__doc__)
    batch.add_argument(
        "manifest", type=Path, metavar="MANIFEST.toml", help="what to match; see docs/batch.md"
    )
    batch.add_argument("-o", "--output", type=Path, metavar="DIR", help="instead of the manifest's folder")
    batch.add_argument("--jobs", type=_positive, metavar="N", help="worker processes (default: the cores)")
    batch.add_argument("--scheduler", metavar="ADDRESS", help="the dask scheduler whose workers do the work")
    batch.add_argument(
        "--insecure", action="store_true", help="let that be one of another machine, without encryption"
    )
    earlier = batch.add_mutually_exclusive_group()
    earlier.add_argument("--resume", action="store_true", help="take up the results in the output folder")
    earlier.add_argument("--overwrite", action="store_true", help="forget them and begin anew")
    batch.add_argument(
        "--anywhere", action="store_true", help="let the manifest name places outside of its folder"
    )
    batch.add_argument("--cache", type=Path, metavar="DIR", help="where prepared shapes are kept")
    batch.add_argument(
        "--cache-limit", type=_positive, default=10, metavar="GB", help="its size at most (default 10)"
    )
    batch.add_argument(
        "--threads", type=_threads, metavar="N", help="of each pair (default: cores over jobs)"
    )
    batch.set_defaults(run=_batch)

    bench = commands.add_parser("bench", help="time the stages", description=_bench.__doc__)
    bench.add_argument(
        "--sizes",
        type=_sizes,
        metavar="N,N,…",
        help="vertices of a shape (default 5000,20000,50000,200000,1000000)",
    )
    bench.add_argument("--runs", type=_positive, default=5, metavar="N", help="of which the median counts")
    bench.add_argument("--no-peers", action="store_true", help="only ourselves")
    bench.add_argument("--json", type=_output, metavar="OUT")
    _add_overwrite(bench)
    bench.set_defaults(run=_bench)
    return parser


def _add_common(parser):
    parser.add_argument("--threads", type=_threads, metavar="N")
    parser.add_argument("--seed", type=int, metavar="N")


def _add_overwrite(parser):
    parser.add_argument("--overwrite", action="store_true", help="replace files of figures and pictures")


def _natural(text: str, least: int = 0) -> int:
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"should be a whole number, {least} or more, got {text!r}")
    return int(text)


def _positive(text: str) -> int:
    return _natural(text, 1)


def _threads(text: str) -> int:
    if (count := _positive(text)) > MOST_THREADS:
        raise argparse.ArgumentTypeError(f"should be {MOST_THREADS} or less, got {text}")
    return count


def _error(text: str) -> float:
    try:
        bound = float(text)
    except ValueError:
        bound = math.nan
    if not 0 < bound < math.inf:
        raise argparse.ArgumentTypeError(f"should be a number above 0, got {text!r}")
    return bound


def _output(text: str) -> Path:
    """A file to be written, in a folder that is there: said before hours of work, not after."""
    path = Path(text)
    if fault := _fault_of_place(path):
        raise argparse.ArgumentTypeError(fault)
    return path


def _fault_of_replacing(options) -> str | None:
    """Words on a file that figures or a picture would replace, which may be somebody's."""
    for place in (getattr(options, "json", None), getattr(options, "plot", None)):
        if place and not options.overwrite and place.is_file() and place.stat().st_size:
            return f"{place}: is there already; please name another file, or replace it with --overwrite"
    return None


def _picture(text: str) -> Path:
    path = _output(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f"{path}: should end with one of {', '.join(PICTURES)}")
    return path


def _fault_of_place(path: Path) -> str | None:
    if path.is_dir():
        return f"{path}: is a folder; please name a file"
    if not path.parent.is_dir():
        return f"{path}: there is no folder {path.parent}; please make it first"
    if not os.access(path.parent, os.W_OK):
        return f"{path}: the folder {path.parent} cannot be written to; please name another place"
    return None


def _landmark(text: str) -> tuple[int, int]:
    try:
        source, target = (int(word) for word in text.split(":"))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"should be SOURCE:TARGET, two vertex numbers, got {text!r}"
        ) from None
    return source, target


def _sizes(text: str) -> list[int]:
    return [_positive(word) for word in text.split(",")]


def _method(text: str) -> str:
    if text in METHODS or text.startswith("saved:"):
        return text
    raise argparse.ArgumentTypeError(f'should be one of {", ".join(METHODS)} or "saved:NAME"')


def _write_json(path: Path, figures: Any) -> None:
    with whole_file(path) as file:
        file.write(json.dumps(_without_nan(figures), indent=1, allow_nan=False) + "\n")


def _without_nan(figures: Any) -> Any:
    """JSON has no word for what is no finite number: null."""
    match figures:
        case dict():
            return {name: _without_nan(figure) for name, figure in figures.items()}
        case list() | tuple():
            return [_without_nan(figure) for figure in figures]
        case float() if not math.isfinite(figures):
            return None
    return figures


def _given(options, *names) -> dict:
    """Options that were given, by name, so that defaults are stated in one place only: the core."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def _match(options) -> int:
    """For every vertex of TARGET, find its point on SOURCE, and save the map."""
    import sgmds

    from . import archive
    from .files import read_mesh

    if options.output.suffix != ".npz":
        return _fail(f"{options.output}: the map is saved as .npz; please name it so")
    if fault := _fault_of_place(options.output):
        return _fail(fault)
    archive.check_replaceable(options.output)
    meshes: list = [read_mesh(options.source), read_mesh(options.target)]
    found: list = []
    try:
        with _ProgressBar() as progress:
            shapes = meshes
            if options.metric != "euclidean":
                shapes = []
                for role, mesh in zip(("source", "target"), meshes, strict=True):
                    try:
                        shapes.append(
                            sgmds.Shape(
                                *mesh, metric=options.metric, progress=progress, threads=options.threads
                            )
                        )
                    except sgmds.MeshError as error:
                        raise sgmds.MeshError(f"{role}: {error}") from error
            corr = sgmds.match(
                *shapes,
                method=options.method,
                landmarks=options.landmark,
                same_axes=options.same_axes,
                progress=progress,
                **_given(options, "part", "mirror", "threads", "seed"),
            )
            found.append(corr)
            if options.alternatives:
                for index in range(corr.alternative_count):
                    found.append(corr.alternative(index, progress=progress, threads=options.threads))
    except sgmds.MeshError as error:
        role, _, reason = str(error).partition(": ")
        named = role in ("source", "target")
        return _fail(f"{getattr(options, role)}: {reason}" if named else str(error))
    paths = [options.output]
    paths += [options.output.with_suffix(f".{number}.npz") for number in range(2, len(found) + 1)]
    for path in paths[1:]:
        archive.check_replaceable(path)
    for path, each in zip(paths, found, strict=True):
        each.save(path)
        print(f"{in_one_line(str(path))}: {len(each.vertices)} vertices, {each.quality.grade}")
        for reason in each.quality.reasons:
            print(f"  {reason}")
    if corr.alternative_count and not options.alternatives and corr.quality.grade != "green":
        print(f"  other plausible maps: {corr.alternative_count}; --alternatives saves them too")
    return 0


def _evaluate(options) -> int:
    """Match the pairs of each set and measure the maps by the Princeton protocol: geodesic errors over
    √area, ×100."""
    from .evaluation import evaluate

    if options.plot:
        extras.require("matplotlib")
    result = evaluate(
        options.folder,
        set=options.set,
        limit=options.limit,
        every=options.every,
        method=options.method,
        bound=options.bound,
        lines=options.lines or None,
        distances=options.distances,
        reverse=options.reverse,
        rotate=options.rotate,
        metric=options.metric,
        compare=options.plot is not None,
        cache=options.cache,
        report=None if options.quiet else lambda line: print(line, flush=True),
        **_given(options, "part", "mirror", "same_axes", "without", "threads", "seed"),
    )
    if options.json:
        _write_json(options.json, result.as_json())
    if options.plot:
        result.plot(options.plot)
    print(result.text())
    if failed := sum(len(s.failed) for s in result.sets):
        return _fail(f"{failed} of {failed + len(result.pairs)} pairs could not be matched: see above")
    return 0


def _reproduce(options) -> int:
    """Error curves of the methods; their errors under noise along the normals and with triangles missing;
    user CPU times of the stages by mesh size; or what the parts of the automatic method contribute."""
    from . import experiments

    for name in UNUSED.get(options.experiment, ()):
        if getattr(options, name) is not None:
            options.error(f"--{name} has no meaning for {options.experiment}")
    if options.plot:
        extras.require("matplotlib")

    def report(line):
        print(line, flush=True)

    if options.experiment == "runtime":
        records = [
            record
            for method in options.method or ["paper"]
            for record in experiments.runtime(options.folder, options.set, method, report=report)
        ]
    else:
        given = {"report": report, **_given(options, "cache", "every")}
        if options.method:
            given["methods"] = options.method
        if options.experiment == "curves":
            given["plot"] = options.plot
        records = getattr(experiments, options.experiment)(options.folder, options.set, **given)
    if options.json:
        _write_json(options.json, records)
    return 0


def _batch(options) -> int:
    """Match the pairs of a manifest, or all of its shapes against all, and report how alike they are. What is
    done survives a crash: --resume goes on from there."""
    from . import batch

    with _PairsBar() as bar:
        summary = batch.run(
            options.manifest,
            output=options.output,
            scheduler_address=options.scheduler,
            insecure=options.insecure,
            resume=options.resume,
            overwrite=options.overwrite,
            anywhere=options.anywhere,
            cache=options.cache,
            cache_limit=options.cache_limit * 2**30,
            progress=bar,
            tell=bar.tell,
            **_given(options, "jobs", "threads"),
        )
    grades = ", ".join(f"{count} {grade}" for grade, count in summary["grades"].items() if count)
    folder = in_one_line(summary["folder"])
    print(f"{folder}: {summary['done']} of {summary['pairs']} pairs matched ({grades or 'none'})")
    if summary["failed"]:
        return _fail(f"{summary['failed']} pairs failed: see {summary['folder']}/pairs.csv")
    return 0


def _bench(options) -> int:
    """Time a pair of generated characters of growing size, stage by stage, beside peers."""
    from . import benchmark

    records = benchmark.run(
        options.sizes or benchmark.SIZES,
        options.runs,
        not options.no_peers,
        report=lambda line: print(line, flush=True),
    )
    if options.json:
        _write_json(options.json, records)
    return 0


class _ProgressBar:
    """`progress` for `match`: a bar on a terminal, silent elsewhere. Ctrl-C is seen between two reports."""

    def __enter__(self):
        self._bar = None
        if sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=100, leave=False, bar_format="{desc:<28}{bar}{percentage:4.0f} % {elapsed}"
            )
        return self

    def __exit__(self, *_):
        if self._bar is not None:
            self._bar.close()

    def __call__(self, stage: str, fraction: float) -> bool:
        if self._bar is not None:
            self._bar.set_description_str(stage, refresh=False)
            self._bar.n = round(100 * fraction, 1)
            self._bar.refresh()
        return True


class _PairsBar:
    """`progress` and `tell` for `batch`: pairs done and time left on a terminal; lines alone elsewhere."""

    def __enter__(self):
        self._bar = None
        return self

    def __exit__(self, *_):
        if self._bar is not None:
            self._bar.close()

    def __call__(self, done: int, every: int):
        if not sys.stderr.isatty():
            return
        if self._bar is None:
            from tqdm import tqdm

            self._bar = tqdm(
                total=every,
                initial=done,
                bar_format="{n} of {total} pairs {bar}{percentage:4.0f} %  {elapsed} gone, {remaining} left",
            )
        self._bar.update(done - self._bar.n)

    def tell(self, words: str):
        line = in_one_line(words)
        if self._bar is not None:
            self._bar.write(line, file=sys.stderr)
        else:
            print(line, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
