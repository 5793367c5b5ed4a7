# SPDX-License-Identifier: GPL-3.0-or-later
# Materials, painted colours, and textures, baked where the target is unwrapped, else by the source's UV maps.
import bpy

settings = bpy.context.scene.spectral_match
settings.take("uv", "colours", "materials", "textures")
