# SPDX-License-Identifier: GPL-3.0-or-later
"""Remedies: what a button beside a refusal or a note does where Blender has no operator for it."""

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator

from .. import landmarks, mesh_read, mesh_write, pair
from ..mesh_read import UnusableObjectError
from ..transfer import others
from ..transfer.layouts import own_maps
from ..transfer.sheets import overlaps
from ..typed import Flags, Outcome
from .step import Step

# Between islands, as a share of the square: eight texels of an image 2048 wide, the margin that is baked.
ISLAND_MARGIN = 8 / 2048


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


class SPECTRAL_MATCH_OT_unwrap(OnObject, Operator):
    """Give this mesh, and others of its character in need of one, a new UV map by Smart UV Project"""

    bl_idname = "spectral_match.unwrap"
    bl_label = "Unwrap It"

    # Whether those are in need whose own map overlaps, instead of those that have none.
    overlapping: BoolProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act_on(self, obj: bpy.types.Object, context: bpy.types.Context) -> None:
        objects = context.view_layer.objects
        in_need = self._overlaps if self.overlapping else self._is_bare
        bare = [obj, *filter(in_need, _matched_with(obj, context))]
        for each in bare:
            if each.name not in objects or not each.visible_get():
                raise UnusableObjectError(f"'{each.name}' is hidden. Show it to unwrap it")
            mesh_read.check_usable(each, as_target=True)
        active, selected = objects.active, list(objects.selected)
        # All that are selected, or in Edit Mode already, would be unwrapped.
        with mesh_write.object_mode(context, [each for each in objects if each.type == "MESH"]):
            layers = {each: each.data.uv_layers.new(name="UVMap") for each in bare}
            full = next((each.name for each, layer in layers.items() if layer is None), None)
            if full is not None:
                for each, layer in layers.items():
                    if layer is not None:
                        each.data.uv_layers.remove(layer)
                raise UnusableObjectError(f"'{full}' has no room for one more UV map. Remove one")
            name = layers[obj].name
            for each in selected:
                each.select_set(False)
            try:
                for each, layer in layers.items():
                    each.data.uv_layers.active = layer
                    _unwrap(objects, each)
            finally:
                objects.active = active
                for each in selected:
                    each.select_set(True)
        who = f"'{obj.name}'{others(len(bare) - 1)}"
        self.tell({"INFO"}, f"{who} got the UV map '{name}'. Transfer again to bake into it")

    @staticmethod
    def _is_bare(obj: bpy.types.Object) -> bool:
        return not own_maps(obj.data)

    @staticmethod
    def _overlaps(obj: bpy.types.Object) -> bool:
        own, active = own_maps(obj.data), obj.data.uv_layers.active
        return bool(own) and overlaps(obj.data, active.name if active.name in own else own[0])


def _matched_with(obj: bpy.types.Object, context: bpy.types.Context) -> list[bpy.types.Object]:
    """The other meshes of a target of the pair that were matched with this one."""
    return [
        each
        for target in pair.matched(context)
        if obj in target.pieces
        for each in target.pieces
        if each != obj
    ]


def _unwrap(objects: bpy.types.LayerObjects, obj: bpy.types.Object) -> None:
    """Lay out all faces of a mesh, hidden ones too, in its active UV map."""
    objects.active = obj
    states = list(_states(obj.data))
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        bpy.ops.mesh.reveal()
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(island_margin=ISLAND_MARGIN)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        for elements, state, values in states:
            elements.foreach_set(state, values)


def _states(mesh: bpy.types.Mesh) -> Iterator[tuple[Any, str, Flags]]:
    """Which vertices, edges and faces are selected and hidden: (elements, name of the state, values)."""
    for elements in (mesh.vertices, mesh.edges, mesh.polygons):
        for state in ("select", "hide"):
            values = np.empty(len(elements), bool)
            elements.foreach_get(state, values)
            yield elements, state, values


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
    SPECTRAL_MATCH_OT_unwrap,
    SPECTRAL_MATCH_OT_remove_outdated,
)
