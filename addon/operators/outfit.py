# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit Outfit: copies of what one character wears, on the matched targets."""

from collections.abc import Collection, Generator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator

from .. import core, drawing, mesh_write, pair
from ..mesh_read import UnusableObjectError
from ..outfit import fitting, live, reading, wardrobe, writing
from ..transfer import said_of_targets
from ..typed import Outcome, Settings
from . import show
from .remedies import OnObject
from .running import JobOperator
from .step import Step, needs_matched

if TYPE_CHECKING:
    from ..character import Character
    from ..job import Job

# A fitted outfit, and its objects in the scene.
Made = tuple[fitting.Fitted, list[bpy.types.Object]]


def wearer_of(found: pair.Pair) -> "Character":
    """The character whose clothes a pair is about."""
    assert found.source is not None
    return wardrobe.wearer(found.source, found.targets)


@dataclass(frozen=True)
class Clothes:
    """What a pair's source wears, of what may be worn, as the boxes are: those of all the wearer's meshes."""

    found: pair.Pair
    wearer: "Character"
    worn: Sequence[bpy.types.Object]
    others: Sequence[bpy.types.Object]
    boxes: Sequence[str]


_shown: list[Clothes] = []


def clothes_of(found: pair.Pair) -> Clothes:
    """The clothes of a pair's source, for the panel: kept while `pair.shown` keeps the pair.

    Found anew they take two milliseconds of every redraw, for a character of 15 meshes.
    """
    if not _shown or _shown[0].found is not found or _shown[0].boxes != _boxes(_shown[0].wearer):
        wearer = wearer_of(found)
        worn, others = wardrobe.worn(wearer), wardrobe.others(wearer)
        _shown[:] = [Clothes(found, wearer, worn, others, _boxes(wearer))]
    return _shown[0]


def _boxes(wearer: "Character") -> list[str]:
    return [obj.spectral_match_worn for obj in wearer.whole]


def garments_of(wearer: "Character", names: str = "") -> list[bpy.types.Object]:
    """What is fitted: the objects that a script names, a line each, or those that are worn."""
    wanted = [line.strip() for line in names.splitlines() if line.strip()]
    if wanted:
        there = {obj.name: obj for obj in wearer.whole}
        missing = [name for name in wanted if name not in there]
        if missing:
            raise UnusableObjectError(f"'{wearer.name}' does not have {', '.join(missing)}")
        return [there[name] for name in wanted]
    worn = wardrobe.worn(wearer)
    if not worn and len(wearer.whole) == 1:
        raise UnusableObjectError(
            f"'{wearer.name}' is one mesh. Separate its clothes into objects of their own: select their "
            "faces in Edit Mode and press P"
        )
    if not worn:
        raise UnusableObjectError(f"Nothing that '{wearer.name}' wears is checked")
    return worn


def options_of(settings: "Settings") -> fitting.Options:
    return fitting.Options(
        settings.outfit_distance, settings.outfit_tightness, settings.outfit_body_keys, settings.outfit_hide
    )


def begin_fitting(
    context: bpy.types.Context,
    wearer: "Character",
    garments: Sequence[bpy.types.Object],
    targets: "Sequence[Character]",
    options: fitting.Options,
) -> Generator[None, None, fitting.OutfitJob]:
    """A generator that reads one target after another; its value is the job.

    What cannot be read of one target does not stop the others.
    """
    wishes, trouble = [], []
    for target in targets:
        yield
        try:
            wishes.append(reading.read(context, wearer, garments, target))
        except UnusableObjectError as reason:
            trouble.append(str(reason))
    if not wishes:
        raise UnusableObjectError(" ".join(trouble))
    job = fitting.OutfitJob(wishes, options)
    job.notes += trouble
    return job


def store_fitted(
    context: bpy.types.Context, job: fitting.OutfitJob, wearer_name: str
) -> tuple[list[Made], list[str]]:
    """Write what a finished job fitted; returns pairs of the outfit and its copies, and words on the rest."""
    made: list[Made] = []
    told: list[tuple[Collection[str], Sequence[str]]] = [
        ([name], [f"The outfit was not fitted to '{name}': {core.explain(why)}"])
        for name, why in job.failures
    ]
    for fitted in job.results:
        names = _names_in(fitted.wish)
        try:
            copies, notes = writing.write(context, fitted, wearer_name)
        except UnusableObjectError as reason:
            notes = [str(reason)]
        else:
            made.append((fitted, copies))
            names |= {obj.name for obj in copies}
        told.append((names, notes))
    return made, said_of_targets(told) + job.notes


def _names_in(wish: reading.Wish) -> set[str]:
    """Names of a target, of its meshes and its rig."""
    rig = wish.rigs[1]
    return {wish.label, *(name for _, name, _ in wish.bodies), *([] if rig is None else [rig.name])}


