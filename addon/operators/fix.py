# SPDX-License-Identifier: GPL-3.0-or-later
"""Fix: exchange the roles, take another of the maps found, exchange left and right."""

from bpy.props import IntProperty
from bpy.types import Operator

from .. import mesh_read, mesh_write, pair, stored_match
from ..mesh_read import UnusableObjectError
from .match import MatchOperator


class SPECTRAL_MATCH_OT_swap_roles(Operator):
    """Exchange source and target: the other mesh gives the data"""

    bl_idname = "spectral_match.swap_roles"
    bl_label = "Swap Source and Target"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        found = pair.resolve(context)
        if found.source is None or len(found.targets) != 1:
            cls.poll_message_set("Needs one source and one target")
            return False
        return True

    def execute(self, context):
        settings = context.scene.spectral_match
        found = pair.resolve(context)
        if settings.pinned:
            settings.source, settings.target = settings.target, settings.source
            return {"FINISHED"}
        for obj in (found.source, found.targets[0]):
            if obj.name not in context.view_layer.objects:
                self.report(
                    {"ERROR"},
                    f"'{obj.name}' is not in this view layer. Pin both objects to choose them by name",
                )
                return {"CANCELLED"}
            obj.select_set(True)
        context.view_layer.objects.active = found.targets[0]
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_pin(Operator):
    """Keep this source and this target whatever is selected, or let the selection decide again"""

    bl_idname = "spectral_match.pin"
    bl_label = "Pin Source and Target"
    bl_options = {"UNDO", "INTERNAL"}

    def execute(self, context):
        settings = context.scene.spectral_match
        if not settings.pinned:
            found = pair.resolve(context)
            settings.source = found.source
            settings.target = found.targets[0] if found.targets else None
        settings.pinned = not settings.pinned
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_alternative(Operator):
    """Take the next of the maps that the match found. Useful when limbs, or front and back, are exchanged"""

    bl_idname = "spectral_match.alternative"
    bl_label = "Next Alternative"
    bl_options = {"UNDO"}

    step: IntProperty(name="Step", default=1, description="1 for the next map, -1 for the previous one")

    @classmethod
    def poll(cls, context):
        found = pair.resolve(context)
        if len(found.targets) != 1:
            cls.poll_message_set("Choose one matched target")
            return False
        known = stored_match.maps_of_mesh.get(found.targets[0].data.session_uid)
        if known is None:
            cls.poll_message_set("Alternatives are not saved with the file. Match again to find them")
            return False
        if len(known.maps) < 2:
            cls.poll_message_set("The match found no other plausible map. Add landmarks to steer it")
            return False
        return True

    def execute(self, context):
        target = pair.resolve(context).targets[0]
        known = stored_match.maps_of_mesh[target.data.session_uid]
        try:
            stored = stored_match.require(target)
            source = target.spectral_match_source
            if mesh_read.fingerprint(source.data) != known.source.fingerprint:
                raise UnusableObjectError(f"'{source.name}' was changed since the match. Match again")
            if mesh_read.fingerprint(target.data) != known.target.fingerprint:
                raise UnusableObjectError(f"'{target.name}' was changed since the match. Match again")
            chosen = (stored.alternative + self.step) % len(known.maps)
            with mesh_write.object_mode(context, [source, target]):
                mesh_write.write_match(source, target, known.source, known.target, known.maps[chosen])
        except UnusableObjectError as reason:
            self.report({"ERROR"}, str(reason))
            return {"CANCELLED"}
        target.data.spectral_match.alternative = chosen
        self.report({"INFO"}, f"Map {chosen + 1} of {len(known.maps)}, grade {stored.grade}")
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_swap_sides(MatchOperator, Operator):
    """Match again, this time to the map that exchanges left and right"""

    bl_idname = "spectral_match.swap_sides"
    bl_label = "Swap Left and Right"
    bl_options = {"UNDO"}

    def wants_swapped_sides(self, context):
        return not pair.resolve(context).targets[0].data.spectral_match.swapped_sides


CLASSES = (
    SPECTRAL_MATCH_OT_swap_roles,
    SPECTRAL_MATCH_OT_pin,
    SPECTRAL_MATCH_OT_alternative,
    SPECTRAL_MATCH_OT_swap_sides,
)
