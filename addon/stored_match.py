# SPDX-License-Identifier: GPL-3.0-or-later
"""The match that a target mesh carries: is it still true, and which other maps were found in this session."""

from __future__ import annotations

import uuid
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
from bpy.app.handlers import persistent

from . import figure, mesh_read
from .character import holds, is_there, pieces_of
from .mesh_read import Fingerprint, Surface, UnusableObjectError
from .mesh_write import PIECE
from .typed import Pointed, StoredMatch

if TYPE_CHECKING:
    from sgmds import Correspondence

    from .character import Character

MATCHED = "MATCHED"
MOVED = "MOVED"
STALE = "STALE"
LOST = "LOST"
ELSEWHERE = "ELSEWHERE"
NONE = "NONE"
# The attributes that a stored map cannot do without.
MAP = ("match_face", "match_barycentric", "match_confidence")


@dataclass(frozen=True)
class State:
    """`code` is one of the names above; `words` say what happened and what to do, empty when all is well."""

    code: str
    words: str = ""

    @property
    def usable(self) -> bool:
        return self.code in (MATCHED, MOVED)


@dataclass(frozen=True)
class SessionMaps:
    """A match with both surfaces as they were; `best` completes the alternatives on demand."""

    source: Surface
    target: Surface
    best: Correspondence


# They hold both prepared shapes, 2 kB a vertex each, so only the newest are kept. The last one always is.
MOST_KEPT_VERTICES = 200_000

# By the identifier that the target mesh has of its match, oldest first: undo leads back to an older match.
_maps: OrderedDict[str, SessionMaps] = OrderedDict()
# Fingerprints by mesh session id, dropped when the dependency graph says that the mesh changed.
_fingerprints: dict[int, Fingerprint] = {}


def keep_maps(meshes: Iterable[bpy.types.Mesh], maps: SessionMaps) -> None:
    """Remember all maps found for the target's meshes until another file is opened."""
    identifier = uuid.uuid4().hex
    for mesh in meshes:
        mesh.spectral_match.identifier = identifier
    _maps[identifier] = maps
    while len(_maps) > 1 and sum(len(kept.target.local) for kept in _maps.values()) > MOST_KEPT_VERTICES:
        _maps.popitem(last=False)


def maps_of(mesh: bpy.types.Mesh) -> SessionMaps | None:
    """All maps found with the match that this target mesh has, or None. A copy of it has only the match."""
    maps = _maps.get(mesh.spectral_match.identifier)
    known = maps is not None and any(
        part.surface.mesh_uid == mesh.session_uid for part in figure.parts(maps.target)
    )
    return maps if known else None


def forget_fingerprint(mesh: bpy.types.Mesh) -> None:
    _fingerprints.pop(mesh.session_uid, None)


def current_fingerprint(mesh: bpy.types.Mesh) -> Fingerprint:
    known = _fingerprints.get(mesh.session_uid)
    if known is None:
        known = _fingerprints[mesh.session_uid] = mesh_read.fingerprint(mesh)
    return known


def matched_together(targets: Sequence[bpy.types.Object]) -> list[list[bpy.types.Object]]:
    """These meshes by the characters in which they were matched."""
    found: dict[str | bpy.types.Object, list[bpy.types.Object]] = {}
    for target in targets:
        found.setdefault(target.data.spectral_match.figure or target, []).append(target)
    return list(found.values())


def sources_of(target: bpy.types.Object) -> list[tuple[Pointed, str, str]]:
    """The meshes that a target was matched with, the lead first: object or None, its name and fingerprint."""
    pieces = [(piece.object, piece.name, piece.fingerprint) for piece in target.spectral_match_pieces]
    stored = target.data.spectral_match
    return pieces or [(target.spectral_match_source, stored.source_name, stored.source_fingerprint)]


