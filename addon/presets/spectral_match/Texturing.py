# SPDX-License-Identifier: GPL-3.0-or-later
# Materials, painted colours, and textures, baked where the target is unwrapped, else by the source's UV maps.
import bpy

TAKEN = "uv colours materials textures".split()
settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name.removeprefix("use_") in TAKEN)
