# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that is rigged already: its rig replaced, or kept and moved by the source's weights."""

import bpy
import numpy as np
import pytest
from bipeds import Figure
from conftest import lumpy, new_object
from test_transfer import store_identity, transfer
from test_weights import give, rig_of, table_of

from addon import character, notice, wording
from addon.transfer import KINDS


def renamed(name):
    """Names as another program gives them."""
    sides = {"L": "_l", "R": "_r"}
    own, _, side = name.partition(".")
    return f"b_{own}{sides.get(side, '')}"


@pytest.fixture
def figures(scene):
    """A rigged source and a target with a rig of its own, whose bones have other names."""
    source, target = Figure("Source", pose="T"), Figure("Target", "stout", "A", seed=3)
    target.store_known(source)
    rig = source.rigged()
    own = target.rigged()
    own.name = "Own"
    for bone in own.data.bones:
        bone.name = renamed(bone.name)
    return source, target, rig, own


def armatures_on(obj):
    return [m.object for m in obj.modifiers if m.type == "ARMATURE" and m.show_viewport and m.show_render]


def test_a_rig_is_replaced_where_one_is_carried(figures):
    source, target, rig, own = figures
    before = table_of(target.obj, "b_hips", "b_foot_l")
    for number in range(2):
        transfer(source.obj, target.obj, kinds="groups,armature")
        fitted = target.obj.find_armature()
        assert armatures_on(target.obj) == [m.object for m in target.obj.modifiers if m.object != own]
        assert fitted not in (rig, own) or number < 0
        assert ("'Own' of 'Target' was replaced" in notice.words) == (number == 0)
    # The old groups and the modifier stay, and the target hangs on the new rig.
    np.testing.assert_array_equal(table_of(target.obj, "b_hips", "b_foot_l"), before)
    assert own in [m.object for m in target.obj.modifiers if not m.show_viewport]
    assert target.obj.parent == armatures_on(target.obj)[0] and len(armatures_on(target.obj)) == 1


def test_what_hangs_on_the_replaced_rig_follows_the_new_one(figures):
    """A thing in the hand stays where it is and goes with the new hand; the old rig is out of sight."""
    source, target, rig, own = figures
    thing = new_object("Thing", [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], [(0, 1, 2)])
    thing.parent, thing.parent_type, thing.parent_bone = own, "BONE", "b_hand_l"
    bpy.context.view_layer.update()
    place = np.array(thing.matrix_world)
    transfer(source.obj, target.obj, kinds="groups,armature")
    fitted = target.obj.find_armature()
    bpy.context.view_layer.update()
    assert (thing.parent, thing.parent_bone) == (fitted, "hand.L") and own.hide_get()
    np.testing.assert_allclose(thing.matrix_world, place, atol=1e-5)
    fitted.pose.bones["hand.L"].rotation_mode = "XYZ"
    fitted.pose.bones["hand.L"].rotation_euler.x = 1.0
    bpy.context.view_layer.update()
    assert np.abs(np.array(thing.matrix_world) - place).max() > 0.1
    assert "follow the new one now: Thing" in notice.words


def test_what_the_replaced_rig_still_moves_is_told(figures):
    """A mesh of the target that is left out: its rig stays in sight, and what to do is not folded away."""
    source, target, rig, own = figures
    skirt = new_object("Skirt", *lumpy(3))
    skirt.modifiers.new("Own", "ARMATURE").object = own
    transfer(source.obj, target.obj, kinds="groups,armature")
    look, _ = wording.notes_in_order(notice.words.splitlines())
    assert [note for note in look if "'Own' of 'Target' still moves what was left out: Skirt." in note]
    assert armatures_on(skirt) == [own] and not own.hide_get()
    assert "stays in the scene, hidden" not in notice.words


def test_a_mesh_that_hung_on_a_bone_is_moved_once(figures):
    """The target itself hangs on a bone of its old rig: the new one deforms it, where it stood."""
    source, target, _, own = figures
    bone = own.data.bones["b_head"]
    place = target.obj.matrix_world.copy()
    target.obj.parent, target.obj.parent_type, target.obj.parent_bone = own, "BONE", bone.name
    target.obj.matrix_world = place
    bpy.context.view_layer.update()
    transfer(source.obj, target.obj, kinds="groups,armature")
    fitted = target.obj.find_armature()
    assert (target.obj.parent, target.obj.parent_type) == (fitted, "OBJECT")
    assert character.skin_of(target.obj) == fitted and character.of(fitted).whole == (target.obj,)
    fitted.pose.bones["head"].location.y = 1.0
    bpy.context.view_layer.update()
    np.testing.assert_allclose(target.obj.matrix_world, place, atol=1e-5)


def test_groups_of_both_rigs_are_kept_beside_the_new_ones(figures):
    source, target, rig, own = figures
    own.data.bones["b_hips"].name = "hips"
    before = table_of(target.obj, "hips")
    for _ in range(2):
        transfer(source.obj, target.obj, kinds="groups,armature")
        np.testing.assert_array_equal(table_of(target.obj, "hips (Own)"), before)
    np.testing.assert_allclose(table_of(target.obj, *target.made.body.names).sum(axis=1), 1.0, atol=1e-3)


