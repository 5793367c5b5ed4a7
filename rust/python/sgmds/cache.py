"""Prepared shapes kept on disk by what they were made of, for every process of a machine."""

import contextlib
import functools
import hashlib
import os
import re
import secrets
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from . import _core, archive
from .errors import Cancelled, SgmdsError
from .locks import try_lock
from .shape import FORMAT, Shape, checked_mesh
from .whole_file import REMAINS

SUBFOLDER = "sgmds-shapes"
"""Of the folder that was chosen, which may hold anything: everything kept is in there, and nothing else of it
is touched."""
ENTRY = r"[0-9a-f]{40}\.npz"
"""Name of an entry: its mesh's key."""

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

    The folder may hold other files. Entries are in a sub-folder, and only what is an entry by its name (the
    key of a mesh) and by its content is ever removed or replaced. Entries beside the sub-folder, where
    versions without one keep them, are moved into it when there is something to write or to clear.

    Parameters
    ----------
    folder : path, optional
        By default `default_folder()`; the entries are in its sub-folder `sgmds-shapes`.
    limit : int
        Bytes that the entries may take together.
    warn : callable, optional
        Told in words of damage and of a folder that cannot be written to; by default a `RuntimeWarning`.

    Attributes
    ----------
    folder : Path
        The sub-folder that holds the entries.
    hits, misses, damaged : int
        Shapes that came from disk, that were prepared, and, among these, whose entry was unusable.
    """

    def __init__(self, folder=None, limit=LIMIT_BYTES, warn=None):
        self._chosen = Path(folder) if folder is not None else default_folder()
        self.folder = self._chosen / SUBFOLDER
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
                self._set_aside(path)
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
        return self._entries_in(self.folder)

    def clear(self) -> int:
        """Removes every shape kept, and returns how many bytes they took."""
        return self._make_room(0)

    def _kept(self, path, vertices, faces):
        shape = Shape.load(path)
        if not (np.array_equal(shape.vertices, vertices) and np.array_equal(shape.faces, faces)):
            raise SgmdsError(f"{path}: holds another mesh than its name says: make it again")
        # Entries go in the order of these times; not being allowed to set one changes only that order.
        with contextlib.suppress(OSError):
            os.utime(path)
        self.hits += 1
        return shape

    def _entries_in(self, folder):
        """Files that are entries by name and content, least recently used first."""
        stamps = []
        for path in folder.glob("*.npz"):
            # Another process may be making room.
            with contextlib.suppress(FileNotFoundError):
                if re.fullmatch(ENTRY, path.name) and archive.kind_of(path) == FORMAT:
                    stamps.append((path.stat().st_mtime_ns, path))
        return [path for _, path in sorted(stamps)]

    def _set_aside(self, path):
        """Gives a file that has an entry's name, but does not begin as one, another name."""
        if archive.kind_of(path) != FORMAT:
            aside = path.with_name(f"{path.name}.{secrets.token_hex(4)}.aside")
            try:
                path.rename(aside)
            except OSError as error:
                self._warn_unwritable(error)
            else:
                self.warn(f"{path}: does not begin as a prepared shape and is kept as {aside.name}")

    def _move_in(self):
        """Entries beside the sub-folder come into it; one that is there already stays."""
        for path in self._entries_in(self._chosen):
            place = self.folder / path.name
            # It may be in use, or gone by now.
            with contextlib.suppress(FileNotFoundError, PermissionError):
                if not place.exists():
                    path.rename(place)

    def _make_room(self, limit) -> int:
        """Removes entries until the others take `limit` bytes together; returns how many were freed."""
        freed = 0
        with self._acquire("room", None):
            self._move_in()
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
                    freed += size
            for path in self.folder.glob(".*"):
                name = re.fullmatch(REMAINS, path.name)
                with contextlib.suppress(FileNotFoundError, PermissionError):
                    if name and re.fullmatch(ENTRY, name[1]) and self._is_abandoned(path):
                        path.unlink()
        return freed

    @staticmethod
    def _is_abandoned(path):
        """Whether a temporary file is of a shape, or empty, and nobody has written to it for long."""
        state = path.stat()
        old = time.time() - state.st_mtime > ABANDONED_SECONDS
        return old and (not state.st_size or archive.kind_of(path) == FORMAT)

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
