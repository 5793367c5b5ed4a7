# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes Mia, a coarse Mia without rig, keys and look, and Bruno without rig and keys as a Blender file:
`cast_file.py FILE.blend`. The panels of the pages by task are drawn with it."""

import os
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "gallery")]

from cast import people, scene  # noqa: E402

bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
scene.add_walk(scene.staged(people.mia(), -0.6))
scene.staged(people.bruno(), 0.6, rig=False, keys=False)
scene.staged(people.mia(0.5), 0.0, rig=False, keys=False, texture=False, label="Mia LOD")
bpy.ops.wm.save_as_mainfile(filepath=str(Path(sys.argv[1]).resolve()))
# bpy's own clean-up at the interpreter's exit may hang; everything is written by now.
sys.stdout.flush()
os._exit(0)
