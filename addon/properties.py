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


def _is_mesh(_settings, obj):
    return obj.type == "MESH"


class SPECTRAL_MATCH_PG_stored_match(PropertyGroup):
    """On a target mesh, beside the `match_*` attributes: where the match came from and how good it is."""

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


class SPECTRAL_MATCH_PG_skipped(PropertyGroup):
    """Something of the source that stays behind; `name` is "kind/name"."""


class SPECTRAL_MATCH_PG_settings(PropertyGroup):
    """Settings of a scene."""

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
    method: EnumProperty(
        name="Method",
        items=(
            ("auto", "Best", "Search for the best map and refine it"),
            ("paper", "Published", "The published algorithm and nothing else: for comparison, less exact"),
        ),
        default="auto",
        description="How the map is computed",
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

    use_groups: BoolProperty(
        name="Vertex Groups", default=True, description="Carry vertex groups and their weights"
    )
    use_uv: BoolProperty(
        name="UV Maps", default=True, description="Carry UV maps, cut where the source's seams fall"
    )
    use_colours: BoolProperty(name="Color Attributes", default=True, description="Carry painted colors")
    open_groups: BoolProperty(name="Show", description="List the vertex groups one by one")
    open_uv: BoolProperty(name="Show", description="List the UV maps one by one")
    open_colours: BoolProperty(name="Show", description="List the color attributes one by one")
    skipped: CollectionProperty(type=SPECTRAL_MATCH_PG_skipped)

    limit_total: BoolProperty(
        name="Limit Total", default=False, description="Keep only the strongest weights of each vertex"
    )
    limit: IntProperty(
        name="Weights per Vertex", default=4, min=1, soft_max=8, description="Game engines usually take 4"
    )
    normalize: BoolProperty(
        name="Normalize",
        default=True,
        description="After limiting, scale each vertex's weights back to the sum that came across: 1 if the "
        "source's weights sum to 1",
    )
    prune: FloatProperty(
        name="Prune Below",
        default=0.001,
        min=0.0,
        max=0.5,
        precision=3,
        description="Drop weights smaller than this",
    )

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
