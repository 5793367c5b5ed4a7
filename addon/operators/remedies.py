# SPDX-License-Identifier: GPL-3.0-or-later
"""Remedies: what a button beside a refusal or a note does where Blender has no operator for it."""

from typing import Any

import bpy
from bpy.props import StringProperty
from bpy.types import Operator

from .. import landmarks, pair
from ..mesh_read import UnusableObjectError
from ..typed import Outcome
from .step import Step


class OnObject(Step):
    """A step on the object of a name."""

    bl_options: set[Any] = {"UNDO", "INTERNAL"}

    name: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context: bpy.types.Context) -> Outcome:
        obj = bpy.data.objects.get(self.name)
        if obj is None:
            raise UnusableObjectError(f"There is no object named '{self.name}' any more")
        self.act_on(obj, context)
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_show_object(OnObject, Operator):
    """Show this object in the viewport, with the collections that it is in"""

    bl_idname = "spectral_match.show_object"
    bl_label = "Show It"

    def act_on(self, obj: bpy.types.Object, context: bpy.types.Context) -> None:
        for layer in _above(context.view_layer.layer_collection, obj):
            layer.exclude = layer.hide_viewport = layer.collection.hide_viewport = False
        obj.hide_viewport = False
        context.view_layer.update()
        if obj.name not in context.view_layer.objects:
            raise UnusableObjectError(f"'{obj.name}' is in another scene. Link it to this one")
        obj.hide_set(False)


def _above(layer: bpy.types.LayerCollection, obj: bpy.types.Object) -> list[bpy.types.LayerCollection]:
    """The layer collections on one way from this one down to an object; none if it is not below."""
    if obj.name in layer.collection.objects:
        return [layer]
    for child in layer.children:
        below = _above(child, obj)
        if below:
            return [layer, *below]
    return []


class SPECTRAL_MATCH_OT_unit_scale(OnObject, Operator):
    """Give this object the scale 1 along each axis that is scaled to nothing"""

    bl_idname = "spectral_match.unit_scale"
    bl_label = "Set Its Scale to 1"

    def act_on(self, obj: bpy.types.Object, _context: bpy.types.Context) -> None:
        if all(obj.scale[:]):
            raise UnusableObjectError(f"'{obj.name}' itself has a scale: its parent has none. Scale that")
        obj.scale = [factor or 1.0 for factor in obj.scale]


class SPECTRAL_MATCH_OT_remove_outdated(Step, Operator):
    """Remove the landmarks of this pair whose mesh got other vertices since they were picked"""

    bl_idname = "spectral_match.remove_outdated"
    bl_label = "Remove Outdated Landmarks"
    bl_options = {"UNDO", "INTERNAL"}

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        found = pair.resolve(context)
        of_all = [landmarks.of_pair(settings, found.source, target) for target in found.targets]
        # A landmark that is removed moves those after it: by name.
        for name in [mark.name for each in of_all for mark, ends in each if landmarks.outdated(ends)]:
            settings.landmarks.remove(settings.landmarks.find(name))
        settings.landmark_index = min(settings.landmark_index, len(settings.landmarks) - 1)
        return {"FINISHED"}


CLASSES = (
    SPECTRAL_MATCH_OT_show_object,
    SPECTRAL_MATCH_OT_unit_scale,
    SPECTRAL_MATCH_OT_remove_outdated,
)
