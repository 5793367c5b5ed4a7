# SPDX-License-Identifier: GPL-3.0-or-later
"""`--command spectral_match`, called as Blender calls it: exit status 0, 1 failed, 2 wrong usage."""

import bpy
import pytest

from addon import command_line


def test_batch_matches_transfers_and_saves(pair, tmp_path):
    source, _, _ = pair
    source.vertex_groups.new(name="All").add(list(range(len(source.data.vertices))), 1.0, "REPLACE")
    output = str(tmp_path / "out.blend")
    arguments = [
        "batch",
        "--source",
        "Source",
        "--target",
        "Target",
        "--transfer",
        "groups",
        "--output",
        output,
    ]
    assert command_line.run(arguments) == 0
    bpy.ops.wm.open_mainfile(filepath=output)
    target = bpy.data.objects["Target"]
    assert "match_face" in target.data.attributes and "All" in target.vertex_groups


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["match", "--source", "Nobody", "--target", "Target", "--output", "x.blend"], 1, "Nobody"),
        (["match", "--source", "Source", "--target", "Target"], 1, "--output"),
        (["transfer", "--source", "Source", "--target", "Target", "--output", "x.blend"], 1, "matched"),
        (["fly"], 2, "invalid choice"),
    ],
)
def test_failure_has_a_status_and_words(pair, capsys, arguments, status, words):
    assert command_line.run(arguments) == status
    assert words in capsys.readouterr().err
