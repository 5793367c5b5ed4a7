# SPDX-License-Identifier: GPL-3.0-or-later
"""A Geometry Nodes group that moves a target's vertices to their places on the source."""

import bpy

GROUP = MODIFIER = "Spectral Match Morph"
FACTOR = "Factor"
SOURCE = "Source"
IN_PLACE = "In Place"


def modifier_of(obj):
    """The morph modifier of an object, or None."""
    found = obj.modifiers.get(MODIFIER)
    return found if found is not None and found.type == "NODES" else None


def place_of(modifier, name):
    """Owner and property path of a group input's value, as a panel takes them."""
    items = modifier.node_group.interface.items_tree
    identifier = next(item.identifier for item in items if item.name == name and item.in_out == "INPUT")
    # From Blender 5.2 on inputs are properties of their own; before, they are custom properties.
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier), "value"
    return modifier, f'["{identifier}"]'


def value(modifier, name):
    owner, path = place_of(modifier, name)
    return owner.path_resolve(path)


def set_value(modifier, name, new):
    owner, path = place_of(modifier, name)
    if owner == modifier:
        modifier[path[2:-2]] = new
    else:
        owner.value = new
    modifier.id_data.update_tag()


def factor_of(obj):
    modifier = modifier_of(obj)
    return 0.0 if modifier is None or modifier.node_group is None else value(modifier, FACTOR)


def add(target):
    modifier = target.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = bpy.data.node_groups.get(GROUP) or make_group()
    set_value(modifier, SOURCE, target.spectral_match_source)
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

    With In Place it is taken as it stands, so that the target takes the source's shape where it is.
    Vertices without a match, as of a mesh joined to the target later, stay.
    """
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    group.description = "Moves vertices to their places on the source of the match"
    inputs = {}
    for name, kind in (("Geometry", "NodeSocketGeometry"), (FACTOR, "NodeSocketFloat")):
        inputs[name] = group.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    inputs[SOURCE] = group.interface.new_socket(SOURCE, in_out="INPUT", socket_type="NodeSocketObject")
    inputs[IN_PLACE] = group.interface.new_socket(IN_PLACE, in_out="INPUT", socket_type="NodeSocketBool")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    factor = inputs[FACTOR]
    factor.subtype, factor.min_value, factor.max_value, factor.default_value = "FACTOR", 0.0, 1.0, 0.0
    factor.description = "0 is the target's own shape, 1 the source's"
    inputs[IN_PLACE].description = "Keep the target where it stands instead of moving it onto the source"

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
    chosen = node("GeometryNodeSwitch", (-100, -200), input_type="VECTOR")
    own = node("GeometryNodeInputPosition", (-100, -80))
    mixed = node("ShaderNodeMix", (140, -120), data_type="VECTOR")
    placed = node("GeometryNodeSetPosition", (380, 0))

    links.new(incoming.outputs[SOURCE], there.inputs["Object"])
    links.new(image.outputs["Attribute"], moved.inputs["Vector"])
    links.new(there.outputs["Transform"], moved.inputs["Transform"])
    links.new(incoming.outputs[IN_PLACE], chosen.inputs["Switch"])
    links.new(moved.outputs["Vector"], chosen.inputs["False"])
    links.new(image.outputs["Attribute"], chosen.inputs["True"])
    vectors = [socket for socket in mixed.inputs if socket.type == "VECTOR" and socket.enabled]
    links.new(incoming.outputs[FACTOR], next(s for s in mixed.inputs if s.enabled and s.name == "Factor"))
    links.new(own.outputs["Position"], vectors[-2])
    links.new(chosen.outputs["Output"], vectors[-1])
    links.new(incoming.outputs["Geometry"], placed.inputs["Geometry"])
    links.new(image.outputs["Exists"], placed.inputs["Selection"])
    links.new(next(s for s in mixed.outputs if s.enabled), placed.inputs["Position"])
    links.new(placed.outputs["Geometry"], outgoing.inputs["Geometry"])
    return group
