"""The manifest: a TOML file that says which shapes are matched, how, and where the results go."""

from __future__ import annotations

import glob
import hashlib
import itertools
import os
import re
import string
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from ..errors import ArgumentError
from ..files import mesh_format, mesh_name
from ..matching import METHODS, check_method

MAP_NAME = "maps/{source}--{target}.npz"
MOST_BYTES = 10**7
"""Of a manifest: some 100,000 listed pairs. In memory it takes a hundred times as much at most."""
MOST_PARTS = 20
"""Of a dotted key, of which none here has more than two; reading one takes time with the square of them."""
_WORD = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"{_WORD}(?:[ \t]*+\.[ \t]*+{_WORD}){{{MOST_PARTS}}}")
TILE = 8
"""Pairs are done in squares of this many sources and targets, so that few shapes are needed at a time."""


@dataclass(frozen=True)
class ShapeFile:
    """A mesh file; `name` is unique within the batch, `digest` that of the file's bytes."""

    name: str
    path: Path
    digest: str


@dataclass(frozen=True)
class Pair:
    """Numbers of the two shapes, where their map goes (None: nowhere) and pairs of vertices given."""

    source: int
    target: int
    map: Path | None
    landmarks: tuple = ()


@dataclass
class Batch:
    """What a manifest asks for, checked: every file is there and every output stays in `folder`.

    `options` are keyword arguments of `sgmds.match`. Pairs are numbered: those of all against all, then
    others listed. Only listed ones are stored one by one: `own` those of all against all, by their numbers.
    """

    folder: Path
    shapes: list[ShapeFile]
    options: dict
    map_name: str | None
    everyone: int
    """The first so many shapes are matched all against all."""
    listed: list[Pair] = field(default_factory=list)
    own: dict[int, Pair] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.everyone * (self.everyone - 1) + len(self.listed)

    def pair(self, number: int) -> Pair:
        square = len(self) - len(self.listed)
        if number >= square:
            return self.listed[number - square]
        if number in self.own:
            return self.own[number]
        source, rest = divmod(number, self.everyone - 1)
        target = rest + (rest >= source)
        return Pair(source, target, self._map(self.map_name, source, target))

    def number(self, source: int, target: int) -> int | None:
        """Number of the pair of two shapes, or None when the manifest does not ask for it."""
        if source < self.everyone and target < self.everyone and source != target:
            return self._square_number(source, target)
        return self._listed_numbers.get((source, target))

    def _square_number(self, source: int, target: int) -> int:
        return source * (self.everyone - 1) + target - (target > source)

    def order(self) -> Iterator[int]:
        """Numbers of all pairs in the order of work."""
        tiles = range(0, self.everyone, TILE)
        for first_source, first_target in itertools.product(tiles, tiles):
            for source in range(first_source, min(first_source + TILE, self.everyone)):
                for target in range(first_target, min(first_target + TILE, self.everyone)):
                    if source != target:
                        yield self._square_number(source, target)
        yield from range(len(self) - len(self.listed), len(self))

    @cached_property
    def _listed_numbers(self) -> dict[tuple[int, int], int]:
        square = len(self) - len(self.listed)
        return {(pair.source, pair.target): square + i for i, pair in enumerate(self.listed)}

    def _map(self, name, source, target) -> Path | None:
        if name is None:
            return None
        return self.folder / name.format(source=self.shapes[source].name, target=self.shapes[target].name)


