# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces: which meshes of a character take part when it is matched."""

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy.types import Operator

from .. import character, pair
from ..character import AUTOMATIC, LEFT_OUT, TAKEN
from ..mesh_read import UnusableObjectError
from ..typed import Outcome
from .step import Step


class SPECTRAL_MATCH_OT_toggle_piece(Step, Operator):
    """Match this mesh with its character, or leave it out"""

    bl_idname = "spectral_match.toggle_piece"
    bl_label = "Take Part"
    bl_options = {"UNDO", "INTERNAL"}

    piece: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def act(self, context: bpy.types.Context) -> Outcome:
        obj = bpy.data.objects.get(self.piece)
        found = pair.resolve(context)
        bodies = [body for body in (found.source, *found.targets) if body is not None]
        body = next((each for each in bodies if character.holds(each, obj)), None)
        if body is None:
            raise UnusableObjectError(f"'{self.piece}' is no mesh of the chosen characters")
        if obj in body.pieces and len(body.pieces) == 1:
            raise UnusableObjectError(f"'{obj.name}' is the last mesh of '{body.name}' that takes part")
        obj.spectral_match_part = LEFT_OUT if obj in body.pieces else TAKEN
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_reset_pieces(Step, Operator):
    """Let all meshes take part again that are neither hidden nor held in a hand"""

    bl_idname = "spectral_match.reset_pieces"
    bl_label = "Reset Pieces"
    bl_options = {"UNDO", "INTERNAL"}

    end: EnumProperty(items=(("SOURCE", "Source", ""), ("TARGET", "Target", "")), options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> Outcome:
        found = pair.resolve(context)
        bodies = found.targets if self.end == "TARGET" else [found.source]
        for body in filter(None, bodies):
            for obj in body.whole:
                obj.spectral_match_part = AUTOMATIC
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_toggle_piece, SPECTRAL_MATCH_OT_reset_pieces)
