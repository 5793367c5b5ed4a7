# SPDX-License-Identifier: GPL-3.0-or-later
"""Image nodes of a material: how their picture is laid onto a mesh, and whether it holds normals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import bpy
from mathutils import Euler, Matrix

from ..mesh_read import UnusableObjectError

# The group nodes around a node, outermost first.
Groups = tuple[bpy.types.Node, ...]


@dataclass(frozen=True)
class Normals:
    """What a normal map needs: TANGENT, OBJECT or WORLD, the UV map of its tangents, if it has such, and the
    channels that count downwards.
    """

    space: str
    uv: str
    downwards: frozenset[int]


@dataclass(frozen=True)
class Laid:
    """An image as a node lays it onto a mesh: (u, v, 1) of the UV map go through `placing`, (2, 3)."""

    image: bpy.types.Image
    uv: str
    placing: tuple[tuple[float, float, float], ...]
    extension: str
    closest: bool
    normals: Normals | None


def image_nodes(material: bpy.types.Material | None) -> list[tuple[Groups, bpy.types.Node]]:
    """Nodes with an image, those in node groups too, each with the group nodes around it, outermost first."""

    def walk(tree: bpy.types.NodeTree, groups: Groups) -> Iterator[tuple[Groups, bpy.types.Node]]:
        for node in tree.nodes:
            if node.type == "TEX_IMAGE" and node.image is not None:
                yield groups, node
            elif node.type == "GROUP" and node.node_tree is not None:
                yield from walk(node.node_tree, (*groups, node))

    return list(walk(material.node_tree, ())) if material is not None and material.node_tree else []


def images(materials: Iterable[bpy.types.Material]) -> set[bpy.types.Image]:
    """Images of the materials' nodes; a node group is read once however often it is used."""
    found: set[bpy.types.Image] = set()
    seen: set[bpy.types.NodeTree] = set()
    trees = [material.node_tree for material in materials if material.node_tree]
    while trees:
        tree = trees.pop()
        if tree in seen:
            continue
        seen.add(tree)
        for node in tree.nodes:
            if node.type == "TEX_IMAGE" and node.image is not None:
                found.add(node.image)
            elif node.type == "GROUP" and node.node_tree is not None:
                trees.append(node.node_tree)
    return found


def laid(
    source: bpy.types.Object, material: bpy.types.Material, groups: Groups, node: bpy.types.Node
) -> Laid:
    """How the node lays its image onto `source`; raises `UnusableObjectError` where no UV map does it."""
    if not source.data.uv_layers:
        raise UnusableObjectError(f"'{source.name}' has no UV map, so its textures have no place on it")
    if node.projection != "FLAT":
        raise _without_uv(material, node, f"by {node.projection.capitalize()} projection")
    uv, placing = _place(source, material, groups, node)
    return Laid(
        node.image,
        uv,
        tuple((row[0], row[1], row[3]) for row in placing[:2]),
        # Tiles do not go over into each other.
        "extend" if node.image.source == "TILED" else node.extension.lower(),
        node.interpolation == "Closest",
        _normals(source, material, groups, node),
    )


def _without_uv(material: bpy.types.Material, node: bpy.types.Node, how: str) -> UnusableObjectError:
    return UnusableObjectError(
        f"Image '{node.image.name}' of material '{material.name}' is laid on {how} (node '{node.name}'), "
        "which cannot be baked. Lay it on by a UV map"
    )


def _shown_uv(mesh: bpy.types.Mesh) -> str:
    """The UV map that materials show where they name none."""
    return next((layer.name for layer in mesh.uv_layers if layer.active_render), mesh.uv_layers[0].name)


def _place(
    source: bpy.types.Object, material: bpy.types.Material, groups: Groups, node: bpy.types.Node
) -> tuple[str, Matrix]:
    """UV map and matrix (4, 4) by which the node's Vector comes about."""
    placing = Matrix.Identity(4)
    socket = node.inputs["Vector"]
    if not socket.links:
        return _shown_uv(source.data), placing
    while True:
        # Blender keeps links that close a circle, as invalid ones.
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            raise _without_uv(material, node, f"by the fixed value of '{socket.node.name}'")
        before, out = link.from_node, link.from_socket
        if before.type == "REROUTE":
            socket = before.inputs[0]
        elif before.type == "MAPPING":
            if not before.mute:
                placing = placing @ _mapping(material, node, before)
            socket = before.inputs["Vector"]
        elif before.type == "GROUP_INPUT" and groups:
            groups, around = groups[:-1], groups[-1]
            socket = _same(around.inputs, out)
        elif before.type == "GROUP" and (end := _end(before)) is not None:
            groups = (*groups, before)
            socket = _same(end.inputs, out)
        else:
            return _map_named(source, material, node, before, out), placing


