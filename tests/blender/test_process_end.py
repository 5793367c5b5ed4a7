# SPDX-License-Identifier: GPL-3.0-or-later
"""How a process ends in which Blender is a Python module and nobody unregistered the extension."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import bpy, addon
addon.register()
bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
if {again}:
    addon.unregister()
    addon.register()
print("the work is done", flush=True)
"""


@pytest.mark.parametrize("again", [False, True])
def test_the_process_ends_well(again):
    """Else Blender frees what is registered after Python has ended: it crashes, or waits for ever."""
    root = Path(__file__).parents[2]
    paths = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(again=again)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": paths},
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "the work is done" in done.stdout
