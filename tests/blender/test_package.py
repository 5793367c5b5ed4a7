# SPDX-License-Identifier: GPL-3.0-or-later
"""The built zip in a Blender with an empty user folder, where no other core can be imported."""

import importlib.util
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# The test's own Python has the core installed: an import hook hides that one until Blender brings the zip's.
INSTALL_AND_USE = """
import os
import sys
from importlib.machinery import PathFinder
class WithoutOwnCore:
    def find_spec(name, path=None, target=None):
        if name == "sgmds":
            found = PathFinder.find_spec(name, [place for place in sys.path if place.startswith({user!r})])
            if found is None:
                raise ModuleNotFoundError("no core", name=name)
            return found
sys.meta_path.insert(0, WithoutOwnCore)
try:
    import sgmds
    raise SystemExit("another core can be imported: " + sgmds.__file__)
except ImportError:
    pass
import bpy
bpy.ops.extensions.package_install_files(filepath={zip!r}, repo="user_default", enable_on_install=True)
assert "bl_ext.user_default.spectral_match" in bpy.context.preferences.addons, "not enabled"
import sgmds
assert sgmds.__file__.startswith({user!r}), sgmds.__file__
bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
target = bpy.context.object
for vertex in target.data.vertices:
    vertex.co.x *= 1.0 + 0.7 * max(vertex.co.x, 0.0)
    vertex.co.z *= 1.3 + 0.2 * vertex.co.y
source = bpy.data.objects.new("Source", target.data.copy())
bpy.context.collection.objects.link(source)
bpy.context.view_layer.update()
bpy.context.view_layer.objects.active = source
source.select_set(True)
assert bpy.ops.spectral_match.match() == {{"FINISHED"}}
assert len(target.data.attributes["match_face"].data) == len(target.data.vertices)
print("core loaded from", sgmds.__file__)
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.spectral_match")
sys.stdout.flush()
os._exit(0)  # see conftest.py on the end of Blender 4.2
"""


@pytest.fixture(scope="module")
def build_extension():
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / ".ci" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_zip_holds_the_addon_and_one_wheel(build_extension, tmp_path):
    wheel = tmp_path / "sgmds-0.1.0-cp311-abi3-manylinux_2_28_x86_64.whl"
    wheel.write_bytes(b"the core")
    archive = zipfile.ZipFile(build_extension.build(wheel, tmp_path / "dist"))
    names = archive.namelist()
    assert "blender_manifest.toml" in names and "__init__.py" in names
    assert [name for name in names if name.endswith(".whl")] == [f"wheels/{wheel.name}"]
    assert archive.read(f"wheels/{wheel.name}") == b"the core"
    assert not [name for name in names if "__pycache__" in name or "numpy" in name]
    assert {"LICENSE", "THIRD_PARTY_NOTICES.txt"} <= set(names)


def test_website_of_a_release_is_where_the_manual_is(build_extension, tmp_path):
    wheel = tmp_path / "sgmds-0.1.0-cp311-abi3-manylinux_2_28_x86_64.whl"
    for website in (None, "https://example.org/manual/"):
        manifest = tomllib.loads(build_extension.manifest_for(wheel, website))
        assert manifest.get("website") == website
        assert manifest["platforms"] == ["linux-x64"] and set(manifest["permissions"]) == {"files"}


def test_manual_has_a_page_for_every_button():
    from addon import manual
    from addon.operators import CLASSES

    pages = {path.stem for path in (ROOT / "docs" / "manual").glob("*.md")}
    assert set(manual.PAGES) <= pages
    known = {name for names in manual.PAGES.values() for name in names}
    # Those that are for scripts, or explain themselves.
    silent = {"add_landmark", "dismiss"}
    buttons = {
        cls.bl_idname.partition(".")[2]
        for cls in CLASSES
        if hasattr(cls, "bl_idname") and "." in cls.bl_idname
    }
    assert buttons - silent == known


def test_zip_works_in_an_empty_user_folder(tmp_path):
    # Built from this tree with the core as it is tested, which is there but for its binding.
    build = [sys.executable, str(ROOT / ".ci" / "build_extension.py"), "--profile", "develop"]
    subprocess.run([*build, "--output-dir", str(tmp_path)], check=True)
    extension = next(tmp_path.glob("spectral_match-*.zip"))
    wheel = next(tmp_path.glob("sgmds-*.whl"))
    assert "abi3" in wheel.name
    user = tmp_path / "user"
    user.mkdir()
    script = INSTALL_AND_USE.format(user=str(user), zip=str(extension))
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(user)}
    environment.pop("PYTHONPATH", None)
    ended = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    print(ended.stdout)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"core loaded from {user}" in ended.stdout
