# SPDX-License-Identifier: GPL-3.0-or-later
"""Material slots, and which face has which."""

import numpy as np

from .kind import Kind, Prepared


def names(source):
    return [_name(slot, place) for place, slot in enumerate(source.material_slots)]


def _name(slot, place):
    return slot.material.name if slot.material else f"Empty Slot {place + 1}"


def prepare(route, wanted, _options):
    slots = route.source.material_slots
    index = np.empty(len(route.source.data.polygons), np.int32)
    route.source.data.polygons.foreach_get("material_index", index)
    # An index beyond the slots shows the last one.
    index = np.minimum(index, len(slots) - 1)
    label = route.map.face_labels(*route.faces, index[route.triangle_faces])
    chosen = [place for place, slot in enumerate(slots) if _name(slot, place) in wanted]

    def write():
        # Looked for among what the object shows: a slot may be linked to it instead of to its mesh.
        shown = route.target.material_slots
        own = np.empty(len(label), np.int32)
        route.target.data.polygons.foreach_get("material_index", own)
        for place in chosen:
            material = slots[place].material
            at = next((at for at, held in enumerate(shown) if held.material == material), len(shown))
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
