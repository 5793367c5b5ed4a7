# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of whole characters, Mia and Bruno: matched, painted, dressed, walking, and the loop at the top
of README.

All are taken from one scene, which is made once a run: `played`.
"""

import contextlib
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import bpy
import numpy as np
from cast import people, scene, studio
from cast.anatomy import INDEX
from mathutils.kdtree import KDTree
from PIL import Image

import addon

HERE = Path(__file__).resolve().parent
STEP = 1.15
SAMPLES = 20
MIAS = ("Coat", "Buttons", "Leggings", "Boots", "Satchel")
BRUNOS = ("Shirt", "Trousers", "Belt", "Shoes")
"""His beanie he keeps on."""
STRIDE = 8
"""Frame of the walk in which both legs are apart."""
FRAMES = (1, 7, 13, 19)
"""Quarters of the walk."""
KEYS = "groups,armature,keys"
COLOURS = "colours of all pieces"


# ------------------------------------------------------------------ the scene


@cache
def played() -> Path:
    """The scene as a file. Bruno was matched with Mia and has her rig, walk, keys, texture and outfit; `Mia
    in blue` and `Bruno in blue` have rigs of their own with other names of bones, and she has his outfit."""
    cleared()
    with registered():
        girl, sailor = people.mia(), people.bruno()
        mia = scene.staged(girl)
        scene.add_walk(mia, 2)
        bruno = scene.staged(sailor, rig=False, keys=False)
        chosen(mia, bruno)
        bpy.ops.spectral_match.match()
        keep_colours(mia, bruno)
        bpy.ops.spectral_match.transfer(kinds=KEYS)
        bpy.ops.spectral_match.transfer(kinds="materials,textures")
        match_bare(mia, bruno)
        bpy.context.scene.spectral_match.outfit_hide = True
        fit(mia, MIAS)
        other_mia, other_bruno = (scene.staged(each, label=f"{each.name} in blue") for each in (girl, sailor))
        scene.add_walk(other_mia, 2)
        match_bare(other_bruno, other_mia)
        fit(other_bruno, BRUNOS)
        path = Path(tempfile.mkdtemp()) / "played.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def cleared():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


@contextlib.contextmanager
def registered():
    """The extension, until the picture is drawn."""
    addon.register()
    try:
        yield
    finally:
        addon.unregister()


def chosen(source, target, piece="Body"):
    bpy.ops.object.select_all(action="DESELECT")
    for actor in (target, source):
        actor.meshes[piece].select_set(True)
    bpy.context.view_layer.objects.active = source.meshes[piece]


def match_bare(source, target):
    """Match the bodies alone, for clothes."""
    chosen(source, target)
    scene.leave_out_worn(source, target)
    bpy.ops.spectral_match.match()


def keep_colours(*actors):
    """Keep the colours of the match of all pieces, which a match of fewer replaces."""
    for actor in actors:
        for obj in actor.objects:
            found = obj.data.color_attributes["match_color"]
            values = np.empty(4 * len(found.data), np.float32)
            found.data.foreach_get("color", values)
            kept = obj.data.color_attributes.new(COLOURS, found.data_type, found.domain)
            kept.data.foreach_set("color", values)


def fit(wearer, names):
    bpy.ops.spectral_match.fit_outfit(garments="\n".join(wearer.meshes[name].name for name in names))


def opened(frame=0):
    """The scene anew, nothing of it in the picture yet. At frame 0 all stand as they were made."""
    bpy.ops.wm.open_mainfile(filepath=str(played()))
    for obj in bpy.data.objects:
        obj.hide_render = True
        if obj.type == "ARMATURE":
            obj.data.pose_position = "POSE" if frame else "REST"
    bpy.context.scene.frame_set(frame)


def pieces(label, leave=()):
    """Meshes of a character by its label, but for those named."""
    skipped = {f"{label} {name}" for name in leave}
    return [
        obj
        for obj in bpy.data.collections[label].objects
        if obj.type == "MESH" and obj.name not in skipped and obj.name.startswith(f"{label} ")
    ]


def outfit(wearer, names):
    """Copies of garments that Fit Outfit made."""
    originals = {f"{wearer} {name}" for name in names}
    return [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") in originals]


def baked_look(objects, carried: bool):
    """Show the objects' own materials, which stay in the first slot, or the carried ones."""
    for obj in objects:
        slots = len(obj.data.materials)
        numbers = np.zeros(len(obj.data.polygons), np.int32)
        if carried:
            obj.data.attributes["carried look"].data.foreach_get("value", numbers)
        obj.data.polygons.foreach_set("material_index", np.minimum(numbers, slots - 1))
        obj.data.update()


