# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: carry the checked data across stored matches."""

from bpy.props import StringProperty
from bpy.types import Operator

from .. import character, core, mesh_read, mesh_write, pair, stored_match
from ..mesh_read import UnusableObjectError
from ..transfer import KINDS, TransferOptions, carry_all, checked, names_of
from .step import Step, needs_matched


def carry(context, source, targets, options, chosen):
    """`carry_all` in Object Mode to these meshes of a target, from the chosen source or, for None, from the
    one that they were matched with.

    Raises `UnusableObjectError`, also for what the core refuses; before it leaves the mode, if it can.
    """
    for target in targets:
        mesh_read.check_usable(target, as_target=True)
        stored_match.require(target, source)
    notes = []
    for together in stored_match.matched_together(targets):
        sources = [obj for obj, _, _ in stored_match.sources_of(together[0])]
        given = character.of(sources[0]) if len(sources) > 1 else character.alone(sources[0])
        with mesh_write.object_mode(context, [*sources, *together]):
            try:
                notes += carry_all(together, given.name, options, chosen)
            except core.load().SgmdsError as reason:
                raise UnusableObjectError(
                    f"Nothing was carried from '{given.label}' to '{together[0].name}': {reason}"
                ) from reason
    return notes


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
        notes, carried, most = [], 0, 0
        for target in found.targets:
            pieces = pair.matched_of(target) or target.pieces
            try:
                self._check_items(pieces)
                notes += carry(context, found.source, pieces, options, chosen)
                carried, most = carried + 1, max(most, len(pieces))
            except (UnusableObjectError, core.CoreMissingError) as reason:
                notes.append(str(reason))
        if not carried:
            return self.fail(" ".join(notes))
        self.warn(notes)
        what = ("mesh", "meshes") if most == 1 else ("character", "characters")
        self.report({"INFO"}, f"Transferred to {carried} {what[carried > 1]}")
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

    def _check_items(self, targets):
        """Raise `UnusableObjectError` when the target's source lacks an item that the script named."""
        items = self._items()
        sources = [obj for target in targets for obj, _, _ in stored_match.sources_of(target)]
        sources = [obj for obj in dict.fromkeys(sources) if character.is_there(obj)]
        if not items or not sources:
            return
        wanted = {item.partition("/")[0] for item in items}
        there = {
            f"{kind.identifier}/{name}"
            for kind in KINDS
            if kind.identifier in wanted
            for name in names_of(kind, sources)
        }
        if items - there:
            raise UnusableObjectError(f"'{sources[0].name}' does not have {', '.join(sorted(items - there))}")


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
