"""The pages of the repository say what is so: links lead somewhere, examples run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import sgmds
from sgmds import characters

ROOT = Path(__file__).resolve().parents[2]
# Those below docs/ are checked with the site, by `just docs`.
PAGES = sorted(ROOT.glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_of_the_repository_lead_to_files(page):
    links = re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert not [link for link in local if not (ROOT / link).exists()]


def test_links_of_the_site_are_those_that_its_build_checks():
    pages = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/**/*.ipynb")]
    raw = re.compile(r"<(?:a|area|audio|iframe|img|link|object|script|source|video)[\s>]", re.IGNORECASE)
    assert not [page.name for page in pages if raw.search(page.read_text(encoding="utf-8"))]


def examples(page):
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def small(monkeypatch):
    """Characters of a size that matches quickly, whatever size an example asks for."""
    make = characters.make
    monkeypatch.setattr(
        characters, "make", lambda *args, **options: make(*args, **{**options, "resolution": 1500})
    )
    return characters.make


@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_examples_run(page, small, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, second = small(), small(build="slender", pose="wave", seed=1)
    write_obj(tmp_path / "source.obj", first)
    write_obj(tmp_path / "target.obj", second)
    names = {"weights_1": first.weights, "labels": first.part}
    blocks = examples(page)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    assert isinstance(names["corr"], sgmds.Correspondence)
    carried = names.get("weights_2", names.get("weights"))
    assert carried.shape[0] == len(names["corr"].vertices)


def write_obj(path, body):
    lines = ["v {} {} {}".format(*vertex) for vertex in body.vertices]
    lines += ["f {} {} {}".format(*face) for face in body.faces + 1]
    path.write_text("\n".join(lines), encoding="utf-8")


def table_rows(page, heading):
    """Cells of a page's table whose first line of cells begins with `heading`."""
    rows = []
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if cells[: len(heading)] == heading:
            rows = [cells]
        elif cells and rows:
            rows.append(cells)
        elif rows:
            break
    return rows


def test_readme_states_the_recorded_figures():
    stated = table_rows("README.md", ["set", "pairs", "ours"])[2:]
    recorded = {row[0]: row for row in table_rows("docs/accuracy.md", ["set", "pairs", "mean"])[2:]}
    assert stated
    for name, pairs, ours, *_ in stated:
        digits = len(ours.partition(".")[2])
        assert (pairs, float(ours)) == (recorded[name][1], round(float(recorded[name][2]), digits)), name


def test_tables_are_those_of_the_results():
    """The script tells which page differs; it writes them without `--check`."""
    run = subprocess.run(
        [sys.executable, str(ROOT / ".ci" / "tables.py"), "--check"], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr


CORE = ROOT / "rust" / "core" / "src"


def test_the_reference_names_files_and_settings_that_there_are():
    page = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    sources = "\n".join(path.read_text(encoding="utf-8") for path in CORE.rglob("*.rs"))
    files = set(re.findall(r"`([a-z_/]+\.rs)`", page))
    settings = set(re.findall(r"`([A-Z][A-Z0-9_]{2,})`", page))
    assert files and settings
    missing = {name for name in files if not (CORE / name).is_file()}
    missing |= {name for name in settings if not re.search(rf"\b{name}\b", sources)}
    for owner, field in re.findall(r"`([A-Z][A-Za-z]+)::(\w+)`", page):
        if not re.search(rf"\bstruct {owner}\b", sources) or not re.search(
            rf"\bpub {field}\b|fn {field}\b", sources
        ):
            missing.add(f"{owner}::{field}")
    assert not missing, f"docs/method.md names what the core does not have: {sorted(missing)}"


def test_every_room_has_a_section_of_the_reference():
    page = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    rooms = [path.name for path in CORE.iterdir() if path.is_dir() and path.name != "watch"]
    assert rooms
    assert not [room for room in rooms if f"`{room}/" not in page]


def test_pages_state_what_is():
    """History stands in decisions and in the changelog."""
    diary = re.compile(
        r"\bformerly\b|\bno longer\b|\bpreviously\b|\bwas measured before\b|\bbefore, \d|\bsince then\b"
    )
    pages = [page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "decisions"]
    found = [
        f"{page.name}: {line}"
        for page in pages
        for line in page.read_text(encoding="utf-8").splitlines()
        if diary.search(line)
    ]
    assert not found


def test_what_artists_expect_is_shown_by_tests_that_there_are():
    page = (ROOT / "docs" / "expectations.md").read_text(encoding="utf-8")
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", page)
    assert len(named) > 30
    for file, test in named:
        code = (ROOT / "tests" / "blender" / file).read_text(encoding="utf-8")
        assert f"def {test}(" in code, f"{file}::{test}"
    rows = table_rows("docs/expectations.md", ["expected"])
    assert rows and not [row for row in rows if row[1].startswith("no")]


def test_the_citation_is_of_this_version():
    # Two lines count, which need no reader of YAML.
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = re.search(r"^version: (\S+)$", citation, re.MULTILINE)
    cargo = re.search(r'^version = "([^"]+)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
    assert version[1] == cargo[1]
    assert citation.startswith("cff-version: 1.2.0\n")
