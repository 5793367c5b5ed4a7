# SPDX-License-Identifier: GPL-3.0-or-later
"""The partner of a point, both ways."""

import numpy as np
from conftest import lumpy, new_object
from test_transfer import store_identity

from addon.operators.partner import partner_of
from addon.overlay import Point


def test_partners_of_a_known_map(scene):
    """Under the identity each vertex is its own partner, from either side; on other meshes it has none."""
    source, target = new_object("Source", *lumpy(8)), new_object("Target", *lumpy(8))
    stranger = new_object("Stranger", *lumpy(6))
    store_identity(source, target)
    for vertex in np.arange(len(target.data.vertices))[::37].tolist():
        assert partner_of(Point(target.session_uid, vertex), (target,)) == Point(source.session_uid, vertex)
        assert partner_of(Point(source.session_uid, vertex), (target,)) == Point(target.session_uid, vertex)
    assert partner_of(Point(stranger.session_uid, 0), (target,)) is None
