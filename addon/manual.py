# SPDX-License-Identifier: GPL-3.0-or-later
"""Right-click ▸ Online Manual on a button leads to its panel's page, where the zip names a website."""

import tomllib
from pathlib import Path

import bpy

# Operators and properties by page.
PAGES = {
    "match": (
        *("match", "cancel", "pin", "swap_roles", "toggle_piece", "reset_pieces"),
        *("reset", "add_preset"),
    ),
    "result": ("show", "lines", "morph"),
    "fix": ("alternative", "swap_sides", "pick_landmarks", "remove_landmark", "go_to_landmark"),
    "transfer": ("transfer", "toggle_item"),
    "batch": ("batch",),
    "preferences": ("clear_cache",),
}


def pages():
    """What Blender asks for: a prefix, and (pattern of an operator, rest of the address)."""
    manifest = tomllib.loads((Path(__file__).parent / "blender_manifest.toml").read_text(encoding="utf-8"))
    names = [
        (f"bpy.ops.spectral_match.{name}*", f"{page}.html")
        for page, operators in PAGES.items()
        for name in operators
    ]
    website = manifest.get("website")
    return (website.rstrip("/") + "/", tuple(names)) if website else ("", ())


def register():
    bpy.utils.register_manual_map(pages)


def unregister():
    bpy.utils.unregister_manual_map(pages)
