# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages: nothing is left out, nothing is left over, and it fits."""

import ast
import unicodedata
from pathlib import Path

import bpy
import pytest

from addon import job, panels, wording
from addon.drawing import wrapped
from addon.tooltip_table import TOOLTIPS
from addon.transfer import KINDS
from addon.translation import CONTEXTS, LANGUAGES, said
from addon.translation_table import TABLE

ADDON = Path(__file__).parents[2] / "addon"
# Columns of the default sidebar beside an icon: Japanese and Chinese signs take two.
WIDEST = 34
# Classes whose properties no panel shows, and how tooltips of what scripts alone give begin.
UNSEEN = {"stored_match", "piece", "landmark", "OT_add_landmark"}
OF_SCRIPTS = "For scripts"


def constant(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def texts_of(call):
    """Texts of the interface in one call."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    for word in call.keywords:
        if word.arg == "text" or (word.arg == "name" and name.endswith("Property")):
            yield constant(word.value)
        if word.arg == "items" and isinstance(word.value, ast.Tuple):
            yield from (constant(item.elts[1]) for item in word.value.elts if isinstance(item, ast.Tuple))
    places = {"Kind": (1,), "said": (0,), "draw_words": (2,), "fold": (3,)}.get(name, ())
    yield from (constant(call.args[place]) for place in places if place < len(call.args))


def texts():
    """All texts of panels, buttons, settings and of what is said while a match runs."""
    found = set(wording.GRADES.values()) | {wording.NEARLY_GOOD, panels.SWAPPED, panels.SWAP_BACK}
    found |= {words for _, words in wording.PLAIN if words} | set(panels.ADVICE.values()) | {panels.LEGEND}
    found |= {words for words in job.STAGE_WORDS.values() if words[0].isupper()}
    for kind in KINDS:
        found |= set(kind.words) if len(kind.words) == 1 else {f"{{}} {word}" for word in kind.words}
    for path in ADDON.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                found.update(texts_of(node))
            elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "bl_label":
                found.add(constant(node.value))
    return {words for words in found if any(sign.isalpha() for sign in words)}


def width(words):
    return sum(2 if unicodedata.east_asian_width(sign) in "WF" else 1 for sign in words)


def tooltips():
    """All tooltips: of operators, properties, choices and kinds of data."""
    found = set()
    for path in ADDON.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and "_OT_" in node.name:
                named = [
                    constant(line.value)
                    for line in node.body
                    if isinstance(line, ast.Assign) and line.targets[0].id == "bl_description"
                ]
                found.add(next(iter(named), None) or ast.get_docstring(node))
            if isinstance(node, ast.ClassDef) and not any(node.name.endswith(name) for name in UNSEEN):
                found.update(words for call in calls(node) for words in tips_of(call))
            elif isinstance(node, ast.Module):
                at_top = [line for line in node.body if not isinstance(line, ast.ClassDef)]
                found.update(words for line in at_top for call in calls(line) for words in tips_of(call))
    return {words for words in found if words and not words.startswith(OF_SCRIPTS)}


def calls(node):
    return [inner for inner in ast.walk(node) if isinstance(inner, ast.Call)]


def tips_of(call):
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    for word in call.keywords:
        if word.arg == "description" and name.endswith("Property"):
            yield constant(word.value)
        if word.arg == "items" and isinstance(word.value, ast.Tuple):
            yield from (constant(item.elts[2]) for item in word.value.elts if isinstance(item, ast.Tuple))
    if name == "Kind" and len(call.args) > 3:
        yield constant(call.args[3])


def test_every_text_has_a_translation():
    assert len(texts()) > 150 and texts() - {row[0] for row in TABLE} == set()


def test_every_tooltip_has_a_translation():
    assert len(tooltips()) > 80 and tooltips() - {row[0] for row in TOOLTIPS} == set()


@pytest.mark.parametrize("row", [*TABLE, *TOOLTIPS], ids=lambda row: row[0][:30])
def test_rows_are_whole(row):
    """Each once, in all languages, with the same values in it, and labels no wider than the sidebar."""
    assert len(row) == 1 + len(LANGUAGES) and sum(row[0] == other[0] for other in (*TABLE, *TOOLTIPS)) == 1
    for words in row[1:]:
        assert words and words.count("{}") == row[0].count("{}")
        if width(row[0]) <= WIDEST and " " in row[0] and "Shift" not in row[0]:
            assert width(words) <= max(WIDEST, 1.5 * width(row[0])), words


@pytest.mark.parametrize("place", range(len(LANGUAGES)))
def test_blender_looks_them_up(registered, place):
    view, row = bpy.context.preferences.view, {row[0]: row for row in TABLE}["Match Characters"]
    before = view.language
    try:
        view.language = LANGUAGES[place]
    except TypeError:
        pytest.skip("this Blender has no languages")
    try:
        for context in CONTEXTS:
            assert bpy.app.translations.pgettext_iface(row[0], context) == row[place + 1]
        assert said("Map {} of {}", 1, 4) == {row[0]: row for row in TABLE}["Map {} of {}"][place + 1].format(
            1, 4
        )
    finally:
        view.language = before


@pytest.mark.parametrize("text", ["one two  three", "", "映射几乎同样合适,请比较。", "マップ 1 を比べる"])
def test_lines_hold_all_of_a_text(text):
    lines = wrapped(text, lambda line: width(line) <= 8)
    assert all(width(line) <= 8 for line in lines)
    assert "".join("".join(lines).split()) == "".join(text.split())
