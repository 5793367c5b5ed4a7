# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the documentation's pictures anew, all or those named: `just -f .ci/justfile gallery [NAME …]`.

Every shape is made by code, every colour is carried by a map that `sgmds` found.
"""

import argparse
import os
import sys
import traceback
from functools import cache
from pathlib import Path

import bpy
import matplotlib
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]
matplotlib.use("Agg")

import sgmds  # noqa: E402
import show  # noqa: E402
import stage  # noqa: E402
import steps  # noqa: E402
from matplotlib import pyplot as plt  # noqa: E402
from sgmds import characters  # noqa: E402
from sgmds.characters import Bone  # noqa: E402
from sgmds.evaluation import TruthDistances  # noqa: E402

import addon  # noqa: E402
from addon import palette  # noqa: E402

STEP = 1.9
"""Distance between neighbours, in units of a body."""
TURN = -0.45

# An animal whose eight limbs are the same, so that nothing on its surface tells one from the next.
ARMS = 8
characters.SKELETONS["octopus"] = [
    Bone("mantle", None, 0, (0, 0, 0.55), (0, 0, 1), 0.45, (0.30, 0.26)),
    *[
        bone
        for k in range(ARMS)
        for bone in (
            Bone(
                f"arm {k}",
                "mantle",
                0,
                (0.24 * np.cos(2 * np.pi * k / ARMS), 0.24 * np.sin(2 * np.pi * k / ARMS), -0.05),
                (np.cos(2 * np.pi * k / ARMS), np.sin(2 * np.pi * k / ARMS), -0.55),
                0.55,
                (0.10, 0.075),
            ),
            Bone(
                f"tip {k}",
                f"arm {k}",
                1,
                (0, 0, 0),
                (np.cos(2 * np.pi * k / ARMS), np.sin(2 * np.pi * k / ARMS), 0.05),
                0.60,
                (0.075, 0.04),
            ),
        )
    ],
]
CROUCH = {
    "thigh.L": (-60, 0, 12),
    "thigh.R": (-60, 0, -12),
    "shin.L": (95, 0, 0),
    "shin.R": (95, 0, 0),
    "foot.L": (-30, 0, 0),
    "foot.R": (-30, 0, 0),
    "chest": (22, 0, 0),
    "head": (-18, 0, 0),
    "upper_arm.L": (-20, 30, 40),
    "upper_arm.R": (-20, -30, -40),
    "tail_root": (35, 0, 0),
    "tail_tip": (25, 0, 0),
}
HEAVY_HEAD = {
    "head": (1.3, 1.5),
    "snout": (0.8, 1.3),
    "ear": (1.3, 1.3),
    "thigh": (0.6, 0.9),
    "shin": (0.6, 0.9),
}


@cache
def made(kind="biped", build="plain", pose="rest", resolution=5000, seed=0):
    build = {"heavy head": HEAVY_HEAD}.get(build, build)
    pose = {"crouch": CROUCH}.get(pose, pose)
    return characters.make(kind, build, pose, resolution, seed)


@cache
def prepared(character_id):
    vertices, faces = _meshes[character_id]
    return sgmds.Shape(vertices, faces)


_meshes = {}


def matched(source, target, **options):
    """The map between two (vertices, faces); shapes are prepared once."""
    for mesh in (source, target):
        _meshes[id(mesh[0])] = mesh
    return sgmds.match(prepared(id(source[0])), prepared(id(target[0])), **options)


def mesh(character):
    return character.vertices, character.faces


def row(name, source, targets, smooth=True, step=STEP, turn=TURN, elevation=stage.ELEVATION, **options):
    """The source, then the targets in the colours that each receives from it."""
    stage.clear()
    colours = palette.surface_colours(source[0])
    middle = len(targets) / 2
    stage.add(*source, colours, -middle * step, turn, smooth)
    for k, target in enumerate(targets):
        corr = matched(source, target, **options)
        print(f"{name}: {corr.quality.grade}; {'; '.join(corr.quality.reasons)}", flush=True)
        stage.add(*target, corr.transfer(colours), (k + 1 - middle) * step, turn, smooth)
    stage.render(HERE / f"{name}.png", elevation=elevation)


def poses():
    row(
        "poses",
        mesh(made()),
        [mesh(made(pose=p, seed=k + 1)) for k, p in enumerate(("wave", "walk", "crouch"))],
    )


def builds():
    bodies = [("slender", "wave"), ("stout", "walk"), ("heavy head", "rest")]
    row("builds", mesh(made()), [mesh(made(build=b, pose=p, seed=k + 1)) for k, (b, p) in enumerate(bodies)])


def animals():
    source = made("quadruped")
    targets = [made("quadruped", "slender", "wave", seed=1), made("quadruped", "stout", "walk", seed=2)]
    row("animals", mesh(source), [mesh(t) for t in targets], step=2.2, turn=-1.0)


def resolution():
    source = made(resolution=20_000)
    targets = [made(pose="wave", resolution=n, seed=n) for n in (5000, 1500)]
    row("resolution", mesh(source), [mesh(t) for t in targets], smooth=False)


def _cut(character, keep):
    """The part of a mesh whose vertices are kept."""
    number = np.cumsum(keep) - 1
    faces = character.faces[keep[character.faces].all(axis=1)]
    return character.vertices[keep], number[faces]


def parts():
    """A whole body, the upper half of another, and one without an arm and the tail."""
    upper, maimed = made(pose="wave", seed=1), made(build="stout", pose="walk", seed=2)
    bust = _cut(upper, upper.vertices[:, 2] > upper.body.starts[0, 2] + 0.1)
    lost = [
        k for k, name in enumerate(maimed.body.names) if "arm.L" in name or "hand.L" in name or "tail" in name
    ]
    rest = _cut(maimed, ~np.isin(maimed.part, lost))
    row("parts", mesh(made()), [bust, rest], part="target")


def _errors(corr, source, target):
    """Geodesic distance from each target vertex's image to the true one, in √area; NaN where no truth is."""
    ids, truth = characters.truth_vertices(target, source)
    distances = TruthDistances(source.vertices, source.faces)
    errors = np.full(len(target.vertices), np.nan)
    errors[ids] = distances.between(truth, corr.vertices[ids])
    return errors


