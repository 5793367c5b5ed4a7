# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages, by Blender's own means; English is the key of each text."""

import bpy

from .tooltip_table import TOOLTIPS
from .translation_table import TABLE

LANGUAGES = ("ja_JP", "zh_HANS")
# What Blender's own table has under another meaning, as Fix, is looked up among ours first.
OWN_CONTEXT = "Spectral Match"
# Buttons look their texts up among operators, all else without a context.
CONTEXTS = ("*", "Operator", OWN_CONTEXT)


def said(text, *values):
    """The text in the language of the interface, with values in its {}."""
    return bpy.app.translations.pgettext_iface(text).format(*values)


def register():
    tables = {
        language: {(context, row[0]): row[place] for row in (*TABLE, *TOOLTIPS) for context in CONTEXTS}
        for place, language in enumerate(LANGUAGES, start=1)
    }
    bpy.app.translations.register(__package__, tables)


def unregister():
    bpy.app.translations.unregister(__package__)