def read_toml(path) -> dict:
    """A TOML file, or `ArgumentError` saying what is wrong with it; the caller names the file."""
    path = Path(path)
    if path.is_dir():
        raise ArgumentError("is a folder; name one manifest, a TOML file")
    if not path.exists():
        raise ArgumentError("no such file")
    if not path.is_file():
        raise ArgumentError("is no regular file but a device or a pipe; name one manifest, a TOML file")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise ArgumentError(f"has {size:,} bytes, at most {MOST_BYTES:,} are read: name meshes by patterns")
    try:
        text = path.read_text(encoding="utf-8")
        if not (long := _LONG_KEY.search(text)):
            return tomllib.loads(text)
    except ValueError as error:
        # Not only its own errors: numbers may have more digits than Python reads.
        raise ArgumentError(f"not a TOML file: {error}") from error
    except RecursionError:
        raise ArgumentError("not a manifest: it is nested too deeply") from None
    line = text.count("\n", 0, long.start()) + 1
    raise ArgumentError(f"not a manifest: line {line} has a key of more than {MOST_PARTS} parts")


def within(folder: Path, name: str | Path, anywhere: bool) -> Path:
    """`name` in `folder` (absolute); a name that leads out of it is refused unless `anywhere`."""
    if "\0" in str(name):
        raise ArgumentError(f"{str(name)!r} is no name of a file: it has a letter of code 0")
    path = folder / name
    if not anywhere and not path.resolve().is_relative_to(folder.resolve()):
        raise ArgumentError(f"'{name}' leads out of {folder}: choose a place in it, or give --anywhere")
    return path


def check_keys(table, allowed: dict, where: str):
    """Every key of a table is known and its value of the right type, or `ArgumentError` says which is not."""
    if not isinstance(table, dict):
        raise ArgumentError(f"{where}: should be a table")
    for key, value in table.items():
        if key not in allowed:
            raise ArgumentError(f"{where}: unknown key {key!r}; there are: {', '.join(allowed)}")
        if not isinstance(value, allowed[key]):
            raise ArgumentError(f"{where}: {key!r} cannot be {value!r}")


def check_options(table, allowed: dict[str, tuple]):
    """Every option is known and has one of its values, or `ArgumentError` says which has not."""
    check_keys(table, {name: type(values[0]) for name, values in allowed.items()}, "options")
    for key, value in table.items():
        if value not in allowed[key]:
            raise ArgumentError(f"options: {key!r} should be one of {allowed[key]}, got {value!r}")


TOP = {
    "output": str,
    "maps": (bool, str),
    "all_against_all": (str, list),
    "pairs": list,
    "options": dict,
}
PAIR = {"source": (str, list), "target": (str, list), "map": str, "landmarks": list}
OPTIONS = {
    "method": METHODS,
    "part": ("source", "target"),
    "mirror": ("forbid", "allow"),
    "same_axes": (False, True),
}


def read(path, output=None, anywhere=False) -> Batch:
    """The batch that a manifest describes.

    Files are named relative to the manifest, the output folder too; `output` overrides the latter. Nothing a
    manifest says is written outside of its own folder, and no map outside of the output folder, unless
    `anywhere`.

    Raises
    ------
    ArgumentError
        Naming the manifest, what in it is wrong and what to do.
    """
    path = Path(path)
    home = path.absolute().parent
    try:
        table = read_toml(path)
        check_keys(table, TOP, "the manifest")
        options = table.get("options", {})
        check_options(options, OPTIONS)
        check_method(options.get("method", "auto"), options)
        folder = Path(output).absolute() if output else within(home, table.get("output", path.stem), anywhere)
        maps = table.get("maps", True)
        map_name = {True: MAP_NAME, False: None}.get(maps, maps)
        if map_name is not None:
            check_map_name(map_name, "maps", placeholders=True)

        everyone = _files(home, table.get("all_against_all", []), "all_against_all")
        wanted = []
        for number, entry in enumerate(table.get("pairs", []), start=1):
            wanted.append(_listed(home, entry, f"pairs, entry {number}"))
            check_method(options.get("method", "auto"), {"landmarks": wanted[-1][-1]})
        files = list(dict.fromkeys(everyone))
        many = len(files)
        if many == 1:
            raise ArgumentError(f"all_against_all: there is only {files[0]}; at least two are needed")
        files = list(dict.fromkeys(itertools.chain(files, *(s + t for s, t, *_ in wanted))))
        if not files:
            raise ArgumentError("nothing to do: give all_against_all or [[pairs]]")
        names = _names(files)
        shapes = [ShapeFile(names[f], f, _digest(f)) for f in files]
        batch = Batch(folder, shapes, options, map_name, many)
        index = {f: i for i, f in enumerate(files)}
        listed: dict[tuple[int, int], Pair] = {}
        for sources, targets, own_map, landmarks in wanted:
            for source, target in itertools.product(sources, targets):
                ends = (index[source], index[target])
                if source == target:
                    continue
                pair = Pair(*ends, batch._map(own_map or map_name, *ends), landmarks)
                if listed.setdefault(ends, pair) != pair:
                    raise ArgumentError(
                        f"pairs: {names[source]} to {names[target]} is listed twice, with other landmarks or "
                        "another map: leave one out"
                    )
        for ends, pair in listed.items():
            if max(ends) < many:
                batch.own[batch._square_number(*ends)] = pair
            else:
                batch.listed.append(pair)
        if not len(batch):
            raise ArgumentError("nothing to do: every pair is a shape with itself")
        _check_places(batch, anywhere)
    except ArgumentError as error:
        raise ArgumentError(f"{path}: {error}; see docs/batch.md") from error
    return batch


