"""Files that fuzzing found to take paths of their own: each is still read, or refused by name."""

import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parents[1] / "fuzz"
sys.path.insert(0, str(FUZZ))
readers = pytest.importorskip("readers")


@pytest.mark.parametrize("kind", [*readers.MESHES, "toml", *readers.STORED])
def test_corpus(kind, tmp_path):
    files = sorted((FUZZ / "corpus" / kind).iterdir())
    accepted = sum(readers.check(kind, file.read_bytes(), tmp_path) for file in files)
    # At least the sound file that the fuzzer started from.
    assert accepted > 0
