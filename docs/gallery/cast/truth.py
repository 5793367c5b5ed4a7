# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a match, and what was carried along it, is from what is known by construction."""

from __future__ import annotations

import bpy
import numpy as np

from .anatomy import SKELETON
from .people import SKIN
from .scene import Actor, corner_uv, triangles

HEIGHT = 1.6
"""Of the template, in whose lengths errors are given."""


def images(source: Actor, target: Actor, piece: str):
    """For each vertex of a piece of the target: where its image lies on the template (n, 3), and its
    weights there."""
    mesh = target.meshes[piece].data
    count = len(mesh.vertices)
    names, which = pieces_of(source, target.meshes[piece])
    face = _attribute(mesh, "match_face", "value", np.empty(count, np.int32))
    share = _attribute(mesh, "match_barycentric", "vector", np.empty(3 * count, np.float32)).reshape(-1, 3)
    places, weights = np.zeros((count, 3)), np.zeros((count, len(SKELETON)))
    for number, name in enumerate(names):
        own = which == number
        if own.any():
            corners = triangles(source.meshes[name].data)[0][face[own]]
            there = source.person.piece(name)
            places[own] = np.einsum("nk,nkd->nd", share[own], there.places[corners])
            weights[own] = np.einsum("nk,nkd->nd", share[own], there.weights[corners])
    return places, weights


def pieces_of(source: Actor, obj):
    """Names of the source's pieces, and for each vertex of a target the number of the one it was matched
    with."""
    by_mesh = {mesh: name for name, mesh in source.meshes.items()}
    which = np.zeros(len(obj.data.vertices), np.int32)
    if "match_piece" in obj.data.attributes:
        which = _attribute(obj.data, "match_piece", "value", which)
    return [by_mesh[each.object] for each in obj.spectral_match_pieces], which


def _attribute(mesh, name, what, values):
    mesh.attributes[name].data.foreach_get(what, values)
    return values


def skin_errors(source: Actor, target: Actor) -> np.ndarray:
    """Way from each skin vertex's image to where it belongs, on the template, in % of the height."""
    away = []
    for name in SKIN:
        found = images(source, target, name)[0]
        away.append(np.linalg.norm(found - target.person.piece(name).places, axis=1))
    return 100 * np.concatenate(away) / HEIGHT


def near_bone_share(source: Actor, target: Actor) -> float:
    """Share of all vertices, clothes and hair too, whose image hangs on the bone that it should or on a
    neighbour."""
    parents = np.array(
        [next((i for i, b in enumerate(SKELETON) if b.name == bone.parent), -1) for bone in SKELETON]
    )
    right = []
    for name in target.meshes:
        wanted = target.person.piece(name).weights.argmax(axis=1)
        found = images(source, target, name)[1].argmax(axis=1)
        right.append((found == wanted) | (parents[found] == wanted) | (parents[wanted] == found))
    return float(np.concatenate(right).mean())


def weight_error(source: Actor, target: Actor) -> float:
    """Mean share of a skin vertex's weight that hangs on wrong bones, in %."""
    wrong = []
    numbers = {source.person.bones[bone.name]: number for number, bone in enumerate(SKELETON)}
    for name in SKIN:
        obj = target.meshes[name]
        carried = np.zeros((len(obj.data.vertices), len(SKELETON)))
        column = {group.index: numbers[group.name] for group in obj.vertex_groups if group.name in numbers}
        for vertex in obj.data.vertices:
            for entry in vertex.groups:
                if entry.group in column:
                    carried[vertex.index, column[entry.group]] += entry.weight
        wrong.append(0.5 * np.abs(carried - target.person.piece(name).weights).sum(axis=1))
    return float(100 * np.concatenate(wrong).mean())


def joint_error(source: Actor, target: Actor, rig) -> float:
    """Mean way of the joints of a carried rig from where the target's build has them, in % of the
    template's height."""
    heads = target.person.build.joints()[0]
    offset = np.array(target.meshes["Body"].matrix_world.translation)
    away = []
    for bone, head in zip(SKELETON, heads, strict=True):
        found = rig.matrix_world @ rig.data.bones[source.person.bones[bone.name]].head_local
        away.append(np.linalg.norm(np.array(found) - offset - head))
    return float(100 * np.mean(away) / HEIGHT)


def colour_share(source: Actor, target: Actor, pieces=("Head", "Hands"), tolerance=0.1) -> float:
    """Share of the pieces' triangles whose middle shows, in the texture that was baked for them, the colour
    that the source is painted there: each channel within `tolerance`. Asked are those matched with the same
    piece: skin under a cap or a beard takes the colour of the source's hair, as it should."""
    right = []
    for name in pieces:
        pixels = _pixels(shown_image(target.meshes[name]))
        mesh, piece = target.meshes[name].data, target.person.piece(name)
        corners, loops = triangles(mesh)
        names, which = pieces_of(source, target.meshes[name])
        asked = (which[corners] == names.index(name)).all(axis=1)
        corners, loops = corners[asked], loops[asked]
        height, width = pixels.shape[:2]
        texel = (corner_uv(mesh)[loops].mean(axis=1) * (width, height)).astype(int)
        places = piece.places[corners].mean(axis=1)
        wanted = source.person.piece(name).brush(places, piece.normals[corners].mean(axis=1))
        right.append((np.abs(pixels[texel[:, 1], texel[:, 0]] - wanted) < tolerance).all(axis=1))
    return float(np.concatenate(right).mean())


def shown_image(obj):
    """The image of the material that most faces of an object show."""
    numbers = np.empty(len(obj.data.polygons), np.int32)
    obj.data.polygons.foreach_get("material_index", numbers)
    nodes = obj.data.materials[int(np.bincount(numbers).argmax())].node_tree.nodes
    return next(node.image for node in nodes if node.type == "TEX_IMAGE")


def _pixels(image):
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[..., :3]


def fitted_errors(source: Actor, target: Actor, copies: dict[str, bpy.types.Object]) -> np.ndarray:
    """Way of each vertex of fitted garments from where the target's build puts it, in % of the template's
    height."""
    away = []
    for name, obj in copies.items():
        points = np.empty(3 * len(obj.data.vertices), np.float32)
        obj.data.attributes["position"].data.foreach_get("vector", points)
        matrix = np.array(obj.matrix_world)
        world = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        world -= np.array(target.meshes["Body"].matrix_world.translation)
        wanted = target.person.build(source.person.piece(name).places)
        away.append(np.linalg.norm(world - wanted, axis=1))
    return 100 * np.concatenate(away) / HEIGHT
