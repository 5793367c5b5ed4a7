# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps where artists look for them: Object > Link/Transfer Data, and the right-click menu of objects."""

from __future__ import annotations

import bpy

from . import pair

MENUS = ("VIEW3D_MT_make_links", "VIEW3D_MT_object_context_menu")


def _draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    layout = menu.layout
    layout.separator()
    layout.operator_context = "INVOKE_DEFAULT"
    layout.operator("spectral_match.match", text="Match Characters", icon="MOD_DATA_TRANSFER")
    layout.operator("spectral_match.batch", text="Match Characters and Transfer", icon="DUPLICATE")
    if pair.matched(context):
        layout.operator("spectral_match.transfer", text="Transfer from Match", icon="IMPORT")
        layout.operator("spectral_match.fit_outfit", icon="MOD_CLOTH")


def _draw_on_characters(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The right-click menu is long already: nothing but where two characters are chosen."""
    if not pair.shown(context).missing:
        _draw(menu, context)


DRAWN = dict(zip(MENUS, (_draw, _draw_on_characters), strict=True))


def register() -> None:
    for name, draw in DRAWN.items():
        getattr(bpy.types, name).append(draw)


def unregister() -> None:
    for name, draw in DRAWN.items():
        getattr(bpy.types, name).remove(draw)
