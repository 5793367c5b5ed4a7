# SPDX-License-Identifier: GPL-3.0-or-later
"""The job behind the modal operator: progress, cancel, and a world that changed meanwhile."""

import re
import time
from pathlib import Path

import bpy
import pytest

from addon import job as job_module
from addon import mesh_read
from addon.mesh_read import UnusableObjectError, value_of
from addon.operators.match import JobOperator, reading, store
from addon.operators.step import going_on


@pytest.fixture
def job(pair):
    source, target, _ = pair
    return value_of(reading(bpy.context, source, [target]))


def test_runs_beside_and_reports(job):
    job.start()
    stages = set()
    while not job.finished:
        stages.add(job.stage)
        assert 0.0 <= job.fraction <= 1.0
        time.sleep(0.005)
    assert job.error is None and len(job.results) == 1 and stages
    targets, trouble = store(bpy.context, job)
    assert [obj.name for obj in targets] == ["Target"] and not trouble


def test_each_stage_of_the_core_has_an_artist_s_words():
    core = Path(__file__).parents[2] / "rust" / "core" / "src"
    told = {
        stage
        for path in core.rglob("*.rs")
        for stage in re.findall(r'report\(\s*"([^"]+)"', path.read_text(encoding="utf-8"))
    }
    # One that every match has, so that the search finds something.
    assert "refinement" in told
    assert told <= set(job_module.STAGE_WORDS)


def test_cancel_ends_without_a_result(job):
    job.cancel()
    job.run()
    assert job.cancelled and not job.results and job.error is None


def test_renamed_object_is_found_again(job):
    job.run()
    bpy.data.objects["Target"].name = "Other Name"
    targets, _ = store(bpy.context, job)
    assert [obj.name for obj in targets] == ["Other Name"]


def test_deleted_target_is_said(job):
    job.run()
    bpy.data.objects.remove(bpy.data.objects["Target"])
    targets, trouble = store(bpy.context, job)
    assert not targets and "'Target' was deleted" in trouble[0]


def test_deleted_source_is_said(job):
    job.run()
    bpy.data.objects.remove(bpy.data.objects["Source"])
    with pytest.raises(UnusableObjectError, match="'Source' was deleted"):
        store(bpy.context, job)


def test_edited_target_is_said(job):
    job.run()
    bpy.data.objects["Target"].data.vertices[0].co.x += 0.5
    targets, trouble = store(bpy.context, job)
    assert not targets and "edited" in trouble[0]


def after_steps(generator, many):
    """Whether the generator lives on after so many steps."""
    return all(next(generator, None) is None and generator.gi_frame for _ in range(many))


@pytest.mark.parametrize("name", ["Source", "Target"])
def test_deleted_while_it_is_read_is_said(pair, name):
    """Reading pauses between its steps for the window, where anything can happen."""
    source, target, _ = pair
    generator = reading(bpy.context, source, [target])
    next(generator)
    bpy.data.objects.remove(bpy.data.objects[name])
    with pytest.raises(UnusableObjectError, match=f"'{name}' was deleted"):
        value_of(generator)


def test_edited_while_it_is_read_is_said(pair):
    """Whatever step an edit falls between: a match of what is not there any more is never stored."""
    source, target, _ = pair
    refused = 0
    for steps in range(1, 20):
        generator = reading(bpy.context, source, [target])
        if not after_steps(generator, steps):
            break
        target.data.vertices[0].co.x += 0.5
        found = value_of(generator)
        now = mesh_read.fingerprint(target.data)
        refused += found.targets[0].fingerprint != now
        assert (found.targets[0].fingerprint == now) == (
            found.targets[0].local == mesh_read.positions(target.data)
        ).all()
    assert refused > 0


def test_missing_core_is_a_message(job, monkeypatch):
    import addon.core as core

    def broken():
        raise core.CoreMissingError("The computing core does not load here")

    monkeypatch.setattr(core, "load", broken)
    job.run()
    assert "core" in core.explain(job.error)


def test_disabling_the_extension_ends_what_goes_on(registered, scene, monkeypatch):
    """Blender drops the operators without a word, so the extension itself gives the status bar back."""
    said = []
    monkeypatch.setattr(bpy.types.WorkSpace, "status_text_set", lambda _, text: said.append(text))
    operator = JobOperator()
    operator._job = job_module.current = job_module.Job()
    operator._beginning, operator._timer = iter(()), None
    going_on.add(operator)
    registered.unregister()
    try:
        assert operator._job.cancelling and job_module.current is None and not going_on
        assert said and set(said) == {None}
    finally:
        registered.register()
