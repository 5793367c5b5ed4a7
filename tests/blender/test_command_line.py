# SPDX-License-Identifier: GPL-3.0-or-later
"""`--command spectral_match`, called as Blender calls it: outputs, report, exit status."""

import json
import re

import bpy
import numpy as np
import pytest
import sgmds
from conftest import lumpy, new_object, renumbered, turned
from test_transfer import store_identity, without_data

from addon import batch, command_line
from addon.operators import carry

WEIGHTS = "Height"


def add_weights(obj):
    """A group that differs from vertex to vertex."""
    group = obj.vertex_groups.new(name=WEIGHTS)
    for number, value in enumerate(graded([vertex.co.z for vertex in obj.data.vertices])):
        group.add([number], float(value), "REPLACE")


def graded(heights):
    """Weights from 0.1 to 1 by height; smaller ones would be pruned."""
    return np.interp(heights, (np.min(heights), np.max(heights)), (0.1, 1.0))


def weights(obj):
    group = obj.vertex_groups[WEIGHTS]
    return np.array([group.weight(number) for number in range(len(obj.data.vertices))])


@pytest.fixture(scope="module")
def files(registered, tmp_path_factory):
    """A hero with weights in one file, an orc and a pot in another; the orc is the hero, turned."""
    folder = tmp_path_factory.mktemp("files")
    vertices, faces = lumpy(8)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    add_weights(new_object("Hero", vertices, faces))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "hero.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    moved, other_faces, _ = renumbered(vertices, faces)
    new_object("Orc", turned(moved), other_faces)
    new_object("Pot", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [])
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "orc.blend"))
    return folder


