# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators whose work goes on while the window lives."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from typing import Any

import bpy

from .. import core
from .. import job as job_module
from ..job import Job
from ..mesh_read import value_of
from ..translation import said
from ..typed import Outcome
from .step import Step, going_on

# Reads in short steps: how far it is and what it does, or None; its value is the job.
Beginning = Generator[tuple[float, str] | None, None, Job]

# How often it is asked how far the work is; what blocks the window goes on at these moments.
POLL_SECONDS, BLOCKING_SECONDS = 0.05, 0.005
# Reading goes on for so long, and one step more, before the window has its turn.
READ_SECONDS = 0.02
# And so long where it takes nothing but Esc, since every turn may draw the whole scene.
BLOCKING_READ_SECONDS = 0.1


def redraw_sidebars(context: bpy.types.Context) -> None:
    """Have the sidebars drawn again, and the viewports left alone."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


class JobOperator(Step):
    """An operator whose work runs beside the window; called from a script it blocks.

    `begin` is a generator that reads in short steps and returns the job; it may yield how far it is and
    what it does. `conclude` writes what was found. While one that `blocks` is at it, the window shows how
    far it is and takes nothing but Esc, and that not in the `lasting` stages, in which it writes.

    Progress is shown in place of the button that was pressed in the sidebar; where none was, as from a menu,
    in place of that of the step `stands_for`.
    """

    stands_for = "spectral_match.match"
    blocks = False
    lasting: Sequence[str] = ()

    def begin(self, context: bpy.types.Context) -> Beginning:
        raise NotImplementedError

    def conclude(self, context: bpy.types.Context, job: Job) -> Outcome:
        raise NotImplementedError

    def act(self, context: bpy.types.Context) -> Outcome:
        job = value_of(self.begin(context))
        job.run()
        return self._end(context, job)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Outcome:
        self.pressed = True
        in_sidebar = context.region is not None and context.region.type == "UI"
        self._button = type(self).bl_idname if in_sidebar else self.stands_for
        self.said_at = self._button
        # Timers stand still in background mode, and there is no window to keep alive.
        if bpy.app.background:
            return self.execute(context)
        self.forget()
        self._beginning: Beginning | None = self.begin(context)
        self._take_up(Job())
        self._job.stage = "Reading the meshes"
        manager = context.window_manager
        pause = BLOCKING_SECONDS if self.blocks else POLL_SECONDS
        self._timer: bpy.types.Timer | None = manager.event_timer_add(pause, window=context.window)
        operator: Any = self
        manager.modal_handler_add(operator)
        going_on.add(self)
        self._shown = ""
        self._show_progress(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        try:
            return self._follow(context, event)
        except Exception:
            # Blender shows it; the panel must not wait for a job that nobody follows any more.
            self._job.cancel()
            self._stop_watching(context)
            raise

    def _follow(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        if event.type == "ESC" and event.value == "PRESS":
            if not self._job.lasting:
                self._job.cancel()
            self._show_progress(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL" if self.blocks else "PASS_THROUGH"}
        if self._beginning is not None:
            result = self.attempt(self._read_on)
            if result != {"RUNNING_MODAL"}:
                self._stop_watching(context)
                return result
        if not self._job.finished:
            self._show_progress(context)
            return {"PASS_THROUGH"}
        self._stop_watching(context)
        return self.attempt(self._end, context, self._job)

    def _take_up(self, job: Job) -> None:
        """Let the panel show how far this job is."""
        job.blocks, job.button = self.blocks, self._button
        self._job = job_module.current = job

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator, for example because another file is opened."""
        self._job.cancel()
        self._stop_watching(context)

    def _read_on(self) -> Outcome:
        until = time.monotonic() + (BLOCKING_READ_SECONDS if self.blocks else READ_SECONDS)
        assert self._beginning is not None
        if self.blocks and self._job.cancelling:
            self._beginning.close()
            self._beginning = None
            return self.conclude(bpy.context, self._job)
        try:
            while time.monotonic() < until:
                step = next(self._beginning)
                if step is not None:
                    begins = step[1] != self._job.stage
                    self._job.fraction, self._job.stage = step
                    self._job.lasting = step[1] in self.lasting
                    # What begins may take long: first it is said.
                    if begins:
                        break
        except StopIteration as end:
            if self._job.cancelling:
                end.value.cancel()
            self._beginning = None
            self._take_up(end.value)
            self._job.start()
        return {"RUNNING_MODAL"}

    def _show_progress(self, context: bpy.types.Context) -> None:
        job = self._job
        words = job.words
        if words != self._shown:
            self._shown = words
            way_out = "" if job.lasting else f"   |   Esc: {said('Cancel')}"
            context.workspace.status_text_set(f"Spectral Match: {words}{way_out}")
        redraw_sidebars(context)

    def _stop_watching(self, context: bpy.types.Context) -> None:
        job_module.current = None
        self._beginning = None
        going_on.discard(self)
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw_sidebars(context)

    def _end(self, context: bpy.types.Context, job: Job) -> Outcome:
        if job.error is not None:
            return self.fail(core.explain(job.error))
        return self.conclude(context, job)
