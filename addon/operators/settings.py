# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: presets, defaults, the folder of prepared meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bpy.types import Menu, Operator

from .. import preferences, prepared
from ..mesh_read import UnusableObjectError
from ..transfer import TransferKinds, TransferOptions
from ..translation import OWN_CONTEXT, spoken
from ..typed import Outcome
from .step import Step

FOLDER = Path(__file__).resolve().parents[1]
PRESETS = "spectral_match"
# What belongs to a pair of objects or to the panel's looks stays.
PRESET_NAMES = (
    "whole_characters",
    "shape",
    "part",
    "allow_mirror",
    "same_axes",
    *TransferKinds.__annotations__,
    *TransferOptions.__annotations__,
)


def shown_name(name: str) -> str:
    """The name of a preset, or of their menu, in the language of the interface.

    Blender itself would take Face for one of a mesh.
    """
    translations: Any = bpy.app.translations
    found: str = translations.pgettext_iface(name, OWN_CONTEXT)
    return found


def shipped() -> dict[str, str]:
    """Names of the presets that come with the extension, by what they are called in the interface."""
    names = [bpy.path.display_name(path.name) for path in (FOLDER / "presets" / PRESETS).glob("*.py")]
    return {shown_name(name): name for name in names}


def _name_of(path: str) -> str:
    name = bpy.path.display_name(path, title_case=False)
    return shown_name(name) if Path(path).is_relative_to(FOLDER) else name


def path_menu(menu: Menu, paths: list[str] | None, operator: str | None, **keywords: Any) -> None:
    """As Blender fills a menu or panel of presets, with our names."""
    Menu.path_menu(menu, paths, operator, **{**keywords, "display_name": _name_of})


class SPECTRAL_MATCH_MT_presets(Menu):
    bl_label = "Presets"
    preset_subdir = PRESETS
    preset_operator = "script.execute_preset"

    def draw(self, context: bpy.types.Context) -> None:
        self.draw_preset(context)

    def path_menu(self, searchpaths: list[str] | None, operator: str | None, **keywords: Any) -> None:
        path_menu(self, searchpaths, operator, **keywords)


def draw_presets(layout: bpy.types.UILayout) -> None:
    """The menu of the presets, by the name of the last one chosen."""
    label = shown_name(SPECTRAL_MATCH_MT_presets.bl_label)
    layout.menu("SPECTRAL_MATCH_MT_presets", text=label, translate=False)


class SPECTRAL_MATCH_OT_add_preset(AddPresetBase, Operator):
    """Keep the settings of match and transfer under a name, or remove the chosen preset"""

    bl_idname = "spectral_match.add_preset"
    bl_label = "Add Preset"
    preset_menu = "SPECTRAL_MATCH_MT_presets"
    preset_subdir = PRESETS
    preset_defines = ["settings = bpy.context.scene.spectral_match"]
    preset_values = [f"settings.{name}" for name in PRESET_NAMES]

    def execute(self, context: bpy.types.Context) -> Outcome:
        # The base's property, which the stubs take for the name of an operator.
        own: Any = self
        own.name = shipped().get(own.name, own.name)
        removed = bpy.utils.preset_find(own.name, PRESETS, display_name=True)
        if (self.remove_name or self.remove_active) and removed and Path(removed).is_relative_to(FOLDER):
            self.report({"ERROR"}, spoken(f"The preset '{own.name}' comes with the extension and stays"))
            return {"CANCELLED"}
        return super().execute(context)


class SPECTRAL_MATCH_OT_reset(Step, Operator):
    """Set everything about match and transfer back to its default. Objects, landmarks and matches stay"""

    bl_idname = "spectral_match.reset"
    bl_label = "Reset to Defaults"
    bl_options = {"UNDO"}

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        for name in PRESET_NAMES:
            settings.property_unset(name)
        settings.skipped.clear()
        SPECTRAL_MATCH_MT_presets.bl_label = "Presets"
        self.tell({"INFO"}, "Settings of match and transfer are the defaults again")
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_clear_cache(Step, Operator):
    """Remove all prepared meshes from the cache folder. The next match of each mesh takes its full time"""

    bl_idname = "spectral_match.clear_cache"
    bl_label = "Clear Cache"
    bl_options = {"INTERNAL"}

    def act(self, context: bpy.types.Context) -> Outcome:
        prepared.forget()
        storage = preferences.storage(context)
        if storage is None:
            raise UnusableObjectError("No meshes are kept on disk: Keep Prepared Meshes is off")
        try:
            freed = prepared.clear(storage)
        except OSError as reason:
            raise UnusableObjectError(f"The cache cannot be cleared: {reason}") from reason
        self.tell({"INFO"}, f"{freed / 1e6:.1f} MB freed; no prepared meshes are left in {storage.folder}")
        return {"FINISHED"}


CLASSES = (
    SPECTRAL_MATCH_MT_presets,
    SPECTRAL_MATCH_OT_add_preset,
    SPECTRAL_MATCH_OT_reset,
    SPECTRAL_MATCH_OT_clear_cache,
)


def register() -> None:
    bpy.utils.register_preset_path(str(FOLDER))


def unregister() -> None:
    bpy.utils.unregister_preset_path(str(FOLDER))
