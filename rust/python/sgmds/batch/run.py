"""A run of a batch from manifest to report."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from .. import extras
from ..cache import LIMIT_BYTES
from ..correspondence import is_map
from ..errors import ArgumentError, SgmdsError
from ..locks import try_lock
from ..shape import checked_count, checked_threads
from ..whole_file import begins_with, clear_remains
from . import journal, manifest, processes, report, scheduler, work

RUNS = "runs.jsonl"
"""One line a run: what it did and what it took. Times are here and in the journal, nowhere else."""
RUNS_BEGINNING = b'{"began": '
"""By which the file is known."""


def run(
    path,
    *,
    output=None,
    jobs: int | None = None,
    scheduler_address: str | None = None,
    insecure: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    anywhere: bool = False,
    threads: int | None = None,
    cache=None,
    cache_limit: int = LIMIT_BYTES,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] = lambda line: None,
) -> dict:
    """Matches every pair of a manifest that has no result yet, and writes the report.

    Parameters
    ----------
    path : path of the TOML manifest
    output : path, optional
        Folder of the results, instead of what the manifest says.
    jobs : int, optional
        Worker processes, by default one a processor core.
    scheduler_address : str, optional
        A dask scheduler whose workers do the work, instead of processes of this machine.
    insecure : bool
        Let that scheduler be one of another machine whose address is not encrypted.
    resume, overwrite : bool
        What to do with results in the folder: take them up, or forget them. Else they are an error.
    anywhere : bool
        Let the manifest write outside of its folder.
    threads : int, optional
        Threads of each pair, by default the cores over the jobs; the results do not depend on them.
    cache, cache_limit
        Folder and bytes of the cache of prepared shapes; see `sgmds.cache.ShapeCache`.
    progress : callable, optional
        ``progress(done, all)``, before the first and after every pair.
    tell : callable
        Told in one line of each failure and of other trouble, as it happens.

    Returns
    -------
    dict
        The summary that is in `report.json`.

    Raises
    ------
    ArgumentError, SgmdsError, OSError, ImportError
        When the batch cannot be begun or gone on with. A pair that fails is in the report instead.
    """
    threads = checked_threads(threads)
    if scheduler_address is not None:
        scheduler.check_address(scheduler_address, insecure)
    if jobs is not None:
        checked_count("jobs", jobs, 1)
    batch = manifest.read(path, output, anywhere)
    # What every pair, or the report after all of them, would fail for.
    extras.require("matplotlib")
    with _claimed(batch.folder):
        _check_place(batch, overwrite)
        if journal.exists(batch.folder) and not resume:
            if not overwrite:
                raise ArgumentError(
                    f"{batch.folder} has results of an earlier run: take them up with --resume, "
                    "or forget them with --overwrite"
                )
            (batch.folder / journal.NAME).unlink()
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        jobs = jobs or cores
        if threads is None and scheduler_address is None:
            threads = max(1, cores // jobs)
        settings = work.Settings(batch.options, threads, Path(cache) if cache else None, cache_limit)
        with journal.Journal(batch) as kept:
            count = sum(1 for _ in kept.open_pairs())
            tasks = (_task(batch, number) for number in kept.open_pairs())
            if scheduler_address is None:
                outcomes = processes.run(tasks, jobs, settings)
            else:
                outcomes = scheduler.run(tasks, scheduler_address, settings)
            effort = _follow(batch, kept, outcomes, count, progress, tell)
            pairs = map(batch.pair, range(len(batch)))
            clear_remains((pair.map for pair in pairs if pair.map is not None), is_map)
            clear_remains((batch.folder / name for name in report.NAMES), report.is_report)
            summary = report.write(batch, kept.records())
        effort |= {"jobs": jobs, "threads": threads, "scheduler": scheduler_address}
        with open(batch.folder / RUNS, "a", encoding="utf-8") as file:
            file.write(json.dumps(effort) + "\n")
    return summary | {"folder": str(batch.folder), "run": effort}


def _check_place(batch, overwrite):
    """Raises `ArgumentError` when the work would replace a file that no run of a batch has written."""
    for name, beginning in ((journal.NAME, journal.BEGINNING), (RUNS, RUNS_BEGINNING)):
        place = batch.folder / name
        if place.exists() and not begins_with(place, beginning):
            raise ArgumentError(
                f"{place}: is not of a run of a batch and would be written to: choose another output folder"
            )
    if journal.exists(batch.folder) or overwrite:
        return
    maps = (batch.pair(number).map for number in range(len(batch)))
    reports = (batch.folder / name for name in report.NAMES)
    for place in itertools.chain(reports, filter(None, maps)):
        if place.exists():
            raise ArgumentError(
                f"{place}: is there, and not of an earlier run: choose another output folder, "
                "or replace it with --overwrite"
            )


def _task(batch, number) -> work.Task:
    pair = batch.pair(number)
    source, target = batch.shapes[pair.source].path, batch.shapes[pair.target].path
    return work.Task(number, source, target, pair.map, pair.landmarks)


def _follow(batch, kept, outcomes, count, progress, tell) -> dict:
    """Writes down every outcome as it comes; returns what the run took."""
    began, started = datetime.now(UTC), time.perf_counter()
    done = len(batch) - count
    totals = {"pairs": 0, "failed": 0, "hits": 0, "misses": 0, "damaged": 0, "cpu_seconds": 0.0}
    peak = 0
    if progress:
        progress(done, len(batch))
    # The generator ends its workers when it is closed, however this loop is left.
    with contextlib.closing(outcomes):
        for task, outcome in outcomes:
            kept.add(task.number, outcome)
            done += 1
            totals["pairs"] += 1
            for name in ("hits", "misses", "damaged", "cpu_seconds"):
                totals[name] += outcome.effort.get(name, 0)
            peak = max(peak, outcome.effort.get("peak_mb", 0))
            for note in outcome.notes:
                tell(note)
            if outcome.record["status"] != "done":
                totals["failed"] += 1
                tell(f"{task.source.name} to {task.target.name} failed: {outcome.record['reason']}")
            if progress:
                progress(done, len(batch))
    return {
        "began": began.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - started, 3),
        **totals,
        "worker_peak_mb": peak,
        "own_peak_mb": round(work.peak_memory() / 2**20),
    }


@contextlib.contextmanager
def _claimed(folder: Path):
    """The output folder, made when it is not there, for this run alone."""
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / ".lock", "a+b") as file:
        if not try_lock(file):
            raise SgmdsError(
                f"{folder}: another run is writing there: wait for it, or choose another --output"
            )
        yield
