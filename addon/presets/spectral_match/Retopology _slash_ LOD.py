# SPDX-License-Identifier: GPL-3.0-or-later
# All that is on the surface, for another topology of the same character under the same rig.
import bpy

settings = bpy.context.scene.spectral_match
settings.take("groups", "keys", "marks", "normals", "uv", "materials", "colours", "attributes", "textures")
settings.own_rig = "KEEP"
