# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab Match: the workflow from top to bottom. Panels only draw."""

from bpy.types import Panel

from . import job as job_module
from . import pair, stored_match
from .transfer import KINDS

GRADE_ICONS = {"green": "CHECKMARK", "amber": "ERROR", "red": "CANCEL"}
GRADE_WORDS = {"green": "Good match", "amber": "Check this match", "red": "Poor match"}
# Letters that fit on a line of the sidebar at its default width and the default font.
LINE_LETTERS = 34


def wrapped(text, letters=LINE_LETTERS):
    """Split words into lines, because labels do not wrap."""
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > letters:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line] if line else lines


def draw_words(layout, text, icon="NONE"):
    """Several lines of text, the icon before the first."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(wrapped(text)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))


class MatchTab:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Match"


class VIEW3D_PT_spectral_match(MatchTab, Panel):
    bl_label = "Spectral Match"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.spectral_match
        found = pair.resolve(context)
        self._draw_pair(layout, settings, found)
        job = job_module.current
        if job is None:
            row = layout.row()
            row.scale_y = 1.6
            row.operator("spectral_match.match", icon="MOD_DATA_TRANSFER")
        else:
            column = layout.column(align=True)
            column.progress(factor=job.fraction, text="Stopping" if job.cancelling else f"{job.fraction:.0%}")
            stage = column.row()
            stage.active = False
            stage.label(text=job.stage[:1].upper() + job.stage[1:])
            row = layout.row()
            row.scale_y = 1.6
            row.operator("spectral_match.cancel", icon="X")
        if found.missing:
            draw_words(layout.box(), found.missing, "INFO")

    def _draw_pair(self, layout, settings, found):
        row = layout.row(align=False)
        column = row.column(align=True)
        if settings.pinned:
            column.prop(settings, "source", text="")
            column.prop(settings, "target", text="")
        else:
            for label, names in (("From", [found.source] if found.source else []), ("To", found.targets)):
                line = column.box().row()
                split = line.split(factor=0.2)
                caption = split.row()
                caption.active = False
                caption.label(text=label)
                if len(names) > 1:
                    split.label(text=f"{len(names)} meshes", icon="OUTLINER_OB_MESH")
                elif names:
                    split.label(text=names[0].name, icon="OUTLINER_OB_MESH")
                else:
                    split.label(text="Nothing chosen")
        buttons = row.column(align=True)
        buttons.operator("spectral_match.pin", text="", icon="PINNED" if settings.pinned else "UNPINNED")
        buttons.operator("spectral_match.swap_roles", text="", icon="ARROW_LEFTRIGHT")


class SubPanel(MatchTab):
    bl_parent_id = "VIEW3D_PT_spectral_match"


class MatchedSubPanel(SubPanel):
    """Drawn only where the first target has a match."""

    @classmethod
    def poll(cls, context):
        targets = pair.resolve(context).targets
        return any(target.data.spectral_match.target_fingerprint for target in targets)

    @staticmethod
    def matched(context):
        targets = pair.resolve(context).targets
        return [target for target in targets if target.data.spectral_match.target_fingerprint]


class VIEW3D_PT_spectral_match_options(SubPanel, Panel):
    bl_label = "Match Options"
    bl_options = {"DEFAULT_CLOSED"}
    bl_order = 0

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.spectral_match
        layout.prop(settings, "shape")
        layout.prop(settings, "method")
        layout.prop(settings, "part")
        layout.prop(settings, "allow_mirror")


class VIEW3D_PT_spectral_match_result(MatchedSubPanel, Panel):
    bl_label = "Result"
    bl_order = 1

    def draw(self, context):
        layout = self.layout
        targets = self.matched(context)
        for target in targets:
            stored = target.data.spectral_match
            now = stored_match.state(target)
            box = layout.box()
            if len(targets) > 1:
                box.label(text=target.name, icon="OUTLINER_OB_MESH")
            if not now.usable:
                draw_words(box, now.words, "ERROR")
                continue
            box.label(
                text=GRADE_WORDS.get(stored.grade, stored.grade),
                icon=GRADE_ICONS.get(stored.grade, "QUESTION"),
            )
            box.progress(factor=stored.mean_confidence, text=f"Confidence {stored.mean_confidence:.0%}")
            for reason in stored.reasons.splitlines():
                draw_words(box, reason, "DOT")
            facts = box.row()
            facts.active = False
            facts.label(text=f"{stored.seconds:.1f} s", icon="TIME")
            if now.words:
                draw_words(box, now.words, "INFO")
        layout.label(text="Show")
        row = layout.row(align=True)
        row.operator("spectral_match.show", text="Colors").what = "COLOURS"
        row.operator("spectral_match.show", text="Confidence").what = "CONFIDENCE"
        row.operator("spectral_match.show", text="Off").what = "NOTHING"


class VIEW3D_PT_spectral_match_fix(MatchedSubPanel, Panel):
    bl_label = "Fix"
    bl_order = 2
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        stored = self.matched(context)[0].data.spectral_match
        column = layout.column(align=True)
        row = column.row(align=True)
        row.operator("spectral_match.alternative", text="", icon="TRIA_LEFT").step = -1
        word = f"Map {stored.alternative + 1} of {max(stored.alternatives, 1)}"
        row.operator("spectral_match.alternative", text=word).step = 1
        row.operator("spectral_match.alternative", text="", icon="TRIA_RIGHT").step = 1
        column.operator("spectral_match.swap_sides", icon="MOD_MIRROR", depress=stored.swapped_sides)


class VIEW3D_PT_spectral_match_transfer(MatchedSubPanel, Panel):
    bl_label = "Transfer"
    bl_order = 3

    def draw(self, context):
        layout = self.layout
        settings = context.scene.spectral_match
        source = self.matched(context)[0].spectral_match_source
        if not pair.is_there(source):
            layout.label(text="The source is gone", icon="ERROR")
            return
        column = layout.column(align=True)
        for kind in KINDS:
            self._draw_kind(column, settings, kind, kind.names(source))
        row = layout.row()
        row.scale_y = 1.6
        row.operator("spectral_match.transfer", icon="IMPORT")

    @staticmethod
    def _draw_kind(layout, settings, kind, names):
        use, opened = f"use_{kind.identifier}", f"open_{kind.identifier}"
        box = layout.box().column(align=True)
        row = box.row()
        row.active = bool(names)
        icon = "DOWNARROW_HLT" if getattr(settings, opened) else "RIGHTARROW"
        row.prop(settings, opened, text="", icon=icon, emboss=False)
        row.prop(settings, use, text=kind.label)
        chosen = sum(not settings.skips(kind.identifier, name) for name in names)
        count = row.row()
        count.alignment = "RIGHT"
        count.active = False
        count.label(text=f"{chosen} / {len(names)}" if names else "none")
        if not getattr(settings, opened):
            return
        items = box.column(align=True)
        items.active = getattr(settings, use)
        for name in names:
            skipped = settings.skips(kind.identifier, name)
            line = items.row()
            line.alignment = "LEFT"
            line.label(text="", icon="BLANK1")
            button = line.operator(
                "spectral_match.toggle_item",
                text=name,
                icon="CHECKBOX_DEHLT" if skipped else "CHECKBOX_HLT",
                emboss=False,
            )
            button.item = f"{kind.identifier}/{name}"


class VIEW3D_PT_spectral_match_mix(MatchTab, Panel):
    bl_label = "Weights"
    bl_parent_id = "VIEW3D_PT_spectral_match_transfer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.spectral_match
        row = layout.row(heading="Limit Total")
        row.prop(settings, "limit_total", text="")
        value = row.row()
        value.active = settings.limit_total
        value.prop(settings, "limit", text="")
        line = layout.row()
        line.active = settings.limit_total
        line.prop(settings, "normalize")
        layout.prop(settings, "prune")


class VIEW3D_PT_spectral_match_batch(SubPanel, Panel):
    bl_label = "Batch"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        count = len(pair.resolve(context).targets)
        if count > 1:
            draw_words(layout, f"Match and transfer the checked data to all {count} selected targets")
        else:
            draw_words(layout, "Select several targets to match and transfer to all of them at once")
        layout.operator("spectral_match.batch", icon="DUPLICATE")


CLASSES = (
    VIEW3D_PT_spectral_match,
    VIEW3D_PT_spectral_match_options,
    VIEW3D_PT_spectral_match_result,
    VIEW3D_PT_spectral_match_fix,
    VIEW3D_PT_spectral_match_transfer,
    VIEW3D_PT_spectral_match_mix,
    VIEW3D_PT_spectral_match_batch,
)
