# SPDX-License-Identifier: GPL-3.0-or-later
"""Match: start the job, watch it, write what it found."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Operator

from .. import core, mesh_read, mesh_write, pair, preferences, stored_match
from .. import job as job_module
from ..job import MatchJob, MatchOptions
from ..mesh_read import UnusableObjectError
from ..transfer import carry_all, checked
from . import show

POLL_SECONDS = 0.05


def refresh_panels(context):
    """Have every viewport and sidebar drawn again."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def make_job(context, source, targets, *, swap_sides=False):
    """Read the objects and return the job, not yet begun; raises `UnusableObjectError`."""
    settings = context.scene.spectral_match
    evaluated = settings.shape == "EVALUATED"
    source_surface = mesh_read.read_surface(context, source, evaluated=evaluated)
    surfaces, seen = [], {source_surface.mesh_uid}
    for target in targets:
        if target.data.session_uid in seen:
            continue
        seen.add(target.data.session_uid)
        surfaces.append(mesh_read.read_surface(context, target, evaluated=evaluated, as_target=True))
    options = MatchOptions(
        method=settings.method,
        part={"AUTO": None, "SOURCE": "source", "TARGET": "target"}[settings.part],
        mirror="allow" if settings.allow_mirror else "forbid",
        threads=preferences.of(context).threads or None,
        swap_sides=swap_sides,
    )
    landmarks = {
        target.session_uid: [
            (pin.source_vertex, pin.target_vertex)
            for pin in settings.landmarks
            if pin.source == source and pin.target == target
        ]
        for target in targets
    }
    return MatchJob(source_surface, surfaces, options, landmarks)


def store(context, job):
    """Write a finished job's maps to its targets; returns them and words on those that could not."""
    source = mesh_read.find_object(bpy.data.objects, job.source.object_uid)
    _check_unchanged(source, job.source)
    stored, trouble = [], []
    for matched in job.results:
        target = mesh_read.find_object(bpy.data.objects, matched.target.object_uid)
        try:
            _check_unchanged(target, matched.target)
            with mesh_write.object_mode(context, [source, target]):
                mesh_write.write_match(source, target, job.source, matched.target, matched.maps[0])
        except UnusableObjectError as reason:
            trouble.append(str(reason))
            continue
        note = target.data.spectral_match
        note.seconds = matched.seconds
        note.alternative, note.alternatives = 0, len(matched.maps)
        note.swapped_sides = job.options.swap_sides
        stored_match.maps_of_mesh[target.data.session_uid] = stored_match.SessionMaps(
            job.source, matched.target, matched.maps
        )
        stored_match.forget_fingerprint(source.data)
        stored_match.forget_fingerprint(target.data)
        stored.append(target)
    return stored, trouble


def _check_unchanged(obj, surface):
    if not pair.is_there(obj):
        raise UnusableObjectError(
            f"'{surface.name}' was deleted while the match was running. Undo, or match again"
        )
    if obj.type != "MESH" or obj.data.session_uid != surface.mesh_uid:
        raise UnusableObjectError(f"'{obj.name}' got another mesh while the match was running. Match again")
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    if mesh_read.fingerprint(obj.data) != surface.fingerprint:
        raise UnusableObjectError(f"'{obj.name}' was edited while the match was running. Match again")


class MatchOperator:
    """What the operators that start a job share; a subclass says which objects in `objects`."""

    then_transfer = False
    _timer = None
    _job = None

    @classmethod
    def poll(cls, context):
        if job_module.current is not None:
            cls.poll_message_set("A match is running. Press Esc or Cancel to stop it")
            return False
        found = pair.resolve(context)
        if found.missing:
            cls.poll_message_set(found.missing)
            return False
        return True

    def objects(self, context):
        found = pair.resolve(context)
        return found.source, found.targets

    def wants_swapped_sides(self, _context):
        return False

    def execute(self, context):
        job = self._prepare(context)
        if job is None:
            return {"CANCELLED"}
        job.run()
        return self._conclude(context, job)

    def invoke(self, context, _event):
        # Timers stand still in background mode, and there is no window to keep alive.
        if bpy.app.background:
            return self.execute(context)
        job = self._prepare(context)
        if job is None:
            return {"CANCELLED"}
        self._job = job_module.current = job
        job.start()
        manager = context.window_manager
        self._timer = manager.event_timer_add(POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        self._show_progress(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._job.cancel()
            self._show_progress(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._job.finished:
            self._show_progress(context)
            return {"PASS_THROUGH"}
        self._stop_watching(context)
        result = self._conclude(context, self._job)
        refresh_panels(context)
        return result

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._job.cancel()
        self._stop_watching(context)

    def _prepare(self, context):
        try:
            return make_job(context, *self.objects(context), swap_sides=self.wants_swapped_sides(context))
        except UnusableObjectError as reason:
            self.report({"ERROR"}, str(reason))
            return None

    def _show_progress(self, context):
        words = "stopping" if self._job.cancelling else f"{self._job.stage}  {self._job.fraction:.0%}"
        context.workspace.status_text_set(f"Spectral Match: {words}   |   Esc: Cancel")
        refresh_panels(context)

    def _stop_watching(self, context):
        job_module.current = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        if context.workspace is not None:
            context.workspace.status_text_set(None)

    def _conclude(self, context, job):
        if job.cancelled:
            self.report({"INFO"}, "Match cancelled; nothing was changed")
            return {"CANCELLED"}
        if job.error is not None:
            self.report({"ERROR"}, core.explain(job.error))
            return {"CANCELLED"}
        try:
            stored, trouble = store(context, job)
            if self.then_transfer:
                settings = context.scene.spectral_match
                for target in stored:
                    trouble += carry_all(target, settings, checked(settings))
        except UnusableObjectError as reason:
            self.report({"ERROR"}, str(reason))
            return {"CANCELLED"}
        for words in trouble:
            self.report({"ERROR"} if not stored else {"WARNING"}, words)
        if not stored:
            return {"CANCELLED"}
        show.show_after_match(context, job.source.object_uid, stored)
        self.report({"INFO"}, summary(stored))
        return {"FINISHED"}


def summary(targets):
    if len(targets) > 1:
        return f"Matched {len(targets)} meshes"
    stored = targets[0].data.spectral_match
    return (
        f"Matched '{targets[0].name}' in {stored.seconds:.1f} s, "
        f"mean confidence {stored.mean_confidence:.0%}, grade {stored.grade}"
    )


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

    def wants_swapped_sides(self, _context):
        return self.swap_sides


class SPECTRAL_MATCH_OT_batch(MatchOperator, Operator):
    """Match the source to every target and carry the checked data over, in one go"""

    bl_idname = "spectral_match.batch"
    bl_label = "Match and Transfer to All"
    bl_options = {"UNDO"}

    then_transfer = True


class SPECTRAL_MATCH_OT_cancel(Operator):
    """Stop the running match; nothing is changed"""

    bl_idname = "spectral_match.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context):
        return job_module.current is not None

    def execute(self, context):
        job_module.current.cancel()
        refresh_panels(context)
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_match, SPECTRAL_MATCH_OT_batch, SPECTRAL_MATCH_OT_cancel)
