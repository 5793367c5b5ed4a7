# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Transfer: what it brought, and what goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
from bpy.types import Panel

from . import item_lists, notice, pair, remedy, stored_match, wording
from .character import is_there
from .drawing import MatchedSubPanel, draw_arrow, draw_option, draw_words, fold
from .operators import compare
from .operators.settings import draw_presets
from .transfer import KINDS, Bodies, has_effect, names_of
from .translation import OWN_CONTEXT, said
from .typed import Settings

if TYPE_CHECKING:
    from .transfer.kind import Kind


class VIEW3D_PT_spectral_match_transfer(MatchedSubPanel, Panel):
    bl_label = "Transfer"
    bl_order = 3

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.spectral_match
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
        if notice.done is not None:
            self._draw_done(context, layout.box().column(), notice.done())
        draw_presets(layout)
        draw_kinds(layout, settings, Bodies(sources, matched))

    @staticmethod
    def _draw_done(context: bpy.types.Context, box: bpy.types.UILayout, done: str) -> None:
        draw_words(context, box, done, "CHECKMARK", boxed=True)
        row = box.row(align=True)
        # What is seen is the transfer's state, or that of the step before it.
        after = compare.is_after(context)
        before = row.row(align=True)
        before.enabled = after
        before.operator(
            "spectral_match.compare",
            text="Before",
            text_ctxt=OWN_CONTEXT,
            icon="BLANK1" if after else "HIDE_OFF",
        ).back = True
        later = row.row(align=True)
        later.enabled = not after
        later.operator(
            "spectral_match.compare",
            text="After",
            text_ctxt=OWN_CONTEXT,
            icon="HIDE_OFF" if after else "BLANK1",
        ).back = False
        look, told = wording.notes_in_order(notice.words.splitlines())
        if look:
            one = said("1 thing needs a look")
            words = one if len(look) == 1 else said("{} things need a look", len(look))
        else:
            words = said("1 note") if len(told) == 1 else said("{} notes", len(told))
        if not (look or told) or not fold(box, "open_notes", words):
            return
        for note in look:
            draw_words(context, box, note, "DOT", boxed=True)
            remedy.draw(box, note)
        for note in told:
            draw_words(context, box, note, "INFO", boxed=True, dim=True)
            remedy.draw(box, note)


def draw_kinds(layout: bpy.types.UILayout, settings: Settings, bodies: Bodies) -> None:
    """What the source has, kind by kind, and behind one line what it lacks."""
    listed = [(kind, names_of(kind, bodies.sources)) for kind in KINDS]
    column = layout.column(align=True)
    for kind, names in listed:
        if names:
            _draw_kind(column, settings, kind, names, bodies)
    lacking = [kind for kind, names in listed if not names]
    if lacking:
        is_open = fold(layout, "open_lacking", said("{} more that the source lacks", len(lacking)))
        for kind in lacking if is_open else ():
            line = layout.row()
            line.active = False
            line.label(text=kind.label, icon=kind.icon)


def _draw_kind(
    layout: bpy.types.UILayout, settings: Settings, kind: Kind, names: Sequence[str], bodies: Bodies
) -> None:
    use = f"use_{kind.identifier}"
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
    item_lists.draw(box.column(align=True), settings, kind, names)


CLASSES = (*item_lists.CLASSES, VIEW3D_PT_spectral_match_transfer)
