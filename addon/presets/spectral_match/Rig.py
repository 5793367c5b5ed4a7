# SPDX-License-Identifier: GPL-3.0-or-later
# Weights and the fitted rig with its animation; the look stays.
import bpy

settings = bpy.context.scene.spectral_match
settings.take("groups", "armature")
