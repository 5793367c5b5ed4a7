# SPDX-License-Identifier: GPL-3.0-or-later
"""Show a match in the viewport: as colours, as a heat map of how sure it is, as lines, as a morph."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.props import EnumProperty
from bpy.types import Operator

from .. import (
    character,
    laid_over,
    mesh_read,
    mesh_write,
    morph,
    overlay,
    pair,
    palette,
    preferences,
    stored_match,
)
from ..mesh_read import UnusableObjectError
from ..typed import Outcome
from .step import Step, needs_matched

if TYPE_CHECKING:
    from ..transfer import Carried

# Colour attribute that was active before ours, by mesh session id, and the viewports' colouring before ours.
_earlier_active: dict[int, str] = {}
_earlier_colouring: dict[int, tuple[Any, ...]] = {}


def _viewports(context: bpy.types.Context) -> list[Any]:
    return [
        area.spaces.active
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def _activate(mesh: bpy.types.Mesh, name: str) -> None:
    colours = mesh.color_attributes
    if name not in colours:
        return
    active = colours.active_color
    if active is not None and not active.name.startswith(mesh_write.OURS):
        _earlier_active[mesh.session_uid] = active.name
    colours.active_color = colours[name]


def _deactivate(mesh: bpy.types.Mesh) -> None:
    """Have the colour attribute active again that was it before ours, or another one."""
    colours = mesh.color_attributes
    earlier = _earlier_active.pop(mesh.session_uid, "")
    others = [layer.name for layer in colours if not layer.name.startswith(mesh_write.OURS)]
    if others:
        colours.active_color = colours[earlier if earlier in others else others[0]]


def remove_colours(mesh: bpy.types.Mesh) -> None:
    """Take our colours from a mesh that has no match any more."""
    _deactivate(mesh)
    mesh_write.remove_attributes(mesh, mesh_write.SHOWN)


def _colour_viewport(space: Any) -> None:
    shading = space.shading
    # A file that was saved with our colors opens with them: what was before them is not known.
    if (shading.color_type, shading.light) != ("VERTEX", "FLAT"):
        _earlier_colouring.setdefault(
            space.as_pointer(), (shading.type, shading.color_type, shading.light, shading.show_cavity)
        )
    shading.type, shading.color_type = "SOLID", "VERTEX"
    # Flat, so that shade is not taken for colour; cavities tell the form.
    shading.light, shading.show_cavity = "FLAT", True


def _colour_viewports(context: bpy.types.Context) -> None:
    for space in _viewports(context):
        _colour_viewport(space)


def _uncolour_viewports(context: bpy.types.Context) -> None:
    for space in _viewports(context):
        if space.shading.color_type == "VERTEX":
            shading = space.shading
            earlier = _earlier_colouring.get(space.as_pointer(), ("SOLID", "MATERIAL", "STUDIO", False))
            shading.light, shading.show_cavity = earlier[2:]
            shading.type, shading.color_type = earlier[:2]
    _earlier_colouring.clear()


def _colour_anew(
    context: bpy.types.Context, sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> None:
    """A body that was source in one match and target in another is coloured for the later one."""
    with mesh_write.object_mode(context, [*sources, *targets]):
        by_sources: dict[tuple[bpy.types.Object, ...], list[bpy.types.Object]] = {}
        for target in targets:
            if sources and stored_match.state(target).usable:
                own = tuple(obj for obj, _, _ in stored_match.sources_of(target))
                by_sources.setdefault(own, []).append(target)
        for own, coloured in by_sources.items():
            points = [
                mesh_read.positions(obj.data) @ matrix[:3, :3].T + matrix[:3, 3]
                for obj, matrix in zip(own, character.placed(own), strict=True)
            ]
            colours = np.split(
                palette.surface_colours(np.concatenate(points)), np.cumsum([len(part) for part in points])
            )
            triangles = [mesh_read.triangle_vertices(obj.data) for obj in own]
            mesh_write.write_colours(own, coloured, colours[:-1], triangles)


def show_colours(
    context: bpy.types.Context, sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> None:
    for obj in [*sources, *targets]:
        _activate(obj.data, "match_color")
    _colour_viewports(context)


def show_confidence(
    context: bpy.types.Context, sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> None:
    with mesh_write.object_mode(context, targets):
        for target in targets:
            confidence = mesh_write.read_attribute(target.data.attributes["match_confidence"])
            mesh_write.write_heat(target.data, confidence)
            _activate(target.data, mesh_write.HEAT)
    for source in sources:
        _activate(source.data, "match_color")
    _colour_viewports(context)


def show_heat(
    context: bpy.types.Context, objects: Iterable[bpy.types.Object], beside: Iterable[bpy.types.Object]
) -> None:
    """The heat map of some objects, and no colours of ours on those beside them."""
    for obj in objects:
        _activate(obj.data, mesh_write.HEAT)
    for obj in beside:
        attributes, active = obj.data.attributes, obj.data.color_attributes.active_color
        if active is not None and active.name.startswith(mesh_write.OURS):
            attributes.active_color_name = ""
            # Where no attribute is active Blender shows the default one.
            if attributes.default_color_name.startswith(mesh_write.OURS):
                attributes.default_color_name = ""
            obj.data.update()
    _colour_viewports(context)


def show_nothing(
    context: bpy.types.Context, sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> None:
    for obj in [*sources, *targets]:
        _deactivate(obj.data)
    _uncolour_viewports(context)


WAYS = (
    ("COLOURS", "Colors", "Matching points of source and target have the same color"),
    ("CONFIDENCE", "Confidence", "Blue where the match is sure, yellow where it is not"),
    ("NOTHING", "Off", "Color the viewport as before"),
)
# How a solid viewport shows what a transfer brought: the first of which there is something.
LOOKS = {"TEXTURE": ("textures", "uv", "materials"), "VERTEX": ("colours",)}
SHOWN = {"COLOURS": show_colours, "CONFIDENCE": show_confidence, "NOTHING": show_nothing}


def shown(context: bpy.types.Context, target: bpy.types.Object) -> str:
    """Which of `SHOWN` this viewport does for the target."""
    active = target.data.color_attributes.active_color
    space = context.space_data
    if active is None or space is None or space.type != "VIEW_3D" or space.shading.color_type != "VERTEX":
        return "NOTHING"
    return {"match_color": "COLOURS", mesh_write.HEAT: "CONFIDENCE"}.get(active.name, "NOTHING")


def show_after_match(context: bpy.types.Context, targets: Sequence[bpy.types.Object]) -> None:
    """What the preferences ask for when these meshes are matched."""
    wish = preferences.of(context).show_after_match
    if wish != "NOTHING":
        SHOWN[wish](context, _sources(targets), targets)


def show_after_transfer(
    context: bpy.types.Context, targets: Sequence[bpy.types.Object], brought: "Carried"
) -> None:
    """Let the viewport show what was brought: textures and materials as they are, else painted colors."""
    show_nothing(context, _sources(targets), targets)
    seen = next(
        (look for look, kinds in LOOKS.items() if any(brought.names.get(kind) for kind in kinds)), None
    )
    if seen is None:
        return
    for space in _viewports(context):
        if space.shading.type == "SOLID":
            space.shading.color_type = seen


def show_after_fit(context: bpy.types.Context, pieces: Iterable[bpy.types.Object]) -> None:
    """Let the viewport show characters as they are, their matched pieces among these."""
    targets = [
        obj for obj in pieces if character.is_there(obj) and obj.data.spectral_match.target_fingerprint
    ]
    show_nothing(context, _sources(targets), targets)


def _sources(targets: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """The meshes that these were matched with, as far as they are there; each once."""
    found = dict.fromkeys(obj for target in targets for obj, _, _ in stored_match.sources_of(target))
    return [obj for obj in found if character.is_there(obj) and obj.type == "MESH"]


@persistent
def _follow_undo(_scene: object, _unused: object = None) -> None:
    """Viewports are no part of undo: color them as the meshes are colored now."""
    targets = [
        mesh
        for mesh in bpy.data.meshes
        if mesh.spectral_match.target_fingerprint or mesh_write.HEAT in mesh.attributes
    ]
    if not targets:
        if _earlier_colouring:
            _uncolour_viewports(bpy.context)
        return
    actives = [mesh.color_attributes.active_color for mesh in targets]
    ours = any(active is not None and active.name.startswith(mesh_write.OURS) for active in actives)
    for space in _viewports(bpy.context):
        shading = space.shading
        if shading.type != "SOLID" or shading.color_type != "VERTEX":
            continue
        if ours:
            _colour_viewport(space)
        elif space.as_pointer() in _earlier_colouring:
            shading.light, shading.show_cavity = _earlier_colouring.pop(space.as_pointer())[2:]


@persistent
def _forget_file(_path: object, _unused: object = None) -> None:
    _earlier_active.clear()
    _earlier_colouring.clear()


HANDLERS = (("undo_post", _follow_undo), ("redo_post", _follow_undo), ("load_pre", _forget_file))


class SPECTRAL_MATCH_OT_show(Step, Operator):
    """Color the two meshes in the viewport"""

    bl_idname = "spectral_match.show"
    bl_label = "Show Match"
    bl_options = {"UNDO"}

    what: EnumProperty(name="Show", items=WAYS)
    obstacle = staticmethod(needs_matched)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return next(words for identifier, _, words in WAYS if identifier == properties.what)

    def act(self, context: bpy.types.Context) -> Outcome:
        source = pair.resolve(context).source
        matched = pair.matched_pieces(context)
        for target in matched:
            elsewhere = stored_match.matched_elsewhere(target, source)
            if self.what != "NOTHING" and elsewhere:
                raise UnusableObjectError(elsewhere)
            if self.what != "NOTHING" and "match_confidence" not in target.data.attributes:
                raise UnusableObjectError(
                    f"The match of '{target.name}' was removed from its attributes. Match again"
                )
        sources = _sources(matched) if source is not None else []
        if self.what == "COLOURS":
            _colour_anew(context, sources, matched)
        SHOWN[self.what](context, sources, matched)
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_lines(Step, Operator):
    """Draw lines between points spread over the target and their places on the source"""

    bl_idname = "spectral_match.lines"
    bl_label = "Lines"
    bl_description = (
        "Draw lines between points spread over the target and their places on the source: blue where the "
        "match is sure, yellow where it is not"
    )
    bl_options = {"INTERNAL"}

    @staticmethod
    def obstacle(context: bpy.types.Context) -> str:
        # Lines that are on can always be switched off.
        return "" if overlay.lines_shown() else needs_matched(context)

    def act(self, context: bpy.types.Context) -> Outcome:
        overlay.show_lines(not overlay.lines_shown())
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()
        return {"FINISHED"}


class SPECTRAL_MATCH_OT_morph(Step, Operator):
    """Move the target's vertices to their places on the source, by a factor"""

    bl_idname = "spectral_match.morph"
    bl_label = "Morph"
    bl_description = (
        "Give the target a Geometry Nodes modifier that moves every vertex to its place on the source, by a "
        "factor. Pressed again, take it away"
    )
    bl_options = {"UNDO"}

    obstacle = staticmethod(needs_matched)

    def act(self, context: bpy.types.Context) -> Outcome:
        matched = pair.matched_pieces(context)
        with mesh_write.object_mode(context, matched):
            if any(morph.modifier_of(target) for target in matched):
                for target in matched:
                    morph.remove(target)
                return {"FINISHED"}
            for target in matched:
                stored_match.require(target, pair.resolve(context).source)
                mesh_read.check_usable(target, as_target=True)
            for together in stored_match.matched_together(matched):
                laid_over.write(together)
            for target in matched:
                morph.add(target, laid_over.sources_of(target))
        return {"FINISHED"}


CLASSES = (SPECTRAL_MATCH_OT_show, SPECTRAL_MATCH_OT_lines, SPECTRAL_MATCH_OT_morph)
