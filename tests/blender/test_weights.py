# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights carried onto a body that has a rig and weights of its own."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object
from test_transfer import store_identity, transfer

from addon import notice
from addon.transfer.weights import read_weights, write_weights

# Weights are kept in single precision, and a row is a sum of few.
ROUNDING = 1e-6


def rig_of(obj, *bones):
    """An armature with these bones, one in each place, that deforms the object."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for place, name in enumerate(bones):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (place, 0, 0), (place, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    obj.modifiers.new("Rig", "ARMATURE").object = rig
    return rig


def give(obj, **columns):
    """Vertex groups with a weight for each vertex."""
    table = np.array(list(columns.values()))
    group, vertex = np.nonzero(table)
    write_weights(obj, list(columns), (vertex, group, table[group, vertex]))


def table_of(obj, *names):
    """Weights of these groups, (n, groups)."""
    vertex, group, weight = read_weights(obj)
    table = np.zeros((len(obj.data.vertices), len(obj.vertex_groups)))
    table[vertex, group] = weight
    return table[:, [obj.vertex_groups[name].index for name in names]]


@pytest.fixture
def worn(scene):
    """A source with a jiggle bone, and a rigged copy whose vertices hang on two others, 0.75 and 0.25."""
    vertices, faces = lumpy()
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    share = np.clip(vertices[:, 0], 0.0, 0.6)
    give(source, Pelvis=1.0 - share, Jiggle=share)
    give(target, Pelvis=np.full(len(vertices), 0.75), Spine=np.full(len(vertices), 0.25))
    rig_of(source, "Pelvis", "Jiggle")
    rig_of(target, "Pelvis", "Spine", "Jiggle")
    return source, target, share


def test_others_give_way_in_their_proportions(worn):
    source, target, share = worn
    for _ in range(2):
        transfer(source, target, items="groups/Jiggle")
        table = table_of(target, "Pelvis", "Spine", "Jiggle")
        expected = np.stack([0.75 * (1.0 - share), 0.25 * (1.0 - share), share], axis=1)
        # What is left of weights below the threshold of Prune.
        np.testing.assert_allclose(table, expected, atol=2e-3)
        assert table.sum(axis=1).max() < 1.0 + 1e-3
    # Nothing is left to give way the second time.
    assert not notice.words


def test_what_gives_way_is_named(worn):
    source, target, share = worn
    transfer(source, target, items="groups/Jiggle")
    assert f"gave way at {(share >= 1e-3).sum()} vertices of 'Target': Pelvis, Spine." in notice.words


def test_locked_and_unmasked_weights_do_not_give_way(worn):
    source, target, share = worn
    before = table_of(target, "Pelvis", "Spine")
    chosen = np.arange(len(share)) % 2 == 0
    give(target, Mask=chosen.astype(float))
    target.vertex_groups["Pelvis"].lock_weight = True
    transfer(source, target, items="groups/Jiggle", group_mask="Mask")
    after = table_of(target, "Pelvis", "Spine", "Jiggle")
    np.testing.assert_array_equal(after[:, 0], before[:, 0])
    np.testing.assert_array_equal(after[~chosen, 1], before[~chosen, 1])
    # The locked bone holds three quarters, so of the rest the carried weight takes what there is.
    given = np.minimum(share, 0.25)
    there = chosen & (share > 1e-3)
    np.testing.assert_allclose(after[there, 2], given[there], atol=ROUNDING)
    np.testing.assert_allclose(after[there, 1], 0.25 - given[there], atol=2e-3)


def test_no_vertex_has_more_weights_than_the_limit(worn):
    source, target, share = worn
    transfer(source, target, items="groups/Jiggle", limit_total=True, limit=2)
    table = table_of(target, "Pelvis", "Spine", "Jiggle")
    there = share > 1e-3
    assert ((table > 0.0).sum(axis=1) <= 2).all()
    # The weaker one went, and the stronger one fills the row.
    assert (table[there, 1] == 0.0).all()
    np.testing.assert_allclose(table[there].sum(axis=1), 1.0, atol=2e-3)


def test_others_stay_on_request_and_on_a_target_without_a_rig(worn):
    source, target, share = worn
    before = table_of(target, "Pelvis", "Spine")
    transfer(source, target, items="groups/Jiggle", others_give_way=False)
    np.testing.assert_array_equal(table_of(target, "Pelvis", "Spine"), before)
    assert "sum to more than 1" in notice.words
    target.modifiers.clear()
    transfer(source, target, items="groups/Jiggle")
    np.testing.assert_array_equal(table_of(target, "Pelvis", "Spine"), before)


@pytest.mark.parametrize("mix", [0.0, 0.25, 1.0])
def test_a_mix_lies_between_what_was_and_what_comes(worn, mix):
    source, target, share = worn
    was = np.full(len(share), 0.2)
    give(target, Jiggle=was, Pelvis=np.full(len(share), 0.55))
    transfer(source, target, items="groups/Jiggle", mix=mix, prune=0.0)
    table = table_of(target, "Pelvis", "Spine", "Jiggle")
    np.testing.assert_allclose(table[:, 2], mix * share + (1.0 - mix) * was, atol=ROUNDING)
    assert table.sum(axis=1).max() < 1.0 + 1e-3
