# SPDX-License-Identifier: GPL-3.0-or-later
# Materials, painted colours, and textures, baked where the target is unwrapped, else by the source's UV maps.
import bpy

settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name in {"use_uv", "use_colours", "use_materials", "use_textures"})
