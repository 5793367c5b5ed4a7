# SPDX-License-Identifier: GPL-3.0-or-later
"""Two characters of many pieces: one gets the other's weights, rig, walk, texture and outfit."""

import argparse
import os
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "gallery")]

from cast import people, scene, studio, truth  # noqa: E402

import addon  # noqa: E402
from addon import wording  # noqa: E402

# What the demo fails beyond: a third more to twice of what is measured (1.8, 1.5, 9.8, 1.2, 1.7 and 1.4).
# Of the head in her colours 2.5 % show another one, lips and cheeks beside their place.
BOUNDS = {
    "distance of the skin's images from where they belong, % of the height": 2.7,
    "vertices neither on the right bone nor on its neighbour, %": 3.0,
    "weight on wrong bones, %": 13.0,
    "distance of the joints from where they belong, % of the height": 1.5,
    "skin of head and hands, where matched with hers, in another colour than hers, %": 2.5,
    "distance of the cloth from where his build puts it, % of the height": 2.4,
}
OUTFIT = ("Coat", "Buttons", "Leggings", "Boots", "Satchel")
TAKEN_OFF = ("Shirt", "Trousers", "Belt", "Shoes")
CAPTIONS = (
    "Mia, the source",
    "Bruno, the target, as he comes",
    "Transfer: her rig, walk and\ncolours on his own clothes",
    "Fit Outfit: her clothes\nin his size",
)
STEP = 1.12
STRIDE = 8
"""Frame of the walk that the picture shows."""


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

    print("making two characters, one to two minutes …", flush=True)
    mia = scene.staged(people.mia(), -1.5 * STEP)
    scene.add_walk(mia)
    # The walk repeats, and so does what Space plays.
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, scene.WALK_FRAMES
    # Bruno comes without a rig: all that moves him is Mia's.
    bruno = scene.staged(people.bruno(), 1.5 * STEP, rig=False, keys=False)
    for actor in (mia, bruno):
        print(f"  {actor.person.name}: {len(actor.meshes)} pieces, {vertices(actor)} vertices")
    bpy.context.scene.frame_set(STRIDE)
    studio.statue(bruno.objects, -0.5 * STEP, "As he comes")
    for number, words in enumerate(CAPTIONS):
        studio.caption(words, (number - 1.5) * STEP, z=1.63)

    print("matching, up to a minute …", flush=True)
    choose(mia, bruno)
    started = time.perf_counter()
    bpy.ops.spectral_match.match()
    seconds = time.perf_counter() - started
    errors = truth.skin_errors(mia, bruno)
    measured = [errors.mean(), 100 * (1 - truth.near_bone_share(mia, bruno))]
    doubts = wording.plain(bruno.meshes["Head"].data.spectral_match.reasons.splitlines())
    most = np.quantile(errors, 0.95)
    print(f"  {seconds:.1f} s; what the panel adds: {'; '.join(doubts)}")
    print(f"  95 % of the skin within {most:.1f} % of the height from where it belongs")

    print("transferring weights, rig, walk, keys and texture, up to a minute …", flush=True)
    started = time.perf_counter()
    bpy.ops.spectral_match.transfer(kinds="groups,armature,keys,materials,textures")
    rig = bruno.meshes["Body"].find_armature()
    print(f"  {time.perf_counter() - started:.1f} s")
    measured += [truth.weight_error(mia, bruno), truth.joint_error(mia, bruno, rig)]
    measured.append(100 * (1 - truth.colour_share(mia, bruno)))
    bpy.context.view_layer.update()
    studio.statue(bruno.objects, 0.5 * STEP, "In Mia's colours")

    wear_own(bruno)

    print("dressing Bruno as Mia, matched once more without clothes, half a minute …", flush=True)
    for name in TAKEN_OFF:
        hide(bruno.meshes[name])
    choose(mia, bruno)
    scene.leave_out_worn(mia, bruno)
    started = time.perf_counter()
    bpy.ops.spectral_match.match()
    # Feet and legs of his may come through her boots and leggings as he walks.
    bpy.context.scene.spectral_match.outfit_hide = True
    bpy.ops.spectral_match.fit_outfit(garments="\n".join(mia.meshes[name].name for name in OUTFIT))
    copies = {name: copy_of(mia.meshes[name]) for name in OUTFIT}
    measured.append(truth.fitted_errors(mia, bruno, copies).mean())
    inside = bpy.context.scene.spectral_match.outfit_inside
    print(f"  {time.perf_counter() - started:.1f} s; at rest {inside}")

    blend, picture = options.output / "demo.blend", options.output / "demo.png"
    studio.built(width=4.9)
    bpy.context.preferences.filepaths.save_version = 0
    with studio.quiet_output():
        bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    print(f"wrote {blend}")
    if options.samples:
        print("rendering, up to three minutes …", flush=True)
        studio.rendered(picture, (1200, 540), options.samples)
        print(f"wrote {picture}")
    print("means, against what is known by construction; the demo fails beyond the bounds in brackets:")
    for (what, bound), value in zip(BOUNDS.items(), measured, strict=True):
        print(f"  {value:5.2f}  {what} (at most {bound:g})")
    within = bool((np.array(measured) <= list(BOUNDS.values())).all())
    print("within all bounds" if within else "FAILED: beyond a bound")
    if options.samples:
        print(f"Next: look at {picture}")
    print(f"Next: open {blend} in Blender and press Space: Mia walks, and Bruno in her clothes with her walk")
    return 0 if within else 1


def vertices(actor):
    return sum(len(obj.data.vertices) for obj in actor.objects)


def choose(source, target):
    """Select any piece of both, the source's active."""
    bpy.ops.object.select_all(action="DESELECT")
    for actor in (target, source):
        actor.meshes["Body"].select_set(True)
    bpy.context.view_layer.objects.active = source.meshes["Body"]


def copy_of(obj):
    """The copy of a garment that Fit Outfit made."""
    return next(each for each in bpy.data.objects if each.get("spectral_match_made_from") == obj.name)


def hide(obj):
    obj.hide_render = True
    obj.hide_set(True)


def wear_own(actor):
    """Show the actor's own materials, which stay in the first slot."""
    for obj in actor.objects:
        obj.data.polygons.foreach_set("material_index", np.zeros(len(obj.data.polygons), np.int32))
        obj.data.update()


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
