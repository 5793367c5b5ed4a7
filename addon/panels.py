# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab Match: the workflow from top to bottom. Panels only draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import bpy
from bl_ui.utils import PresetPanel
from bpy.types import Panel

from . import (
    character,
    landmarks,
    manual,
    morph,
    notes_panel,
    outfit_panel,
    overlay,
    pair,
    palette,
    remedy,
    stored_match,
    transfer_panel,
    wording,
)
from .drawing import (
    BIG,
    MatchedSubPanel,
    MatchTab,
    SubPanel,
    draw_option,
    draw_step,
    draw_words,
    fold,
    icon_of,
)
from .lines import Lines
from .operators import pick, show
from .operators.settings import PRESETS, draw_presets, path_menu
from .transfer import Bodies
from .translation import OWN_CONTEXT, said
from .typed import EnumItem, Settings, StoredMatch

if TYPE_CHECKING:
    from .character import Character

GRADE_ICONS: dict[str, EnumItem] = {"green": "CHECKMARK", "amber": "ERROR", "red": "CANCEL"}
# The buttons of the two steps.
BUTTONS: tuple[tuple[str, EnumItem], ...] = (
    ("spectral_match.match", "MOD_DATA_TRANSFER"),
    ("spectral_match.transfer", "IMPORT"),
)
SWAPPED = "Left and right are swapped, as you asked"
# What to do about it, by grade.
ADVICE = {
    "green": "Nothing to do, unless you see something wrong",
    "amber": "Look where Confidence is yellow; compare the other maps",
    "red": "Try the other maps, then landmarks on hands, feet and head",
}
SWAP_BACK = "Press Swap Left and Right again to go back"
LEGEND = "Equal colors match. Left and right differ in hue"
WHITE = "White is left out"
# More results than these are listed a line each.
MOST_BOXES = 3
# More things than these are not named.
MOST_NAMES = 3
# Pieces of a character that are listed without scrolling.
MOST_ROWS = 8


def state_of(target: Character, source: Character | None) -> stored_match.State:
    """The state of a character's match, or of the worst one where its meshes were matched in several."""
    states = [stored_match.state_of(each, source) for each in stored_match.matched_together(target.pieces)]
    return min(states, key=lambda each: (each.usable, not each.words))


def _leaves_white(found: pair.Pair) -> bool:
    """Whether pieces of the pair are to be seen that are left out, and so have no colors of the match."""
    bodies = [found.source, *found.targets] if found.source is not None else found.targets
    return any(
        obj.visible_get() and not obj.data.color_attributes for body in bodies for obj in body.left_out
    )


def has_several(body: Character) -> bool:
    """Whether what a chosen body belongs to has several meshes, also where it stands by itself."""
    whole = character.of(body.lead) or body
    return max(len(body.whole), len(whole.whole)) > 1


def draw_name(row: bpy.types.UILayout, body: Character) -> None:
    """A character's name and, if it has several meshes, how many."""
    row.label(text=body.name, icon=icon_of(body), translate=False)
    if len(body.whole) > 1:
        # Beside the name, which may be cut off for it.
        count = row.row()
        count.alignment = "RIGHT"
        count.active = False
        taken, of_all = len(body.pieces), len(body.whole)
        count.label(text=f"({of_all})" if taken == of_all else f"({taken}/{of_all})")


class VIEW3D_PT_spectral_match_presets(PresetPanel, Panel):
    bl_label = "Match Presets"
    bl_space_type = "VIEW_3D"
    # As a panel of the sidebar it would get a tab of its own.
    bl_region_type = "HEADER"
    preset_subdir = PRESETS
    preset_operator = "script.execute_preset"
    preset_add_operator = "spectral_match.add_preset"
    path_menu = path_menu

    def draw(self, context: bpy.types.Context) -> None:
        super().draw(context)
        self.layout.separator()
        self.layout.operator("spectral_match.reset", icon="LOOP_BACK")
        manual.draw_links(self.layout)


