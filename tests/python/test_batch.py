"""Batches: what a manifest asks for is done once, whatever dies, and reported in the same bytes."""

import contextlib
import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import sgmds
from hypothesis import given
from hypothesis import strategies as st
from sgmds import archive, batch, correspondence
from sgmds.batch import journal, manifest, processes, report, work
from sgmds.batch.manifest import Batch, Pair, ShapeFile
from sgmds.cli import main
from sgmds.whole_file import clear_remains

REPORT = ("pairs.csv", "energy.csv", "confidence.csv", "distances.png", "report.json")
SHAPES = ("ant", "bee", "cat", "dog")


def write_off(path, vertices, faces):
    with open(path, "w") as file:
        file.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        file.writelines(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())


@pytest.fixture(scope="module")
def meshes(tmp_path_factory, sphere):
    """Four bodies without symmetry; the cat is the ant turned and doubled."""
    folder = tmp_path_factory.mktemp("batch") / "meshes"
    folder.mkdir()
    # The first vertices of the fixture are the sphere two subdivisions earlier; its faces are made anew.
    from scipy.spatial import ConvexHull

    points = sphere[0][:642]
    faces = ConvexHull(points).simplices
    outward = np.einsum(
        "ij,ij->i",
        np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))),
        points[faces[:, 0]],
    )
    faces = np.where(outward[:, None] > 0, faces, faces[:, ::-1])
    for seed, name in enumerate(SHAPES):
        rng = np.random.default_rng(0 if name == "cat" else seed)
        height = sum(
            h * np.exp(8 * (points @ (d / np.linalg.norm(d)) - 1))
            for h, d in zip(rng.uniform(0.3, 1.2, 5), rng.normal(size=(5, 3)), strict=True)
        )
        body = points * (1 + height)[:, None] * (1, 0.8, 1.3)
        if name == "cat":
            turn = np.linalg.qr(np.random.default_rng(9).normal(size=(3, 3)))[0]
            body = 2 * body @ (turn * np.sign(np.linalg.det(turn)))
        write_off(folder / f"{name}.off", body, faces)
    return folder


def everyone(meshes, folder, **more):
    path = folder / "all.toml"
    lines = [f'all_against_all = "{meshes}/*.off"', 'options.method = "paper"']
    lines += [f"{key} = {json.dumps(value)}" for key, value in more.items()]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def reference(meshes, cache, tmp_path_factory):
    """The folder of a batch that nothing interrupted."""
    path = everyone(meshes, tmp_path_factory.mktemp("reference"))
    assert main(["batch", str(path), "--jobs", "2", "--cache", str(cache)]) == 0
    return path.with_suffix("")


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def same_report(folder, reference):
    for name in REPORT:
        assert (folder / name).read_bytes() == (reference / name).read_bytes(), name
    maps = {path.name: path.read_bytes() for path in (folder / "maps").iterdir()}
    assert maps == {path.name: path.read_bytes() for path in (reference / "maps").iterdir()}


def runs(folder):
    return [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]


# What is done.


def test_every_pair_is_matched_as_it_is_alone(reference, meshes):
    rows = table(reference / "pairs.csv")
    assert [(r["source"], r["target"]) for r in rows] == [(s, t) for s in SHAPES for t in SHAPES if s != t]
    source, target = (sgmds.files.read_mesh(meshes / f"{name}.off") for name in ("bee", "dog"))
    alone = sgmds.match(source, target, method="paper")
    row = next(r for r in rows if (r["source"], r["target"]) == ("bee", "dog"))
    assert float(row["energy"]) == alone.quality.figures["sgmds_energy"]
    assert float(row["confidence"]) == alone.confidence.mean()
    stored = sgmds.Correspondence.load(reference / row["map"])
    assert np.array_equal(stored.faces, alone.faces)


def test_energy_matrix_knows_what_is_alike(reference):
    rows = table(reference / "energy.csv")
    assert [r["source"] for r in rows] == list(SHAPES) and list(rows[0]) == ["source", *SHAPES]
    energy = {(r["source"], t): float(r[t]) for r in rows for t in SHAPES if r[t]}
    assert len(energy) == 12
    alike = [energy.pop(("ant", "cat")), energy.pop(("cat", "ant"))]
    # One body in two positions: an isometry, where every term vanishes but for the fit of the functional map.
    assert 10 * max(alike) < min(energy.values())


def test_shapes_are_prepared_once(reference):
    (run,) = runs(reference)
    assert run["misses"] == len(SHAPES) and run["pairs"] == 12


