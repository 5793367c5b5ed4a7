# SPDX-License-Identifier: GPL-3.0-or-later
"""Files, objects and outputs of one run of the command line, and the work on each of them."""

from __future__ import annotations

import dataclasses
import importlib
import os
import secrets
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import bpy

from . import character, core, pair
from .mesh_read import UnusableObjectError, value_of
from .operators.carry import carry
from .operators.match import reading, store
from .operators.outfit import begin_fitting, garments_of, options_of, store_fitted, summary
from .outfit import wardrobe
from .transfer import KINDS, companions
from .transfer.copies import MADE_FROM

if TYPE_CHECKING:
    from .character import Character

# What came from another file: the character of each name, and the objects that came with it.
Brought = dict[str, tuple[character.Character, list[bpy.types.Object]]]
# A scene and a view layer of it, as a context is told of them.
Place = dict[str, Any]

# Objects that hold the meshes of a character together.
HOLDERS = ("ARMATURE", "EMPTY")
DEFAULT_OUTPUT = "{file}.blend"
# Among the kinds of data: what the source wears is fitted to the target.
OUTFIT = "outfit"
POLL_SECONDS = 0.1


class WrongRequestError(Exception):
    """What was asked for cannot be begun; the text says why and what to do."""


class CancelledError(Exception):
    """Somebody pressed Ctrl-C."""


@dataclass(frozen=True)
class Pairing:
    """A source object and names or patterns of the objects that receive its data."""

    source: str
    targets: tuple[str, ...]


@dataclass(frozen=True)
class FileJob:
    """What is done with one file. `file` None is the one opened; `source_file` has the source objects, if it
    is not the file itself, and they leave again after a transfer unless `keep_source`.
    """

    file: Path | None
    pairings: tuple[Pairing, ...]
    output: Path
    kinds: frozenset[str]
    source_file: Path | None = None
    keep_source: bool = False

    def shown_file(self) -> str:
        return str(self.file or bpy.data.filepath or "the scene")


def kinds_of(names: Iterable[str] | None) -> frozenset[str]:
    """The kinds of data by their names, for None all of them but outfits."""
    known = {kind.identifier for kind in KINDS}
    unknown = set(names or ()) - known - {OUTFIT}
    if unknown:
        listed = ", ".join(sorted({*known, OUTFIT}))
        raise WrongRequestError(
            f"There is no kind of data named {', '.join(sorted(map(str, unknown)))}. There are: {listed}"
        )
    return frozenset(known if names is None else names)


# The manifest.

TOP = {"output": str, "transfer": list, "options": dict, "jobs": list}
JOB = {
    "files": (str, list),
    "source": str,
    "targets": (str, list),
    "pairs": list,
    "source_file": str,
    "keep_source": bool,
    "transfer": list,
    "output": str,
}
PAIR = {"source": str, "targets": (str, list)}
OPTIONS = {
    "method": ("auto", "paper"),
    "part": ("source", "target"),
    "mirror": ("forbid", "allow"),
    "same_axes": (False, True),
}


def read_manifest(
    path: str | Path, folder: str | Path | None, anywhere: bool
) -> tuple[list[FileJob], dict[str, Any]]:
    """File jobs and options of a TOML manifest; `folder` overrides where the outputs go.

    Raises `WrongRequestError`.
    """
    core.load()
    toml = importlib.import_module("sgmds.batch.manifest")
    path = Path(path).absolute()
    try:
        table = toml.read_toml(path)
        toml.check_keys(table, TOP, "the manifest")
        options = table.get("options", {})
        toml.check_options(options, OPTIONS)
        home = path.parent
        if folder:
            output = Path(folder).absolute()
        else:
            output = toml.within(home, table.get("output", path.stem), anywhere)
        jobs: list[FileJob] = []
        for number, entry in enumerate(table.get("jobs", []), start=1):
            where = f"jobs, entry {number}"
            toml.check_keys(entry, JOB, where)
            jobs += _file_jobs(toml, home, output, anywhere, table, entry, where)
        jobs = _with_opened_file(jobs)
    except (ValueError, OSError, WrongRequestError) as reason:
        # Errors of the core about a manifest are ValueErrors.
        words = str(reason)
        named = words if str(path) in words else f"{path}: {words}"
        raise WrongRequestError(f"{named}; see docs/batch.md") from reason
    if not jobs:
        raise WrongRequestError(f"{path}: nothing to do: give [[jobs]]; see docs/batch.md")
    _check_outputs(jobs)
    return jobs, options


