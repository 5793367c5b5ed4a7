# SPDX-License-Identifier: GPL-3.0-or-later
"""Show a match in the viewport: as colours, or as a heat map of how sure it is."""

import bpy
from bpy.props import EnumProperty
from bpy.types import Operator

from .. import mesh_read, mesh_write, pair, preferences
from ..mesh_read import UnusableObjectError

# Colour attribute that was active before ours, by mesh session id, and the viewports' colouring before ours.
_earlier_active: dict[int, str] = {}
_earlier_colouring: dict[int, tuple] = {}


def _viewports(context):
    return [
        area.spaces.active
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def _activate(mesh, name):
    colours = mesh.color_attributes
    if name not in colours:
        return
    active = colours.active_color
    if active is not None and not active.name.startswith("match_"):
        _earlier_active[mesh.session_uid] = active.name
    colours.active_color = colours[name]


def _colour_viewports(context):
    for space in _viewports(context):
        _earlier_colouring.setdefault(space.as_pointer(), (space.shading.type, space.shading.color_type))
        space.shading.type = "SOLID"
        space.shading.color_type = "VERTEX"


def show_colours(context, source, targets):
    for obj in (source, *targets):
        _activate(obj.data, "match_color")
    _colour_viewports(context)


def show_confidence(context, source, targets):
    with mesh_write.object_mode(context, targets):
        for target in targets:
            mesh_write.write_heat(target.data)
            _activate(target.data, mesh_write.HEAT)
    _activate(source.data, "match_color")
    _colour_viewports(context)


def show_nothing(context, source, targets):
    for obj in (source, *targets):
        earlier = _earlier_active.pop(obj.data.session_uid, "")
        colours = obj.data.color_attributes
        if earlier in colours:
            colours.active_color = colours[earlier]
    for space in _viewports(context):
        space.shading.type, space.shading.color_type = _earlier_colouring.pop(
            space.as_pointer(), (space.shading.type, "MATERIAL")
        )


def show_after_match(context, source_uid, targets):
    """What the preferences ask for when a match is done."""
    source = mesh_read.find_object(bpy.data.objects, source_uid)
    wish = preferences.of(context).show_after_match
    if wish == "COLOURS":
        show_colours(context, source, targets)
    elif wish == "CONFIDENCE":
        show_confidence(context, source, targets)


class SPECTRAL_MATCH_OT_show(Operator):
    """Color the two meshes in the viewport"""

    bl_idname = "spectral_match.show"
    bl_label = "Show Match"
    bl_options = {"UNDO"}

    what: EnumProperty(
        name="Show",
        items=(
            ("COLOURS", "Colors", "Matching points of source and target have the same color"),
            ("CONFIDENCE", "Confidence", "Blue where the match is sure, yellow where it is not"),
            ("NOTHING", "Off", "Color the viewport as before"),
        ),
    )

    @classmethod
    def description(cls, _context, properties):
        return cls.bl_rna.properties["what"].enum_items[properties.what].description

    @classmethod
    def poll(cls, context):
        found = pair.resolve(context)
        if not any(target.data.spectral_match.target_fingerprint for target in found.targets):
            cls.poll_message_set("Nothing is matched yet. Press Match first")
            return False
        return True

    def execute(self, context):
        found = pair.resolve(context)
        matched = [target for target in found.targets if target.data.spectral_match.target_fingerprint]
        show = {"COLOURS": show_colours, "CONFIDENCE": show_confidence, "NOTHING": show_nothing}[self.what]
        try:
            show(context, found.source, matched)
        except (UnusableObjectError, KeyError) as reason:
            self.report({"ERROR"}, f"The match cannot be shown ({reason}). Match again")
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_show,)
