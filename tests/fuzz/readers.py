"""Coverage-guided fuzzing of what reads files: meshes, manifests, saved maps and shapes. Needs atheris.

    python tests/fuzz/readers.py obj|off|ply|stl|glb|gz|accessors|toml|map|shape [SECONDS] [libFuzzer options]

`gz` changes what is within a gzipped OBJ, `accessors` entries of the description of a GLB. Each input is
the content of a file. It must be read, or refused with an error of this package that names the file;
anything else is a finding, whose input is kept in build/fuzz. The tests replay the corpus with `check`.
"""

import gzip
import json
import random
import struct
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np
import sgmds
from sgmds import archive
from sgmds.batch import manifest
from sgmds.files import read_mesh

HERE = Path(__file__).parent
ENDINGS = {"gz": "obj.gz", "accessors": "glb", **{kind: kind for kind in ("obj", "off", "ply", "stl", "glb")}}
MESHES = tuple(ENDINGS)
STORED = {"map": sgmds.Correspondence, "shape": sgmds.Shape}


def check(kind, data, folder):
    """Reads `data` as a file of this kind. True when it was accepted."""
    path = Path(folder) / f"input.{ENDINGS.get(kind) or {'toml': 'toml'}.get(kind, 'npz')}"
    path.write_bytes(data)
    try:
        if kind in MESHES:
            vertices, faces = read_mesh(path)
            assert vertices.shape[1:] == faces.shape[1:] == (3,)
            assert faces.min() >= 0 and faces.max() < len(vertices)
        elif kind == "toml":
            for name in ("a.off", "b.obj"):
                (Path(folder) / name).touch()
            batch = manifest.read(path)
            assert [
                batch.number(pair.source, pair.target) for pair in map(batch.pair, range(min(len(batch), 50)))
            ]
        else:
            found = STORED[kind].load(path)
            if kind == "map":
                assert len(found.transfer(np.zeros(found._source_count))) == len(found.faces)
    except sgmds.InternalError:
        raise
    except sgmds.SgmdsError as error:
        assert str(path) in str(error)
        return False
    return True


def changed_within(data, most, seed, mutate):
    """A gzipped file with other content."""
    try:
        content = gzip.decompress(data)
    except (OSError, EOFError, zlib.error):
        content = b"v 0 0 0\nf 1 1 1\n"
    if seed % 8 == 0:
        return mutate(data, most)
    return gzip.compress(mutate(content[:most], most), 1, mtime=0)[:most]


NUMBERS = (
    -1,
    0,
    1,
    2,
    3,
    4,
    255,
    5120,
    5123,
    5125,
    5126,
    65536,
    2**31,
    2**32 - 1,
    10**9,
    10**12,
    2**63,
    1e300,
)
NAMES = ("SCALAR", "VEC3", "VEC4", "MAT4", "data:;base64,AAAA", "x.bin")


def changed_description(data, most, seed, mutate):
    """A GLB in whose description one number, word, list or entry is another one."""
    try:
        (length,) = struct.unpack_from("<I", data, 12)
        tree = json.loads(data[20 : 20 + length])
        rest = data[20 + length :]
    except (ValueError, struct.error):
        return mutate(data, most)
    choose = random.Random(seed)
    places = []

    def walk(entry):
        for key, value in list(entry.items()) if isinstance(entry, dict) else list(enumerate(entry)):
            places.append((entry, key))
            if isinstance(value, dict | list):
                walk(value)

    if not isinstance(tree, dict):
        return mutate(data, most)
    walk(tree)
    if not places or choose.random() < 0.1:
        return mutate(data, most)
    entry, key = choose.choice(places)
    old = entry[key]
    match choose.randrange(4):
        case 0 if isinstance(entry, dict):
            del entry[key]
        case 1 if isinstance(entry, list):
            entry.append(old)
        case 2:
            donor, other = choose.choice(places)
            entry[key] = (
                json.loads(json.dumps(donor[other])) if other in donor or isinstance(donor, list) else old
            )
        case _:
            entry[key] = choose.choice(NAMES if isinstance(old, str) else NUMBERS)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + rest
    return (struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)[:most]


MUTATORS = {"gz": changed_within, "accessors": changed_description}


class _Equal(str):
    """Equal to any other."""

    __hash__ = str.__hash__

    def __eq__(self, other):
        return True

    def __ne__(self, other):
        return False


def main():
    import atheris

    kind = sys.argv[1]
    seconds = sys.argv[2] if len(sys.argv) > 2 else "900"
    found = Path("build/fuzz") / f"reader-{kind}"
    found.mkdir(parents=True, exist_ok=True)
    # What is imported already is instrumented where it stands.
    atheris.instrument_all()
    # Or the archive's checksums would refuse nearly every changed file before our own checks see it.
    zipfile.ZipExtFile._update_crc = lambda self, data: None
    archive.checksum = lambda arrays: _Equal()
    with tempfile.TemporaryDirectory() as folder:
        options = [f"-max_total_time={seconds}", "-timeout=20", "-rss_limit_mb=4096", *sys.argv[3:]]
        # A whole shape is longer than any mesh that shows something.
        options.append(f"-max_len={100_000 if kind in STORED else 20_000}")
        options.append(f"-artifact_prefix={found.parent}/reader-{kind}-")
        folders = [str(found), str(HERE / "corpus" / kind)]
        more = {}
        if kind in MUTATORS:

            def mutator(data, most, seed):
                return MUTATORS[kind](data, most, seed, atheris.Mutate)

            more["custom_mutator"] = mutator
        atheris.Setup(
            [sys.argv[0], *options, *folders], lambda data: check(kind, data, folder) and None, **more
        )
        atheris.Fuzz()


if __name__ == "__main__":
    main()
