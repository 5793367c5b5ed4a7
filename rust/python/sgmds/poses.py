"""How bodies and rigs stand: what turns, scales and moves one to another, and takes poses along.

Matrices are given by rows. The axes of a bone are the columns of a matrix (3, 3): x, y along the bone, and z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .errors import ArgumentError
from .shape import Floats, checked_array, checked_matrix, finite


def similarity(points: ArrayLike, aims: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """The turn, scale and shift, (4, 4), that bring points (n, 3) nearest to `aims` (n, 3) by least squares.

    It does not mirror. Points count by `weights` (n,), which are 0 or more, alike where these are all 0; a
    shift alone is left where the points that count, or their aims, are all at one place (Umeyama, IEEE PAMI
    13, 1991). No points are an `ArgumentError`.
    """
    points = finite("points", checked_array("points", points, np.float64, None, 3))
    aims = finite("aims", checked_array("aims", aims, np.float64, len(points), 3))
    if weights is not None:
        weights = finite("weights", checked_array("weights", weights, np.float64, len(points)))
    return _core.similarity(points, aims, weights)


def polar(given: ArrayLike) -> tuple[Floats, Floats]:
    """The turn and the stretch, (3, 3) each, of which a matrix (3, 3) is ``turn @ stretch``.

    The turn is the orthogonal matrix nearest to it and mirrors if the matrix does; the stretch is symmetric
    (Higham, SIAM J. Sci. Stat. Comput. 7, 1986).
    """
    return _core.polar(checked_matrix("matrix", given, 3))


def facing(
    source_heads: ArrayLike,
    source_axes: ArrayLike,
    target_heads: ArrayLike,
    target_axes: ArrayLike,
    *,
    mirrors: bool = False,
    spaces: tuple[ArrayLike, ArrayLike] | None = None,
) -> Floats:
    """What turns the source's body at rest to the target's, (3, 3), a mirroring one if `mirrors`.

    Rigs with the same bones at rest, each in the world or a space of its own: `source_heads` and
    `target_heads` (bones, 3) are where bones begin, `source_axes` and `target_axes` (bones, 3, 3) their axes.
    The turn is the one that takes heads, and places beside them along the y and z axes, nearest to those of
    the target by least squares. Bodies that stand within 12 degrees of whole quarter turns to each other, in
    these spaces or as seen from two more `spaces`, matrices (3, 3) of which only the turns count, stand so.
    """
    source = _rig("source_", source_heads, source_axes, None)
    target = _rig("target_", target_heads, target_axes, len(source[0]))
    try:
        first, second = (np.eye(3), np.eye(3)) if spaces is None else spaces
    except (TypeError, ValueError):
        raise ArgumentError("`spaces` should be two matrices, of source and target") from None
    given = checked_matrix("spaces[0]", first, 3), checked_matrix("spaces[1]", second, 3)
    return _core.facing(source, target, bool(mirrors), given)


def nearest_axis(direction: ArrayLike, axes: ArrayLike) -> Floats:
    """The one of `axes` (n, 3), or of their opposites, next to a direction (3,); all are unit vectors.

    Where none is within 12 degrees it is the direction itself.
    """
    direction = finite("direction", checked_array("direction", direction, np.float64, 3))
    axes = finite("axes", checked_array("axes", axes, np.float64, None, 3))
    return np.array(_core.nearest_axis(direction.tolist(), axes))


def fitted_turns(
    source_axes: ArrayLike,
    target_axes: ArrayLike,
    parents: ArrayLike,
    facing: ArrayLike,
    *,
    source_limbs: ArrayLike | None = None,
    target_limbs: ArrayLike | None = None,
    kept: tuple[ArrayLike, ArrayLike] | None = None,
) -> tuple[Floats, Floats]:
    """What takes turns of a rig's bones to those of the fitted rig: L and N, (bones, 3, 3) each.

    Let B₁ be the turn of a bone of the source from its place at rest, in its own axes. With B₂ = L (S B₁ S) N
    the partner is turned in the world by G P₁ S N where the bone is turned by P₁: G is `facing` (3, 3), as
    `facing` finds it, and S = diag(±1, 1, 1) mirrors where G does and the two rigs do not. N is the smallest
    turn that takes the limb in the target's bone to that in the source's: directions (bones, 3) in the axes
    of each bone, `source_limbs` and `target_limbs`, by default y.

    `source_axes` and `target_axes` (bones, 3, 3) are the axes at rest in the spaces between which G leads,
    `parents` (bones,) the parent of each bone, −1 of a root and of bones that do not turn with their parent.
    `kept` are bones that are not fitted, (bones,) of bool, and the turns (bones, 3, 3) that they have in both
    rigs: of these N is what that makes of their P₂ beside G P₁ S.
    """
    parents = checked_array("parents", parents, np.int64, None)
    count = len(parents)
    along = np.tile((0.0, 1.0, 0.0), (count, 1))
    limbs = [
        finite(name, checked_array(name, along if given is None else given, np.float64, count, 3))
        for name, given in (("source_limbs", source_limbs), ("target_limbs", target_limbs))
    ]
    try:
        still, turns = (np.zeros(count, bool), np.zeros((count, 3, 3))) if kept is None else kept
    except (TypeError, ValueError):
        raise ArgumentError("`kept` should be two arrays: which bones, and their turns") from None
    return _core.fitted_turns(
        (_matrices("source_axes", source_axes, count), _matrices("target_axes", target_axes, count)),
        checked_matrix("facing", facing, 3),
        parents,
        (limbs[0], limbs[1]),
        ~checked_array("kept[0]", still, np.bool_, count),
        _matrices("kept[1]", turns, count),
    )


def posed_heads(
    heads: ArrayLike,
    axes: ArrayLike,
    parents: ArrayLike,
    turns: ArrayLike,
    *,
    loose: ArrayLike | None = None,
) -> Floats:
    """Where the bones of a rig begin in a pose, (bones, 3), given `heads` (bones, 3) and `axes` at rest.

    `axes` (bones, 3, 3) are those of the bones, `parents` (bones,) the parent of each, −1 of a root, and
    `turns` (bones, 3, 3) the turns of the bones from their places at rest, in their own axes. Bones that are
    `loose` (bones,), by default none, go with their parent's place and not with its turn.
    """
    parents = checked_array("parents", parents, np.int64, None)
    count = len(parents)
    heads, axes = _rig("", heads, axes, count)
    loose = checked_array("loose", np.zeros(count, bool) if loose is None else loose, np.bool_, count)
    return _core.posed_heads(heads, axes, parents, loose, _matrices("turns", turns, count))


def _rig(of: str, heads: ArrayLike, axes: ArrayLike, count: int | None) -> tuple[Floats, Floats]:
    """Heads and axes of so many bones, checked; `of` begins their names."""
    name = f"{of}heads"
    heads = finite(name, checked_array(name, heads, np.float64, count, 3))
    return heads, _matrices(f"{of}axes", axes, len(heads))


def _matrices(name: str, given: ArrayLike, count: int) -> NDArray[np.float64]:
    return finite(name, checked_array(name, given, np.float64, count, 3, 3))
