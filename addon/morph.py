# SPDX-License-Identifier: GPL-3.0-or-later
"""A Geometry Nodes group that moves a target's vertices to their places on the source."""

import bpy

GROUP = MODIFIER = "Spectral Match Morph"
# Inputs of the group, made in this order, by their identifiers, which stay when somebody renames them.
FACTOR, SOURCE, IN_PLACE = "Socket_1", "Socket_2", "Socket_3"

# So that the first press shows something: the target as the source's surface.
AT_FIRST = 1.0


def modifier_of(obj):
    """The morph modifier of an object, or None."""
    found = obj.modifiers.get(MODIFIER)
    return found if found is not None and found.type == "NODES" else None


def is_whole(modifier):
    """Whether this is a morph modifier whose group still has its inputs."""
    if modifier is None or modifier.node_group is None:
        return False
    inputs = {
        item.identifier for item in modifier.node_group.interface.items_tree if item.item_type == "SOCKET"
    }
    return {FACTOR, SOURCE, IN_PLACE} <= inputs


def place_of(modifier, identifier):
    """Owner and property path of a group input's value, as a panel takes them."""
    # From Blender 5.2 on inputs are properties of their own; before, they are custom properties.
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier), "value"
    return modifier, f'["{identifier}"]'


def value(modifier, identifier):
    owner, path = place_of(modifier, identifier)
    return owner.path_resolve(path)


def set_value(modifier, identifier, new):
    owner, path = place_of(modifier, identifier)
    if owner == modifier:
        modifier[path[2:-2]] = new
    else:
        owner.value = new
    modifier.id_data.update_tag()


def factor_of(obj):
    modifier = modifier_of(obj)
    return value(modifier, FACTOR) if is_whole(modifier) else 0.0


def add(target):
    modifier = target.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = bpy.data.node_groups.get(GROUP)
    if not is_whole(modifier):
        modifier.node_group = make_group()
    set_value(modifier, SOURCE, target.spectral_match_source)
    set_value(modifier, FACTOR, AT_FIRST)
    return modifier


def remove(target):
    modifier = modifier_of(target)
    if modifier is None:
        return
    group = modifier.node_group
    target.modifiers.remove(modifier)
    if group is not None and group.users == 0:
        bpy.data.node_groups.remove(group)


def make_group():
    """Position = mix(position, match_position, factor), `match_position` seen from the target's own space.

    With In Place only its direction from the source's origin is, so that the target takes the source's shape,
    turned and scaled as that is, about its own origin.
    Vertices without a match, as of a mesh joined to the target later, stay.
    """
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    group.description = "Moves vertices to their places on the source of the match"
    inputs = {}
    for name, kind in (
        ("Geometry", "NodeSocketGeometry"),
        ("Factor", "NodeSocketFloat"),
        ("Source", "NodeSocketObject"),
        ("In Place", "NodeSocketBool"),
    ):
        inputs[name] = group.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    factor = inputs["Factor"]
    factor.subtype, factor.min_value, factor.max_value, factor.default_value = "FACTOR", 0.0, 1.0, 0.0
    factor.description = "0 is the target's own shape, 1 the source's"
    inputs["In Place"].description = "Keep the target where it stands instead of moving it onto the source"

    nodes, links = group.nodes, group.links

    def node(kind, place, **settings):
        made = nodes.new(kind)
        made.location = place
        for name, value in settings.items():
            setattr(made, name, value)
        return made

    incoming = node("NodeGroupInput", (-800, 0))
    outgoing = node("NodeGroupOutput", (600, 0))
    image = node("GeometryNodeInputNamedAttribute", (-800, -250), data_type="FLOAT_VECTOR")
    image.inputs["Name"].default_value = "match_position"
    there = node("GeometryNodeObjectInfo", (-560, -420), transform_space="RELATIVE")
    moved = node("FunctionNodeTransformPoint", (-320, -300))
    turned = node("FunctionNodeTransformDirection", (-320, -460))
    chosen = node("GeometryNodeSwitch", (-100, -200), input_type="VECTOR")
    own = node("GeometryNodeInputPosition", (-100, -80))
    mixed = node("ShaderNodeMix", (140, -120), data_type="VECTOR")
    placed = node("GeometryNodeSetPosition", (380, 0))

    links.new(incoming.outputs["Source"], there.inputs["Object"])
    links.new(image.outputs["Attribute"], moved.inputs["Vector"])
    links.new(there.outputs["Transform"], moved.inputs["Transform"])
    links.new(incoming.outputs["In Place"], chosen.inputs["Switch"])
    links.new(moved.outputs["Vector"], chosen.inputs["False"])
    links.new(image.outputs["Attribute"], turned.inputs["Direction"])
    links.new(there.outputs["Transform"], turned.inputs["Transform"])
    links.new(turned.outputs["Direction"], chosen.inputs["True"])
    vectors = [socket for socket in mixed.inputs if socket.type == "VECTOR" and socket.enabled]
    links.new(incoming.outputs["Factor"], next(s for s in mixed.inputs if s.enabled and s.name == "Factor"))
    links.new(own.outputs["Position"], vectors[-2])
    links.new(chosen.outputs["Output"], vectors[-1])
    links.new(incoming.outputs["Geometry"], placed.inputs["Geometry"])
    links.new(image.outputs["Exists"], placed.inputs["Selection"])
    links.new(next(s for s in mixed.outputs if s.enabled), placed.inputs["Position"])
    links.new(placed.outputs["Geometry"], outgoing.inputs["Geometry"])
    return group
