# SPDX-License-Identifier: GPL-3.0-or-later
"""Two characters of different build, pose and topology, matched and dressed in headless Blender."""

import argparse
import contextlib
import os
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from sgmds import characters  # noqa: E402
from sgmds.evaluation import TruthDistances  # noqa: E402

import addon  # noqa: E402

ERROR_BOUND = 8.0
"""Mean geodesic error ×100 above which the demo fails."""
TRUTH_LINES = 400
SIDE_STEP = 0.95
TURN = -0.5
"""Radians about Z, so that the tails are seen."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=ROOT / "build", help="folder for demo.blend and demo.png"
    )
    parser.add_argument("--samples", type=int, default=16, help="Cycles samples; 0 leaves the picture out")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    addon.register()

    print("making two characters …", flush=True)
    slender = characters.make("biped", build="slender", pose="wave", resolution=5000, seed=0)
    stout = characters.make("biped", build="stout", pose="walk", resolution=7000, seed=1)
    source, target = _new_object("Slender", slender, -SIDE_STEP), _new_object("Stout", stout, SIDE_STEP)
    _add_groups_and_uvs(source, slender)

    bpy.ops.object.select_all(action="DESELECT")
    for obj in (source, target):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = source
    print("matching …", flush=True)
    started = time.perf_counter()
    bpy.ops.spectral_match.match()
    seconds = time.perf_counter() - started
    bpy.ops.spectral_match.transfer(split_bare=False)

    error = _mean_error(source, target, slender, stout)
    print(f"{len(slender.vertices)} vertices matched to {len(stout.vertices)} in {seconds:.1f} s")
    print(
        f"vertex groups: the right bone is strongest at {_right_group_share(target, stout):.1%} of vertices"
    )
    print(f"UV corners in the right island: {_right_island_share(target, stout):.1%}")

    _build_stage((source, target))
    blend, picture = options.output / "demo.blend", options.output / "demo.png"
    bpy.context.scene.render.filepath = str(picture)
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    print(f"wrote {blend}")
    if options.samples:
        bpy.context.scene.cycles.samples = options.samples
        print("rendering …", flush=True)
        with _quiet_output():
            bpy.ops.render.render(write_still=True)
        print(f"wrote {picture}")
    print(f"mean geodesic error x100: {error:.2f} (at most {ERROR_BOUND:g})")
    return 0 if error <= ERROR_BOUND else 1


@contextlib.contextmanager
def _quiet_output():
    """Nothing on standard output meanwhile: the renderer writes its progress there, past Python."""
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


def _new_object(name, character, x):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(character.vertices.tolist(), [], character.faces.tolist())
    mesh.shade_smooth()
    obj = bpy.data.objects.new(name, mesh)
    obj.location = (x, 0, -character.vertices[:, 2].min())
    obj.rotation_euler = (0, 0, TURN)
    bpy.context.collection.objects.link(obj)
    return obj


def _add_groups_and_uvs(obj, character):
    for bone, name in enumerate(character.body.names):
        group = obj.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(character.weights[:, bone]):
            group.add([int(vertex)], float(character.weights[vertex, bone]), "REPLACE")
    layer = obj.data.uv_layers.new(name="Parts")
    layer.uv.foreach_set("vector", character.uv.astype(np.float32).reshape(-1))


def _mean_error(source, target, character, other) -> float:
    """Mean distance on the source from the matched point to the true one, over √area, ×100."""
    position = np.empty(3 * len(target.data.vertices), np.float32)
    target.data.attributes["match_position"].data.foreach_get("vector", position)
    from scipy.spatial import cKDTree

    images = cKDTree(character.vertices).query(position.reshape(-1, 3))[1]
    ids, truth = characters.truth_vertices(other, character)
    lines = np.linspace(0, len(ids) - 1, TRUTH_LINES).astype(int)
    distances = TruthDistances(character.vertices, character.faces)
    return float(100 * distances.between(truth[lines], images[ids[lines]]).mean())


def _right_group_share(obj, character) -> float:
    names = [group.name for group in obj.vertex_groups]
    right = 0
    ids = np.flatnonzero(character.addressed)
    for i in ids:
        weights = {names[g.group]: g.weight for g in obj.data.vertices[int(i)].groups}
        right += bool(weights) and max(weights, key=weights.get) == character.body.names[character.part[i]]
    return right / len(ids)


def _right_island_share(obj, character) -> float:
    layer = obj.data.uv_layers.get("Parts")
    if layer is None:
        return 0.0
    carried = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", carried)
    columns = int(np.ceil(np.sqrt(len(character.body.names))))
    cell = np.floor(carried.reshape(-1, 2) * columns)
    corners = character.faces.reshape(-1)
    known = character.addressed[corners]
    island = cell[:, 0] + columns * cell[:, 1]
    return float((island == character.part[corners])[known].mean())


# ------------------------------------------------------------------ the picture


def _build_stage(objects):
    """Floor, light, camera and a material that shows the matching colours."""
    skin = bpy.data.materials.new("Matching colours")
    skin.use_nodes = True
    nodes, links = skin.node_tree.nodes, skin.node_tree.links
    shader = nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.42
    shader.inputs["Coat Weight"].default_value = 0.25
    colours = nodes.new("ShaderNodeVertexColor")
    colours.layer_name = "match_color"
    links.new(colours.outputs["Color"], shader.inputs["Base Color"])
    for obj in objects:
        obj.data.materials.clear()
        obj.data.materials.append(skin)

    floor = _floor()
    paper = bpy.data.materials.new("Paper")
    paper.use_nodes = True
    paper.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.80, 0.79, 0.77, 1)
    paper.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.9
    floor.data.materials.append(paper)

    middle = Vector((0.0, 0, 1.12))
    _add_light("Key", (-3.2, -4.2, 4.6), middle, 250, 2.6, (1.0, 0.96, 0.90))
    _add_light("Fill", (4.5, -3.5, 2.6), middle, 80, 4.0, (0.90, 0.95, 1.0))
    _add_light("Rim", (1.5, 3.4, 4.2), middle, 170, 2.0, (1.0, 1.0, 1.0))

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = 62
    camera.location = (-0.6, -9.2, 2.1)
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(camera)

    scene = bpy.context.scene
    scene.camera = camera
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.86, 0.90, 0.96, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.4
    scene.world = world
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = True
    # Some builds of Blender have no denoiser.
    import _cycles

    scene.cycles.use_denoising = _cycles.with_openimagedenoise
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.render.image_settings.file_format = "PNG"
    # The picture's metadata would carry the path of this machine.
    scene.render.use_stamp_filename = False
    scene.view_settings.view_transform = "Standard"


def _floor():
    """A floor that bends up behind the characters, so that there is no horizon."""
    depth = np.concatenate([[-12.0], np.linspace(2.5, 4.5, 24)])
    height = np.where(depth > 2.5, 2.0 - np.sqrt(np.maximum(4.0 - (depth - 2.5) ** 2, 0)), 0.0)
    depth, height = np.append(depth, 4.5), np.append(height, 14.0)
    points = [(x, float(y), float(z)) for y, z in zip(depth, height, strict=True) for x in (-16.0, 16.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(depth) - 1)]
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata(points, [], faces)
    mesh.shade_smooth()
    obj = bpy.data.objects.new("Floor", mesh)
    bpy.context.collection.objects.link(obj)
    return obj


def _add_light(name, place, towards, power, size, colour):
    light = bpy.data.lights.new(name, "AREA")
    light.energy, light.size, light.color = power, size, colour
    obj = bpy.data.objects.new(name, light)
    obj.location = place
    obj.rotation_euler = (towards - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(obj)


if __name__ == "__main__":
    status = 1
    try:
        status = main()
    except Exception:
        traceback.print_exc()
    # bpy's own clean-up at the interpreter's exit may hang; everything is written by now.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
