# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn arrays into attributes of a mesh, and a finished match into the attributes that artists use."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import figure, palette
from .mesh_read import UnusableObjectError, matched_bodies
from .typed import EnumItem, Floats, Integers, Values

if TYPE_CHECKING:
    from sgmds import Correspondence, Quality

    from .mesh_read import Surface

# Names of our own attributes begin so: they are never carried.
OURS = "match_"
# Which mesh of a source of several has the image. Without it, its only one.
PIECE = "match_piece"
# In which mirrors of a half source the image lies: bit k for the k-th one. Without it, in none.
MATCH_IMAGE = "match_image"

# Attribute type → (name of the value in foreach_set, numbers an element, number type).
VALUE_LAYOUT: dict[str, tuple[str, int, type[np.generic]]] = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int8),
    "BOOLEAN": ("value", 1, np.bool_),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "INT16_2D": ("value", 2, np.int16),
    "INT32_2D": ("value", 2, np.int32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
}


def read_attribute(attribute: bpy.types.Attribute) -> Values:
    """Values of an attribute: (elements,) or (elements, numbers). Colours are linear in both colour types.

    Texts are bytes in an array of objects.
    """
    if attribute.data_type == "STRING":
        return np.array([entry.value for entry in attribute.data], object)
    name, numbers, kind = VALUE_LAYOUT[attribute.data_type]
    values = np.empty(len(attribute.data) * numbers, kind)
    attribute.data.foreach_get(name, values)
    return values if numbers == 1 else values.reshape(-1, numbers)


# What an attribute is for an artist, by the list in which Blender shows it.
UV_MAP, COLOUR, PLAIN = "a UV map", "a color attribute", "an attribute"


def sort_of(data_type: str, domain: str) -> str:
    """`UV_MAP`, `COLOUR` or `PLAIN`."""
    if data_type == "FLOAT2" and domain == "CORNER":
        return UV_MAP
    if data_type in {"FLOAT_COLOR", "BYTE_COLOR"} and domain in {"POINT", "CORNER"}:
        return COLOUR
    return PLAIN


def check_name(obj: bpy.types.Object, name: str, data_type: str, domain: str) -> None:
    """Raise `UnusableObjectError` when `write_attribute` would find the name taken on this object.

    Attributes, UV maps, colour attributes and vertex groups share their names; of these only UV maps can be
    made where there is a vertex group.
    """
    attribute, wanted = obj.data.attributes.get(name), sort_of(data_type, domain)
    _check_sort(obj, attribute, name, data_type, domain)
    fits = attribute is not None and (attribute.data_type, attribute.domain) == (data_type, domain)
    if name in obj.vertex_groups and wanted != UV_MAP and not fits:
        raise _taken(obj, name, "a vertex group", wanted)


def _check_sort(
    owner: bpy.types.ID, attribute: bpy.types.Attribute | None, name: str, data_type: str, domain: str
) -> None:
    """What is on the mesh by this name may be overwritten, or replaced by one of the same sort."""
    if attribute is None or (attribute.data_type, attribute.domain) == (data_type, domain):
        return
    kept, wanted = sort_of(attribute.data_type, attribute.domain), sort_of(data_type, domain)
    if attribute.is_required or kept != wanted:
        raise _taken(owner, name, "a built-in attribute" if attribute.is_required else kept, wanted)


def _taken(owner: bpy.types.ID, name: str, kept: str, wanted: str) -> UnusableObjectError:
    return UnusableObjectError(
        f"'{owner.name}' has {kept} named '{name}' and cannot get {wanted} of the same name. "
        "Rename it and try again"
    )


def write_attribute(
    mesh: bpy.types.Mesh | bpy.types.Curves, name: str, data_type: EnumItem, domain: EnumItem, values: Values
) -> None:
    """Create or overwrite the attribute `name`; one of its sort but another type or domain is replaced."""
    attribute = mesh.attributes.get(name)
    _check_sort(mesh, attribute, name, data_type, domain)
    if attribute is not None and (attribute.data_type, attribute.domain) != (data_type, domain):
        mesh.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = mesh.attributes.new(name, data_type, domain)
    if attribute is None or attribute.name != name:
        raise _taken(mesh, name, "a vertex group", sort_of(data_type, domain))
    if data_type == "STRING":
        for entry, value in zip(attribute.data, values, strict=True):
            entry.value = value
        return
    value_name, _, kind = VALUE_LAYOUT[data_type]
    attribute.data.foreach_set(value_name, np.ascontiguousarray(values, kind).ravel())


