# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages, by Blender's own means; English is the key of each text."""

import re
from functools import lru_cache
from typing import Any

import bpy

from .message_table import MESSAGES
from .tooltip_table import TOOLTIPS
from .translation_table import TABLE

LANGUAGES = ("ja_JP", "zh_HANS")
ROWS = (*TABLE, *MESSAGES, *TOOLTIPS)
# What Blender's own table has under another meaning, as Fix, is looked up among ours first.
OWN_CONTEXT = "Spectral Match"
# Buttons look their texts up among operators, all else without a context.
CONTEXTS = ("*", "Operator", OWN_CONTEXT)


def said(text: str, *values: object) -> str:
    """The text in the language of the interface, with values in its {}."""
    translations: Any = bpy.app.translations
    found: str = translations.pgettext_iface(text)
    return found.format(*values)


# A name in quotes, of which messages say that it stands for others too.
# An apostrophe in a name stands before a letter.
NAMED, NAME = "'{}'", r"'(?:[^']|'(?=\w))+'"
MORE = r" and \d+ more mesh(?:es)?"
# What fewer letters than these are beside values is no message to be known by them.
FEWEST_LETTERS = 7


def spoken(text: str, locale: str | None = None) -> str:
    """Messages in English, a line each, with names and figures in them, in the language of the interface.

    They are composed where something happens, in the core as well, and kept in English; of each the row of
    the table is found that has its words.
    """
    if not (locale or bpy.context.preferences.view.use_translate_interface):
        return text
    language: str = locale or bpy.app.translations.locale
    return "\n".join(_spoken(line, language) for line in text.splitlines())


@lru_cache(maxsize=1000)
def _spoken(text: str, locale: str) -> str:
    ours = said(text) if "{" not in text else text
    if ours != text or locale not in LANGUAGES:
        return ours
    for pattern, row in _patterns():
        found = pattern.fullmatch(text)
        if found is None:
            continue
        template = row[1 + LANGUAGES.index(locale)]
        return re.sub(r"'(\{\d*\})'", r"\1", template).format(
            *(_value(part, locale) for part in found.groups())
        )
    return text


def _value(text: str, locale: str) -> str:
    """A value in a message: words of its own are spoken, names stay."""
    name = re.fullmatch(rf"({NAME})({MORE})?", text)
    if name is not None:
        return name[1] + (_spoken(name[2].lstrip(), locale) if name[2] else "")
    return _spoken(text, locale) if " " in text else text


@lru_cache(maxsize=1)
def _patterns() -> list[tuple[re.Pattern[str], tuple[str, ...]]]:
    """Rows of messages, each with the pattern of what has its words, the most telling first."""
    made = []
    for row in (*MESSAGES, *TABLE):
        parts = re.split(r"('?\{\}'?)", row[0])
        if sum(map(str.isalpha, "".join(parts[::2]))) < FEWEST_LETTERS:
            continue
        pattern = "".join(
            (rf"({NAME}(?:{MORE})?)" if part == NAMED else part.replace("{}", "(.+?)"))
            if number % 2
            else re.escape(part)
            for number, part in enumerate(parts)
        )
        # The panel begins the core's words with a capital.
        made.append((len("".join(parts[::2])), re.compile(pattern, re.IGNORECASE), row))
    return [(pattern, row) for _, pattern, row in sorted(made, key=lambda each: -each[0])]


def register() -> None:
    tables = {
        language: {(context, row[0]): row[place] for row in ROWS for context in CONTEXTS}
        for place, language in enumerate(LANGUAGES, start=1)
    }
    bpy.app.translations.register(__package__, tables)


def unregister() -> None:
    bpy.app.translations.unregister(__package__)
