# SPDX-License-Identifier: GPL-3.0-or-later
"""Match: read the objects, have the job run beside the window, write what it found."""

from collections.abc import Generator, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator

from .. import (
    character,
    completion,
    core,
    figure,
    laid_over,
    landmarks,
    mesh_read,
    mesh_write,
    morph,
    notice,
    pair,
    preferences,
    stored_match,
    wording,
)
from .. import job as job_module
from ..character import Character
from ..job import MatchJob, MatchOptions
from ..mesh_read import UnusableObjectError, find_object, value_of
from ..outfit import wardrobe
from ..transfer import Carried, checked, said_of_targets
from ..transfer.listed import listed
from ..typed import Outcome
from . import show
from .carry import carry, done_words
from .running import JobOperator, redraw_sidebars
from .step import Step, needs_pair, nothing

if TYPE_CHECKING:
    from ..job import Failed, Job
    from ..mesh_read import Surface


def reading(
    context: bpy.types.Context,
    source: Character | bpy.types.Object,
    targets: Sequence[Character | bpy.types.Object],
    *,
    swap_sides: bool = False,
) -> Generator[None, None, MatchJob]:
    """Read the objects in short steps, so that the window lives on; the generator's value is the job."""
    settings = context.scene.spectral_match
    evaluated = settings.shape == "EVALUATED"
    wish = preferences.of(context)
    options = MatchOptions(
        method=wish.method,
        part={"AUTO": None, "SOURCE": "source", "TARGET": "target"}[settings.part],
        mirror="allow" if settings.allow_mirror else "forbid",
        same_axes=settings.same_axes,
        threads=wish.threads or None,
        swap_sides=swap_sides,
        storage=preferences.storage(context),
    )
    giver, *takers = (
        body if isinstance(body, Character) else character.alone(body) for body in (source, *targets)
    )
    bodies = [piece for body in (giver, *takers) for piece in body.pieces]
    for piece in bodies:
        mesh_read.check_usable(piece, as_target=piece not in giver.pieces)
    rigs = dict.fromkeys(filter(None, (character.held_by_bone(piece)[0] for piece in bodies)))
    mesh_read.place(
        context, [seen for obj in bodies for seen in (obj, *completion.mirror_objects(obj))] + list(rigs)
    )
    # All questions to objects and settings come before the first step: they may be gone after it.
    wanted: dict[int, figure.Reading] = {}
    pairs: dict[int, list[tuple[int, int]]] = {}
    left_out = {giver.lead.session_uid: [obj.session_uid for obj in giver.left_out]}
    notes = []
    for each in takers:
        target, words = _writable(giver, each)
        notes += words
        if target is not None:
            pairs.setdefault(target.lead.session_uid, landmarks.vertex_pairs(settings, giver, target))
            left_out.setdefault(target.lead.session_uid, [obj.session_uid for obj in target.left_out])
            wanted.setdefault(target.lead.data.session_uid, figure.Reading(target, evaluated, as_target=True))
    source_surface = yield from figure.Reading(giver, evaluated).steps(context)
    surfaces = []
    for way in wanted.values():
        surfaces.append((yield from way.steps(context)))
        yield
    job = MatchJob(source_surface, surfaces, options, pairs, left_out)
    job.notes += notes
    return job


def _writable(source: Character, target: Character) -> tuple[Character | None, list[str]]:
    """The target with the pieces whose meshes a match can be written to, or None, and words on others."""
    holder = {piece.data: piece.name for piece in reversed(source.pieces)}
    kept, notes = [], []
    for piece in target.pieces:
        if piece.data in holder:
            notes.append(f"'{piece.name}' was left out: it shares the mesh of '{holder[piece.data]}'")
        else:
            kept.append(piece)
            holder[piece.data] = piece.name
    return (replace(target, pieces=tuple(kept)) if kept else None), notes


def store(context: bpy.types.Context, job: MatchJob) -> tuple[list[bpy.types.Object], list[str]]:
    """Write a finished job's maps to its targets; returns all meshes of these and words on those that could
    not.
    """
    sources = find_unchanged(job.source)
    stored, trouble = [], [failure_words(failed) for failed in job.failures]
    for matched in job.results:
        try:
            targets = find_unchanged(matched.target)
            with mesh_write.object_mode(context, [*sources, *targets]):
                mesh_write.write_match(sources, targets, job.source, matched.target, matched.found)
                laid_over.refresh(targets)
        except UnusableObjectError as reason:
            trouble.append(str(reason))
            continue
        for target in targets:
            note = target.data.spectral_match
            note.seconds = matched.seconds
            note.alternative, note.alternatives = 0, 1 + matched.found.alternative_count
            note.swapped_sides = job.options.swap_sides
        _forget_left_out(context, job, matched.target, sources, targets)
        stored_match.keep_maps(
            [target.data for target in targets],
            stored_match.SessionMaps(job.source, matched.target, matched.found),
        )
        for obj in (*sources, *targets):
            stored_match.forget_fingerprint(obj.data)
        stored += targets
    return stored, trouble


