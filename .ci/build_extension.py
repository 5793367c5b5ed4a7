# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension: addon/ and the core's wheel as dist/spectral_match-VERSION-PLATFORM.zip.

    python .ci/build_extension.py [--wheel FILE.whl] [--profile release] [--output-dir dist] [--website URL]

Without --wheel the core is built by maturin, with a profile of Cargo.toml. The website, or else
$SPECTRAL_MATCH_WEBSITE, is where the manual is published; Blender then links to it. Needs no Blender; its
`extension validate` accepts the result. The zip depends on the files alone, not on time or folder.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon"
NOTICES = ROOT / "THIRD_PARTY_NOTICES.txt"
# End of a wheel's platform tag → Blender's name of the platform.
PLATFORMS = {
    "linux_x86_64": "linux-x64",
    "linux_aarch64": "linux-arm64",
    "win_amd64": "windows-x64",
    "win_arm64": "windows-arm64",
    "macosx_x86_64": "macos-x64",
    "macosx_arm64": "macos-arm64",
}
# The earliest time that a zip can hold.
ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)


def platform_of(wheel):
    """Blender's platform name for a wheel's file name."""
    tag = wheel.stem.rsplit("-", 1)[1].split(".")[0]
    tag = re.sub(r"^manylinux_\d+_\d+_|^manylinux\d+_|^musllinux_\d+_\d+_", "linux_", tag)
    tag = re.sub(r"^macosx_\d+_\d+_", "macosx_", tag)
    if tag not in PLATFORMS:
        raise SystemExit(f"{wheel.name}: no Blender platform is known for the wheel tag '{tag}'")
    return PLATFORMS[tag]


def build_wheel(folder, profile):
    """Build the core with maturin and return the wheel; of several in the folder, the newest."""
    maturin = Path(sys.executable).with_name("maturin")
    program = str(maturin) if maturin.exists() else "maturin"
    cargo = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo")) / "bin"
    environment = {**os.environ, "PATH": f"{os.environ['PATH']}{os.pathsep}{cargo}"}
    if not shutil.which("cargo", path=environment["PATH"]):
        raise SystemExit("Please install Rust first (https://rustup.rs): the wheel is built from it")
    subprocess.run(
        [program, "build", "--profile", profile, "--out", str(folder)],
        cwd=ROOT,
        env=environment,
        check=True,
        stdout=sys.stderr,
    )
    wheels = sorted(folder.glob("sgmds-*.whl"), key=lambda path: path.stat().st_mtime)
    if not wheels:
        raise SystemExit(f"maturin left no wheel in {folder}")
    return wheels[-1]


def manifest_for(wheel, website):
    """The manifest's text with this one platform, this wheel and, if there is one, the website."""
    text = (ADDON / "blender_manifest.toml").read_text(encoding="utf-8")
    text, platforms = re.subn(r"(?m)^platforms = .*$", f'platforms = ["{platform_of(wheel)}"]', text)
    text, wheels = re.subn(r"(?m)^wheels = .*$", f'wheels = ["./wheels/{wheel.name}"]', text)
    if (platforms, wheels) != (1, 1):
        raise SystemExit(
            "blender_manifest.toml should have one line 'platforms = …' and one line 'wheels = …'"
        )
    if website:
        text = re.sub(r"(?m)^(type = .*)$", rf'\1\nwebsite = "{website}"', text)
    return text


def build(wheel, output_dir, website=None):
    """Write the zip and return its path."""
    manifest = manifest_for(wheel, website)
    version = tomllib.loads(manifest)["version"]
    output_dir.mkdir(parents=True, exist_ok=True)
    target = output_dir / f"spectral_match-{version}-{platform_of(wheel)}.zip"
    sources = [path for path in sorted(ADDON.rglob("*")) if path.suffix == ".py" or path.name == "LICENSE"]
    with zipfile.ZipFile(target, "w") as archive:
        _add(archive, "blender_manifest.toml", manifest.encode())
        for path in sources:
            _add(archive, path.relative_to(ADDON).as_posix(), path.read_bytes())
        _add(archive, NOTICES.name, NOTICES.read_bytes())
        # A wheel is a zip already.
        _add(archive, f"wheels/{wheel.name}", wheel.read_bytes(), zipfile.ZIP_STORED)
    return target


def _add(archive, name, content, method=zipfile.ZIP_DEFLATED):
    entry = zipfile.ZipInfo(name, ZIP_EPOCH)
    entry.compress_type = method
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--wheel", type=Path, help="use this wheel instead of building one")
    parser.add_argument("--profile", default="release", help="with which the core is built")
    parser.add_argument("--output-dir", type=Path, default=ROOT / "dist")
    parser.add_argument("--website", default=os.environ.get("SPECTRAL_MATCH_WEBSITE"), metavar="URL")
    options = parser.parse_args()
    wheel = options.wheel or build_wheel(options.output_dir, options.profile)
    print(build(wheel.resolve(), options.output_dir, options.website))


if __name__ == "__main__":
    main()
