# SPDX-License-Identifier: GPL-3.0-or-later
"""Material slots, and which face has which."""

import numpy as np

from .kind import Kind, Prepared
from .textures import is_made_from, slot_name


def names(source):
    return [slot_name(slot, place) for place, slot in enumerate(source.material_slots)]


def prepare(route, wanted, _options):
    slots = route.source.material_slots
    label = route.carried_slots
    chosen = [place for place, slot in enumerate(slots) if slot_name(slot, place) in wanted]

    def write():
        # Looked for among what the object shows: a slot may be linked to it instead of to its mesh.
        shown = route.target.material_slots
        own = np.empty(len(label), np.int32)
        route.target.data.polygons.foreach_get("material_index", own)
        for place in chosen:
            material = slots[place].material
            same = (
                at for at, held in enumerate(shown) if is_made_from(held.material, material, route.target)
            )
            at = next(same, len(shown))
            if at == len(shown):
                route.target.data.materials.append(material)
            own[label == place] = at
        route.target.data.polygons.foreach_set("material_index", own)

    return Prepared(write)


KIND = Kind(
    "materials",
    "Materials",
    "MATERIAL",
    "Carry material slots and which face has which material",
    names,
    prepare,
)
