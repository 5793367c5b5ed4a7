# SPDX-License-Identifier: GPL-3.0-or-later
"""Material slots, and which face has which."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import mesh_read
from ..mesh_write import read_attribute, write_attribute
from ..typed import Flags, Integers, Options
from .kind import Kind, Prepared
from .material_copies import fitting, is_made_from, slot_name

if TYPE_CHECKING:
    from .route import Route

# On the target: the slot of its own that each face showed before it got one of the source's, else -1.
OWN_SLOT = "match_own_material"


def names(source: bpy.types.Object) -> list[str]:
    return [slot_name(slot, place) for place, slot in enumerate(source.material_slots)]


def prepare(route: Route, wanted: Sequence[str], _options: Options) -> Prepared:
    target, slots = route.target, route.source.material_slots
    label = route.carried_slots
    chosen = [place for place, slot in enumerate(slots) if slot_name(slot, place) in wanted]
    own = _shown_own(route)
    lost = np.isin(label, chosen) & (own >= 0)
    notes = []
    if lost.any() and OWN_SLOT not in target.data.attributes:
        notes.append(
            f"Faces of '{target.name}' show materials of '{route.source.name}'. Its own stay in its slots, "
            f"and the attribute {OWN_SLOT} tells which face had which"
        )

    def write() -> None:
        if lost.any():
            _keep(target.data, own, lost)
        # Looked for among what the object shows: a slot may be linked to it instead of to its mesh.
        shown = target.material_slots
        index = np.empty(len(label), np.int32)
        target.data.polygons.foreach_get("material_index", index)
        for place in chosen:
            material = slots[place].material
            same = (at for at, held in enumerate(shown) if is_made_from(held.material, material, target))
            at = next(same, len(shown))
            if at == len(shown):
                target.data.materials.append(material)
            if shown[at].material == material:
                shown[at].material = fitting(route, material)
            index[label == place] = at
        target.data.polygons.foreach_set("material_index", index)

    return Prepared(write, notes)


def own_slots(route: Route) -> Integers:
    """For each face of the target the slot of its own material that it shows, or showed before, else -1."""
    own, kept = _shown_own(route), route.target.data.attributes.get(OWN_SLOT)
    if kept is None:
        return own
    before = read_attribute(kept)
    known = (before >= 0) & (before < len(route.target.material_slots))
    return np.where((own < 0) & known, before, own)


def _shown_own(route: Route) -> Integers:
    """For each face of the target the slot of its own material that it shows, -1 for one of the source's."""
    shown = mesh_read.slots_shown(route.target)
    given = [slot.material for slot in route.source.material_slots]
    own = [
        slot.material is not None
        and not any(is_made_from(slot.material, each, route.target) for each in given)
        for slot in route.target.material_slots
    ]
    return np.where(np.array([*own, False])[shown], shown, -1)


def _keep(mesh: bpy.types.Mesh, own: Integers, lost: Flags) -> None:
    """Note the slots of faces that lose them, beside what was noted before."""
    kept = mesh.attributes.get(OWN_SLOT)
    before = np.full(len(own), -1) if kept is None else read_attribute(kept)
    write_attribute(mesh, OWN_SLOT, "INT", "FACE", np.where(lost, own, before))


KIND = Kind(
    "materials",
    "Materials",
    "MATERIAL",
    "Carry material slots and which face has which material",
    names,
    prepare,
    words=("material", "materials"),
)
