# SPDX-License-Identifier: GPL-3.0-or-later
# All that is on the surface, for another topology of the same character under the same rig.
import bpy

TAKEN = "groups keys marks normals uv materials colours attributes textures".split()
settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name.removeprefix("use_") in TAKEN)
settings.own_rig = "KEEP"
