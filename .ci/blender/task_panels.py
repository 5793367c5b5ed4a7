# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of the pages by task, in Blender's window, each as its page has it: one picture each.

The characters are those of cast.blend beside this script.
"""

import importlib
import os
import runpy

import bpy
import window

PANELS = ("pieces", "options", "result", "fix", "transfer", "outfit", "batch")
FACE = ("Head", "Eyes", "Lids", "Lashes", "Mouth", "Brows")
SKIN = (*FACE, "Hands", "Body")


def addon(name):
    package = next(key for key in bpy.context.preferences.addons.keys() if key.endswith("spectral_match"))
    return importlib.import_module(f"{package}.{name}")


def always(_kind, _context):
    return True


def never(_kind, _context):
    return False


def show_only(*names):
    """Let the tab have these panels alone, opened."""
    panels = [addon(name) for name in ("panels", "transfer_panel", "outfit_panel")]
    for name in PANELS:
        kind = next(
            getattr(module, found)
            for module in panels
            if hasattr(module, found := f"VIEW3D_PT_spectral_match_{name}")
        )
        bpy.utils.unregister_class(kind)
        kind.bl_options = set()
        kind.poll = classmethod(always if name in names else never)
        bpy.utils.register_class(kind)


def fresh():
    """The characters of the file, in a scene without anything else."""
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.collections])
    bpy.data.orphans_purge()
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "cast.blend")
    with bpy.data.libraries.load(path) as (there, taken):
        taken.collections = [name for name in there.collections if name in ("Mia", "Bruno", "Mia LOD")]
    for collection in taken.collections:
        bpy.context.scene.collection.children.link(collection)
    bpy.context.view_layer.update()


def choose(source, target, pieces=None):
    """Select a mesh of both, the source's active; of `pieces` only these take part."""
    for label in (source, target):
        for obj in bpy.data.collections[label].objects:
            if obj.type == "MESH":
                taking = pieces is None or obj.name.removeprefix(f"{label} ") in pieces
                obj.spectral_match_part = "AUTOMATIC" if taking else "LEFT_OUT"
    piece = "Body" if pieces is None or "Body" in pieces else "Head"
    chosen = [bpy.data.objects[f"{label} {piece}"] for label in (source, target)]
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in chosen)
    bpy.context.view_layer.objects.active = chosen[0]


def preset(name):
    folder = os.path.join(os.path.dirname(addon("panels").__file__), "presets", "spectral_match")
    runpy.run_path(os.path.join(folder, f"{name}.py"))


def matched(operator, **options):
    with bpy.context.temp_override(**window.view()):
        assert getattr(bpy.ops.spectral_match, operator)(**options) == {"FINISHED"}


def taken(name):
    """`yield from taken(name)`: the picture, and in a file of its name where the sidebar is in it."""
    yield 0.5
    yield from window.shot(name)
    sidebar = window.region("UI")
    place = (*window.point("UI", 0, 0), sidebar.width, sidebar.height)
    with open(os.path.join(os.environ["PICTURES"], f"{name}.txt"), "w", encoding="utf-8") as file:
        file.write(" ".join(map(str, place)))


def steps():
    bpy.context.preferences.system.use_region_overlap = False
    fresh()
    show_only()
    yield from window.open_tab("Match")
    choose("Mia", "Bruno")
    yield from taken("pair")
    choose("Mia", "Mia LOD")
    yield from taken("levels")

    choose("Mia", "Bruno", FACE)
    show_only("pieces")
    yield from taken("pieces")

    show_only("transfer")
    for source, target, pieces, presets in (
        ("Mia", "Bruno", FACE, {"face": "Face"}),
        ("Mia", "Bruno", None, {"textures": "Texturing", "rig": "Rig"}),
        ("Mia", "Mia LOD", None, {"lods": "Retopology _slash_ LOD"}),
    ):
        fresh()
        choose(source, target, pieces)
        matched("match")
        for name, file in presets.items():
            preset(file)
            # What was left out, as hair and clothes, stays where it is.
            bpy.context.scene.spectral_match.use_objects = False
            bpy.context.scene.spectral_match.open_textures = name == "textures"
            matched("transfer")
            yield from taken(name)

    fresh()
    show_only("outfit")
    choose("Mia", "Bruno", SKIN)
    matched("match")
    for name in ("Shirt", "Trousers", "Belt", "Shoes"):
        bpy.data.objects[f"Bruno {name}"].hide_set(True)
    for name in ("Mia Hair", "Mia Ties", "Mia Brows", "Mia Lashes", "Bruno Brows"):
        bpy.data.objects[name].spectral_match_worn = "NOT_WORN"
    matched("fit_outfit")
    yield from taken("outfit")


window.run(steps)
