# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral Match: dense correspondences between two characters, and data carried across them."""

from __future__ import annotations

import atexit

import bpy

from . import (
    character,
    command_line,
    item_lists,
    manual,
    menus,
    notice,
    operators,
    overlay,
    pair,
    panels,
    preferences,
    prepared,
    properties,
    stored_match,
    translation,
)
from .operators import settings, show, step
from .outfit import live, wardrobe

_HANDLERS = (
    *stored_match.HANDLERS,
    *character.HANDLERS,
    *pair.HANDLERS,
    *overlay.HANDLERS,
    *notice.HANDLERS,
    *show.HANDLERS,
    *live.HANDLERS,
    *wardrobe.HANDLERS,
)


def register() -> None:
    translation.register()
    properties.register()
    preferences.register()
    for cls in (*operators.CLASSES, *panels.CLASSES):
        bpy.utils.register_class(cls)
    settings.register()
    for moment, handler in _HANDLERS:
        getattr(bpy.app.handlers, moment).append(handler)
    overlay.register()
    manual.register()
    menus.register()
    command_line.register()
    # Blender disables add-ons when it ends, but as a Python module it knows only those that it enabled. It
    # cannot free classes, properties and commands after Python has ended: it crashes, or waits for ever.
    atexit.register(unregister)


def unregister() -> None:
    atexit.unregister(unregister)
    step.end_all(bpy.context)
    command_line.unregister()
    menus.unregister()
    manual.unregister()
    overlay.unregister()
    for moment, handler in reversed(_HANDLERS):
        getattr(bpy.app.handlers, moment).remove(handler)
    settings.unregister()
    for cls in reversed((*operators.CLASSES, *panels.CLASSES)):
        bpy.utils.unregister_class(cls)
    preferences.unregister()
    properties.unregister()
    stored_match.forget()
    character.forget()
    prepared.forget()
    live.forget()
    wardrobe.forget()
    item_lists.forget()
    notice.clear()
    translation.unregister()