def confidence():
    """Source, target, its confidence, and the true error where it is known (grey elsewhere)."""
    source, target = made(build="slender", pose="wave"), made(build="heavy head", pose="walk", seed=3)
    corr = matched(mesh(source), mesh(target))
    print(f"confidence: {corr.quality.grade}; {'; '.join(corr.quality.reasons)}", flush=True)
    errors = _errors(corr, source, target)
    error_colours = palette.heat_colours(1 - errors / 0.15)
    error_colours[np.isnan(errors)] = (0.35, 0.35, 0.35, 1)
    colours = palette.surface_colours(source.vertices)
    stage.clear()
    stage.add(*mesh(source), colours, -1.5 * STEP, TURN)
    shown = [corr.transfer(colours), palette.heat_colours(corr.confidence), error_colours]
    for k, painted in enumerate(shown):
        stage.add(*mesh(target), painted, (k - 0.5) * STEP, TURN)
    stage.render(HERE / "confidence.png")


def failures():
    """Eight equal arms; nothing says which is which."""
    turned = {f"arm {k}": (0, 0, 18 * np.sin(2.0 * k)) for k in range(ARMS)}
    turned |= {f"tip {k}": (20 * np.cos(3.0 * k), 0, 25 * np.sin(5.0 * k)) for k in range(ARMS)}
    source = characters.make("octopus", {}, {}, 3000, 0)
    target = characters.make("octopus", {}, turned, 3000, 1)
    row("failures", mesh(source), [mesh(target)], step=2.8, turn=0.3, elevation=0.6)


def textures():
    """UV maps carried by the extension, seen through a chequered image."""
    stage.clear()
    addon.register()
    source, target = (
        made(build="slender", pose="wave"),
        made(build="stout", pose="walk", resolution=7000, seed=1),
    )
    first = stage.add(*mesh(source), x=-STEP / 2, turn=TURN, name="Slender")
    second = stage.add(*mesh(target), x=STEP / 2, turn=TURN, name="Stout")
    layer = first.data.uv_layers.new(name="Parts")
    layer.uv.foreach_set("vector", source.uv.astype(np.float32).ravel())
    first.select_set(True)
    second.select_set(True)
    bpy.context.view_layer.objects.active = first
    bpy.ops.spectral_match.match()
    bpy.ops.spectral_match.transfer()
    second.data.uv_layers.active = second.data.uv_layers["Parts"]
    stage.wear((first, second), bpy.data.images.new("Chequers", 1024, 1024, tiled=False))
    image = bpy.data.images["Chequers"]
    image.generated_type = "COLOR_GRID"
    stage.render(HERE / "textures.png", textured=True)
    addon.unregister()


