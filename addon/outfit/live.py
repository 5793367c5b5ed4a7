# SPDX-License-Identifier: GPL-3.0-or-later
"""Outfits that were fitted since the file was opened, which can be placed anew without binding."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.app.handlers import persistent

from .. import core, mesh_read, mesh_write, notice, pair
from ..transfer.shape_keys import read_key
from ..typed import Floats, Settings
from . import fitting

if TYPE_CHECKING:
    from ..character import Character
    from .reading import Garment

# Fitted outfits, each with its copies in the scene.
Kept = list[tuple[fitting.Fitted, list[bpy.types.Object]]]
# A bound outfit holds some 2 kB a vertex, and its bodies as much.
MOST_KEPT = 8
NOTHING_INSIDE = "nothing is inside the body"
# By the session ids of their copies, oldest first.
_kept: OrderedDict[tuple[int, ...], fitting.Fitted] = OrderedDict()


def keep(fitted: fitting.Fitted, copies: Sequence[bpy.types.Object]) -> None:
    """Remember a fitted outfit until another file is opened."""
    uids = tuple(obj.session_uid for obj in copies)
    for key in [key for key in _kept if set(key) & set(uids)]:
        del _kept[key]
    _kept[uids] = fitted
    while len(_kept) > MOST_KEPT:
        _kept.popitem(last=False)


def kept_for(targets: Iterable[bpy.types.Object]) -> Kept:
    """The outfits on these objects that can still be placed anew, with their copies."""
    wanted = {obj.session_uid for obj in targets}
    found = []
    for uids, fitted in _kept.items():
        if fitted.wish.bodies[0][0] in wanted:
            there = [mesh_read.find_object(bpy.data.objects, uid) for uid in uids]
            copies = [obj for obj in there if obj is not None]
            if len(copies) == len(there) and all(map(_is_whole, copies, fitted.wish.garments)):
                found.append((fitted, copies))
    return found


def _is_whole(obj: bpy.types.Object, garment: Garment) -> bool:
    there = obj.type == "MESH" and obj.mode == "OBJECT"
    return there and len(obj.data.vertices) == len(garment.points)


def copies_of(kept: Kept) -> list[bpy.types.Object]:
    """The objects of these outfits."""
    return [obj for _, copies in kept for obj in copies]


def kept_on(targets: Iterable[Character]) -> Kept:
    """The same on these characters."""
    return kept_for(piece for target in targets for piece in target.whole)


def place_again(kept: Kept, options: fitting.Options) -> tuple[int, int]:
    """Place outfits anew; returns how many vertices are inside now, and of how many."""
    inside = many = 0
    for fitted, copies in kept:
        places = fitting.place(fitted.fitting, fitted.wish, options)
        back = fitted.wish.back
        for obj, garment, worn in zip(copies, fitted.wish.garments, fitted.worn, strict=True):
            own = {name: offsets @ back for name, offsets in (worn.body_keys | worn.keys).items()}
            put(obj, places[garment.vertices] @ back, own)
        inside += fitting.count_inside(fitted.fitting, fitted.wish, places)
        many += len(places)
    return inside, many


def look_closer(kept: Kept, options: fitting.Options) -> None:
    """Give outfits a heat map, from yellow inside the body to blue as far as asked."""
    for fitted, copies in kept:
        points = np.concatenate([mesh_read.positions(obj.data) for obj in copies])
        places = points @ np.linalg.inv(fitted.wish.back)
        shares = fitting.shares_kept(fitted.fitting, fitted.wish, places, options)
        for obj, garment in zip(copies, fitted.wish.garments, strict=True):
            mesh_write.write_heat(obj.data, shares[garment.vertices])


def looked_at(kept: Kept) -> bool:
    """Whether an object of these outfits has a heat map."""
    return any(mesh_write.HEAT in obj.data.attributes for obj in copies_of(kept))


def put(own: bpy.types.Object, points: Floats, keys: Mapping[str, Floats]) -> None:
    """Write coordinates of an object's vertices, and of its shape keys as displacements from these.

    Keys that are not given keep theirs.
    """
    held = own.data.shape_keys
    if held is not None:
        basis = read_key(held.reference_key)
        for block in held.key_blocks:
            offsets = keys.get(block.name)
            if offsets is None or block == held.reference_key:
                offsets = read_key(block) - basis
            block.data.foreach_set("co", (points + offsets).astype(np.float32).ravel())
    own.data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    own.data.update()


def follow_sliders(settings: Settings, context: bpy.types.Context) -> None:
    """Place the outfits on the chosen targets as the sliders say."""
    kept = kept_on(pair.resolve(context).targets)
    options = fitting.Options(settings.outfit_distance, settings.outfit_tightness)
    try:
        inside, many = place_again(kept, options)
        if looked_at(kept):
            look_closer(kept, options)
    except core.load().SgmdsError as reason:
        notice.say(str(reason))
        return
    if many:
        settings.outfit_inside = words_inside(inside, many)


def words_inside(inside: int, many: int) -> str:
    """How much of an outfit is inside the body, in words."""
    if not inside:
        return NOTHING_INSIDE
    share = 100.0 * inside / many
    return f"{inside} of {many} vertices ({share:.2g} %) are inside the body"


@persistent
def forget(_path: object = None, _unused: object = None) -> None:
    _kept.clear()


HANDLERS = (("load_pre", forget),)
