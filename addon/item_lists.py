# SPDX-License-Identifier: GPL-3.0-or-later
"""Items with check boxes as lists that Blender scrolls: what a source has of each kind, and what it wears.

A panel may change nothing while it is drawn: what it wants listed is noted, and is in the lists when it is
drawn next. They belong to the window manager, so that undo and files know nothing of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
from bpy.props import CollectionProperty, IntProperty
from bpy.types import PropertyGroup

from .drawing import panel_state
from .lines import Lines

# Names by list that a panel wanted listed when it was drawn.
_wanted: dict[str, tuple[str, ...]] = {}


class SPECTRAL_MATCH_PG_listed(PropertyGroup):
    """Something of the source; `name` is the one that it has there."""


class SPECTRAL_MATCH_PG_list(PropertyGroup):
    """The items of the list that `name` identifies, as of a kind of data, and which line is active."""

    entries: CollectionProperty(type=SPECTRAL_MATCH_PG_listed)
    line: IntProperty(name="Item")


class CheckedItems(Lines):
    """Items with check boxes, of which what is searched for in the panel leaves some."""

    # Where the panel keeps what is searched for.
    search: str
    # Rows that are shown at a time, unless the artist draws the list longer.
    most_rows: int

    @staticmethod
    def draw_box(context: bpy.types.Context, layout: bpy.types.UILayout, listed: str, name: str) -> None:
        """Draw the check box of an item of the list `listed`."""
        raise NotImplementedError

    @staticmethod
    def draw_choice(row: bpy.types.UILayout, listed: str, text: str, *, take: bool) -> None:
        """Draw the button that checks or unchecks all that the search finds."""
        raise NotImplementedError

    def draw_line(self, context: bpy.types.Context, layout: bpy.types.UILayout, data: Any, item: Any) -> None:
        self.draw_box(context, layout, data.name, item.name)

    def draw_filter(self, _context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        row = layout.row(align=True)
        row.prop(self, "use_filter_sort_alpha", text="Sort by Name", toggle=True)
        row.prop(self, "use_filter_sort_reverse", text="", icon="SORT_DESC")

    def filter_items(self, context: bpy.types.Context, data: Any, property: str) -> Any:
        entries = getattr(data, property)
        names = [entry.name for entry in entries]
        found = set(panel_state().found(names, self.search))
        flags = [self.bitflag_filter_item if name in found else 0 for name in names]
        by_name = bpy.types.UI_UL_list.sort_items_by_name(entries) if self.use_filter_sort_alpha else None
        return flags, by_name or []


class VIEW3D_UL_spectral_match_items(CheckedItems):
    """What the source has of a kind, as far as it goes."""

    search, most_rows = "item_search", 10

    @staticmethod
    def draw_box(context: bpy.types.Context, layout: bpy.types.UILayout, listed: str, name: str) -> None:
        row = layout.row()
        row.alignment = "LEFT"
        button = row.operator(
            "spectral_match.toggle_item",
            text=name,
            translate=False,
            icon="CHECKBOX_DEHLT" if context.scene.spectral_match.skips(listed, name) else "CHECKBOX_HLT",
            emboss=False,
        )
        button.item = f"{listed}/{name}"

    @staticmethod
    def draw_choice(row: bpy.types.UILayout, listed: str, text: str, *, take: bool) -> None:
        button = row.operator("spectral_match.choose_items", text=text)
        button.kind, button.take = listed, take


def draw(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    kind: type[CheckedItems],
    listed: str,
    names: Sequence[str],
) -> None:
    """Items in the list that `listed` identifies; where there are several in a box that scrolls, with a
    search.
    """
    if len(names) == 1:
        kind.draw_box(context, layout, listed, names[0])
        return
    # A row would give the search a third, in which a word has no room.
    tools = layout.split(factor=0.55, align=True)
    tools.prop(panel_state(), kind.search, text="", icon="VIEWZOOM")
    both = tools.row(align=True)
    kind.draw_choice(both, listed, "All", take=True)
    kind.draw_choice(both, listed, "None", take=False)
    held = bpy.context.window_manager.spectral_match_lists.get(listed)
    if held is None or [entry.name for entry in held.entries] != list(names):
        _want(listed, names)
    if not panel_state().found(names, kind.search):
        layout.label(text="No name with these letters")
    elif held is not None:
        rows = min(len(names), kind.most_rows)
        layout.template_list(kind.__name__, listed, held, "entries", held, "line", rows=rows)


def _want(listed: str, names: Sequence[str]) -> None:
    _wanted[listed] = tuple(names)
    if not bpy.app.timers.is_registered(bring_up_to_date):
        bpy.app.timers.register(bring_up_to_date, first_interval=0.0)


def bring_up_to_date() -> None:
    """Have the lists as panels wanted them, and the sidebars drawn with them."""
    manager = bpy.context.window_manager
    lists = manager.spectral_match_lists
    for listed, names in _wanted.items():
        held = lists.get(listed)
        if held is None:
            held = lists.add()
            held.name = listed
        held.entries.clear()
        for name in names:
            held.entries.add().name = name
        held.line = min(held.line, max(len(names) - 1, 0))
    _wanted.clear()
    for window in manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def forget() -> None:
    """Nothing is wanted any more."""
    _wanted.clear()
    if bpy.app.timers.is_registered(bring_up_to_date):
        bpy.app.timers.unregister(bring_up_to_date)


# Groups of properties first: the lists are made of them.
GROUPS = (SPECTRAL_MATCH_PG_listed, SPECTRAL_MATCH_PG_list)
CLASSES = (VIEW3D_UL_spectral_match_items,)