def posed(objects, x, name, colours=None):
    worn = any("spectral_match_made_from" in obj for obj in objects)
    for obj in objects:
        obj.hide_set(False)
        obj.hide_render = False
    hide_skin(objects, worn)
    copies = studio.statue(objects, x, name, colours)
    for obj in objects:
        obj.hide_render = True
    return copies


def hide_skin(objects, hidden: bool):
    """Hide skin below the outfit that was fitted, or show it, as below the own one."""
    for modifier in (modifier for obj in objects for modifier in obj.modifiers):
        if modifier.type == "MASK":
            modifier.show_viewport = modifier.show_render = hidden


def keep_carried(objects):
    """Remember which carried material each face has, and show the own one."""
    for obj in objects:
        numbers = np.empty(len(obj.data.polygons), np.int32)
        obj.data.polygons.foreach_get("material_index", numbers)
        layer = obj.data.attributes.new("carried look", "INT", "FACE")
        layer.data.foreach_set("value", numbers)
    baked_look(objects, False)


# ------------------------------------------------------------------ pictures


def drawn(height, samples=SAMPLES):
    """What stands in the studio that was built."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "row.png"
        studio.rendered(path, (1200, height), samples)
        with Image.open(path) as picture:
            return picture.convert("RGB")


def row(name, width, height=480, samples=SAMPLES, **studio_options):
    """Draw what stands in the scene, `width` metres wide."""
    studio.built(width=width, **studio_options)
    keep(name, drawn(height, samples))


def keep(name, picture):
    picture.save(HERE / f"{name}.webp", quality=86, method=6)


def matched():
    """Both as they are, and both in the colours of the match."""
    opened()
    bruno = pieces("Bruno")
    keep_carried(bruno)
    for k, colours in enumerate((None, COLOURS)):
        posed(pieces("Mia"), (2 * k - 1.5) * STEP, f"Mia {k}", colours)
        posed(bruno, (2 * k - 0.5) * STEP, f"Bruno {k}", colours)
    row("matched", 4.9)


def painted():
    """Mia, Bruno as he comes, and Bruno in her texture."""
    opened()
    bruno = pieces("Bruno")
    keep_carried(bruno)
    posed(pieces("Mia"), -STEP, "Mia 0")
    posed(bruno, 0.0, "Bruno 0")
    baked_look(bruno, True)
    posed(bruno, STEP, "Bruno 1")
    row("painted", 4.2, 540)


def dressed():
    """Who wears it, and the other one in it, both ways, walking."""
    opened(STRIDE)
    bruno = pieces("Bruno", BRUNOS)
    keep_carried(pieces("Bruno"))
    posed(pieces("Mia"), -1.5 * STEP, "Mia 0")
    posed([*bruno, *outfit("Mia", MIAS)], -0.5 * STEP, "Bruno 0")
    posed(pieces("Bruno"), 0.5 * STEP, "Bruno 1")
    posed(
        [*pieces("Mia in blue", MIAS), *outfit("Bruno in blue", BRUNOS)],
        1.5 * STEP,
        "Mia 1",
    )
    row("dressed", 4.9, turn=0.15)


def exchanged():
    """Bruno in her outfit and Mia in his, through a walk of each rig."""
    opened(1)
    keep_carried(pieces("Bruno"))
    for k, frame in enumerate(FRAMES):
        bpy.context.scene.frame_set(frame)
        bruno = [*pieces("Bruno", BRUNOS), *outfit("Mia", MIAS)]
        mia = [*pieces("Mia in blue", MIAS), *outfit("Bruno in blue", BRUNOS)]
        for side, name, objects in ((-1, "Bruno", bruno), (1, "Mia", mia)):
            for copy in posed(objects, 0.85 * (k - 1.5) + 1.95 * side, f"{name} {k}"):
                copy.rotation_euler.z = -0.75
    row("exchanged", 7.6, 330)


def shafts():
    """From near, what does not ship: shafts of Mia's boots on thicker legs, beside her."""
    opened(STRIDE)
    keep_carried(pieces("Bruno"))
    posed(pieces("Mia"), -0.35, "Mia 0")
    posed([*pieces("Bruno", BRUNOS), *outfit("Mia", MIAS)], 0.35, "Bruno 0")
    row("shafts", 1.5, middle=(0.0, 0.0, 0.3))


