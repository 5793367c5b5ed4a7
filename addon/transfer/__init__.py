# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be carried over, a module for each kind of data.

A kind has `names(source)`, what the source has of it, and `carry(route, names, settings)`, which reads it
there, carries it along the route, writes it to the target and returns words about what needs the artist's
attention.
"""

from collections.abc import Callable
from dataclasses import dataclass

from . import colours, uv_maps, vertex_groups
from .route import Route


@dataclass(frozen=True)
class Kind:
    """One kind of data; `identifier` names it in scripts and, after `use_` or `open_`, in settings."""

    identifier: str
    label: str
    icon: str
    names: Callable
    carry: Callable


KINDS = (
    Kind("groups", "Vertex Groups", "GROUP_VERTEX", vertex_groups.names, vertex_groups.carry),
    Kind("uv", "UV Maps", "GROUP_UVS", uv_maps.names, uv_maps.carry),
    Kind("colours", "Color Attributes", "GROUP_VCOL", colours.names, colours.carry),
)


def carry_all(context, target, kinds=None):
    """Carry what is checked in the panel, or everything of `kinds`, to one target; returns warnings."""
    settings = context.scene.spectral_match
    route = Route(target)
    notes = []
    for kind in KINDS:
        asked = getattr(settings, f"use_{kind.identifier}") if kinds is None else kind.identifier in kinds
        if not asked:
            continue
        wanted = [
            name
            for name in kind.names(route.source)
            if kinds is not None or not settings.skips(kind.identifier, name)
        ]
        if wanted:
            notes += kind.carry(route, wanted, settings)
    target.data.update()
    return notes
