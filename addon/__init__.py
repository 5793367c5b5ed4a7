# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral Match: dense correspondences between two characters, and data carried across them."""

import bpy

from . import command_line, operators, panels, preferences, properties, stored_match
from . import job as job_module


def register():
    properties.register()
    preferences.register()
    for cls in (*operators.CLASSES, *panels.CLASSES):
        bpy.utils.register_class(cls)
    stored_match.register()
    command_line.register()


def unregister():
    if job_module.current is not None:
        job_module.current.cancel()
    command_line.unregister()
    stored_match.unregister()
    for cls in reversed((*operators.CLASSES, *panels.CLASSES)):
        bpy.utils.unregister_class(cls)
    preferences.unregister()
    properties.unregister()