def _forget_left_out(
    context: bpy.types.Context,
    job: MatchJob,
    target: "Surface",
    sources: Sequence[bpy.types.Object],
    targets: Sequence[bpy.types.Object],
) -> None:
    """Pieces that this match leaves out lose an earlier one with the same source, and its colours."""
    givers, takers = (
        [
            obj
            for uid in job.left_out.get(surface.object_uid, ())
            if (obj := find_object(bpy.data.objects, uid))
        ]
        for surface in (job.source, target)
    )
    taking = {obj.data for obj in (*sources, *targets)}
    left = [
        obj
        for obj in (*givers, *takers)
        if obj.type == "MESH" and obj.data.is_editable and obj.data not in taking
    ]
    with mesh_write.object_mode(context, left):
        for obj in left:
            if obj in takers and obj.spectral_match_source in (*sources, *givers):
                morph.remove(obj)
                mesh_write.forget_match(obj.data)
                stored_match.forget_fingerprint(obj.data)
        for obj in left:
            if not pair.has_match(obj) and not stored_match.is_source(obj):
                show.remove_colours(obj.data)


def failure_words(failed: "Failed") -> str:
    return f"'{failed.target.name}' was not matched: {core.explain(failed.error)}"


def _doubts_of_worn(targets: Iterable[Sequence[bpy.types.Object]]) -> list[str]:
    """What is worn where a match is doubtful: a helmet and a hat are no two forms of one shape."""
    doubtful = [pieces[0] for pieces in targets if not wording.is_good(pieces[0].data.spectral_match)]
    leads = [obj for obj, _, _ in stored_match.sources_of(doubtful[0])][:1] + doubtful if doubtful else []
    found = wardrobe.worn_in_match(character.of(lead) or character.alone(lead) for lead in leads)
    if not found:
        return []
    return [f"What is worn may mislead the match: {listed([obj.name for obj in found])}"]


def find_unchanged(surface: "Surface") -> list[bpy.types.Object]:
    """The objects that a surface was read from, one for each piece.

    Raises `UnusableObjectError` when one of them is another one now.
    """
    return [_find_unchanged(part.surface) for part in figure.parts(surface)]


def _find_unchanged(surface: "Surface") -> bpy.types.Object:
    obj = mesh_read.present(surface.object_uid, surface.name)
    if obj.type != "MESH" or obj.data.session_uid != surface.mesh_uid:
        raise UnusableObjectError(f"'{obj.name}' got another mesh since it was read. Match again")
    if obj.data.is_editmode:
        obj.update_from_editmode()
    if mesh_read.fingerprint(obj.data) != surface.fingerprint:
        raise UnusableObjectError(f"'{obj.name}' was edited since it was read. Match again")
    return obj


class MatchOperator(JobOperator):
    """What the operators that match the chosen pair share."""

    obstacle = staticmethod(needs_pair)
    then_transfer = False

    def wants_swapped_sides(self, _context: bpy.types.Context) -> bool:
        return False

    def begin(self, context: bpy.types.Context) -> "Generator[None, None, Job]":
        found = pair.resolve(context)
        assert found.source is not None
        return reading(context, found.source, found.targets, swap_sides=self.wants_swapped_sides(context))

    def conclude(self, context: bpy.types.Context, job: "Job") -> Outcome:
        assert isinstance(job, MatchJob)
        if job.cancelled and not job.results:
            return self.stopped("Match stopped; nothing was changed")
        stored, trouble = store(context, job)
        trouble += job.notes
        together = stored_match.matched_together(stored)
        brought, many = Carried(), []
        if self.then_transfer:
            settings, told = context.scene.spectral_match, []
            for pieces in together:
                names = character.names_in(character.of(pieces[0]) or character.alone(pieces[0]))
                try:
                    given = value_of(carry(context, None, pieces, settings, checked(settings)))
                except (UnusableObjectError, core.CoreMissingError) as reason:
                    told.append((names, [str(reason)]))
                else:
                    brought.add(given)
                    many.append(len(pieces))
                    told.append((names, given.notes))
            trouble += said_of_targets(told)
        if not stored:
            return self.fail("\n".join(trouble))
        trouble += _doubts_of_worn(together)
        if brought.names:
            show.show_after_transfer(context, stored, brought)
            notice.finish(context, stored, partial(done_words, brought, many), trouble)
        else:
            show.show_after_match(context, stored)
            self.warn(trouble)
        stopped = "Stopped.\n" if job.cancelled else ""
        leads, most = [pieces[0] for pieces in together], max(map(len, together))
        self.tell({"INFO"}, stopped + summary(leads, len(job.targets), self.then_transfer, most))
        return {"FINISHED"}