def _file_jobs(
    toml: ModuleType,
    home: Path,
    folder: Path | None,
    anywhere: bool,
    table: dict[str, Any],
    entry: dict[str, Any],
    where: str,
) -> Iterator[FileJob]:
    if "pairs" in entry:
        pairings = []
        for given in entry["pairs"]:
            toml.check_keys(given, PAIR, f"{where}, pairs")
            pairings.append(_pairing(given, f"{where}, pairs"))
    else:
        pairings = [_pairing(entry, where)]
    source_file = None
    if "source_file" in entry:
        source_file = home / entry["source_file"]
        if not source_file.is_file():
            raise WrongRequestError(f"{where}: there is no file {source_file}")
    wanted = entry.get("transfer", table.get("transfer"))
    kinds = kinds_of(None if wanted is None else _strings(wanted, f"{where}, transfer"))
    name = entry.get("output", DEFAULT_OUTPUT)
    if {"{", "}"} & set(name.replace("{file}", "")):
        raise WrongRequestError(f"{where}: output '{name}' may use {{file}} only")
    if not Path(name).name:
        raise WrongRequestError(f"{where}: output '{name}' is no name of a file")
    for file in _files(toml, home, entry.get("files"), where):
        stem = file.stem if file else Path(bpy.data.filepath).stem
        output = toml.within(folder, name.replace("{file}", stem or "untitled"), anywhere)
        yield FileJob(file, tuple(pairings), output, kinds, source_file, entry.get("keep_source", False))


def _pairing(entry: dict[str, Any], where: str) -> Pairing:
    for key in ("source", "targets"):
        if not entry.get(key):
            raise WrongRequestError(f"{where}: lacks '{key}'")
    return Pairing(entry["source"], _strings(entry["targets"], f"{where}, targets"))


def _strings(value: str | list[str], where: str) -> tuple[str, ...]:
    """A string, or a list of them, as a tuple."""
    values = (value,) if isinstance(value, str) else tuple(value)
    for wrong in (entry for entry in values if not isinstance(entry, str)):
        raise WrongRequestError(f"{where}: names are strings, got {wrong!r}")
    return values


def _files(
    toml: ModuleType, home: Path, patterns: str | list[str] | None, where: str
) -> Sequence[Path | None]:
    if patterns is None:
        return [None]
    files = []
    for pattern in _strings(patterns, f"{where}, files"):
        found = [home / pattern] if (home / pattern).is_file() else []
        found = found or sorted(toml.matching(home, pattern))
        if not found:
            raise WrongRequestError(f"{where}: no file is named '{pattern}'")
        files += found
    return list(dict.fromkeys(files))


def _with_opened_file(jobs: list[FileJob]) -> list[FileJob]:
    """Of several jobs those on the opened file read it anew: what is open then is what the last one left."""
    if len(jobs) == 1 or all(job.file is not None for job in jobs):
        return jobs
    if not bpy.data.filepath:
        raise WrongRequestError(
            "A job without 'files' means the opened scene, which was never saved, and is not the only one: "
            "save the scene and name its file"
        )
    opened = Path(bpy.data.filepath)
    return [dataclasses.replace(job, file=job.file or opened) for job in jobs]


def _check_outputs(jobs: Sequence[FileJob]) -> None:
    places = [job.output.resolve() for job in jobs]
    for place in places:
        if places.count(place) > 1:
            raise WrongRequestError(f"Two files would be saved as {place}: use {{file}} in 'output'")


def check_overwriting(jobs: Sequence[FileJob], overwrite: bool, resume: bool) -> list[FileJob]:
    """Refuse to replace an input, or what is there already, unless told; returns the jobs left to do."""
    opened = Path(bpy.data.filepath) if bpy.data.filepath else None
    inputs = {file.resolve() for job in jobs for file in (job.file or opened, job.source_file) if file}
    left = []
    for job in jobs:
        if overwrite:
            left.append(job)
        elif job.output.resolve() in inputs:
            raise WrongRequestError(f"{job.output} is an input: choose another output, or give --overwrite")
        elif not job.output.exists():
            left.append(job)
        elif not resume:
            raise WrongRequestError(
                f"{job.output} is there already: give --overwrite to replace it, or --resume to keep it"
            )
    return left


