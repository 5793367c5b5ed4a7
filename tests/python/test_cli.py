"""The command line: what it writes and its exit status."""

import os
import shlex
import subprocess
import sys

import numpy as np
import pytest
import sgmds
from sgmds.cli import main
from sgmds.extras import missing


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
        ["match", good, good, "-o", str(tmp_path / "none" / "map.npz")],
        ["match", str(tmp_path), good, "-o", output],
        ["match", good, good, "-o", output, "--method", "paper", "--same-axes"],
        ["bench", "--sizes", "10"],
        ["match", good, good, "-o", output, "--landmark", "0:99999999"],
        ["evaluate", str(tmp_path / "none")],
    ):
        assert main(arguments) == 1
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and lines[0].startswith("sgmds: ")


def test_a_map_without_a_folder_is_refused_before_any_work(files, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sgmds, "match", None)
    good, place = str(files / "slender.obj"), tmp_path / "none" / "map.npz"
    assert main(["match", good, good, "-o", str(place)]) == 1
    assert f"there is no folder {place.parent}" in capsys.readouterr().err
    folder = tmp_path / "folder.npz"
    folder.mkdir()
    assert main(["match", good, good, "-o", str(folder)]) == 1
    assert f"{folder}: is a folder" in capsys.readouterr().err
    monkeypatch.setattr(os, "access", lambda place, mode: False)
    assert main(["match", good, good, "-o", str(tmp_path / "map.npz")]) == 1
    assert f"the folder {tmp_path} cannot be written to" in capsys.readouterr().err


def test_a_map_replaces_only_what_was_saved_here(files, tmp_path, monkeypatch, capsys):
    good, place = str(files / "slender.obj"), tmp_path / "map.npz"
    assert main(["match", good, good, "-o", str(place)]) == 0
    assert main(["match", good, good, "-o", str(place)]) == 0
    capsys.readouterr()
    corr = sgmds.Correspondence.load(place)
    np.savez(place, results=np.arange(10))
    mine = place.read_bytes()
    monkeypatch.setattr(sgmds, "match", None)
    assert main(["match", good, good, "-o", str(place)]) == 1
    assert f"{place}: is there already" in capsys.readouterr().err
    with pytest.raises(FileExistsError):
        corr.save(place)
    assert place.read_bytes() == mine


@pytest.mark.parametrize(
    "command",
    [["evaluate", "DATA", "--json"], ["evaluate", "DATA", "--plot"], ["reproduce", "noise", "DATA", "--json"]]
    + [["bench", "--sizes", "10", "--json"]],
)
def test_figures_and_pictures_replace_nothing_unless_told(command, tmp_path, capsys):
    place = tmp_path / "mine.svg"
    place.write_text("mine")
    assert main([*command, str(place)]) == 1
    assert f"{place}: is there already" in capsys.readouterr().err
    # The work then fails for other reasons.
    assert main([*command, str(place), "--overwrite"]) == 1
    assert "there already" not in capsys.readouterr().err
    assert place.read_text() == "mine"


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (["evaluate", "DATA"], "--json"),
        (["evaluate", "DATA"], "--plot"),
        (["reproduce", "noise", "DATA"], "--json"),
        (["bench"], "--json"),
    ],
)
def test_figures_without_a_folder_are_refused_before_any_work(command, option, tmp_path, capsys):
    place = tmp_path / "none" / "figures"
    with pytest.raises(SystemExit) as refused:
        main([*command, option, str(place)])
    assert refused.value.code == 2
    assert f"there is no folder {place.parent}" in capsys.readouterr().err


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("metric", ["euclidean", "scale-invariant"])
def test_a_mesh_that_cannot_be_matched_is_named_by_its_file(files, tmp_path, capsys, side, metric):
    bad = tmp_path / "triangle.obj"
    bad.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    meshes = [str(files / "slender.obj")]
    meshes.insert(side, str(bad))
    assert main(["match", *meshes, "-o", str(tmp_path / "map.npz"), "--metric", metric]) == 1
    assert capsys.readouterr().err.startswith(f"sgmds: {bad}: the largest connected part")


def test_an_error_about_no_one_mesh_keeps_its_words(files, tmp_path, monkeypatch, capsys):
    def match(*_, **__):
        raise sgmds.MeshError("method: strange")

    monkeypatch.setattr(sgmds, "match", match)
    good = str(files / "slender.obj")
    assert main(["match", good, good, "-o", str(tmp_path / "map.npz")]) == 1
    assert "method: strange" in capsys.readouterr().err


def test_axes_in_common_are_told_to_the_matcher(files, tmp_path, monkeypatch):
    told = []

    def noted(*_, **options):
        told.append(options["same_axes"])
        raise sgmds.Cancelled

    monkeypatch.setattr(sgmds, "match", noted)
    good = str(files / "slender.obj")
    for more in ([], ["--same-axes"]):
        assert main(["match", good, good, "-o", str(tmp_path / "map.npz"), *more]) == 130
    assert told == [False, True]


def test_version(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"sgmds {sgmds.__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["match"],
        ["match", "a", "b"],
        ["unknown"],
        ["evaluate", ".", "--limit", "0"],
        ["evaluate", ".", "--limit", "few"],
        ["evaluate", ".", "--lines", "-5"],
        ["evaluate", ".", "--threads", "70000"],
        ["batch", "pairs.toml", "--threads", "70000"],
        ["evaluate", ".", "--bound", "nan"],
        ["evaluate", ".", "--plot", "curves.xyz"],
        ["reproduce", "runtime", ".", "--cache", "c"],
        ["reproduce", "runtime", ".", "--every", "2"],
        ["reproduce", "noise", ".", "--plot", "curves.svg"],
        ["reproduce", "ablation", ".", "--method", "paper"],
        ["bench", "--sizes", "10,x"],
    ],
)
def test_wrong_usage_is_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    # The words are for users, who know none of our functions.
    assert "invalid _" not in capsys.readouterr().err


