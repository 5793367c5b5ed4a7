# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way through the panel, with mouse and keyboard, a picture of each step.

The pictures are those of the manual. What our own code costs Blender's main thread is measured on the way.
"""

import importlib
import inspect
import sys
import threading
import time
from collections import defaultdict

import bpy
import gpu
import window
from mathutils import Matrix, Vector

# Seconds of the main thread that one call of ours may take, apart from writing a finished match.
LONGEST_BLOCK = 0.1


def addon(name):
    package = next(key for key in bpy.context.preferences.addons.keys() if key.endswith("spectral_match"))
    return importlib.import_module(f"{package}.{name}" if name else package)


def character(name, place, bend, length, detail):
    """A body with limbs of unequal length out of metaballs, turned into a mesh."""
    ball = bpy.data.metaballs.new(name)
    ball.resolution = 0.3 / detail
    limbs = (
        ((0, 0, 0), (0, 0, 1.6), 0.55),
        ((0, 0, 1.6), (0, -0.15, 2.5), 0.42),
        ((0.3, 0, 1.4), (1.6 * length, 0.2, 1.4 + bend), 0.26),
        ((-0.3, 0, 1.4), (-1.3, 0.3, 1.2 - bend), 0.26),
        ((0.25, 0, 0), (0.55, 0.1 + bend, -1.9 * length), 0.3),
        ((-0.25, 0, 0), (-0.5, -bend, -1.8), 0.3),
        ((0, 0.2, 0), (0.1, 1.3, -0.3 + bend), 0.18),
    )
    for start, end, radius in limbs:
        start, end = Vector(start), Vector(end)
        many = int((end - start).length / 0.12) + 2
        for i in range(many):
            element = ball.elements.new()
            element.co = start.lerp(end, i / (many - 1))
            element.radius = radius * 1.5
    made = bpy.data.objects.new(name, ball)
    bpy.context.collection.objects.link(made)
    bpy.context.view_layer.update()
    mesh = bpy.data.meshes.new_from_object(made.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    bpy.data.objects.remove(made)
    mesh.name = name
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    obj.location = place
    mesh.shade_smooth()
    bpy.context.view_layer.update()
    return obj


def choose(source, *targets):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == source or obj in targets)
    bpy.context.view_layer.objects.active = source


def dress(source):
    """Data to carry over: weights, UVs, paint."""
    for name, low, high in (("Head", 1.9, 9.0), ("Body", -0.3, 1.9), ("Legs", -9.0, -0.3)):
        group = source.vertex_groups.new(name=name)
        group.add([v.index for v in source.data.vertices if low <= v.co.z < high], 1.0, "REPLACE")
    layer = source.data.uv_layers.new(name="UVMap")
    for loop in source.data.loops:
        co = source.data.vertices[loop.vertex_index].co
        layer.uv[loop.index].vector = (co.x * 0.2 + 0.5, co.z * 0.2 + 0.4)
    source.data.color_attributes.new("Paint", "BYTE_COLOR", "CORNER")


class MainThread:
    """The longest that one call of each of our functions kept Blender's main thread busy."""

    def __init__(self):
        self.longest = defaultdict(float)
        self._writing = self._compiling = False

    def watch(self):
        """Measure every function of ours that Blender calls."""
        overlay, stored = addon("overlay"), addon("stored_match")
        self._mark_writing(addon("operators.running").JobOperator, "_end")
        # A transfer computes and writes while nothing else can be done.
        self._mark_writing(addon("operators.carry").SPECTRAL_MATCH_OT_transfer, "_read_on")
        for cls in (*addon("operators").CLASSES, *addon("panels").CLASSES):
            for name in (
                "poll",
                "invoke",
                "modal",
                "draw",
                "draw_header_preset",
                "draw_item",
                "filter_items",
            ):
                if callable(getattr(cls, name, None)):
                    self._measure(cls, name, f"{cls.__name__}.{name}")
        self._mark_compiling()
        overlay.unregister()
        for name in ("_draw_lines", "_draw_marks"):
            self._measure(overlay, name, name)
        overlay.register()
        self._measure(stored, "state", "stored_match.state")

    def _mark_compiling(self):
        """The driver, here on the processor, compiles a shader when it is first used."""
        inner, known = gpu.shader.from_builtin, set()

        def marked(name):
            self._compiling |= name not in known
            known.add(name)
            return inner(name)

        gpu.shader.from_builtin = marked

    def _mark_writing(self, cls, name):
        inner = getattr(cls, name)

        def marked(*arguments):
            self._writing = True
            return inner(*arguments)

        setattr(cls, name, marked)

    def _measure(self, owner, name, label):
        inner = getattr(owner, name)
        bound = isinstance(inspect.getattr_static(owner, name), classmethod)

        def measured(*arguments):
            self._writing = self._compiling = False
            # Time of this thread alone: what else the machine does is not our doing.
            begun = time.thread_time()
            try:
                return inner(*arguments)
            finally:
                if not self._writing and not self._compiling:
                    self.longest[label] = max(self.longest[label], time.thread_time() - begun)

        if inspect.ismodule(owner):
            setattr(owner, name, measured)
            return
        # Blender passes as many arguments as the function's code declares.
        names = ", ".join(f"a{i}" for i in range(len(inspect.signature(inner).parameters)))
        scope = {"measured": measured}
        if bound:
            setattr(owner, name, classmethod(eval(f"lambda cls, {names}: measured({names})", scope)))
        else:
            setattr(owner, name, eval(f"lambda {names}: measured({names})", scope))

    def report(self, title):
        worst = sorted(self.longest.items(), key=lambda entry: -entry[1])
        for label, seconds in worst[:6]:
            print(f"MAIN THREAD {title}: {label} {seconds * 1e3:.1f} ms")
        label, seconds = worst[0]
        assert seconds < LONGEST_BLOCK, f"{label} kept the window waiting for {seconds:.2f} s"
        self.longest.clear()


