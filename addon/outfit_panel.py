# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Fit Outfit: what the source wears, how it is fitted, and what came of it."""

from __future__ import annotations

import bpy
from bpy.types import Panel

from . import item_lists, notice, pair
from .drawing import BIG, MatchedSubPanel, draw_arrow, draw_option, draw_step, draw_words, icon_of
from .notes_panel import draw_message
from .operators.outfit import Clothes, clothes_of
from .outfit import live, wardrobe
from .translation import OWN_CONTEXT, said
from .typed import EnumItem, Settings

FIT = "spectral_match.fit_outfit"
# Of more targets than these it is not said what they wear, and of each no more pieces are named.
MOST_TARGETS, MOST_NAMES = 3, 3


class VIEW3D_UL_spectral_match_clothes(item_lists.CheckedItems):
    """What the source wears, of what may be worn."""

    search, most_rows = "worn_search", 5

    @staticmethod
    def draw_box(context: bpy.types.Context, layout: bpy.types.UILayout, listed: str, name: str) -> None:
        worn = any(obj.name == name for obj in clothes_of(pair.shown(context)).worn)
        row = layout.row()
        row.alignment = "LEFT"
        button = row.operator(
            "spectral_match.toggle_worn",
            text=name,
            icon="CHECKBOX_HLT" if worn else "CHECKBOX_DEHLT",
            emboss=False,
            translate=False,
        )
        button.garment = name

    @staticmethod
    def draw_choice(row: bpy.types.UILayout, listed: str, text: str, *, take: bool) -> None:
        row.operator("spectral_match.choose_worn", text=text).take = take


class VIEW3D_PT_spectral_match_outfit(MatchedSubPanel, Panel):
    bl_label = "Fit Outfit"
    bl_translation_context = OWN_CONTEXT
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.spectral_match
        found = pair.shown(context)
        if found.source is None:
            draw_words(context, layout, found.missing, "INFO")
            return
        # Above all whose height depends on what is worn and came, so that it stays under the pointer.
        row = layout.row(align=True)
        row.scale_y = BIG
        draw_step(row, FIT, icon="MOD_CLOTH")
        kept = live.kept_on(found.targets) if settings.outfit_inside else []
        if kept:
            self._draw_fitted(context, layout.box().column(), settings, found, kept)
        if FIT in notice.beside:
            draw_message(context, layout, *notice.beside[FIT], step=FIT)
        clothes = clothes_of(found)
        if len(clothes.wearer.whole) == 1 and not clothes.worn:
            words = "The source wears no objects of their own. Check it if it is an outfit without a body"
            draw_words(context, layout, words, "INFO")
        self._draw_worn(context, layout, clothes)
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(settings, "outfit_distance")
        column.prop(settings, "outfit_tightness", slider=True)
        keyed = any(piece.data.shape_keys for target in found.targets for piece in target.whole)
        draw_option(column, settings, "outfit_body_keys", works=keyed)
        draw_option(column, settings, "outfit_hide")

    @staticmethod
    def _draw_fitted(
        context: bpy.types.Context,
        box: bpy.types.UILayout,
        settings: Settings,
        found: pair.Pair,
        kept: live.Kept,
    ) -> None:
        copies = live.copies_of(kept)
        what = said("1 garment") if len(copies) == 1 else said("{} garments", len(copies))
        draw_words(context, box, said("Done: {}", what), "CHECKMARK", boxed=True)
        words = settings.outfit_inside
        icon: EnumItem = "INFO" if words == live.NOTHING_INSIDE else "ERROR"
        draw_words(context, box, words[:1].upper() + words[1:], icon, boxed=True)
        looked_at = live.looked_at(kept)
        box.operator("spectral_match.closer_look", icon="VIEWZOOM", depress=looked_at)
        if looked_at:
            draw_words(context, box, "Blue is as far as asked, yellow is inside", boxed=True, dim=True)
        for target in found.targets[:MOST_TARGETS]:
            own = wardrobe.replaced(target, live.copies_of(live.kept_on([target])))
            if own:
                words = f"'{target.name}' wears clothes of its own there. Hide what is in the way:"
                draw_words(context, box, words, "INFO", boxed=True, dim=True)
            column = box.column(align=True)
            for obj in own[:MOST_NAMES]:
                icon = "HIDE_OFF" if obj.visible_get() else "HIDE_ON"
                button = column.operator(
                    "spectral_match.hide_worn", text=obj.name, icon=icon, translate=False
                )
                button.name = obj.name
            if len(own) > MOST_NAMES:
                draw_words(context, box, f"and {len(own) - MOST_NAMES} more", boxed=True, dim=True)

    @staticmethod
    def _draw_worn(context: bpy.types.Context, layout: bpy.types.UILayout, clothes: Clothes) -> None:
        box = layout.box().column(align=True)
        row = box.row()
        is_open = draw_arrow(row, "open_outfit")
        row.label(text=clothes.wearer.name, icon=icon_of(clothes.wearer), translate=False)
        count = row.row()
        count.alignment = "RIGHT"
        count.active = False
        count.label(text=f"{len(clothes.worn)} / {len(clothes.others)}")
        if is_open and clothes.others:
            names = [obj.name for obj in clothes.others]
            item_lists.draw(context, box, VIEW3D_UL_spectral_match_clothes, "worn", names)


CLASSES = (VIEW3D_UL_spectral_match_clothes, VIEW3D_PT_spectral_match_outfit)
