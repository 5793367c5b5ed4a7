# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that runs beside the window: plain arrays in, correspondences out, cancelled from any thread."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any

from . import core, prepared
from .mesh_read import Surface, matched_bodies
from .translation import said

if TYPE_CHECKING:
    from sgmds import Correspondence

    from .completion import Body
    from .stored_match import SessionMaps

# The core's stages in an artist's words; one that is not here is shown by its own name.
STAGE_WORDS = {
    "reading": "Reading",
    "simplification": "Reducing the mesh",
    "operator": "Looking at the surface",
    "eigenpairs": "Learning the shape",
    "sampling": "Choosing points",
    "geodesics": "Measuring distances",
    "distance operator": "Measuring distances",
    "envelope": "Wrapping all pieces",
    "landmarks": "Following landmarks",
    "search": "Searching maps",
    "functional map": "Searching maps",
    "GMDS": "Searching maps",
    "S-GMDS": "Searching maps",
    "selection": "Comparing maps",
    "refinement": "Refining the map",
    "dense map": "Finding every vertex",
}
# Shares of the time for source, target and map, as measured between bodies of 5000 to 50,000 vertices.
PREPARING_SHARE = 0.2


@dataclass(frozen=True)
class MatchOptions:
    """Keyword arguments of the core, and what else is the same for all targets.

    `swap_sides` looks for the map that exchanges left and right; `storage` keeps prepared shapes on disk.
    """

    method: str = "auto"
    part: str | None = None
    mirror: str = "forbid"
    same_axes: bool = False
    threads: int | None = None
    swap_sides: bool = False
    storage: prepared.Storage | None = None


@dataclass(frozen=True)
class Matched:
    """One finished target: its surface, the map found, and the time it took."""

    target: Surface
    found: Correspondence
    seconds: float


@dataclass(frozen=True)
class Failed:
    """One target that could not be matched, and why."""

    target: Surface
    error: Exception


