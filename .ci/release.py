# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the files of a release agree with one another.

    python .ci/release.py [--tag vX.Y.Z]

The version of Cargo.toml is that of the extension's manifest and of CITATION.cff; every platform of the
manifest has a wheel in the release workflow and notices for its target; the manifest credits whoever holds
copyright on bundled code, as THIRD_PARTY_NOTICES.txt names it; the changelog has a section for the version or
something unreleased. With a tag, it is the version, and the changelog has a section for it and nothing
unreleased. Exit status 1, with a line for each fault.
"""

import argparse
import re
import sys
import tomllib
from pathlib import Path

from third_party_notices import TARGETS

ROOT = Path(__file__).resolve().parent.parent
# Blender's names of platforms and the targets whose wheels they take.
TARGET_OF = {
    "linux-x64": "x86_64-unknown-linux-gnu",
    "linux-arm64": "aarch64-unknown-linux-gnu",
    "windows-x64": "x86_64-pc-windows-msvc",
    "windows-arm64": "aarch64-pc-windows-msvc",
    "macos-x64": "x86_64-apple-darwin",
    "macos-arm64": "aarch64-apple-darwin",
}
NOTICES = "THIRD_PARTY_NOTICES.txt"


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def versions() -> dict[str, str]:
    """Version by the file that states it."""
    cited = re.search(r"(?m)^version: (.+)$", text("CITATION.cff"))
    return {
        "Cargo.toml": tomllib.loads(text("Cargo.toml"))["workspace"]["package"]["version"],
        "addon/blender_manifest.toml": tomllib.loads(text("addon/blender_manifest.toml"))["version"],
        "CITATION.cff": cited[1] if cited else "none",
    }


def faults(tag: str | None) -> list[str]:
    """What does not agree, a line each."""
    found = []
    stated = versions()
    version = stated["Cargo.toml"]
    if len(set(stated.values())) > 1:
        found.append("versions differ: " + ", ".join(f"{name} {v}" for name, v in stated.items()))
    manifest = tomllib.loads(text("addon/blender_manifest.toml"))
    built = re.findall(r"target: ([\w-]+)", text(".github/workflows/release.yml"))
    for platform in manifest["platforms"]:
        target = TARGET_OF.get(platform)
        if target not in built:
            found.append(f"the manifest names {platform}, for which release.yml builds no wheel ({target})")
    found += [f"{target} is built, but has no notices" for target in sorted(set(built) - set(TARGETS))]
    if not any(NOTICES in line for line in manifest["copyright"]):
        found.append(f"`copyright` of the manifest does not credit what the wheel bundles ({NOTICES})")
    sections = dict(re.findall(r"(?ms)^## ([^\n]+)\n(.*?)(?=^## |\Z)", text("CHANGELOG.md")))
    unreleased = bool(sections.get("Unreleased", "").strip())
    if not any(name.split()[0] == version for name in sections) and (tag or not unreleased):
        found.append(f"CHANGELOG.md has no section {version}")
    if tag and unreleased:
        found.append("CHANGELOG.md has unreleased entries")
    if tag and tag != f"v{version}":
        found.append(f"the tag {tag} is not v{version}")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tag", help="of the release")
    found = faults(parser.parse_args().tag)
    for line in found:
        print(line)
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
