# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on remembers: settings of the scene, and on each matched mesh what its match was."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)
from bpy.types import Object, PropertyGroup

from .transfer import TransferChoice, TransferOptions


def _is_mesh(_settings, obj):
    return obj.type == "MESH"


class SPECTRAL_MATCH_PG_stored_match(PropertyGroup):
    """On a target mesh, beside the `match_*` attributes: where the match came from and how good it is."""

    identifier: StringProperty(description="Other than that of every other match")
    source_name: StringProperty()
    source_fingerprint: StringProperty()
    target_fingerprint: StringProperty()
    grade: StringProperty()
    reasons: StringProperty(description="One reason a line")
    mean_confidence: FloatProperty()
    seconds: FloatProperty()
    alternative: IntProperty(description="Which of the maps found is the stored one, 0 the best")
    alternatives: IntProperty(description="How many maps were found")
    swapped_sides: BoolProperty()


class SPECTRAL_MATCH_PG_landmark(PropertyGroup):
    """A pair of vertices that must correspond; `name` is for people."""

    source: PointerProperty(type=Object)
    target: PointerProperty(type=Object)
    source_vertex: IntProperty(min=0)
    target_vertex: IntProperty(min=0)
    source_topology: StringProperty(description="Numbering of the source when its vertex was picked")
    target_topology: StringProperty(description="Numbering of the target when its vertex was picked")


class SPECTRAL_MATCH_PG_skipped(PropertyGroup):
    """Something of the source that stays behind; `name` is "kind/name"."""


class SPECTRAL_MATCH_PG_settings(TransferChoice, TransferOptions, PropertyGroup):
    """Settings of a scene; those of the transfer are declared with each kind of data."""

    pinned: BoolProperty(
        name="Pin",
        description="Keep these two objects whatever is selected. Else the active object is source and the "
        "other selected meshes are the targets",
    )
    source: PointerProperty(
        name="Source",
        type=Object,
        poll=_is_mesh,
        description="The character that has the data to be carried over",
    )
    target: PointerProperty(
        name="Target", type=Object, poll=_is_mesh, description="The character that receives the data"
    )
    shape: EnumProperty(
        name="Shape",
        items=(
            ("ORIGINAL", "Original", "Match the meshes as modelled, without modifiers and shape keys"),
            (
                "EVALUATED",
                "As Shown",
                "Match the meshes as modifiers and shape keys show them now. Modifiers that "
                "add or remove vertices must be off",
            ),
        ),
        default="ORIGINAL",
        description="Which form of the meshes is compared",
    )
    part: EnumProperty(
        name="Parts",
        items=(
            ("AUTO", "Find Out", "Decide from the shapes whether one is a part of the other"),
            (
                "SOURCE",
                "Source Is a Part",
                "The source is a piece of the target, for example a bust against a whole body",
            ),
            (
                "TARGET",
                "Target Is a Part",
                "The target is a piece of the source, for example a hand against a whole body",
            ),
        ),
        default="AUTO",
        description="Say so when one of the two is only a piece of the other",
    )
    allow_mirror: BoolProperty(
        name="Allow Mirrored Match",
        description="Also accept a match that turns left into right, as between a left and a right hand",
    )
    same_axes: BoolProperty(
        name="Facing the Same Way",
        description="Left, front and up are the same directions on both: "
        "tells the sides of a body apart that is its own mirror image",
    )

    skipped: CollectionProperty(type=SPECTRAL_MATCH_PG_skipped)

    landmarks: CollectionProperty(type=SPECTRAL_MATCH_PG_landmark)
    landmark_index: IntProperty(name="Landmark", description="Chosen pair of landmarks")

    def skips(self, kind, name):
        return self.skipped.find(f"{kind}/{name}") >= 0


CLASSES = (
    SPECTRAL_MATCH_PG_stored_match,
    SPECTRAL_MATCH_PG_landmark,
    SPECTRAL_MATCH_PG_skipped,
    SPECTRAL_MATCH_PG_settings,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.spectral_match = PointerProperty(type=SPECTRAL_MATCH_PG_settings)
    bpy.types.Mesh.spectral_match = PointerProperty(type=SPECTRAL_MATCH_PG_stored_match)
    # On the object: a mesh that points to an object crashes Blender 5.0 when a script removes that object.
    bpy.types.Object.spectral_match_source = PointerProperty(type=Object)


def unregister():
    del bpy.types.Object.spectral_match_source
    del bpy.types.Mesh.spectral_match
    del bpy.types.Scene.spectral_match
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
