# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of what belongs to the source, which belong to this file whatever library their originals are of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import bpy

from ..character import MADE_FOR, MADE_FROM, is_there

Copied = TypeVar("Copied", bound=bpy.types.ID)

# On objects and materials that are made: what from. It may be renamed, or gone and come back under its name.
ORIGINAL = "spectral_match_original"
# What a joined object stands for, by its session id: the objects that it was joined from, and their name.
_joined: dict[int, tuple[bpy.types.Object, ...]] = {}
_names: dict[int, str] = {}


@contextmanager
def stand_in(obj: bpy.types.Object, pieces: Sequence[bpy.types.Object], name: str) -> Iterator[None]:
    """Let an object stand for those that it was joined from, which have this name together."""
    uid = obj.session_uid
    _joined[uid], _names[uid] = (obj, *pieces), name
    try:
        yield
    finally:
        del _joined[uid], _names[uid]


def stands_in(obj: bpy.types.Object) -> bool:
    """Whether an object was made to stand for others, and is gone soon."""
    return obj.session_uid in _joined


def name_of(obj: bpy.types.Object) -> str:
    """The name of an object, or of the character that it stands for."""
    return _names.get(obj.session_uid, obj.name)


def meant_by(obj: bpy.types.Object) -> tuple[bpy.types.Object, ...]:
    """An object and those that it stands for."""
    return _joined.get(obj.session_uid, (obj,))


def copied(original: Copied) -> Copied:
    """A copy of an ID that can be edited: that of a library override would be an override too."""
    copy = original.copy()
    return copy.make_local(clear_liboverride=True) if copy.override_library is not None else copy


def object_copy(original: bpy.types.Object, target: bpy.types.Object) -> bpy.types.Object:
    """A copy of an object for the target, beside which it is put."""
    own = copied(original)
    own.name = f"{original.name} {target.name}"
    own[MADE_FROM], own[ORIGINAL], own[MADE_FOR] = original.name, original, target
    # Linked and overridden collections take no objects.
    places = [place for place in target.users_collection if place.is_editable and not place.override_library]
    for place in places or [target.users_scene[0].collection]:
        place.objects.link(own)
    _enter_local_views(own, target)
    return own


def _enter_local_views(own: bpy.types.Object, target: bpy.types.Object) -> None:
    """Show a new object in the local views that show the target: they leave out what comes later."""
    for window in bpy.context.window_manager.windows:
        if window.view_layer.objects.get(own.name) != own:
            continue
        for area in window.screen.areas:
            space = area.spaces.active
            if not isinstance(space, bpy.types.SpaceView3D) or space.local_view is None:
                continue
            if target.local_view_get(space):
                own.local_view_set(space, True)


def comes_from(own: bpy.types.Object, original: bpy.types.Object) -> bool:
    """Whether an object is a copy of `original`."""
    if MADE_FROM not in own:
        return False
    kept = own.get(ORIGINAL)
    return kept == original if is_there(kept) else own[MADE_FROM] == original.name
