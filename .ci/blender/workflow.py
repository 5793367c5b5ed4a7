# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way through the panel, with mouse and keyboard, a picture of each step."""

import importlib
import sys

import bpy
import window
from mathutils import Matrix, Vector


def addon(name):
    package = next(key for key in bpy.context.preferences.addons.keys() if key.endswith("spectral_match"))
    return importlib.import_module(f"{package}.{name}")


def character(name, place, bend, length, divisions, detail):
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


def choose(source, target):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (source, target))
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


def steps():
    job = addon("job")
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    source = character("Hero", (-2.2, 0, 0), 0.1, 1.0, 0, 3.0)
    target = character("Troll", (2.2, 0, 0), -0.35, 1.2, 0, 2.6)
    dress(source)
    choose(source, target)
    print(
        "VERSION", bpy.app.version_string, sys.version.split()[0], importlib.import_module("sgmds").__file__
    )
    print("VERTICES", len(source.data.vertices), len(target.data.vertices))
    space = window.view()["area"].spaces.active
    space.region_3d.view_rotation = (
        Matrix.Rotation(0.12, 4, "Z") @ Matrix.Rotation(1.45, 4, "X")
    ).to_quaternion()
    space.region_3d.view_distance = 13.0
    space.region_3d.view_location = (0, 0, 0.3)
    space.overlay.show_relationship_lines = False
    yield from window.open_tab("Match")
    window.picture("1_selected")

    # The Match button is the first wide one under source and target.
    yield from press_match(job)
    yield from window.until(lambda: job.current is None or job.current.fraction > 0.3, "progress")
    yield from window.redrawn()
    window.picture("2_running")
    window.key("Escape")
    yield from window.until(lambda: job.current is None, "the end of the cancelled match")
    yield from window.redrawn()
    window.picture("3_cancelled")
    assert "match_face" not in target.data.attributes, "cancelled, and yet written"

    yield from press_match(job)
    yield from window.until(lambda: job.current is None, "the match", 120.0)
    yield from window.redrawn()
    window.picture("4_matched")
    target = bpy.data.objects["Troll"]
    assert "match_face" in target.data.attributes
    print("GRADE", target.data.spectral_match.grade, target.data.spectral_match.mean_confidence)

    with bpy.context.temp_override(**window.view()):
        bpy.ops.spectral_match.show("INVOKE_DEFAULT", True, what="CONFIDENCE")
    yield from window.redrawn()
    window.picture("5_confidence")
    with bpy.context.temp_override(**window.view()):
        bpy.ops.spectral_match.show("INVOKE_DEFAULT", True, what="COLOURS")
        bpy.ops.spectral_match.transfer("INVOKE_DEFAULT", True)
    yield from window.redrawn()
    window.picture("6_transferred")
    target = bpy.data.objects["Troll"]
    assert len(target.vertex_groups) == 3 and len(target.data.uv_layers) == 1
    with bpy.context.temp_override(**window.view()):
        bpy.ops.ed.undo()
    yield from window.redrawn()
    assert not bpy.data.objects["Troll"].vertex_groups, "one undo takes back the transfer"
    window.picture("7_undone")
    with bpy.context.temp_override(**window.view()):
        bpy.ops.ed.redo()
    yield from window.redrawn()
    assert len(bpy.data.objects["Troll"].vertex_groups) == 3, "redo brings it back"


def press_match(job):
    """Press the button where it is drawn; its height depends on the theme's scale."""
    for y in range(60, 180, 10):
        window.click(*window.point("UI", 110, y))
        yield 0.4
        if job.current is not None:
            print("MATCH pressed at", y)
            return
    raise AssertionError("the Match button was not hit")


window.run(steps)
