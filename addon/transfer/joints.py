# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones of the source's rig, placed in the target: what the core asks about a rig, and what it finds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import core
from ..mesh_read import moved
from ..typed import Floats
from .sides import flip_name
from .weights import read_weights

if TYPE_CHECKING:
    from sgmds.transfer import SkinWeights

    from .route import Route


@dataclass(frozen=True)
class Placed:
    """A bone in the target's coordinates as seen: its ends, its axes (3, 3) and how much larger it is there.

    `turn` (3, 3) takes directions of the source to those of the target, mirroring if the map does. `firm` are
    bones placed by the surface, or with such bones.
    """

    head: Floats
    tail: Floats
    axes: Floats
    turn: Floats
    scale: float
    firm: bool = True


def fitted_bones(route: Route, rig: bpy.types.Object) -> dict[str, Placed]:
    """Every bone of a rig, `Placed` in the target, by name: `SurfaceMap.fit_bones` says where."""
    bones = list(rig.data.bones)
    number = {bone.name: place for place, bone in enumerate(bones)}
    to_source = np.array(route.source_to_world.inverted_safe() @ rig.matrix_world)
    others = [flip_name(name, number) for name in number]
    found = route.map_as_seen.fit_bones(
        moved(np.array([bone.head_local for bone in bones], np.float64), to_source),
        moved(np.array([bone.tail_local for bone in bones], np.float64), to_source),
        _weights(route.body, number),
        [-1 if bone.parent is None else number[bone.parent.name] for bone in bones],
        ups=np.array([bone.matrix_local.col[2][:3] for bone in bones]) @ to_source[:3, :3].T,
        leads=np.array(list(_leads(rig, number)), np.int64).reshape(-1, 2),
        partners=[
            number.get(other, -1) if other != name else -1 for name, other in zip(number, others, strict=True)
        ],
        sided=[other != name for name, other in zip(number, others, strict=True)],
        mirrors=_mirrors(route, to_source[:3, :3]),
    )
    columns = (found.heads, found.tails, found.axes, found.turns, found.scales.tolist(), found.firm.tolist())
    return dict(zip(number, map(Placed, *columns), strict=True))


def _weights(source: bpy.types.Object, number: Mapping[str, int]) -> SkinWeights:
    """Weights of a mesh for bones, by the names of its groups."""
    vertex, group, weight = read_weights(source)
    bone = np.array([number.get(held.name, -1) for held in source.vertex_groups], np.int64)
    kept = group < len(bone)
    kept[kept] = bone[group[kept]] >= 0
    starts = np.searchsorted(vertex[kept], np.arange(len(source.data.vertices) + 1))
    rows = core.load().transfer.SkinWeights
    return rows(starts, bone[group[kept]], weight[kept], np.zeros(0, np.int64))


def _leads(rig: bpy.types.Object, number: Mapping[str, int]) -> Iterator[tuple[int, int]]:
    """The bones at which constraints look, each with the bone that has the constraint."""
    for bone in rig.pose.bones:
        for constraint in bone.constraints:
            looks = getattr(constraint, "targets", None) or [constraint]
            names = [look.subtarget for look in looks if getattr(look, "target", None) == rig]
            if getattr(constraint, "pole_target", None) == rig:
                names.append(constraint.pole_subtarget)
            for name in names:
                if name in number:
                    yield number[name], number[bone.name]


def _mirrors(route: Route, axes: Floats) -> tuple[Floats, Floats] | None:
    """Where a modifier mirrors one half of the target: the rig's reflection as the source has it, its axes
    being `axes` (3, 3), and the target's as it is seen.
    """
    if len(route.target_mirrors) != 1:
        return None
    stretch = np.eye(4)
    stretch[:3, :3] = route.target_stretch
    return (
        axes @ np.diag((-1.0, 1.0, 1.0)) @ np.linalg.inv(axes),
        stretch @ route.target_mirrors[0].reflection @ np.linalg.inv(stretch),
    )
