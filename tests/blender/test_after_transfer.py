# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist meets around a transfer: a summary, a stop, a search in lists, presets and menus."""

from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from conftest import choose, lumpy, new_object
from test_transfer import store_identity

from addon import job, menus, notice, pair, palette, translation
from addon.mesh_read import value_of
from addon.operators import carry as carrying
from addon.operators import compare
from addon.operators.carry import ADJUSTED, carry, done_words
from addon.operators.step import Step
from addon.transfer import LASTING, Carried, said_of_targets, said_once
from addon.translation_table import TABLE

GROUPS = [f"Bone {number:02}" for number in range(25)]


@pytest.fixture
def bodies(scene):
    """A source with groups and a UV map, and a target that is its copy, matched."""
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(8))
    for number, name in enumerate(GROUPS):
        source.vertex_groups.new(name=name).add([number], 1.0, "REPLACE")
    source.data.uv_layers.new(name="UVMap")
    store_identity(source, target)
    choose(source, target)
    return source, target


def test_what_came_is_counted_in_words(bodies, scene):
    _, target = bodies
    scene.spectral_match.skip("groups", GROUPS[0], True)
    scene.spectral_match.use_marks = False
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert notice.done() == "Done: 24 groups, 1 UV map"
    assert len(target.vertex_groups) == 24
    assert scene.spectral_match.transfers == notice.transfer == 1
    bpy.ops.spectral_match.dismiss()
    assert not notice.done


def test_what_came_is_said_in_the_language_of_the_moment(bodies, monkeypatch):
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert notice.done().startswith("Done: ")
    japanese = {row[0]: row[1] for row in TABLE}
    monkeypatch.setattr(carrying, "said", lambda text, *values: japanese[text].format(*values))
    assert notice.done().startswith("完了: ")


def test_what_came_is_said_until_the_next_match(bodies, scene):
    """Notes, Before and After are there while the artist looks; what another step fails of comes instead."""
    _, target = bodies
    target.data.uv_layers.new(name="UVMap")
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    words = notice.words
    assert "UV map 'UVMap' of 'Target' stays" in words
    for step in (
        lambda: bpy.ops.spectral_match.show(what="COLOURS"),
        lambda: bpy.ops.spectral_match.toggle_item(item="groups/Bone 01"),
        lambda: bpy.ops.spectral_match.choose_items(kind="groups", take=True),
    ):
        assert step() == {"FINISHED"}
        assert notice.done is not None and notice.words == words
    with pytest.raises(RuntimeError, match="'Nobody' is no mesh"):
        bpy.ops.spectral_match.toggle_piece(piece="Nobody")
    assert notice.done is None and "'Nobody'" in notice.words
    # A failure is forgotten with the next step.
    assert bpy.ops.spectral_match.show(what="NOTHING") == {"FINISHED"}
    assert not notice.words
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"} and notice.done is not None
    assert bpy.ops.spectral_match.match() == {"FINISHED"}
    assert notice.done is None


@pytest.mark.parametrize("button", ["spectral_match.match", notice.BESIDE[0]])
def test_what_came_is_said_on_when_other_work_is_stopped(bodies, button):
    stopped = "Match stopped; nothing was changed"
    operator = SimpleNamespace(said_at=button, tell=lambda *_: None)
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    Step.stopped(operator, stopped)
    assert notice.done is not None and notice.words != stopped
    notice.clear()
    Step.stopped(operator, stopped)
    assert stopped in (notice.words, notice.beside.get(button, ("",))[0])


def test_one_kind_without_a_plural_is_not_counted():
    brought = Carried({"armature": ["Rig"], "keys": ["A"], "groups": ["A", "B"]})
    brought.add(Carried({"groups": ["B", "C"], "marks": ["Seams"]}, ["look"]))
    assert brought.summary() == "3 groups, 1 key, marks, rig" and brought.notes == ["look"]


def test_several_targets_are_counted():
    brought = Carried({"groups": ["A"]})
    assert done_words(brought, [1]) == "Done: 1 group"
    assert done_words(brought, [1, 1]) == "Done to 2 meshes: 1 group"
    assert done_words(brought, [4, 1]) == "Done to 2 characters: 1 group"


def test_actions_are_counted_once():
    brought = Carried({"armature": ["Rig"]}, actions=["Walk"])
    assert brought.summary() == "rig, 1 action"
    brought.add(Carried(actions=["Walk", "Run"]))
    assert brought.summary() == "rig, 2 actions"