class VIEW3D_PT_spectral_match(MatchTab, Panel):
    bl_label = "Spectral Match"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        VIEW3D_PT_spectral_match_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = context.scene.spectral_match
        found = pair.shown(context)
        self._draw_pair(layout, settings, found)
        # Both above all whose height changes, so that they stay under the pointer.
        buttons = layout.column()
        for operator, icon in BUTTONS:
            row = buttons.row(align=True)
            row.scale_y = BIG
            draw_step(row, operator, icon=icon)
        self._draw_landmarks(layout, settings, found)
        if found.missing:
            box = layout.box()
            draw_words(context, box, found.missing, "INFO", boxed=True)
            remedy.draw(box, found.missing)

    @staticmethod
    def _draw_pair(layout: bpy.types.UILayout, settings: Settings, found: pair.Pair) -> None:
        row = layout.row(align=False)
        column = row.column(align=True)
        for label, end, bodies in (
            ("From", "source", [found.source] if found.source else []),
            ("To", "target", found.targets),
        ):
            if settings.pinned:
                VIEW3D_PT_spectral_match._draw_fields(column, settings, end)
            # A field says itself what it holds, but not of how many meshes that is.
            if not settings.pinned or any(len(body.whole) > 1 for body in bodies):
                VIEW3D_PT_spectral_match._draw_chosen(column, label, bodies)
        buttons = row.column(align=True)
        buttons.scale_y = 1.0 if settings.pinned else 1.4
        buttons.operator("spectral_match.pin", text="", icon="PINNED" if settings.pinned else "UNPINNED")
        buttons.operator("spectral_match.swap_roles", text="", icon="UV_SYNC_SELECT")

    @staticmethod
    def _draw_fields(column: bpy.types.UILayout, settings: Settings, end: str) -> None:
        """A field for an object and, while that is empty, one for a collection."""
        collection = f"{end}_collection"
        if getattr(settings, end) is not None or getattr(settings, collection) is None:
            column.prop(settings, end, text="")
        if getattr(settings, end) is None:
            column.prop(settings, collection, text="")

    @staticmethod
    def _draw_chosen(column: bpy.types.UILayout, label: str, bodies: Sequence[Character]) -> None:
        split = column.box().row().split(factor=0.2)
        caption = split.row()
        caption.active = False
        caption.label(text=label)
        if len(bodies) > 1:
            many = any(len(body.whole) > 1 for body in bodies)
            words = said("{} characters", len(bodies)) if many else said("{} meshes", len(bodies))
            split.label(text=words, icon="OUTLINER_OB_MESH", translate=False)
        elif bodies:
            draw_name(split.row(), bodies[0])
        else:
            split.label(text="Nothing chosen")

    @staticmethod
    def _draw_landmarks(layout: bpy.types.UILayout, settings: Settings, found: pair.Pair) -> None:
        if found.missing:
            return
        count = sum(len(landmarks.of_pair(settings, found.source, target)) for target in found.targets)
        if count:
            hint = layout.row()
            hint.active = False
            words = said("With 1 landmark") if count == 1 else said("With {} landmarks", count)
            hint.label(text=words, icon="EMPTY_AXIS")


class PiecesList(Lines):
    """All objects of the file, of which only the meshes of one character are listed."""

    bl_options: set[Any] = set()
    use_filter_show = False

    @staticmethod
    def bodies(context: bpy.types.Context) -> Sequence[Character]:
        raise NotImplementedError

    def draw_line(self, context: bpy.types.Context, layout: bpy.types.UILayout, _data: Any, obj: Any) -> None:
        taken = any(obj in body.pieces for body in self.bodies(context))
        row = layout.row(align=True)
        button = row.operator(
            "spectral_match.toggle_piece",
            text="",
            icon="CHECKBOX_HLT" if taken else "CHECKBOX_DEHLT",
            emboss=False,
        )
        button.piece = obj.name
        name = row.row()
        name.active = taken
        name.label(text=obj.name, translate=False)

    def filter_items(self, context: bpy.types.Context, data: Any, name: str) -> Any:
        listed = {obj for body in self.bodies(context) for obj in body.whole}
        wanted = self.filter_name.lower()
        shown = [
            self.bitflag_filter_item if obj in listed and wanted in obj.name.lower() else 0
            for obj in getattr(data, name)
        ]
        return shown, []


