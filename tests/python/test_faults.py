"""What goes wrong around a match: the disk, the file, the process, the user who changes their mind.

`HYPOTHESIS_PROFILE=long` repeats what is random a thousand times.
"""

import os
import resource
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import sgmds
from hypothesis import given
from hypothesis import strategies as st
from sgmds import _core, characters, correspondence, memory, shape

LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"


@pytest.fixture(scope="module")
def small():
    """Two poses of a body of 600 vertices, prepared: so alike that one search is enough."""
    made = [
        characters.make("biped", "slender", pose, resolution=600, seed=seed)
        for seed, pose in enumerate(["wave", "walk"])
    ]
    return [sgmds.Shape(m.vertices, m.faces) for m in made]


@pytest.fixture(scope="module")
def corr(small):
    return sgmds.match(*small)


def same(first, second):
    return all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("faces", "barycentric", "vertices", "confidence")
    )


def run(code, *arguments):
    return subprocess.run([sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True)


# ---- files


@pytest.mark.parametrize("kind", ["map", "shape"])
def test_full_disk_leaves_the_previous_file(kind, small, corr, tmp_path):
    """A limit on the size of files stands for the full disk: the write ends with an error in the middle."""
    path = tmp_path / "kept.npz"
    (corr if kind == "map" else small[0]).save(path)
    before = path.read_bytes()
    code = """
import resource, sys, sgmds
path, kind = sys.argv[1:]
thing = (sgmds.Correspondence if kind == "map" else sgmds.Shape).load(path)
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
try:
    thing.save(path)
except OSError as error:
    print("told:", error)
"""
    done = run(code, path, kind)
    assert done.stdout.startswith("told:"), done.stderr
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["kept.npz"]


def test_folder_that_cannot_be_written(corr, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    for path in ("/proc/map.npz", tmp_path / "none" / "map.npz", tmp_path / "file" / "map.npz"):
        with pytest.raises(OSError) as told:
            corr.save(path)
        assert told.value.filename == str(path)


def test_killed_in_mid_write(corr, tmp_path):
    """Whenever a writing process is killed, the file is there and whole."""
    path = tmp_path / "map.npz"
    corr.save(path)
    code = """
import sys, sgmds
found = sgmds.Correspondence.load(sys.argv[1])
print("ready", flush=True)
while True:
    found.save(sys.argv[1])
"""
    random = np.random.default_rng(0)
    for _ in range(100 if LONG else 8):
        writer = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
        writer.stdout.readline()
        time.sleep(random.uniform(0, 0.05))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        assert same(sgmds.Correspondence.load(path), corr)


@pytest.fixture(scope="module")
def stored(small, corr, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    corr.save(folder / "map.npz")
    small[0].save(folder / "shape.npz")
    return folder


@given(data=st.data())
def test_property_damaged_files_are_refused_or_unharmed(stored, corr, small, data):
    name = data.draw(st.sampled_from(["map.npz", "shape.npz"]))
    content = bytearray((stored / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(["change", "cut", "insert", "zero"])):
            case "change":
                content[at] = data.draw(st.integers(0, 255))
            case "cut":
                del content[at : at + data.draw(st.integers(1, 2000))]
            case "insert":
                content[at:at] = data.draw(st.binary(min_size=1, max_size=20))
            case "zero":
                content[at : at + 500] = bytes(len(content[at : at + 500]))
        if not content:
            break
    path = stored / f"damaged-{name}"
    path.write_bytes(content)
    try:
        if name == "map.npz":
            assert same(sgmds.Correspondence.load(path), corr)
        else:
            assert np.array_equal(sgmds.Shape.load(path).eigenvalues, small[0].eigenvalues)
    except sgmds.InternalError:
        raise
    except sgmds.SgmdsError as error:
        assert str(path) in str(error)


def test_other_kinds_and_versions_are_refused(stored, tmp_path, monkeypatch, corr, small):
    with pytest.raises(sgmds.SgmdsError, match="not a sgmds-shape file"):
        sgmds.Shape.load(stored / "map.npz")
    with pytest.raises(sgmds.SgmdsError, match="not a sgmds-correspondence file"):
        sgmds.Correspondence.load(stored / "shape.npz")
    for module, thing in ((correspondence, corr), (shape, small[0])):
        for step, word in ((1, "newer"), (-1, "older")):
            path = tmp_path / f"{word}.npz"
            with monkeypatch.context() as patch:
                patch.setattr(module, "VERSION", module.VERSION + step)
                thing.save(path)
            with pytest.raises(sgmds.SgmdsError, match=f"of an? {word} version") as refusal:
                type(thing).load(path)
            assert "damaged" not in str(refusal.value)


def test_older_layout_is_called_old_not_damaged(tmp_path, small):
    """A file of the first version, which lacked what is stored now."""
    path = tmp_path / "first.npz"
    np.savez(path, format="sgmds-shape", version=1, vertices=small[0].vertices, faces=small[0].faces)
    with pytest.raises(sgmds.SgmdsError, match="of an older version"):
        sgmds.Shape.load(path)


def test_nothing_in_a_file_is_executed(tmp_path):
    """An array of Python objects is a pickle, which runs code when read: it is refused unread."""

    class Bomb:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "executed"),)

    path = tmp_path / "bomb.npz"
    np.savez(path, format="sgmds-correspondence", version=1, faces=np.array([Bomb()], dtype=object))
    for kind in (sgmds.Correspondence, sgmds.Shape):
        with pytest.raises(sgmds.SgmdsError, match="pickle"):
            kind.load(path)
    assert not (tmp_path / "executed").exists()


DAMAGE = {
    "vertices": [lambda a: a + 10**6, lambda a: a - 10**6, lambda a: a * 0.3],
    "faces": [lambda a: a + 10**6, lambda a: a + 0.5, lambda a: a[:, None]],
    "barycentric": [
        lambda a: a * np.nan,
        lambda a: 2 * a,
        lambda a: a[:, ::-1] * (-1, 1, 1),
        lambda a: a[:-1],
    ],
    "confidence": [lambda a: a * np.nan, lambda a: a + 7, lambda a: a - 7, lambda a: np.full(len(a), "sure")],
    "grade": [lambda a: np.array("purple")],
    "reasons": [lambda a: np.array("one")],
    "functional_map": [lambda a: a[0], lambda a: a * np.nan, lambda a: np.array("none")],
    "triangles": [lambda a: a[:, :2], lambda a: a[:, [0, 1, 2, 2]], lambda a: a + 10**6, lambda a: a - 1],
    "source_count": [lambda a: np.array([a, a]), lambda a: np.array("many"), lambda a: np.array(3)],
}


@pytest.mark.parametrize(
    ("name", "number"), [(name, k) for name, changes in DAMAGE.items() for k in range(len(changes))]
)
def test_a_map_that_breaks_a_promise_is_refused(stored, tmp_path, name, number):
    with np.load(stored / "map.npz") as file:
        arrays = dict(file)
    arrays[name] = DAMAGE[name][number](arrays[name])
    np.savez(tmp_path / "map.npz", **arrays)
    with pytest.raises(sgmds.SgmdsError, match="map.npz: damaged"):
        sgmds.Correspondence.load(tmp_path / "map.npz")


# ---- memory


def test_what_cannot_fit_is_refused_with_the_numbers(small, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 300_000_000)
    side = 400
    i, j = (x.ravel() for x in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    sheet = np.stack([i, j, 0 * i], axis=1) / side
    cell = (i * side + j)[(i < side - 1) & (j < side - 1)]
    lower = np.stack([cell, cell + side, cell + side + 1], axis=1)
    upper = np.stack([cell, cell + side + 1, cell + 1], axis=1)
    large = sheet, np.concatenate([lower, upper])
    for call in (lambda: sgmds.Shape(*large), lambda: sgmds.match(small[0], large)):
        with pytest.raises(
            sgmds.NotEnoughMemory, match=r"160,000 vertices needs about 0\.4 GB, 0\.3 GB are free"
        ):
            call()
    with pytest.raises(MemoryError):
        sgmds.Shape(*large)


def test_a_file_that_unpacks_to_too_much_is_refused(corr, tmp_path, monkeypatch):
    path = tmp_path / "bomb.npz"
    corr.save(path)
    with np.load(path) as file:
        arrays = dict(file)
    arrays["barycentric"] = np.zeros((5_000_000, 3))
    np.savez_compressed(path, **arrays)
    assert path.stat().st_size < 1e6
    monkeypatch.setattr(memory, "available", lambda: 100_000_000)
    with pytest.raises(sgmds.NotEnoughMemory, match=r"bomb.npz: unpacks to 0\.1 GB, 0\.1 GB are free"):
        sgmds.Correspondence.load(path)


def test_what_is_dropped_needs_no_memory(small, monkeypatch):
    """Loose triangles, a fiftieth of what is seen, that would not fit, were they prepared."""
    monkeypatch.setattr(memory, "available", lambda: 300_000_000)
    n = len(small[0].vertices)
    random = np.random.default_rng(0)
    confetti = random.normal(size=(100_000, 1, 3)) + 6e-4 * random.normal(size=(100_000, 3, 3))
    vertices = np.concatenate([small[0].vertices, confetti.reshape(-1, 3)])
    faces = np.concatenate([small[0].faces, n + np.arange(300_000).reshape(-1, 3)])
    own = small[0].report["dropped_components"]
    assert sgmds.Shape(vertices, faces).report["dropped_components"] == own + 100_000


def test_available_memory_is_plausible():
    physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    assert 0 < memory.available() <= physical


def test_estimate_covers_what_a_match_takes():
    """Peak of the process while two bodies are prepared and matched, against the two estimates."""
    code = """
import sgmds
from sgmds import characters, _core
made = [characters.make("biped", build, "wave", resolution=6000) for build in ("slender", "stout")]
def status(entry):
    return next(int(l.split()[1]) * 1024 for l in open("/proc/self/status") if l.startswith(entry))
before = status("VmRSS")
open("/proc/self/clear_refs", "w").write("5")
sgmds.match(*((m.vertices, m.faces) for m in made))
sizes = [(len(m.vertices), len(m.faces)) for m in made]
estimate = _core.memory_to_prepare(sizes) + _core.memory_to_match(*(s[0] for s in sizes))
print(status("VmHWM") - before, estimate)
"""
    done = run(code)
    assert done.returncode == 0, done.stderr
    peak, estimate = map(int, done.stdout.split())
    # An estimate far above would refuse what fits.
    assert peak < estimate < 5 * peak


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def test_many_matches_in_flat_memory(small, corr):
    """A thousand in the long run."""
    for _ in range(2):
        sgmds.match(*small)
    before = resident()
    for _ in range(1000 if LONG else 6):
        again = sgmds.match(*small)
    assert same(again, corr)
    # A result is 50 kB; the allocator's own ups and downs are some megabytes.
    assert resident() - before < 20e6


# ---- the user


def test_cancelling_anywhere_ends_at_once_and_leaves_nothing(small, corr):
    """At a random moment each time, a thousand times in the long run."""
    raw = [(s.vertices, s.faces) for s in small]
    started = time.perf_counter()
    sgmds.match(*raw)
    seconds = time.perf_counter() - started
    random = np.random.default_rng(0)
    threads, before = threading.active_count(), resident()
    cancelled = 0
    for _ in range(1000 if LONG else 10):
        stop = time.perf_counter() + random.uniform(0, seconds)
        try:
            sgmds.match(*raw, progress=lambda stage, fraction, stop=stop: time.perf_counter() < stop)
        except sgmds.Cancelled:
            cancelled += 1
    assert cancelled > 0
    assert threading.active_count() == threads
    assert resident() - before < 30e6
    assert same(sgmds.match(*small), corr)


def test_an_exception_in_the_progress_function_comes_through(small):
    def fails(stage, fraction):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        sgmds.match(*small, progress=fails)


def test_two_matches_at_once(small, corr):
    found = {}
    jobs = [
        threading.Thread(target=lambda i=i: found.update({i: sgmds.match(*small, threads=1 + i % 2)}))
        for i in range(4)
    ]
    for job in jobs:
        job.start()
    for job in jobs:
        job.join(120)
    assert len(found) == 4 and all(same(f, corr) for f in found.values())


def test_interpreter_closed_in_mid_run(small, tmp_path):
    """The program that owns the process may end while a match runs on a thread of its own."""
    small[0].save(tmp_path / "shape.npz")
    code = """
import sys, threading, time, sgmds
shape = sgmds.Shape.load(sys.argv[1])
def forever():
    while True:
        sgmds.match(shape, shape)
threading.Thread(target=forever, daemon=True).start()
time.sleep(0.3)
print("closing")
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "shape.npz")], capture_output=True, timeout=60
    )
    assert done.stdout == b"closing\n" and done.returncode == 0, done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system starts every process anew")
def test_forked_processes_work_after_the_first_has_worked(small, tmp_path):
    """multiprocessing.Pool forks on Linux: the children have none of the threads that the parent started."""
    small[0].save(tmp_path / "shape.npz")
    code = """
import multiprocessing, sys, sgmds
shape = sgmds.Shape.load(sys.argv[1])
expected = sgmds.match(shape, shape).vertices.sum()
def work(_):
    mesh = shape.vertices, shape.faces
    return sgmds.match(shape, sgmds.Shape(*mesh)).vertices.sum() == expected
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(pool.map_async(work, range(2)).get(60))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "shape.npz")], capture_output=True, text=True, timeout=90
    )
    assert done.stdout == "[True, True]\n", done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="a limit that Linux keeps")
def test_threads_that_the_system_does_not_start_are_told_of():
    """Room for three stacks of 300 MB, and for what threads that were started still need: where that is
    missing, the C library ends the process."""
    code = """
import os, resource, numpy as np, sgmds
from pathlib import Path
os.environ["RUST_MIN_STACK"] = str(300 * 2**20)
pages = int(Path("/proc/self/statm").read_text().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + 2**30, -1))
try:
    sgmds.Shape(np.eye(4, 3), [[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]], threads=1000)
except sgmds.ArgumentError as error:
    print(error)
"""
    done = run(code)
    assert "starts no more threads" in done.stdout and "set `threads` lower" in done.stdout, done.stderr


def test_a_panic_names_the_stage():
    with pytest.raises(sgmds.InternalError, match="internal error during selection: provoked; please report"):
        _core.provoke_panic()
    # The library still works.
    assert _core.memory_to_match(1, 1) > 0
