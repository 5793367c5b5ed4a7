"""Pages in Japanese and Chinese: the steps, pictures, scripts and buttons are those of the English ones."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
ENGLISH = [DOCS / "quickstart.md", *sorted((DOCS / "tasks").glob("*.md"))]
COLUMN = {"ja": 1, "zh": 2}
"""Where a language stands in a row of the extension's table."""

BLOCK = re.compile(r"^ *```\w*\n(.*?)^ *```", re.DOTALL | re.MULTILINE)


def blocks(text):
    return BLOCK.findall(text)


def labels(text):
    """What is set in bold or italics, as the names of buttons and panels are."""
    prose = re.sub(r"`[^`]*`", "", BLOCK.sub("", text))
    return {label.strip("*") for label in re.findall(r"\*\*[^*\n]+\*\*|\*[^*\n]+\*", prose)}


def pictures(text):
    return sorted(Path(link).name for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text))


def steps(text):
    return len(re.findall(r"^\d\. ", text, re.MULTILINE))


@pytest.fixture(scope="module")
def table():
    place = ROOT / "addon" / "translation_table.py"
    spec = importlib.util.spec_from_file_location("translation_table", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.TABLE


@pytest.mark.parametrize("language", COLUMN)
@pytest.mark.parametrize("page", ENGLISH, ids=lambda page: page.stem)
def test_a_translated_page_has_what_the_english_one_has(language, page, table):
    english = page.read_text(encoding="utf-8")
    translated = (DOCS / language / page.name).read_text(encoding="utf-8")
    assert blocks(translated) == blocks(english)
    assert pictures(translated) == pictures(english)
    assert steps(translated) == steps(english)
    words = {}
    for row in table:
        words.setdefault(row[0], row[COLUMN[language]])
    named = {words[label] for label in labels(english) if label in words}
    assert named <= labels(translated)
