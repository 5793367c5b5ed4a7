# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last step said. The status bar forgets it; the panel shows it until the next step, and what a
transfer brought until the next match or transfer.
"""

from collections.abc import Callable, Iterable

import bpy
from bpy.app.handlers import persistent

from .typed import EnumItem

# Steps of which messages are beside their button, since it is far below the result, where all others are.
BESIDE = ("spectral_match.fit_outfit",)
# A failure, warnings or that something was stopped, a line each, and what stands before them.
words = ""
icon: EnumItem = "ERROR"
# The same of those steps, by their names.
beside: dict[str, tuple[str, EnumItem]] = {}
# Says what a transfer brought, in the language that the interface has when it is asked; `words` is then what
# needs a look. And which of the scene's transfers it was, by which map of each match, by its identifier.
done: Callable[[], str] | None = None
transfer = 0
maps: dict[str, int] = {}


def say(text: str, sign: EnumItem = "ERROR", step: str = "") -> None:
    """Say it below the result, where nothing said earlier stays, or beside the button of a step."""
    global words, icon, done
    if step not in BESIDE:
        words, icon, done = text, sign, None
        beside.clear()
    elif text:
        beside[step] = text, sign
    else:
        beside.pop(step, None)


def finish(
    context: bpy.types.Context,
    targets: Iterable[bpy.types.Object],
    summary: Callable[[], str],
    notes: Iterable[str],
) -> None:
    """A transfer to these meshes is done: `summary` says what it brought, `notes` what needs a look."""
    global done, transfer, maps
    say("\n".join(notes))
    context.scene.spectral_match.transfers += 1
    done, transfer = summary, context.scene.spectral_match.transfers
    stored = [target.data.spectral_match for target in targets]
    maps = {match.identifier: match.alternative for match in stored}


def other_map(target: bpy.types.Object) -> str:
    """By which map the last transfer to this mesh came, if not by the one that it has now, else ""."""
    stored = target.data.spectral_match
    came = maps.get(stored.identifier, stored.alternative)
    if came == stored.alternative:
        return ""
    return f"This came with map {came + 1}. To use map {stored.alternative + 1}, press Transfer"


def clear(step: str = "") -> None:
    say("", step=step)


@persistent
def _forget_file(_path: str, _unused: object = None) -> None:
    clear()


HANDLERS = (("load_pre", _forget_file),)
