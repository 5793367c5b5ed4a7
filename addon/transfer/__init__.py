# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be carried over: a module for each kind of data, its `KIND` listed in `KINDS`."""

import bpy
from bpy.props import BoolProperty

from .. import completion, mesh_read
from ..mesh_read import UnusableObjectError
from . import (
    armatures,
    attributes,
    colours,
    companions,
    edge_marks,
    materials,
    normals,
    seam_splits,
    shape_keys,
    textures,
    uv_maps,
    vertex_groups,
)
from .kind import Kind, Prepared
from .redirect import redirect
from .route import Route
from .sides import names_on_target

__all__ = ["KINDS", "Kind", "Prepared", "TransferChoice", "TransferOptions", "carry_all", "checked"]

# In the order of the panel, which is the order of writing.
KINDS = (
    vertex_groups.KIND,
    shape_keys.KIND,
    edge_marks.KIND,
    normals.KIND,
    uv_maps.KIND,
    materials.KIND,
    colours.KIND,
    attributes.KIND,
    textures.KIND,
    armatures.KIND,
    companions.KIND,
)

# Both classes only bring properties to the property group or operator that inherits them.
TransferOptions = type(
    "TransferOptions",
    (),
    {
        "__doc__": "Every option of every kind.",
        "__annotations__": {name: made for kind in KINDS for name, made in kind.options.items()},
    },
)
TransferChoice = type(
    "TransferChoice",
    (),
    {
        "__doc__": "`use_KIND` chooses a kind, `open_KIND` lists its items in the panel.",
        "__annotations__": {
            f"use_{kind.identifier}": BoolProperty(
                name=kind.label, description=kind.description, default=kind.default
            )
            for kind in KINDS
        }
        | {
            f"open_{kind.identifier}": BoolProperty(
                name="Show", description=f"List the {kind.label.lower()} one by one"
            )
            for kind in KINDS
        },
    },
)


def checked(settings):
    """The choice made in the panel, for `carry_all`."""

    def chosen(kind, name):
        return getattr(settings, f"use_{kind.identifier}") and not settings.skips(kind.identifier, name)

    return chosen


def carry_all(target, options, chosen):
    """Carry to one target all names for which `chosen(kind, name)` holds; returns words for the artist.

    Everything is computed before anything is written, so that a kind that cannot be carried leaves the
    target as it was.
    """
    route = Route(target)
    wanted = {
        kind.identifier: [name for name in kind.names(route.source) if chosen(kind, name)] for kind in KINDS
    }
    mesh_read.place(bpy.context, _whole(route, wanted))
    _check_twins(route, wanted, options)
    with seam_splits.split(route, wanted[uv_maps.KIND.identifier], options) as (route, notes):
        route.wanted = wanted
        for kind in KINDS:
            if wanted[kind.identifier]:
                route.prepared.append(kind.prepare(route, wanted[kind.identifier], options))
    for part in route.prepared:
        part.write()
    if any(wanted[kind.identifier] for kind in (shape_keys.KIND, armatures.KIND, companions.KIND)):
        redirect(route, options)
    target.data.update()
    notes += _halves(route, *(bool(wanted[kind.KIND.identifier]) for kind in (armatures, companions)))
    return notes + [note for part in route.prepared for note in part.notes]


def _whole(route, wanted):
    """Both bodies with their rigs and, where they are wanted, what hangs on them."""
    bodies = [route.source, route.target]
    rigs = [rig for body in bodies for rig in armatures.rigs(body)]
    hung = (
        [obj for body in bodies for obj in companions.hanging(body)]
        if wanted[companions.KIND.identifier]
        else []
    )
    return bodies + rigs + hung


def _halves(route, rigs, objects):
    """Notes when a modifier adds a half, by whose surface nothing can be placed."""
    source, target = route.source, route.target
    if not (rigs or objects):
        return []
    if not route.target_mirrors and completion.mirrors(source, route.source_points):
        return [
            f"'{source.name}' is completed by a Mirror modifier, and its modelled half alone was matched. "
            "Bones and objects of the other half may lie beside the target: apply the modifier and match "
            "again, or symmetrize them"
        ]
    if objects and route.target_mirrors:
        return [
            f"'{target.name}' is completed by a Mirror modifier, and the map knows its modelled half alone. "
            "Objects of the other half may lie beside it: apply the modifier and match again, or symmetrize "
            "them"
        ]
    return []


def _check_twins(route, wanted, options):
    """Raise `UnusableObjectError` for a vertex group and an attribute of one name.

    Blender makes the group beside the attribute, but no attribute beside the group, which is written first.
    """
    layers = wanted[colours.KIND.identifier] + wanted[attributes.KIND.identifier]
    groups, _ = names_on_target(wanted[vertex_groups.KIND.identifier], options)
    for name in groups.values():
        if name in layers and name not in route.target.data.attributes:
            raise UnusableObjectError(
                f"'{route.source.name}' brings both a vertex group and an attribute named '{name}', which "
                f"'{route.target.name}' cannot get at once. Rename one of the two"
            )
