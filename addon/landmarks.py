# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of vertices that the artist knows to correspond, and whether they still hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from . import palette, stored_match
from .character import holds, pieces_of
from .mesh_read import UnusableObjectError
from .pair import shown
from .typed import Landmark, Settings

if TYPE_CHECKING:
    from .character import Character


@dataclass(frozen=True)
class Ends:
    """The two vertices of a landmark and their objects, seen from the source and the target chosen now."""

    source: bpy.types.Object
    target: bpy.types.Object
    source_vertex: int
    target_vertex: int
    source_topology: str
    target_topology: str


def ends(
    landmark: Landmark, source: Character | bpy.types.Object | None, target: Character | bpy.types.Object
) -> Ends | None:
    """The landmark's vertices, exchanged when the roles were swapped; None when it is another pair's.

    Source and target are characters, or objects by themselves.
    """
    first, second = (
        (landmark.source, landmark.source_vertex, landmark.source_topology),
        (landmark.target, landmark.target_vertex, landmark.target_topology),
    )
    for (a, at_a, print_a), (b, at_b, print_b) in ((first, second), (second, first)):
        if holds(source, a) and holds(target, b):
            return Ends(a, b, at_a, at_b, print_a, print_b)
    return None


def of_pair(
    settings: Settings, source: Character | bpy.types.Object | None, target: Character | bpy.types.Object
) -> list[tuple[Landmark, Ends]]:
    """The landmarks of this pair with their ends, in the list's order."""
    found = ((landmark, ends(landmark, source, target)) for landmark in settings.landmarks)
    return [(landmark, pair) for landmark, pair in found if pair is not None]


def listed(context: bpy.types.Context) -> list[int]:
    """Places in the scene's list of the chosen pairs' landmarks, which are those that the panel shows."""
    chosen = shown(context)
    return [
        place
        for place, landmark in enumerate(context.scene.spectral_match.landmarks)
        if any(ends(landmark, chosen.source, target) is not None for target in chosen.targets)
    ]


def outdated(pair: Ends) -> bpy.types.Object | None:
    """The object whose vertices were renumbered since the landmark was picked, or None."""
    for obj, topology in ((pair.source, pair.source_topology), (pair.target, pair.target_topology)):
        if stored_match.current_fingerprint(obj.data).topology != topology:
            return obj
    return None


def vertex_pairs(
    settings: Settings, source: Character | bpy.types.Object | None, target: Character | bpy.types.Object
) -> list[tuple[int, int]]:
    """What the core takes: [(source vertex, target vertex)], in figures counted through all their pieces.

    A landmark that is outdated, or on a piece that is left out, is refused in words.
    """
    pairs, before = [], {}
    for body in (source, target):
        count = 0
        for obj in pieces_of(body):
            before[obj] = count
            count += len(obj.data.vertices)
    for landmark, pair in of_pair(settings, source, target):
        for obj in (pair.source, pair.target):
            if obj not in before:
                raise UnusableObjectError(
                    f"Landmark '{landmark.name}' is on '{obj.name}', which is left out. Check '{obj.name}' "
                    "under Pieces, or remove the landmark under Fix"
                )
        changed = outdated(pair)
        if changed is not None:
            raise UnusableObjectError(
                f"'{changed.name}' got other vertices since landmark '{landmark.name}' was picked. "
                "Remove the landmark under Fix, or pick it again"
            )
        pairs.append((before[pair.source] + pair.source_vertex, before[pair.target] + pair.target_vertex))
    return pairs


def follow(mesh: bpy.types.Mesh, old: str, new: str) -> None:
    """Landmarks on this mesh, whose topology changed from `old` to `new` without renumbering, still hold."""
    for scene in bpy.data.scenes:
        for landmark in scene.spectral_match.landmarks:
            for end in ("source", "target"):
                obj = getattr(landmark, end)
                if obj is not None and obj.data == mesh and getattr(landmark, f"{end}_topology") == old:
                    setattr(landmark, f"{end}_topology", new)


def add(
    settings: Settings,
    source: bpy.types.Object,
    source_vertex: int,
    target: bpy.types.Object,
    target_vertex: int,
) -> Landmark:
    """Append a landmark under a name that is free in the list: that of its colour.

    Raises `UnusableObjectError` where one of the two vertices has a landmark of this pair.
    """
    for landmark, pair in of_pair(settings, source, target):
        if (pair.source, pair.source_vertex) == (source, source_vertex) or (
            (pair.target, pair.target_vertex) == (target, target_vertex)
        ):
            raise UnusableObjectError(f"Landmark '{landmark.name}' is there already. Click another point")
    colours = [landmark.colour for landmark in settings.landmarks]
    colour = min(range(len(palette.LANDMARK_NAMES)), key=lambda each: (colours.count(each), each))
    landmark = settings.landmarks.add()
    landmark.colour, landmark.name = colour, _free_name(settings, palette.LANDMARK_NAMES[colour])
    landmark.source, landmark.target = source, target
    landmark.source_vertex, landmark.target_vertex = source_vertex, target_vertex
    landmark.source_topology = stored_match.current_fingerprint(source.data).topology
    landmark.target_topology = stored_match.current_fingerprint(target.data).topology
    settings.landmark_index = len(settings.landmarks) - 1
    return landmark


def _free_name(settings: Settings, name: str) -> str:
    """The name, or the first of "Orange 2", "Orange 3" and so on that no landmark has."""
    names = {landmark.name for landmark in settings.landmarks}
    ways = (name if number == 1 else f"{name} {number}" for number in range(1, len(names) + 2))
    return next(way for way in ways if way not in names)
