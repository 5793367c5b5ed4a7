# SPDX-License-Identifier: GPL-3.0-or-later
"""Fix: exchange the roles, take another of the maps found, exchange left and right."""

from collections.abc import Generator
from typing import TYPE_CHECKING

import bpy
from bpy.props import IntProperty
from bpy.types import Operator

from .. import laid_over, mesh_write, pair, preferences, stored_match, wording
from ..job import AlternativeJob
from ..mesh_read import UnusableObjectError
from ..typed import Outcome
from .match import MatchOperator, find_unchanged
from .running import JobOperator
from .step import Step, needs_matched

if TYPE_CHECKING:
    from ..character import Character
    from ..job import Job


class SPECTRAL_MATCH_OT_swap_roles(Step, Operator):
    """Exchange source and target: the other mesh gives the data"""

    bl_idname = "spectral_match.swap_roles"
    bl_label = "Swap Source and Target"
    bl_options = {"UNDO"}

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        found = pair.resolve(context)
        chosen = found.source is not None and len(found.targets) == 1
        return "" if chosen else "Needs one source and one target"

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        found = pair.resolve(context)
        if settings.pinned:
            settings.source, settings.target = settings.target, settings.source
            collections = settings.source_collection, settings.target_collection
            settings.target_collection, settings.source_collection = collections
            return {"FINISHED"}
        assert found.source is not None
        source, target = _standing(found.source), _standing(found.targets[0])
        for obj in (source, target):
            there = obj.name in context.view_layer.objects
            if not there or not obj.visible_get() or obj.hide_select:
                raise UnusableObjectError(
                    f"'{obj.name}' is hidden or not selectable. Pin both objects to choose them by name"
                    if there
                    else f"'{obj.name}' is not in this view layer. Pin both objects to choose them by name"
                )
        for obj in (source, target):
            obj.select_set(True)
        context.view_layer.objects.active = target
        return {"FINISHED"}


def _standing(body: "Character") -> bpy.types.Object:
    """The object that stands for a character: the one selected of it, or its lead."""
    chosen = [obj for obj in body.whole if obj.name in bpy.context.view_layer.objects and obj.select_get()]
    active = bpy.context.view_layer.objects.active
    return active if active in chosen else next(iter(chosen), body.lead)


class SPECTRAL_MATCH_OT_pin(Step, Operator):
    """Keep this source and this target whatever is selected, or let the selection decide again"""

    bl_idname = "spectral_match.pin"
    bl_label = "Pin Source and Target"
    bl_options = {"UNDO", "INTERNAL"}

    def act(self, context: bpy.types.Context) -> Outcome:
        settings = context.scene.spectral_match
        if not settings.pinned:
            found = pair.resolve(context)
            for end, body in (("source", found.source), ("target", next(iter(found.targets), None))):
                setattr(settings, end, _standing(body) if body is not None else None)
        settings.pinned = not settings.pinned
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_alternative(JobOperator, Operator):
    """Take the next of the maps that the match found. Useful when limbs, or front and back, are exchanged"""

    bl_idname = "spectral_match.alternative"
    bl_label = "Other Map"
    bl_options = {"UNDO"}

    step: IntProperty(name="Step", default=1, description="1 for the next map, -1 for the previous one")

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        words = needs_matched(context)
        if words:
            return words
        matched = pair.matched(context)
        if len(matched) > 1:
            return "Choose one matched target"
        maps = stored_match.maps_of(matched[0].lead.data)
        if maps is None:
            return "Other maps are not kept with a file or with a copy of the mesh. Match again to find them"
        if maps.best.alternative_count == 0:
            return "The match found no other plausible map. Add landmarks to steer it"
        return ""

    def begin(self, context: bpy.types.Context) -> "Generator[None, None, Job]":
        target = pair.matched(context)[0].lead
        stored = stored_match.require(target, pair.resolve(context).source)
        maps = stored_match.maps_of(target.data)
        assert maps is not None
        number = (stored.alternative + self.step) % (1 + maps.best.alternative_count)
        threads = preferences.of(context).threads or None
        # Nothing has to be read, so this generator has no steps.
        yield from ()
        return AlternativeJob(maps, number, threads)

    def conclude(self, context: bpy.types.Context, job: "Job") -> Outcome:
        if job.cancelled:
            self.tell({"INFO"}, "Cancelled; the map is the same as before")
            return {"CANCELLED"}
        assert isinstance(job, AlternativeJob)
        maps = job.maps
        sources, targets = find_unchanged(maps.source), find_unchanged(maps.target)
        with mesh_write.object_mode(context, [*sources, *targets]):
            mesh_write.write_match(sources, targets, maps.source, maps.target, job.found)
            laid_over.refresh(targets)
        for target in targets:
            stored_match.forget_fingerprint(target.data)
            stored = target.data.spectral_match
            stored.alternative = job.number
        self.tell({"INFO"}, f"Map {job.number + 1} of {stored.alternatives}: {wording.of(stored)}")
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_swap_sides(MatchOperator, Operator):
    """Match again, this time to the map that exchanges left and right"""

    bl_idname = "spectral_match.swap_sides"
    bl_label = "Swap Left and Right"
    bl_options = {"UNDO"}

    def wants_swapped_sides(self, context: bpy.types.Context) -> bool:
        return not pair.matched(context)[0].lead.data.spectral_match.swapped_sides


CLASSES = (
    SPECTRAL_MATCH_OT_swap_roles,
    SPECTRAL_MATCH_OT_pin,
    SPECTRAL_MATCH_OT_alternative,
    SPECTRAL_MATCH_OT_swap_sides,
)
