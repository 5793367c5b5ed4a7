# SPDX-License-Identifier: GPL-3.0-or-later
"""The page on adding a kind, followed to the letter in a copy: its module carries, and its test passes."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_a_stranger_adds_a_kind(tmp_path):
    page = (ROOT / "docs" / "adding-a-kind.md").read_text(encoding="utf-8")
    module, test = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    for folder in ("addon", "tests/blender"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "addon" / "transfer" / "sculpt_mask.py").write_text(module)
    mine = tmp_path / "tests" / "blender" / "test_sculpt_mask.py"
    mine.write_text(test)
    listed = tmp_path / "addon" / "transfer" / "__init__.py"
    text = listed.read_text(encoding="utf-8")
    text = text.replace("from . import (\n", "from . import (\n    sculpt_mask,\n")
    listed.write_text(text.replace("KINDS = (\n", "KINDS = (\n    sculpt_mask.KIND,\n"), encoding="utf-8")
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(mine)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert told.returncode == 0 and "1 passed" in told.stdout, told.stdout + told.stderr