def test_objects_of_a_source_file_come_along_and_leave_again(files, tmp_path):
    """Eye and hair of the hero: copies stay with the orc; what does not hang on the hero never comes."""
    bpy.ops.wm.open_mainfile(filepath=str(files / "hero.blend"))
    for name in ("Eye", "Stone"):
        new_object(name, 0.08 * lumpy(3)[0] + (0.3, 0.4, 0.9), lumpy(3)[1])
    hair = bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair"))
    bpy.context.collection.objects.link(hair)
    hair.data.surface = bpy.data.objects["Eye"].parent = bpy.data.objects["Hero"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "hero.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(files / "orc.blend"))
    words = ["batch", "--source", "Hero", "--source-file", str(tmp_path / "hero.blend"), "--target", "[EO]*"]
    output = tmp_path / "out.blend"
    assert command_line.run([*words, "--transfer", "objects", "--output", str(output)]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert sorted(bpy.data.objects.keys()) == ["Eye Orc", "Hair Orc", "Orc", "Pot"]
    assert bpy.data.objects["Hair Orc"].data.surface == bpy.data.objects["Orc"]
    copy = bpy.data.objects["Eye Orc"]
    expected = turned(0.08 * lumpy(3)[0] + (0.3, 0.4, 0.9))
    found = [copy.matrix_world @ vertex.co for vertex in copy.data.vertices]
    # The eye is 0.1 large: the match of a renumbered copy is right to a few thousandths of its size.
    np.testing.assert_allclose(found, expected, atol=5e-3)


def test_wildcards_leave_out_what_is_made_on_the_way(known, tmp_path):
    """Neither the source's eye nor its copy on the first target is a target of the second pattern."""
    source, _, _ = known
    eye = new_object("Eye", 0.08 * lumpy(3)[0] + (0.3, 0.4, 0.9), lumpy(3)[1])
    eye.parent = source
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cast.blend"))
    given = manifest(
        tmp_path,
        """
        output = "out"
        transfer = ["objects"]
        [[jobs]]
        files = "cast.blend"
        source = "Source"
        targets = ["Target", "*"]
        """,
    )
    report = tmp_path / "report.json"
    assert command_line.run(["transfer", *given, "--json", str(report)]) == 0
    (done,) = json.loads(report.read_text())["files"]
    assert [pair["target"] for pair in done["pairs"]] == ["Target", "Second"]


def second_scene(*objects, name="Second"):
    """Moves objects into a scene of their own, which is not the one that is open."""
    scene = bpy.data.scenes.new(name)
    for obj in objects:
        scene.collection.objects.link(obj)
        for collection in obj.users_collection:
            if collection != scene.collection:
                collection.objects.unlink(obj)
    return scene


@pytest.mark.parametrize("moved", ["Hero", "Orc", "both"])
def test_objects_are_found_in_all_scenes(files, tmp_path, moved):
    """Source, target or both in a scene that is not the open one, with a rig, which is edited there."""
    bpy.ops.wm.open_mainfile(filepath=str(files / "hero.blend"))
    hero = bpy.data.objects["Hero"]
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new(WEIGHTS)
    bone.head, bone.tail = (0, 0, -0.5), (0, 0, 0.5)
    bpy.ops.object.mode_set(mode="OBJECT")
    hero.modifiers.new("Armature", "ARMATURE").object = rig
    vertices, faces = lumpy(8)
    shuffled, other_faces, _ = renumbered(vertices, faces)
    orc = new_object("Orc", turned(shuffled), other_faces)
    second_scene(*{"Hero": (hero, rig), "Orc": (orc,), "both": (hero, rig, orc)}[moved])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scenes.blend"))
    output = tmp_path / "out.blend"
    words = ["batch", "--source", "Hero", "--target", "O*", "--transfer", "groups,armature"]
    assert command_line.run([*words, "--output", str(output)]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    orc = bpy.data.objects["Orc"]
    assert {scene.name for scene in orc.users_scene} == {"Second" if moved != "Hero" else "Scene"}
    fitted = next(modifier.object for modifier in orc.modifiers if modifier.type == "ARMATURE")
    assert fitted != bpy.data.objects["Rig"] and fitted.users_scene == orc.users_scene
    assert WEIGHTS in orc.vertex_groups and 0.05 < np.std(weights(orc))
    hero = bpy.data.objects["Hero"]
    assert {scene.name for scene in hero.users_scene} == {"Scene" if moved == "Orc" else "Second"}


def test_a_source_of_another_file_reaches_all_scenes(files, tmp_path):
    bpy.ops.wm.open_mainfile(filepath=str(files / "orc.blend"))
    second_scene(bpy.data.objects["Orc"])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "orc.blend"))
    output = tmp_path / "out.blend"
    words = ["batch", "--source", "Hero", "--source-file", str(files / "hero.blend"), "--target", "Orc"]
    assert command_line.run([*words, "--transfer", "groups", "--output", str(output)]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert WEIGHTS in bpy.data.objects["Orc"].vertex_groups and "Hero" not in bpy.data.objects


def written(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob("*")}


def test_batch_matches_transfers_and_saves(pair, tmp_path, capsys):
    source, _, _ = pair
    add_weights(source)
    output, report = tmp_path / "new" / "out.blend", tmp_path / "report.json"
    words = ["batch", "--source", "Source", "--target", "Target", "--transfer", "groups"]
    assert command_line.run([*words, "--output", str(output), "--json", str(report)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines and all(line.startswith("spectral_match: ") for line in lines)
    assert any("%" in line for line in lines) and lines[-1].endswith("out.blend")
    told = json.loads(report.read_text())
    (entry,) = told["files"]
    (done,) = entry["pairs"]
    assert told["status"] == 0 and entry["output"] == str(output)
    assert (done["source"], done["target"], done["status"]) == ("Source", "Target", "done")
    assert done["grade"] in ("green", "amber", "red") and done["transferred"] == ["groups"]
    assert [path.name for path in output.parent.iterdir()] == ["out.blend"]
    bpy.ops.wm.open_mainfile(filepath=str(output))
    target = bpy.data.objects["Target"]
    assert "match_face" in target.data.attributes and WEIGHTS in target.vertex_groups


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["match", "--source", "Nobody", "--target", "Target", "--output", "x.blend"], 1, "Nobody"),
        (["match", "--source", "Source", "--target", "No*", "--output", "x.blend"], 1, "'No*'"),
        (["match", "--source", "Source", "--target", "Target"], 1, "--output"),
        (["transfer", "--source", "Source", "--target", "Target", "--output", "x.blend"], 1, "match"),
        (["batch", "--manifest", "nothing.toml"], 1, "nothing.toml"),
        (["match", "--source", "Source"], 2, "--target"),
        (["match", "--manifest", "m.toml", "--source", "Source"], 2, "--source"),
        (["batch", "--source", "S", "--target", "T", "--transfer", "hats"], 2, "hats"),
        (["batch", "--manifest", "m.toml", "--resume", "--overwrite"], 2, "--overwrite"),
        (["match", "--source", "S", "--target", "T", "--output", "x.blend", "--folder", "x"], 2, "--folder"),
        (["match", "--manifest", "m.toml", "--keep-source"], 2, "--keep-source"),
        (
            ["match", "--source", "No\x1b[2J\nbody", "--target", "Target", "--output", "x.blend"],
            1,
            "No\\x1b[2J body",
        ),
        (["fly"], 2, "invalid choice"),
    ],
)
def test_failure_has_a_status_and_words(pair, capsys, tmp_path, monkeypatch, arguments, status, words):
    monkeypatch.chdir(tmp_path)
    assert command_line.run(arguments) == status
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_report_replaces_reports_alone(pair, tmp_path, capsys):
    report, output = tmp_path / "report.json", tmp_path / "out.blend"
    words = [
        "match",
        "--source",
        "Nobody",
        "--target",
        "Target",
        "--output",
        str(output),
        "--json",
        str(report),
    ]
    report.write_text('{"mine": 1}')
    assert command_line.run(words) == 1
    assert "is no report" in capsys.readouterr().err and report.read_text() == '{"mine": 1}'
    report.unlink()
    for _ in range(2):
        assert command_line.run(words) == 1
        assert "Nobody" in capsys.readouterr().err and json.loads(report.read_text())["status"] == 1
    report.write_text('{"mine": 1}')
    command_line.run([*words, "--overwrite"])
    assert json.loads(report.read_text())["status"] == 1


@pytest.mark.parametrize("place", ["folder", "file/out.blend"])
def test_what_cannot_be_saved_is_a_failure(pair, tmp_path, place):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    report = tmp_path / "report.json"
    words = ["match", "--source", "Source", "--target", "Target", "--overwrite", "--json", str(report)]
    assert command_line.run([*words, "--output", str(tmp_path / place)]) == 1
    told = json.loads(report.read_text())
    assert (told["status"], told["files"][0]["status"]) == (1, "failed") and told["files"][0]["reason"]
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "folder", "report.json"]


