"""The cache of prepared shapes: the same shapes, once, within its size, from several processes, whole or not
at all."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
import warnings

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


DAMAGES = ["cut", "flip", "head", "empty", "other mesh", "other arrays", "not ours"]


@pytest.mark.parametrize("damage", DAMAGES)
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
    elif damage == "head":
        content[:200] = bytes(200)
        entry.write_bytes(content)
    elif damage == "other arrays":
        # Whole and of the right mesh, but not what was computed of it.
        with np.load(entry) as held:
            arrays = dict(held)
        arrays["values"] = arrays["values"] * 1.1
        np.savez(entry, **arrays)
    elif damage == "empty":
        entry.write_bytes(b"")
    elif damage == "other mesh":
        sgmds.Shape(*bodies[1]).save(entry)
    else:
        np.savez(entry, something=np.arange(3))
    damaged = entry.read_bytes()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        mended = cache.shape(*bodies[0])
    assert "again" in str(told[0].message)
    # What does not begin as an entry is somebody's, even under an entry's name.
    aside = [path.read_bytes() for path in cache.folder.glob("*.aside")]
    assert aside == ([damaged] if damage in ("head", "empty", "not ours") else [])
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
    sizes = [path.stat().st_size for path in cache.entries()]
    assert sum(sizes) <= cache.limit
    assert cache.clear() == sum(sizes)
    assert cache.entries() == []


def test_left_over_temporary_files_go(bodies, tmp_path):
    cache = ShapeCache(tmp_path)
    cache.shape(*bodies[0])
    (entry,) = cache.entries()
    half = entry.read_bytes()[:5000]
    key = entry.name
    left = {
        f".{key}.0123abcd": (half, 7200, True),
        f".{key}.0123abce": (b"", 7200, True),
        f".{key}.0123abcf": (half, 0, False),
        f".{key}.0123abc0": (b"somebody's", 7200, False),
        ".map.npz.0123abcd": (half, 7200, False),
    }
    for name, (content, age, _) in left.items():
        (cache.folder / name).write_bytes(content)
        os.utime(cache.folder / name, (time.time() - age,) * 2)
    cache.shape(*bodies[1])
    assert {name for name in left if not (cache.folder / name).exists()} == {
        name for name, (_, _, goes) in left.items() if goes
    }


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def with_others(bodies, tmp_path):
    """A chosen folder that holds files of the user, with names and contents like those of the cache."""
    shape = sgmds.Shape(*bodies[2])
    for folder in (tmp_path, tmp_path / "sgmds-shapes"):
        folder.mkdir(exist_ok=True)
        np.savez(folder / "results.npz", a=np.arange(10))
        # The name of an entry, and not its content.
        np.savez(folder / f"{'0123456789' * 4}.npz", a=np.arange(10))
        (folder / f"{'abcdef0123' * 4}.npz").write_bytes(b"PK\3\4" + b"notes" * 100)
        (folder / f"{'abcdef0124' * 4}.npz").write_bytes(b"")
        # Its content, and not its name.
        shape.save(folder / "hero.npz")
        sgmds.match(shape, shape).save(folder / "hero--hero.npz")
        (folder / "picture.png").write_bytes(b"\x89PNG")
    for path in tmp_path.rglob("*.*"):
        os.utime(path, (1, 1))
    return tmp_path


def test_only_its_own_entries_ever_go(bodies, with_others):
    before = contents(with_others)
    cache = ShapeCache(with_others, limit=1)
    cache.shape(*bodies[0])
    assert cache.entries() == [], "the limit was reached by one shape"
    roomy = ShapeCache(with_others)
    roomy.shape(*bodies[0])
    roomy.shape(*bodies[1])
    assert len(roomy.entries()) == 2
    roomy.clear()
    assert roomy.entries() == []
    after = {path: content for path, content in contents(with_others).items() if path.parent.name != "locks"}
    assert after == before


def test_entries_of_versions_without_a_subfolder_come_into_it(bodies, with_others):
    cache = ShapeCache(with_others)
    before = contents(with_others)
    cache.shape(*bodies[0])
    (entry,) = cache.entries()
    entry.rename(with_others / entry.name)
    older = f"{'0a' * 20}.npz"
    np.savez(with_others / older, format="sgmds-shape", version=4, vertices=bodies[0][0], faces=bodies[0][1])
    cache.shape(*bodies[1])
    assert {path.name for path in cache.entries()} >= {entry.name, older}
    assert not (with_others / entry.name).exists() and not (with_others / older).exists()
    cache.shape(*bodies[0])
    assert cache.hits == 1
    cache.clear()
    assert cache.entries() == [] and before.items() <= contents(with_others).items()


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
