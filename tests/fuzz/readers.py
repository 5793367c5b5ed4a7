"""Coverage-guided fuzzing of what reads files: meshes, saved maps and saved shapes. Needs atheris.

    python tests/fuzz/readers.py obj|off|ply|stl|glb|map|shape [SECONDS] [libFuzzer options]

Each input is the content of a file. It must be read, or refused with an error of this package that names the
file; anything else is a finding, whose input is kept in build/fuzz. The tests replay the corpus with `check`.
"""

import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import sgmds
from sgmds.files import read_mesh

HERE = Path(__file__).parent
MESHES = ("obj", "off", "ply", "stl", "glb")
STORED = {"map": sgmds.Correspondence, "shape": sgmds.Shape}


def check(kind, data, folder):
    """Reads `data` as a file of this kind. True when it was accepted."""
    path = Path(folder) / f"input.{kind if kind in MESHES else 'npz'}"
    path.write_bytes(data)
    try:
        if kind in MESHES:
            vertices, faces = read_mesh(path)
            assert vertices.shape[1:] == faces.shape[1:] == (3,)
            assert faces.min() >= 0 and faces.max() < len(vertices)
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
    with tempfile.TemporaryDirectory() as folder:
        options = [f"-max_total_time={seconds}", "-timeout=20", "-rss_limit_mb=4096", *sys.argv[3:]]
        # A whole shape is longer than any mesh that shows something.
        options.append(f"-max_len={100_000 if kind in STORED else 20_000}")
        options.append(f"-artifact_prefix={found.parent}/reader-{kind}-")
        folders = [str(found), str(HERE / "corpus" / kind)]
        atheris.Setup([sys.argv[0], *options, *folders], lambda data: check(kind, data, folder) and None)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
