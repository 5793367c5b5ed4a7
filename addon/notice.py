# SPDX-License-Identifier: GPL-3.0-or-later
"""The last failure in words. The status bar forgets it; the panel shows it until the next step succeeds."""

from bpy.app.handlers import persistent

words = ""


def say(text):
    global words
    words = text


def clear():
    say("")


@persistent
def _forget_file(_path, _unused=None):
    clear()


HANDLERS = (("load_pre", _forget_file),)
