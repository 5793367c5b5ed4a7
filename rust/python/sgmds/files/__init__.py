"""Reading meshes from files, with vertices and faces in the order of the file.

The readers are our own, because others split vertices at UV seams, reorder faces, refuse polygons of several
sizes, and decode what is not asked for. Each holds a bounded multiple of its file in memory (`source.py`) or
refuses with the number, and can be interrupted at any time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import MeshError, NotEnoughMemory
from . import gltf, obj, off, ply, stl
from .source import Source, about

FORMATS = ("obj", "off", "ply", "stl", "glb")
GZIPPED = ("off", "obj", "ply")
_READERS = {"obj": obj.read, "off": off.read, "ply": ply.read, "stl": stl.read, "glb": gltf.read}


@dataclass(frozen=True)
class Piece:
    """A named part of a file: a node of a GLB scene that shows a mesh, an object (`o`) of an OBJ file."""

    name: str
    """As the file has it; empty where it has none."""
    faces: range
    """Its triangles."""


@dataclass(frozen=True)
class Scene:
    """Everything that a file shows, as one mesh.

    `vertices` are (n, 3) float64, `faces` (m, 3) int64 triangles. `pieces` together have all triangles, in
    order; a file without names is one piece.
    """

    vertices: np.ndarray
    faces: np.ndarray
    pieces: list[Piece]


def mesh_format(path) -> str:
    """Format of a mesh file by its name: `"obj"`, `"off"`, … or `"obj.gz"`, …; empty when it is none of
    ours."""
    suffixes = [s.lstrip(".").lower() for s in Path(path).suffixes]
    if suffixes and suffixes[-1] in FORMATS:
        return suffixes[-1]
    if len(suffixes) > 1 and suffixes[-1] == "gz" and suffixes[-2] in GZIPPED:
        return suffixes[-2] + ".gz"
    return ""


def mesh_name(path) -> str:
    """File name without the ending of its format."""
    return Path(path).name[: -len(mesh_format(path)) - 1]


def read_mesh(path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64 of a mesh file.

    Polygons are triangulated as they lie in space, also hollow ones and those with holes that a double edge
    joins to the outside. Vertices keep the order of the file, unused ones too. STL has no vertices of its
    own, only corners: equal ones are joined, in order of first appearance. A GLB scene comes whole, in world
    space: its meshes one after the other in the order of its nodes, each before what hangs on it, skinned
    ones where their joints hold them. Materials and pictures are not read.

    At no time more is held in memory than 12 times the size of the file and 200 MB.

    Raises
    ------
    MeshError
        Naming the file and the reason, as for one that is damaged, or would take more memory; what a mesh
        must satisfy to be matched is checked by `Shape`.
    NotEnoughMemory
        When not even that is free.
    """
    scene = read_scene(path)
    return scene.vertices, scene.faces


def read_scene(path) -> Scene:
    """The same mesh as `read_mesh` reads, and its named pieces."""
    if Path(path).is_dir():
        raise MeshError(f"{path}: is a folder; name one mesh file, or use `sgmds batch`")
    kind = mesh_format(path)
    if not kind:
        known = ", ".join("." + f for f in FORMATS) + ", " + ", ".join(f".{f}.gz" for f in GZIPPED)
        raise MeshError(f"{path}: unknown kind of file; use one of {known}")
    kind, _, zipped = kind.partition(".")
    try:
        # Numbers beyond all range are told of by `Shape`, with their vertex, not by numpy on standard error.
        with Source(path, bool(zipped)) as source, np.errstate(all="ignore"):
            vertices, faces, names = _READERS[kind](source)
    except MemoryError as error:
        # Without words where Python's own limit was met.
        raise NotEnoughMemory(f"{path}: {str(error) or 'memory is used up: close other programs'}") from error
    except OSError as error:
        # Those of the system have a number; gzip's are about what is in the file.
        raise MeshError(f"{path}: {error.strerror or _unreadable(kind, error)}") from error
    except Exception as error:
        # Readers fail in many ways on damaged files; each of them is the file's fault.
        raise MeshError(f"{path}: {_unreadable(kind, error)}") from error
    if len(vertices) == 0:
        raise MeshError(f"{path}: has no vertices: export the mesh again")
    if len(faces) == 0:
        raise MeshError(f"{path}: has no faces: export the surface, not its points alone")
    if faces.min() < 0 or faces.max() >= len(vertices):
        bad = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
        raise MeshError(
            f"{path}: triangle {bad} names a vertex outside 0…{len(vertices) - 1}; "
            "the file is damaged or cut short"
        )
    ends = [first for _, first in names[1:]] + [len(faces)]
    pieces = [Piece(name, range(first, end)) for (name, first), end in zip(names, ends, strict=True)]
    return Scene(vertices, faces, [piece for piece in pieces if piece.faces])


def _unreadable(kind: str, error: Exception) -> str:
    # Words of our own are ValueErrors; others are Python's, about what is not as the format has it.
    if not isinstance(error, ValueError):
        error = ValueError(f"it is damaged ({type(error).__name__}: {error})")
    return f"cannot be read as {kind.upper()}: {about(str(error))}"