@pytest.fixture
def known(scene):
    """A source and two targets that are matched with it."""
    source = new_object("Source", *lumpy(4))
    targets = [without_data(source, name) for name in ("Target", "Second")]
    for target in targets:
        store_identity(source, target)
    return source, *targets


def test_a_missing_object_is_a_failed_pair(known, tmp_path):
    source, _, _ = known
    add_weights(source)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "in.blend"))
    given = manifest(
        tmp_path,
        """
        output = "out"
        transfer = ["groups"]
        [[jobs]]
        files = "in.blend"
        [[jobs.pairs]]
        source = "Nobody"
        targets = "Target"
        [[jobs.pairs]]
        source = "Source"
        targets = ["No*", "Target"]
        """,
    )
    report = tmp_path / "report.json"
    assert command_line.run(["transfer", *given, "--json", str(report)]) == 1
    (entry,) = json.loads(report.read_text())["files"]
    assert entry["status"] == "done"
    assert [(pair["source"], pair["target"], pair["status"]) for pair in entry["pairs"]] == [
        ("Nobody", "Target", "failed"),
        ("Source", "No*", "failed"),
        ("Source", "Target", "done"),
    ]
    assert "'Nobody'" in entry["pairs"][0]["reason"] and "'No*'" in entry["pairs"][1]["reason"]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out" / "in.blend"))
    assert WEIGHTS in bpy.data.objects["Target"].vertex_groups


