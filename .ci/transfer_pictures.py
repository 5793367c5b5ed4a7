"""Pictures of each kind of data for docs/: the source, the target before and the target after.

.venv/bin/python .ci/transfer_pictures.py [--only NAME] [--output FOLDER] [--samples N]
"""

import argparse
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "gallery")]

from sgmds import characters  # noqa: E402
from stage import reduce  # noqa: E402

import addon  # noqa: E402

STEP = 1.9
SIZE = 720, 300
BARE = (0.62, 0.62, 0.64)


def new_object(name, character, x):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(character.vertices.tolist(), [], character.faces.tolist())
    mesh.shade_smooth()
    obj = bpy.data.objects.new(name, mesh)
    obj.location = (x, 0.0, -character.vertices[:, 2].min())
    bpy.context.collection.objects.link(obj)
    return obj


def material(name, build):
    """A material whose colour is the output of the node that `build(nodes)` returns."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    shader = nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.6
    shader.inputs["Base Color"].default_value = (*BARE, 1.0)
    if build is not None:
        made.node_tree.links.new(build(nodes), shader.inputs["Base Color"])
    return made


def coloured(name, colour):
    made = material(name, None)
    made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1.0)
    return made


def shown_attribute(name):
    def build(nodes):
        node = nodes.new("ShaderNodeVertexColor")
        node.layer_name = name
        return node.outputs["Color"]

    return build


def checker(nodes):
    """A checker whose colour runs with u and v, so that islands can be told apart."""
    side = 512
    y, x = (np.mgrid[:side, :side] + 0.5) / side
    dark = (np.floor(x * 60) + np.floor(y * 60)) % 2
    pixels = np.ones((side, side, 4), np.float32)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 0.25 + 0.7 * x, 0.25 + 0.7 * y, 0.9 - 0.6 * x * y
    pixels[..., :3] *= np.where(dark, 0.35, 1.0)[..., None]
    image = bpy.data.images.new("Checker", side, side)
    image.pixels.foreach_set(pixels.ravel())
    node = nodes.new("ShaderNodeTexImage")
    node.image = image
    return node.outputs["Color"]


def add_groups(obj, character):
    for bone, name in enumerate(character.body.names):
        group = obj.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(character.weights[:, bone]).tolist():
            group.add([vertex], float(character.weights[vertex, bone]), "REPLACE")


def show_groups(obj):
    """A colour for each group, mixed by weight."""
    hue = np.random.default_rng(3).permutation(len(obj.vertex_groups)) / max(len(obj.vertex_groups), 1)
    colours = np.stack(
        [0.5 + 0.45 * np.cos(2 * np.pi * (hue + shift)) for shift in (0, 1 / 3, 2 / 3)], axis=1
    )
    values = np.ones((len(obj.data.vertices), 4), np.float32)
    for vertex in obj.data.vertices:
        mixed = sum((colours[entry.group] * entry.weight for entry in vertex.groups), np.zeros(3))
        values[vertex.index, :3] = mixed if vertex.groups else BARE
    layer = obj.data.color_attributes.new("shown", "FLOAT_COLOR", "POINT")
    layer.data.foreach_set("color", values.ravel())


def add_layout(obj, character):
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", character.uv.astype(np.float32).ravel())


def add_key(obj, character):
    obj.shape_key_add(name="Basis", from_mix=False)
    key = obj.shape_key_add(name="Muscles", from_mix=False)
    body, part = character.body, character.part
    at = body.starts[part] + character.axial[:, None] * (body.ends[part] - body.starts[part])
    height = 0.9 * np.sin(np.pi * np.clip(character.axial, 0, 1)) ** 2
    limbs = [i for i, name in enumerate(body.names) if name.startswith(("upper_arm", "thigh", "tail"))]
    height[~np.isin(part, limbs)] = 0.0
    moved = character.vertices + (character.vertices - at) * height[:, None]
    key.data.foreach_set("co", moved.astype(np.float32).ravel())


def add_materials(obj, character):
    """Two materials, trunk and limbs."""
    names = np.array([name.startswith(("hips", "chest", "neck", "head")) for name in character.body.names])
    trunk = names[character.part][character.faces].sum(axis=1) >= 2
    for name, colour in (("Limbs", (0.10, 0.28, 0.55)), ("Trunk", (0.85, 0.45, 0.15))):
        obj.data.materials.append(coloured(name, colour))
    obj.data.polygons.foreach_set("material_index", trunk.astype(np.int32))


def add_rig(obj, character):
    body = character.body
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    rig.location = obj.location
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail in zip(body.names, body.starts, body.ends, strict=True):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = head, tail
    for bone in characters.SKELETONS[body.kind]:
        if bone.parent:
            rig.data.edit_bones[bone.name].parent = rig.data.edit_bones[bone.parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.hide_render = True
    obj.modifiers.new("Rig", "ARMATURE").object = rig


def pose(obj):
    rig = obj.find_armature()
    if rig is None:
        return
    for name, axis, degrees in (
        ("upper_arm.L", "X", -50),
        ("upper_arm.R", "X", 50),
        ("thigh.L", "X", 35),
        ("shin.L", "X", -40),
        ("tail", "Z", 40),
        ("head", "Y", 25),
    ):
        rig.pose.bones[name].matrix_basis = Matrix.Rotation(np.radians(degrees), 4, axis)


def groups_scene(source, target, given):
    add_groups(source, given)
    return "groups", [show_groups], material("Weights", shown_attribute("shown"))


def layout_scene(source, target, given):
    add_layout(source, given)
    return "uv", [], material("Layout", checker)


def keys_scene(source, target, given):
    add_key(source, given)

    def strong(obj):
        if obj.data.shape_keys is not None:
            obj.data.shape_keys.key_blocks["Muscles"].value = 1.0

    return "keys", [strong], material("Plain", None)


def materials_scene(source, target, given):
    add_materials(source, given)
    return "materials", [], None


def rig_scene(source, target, given):
    add_groups(source, given)
    add_rig(source, given)
    return "groups,armature", [show_groups, pose], material("Weights", shown_attribute("shown"))


def textures_scene(source, target, given):
    """The picture of the source baked into another layout that the target has already."""
    add_layout(source, given)
    source.data.materials.append(material("Layout", checker))
    # A layout of its own: each face apart, so that nothing of the source's is left in it.
    own = target.data.uv_layers.new(name="Own")
    columns = int(np.ceil(np.sqrt(len(target.data.polygons))))
    cell = np.array([(face % columns, face // columns) for face in range(len(target.data.polygons))])
    corners = cell[:, None] + 0.08 + 0.84 * np.array([(0, 0), (1, 0), (0, 1)])
    own.uv.foreach_set("vector", (corners / columns).astype(np.float32).ravel())
    bpy.context.scene.spectral_match.bake_size = "2048"
    bpy.context.scene.spectral_match.bake_margin = 2
    return "textures", [], None


def around(character, bone, along):
    """Edges of the character that go around a bone, as pairs of vertices."""
    part = character.body.names.index(bone)
    edges = np.unique(
        np.sort(np.concatenate([character.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1), axis=0
    )
    side = np.where(character.part == part, np.sign(character.axial - along), 0)
    # One side's vertices of all edges that cross, and the edges between these.
    crossing = edges[(side[edges[:, 0]] * side[edges[:, 1]]) < 0]
    near = np.unique(np.where(side[crossing] > 0, crossing, -1))
    return edges[np.isin(edges, near[near >= 0]).all(axis=1)]


MARKED = (("upper_arm.L", 0.6), ("upper_arm.R", 0.6), ("thigh.L", 0.5), ("thigh.R", 0.5), ("tail", 0.5))


def marks_scene(source, target, given):
    marked = {tuple(edge) for bone, along in MARKED for edge in around(given, bone, along).tolist()}
    for edge in source.data.edges:
        edge.use_seam = tuple(sorted(edge.vertices)) in marked
    return "marks", [show_seams], material("Marks", shown_attribute("shown"))


def show_seams(obj):
    """Vertices of marked edges in red."""
    values = np.tile((*BARE, 1.0), (len(obj.data.vertices), 1)).astype(np.float32)
    for edge in obj.data.edges:
        if edge.use_seam:
            values[list(edge.vertices)] = 0.8, 0.05, 0.03, 1.0
    layer = obj.data.color_attributes.new("shown", "FLOAT_COLOR", "POINT")
    layer.data.foreach_set("color", values.ravel())


def attributes_scene(source, target, given):
    """A number at each vertex, in waves along the bones."""
    values = np.cos(6 * np.pi * given.axial) * 0.5 + 0.5
    source.data.attributes.new("wave", "FLOAT", "POINT").data.foreach_set("value", values.astype(np.float32))
    return "attributes", [show_wave], material("Attribute", shown_attribute("shown"))


def show_wave(obj):
    wave = np.empty(len(obj.data.vertices), np.float32)
    obj.data.attributes["wave"].data.foreach_get("value", wave)
    ends = np.array([(0.05, 0.12, 0.35), (1.0, 0.75, 0.2)])
    values = np.ones((len(wave), 4), np.float32)
    values[:, :3] = ends[0] + wave[:, None] * (ends[1] - ends[0])
    layer = obj.data.color_attributes.new("shown", "FLOAT_COLOR", "POINT")
    layer.data.foreach_set("color", values.ravel())


def parts_scene(source, target, given):
    """Eyes that are objects of their own."""
    body = given.body
    head = body.names.index("head")
    axis = body.ends[head] - body.starts[head]
    middle = body.starts[head] + 0.55 * axis
    for side in (-1, 1):
        ray = np.array((0.45 * side, -1.0, 0.15))
        way = (given.vertices - middle) @ ray / np.linalg.norm(ray)
        off = np.linalg.norm(given.vertices - middle - way[:, None] * ray / np.linalg.norm(ray), axis=1)
        place = given.vertices[np.where(way > 0, off, np.inf).argmin()]
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.055, location=(0, 0, 0))
        add_part(source, "Eye", place, (0.02, 0.02, 0.03))
    return "objects", [], material("Plain", None)


def hair_scene(source, target, given):
    """Hair curves on the crown, combed back."""
    add_layout(source, given)
    body = given.body
    head = body.names.index("head")
    axis = body.ends[head] - body.starts[head]
    middle = body.starts[head] + 0.55 * axis
    outward = given.vertices - middle
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    roots = np.flatnonzero((given.part == head) & (outward @ (0.0, 0.55, 0.83) > 0.35))
    steps = np.linspace(0.0, 1.0, 8)[None, :, None]
    combed = 0.22 * steps * outward[roots][:, None] + steps**2 * np.array((0.0, 0.16, -0.25))
    strands = bpy.data.hair_curves.new("Hair")
    strands.add_curves([steps.size] * len(roots))
    points = given.vertices[roots][:, None] + combed
    strands.position_data.foreach_set("vector", points.astype(np.float32).ravel())
    radius = np.broadcast_to(0.012 * (1.0 - 0.8 * steps), points[..., :1].shape)
    strands.attributes.new("radius", "FLOAT", "POINT").data.foreach_set(
        "value", radius.astype(np.float32).ravel()
    )
    strands.materials.append(coloured("Hair", (0.22, 0.06, 0.02)))
    strands.surface = source
    hair = bpy.data.objects.new("Hair", strands)
    hair.parent = source
    bpy.context.collection.objects.link(hair)
    return "uv,objects", [], material("Plain", None)


def add_part(source, name, place, colour):
    """The active object as a companion of the source, at a place of its own space."""
    part = bpy.context.object
    part.name = name
    bpy.ops.object.shade_smooth()
    part.data.materials.append(coloured(name, colour))
    part.parent, part.location = source, place


SCENES = {
    "weights": groups_scene,
    "layout": layout_scene,
    "shape_keys": keys_scene,
    "materials": materials_scene,
    "rig": rig_scene,
    "textures": textures_scene,
    "marks": marks_scene,
    "attributes": attributes_scene,
    "parts": parts_scene,
    "hair": hair_scene,
}


def stage():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.6
    scene.world = world
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler = (0.8, 0.2, 0.5)
    sun.data.energy = 2.0
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.35 * STEP
    camera.location = (-1.6, -9.0, 2.2)
    camera.rotation_euler = (Vector((0, 0, 1.1)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    for obj in (sun, camera):
        bpy.context.collection.objects.link(obj)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.color_mode = "RGB"
    scene.view_settings.view_transform = "Standard"
    # Nothing of the machine in the picture.
    for stamp in [name for name in dir(scene.render) if name.startswith("use_stamp")]:
        setattr(scene.render, stamp, False)


def rendered(path, samples):
    """The scene as a picture."""
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.cycles.max_bounces = 2
    # Some builds of Blender have no denoiser; the module comes with bpy.
    import _cycles

    scene.cycles.use_denoising = _cycles.with_openimagedenoise
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    reduce(path)


def draw_each(describe, scenes, draw):
    """Draw the scenes that the command line asks for, the extension being registered meanwhile."""
    parser = argparse.ArgumentParser(description=describe, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=sorted(scenes))
    parser.add_argument("--output", type=Path, default=ROOT / "docs")
    parser.add_argument("--samples", type=int, default=32)
    given = parser.parse_args()
    addon.register()
    try:
        for name in [given.only] if given.only else scenes:
            draw(name, given.output, given.samples)
    finally:
        # With its properties still declared, bpy crashes when the interpreter ends.
        addon.unregister()


def draw(name, output, samples):
    stage()
    given = characters.make("biped", "slender", "rest", resolution=4000, seed=2)
    taker = characters.make("biped", "stout", "wave", resolution=5000, seed=3)
    source, target = new_object("Source", given, -STEP), new_object("Target", taker, STEP)
    before = new_object("Before", taker, 0.0)
    kinds, after, shown = SCENES[name](source, target, given)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (source, target))
    bpy.context.view_layer.objects.active = source
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.transfer(kinds=kinds)
    for obj in (source, target):
        for step in after:
            step(obj)
    plain = material("Bare", None)
    before.data.materials.append(plain)
    if shown is not None:
        for obj in (source, target):
            obj.data.materials.clear()
            obj.data.materials.append(shown)
    rendered(output / f"transfer_{name}.png", samples)


if __name__ == "__main__":
    draw_each(__doc__, SCENES, draw)
