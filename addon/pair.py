# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is the source and who are the targets: the selection, or the two objects pinned in the panel."""

from dataclasses import dataclass, field

import bpy


@dataclass(frozen=True)
class Pair:
    """`source` and `targets`, and in `missing` what to do when they are not complete."""

    source: bpy.types.Object | None
    targets: list = field(default_factory=list)
    missing: str = ""


def resolve(context):
    """The objects that the next match is about."""
    settings = context.scene.spectral_match
    if settings.pinned:
        return _of(settings.source, [settings.target] if settings.target else [])
    active = context.view_layer.objects.active
    if active is not None and active.instance_type == "COLLECTION" and active.instance_collection:
        return Pair(
            None,
            [],
            f"'{active.name}' only shows a collection. Use Object > Apply > Make Instances Real, "
            "or select the meshes themselves",
        )
    if active is None or active.type != "MESH":
        return Pair(None, [], "Select the target, then Shift-click the source: two meshes")
    others = [obj for obj in context.view_layer.objects.selected if obj != active and obj.type == "MESH"]
    if not others:
        # A matched target alone still means the pair it was matched in, even if the source is gone.
        if active.data.spectral_match.target_fingerprint:
            return _of(active.spectral_match_source, [active])
        return Pair(active, [], f"Add a target: select it first, then Shift-click '{active.name}'")
    return _of(active, others)


def matched(context):
    """The targets that have a match, however old."""
    return [obj for obj in resolve(context).targets if obj.data.spectral_match.target_fingerprint]


def _of(source, targets):
    if not is_there(source):
        return Pair(None, targets, _absent([source]) + "Choose a source: the mesh that has the data")
    there = [obj for obj in targets if is_there(obj) and obj != source]
    if not there:
        return Pair(source, [], _absent(targets) + "Choose a target: another mesh, which receives the data")
    if all(obj.data == source.data for obj in there):
        return Pair(source, there, "Source and target share one mesh, so they have the same data already")
    return Pair(source, there)


def _absent(objects):
    """Words about a chosen object that no scene has."""
    for obj in objects:
        if obj is not None and not is_there(obj):
            return f"'{obj.name}' is in no scene: it was deleted, or only an instance shows it. "
    return ""


def is_there(obj):
    """False for None and for an object that was deleted and is only kept by a reference to it."""
    return obj is not None and bool(obj.users_scene)