def test_what_the_core_refuses_is_a_failed_pair(known, tmp_path, monkeypatch):
    def refuses(*_):
        raise sgmds.SgmdsError("nothing finite")

    monkeypatch.setattr(carry, "carry_all", refuses)
    report = tmp_path / "report.json"
    words = ["transfer", "--source", "Source", "--target", "Target", "--output", str(tmp_path / "out.blend")]
    assert command_line.run([*words, "--json", str(report)]) == 1
    (failed,) = json.loads(report.read_text())["files"][0]["pairs"]
    assert failed["status"] == "failed" and "'Target': nothing finite" in failed["reason"]


def test_another_source_than_the_matched_one_is_refused(known, tmp_path, capsys):
    new_object("Other", *lumpy(4))
    words = ["transfer", "--source", "Other", "--target", "Target", "--output", str(tmp_path / "out.blend")]
    assert command_line.run(words) == 1
    assert "'Target' was matched with 'Source'" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_every_job_begins_with_the_opened_file_as_it_was(known, tmp_path):
    add_weights(known[0])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"))
    bpy.data.objects["Source"]["opened"] = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "opened.blend"))
    jobs = "[[jobs]]\nsource = 'Source'\ntargets = '{}'\noutput = '{}'\n{}"
    given = manifest(
        tmp_path,
        "output = 'out'\ntransfer = ['groups']\n"
        + jobs.format("Target", "other.blend", "files = 'other.blend'\n")
        + jobs.format("Target", "one.blend", "")
        + jobs.format("Second", "two.blend", ""),
    )
    assert command_line.run(["transfer", *given]) == 0
    for name, target, other in (("one", "Target", "Second"), ("two", "Second", "Target")):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out" / f"{name}.blend"))
        objects = bpy.data.objects
        assert "opened" in objects["Source"]
        assert WEIGHTS in objects[target].vertex_groups and not objects[other].vertex_groups


def test_help_is_status_0(registered, capsys):
    assert command_line.run(["--help"]) == 0
    assert "Exit status" in capsys.readouterr().out


def manifest(folder, text):
    path = folder / "cast.toml"
    path.write_text(text)
    return ["--manifest", str(path)]


def test_manifest_goes_on_past_failures_and_leaves_inputs_alone(files, tmp_path, capsys):
    (tmp_path / "torn.blend").write_bytes((files / "orc.blend").read_bytes()[:1000])
    given = manifest(
        tmp_path,
        f"""
        output = "dressed"
        transfer = ["groups"]
        [[jobs]]
        files = ["torn.blend", "{files}/orc.blend"]
        source = "Hero"
        source_file = "{files}/hero.blend"
        targets = "*"
        """,
    )
    before = written(files)
    report = tmp_path / "report.json"
    assert command_line.run(["batch", *given, "--json", str(report)]) == 1
    assert written(files) == before
    assert [path.name for path in (tmp_path / "dressed").iterdir()] == ["orc.blend"]
    torn, good = json.loads(report.read_text())["files"]
    assert torn["status"] == "failed" and torn["reason"] and not torn["pairs"]
    assert {(p["target"], p["status"]) for p in good["pairs"]} == {("Orc", "done"), ("Pot", "failed")}
    assert any("faces" in p.get("reason", "") for p in good["pairs"])
    assert "2 of the pairs or files failed" in capsys.readouterr().err

    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "dressed" / "orc.blend"))
    # The source came from another file and left again.
    assert {obj.name for obj in bpy.data.objects} == {"Orc", "Pot"}
    orc = bpy.data.objects["Orc"]
    vertices, faces = lumpy(8)
    old = renumbered(vertices, faces)[2]
    expected = graded(vertices[old, 2])
    # One body in two positions: nearly every vertex finds its own, the rest a neighbour.
    assert np.median(np.abs(weights(orc) - expected)) < 1e-3

    # What is there is not replaced unless told, and can be kept.
    capsys.readouterr()
    assert command_line.run(["batch", *given]) == 1
    assert "--overwrite" in capsys.readouterr().err
    (tmp_path / "torn.blend").unlink()
    given = manifest(
        tmp_path,
        f"""
        output = "dressed"
        [[jobs]]
        files = "{files}/orc.blend"
        pairs = [{{ source = "Hero", targets = "Orc" }}]
        source_file = "{files}/hero.blend"
        """,
    )
    stamp = written(tmp_path / "dressed")
    assert command_line.run(["batch", *given, "--resume", "--json", str(report)]) == 0
    assert written(tmp_path / "dressed") == stamp
    assert len(json.loads(report.read_text())["skipped"]) == 1


