# SPDX-License-Identifier: GPL-3.0-or-later
"""A photographer's studio: paper, three lights, a camera, and pictures from it."""

from __future__ import annotations

import contextlib
import os
import sys

import bpy
import numpy as np
from mathutils import Vector

PAPER = (0.72, 0.76, 0.78)
LIGHT_SPREAD = 2.2


def built(middle=(0.0, 0.0, 0.72), width: float = 4.0, elevation: float = 0.07, turn: float = 0.0):
    """Paper, lights and a camera that shows `width` metres around a place."""
    scene = bpy.context.scene
    paper = _paper()
    scale = width / 2.4
    _light("Key", (-2.2 * scale, -3.2, 3.0), middle, 130 * scale**1.5, 1.8 * scale, (1.0, 0.95, 0.88))
    _light("Fill", (3.0 * scale, -2.4, 1.8), middle, 45 * scale**1.5, 2.5 * scale, (0.88, 0.94, 1.0))
    _light("Rim", (1.0, 2.4, 3.2), middle, 110 * scale, 2.4 * scale, (1.0, 1.0, 1.0))
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.85, 0.90, 1.0, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.55
    scene.world = world
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = 85
    distance = width * camera.data.lens / camera.data.sensor_width
    way = Vector((np.sin(turn) * np.cos(elevation), -np.cos(turn) * np.cos(elevation), np.sin(elevation)))
    camera.location = Vector(middle) + distance * way
    camera.rotation_euler = (-way).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    return paper


def rendered(path, size, samples: int = 24):
    """The scene as a picture; the renderer's progress is not heard."""
    import _cycles

    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", samples
    scene.cycles.max_bounces = 3
    # Some builds of Blender have no denoiser.
    scene.cycles.use_denoising = _cycles.with_openimagedenoise
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    # Nothing of the machine in the picture.
    for stamp in [name for name in dir(scene.render) if name.startswith("use_stamp")]:
        setattr(scene.render, stamp, False)
    scene.render.filepath = str(path)
    with quiet_output():
        bpy.ops.render.render(write_still=True)


@contextlib.contextmanager
def quiet_output():
    """Nothing on standard output meanwhile: Blender writes there past Python."""
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def statue(objects, x: float, name: str, colours: str | None = None):
    """Copies of objects as they are seen now, moved so that what stood at `objects[0]`'s place stands at
    `x`; with `colours`, a vertex attribute of that name is their look."""
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    graph = bpy.context.evaluated_depsgraph_get()
    made = []
    for obj in objects:
        mesh = bpy.data.meshes.new_from_object(obj.evaluated_get(graph), depsgraph=graph)
        copy = bpy.data.objects.new(f"{name} {obj.name}", mesh)
        copy.matrix_world = obj.matrix_world
        copy.location.x += x - objects[0].matrix_world.translation.x
        collection.objects.link(copy)
        if colours:
            mesh.materials.clear()
            mesh.materials.append(attribute_look(colours))
            mesh.polygons.foreach_set("material_index", np.zeros(len(mesh.polygons), np.int32))
        made.append(copy)
    return made


def caption(words: str, x: float, z: float, size: float = 0.07):
    """Words that stand above a figure and cast no shadow, their lowest line at `z`."""
    curve = bpy.data.curves.new(words, "FONT")
    curve.body, curve.size, curve.align_x, curve.align_y = words, size, "CENTER", "BOTTOM"
    look = bpy.data.materials.new("Ink")
    look.use_nodes = True
    shader = look.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.01, 0.01, 0.01, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    curve.materials.append(look)
    obj = bpy.data.objects.new(words, curve)
    obj.location, obj.rotation_euler = (x, 0.0, z), (np.pi / 2, 0.0, 0.0)
    obj.visible_shadow = False
    bpy.context.scene.collection.objects.link(obj)
    return obj


def attribute_look(name: str):
    """A material that shows a colour attribute."""
    look = bpy.data.materials.get(f"Shows {name}")
    if look is None:
        look = bpy.data.materials.new(f"Shows {name}")
        look.use_nodes = True
        nodes = look.node_tree.nodes
        shader, colours = nodes["Principled BSDF"], nodes.new("ShaderNodeVertexColor")
        colours.layer_name = name
        shader.inputs["Roughness"].default_value = 0.45
        look.node_tree.links.new(colours.outputs["Color"], shader.inputs["Base Color"])
    return look


def _paper():
    """A floor that bends up behind the figures, so that there is no horizon."""
    depth = np.concatenate([[-14.0], np.linspace(5.0, 8.0, 24)])
    height = np.where(depth > 5.0, 3.0 - np.sqrt(np.maximum(9.0 - (depth - 5.0) ** 2, 0.0)), 0.0)
    depth, height = np.append(depth, 8.0), np.append(height, 18.0)
    points = [(x, float(y), float(z)) for y, z in zip(depth, height, strict=True) for x in (-24.0, 24.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(depth) - 1)]
    mesh = bpy.data.meshes.new("Paper")
    mesh.from_pydata(points, [], faces)
    mesh.shade_smooth()
    look = bpy.data.materials.new("Paper")
    look.use_nodes = True
    shader = look.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*PAPER, 1.0)
    shader.inputs["Roughness"].default_value = 0.9
    mesh.materials.append(look)
    obj = bpy.data.objects.new("Paper", mesh)
    obj.hide_select = True
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _light(name, place, towards, power, size, colour):
    light = bpy.data.lights.new(name, "AREA")
    light.energy, light.size, light.color = power, size, colour
    # Narrower than a half space, or the paper would show where that ends.
    light.spread = LIGHT_SPREAD
    obj = bpy.data.objects.new(name, light)
    obj.location = place
    obj.rotation_euler = (Vector(towards) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(obj)
