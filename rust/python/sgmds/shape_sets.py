"""Folders of shapes with known correspondences.

A set is a folder with meshes, pairs and truth. A pair "A B" asks for a vertex of B for every vertex of A, so
that B is the source and A the target of `match`. Sets are read by their layout:

    NAME.off, .obj, .ply (also .gz)      meshes
    pairs.txt                            "A B" a line
    corr/NAME.txt, NAME.sym.txt          vertex ids, line k of A belongs to line k of B, -1 = not there;
                                         .sym: the same lines with the sides swapped
    corr/IDENTITY                        patterns of names whose meshes share their vertex order
    corr_pairs/A__B.txt, A__B.sym.txt    two columns "a b"
    corr_pairs/CLASS__CLASS.txt          the same for all meshes of two classes (name less its final digits)
    samples/CLASS.txt, CLASS.sym.txt     sampled vertices of a class and their partners on the other side
    maps/METHOD/A__B.txt                 saved maps of other methods: line i the vertex of B for vertex i of A

Published sets are read as they come. There ids count from 1:

    off/NAME.off, off/CLASS/NAME.off     meshes; those of a class are named CLASS/NAME
    test_pairs.txt                       "A B" or "A,B" a line; without it all pairs, of each class
    corres/NAME.vts, NAME.sym.vts        as corr/NAME.txt; also in corres/CLASS/
    corres/A_B.map                       a line for every vertex of one of the two: the vertex of the other
    corres/cross_category_corres/C_D.vts a line for every line of the truth of class C: the line of D's
    ../null/NAME.off, ../null/off/       wholes of parts named SET_NAME_shape_K, whose corres/ files tell the
                                         vertex of the whole for each of theirs
    PART.baryc_gt, PART.baryc_gt_sym     the same as a triangle of the whole and weights of its corners, of
                                         which the heaviest is taken; _sym with the sides swapped
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np

from .files import mesh_format, mesh_name, read_mesh

TRUTH_LINES = 400
"""Truth lines asked of a pair, spread evenly; fewer than 200 move the mean by one or two units."""
PUBLISHED_PAIRS = "test_pairs.txt"
PAIRS = ("pairs.txt", PUBLISHED_PAIRS)
"""What may tell which maps are asked for."""


@dataclass(frozen=True)
class Truth:
    """Vertices of A and B that belong together, line by line; `swapped_*` with the sides exchanged, where
    known.

    `all_a` are the vertices of A with a counterpart, all of them, not only the lines asked.
    """

    a: np.ndarray
    b: np.ndarray
    swapped_a: np.ndarray | None
    swapped_b: np.ndarray | None
    all_a: np.ndarray


class ShapeSet:
    """One folder of meshes, pairs and truth."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.name = self.folder.resolve().name
        self._files = _meshes(self.folder) or _meshes(self.folder / "off")
        # Parts of shapes that stand beside them.
        null = self.folder.parent / "null"
        wholes = _meshes(null / "off") or _meshes(null) if self.name != "null" else {}
        self._whole = {name: whole for name in self._files if (whole := _whole_of(name, self.name)) in wholes}
        self._files |= {name: wholes[name] for name in set(self._whole.values())}
        path = next((p for name in PAIRS if (p := self.folder / name).exists()), None)
        self._pairs = _asked(path) if path else self._all_pairs()
        if not self._pairs:
            raise layout_error(f'{path or self.folder}: asks for no map; write a line "A B" for each')

    def _all_pairs(self) -> list[tuple[str, str]]:
        """Parts with their wholes, or what has a map, or all of a class with one another, if their truth is
        published."""
        if self._whole:
            return sorted(self._whole.items())
        halves = (path.stem.split("_") for path in sorted((self.folder / "corres").glob("*.map")))
        cuts = (("_".join(x[:k]), "_".join(x[k:])) for x in halves for k in range(1, len(x)))
        mapped = [(a, b) for a, b in cuts if a in self._files and b in self._files]
        known = sorted(name for name in self._files if self._published(name, ".vts").exists())
        return mapped or [(a, b) for a, b in permutations(known, 2) if _folder_of(a) == _folder_of(b)]

    def pairs(self) -> list[tuple[str, str]]:
        return list(self._pairs)

    def mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        if name not in self._files:
            raise layout_error(f"{self.folder}: no mesh named {name}, though a map of it is asked for")
        return read_mesh(self._files[name])

    def saved_maps(self) -> list[str]:
        folder = self.folder / "maps"
        return sorted(p.name for p in folder.iterdir() if p.is_dir()) if folder.is_dir() else []

    def saved_map(self, method: str, a: str, b: str) -> np.ndarray | None:
        path = self.folder / "maps" / method / f"{a}__{b}.txt"
        return _ids(path) if path.exists() else None

    def truth(self, a: str, b: str, vertices_a: int, lines: int | None = TRUTH_LINES) -> Truth:
        ids_a, ids_b = self._direct(a, b, vertices_a)
        check_ids(ids_a, vertices_a)
        all_a = ids_a
        swapped = self._swapped(a, b)
        if swapped is not None and len(swapped[0]) != len(ids_a):
            if (self.folder / "samples").is_dir():
                # Partners are known on samples only: ask both ways on the same samples.
                ids_a = ids_b = swapped[0]
            else:
                swapped = None
        count = len(ids_a)
        if not count:
            raise set_error(f"{self.folder}: the truth for the pair {a} {b} has no line")
        chosen = np.arange(count)
        if lines is not None and count > lines:
            chosen = np.linspace(0, count - 1, lines).astype(int)
        return Truth(
            ids_a[chosen],
            ids_b[chosen],
            None if swapped is None else swapped[0][chosen],
            None if swapped is None else swapped[1][chosen],
            all_a,
        )

    def _direct(self, a, b, vertices_a):
        found = self._columns(a, b, ".txt")
        if found is None:
            found = self._between_classes(a, b)
        if found is None:
            found = self._lists(a, b, ".txt")
        if found is None:
            found = self._images(a, b, vertices_a)
        class_a, class_b = _class(a), _class(b)
        if found is None and class_a != class_b:
            found = self._columns(class_a, class_b, ".txt")
        if found is None and self._share_order(a, b):
            found = np.arange(vertices_a), np.arange(vertices_a)
        if found is None:
            raise layout_error(f"{self.folder}: no truth for the pair {a} {b}")
        return found

    def _swapped(self, a, b):
        found = self._columns(a, b, ".sym.txt")
        if found is None:
            found = self._lists(a, b, ".sym.txt")
        if found is None:
            found = self._on_whole(a, b, ".baryc_gt_sym")
        if found is None and _class(a) == _class(b):
            samples = self.folder / "samples" / f"{_class(a)}.txt"
            if samples.exists():
                found = _ids(samples), _ids(samples.with_suffix(".sym.txt"))
        return found

    def _columns(self, a, b, ending):
        for first, second, order in ((a, b, (0, 1)), (b, a, (1, 0))):
            path = self.folder / "corr_pairs" / f"{first}__{second}{ending}"
            if path.exists():
                columns = _ids(path, 2)
                columns = columns[(columns >= 0).all(axis=1)]
                return columns[:, order[0]], columns[:, order[1]]
        return None

    def _lists(self, a, b, ending):
        (path_a, first_a), (path_b, first_b) = self._list(a, ".txt"), self._list(b, ending)
        if not (path_a.exists() and path_b.exists()) or a in self._whole or _folder_of(a) != _folder_of(b):
            return None
        ids_a, ids_b = _ids(path_a) - first_a, _ids(path_b) - first_b
        if len(ids_a) != len(ids_b):
            raise set_error(f"{path_a} has {len(ids_a)} lines, {path_b} has {len(ids_b)}: they should agree")
        both = (ids_a >= 0) & (ids_b >= 0)
        return ids_a[both], ids_b[both]

    def _list(self, name: str, ending: str) -> tuple[Path, int]:
        """File of a mesh's ids, and from what they count."""
        own = self.folder / "corr" / f"{name}{ending}"
        return (own, 0) if own.exists() else (self._published(name, ending.replace(".txt", ".vts")), 1)

    def _published(self, name: str, ending: str) -> Path:
        return self.folder / "corres" / f"{name}{ending}"

    def _between_classes(self, a, b):
        """Truth by the references of two classes: which line of one belongs to each line of the other."""
        if _folder_of(a) == _folder_of(b):
            return None
        for first, second, order in ((a, b, (0, 1)), (b, a, (1, 0))):
            classes = f"{_folder_of(first)}_{_folder_of(second)}"
            path = self._published(f"cross_category_corres/{classes}", ".vts")
            if path.exists():
                ids_1, ids_2 = (_ids(self._published(name, ".vts")) - 1 for name in (first, second))
                lines = _ids(path) - 1
                if len(lines) != len(ids_1) or lines.max(initial=-1) >= len(ids_2):
                    raise set_error(
                        f"{path}: {len(lines)} lines up to {lines.max(initial=-1) + 1} are not a line of "
                        f"{second} ({len(ids_2)}) for each of {first} ({len(ids_1)})"
                    )
                columns = ids_1[lines >= 0], ids_2[lines[lines >= 0]]
                both = (columns[0] >= 0) & (columns[1] >= 0)
                return columns[order[0]][both], columns[order[1]][both]
        return None

    def _on_whole(self, a, b, ending):
        """Truth of a part by points on its whole: the heaviest corner of each vertex's triangle."""
        part, whole = (a, b) if a in self._whole else (b, a)
        if self._whole.get(part) != whole:
            return None
        path = self._files[part].with_name(f"{part}{ending}")
        if not path.exists():
            return None
        points = _numbers(path, 4)
        faces = self.mesh(whole)[1]
        triangles = points[:, 0].astype(np.int64) - 1
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(faces):
            raise set_error(f"{path}: names a triangle that {whole} with its {len(faces)} does not have")
        images = faces[triangles, points[:, 1:].argmax(axis=1)]
        every = np.arange(len(images))
        return (every, images) if part == a else (images, every)

    def _images(self, a, b, vertices_a):
        """Truth by the images of all vertices of one of the two."""
        found = self._on_whole(a, b, ".baryc_gt")
        if found is not None:
            return found
        if self._whole.get(a) == b or self._whole.get(b) == a:
            of_a = a in self._whole
            images = _ids(self._published(a if of_a else b, ".vts")) - 1
        else:
            either = (self._published(f"{x}_{y}", ".map") for x, y in ((a, b), (b, a)))
            path = next(filter(Path.exists, either), None)
            if path is None:
                return None
            images = _ids(path) - 1
            vertices_b = len(self.mesh(b)[0])
            of_a = len(images) == vertices_a
            if of_a == (len(images) == vertices_b):
                raise set_error(
                    f"{path}: {len(images)} lines are not one for each vertex of one of {a} ({vertices_a}) "
                    f"and {b} ({vertices_b}); write two columns to corr_pairs/{a}__{b}.txt"
                )
        known = np.flatnonzero(images >= 0)
        return (known, images[known]) if of_a else (images[known], known)

    def _share_order(self, a, b) -> bool:
        path = self.folder / "corr" / "IDENTITY"
        if not path.exists():
            return False
        patterns = [line.strip() for line in _text(path).splitlines() if line.strip()]
        try:
            return any(re.fullmatch(p, a) and re.fullmatch(p, b) for p in patterns)
        except re.error as error:
            raise set_error(
                f"{path}: {error.pattern!r} is no regular expression ({error}); any name is .*"
            ) from error


