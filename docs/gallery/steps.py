# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of single steps, for the pages by task."""

import bpy
import numpy as np
from cast import studio
from PIL import Image
from show import HERE, STEP, keep_carried, opened, pieces, posed

BONE = (0.02, 0.25, 0.85, 1.0)
PAPER = (0.90, 0.91, 0.92)


def layered(name, width, height, *layers):
    """Draw what stands in the scene, `width` metres wide, a layer (objects, what colours them) over the
    other."""
    studio.built(width=width).hide_render = True
    view = bpy.context.scene
    view.render.engine, view.display.render_aa = "BLENDER_WORKBENCH", "16"
    view.render.film_transparent = True
    view.render.image_settings.color_mode = "RGBA"
    view.render.resolution_x, view.render.resolution_y = 1200, height
    view.view_settings.view_transform, view.view_settings.look = "Standard", "None"
    # Studio light alone leaves the colours duller than they are on the surface.
    view.view_settings.exposure = 0.7
    shading = view.display.shading
    shading.light, shading.show_specular_highlight = "STUDIO", False
    shading.show_cavity, shading.cavity_type, shading.cavity_ridge_factor = True, "WORLD", 0.0
    everything = [obj for objects, _ in layers for obj in objects]
    drawn = Image.new("RGBA", (1200, height), tuple(int(255 * each) for each in PAPER))
    path = HERE / f"{name}.png"
    for objects, colours in layers:
        shading.color_type = colours
        for obj in everything:
            obj.hide_render = obj not in objects
        view.render.filepath = str(path)
        with studio.quiet_output():
            bpy.ops.render.render(write_still=True)
        with Image.open(path) as picture:
            drawn.alpha_composite(picture.convert("RGBA"))
    path.unlink()
    drawn.convert("RGB").save(HERE / f"{name}.webp", quality=86, method=6)


def _bone_sticks(rig, x, name):
    """The rig's bones as they are posed, as meshes: slim octahedra at `x`."""
    points, faces = [], []
    for bone in rig.pose.bones:
        head, tail = (
            np.array(rig.matrix_world @ end) - (rig.location.x, 0, 0) for end in (bone.head, bone.tail)
        )
        along = (tail - head) / max(np.linalg.norm(tail - head), 1e-6)
        side = np.cross(along, (0.0, 1.0, 0.0) if abs(along[1]) < 0.9 else (1.0, 0.0, 0.0))
        side /= np.linalg.norm(side)
        thick = min(0.10 * np.linalg.norm(tail - head), 0.014)
        ring = [turn * thick for turn in (side, np.cross(along, side), -side, -np.cross(along, side))]
        middle, first = head + 0.15 * (tail - head), len(points)
        points += [head, *(middle + each for each in ring), tail]
        faces += [(first, first + 1 + k, first + 1 + (k + 1) % 4) for k in range(4)]
        faces += [(first + 5, first + 1 + (k + 1) % 4, first + 1 + k) for k in range(4)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(each + (x, 0, 0)) for each in points], [], faces)
    look = bpy.data.materials.new(name)
    look.diffuse_color = BONE
    mesh.materials.append(look)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def rigs():
    """Mia with her bones, Bruno as he comes, and Bruno with her bones fitted to him; bones are drawn over
    all."""
    opened()
    keep_carried(pieces("Bruno"))
    bodies, bones = [], []
    for k, label in enumerate(("Mia", "Bruno", "Bruno")):
        x = (k - 1) * STEP
        bodies += posed(pieces(label), x, f"{label} {k}")
        if k != 1:
            bones.append(_bone_sticks(pieces(label)[0].find_armature(), x, f"Bones {k}"))
    layered("rigs", 4.2, 540, (bodies, "TEXTURE"), (bones, "MATERIAL"))


PICTURES = {"rigs": rigs}
