# SPDX-License-Identifier: GPL-3.0-or-later
# Skin weights as engines take them: four a vertex, summing to what came across; nothing else is carried.
import bpy

settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name == "use_groups")
settings.limit_total = True
settings.limit = 4
settings.normalize = True
