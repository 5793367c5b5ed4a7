# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender --background FILE.blend --command spectral_match match|transfer|batch …`"""

import argparse
import sys

import bpy

from .transfer import KINDS

DONE, FAILED, WRONG_USAGE = 0, 1, 2
_command = None


def run(arguments):
    """Do one step on the opened file and save it; returns the exit status."""
    kinds = ",".join(kind.identifier for kind in KINDS)
    parser = argparse.ArgumentParser(
        prog="blender --background FILE.blend --command spectral_match",
        description="Match meshes of a file and carry data across.",
    )
    parser.add_argument("step", choices=("match", "transfer", "batch"), help="batch is match, then transfer")
    parser.add_argument("--source", required=True, metavar="NAME", help="object that has the data")
    parser.add_argument("--target", required=True, metavar="NAME[,NAME…]", help="objects that receive it")
    parser.add_argument(
        "--transfer", default=kinds, metavar="KINDS", help=f"what to carry, by default {kinds}"
    )
    parser.add_argument("--output", metavar="OUT.blend", help="where to save; by default the opened file")
    try:
        wishes = parser.parse_args(arguments)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else WRONG_USAGE
    names = [wishes.source, *wishes.target.split(",")]
    missing = [name for name in names if name not in bpy.context.view_layer.objects]
    if missing:
        return _fail(f"There is no object named {', '.join(missing)} in the view layer of this file")
    output = wishes.output or bpy.data.filepath
    if not output:
        return _fail("Nothing to save to: open a file or give --output")
    _select(names)
    try:
        if wishes.step in ("match", "batch"):
            finished = bpy.ops.spectral_match.match() == {"FINISHED"}
        if wishes.step in ("transfer", "batch"):
            finished = bpy.ops.spectral_match.transfer(kinds=wishes.transfer) == {"FINISHED"}
        if finished:
            bpy.ops.wm.save_as_mainfile(filepath=output)
    except RuntimeError as reason:
        # Operators called from Python raise what they report.
        return _fail(str(reason).strip())
    return DONE if finished else FAILED


def _select(names):
    settings = bpy.context.scene.spectral_match
    settings.pinned = False
    view_layer = bpy.context.view_layer
    for obj in view_layer.objects:
        obj.select_set(False)
    for name in names:
        view_layer.objects[name].select_set(True)
    view_layer.objects.active = view_layer.objects[names[0]]
    view_layer.update()


def _fail(words):
    sys.stderr.write(f"spectral_match: {words}\n")
    return FAILED


def register():
    global _command
    _command = bpy.utils.register_cli_command("spectral_match", run)


def unregister():
    bpy.utils.unregister_cli_command(_command)
