# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer: carry the checked data across stored matches."""

from collections.abc import Generator, Iterable, Sequence
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator

from .. import character, core, drawing, mesh_read, mesh_write, notice, pair, stored_match
from ..job import Job
from ..mesh_read import UnusableObjectError
from ..transfer import (
    KINDS,
    LASTING,
    Carried,
    TransferAdjustments,
    carry_all,
    checked,
    has_effect,
    names_of,
    said_of_targets,
)
from ..translation import said
from ..typed import Chosen, Options, Outcome, Settings
from . import show
from .running import JobOperator
from .step import Step, needs_matched

if TYPE_CHECKING:
    from ..character import Character

# What Adjust Last Operation can change after a transfer.
ADJUSTED = tuple(TransferAdjustments.__annotations__)


def carry(
    context: bpy.types.Context,
    source: "Character | bpy.types.Object | None",
    targets: Sequence[bpy.types.Object],
    options: "Options",
    chosen: "Chosen",
) -> Generator[tuple[float, str], None, Carried]:
    """`carry_all`, a generator too, in Object Mode to these meshes of a target, from the chosen source or,
    for None, from the one that they were matched with.

    Raises `UnusableObjectError`, also for what the core refuses; before it leaves the mode, if it can.
    """
    for target in targets:
        mesh_read.check_usable(target, as_target=True)
        stored_match.require(target, source)
    brought = Carried()
    for together in stored_match.matched_together(targets):
        sources = [obj for obj, _, _ in stored_match.sources_of(together[0])]
        given = character.of(sources[0]) if len(sources) > 1 else character.alone(sources[0])
        with mesh_write.object_mode(context, [*sources, *together]):
            try:
                brought.add((yield from carry_all(together, given.name, options, chosen)))
            except core.load().SgmdsError as reason:
                why = core.explain(reason)
                raise UnusableObjectError(
                    f"Nothing was carried from '{given.label}' to '{together[0].name}': {why}"
                ) from reason
    return brought


def _of_many(
    going: Generator[tuple[float, str], None, Carried], number: int, many: int
) -> Generator[tuple[float, str], None, Carried]:
    """Steps of one target among several, and their value."""
    while True:
        try:
            share, words = next(going)
        except StopIteration as end:
            return end.value
        yield (number + share) / many, words


def done_words(brought: Carried, meshes: Sequence[int]) -> str:
    """Words such as "Done: 41 groups, rig", and to how many targets, of so many meshes each, if several."""
    what = brought.summary() or said("nothing to carry")
    if len(meshes) == 1:
        return said("Done: {}", what)
    if max(meshes) > 1:
        return said("Done to {} characters: {}", len(meshes), what)
    return said("Done to {} meshes: {}", len(meshes), what)


class GivenOptions:
    """An operator's options where a script or Adjust Last Operation gave them, else those of the scene."""

    def __init__(self, operator: Operator, settings: "Settings") -> None:
        self._operator, self._settings = operator, settings

    def __getattr__(self, name: str) -> Any:
        given = name in ADJUSTED and self._operator.properties.is_property_set(name)
        return getattr(self._operator if given else self._settings, name)


class TransferJob(Job):
    """What a transfer did, which it does in the main thread before."""

    def _work(self, _sgmds: ModuleType) -> None:
        """Nothing is left to do."""


