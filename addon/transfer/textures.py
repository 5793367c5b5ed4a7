# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures of the source's materials, baked into the target's own UV layout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ..mesh_read import UnusableObjectError
from ..typed import Flags, Options, Values
from .baking import bake, materials_of, materials_on, triangles_used, uses_of
from .copies import MADE_FROM, ORIGINAL
from .image_nodes import image_nodes, images, normal_maps
from .image_pixels import store
from .kind import Kind, Prepared
from .layouts import NEEDED, NEVER, OVERLAPS, bake_map, may_bake, takes_over
from .listed import listed
from .material_copies import fitting, forget, is_made_from, made_title, own_copy
from .sheets import sheets

if TYPE_CHECKING:
    from .image_nodes import Laid
    from .route import Route
    from .sheets import Sheets


def names(source: bpy.types.Object) -> list[str]:
    return sorted({image.name for image in images(materials_on(source))})


def prepare(route: Route, wanted: Sequence[str], options: Options) -> Prepared:
    if takes_over(route, options):
        words = (
            f"Textures of '{route.target.name}' are shown by the source's UV map, which they fit as they "
            "are: they were not baked. To bake them, unwrap it, or choose a UV map of its own"
        )
        return Prepared(partial(_show_originals, route, options), (words,))
    notes: list[str] = []
    baked: dict[tuple[Laid, int], dict[int, Values]] = {}
    uses = uses_of(route.source, wanted, notes)
    try:
        target_uv = _own_layout(route, options)
    except UnusableObjectError as reason:
        notes.append(str(reason))
    else:
        with route.mesh_as_written() as mesh:
            of = {use: triangles_used(route, materials) for use, materials in materials_of(uses).items()}
            try:
                parts, overlap = sheets(route, target_uv, _any([used for _, used in of.values()]))
                notes += overlap
            except UnusableObjectError as reason:
                notes.append(str(reason))
                of = {}
            for use, (source_used, target_used) in of.items():
                for number in parts.numbers:
                    used = source_used, target_used & (parts.triangles == number)
                    if number and not used[1].any():
                        continue
                    try:
                        baked[use, number] = bake(route, mesh, use, used, target_uv, options)
                    except UnusableObjectError as reason:
                        notes.append(str(reason))
    # An image that several nodes or materials lay on in the same way is told of once.
    notes = list(dict.fromkeys(notes))
    if not baked and not any(others for kind, others in route.wanted.items() if kind != KIND.identifier):
        raise UnusableObjectError(" ".join(notes))
    if options.bake_material:
        notes += _unseen(route, uses, baked)

    def write() -> None:
        titles = _titles(route, baked, parts) if baked else {}
        images: dict[tuple[Laid | None, int], bpy.types.Image] = {
            key: store(title, baked[key], key[0].image) for key, title in titles.items()
        }
        if images and options.bake_material:
            _fill_slots(route)
            _replace_materials(route, uses, images, target_uv, parts)
        for image in images.values():
            # Without a user it would not be saved.
            image.use_fake_user = not image.users

    return Prepared(write, notes)


def _any(masks: Sequence[Flags]) -> Flags:
    return np.logical_or.reduce(masks) if masks else np.zeros(0, bool)


def _titles(route: Route, baked: Iterable[tuple[Laid, int]], parts: Sheets) -> dict[tuple[Laid, int], str]:
    """A name for each baked image; those laid on in several ways are numbered."""
    titles: dict[tuple[Laid, int], str] = {}
    times: Counter[str] = Counter()
    for use, number in baked:
        title = _part_title(use.image, route.target, parts, number)
        times[title] += 1
        titles[use, number] = f"{title} {times[title]}" if times[title] > 1 else title
    return titles


def _part_title(original: bpy.types.ID, target: bpy.types.Object, parts: Sheets, number: int) -> str:
    """Name of what is made from an image or material for a part of the target."""
    return " ".join([made_title(original, target), parts.names[number]]).rstrip()


def _own_layout(route: Route, options: Options) -> str:
    name = bake_map(route, options)
    if name not in route.target.data.uv_layers:
        raise UnusableObjectError(
            f"'{route.target.name}' has no UV map '{name}' to bake textures into. Choose another one"
            if name
            else f"'{route.target.name}' has no UV map of its own to bake textures into. Unwrap it first"
        )
    return name


def _unseen(
    route: Route, uses: Mapping[bpy.types.Material, list[Laid | None]], baked: Iterable[tuple[Laid, int]]
) -> list[str]:
    """Words about baked images that no material of the target will show."""
    slots = route.target.material_slots
    carried = route.wanted.get("materials", ())

    def seen(material: bpy.types.Material) -> bool:
        shown = any(is_made_from(slot.material, material, route.target) for slot in slots)
        return not slots or shown or material.name in carried

    materials = materials_of(uses)
    unseen = sorted({use.image.name for use, _ in baked if not any(map(seen, materials[use]))})
    if not unseen:
        return []
    which = listed(f"'{name}'" for name in unseen)
    return [
        f"The materials of '{route.target.name}' do not show what was baked from {which}: use the baked "
        "images in them, or check Materials and transfer again"
    ]


def _fill_slots(route: Route) -> None:
    """Give a target without material slots those of the source; of one of several meshes those it shows."""
    if not route.target.material_slots:
        label, slots = route.carried_slots, route.source.material_slots
        given = np.arange(len(slots)) if len(route.view.starts) == 1 else np.unique(label)
        for place in given.tolist():
            route.target.data.materials.append(slots[place].material)
        index = np.searchsorted(given, label).astype(np.int32)
        route.target.data.polygons.foreach_set("material_index", index)


