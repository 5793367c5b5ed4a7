# SPDX-License-Identifier: GPL-3.0-or-later
"""Before and After: the target without what the last transfer brought, and with it again."""

from functools import partial
from typing import Any

import bpy
from bpy.props import BoolProperty
from bpy.types import Operator

from .. import notice
from ..typed import Outcome

# Steps that Before took back, which After brings again.
_taken = 0


def is_after(context: bpy.types.Context) -> bool:
    """Whether the scene has what the last transfer brought, rather than being as before it."""
    return context.scene.spectral_match.transfers >= notice.transfer


def _done(operator: Any) -> bool:
    """Run an operator, if it can be run now; whether it did something."""
    return operator.poll() and operator() == {"FINISHED"}


def step_through(back: bool) -> None:
    """Undo to before the last transfer, or redo all that was undone so.

    Steps made since the transfer lie between: what the artist did, and from Blender 5.2 the end of a
    playback.
    """
    global _taken
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        if back:
            _taken = 0
            while is_after(bpy.context) and _done(bpy.ops.ed.undo):
                _taken += 1
            if not is_after(bpy.context):
                return
            # Blender does not remember that far back: all stays as it is.
        while (_taken > 0 or not is_after(bpy.context)) and _done(bpy.ops.ed.redo):
            _taken -= 1
        _taken = 0


class SPECTRAL_MATCH_OT_compare(Operator):
    """Show the target as it was before the transfer, or with all that came and was done since"""

    bl_idname = "spectral_match.compare"
    bl_label = "Compare"
    bl_options = {"INTERNAL"}

    back: BoolProperty(options={"SKIP_SAVE", "HIDDEN"})

    def execute(self, _context: bpy.types.Context) -> Outcome:
        # Undo takes away what an operator that is still running was called with.
        if bpy.app.background:
            step_through(self.back)
        else:
            bpy.app.timers.register(partial(step_through, self.back), first_interval=0.0)
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_compare,)