def test_groups_that_are_kept_are_named_in_the_order_of_the_bones(figures):
    source, target, rig, own = figures
    for bone in own.data.bones:
        bone.name = bone.name.removeprefix("b_")
    transfer(source.obj, target.obj, kinds="groups,armature")
    shared = [bone.name for bone in own.data.bones if bone.name in rig.data.bones]
    assert len(shared) > 5
    assert f"in groups of their own: {', '.join(f'{name} (Own)' for name in shared[:5])} and " in notice.words


def test_the_choice_is_where_weights_are_and_where_rigs_are():
    shown = {kind.identifier for kind in KINDS if "own_rig" in kind.shown}
    assert shown == {"groups", "armature"}
    for kind in KINDS:
        others = {name for other in KINDS if other != kind for name in other.options}
        assert set(kind.borrowed) <= others and not set(kind.borrowed) & set(kind.options)


def test_replacing_is_one_undo_step(figures):
    source, target, rig, own = figures
    bpy.ops.ed.undo_push(message="Before")
    transfer(source.obj, target.obj, kinds="groups,armature")
    bpy.ops.ed.undo_push(message="Transfer")
    bpy.ops.ed.undo()
    target = bpy.data.objects["Target"]
    assert [rig.name for rig in armatures_on(target)] == ["Own"] and target.parent.name == "Own"
    assert "hips" not in target.vertex_groups


def test_a_rig_that_stays_is_not_said_to_have_come(figures):
    source, target, rig, own = figures
    transfer(source.obj, target.obj, kinds="groups,armature", own_rig="KEEP")
    assert armatures_on(target.obj) == [own] and "keeps its rig 'Own'" in notice.words
    assert notice.done().startswith("Done: ") and "rig" not in notice.done()
    transfer(source.obj, target.obj, kinds="groups,armature", own_rig="REPLACE")
    assert armatures_on(target.obj) != [own] and notice.done().endswith(", rig")


@pytest.mark.parametrize("wish", ["AUTO", "KEEP"])
def test_a_rig_that_stays_is_moved_by_the_new_weights(figures, wish):
    """Bones of other names by the surface they hold: each gets what its partner has."""
    source, target, rig, own = figures
    names = target.made.body.names
    truth = target.made.weights
    # Weights that are there are rough, as automatic ones are: what is carried is better.
    rough = np.where(truth > 0.5, 1.0, 0.0)
    rough[np.arange(len(rough)), truth.argmax(axis=1)] = 1.0
    give(target.obj, **{renamed(name): rough[:, k] for k, name in enumerate(names)})
    kinds = "groups" if wish == "AUTO" else "groups,armature"
    for _ in range(2):
        transfer(source.obj, target.obj, kinds=kinds, own_rig=wish)
        assert armatures_on(target.obj) == [own] and not set(names) & set(target.obj.vertex_groups.keys())
        table = table_of(target.obj, *(renamed(name) for name in names))
        np.testing.assert_allclose(table.sum(axis=1), 1.0, atol=1e-3)
        # On average 2 % of a vertex's weight are on other bones: the known map is off by half an edge.
        assert 0.5 * np.abs(table - truth).sum(axis=1).mean() < 0.02
    assert "keeps its rig 'Own'" in notice.words and f"and {len(names) - 5} more" in notice.words
    assert (wish == "KEEP") == ("was not fitted" in notice.words)


def test_a_finer_rig_shares_what_a_bone_of_the_source_holds(scene):
    """An arm of one bone, on the target of two, in the proportions that these had."""
    vertices, faces = lumpy()
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    arm = np.clip(vertices[:, 0], 0.0, 1.0)
    along = np.clip(vertices[:, 2] + 0.5, 0.0, 1.0)
    give(source, Arm=arm, Body=1.0 - arm)
    give(target, Upper=arm**2 * along, Twist=arm**2 * (1.0 - along), Torso=1.0 - arm**2)
    rig_of(source, "Arm", "Body")
    rig_of(target, "Upper", "Twist", "Torso")
    transfer(source, target, kinds="groups")
    table = table_of(target, "Upper", "Twist", "Torso")
    # Pruned weights are at most a thousandth.
    np.testing.assert_allclose(table[:, 2], 1.0 - arm, atol=3e-3)
    np.testing.assert_allclose(table[:, 0], arm * along, atol=3e-3)
    np.testing.assert_allclose(table[:, 1], arm * (1.0 - along), atol=3e-3)


def test_a_rig_without_weights_takes_the_bones_that_lie_there(figures):
    source, target, rig, own = figures
    target.obj.vertex_groups.clear()
    transfer(source.obj, target.obj, kinds="groups")
    names = target.made.body.names
    table = table_of(target.obj, *(renamed(name) for name in names))
    assert 0.5 * np.abs(table - target.made.weights).sum(axis=1).mean() < 0.02


def test_limits_and_locks_hold_on_a_rig_that_stays(figures):
    source, target, rig, own = figures
    names = [renamed(name) for name in target.made.body.names]
    target.obj.vertex_groups["b_head"].lock_weight = True
    head = table_of(target.obj, "b_head")
    transfer(source.obj, target.obj, kinds="groups", limit_total=True, limit=2)
    table = table_of(target.obj, *names)
    np.testing.assert_array_equal(table_of(target.obj, "b_head"), head)
    assert ((table > 0.0).sum(axis=1) <= 2).mean() > 0.95
    # The head's partner came under its own name, since its bone is locked.
    assert table.sum(axis=1).max() < 1.0 + 1e-3
