"""Prepared shapes kept on disk by what they were made of, for every process of a machine."""

import contextlib
import functools
import hashlib
import os
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from . import _core
from .errors import Cancelled, SgmdsError
from .locks import try_lock
from .shape import Shape, checked_mesh

LIMIT_BYTES = 10 * 2**30
"""Size of a cache unless told otherwise: some 800 shapes of 20,000 vertices."""
LOCK_DIGITS = 2
"""Digits of a key that name its lock file: the 256 files are shared, so that none ever has to be deleted."""
LOCK_POLL_SECONDS = 0.1
ABANDONED_SECONDS = 3600
"""A temporary file of this age was left by a process that died."""


def default_folder() -> Path:
    """`$SGMDS_CACHE`, or the place that this system has for caches."""
    if named := os.environ.get("SGMDS_CACHE"):
        return Path(named)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "sgmds"


@functools.cache
def core_hash() -> bytes:
    """Another core may prepare the same mesh differently, so its own bytes are part of every key."""
    return hashlib.sha256(Path(_core.__file__).read_bytes()).digest()


def mesh_key(vertices, faces) -> str:
    """Name of a mesh by its content, in hexadecimal; the same for the same arrays and the same core only."""
    vertices, faces = checked_mesh(vertices, faces)
    digest = hashlib.blake2b(core_hash(), digest_size=20)
    digest.update(np.array([len(vertices), len(faces)], "<u8").tobytes())
    digest.update(vertices.astype("<f8", copy=False).data)
    digest.update(faces.astype("<i8", copy=False).data)
    return digest.hexdigest()


class ShapeCache:
    """Prepared shapes in a folder: each mesh is prepared once, whoever asks and however often.

    Several processes may share the folder. A mesh that two of them ask for at the same time is prepared by
    one while the other waits. Entries are written whole or not at all; one that is damaged is noticed when
    read, told of and made again. The least recently used entries go when all together exceed
    `limit`. A folder that cannot be written to costs a warning and time, not the result.

    Parameters
    ----------
    folder : path, optional
        By default `default_folder()`.
    limit : int
        Bytes that the entries may take together.
    warn : callable, optional
        Told in words of damage and of a folder that cannot be written to; by default a `RuntimeWarning`.

    Attributes
    ----------
    hits, misses, damaged : int
        Shapes that came from disk, that were prepared, and, among these, whose entry was unusable.
    """

    def __init__(self, folder=None, limit=LIMIT_BYTES, warn=None):
        self.folder = Path(folder) if folder is not None else default_folder()
        self.limit = limit
        self.warn = warn or (lambda words: warnings.warn(words, RuntimeWarning, stacklevel=4))
        self.hits = self.misses = self.damaged = 0

    def shape(self, vertices, faces, *, progress=None, threads=None) -> Shape:
        """The prepared shape of a mesh, from disk when it is there.

        Takes the arguments of `Shape` and raises what it raises.
        """
        vertices, faces = checked_mesh(vertices, faces)
        path = self.folder / f"{mesh_key(vertices, faces)}.npz"
        with contextlib.suppress(FileNotFoundError, SgmdsError):
            return self._kept(path, vertices, faces)
        try:
            lock = self._acquire(path.name[:LOCK_DIGITS], progress)
        except OSError as error:
            self._warn_unwritable(error)
            self.misses += 1
            return Shape(vertices, faces, progress=progress, threads=threads)
        with lock:
            # Somebody else may have made or mended it while we waited.
            try:
                return self._kept(path, vertices, faces)
            except FileNotFoundError:
                pass
            except SgmdsError as error:
                self.damaged += 1
                self.warn(f"{error} (done)")
            shape = Shape(vertices, faces, progress=progress, threads=threads)
            self.misses += 1
            try:
                shape.save(path)
                self._make_room(self.limit)
            except OSError as error:
                self._warn_unwritable(error)
        return shape

    def entries(self) -> list[Path]:
        """Files of the shapes kept, least recently used first."""
        stamps = []
        for path in self.folder.glob("*.npz"):
            # Another process may be making room.
            with contextlib.suppress(FileNotFoundError):
                stamps.append((path.stat().st_mtime_ns, path))
        return [path for _, path in sorted(stamps)]

    def clear(self):
        """Removes every shape kept."""
        self._make_room(0)

    def _kept(self, path, vertices, faces):
        shape = Shape.load(path)
        if not (np.array_equal(shape.vertices, vertices) and np.array_equal(shape.faces, faces)):
            raise SgmdsError(f"{path}: holds another mesh than its name says: make it again")
        # Entries go in the order of these times; not being allowed to set one changes only that order.
        with contextlib.suppress(OSError):
            os.utime(path)
        self.hits += 1
        return shape

    def _make_room(self, limit):
        with self._acquire("room", None):
            sizes = {}
            for path in self.entries():
                with contextlib.suppress(FileNotFoundError):
                    sizes[path] = path.stat().st_size
            excess = sum(sizes.values()) - limit
            for path, size in sizes.items():
                if excess <= 0:
                    break
                # Windows does not remove a file that another process is reading: it goes next time.
                with contextlib.suppress(PermissionError):
                    path.unlink(missing_ok=True)
                    excess -= size
            for path in self.folder.glob(".*.npz.*"):
                with contextlib.suppress(FileNotFoundError, PermissionError):
                    if time.time() - path.stat().st_mtime > ABANDONED_SECONDS:
                        path.unlink()

    def _warn_unwritable(self, error):
        self.warn(f"{self.folder}: shapes cannot be kept here and are prepared each time ({error})")

    def _acquire(self, name, progress):
        """Holds a lock file until it is closed, which the system does when a process ends in whatever way."""
        folder = self.folder / "locks"
        folder.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as stack:
            file = stack.enter_context(open(folder / name, "a+b"))
            while not try_lock(file):
                if progress is not None and progress("waiting for the cache", 0.0) is False:
                    raise Cancelled("cancelled while another process prepared the shape")
                time.sleep(LOCK_POLL_SECONDS)
            stack.pop_all()
            return file