class Brake:
    """Holds the core at a share of its way until released, so that a picture of it can be taken."""

    def __init__(self, job):
        self._share = 2.0
        self._free = threading.Event()
        inner = job.Job._progress

        def braked(running, *arguments):
            report = inner(running, *arguments)

            def held(stage, fraction):
                report(stage, fraction)
                if running.fraction >= self._share:
                    self._free.wait()
                return report(stage, fraction)

            return held

        job.Job._progress = braked

    def on(self, share):
        self._share = share
        self._free.clear()

    def off(self):
        self._share = 2.0
        self._free.set()


def screen_place(obj, vertex):
    """Screen pixel of a vertex."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    region = window.region("WINDOW")
    place = obj.matrix_world @ obj.data.vertices[vertex].co
    pixel = location_3d_to_region_2d(region, region.data, place)
    return window.point("WINDOW", pixel.x, region.height - pixel.y)


def foremost(obj, target):
    """The vertex nearest to `target` in object space among those that face the viewer (who looks along Y)."""
    front = [v for v in obj.data.vertices if v.normal.y < -0.5]
    return min(front, key=lambda v: (v.co - Vector(target)).length).index


def look(space, distance=15.0):
    space.region_3d.view_rotation = (
        Matrix.Rotation(0.12, 4, "Z") @ Matrix.Rotation(1.45, 4, "X")
    ).to_quaternion()
    space.region_3d.view_distance = distance
    space.region_3d.view_location = (0.9, 0, 0.3)


def steps():
    job = addon("job")

    def troll():
        return bpy.data.objects["Troll"]

    def stored():
        return troll().data.spectral_match

    def idle(what, seconds=150.0):
        yield from window.until(lambda: job.current is None, what, seconds)

    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    hero = character("Hero", (-2.2, 0, 0), 0.1, 1.0, 2.2)
    choose(hero, character("Troll", (2.2, 0, 0), -0.35, 1.2, 2.0))
    dress(hero)
    core = importlib.import_module("sgmds").__file__
    print("VERSION", bpy.app.version_string, sys.version.split()[0])
    print("CORE loaded from", core)
    assert bpy.utils.resource_path("USER") in core, "a core that is not the zip's"
    print("VERTICES", len(hero.data.vertices), len(troll().data.vertices))
    space = window.view()["area"].spaces.active
    look(space)
    space.overlay.show_relationship_lines = False
    yield from window.open_tab("Match")
    thread = MainThread()
    thread.watch()
    brake = Brake(job)
    bpy.ops.ed.undo_push(message="Start")
    yield from window.shot("01_selected")

    brake.on(0.5)
    yield from window.press("spectral_match.match(")
    yield from window.until(lambda: job.current is not None and job.current.fraction >= 0.5, "progress")
    yield from window.shot("02_running")
    window.key("Escape")
    yield from window.until(lambda: job.current.cancelling, "Esc to be heard")
    brake.off()
    yield from idle("the end of the cancelled match")
    yield from window.shot("03_cancelled")
    assert "match_face" not in troll().data.attributes, "cancelled, and yet written"
    assert addon("notice").words == "Match stopped; nothing was changed"

    yield from window.press("spectral_match.match(")
    yield from idle("the match")
    yield from window.shot("04_matched")
    assert "match_face" in troll().data.attributes
    print("GRADE", stored().grade, stored().mean_confidence, "in", stored().seconds, "s")

    yield from window.press("what='CONFIDENCE'", 0.5)
    yield from window.until(
        lambda: troll().data.color_attributes.active_color.name == "match_heat", "the heat map"
    )
    yield from window.shot("05_confidence")
    yield from window.press("what='COLOURS'", 0.15)
    yield from window.press("spectral_match.lines", 0.25)
    yield from window.shot("06_lines")
    yield from window.press("spectral_match.morph", 0.75)
    yield from window.until(lambda: troll().modifiers, "the morph")
    modifier = troll().modifiers[0]
    assert modifier.type == "NODES"
    morph = addon("morph")
    modelled = sum((v.co for v in troll().data.vertices), Vector()) / len(troll().data.vertices)

    def away():
        return (Vector(shown_centre(troll())) - modelled).length

    assert away() < 0.3, "a morph begins where the target stands"
    morph.set_value(modifier, morph.FACTOR, 0.5)
    bpy.context.view_layer.update()
    yield from window.shot("07_morph")
    morph.set_value(modifier, morph.WIPE, True)
    bpy.context.view_layer.update()
    yield from window.shot("07_wipe")
    assert away() < 0.3, "a wipe stays where the target stands"
    for way in (morph.IN_PLACE, morph.WIPE):
        morph.set_value(modifier, way, False)
    bpy.context.view_layer.update()
    assert away() > 1.0, "a morph that is not in place moves the target to the source"
    yield from window.press("spectral_match.morph", 0.75)
    yield from window.until(lambda: not troll().modifiers, "the end of the morph")
    yield from window.press("spectral_match.lines", 0.25)

    yield from window.open_panel("spectral_match.lines", "spectral_match.swap_sides")
    yield from window.shot("08_fix")
    if stored().alternatives > 1:
        stepper = yield from window.find("spectral_match.alternative(step=1)")
        yield from window.press("spectral_match.alternative(step=1)")
        yield from idle("the alternative")
        assert stored().alternative == 1
        stays = yield from window.is_at("spectral_match.alternative(step=1)", stepper)
        assert stays, "the arrows stay under the pointer"
        yield from window.shot("09_alternative")
        yield from undo(lambda: stored().alternative == 0, "one undo to take back the alternative")
    yield from window.press("spectral_match.swap_sides")
    yield from idle("the match with sides swapped")
    assert stored().swapped_sides
    yield from window.shot("10_swapped")
    yield from undo(lambda: not stored().swapped_sides, "one undo to take back the swapped match")

    yield from window.press("spectral_match.pick_landmarks")
    hero = bpy.data.objects["Hero"]
    settings = bpy.context.scene.spectral_match
    pairs = []
    for number, (on_hero, on_troll) in enumerate(
        (((1.5, 0, 1.5), (1.8, 0, 1.1)), ((0, 0, 2.5), (0, 0, 2.5)))
    ):
        pair = foremost(hero, on_hero), foremost(troll(), on_troll)
        window.click(*screen_place(hero, pair[0]))
        yield from window.until(lambda: addon("overlay").picking.first is not None, "the first pick")
        if number == 1:
            window.pointer(*screen_place(troll(), pair[1]))
            yield from window.redrawn()
            window.picture("11_picking")
        window.click(*screen_place(troll(), pair[1]))
        yield from window.until(lambda n=number: len(settings.landmarks) == n + 1, "the second pick")
        pairs.append(pair)
    window.key("Return")
    yield from window.until(lambda: addon("overlay").picking is None, "the end of picking")
    picked = [(mark.source_vertex, mark.target_vertex) for mark in settings.landmarks]
    assert picked == pairs, (picked, pairs)
    yield from window.shot("12_landmarks")
    yield from window.press("spectral_match.go_to_landmark(end='TARGET')", 0.75)
    yield from window.shot("13_go_to")
    look(space)
    yield from window.press("spectral_match.match(")
    yield from idle("the match with landmarks")
    face = troll().data.attributes["match_face"].data
    for source_vertex, target_vertex in pairs:
        hero.data.calc_loop_triangles()
        image = troll().data.attributes["match_position"].data[target_vertex].vector
        away = (image - hero.data.vertices[source_vertex].co).length
        print("LANDMARK image is", round(away, 3), "away, triangle", face[target_vertex].value)
        assert away < 0.3, "a landmark's image is where it was picked"
    yield from window.shot("14_landmarks_matched")
    yield from window.press("spectral_match.remove_landmark", 0.9)
    settings = bpy.context.scene.spectral_match
    yield from window.until(lambda: len(settings.landmarks) == 1, "the removal")
    yield from window.close_panel("spectral_match.swap_sides")
    yield from lists()
    place = yield from window.find("spectral_match.transfer()")
    yield from window.press("spectral_match.transfer()")
    yield from window.until(lambda: len(troll().vertex_groups) == 3, "the transfer")
    assert len(troll().data.uv_layers) == 1
    yield from idle("the end of the transfer")
    yield from window.shot("15_transferred")
    assert (yield from window.is_at("spectral_match.transfer()", place)), "Transfer stays under the pointer"
    yield from adjust(troll, lambda: not troll().data.uv_layers, "a transfer without UV maps")
    assert len(troll().vertex_groups) == 3
    assert not bpy.context.scene.spectral_match.use_uv, "the panel shows what was adjusted"
    yield from window.press("spectral_match.compare(back=True)", 0.25)
    yield from window.until(lambda: not troll().vertex_groups, "the target as before")
    yield from window.press("spectral_match.compare(back=False)", 0.75)
    yield from window.until(lambda: len(troll().vertex_groups) == 3, "the target as after")
    yield from undo(lambda: not troll().vertex_groups, "one undo to take back the transfer")
    yield from window.shot("16_undone")
    yield from redo(lambda: len(troll().vertex_groups) == 3, "redo to bring it back")
    bpy.context.scene.spectral_match.use_uv = True

    third = character("Dwarf", (0, 0, 0), 0.2, 0.9, 1.8)
    third.scale = (0.7, 0.7, 0.6)
    hero, ogre = bpy.data.objects["Hero"], troll()
    flat = character("Flat", (0, 0, 0), 0.0, 1.0, 1.0)
    flat.scale = (1.0, 0.0, 1.0)
    flat.location = (4.4, 0, 0)
    choose(hero, flat)
    bpy.context.view_layer.update()
    yield from window.press("spectral_match.match(")
    yield from idle("the refusal")
    assert "scale" in addon("notice").words
    # Blender's own pop-up tells of the failure too, until the pointer leaves it or Esc is pressed.
    window.key("Escape")
    yield from window.shot("17_refused")
    yield from window.press("spectral_match.unit_scale")
    yield from window.until(lambda: bpy.data.objects["Flat"].scale.y == 1.0, "the remedy")
    assert not addon("notice").words
    flat = bpy.data.objects["Flat"]
    bpy.data.objects.remove(flat)
    ogre = troll()
    there = ogre.data.vertices[0].co.copy()
    ogre.data.vertices[0].co.z += 0.05
    ogre.data.update()
    choose(hero, ogre)
    yield from window.shot("18_moved")
    ogre.data.vertices[0].co = there
    ogre.data.update()
    choose(hero, third, character("Imp", (5.0, 0, 0), -0.1, 1.1, 1.8))
    # Below Match Options; a click beneath all panels would go to the viewport.
    yield from window.open_panel("spectral_match.transfer()", "spectral_match.batch", distances=(62,))
    yield from window.shot("19_batch")
    yield from window.press("spectral_match.batch")
    yield from idle("the batch", 240.0)
    third = bpy.data.objects["Dwarf"]
    assert len(third.vertex_groups) == 3 and third.data.spectral_match.grade
    yield from window.shot("20_batch_done")
    thread.report("small meshes")

    for obj in (hero, third):
        if obj.name == "Dwarf":
            bpy.data.objects.remove(obj)
    big = [fine_copy(bpy.data.objects[name]) for name in ("Hero", "Troll")]
    print("VERTICES", [len(obj.data.vertices) for obj in big])
    choose(*big)
    yield from window.redrawn()
    thread.longest.clear()
    brake.on(0.05)
    yield from window.press("spectral_match.match(")
    yield from window.until(
        lambda: job.current is not None and job.current.fraction >= 0.05, "progress", 120.0
    )
    brake.off()
    window.key("Escape")
    yield from idle("the end of the large match")
    thread.report("large meshes")

    for name in ("Hero", "Troll"):
        bpy.data.objects[name].hide_set(True)
    package = addon("").__name__
    # The folder of this run says nothing to a reader.
    bpy.context.preferences.addons[package].preferences.cache_folder = "/home/artist/prepared_meshes"
    with bpy.context.temp_override(**window.view()):
        bpy.ops.preferences.addon_show(module=package)
    yield 2.0
    window.picture("21_preferences")


def shown_centre(obj):
    """Mean vertex of an object as shown, in its own space."""
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return sum((v.co for v in shown.vertices), Vector()) / len(shown.vertices)


def fine_copy(obj):
    """The object with each face cut twice in four, as a plain mesh."""
    fine = obj.copy()
    fine.data = obj.data.copy()
    fine.name = f"Fine {obj.name}"
    bpy.context.collection.objects.link(fine)
    fine.modifiers.new("Fine", "SUBSURF").levels = 2
    bpy.context.view_layer.update()
    fine.data = bpy.data.meshes.new_from_object(fine.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    fine.modifiers.clear()
    for attribute in [a.name for a in fine.data.attributes if a.name.startswith("match_")]:
        fine.data.attributes.remove(fine.data.attributes[attribute])
    return fine


def lists():
    """`yield from`: a list of groups comes when it is opened."""
    panel = bpy.context.window_manager.spectral_match_panel
    panel.open_groups = True
    yield from window.redrawn()
    held = bpy.context.window_manager.spectral_match_lists
    yield from window.until(lambda: "groups" in held and len(held["groups"].entries) == 3, "the list")
    yield from window.shot("15_list")
    panel.open_groups = False


def adjust(target, done, what):
    """Press F9 and switch one check box after another off and on again, until it is done.

    Those of the kinds stand below each other at the left edge, where the pointer opens the pop-up.
    """
    x, y = window.point("WINDOW", 300, 300)
    window.pointer(x, y)
    window.key("F9")
    yield 3.0
    window.picture("15_adjust")
    groups = len(target().vertex_groups)
    for down in range(12, 400, 8):
        window.click(x + 9, y + down)
        yield 1.0
        if done():
            break
        if len(target().vertex_groups) != groups:
            window.click(x + 9, y + down)
            yield from window.until(lambda: len(target().vertex_groups) == groups, "what was switched off")
    yield 2.0
    window.picture("15_adjusted")
    assert done(), what
    window.key("Escape")
    yield 1.0


def undo(done, what):
    window.pointer(*window.point("WINDOW", 420, 300))
    window.key("ctrl+z")
    yield from window.until(done, what)
    yield from window.redrawn()


def redo(done, what):
    window.pointer(*window.point("WINDOW", 420, 300))
    window.key("ctrl+shift+z")
    yield from window.until(done, what)
    yield from window.redrawn()


window.run(steps)