class VIEW3D_UL_spectral_match_source_pieces(PiecesList):
    @staticmethod
    def bodies(context: bpy.types.Context) -> Sequence[Character]:
        source = pair.shown(context).source
        return [] if source is None else [source]


class VIEW3D_UL_spectral_match_target_pieces(PiecesList):
    @staticmethod
    def bodies(context: bpy.types.Context) -> Sequence[Character]:
        return pair.shown(context).targets


class VIEW3D_PT_spectral_match_pieces(SubPanel, Panel):
    """Below the result, which the two lists would push out of the window."""

    bl_label = "Pieces"
    bl_options = {"DEFAULT_CLOSED"}
    bl_order = 1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        found = pair.shown(context)
        return any(len(body.whole) > 1 for body in (found.source, *found.targets) if body is not None)

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.spectral_match
        for end, of_end in (
            ("source", VIEW3D_UL_spectral_match_source_pieces),
            ("target", VIEW3D_UL_spectral_match_target_pieces),
        ):
            bodies = of_end.bodies(context)
            count = sum(len(body.whole) for body in bodies)
            if count < 2:
                continue
            column = layout.column()
            row = column.row()
            if len(bodies) == 1:
                draw_name(row.row(), bodies[0])
            else:
                row.label(text=said("{} characters", len(bodies)), icon=icon_of(bodies[0]), translate=False)
            for button in (
                row.operator("spectral_match.undress", text="", icon="MATCLOTH", emboss=False),
                row.operator("spectral_match.reset_pieces", text="", icon="LOOP_BACK", emboss=False),
            ):
                button.end = end.upper()
            column.template_list(
                of_end.__name__,
                "",
                bpy.data,
                "objects",
                settings,
                f"{end}_piece",
                rows=min(count, MOST_ROWS),
                maxrows=MOST_ROWS,
            )


class VIEW3D_PT_spectral_match_options(SubPanel, Panel):
    bl_label = "Match Options"
    bl_options = {"DEFAULT_CLOSED"}
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.spectral_match
        found = pair.shown(context)
        bodies = [body for body in (found.source, *found.targets) if body is not None]
        draw_option(layout, settings, "whole_characters", works=not bodies or any(map(has_several, bodies)))
        for name in ("shape", "part", "allow_mirror", "same_axes"):
            draw_option(layout, settings, name)


