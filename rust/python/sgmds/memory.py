"""Whether a computation fits into memory, asked before it starts: a failed allocation ends the process."""

import ctypes
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import _core
from .errors import NotEnoughMemory

GIGABYTE = 1e9


def available() -> int | None:
    """Bytes that may still be allocated without swapping; `None` where the system does not tell."""
    if sys.platform == "linux":
        return _least(_linux_available(), _group_available())
    if sys.platform == "win32":
        return _windows_available()
    try:
        # What others use is not known here, so this only refuses what can never fit.
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def require_to_prepare(*meshes: Any) -> None:
    """Raises `NotEnoughMemory` when these meshes, each (vertices, faces), cannot be prepared together."""
    _require("preparing", meshes, _core.memory_to_prepare)


def require_to_match(source: Any, target: Any) -> None:
    """Raises `NotEnoughMemory` when two meshes, prepared or not, cannot be matched."""
    _require("matching", (source, target), lambda sizes: _core.memory_to_match(*(n for n, _ in sizes)))


def require_for_spectrum(mesh: Any) -> None:
    """Raises `NotEnoughMemory` when the spectrum of a mesh cannot be computed in its given resolution."""
    _require("the spectrum of", (mesh,), lambda sizes: _core.memory_for_spectrum(*sizes[0]))


def _require(doing: str, meshes: tuple[Any, ...], estimate: Callable[[list[tuple[int, int]]], int]) -> None:
    free = available()
    if free is None:
        return
    # First as if nothing were dropped; what is left of a mesh is counted only when that does not fit.
    for count in (_given_size, _checked_size):
        sizes = [count(mesh) for mesh in meshes]
        needed = estimate(sizes)
        if needed <= free:
            return
    counts = " and ".join(f"{n:,}" for n, _ in sizes)
    # Less than in proportion, since a part is needed whatever the size.
    fitting = _rounded(0.9 * sum(n for n, _ in sizes) * free / needed)
    raise NotEnoughMemory(
        f"{doing} {counts} vertices needs about {needed / GIGABYTE:.1f} GB, "
        f"{free / GIGABYTE:.1f} GB are free: reduce to about {fitting:,} vertices in all (Decimate), "
        "or close other programs"
    )


def _given_size(mesh: Any) -> tuple[int, int]:
    return mesh.checked_size if isinstance(mesh, _core.PreparedShape) else (len(mesh[0]), len(mesh[1]))


def _checked_size(mesh: Any) -> tuple[int, int]:
    return mesh.checked_size if isinstance(mesh, _core.PreparedShape) else _core.checked_size(*mesh)


def _rounded(count: float) -> int:
    digits = max(len(str(int(count))) - 2, 0)
    return int(count) // 10**digits * 10**digits


def _least(*sizes: int | None) -> int | None:
    return min((s for s in sizes if s is not None), default=None)


def _linux_available() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        pass
    return None


def _group_available() -> int | None:
    """What the control group, a container's limit, leaves; what it caches can be dropped."""
    try:
        group = Path("/proc/self/cgroup").read_text().strip().rpartition("::")[2].lstrip("/")
        folder = Path("/sys/fs/cgroup") / group
        limit, used = ((folder / name).read_text() for name in ("memory.max", "memory.current"))
        statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return max(int(limit) - int(used) + int(statistics["inactive_file"]), 0)
    except (OSError, ValueError, KeyError):
        # No such group, or no limit ("max").
        return None


def _windows_available() -> int | None:
    class Status(ctypes.Structure):
        _fields_ = [("size", ctypes.c_ulong), ("load", ctypes.c_ulong)] + [
            (name, ctypes.c_ulonglong)
            for name in ("total", "free", "page_total", "page_free", "own_total", "own_free", "extended")
        ]

    status = Status(size=ctypes.sizeof(Status))
    if sys.platform != "win32" or not ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
        return None
    return status.free