def check_map_name(name, where, placeholders):
    wrong = ArgumentError(f"{where}: {name!r} may use {{source}} and {{target}} only")
    try:
        fields = {part[1:] for part in string.Formatter().parse(name) if part[1] is not None}
    except ValueError as error:
        raise wrong from error
    if not fields <= {("source", "", None), ("target", "", None)}:
        raise wrong
    if not name.endswith(".npz"):
        raise ArgumentError(f"{where}: {name!r} should end with .npz")
    if placeholders and not ("{source}" in name and "{target}" in name):
        raise ArgumentError(f"{where}: {name!r} should use {{source}} and {{target}}, one map each")


def _listed(home, entry, where):
    check_keys(entry, PAIR, where)
    for key in ("source", "target"):
        if key not in entry:
            raise ArgumentError(f"{where}: lacks {key!r}")
    sources, targets = (_files(home, entry[key], f"{where}, {key}") for key in ("source", "target"))
    single = len(sources) == len(targets) == 1
    own_map, landmarks = entry.get("map"), entry.get("landmarks", [])
    if own_map is not None:
        check_map_name(own_map, where, placeholders=not single)
    if landmarks and not single:
        raise ArgumentError(f"{where}: landmarks belong to one source and one target, not to patterns")
    for landmark in landmarks:
        if not (isinstance(landmark, list) and len(landmark) == 2 and all(type(v) is int for v in landmark)):
            raise ArgumentError(f"{where}: landmarks are [source_vertex, target_vertex], got {landmark!r}")
    return sources, targets, own_map, tuple(map(tuple, landmarks))


def _files(home, patterns, where) -> list[Path]:
    """Mesh files of names and patterns, sorted within each pattern."""
    files = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        if not isinstance(pattern, str):
            raise ArgumentError(f"{where}: file names are strings, got {pattern!r}")
        try:
            if (home / pattern).is_file():
                files.append(home / pattern)
                continue
            # Other files may lie beside the meshes that a pattern means.
            found = [path for path in matching(home, pattern) if mesh_format(path)]
        except OSError as error:
            raise ArgumentError(f"{where}: {error.strerror}: {pattern!r}") from error
        if not found:
            raise ArgumentError(f"{where}: no mesh file is named {pattern!r}")
        files += sorted(found)
    return files


