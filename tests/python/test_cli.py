"""The command line: what it writes and its exit status."""

import subprocess
import sys

import numpy as np
import pytest
import sgmds
from sgmds.cli import main


@pytest.fixture(scope="module")
def files(tmp_path_factory, slender, stout):
    folder = tmp_path_factory.mktemp("meshes")
    for name, shape in (("slender", slender), ("stout", stout)):
        with open(folder / f"{name}.obj", "w") as file:
            file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in shape.vertices.tolist())
            file.writelines(f"f {a} {b} {c}\n" for a, b, c in (shape.faces + 1).tolist())
    return folder


def test_match_writes_a_map(files, tmp_path, capsys, stout):
    output = tmp_path / "map.npz"
    assert main(["match", str(files / "slender.obj"), str(files / "stout.obj"), "-o", str(output)]) == 0
    assert "map.npz" in capsys.readouterr().out
    corr = sgmds.Correspondence.load(output)
    assert len(corr.vertices) == len(stout.vertices)
    # Readable by numpy alone.
    with np.load(output) as stored:
        assert len(stored.files) > 0


def test_failures_are_one_line_and_status_1(files, tmp_path, capsys):
    output = str(tmp_path / "map.npz")
    good = str(files / "slender.obj")
    for arguments in (
        ["match", str(tmp_path / "none.off"), good, "-o", output],
        ["match", good, good, "-o", str(tmp_path / "map.txt")],
        ["match", good, good, "-o", output, "--landmark", "0:99999999"],
        ["evaluate", str(tmp_path / "none")],
    ):
        assert main(arguments) == 1
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and lines[0].startswith("sgmds: ")


@pytest.mark.parametrize(
    "arguments", [[], ["match"], ["match", "a", "b"], ["unknown"], ["evaluate", ".", "--limit", "0"]]
)
def test_wrong_usage_is_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2


def test_interrupt_is_status_130(files, tmp_path, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(sgmds, "match", interrupted)
    good = str(files / "slender.obj")
    assert main(["match", good, good, "-o", str(tmp_path / "map.npz")]) == 130


def test_import_needs_numpy_alone():
    code = "import sys, sgmds; print({'scipy', 'trimesh', 'matplotlib', 'tqdm'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
