"""Pictures of outfits for docs/: who wears it, the target, and the target with it, at rest and posed.

.venv/bin/python .ci/outfit_pictures.py [--only NAME] [--output FOLDER] [--samples N]
"""

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "gallery"), str(ROOT / ".ci")]

from sgmds import characters  # noqa: E402
from transfer_pictures import (  # noqa: E402
    add_groups,
    add_rig,
    coloured,
    draw_each,
    material,
    new_object,
    pose,
    rendered,
    stage,
)

STEP = 1.95
SIZE = 960, 340
# Each garment: how far it is off the skin, on which bones it lies, and its colour.
GARMENTS = {
    "Shirt": (0.012, ("chest", "hips", "upper_arm"), (0.75, 0.16, 0.12)),
    "Trousers": (0.009, ("hips", "thigh", "shin"), (0.10, 0.20, 0.45)),
    "Coat": (0.05, ("chest", "hips", "upper_arm", "forearm"), (0.16, 0.33, 0.2)),
    "Hat": (0.03, ("head",), (0.12, 0.08, 0.05)),
}
# Build and pose of who wears it and of who gets it, and what is worn.
SCENES = {
    "outfit": (("slender", "rest"), ("stout", "wave"), ("Shirt", "Trousers", "Hat")),
    "layers": (("stout", "rest"), ("slender", "rest"), ("Shirt", "Trousers", "Coat")),
    "skirt": (("slender", "rest"), ("stout", "rest"), ("Shirt", "Skirt")),
}


def worn(name, made, body):
    """A garment cut from the skin, or a skirt around the hips."""
    if name == "Skirt":
        return skirt(made, body)
    off, parts, colour = GARMENTS[name]
    names = list(made.body.names)
    chosen = np.array([names[part].startswith(parts) for part in made.part])
    if name == "Hat":
        head = names.index("head")
        middle = made.body.starts[head] + 0.6 * (made.body.ends[head] - made.body.starts[head])
        chosen &= made.vertices[:, 2] > middle[2]
    if name == "Trousers":
        chosen &= made.vertices[:, 2] < made.body.starts[names.index("chest")][2]
    normals = np.array([vertex.normal for vertex in body.data.vertices])
    faces = made.faces[chosen[made.faces].all(axis=1)]
    used, number = np.unique(faces, return_inverse=True)
    obj = garment(name, (made.vertices + off * normals)[used], number.reshape(faces.shape), colour, body)
    weigh(obj, names, made.weights[used])
    return obj


def skirt(made, body, around=48, rings=16):
    """A cone from the waist to the knees, on a bone of its own that the target lacks."""
    names = list(made.body.names)
    hips, knee = names.index("hips"), names.index("shin.L")
    top, low = made.body.ends[hips][2] - 0.02, made.body.starts[knee][2]
    near = np.abs(made.vertices[:, 2] - top) < 0.05
    near &= np.array([names[part].startswith(("hips", "chest")) for part in made.part])
    middle = made.vertices[near].mean(axis=0)
    waist = np.abs(made.vertices[near] - middle)[:, :2].max(axis=0) + 0.02
    angle, share = np.meshgrid(np.linspace(0, 2 * np.pi, around, endpoint=False), np.linspace(0, 1, rings))
    folds = 1.0 + 0.05 * share * np.cos(12 * angle)
    wide = (1.0 + 0.9 * share) * folds
    points = np.stack(
        [
            middle[0] + waist[0] * wide * np.cos(angle),
            middle[1] + waist[1] * wide * np.sin(angle),
            top + share * (low - top),
        ],
        axis=2,
    ).reshape(-1, 3)
    ring, next_one = np.arange(around), (np.arange(around) + 1) % around
    start = around * np.arange(rings - 1)[:, None]
    quads = np.stack(
        [start + next_one, start + ring, start + around + ring, start + around + next_one], axis=2
    )
    obj = garment("Skirt", points, quads.reshape(-1, 4), (0.5, 0.12, 0.4), body)
    side = np.clip(0.5 + 2.5 * (points[:, 0] - middle[0]), 0.0, 1.0)
    down = share.ravel() ** 2 * 0.6
    weights = np.zeros((len(points), len(names)))
    weights[:, hips] = 1.0 - down
    right = made.body.starts[names.index("thigh.L")][0] < made.body.starts[names.index("thigh.R")][0]
    for bone, part in (
        ("thigh.L", 1.0 - side if right else side),
        ("thigh.R", side if right else 1.0 - side),
    ):
        weights[:, names.index(bone)] = down * part
    weigh(obj, names, weights)
    return obj


def garment(name, points, faces, colour, body):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    obj.data.materials.append(coloured(name, colour))
    rig = body.find_armature()
    obj.parent, obj.matrix_parent_inverse = rig, rig.matrix_world.inverted()
    obj.location = body.location
    obj.modifiers.new("Rig", "ARMATURE").object = rig
    solid = obj.modifiers.new("Thickness", "SOLIDIFY")
    solid.thickness, solid.offset = 0.006, 1.0
    return obj


def weigh(obj, names, weights):
    for bone, name in enumerate(names):
        held = np.flatnonzero(weights[:, bone])
        if len(held):
            group = obj.vertex_groups.new(name=name)
            for vertex in held.tolist():
                group.add([vertex], float(weights[vertex, bone]), "REPLACE")


def character(name, build, stance, x, seed):
    made = characters.make("biped", build, stance, resolution=6000, seed=seed)
    body = new_object(name, made, x)
    add_groups(body, made)
    add_rig(body, made)
    body.parent = body.find_armature()
    body.matrix_parent_inverse = body.parent.matrix_world.inverted()
    body.data.materials.append(material("Skin", None))
    bpy.context.view_layer.update()
    return made, body


def draw(name, output, samples):
    stage()
    wearer, taker, garments = SCENES[name]
    made, source = character("Wearer", *wearer, -1.5 * STEP, 2)
    for each in garments:
        worn(each, made, source)
    character("Before", *taker, -0.5 * STEP, 3)
    targets = [character(f"Target {k}", *taker, (0.5 + k) * STEP, 3)[1] for k in range(2)]
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == source or obj in targets)
    bpy.context.view_layer.objects.active = source
    settings = bpy.context.scene.spectral_match
    settings.whole_characters = False
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.fit_outfit()
    print(name, settings.outfit_inside)
    pose(targets[1])
    targets[1].find_armature().pose.bones["hips"].matrix_basis = Matrix.Rotation(0.3, 4, "Y")
    bpy.context.view_layer.update()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.camera.data.ortho_scale = 4.2 * STEP
    scene.camera.location = (-1.6, -9.0, 1.6)
    scene.camera.rotation_euler = (
        (Vector((0, 0, 1.1)) - scene.camera.location).to_track_quat("-Z", "Y").to_euler()
    )
    rendered(output / f"outfit_{name}.png", samples)


if __name__ == "__main__":
    draw_each(__doc__, SCENES, draw)
