# SPDX-License-Identifier: GPL-3.0-or-later
"""Right-click ▸ Online Manual on a button leads to its panel's page, where the zip names a website."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import bpy

# Operators and properties by page.
PAGES = {
    "match": (
        *("match", "cancel", "pin", "swap_roles", "toggle_piece", "reset_pieces", "undress"),
        *("reset", "add_preset", "show_object", "unit_scale"),
    ),
    "result": ("show", "lines", "morph", "follow_pointer"),
    "fix": (
        "alternative",
        "swap_sides",
        "pick_landmarks",
        "remove_landmark",
        "remove_outdated",
        "go_to_landmark",
    ),
    "transfer": ("transfer", "compare", "toggle_item", "choose_items"),
    "outfit": ("fit_outfit", "toggle_worn", "choose_worn", "hide_worn", "closer_look"),
    "batch": ("batch",),
    "preferences": ("clear_cache",),
}


@cache
def website() -> str:
    """Where the manual is, with a slash at the end, or "" where the zip names none."""
    manifest = tomllib.loads((Path(__file__).parent / "blender_manifest.toml").read_text(encoding="utf-8"))
    address = manifest.get("website", "").rstrip("/")
    return address and f"{address}/"


def pages() -> tuple[str, tuple[tuple[str, str], ...]]:
    """What Blender asks for: a prefix, and (pattern of an operator, rest of the address)."""
    names = [
        (f"bpy.ops.spectral_match.{name}*", f"{page}.html")
        for page, operators in PAGES.items()
        for name in operators
    ]
    return (website(), tuple(names)) if website() else ("", ())


def draw_links(layout: bpy.types.UILayout) -> None:
    """Buttons to the manual and to the page for reports; none where the zip names no website."""
    if website():
        layout.operator("wm.url_open", text="Documentation", icon="HELP").url = f"{website()}index.html"
        layout.operator("wm.url_open", text="Report a Bug", icon="URL").url = f"{website()}report.html"


def register() -> None:
    bpy.utils.register_manual_map(pages)


def unregister() -> None:
    bpy.utils.unregister_manual_map(pages)