# The work.


@dataclass
class Request:
    """How every file is worked on: the steps, keyword options of the match, and who is told of progress."""

    match: bool
    transfer: bool
    options: dict[str, Any] = field(default_factory=dict)
    tell: Callable[[str], object] = lambda words: None


def work_on(context: bpy.types.Context, job: FileJob, request: Request) -> dict[str, Any]:
    """Do one file; returns its entry of the report. A pair that fails does not stop the next one."""
    entry: dict[str, Any] = {
        "file": job.shown_file(),
        "output": str(job.output),
        "status": "failed",
        "pairs": [],
    }
    try:
        if job.file is not None:
            bpy.ops.wm.open_mainfile(filepath=str(job.file), load_ui=False)
            context = bpy.context
        brought: Brought = {}
        for pairing in job.pairings:
            entry["pairs"] += _pairs(context, job, request, pairing, brought)
        if any(done["status"] == "done" for done in entry["pairs"]):
            if brought and request.transfer and not job.keep_source:
                _remove(_came(brought))
            save(job.output)
            entry["status"] = "done"
        else:
            entry["reason"] = "no pair succeeded, so nothing was saved"
    except (UnusableObjectError, core.CoreMissingError, RuntimeError, OSError) as reason:
        # Blender's operators raise RuntimeError with what they report.
        entry["reason"] = " ".join(str(reason).split())
    return entry


def _pairs(
    context: bpy.types.Context, job: FileJob, request: Request, pairing: Pairing, brought: Brought
) -> list[dict[str, Any]]:
    """Do one pairing; returns its pairs' entries. An object that is not there makes a failed pair."""
    with_objects = request.transfer and bool({companions.KIND.identifier, OUTFIT} & job.kinds)
    entries, met = [], set()
    for pattern in pairing.targets:
        try:
            source = _source(context, job, pairing.source, brought, with_objects)
            hanging = companions.hanging_on(source.pieces) if with_objects else []
            targets = _targets(context, pattern, [*source.whole, *_came(brought)], hanging)
        except (UnusableObjectError, RuntimeError, OSError) as reason:
            missing = {"source": pairing.source, "target": pattern, "status": "failed", "notes": []}
            missing["reason"] = " ".join(str(reason).split())
            request.tell(f"{pairing.source} to {pattern}: {missing['reason']}")
            entries.append(missing)
            continue
        for target, place in targets:
            if target not in met:
                met.add(target)
                with context.temp_override(**place):
                    entries.append(_pair(bpy.context, job, request, source, target))
    return entries


def _places(context: bpy.types.Context) -> list[Place]:
    """All scenes and view layers of the file, those of the context first, as a context is told of them."""
    shown = [(context.scene, context.view_layer)]
    shown += [(scene, layer) for scene in bpy.data.scenes for layer in scene.view_layers]
    return [{"scene": scene, "view_layer": layer} for scene, layer in dict.fromkeys(shown)]


def _came(brought: Brought) -> list[bpy.types.Object]:
    """All objects that came from other files."""
    return [obj for _, objects in brought.values() for obj in objects]


def _source(
    context: bpy.types.Context, job: FileJob, name: str, brought: Brought, with_objects: bool
) -> Character:
    """The character, or mesh, of this name. From another file it comes with its rig and, if asked, what else
    hangs on it.
    """
    if job.source_file is None:
        for place in _places(context):
            found = _named(place, name)
            if found is not None:
                return found
        raise UnusableObjectError(
            f"There is no mesh, nor an armature or collection with meshes, named '{name}' in any scene of "
            "this file"
        )
    if name in brought:
        return brought[name][0]
    source, objects = _bring(context, job.source_file, name, with_objects)
    brought[name] = source, objects
    return source


