# SPDX-License-Identifier: GPL-3.0-or-later
"""A Geometry Nodes group that moves a target's vertices to their places on the source, posed as that is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeGuard

import bpy

from .typed import EnumItem

GROUP = MODIFIER = "Spectral Match Morph"
# Inputs of the group, made in this order, by their identifiers, which stay when somebody renames them.
FACTOR, SOURCE, IN_PLACE, WIPE = "Socket_1", "Socket_2", "Socket_3", "Socket_4"

# So that the first press shows something: the source's surface, where the target stands.
AT_FIRST = {FACTOR: 1.0, IN_PLACE: True}
# What a modifier keeps when it is aimed at another source.
HELD = (FACTOR, IN_PLACE, WIPE)
# Attributes of a target that is morphed: the source's surface laid over the target, and how far along the
# body each vertex is, from 0 to 1.
FITTED, ALONG = "match_in_place", "match_wipe"
# Which mesh of the source answers, or -1 where that is shown with other vertices than it has, and the three
# of its vertices that have the image between them.
PIECE, CORNERS = "match_morph_piece", ("match_morph_1", "match_morph_2", "match_morph_3")
# The share of the body in which a wipe goes over from one surface to the other: wide enough that faces are
# not torn, narrow enough to be an edge.
WIPE_EDGE = 0.05


def modifier_of(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """The morph modifier of an object, or None."""
    found = obj.modifiers.get(MODIFIER)
    return found if found is not None and found.type == "NODES" else None


def is_whole(modifier: bpy.types.Modifier | None) -> TypeGuard[bpy.types.Modifier]:
    """Whether this is a morph modifier whose group still has its inputs."""
    if modifier is None or modifier.node_group is None:
        return False
    inputs = {
        item.identifier for item in modifier.node_group.interface.items_tree if item.item_type == "SOCKET"
    }
    return {FACTOR, SOURCE, IN_PLACE, WIPE} <= inputs


def place_of(modifier: bpy.types.Modifier, identifier: str) -> tuple[Any, str]:
    """Owner and property path of a group input's value, as a panel takes them."""
    # From Blender 5.2 on inputs are properties of their own; before, they are custom properties.
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier), "value"
    return modifier, f'["{identifier}"]'


def value(modifier: bpy.types.Modifier, identifier: str) -> Any:
    owner, path = place_of(modifier, identifier)
    return owner.path_resolve(path)


def set_value(modifier: bpy.types.Modifier, identifier: str, new: Any) -> None:
    owner, path = place_of(modifier, identifier)
    if owner == modifier:
        modifier[path[2:-2]] = new
    else:
        owner.value = new
    if identifier in (IN_PLACE, WIPE):
        _settle(modifier)
    modifier.id_data.update_tag()


def _settle(modifier: bpy.types.Modifier) -> None:
    """What is laid over the target belongs to its rest pose, which its rig then moves; else it comes last."""
    stack = modifier.id_data.modifiers
    kinds = [each.type for each in stack]
    place, last = stack.find(modifier.name), len(stack) - 1
    laid = value(modifier, IN_PLACE) or value(modifier, WIPE)
    wanted = kinds.index("ARMATURE") if laid and "ARMATURE" in kinds else last
    if place != wanted and not (laid and place < wanted):
        stack.move(place, wanted)


def factor_of(obj: bpy.types.Object) -> float:
    modifier = modifier_of(obj)
    return value(modifier, FACTOR) if is_whole(modifier) else 0.0


def add(target: bpy.types.Object, sources: Sequence[bpy.types.Object]) -> None:
    """Give a target the modifier, or aim the one that it has at these meshes of its source.

    `laid_over.write` gives it the attributes.
    """
    modifier, name = modifier_of(target), GROUP if len(sources) == 1 else f"{GROUP} {len(sources)}"
    new = modifier is None
    if modifier is None:
        modifier = target.modifiers.new(MODIFIER, "NODES")
    before = {} if new or not is_whole(modifier) else {way: value(modifier, way) for way in HELD}
    _use(modifier, bpy.data.node_groups.get(name))
    if not is_whole(modifier) or len(_sources_of(modifier)) != len(sources):
        _use(modifier, make_group(name, len(sources)))
    for identifier, source in zip(_sources_of(modifier), sources, strict=True):
        set_value(modifier, identifier, source)
    for way, held in (AT_FIRST | before).items():
        set_value(modifier, way, held)


