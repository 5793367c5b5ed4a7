# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of the source's materials for a target, which show other images or name other UV maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import bpy

from .copies import MADE_FROM, ORIGINAL, copied
from .image_nodes import image_nodes

if TYPE_CHECKING:
    from .route import Route

# Nodes that name a UV map, and the property in which they do.
NAMING = {"UVMAP": "uv_map", "NORMAL_MAP": "uv_map", "TANGENT": "uv_map", "ATTRIBUTE": "attribute_name"}


def made_title(original: bpy.types.ID, target: bpy.types.Object) -> str:
    """Name of what is made from an image or a material for the target. In `MADE_FROM` it tells it from
    others of that name.
    """
    return f"{original.name} {target.name}"


def is_made_from(
    material: bpy.types.Material | None, original: bpy.types.Material | None, target: bpy.types.Object
) -> bool:
    """Whether the material is the original, or the copy of it that was made for the target; None is none."""
    if material is None or original is None:
        return material == original
    kept = material.get(ORIGINAL)
    known = kept == original if kept else material.get(MADE_FROM) == made_title(original, target)
    return known or material == original


def slot_name(slot: bpy.types.MaterialSlot, place: int) -> str:
    """What an artist chooses the source's slot by, the empty one too."""
    return slot.material.name if slot.material else f"Empty Slot {place + 1}"


def fitting(route: Route, material: bpy.types.Material | None) -> bpy.types.Material | None:
    """What shows the source's material on the target: itself, or a copy that names UV maps as they came."""
    renamed = _renamed(route)
    if material is None or not material.node_tree or not _names_any(material.node_tree, renamed, set()):
        return material
    title = made_title(material, route.target)
    before = [held for held in bpy.data.materials if held != material and held.get(MADE_FROM) == title]
    copy = own_copy(route, material, title)
    for held in before:
        held.user_remap(copy)
    forget(before)
    copy.name = title
    return copy


def own_copy(route: Route, material: bpy.types.Material, title: str) -> bpy.types.Material:
    """A copy of the material, with copies of the node groups that hold images or name UV maps that came under
    other names, which it names so.
    """
    copy, renamed = copied(material), _renamed(route)
    copy[MADE_FROM], copy[ORIGINAL] = title, material
    with_images = {around.node_tree for groups, _ in image_nodes(copy) for around in groups}

    def own_groups(tree: bpy.types.NodeTree) -> None:
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree is not None:
                if node.node_tree in with_images or _names_any(node.node_tree, renamed, set()):
                    node.node_tree = copied(node.node_tree)
                    node.node_tree[MADE_FROM] = title
                    own_groups(node.node_tree)
            elif node.type in NAMING:
                name = getattr(node, NAMING[node.type])
                setattr(node, NAMING[node.type], renamed.get(name, name))

    own_groups(copy.node_tree)
    return copy


def forget(materials: list[bpy.types.Material]) -> None:
    """Remove those of these copies that nothing uses any more, and of the node groups that came with them."""
    titles = {material[MADE_FROM] for material in materials if MADE_FROM in material}
    _remove_unused(bpy.data.materials, materials)
    groups = [group for group in bpy.data.node_groups if group.get(MADE_FROM) in titles]
    while _remove_unused(bpy.data.node_groups, groups):
        pass


def _remove_unused(collection: Any, held: list[Any]) -> bool:
    """Remove those of `held` that nothing uses any more, from it too; whether there were any."""
    unused = [data for data in held if not data.users]
    for data in unused:
        held.remove(data)
        collection.remove(data)
    return bool(unused)


def _renamed(route: Route) -> dict[str, str]:
    return {name: own for name, own in route.uv_names.items() if own != name}


def _names_any(tree: bpy.types.NodeTree, renamed: Mapping[str, str], seen: set[bpy.types.NodeTree]) -> bool:
    """Whether a node of the tree, or of a group in it, names one of these UV maps."""
    if not renamed or tree in seen:
        return False
    seen.add(tree)
    return any(
        (node.type in NAMING and getattr(node, NAMING[node.type]) in renamed)
        or (node.type == "GROUP" and node.node_tree is not None and _names_any(node.node_tree, renamed, seen))
        for node in tree.nodes
    )
