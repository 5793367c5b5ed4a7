# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces: which meshes of a character take part when it is matched."""

from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy.types import Operator

from .. import character, pair
from ..character import AUTOMATIC, LEFT_OUT, TAKEN, Character
from ..mesh_read import UnusableObjectError
from ..outfit import wardrobe
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


class AtEnd(Step):
    """A step on the pieces of the source, or of the targets."""

    bl_options: set[Any] = {"UNDO", "INTERNAL"}

    end: EnumProperty(items=(("SOURCE", "Source", ""), ("TARGET", "Target", "")), options={"SKIP_SAVE"})

    def bodies(self, context: bpy.types.Context) -> list[Character]:
        found = pair.resolve(context)
        return [body for body in (found.targets if self.end == "TARGET" else [found.source]) if body]


class SPECTRAL_MATCH_OT_reset_pieces(AtEnd, Operator):
    """Let all meshes take part again that are neither hidden nor held in a hand"""

    bl_idname = "spectral_match.reset_pieces"
    bl_label = "Reset Pieces"

    def act(self, context: bpy.types.Context) -> Outcome:
        for body in self.bodies(context):
            for obj in body.whole:
                obj.spectral_match_part = AUTOMATIC
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_undress(AtEnd, Operator):
    """Leave out hats, hair and clothes that lie over other meshes: bodies alone match more exactly"""

    bl_idname = "spectral_match.undress"
    bl_label = "Leave Out What Is Worn"

    def act(self, context: bpy.types.Context) -> Outcome:
        if wardrobe.undress(self.bodies(context)):
            return {"FINISHED"}
        self.tell({"INFO"}, "Nothing that takes part is worn over other meshes")
        return {"CANCELLED"}


CLASSES = (SPECTRAL_MATCH_OT_toggle_piece, SPECTRAL_MATCH_OT_reset_pieces, SPECTRAL_MATCH_OT_undress)
