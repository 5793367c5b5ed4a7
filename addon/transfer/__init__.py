# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be carried over: a module for each kind of data, its `KIND` listed in `KINDS`."""

import bpy
from bpy.props import BoolProperty

from .. import completion, mesh_read, stored_match
from ..mesh_read import UnusableObjectError
from . import (
    armatures,
    attributes,
    colours,
    companions,
    edge_marks,
    layouts,
    materials,
    normals,
    partners,
    seam_splits,
    shape_keys,
    textures,
    uv_maps,
    vertex_groups,
    whole,
)
from .kind import Kind, Prepared
from .redirect import redirect
from .route import Route

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
    mesh_read.check_usable(target, as_target=True)
    stored_match.require(target)
    source = target.spectral_match_source
    wanted = {kind.identifier: [name for name in kind.names(source) if chosen(kind, name)] for kind in KINDS}
    mesh_read.place(bpy.context, _standing(source, target, wanted))
    with whole.body_of(target) as body:
        return _carry(Route(target, body), wanted, options)


def _carry(route, wanted, options):
    target = route.target
    route.wanted, route.sides = wanted, partners.sides(route, options)
    known = {given: own for own, given in layouts.carried_maps(target.data).items()}
    maps = wanted[uv_maps.KIND.identifier]
    route.uv_names = known | layouts.names_on_target(route.source, target, maps, options.replace_uv)
    _check_twins(route)
    with seam_splits.split(route, wanted[uv_maps.KIND.identifier], options) as (route, notes):
        for kind in KINDS:
            if wanted[kind.identifier]:
                route.prepared.append(kind.prepare(route, wanted[kind.identifier], options))
    for part in route.prepared:
        part.write()
    if any(wanted[kind.identifier] for kind in (shape_keys.KIND, armatures.KIND, companions.KIND)):
        redirect(route)
    target.data.update()
    if wanted[companions.KIND.identifier] and route.target_mirrors:
        notes.append(
            f"'{target.name}' is completed by a Mirror modifier, and the map knows its modelled half alone. "
            "Objects of the other half may lie beside it: apply the modifier and match again, or symmetrize "
            "them"
        )
    return notes + [note for part in route.prepared for note in part.notes]


def _standing(source, target, wanted):
    """Both bodies with their rigs, what they are mirrored about and, where wanted, what hangs on them."""
    bodies = [source, target]
    rigs = [rig for body in bodies for rig in armatures.rigs(body)]
    mirrors = [obj for body in bodies for obj in completion.mirror_objects(body)]
    hung = (
        [obj for body in bodies for obj in companions.hanging(body)]
        if wanted[companions.KIND.identifier]
        else []
    )
    return bodies + rigs + mirrors + hung


def _check_twins(route):
    """Raise `UnusableObjectError` for a vertex group and an attribute of one name.

    Blender makes the group beside the attribute, but no attribute beside the group, which is written first.
    """
    layers = route.wanted[colours.KIND.identifier] + route.wanted[attributes.KIND.identifier]
    groups, _ = route.sides.of_all(route.wanted[vertex_groups.KIND.identifier])
    for name in groups.values():
        if name in layers and name not in route.target.data.attributes:
            raise UnusableObjectError(
                f"'{route.source.name}' brings both a vertex group and an attribute named '{name}', which "
                f"'{route.target.name}' cannot get at once. Rename one of the two"
            )