def _use(modifier: bpy.types.Modifier, group: bpy.types.NodeTree | None) -> None:
    """Exchange the group of a modifier; one that nothing uses any more goes."""
    earlier, modifier.node_group = modifier.node_group, group
    if earlier is not None and earlier.users == 0:
        bpy.data.node_groups.remove(earlier)


def _sources_of(modifier: bpy.types.Modifier) -> list[str]:
    """Identifiers of the group inputs that take the meshes of a source."""
    return [
        item.identifier
        for item in modifier.node_group.interface.items_tree
        if item.item_type == "SOCKET" and item.socket_type == "NodeSocketObject"
    ]


def remove(target: bpy.types.Object) -> None:
    modifier = modifier_of(target)
    if modifier is None:
        return
    # A modifier that is removed with them keeps them counted as used.
    for identifier in _sources_of(modifier) if is_whole(modifier) else ():
        set_value(modifier, identifier, None)
    _use(modifier, None)
    target.modifiers.remove(modifier)
    for name in (FITTED, ALONG, PIECE, *CORNERS):
        if name in target.data.attributes:
            target.data.attributes.remove(target.data.attributes[name])


def make_group(name: str, pieces: int) -> bpy.types.NodeTree:
    """Position = mix(position, there, factor), for a source of so many pieces.

    `there` is the place between the three `CORNERS` of `PIECE`, as that is posed, or `match_position`, seen
    from the target's own space; or, In Place and in a Wipe, `FITTED`. In a Wipe the factor of a vertex is how
    far the edge, which runs from one end of the body to the other, is past it. Vertices without a match, as
    of a mesh joined to the target later, stay.
    """
    kind: EnumItem = "GeometryNodeTree"
    group = bpy.data.node_groups.new(name, kind)
    group.is_modifier = True
    group.description = "Moves vertices to their places on the source of the match"
    inputs = {}
    for name, kind in (
        ("Geometry", "NodeSocketGeometry"),
        ("Factor", "NodeSocketFloat"),
        ("Source", "NodeSocketObject"),
        ("In Place", "NodeSocketBool"),
        ("Wipe", "NodeSocketBool"),
    ):
        inputs[name] = group.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given = ["Source", *(f"Source {number}" for number in range(2, pieces + 1))]
    for name in given[1:]:
        socket = group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketObject")
        socket.hide_in_modifier = True
    factor = inputs["Factor"]
    factor.subtype, factor.min_value, factor.max_value, factor.default_value = "FACTOR", 0.0, 1.0, 0.0
    factor.description = "0 is the target's own shape, 1 the source's"
    inputs["In Place"].description = "Lay the source's shape over the target instead of moving it there"
    inputs["Wipe"].description = "Go over to the source's shape from one end of the body to the other"

    nodes, links = group.nodes, group.links

    def node(kind: str, place: tuple[float, float], **settings: Any) -> bpy.types.Node:
        made = nodes.new(kind)
        made.location = place
        for name, value in settings.items():
            setattr(made, name, value)
        return made

    def named(name: str, data_type: str, place: tuple[float, float]) -> bpy.types.Node:
        made = node("GeometryNodeInputNamedAttribute", place, data_type=data_type)
        made.inputs["Name"].default_value = name
        return made

    def enabled(sockets: Iterable[bpy.types.NodeSocket], kind: str) -> list[bpy.types.NodeSocket]:
        return [socket for socket in sockets if socket.enabled and socket.type == kind]

    def between(geometry: bpy.types.NodeSocket, row: float) -> bpy.types.NodeSocket:
        """The place between its corners on a piece as shown."""
        own, parts = node("GeometryNodeInputPosition", (-1700, row)), []
        shares = node("ShaderNodeSeparateXYZ", (-1700, row - 120))
        links.new(enabled(weights.outputs, "VECTOR")[0], shares.inputs["Vector"])
        for number, corner in enumerate(corners):
            sample = node(
                "GeometryNodeSampleIndex", (-1500, row), data_type="FLOAT_VECTOR", domain="POINT", clamp=False
            )
            part = node("ShaderNodeVectorMath", (-1340, row), operation="SCALE")
            links.new(geometry, sample.inputs["Geometry"])
            links.new(own.outputs["Position"], enabled(sample.inputs, "VECTOR")[0])
            links.new(enabled(corner.outputs, "INT")[0], sample.inputs["Index"])
            links.new(enabled(sample.outputs, "VECTOR")[0], part.inputs[0])
            links.new(shares.outputs[number], part.inputs["Scale"])
            parts.append(part.outputs["Vector"])
        found = parts[0]
        for other in parts[1:]:
            total = node("ShaderNodeVectorMath", (-1180, row), operation="ADD")
            links.new(found, total.inputs[0])
            links.new(other, total.inputs[1])
            found = total.outputs["Vector"]
        return found

    incoming = node("NodeGroupInput", (-2100, 0))
    weights = named("match_barycentric", "FLOAT_VECTOR", (-2100, -600))
    corners = [named(name, "INT", (-2100, -800 - 160 * number)) for number, name in enumerate(CORNERS)]
    piece = named(PIECE, "INT", (-2100, -440))
    outgoing = node("NodeGroupOutput", (700, 0))
    image = named("match_position", "FLOAT_VECTOR", (-900, -250))
    fitted = named(FITTED, "FLOAT_VECTOR", (-660, -640))
    along = named(ALONG, "FLOAT", (-660, 240))
    infos = [
        node("GeometryNodeObjectInfo", (-1900, -420 - 400 * number), transform_space="RELATIVE")
        for number in range(pieces)
    ]
    moved = node("FunctionNodeTransformPoint", (-420, -300))
    over = node("FunctionNodeBooleanMath", (-420, -80), operation="OR")
    chosen = node("GeometryNodeSwitch", (-180, -200), input_type="VECTOR")
    # The edge starts before the body and ends behind it.
    edge = node("ShaderNodeMath", (-660, 420), operation="MULTIPLY")
    edge.inputs[1].default_value = 1.0 + WIPE_EDGE
    past = node("ShaderNodeMath", (-420, 340), operation="SUBTRACT")
    wiped = node("ShaderNodeMath", (-180, 340), operation="DIVIDE", use_clamp=True)
    wiped.inputs[1].default_value = WIPE_EDGE
    share = node("GeometryNodeSwitch", (60, 240), input_type="FLOAT")
    own = node("GeometryNodeInputPosition", (60, 40))
    mixed = node("ShaderNodeMix", (280, -60), data_type="VECTOR")
    placed = node("GeometryNodeSetPosition", (500, 0))

    links.new(enabled(image.outputs, "VECTOR")[0], moved.inputs["Vector"])
    links.new(infos[0].outputs["Transform"], moved.inputs["Transform"])
    there = enabled(moved.outputs, "VECTOR")[0]
    for number, (name, info) in enumerate(zip(given, infos, strict=True)):
        links.new(incoming.outputs[name], info.inputs["Object"])
        row = -420.0 - 400.0 * number
        here = node("FunctionNodeCompare", (-1020, row), data_type="INT", operation="EQUAL")
        first, second = enabled(here.inputs, "INT")
        second.default_value = number
        shown = node("GeometryNodeSwitch", (-860, row), input_type="VECTOR")
        links.new(enabled(piece.outputs, "INT")[0], first)
        links.new(here.outputs["Result"], shown.inputs["Switch"])
        links.new(there, shown.inputs["False"])
        links.new(between(info.outputs["Geometry"], row), shown.inputs["True"])
        there = shown.outputs["Output"]
    links.new(incoming.outputs["In Place"], over.inputs[0])
    links.new(incoming.outputs["Wipe"], over.inputs[1])
    links.new(over.outputs["Boolean"], chosen.inputs["Switch"])
    links.new(there, chosen.inputs["False"])
    links.new(enabled(fitted.outputs, "VECTOR")[0], chosen.inputs["True"])
    links.new(incoming.outputs["Factor"], edge.inputs[0])
    links.new(edge.outputs["Value"], past.inputs[0])
    links.new(enabled(along.outputs, "VALUE")[0], past.inputs[1])
    links.new(past.outputs["Value"], wiped.inputs[0])
    links.new(incoming.outputs["Wipe"], share.inputs["Switch"])
    links.new(incoming.outputs["Factor"], share.inputs["False"])
    links.new(wiped.outputs["Value"], share.inputs["True"])
    links.new(share.outputs["Output"], next(s for s in mixed.inputs if s.enabled and s.name == "Factor"))
    links.new(own.outputs["Position"], enabled(mixed.inputs, "VECTOR")[0])
    links.new(chosen.outputs["Output"], enabled(mixed.inputs, "VECTOR")[1])
    links.new(incoming.outputs["Geometry"], placed.inputs["Geometry"])
    links.new(image.outputs["Exists"], placed.inputs["Selection"])
    links.new(enabled(mixed.outputs, "VECTOR")[0], placed.inputs["Position"])
    links.new(placed.outputs["Geometry"], outgoing.inputs["Geometry"])
    return group
