# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: carry the checked data across stored matches."""

from bpy.props import StringProperty
from bpy.types import Operator

from .. import job as job_module
from .. import mesh_write, pair
from ..mesh_read import UnusableObjectError
from ..transfer import KINDS, carry_all


class SPECTRAL_MATCH_OT_transfer(Operator):
    """Carry the checked data from the source to every matched target"""

    bl_idname = "spectral_match.transfer"
    bl_label = "Transfer"
    bl_options = {"UNDO"}

    kinds: StringProperty(
        name="Kinds",
        description="For scripts: comma-separated kinds of data instead of the check boxes, of "
        + ", ".join(kind.identifier for kind in KINDS),
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        found = pair.resolve(context)
        if job_module.current is not None:
            cls.poll_message_set("A match is running. Wait for it, or press Esc to stop it")
            return False
        if not any(target.data.spectral_match.target_fingerprint for target in found.targets):
            cls.poll_message_set("Nothing is matched yet. Press Match first")
            return False
        return True

    def execute(self, context):
        found = pair.resolve(context)
        wanted = [name.strip() for name in self.kinds.split(",") if name.strip()]
        unknown = set(wanted) - {kind.identifier for kind in KINDS}
        if unknown:
            known = ", ".join(kind.identifier for kind in KINDS)
            self.report(
                {"ERROR"}, f"There is no kind of data named {', '.join(sorted(unknown))}. There are: {known}"
            )
            return {"CANCELLED"}
        notes, carried = [], 0
        for target in found.targets:
            try:
                sources = [target.spectral_match_source or found.source, target]
                with mesh_write.object_mode(context, sources):
                    notes += carry_all(context, target, wanted or None)
                carried += 1
            except UnusableObjectError as reason:
                notes.append(str(reason))
        for words in notes:
            self.report({"WARNING"} if carried else {"ERROR"}, words)
        if not carried:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Transferred to {carried} mesh{'es' if carried > 1 else ''}")
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_toggle_item(Operator):
    """Carry this over, or leave it behind"""

    bl_idname = "spectral_match.toggle_item"
    bl_label = "Carry Over"
    bl_options = {"UNDO", "INTERNAL"}

    item: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def execute(self, context):
        skipped = context.scene.spectral_match.skipped
        place = skipped.find(self.item)
        if place >= 0:
            skipped.remove(place)
        else:
            skipped.add().name = self.item
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_transfer, SPECTRAL_MATCH_OT_toggle_item)