def test_interrupt_is_status_130(files, tmp_path, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(sgmds, "match", interrupted)
    good = str(files / "slender.obj")
    assert main(["match", good, good, "-o", str(tmp_path / "map.npz")]) == 130


def test_an_interrupt_while_packages_load_is_one_line():
    code = """
import os, signal, sys
from sgmds.command import main
assert "numpy" not in sys.modules
class Interrupting:
    def find_spec(self, name, *_):
        if name == "numpy":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
sys.exit(main())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "cancelled\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no disk that is always full")
@pytest.mark.parametrize("arguments", [["--version"], ["evaluate", "--help"], ["match"]])
def test_a_full_disk_for_what_is_printed_is_one_line(files, tmp_path, arguments):
    if arguments == ["match"]:
        good = str(files / "slender.obj")
        arguments += [good, good, "-o", str(tmp_path / "map.npz"), "--method", "functional-map"]
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "sgmds.command", *arguments]
        # Unbuffered, the parser of arguments would keep the trouble with its help to itself.
        given = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=given)
    assert (done.returncode, done.stderr) == (1, "sgmds: standard output: No space left on device\n")


@pytest.mark.skipif(os.name == "nt", reason="the shell closes the output")
@pytest.mark.parametrize("arguments", ["--version", "match none.off none.off -o map.npz"])
def test_an_output_that_is_closed_is_no_failure(tmp_path, arguments):
    command = f"exec {shlex.quote(sys.executable)} -m sgmds.command {arguments} >&-"
    done = subprocess.run(command, shell=True, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    wanted = (1, "sgmds: none.off: No such file or directory\n") if "match" in arguments else (0, "")
    # Python prints the version where there is an output.
    assert (done.returncode, done.stderr.removeprefix(f"sgmds {sgmds.__version__}\n")) == wanted


def test_a_full_disk_for_the_map_is_one_line(files, tmp_path):
    good = str(files / "slender.obj")
    code = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (50_000,) * 2); "
    code += "from sgmds.command import main; sys.exit(main())"
    arguments = ["match", good, good, "-o", str(tmp_path / "map.npz"), "--method", "functional-map"]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line == f"sgmds: {tmp_path / 'map.npz'}: File too large"
    assert list(tmp_path.iterdir()) == []


def test_import_needs_numpy_alone():
    code = "import sys, sgmds; print({'scipy', 'matplotlib', 'tqdm'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_an_output_that_lacks_letters_is_no_failure(tmp_path, encoding):
    """Windows gives a pipe the code page of the country, which has no √."""
    command = [sys.executable, "-m", "sgmds.cli", "evaluate", "--help"]
    done = subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    assert done.returncode == 0 and b"\\u221aarea" in done.stdout, done.stderr


def test_threads_are_those_of_the_preparation_too(files, tmp_path, monkeypatch):
    given = []

    class Shape(sgmds.Shape):
        def __init__(self, *mesh, threads=None, **options):
            given.append(threads)
            super().__init__(*mesh, threads=threads, **options)

    monkeypatch.setattr(sgmds, "Shape", Shape)
    good = str(files / "slender.obj")
    arguments = ["--metric", "scale-invariant", "--method", "paper", "--threads", "1"]
    assert main(["match", good, good, "-o", str(tmp_path / "map.npz"), *arguments]) == 0
    (tmp_path / "corr").mkdir()
    for name in "ab":
        (tmp_path / f"{name}.obj").symlink_to(good)
        (tmp_path / "corr" / f"{name}.txt").write_text("0\n1\n")
    (tmp_path / "pairs.txt").write_text("a b\n")
    assert main(["evaluate", str(tmp_path), "--method", "paper", "--threads", "1"]) == 0
    assert given == [1] * 4


@pytest.mark.parametrize(
    ("module", "wanted"),
    [
        ("matplotlib", ".[tools]"),
        ("distributed", ".[batch]"),
        ("pyFM", ".[peers]"),
        ("pygeodesic", "pygeodesic"),
    ],
)
def test_a_missing_package_is_named_with_what_brings_it(module, wanted):
    assert missing(module).replace('"', "").startswith(f"{module} is missing: pip install {wanted}")


def test_other_maps_are_saved_beside_the_chosen_one(files, tmp_path, capsys, slender, stout):
    """As many, in the order and with the grades that the library gives."""
    output = tmp_path / "map.npz"
    command = ["match", str(files / "slender.obj"), str(files / "stout.obj"), "-o", str(output)]
    corr = sgmds.match((slender.vertices, slender.faces), (stout.vertices, stout.faces))
    others = corr.alternatives
    assert others, "the test needs a pair with other plausible maps"
    assert main([*command, "--alternatives"]) == 0
    said = capsys.readouterr().out
    for number, other in enumerate(others, 2):
        path = tmp_path / f"map.{number}.npz"
        assert f"{path}: {len(other.vertices)} vertices, {other.quality.grade}" in said
        np.testing.assert_array_equal(sgmds.Correspondence.load(path).faces, other.faces)
    assert not (tmp_path / f"map.{len(others) + 2}.npz").exists()