def matching(folder: Path, pattern: str) -> set[Path]:
    """Files and folders of a pattern. `**` goes into folders, not into links, which may lead in circles."""
    stars = re.search(r"(?<![^/])\*\*(?:/\*\*)*(?:/|$)", pattern)
    if stars is None:
        return {folder / name for name in glob.glob(pattern, root_dir=folder)}
    head, rest = pattern[: stars.start()], pattern[stars.end() :] or "*"
    found = set()
    for base in glob.glob(head, root_dir=folder) if head else [""]:
        for place, below, _ in os.walk(folder / base):
            below[:] = [name for name in below if not name.startswith(".")]
            found |= matching(Path(place), rest)
    return found


def _names(files: list[Path]) -> dict[Path, str]:
    """A short name for every file: its own, or with its folders where two are called the same."""
    short = {f: mesh_name(f) for f in files}
    for file, name in short.items():
        if not name.strip("."):
            raise ArgumentError(f"{file}: has no name before its ending: rename it")
        try:
            str(file).encode()
        except UnicodeEncodeError as error:
            # Journal and tables could not say it.
            raise ArgumentError(f"{file}: has a name that is no UTF-8: rename it") from error
    if len(set(short.values())) == len(files):
        return short
    parts = [f.parent.parts for f in files]
    shared = len(list(itertools.takewhile(lambda level: len(set(level)) == 1, zip(*parts, strict=False))))
    long = {f: "+".join((*f.parent.parts[shared:], mesh_name(f))) for f in files}
    twice = [name for name, count in Counter(long.values()).items() if count > 1]
    if twice:
        raise ArgumentError(f"several files are called {twice[0]!r}: rename all but one")
    return long


def _digest(path: Path) -> str:
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise ArgumentError(f"{path}: {error.strerror}") from error


def _check_places(batch: Batch, anywhere: bool):
    """No map leaves the folder, or takes the place of an input or of another map.

    Of all against all one map tells whether they leave it: only their pattern could do that, not the names of
    shapes.
    """
    inputs = {shape.path.resolve() for shape in batch.shapes}
    one_by_one = [*batch.listed, *batch.own.values()]
    probes = list(one_by_one)
    if batch.everyone:
        probes.append(Pair(0, 1, batch._map(batch.map_name, 0, 1)))
    for place in {pair.map for pair in probes if pair.map is not None}:
        within(batch.folder, place, anywhere)
        if place.resolve() in inputs:
            raise ArgumentError(f"{place} is an input: choose another name for the map")
    twice = [place for place, count in Counter(p.map for p in one_by_one if p.map).items() if count > 1]
    named = {p.map for p in one_by_one if p.map != batch._map(batch.map_name, p.source, p.target)}
    if named:
        square = range(len(batch) - len(batch.listed))
        others = (batch.pair(n).map for n in square if n not in batch.own)
        twice += [place for place in others if place and place in named]
    if batch.map_name is not None and not twice:
        twice = list(itertools.islice(_shared_places(batch, batch.map_name), 1))
    if twice:
        raise ArgumentError(f"two maps would be written to {twice[0]}: choose another name for one")


def _shared_places(batch: Batch, pattern: str) -> Iterator[Path]:
    """Maps that two pairs have in common by the names of their shapes, as a--b to c and a to b--c.

    Of the two names that come first in the pattern, one begins with the other then, and what it has more,
    with the text between names behind it, begins like that text. So few shapes are looked at, not all pairs.
    """
    texts, fields = [""], []
    for text, name, *_ in string.Formatter().parse(pattern):
        texts[-1] += text
        if name is not None:
            fields.append(name)
            texts.append("")
    between = texts[1]

    def places(first):
        for second in range(len(names)):
            ends = (first, second) if fields[0] == "source" else (second, first)
            number = batch.number(*ends)
            if number is not None and (place := batch.pair(number).map):
                yield place

    names = [shape.name for shape in batch.shapes]
    ordered = sorted(range(len(names)), key=names.__getitem__)
    for k, short in enumerate(ordered):
        for long in itertools.islice(ordered, k + 1, None):
            if not names[long].startswith(names[short]):
                break
            if (names[long][len(names[short]) :] + between).startswith(between):
                yield from set(places(short)) & set(places(long))