@dataclass
class Job:
    """Something long. `run` works in the calling thread, `start` in one of its own.

    `stage`, `fraction`, `seconds` and `finished` may be read at any time. While one that `blocks` is at
    it the window does nothing else; what is `lasting` cannot be stopped. `button` is the operator in place of
    whose button the panel shows how far it is. After the end, when neither `error` nor `cancelled` is set,
    the results are there; `notes` are warnings in words.
    """

    stage: str = field(default="Starting", init=False)
    button: str = field(default="", init=False)
    blocks: bool = field(default=False, init=False)
    lasting: bool = field(default=False, init=False)
    fraction: float = field(default=0.0, init=False)
    finished: bool = field(default=False, init=False)
    cancelled: bool = field(default=False, init=False)
    error: Exception | None = field(default=None, init=False)
    notes: list[str] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._begun = time.monotonic()

    def start(self) -> None:
        self._thread = threading.Thread(target=self.run, name="spectral-match", daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Ask for the end; it comes with the core's next report of progress."""
        self._stop.set()

    @property
    def cancelling(self) -> bool:
        return self._stop.is_set() and not self.finished

    @property
    def words(self) -> str:
        """What is done now and how far it is, in the language of the interface."""
        number, found, stage = self.stage.rpartition(": ")
        done = said("Stopping") if self.cancelling else f"{said(stage)}  {self.fraction:.0%}"
        return number + found + done

    @property
    def seconds(self) -> float:
        """Time since the job was made."""
        return time.monotonic() - self._begun

    def wait(self, seconds: float | None = None) -> None:
        if self._thread is not None:
            self._thread.join(seconds)

    def run(self) -> None:
        """Do the work; never raises, because nobody is there to catch it: see `error`."""
        try:
            sgmds = core.load()
            try:
                self._check_cancelled(sgmds)
                with warnings.catch_warnings(record=True) as said:
                    warnings.simplefilter("always", RuntimeWarning)
                    self._work(sgmds)
                self.notes += [str(warning.message) for warning in said]
            except sgmds.Cancelled:
                self.cancelled = True
        except Exception as reason:
            self.error = reason
        finally:
            self.finished = True

    def _work(self, sgmds: ModuleType) -> None:
        """What is done; raises `sgmds.Cancelled` where it was asked to stop."""
        raise NotImplementedError

    def _check_cancelled(self, sgmds: ModuleType) -> None:
        if self._stop.is_set():
            raise sgmds.Cancelled("cancelled")

    def _progress(self, words: str, first: float, share: float) -> Callable[[str, float], bool]:
        """A callback for the core whose own 0 to 1 becomes `first` to `first + share`."""

        def report(stage: str, fraction: float) -> bool:
            self.stage = words.format(STAGE_WORDS.get(stage, stage))
            self.fraction = first + share * min(max(fraction, 0.0), 1.0)
            return not self._stop.is_set()

        return report


@dataclass
class MatchJob(Job):
    """Match one source surface to several targets: `results` and `failures` have them all in the end.

    `landmarks` maps a target's `object_uid` to pairs (source vertex, target vertex), `left_out` that of the
    source and of each target to the session ids of the character's meshes that take no part.
    """

    source: Surface
    targets: list[Surface]
    options: MatchOptions
    landmarks: Mapping[int, Iterable[tuple[int, int]]] = field(default_factory=dict)
    left_out: Mapping[int, Sequence[int]] = field(default_factory=dict)
    results: list[Matched] = field(default_factory=list, init=False)
    failures: list[Failed] = field(default_factory=list, init=False)

    def _work(self, sgmds: ModuleType) -> None:
        for number, target in enumerate(self.targets):
            self._check_cancelled(sgmds)
            begun = time.monotonic()
            try:
                found = self._match(sgmds, number, target)
            except sgmds.Cancelled:
                raise
            except Exception as reason:
                # The other targets may still succeed; this one is reported with them.
                self.failures.append(Failed(target, reason))
            else:
                self.results.append(Matched(target, found, time.monotonic() - begun))

    def _match(self, sgmds: ModuleType, number: int, target: Surface) -> Correspondence:
        many = len(self.targets)
        label = f"{number + 1} / {many}: " if many > 1 else ""

        def part(words: str, first: float, share: float) -> Callable[[str, float], bool]:
            return self._progress(label + words, (number + first) / many, share / many)

        def shape(surface: Surface, body: Body, first: float, sides: float = 1.0) -> Any:
            vertices, triangles = surface.for_core(body)
            return prepared.shape(
                vertices * (sides, 1.0, 1.0),
                triangles,
                self.options.storage,
                progress=part("{}", first, PREPARING_SHARE),
                threads=threads,
            )

        threads = self.options.threads
        source_body, target_body = matched_bodies(self.source, target)
        # Seen in a mirror but wound as before, the source answers only to the map that exchanges left and
        # right.
        source_shape = shape(self.source, source_body, 0.0, -1.0 if self.options.swap_sides else 1.0)
        target_shape = shape(target, target_body, PREPARING_SHARE)
        found = sgmds.match(
            source_shape,
            target_shape,
            landmarks=self.landmarks.get(target.object_uid, ()),
            method=self.options.method,
            part=self.options.part,
            mirror=self.options.mirror,
            same_axes=self.options.same_axes,
            threads=threads,
            progress=part("{}", 2 * PREPARING_SHARE, 1.0 - 2 * PREPARING_SHARE),
        )
        return found


@dataclass
class AlternativeJob(Job):
    """Complete map `number` of a finished match, 0 the best: `found`. `maps` are its `SessionMaps`."""

    maps: SessionMaps
    number: int
    threads: int | None = None
    found: Any = field(default=None, init=False)

    def _work(self, _sgmds: ModuleType) -> None:
        best = self.maps.best
        self.found = best
        if self.number > 0:
            self.found = best.alternative(
                self.number - 1, progress=self._progress("{}", 0.0, 1.0), threads=self.threads
            )


# The window runs one job at a time; panel and Cancel button look here.
current: Job | None = None
