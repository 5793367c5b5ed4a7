# SPDX-License-Identifier: GPL-3.0-or-later
# UV maps, painted colours and materials: the target can wear the source's textures.
import bpy

settings = bpy.context.scene.spectral_match
for name in settings.bl_rna.properties.keys():
    if name.startswith("use_"):
        setattr(settings, name, name in {"use_uv", "use_colours", "use_materials"})
