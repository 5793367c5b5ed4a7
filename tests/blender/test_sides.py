# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the other side: by any convention, by counterparts, and by where bones and groups lie."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object
from test_transfer import store_identity, transfer

from addon import notice
from addon.transfer.sides import flip_name, looks_sided

# As rigs of these programs write them, each with its partner.
PAIRS = {
    "Blender": ("upper_arm.L.001", "upper_arm.R.001"),
    "Blender, within": ("DEF-forearm.L.002_twist", "DEF-forearm.R.002_twist"),
    "Unreal": ("hand_l", "hand_r"),
    "Unreal, within": ("thumb_l_01", "thumb_r_01"),
    "in front": ("L_Hand", "R_Hand"),
    "lower case in front": ("l_upperarm", "r_upperarm"),
    "Mixamo": ("mixamorig:LeftHandThumb1", "mixamorig:RightHandThumb1"),
    "Mixamo without its colon": ("mixamorigLeftArm", "mixamorigRightArm"),
    "a word within": ("Index_Left_2", "Index_Right_2"),
    "a word at the end": ("eyeBlinkLeft", "eyeBlinkRight"),
    "capitals": ("ARM_LEFT", "ARM_RIGHT"),
    "VRoid": ("J_Bip_L_Hand", "J_Bip_R_Hand"),
    "3ds Max": ("Bip01 L Finger0", "Bip01 R Finger0"),
    "Source": ("ValveBiped.Bip01_L_Hand", "ValveBiped.Bip01_R_Hand"),
    "Character Creator": ("CC_Base_L_Hand", "CC_Base_R_Hand"),
    "Daz": ("lShldrBend", "rShldrBend"),
    "a capital in front": ("LThumb1", "RThumb1"),
    "a capital behind": ("HandL", "HandR"),
    "a capital behind a number": ("Finger01L", "Finger01R"),
    "Maya": ("lft_arm_jnt", "rgt_arm_jnt"),
    "Japanese": ("左腕", "右腕"),
    "Japanese, within": ("腕.左.001", "腕.右.001"),
    "a letter behind Japanese": ("ウィンクL", "ウィンクR"),
    "Korean": ("왼팔", "오른팔"),
    "said twice": ("L_Hand.L", "R_Hand.R"),
}


@pytest.mark.parametrize("convention", PAIRS)
def test_a_side_is_exchanged_as_each_program_writes_it(convention):
    left, right = PAIRS[convention]
    assert (flip_name(left), flip_name(right)) == (right, left)


@pytest.mark.parametrize(
    "name",
    "Pelvis Color Lower_arm roll Lip Root tail_roll leftover Leftover Bright upright copyright Cleft RGB "
    "LOD0 URL RL_BoneRoot ARKit rigify lamp Loop Spine1 L4 左右 Left:Hand Real_Lips Hair Ctrl".split(),
)
def test_words_that_only_contain_the_letters_stay(name):
    assert flip_name(name) == name


@pytest.mark.parametrize(
    "left, right",
    [
        ("lf_arm", "rt_arm"),
        ("lt_leg", "rt_leg"),
        ("leftarm", "rightarm"),
        ("HairL1", "HairR1"),
        ("ikLHand", "ikRHand"),
    ]
    + [("L1_rib", "R1_rib"), ("L_to_R", "R_to_L"), ("HANDLEFT", "HANDRIGHT")],
)
def test_what_may_be_a_side_counts_beside_its_counterpart(left, right):
    both = {left, right}
    assert (flip_name(left, both), flip_name(right, both)) == (right, left)
    # One alone stays, or, for lf, is exchanged for certain; either way it is told of or right.
    assert flip_name(right, {right}) == right and looks_sided(right)


def weighted(obj, name, at):
    """A group of the vertices around a place."""
    near = np.linalg.norm(np.array([vertex.co for vertex in obj.data.vertices]) - at, axis=1) < 0.5
    obj.vertex_groups.new(name=name).add(np.flatnonzero(near).tolist(), 1.0, "REPLACE")


def test_partners_without_a_side_are_found_by_their_place(scene):
    """Groups by what they move and bones by their ends; what lies in the middle, or alone, stays."""
    vertices, faces = lumpy()
    symmetric = np.abs(vertices / np.linalg.norm(vertices, axis=1, keepdims=True))
    vertices = np.sign(vertices) * symmetric
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    for name, at in (("Bone.001", (0.8, 0, 0.5)), ("Bone.002", (-0.8, 0, 0.5)), ("Chest", (0, -0.9, 0))):
        weighted(source, name, at)
    weighted(source, "Pocket", (0.6, -0.6, -0.4))
    transfer(source, target, kinds="groups", mirror_names=True)
    assert [group.name for group in target.vertex_groups] == ["Bone.002", "Bone.001", "Chest", "Pocket"]
    assert not notice.words


def test_names_that_stay_are_told(scene):
    vertices, faces = lumpy()
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    for number in range(25):
        source.vertex_groups.new(name=f"rt_{number:02}").add([number], 1.0, "REPLACE")
    source.vertex_groups.new(name="Hand.L").add([30], 1.0, "REPLACE")
    transfer(source, target, kinds="groups", mirror_names=True)
    assert all(f"rt_{number:02}" in notice.words for number in range(20))
    assert "rt_20" not in notice.words and "and 5 more" in notice.words
    assert "Hand.R" in target.vertex_groups and "Hand.L" not in notice.words


def test_a_name_that_the_target_knows_is_a_counterpart(scene):
    """A glove for one hand has no names of the other side; the body that gets it has."""
    vertices, faces = lumpy()
    source, target = new_object("Source", vertices, faces), new_object("Target", vertices, faces)
    store_identity(source, target)
    source.vertex_groups.new(name="rt_hand").add([0], 1.0, "REPLACE")
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones.new("lf_hand").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    target.modifiers.new("Rig", "ARMATURE").object = rig
    transfer(source, target, kinds="groups", mirror_names=True)
    assert [group.name for group in target.vertex_groups] == ["lf_hand"] and not notice.words
