# SPDX-License-Identifier: GPL-3.0-or-later
"""The partner of a place, both ways."""

import numpy as np
import pytest
from conftest import lumpy, new_object
from test_transfer import store_identity

from addon.mesh_read import positions, triangle_vertices
from addon.operators.partner import partner_of
from addon.overlay import Place


def where(place):
    """A place in its object's own space."""
    return np.array(place.shares) @ positions(place.object.data)[list(place.vertices)]


@pytest.fixture
def copies(scene):
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(8))
    store_identity(source, target)
    return source, target


@pytest.mark.parametrize("shares", [(1.0, 0.0, 0.0), (0.2, 0.5, 0.3)])
def test_partners_of_a_known_map(copies, shares):
    """Under the identity each place is its own partner, from either side."""
    source, target = copies
    for corners in triangle_vertices(target.data)[::37].tolist():
        for own, other in (copies, copies[::-1]):
            place = Place(own.session_uid, corners, shares)
            found = partner_of(place, (target,))
            assert found.object == other and sum(found.shares) == pytest.approx(1.0)
            # Single precision of Blender's vectors, on a body of size 4.
            np.testing.assert_allclose(where(found), where(place), atol=1e-5)


def test_what_was_not_matched_has_no_partner(copies):
    stranger = new_object("Stranger", *lumpy(6))
    assert partner_of(Place(stranger.session_uid, (0,), (1.0,)), copies[1:]) is None
