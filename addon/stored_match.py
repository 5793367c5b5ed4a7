# SPDX-License-Identifier: GPL-3.0-or-later
"""The match that a target mesh carries: is it still true, and which other maps were found in this session."""

import uuid
from collections import OrderedDict
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import mesh_read, pair
from .mesh_read import Fingerprint, UnusableObjectError
from .mesh_write import MATCH_IMAGE, read_attribute

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
    def usable(self):
        return self.code in (MATCHED, MOVED)


@dataclass(frozen=True)
class SessionMaps:
    """A match with both surfaces as they were; `best` completes the alternatives on demand."""

    source: object
    target: object
    best: object


# They hold both prepared shapes, 2 kB a vertex each, so only the newest are kept. The last one always is.
MOST_KEPT_VERTICES = 200_000

# By the identifier that the target mesh has of its match, oldest first: undo leads back to an older match.
_maps: OrderedDict[str, SessionMaps] = OrderedDict()
# Fingerprints by mesh session id, dropped when the dependency graph says that the mesh changed.
_fingerprints: dict[int, Fingerprint] = {}


def keep_maps(mesh, maps):
    """Remember all maps found for this target mesh until another file is opened."""
    identifier = mesh.spectral_match.identifier = uuid.uuid4().hex
    _maps[identifier] = maps
    while len(_maps) > 1 and sum(len(kept.target.local) for kept in _maps.values()) > MOST_KEPT_VERTICES:
        _maps.popitem(last=False)


def maps_of(mesh):
    """All maps found with the match that this target mesh has, or None. A copy of it has only the match."""
    maps = _maps.get(mesh.spectral_match.identifier)
    return maps if maps is not None and maps.target.mesh_uid == mesh.session_uid else None


def images(mesh):
    """In which mirrors of a half source the image of each vertex of this target lies, 0 for none: (n,)."""
    kept = mesh.attributes.get(MATCH_IMAGE)
    return np.zeros(len(mesh.vertices), int) if kept is None else read_attribute(kept).astype(int)


def forget_fingerprint(mesh):
    _fingerprints.pop(mesh.session_uid, None)


def current_fingerprint(mesh):
    known = _fingerprints.get(mesh.session_uid)
    if known is None:
        known = _fingerprints[mesh.session_uid] = mesh_read.fingerprint(mesh)
    return known


def matched_elsewhere(target, source):
    """What to do where `target` was matched with another source than the one chosen, else ""."""
    own = target.spectral_match_source
    if source in (None, own) or not pair.is_there(own):
        return ""
    return f"'{target.name}' was matched with '{own.name}': match again or choose that one as source"


def state(target, source=None):
    """Whether the match stored on `target` still belongs to the two meshes as they are.

    Where a source was chosen, it has to be the one that the target was matched with.
    """
    stored = target.data.spectral_match
    if not stored.target_fingerprint:
        return State(NONE)
    elsewhere = matched_elsewhere(target, source)
    source = target.spectral_match_source
    if not pair.is_there(source) or source.type != "MESH":
        return State(LOST, f"The source '{stored.source_name}' is gone. Match again with another one")
    if elsewhere:
        return State(ELSEWHERE, elsewhere)
    if not all(name in target.data.attributes for name in MAP):
        return State(STALE, f"The match of '{target.name}' was removed from its attributes. Match again")
    verdicts = [
        (obj.name, Fingerprint.parse(kept), current_fingerprint(obj.data))
        for obj, kept in ((source, stored.source_fingerprint), (target, stored.target_fingerprint))
    ]
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


def require(target, source=None):
    """The stored match of `target`; raises `UnusableObjectError` when there is none that can be used."""
    now = state(target, source)
    if now.code == NONE and source is not None and target.data == source.data:
        raise UnusableObjectError(
            f"'{target.name}' shares the mesh of '{source.name}', so it has the same data already"
        )
    if now.code == NONE:
        raise UnusableObjectError(f"'{target.name}' has no match yet. Press Match first")
    if not now.usable:
        raise UnusableObjectError(now.words)
    return target.data.spectral_match


@persistent
def _forget_changed(_scene, depsgraph):
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
def _forget_undone(_scene, _unused=None):
    _fingerprints.clear()


def forget():
    _maps.clear()
    _fingerprints.clear()


@persistent
def _forget_file(_path, _unused=None):
    forget()


HANDLERS = (
    ("depsgraph_update_post", _forget_changed),
    ("undo_post", _forget_undone),
    ("redo_post", _forget_undone),
    ("load_pre", _forget_file),
)
