# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Transfer: what goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
from bpy.types import Panel

from . import item_lists, pair, remedy, stored_match
from .character import is_there
from .drawing import MatchedSubPanel, draw_arrow, draw_option, draw_words, fold
from .operators.settings import draw_presets
from .transfer import KINDS, Bodies, has_effect, names_of
from .translation import said

if TYPE_CHECKING:
    from .transfer.kind import Kind


class VIEW3D_PT_spectral_match_transfer(MatchedSubPanel, Panel):
    bl_label = "Transfer"
    bl_order = 3

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        matched, chosen = pair.matched_pieces(context), pair.shown(context).source
        sources = [obj for target in matched for obj, _, _ in stored_match.sources_of(target)]
        sources = [obj for obj in dict.fromkeys(sources) if is_there(obj) and obj.type == "MESH"]
        if not sources:
            layout.label(text="The source is gone", icon="ERROR")
            return
        elsewhere = [stored_match.matched_elsewhere(target, chosen) for target in matched]
        if all(elsewhere):
            draw_words(context, layout, elsewhere[0], "ERROR")
            remedy.draw(layout, elsewhere[0])
            return
        draw_presets(layout)
        draw_kinds(context, layout, Bodies(sources, matched))


def draw_kinds(context: bpy.types.Context, layout: bpy.types.UILayout, bodies: Bodies) -> None:
    """What the source has, kind by kind, and behind one line what it lacks."""
    listed = [(kind, names_of(kind, bodies.sources)) for kind in KINDS]
    column = layout.column(align=True)
    for kind, names in listed:
        if names:
            _draw_kind(context, column, kind, names, bodies)
    lacking = [kind for kind, names in listed if not names]
    if lacking:
        is_open = fold(layout, "open_lacking", said("{} more that the source lacks", len(lacking)))
        for kind in lacking if is_open else ():
            line = layout.row()
            line.active = False
            line.label(text=kind.label, icon=kind.icon)


def _draw_kind(
    context: bpy.types.Context, layout: bpy.types.UILayout, kind: Kind, names: Sequence[str], bodies: Bodies
) -> None:
    settings, use = context.scene.spectral_match, f"use_{kind.identifier}"
    row = layout.row(align=True)
    is_open = draw_arrow(row, f"open_{kind.identifier}")
    row.prop(settings, use, text=kind.label)
    chosen = sum(not settings.skips(kind.identifier, name) for name in names)
    count = row.row()
    count.alignment = "RIGHT"
    count.active = False
    count.label(text=str(len(names)) if chosen == len(names) else said("{} of {}", chosen, len(names)))
    if not is_open:
        return
    box = layout.box().column()
    box.active = getattr(settings, use)
    if kind.shown:
        options = box.column()
        options.use_property_split = True
        options.use_property_decorate = False
        for name in kind.shown:
            draw_option(options, settings, name, works=has_effect(name, settings, bodies))
    items = item_lists.VIEW3D_UL_spectral_match_items
    item_lists.draw(context, box.column(align=True), items, kind.identifier, names)


CLASSES = (*item_lists.CLASSES, VIEW3D_PT_spectral_match_transfer)
