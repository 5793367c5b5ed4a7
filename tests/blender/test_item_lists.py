# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of groups, keys and the like: what they show, and that drawing them changes nothing."""

from types import SimpleNamespace

import bpy
import pytest
from conftest import lumpy, new_object
from test_after_transfer import GROUPS

from addon import item_lists, transfer_panel
from addon.transfer import KINDS, Bodies

KIND = next(kind for kind in KINDS if kind.identifier == "groups")
FOUND = 1 << 30
LISTS = item_lists.VIEW3D_UL_spectral_match_items


class Layout:
    """Notes which lists are drawn, and lets all else be drawn too."""

    def __init__(self, lists):
        self._lists = lists

    def template_list(self, name, identifier, data, entries, *_rest, rows):
        self._lists.append((identifier, [entry.name for entry in getattr(data, entries)], rows))

    def __getattr__(self, name):
        return lambda *_given, **_more: Layout(self._lists)


@pytest.fixture
def source(scene):
    source = new_object("Source", *lumpy(3))
    for name in GROUPS:
        source.vertex_groups.new(name=name)
    folds = bpy.context.window_manager.spectral_match_panel
    folds.open_groups = True
    yield source
    folds.property_unset("open_groups")
    item_lists.forget()
    bpy.context.window_manager.spectral_match_lists.clear()


def drawn(source):
    lists = []
    transfer_panel.draw_kinds(bpy.context, Layout(lists), Bodies([source], []))
    return lists


def test_lists_follow_the_source_and_drawing_changes_nothing(source):
    lists = bpy.context.window_manager.spectral_match_lists
    for names in (GROUPS, GROUPS[:3]):
        while len(source.vertex_groups) > len(names):
            source.vertex_groups.remove(source.vertex_groups[len(names)])
        before = [(each.name, [entry.name for entry in each.entries]) for each in lists]
        drawn(source)
        assert [(each.name, [entry.name for entry in each.entries]) for each in lists] == before
        assert bpy.app.timers.is_registered(item_lists.bring_up_to_date)
        item_lists.bring_up_to_date()
        item_lists.forget()
        assert drawn(source) == [("groups", names, min(len(names), LISTS.most_rows))]
        # What is up to date is left alone.
        assert not bpy.app.timers.is_registered(item_lists.bring_up_to_date)


def test_undo_knows_nothing_of_folds_and_searches(source):
    """They stay as they are, whatever is undone."""
    bpy.ops.ed.undo_push(message="Before")
    source.location.x = 1.0
    bpy.ops.ed.undo_push(message="Move")
    panel = bpy.context.window_manager.spectral_match_panel
    panel.open_uv, panel.item_search = True, "bone"
    assert bpy.ops.ed.undo() == {"FINISHED"} and bpy.data.objects["Source"].location.x == 0.0
    panel = bpy.context.window_manager.spectral_match_panel
    assert (panel.open_uv, panel.open_groups, panel.item_search) == (True, True, "bone")
    panel.open_uv, panel.item_search = False, ""


def test_one_item_needs_no_list(source):
    for name in GROUPS[1:]:
        source.vertex_groups.remove(source.vertex_groups[name])
    assert not drawn(source) and not bpy.app.timers.is_registered(item_lists.bring_up_to_date)


def test_a_list_shows_what_the_search_finds(source, scene):
    drawn(source)
    item_lists.bring_up_to_date()
    (held,) = bpy.context.window_manager.spectral_match_lists
    shown = SimpleNamespace(bitflag_filter_item=FOUND, use_filter_sort_alpha=False, search="item_search")
    for letters in ("", "BONE 1", "nowhere"):
        bpy.context.window_manager.spectral_match_panel.item_search = letters
        flags, order = LISTS.filter_items(shown, bpy.context, held, "entries")
        found = [name for name, flag in zip(GROUPS, flags, strict=True) if flag == FOUND]
        assert found == [name for name in GROUPS if letters.lower() in name.lower()] and not order
    assert not drawn(source)
    shown.use_filter_sort_alpha = True
    bpy.context.window_manager.spectral_match_panel.item_search = ""
    _, order = LISTS.filter_items(shown, bpy.context, held, "entries")
    by_name = sorted(GROUPS, key=str.lower)
    assert [by_name.index(name) for name in GROUPS] == list(order)