def _bring(
    context: bpy.types.Context, file: Path, name: str, with_objects: bool
) -> tuple[Character, list[bpy.types.Object]]:
    """Append the object or collection of this name: the character, and the objects that came to the scene."""
    came, *others = _append(file, name, with_objects)
    if isinstance(came, bpy.types.Object) and came.type in HOLDERS:
        # What hangs on it is not known before all is there.
        bpy.data.objects.remove(came)
        came, *others = _append(file, name, True)
    linked = context.scene.collection
    if isinstance(came, bpy.types.Collection):
        linked.children.link(came)
        others += came.all_objects
    else:
        linked.objects.link(came)
    for other in others:
        if other.name not in context.scene.objects:
            linked.objects.link(other)
    context.view_layer.update()
    source = _character(came)
    if source is None:
        raise UnusableObjectError(f"'{name}' in {file} has no meshes")
    hanging = companions.hanging_on(source.whole) if with_objects else []
    belonging = [*source.whole, *hanging, *character.holders(source.whole)]
    for other in others:
        if other not in belonging:
            for collection in other.users_collection:
                collection.objects.unlink(other)
    context.view_layer.update()
    return source, list(dict.fromkeys([came, *belonging] if came in belonging else belonging))


def _append(file: Path, name: str, with_others: bool) -> list[Any]:
    """The object, or else the collection, of this name, and all other objects if they are wanted."""
    with bpy.data.libraries.load(str(file), link=False) as (there, here):
        if name in there.objects:
            here.objects = [name, *(other for other in there.objects if with_others and other != name)]
        elif name in there.collections:
            here.collections = [name]
            here.objects = [other for other in there.objects if with_others]
        else:
            raise UnusableObjectError(f"There is no object or collection named '{name}' in {file}")
    return [*here.collections, *here.objects]


def _character(found: bpy.types.Object | bpy.types.Collection) -> Character | None:
    """The mesh by itself, the whole character of an armature or empty, or that of a collection."""
    if isinstance(found, bpy.types.Collection):
        return character.of_owner(found)
    return character.of(found) if found.type in HOLDERS else character.alone(found)


def _named(place: Place, name: str) -> Character | None:
    """The character of the object or collection of this name in a scene, None where there is none with a
    mesh.
    """
    found = place["view_layer"].objects.get(name) or next(
        (each for each in place["scene"].collection.children_recursive if each.name == name), None
    )
    return None if found is None else _character(found)


def _remove(brought: Iterable[bpy.types.Object]) -> None:
    for obj in brought:
        data = obj.data
        bpy.data.objects.remove(obj)
        # An empty has none.
        if data is not None and not data.users:
            bpy.data.batch_remove([data])


def _targets(
    context: bpy.types.Context,
    pattern: str,
    sources: Collection[bpy.types.Object],
    hanging: Collection[bpy.types.Object],
) -> list[tuple[Character, Place]]:
    """Characters that the pattern means, each with its place: meshes, else armatures, empties, collections.

    Meshes of one rig or empty that wildcards mean are one figure, else a mesh is meant by itself. `sources`
    are left out. Wildcards mean neither what the source brings along (`hanging`) nor what was made
    for a target from that.
    """
    left_out = [*sources, *character.holders(sources)]
    candidates: dict[Any, tuple[int, Place]] = {}
    for place in _places(context):
        objects = [obj for obj in place["view_layer"].objects if obj not in left_out]
        meshes = [obj for obj in objects if obj.type == "MESH"]
        holders = [obj for obj in objects if obj.type in HOLDERS]
        for way, found in enumerate((meshes, holders, place["scene"].collection.children_recursive)):
            for each in found:
                candidates.setdefault(each, (way, place))
    for matches in (str.__eq__, fnmatchcase):
        for wanted in range(3):
            named = [
                each for each, (way, _) in candidates.items() if way == wanted and matches(each.name, pattern)
            ]
            if matches is fnmatchcase:
                named = [each for each in named if MADE_FROM not in each and each not in hanging]
            figures = matches is fnmatchcase and wanted == 0
            found = _together(named) if figures else list(filter(None, map(_character, named)))
            if found:
                bodies = {body.owner: body for body in found}.values()
                return [(body, candidates[body.pieces[0]][1]) for body in bodies]
    raise UnusableObjectError(
        f"There is no mesh, nor an armature or collection with meshes, named '{pattern}' in any scene of "
        "this file"
    )


