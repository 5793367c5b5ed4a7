# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages: nothing is left out, nothing is left over, and it fits."""

import ast
import re
import unicodedata
from pathlib import Path
from string import Formatter
from types import SimpleNamespace

import bpy
import pytest

from addon import job, panels, remedy, translation, wording
from addon.drawing import wrapped
from addon.message_table import MESSAGES
from addon.operators import settings
from addon.tooltip_table import TOOLTIPS
from addon.transfer import KINDS
from addon.translation import CONTEXTS, LANGUAGES, ROWS, said, spoken
from addon.translation_table import TABLE

ADDON = Path(__file__).parents[2] / "addon"
# Columns of the default sidebar beside an icon: Japanese and Chinese signs take two.
WIDEST = 34
# Classes whose properties no panel shows, and how tooltips of what scripts alone give begin.
UNSEEN = {"stored_match", "piece", "landmark", "OT_add_landmark"}
OF_SCRIPTS = "For scripts"
# Modules whose words no panel shows: of the command line, of tables, and patterns that are looked for.
NOT_SHOWN = {"batch.py", "command_line.py", "translation.py", "wording.py", "remedy.py", "morph.py"}
CORE = ADDON.parent / "rust" / "core" / "src"


def constant(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def texts_of(call):
    """Texts of the interface in one call."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    for word in call.keywords:
        if word.arg == "text" or (word.arg == "name" and name.endswith("Property")):
            yield constant(word.value)
        if word.arg == "items" and isinstance(word.value, ast.Tuple | ast.List):
            yield from (constant(item.elts[1]) for item in word.value.elts if isinstance(item, ast.Tuple))
    places = {"Kind": (1,), "said": (0,), "draw_words": (2,), "fold": (3,)}.get(name, ())
    yield from (constant(call.args[place]) for place in places if place < len(call.args))


def texts():
    """All texts of panels, buttons, settings and of what is said while a match runs."""
    found = set(wording.GRADES.values()) | {wording.NEARLY_GOOD, panels.SWAPPED, panels.SWAP_BACK}
    found |= (
        {words for _, words in wording.PLAIN if words}
        | set(panels.ADVICE.values())
        | {panels.LEGEND, panels.WHITE}
    )
    found |= set(job.STAGE_WORDS.values()) | set(settings.shipped().values())
    found |= {each.label for each in vars(remedy).values() if isinstance(each, remedy.Remedy)}
    for kind in KINDS:
        found |= set(kind.words) if len(kind.words) == 1 else {f"{{}} {word}" for word in kind.words}
    for path in ADDON.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                found.update(texts_of(node))
            elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "bl_label":
                found.add(constant(node.value))
    return {words for words in found if any(sign.isalpha() for sign in words)}


# Columns of its left half, in which the labels of settings are.
LEFT_HALF = 14
# Settings that panels show there, beside those of each kind of data.
IN_PANELS = ("shape", "part", "outfit_distance", "outfit_tightness")


def labels():
    """Names of settings in English, and whether they are check boxes."""
    known = bpy.context.scene.spectral_match.bl_rna.properties
    names = {name for kind in KINDS for name in kind.shown} | {*IN_PANELS, "allow_mirror", "same_axes"}
    return {(known[name].name, known[name].type == "BOOLEAN") for name in names}


def test_labels_fit_the_default_sidebar(registered):
    rows = {row[0]: row for row in ROWS}
    found = labels()
    assert len(found) > 25
    for name, is_check in found:
        for words in rows.get(name, (name,)):
            assert width(words) <= (WIDEST if is_check else LEFT_HALF), words


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
        if word.arg == "items" and isinstance(word.value, ast.Tuple | ast.List):
            yield from (constant(item.elts[2]) for item in word.value.elts if isinstance(item, ast.Tuple))
    if name == "Kind" and len(call.args) > 3:
        yield constant(call.args[3])


def template(node):
    """A text with `{}` for each value in it."""
    if isinstance(node, ast.Constant):
        return constant(node)
    return "".join(template(part) if isinstance(part, ast.Constant) else "{}" for part in node.values)


def messages():
    """Sentences in the code that are no docstrings, descriptions, types or lists of names: what is said."""
    for path in ADDON.rglob("*.py"):
        if path.name in NOT_SHOWN or path.name.endswith("_table.py") or "presets" in path.parts:
            continue
        tree, passed = ast.parse(path.read_text(encoding="utf-8")), set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr):
                passed.add(node.value)
            elif isinstance(node, ast.JoinedStr):
                passed.update(node.values)
            elif isinstance(node, ast.Attribute) and node.attr == "split":
                passed.add(node.value)
            elif isinstance(node, ast.Call):
                told = [word.value for word in node.keywords if word.arg == "description"]
                passed.update(part for each in told for part in ast.walk(each))
            elif isinstance(node, ast.arg):
                passed.add(node.annotation)
            elif isinstance(node, ast.FunctionDef):
                passed.add(node.returns)
            elif isinstance(node, ast.AnnAssign) and getattr(node.annotation, "id", "") == "TypeAlias":
                passed.add(node.value)
            elif isinstance(node, ast.Dict):
                keys = [constant(key) for key in node.keys if key is not None]
                if "__doc__" in keys:
                    passed.update(node.values)
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant | ast.JoinedStr) and node not in passed:
                yield from template(node).splitlines()


def core_messages(*rooms):
    """What the core, or these rooms of it, says of a match and of why there is none, `{}` for its values."""
    found = []
    for path in ("matching/ranking/quality.rs", "figure/judgement.rs", "error.rs"):
        if rooms and not path.startswith(rooms):
            continue
        text = (CORE / path).read_text(encoding="utf-8").split("mod tests")[0]
        found += re.findall(r'"((?:[^"\\]|\\.|\\\n)*)"', text, re.DOTALL)
    for path in CORE.rglob("*.rs") if not rooms else ():
        text = path.read_text(encoding="utf-8")
        found += re.findall(r'Error::NoMap \{\s*reason: "([^"]*)"', text)
        found += re.findall(r'remarks\.push\(format!\(\s*"([^"]*)"', text)
    for words in found:
        words = re.sub(r"\\\n\s*", "", words)
        for role in ("source", "target") if "{role}" in words else ("",):
            yield re.sub(r"\{[^}]*\}", "{}", words.replace("{role}", role))


def sentences(words):
    return {each.strip() for each in words if len(re.findall(r"[A-Za-z]{2,}", each)) > 2 and " " in each}


# What is composed with translated parts alone, is shown by no one, or is the name of a mark.
COMPOSED = {
    "{}   |   Enter, Esc: {}   |   Backspace: {}",
    "Spectral Match: {}   |   Esc: {}",
    "settings = bpy.context.scene.spectral_match",
    "Edge Bevel Weights",
    "Vertex Bevel Weights",
}


def test_every_message_has_a_translation():
    found = sentences(messages())
    assert len(found) > 150
    of_figures = {re.sub(r"\d+", "{}", row[0]) for row in ROWS} | {row[0] for row in ROWS}
    assert {re.sub(r"\b\d+\b", "{}", each) for each in found - COMPOSED} - of_figures == set()


def test_every_message_of_the_core_has_a_translation():
    found = sentences(core_messages())
    # The panel begins them with a capital, and the table has some of them so.
    rows = {row[0].lower() for row in ROWS}
    assert len(found) > 25 and {each for each in found if each.lower() not in rows} == set()


def test_every_reason_in_plain_words_has_a_translation():
    """As the panel shows it, with the core's figures left out."""
    rows = {row[0] for row in ROWS}
    said = [re.sub(r"\{\}", "7", each) for each in core_messages("matching/ranking", "figure/judgement")]
    assert len(said) > 20
    for reason in said:
        if " " in reason:
            assert set(wording.plain([reason])) <= rows, reason


def test_every_text_has_a_translation():
    assert len(texts()) > 150 and texts() - {row[0] for row in (*TABLE, *MESSAGES)} == set()


def test_every_tooltip_has_a_translation():
    assert len(tooltips()) > 80 and tooltips() - {row[0] for row in TOOLTIPS} == set()


def places(words):
    """The numbers of the values in a text, in their order, and whether each is in quotes."""
    count, found = 0, []
    for before, name, _, _ in Formatter().parse(words):
        if name is not None:
            found.append((int(name) if name else count, before.endswith("'")))
            count += 1
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:30])
def test_rows_are_whole(row):
    """Each once, in all languages, with the same values in it, and labels no wider than the sidebar."""
    assert len(row) == 1 + len(LANGUAGES) and sum(row[0] == other[0] for other in ROWS) == 1
    for words in row[1:]:
        # Values that are quoted in messages bring their quotes.
        quotes = row in MESSAGES
        assert words and {(n, q and quotes) for n, q in places(words)} == {
            (n, q and quotes) for n, q in places(row[0])
        }
        if row not in MESSAGES and width(row[0]) <= WIDEST and " " in row[0] and "Shift" not in row[0]:
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


