# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: carry the checked data across stored matches."""

from bpy.props import StringProperty
from bpy.types import Operator

from .. import core, mesh_read, mesh_write, pair, stored_match
from ..mesh_read import UnusableObjectError
from ..transfer import KINDS, TransferOptions, carry_all, checked
from .step import Step, needs_matched


def carry(context, source, target, options, chosen):
    """`carry_all` in Object Mode, from the chosen source or, for None, from the one that it was matched with.

    Raises `UnusableObjectError`, also for what the core refuses; before it leaves the mode, if it can.
    """
    mesh_read.check_usable(target, as_target=True)
    stored_match.require(target, source)
    with mesh_write.object_mode(context, [target.spectral_match_source, target]):
        try:
            return carry_all(target, options, chosen)
        except core.load().SgmdsError as reason:
            raise UnusableObjectError(
                f"Nothing was carried from '{target.spectral_match_source.name}' to '{target.name}': {reason}"
            ) from reason


class GivenOptions:
    """An operator's options where a script gave them, else those of the scene."""

    def __init__(self, operator, settings):
        self._operator, self._settings = operator, settings

    def __getattr__(self, name):
        given = self._operator.properties.is_property_set(name)
        return getattr(self._operator if given else self._settings, name)


class SPECTRAL_MATCH_OT_transfer(TransferOptions, Step, Operator):
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

    obstacle = staticmethod(needs_matched)

    def act(self, context):
        found = pair.resolve(context)
        settings = context.scene.spectral_match
        options = GivenOptions(self, settings)
        chosen = self._choice(settings)
        notes, carried = [], 0
        for target in found.targets:
            try:
                self._check_items(target)
                notes += carry(context, found.source, target, options, chosen)
                carried += 1
            except (UnusableObjectError, core.CoreMissingError) as reason:
                notes.append(str(reason))
        if not carried:
            return self.fail(" ".join(notes))
        self.warn(notes)
        self.report({"INFO"}, f"Transferred to {carried} mesh{'es' if carried > 1 else ''}")
        return {"FINISHED"}

    def _choice(self, settings):
        """Which items go: those named by the script, those of its kinds, or those checked in the panel."""
        known = [kind.identifier for kind in KINDS]
        items = self._items()
        kinds = {name.strip() for name in self.kinds.split(",") if name.strip()}
        unknown = (kinds | {item.partition("/")[0] for item in items}) - set(known)
        if unknown:
            raise UnusableObjectError(
                f"There is no kind of data named {', '.join(sorted(unknown))}. There are: {', '.join(known)}"
            )

        if not items and not kinds:
            return checked(settings)
        return lambda kind, name: kind.identifier in kinds or f"{kind.identifier}/{name}" in items

    def _items(self):
        return {line.strip() for line in self.items.splitlines() if line.strip()}

    def _check_items(self, target):
        """Raise `UnusableObjectError` when the target's source lacks an item that the script named."""
        source = target.spectral_match_source
        items = self._items()
        if not items or not pair.is_there(source):
            return
        wanted = {item.partition("/")[0] for item in items}
        there = {
            f"{kind.identifier}/{name}"
            for kind in KINDS
            if kind.identifier in wanted
            for name in kind.names(source)
        }
        if items - there:
            raise UnusableObjectError(f"'{source.name}' does not have {', '.join(sorted(items - there))}")


class SPECTRAL_MATCH_OT_toggle_item(Step, Operator):
    """Carry this over, or leave it behind"""

    bl_idname = "spectral_match.toggle_item"
    bl_label = "Carry Over"
    bl_options = {"UNDO", "INTERNAL"}

    item: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context):
        skipped = context.scene.spectral_match.skipped
        place = skipped.find(self.item)
        if place >= 0:
            skipped.remove(place)
        else:
            skipped.add().name = self.item
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_transfer, SPECTRAL_MATCH_OT_toggle_item)
