# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last step said and what a transfer brought, below the result: there it cannot be folded away."""

from __future__ import annotations

import bpy
from bpy.types import Panel

from . import job as job_module
from . import notice, pair, remedy, wording
from .drawing import CROSS_WIDTH, SubPanel, draw_words, fold
from .operators import compare
from .translation import OWN_CONTEXT, said
from .typed import EnumItem


class VIEW3D_PT_spectral_match_message(SubPanel, Panel):
    """The result above stays where it is when this comes and goes, as it does while other work runs."""

    bl_label = "Notes"
    bl_options = {"HIDE_HEADER"}
    bl_order = 1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        job = job_module.current
        if job is not None and job.button not in notice.BESIDE:
            return False
        return bool(pair.matched(context)) if notice.done is not None else bool(notice.words)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.enabled = job_module.current is None
        if notice.done is not None:
            self._draw_done(context, layout.box().column(), notice.done())
        else:
            draw_message(context, layout, notice.words, notice.icon)

    @staticmethod
    def _draw_done(context: bpy.types.Context, box: bpy.types.UILayout, done: str) -> None:
        draw_words(context, box, done, "CHECKMARK", boxed=True)
        # Maps are gone through of one target at a time.
        other = notice.other_map(pair.matched(context)[0].lead)
        if other:
            draw_words(context, box, other, "INFO", boxed=True)
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


def draw_message(
    context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: EnumItem, step: str = ""
) -> None:
    """What a step said, with remedies, and a cross that hides it."""
    box = layout.box()
    row = box.row()
    words = row.column()
    for line in text.splitlines():
        draw_words(context, words, line, icon, boxed=True, beside=CROSS_WIDTH)
    row.operator("spectral_match.dismiss", text="", icon="X", emboss=False).step = step
    remedy.draw(box, text)


CLASSES = (VIEW3D_PT_spectral_match_message,)
