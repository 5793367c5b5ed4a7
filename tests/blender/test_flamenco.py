# SPDX-License-Identifier: GPL-3.0-or-later
"""The Flamenco job type in a JavaScript engine, against a stub of Flamenco's author API, and the commands it
makes against our own command line."""

import json
from pathlib import Path

import bpy
import pytest
from conftest import lumpy, new_object, renumbered, turned
from py_mini_racer import JSEvalException, MiniRacer

from addon import command_line

SCRIPT = Path(command_line.__file__).parent / "flamenco" / "spectral_match.js"

# What Flamenco Manager gives to a job type: objects with the same methods, `path` with Go's functions.
# Whatever else the script calls does not exist here and is an error, as it is there.
STUB = """
const author = {
    Task: (name, type) => {
        if (typeof name !== "string" || typeof type !== "string") throw new TypeError("Task(name, type)");
        const made = { name, type, commands: [], dependencies: [] };
        made.addCommand = (command) => { made.commands.push(command); };
        made.addDependency = (task) => { made.dependencies.push(task.name); };
        return made;
    },
    Command: (name, parameters) => {
        if (typeof name !== "string" || typeof parameters !== "object") throw new TypeError("Command");
        return { name, parameters };
    },
};
const path = {
    basename: (p) => p.split("/").pop(),
    dirname: (p) => p.split("/").slice(0, -1).join("/") || "/",
    join: (...parts) => parts.join("/").replace(/[/]+/g, "/"),
    stem: (p) => p.split("/").pop().replace(/[.][^.]*$/, ""),
};
function compiled(settings) {
    const tasks = [];
    compileJob({ name: "job", settings, addTask: (task) => { tasks.push(task); } });
    return JSON.stringify(tasks);
}
"""
SETTING_KEYS = {
    "key", "type", "subtype", "choices", "propargs", "description", "default", "eval", "evalInfo", "visible",
    "required", "editable", "label",
}  # fmt: skip
VARIABLES = {"{blender}": "blender", "{blenderArgs}": "-b -y"}


@pytest.fixture(scope="module")
def engine():
    engine = MiniRacer()
    engine.eval(STUB)
    engine.eval(SCRIPT.read_text(encoding="utf-8"))
    return engine


@pytest.fixture(scope="module")
def job_type(engine):
    return json.loads(engine.eval("JSON.stringify(JOB_TYPE)"))


@pytest.fixture(scope="module")
def tasks_of(engine, job_type):
    """Tasks of a job with these settings and the defaults of the others, as the Manager fills them in."""

    def compiled(**given):
        settings = {s["key"]: s["default"] for s in job_type["settings"] if "default" in s} | given
        missing = [s["key"] for s in job_type["settings"] if s.get("required") and s["key"] not in settings]
        assert not missing
        return json.loads(engine.eval(f"compiled({json.dumps(settings)})"))

    return compiled


GIVEN = {"blendfile": "/job/hero.blend", "source": "Hero", "output_folder": "/out/"}


def test_settings_are_of_known_kinds(job_type):
    assert job_type["label"]
    for setting in job_type["settings"]:
        assert set(setting) <= SETTING_KEYS
        assert setting["type"] in ("string", "int32", "float", "bool")
        assert setting.get("subtype") in (None, "file_path", "dir_path", "file_name", "hashed_file_path")
        assert setting.get("visible") in (None, "visible", "hidden", "submission", "web")
        if "eval" in setting:
            compile(setting["eval"], setting["key"], "eval")


def test_each_file_is_a_task_of_blender(tasks_of):
    tasks = tasks_of(**GIVEN, files="/cast/orc.blend; /cast/elf.blend;", kinds="uv", keep_source=True)
    assert [task["name"] for task in tasks] == ["match-orc", "match-elf"]
    for task, file in zip(tasks, ("orc.blend", "elf.blend"), strict=True):
        assert task["type"] == "blender" and not task["dependencies"]
        (command,) = task["commands"]
        # Command and parameters as in the Worker's list of commands.
        assert command["name"] == "blender-render"
        assert set(command["parameters"]) == {"exe", "exeArgs", "argsBefore", "blendfile", "args"}
        assert command["parameters"]["blendfile"] == f"/cast/{file}"
        arguments = command["parameters"]["args"]
        assert all(type(word) is str for word in arguments)
        assert arguments[arguments.index("--output") + 1] == f"/out/{file}"
        assert arguments[arguments.index("--transfer") + 1] == "uv" and "--keep-source" in arguments


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"files": " ; "}, "at least one"),
        ({"files": "/cast/orc.blend;/new/orc.blend"}, "two files"),
        ({"files": "/out/orc.blend"}, "is an input"),
        ({"files": "/cast/hero.blend", "blendfile": "/out/hero.blend"}, "is an input"),
    ],
)
def test_a_job_that_would_lose_files_is_refused(tasks_of, given, words):
    with pytest.raises(JSEvalException, match=words):
        tasks_of(**(GIVEN | given))


def test_the_commands_are_understood_and_do_the_work(scene, tasks_of, tmp_path, monkeypatch):
    vertices, faces = lumpy(6)
    hero = new_object("Hero", vertices, faces)
    hero.vertex_groups.new(name="All").add(list(range(len(vertices))), 1.0, "REPLACE")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "hero.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    moved, other_faces, _ = renumbered(vertices, faces)
    new_object("Orc", turned(moved), other_faces)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "orc.blend"))

    (task,) = tasks_of(
        blendfile=str(tmp_path / "hero.blend"),
        source="Hero",
        files=str(tmp_path / "orc.blend"),
        output_folder=str(tmp_path / "out"),
    )
    parameters = task["commands"][0]["parameters"]
    # The Worker runs {exe} {exeArgs} {argsBefore} {blendfile} {args}.
    assert [VARIABLES[parameters[name]] for name in ("exe", "exeArgs")] == ["blender", "-b -y"]
    bpy.ops.wm.open_mainfile(filepath=parameters["blendfile"])
    assert parameters["args"][:2] == ["--command", "spectral_match"]
    for _ in range(2):
        assert command_line.run(parameters["args"][2:]) == 0
    report = json.loads((tmp_path / "out" / "orc.blend.json").read_text())
    assert report["files"][0]["pairs"][0]["status"] == "done"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out" / "orc.blend"))
    assert "All" in bpy.data.objects["Orc"].vertex_groups and "Hero" not in bpy.data.objects
