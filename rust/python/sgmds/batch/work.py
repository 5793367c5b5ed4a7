"""One pair of a batch, in whatever process: mesh files in, map and record out."""

from __future__ import annotations

import os
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..cache import LIMIT_BYTES, ShapeCache
from ..errors import MeshError, SgmdsError
from ..files import read_mesh
from ..matching import match
from ..shape import Shape

MEMORY_VERTICES = 100_000
"""Vertices of the prepared shapes that a process keeps in memory, at some 3 kB each; two shapes at least."""
FIGURES = {
    "energy": "sgmds_energy",
    "local_distortion": "local_distortion",
    "orientation": "orientation",
    "unmatched": "unmatched",
}
"""Figures of a record, and their names in `Quality.figures`; not every method has all of them."""


@dataclass(frozen=True)
class Settings:
    """What every worker of a run has in common."""

    options: dict
    threads: int | None = None
    cache: Path | None = None
    cache_limit: int = LIMIT_BYTES


@dataclass(frozen=True)
class Task:
    """One pair to match. `number` is the pair's in the batch."""

    number: int
    source: Path
    target: Path
    map: Path | None
    landmarks: tuple = ()


@dataclass
class Outcome:
    """`record` is the same whenever and wherever the pair is matched; the rest is of this time."""

    record: dict
    effort: dict = field(default_factory=dict)
    notes: list = field(default_factory=list)


class Worker:
    """Matches pairs, keeping the shapes last used. Threads may share it."""

    def __init__(self, settings: Settings):
        self.settings = settings
        self._shapes: OrderedDict[Path, Shape] = OrderedDict()
        self._lock = threading.Lock()

    def prepare(self, path: Path) -> None:
        """Makes sure that the cache has a shape. An unusable file is not told of here, but by its pairs."""
        try:
            self._shape(path, self._cache([]))
        except (SgmdsError, OSError):
            pass

    def match(self, task: Task) -> Outcome:
        """Matches a pair and saves its map. Never raises: what went wrong is the record's `reason`."""
        notes: list[str] = []
        cache = self._cache(notes)
        started, cpu = time.perf_counter(), time.process_time()
        try:
            record = self._record(task, cache)
        except (SgmdsError, OSError) as error:
            record = failure(str(error))
        except MemoryError:
            record = failure("not enough memory")
        except Exception as error:
            # One pair's surprise is that pair's failure, not the end of thousands of others.
            record = failure(f"unexpected {type(error).__name__}: {error}")
        effort = {
            "seconds": round(time.perf_counter() - started, 3),
            "cpu_seconds": round(time.process_time() - cpu, 3),
            "hits": cache.hits,
            "misses": cache.misses,
            "damaged": cache.damaged,
            "peak_mb": round(peak_memory() / 2**20),
        }
        return Outcome(record, effort, notes)

    def _cache(self, notes):
        return ShapeCache(self.settings.cache, self.settings.cache_limit, warn=notes.append)

    def _record(self, task, cache):
        source, target = self._shape(task.source, cache), self._shape(task.target, cache)
        corr = match(
            source,
            target,
            landmarks=task.landmarks,
            threads=self.settings.threads,
            **self.settings.options,
        )
        if task.map is not None:
            task.map.parent.mkdir(parents=True, exist_ok=True)
            corr.save(task.map)
        quality = corr.quality
        known = quality.figures
        figures = {name: known[theirs] for name, theirs in FIGURES.items() if theirs in known}
        return {
            "status": "done",
            "grade": quality.grade,
            **figures,
            "confidence": float(np.mean(corr.confidence)),
            "reason": "; ".join(quality.reasons),
        }

    def _shape(self, path, cache):
        with self._lock:
            if path in self._shapes:
                self._shapes.move_to_end(path)
                return self._shapes[path]
        mesh = read_mesh(path)
        try:
            shape = cache.shape(*mesh, threads=self.settings.threads)
        except MeshError as error:
            raise MeshError(f"{path}: {error}") from error
        with self._lock:
            self._shapes[path] = shape
            held = sum(len(s.vertices) for s in self._shapes.values())
            while len(self._shapes) > 2 and held > MEMORY_VERTICES:
                held -= len(self._shapes.popitem(last=False)[1].vertices)
        return shape


def failure(reason: str) -> dict:
    return {"status": "failed", "reason": " ".join(reason.split())}


def peak_memory() -> int:
    """Bytes that this process took at most, 0 where the system does not say."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if os.uname().sysname == "Darwin" else 1024 * peak
