# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the user, not of a file."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy.types import AddonPreferences

from . import manual
from .prepared import Storage


class SPECTRAL_MATCH_preferences(AddonPreferences):
    bl_idname = __package__

    threads: IntProperty(
        name="Threads",
        default=0,
        min=0,
        max=1024,
        soft_max=64,
        description="Processor threads a match may use; 0 takes all. The result does not depend on it",
    )
    method: EnumProperty(
        name="Quality",
        items=(
            ("auto", "Best", "Search for the best map and refine it"),
            (
                "paper",
                "Published Method",
                "The published algorithm and nothing else: for comparison in research, less exact and slower",
            ),
        ),
        default="auto",
        description="How every match is computed",
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
    keep_shapes: BoolProperty(
        name="Keep Prepared Meshes",
        default=True,
        description="Keep what was computed of each mesh on disk, so that its next match starts half done, "
        "in another session too",
    )
    cache_folder: StringProperty(
        name="Cache Folder",
        subtype="DIR_PATH",
        description="Where prepared meshes are kept, in a sub-folder sgmds-shapes; other files there "
        "are left alone. Empty is a folder of this extension's own",
    )
    cache_gigabytes: FloatProperty(
        name="Cache Size (GB)",
        default=2.0,
        min=0.1,
        soft_max=50.0,
        precision=1,
        description="When prepared meshes take more than this, those used longest ago are removed. A mesh of "
        "20,000 vertices takes 0.013",
    )

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.prop(self, "threads")
        column.prop(self, "method")
        column.prop(self, "show_after_match")
        layout.separator()
        column = layout.column()
        column.prop(self, "keep_shapes")
        kept = column.column()
        kept.active = self.keep_shapes
        kept.prop(self, "cache_folder", placeholder=own_cache_folder())
        kept.prop(self, "cache_gigabytes")
        column.operator("spectral_match.clear_cache", icon="TRASH")
        manual.draw_links(layout)


class _Defaults:
    """What holds when the add-on was registered without being enabled, as tests and scripts do."""

    threads = 0
    method = "auto"
    show_after_match = "COLOURS"
    keep_shapes = False


def of(context: bpy.types.Context) -> SPECTRAL_MATCH_preferences | type[_Defaults]:
    addon = context.preferences.addons.get(__package__)
    return addon.preferences if addon is not None and addon.preferences is not None else _Defaults


def own_cache_folder() -> str:
    return bpy.utils.extension_path_user(__package__, path="prepared_meshes")


def storage(context: bpy.types.Context) -> Storage | None:
    """Where the user wants prepared shapes kept, or None."""
    wish = of(context)
    if not wish.keep_shapes:
        return None
    folder = bpy.path.abspath(wish.cache_folder) if wish.cache_folder else own_cache_folder()
    return Storage(folder, int(wish.cache_gigabytes * 2**30))


def register() -> None:
    bpy.utils.register_class(SPECTRAL_MATCH_preferences)


def unregister() -> None:
    bpy.utils.unregister_class(SPECTRAL_MATCH_preferences)