# ------------------------------------------------------------------ figures of the method


def _diverging(values):
    """Blue below zero, red above, as linear RGBA."""
    scaled = 0.5 + 0.5 * values / np.abs(values).max()
    return (plt.get_cmap("RdBu_r")(scaled) ** 2.2).astype(np.float32)


def eigenfunctions():
    """Functions 2, 3, 4, 6 and 12 of one body and, below the same, of another."""
    stage.clear()
    chosen = (1, 2, 3, 5, 11)
    for level, character in enumerate((made(pose="wave"), made(build="stout", pose="walk", seed=2))):
        shape = sgmds.Shape(*mesh(character))
        for k, which in enumerate(chosen):
            x = (k - (len(chosen) - 1) / 2) * STEP
            obj = stage.add(*mesh(character), _diverging(shape.eigenfunctions[:, which]), x, TURN)
            obj.location.z -= 2.4 * level
    stage.render(HERE / "eigenfunctions.png")


def distances():
    """Lines of equal distance from the tip of one hand on two bodies."""
    stage.clear()
    for k, character in enumerate((made(pose="wave"), made(build="stout", pose="walk", seed=2))):
        hand = character.body.ends[character.body.names.index("hand.L")]
        start = int(np.linalg.norm(character.vertices - hand, axis=1).argmin())
        solver = TruthDistances(*mesh(character))
        ids = np.arange(len(character.vertices))
        away = solver.between(np.full(len(ids), start), ids)
        bands = plt.get_cmap("viridis")(away / away.max()) * (1 - 0.35 * (np.floor(away / 0.08) % 2))[:, None]
        stage.add(*mesh(character), (bands**2.2)[:, :3], (k - 0.5) * STEP, TURN)
    stage.render(HERE / "distances.png")


def operators():
    """The distance operators of two bodies and the map between them, as matrices."""
    source, target = made(pose="wave"), made(build="stout", pose="walk", seed=2)
    corr = matched(mesh(source), mesh(target))
    shapes = [prepared(id(mesh_[0])) for mesh_ in (mesh(source), mesh(target))]
    shown = 30
    panels = []
    for shape, name in zip(shapes, ("source", "target"), strict=True):
        alpha = shape.distance_operator / shape.mass.sum() ** 1.5
        panels.append((alpha[:shown, :shown], f"distance operator of the {name}"))
    panels.append((corr.functional_map[:shown, :shown], "map α: source → target"))
    figure, axes = plt.subplots(1, 3, figsize=(9.2, 3.2), constrained_layout=True)
    for axis, (matrix, title) in zip(axes, panels, strict=True):
        # The first entry of a distance operator, the mean distance, is far above all others.
        limit = np.abs(matrix[1:, 1:]).max()
        axis.imshow(matrix, cmap="RdBu_r", vmin=-limit, vmax=limit)
        axis.set_title(title, fontsize=10)
        axis.set_xticks([0, shown - 1], [1, shown])
        axis.set_yticks([0, shown - 1], [1, shown])
    figure.savefig(HERE / "operators.png", dpi=100)
    plt.close(figure)
    stage.reduce(HERE / "operators.png")


PICTURES = (
    {
        picture.__name__: picture
        for picture in (
            poses,
            builds,
            animals,
            resolution,
            parts,
            textures,
            confidence,
            failures,
            eigenfunctions,
            distances,
            operators,
        )
    }
    | show.PICTURES
    | steps.PICTURES
)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"some of {', '.join(PICTURES)}; all without"
    )
    options = parser.parse_args()
    for name in options.names:
        if name not in PICTURES:
            parser.error(f"no picture is called {name!r}; there are {', '.join(PICTURES)}")
    for name in options.names or PICTURES:
        PICTURES[name]()
        print(f"drew {name}", flush=True)


if __name__ == "__main__":
    status = 1
    try:
        main()
        status = 0
    except Exception:
        traceback.print_exc()
    # bpy's own clean-up at the interpreter's exit may hang; everything is written by now.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
