"""How bodies and rigs stand to one another, and poses taken from one rig to another."""

import numpy as np
import pytest
import sgmds
from sgmds import poses

MIRROR = np.diag((-1.0, 1.0, 1.0))


def turn(axis, degrees):
    """A turn about an axis."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def a_rig(count, seed=0):
    """Heads, axes and parents of bones all over the place."""
    rng = np.random.default_rng(seed)
    axes = np.array([turn(axis, angle) for *axis, angle in rng.uniform(1.0, 300.0, (count, 4))])
    return rng.normal(size=(count, 3)), axes, (np.arange(count) - 1) // 2


def world(axes, parents, turns):
    """Axes of bones in a pose."""
    found = []
    for bone, parent in enumerate(parents):
        above = found[parent] @ axes[parent].T if parent >= 0 else np.eye(3)
        found.append(above @ axes[bone] @ turns[bone])
    return np.array(found)


def test_a_similarity_is_found_again():
    """Of points that were turned, scaled and moved; a mirrored body is not mirrored back.

    What has no weight does not count, and points that all come to one place are moved to it.
    """
    rng = np.random.default_rng(5)
    points = rng.normal(size=(50, 3)) * (1.0, 2.0, 3.0)
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = 0.01 * turn((1, 2, 3), 70.0), (1.0, 2.0, 3.0)
    aims = points @ made[:3, :3].T + made[:3, 3]
    np.testing.assert_allclose(poses.similarity(points, aims), made, atol=1e-14)
    assert np.linalg.det(poses.similarity(points, points * (-1.0, 1.0, 1.0))[:3, :3]) > 0.0
    aims[0] += 5.0
    counted = np.arange(len(points)) > 0
    np.testing.assert_allclose(poses.similarity(points, aims, counted), made, atol=1e-14)
    np.testing.assert_array_equal(
        poses.similarity(points, aims, 0.0 * counted), poses.similarity(points, aims)
    )
    shifted = poses.similarity(points, np.full((len(points), 3), 0.1))
    np.testing.assert_array_equal(shifted[:3, :3], np.eye(3))
    np.testing.assert_allclose(points.mean(axis=0) + shifted[:3, 3], 0.1)


def test_of_points_that_do_not_fit_the_least_squares_are_left():
    rng = np.random.default_rng(6)
    points, aims, weights = rng.normal(size=(20, 3)), rng.normal(size=(20, 3)), rng.uniform(size=20)
    found = poses.similarity(points, aims, weights)

    def left(matrix):
        off = points @ matrix[:3, :3].T + matrix[:3, 3] - aims
        return weights @ np.square(off).sum(axis=1)

    for axis in np.eye(3):
        for step in (-1e-3, 1e-3):
            shifted, turned = found.copy(), found.copy()
            shifted[:3, 3] += step * axis
            turned[:3, :3] = turn(axis, 100.0 * step) @ found[:3, :3]
            assert left(found) < min(left(shifted), left(turned))
    for scale in (0.999, 1.001):
        assert left(found) < left(found * np.array([[scale] * 3 + [1.0]]))


@pytest.mark.parametrize("side", (1.0, -1.0))
def test_a_matrix_is_its_turn_after_its_stretch(side):
    stretch = np.array([[2.0, 0.3, -0.2], [0.3, 0.6, 0.1], [-0.2, 0.1, 1.1]])
    turned = side * turn((1, 2, 3), 130.0)
    found = poses.polar(turned @ stretch)
    np.testing.assert_allclose(found[0], turned, atol=1e-14)
    np.testing.assert_allclose(found[1], stretch, atol=1e-14)


@pytest.mark.parametrize("side", (np.eye(3), MIRROR), ids=("plain", "mirrored"))
def test_a_body_that_was_turned_faces_so(side):
    heads, axes, _ = a_rig(20)
    mirrors = np.linalg.det(side) < 0.0
    for angle, found_angle in ((0.0, 0.0), (11.9, 0.0), (12.1, 12.1), (79.0, 90.0), (200.0, 200.0)):
        made = turn((0, 0, 1), angle) @ side
        moved = heads @ made.T + (1.0, 2.0, 3.0), made @ axes @ side
        found = poses.facing(heads, axes, *moved, mirrors=mirrors)
        np.testing.assert_allclose(found, turn((0, 0, 1), found_angle) @ side, atol=1e-12)
    # By a quarter turn as the body's own object sees it.
    space = turn((1, 2, 3), 40.0)
    exact = space @ turn((0, 0, 1), 90.0) @ side
    made = turn((1, 0, 0), 8.0) @ exact
    moved = heads @ made.T, made @ axes @ side
    found = poses.facing(heads, axes, *moved, mirrors=mirrors, spaces=(2.0 * np.eye(3), 3.0 * space))
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_a_direction_goes_to_the_axis_that_it_is_near():
    np.testing.assert_array_equal(poses.nearest_axis((0.1, 0.0, -0.99), np.eye(3)), (0.0, 0.0, -1.0))
    np.testing.assert_array_equal(poses.nearest_axis((0.6, 0.0, -0.8), np.eye(3)), (0.6, 0.0, -0.8))


@pytest.mark.parametrize("side", (np.eye(3), MIRROR), ids=("plain", "mirrored"))
def test_every_bone_is_turned_as_its_partner(side):
    """In the world by G P₁ S N; bones that are not fitted keep theirs, and what hangs on them is right."""
    count = 15
    _, source, parents = a_rig(count, seed=1)
    _, target, _ = a_rig(count, seed=2)
    _, given, _ = a_rig(count, seed=3)
    facing = turn((3, 1, 2), 77.0) @ side
    limbs = np.random.default_rng(4).normal(size=(2, count, 3))
    still = np.arange(count) % 4 == 1
    left, right = poses.fitted_turns(
        source, target, parents, facing, source_limbs=limbs[0], target_limbs=limbs[1], kept=(still, given)
    )
    own = np.where(still[:, None, None], given, left @ side @ given @ side @ right)
    before, after = world(source, parents, given), world(target, parents, own)
    np.testing.assert_allclose(after, facing @ before @ side @ right, atol=1e-12)
    unit = limbs / np.linalg.norm(limbs, axis=2, keepdims=True)
    ways = [
        np.einsum("bij,bj->bi", turned, limb)
        for turned, limb in ((facing @ before, unit[0]), (after, unit[1]))
    ]
    np.testing.assert_allclose(ways[0][~still], ways[1][~still], atol=1e-12)
    # Limbs along the bones, and a rest that is the same, take turns over as they are.
    left, right = poses.fitted_turns(source, source, parents, np.eye(3))
    for found in (left, right):
        np.testing.assert_allclose(found, np.broadcast_to(np.eye(3), found.shape), atol=1e-14)


def test_heads_go_with_what_turns_them():
    count = 10
    heads, axes, parents = a_rig(count, seed=5)
    _, given, _ = a_rig(count, seed=6)
    np.testing.assert_allclose(
        poses.posed_heads(heads, axes, parents, np.tile(np.eye(3), (count, 1, 1))), heads, atol=1e-14
    )
    found = poses.posed_heads(heads, axes, parents, given)
    turned = world(axes, parents, given) @ axes.transpose(0, 2, 1)
    for bone, parent in enumerate(parents):
        above = found[parent] + turned[parent] @ (heads[bone] - heads[parent]) if parent >= 0 else heads[bone]
        np.testing.assert_allclose(found[bone], above, atol=1e-12)
    # A bone that does not turn with its parent still goes with its place.
    chain = poses.posed_heads(
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)],
        np.tile(np.eye(3), (3, 1, 1)),
        [-1, 0, 1],
        [turn((0, 0, 1), 90.0), np.eye(3), np.eye(3)],
        loose=[False, True, False],
    )
    np.testing.assert_allclose(chain, [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)], atol=1e-15)


def test_what_has_no_meaning_is_refused():
    heads, axes, parents = a_rig(4)
    circle = [3, 0, 1, 2]
    eye, nan = np.eye(3), np.full((4, 3), np.nan)
    for call, words in (
        (lambda: poses.similarity(heads, heads[1:]), r"`aims` should be \(4, 3\)"),
        (lambda: poses.similarity(nan, heads), "`points` should be finite"),
        (lambda: poses.similarity(heads[:0], heads[:0]), "`points` should have at least one row"),
        (lambda: poses.similarity(heads, heads, -np.ones(4)), "`weights` should be 0 or more"),
        (lambda: poses.similarity(heads, heads, np.ones(3)), r"`weights` should be \(4\)"),
        (lambda: poses.polar(np.eye(4)), r"`matrix` should be \(3, 3\)"),
        (lambda: poses.polar(np.full((3, 3), np.inf)), "`matrix` should be finite"),
        (lambda: poses.facing(heads, axes, heads[1:], axes), r"`target_heads` should be \(4, 3\)"),
        (lambda: poses.facing(heads, axes[1:], heads, axes), r"`source_axes` should be \(4, 3, 3\)"),
        (lambda: poses.facing(heads, axes, nan, axes), "`target_heads` should be finite"),
        (lambda: poses.facing(heads, axes, heads, axes, spaces=eye), "`spaces` should be two matrices"),
        (lambda: poses.facing(heads, axes, heads, axes, spaces=(eye, 1.0)), r"`spaces\[1\]`"),
        (lambda: poses.nearest_axis((1.0, 0.0), eye), r"`direction` should be \(3\)"),
        (lambda: poses.fitted_turns(axes, axes, circle, eye), "`parents` of 4 bones should be bones above"),
        (lambda: poses.fitted_turns(axes, axes, [-1, 0, 1, 4], eye), "`parents` of 4 bones"),
        (lambda: poses.fitted_turns(axes, axes[1:], parents, eye), "`target_axes`"),
        (lambda: poses.fitted_turns(axes, axes, parents, heads), "`facing`"),
        (
            lambda: poses.fitted_turns(axes, axes, parents, eye, target_limbs=nan),
            "`target_limbs` sh",
        ),
        (lambda: poses.fitted_turns(axes, axes, parents, eye, kept=axes[0]), "`kept` should be two arrays"),
        (lambda: poses.fitted_turns(axes, axes, parents, eye, kept=([True], axes)), r"`kept\[0\]`"),
        (lambda: poses.posed_heads(heads, axes, circle, axes), "`parents` of 4 bones"),
        (lambda: poses.posed_heads(heads, axes, parents, axes[1:]), "`turns`"),
        (lambda: poses.posed_heads(heads, axes, parents, axes, loose=[True]), "`loose`"),
    ):
        with pytest.raises(sgmds.ArgumentError, match=words):
            call()
