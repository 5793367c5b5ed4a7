# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: carry the checked data across stored matches."""

from bpy.props import StringProperty
from bpy.types import Operator

from .. import core, mesh_write, pair
from .. import job as job_module
from ..mesh_read import UnusableObjectError
from ..transfer import KINDS, TransferOptions, carry_all, checked


class GivenOptions:
    """An operator's options where a script gave them, else those of the scene."""

    def __init__(self, operator, settings):
        self._operator, self._settings = operator, settings

    def __getattr__(self, name):
        given = self._operator.properties.is_property_set(name)
        return getattr(self._operator if given else self._settings, name)


class SPECTRAL_MATCH_OT_transfer(TransferOptions, Operator):
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
    items: StringProperty(
        name="Items",
        description="For scripts: what to carry, an item a line, each kind/name, for example groups/Hand.L",
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
        settings = context.scene.spectral_match
        options = GivenOptions(self, settings)
        try:
            chosen = self._choice(settings)
        except UnusableObjectError as reason:
            self.report({"ERROR"}, str(reason))
            return {"CANCELLED"}
        notes, carried = [], 0
        for target in found.targets:
            try:
                sources = [target.spectral_match_source or found.source, target]
                with mesh_write.object_mode(context, sources):
                    notes += carry_all(target, options, chosen)
                carried += 1
            except (UnusableObjectError, core.CoreMissingError) as reason:
                notes.append(str(reason))
        for words in notes:
            self.report({"WARNING"} if carried else {"ERROR"}, words)
        if not carried:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Transferred to {carried} mesh{'es' if carried > 1 else ''}")
        return {"FINISHED"}

    def _choice(self, settings):
        """Which items go: those named by the script, those of its kinds, or those checked in the panel."""
        known = [kind.identifier for kind in KINDS]
        items = {line.strip() for line in self.items.splitlines() if line.strip()}
        kinds = {name.strip() for name in self.kinds.split(",") if name.strip()}
        unknown = (kinds | {item.partition("/")[0] for item in items}) - set(known)
        if unknown:
            raise UnusableObjectError(
                f"There is no kind of data named {', '.join(sorted(unknown))}. There are: {', '.join(known)}"
            )

        if not items and not kinds:
            return checked(settings)
        return lambda kind, name: kind.identifier in kinds or f"{kind.identifier}/{name}" in items


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
