# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is the source and who are the targets: the selection, or the two characters pinned in the panel."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import character, job
from .character import Character, is_there
from .typed import Settings

HOLDERS = ("MESH", "ARMATURE", "EMPTY")
# How long `shown` keeps what it found; handlers forget it earlier.
KEPT_SECONDS = 0.25
_kept: list[Any] = []


@dataclass(frozen=True)
class Pair:
    """`source` and `targets` are characters; in `missing` is what to do when they are not complete."""

    source: Character | None
    targets: Sequence[Character] = field(default_factory=list)
    missing: str = ""

    @property
    def source_pieces(self) -> tuple[bpy.types.Object, ...]:
        return () if self.source is None else self.source.pieces

    @property
    def target_pieces(self) -> list[bpy.types.Object]:
        return [piece for target in self.targets for piece in target.pieces]


def resolve(context: bpy.types.Context) -> Pair:
    """The characters that the next match is about."""
    settings = context.scene.spectral_match
    if settings.pinned:
        return _pinned(settings)
    active = context.view_layer.objects.active
    if active is not None and active.instance_type == "COLLECTION" and active.instance_collection:
        return Pair(
            None,
            [],
            f"'{active.name}' only shows a collection. Use Object > Apply > Make Instances Real, "
            "or select the meshes themselves",
        )
    if active is None or active.type not in HOLDERS:
        return Pair(None, [], "Select the target, then Shift-click the source: any mesh of each will do")
    others = [obj for obj in context.view_layer.objects.selected if obj != active and obj.type in HOLDERS]
    source, *targets = _characters(settings, [active, *others])
    if source is None:
        return Pair(None, [], f"'{active.name}' has no meshes. Choose a mesh, or what holds some together")
    targets = [target for target in targets if target is not None]
    if not targets:
        # A matched target alone still means the pair it was matched in, even if the source is gone.
        held = [piece for piece in source.whole if has_match(piece)]
        if held:
            return _as_matched(settings, active if active in held else held[0])
        return Pair(source, [], f"Add a target: select it first, then Shift-click '{active.name}'")
    return _of(source, targets)


def shown(context: bpy.types.Context) -> Pair:
    """What `resolve` finds, for panels and polls, of which every redraw asks many times: kept for a moment.

    Without a window it is found anew each time. While a job blocks the window, all stays what it was before,
    since there are objects of its own.
    """
    if _kept and job.current is not None and job.current.blocks:
        return _kept[2]
    scene, now = context.scene.session_uid, time.monotonic()
    if bpy.app.background or not _kept or _kept[0] != scene or now - _kept[1] > KEPT_SECONDS:
        _kept[:] = [scene, now, resolve(context)]
    return _kept[2]


@persistent
def _forget(_scene: object = None, _unused: object = None) -> None:
    if job.current is None or not job.current.blocks:
        _kept.clear()


@persistent
def _forget_file(_path: object, _unused: object = None) -> None:
    _kept.clear()


HANDLERS = (
    *((moment, _forget) for moment in ("depsgraph_update_post", "undo_post", "redo_post")),
    ("load_pre", _forget_file),
)


def matched(context: bpy.types.Context) -> list[Character]:
    """The targets that have a match, however old, with the pieces that have one."""
    return [
        replace(target, pieces=pieces, left_out=tuple(each for each in target.whole if each not in pieces))
        for target in shown(context).targets
        if (pieces := matched_of(target))
    ]


def matched_of(target: Character) -> tuple[bpy.types.Object, ...]:
    """The meshes of a character that have a match; one that is left out may have an older one, and counts
    where it was matched together with others that take part.
    """
    have = list(filter(has_match, target.whole))
    taking = [piece for piece in have if piece in target.pieces]
    figures = {piece.data.spectral_match.figure for piece in taking} - {""}
    counts = [piece for piece in have if piece in taking or piece.data.spectral_match.figure in figures]
    return tuple(counts if taking else have)


def matched_pieces(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The matched meshes of all targets."""
    return [piece for target in matched(context) for piece in target.pieces]


def has_match(obj: bpy.types.Object) -> bool:
    return bool(obj.data.spectral_match.target_fingerprint)


def _pinned(settings: Settings) -> Pair:
    objects = [settings.source, settings.target]
    if all(map(is_there, objects)):
        source, *targets = _characters(settings, objects)
        return _of(source, targets)
    source = _chosen(settings.source, settings.source_collection)
    target = _chosen(settings.target, settings.target_collection)
    return _of(source, [target] if target is not None else [])


def _chosen(obj: bpy.types.Object | None, collection: bpy.types.Collection | None) -> Character | None:
    """The character of a chosen object or, where there is none, of a collection."""
    if obj is None:
        return None if collection is None else character.of_owner(collection)
    return character.of(obj) if is_there(obj) else character.alone(obj)


def _characters(settings: Settings, objects: Sequence[bpy.types.Object]) -> Sequence[Character | None]:
    """The characters that objects belong to, or meshes by themselves where that is wished."""
    if settings.whole_characters:
        return character.groups(objects)
    return [character.alone(obj) if obj.type == "MESH" else character.of(obj) for obj in objects]


def _as_matched(settings: Settings, target: bpy.types.Object) -> Pair:
    """The pair in which a target was matched."""
    source = target.spectral_match_source
    if not is_there(source):
        return _of(None if source is None else character.alone(source), [character.of(target)])
    source, *targets = _characters(settings, [source, target])
    return _of(source, targets)


def _of(source: Character | None, targets: Sequence[Character | None]) -> Pair:
    if source is None or not is_there(source.lead):
        return Pair(
            None,
            [each for each in targets if each],
            _absent([source]) + "Choose a source: the character that has the data",
        )
    there = [each for each in targets if each and is_there(each.lead) and each.owner != source.owner]
    if not there:
        return Pair(
            source, [], _absent(targets) + "Choose a target: another character, which receives the data"
        )
    given = {piece.data for piece in source.pieces}
    if all(piece.data in given for each in there for piece in each.pieces):
        return Pair(source, there, "Source and target share one mesh, so they have the same data already")
    return Pair(source, there)


def _absent(characters: Iterable[Character | None]) -> str:
    """Words about a chosen object that no scene has."""
    for each in characters:
        if each is not None and not is_there(each.lead):
            return f"'{each.lead.name}' is in no scene: it was deleted, or only an instance shows it\n"
    return ""