def _end(group: bpy.types.Node) -> bpy.types.Node | None:
    """The node that gives the group's outputs."""
    nodes = group.node_tree.nodes if group.node_tree is not None and not group.mute else ()
    return next((node for node in nodes if node.type == "GROUP_OUTPUT" and node.is_active_output), None)


def _same(sockets: Iterable[bpy.types.NodeSocket], socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """A group's socket on the other side of its border."""
    return next(other for other in sockets if other.identifier == socket.identifier)


def _map_named(
    source: bpy.types.Object,
    material: bpy.types.Material,
    node: bpy.types.Node,
    before: bpy.types.Node,
    out: bpy.types.NodeSocket,
) -> str:
    """The UV map that the output of the node `before` gives."""
    if before.type == "TEX_COORD" and out.name == "UV":
        return _shown_uv(source.data)
    if before.type == "UVMAP":
        name = before.uv_map or _shown_uv(source.data)
    elif (
        before.type == "ATTRIBUTE" and before.attribute_type == "GEOMETRY" and out.name in {"Vector", "Color"}
    ):
        name = before.attribute_name
    else:
        raise _without_uv(material, node, f"by {out.name} of '{before.name}'")
    if name not in source.data.uv_layers:
        raise _without_uv(material, node, f"by '{name}', which is no UV map of '{source.name}',")
    return name


def _mapping(material: bpy.types.Material, node: bpy.types.Node, mapping: bpy.types.Node) -> Matrix:
    """What a Mapping node does to a point, as a matrix (4, 4)."""
    values = [mapping.inputs[name] for name in ("Location", "Rotation", "Scale")]
    if mapping.vector_type == "NORMAL" or any(socket.is_linked for socket in values):
        raise _without_uv(material, node, f"by '{mapping.name}', whose values are not fixed numbers")
    location, rotation, scale = (socket.default_value[:] for socket in values)
    if mapping.vector_type == "TEXTURE":
        back = Matrix.Diagonal([1.0 / s if s else 0.0 for s in scale]).to_4x4()
        return (
            back @ Euler(rotation).to_matrix().transposed().to_4x4() @ Matrix.Translation(location).inverted()
        )
    if mapping.vector_type == "VECTOR":
        location = (0.0, 0.0, 0.0)
    return Matrix.LocRotScale(location, Euler(rotation), scale)


BLENDER = "BLENDER_"


def _normals(
    source: bpy.types.Object, material: bpy.types.Material, groups: Groups, node: bpy.types.Node
) -> Normals | None:
    found = normal_maps(groups, node)
    if not found:
        return None
    what = f"Image '{node.image.name}' of material '{material.name}' holds normals"
    spaces = {normal_map.space for normal_map in found}
    if len(spaces) > 1:
        which = ", ".join(sorted(f"'{normal_map.name}'" for normal_map in found))
        raise UnusableObjectError(
            f"{what} for nodes of different spaces ({which}), which cannot be baked. Give each space an image"
        )
    (space,) = spaces
    downwards = frozenset().union(*(way.downwards for way in found.values()))
    if space != "TANGENT":
        exchanged = next((normal_map for normal_map, way in found.items() if way.exchanged), None)
        if exchanged is not None:
            raise UnusableObjectError(
                f"{what} whose channels are exchanged on the way to node '{exchanged.name}', which cannot be "
                "baked. Exchange them in the image itself"
            )
        return Normals(space.removeprefix(BLENDER), "", downwards)
    names = {normal_map.uv_map or _shown_uv(source.data) for normal_map in found}
    missing = sorted(name for name in names if name not in source.data.uv_layers)
    if missing:
        raise _without_uv(
            material, node, f"with tangents of '{missing[0]}', which is no UV map of '{source.name}',"
        )
    return Normals(space, min(names), downwards)


# Nodes out of which a normal map still comes when one goes in.
PASSING = {
    "REROUTE", "MIX", "MIX_RGB", "CURVE_RGB", "CURVE_VEC", "BRIGHTCONTRAST", "GAMMA", "HUE_SAT", "INVERT",
    "MATH", "VECT_MATH", "CLAMP", "MAP_RANGE", "SEPARATE_COLOR", "SEPRGB", "SEPXYZ", "COMBINE_COLOR",
    "COMBRGB", "COMBXYZ",
}  # fmt: skip
FACTORS = {"Fac", "Factor"}
CHANNELS = RED, GREEN, BLUE = range(3)


@dataclass(frozen=True)
class Way:
    """What nodes do to a normal map: which channels they turn downwards, and whether they exchange some."""

    downwards: frozenset[int] = frozenset()
    exchanged: bool = False

    def joined(self, other: Way) -> Way:
        return Way(self.downwards | other.downwards, self.exchanged or other.exchanged)


def normal_maps(groups: Groups, node: bpy.types.Node) -> dict[bpy.types.Node, Way]:
    """Normal Map nodes that the image node ends in, each with the `Way` to it."""
    found: dict[bpy.types.Node, Way] = {}
    seen = set()
    open_ends: list[tuple[Groups, bpy.types.NodeSocket, int | None, Way]] = [
        (tuple(groups), node.outputs["Color"], None, Way())
    ]
    while open_ends:
        end = open_ends.pop()
        if end in seen:
            continue
        seen.add(end)
        groups, socket, channel, way = end
        for link in socket.links:
            after, into = link.to_node, link.to_socket
            if link.is_muted or into.name in FACTORS:
                continue
            if after.type == "NORMAL_MAP":
                found[after] = found.get(after, way).joined(way)
            elif after.type == "GROUP" and after.node_tree is not None:
                inputs = (n for n in after.node_tree.nodes if n.type == "GROUP_INPUT")
                inner = (*groups, after)
                open_ends += [(inner, _same(n.outputs, into), channel, way) for n in inputs]
            elif after.type == "GROUP_OUTPUT" and groups:
                open_ends.append((groups[:-1], _same(groups[-1].outputs, into), channel, way))
            elif after.type in PASSING:
                on = way if after.mute else _through(way, after, into, channel)
                for place, out in enumerate(after.outputs):
                    open_ends.append((groups, out, _channel_of(after, channel, place), on))
    return {
        normal_map: Way(way.downwards ^ _convention(normal_map), way.exchanged)
        for normal_map, way in found.items()
    }


def _convention(normal_map: bpy.types.Node) -> set[int]:
    """Channels that a Normal Map node reads downwards.

    Those of the spaces named after Blender are what its former renderer baked, as Cycles reads them.
    """
    directx = getattr(normal_map, "convention", "OPENGL") == "DIRECTX"
    downwards = {GREEN} if directx else set()
    return downwards ^ ({GREEN, BLUE} if normal_map.space.startswith(BLENDER) else set())


def _through(way: Way, node: bpy.types.Node, into: bpy.types.NodeSocket, channel: int | None) -> Way:
    """The way behind a node. What becomes of a channel in another's place says nothing about its own."""
    if node.type.startswith("COMB") and channel is not None and node.inputs[channel] != into:
        return Way(exchanged=True)
    return Way(way.downwards ^ _turned_by(node, into, channel), way.exchanged)


def _channel_of(node: bpy.types.Node, channel: int | None, place: int) -> int | None:
    """The colour's channel that leaves the node, None for the whole colour."""
    if node.type.startswith("SEP"):
        return place
    return None if node.type.startswith("COMB") else channel


def _turned_by(node: bpy.types.Node, into: bpy.types.NodeSocket, channel: int | None) -> set[int]:
    """Channels that the node takes to one minus what they are."""
    if channel is not None:
        return {channel} if _turns(node, into) else set()
    if node.type != "CURVE_RGB":
        return set()
    node.mapping.initialize()

    def at(channel: int, value: float) -> float:
        return node.mapping.evaluate(node.mapping.curves[channel], value)

    return {channel for channel in CHANNELS if at(channel, 0.0) > at(channel, 1.0)}


def _turns(node: bpy.types.Node, into: bpy.types.NodeSocket) -> bool:
    """Whether the node takes a number to one minus the number."""
    if node.type == "MATH" and node.operation == "SUBTRACT":
        return into == node.inputs[1] and not node.inputs[0].is_linked and node.inputs[0].default_value == 1.0
    if node.type == "MATH" and node.operation == "MULTIPLY_ADD":
        return into == node.inputs[0] and node.inputs[1].default_value < 0.0
    return node.type == "INVERT"
