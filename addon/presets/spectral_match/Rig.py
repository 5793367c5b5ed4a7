# SPDX-License-Identifier: GPL-3.0-or-later
# Weights and the fitted rig with its animation; the look stays.
import bpy

TAKEN = "groups armature".split()
settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name.removeprefix("use_") in TAKEN)
