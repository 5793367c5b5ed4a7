# SPDX-License-Identifier: GPL-3.0-or-later
# Shape keys of a face, with their drivers, and eyes and teeth that are objects of their own.
import bpy

settings = bpy.context.scene.spectral_match
settings.take("keys", "objects")