def test_report_counts(reference):
    told = json.loads((reference / "report.json").read_text())
    assert (told["pairs"], told["done"], told["failed"], told["open"]) == (12, 12, 0, 0)
    assert sum(told["grades"].values()) == 12
    assert (reference / "distances.png").read_bytes().startswith(b"\x89PNG")


def test_listed_pairs_patterns_and_options(meshes, cache, tmp_path, capsys):
    path = tmp_path / "some.toml"
    path.write_text(
        f"""
        output = "out"
        options = {{ method = "paper" }}
        [[pairs]]
        source = "{meshes}/ant.off"
        target = ["{meshes}/b*.off", "{meshes}/cat.off"]
        [[pairs]]
        source = "{meshes}/dog.off"
        target = "{meshes}/ant.off"
        map = "dog.npz"
        """
    )
    assert main(["batch", str(path), "--jobs", "1", "--cache", str(cache)]) == 0
    rows = table(tmp_path / "out" / "pairs.csv")
    assert [(r["source"], r["target"], r["map"]) for r in rows] == [
        ("ant", "bee", "maps/ant--bee.npz"),
        ("ant", "cat", "maps/ant--cat.npz"),
        ("dog", "ant", "dog.npz"),
    ]
    assert (tmp_path / "out" / "dog.npz").exists()
    matrix = table(tmp_path / "out" / "energy.csv")
    assert [r["source"] for r in matrix] == ["ant", "dog"] and matrix[1]["bee"] == ""
    assert "3 of 3 pairs" in capsys.readouterr().out


def test_a_listed_pair_takes_its_place_in_all_against_all(meshes, tmp_path):
    path = tmp_path / "all.toml"
    entry = f'[[pairs]]\nsource = "{meshes}/bee.off"\ntarget = "{meshes}/dog.off"\n'
    own = 2 * (entry + 'map = "own.npz"\nlandmarks = [[1, 2]]\n')
    path.write_text(f'all_against_all = "{meshes}/*.off"\n{own}')
    batch = manifest.read(path)
    assert len(batch) == 12 and sorted(batch.order()) == list(range(12))
    pairs = list(map(batch.pair, range(12)))
    assert [batch.number(p.source, p.target) for p in pairs] == list(range(12))
    (listed,) = (p for p in pairs if p.landmarks)
    assert [batch.shapes[i].name for i in (listed.source, listed.target)] == ["bee", "dog"]
    assert (listed.map, listed.landmarks) == (batch.folder / "own.npz", ((1, 2),))


def test_a_failed_pair_stops_nothing_and_is_reported(meshes, cache, tmp_path, capsys):
    (tmp_path / "bad.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    path = tmp_path / "some.toml"
    path.write_text(
        f"""
        all_against_all = ["{meshes}/ant.off", "bad.off", "{meshes}/bee.off"]
        options.method = "paper"
        """
    )
    assert main(["batch", str(path), "--jobs", "2", "--cache", str(cache)]) == 1
    errors = capsys.readouterr().err.splitlines()
    assert errors[-1].startswith("sgmds: 4 pairs failed")
    assert sum("bad.off to" in line or "to bad.off failed" in line for line in errors) == 4
    rows = table(tmp_path / "some" / "pairs.csv")
    assert sorted(r["status"] for r in rows) == ["done"] * 2 + ["failed"] * 4
    told = json.loads((tmp_path / "some" / "report.json").read_text())
    assert len(told["failures"]) == 4 and all("bad.off" in f["reason"] for f in told["failures"])


def test_a_mesh_that_cannot_be_matched_is_named_by_its_file(meshes, cache, tmp_path):
    bad = tmp_path / "triangle.off"
    bad.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    path = tmp_path / "some.toml"
    path.write_text(
        f'options.same_axes = true\n[[pairs]]\nsource = "{meshes}/ant.off"\ntarget = "{bad.name}"\n'
    )
    assert main(["batch", str(path), "--jobs", "1", "--cache", str(cache)]) == 1
    (row,) = table(tmp_path / "some" / "pairs.csv")
    assert row["reason"].startswith(f"{bad}: the largest connected part has 3 vertices")


@pytest.mark.parametrize(("option", "count"), [("jobs", -1), ("jobs", 0), ("threads", 0), ("threads", 1025)])
def test_counts_that_mean_nothing_are_refused_at_once(meshes, cache, tmp_path, option, count):
    path = everyone(meshes, tmp_path)
    with pytest.raises(sgmds.ArgumentError, match=f"`{option}` should be"):
        batch.run(path, cache=cache, **{option: count})
    assert not path.with_suffix("").exists()


# What happens when something dies.


def begin(path, cache, *more):
    command = [sys.executable, "-m", "sgmds.cli", "batch", str(path), "--cache", str(cache), *more]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)