def find_sets(folder, names: Iterable[str] | None = None) -> list[ShapeSet]:
    """Sets in a folder, or the folder itself when it is one."""
    folder = Path(folder)
    if not folder.is_dir():
        raise layout_error(f"{folder}: no such folder")
    names = list(names or ())
    if _is_set(folder) and set(names) <= {folder.resolve().name}:
        return [ShapeSet(folder)]
    known = {p.name: p for p in sorted(folder.iterdir()) if _is_set(p)}
    wanted = names or list(known)
    for name in wanted:
        if name not in known:
            raise layout_error(f"{folder}: no set named {name}; there are {', '.join(known) or 'none'}")
    if not wanted:
        raise layout_error(f"{folder}: neither a pairs.txt nor a folder with one")
    return [ShapeSet(known[name]) for name in wanted]


def _is_set(folder: Path) -> bool:
    return any((folder / name).exists() for name in (*PAIRS, "corres")) or any(folder.glob("*.baryc_gt"))


def _meshes(folder: Path) -> dict[str, Path]:
    """Mesh files of a folder and of the folders of classes in it, by name."""
    if not folder.is_dir():
        return {}
    found = {mesh_name(p): p for p in sorted(folder.iterdir()) if mesh_format(p)}
    if folder.name == "off":
        classes = [p for p in sorted(folder.iterdir()) if p.is_dir()]
        found |= {
            f"{c.name}/{mesh_name(p)}": p for c in classes for p in sorted(c.iterdir()) if mesh_format(p)
        }
    return found