@contextmanager
def object_mode(context: bpy.types.Context, objects: Iterable[bpy.types.Object]) -> Iterator[None]:
    """Attributes are written in object mode: leave edit or sculpt mode, and return afterwards.

    A mesh may be open through another object that shares it.
    """
    meshes, left = {obj.data for obj in objects}, []
    for obj in bpy.data.objects:
        if obj.data in meshes and obj.mode in {"EDIT", "SCULPT"}:
            left.append((obj, obj.mode))
            _set_mode(context, obj, "OBJECT")
    try:
        yield
    finally:
        for obj, mode in left:
            _set_mode(context, obj, mode)


def _set_mode(context: bpy.types.Context, obj: bpy.types.Object, mode: EnumItem) -> None:
    # The operator works on all objects being edited together, so one may be there already.
    if obj.mode == mode:
        return
    with context.temp_override(object=obj, active_object=obj, selected_objects=[obj]):
        bpy.ops.object.mode_set(mode=mode)
    if obj.mode != mode:
        raise UnusableObjectError(
            f"'{obj.name}' did not change to {mode.title()} Mode. Change it by hand and try again"
        )


def image_points(points: Floats, triangles: Integers, faces: Integers, barycentric: Floats) -> Floats:
    """Points in triangles: `points` (n, c) of the vertices, one row for each entry of `faces`."""
    return np.einsum("ij,ijc->ic", barycentric, points[triangles[faces]])


def write_match(
    sources: Sequence[bpy.types.Object],
    targets: Sequence[bpy.types.Object],
    source_surface: Surface,
    target_surface: Surface,
    found: Correspondence,
) -> None:
    """Write one correspondence as attributes: colours on all pieces, the map itself on those of the target.

    `sources` and `targets` are the objects of the two surfaces' pieces.
    """
    source_body, _ = matched_bodies(source_surface, target_surface)
    # Of a completed target the modelled vertices are the first.
    modelled = slice(len(target_surface.local))
    shown = np.asarray(found.faces, np.int64)[modelled], np.asarray(found.barycentric, np.float64)[modelled]
    faces, barycentric = source_surface.from_core(source_body, *shown)
    confidence = np.asarray(found.confidence)[modelled]
    position = image_points(source_surface.local, source_surface.triangles, faces, barycentric)
    image = source_body.image[shown[0]]
    beyond = image > 0
    if beyond.any():
        _, triangles = source_surface.for_core(source_body)
        position[beyond] = image_points(source_body.points, triangles, *(each[beyond] for each in shown))
    places = *figure.in_pieces(source_surface, faces, barycentric), image
    written = set()
    for target, part in zip(targets, figure.parts(target_surface), strict=True):
        mesh, own = target.data, part.vertices
        if mesh not in written:
            written.add(mesh)
            write_attribute(mesh, "match_position", "FLOAT_VECTOR", "POINT", position[own])
            write_places(mesh, len(sources) > 1, *(np.asarray(values)[own] for values in places))
            write_attribute(mesh, "match_confidence", "FLOAT", "POINT", confidence[own])
            if HEAT in mesh.attributes:
                write_heat(mesh, confidence[own])
    colours, pieces = palette.surface_colours(source_surface.local), figure.parts(source_surface)
    write_colours(
        sources,
        targets,
        [colours[part.vertices] for part in pieces],
        [part.surface.triangles for part in pieces],
    )
    _remember(sources, targets, source_surface, target_surface, found.quality, confidence)


def write_places(
    mesh: bpy.types.Mesh,
    of_many: bool,
    piece: Integers,
    faces: Integers,
    barycentric: Floats,
    image: Integers,
) -> None:
    """Write where each vertex's image is: the piece of the source, its modelled triangle, the weights there,
    and in which mirrors of that piece.
    """
    write_attribute(mesh, "match_face", "INT", "POINT", faces)
    write_attribute(mesh, "match_barycentric", "FLOAT_VECTOR", "POINT", barycentric)
    for name, there, values in ((PIECE, of_many, piece), (MATCH_IMAGE, image.any(), image)):
        if there:
            write_attribute(mesh, name, "INT", "POINT", values)
        elif name in mesh.attributes:
            mesh.attributes.remove(mesh.attributes[name])


