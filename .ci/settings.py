"""Writes docs/settings.md, the table of all numbers that steer the method, from the core's settings.rs files.

    python .ci/settings.py [--check]

With --check the exit status is 1 when the page is another, or when a number has no reason.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "rust" / "core" / "src"
PAGE = ROOT / "docs" / "settings.md"
# In the order in which data flow.
STAGES = ("mesh", "envelope", "spectrum", "geodesics", "deformation", "shape", "baselines")
STAGES += tuple(f"matching/{name}" for name in ("problem", "search", "refinement", "ranking", "detail"))
STAGES += ("matching/result", "matching/partial", "matching", "transfer", "transfer/outfit", "figure")

GROUP = re.compile(r"((?:    ///[^\n]*\n)+)    (\w+): \w+ \{\n(.*?)\n    \}\n", re.DOTALL)
FIELD = re.compile(r"((?:        ///[^\n]*\n)*)        (\w+): [^=\n]+ = (.+),\n")

HEAD = """# Settings

Every number that steers the method, by stage, with the reason for its value or what was measured. This
page is written by `.ci/settings.py` from the `settings.rs` of each stage;
`tests/reliability/settings.py` multiplies each by 0.8 and by 1.2 and reports what changes. Block sizes,
bytes and rounding bounds, which change no map, stand where they are used; so do the
[schedules](method.md) of the refinement, lists of numbers of eigenfunctions.

Lengths are at unit area of the surface unless something else is said.
"""


def prose(comment: str) -> str:
    """Of lines of a doc comment, without links that only the reference of the code resolves."""
    text = " ".join(line.strip().removeprefix("///").strip() for line in comment.splitlines())
    text = re.sub(r"\[([^\]]+)\]\([\w:]+\)", r"\1", text)
    text = re.sub(r"\[(`[^`]+`)\](?!\()", r"\1", text)
    return text.replace("|", "\\|").replace("<", "&lt;")


def rows(text: str, path: str):
    """Name, value and reason of each setting of a file, beneath the title of its group."""
    for about, group, body in GROUP.findall(text):
        fields = FIELD.findall(body + "\n")
        yield (
            prose(about),
            [(f"{path}.{group.lower()}.{name}", value, prose(why)) for why, name, value in fields],
        )


def page() -> str:
    found = {file.parent.relative_to(SOURCE).as_posix() for file in SOURCE.glob("*/**/settings.rs")}
    if found != set(STAGES):
        raise SystemExit(
            f"settings of stages that are not in the list, or the other way: {found ^ set(STAGES)}"
        )
    parts = [HEAD]
    for stage in STAGES:
        text = (SOURCE / stage / "settings.rs").read_text(encoding="utf-8")
        path = stage.replace("/", ".")
        parts.append(f"## {path}\n")
        for about, settings in rows(text, path):
            if bare := [name for name, _, why in settings if not why]:
                raise SystemExit(f"without a reason: {', '.join(bare)}")
            lines = [f"| `{name}` | {value} | {why} |" for name, value, why in settings]
            parts.append("\n".join([about, "", "| setting | value | reason |", "|---|---|---|", *lines, ""]))
    return "\n".join(parts)


def main() -> int:
    made = page()
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(made, encoding="utf-8")
    elif not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != made:
        print(f"{PAGE.name}: other than the settings of the core, run python .ci/settings.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
