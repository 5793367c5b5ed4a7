# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the user, not of a file."""

import bpy
from bpy.props import EnumProperty, IntProperty
from bpy.types import AddonPreferences


class SPECTRAL_MATCH_preferences(AddonPreferences):
    bl_idname = __package__

    threads: IntProperty(
        name="Threads",
        default=0,
        min=0,
        soft_max=64,
        description="Processor threads a match may use; 0 takes all. The result does not depend on it",
    )
    show_after_match: EnumProperty(
        name="After a Match",
        items=(
            ("COLOURS", "Show Colors", "Color both meshes so that matching points have the same color"),
            ("CONFIDENCE", "Show Confidence", "Color the targets by how sure the match is"),
            ("NOTHING", "Leave the View", "Do not touch the viewport"),
        ),
        default="COLOURS",
        description="What the viewport shows when a match is done",
    )

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "threads")
        layout.prop(self, "show_after_match")


class _Defaults:
    """What holds when the add-on was registered without being enabled, as tests and scripts do."""

    threads = 0
    show_after_match = "COLOURS"


def of(context):
    addon = context.preferences.addons.get(__package__)
    return addon.preferences if addon is not None and addon.preferences is not None else _Defaults


def register():
    bpy.utils.register_class(SPECTRAL_MATCH_preferences)


def unregister():
    bpy.utils.unregister_class(SPECTRAL_MATCH_preferences)