def _together(meshes: Iterable[bpy.types.Object]) -> list[Character]:
    """The characters of these meshes: of each rig or empty with those alone, and others by themselves."""
    by_owner: dict[bpy.types.ID, list[bpy.types.Object]] = {}
    for obj in meshes:
        owner = character.owner(obj)
        held = isinstance(owner, bpy.types.Object) and owner.type in HOLDERS
        by_owner.setdefault(owner if held else obj, []).append(obj)
    found = []
    for owner, own in by_owner.items():
        body = character.of_owner(owner)
        together = body is not None and len(own) > 1
        pieces = tuple(piece for piece in body.pieces if piece in own) if together else ()
        if body is not None and len(pieces) > 1:
            left_out = tuple(piece for piece in body.whole if piece not in pieces)
            found.append(dataclasses.replace(body, pieces=pieces, left_out=left_out))
        else:
            found += map(character.alone, own)
    return found


def _pair(
    context: bpy.types.Context, job: FileJob, request: Request, source: Character, target: Character
) -> dict[str, Any]:
    entry: dict[str, Any] = {"source": source.name, "target": target.name, "status": "failed", "notes": []}
    if len(target.pieces) > 1:
        entry["meshes"] = [piece.name for piece in target.pieces]
    begun = time.monotonic()
    try:
        given = {piece.data for piece in source.pieces}
        if all(piece.data in given for piece in target.pieces):
            raise UnusableObjectError("source and target share one mesh, so they have the same data already")
        if request.match:
            entry["notes"] += _match(context, request, source, target)
        matched = [piece for piece in target.pieces if pair.has_match(piece)]
        stored = (matched or target.pieces)[0].data.spectral_match
        if stored.target_fingerprint:
            entry |= {
                "grade": stored.grade,
                "reasons": stored.reasons.split("\n"),
                "mean_confidence": stored.mean_confidence,
            }
        if request.transfer and job.kinds != {OUTFIT}:
            going = carry(
                context,
                source,
                matched or target.pieces,
                context.scene.spectral_match,
                lambda kind, _name: kind.identifier in job.kinds,
            )
            entry["notes"] += value_of(going).notes
        if request.transfer and OUTFIT in job.kinds:
            entry["outfit"], notes = _fit(context, source, target)
            entry["notes"] += notes
        if request.transfer:
            entry["transferred"] = sorted(job.kinds)
        entry["status"] = "done"
    except (UnusableObjectError, core.CoreMissingError, RuntimeError) as reason:
        entry["reason"] = " ".join(str(reason).split())
    entry["seconds"] = round(time.monotonic() - begun, 3)
    request.tell(f"{source.name} to {target.name}: {entry.get('reason') or entry.get('grade') or 'done'}")
    return entry


def _match(context: bpy.types.Context, request: Request, source: Character, target: Character) -> list[str]:
    """Match and store one target; returns warnings, raises `UnusableObjectError` with a failure's reason."""
    matching = value_of(reading(context, source, [target]))
    matching.options = dataclasses.replace(matching.options, **request.options)
    told = None
    matching.start()
    try:
        while not matching.finished:
            matching.wait(POLL_SECONDS)
            now = (matching.stage, int(10 * matching.fraction))
            if now != told and not matching.finished:
                told = now
                request.tell(f"{source.name} to {target.name}: {matching.stage} {matching.fraction:.0%}")
    except KeyboardInterrupt:
        matching.cancel()
        matching.wait()
        raise CancelledError from None
    if matching.error is not None:
        raise UnusableObjectError(core.explain(matching.error))
    _, trouble = store(context, matching)
    if trouble:
        raise UnusableObjectError("; ".join(trouble))
    return matching.notes


def _fit(context: bpy.types.Context, source: Character, target: Character) -> tuple[str, list[str]]:
    """Fit what the source wears to one matched target; returns a summary and words.

    Raises `UnusableObjectError` where nothing could be fitted.
    """
    wearer = wardrobe.wearer(source, [target])
    options = options_of(context.scene.spectral_match)
    job = value_of(begin_fitting(context, wearer, garments_of(wearer), [target], options))
    job.run()
    if job.error is not None:
        raise UnusableObjectError(core.explain(job.error))
    made, trouble = store_fitted(context, job, wearer.name)
    if not made:
        raise UnusableObjectError("; ".join(trouble))
    return summary(made), trouble


def save(output: Path) -> None:
    """Write the file beside its place and move it there when it is complete."""
    output = Path(output).absolute()
    output.parent.mkdir(parents=True, exist_ok=True)
    temporary = output.with_name(f".{output.stem}.{secrets.token_hex(4)}.blend")
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), copy=True, check_existing=False)
        os.replace(temporary, output)
    finally:
        temporary.unlink(missing_ok=True)
