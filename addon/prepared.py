# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepared shapes, found again by their content: a second match of a mesh starts half done."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import core

# A prepared shape takes some 2 kB a vertex, so these take a few hundred MB. The newest two always stay.
MOST_VERTICES = 120_000
FEWEST_SHAPES = 2

_kept: OrderedDict[str, Any] = OrderedDict()
_lock = threading.Lock()


@dataclass(frozen=True)
class Storage:
    """Where shapes outlive Blender: a folder, and the bytes that they may take there."""

    folder: str
    limit: int


def shape(
    vertices: NDArray[np.floating[Any]],
    triangles: NDArray[np.integer[Any]],
    storage: Storage | None,
    *,
    progress: Callable[[str, float], bool],
    threads: int | None,
) -> Any:
    """The prepared shape of these arrays: from memory, else from the folder if there is one, else made."""
    core.load()
    from sgmds import Shape, cache

    key = cache.mesh_key(vertices, triangles)
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
    make = Shape if storage is None else cache.ShapeCache(storage.folder, storage.limit).shape
    made = make(vertices, triangles, progress=progress, threads=threads)
    with _lock:
        _kept[key] = made
        while len(_kept) > FEWEST_SHAPES and sum(len(s.vertices) for s in _kept.values()) > MOST_VERTICES:
            _kept.popitem(last=False)
    return made


def forget() -> None:
    with _lock:
        _kept.clear()


def clear(storage: Storage) -> int:
    """Remove what the folder keeps, and return how many bytes that took."""
    core.load()
    from sgmds import cache

    freed: int = cache.ShapeCache(storage.folder, storage.limit).clear()
    return freed
