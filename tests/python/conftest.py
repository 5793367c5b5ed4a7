"""Shapes that the tests share, each made once."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from sgmds import characters

settings.register_profile("short", max_examples=8, deadline=None, derandomize=True)
settings.register_profile(
    "long", max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "short"))


@pytest.fixture(scope="session")
def slender():
    return characters.make("biped", "slender", "wave", resolution=2500, seed=0)


@pytest.fixture(scope="session")
def stout():
    return characters.make("biped", "stout", "walk", resolution=3000, seed=1)


@pytest.fixture(scope="session")
def sphere():
    """Unit sphere from an icosahedron subdivided four times: 2562 vertices."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array([[s * a, t * b, 0] for a, b in [(1, golden)] for s in (-1, 1) for t in (-1, 1)])
    vertices = np.concatenate([np.roll(vertices, shift, axis=1) for shift in range(3)])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    gaps = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = (gaps > 0) & (gaps < 1.1)
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    faces = np.array([f if np.linalg.det(vertices[list(f)]) > 0 else f[::-1] for f in faces])
    for _ in range(4):
        vertices, faces = characters.subdivide(vertices, faces)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices, faces
