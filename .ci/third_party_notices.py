# SPDX-License-Identifier: GPL-3.0-or-later
"""Write THIRD_PARTY_NOTICES.txt: what Cargo.lock links into the core, with its licences.

    python .ci/third_party_notices.py [--check]

With --check nothing is written; the exit status says whether the file still agrees with the lock file. Crates
that only run while building (procedural macros, build scripts, tests) are not part of the core.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "THIRD_PARTY_NOTICES.txt"
# The platforms of the release wheels.
TARGETS = (
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-pc-windows-msvc",
    "aarch64-pc-windows-msvc",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
)
# Licences that both MIT OR Apache-2.0 and GPL-3.0-or-later may be combined with, in the order in which one is
# chosen where a crate offers several.
ACCEPTED = ("MIT", "BSD-2-Clause", "BSD-3-Clause", "Zlib", "ISC", "Apache-2.0")
LICENCE_FILE = re.compile(r"(?i)^(licen[cs]e|copying|notice|copyright|unlicense)")
# How the file of one licence among several is called.
FILE_WORDS = {
    "MIT": "mit",
    "Apache-2.0": "apache",
    "Zlib": "zlib",
    "BSD-2-Clause": "bsd",
    "Unlicense": "unlicense",
}
RULE = "=" * 100

MIT_TEXT = """\
Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without
limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the
Software, and to permit persons to whom the Software is furnished to do so, subject to the following
conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions
of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED
TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL
THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF
CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER
DEALINGS IN THE SOFTWARE."""

HEAD = """\
Third-party software in the compiled core of Spectral Match (sgmds)

The core's library contains the Rust standard library and the crates below, for at least one of the
supported platforms. Their sources are in the public registry of Rust crates under these names and versions.
No Python package is contained: numpy is part of Blender, or is installed beside sgmds.
Generated from Cargo.lock by .ci/third_party_notices.py."""


def linked_crates():
    """Packages (as cargo describes them) that end up in the library, by name and version."""
    crates = {}
    for target in TARGETS:
        command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
        metadata = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)
        packages = {package["id"]: package for package in metadata["packages"]}
        nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
        waiting = [id for id, package in packages.items() if package["name"] == "sgmds-python"]
        seen = set(waiting)
        while waiting:
            for dependency in nodes[waiting.pop()]["deps"]:
                id = dependency["pkg"]
                linked = any(kind["kind"] is None for kind in dependency["dep_kinds"])
                macro = any("proc-macro" in built["kind"] for built in packages[id]["targets"])
                if linked and not macro and id not in seen:
                    seen.add(id)
                    waiting.append(id)
        for id in seen:
            package = packages[id]
            # Without a source it is our own.
            if package["source"] is not None:
                crates[package["name"], package["version"]] = package
    return [crates[key] for key in sorted(crates)]


def chosen_licence(package):
    """The licence under which a crate is taken."""
    offered = re.split(r"\s+OR\s+|/", package["license"] or "")
    for licence in ACCEPTED:
        if licence in offered:
            return licence
    raise SystemExit(
        f"{package['name']} {package['version']}: licence '{package['license']}' is not among the accepted "
        f"{', '.join(ACCEPTED)}: replace the crate, or add the licence here after checking it"
    )


def licence_texts(package, licence):
    """Texts of a crate's licence files without those of the alternatives not chosen."""
    others = [word for name, word in FILE_WORDS.items() if name != licence]
    folder = Path(package["manifest_path"]).parent
    texts = []
    for path in sorted(folder.iterdir()):
        name = path.name.lower()
        if not path.is_file() or not LICENCE_FILE.match(name):
            continue
        # Only a crate with several licences has files for the others; "copying.x.bsd" is a part's own.
        if not name.startswith("copying") and any(word in name for word in others):
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        texts.append("\n".join(line.rstrip() for line in text.strip().splitlines()))
    if licence == "MIT" and not any("Permission is hereby granted" in text for text in texts):
        authors = ", ".join(re.sub(r"\s*<.*?>", "", author) for author in package["authors"])
        texts.append(f"Copyright (c) {authors or 'the authors of ' + package['name']}\n\n{MIT_TEXT}")
    if not texts:
        raise SystemExit(f"{package['name']} {package['version']}: has no licence file")
    return texts


def notices():
    """The whole text: each licence text once, under the names of all crates that it covers."""
    covered = {}
    std = f"Copyright (c) The Rust Project Developers\n\n{MIT_TEXT}"
    covered[std] = ["Rust standard library (MIT)"]
    for package in linked_crates():
        licence = chosen_licence(package)
        for text in licence_texts(package, licence):
            covered.setdefault(text, []).append(f"{package['name']} {package['version']} ({licence})")
    sections = [HEAD]
    sections += [f"{RULE}\n" + "\n".join(names) + f"\n\n{text}" for text, names in covered.items()]
    return "\n\n".join(sections) + "\n"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="only say whether the file is up to date")
    options = parser.parse_args()
    text = notices()
    if not options.check:
        OUTPUT.write_text(text, encoding="utf-8")
    elif not OUTPUT.exists() or OUTPUT.read_text(encoding="utf-8") != text:
        sys.exit(f"{OUTPUT.name} does not agree with Cargo.lock: run just -f .ci/justfile notices")


if __name__ == "__main__":
    main()