def read_places(mesh: bpy.types.Mesh) -> tuple[Values, Values, Values, Values]:
    """What `write_places` wrote: (n,), (n,), (n, 3) and (n,)."""
    faces = read_attribute(mesh.attributes["match_face"])
    piece, image = (
        np.zeros(len(faces), np.int32) if kept is None else read_attribute(kept)
        for kept in (mesh.attributes.get(name) for name in (PIECE, MATCH_IMAGE))
    )
    return piece, faces, read_attribute(mesh.attributes["match_barycentric"]), image


def write_colours(
    sources: Sequence[bpy.types.Object],
    targets: Sequence[bpy.types.Object],
    colours: Sequence[Floats],
    triangles: Sequence[Integers],
) -> None:
    """Give the sources these colours of their vertices, and each vertex of the targets that of its image in
    their triangles.
    """
    for target in targets:
        piece, faces, barycentric, _ = read_places(target.data)
        carried = np.zeros((len(faces), 4))
        for number in np.unique(piece).tolist():
            here = piece == number
            carried[here] = image_points(colours[number], triangles[number], faces[here], barycentric[here])
        _write_colour(target.data, carried)
    for source, values in zip(sources, colours, strict=True):
        _write_colour(source.data, values)


def _write_colour(mesh: bpy.types.Mesh, values: Floats) -> None:
    if mesh.is_editable:
        write_attribute(mesh, "match_color", "FLOAT_COLOR", "POINT", values)
        mesh.update()


HEAT = "match_heat"
# What `write_match` and `write_heat` make: the map, and what it is shown by.
MAP = ("match_position", "match_face", "match_barycentric", PIECE, MATCH_IMAGE, "match_confidence")
SHOWN = ("match_color", HEAT)


def remove_attributes(mesh: bpy.types.Mesh, names: Iterable[str]) -> None:
    """Remove those of these attributes that the mesh has."""
    for name in names:
        if name in mesh.attributes:
            mesh.attributes.remove(mesh.attributes[name])
    mesh.update()


def forget_match(mesh: bpy.types.Mesh) -> None:
    """Take away the match that `write_match` gave to a target's mesh, but for its colours."""
    remove_attributes(mesh, MAP)
    mesh.property_unset("spectral_match")
    for obj in bpy.data.objects:
        if obj.data == mesh and obj.is_editable:
            obj.spectral_match_source = None
            obj.spectral_match_pieces.clear()


def write_heat(mesh: bpy.types.Mesh, shares: Floats) -> None:
    """Numbers in [0, 1] of all vertices as colours: blue at 1, yellow at 0."""
    write_attribute(mesh, HEAT, "FLOAT_COLOR", "POINT", palette.heat_colours(shares))


def _remember(
    sources: Sequence[bpy.types.Object],
    targets: Sequence[bpy.types.Object],
    source_surface: Surface,
    target_surface: Surface,
    quality: Quality,
    confidence: Floats,
) -> None:
    pieces = figure.parts(source_surface)
    prints = [str(part.surface.fingerprint) for part in pieces]
    mates = uuid.uuid4().hex if len(targets) > 1 else ""
    for target, part in zip(targets, figure.parts(target_surface), strict=True):
        stored = target.data.spectral_match
        for obj in bpy.data.objects:
            if obj.data == target.data and obj.is_editable:
                obj.spectral_match_source = sources[0]
                obj.spectral_match_pieces.clear()
                for source, kept in zip(sources, prints, strict=True) if len(sources) > 1 else ():
                    piece = obj.spectral_match_pieces.add()
                    piece.object, piece.name, piece.fingerprint = source, source.name, kept
        stored.source_name = sources[0].name
        stored.source_fingerprint = prints[0]
        stored.target_fingerprint = str(part.surface.fingerprint)
        stored.figure = mates
        stored.grade = quality.grade
        stored.reasons = "\n".join(quality.reasons)
        stored.mean_confidence = float(np.mean(confidence)) if len(confidence) else 0.0
