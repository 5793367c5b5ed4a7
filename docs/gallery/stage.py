# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes side by side in Blender's Workbench renderer, coloured by vertex or by a texture."""

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

BACKGROUND = (0.90, 0.90, 0.89)
PIXELS_PER_UNIT = 150
"""Pictures share one scale: a character is about two units tall."""
ELEVATION = 0.14
"""Radians by which the camera looks down."""


def clear():
    """An empty scene of Blender's factory settings."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


def add(vertices, faces, colours=None, x=0.0, turn=0.0, smooth=True, name="Shape"):
    """A new object standing at `x`, turned about the vertical; `colours` (n, 3 or 4), linear."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    if smooth:
        mesh.shade_smooth()
    if colours is not None:
        paint(mesh, colours)
    obj = bpy.data.objects.new(name, mesh)
    obj.rotation_euler = (0, 0, turn)
    obj.location = (x, 0, -vertices[:, 2].min())
    bpy.context.collection.objects.link(obj)
    return obj


def paint(mesh, colours):
    rgba = np.ones((len(colours), 4), np.float32)
    rgba[:, : colours.shape[1]] = colours
    layer = mesh.color_attributes.new("Colours", "FLOAT_COLOR", "POINT")
    layer.data.foreach_set("color", rgba.ravel())
    mesh.color_attributes.active_color = layer


def wear(objects, image):
    """The image as the objects' texture, by their active UV map."""
    material = bpy.data.materials.new("Texture")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.nodes.active = texture
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    for obj in objects:
        obj.data.materials.clear()
        obj.data.materials.append(material)


def render(path, textured=False, elevation=ELEVATION, margin=0.12):
    """All objects of the scene, seen from the front, into a PNG just large enough."""
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    corners = np.array(
        [obj.matrix_world @ Vector(corner) for obj in scene.objects for corner in obj.bound_box]
    )
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    width = high[0] - low[0]
    depth = high[1] - low[1]
    height = (high[2] - low[2]) * np.cos(elevation) + depth * np.sin(elevation)

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = max(width, height)
    middle = Vector((low + high) / 2)
    camera.location = middle + 30 * Vector((0, -np.cos(elevation), np.sin(elevation)))
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(camera)
    scene.camera = camera
    world = bpy.data.worlds.new("Paper")
    world.color = BACKGROUND
    scene.world = world

    scene.render.engine = "BLENDER_WORKBENCH"
    scene.display.render_aa = "16"
    shading = scene.display.shading
    shading.light = "STUDIO"
    shading.color_type = "TEXTURE" if textured else "VERTEX"
    shading.show_specular_highlight = False
    shading.show_cavity = True
    shading.cavity_type = "WORLD"
    shading.cavity_ridge_factor = 0.0
    scene.render.resolution_x = int(width * PIXELS_PER_UNIT)
    scene.render.resolution_y = int(height * PIXELS_PER_UNIT)
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.compression = 0
    scene.render.image_settings.color_mode = "RGB"
    scene.view_settings.view_transform = "Standard"
    # Studio light alone leaves the colours duller than they are on the surface.
    scene.view_settings.exposure = 0.7
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    reduce(path)


def reduce(path):
    """Write a PNG anew with 256 colours, a third of the size, and without what Blender says of the file."""
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(256)
    small.save(path, optimize=True)