class SPECTRAL_MATCH_OT_transfer(TransferAdjustments, JobOperator, Operator):
    """Carry the checked data from the source to every matched target"""

    bl_idname = "spectral_match.transfer"
    bl_label = "Transfer"
    bl_options = {"REGISTER", "UNDO"}

    stands_for = bl_idname
    # Nothing may change between its steps.
    blocks = True
    lasting = LASTING

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

    def begin(self, context: bpy.types.Context) -> Generator[tuple[float, str], None, Job]:
        found = pair.resolve(context)
        settings = context.scene.spectral_match
        if self.options.is_repeat:
            self._keep(settings)
        options = GivenOptions(self, settings)
        chosen = self._choice(options)
        self._brought, self._done, told = Carried(), [], []
        for number, target in enumerate(found.targets):
            pieces, names = pair.matched_of(target) or target.pieces, character.names_in(target)
            try:
                self._check_items(pieces)
                going = carry(context, found.source, pieces, options, chosen)
                brought = yield from _of_many(going, number, len(found.targets))
            except (UnusableObjectError, core.CoreMissingError) as reason:
                told.append((names, [str(reason)]))
            else:
                self._brought.add(brought)
                self._done.append(pieces)
                told.append((names, brought.notes))
        notes = said_of_targets(told)
        if not self._done:
            raise UnusableObjectError("\n".join(notes))
        self._brought.notes = notes
        return TransferJob()

    def conclude(self, context: bpy.types.Context, job: Job) -> Outcome:
        if not self._done:
            return self.stopped("Transfer stopped; nothing was changed")
        done = partial(done_words, self._brought, [len(pieces) for pieces in self._done])
        targets = [obj for pieces in self._done for obj in pieces]
        show.show_after_transfer(context, targets, self._brought)
        self.tell({"INFO"}, ("Stopped.\n" if job.cancelling else "") + done())
        self._offer(context.scene.spectral_match)
        notice.finish(context, targets, done, self._brought.notes)
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Adjust Last Operation: the kinds that the source has, and under each how it was carried."""
        pieces = pair.matched_pieces(context)
        sources = [obj for piece in pieces for obj, _, _ in stored_match.sources_of(piece)]
        sources = list(filter(character.is_there, dict.fromkeys(sources)))
        layout = self.layout
        layout.use_property_decorate = False
        for kind in KINDS:
            if not names_of(kind, sources):
                continue
            column, use = layout.column(align=True), f"use_{kind.identifier}"
            if not (self.kinds or self.items):
                column.prop(self, use)
            options = column.column(align=True)
            options.use_property_split = True
            for name in kind.options if getattr(self, use) else ():
                row = options.row()
                row.active = has_effect(name, self, None)
                row.prop(self, name)

    def _offer(self, settings: "Settings") -> None:
        """Have Adjust Last Operation begin with what was done."""
        done = GivenOptions(self, settings)
        for name in ADJUSTED:
            setattr(self, name, getattr(done, name))

    def _keep(self, settings: "Settings") -> None:
        """What was chosen in Adjust Last Operation is what the panel shows."""
        for name in ADJUSTED:
            setattr(settings, name, getattr(self, name))

    def _choice(self, options: "Options") -> "Chosen":
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
            return checked(options)
        return lambda kind, name: kind.identifier in kinds or f"{kind.identifier}/{name}" in items

    def _items(self) -> set[str]:
        return {line.strip() for line in self.items.splitlines() if line.strip()}

    def _check_items(self, targets: Iterable[bpy.types.Object]) -> None:
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

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        kind, _, name = self.item.partition("/")
        settings.skip(kind, name, not settings.skips(kind, name))
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_choose_items(Step, Operator):
    """Carry over, or leave behind, all that the search finds"""

    bl_idname = "spectral_match.choose_items"
    bl_label = "Choose All or None"
    bl_options = {"UNDO", "INTERNAL"}

    kind: StringProperty(options={"SKIP_SAVE", "HIDDEN"})
    take: BoolProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        kind = next(kind for kind in KINDS if kind.identifier == self.kind)
        pieces = pair.matched_pieces(context)
        sources = dict.fromkeys(obj for piece in pieces for obj, _, _ in stored_match.sources_of(piece))
        listed = list(filter(character.is_there, sources)) or pair.resolve(context).source_pieces
        for name in drawing.panel_state().found(names_of(kind, listed)):
            settings.skip(self.kind, name, not self.take)
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_transfer, SPECTRAL_MATCH_OT_toggle_item, SPECTRAL_MATCH_OT_choose_items)
