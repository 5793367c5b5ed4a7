# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last step said. The status bar forgets it; the panel shows it until the next step."""

from bpy.app.handlers import persistent

# A failure or warnings, a line each.
words = ""
# What a transfer brought; `words` is then what needs a look. And which of the scene's transfers it was.
done = ""
transfer = 0


def say(text):
    global words
    words = text


def finish(context, summary, notes):
    """A transfer is done: what it brought and, in `notes`, what needs a look."""
    global done, transfer
    context.scene.spectral_match.transfers += 1
    done, transfer = summary, context.scene.spectral_match.transfers
    say("\n".join(notes))


def clear():
    global done
    done = ""
    say("")


@persistent
def _forget_file(_path, _unused=None):
    clear()


HANDLERS = (("load_pre", _forget_file),)