class VIEW3D_PT_spectral_match_result(MatchedSubPanel, Panel):
    bl_label = "Result"
    bl_order = 1

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        matched = pair.matched(context)
        # Above all whose height depends on the map, so that the arrows stay under the pointer.
        if len(matched) == 1:
            self._draw_maps(layout, matched[0].lead.data.spectral_match)
        column = layout.column(align=True)
        source = pair.shown(context).source
        for target in matched:
            now = state_of(target, source)
            if len(matched) > MOST_BOXES:
                self._draw_line(column, target, now)
            else:
                self._draw_box(context, layout, target, now, named=len(matched) > 1)
        self._draw_show(context, layout, [piece for target in matched for piece in target.pieces])

    @staticmethod
    def _draw_maps(layout: bpy.types.UILayout, stored: StoredMatch) -> None:
        if stored.alternatives < 2:
            return
        row = layout.row(align=True)
        row.operator("spectral_match.alternative", text="", icon="TRIA_LEFT").step = -1
        word = said("Map {} of {}", stored.alternative + 1, stored.alternatives)
        # The arrows stay, that a second press is no other button's.
        alternative = draw_step(row.row(align=True), "spectral_match.alternative", text=word)
        if alternative is not None:
            alternative.step = 1
        row.operator("spectral_match.alternative", text="", icon="TRIA_RIGHT").step = 1

    @staticmethod
    def _draw_line(column: bpy.types.UILayout, target: Character, now: stored_match.State) -> None:
        stored = target.lead.data.spectral_match
        row = column.row()
        row.alert = not now.usable or stored.grade == "red"
        row.label(
            text=target.name,
            translate=False,
            icon=GRADE_ICONS.get(stored.grade, "QUESTION") if now.usable else "ERROR",
        )
        if stored.swapped_sides:
            row.label(text="", icon="MOD_MIRROR")
        share = row.row()
        share.alignment = "RIGHT"
        share.label(text=f"{stored.mean_confidence:.0%}" if now.usable else said("match again"))

    @staticmethod
    def _draw_box(
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        target: Character,
        now: stored_match.State,
        *,
        named: bool,
    ) -> None:
        stored = target.lead.data.spectral_match
        box = layout.box().column()
        if named:
            box.label(text=target.name, icon=icon_of(target), translate=False)
        if not now.usable:
            draw_words(context, box, now.words, "ERROR", boxed=True)
            remedy.draw(box, now.words)
            return
        head = box.row()
        head.alert = stored.grade == "red"
        reasons, sure = stored.reasons.splitlines(), stored.mean_confidence
        head.label(text=wording.of(stored), icon=GRADE_ICONS.get(stored.grade, "QUESTION"))
        box.progress(factor=sure, text=said("Confidence {}", f"{sure:.0%}"))
        if stored.swapped_sides:
            draw_words(context, box, SWAPPED, "MOD_MIRROR", boxed=True)
        for reason in wording.plain(reasons):
            draw_words(context, box, reason, "DOT", boxed=True)
        remedy.draw(box, "\n".join(reasons))
        if now.words:
            draw_words(context, box, now.words, "INFO", boxed=True)
            remedy.draw(box, now.words)
        if fold(box, "open_details", "Details"):
            for words in (*wording.details(reasons), said("matched in {} s", f"{stored.seconds:.1f}")):
                draw_words(context, box, words[:1].upper() + words[1:], boxed=True, dim=True)

    @staticmethod
    def _draw_show(
        context: bpy.types.Context, layout: bpy.types.UILayout, matched: Sequence[bpy.types.Object]
    ) -> None:
        column = layout.column(align=True)
        row = column.row(align=True)
        now = show.shown(context, matched[0])
        for what, text in (("COLOURS", "Colors"), ("CONFIDENCE", "Confidence"), ("NOTHING", "Off")):
            row.operator("spectral_match.show", text=text, depress=now == what).what = what
        row = column.row(align=True)
        row.operator("spectral_match.lines", icon="CURVE_PATH", depress=overlay.lines_shown())
        modifier = morph.modifier_of(matched[0])
        row.operator("spectral_match.morph", icon="MOD_SIMPLEDEFORM", depress=modifier is not None)
        column.operator(
            "spectral_match.follow_pointer", icon="RESTRICT_SELECT_OFF", depress=overlay.partners is not None
        )
        legend = []
        if now == "COLOURS":
            legend.append(said(LEGEND))
        if now == "CONFIDENCE" or overlay.lines_shown():
            legend.append(said("Blue is sure, yellow is doubtful"))
        if now != "NOTHING" and _leaves_white(pair.shown(context)):
            legend.append(said(WHITE))
        draw_words(context, layout, said(". ").join(legend), dim=True)
        if morph.is_whole(modifier):
            settings = context.scene.spectral_match
            morphing = layout.column(align=True)
            morphing.prop(settings, "morph_factor", slider=True)
            ways = morphing.row(align=True)
            for way in ("morph_in_place", "morph_wipe"):
                ways.prop(settings, way, toggle=True)


class VIEW3D_UL_spectral_match_landmarks(Lines):
    """The landmarks of the chosen pair."""

    def draw_line(
        self, context: bpy.types.Context, layout: bpy.types.UILayout, _data: Any, item: Any
    ) -> None:
        found = pair.shown(context)
        row = layout.row(align=True)
        row.label(text="", icon=palette.LANDMARK_ICONS[item.colour])
        row.prop(item, "name", text="", emboss=False)
        for target in found.targets:
            ends = landmarks.ends(item, found.source, target)
            if ends is None:
                continue
            if landmarks.outdated(ends) is not None:
                row.label(text="outdated", icon="ERROR")
                return

    def filter_items(self, context: bpy.types.Context, data: Any, name: str) -> Any:
        listed = set(landmarks.listed(context))
        many = len(getattr(data, name))
        return [self.bitflag_filter_item if place in listed else 0 for place in range(many)], []