def _whole_of(name: str, name_of_set: str) -> str | None:
    """Name of the whole of which a mesh is a part by its name."""
    found = re.fullmatch(rf"{re.escape(name_of_set)}_(.+)_shape_\d+", name)
    return found[1] if found else None


def _asked(path: Path) -> list[tuple[str, str]]:
    """Pairs of a file, "A B" a line, or "A,B" in a published one."""
    pairs = []
    for number, line in enumerate(_text(path).splitlines(), start=1):
        words = (line.replace(",", " ") if path.name == PUBLISHED_PAIRS else line).split()
        if len(words) == 1:
            raise set_error(f'{path}: line {number} should be "A B", names of two meshes, got {line!r}')
        if words:
            pairs.append((words[0], words[1]))
    return pairs


def _folder_of(name: str) -> str:
    return name.rpartition("/")[0]


def _class(name: str) -> str:
    return re.sub(r"\d+$", "", name)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise set_error(f"{path}: is not UTF-8 text: {error}") from error


def _ids(path: Path, columns: int = 1) -> np.ndarray:
    """Vertex ids of a file, (lines,) or (lines, columns)."""
    found = _numbers(path, columns, np.int64, "vertex id(s)")
    return found if columns > 1 else found.reshape(-1)


def _numbers(path: Path, columns: int, dtype: type = np.float64, what: str = "numbers") -> np.ndarray:
    """Table of a file, (lines, columns)."""
    try:
        found: np.ndarray = np.loadtxt(path, dtype=dtype, ndmin=2)
        if found.size and found.shape[1] != columns:
            raise ValueError(f"it has {found.shape[1]}")
    except (OSError, ValueError, OverflowError) as error:
        raise set_error(f"{path}: should have {columns} {what} a line: {error}") from error
    return found.reshape(-1, columns)


def check_ids(ids, count: int) -> None:
    """A mesh has all vertices that the truth or a map names: negative ids would count from its end."""
    wrong = ids[(ids < 0) | (ids >= count)]
    if len(wrong):
        raise set_error(
            f"the truth or the map names vertex {wrong[0]}, but the mesh has {count}: it is of another mesh"
        )


def set_error(message: str) -> Exception:
    from sgmds import SgmdsError

    return SgmdsError(message)


def layout_error(message: str) -> Exception:
    """Something is not where a set has it."""
    return set_error(f"{message}; see docs/evaluation.md")