# What was done to several targets, by whether data were transferred and whether they are characters.
DONE = {
    (False, False): "Matched {} of {} meshes",
    (False, True): "Matched {} of {} characters",
    (True, False): "Matched and transferred to {} of {} meshes",
    (True, True): "Matched and transferred to {} of {} characters",
}


def summary(targets: Sequence[bpy.types.Object], wanted: int, transferred: bool, pieces: int = 1) -> str:
    """What was done to these targets, each told by one of its meshes; `pieces` is the most that one has."""
    if wanted > 1:
        return DONE[transferred, pieces > 1].format(len(targets), wanted)
    stored = targets[0].data.spectral_match
    whole = character.of(targets[0]) if pieces > 1 else None
    name, verdict = f"'{(whole or targets[0]).name}'", wording.of(stored)
    if stored.swapped_sides:
        verdict = f"{verdict}, left and right swapped"
    if stored.grade != "green":
        return f"Matched {name} in {stored.seconds:.1f} s: {verdict}"
    return f"Matched {name} in {stored.seconds:.1f} s, confidence {stored.mean_confidence:.0%}: {verdict}"


class SPECTRAL_MATCH_OT_match(MatchOperator, Operator):
    """Find for every vertex of the targets the point of the source that it corresponds to"""

    bl_idname = "spectral_match.match"
    bl_label = "Match"
    bl_options = {"UNDO"}

    swap_sides: BoolProperty(
        name="Swap Sides",
        description="Look for the map that exchanges left and right",
        options={"SKIP_SAVE"},
    )
    as_modelled: BoolProperty(
        name="As Modelled", description="Set Shape to Original first", options={"SKIP_SAVE"}
    )
    mirrored: BoolProperty(
        name="Allow Mirrored", description="Check Allow Mirrored Match first", options={"SKIP_SAVE"}
    )

    bare: BoolProperty(
        name="Without What Is Worn",
        description="First leave out hats, hair and clothes that lie over other meshes of their character",
        options={"SKIP_SAVE"},
    )

    def begin(self, context: bpy.types.Context) -> "Generator[None, None, Job]":
        settings = context.scene.spectral_match
        if self.bare:
            found = pair.resolve(context)
            wardrobe.undress(filter(None, (found.source, *found.targets)))
        if self.as_modelled:
            settings.shape = "ORIGINAL"
        if self.mirrored:
            settings.allow_mirror = True
        return super().begin(context)

    def wants_swapped_sides(self, _context: bpy.types.Context) -> bool:
        return self.swap_sides


class SPECTRAL_MATCH_OT_batch(MatchOperator, Operator):
    """Match the source to every target and carry the checked data over, in one go"""

    bl_idname = "spectral_match.batch"
    bl_label = "Match and Transfer to All"
    bl_options = {"UNDO"}

    then_transfer = True


class SPECTRAL_MATCH_OT_cancel(Step, Operator):
    """Stop; nothing is changed, except that targets of a batch that are done already stay matched"""

    bl_idname = "spectral_match.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @staticmethod
    def obstacle(_context: bpy.types.Context) -> str:
        return "" if job_module.current is not None else "Nothing is running"

    def act(self, context: bpy.types.Context) -> Outcome:
        job_module.current.cancel()
        redraw_sidebars(context)
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_dismiss(Step, Operator):
    """Hide this message"""

    bl_idname = "spectral_match.dismiss"
    bl_label = "Dismiss"
    bl_options = {"INTERNAL"}

    obstacle = staticmethod(nothing)

    step: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def forget(self) -> None:
        """All but this message stays."""

    def act(self, _context: bpy.types.Context) -> Outcome:
        notice.clear(self.step)
        return {"FINISHED"}


CLASSES = (
    SPECTRAL_MATCH_OT_match,
    SPECTRAL_MATCH_OT_batch,
    SPECTRAL_MATCH_OT_cancel,
    SPECTRAL_MATCH_OT_dismiss,
)