def walking():
    """The walk that came with Mia's rig, on Bruno."""
    opened(1)
    keep_carried(pieces("Bruno"))
    for k, frame in enumerate(FRAMES):
        bpy.context.scene.frame_set(frame)
        for side, label in ((-1, "Mia"), (1, "Bruno")):
            for copy in posed(pieces(label), 0.85 * (k - 1.5) + 1.95 * side, f"{label} {k}"):
                copy.rotation_euler.z = -0.75
    row("walking", 7.6, 330)


FACE = ("Head", "Eyes", "Lids", "Lashes", "Mouth", "Brows")
LIFT = 0.17
"""By which Bruno's head is lifted to Mia's."""
EXPRESSIONS = (
    {},
    {"mouthSmileLeft": 1.2, "mouthSmileRight": 1.2, "cheekSquintLeft": 1.0, "cheekSquintRight": 1.0},
    {"jawOpen": 1.0},
    {"mouthPucker": 1.0, "cheekPuff": 1.0},
)


def _head(person, keys, label, leave=()):
    """The pieces of a face, and what else is on the head."""
    shown = [piece for piece in person.pieces if not piece.weights[:, INDEX["hips"]].any()]
    face = [piece for piece in shown if piece.name in FACE]
    leave = ("Hands", "Shoes", "Boots", *leave)
    worn = [piece for piece in shown if piece not in face and piece.name not in leave]
    return (
        scene.staged(replace(person, pieces=face), rig=False, keys=keys, label=label),
        scene.staged(replace(person, pieces=worn), rig=False, keys=False, label=f"{label} wears"),
    )


def _carry_keys(source, target):
    with registered():
        chosen(source, target, "Head")
        bpy.ops.spectral_match.match()
        bpy.ops.spectral_match.transfer(kinds="keys")


def _makes(head, expression, x, lift, name):
    """Copies of a head's pieces at `x` that make a face."""
    face, worn = head
    for obj in face.objects:
        for key in obj.data.shape_keys.key_blocks if obj.data.shape_keys else ():
            key.slider_max = 2.0
            key.value = expression.get(key.name, 0.0)
    bpy.context.view_layer.update()
    copies = posed([*face.objects, *worn.objects], x, name)
    for copy in copies:
        copy.location.z = lift
        copy.rotation_euler.z = 0.25
    return copies


def faces():
    """Keys of Mia's face, and the same on Bruno's; the heads were matched by themselves."""
    cleared()
    heads = _head(people.mia(), True, "Mia"), _head(people.bruno(), False, "Bruno")
    _carry_keys(heads[0][0], heads[1][0])
    for k, expression in enumerate(EXPRESSIONS):
        for side, head in zip((-1, 1), heads, strict=True):
            lift = 0.0 if side < 0 else LIFT
            _makes(head, expression, 0.46 * (k - 1.5) + 0.98 * side, lift, f"{side} {k}")
    row("faces", 3.9, 260, middle=(0, 0, 1.46))


JUDGED = (
    {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0},
    {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0},
    {"jawOpen": 1.0},
)


def expressions():
    """Eyes shut, a smile and an open jaw, a row each: Mia's; Bruno's as they were made for him; as they
    were carried from Mia; and as they come from the nearest vertex."""
    cleared()
    mia, bruno = people.mia(), people.bruno()
    heads = [
        _head(mia, True, "Mia"),
        _head(bruno, True, "Made", leave=("Beard",)),
        _head(bruno, False, "Carried", leave=("Beard",)),
        _head(_with_nearest_keys(mia, bruno), True, "Nearest", leave=("Beard",)),
    ]
    _carry_keys(heads[0][0], heads[2][0])
    studio.built(width=2.05, middle=(0, 0, 1.40))
    stacked = Image.new("RGB", (1200, 240 * len(JUDGED)))
    for number, expression in enumerate(JUDGED):
        copies = [
            copy
            for k, head in enumerate(heads)
            for copy in _makes(head, expression, 0.5 * (k - 1.5), LIFT if k else 0.0, f"{number} {k}")
        ]
        stacked.paste(drawn(240), (0, 240 * number))
        for copy in copies:
            copy.hide_render = True
    keep("expressions", stacked)


