# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says of a match: plain words, and good only where there is no doubt."""

import re
from pathlib import Path

import pytest
from test_translation import core_messages

from addon import wording
from addon.message_table import MESSAGES
from addon.translation_table import TABLE

CORE = Path(__file__).parents[2] / "rust" / "core" / "src"
# The measures by which the core judges are no words for the panel.
UNPLAIN = re.compile("eigen|√|correlation|orientation|curvature|vertex", re.IGNORECASE)


def core_reasons():
    """What the core's judges can say: each string that is pushed to reasons."""
    found = []
    for path in ("matching/ranking/quality.rs", "figure/judgement.rs"):
        text = (CORE / path).read_text(encoding="utf-8").split("mod tests")[0]
        for pushed in re.findall(r"reasons\s*\.push\((.*?)\);", text, re.DOTALL):
            found += re.findall(r'"((?:[^"\\]|\\\n)*)"', pushed)
    assert len(found) > 12
    return [re.sub(r"\\\n\s*", "", reason) for reason in found]


@pytest.mark.parametrize("reason", core_reasons())
def test_reasons_are_plain(reason):
    for words in wording.plain([reason.replace("{:.2}", "0.12").replace("{o:.2}", "0.34")]):
        assert not UNPLAIN.search(words.replace("vertices", "")), words


@pytest.mark.parametrize("reason", core_reasons())
def test_maps_are_called_so_in_details_too(reason):
    """What stands there instead of the core's word is in the table as well."""
    (words,) = wording.details([reason])
    assert "alternative" not in words
    if words != reason:
        pattern = re.sub(r"\{[^}]*\}", "{}", words)
        assert pattern in [row[0] for row in MESSAGES]


def test_one_word_for_a_map_and_one_for_the_bar():
    unwanted = re.compile("alternative|simplif|closing the figure|consistent|{} sure", re.IGNORECASE)
    assert not [row[0] for row in TABLE if unwanted.search(row[0])]


@pytest.mark.parametrize(
    ("grade", "reasons", "confidence", "words"),
    [
        ("green", ["distances, curvatures and orientation agree"], 0.9, "Good match"),
        ("green", ["the target's 7 pieces were matched as one figure"], 0.9, "Good match"),
        ("green", ["distances change by 3.7 % of √area: the bodies differ"], 0.9, "Mostly good match"),
        ("green", ["distances, curvatures and orientation agree"], 0.38, "Mostly good match"),
        ("amber", [], 0.9, "Check this match"),
        ("red", [], 0.9, "Poor match"),
    ],
)
def test_good_never_stands_beside_doubts(grade, reasons, confidence, words):
    assert wording.verdict(grade, reasons, confidence) == words


@pytest.mark.parametrize("sign", wording.TOLD)
def test_what_tells_how_a_transfer_was_done_is_said_somewhere(sign):
    assert any(sign in row[0] for row in MESSAGES)


def test_what_needs_a_look_is_apart_from_what_tells_how_it_was_done():
    look = ["'Head' has no UV map of its own to bake textures into. Unwrap it first"]
    told = ["UV map 'A' of 'Head' stays; that of 'Knight' came beside it as 'B'"]
    assert wording.notes_in_order([*told, *look]) == (look, told)


@pytest.mark.parametrize("words", sorted(set(core_messages()) - set(core_messages("matching", "figure"))))
def test_failures_are_plain(words):
    """With figures for its values; a name of a vertex tells an artist nothing."""
    plain = wording.failure(words.replace("{}", "12"))
    terms = "eigen|√|correlation|Laplac|factoris|residual|candidate|vote|distortion|equation"
    assert not re.search(rf"{terms}|(vertex|face) 12", plain, re.IGNORECASE), plain
    if plain != words.replace("{}", "12"):
        shown = re.sub(r"\b12\b", "{}", plain)
        assert any(row[0].lower().endswith(shown.rpartition(": {}: ")[2].lower()) for row in MESSAGES)


def test_figures_of_the_core_s_own_measures_are_left_out():
    assert wording.plain(["something new (correlation 0.12)"]) == ["Something new"]
