# SPDX-License-Identifier: GPL-3.0-or-later
# Shape keys of a face, with their drivers, and eyes and teeth that are objects of their own.
import bpy

TAKEN = "keys objects".split()
settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name.removeprefix("use_") in TAKEN)