def _show_originals(route: Route, options: Options) -> None:
    """Give the target's slots the source's materials instead of copies with baked images."""
    if not options.bake_material:
        return
    _fill_slots(route)
    for material in materials_on(route.source):
        shown = fitting(route, material)
        for slot in route.target.material_slots:
            if is_made_from(slot.material, material, route.target):
                slot.material = shown


def _replace_materials(
    route: Route,
    uses: Mapping[bpy.types.Material, list[Laid | None]],
    images: Mapping[tuple[Laid | None, int], bpy.types.Image],
    uv: str,
    parts: Sheets,
) -> None:
    """In the target's slots: copies of the source's materials with the baked images on the target's map.

    Where the target has several parts, their faces get a slot each.
    """
    target = route.target
    slots = target.material_slots
    for material, laid_on in uses.items():
        places = [at for at, slot in enumerate(slots) if is_made_from(slot.material, material, target)]
        numbers = [number for number in parts.numbers if any((use, number) in images for use in laid_on)]
        if not places or not numbers:
            continue
        earlier = [
            held for held in bpy.data.materials if held != material and is_made_from(held, material, target)
        ]
        replaced = {slots[at].material for at in places} - {material}
        copies = {}
        for number in numbers:
            copy = own_copy(route, material, _part_title(material, target, parts, number))
            _exchange(copy, [images.get((use, number)) for use in laid_on], uv)
            copies[number] = copy
        for held in bpy.data.materials:
            # What was baked from an earlier one for the next target in a chain.
            if held.get(ORIGINAL) in replaced:
                held[ORIGINAL] = copies[numbers[0]]
        _give_slots(target, places, copies, parts)
        forget(earlier)
        for copy in copies.values():
            copy.name = copy[MADE_FROM]


def _give_slots(
    target: bpy.types.Object, places: Sequence[int], copies: Mapping[int, bpy.types.Material], parts: Sheets
) -> None:
    """Show each part's copy of a material on the faces that show one of the slots at these places."""
    slots = target.material_slots
    for at in places:
        slots[at].material = next(iter(copies.values()))
    if len(copies) == 1:
        return
    index = np.empty(len(parts.faces), np.int32)
    target.data.polygons.foreach_get("material_index", index)
    shows = np.isin(index, places)
    free = list(places)
    for number, copy in copies.items():
        if free:
            at = free.pop(0)
            slots[at].material = copy
        else:
            at = len(slots)
            target.data.materials.append(copy)
        index[shows & (parts.faces == number)] = at
    target.data.polygons.foreach_set("material_index", index)


def _exchange(material: bpy.types.Material, images: Iterable[bpy.types.Image | None], uv: str) -> None:
    """Give the material's image nodes these images, None for none, and lay them on by the UV map."""
    named = {}
    for (groups, node), image in zip(image_nodes(material), images, strict=True):
        if image is None:
            continue
        node.image = image
        tree = node.id_data
        if tree not in named:
            named[tree] = tree.nodes.new("ShaderNodeUVMap")
            named[tree].uv_map = uv
            named[tree].parent, named[tree].location = node.parent, node.location
            named[tree].location.x -= node.width
        tree.links.new(named[tree].outputs["UV"], node.inputs["Vector"])
        for normal_map in normal_maps(groups, node):
            normal_map.uv_map = uv


KIND = Kind(
    "textures",
    "Textures",
    "TEXTURE",
    "Bake the source's image textures into the target's own UV layout. A target without one shows them by "
    "the source's UV map",
    names,
    prepare,
    {
        "bake_uv": StringProperty(
            name="UV Map",
            description="UV map of the target to bake into. Empty: the active one, or the first other one "
            "where the source's comes in its place",
        ),
        "bake_unwrap": EnumProperty(
            name="New UV Map",
            items=[
                (NEVER, "Never", "Bake into a UV map of its own in any case"),
                (
                    NEEDED,
                    "If Needed",
                    "Where places that should look different share texels of its own UV map, as in a "
                    "palette, or where nothing else shows the textures",
                ),
                (OVERLAPS, "If Overlapping", "Where its own UV map overlaps at all, or it has none"),
            ],
            default=NEEDED,
            description="When to give the target a new UV map by Smart UV Project, beside its own, and bake "
            "into that",
        ),
        "bake_size": EnumProperty(
            name="Size",
            items=[
                ("SOURCE", "As Source", "As large as the source's image"),
                *(
                    (str(side), f"{side} px", f"{side} by {side} pixels")
                    for side in (512, 1024, 2048, 4096, 8192)
                ),
            ],
            default="SOURCE",
            description="Size of the baked images",
        ),
        "bake_margin": IntProperty(
            name="Margin",
            default=16,
            min=0,
            soft_max=64,
            description="Pixels by which islands are extended into the empty space around them",
        ),
        "bake_material": BoolProperty(
            name="Replace Materials",
            default=True,
            description="Give the target copies of the materials that show the baked images",
        ),
    },
    words=("texture", "textures"),
    effects={
        # There is one to choose; those that come from the source show its textures as they are.
        "bake_uv": lambda _, bodies: (
            bodies is None or any(target.data.uv_layers for target in bodies.targets)
        ),
        "bake_size": may_bake,
        "bake_margin": may_bake,
    },
)
