# SPDX-License-Identifier: GPL-3.0-or-later
"""A match that runs beside the window: plain arrays in, correspondences out, cancelled from any thread."""

import threading
import time
from dataclasses import dataclass, field

from . import core


@dataclass(frozen=True)
class MatchOptions:
    """Keyword arguments of the core, and `swap_sides`: look for the map that exchanges left and right."""

    method: str = "auto"
    part: str | None = None
    mirror: str = "forbid"
    threads: int | None = None
    swap_sides: bool = False


@dataclass
class Matched:
    """One finished target: its surface, the maps found, best first, and the time it took."""

    target: object
    maps: list
    seconds: float


@dataclass
class MatchJob:
    """Match one source surface to several targets.

    `run` works in the calling thread, `start` in one of its own; `stage`, `fraction` and `finished` may be
    read at any time. After the end either `error` or `cancelled` is set, or `results` has one entry for each
    target. `landmarks` maps a target's `object_uid` to pairs (source vertex, target vertex).
    """

    source: object
    targets: list
    options: MatchOptions
    landmarks: dict = field(default_factory=dict)
    results: list = field(default_factory=list)
    stage: str = "Reading the shapes"
    fraction: float = 0.0
    finished: bool = False
    cancelled: bool = False
    error: Exception | None = None

    def __post_init__(self):
        self._stop = threading.Event()
        self._thread = None
        self._done = 0

    def start(self):
        self._thread = threading.Thread(target=self.run, name="spectral-match", daemon=True)
        self._thread.start()

    def cancel(self):
        """Ask for the end; it comes with the core's next report of progress."""
        self._stop.set()

    @property
    def cancelling(self):
        return self._stop.is_set() and not self.finished

    def wait(self, seconds=None):
        if self._thread is not None:
            self._thread.join(seconds)

    def run(self):
        """Do the work; never raises, because nobody is there to catch it: see `error`."""
        try:
            self._match_all(core.load())
        except Exception as reason:
            self.error = reason
        finally:
            self.finished = True

    def _match_all(self, sgmds):
        cancelled = sgmds.Cancelled
        for target in self.targets:
            if self._stop.is_set():
                self.cancelled = True
                return
            begun = time.monotonic()
            try:
                best = sgmds.match(
                    (self._source_vertices(), self.source.outward_triangles),
                    (target.vertices, target.outward_triangles),
                    landmarks=self.landmarks.get(target.object_uid, ()),
                    method=self.options.method,
                    part=self.options.part,
                    mirror=self.options.mirror,
                    threads=self.options.threads,
                    progress=self._on_progress,
                )
            except cancelled:
                self.cancelled = True
                return
            self.results.append(Matched(target, [best, *best.alternatives], time.monotonic() - begun))
            self._done += 1

    def _source_vertices(self):
        # Seen in a mirror but wound as before, the source answers only to the map that exchanges left and
        # right.
        return self.source.vertices * (-1.0, 1.0, 1.0) if self.options.swap_sides else self.source.vertices

    def _on_progress(self, stage, fraction):
        several = len(self.targets) > 1
        self.stage = f"{self._done + 1} of {len(self.targets)}: {stage}" if several else stage
        self.fraction = (self._done + min(max(fraction, 0.0), 1.0)) / len(self.targets)
        return not self._stop.is_set()


# The window runs one match at a time; panel and Cancel button look here.
current: MatchJob | None = None