def _with_nearest_keys(source, target):
    """The target with keys of the source: each vertex of its face moves as the nearest vertex of the source's
    does, both heads laid over one another by their boxes."""

    def box(person):
        (head,) = (piece.vertices for piece in person.pieces if piece.name == "Head")
        return head.min(axis=0), np.ptp(head, axis=0)

    (low, size), (own_low, own_size) = box(source), box(target)
    face = [piece for piece in source.pieces if piece.name in FACE]
    names = {name for piece in face for name in piece.keys}
    shifts = {
        name: np.concatenate([piece.keys.get(name, 0.0 * piece.vertices) for piece in face]) for name in names
    }
    points = np.concatenate([piece.vertices for piece in face])
    tree = KDTree(len(points))
    for number, point in enumerate(((points - low) / size).tolist()):
        tree.insert(point, number)
    tree.balance()

    def keyed(piece):
        laid = (piece.vertices - own_low) / own_size
        nearest = [tree.find(point)[1] for point in laid.tolist()]
        moved = {name: shift[nearest] / size * own_size for name, shift in shifts.items()}
        return replace(piece, keys=moved)

    return replace(target, pieces=[keyed(p) if p.name in FACE else p for p in target.pieces])


def ink():
    look = bpy.data.materials.get("Ink") or bpy.data.materials.new("Ink")
    look.use_nodes = True
    look.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.03, 0.03, 0.05, 1.0)
    return look


# ------------------------------------------------------------------ the loop

FRAME_RATE = 8
LOOP_SIZE = 640, 360
TOP = 2.0
"""Height above all characters, metres, where a sweep ends."""


def _ramp(nodes, links, height, name, wide):
    """1 below a level that is set by `Sweep.level`, 0 above, over `wide` metres."""
    node = nodes.new("ShaderNodeMapRange")
    node.name = name
    node["wide"] = wide
    node.inputs["To Min"].default_value, node.inputs["To Max"].default_value = 1.0, 0.0
    links.new(height, node.inputs["Value"])
    return node


class Sweep:
    """Levels that rise over everything: below `colours` the match's colours are seen, below `dressed` the
    new outfit."""

    def __init__(self):
        self.group = bpy.data.node_groups.new("Sweep", "ShaderNodeTree")
        nodes, links = self.group.nodes, self.group.links
        out = nodes.new("NodeGroupOutput")
        place, split = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeSeparateXYZ")
        links.new(place.outputs["Position"], split.inputs[0])
        for name in ("colours", "dressed"):
            self.group.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketFloat")
        for name, wide in (("colours", 0.10), ("dressed", 0.03)):
            links.new(_ramp(nodes, links, split.outputs["Z"], name, wide).outputs["Result"], out.inputs[name])
        self.level(colours=-1.0, dressed=-1.0)

    def level(self, **levels):
        for name, height in levels.items():
            node = self.group.nodes[name]
            node.inputs["From Min"].default_value = height - node["wide"]
            node.inputs["From Max"].default_value = height

    def wear(self, objects, shown=None):
        """Let objects change colour with the sweep; those with `shown` "below" or "above" are seen only
        there."""
        for material in {obj.data.materials[0] for obj in objects}:
            nodes, links = material.node_tree.nodes, material.node_tree.links
            group = nodes.new("ShaderNodeGroup")
            group.node_tree = self.group
            shader, out = nodes["Principled BSDF"], nodes["Material Output"]
            texture = shader.inputs["Base Color"].links[0].from_socket
            if shown is None or shown == "above":
                mix, colours = nodes.new("ShaderNodeMix"), nodes.new("ShaderNodeVertexColor")
                mix.data_type, colours.layer_name = "RGBA", COLOURS
                links.new(group.outputs["colours"], mix.inputs["Factor"])
                links.new(texture, mix.inputs[6])
                links.new(colours.outputs["Color"], mix.inputs[7])
                links.new(mix.outputs[2], shader.inputs["Base Color"])
            if shown:
                blend, clear = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeBsdfTransparent")
                links.new(group.outputs["dressed"], blend.inputs["Fac"])
                first, second = (shader, clear) if shown == "above" else (clear, shader)
                links.new(first.outputs[0], blend.inputs[1])
                links.new(second.outputs[0], blend.inputs[2])
                links.new(blend.outputs[0], out.inputs["Surface"])


