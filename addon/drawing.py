# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels share: text that fits the sidebar, and where they belong."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import blf
import bpy

from . import job as job_module
from . import pair
from .character import Character
from .translation import said, spoken
from .typed import EnumItem, PanelState, Settings

# Pixels at scale 1 that a panel, a box and an icon take from the sidebar's width.
PANEL_MARGIN, BOX_MARGIN, ICON_WIDTH = 60, 10, 20
# The button that hides a message, with the gap before it.
CROSS_WIDTH = 34
# A word with the space before it, or one sign of Chinese or Japanese, with the marks that open and end it.
PORTIONS = re.compile(
    r"\s*[（「“]*(?:[\u3000-\u9fff\uff00-\uffef]|[^\s（「“\u3000-\u9fff\uff00-\uffef]+|[“])"
    r"[、。，：；？）」”,:;)]*|\s+"
)
BIG = 1.6


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Split text into lines of which `fits(line)` holds, because labels do not wrap.

    Between words, and after any sign of a script without spaces.
    """
    lines, line = [], ""
    for word in PORTIONS.findall(text):
        longer = line + word
        if line and not fits(longer.rstrip()):
            lines.append(line.rstrip())
            line = word.lstrip()
        else:
            line = longer.lstrip()
    return [*lines, line.rstrip()] if line.strip() else lines


def draw_words(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    text: str,
    icon: EnumItem = "NONE",
    *,
    boxed: bool = False,
    dim: bool = False,
    beside: float = 0,
) -> None:
    """Several lines of text that fit into the sidebar, the icon first, `beside` pixels to spare."""
    scale = context.preferences.system.ui_scale
    margin = PANEL_MARGIN + boxed * BOX_MARGIN + (icon != "NONE") * ICON_WIDTH + beside
    room = context.region.width - margin * scale
    blf.size(0, context.preferences.ui_styles[0].widget.points * scale)
    text = spoken(text)
    column = layout.column(align=True)
    column.scale_y = 0.8
    column.active = not dim
    for number, line in enumerate(wrapped(text, lambda line: blf.dimensions(0, line)[0] <= room)):
        column.label(
            text=line, translate=False, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE")
        )


def draw_step(row: bpy.types.UILayout, operator: str, **how: Any) -> Any:
    """The button of a step, whose properties are returned; None while in its place is how far it is."""
    job = job_module.current
    if job is None or job.button != operator:
        # Else Blender lets an operator begin in the viewport, as from a menu.
        row.operator_context = "INVOKE_DEFAULT"
        return row.operator(operator, **how)
    # Where the window waits there is no button to press.
    way_out = f"  (Esc: {said('Cancel')})" if job.blocks and not job.lasting else ""
    row.progress(factor=job.fraction, text=job.words + way_out)
    if not job.blocks:
        row.operator("spectral_match.cancel", text="", icon="X")
    return None


def icon_of(body: Character) -> EnumItem:
    """What the outliner shows before that which holds a character together."""
    if isinstance(body.owner, bpy.types.Collection):
        return "OUTLINER_COLLECTION"
    return f"OUTLINER_OB_{body.owner.type}"


def draw_option(
    layout: bpy.types.UILayout, settings: Settings, name: str, *, works: bool = True, **how: Any
) -> None:
    """A setting, its label in the left half; a check box has all of the row, not the right half alone.

    One that changes nothing now is grey.
    """
    row = layout.row()
    row.active = works
    if settings.bl_rna.properties[name].type == "BOOLEAN":
        row.use_property_split = False
    row.prop(settings, name, **how)


def panel_state() -> PanelState:
    """What of the panel is unfolded, and what its lists are searched for."""
    return bpy.context.window_manager.spectral_match_panel


def draw_arrow(row: bpy.types.UILayout, opened: str, text: str = "") -> bool:
    """The arrow of a fold; returns whether it is open."""
    state = panel_state()
    is_open: bool = getattr(state, opened)
    row.prop(state, opened, text=text, icon="DOWNARROW_HLT" if is_open else "RIGHTARROW", emboss=False)
    return is_open


def fold(layout: bpy.types.UILayout, opened: str, text: str) -> bool:
    """A line with an arrow, which shows or hides what follows; returns whether it is shown."""
    row = layout.row()
    row.alignment = "LEFT"
    return draw_arrow(row, opened, text)


def is_open(context: bpy.types.Context) -> bool:
    """Whether a sidebar shows the tab."""
    return any(
        region.type == "UI" and region.width > 1 and region.active_panel_category == MatchTab.bl_category
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D" and area.spaces.active.show_region_ui
        for region in area.regions
    )


class MatchTab:
    bl_space_type: EnumItem = "VIEW_3D"
    bl_region_type: EnumItem = "UI"
    bl_category = "Match"


class SubPanel(MatchTab):
    bl_parent_id = "VIEW3D_PT_spectral_match"


class MatchedSubPanel(SubPanel):
    """Drawn only where a target has a match."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(pair.matched(context))
