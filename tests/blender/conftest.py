# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on registered in an otherwise empty scene, and small shapes made by code."""

import os
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import addon  # noqa: E402
from addon import mesh_read  # noqa: E402

_status = [0]


def pytest_sessionfinish(exitstatus):
    _status[0] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure():
    """Leave without Blender's own end: the result is printed by then.

    As a module 4.2 crashes there once a pointer property with a poll was registered, and later versions wait
    for ever for a thread of their own once files were read while Rigify was on. How a process with this
    extension alone ends is tested by `test_process_end`.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(_status[0])


@pytest.fixture(scope="session")
def registered():
    addon.register()
    yield addon
    addon.unregister()


@pytest.fixture
def scene(registered):
    """An empty scene with the add-on registered."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    return bpy.context.scene


def new_object(name, vertices, faces):
    """Link a new mesh object to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices).tolist(), [], [list(map(int, face)) for face in faces])
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def lumpy(cells=12):
    """A closed body of quads without any symmetry: vertices (n, 3) and faces.

    Lobes of unequal size stand on a stretched sphere, so that a map onto a copy has one right answer. It is
    a cube of `cells` × `cells` quads a side, blown up.
    """
    line = np.tan(np.linspace(-1.0, 1.0, cells + 1) * np.pi / 4)
    u, v = np.meshgrid(line, line, indexing="ij")
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    square = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(
        -1, 4
    )
    sides, quads = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.empty((*u.shape, 3))
            side[..., axis], side[..., axis - 2], side[..., axis - 1] = sign, u, v
            quads.append((square if sign > 0.0 else square[:, ::-1]) + len(sides) * number.size)
            sides.append(side.reshape(-1, 3))
    doubled = np.vstack(sides)
    _, first, joined = np.unique(np.round(doubled, 6), axis=0, return_index=True, return_inverse=True)
    direction = doubled[first] / np.linalg.norm(doubled[first], axis=1, keepdims=True)
    faces = joined.reshape(-1)[np.vstack(quads)]
    lobes = (
        ((0.9, 0.3, 0.3), 0.9, 7.0),
        ((-0.7, 0.6, 0.4), 0.6, 9.0),
        ((0.1, -0.9, -0.4), 1.2, 8.0),
        ((-0.4, -0.3, 0.85), 0.4, 12.0),
    )
    radius = np.ones(len(direction))
    for axis, height, narrow in lobes:
        axis = np.array(axis) / np.linalg.norm(axis)
        radius += height * np.exp(narrow * (direction @ axis - 1.0))
    return direction * radius[:, None] * (1.0, 0.8, 1.5), faces.tolist()


def renumbered(vertices, faces, seed=5):
    """The same surface with vertices and faces in another order, and for each new vertex its old number."""
    rng = np.random.default_rng(seed)
    old = rng.permutation(len(vertices))
    new = np.empty(len(old), int)
    new[old] = np.arange(len(old))
    order = rng.permutation(len(faces))
    return vertices[old], [[int(new[v]) for v in faces[i]] for i in order], old


def triangle_vertices(mesh):
    """The vertices of Blender's triangles, (m, 3)."""
    return mesh_read.corner_vertices(mesh)[mesh_read.triangle_corners(mesh)[0]]


def turned(vertices):
    """A rigid motion that exchanges no axes."""
    a, b = 0.7, 0.4
    about_z = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(b), -np.sin(b)], [0.0, np.sin(b), np.cos(b)]])
    return vertices @ (about_z @ about_x).T + (3.0, 1.0, 0.0)


def choose(source, *targets):
    """Select as an artist does: targets, then the source, which is active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == source or obj in targets)
    bpy.context.view_layer.objects.active = source


@pytest.fixture
def pair(scene):
    """Source, target (its turned, renumbered copy), and the source vertex of each target vertex."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    moved, other_faces, old = renumbered(vertices, faces)
    target = new_object("Target", turned(moved), other_faces)
    choose(source, target)
    return source, target, old