class SPECTRAL_MATCH_OT_fit_outfit(JobOperator, Operator):
    """Put copies of what the source wears onto every matched target: fitted, rigged and moving with it"""

    bl_idname = "spectral_match.fit_outfit"
    bl_label = "Fit Outfit"
    bl_options = {"UNDO"}

    garments: StringProperty(
        name="Garments",
        description="For scripts: names of the objects to fit, a line each, instead of the check boxes",
        options={"SKIP_SAVE"},
    )

    obstacle = staticmethod(needs_matched)

    def begin(self, context: bpy.types.Context) -> "Generator[None, None, Job]":
        found = pair.resolve(context)
        wearer = wearer_of(found)
        self._wearer = wearer.name
        self._dressed = [piece for target in found.targets for piece in target.whole]
        garments = garments_of(wearer, self.garments)
        options = options_of(context.scene.spectral_match)
        return (yield from begin_fitting(context, wearer, garments, found.targets, options))

    def conclude(self, context: bpy.types.Context, job: "Job") -> Outcome:
        if job.cancelled:
            return self.stopped("Fitting stopped; nothing was changed")
        assert isinstance(job, fitting.OutfitJob)
        made, trouble = store_fitted(context, job, self._wearer)
        if not made:
            return self.fail("\n".join(trouble))
        self.warn(trouble)
        show.show_after_fit(context, self._dressed)
        context.scene.spectral_match.outfit_inside = words_inside(made)
        self.tell({"INFO"}, summary(made))
        return {"FINISHED"}


def words_inside(made: Sequence[Made]) -> str:
    """How much of what was fitted is inside."""
    return live.words_inside(sum(each.inside for each, _ in made), sum(len(each.places) for each, _ in made))


def summary(made: Sequence[Made]) -> str:
    """What was fitted, and how much of it is inside."""
    pieces = len(made[0][1])
    to = f"'{made[0][0].wish.label}'" if len(made) == 1 else f"{len(made)} characters"
    what = "1 garment" if pieces == 1 else f"{pieces} garments"
    return f"Fitted {what} to {to}: {words_inside(made)}"


class SPECTRAL_MATCH_OT_toggle_worn(Step, Operator):
    """Fit this object with the outfit, or leave it to the character"""

    bl_idname = "spectral_match.toggle_worn"
    bl_label = "Worn"
    bl_options = {"UNDO", "INTERNAL"}

    garment: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context: bpy.types.Context) -> Outcome:
        found = pair.resolve(context)
        obj = bpy.data.objects.get(self.garment)
        if found.source is None or obj not in wearer_of(found).whole:
            raise UnusableObjectError(f"'{self.garment}' is no mesh of the chosen source")
        worn = obj in wardrobe.worn(wearer_of(found))
        obj.spectral_match_worn = wardrobe.NOT_WORN if worn else wardrobe.WORN
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_choose_worn(Step, Operator):
    """Fit with the outfit, or leave to the character, all that the search finds"""

    bl_idname = "spectral_match.choose_worn"
    bl_label = "Choose All or None"
    bl_options = {"UNDO", "INTERNAL"}

    take: BoolProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context: bpy.types.Context) -> Outcome:
        listed = {obj.name: obj for obj in clothes_of(pair.resolve(context)).others}
        for name in drawing.panel_state().found(listed, "worn_search"):
            listed[name].spectral_match_worn = wardrobe.WORN if self.take else wardrobe.NOT_WORN
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_hide_worn(OnObject, Operator):
    """Hide this piece of the target in viewport and render, or show it again. Nothing is deleted"""

    bl_idname = "spectral_match.hide_worn"
    bl_label = "Hide or Show What Is in the Way"

    def act_on(self, obj: bpy.types.Object, _context: bpy.types.Context) -> None:
        hide = obj.visible_get()
        obj.hide_set(hide)
        obj.hide_render = obj.spectral_match_hidden = hide


def needs_fitted(context: bpy.types.Context) -> str:
    missing = needs_matched(context)
    if missing or live.kept_on(pair.resolve(context).targets):
        return missing
    return "No outfit was fitted since the file was opened. Press Fit Outfit first"


class SPECTRAL_MATCH_OT_closer_look(Step, Operator):
    """Color fitted outfits by their distance to the skin"""

    bl_idname = "spectral_match.closer_look"
    bl_label = "Closer Look"
    bl_description = (
        "Color fitted outfits by their distance to the skin: blue where it is as large as asked, yellow "
        "where they are inside the body. Pressed again, color the viewport as before"
    )
    bl_options = {"UNDO"}

    obstacle = staticmethod(needs_fitted)

    def act(self, context: bpy.types.Context) -> Outcome:
        found = pair.resolve(context)
        kept = live.kept_on(found.targets)
        copies = live.copies_of(kept)
        if live.looked_at(kept):
            show.show_nothing(context, [], copies)
            for obj in copies:
                heat = obj.data.attributes.get(mesh_write.HEAT)
                if heat is not None:
                    obj.data.attributes.remove(heat)
            return {"FINISHED"}
        live.look_closer(kept, options_of(context.scene.spectral_match))
        bodies = [body for body in (found.source, *found.targets) if body is not None]
        show.show_heat(context, copies, [obj for body in bodies for obj in body.whole if obj not in copies])
        return {"FINISHED"}


CLASSES = (
    SPECTRAL_MATCH_OT_fit_outfit,
    SPECTRAL_MATCH_OT_toggle_worn,
    SPECTRAL_MATCH_OT_choose_worn,
    SPECTRAL_MATCH_OT_hide_worn,
    SPECTRAL_MATCH_OT_closer_look,
)
