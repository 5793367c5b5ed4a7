# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets, defaults, and prepared meshes kept between matches."""

from pathlib import Path

import bpy
import numpy as np
import pytest
import sgmds
from conftest import lumpy

from addon import panels, prepared
from addon.operators import settings as setting
from addon.operators.settings import PRESET_NAMES

PRESETS = sorted((Path(__file__).parents[2] / "addon" / "presets" / "spectral_match").glob("*.py"))


@pytest.mark.parametrize("preset", PRESETS, ids=lambda path: path.stem)
def test_shipped_preset_is_applied_and_reset(scene, preset):
    settings = scene.spectral_match
    defaults = {name: getattr(settings, name) for name in PRESET_NAMES}
    apply = bpy.ops.script.execute_preset
    assert apply(filepath=str(preset), menu_idname="SPECTRAL_MATCH_MT_presets") == {"FINISHED"}
    assert {name: getattr(settings, name) for name in PRESET_NAMES} != defaults
    assert any(getattr(settings, name) for name in PRESET_NAMES if name.startswith("use_"))
    bpy.ops.spectral_match.toggle_item(item="groups/Head")
    assert bpy.ops.spectral_match.reset() == {"FINISHED"}
    assert {name: getattr(settings, name) for name in PRESET_NAMES} == defaults
    assert not settings.skipped


def test_a_preset_does_not_depend_on_the_one_before(scene):
    settings = scene.spectral_match
    made = {}
    for before in PRESETS:
        for preset in PRESETS:
            for chosen in (before, preset):
                bpy.ops.script.execute_preset(filepath=str(chosen), menu_idname="SPECTRAL_MATCH_MT_presets")
            now = {name: getattr(settings, name) for name in PRESET_NAMES}
            assert made.setdefault(preset, now) == now, (before.stem, preset.stem)
    assert len({str(now) for now in made.values()}) == len(PRESETS)


def triangles():
    vertices, faces = lumpy(8)
    quads = np.array(faces)
    return vertices, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


@pytest.fixture
def made(monkeypatch):
    """How many shapes were really prepared."""
    prepared.forget()
    count = []
    real = sgmds.Shape.__init__

    def counted(self, *arguments, **options):
        count.append(1)
        real(self, *arguments, **options)

    monkeypatch.setattr(sgmds.Shape, "__init__", counted)
    yield count
    prepared.forget()


def test_shipped_presets_have_names_in_other_languages(registered, monkeypatch):
    """By our own table: in Blender's, Face is one of a mesh. Presets of the user's are called as they are."""
    monkeypatch.setattr(setting, "shown_name", {"Face": "Kao"}.get)
    given = {}
    monkeypatch.setattr(setting.Menu, "path_menu", lambda *_, **keywords: given.update(keywords))
    for shown in (setting.SPECTRAL_MATCH_MT_presets, panels.VIEW3D_PT_spectral_match_presets):
        given.clear()
        shown.path_menu(None, [], "", display_name=None)
        assert given["display_name"](str(setting.FOLDER / "presets" / "spectral_match" / "Face.py")) == "Kao"
        assert given["display_name"]("/home/artist/Face.py") == "Face"
    assert setting.shipped()["Kao"] == "Face"


def test_the_same_mesh_is_prepared_once(made):
    vertices, faces = triangles()
    first = prepared.shape(vertices, faces, None, progress=None, threads=None)
    assert prepared.shape(vertices.copy(), faces, None, progress=None, threads=None) is first
    assert len(made) == 1
    prepared.shape(vertices * 2.0, faces, None, progress=None, threads=None)
    assert len(made) == 2


def test_prepared_meshes_outlive_the_session(made, tmp_path):
    vertices, faces = triangles()
    storage = prepared.Storage(str(tmp_path / "kept"), 2**30)
    first = prepared.shape(vertices, faces, storage, progress=None, threads=None)
    prepared.forget()
    again = prepared.shape(vertices, faces, storage, progress=None, threads=None)
    assert len(made) == 1 and again is not first
    np.testing.assert_array_equal(again.eigenvalues, first.eigenvalues)
    users = tmp_path / "kept" / "hero--orc.npz"
    np.savez(users, a=np.arange(3))
    prepared.clear(storage)
    assert users.exists() and not list((tmp_path / "kept" / "sgmds-shapes").glob("*.npz"))
    prepared.forget()
    prepared.shape(vertices, faces, storage, progress=None, threads=None)
    assert len(made) == 2


def test_memory_is_bounded(made, monkeypatch):
    monkeypatch.setattr(prepared, "MOST_VERTICES", 1)
    vertices, faces = triangles()
    for scale in (1.0, 2.0, 3.0):
        prepared.shape(vertices * scale, faces, None, progress=None, threads=None)
    assert len(prepared._kept) == prepared.FEWEST_SHAPES


def test_second_match_prepares_nothing(pair, made):
    bpy.ops.spectral_match.match()
    assert len(made) == 2
    bpy.ops.spectral_match.match()
    assert len(made) == 2


def explained(properties, own):
    """Names of properties without a tooltip worth reading."""
    return [
        name
        for name, found in properties.items()
        if name in own and (len(found.description.split()) < 3 or found.description == found.name)
    ]


def test_everything_that_can_be_pressed_explains_itself(registered):
    from addon.operators import CLASSES
    from addon.preferences import SPECTRAL_MATCH_preferences
    from addon.properties import SPECTRAL_MATCH_PG_settings

    for cls in CLASSES:
        if not issubclass(cls, bpy.types.Operator):
            continue
        module, name = cls.bl_idname.split(".")
        rna = getattr(getattr(bpy.ops, module), name).get_rna_type()
        assert len(rna.description.split()) > 2 or cls.bl_label == "Dismiss", cls.bl_idname
        assert "\n" not in rna.description, cls.bl_idname
    for cls in (SPECTRAL_MATCH_PG_settings, SPECTRAL_MATCH_preferences):
        own = {name for base in cls.__mro__ for name in getattr(base, "__annotations__", ())}
        # Objects, lists and their active lines are no buttons of their own; counts and words are only read.
        own -= {"skipped", "landmarks", "source_piece", "target_piece", "transfers", "outfit_inside"}
        assert not explained(cls.bl_rna.properties, own)
