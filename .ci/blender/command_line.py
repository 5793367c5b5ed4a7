# SPDX-License-Identifier: GPL-3.0-or-later
"""Files for the test of the command line, and a look at what it made of them.

blender --background --python command_line.py -- make|check FOLDER
"""

import sys
from pathlib import Path

import bpy


def body(name, turned):
    """An icosphere pulled into a shape without symmetry."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    obj = bpy.context.object
    obj.name = name
    for vertex in obj.data.vertices:
        x, y, z = vertex.co
        x, y, z = (
            x * (1.0 + 0.8 * max(x, 0.0) ** 4),
            y * (0.8 + 0.5 * max(z, 0.0) ** 2),
            z * 1.5 + 0.3 * x * y,
        )
        vertex.co = (-y, x, z) if turned else (x, y, z)
    return obj


def make(folder):
    for name in ("hero", "orc"):
        bpy.ops.wm.read_homefile(use_empty=True)
        obj = body(name.title(), turned=name == "orc")
        if name == "hero":
            obj.vertex_groups.new(name="All").add(list(range(len(obj.data.vertices))), 1.0, "REPLACE")
        else:
            # A mesh without faces, which cannot be matched.
            bpy.context.collection.objects.link(bpy.data.objects.new("Pot", bpy.data.meshes.new("Pot")))
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    lines = ("[[jobs]]", 'files = "orc.blend"', 'source = "Hero"', 'source_file = "hero.blend"')
    (folder / "cast.toml").write_text("\n".join((*lines, 'targets = ["Orc", "Pot"]')))


def check(folder):
    for path in ("one.blend", "cast/orc.blend"):
        bpy.ops.wm.open_mainfile(filepath=str(folder / path))
        assert "All" in bpy.data.objects["Orc"].vertex_groups, path
        assert "Hero" not in bpy.data.objects, path


step, folder = sys.argv[sys.argv.index("--") + 1 :]
{"make": make, "check": check}[step](Path(folder))