@pytest.fixture(params=range(len(LANGUAGES)), ids=LANGUAGES)
def language(request):
    return request.param


def test_messages_are_spoken(language):
    """Names stay, also those that are words; reasons inside of a message are spoken too."""
    rows = {row[0]: row[1 + language] for row in ROWS}
    locale = LANGUAGES[language]
    assert spoken("'Match' has no faces. Matching needs a surface", locale) == rows[
        "'{}' has no faces. Matching needs a surface"
    ].replace("{}", "Match")
    inner = "'{}' was edited while it was read. Match again"
    assert spoken(f"'A B' was not matched: {inner.format('C')}", locale) == rows[
        "'{}' was not matched: {}"
    ].format("A B", rows[inner].format("C"))
    # The core begins in lower case.
    reason = "the surface turns in places (orientation {})"
    assert spoken(reason.format(0.38).capitalize(), locale) == rows[reason].format(0.38)
    two = spoken("1 landmark added\nnobody says this", locale)
    assert two.splitlines() == [rows["1 landmark added"], "nobody says this"]


def test_others_in_a_message_are_spoken(language):
    rows = {row[0]: row[1 + language] for row in ROWS}
    more = rows["and {} more meshes"].format(3)
    row = "UV map '{}' of '{}' stays; that of '{}' came beside it as '{}'"
    words = spoken(
        "UV map 'UVMap' of 'Leg' and 3 more meshes stays; that of 'S' came beside it as 'T'",
        LANGUAGES[language],
    )
    wanted = re.sub(r"'(\{\d*\})'", r"\1", rows[row])
    assert words == wanted.format("'UVMap'", f"'Leg'{more}", "'S'", "'T'")


def test_english_is_left_alone(registered):
    words = "'Ann's Hat' has no faces. Matching needs a surface"
    assert spoken(words) == words


@pytest.mark.parametrize(
    "text", ["one two  three", "", "映射几乎同样合适，请比较（共 2 个）。", "マップ 1 を比べる"]
)
def test_lines_hold_all_of_a_text(text):
    lines = wrapped(text, lambda line: width(line) <= 8)
    assert all(width(line) <= 8 for line in lines)
    assert "".join("".join(lines).split()) == "".join(text.split())


@pytest.mark.parametrize("translates", [True, False])
def test_messages_are_in_the_language_of_the_interface(monkeypatch, translates):
    """With tooltips alone translated, panels are in English."""
    view = SimpleNamespace(use_translate_interface=translates)
    fake = SimpleNamespace(
        context=SimpleNamespace(preferences=SimpleNamespace(view=view)),
        app=SimpleNamespace(translations=SimpleNamespace(locale="ja_JP", pgettext_iface=lambda text: text)),
    )
    monkeypatch.setattr(translation, "bpy", fake)
    words = "'Body' has no match yet. Press Match first"
    assert (spoken(words) == words) != translates
    assert spoken(words, "ja_JP") != words