def test_an_input_is_replaced_only_when_told(files, tmp_path, capsys):
    own = tmp_path / "orc.blend"
    own.write_bytes((files / "orc.blend").read_bytes())
    given = manifest(
        tmp_path,
        f"""
        output = "."
        options = {{ method = "paper" }}
        [[jobs]]
        files = "orc.blend"
        source = "Hero"
        source_file = "{files}/hero.blend"
        targets = "Orc"
        """,
    )
    before = own.read_bytes()
    assert command_line.run(["match", *given]) == 1
    assert "is an input" in capsys.readouterr().err and own.read_bytes() == before
    assert command_line.run(["match", *given, "--overwrite"]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(own))
    # Without a transfer the source stays, because the match is worth nothing without it.
    assert bpy.data.objects["Orc"].spectral_match_source == bpy.data.objects["Hero"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("jobs = 3", "cannot be 3"),
        ("", "nothing to do"),
        ("[[jobs]]\nsource = 'A'", "targets"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\ncolour = 'red'", "unknown key 'colour'"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\nfiles = '*.blend'", "no file is named"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\nsource_file = 'a.blend'", "there is no file"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\ntransfer = ['hats']", "hats"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\noutput = '../out.blend'", "leads out"),
        ("output = '/elsewhere'\n[[jobs]]\nsource = 'A'\ntargets = 'B'", "leads out"),
        ("options.same_axes = 'yes'\n[[jobs]]\nsource = 'A'\ntargets = 'B'", "cannot be 'yes'"),
        ("options.method = 'best'\n[[jobs]]\nsource = 'A'\ntargets = 'B'", "should be one of"),
        ("[[jobs]]\nsource = 'A'\ntargets = [1]", "names are strings, got 1"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\nfiles = [1]", "names are strings, got 1"),
        ("transfer = [['uv']]\n[[jobs]]\nsource = 'A'\ntargets = 'B'", "names are strings"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\noutput = '{file.x}'", "may use {file} only"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\noutput = '{file[0]}.blend'", "may use {file} only"),
        ("[[jobs]]\nsource = 'A'\ntargets = 'B'\noutput = ''", "no name of a file"),
        ("[[jobs]]\nsource='A'\ntargets='B'\n[[jobs]]\nsource='A'\ntargets='C'", "never saved"),
        ("[[jobs]]\nsource='A'\ntargets='B'\nfiles='cast.toml'\n" * 2, "Two files"),
    ],
)
def test_a_wrong_manifest_is_told_in_words(scene, tmp_path, text, words):
    with pytest.raises(batch.WrongRequestError, match=re.escape(words)) as caught:
        path = manifest(tmp_path, text)[1]
        batch.check_overwriting(batch.read_manifest(path, None, False)[0], False, False)
    if words != "Two files":
        assert "cast.toml" in str(caught.value)


def test_ctrl_c_cancels_and_saves_nothing(pair, tmp_path, monkeypatch, capsys):
    def pressed(self, seconds=None):
        monkeypatch.undo()
        raise KeyboardInterrupt

    from addon.job import MatchJob

    monkeypatch.setattr(MatchJob, "wait", pressed)
    words = ["match", "--source", "Source", "--target", "Target", "--output", str(tmp_path / "x.blend")]
    assert command_line.run(words) == 130
    assert "cancelled" in capsys.readouterr().err and not list(tmp_path.iterdir())
