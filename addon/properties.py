# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on remembers: settings of the scene, and on each matched mesh what its match was."""

from collections.abc import Callable, Iterable
from typing import Any

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
from bpy.types import Collection, Object, PropertyGroup

from . import item_lists, morph, pair
from .character import AUTOMATIC, LEFT_OUT, TAKEN
from .outfit import live, wardrobe
from .transfer import TransferFolds, TransferKinds, TransferOptions


def _holds_meshes(_settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    return obj.type in {"MESH", "ARMATURE"} or (obj.type == "EMPTY" and bool(obj.children))


class SPECTRAL_MATCH_PG_stored_match(PropertyGroup):
    """On a target mesh, beside the `match_*` attributes: where the match came from and how good it is."""

    identifier: StringProperty(description="Other than that of every other match")
    figure: StringProperty(description="The same on all meshes of a character that were matched together")
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


class SPECTRAL_MATCH_PG_piece(PropertyGroup):
    """One of the meshes of a source that are a character together; `name` is the one that it had."""

    object: PointerProperty(type=Object)
    fingerprint: StringProperty()


class SPECTRAL_MATCH_PG_landmark(PropertyGroup):
    """A pair of vertices that must correspond; `name` is for people."""

    source: PointerProperty(type=Object)
    target: PointerProperty(type=Object)
    source_vertex: IntProperty(min=0)
    target_vertex: IntProperty(min=0)
    colour: IntProperty(min=0, description="Which of the colors of landmarks it is shown in")
    source_topology: StringProperty(description="Numbering of the source when its vertex was picked")
    target_topology: StringProperty(description="Numbering of the target when its vertex was picked")


class SPECTRAL_MATCH_PG_skipped(PropertyGroup):
    """Something of the source that stays behind; `name` is "kind/name"."""


def _morphs() -> list[bpy.types.Modifier]:
    """The morph modifiers of the pair's matched meshes."""
    found = map(morph.modifier_of, pair.matched_pieces(bpy.context))
    return [modifier for modifier in found if morph.is_whole(modifier)]


def _of_morphs(identifier: str, nothing: Any) -> dict[str, Callable[..., Any]]:
    """What reads a group input of all morphs that are shown, as the first has it, and what writes it."""

    def read(_settings: PropertyGroup) -> Any:
        found = _morphs()
        return morph.value(found[0], identifier) if found else nothing

    def write(_settings: PropertyGroup, value: Any) -> None:
        for modifier in _morphs():
            morph.set_value(modifier, identifier, value)

    return {"get": read, "set": write}


class SPECTRAL_MATCH_PG_panel(TransferFolds, PropertyGroup):
    """What of the panel is unfolded, and what its lists are searched for.

    It belongs to the window manager, so that undo neither changes it nor has a step for it.
    """

    item_search: StringProperty(
        name="Search", description="List only names with these letters", options={"TEXTEDIT_UPDATE"}
    )
    worn_search: StringProperty(
        name="Search", description="List only names with these letters", options={"TEXTEDIT_UPDATE"}
    )
    open_details: BoolProperty(name="Details", description="Show what the matcher measured")
    open_notes: BoolProperty(name="Notes", description="Show what needs a look")
    open_lacking: BoolProperty(name="Lacking", description="Show what the source does not have")
    open_outfit: BoolProperty(name="Show", default=True, description="List what the source wears")

    def found(self, names: Iterable[str], search: str = "item_search") -> list[str]:
        """Those of these names in which the letters searched for are."""
        letters = getattr(self, search).lower()
        return [name for name in names if letters in name.lower()]


class SPECTRAL_MATCH_PG_settings(TransferKinds, TransferOptions, PropertyGroup):
    """Settings of a scene; those of the transfer are declared with each kind of data."""

    pinned: BoolProperty(
        name="Pin",
        description="Keep these two objects whatever is selected. Else the active object is source and the "
        "other selected meshes are the targets",
    )
    source: PointerProperty(
        name="Source",
        type=Object,
        poll=_holds_meshes,
        description="The character that has the data to be carried over",
    )
    target: PointerProperty(
        name="Target", type=Object, poll=_holds_meshes, description="The character that receives the data"
    )
    source_collection: PointerProperty(
        name="Source Collection",
        type=Collection,
        description="A collection whose meshes are the character that has the data",
    )
    target_collection: PointerProperty(
        name="Target Collection",
        type=Collection,
        description="A collection whose meshes are the character that receives the data",
    )
    whole_characters: BoolProperty(
        name="Whole Characters",
        default=True,
        description="Match all meshes of a character together, whichever of them is chosen. Off: match the "
        "chosen meshes by themselves",
    )
    # Lines of the lists of meshes.
    source_piece: IntProperty(name="Piece")
    target_piece: IntProperty(name="Piece")
    shape: EnumProperty(
        name="Shape",
        items=(
            (
                "ORIGINAL",
                "Original",
                "Match the meshes as modelled, with rigs at rest, without modifiers and shape keys",
            ),
            (
                "EVALUATED",
                "As Shown",
                "Match the meshes as rigs, modifiers and shape keys show them now. Modifiers that "
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
    # Of all meshes of a character at once; the modifiers have the values.
    morph_factor: FloatProperty(
        name="Morph",
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        description="Move all matched meshes to their places on the source: 0 is the target's own shape, "
        "1 the source's",
        **_of_morphs(morph.FACTOR, 0.0),
    )
    morph_in_place: BoolProperty(
        name="In Place",
        description="Lay the source's shape over the target instead of moving it there",
        **_of_morphs(morph.IN_PLACE, False),
    )
    morph_wipe: BoolProperty(
        name="Wipe",
        description="Go over to the source's shape from one end of the body to the other",
        **_of_morphs(morph.WIPE, False),
    )
    # How many transfers there were; undo takes them back.
    transfers: IntProperty()

    outfit_distance: FloatProperty(
        name="Distance",
        subtype="DISTANCE",
        step=0.1,
        precision=4,
        description="Added to the distance between skin and cloth. Outfits fitted since the file was "
        "opened follow at once",
        update=live.follow_sliders,
    )
    outfit_tightness: FloatProperty(
        name="Tightness",
        min=-1.0,
        max=1.0,
        subtype="FACTOR",
        description="How much of the distance between skin and cloth is taken away; below zero it grows. "
        "Outfits fitted since the file was opened follow at once",
        update=live.follow_sliders,
    )
    outfit_body_keys: BoolProperty(
        name="Follow Body Keys",
        default=True,
        description="Give the outfit shape keys, driven by those of the target that move skin under it",
    )
    outfit_hide: BoolProperty(
        name="Hide Covered Skin",
        description="Put what nobody sees of the target under the outfit into a vertex group, which a "
        "Mask modifier leaves out. Nothing is deleted",
    )
    outfit_inside: StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    landmarks: CollectionProperty(type=SPECTRAL_MATCH_PG_landmark)
    landmark_index: IntProperty(name="Landmark", description="Chosen pair of landmarks")

    def take(self, *kinds: str) -> None:
        """Carry these kinds alone, each as it is by default: how presets begin."""
        for name in TransferOptions.__annotations__:
            self.property_unset(name)
        for name in TransferKinds.__annotations__:
            setattr(self, name, name.removeprefix("use_") in kinds)

    def skips(self, kind: str, name: str) -> bool:
        return self.skipped.find(f"{kind}/{name}") >= 0

    def skip(self, kind: str, name: str, skipped: bool) -> None:
        """Leave an item of the source behind, or carry it over."""
        place = self.skipped.find(f"{kind}/{name}")
        if skipped and place < 0:
            self.skipped.add().name = f"{kind}/{name}"
        elif not skipped and place >= 0:
            self.skipped.remove(place)


CLASSES = (
    SPECTRAL_MATCH_PG_stored_match,
    SPECTRAL_MATCH_PG_piece,
    SPECTRAL_MATCH_PG_landmark,
    SPECTRAL_MATCH_PG_skipped,
    *item_lists.GROUPS,
    SPECTRAL_MATCH_PG_panel,
    SPECTRAL_MATCH_PG_settings,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.WindowManager.spectral_match_lists = CollectionProperty(type=item_lists.SPECTRAL_MATCH_PG_list)
    bpy.types.WindowManager.spectral_match_panel = PointerProperty(type=SPECTRAL_MATCH_PG_panel)
    bpy.types.Scene.spectral_match = PointerProperty(type=SPECTRAL_MATCH_PG_settings)
    bpy.types.Mesh.spectral_match = PointerProperty(type=SPECTRAL_MATCH_PG_stored_match)
    # On the object: a mesh that points to an object crashes Blender 5.0 when a script removes that object.
    bpy.types.Object.spectral_match_source = PointerProperty(type=Object)
    bpy.types.Object.spectral_match_pieces = CollectionProperty(type=SPECTRAL_MATCH_PG_piece)
    bpy.types.Object.spectral_match_part = EnumProperty(
        name="Part of the Character",
        items=(
            (AUTOMATIC, "Automatic", "Takes part unless it is hidden or held in a hand"),
            (TAKEN, "Takes Part", "Is matched with its character"),
            (LEFT_OUT, "Left Out", "Is left out when its character is matched"),
        ),
        default=AUTOMATIC,
        description="Whether this mesh takes part when its character is matched",
    )
    # Set where the panel hid it, so that the panel can show it again.
    bpy.types.Object.spectral_match_hidden = BoolProperty(options={"HIDDEN"})
    bpy.types.Object.spectral_match_worn = EnumProperty(
        name="Worn",
        items=(
            (
                wardrobe.AUTOMATIC,
                "Automatic",
                "Worn where it lies over other meshes, unless small or hidden",
            ),
            (wardrobe.WORN, "Worn", "Is fitted with its character's outfit"),
            (wardrobe.NOT_WORN, "Not Worn", "Belongs to its character's body"),
        ),
        default=wardrobe.AUTOMATIC,
        description="Whether this mesh is clothing of its character",
    )


def unregister() -> None:
    del bpy.types.Object.spectral_match_worn
    del bpy.types.Object.spectral_match_hidden
    del bpy.types.Object.spectral_match_part
    del bpy.types.Object.spectral_match_pieces
    del bpy.types.Object.spectral_match_source
    del bpy.types.Mesh.spectral_match
    del bpy.types.Scene.spectral_match
    del bpy.types.WindowManager.spectral_match_panel
    del bpy.types.WindowManager.spectral_match_lists
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
