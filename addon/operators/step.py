# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators of the workflow share: when they can be pressed, and how they fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import bpy

from .. import core, drawing, notice, pair
from .. import job as job_module
from ..mesh_read import UnusableObjectError
from ..translation import spoken
from ..typed import Outcome

Result = TypeVar("Result")

# Operators that go on in the window. Disabling the extension takes their classes away without a word to them.
going_on: set[Any] = set()

RUNNING = "A match is running. Wait for it, or press Esc to stop it"


def nothing(_context: bpy.types.Context, /) -> str:
    """For operators that can always be pressed."""
    return ""


def needs_pair(context: bpy.types.Context) -> str:
    return RUNNING if job_module.current is not None else pair.shown(context).missing


def needs_matched(context: bpy.types.Context) -> str:
    if job_module.current is not None:
        return RUNNING
    return "" if pair.matched(context) else "Nothing is matched yet. Press Match first"


def end_all(context: bpy.types.Context) -> None:
    """End the operators that go on in the window, and give status bar and pointer back wherever they are."""
    if not going_on:
        return
    for operator in list(going_on):
        operator.cancel(context)
    for window in context.window_manager.windows:
        window.cursor_modal_restore()
        window.workspace.status_text_set(None)


class Step:
    """Put before `Operator`. `obstacle(context)` says why the operator cannot be pressed now, or "".

    `act` does the work; what goes wrong in it is said in the status bar and kept for the panel.
    """

    obstacle = staticmethod(nothing)
    # Whether somebody pressed it, rather than a script.
    pressed = False
    # The step in whose place what is said is, where it has one.
    said_at = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        words = cls.obstacle(context)
        if words:
            cls.poll_message_set(spoken(words))
        return not words

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Outcome:
        self.pressed = True
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> Outcome:
        self.forget()
        return self.attempt(self.act, context)

    def forget(self) -> None:
        """The words of an earlier step go, or those beside the button that was pressed.

        What a transfer brought is said on until other work is done, while it is looked at and compared.
        """
        if notice.done is None or self.said_at in notice.BESIDE:
            notice.clear(self.said_at)

    def attempt(self, work: Callable[..., Result], *arguments: Any) -> Result | Outcome:
        """Do the work; its failure becomes words."""
        try:
            return work(*arguments)
        except (UnusableObjectError, core.CoreMissingError) as reason:
            return self.fail(str(reason))

    def tell(self, kinds: set[Any], words: str) -> None:
        """Report messages, a line each, in the language of the interface."""
        self.report(kinds, " ".join(spoken(words).splitlines()))

    def stopped(self, words: str) -> Outcome:
        """Say that the artist stopped it, where it was pressed too: the status bar forgets soon.

        What an earlier transfer brought, which is as it was, is rather said on.
        """
        self.tell({"INFO"}, words)
        if notice.done is None or self.said_at in notice.BESIDE:
            notice.say(words, "INFO", self.said_at)
        return {"CANCELLED"}

    def fail(self, words: str) -> Outcome:
        # An error opens a pop-up, which the panel beside it would repeat.
        once = self.pressed and drawing.is_open(bpy.context)
        self.tell({"WARNING"} if once else {"ERROR"}, words)
        notice.say(words, step=self.said_at)
        return {"CANCELLED"}

    def warn(self, messages: Sequence[str]) -> None:
        """Say what needs attention though the step succeeded."""
        for words in messages:
            self.tell({"WARNING"}, words)
        notice.say("\n".join(messages), step=self.said_at)
