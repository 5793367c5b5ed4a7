# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the other side, for a match that turned left into right.

A side is a word, a letter or a sign that stands by itself, anywhere in a name: `Hand.L`, `hand_l_01`,
`L_Hand`, `J_Bip_L_Hand`, `Bip01 L Hand`, `LeftHand`, `lShldr`, `HandR`, `左腕`. What only may be one, as in
`leftarm`, `rt_arm` or `HairL1`, counts where there is a name of the other side, and two names without any
side are partners where they lie so on a symmetric body.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import bpy

from .actions import actions_of, own_actions
from .listed import listed

# What stands for each side; of several that are possible the first that makes a known name.
OTHER = {
    "l": ("r",), "L": ("R",), "r": ("l",), "R": ("L",),
    "left": ("right",), "Left": ("Right",), "LEFT": ("RIGHT",),
    "right": ("left",), "Right": ("Left",), "RIGHT": ("LEFT",),
    "lft": ("rgt",), "Lft": ("Rgt",), "LFT": ("RGT",),
    "rgt": ("lft",), "Rgt": ("Lft",), "RGT": ("LFT",),
    "lf": ("rt",), "Lf": ("Rt",), "LF": ("RT",),
    "lt": ("rt",), "Lt": ("Rt",), "LT": ("RT",),
    "rt": ("lf", "lt"), "Rt": ("Lf", "Lt"), "RT": ("LF", "LT"),
    "左": ("右",), "右": ("左",), "왼": ("오른",), "오른": ("왼",),
}  # fmt: skip
LEFTS = frozenset("l L left Left LEFT lft Lft LFT lf Lf LF lt Lt LT 左 왼".split())
# Signs of scripts without words apart, where both in one name mean both sides.
SIGNS = frozenset("左右왼") | {"오른"}
# Sides for certain. A letter stands alone between signs, or is set off by the case of its neighbours.
SURE = (
    r"(?<![A-Z])(?:LEFT|RIGHT)(?![A-Za-z])",
    r"(?:Left|Right)(?![a-z])",
    r"(?<![A-Za-z])(?:left|right)(?![a-z])",
    r"(?<![A-Za-z])(?:lft|Lft|LFT|rgt|Rgt|RGT|lf|Lf|LF)(?![A-Za-z])",
    r"(?<![A-Za-z0-9])[LlRr](?![A-Za-z0-9])",
    r"(?<![A-Za-z0-9])[lr](?=[A-Z])",
    r"(?<![A-Za-z0-9])[LR](?=[A-Z][a-z])",
    r"(?<=[a-z0-9])[LR](?![A-Za-z0-9])",
    r"左|右|왼|오른",
)
# Sides perhaps: "Bright", "root_rt" and the vertebra "L4" have none.
PERHAPS = (
    r"(?:left|right|Left|Right|LEFT|RIGHT)",
    r"(?<![A-Za-z])(?:lt|Lt|LT|rt|Rt|RT)(?![A-Za-z])",
    r"(?<![A-Za-z0-9])[LlRr](?=[0-9])",
    r"(?<=[a-z0-9])[LR](?=[A-Z0-9])",
)
FOR_CERTAIN, AT_MOST = re.compile("|".join(SURE)), re.compile("|".join(SURE + PERHAPS))
# Words in which people read no side.
SIDELESS = re.compile(r"(?i)(?:b|f|w|up|copy|out|down)right|cleft|leftover")
# Names that are told of at once: each has to be looked at.
MOST_TOLD = 20


def flip_name(name: str, known: Container[str] = ()) -> str:
    """The name with its side exchanged, a namespace before a colon left aside; itself where it has none.

    What only may be a side is exchanged where that makes one of the `known` names.
    """
    space, colon, own = name.rpartition(":")
    certain = FOR_CERTAIN.findall(own)
    sides = {side in LEFTS for side in certain}
    if len(sides) == 1:
        (flipped,) = _flips(FOR_CERTAIN, own)[:1]
        return space + colon + flipped
    found = (space + colon + flipped for flipped in _flips(AT_MOST, own))
    return next((flipped for flipped in found if flipped != name and flipped in known), name)


def _flips(pattern: re.Pattern[str], name: str) -> list[str]:
    """The name with all sides that the pattern finds exchanged, in each way of writing the others."""
    ways = max((len(OTHER[side]) for side in pattern.findall(name)), default=0)
    return [pattern.sub(partial(_other, way), name) for way in range(ways)]


def _other(way: int, found: re.Match[str]) -> str:
    """The other side of the one found, in the way of this number, or in the last that there is."""
    return OTHER[found[0]][min(way, len(OTHER[found[0]]) - 1)]


def looks_sided(name: str) -> bool:
    """Whether people may read a side in a name, and not both."""
    own = SIDELESS.sub("", name.rpartition(":")[2])
    sides = AT_MOST.findall(own)
    both = {side in LEFTS for side in sides} == {True, False} and SIGNS.issuperset(sides)
    return bool(sides) and not both


@dataclass(frozen=True)
class Sides:
    """The target's name for each of the source's: itself, or with the side exchanged.

    `known` are names that there are, `partners` those that are exchanged because of where they lie.
    """

    mirrored: bool = False
    known: frozenset[str] = frozenset()
    partners: Mapping[str, str] = field(default_factory=dict)

    def of(self, name: str) -> str:
        if not self.mirrored or not name:
            return name
        flipped = flip_name(name, self.known)
        return self.partners.get(name, name) if flipped == name else flipped

    def of_all(self, names: Iterable[str]) -> tuple[dict[str, str], list[str]]:
        """The target's name for each, and notes about sides that are not exchanged."""
        named = {name: self.of(name) for name in names}
        kept = [name for name, other in named.items() if name == other and looks_sided(name)]
        if not self.mirrored or not kept:
            return named, []
        return named, [
            f"Mirror Names found no other side for these names, which stay: {listed(kept, MOST_TOLD)}. "
            "Rename those that are of one side"
        ]


def rename(items: Iterable[Any], named: Mapping[str, str], *animated: bpy.types.ID) -> None:
    """Give bones, vertex groups or shape keys new names, which may be names that others of them have.

    Blender renames the paths in actions too: those of the `animated` IDs are copied, for others share them.
    """
    renamed = [(item, named[item.name]) for item in items if named[item.name] != item.name]
    for holder in animated if renamed else ():
        own_actions(holder, actions_of(holder))
    # Twice, since two of them may exchange their names.
    for number, (item, _) in enumerate(renamed):
        item.name = f"spectral_match {number}"
    for item, name in renamed:
        item.name = name
