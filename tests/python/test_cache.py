"""The cache of prepared shapes: the same shapes, once, within its size, from several processes, whole or not
at all."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import sgmds
from sgmds.cache import ShapeCache, default_folder, mesh_key


@pytest.fixture(scope="module")
def bodies(sphere):
    """Three small closed meshes that differ: stretched spheres."""
    vertices, faces = sphere
    return [(vertices * stretch, faces) for stretch in ((1, 1.2, 1.5), (1, 1.3, 1.6), (1, 1.4, 1.7))]


def equal(one, other):
    names = ("vertices", "faces", "eigenvalues", "eigenfunctions", "mass", "geodesics", "distance_operator")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_a_kept_shape_is_the_prepared_one(bodies, tmp_path):
    cache = ShapeCache(tmp_path)
    made, kept = cache.shape(*bodies[0]), cache.shape(*bodies[0])
    assert (cache.misses, cache.hits) == (1, 1)
    assert equal(made, kept) and equal(made, sgmds.Shape(*bodies[0]))


def test_a_kept_shape_matches_as_a_prepared_one(bodies, tmp_path):
    cache = ShapeCache(tmp_path)
    source, target = cache.shape(*bodies[0]), cache.shape(*bodies[1])
    fresh = sgmds.match(source, target)
    again = sgmds.match(cache.shape(*bodies[0]), cache.shape(*bodies[1]))
    for name in ("faces", "barycentric", "confidence", "functional_map"):
        assert np.array_equal(getattr(fresh, name), getattr(again, name))
    assert fresh.quality == again.quality


def test_key_is_the_content(bodies):
    vertices, faces = bodies[0]
    key = mesh_key(vertices, faces)
    assert key == mesh_key(np.asfortranarray(vertices), faces.astype(np.int32))
    moved = vertices.copy()
    moved[7, 1] = np.nextafter(moved[7, 1], 2)
    assert key != mesh_key(moved, faces)
    assert key != mesh_key(vertices, np.roll(faces, 1, axis=1))


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other mesh", "not ours"])
def test_damage_is_noticed_and_mended(bodies, tmp_path, damage):
    cache = ShapeCache(tmp_path)
    good = cache.shape(*bodies[0])
    (entry,) = cache.entries()
    content = bytearray(entry.read_bytes())
    if damage == "cut":
        entry.write_bytes(content[:-1000])
    elif damage == "flip":
        content[len(content) // 2] ^= 1
        entry.write_bytes(content)
    elif damage == "empty":
        entry.write_bytes(b"")
    elif damage == "other mesh":
        sgmds.Shape(*bodies[1]).save(entry)
    else:
        np.savez(entry, something=np.arange(3))
    with pytest.warns(RuntimeWarning, match="again"):
        mended = cache.shape(*bodies[0])
    assert equal(good, mended) and cache.damaged == 1
    assert equal(good, cache.shape(*bodies[0])) and cache.hits == 1


def test_size_is_bounded_and_the_oldest_go_first(bodies, tmp_path):
    ShapeCache(tmp_path).shape(*bodies[0])
    size = ShapeCache(tmp_path).entries()[0].stat().st_size
    cache = ShapeCache(tmp_path, limit=int(2.5 * size))
    cache.shape(*bodies[1])
    for age, path in enumerate(reversed(cache.entries())):
        os.utime(path, (time.time() - 100 * (age + 1),) * 2)
    cache.shape(*bodies[0])
    cache.shape(*bodies[2])
    kept = {path.stem for path in cache.entries()}
    assert kept == {mesh_key(*bodies[0]), mesh_key(*bodies[2])}
    assert sum(path.stat().st_size for path in cache.entries()) <= cache.limit
    cache.clear()
    assert cache.entries() == []


def test_left_over_temporary_files_go(bodies, tmp_path):
    for name, age in ((".dead.npz.x1", 7200), (".busy.npz.x2", 0)):
        (tmp_path / name).write_bytes(b"half")
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    ShapeCache(tmp_path).shape(*bodies[0])
    assert not (tmp_path / ".dead.npz.x1").exists() and (tmp_path / ".busy.npz.x2").exists()


def test_without_a_place_the_shape_comes_all_the_same(bodies, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    cache = ShapeCache(tmp_path / "file")
    with pytest.warns(RuntimeWarning, match="cannot be kept"):
        shape = cache.shape(*bodies[0])
    assert cache.misses == 1 and shape.eigenvalues.size


def _ask(folder, mesh, start, results):
    start.wait()
    cache = ShapeCache(folder)
    shape = cache.shape(*mesh)
    results.put((cache.misses, cache.hits, shape.eigenvalues.tobytes()))


def test_several_processes_prepare_a_shape_once(bodies, tmp_path):
    context = multiprocessing.get_context("spawn")
    start, results = context.Barrier(3), context.Queue()
    asking = [context.Process(target=_ask, args=(tmp_path, bodies[0], start, results)) for _ in range(3)]
    for process in asking:
        process.start()
    told = [results.get(timeout=60) for _ in asking]
    for process in asking:
        process.join()
    assert sum(misses for misses, _, _ in told) == 1 and sum(hits for _, hits, _ in told) == 2
    assert len({values for _, _, values in told}) == 1


def test_a_killed_process_leaves_no_lock(bodies, tmp_path):
    code = (
        "import sys, time; from sgmds.cache import ShapeCache; "
        f"lock = ShapeCache({str(tmp_path)!r})._acquire({mesh_key(*bodies[0])[:2]!r}, None); "
        "print('held', flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert holder.stdout.readline() == "held\n"
    stages = []

    def give_up(stage, _fraction):
        stages.append(stage)
        return False

    with pytest.raises(sgmds.Cancelled):
        ShapeCache(tmp_path).shape(*bodies[0], progress=give_up)
    assert stages == ["waiting for the cache"]
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    holder.stdout.close()
    assert ShapeCache(tmp_path).shape(*bodies[0]).eigenvalues.size


def test_default_folder_can_be_named(monkeypatch, tmp_path):
    monkeypatch.setenv("SGMDS_CACHE", str(tmp_path))
    assert default_folder() == tmp_path
