# SPDX-License-Identifier: GPL-3.0-or-later
# Skin weights as engines take them, four a vertex, summing to what came across; the rig and the look.
import bpy

TAKEN = "groups uv materials textures armature".split()
settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name.removeprefix("use_") in TAKEN)
settings.limit_total = True
settings.limit = 4
settings.normalize = True