def test_a_transfer_that_is_stopped_changes_nothing(bodies, scene):
    source, target = bodies
    objects = set(bpy.data.objects)
    going = carry(bpy.context, source, [target], scene.spectral_match, lambda *_: True)
    shares = []
    for share, words in going:
        shares.append(share)
        assert words
        if words in LASTING:
            # Everything is computed, and nothing written.
            break
    going.close()
    assert shares == sorted(shares) and len(shares) > 2
    assert not target.vertex_groups and not target.data.uv_layers
    assert set(bpy.data.objects) == objects and target.mode == "OBJECT"
    brought = value_of(carry(bpy.context, source, [target], scene.spectral_match, lambda *_: True))
    assert len(brought.names["groups"]) == len(target.vertex_groups) == len(GROUPS)


def test_adjust_last_operation_begins_with_what_was_done(bodies, scene):
    """What is not set in it is as in the panel when the button was pressed."""
    _, target = bodies
    settings = scene.spectral_match
    settings.use_marks, settings.mix, settings.smooth_weights = False, 0.5, 2
    assert bpy.ops.spectral_match.transfer("EXEC_DEFAULT", True, smooth_weights=1) == {"FINISHED"}
    done = bpy.context.window_manager.operators[-1]
    assert done.bl_idname == "SPECTRAL_MATCH_OT_transfer"
    assert (done.use_marks, done.mix, done.smooth_weights, done.use_uv) == (False, 0.5, 1, True)
    for name in ADJUSTED:
        if name != "smooth_weights":
            assert getattr(done, name) == getattr(settings, name)
    # The next one knows nothing of it.
    assert settings.smooth_weights == 2
    target.data.uv_layers.remove(target.data.uv_layers[0])
    settings.use_uv = False
    assert bpy.ops.spectral_match.transfer("EXEC_DEFAULT", True) == {"FINISHED"}
    assert not target.data.uv_layers
    assert bpy.context.window_manager.operators[-1].smooth_weights == 2