def wait_for_lines(path, count, process):
    while not path.exists() or path.read_bytes().count(b"\n") < count:
        assert process.poll() is None, "ended too early"
        time.sleep(0.01)


def test_a_killed_run_is_taken_up_and_reports_the_same(meshes, cache, tmp_path, reference):
    path = everyone(meshes, tmp_path)
    folder = path.with_suffix("")
    process = begin(path, cache, "--jobs", "2")
    wait_for_lines(folder / journal.NAME, 3, process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    # As if the kill had come in the middle of a line.
    with open(folder / journal.NAME, "ab") as file:
        file.write(b'{"source": "ant", "tar')
    before = (folder / journal.NAME).read_bytes().count(b"\n")
    assert before < 12, "nothing was left to do"
    assert not (folder / "pairs.csv").exists()

    assert main(["batch", str(path), "--cache", str(cache)]) == 1, "without --resume it is refused"
    # The dead run's workers end after their pair; the lock was its own.
    assert main(["batch", str(path), "--jobs", "2", "--resume", "--cache", str(cache)]) == 0
    assert runs(folder)[-1]["pairs"] == 12 - before
    same_report(folder, reference)

    assert main(["batch", str(path), "--resume", "--cache", str(cache)]) == 0
    assert runs(folder)[-1]["pairs"] == 0
    same_report(folder, reference)


@pytest.mark.parametrize("loaded", ["numpy/core", "_core.abi3", "matplotlib"])
def test_an_interrupt_at_any_time_is_one_line(meshes, tmp_path, loaded):
    """Ctrl-C reaches all processes of a terminal's group, also those that only begin."""
    path = everyone(meshes, tmp_path)
    command = [sys.executable, "-m", "sgmds.command", "batch", str(path), "--jobs", "2"]
    process = subprocess.Popen(
        [*command, "--cache", str(tmp_path / "cache")],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    # Where it is, by what it has loaded; matplotlib comes at the end.
    while process.poll() is None and loaded not in Path(f"/proc/{process.pid}/maps").read_text():
        time.sleep(0.005)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    _, words = process.communicate(timeout=60)
    assert (process.returncode, words) in ((130, "cancelled\n"), (0, ""))


@pytest.mark.parametrize("later", [0.0, 0.1, 0.2])
def test_an_interrupt_while_workers_load_is_one_line(meshes, tmp_path, later):
    """A worker that loads packages hears nothing of Ctrl-C, and that its work will not come is no failure."""
    path = everyone(meshes, tmp_path)
    command = [sys.executable, "-m", "sgmds.command", "batch", str(path), "--jobs", "2"]
    process = subprocess.Popen(
        [*command, "--cache", str(tmp_path / "cache")],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )

    def is_loading():
        with contextlib.suppress(OSError):
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            return any("numpy/core" in Path(f"/proc/{child}/maps").read_text() for child in children)
        return False

    while process.poll() is None and not is_loading():
        time.sleep(0.002)
    time.sleep(later)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    _, words = process.communicate(timeout=60)
    assert (process.returncode, words) in ((130, "cancelled\n"), (0, ""))


def test_a_full_disk_ends_in_words(meshes, tmp_path):
    path = everyone(meshes, tmp_path)
    code = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (2000,) * 2); "
    code += "from sgmds.command import main; sys.exit(main())"
    command = [
        sys.executable,
        "-c",
        code,
        "batch",
        str(path),
        "--jobs",
        "1",
        "--cache",
        str(tmp_path / "cache"),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert "File too large" in done.stderr.splitlines()[-1] and "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_only_what_changed_is_done_again(meshes, cache, tmp_path, reference):
    own = tmp_path / "meshes"
    own.mkdir()
    for name in SHAPES[:3]:
        (own / f"{name}.off").write_bytes((meshes / f"{name}.off").read_bytes())
    path = everyone(own, tmp_path)
    folder = path.with_suffix("")
    resume = ["batch", str(path), "--jobs", "1", "--resume", "--cache", str(cache)]
    assert main(resume) == 0 and runs(folder)[-1]["pairs"] == 6
    (own / "dog.off").write_bytes((meshes / "dog.off").read_bytes())
    assert main(resume) == 0 and runs(folder)[-1]["pairs"] == 6
    same_report(folder, reference)
    (folder / "maps" / "ant--bee.npz").unlink()
    assert main(resume) == 0 and runs(folder)[-1]["pairs"] == 1
    same_report(folder, reference)
    (own / "bee.off").write_bytes((meshes / "dog.off").read_bytes())
    assert main(resume) == 0 and runs(folder)[-1]["pairs"] == 6


def tasks(meshes, *pairs):
    for number, (source, target) in enumerate(pairs):
        yield work.Task(number, meshes / f"{source}.off", meshes / f"{target}.off", None)


PAPER = {"method": "paper"}


def test_a_killed_worker_loses_nothing(meshes, cache):
    from multiprocessing import active_children

    wanted = [("ant", "bee"), ("ant", "cat"), ("bee", "cat"), ("cat", "dog"), ("dog", "ant")]
    found = {}
    for task, outcome in processes.run(tasks(meshes, *wanted), 2, work.Settings(PAPER, 1, cache)):
        if not found:
            active_children()[0].kill()
        found[task.number] = outcome.record["status"]
    assert found == dict.fromkeys(range(5), "done")
    assert not active_children()


def _dies_at_bees(pipe, settings):
    class Worker(work.Worker):
        def match(self, task):
            if task.source.stem == "bee":
                os._exit(3)
            return super().match(task)

    processes.Worker = Worker
    processes.serve(pipe, settings)


def test_a_pair_that_kills_every_worker_fails_alone(meshes, cache, monkeypatch):
    monkeypatch.setattr(processes, "serve", _dies_at_bees)
    found = {}
    wanted = [("ant", "cat"), ("bee", "cat"), ("cat", "dog")]
    for task, outcome in processes.run(tasks(meshes, *wanted), 2, work.Settings(PAPER, 1, cache)):
        found[task.number] = outcome.record
    assert [found[n]["status"] for n in range(3)] == ["done", "failed", "done"]
    assert found[1]["reason"] == "the worker process ended each time, with status 3"


def test_two_runs_do_not_write_to_one_folder(meshes, cache, tmp_path, capsys):
    from sgmds.locks import try_lock

    path = everyone(meshes, tmp_path)
    path.with_suffix("").mkdir()
    with open(path.with_suffix("") / ".lock", "a+b") as file:
        assert try_lock(file)
        assert main(["batch", str(path), "--cache", str(cache)]) == 1
    assert "another run" in capsys.readouterr().err


# Workers of a scheduler.


@pytest.fixture
def dask_cluster(tmp_path):
    """A scheduler and two workers, processes of their own: address and workers."""
    place = tmp_path / "scheduler.json"
    common = ["--scheduler-file", str(place), "--host", "127.0.0.1", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    python = [sys.executable, "-m"]
    scheduler = subprocess.Popen([*python, "distributed.cli.dask_scheduler", *common, "--port", "0"], **quiet)
    worker = [*python, "distributed.cli.dask_worker", *common, "--nthreads", "1", "--no-nanny"]
    workers = [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        while not place.exists() or not place.read_text():
            assert scheduler.poll() is None
            time.sleep(0.05)
        yield json.loads(place.read_text())["address"], workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def test_a_scheduler_loses_nothing_when_a_worker_is_killed(meshes, cache, tmp_path, reference, dask_cluster):
    address, workers = dask_cluster
    path = everyone(meshes, tmp_path)
    folder = path.with_suffix("")
    process = begin(path, cache, "--scheduler", address)
    wait_for_lines(folder / journal.NAME, 3, process)
    workers[0].send_signal(signal.SIGKILL)
    assert (folder / journal.NAME).read_bytes().count(b"\n") < 12, "nothing was left to do"
    assert process.wait(timeout=120) == 0
    same_report(folder, reference)


def test_what_killed_workers_left_of_maps_is_removed(tmp_path):
    kept = {"a.npz", ".a.npz.note", ".b.npz.01234567", ".a.npz.0000ffff"}
    for name in (*kept, ".a.npz.01234567", ".a.npz.89abcdef"):
        (tmp_path / name).touch()
    np.savez(tmp_path / ".a.npz.0000ffff.npz", results=np.arange(3))
    (tmp_path / ".a.npz.0000ffff.npz").rename(tmp_path / ".a.npz.0000ffff")
    archive.write(tmp_path / ".a.npz.89abcdef", correspondence.FORMAT, 1, faces=np.arange(1000))
    clear_remains([tmp_path / "a.npz", tmp_path / "none" / "b.npz"], correspondence.is_map)
    assert {path.name for path in tmp_path.iterdir()} == kept


def test_what_killed_workers_left_of_a_report_is_removed(tmp_path):
    kept = {".pairs.csv.01234567", ".notes.csv.01234567", ".report.json.note", "pairs.csv"}
    begun = {
        ".pairs.csv.89abcdef": b"sour",
        ".energy.csv.01234567": b"source,ant,cat\n",
        ".distances.png.01234567": b"\x89PNG\r\n\x1a\n\0",
        ".report.json.01234567": b'{\n "pairs": 34,',
        ".report.json.89abcdef": b"",
    }
    for name, content in {**dict.fromkeys(kept, b"of somebody else"), **begun}.items():
        (tmp_path / name).write_bytes(content)
    clear_remains((tmp_path / name for name in report.NAMES), report.is_report)
    assert {path.name for path in tmp_path.iterdir()} == kept


def test_names_are_no_formulas_in_the_tables(meshes, tmp_path, cache):
    """Programs of tables compute a cell that begins with one of four signs, whoever wrote it."""
    names = ["=1+1", "+2", "-3", "@sum", "\n=4", "\uff1d5", "plain"]
    for name in names:
        (tmp_path / f"{name}.off").symlink_to(meshes / "ant.off")
    path = tmp_path / "batch.toml"
    path.write_text("all_against_all = '*.off'\noptions = { method = 'paper' }\n")
    assert main(["batch", str(path), "--cache", str(cache)]) == 0
    for table in ("pairs.csv", "energy.csv"):
        with open(tmp_path / "batch" / table, newline="") as file:
            rows = list(csv.reader(file))
        cells = [cell for row in rows for cell in row]
        assert {f"'{name}" for name in names[:-1]} | {"plain"} <= set(cells)
        # What still begins with a sign is a number.
        assert all(float(cell) < 0 for cell in cells if cell.startswith(tuple("=+-@\n\uff1d")))


@pytest.mark.parametrize("name", ["pairs.csv", "distances.png", "report.json", "maps/ant--bee.npz"])
def test_files_of_others_are_not_replaced(meshes, cache, tmp_path, capsys, name):
    path = everyone(meshes, tmp_path)
    place = path.with_suffix("") / name
    place.parent.mkdir(parents=True)
    place.write_text("mine")
    assert main(["batch", str(path), "--cache", str(cache)]) == 1
    assert f"{place}: is there" in capsys.readouterr().err and place.read_text() == "mine"


@pytest.mark.parametrize("name", ["journal.jsonl", "runs.jsonl"])
@pytest.mark.parametrize("option", ["--resume", "--overwrite"])
def test_a_journal_of_others_is_left_alone(meshes, cache, tmp_path, capsys, name, option):
    path = everyone(meshes, tmp_path)
    place = path.with_suffix("") / name
    place.parent.mkdir()
    place.write_text('{"day": 1}\n')
    assert main(["batch", str(path), option, "--cache", str(cache)]) == 1
    assert str(place) in capsys.readouterr().err and place.read_text() == '{"day": 1}\n'
    assert [found.name for found in place.parent.iterdir() if found.name != ".lock"] == [name]


def test_a_missing_package_is_named_with_its_extra(meshes, cache, tmp_path, capsys, monkeypatch):
    path = everyone(meshes, tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["batch", str(path), "--scheduler", "tcp://127.0.0.1:1", "--cache", str(cache)]) == 1
    assert 'distributed is missing: pip install ".[batch]"' in capsys.readouterr().err


def test_a_package_that_the_report_needs_is_missed_at_the_start(meshes, cache, tmp_path, capsys, monkeypatch):
    path = everyone(meshes, tmp_path)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["batch", str(path), "--cache", str(cache)]) == 1
    words = 'pip install ".[tools]" in a clone of the repository'
    assert capsys.readouterr().err == f"sgmds: matplotlib is missing: {words}\n"
    assert not path.with_suffix("").exists()


@pytest.mark.parametrize(
    ("address", "is_refused"),
    [
        ("tcp://10.0.0.7:8786", True),
        ("farm.example:8786", True),
        ("ws://farm.example", True),
        ("ucx://[2001:db8::1]:8786", True),
        ("tcp://localhost.example:8786", True),
        ("tls://farm.example:8786", False),
        ("tcp://127.0.0.1:8786", False),
        ("localhost:8786", False),
        ("tcp://[::1]:8786", False),
    ],
)
def test_an_open_scheduler_of_another_machine_is_refused(address, is_refused):
    from sgmds.batch.scheduler import check_address

    check_address(address, insecure=True)
    if is_refused:
        with pytest.raises(sgmds.ArgumentError, match="not encrypted.*tls://.*--insecure"):
            check_address(address, insecure=False)
    else:
        check_address(address, insecure=False)


@pytest.mark.parametrize("address", ["", "  ", "tls://", "tcp://"])
def test_no_address_is_no_scheduler(address):
    from sgmds.batch.scheduler import check_address

    for insecure in (True, False):
        with pytest.raises(sgmds.ArgumentError, match=r"like tls://HOST:8786, got '"):
            check_address(address, insecure)


def test_an_open_scheduler_is_refused_before_any_work(meshes, cache, tmp_path, capsys):
    path = everyone(meshes, tmp_path)
    assert main(["batch", str(path), "--scheduler", "tcp://10.0.0.7:8786", "--cache", str(cache)]) == 1
    assert "not encrypted" in capsys.readouterr().err and not path.with_suffix("").exists()


def test_no_scheduler_is_one_line(meshes, cache, tmp_path, capsys, monkeypatch):
    from sgmds.batch import scheduler

    monkeypatch.setattr(scheduler, "CONNECT_SECONDS", 0.5)
    path = everyone(meshes, tmp_path)
    arguments = ["batch", str(path), "--scheduler", "tcp://127.0.0.1:1", "--cache", str(cache)]
    assert main(arguments) == 1
    assert "no scheduler answers" in capsys.readouterr().err


@pytest.mark.parametrize("address", ["tls://127.0.0.1:1", "tcp://localhost"])
def test_an_address_that_cannot_be_used_is_one_line_and_leaves_no_results(meshes, cache, tmp_path, address):
    """Certificates or the port are missing. A process of its own tells at its end of what it forgets."""
    path = everyone(meshes, tmp_path)
    command = [sys.executable, "-m", "sgmds.command", "batch", path, "--cache", cache, "--scheduler", address]
    for _ in range(2):
        # The second time too, as nothing was done that could be taken up.
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert done.returncode == 1 and done.stderr.startswith(f"sgmds: no scheduler answers at {address}: ")
        assert done.stderr.count("\n") == 1, done.stderr


# Manifests.

EVERYONE = "all_against_all = '*.off'\n"
PAIR = "[[pairs]]\nsource = 'ant.off'\ntarget = 'bee.off'\n"


def read(tmp_path, text, **more):
    path = tmp_path / "batch.toml"
    path.write_text(text)
    return manifest.read(path, **more)


@pytest.mark.filterwarnings("error:Glyph")
@pytest.mark.parametrize("name", ["a$\\bad{$b", "モデル", "a\x1b\nb"])
def test_a_name_of_any_letters_is_in_tables_and_picture(meshes, cache, tmp_path, capfd, name):
    (tmp_path / f"{name}.off").write_bytes((meshes / "bee.off").read_bytes())
    path = tmp_path / "some.toml"
    path.write_text(f'all_against_all = ["{meshes}/ant.off", "*.off"]\noptions.method = "paper"')
    assert main(["batch", str(path), "--jobs", "1", "--cache", str(cache)]) == 0
    assert capfd.readouterr().err == ""
    assert {row["source"] for row in table(tmp_path / "some" / "pairs.csv")} == {"ant", name}
    assert (tmp_path / "some" / "distances.png").stat().st_size > 1000


def test_a_name_that_is_no_text_is_refused(meshes, tmp_path, capsys):
    place = os.fsencode(tmp_path) + b"/a\xffb.off"
    Path(os.fsdecode(place)).write_bytes((meshes / "bee.off").read_bytes())
    path = tmp_path / "some.toml"
    path.write_text(f'all_against_all = ["{meshes}/ant.off", "*.off"]')
    assert main(["batch", str(path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "a\\xdcffb.off: has a name that is no UTF-8: rename it" in line


def test_names_that_move_the_cursor_stay_in_the_line_of_a_failure(meshes, cache, tmp_path, capsys):
    (tmp_path / "red\x1b[31m\nbad.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    path = tmp_path / "some.toml"
    path.write_text(f'all_against_all = ["{meshes}/ant.off", "red*.off"]\noptions.method = "paper"')
    assert main(["batch", str(path), "--jobs", "1", "--cache", str(cache)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and not any("\x1b" in line for line in lines)
    assert sum("red\\x1b[31m bad.off" in line for line in lines) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("all_against_all = [", "not a TOML file"),
        ("all_against_all = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("a" + ".a" * 200_000 + " = 1", "toml: not a manifest: line 1 has a key of more than 20 parts"),
        ("\n[" + "'a' . " * 200_000 + "a]", "line 2 has a key of more than 20 parts"),
        (PAIR + "landmarks = [[" + "9" * 5000 + ", 1]]", "not a TOML file: .*integer"),
        ('output = "\\u0000"\n' + EVERYONE, "no name of a file"),
        (EVERYONE + 'maps = "\\u0000{source}{target}.npz"', "no name of a file"),
        (f"all_against_all = '{'a' * 100_000}.off'", "all_against_all: File name too long"),
        ("#" * 10_000_001, "10,000,001 bytes, at most 10,000,000 are read"),
        ("", "nothing to do"),
        ("everybody = '*.off'", "unknown key 'everybody'"),
        ("all_against_all = 3", "cannot be 3"),
        ("all_against_all = '*.nothing'", "no mesh file is named"),
        ("all_against_all = 'ant.off'", "at least two"),
        ("all_against_all = '*.off'\noptions.method = 'best'", "should be one of"),
        ("all_against_all = '*.off'\nmaps = 'all.npz'", "one map each"),
        ("all_against_all = '*.off'\nmaps = '{source}-{target}-{time}.npz'", "only"),
        ("all_against_all = '*.off'\nmaps = '{source}-{target}.txt'", "end with .npz"),
        ("all_against_all = '*.off'\nmaps = '../{source}-{target}.npz'", "leads out"),
        ("all_against_all = '*.off'\nmaps = '/tmp/{source}-{target}.npz'", "leads out"),
        ("all_against_all = '*.off'\noutput = '../elsewhere'", "leads out"),
        ("[[pairs]]\nsource = 'ant.off'", "lacks 'target'"),
        ("[[pairs]]\nsource = 'ant.off'\ntarget = '*.off'\nlandmarks = [[1, 2]]", "not to patterns"),
        ("[[pairs]]\nsource = 'ant.off'\ntarget = 'bee.off'\nlandmarks = [[1, 'x']]", "landmarks are"),
        ("[[pairs]]\nsource = 'ant.off'\ntarget = 'bee.off'\nmap = '../../x.npz'", "leads out"),
        (EVERYONE + "maps = '../../{source}--{target}.npz'\n" + PAIR + "map = 'own.npz'", "leads out"),
        (EVERYONE + PAIR + "map = 'maps/bee--ant.npz'", "two maps would be written"),
        ("[[pairs]]\nsource = 'ant.off'\ntarget = 'ant.off'", "itself"),
        ("all_against_all = '*.off'\nmaps = '{source.name}-{target}.npz'", "only"),
        (2 * (PAIR + "landmarks = [[1, 2]]\n") + PAIR, "ant to bee is listed twice"),
        ("options = { method = 'paper', same_axes = true }\n" + PAIR, "`same_axes` is for the method"),
        ("options.method = 'paper'\n" + PAIR + "landmarks = [[1, 2]]", "`landmarks` is for the method"),
    ],
)
def test_a_wrong_manifest_is_told_in_words(tmp_path, text, words):
    for name in ("ant", "bee"):
        (tmp_path / f"{name}.off").write_text("OFF")
    with pytest.raises(sgmds.ArgumentError, match=words) as caught:
        read(tmp_path, text)
    assert str(caught.value).count("batch.toml") == 1


def test_what_is_no_manifest_is_told_in_words(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sgmds.ArgumentError, match="^nope.toml: no such file; see docs/batch.md$"):
        manifest.read("nope.toml")
    with pytest.raises(sgmds.ArgumentError, match="is a folder"):
        manifest.read(tmp_path)


def test_a_link_does_not_lead_out(tmp_path):
    for name in ("ant", "bee"):
        (tmp_path / f"{name}.off").write_text("OFF")
    outside = tmp_path.parent / "outside"
    outside.mkdir(exist_ok=True)
    (tmp_path / "batch").mkdir()
    (tmp_path / "batch" / "maps").symlink_to(outside)
    with pytest.raises(sgmds.ArgumentError, match="leads out"):
        read(tmp_path, "all_against_all = '*.off'")
    assert len(read(tmp_path, "all_against_all = '*.off'", anywhere=True)) == 2


def test_links_that_lead_in_circles_are_not_followed(tmp_path):
    """Two of them have as many ways through as there are numbers of forty digits in base two."""
    (tmp_path / "below" / "further").mkdir(parents=True)
    (tmp_path / "here").symlink_to(".")
    (tmp_path / "below" / "up").symlink_to("..")
    for place in ("ant", "below/bee", "below/further/cat", "below/further/.dog"):
        (tmp_path / f"{place}.off").write_text("OFF")
    for pattern, count in (
        ("**/*.off", 3),
        ("**", 3),
        ("**/**/*.off", 3),
        ("below/**", 2),
        ("bel*/**/c*.off", 1),
    ):
        batch = read(tmp_path, f"all_against_all = ['ant.off', '{pattern}']")
        assert len(batch.shapes) == count + (count < 3), pattern


def test_no_two_pairs_have_one_map(tmp_path):
    """Names that hold what is between names: a--b to c and a to b--c."""
    for name in ("a", "a--b", "b--c", "c", "a1"):
        (tmp_path / f"{name}.off").write_text("OFF")
    everyone = "all_against_all = '*.off'"
    for text in (everyone, "maps = '{target}--{source}.npz'\n" + everyone):
        with pytest.raises(sgmds.ArgumentError, match=r"two maps would be written to \S+--\S+--\S+\.npz"):
            read(tmp_path, text)
    other = "[[pairs]]\nsource = 'a.off'\ntarget = 'b--c.off'\nmap = 'other.npz'\n"
    for text in (
        "maps = false\n" + everyone,
        "maps = '{source}/{target}.npz'\n" + everyone,
        f"{everyone}\n{other}",
    ):
        batch = read(tmp_path, text)
        maps = [batch.pair(number).map for number in range(len(batch))]
        assert len(maps) == 20 and (None in maps or len(set(maps)) == 20)
    # One that is listed beside all against all of others.
    beside = "[[pairs]]\nsource = 'a--b.off'\ntarget = 'c.off'\n"
    with pytest.raises(sgmds.ArgumentError, match="two maps would be written to"):
        read(tmp_path, f"all_against_all = ['a.off', 'b--c.off']\n{beside}")


def test_files_of_one_name_get_their_folders(tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "body.off").write_text("OFF")
    batch = read(tmp_path, "all_against_all = '**/*.off'")
    assert [shape.name for shape in batch.shapes] == ["one+body", "two+body"]
    (tmp_path / "one" / "body.obj").write_text("")
    with pytest.raises(sgmds.ArgumentError, match="several files"):
        read(tmp_path, "all_against_all = '**/body.*'")


def imagined(everyone, listed=()):
    shapes = [ShapeFile(f"s{i}", Path(f"s{i}.off"), f"{i:032x}") for i in range(everyone + 3)]
    return Batch(Path("nowhere"), shapes, {}, None, everyone, [Pair(*ends, None) for ends in listed])


@given(st.integers(2, 40), st.booleans())
def test_numbering_is_one_to_one_property(everyone, more):
    listed = [(everyone, 0), (everyone + 2, everyone + 1)] if more else []
    batch = imagined(everyone, listed)
    assert sorted(batch.order()) == list(range(len(batch)))
    ends = [(p.source, p.target) for p in map(batch.pair, range(len(batch)))]
    assert len(set(ends)) == len(ends) == everyone * (everyone - 1) + len(listed)
    assert all(s != t for s, t in ends)
    assert [batch.number(s, t) for s, t in ends] == list(range(len(batch)))
    assert batch.number(0, everyone + 2) is None


def test_memory_does_not_grow_with_the_pairs(tmp_path):
    def peak(shapes):
        batch = imagined(shapes)
        batch.folder = tmp_path
        tracemalloc.start()
        with journal.Journal(batch) as kept:
            # As if every second pair were done.
            for number in range(0, len(batch), 2):
                kept._places[number] = 100 * number
            assert sum(kept._places[number] is None for number in batch.order()) == len(batch) // 2
            found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    # 9,900 pairs and nine times as many of three times the shapes.
    few, many = peak(100), peak(300)
    assert many < 3 * few


def test_a_terminal_shows_pairs_done_and_time_left(meshes, cache, tmp_path):
    """The bar itself, by a pseudo-terminal of 100 columns."""
    pty = pytest.importorskip("pty")
    import fcntl
    import struct
    import termios

    path = everyone(meshes, tmp_path, maps=False)
    try:
        ours, theirs = pty.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminal here: {error}")
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "sgmds.cli", "batch", str(path), "--jobs", "2", "--cache", str(cache)],
        stderr=theirs,
        stdout=subprocess.DEVNULL,
    )
    os.close(theirs)
    shown = b""
    try:
        while part := os.read(ours, 4096):
            shown += part
    except OSError:
        # How Linux tells that the other side was closed.
        pass
    os.close(ours)
    assert process.wait() == 0
    states = re.findall(r"(\d+) of 12 pairs [^\r]* (\d+) %  \d\d:\d\d gone, (\S+) left", shown.decode())
    done = [int(count) for count, _, _ in states]
    assert done == sorted(done) and done[-1] == 12 and states[-1][1:] == ("100", "00:00")
    assert any(0 < int(count) < 12 and re.fullmatch(r"\d\d:\d\d", left) for count, _, left in states)
