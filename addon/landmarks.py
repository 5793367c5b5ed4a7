# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of vertices that the artist knows to correspond, and whether they still hold."""

from dataclasses import dataclass

import bpy

from . import stored_match
from .mesh_read import UnusableObjectError
from .pair import resolve


@dataclass(frozen=True)
class Ends:
    """The two vertices of a landmark, seen from the source and the target chosen now."""

    source_vertex: int
    target_vertex: int
    source_topology: str
    target_topology: str


def ends(landmark, source, target):
    """The landmark's vertices, exchanged when the roles were swapped; None when it is another pair's."""
    first, second = (
        (landmark.source_vertex, landmark.source_topology),
        (landmark.target_vertex, landmark.target_topology),
    )
    if (landmark.source, landmark.target) == (source, target):
        return Ends(first[0], second[0], first[1], second[1])
    if (landmark.source, landmark.target) == (target, source):
        return Ends(second[0], first[0], second[1], first[1])
    return None


def of_pair(settings, source, target):
    """The landmarks of this pair with their ends, in the list's order."""
    found = ((landmark, ends(landmark, source, target)) for landmark in settings.landmarks)
    return [(landmark, pair) for landmark, pair in found if pair is not None]


def listed(context):
    """Places in the scene's list of the chosen pairs' landmarks, which are those that the panel shows."""
    chosen = resolve(context)
    return [
        place
        for place, landmark in enumerate(context.scene.spectral_match.landmarks)
        if any(ends(landmark, chosen.source, target) is not None for target in chosen.targets)
    ]


def outdated(pair, source, target):
    """The object whose vertices were renumbered since the landmark was picked, or None."""
    for obj, topology in ((source, pair.source_topology), (target, pair.target_topology)):
        if stored_match.current_fingerprint(obj.data).topology != topology:
            return obj
    return None


def vertex_pairs(settings, source, target):
    """What the core takes: [(source vertex, target vertex)]; an outdated landmark is refused in words."""
    pairs = []
    for landmark, pair in of_pair(settings, source, target):
        changed = outdated(pair, source, target)
        if changed is not None:
            raise UnusableObjectError(
                f"'{changed.name}' got other vertices since landmark '{landmark.name}' was picked. "
                "Remove the landmark under Fix, or pick it again"
            )
        pairs.append((pair.source_vertex, pair.target_vertex))
    return pairs


def follow(mesh, old, new):
    """Landmarks on this mesh, whose topology changed from `old` to `new` without renumbering, still hold."""
    for scene in bpy.data.scenes:
        for landmark in scene.spectral_match.landmarks:
            for end in ("source", "target"):
                obj = getattr(landmark, end)
                if obj is not None and obj.data == mesh and getattr(landmark, f"{end}_topology") == old:
                    setattr(landmark, f"{end}_topology", new)


def add(settings, source, source_vertex, target, target_vertex):
    """Append a landmark under a name that is free in the list."""
    names = {landmark.name for landmark in settings.landmarks}
    number = len(of_pair(settings, source, target)) + 1
    while f"Landmark {number}" in names:
        number += 1
    landmark = settings.landmarks.add()
    landmark.name = f"Landmark {number}"
    landmark.source, landmark.target = source, target
    landmark.source_vertex, landmark.target_vertex = source_vertex, target_vertex
    landmark.source_topology = stored_match.current_fingerprint(source.data).topology
    landmark.target_topology = stored_match.current_fingerprint(target.data).topology
    settings.landmark_index = len(settings.landmarks) - 1
    return landmark