def loop(folder=None, samples=5):
    """Ten seconds: colours flow over both, the walk arrives, the outfit arrives."""
    opened()
    bpy.context.scene.render.use_persistent_data = True
    own_clothes = [obj for obj in pieces("Bruno") if obj.name.split(" ")[1] in BRUNOS]
    bare = pieces("Bruno", BRUNOS)
    fitted = outfit("Mia", MIAS)
    keep_carried(pieces("Bruno"))
    sweep = Sweep()
    # Garments share materials with Mia's; the copies on Bruno come into view by themselves.
    for obj in fitted:
        obj.data.materials[0] = obj.data.materials[0].copy()
        obj.data.polygons.foreach_set("material_index", np.zeros(len(obj.data.polygons), np.int32))
    for obj in (*pieces("Mia"), *pieces("Bruno"), *fitted):
        # What is not shown need not be loaded.
        while len(obj.data.materials) > 1:
            obj.data.materials.pop()
    sweep.wear(fitted, "below")
    sweep.wear(own_clothes, "above")
    sweep.wear([*pieces("Mia"), *bare])
    for obj in (*pieces("Mia"), *bare, *own_clothes, *fitted):
        obj.hide_set(False)
        obj.hide_render = False
    for objects, x in ((pieces("Mia"), -0.56), ([*bare, *own_clothes, *fitted], 0.56)):
        for root in {top(each) for obj in objects for each in (obj, obj.find_armature())}:
            root.location.x += x
    studio.built(width=3.35, middle=(0, 0, 0.80), turn=0.12)
    rigs = {label: next(obj.find_armature() for obj in pieces(label)) for label in ("Mia", "Bruno")}
    folder = Path(folder or tempfile.mkdtemp())
    frames, lasting = [], []

    def taken(seconds=1.0 / FRAME_RATE, *, walk=None, moving=("Mia", "Bruno"), **levels):
        for label, rig in rigs.items():
            rig.data.pose_position = "POSE" if walk is not None and label in moving else "REST"
        hide_skin(bare, levels.get("dressed") == TOP)
        bpy.context.scene.frame_set(walk or 1)
        sweep.level(**levels)
        path = folder / f"{len(frames):03d}.png"
        if not path.exists():
            studio.rendered(path, LOOP_SIZE, samples)
        frames.append(path)
        lasting.append(round(1000 * seconds))

    heights = np.linspace(0.1, TOP, 9)
    taken(0.8, colours=-1.0)
    for height in heights:
        taken(0.1, colours=height)
    lasting[-1] = 1200
    for height in heights[::-1][1:]:
        taken(0.07, colours=height)
    strides = range(1, scene.WALK_FRAMES + 1, 3)
    for frame in strides:
        taken(walk=frame, moving=("Mia",), colours=-1.0)
    first = len(frames)
    for frame in strides:
        taken(walk=frame)
    frames += frames[first:]
    lasting += lasting[first:]
    for frame, height in zip(strides, np.linspace(0.05, 1.35, len(strides)), strict=True):
        taken(walk=frame, dressed=height)
    last = len(frames)
    for frame in strides:
        taken(walk=frame, dressed=TOP)
    frames += frames[last:]
    lasting += lasting[last:]
    images = [Image.open(path).convert("RGB") for path in frames]
    images[0].save(
        HERE / "loop.webp",
        save_all=True,
        append_images=images[1:],
        duration=lasting,
        loop=0,
        quality=72,
        method=6,
    )


def top(obj):
    while obj.parent:
        obj = obj.parent
    return obj


PICTURES = {
    picture.__name__: picture
    for picture in (matched, painted, dressed, exchanged, shafts, walking, faces, expressions, loop)
}
