# SPDX-License-Identifier: GPL-3.0-or-later
"""What a button can do about what is said: one table from words to operators."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

import bpy

from .typed import EnumItem


@dataclass(frozen=True)
class Remedy:
    """A button: its operator with these properties.

    `named` is the property that gets the name which the words tell, where their pattern has a group for it.
    """

    label: str
    operator: str
    icon: EnumItem
    properties: tuple[tuple[str, Any], ...] = ()
    named: str = ""


AGAIN = Remedy("Match Again", "spectral_match.match", "FILE_REFRESH")
MODELLED = Remedy("Match as Modelled", "spectral_match.match", "FILE_REFRESH", (("as_modelled", True),))
MIRRORED = Remedy("Allow Mirrored, Match Again", "spectral_match.match", "MOD_MIRROR", (("mirrored", True),))
BARE = Remedy("Match without It", "spectral_match.match", "MATCLOTH", (("bare", True),))
SIDES = Remedy("Swap Left and Right", "spectral_match.swap_sides", "MOD_MIRROR")
MARK = Remedy("Add Landmarks", "spectral_match.pick_landmarks", "RESTRICT_SELECT_OFF")
OUTDATED = Remedy("Remove Outdated Landmarks", "spectral_match.remove_outdated", "X")
TAKE = Remedy("Let It Take Part", "spectral_match.toggle_piece", "CHECKBOX_HLT", named="piece")
SHOW = Remedy("Show It", "spectral_match.show_object", "HIDE_OFF", named="name")
SCALE = Remedy("Set Its Scale to 1", "spectral_match.unit_scale", "FULLSCREEN_ENTER", named="name")
UNWRAP = Remedy("Unwrap It", "spectral_match.transfer", "UV", (("bake_unwrap", "OVERLAPS"),))
UNWRAP_ANEW = Remedy("Unwrap Anew", "spectral_match.transfer", "UV", (("bake_unwrap", "OVERLAPS"),))
LOCAL = Remedy("Make Selected Local", "object.make_local", "LINKED", (("type", "SELECT_OBDATA"),))
REAL = Remedy("Make Instances Real", "object.duplicates_make_real", "OUTLINER_OB_MESH")
LEAVE_MODE = Remedy("Object Mode", "object.mode_set", "OBJECT_DATAMODE", (("mode", "OBJECT"),))
FILES = Remedy("Find Missing Files", "file.find_missing_files", "FILE_FOLDER")
SAVE = Remedy("Save All Images", "image.save_all_modified", "FILE_TICK")
NO_MASK = Remedy("Transfer without Mask", "spectral_match.transfer", "IMPORT", (("group_mask", ""),))
NO_SPLITS = Remedy("Transfer without Splits", "spectral_match.transfer", "IMPORT", (("split_seams", False),))
GIVE_WAY = Remedy("Let Others Give Way", "spectral_match.transfer", "IMPORT", (("others_give_way", True),))

# Patterns of what is said, in English, and what helps; refusals, doubts about a match and notes alike.
TABLE = (
    (r"set Shape to Original", MODELLED),
    (r"[Mm]atch again", AGAIN),
    (r"mirror image of the other", MIRRORED),
    (r"[Ww]hat is worn may mislead the match", BARE),
    (r"left and right are hard to tell apart", SIDES),
    (r"cannot be told, set two landmarks|[Aa]dd landmarks|the shapes differ, or one is a part", MARK),
    (r"no plausible map was found", MARK),
    (r"[Rr]emove the landmark under Fix", OUTDATED),
    (r"is on '(.*)', which is left out", TAKE),
    (r"^'(.*)' is hidden in all viewports", SHOW),
    (r"^'(.*)' is scaled to nothing", SCALE),
    (
        r"has no UV map of its own to bake textures into|Textures of '.*'.* are shown by the source's UV map",
        UNWRAP,
    ),
    (r"^UV map '.*' of '.*'.* (?:overlaps: |has .* of the surface in single points)", UNWRAP_ANEW),
    (r"Make Local >", LOCAL),
    (r"Make Instances Real", REAL),
    (r"Leave Sculpt Mode first|Use Object Mode first", LEAVE_MODE),
    (r"[Ff]ind its file", FILES),
    (r"Save or pack the image|Save the image", SAVE),
    (r"has no vertex group '.*' for the mask", NO_MASK),
    (r"switch Split Faces at Seams off", NO_SPLITS),
    (r"sum to more than 1, because groups of other bones", GIVE_WAY),
)


@cache
def remedies(words: str) -> tuple[tuple[Remedy, str], ...]:
    """Remedies for words of any number of lines, each once, in the order of the table: (remedy, name)."""
    found: dict[Remedy, str] = {}
    for pattern, remedy in TABLE:
        for line in words.splitlines():
            sign = re.search(pattern, line)
            if sign is not None:
                found.setdefault(remedy, next(filter(None, sign.groups()), ""))
    return tuple(found.items())


def draw(layout: bpy.types.UILayout, words: str) -> None:
    """A button for each remedy for these words."""
    found = remedies(words)
    if not found:
        # An empty column would be seen as a gap.
        return
    column = layout.column(align=True)
    for remedy, name in found:
        button = column.operator(remedy.operator, text=remedy.label, icon=remedy.icon)
        for key, value in remedy.properties:
            setattr(button, key, value)
        if remedy.named:
            setattr(button, remedy.named, name)