def test_a_transfer_is_repeated_with_what_was_adjusted(bodies, scene):
    _, target = bodies
    assert bpy.ops.spectral_match.transfer("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.context.window_manager.operators[-1].use_uv = False
    target.data.uv_layers.remove(target.data.uv_layers[0])
    target.vertex_groups.clear()
    bpy.ops.screen.repeat_last()
    assert not target.data.uv_layers and len(target.vertex_groups) == len(GROUPS)
    assert scene.spectral_match.use_uv


def test_before_and_after_are_one_press_each(bodies, scene):
    """Whatever was done since the transfer; what was done comes back with it."""

    def groups_and_place():
        target = bpy.data.objects["Target"]
        return len(target.vertex_groups), target.location.x

    bpy.ops.ed.undo_push(message="Begin")
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Transfer")
    for place in (0.0, 1.0, 2.0):
        bpy.data.objects["Target"].location.x = place
        bpy.ops.ed.undo_push(message="Move")
        for _ in range(2):
            bpy.ops.spectral_match.compare(back=True)
            assert groups_and_place() == (0, 0.0) and not compare.is_after(bpy.context)
            bpy.ops.spectral_match.compare(back=False)
            assert groups_and_place() == (len(GROUPS), place) and compare.is_after(bpy.context)
    # A step that was undone by itself is redone to just after the transfer.
    for _ in range(4):
        bpy.ops.ed.undo()
    assert not compare.is_after(bpy.context)
    bpy.ops.spectral_match.compare(back=False)
    assert groups_and_place() == (len(GROUPS), 0.0)
    assert notice.done is not None


def test_a_transfer_too_long_ago_for_undo_stays(bodies, monkeypatch):
    edit = bpy.context.preferences.edit
    monkeypatch.setattr(edit, "undo_steps", 4)
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    for place in range(8):
        bpy.data.objects["Target"].location.x = place
        bpy.ops.ed.undo_push(message="Move")
    bpy.ops.spectral_match.compare(back=True)
    target = bpy.data.objects["Target"]
    assert (len(target.vertex_groups), target.location.x) == (len(GROUPS), 7.0)


def test_all_and_none_mean_what_the_search_finds(bodies, scene):
    settings, panel = scene.spectral_match, bpy.context.window_manager.spectral_match_panel
    panel.item_search = "bone 1"
    bpy.ops.spectral_match.choose_items(kind="groups", take=False)
    skipped = [name for name in GROUPS if settings.skips("groups", name)]
    assert skipped == GROUPS[10:20]
    panel.item_search = ""
    bpy.ops.spectral_match.choose_items(kind="groups", take=True)
    assert not settings.skipped


def test_presets_are_named_as_artists_write_them():
    folder = Path(menus.__file__).parent / "presets" / "spectral_match"
    names = {bpy.path.display_name(path.name) for path in folder.glob("*.py")}
    assert names == {"Game character", "Texturing", "Rig", "Retopology / LOD", "Face"}


@pytest.mark.parametrize("name", menus.MENUS)
def test_steps_are_in_the_menus_of_objects(registered, name):
    assert menus.DRAWN[name] in getattr(bpy.types, name)._dyn_ui_initialize()


def test_sides_differ_in_hue():
    """Two points that mirror each other differ more than two that lie beside each other."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.0, 1.0, (400, 3)) * (0.4, 0.2, 1.0)
    points = points[np.abs(points[:, 0]) > 0.1]
    both = np.concatenate([points, points * (-1.0, 1.0, 1.0), points + (0.02, 0.0, 0.0)])
    own, other, beside = np.split(palette.surface_colours(both)[:, :3], 3)
    assert np.linalg.norm(own - other, axis=1).min() > 3.0 * np.linalg.norm(own - beside, axis=1).mean()


def test_notes_that_differ_in_figures_are_one():
    """The worst is said, and of how many more; a figure in a name is no figure."""

    class Mesh:
        def __init__(self, name):
            self.name = name

    arm, leg, hat = Mesh("Arm.1"), Mesh("Leg"), Mesh("Hat")
    notes = said_once(
        [
            (arm, "'Arm.1' overlaps: 12% of it"),
            (leg, "'Leg' overlaps: 80.5% of it"),
            (hat, "'Hat' has no 'UV2'"),
            (arm, "'Arm.1' has no 'UV3'"),
        ]
    )
    assert notes == [
        "'Leg' and 1 more mesh overlaps: 80.5% of it",
        "'Hat' has no 'UV2'",
        "'Arm.1' has no 'UV3'",
    ]


def test_notes_on_several_targets_are_one():
    """Which of their meshes is named and how they are numbered does not matter; what else differs does."""

    def notes_on(name, number, percent, *more):
        rig, hat = f"{name} Rig{number}", f"Hat{number}"
        return {name, rig, hat, f"Cape{number}"}, [
            f"UV map 'UVMap' of '{hat}' and 2 more meshes overlaps: {percent}% of it",
            f"The old weights of 'Cape{number}' stay: Bone ({rig}), Root ({rig})",
            f"These hung on the old rig and follow the new one now: Staff{number}",
            *more,
        ]

    one, own = "'Hat' has no 'UV2'", "'Hat.001' has no 'UV3'"
    told = [
        notes_on("Mage", "", 12, one),
        notes_on("Rogue", ".001", 80.5, own, own),
        notes_on("Monk", ".002", 7),
    ]
    assert said_of_targets(told) == [
        "UV map 'UVMap' of 'Hat.001' and 2 more meshes overlaps: 80.5% of it (on 3 targets)",
        "The old weights of 'Cape' stay: Bone (Mage Rig), Root (Mage Rig) (on 3 targets)",
        "These hung on the old rig and follow the new one now: Staff (on 3 targets)",
        one,
        own,
        own,
    ]
    for names, notes in told:
        assert said_of_targets([(names, notes)]) == notes
    assert said_of_targets([({"Hat"}, [one]), ({"Cap"}, ["'Cap' and 1 more mesh has no 'UV2'"])]) == [
        f"{one} (on 2 targets)"
    ]


def test_a_note_on_several_targets_is_said_once(bodies, scene):
    source, target = bodies
    other = new_object("Other", *lumpy(8))
    store_identity(source, other)
    for obj in (target, other):
        obj.vertex_groups.new(name=GROUPS[3]).lock_weight = True
    choose(source, target, other)
    assert bpy.ops.spectral_match.transfer(kinds="groups") == {"FINISHED"}
    (words,) = notice.words.splitlines()
    assert words.endswith(" (on 2 targets)") and "'Target'" in words and "'Other'" not in words
    for locale, said in (("ja_JP", "（転送先 2 件）"), ("zh_HANS", "（2 个目标）")):
        spoken = translation.spoken(words, locale)
        assert spoken.endswith(said) and "locked" not in spoken


def test_the_pair_stays_while_a_transfer_has_objects_of_its_own(bodies, scene, monkeypatch):
    source, target = bodies
    monkeypatch.setattr(pair, "_kept", [scene.session_uid, 0.0, pair.resolve(bpy.context)])
    running = job.Job()
    running.blocks = True
    monkeypatch.setattr(job, "current", running)
    new_object("Third", *lumpy(6)).select_set(True)
    pair._forget()
    assert [body.lead for body in pair.shown(bpy.context).targets] == [target]
    monkeypatch.setattr(job, "current", None)
    assert len(pair.shown(bpy.context).targets) == 2
