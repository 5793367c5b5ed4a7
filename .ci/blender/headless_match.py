# SPDX-License-Identifier: GPL-3.0-or-later
"""One match and one transfer in Blender without a window, with the extension that is installed there."""

import bpy
import sgmds


def body(name, stretch):
    """An icosphere pulled into a shape without symmetry."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    obj = bpy.context.object
    obj.name = name
    for vertex in obj.data.vertices:
        x, y, z = vertex.co
        vertex.co = (
            x * (1.0 + 0.8 * max(x, 0.0) ** 4),
            y * (0.8 + 0.5 * max(z, 0.0) ** 2),
            z * stretch + 0.3 * x * y,
        )
    return obj


def main():
    print("core", sgmds.__version__, "from", sgmds.__file__)
    target, source = body("Target", 1.4), body("Source", 1.5)
    source.vertex_groups.new(name="All").add(list(range(len(source.data.vertices))), 1.0, "REPLACE")
    target.select_set(True)
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert "match_face" in target.data.attributes and "All" in target.vertex_groups
    print("matched and transferred in Blender", bpy.app.version_string)


main()
