# SPDX-License-Identifier: GPL-3.0-or-later
# Skin weights as engines take them, four a vertex, summing to what came across; the rig and the look.
import bpy

settings = bpy.context.scene.spectral_match
settings.take("groups", "uv", "materials", "textures", "armature")
settings.limit_total = True
settings.limit = 4
settings.normalize = True