def is_source(obj: bpy.types.Object) -> bool:
    """Whether any object has a match with this one."""
    return any(
        obj == source
        for target in bpy.data.objects
        if target.type == "MESH" and target.data.spectral_match.target_fingerprint
        for source, _, _ in sources_of(target)
    )


def matched_elsewhere(target: bpy.types.Object, source: Character | bpy.types.Object | None) -> str:
    """What to do where `target` was matched with another source than the one chosen, else "".

    The source is a character, or an object by itself.
    """
    own = target.spectral_match_source
    if source is None or holds(source, own) or not is_there(own):
        return ""
    return f"'{target.name}' was matched with '{own.name}': match again or choose that one as source"


def state(target: bpy.types.Object, source: Character | bpy.types.Object | None = None) -> State:
    """Whether the match stored on `target` still belongs to the two meshes as they are.

    Where a source was chosen, it has to be the one that the target was matched with.
    """
    return state_of([target], source)


def state_of(
    targets: Sequence[bpy.types.Object], source: Character | bpy.types.Object | None = None
) -> State:
    """The `state` of meshes that were matched together, which is that of the one worst off."""
    target = targets[0]
    if not all(each.data.spectral_match.target_fingerprint for each in targets):
        return State(NONE)
    elsewhere = matched_elsewhere(target, source)
    sources = sources_of(target)
    for obj, name, _ in sources:
        if not is_there(obj) or obj.type != "MESH":
            return State(LOST, f"The source '{name}' is gone. Match again with another one")
    if elsewhere:
        return State(ELSEWHERE, elsewhere)
    wanted = MAP if len(sources) == 1 else (*MAP, PIECE)
    for each in targets:
        if not all(name in each.data.attributes for name in wanted):
            return State(STALE, f"The match of '{each.name}' was removed from its attributes. Match again")
    read = [(obj, kept) for obj, _, kept in sources]
    read += [(each, each.data.spectral_match.target_fingerprint) for each in targets]
    verdicts = [(obj.name, Fingerprint.parse(kept), current_fingerprint(obj.data)) for obj, kept in read]
    for name, kept, now in verdicts:
        if kept.topology != now.topology:
            return State(STALE, f"'{name}' got other vertices or faces since the match. Match again")
    for name, kept, now in verdicts:
        if kept.shape != now.shape:
            return State(
                MOVED,
                f"Vertices of '{name}' moved since the match. It is still used; match again to refresh it",
            )
    return State(MATCHED)


def require(target: bpy.types.Object, source: Character | bpy.types.Object | None = None) -> StoredMatch:
    """The stored match of `target`; raises `UnusableObjectError` when there is none that can be used."""
    now = state(target, source)
    shared = [piece for piece in pieces_of(source) if piece.data == target.data]
    if now.code == NONE and shared:
        raise UnusableObjectError(
            f"'{target.name}' shares the mesh of '{shared[0].name}', so it has the same data already"
        )
    if now.code == NONE:
        raise UnusableObjectError(f"'{target.name}' has no match yet. Press Match first")
    if not now.usable:
        raise UnusableObjectError(now.words)
    return target.data.spectral_match


@persistent
def _forget_changed(_scene: object, depsgraph: bpy.types.Depsgraph) -> None:
    for update in depsgraph.updates:
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Mesh):
            _fingerprints.pop(update.id.original.session_uid, None)
        elif (
            update.is_updated_geometry
            and isinstance(update.id, bpy.types.Object)
            and update.id.type == "MESH"
        ):
            _fingerprints.pop(update.id.original.data.session_uid, None)


@persistent
def _forget_undone(_scene: object, _unused: object = None) -> None:
    _fingerprints.clear()


def forget() -> None:
    _maps.clear()
    _fingerprints.clear()


@persistent
def _forget_file(_path: object, _unused: object = None) -> None:
    forget()


HANDLERS = (
    ("depsgraph_update_post", _forget_changed),
    ("undo_post", _forget_undone),
    ("redo_post", _forget_undone),
    ("load_pre", _forget_file),
)