class VIEW3D_PT_spectral_match_fix(MatchedSubPanel, Panel):
    bl_label = "Fix"
    bl_translation_context = OWN_CONTEXT
    bl_order = 2
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = context.scene.spectral_match
        stored = pair.matched(context)[0].lead.data.spectral_match
        advice = SWAP_BACK if stored.swapped_sides else ADVICE.get(stored.grade, ADVICE["amber"])
        draw_words(context, layout, advice, "INFO")
        row = layout.row(align=True)
        draw_step(row, "spectral_match.swap_sides", icon="MOD_MIRROR", depress=stored.swapped_sides)
        part = layout.column()
        part.use_property_split = True
        part.use_property_decorate = False
        part.prop(settings, "part")
        self._draw_landmarks(context, layout, settings)
        row = layout.row(align=True)
        row.scale_y = BIG
        again = draw_step(row, "spectral_match.match", text="Match Again", icon="FILE_REFRESH")
        if again is not None:
            again.swap_sides = stored.swapped_sides

    @staticmethod
    def _draw_landmarks(context: bpy.types.Context, layout: bpy.types.UILayout, settings: Settings) -> None:
        column = layout.column(align=True)
        if overlay.picking is not None:
            draw_words(context, column.box(), pick.hint(context), "RESTRICT_SELECT_OFF", boxed=True)
        else:
            column.operator("spectral_match.pick_landmarks", icon="RESTRICT_SELECT_OFF")
        found = pair.shown(context)
        if not any(landmarks.of_pair(settings, found.source, target) for target in found.targets):
            return
        row = column.row()
        row.template_list(
            "VIEW3D_UL_spectral_match_landmarks",
            "",
            settings,
            "landmarks",
            settings,
            "landmark_index",
            rows=3,
        )
        buttons = row.column(align=True)
        buttons.operator("spectral_match.remove_landmark", text="", icon="REMOVE")
        go = column.row(align=True)
        go.operator("spectral_match.go_to_landmark", text="Source", icon="VIEWZOOM").end = "SOURCE"
        go.operator("spectral_match.go_to_landmark", text="Target", icon="VIEWZOOM").end = "TARGET"


class VIEW3D_PT_spectral_match_batch(SubPanel, Panel):
    bl_label = "Batch"
    bl_translation_context = OWN_CONTEXT
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        count = len(pair.shown(context).targets)
        if count > 1:
            words = said("Match and transfer the checked data to all {} selected targets", count)
        else:
            words = said("Select several targets to match and transfer to all of them at once")
        draw_words(context, layout, words)
        draw_step(layout.row(align=True), "spectral_match.batch", icon="DUPLICATE")
        source = pair.shown(context).source
        if source is not None and count and not pair.matched(context):
            # After a match the panel Transfer shows it.
            draw_presets(layout)
            targets = [piece for target in pair.shown(context).targets for piece in target.pieces]
            transfer_panel.draw_kinds(context, layout, Bodies(source.pieces, targets))


CLASSES = (
    VIEW3D_UL_spectral_match_landmarks,
    VIEW3D_UL_spectral_match_source_pieces,
    VIEW3D_UL_spectral_match_target_pieces,
    VIEW3D_PT_spectral_match_presets,
    VIEW3D_PT_spectral_match,
    VIEW3D_PT_spectral_match_options,
    VIEW3D_PT_spectral_match_result,
    *notes_panel.CLASSES,
    VIEW3D_PT_spectral_match_pieces,
    VIEW3D_PT_spectral_match_fix,
    *transfer_panel.CLASSES,
    *outfit_panel.CLASSES,
    VIEW3D_PT_spectral_match_batch,
)
