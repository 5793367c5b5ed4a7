# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions on a fitted rig: limbs point as the source's, whatever both bodies' rest poses and sizes are."""

import bpy
import numpy as np
import pytest
from bipeds import FRAMES, Figure, apart, head_of, leg_of, limbs, turn_bone, walk
from conftest import choose
from mathutils import Euler, Matrix
from test_transfer import transfer

from addon import notice
from addon.operators.carry import carry
from addon.transfer import ANIMATING, WRITTEN
from addon.transfer.actions import curves_used

# Limbs that are keyed at each frame point as the source's but for single precision.
EXACT = 0.1
# Between keys of Euler angles the curves may be off by `curve_maps.TOLERANCE`, a third of a degree each.
BETWEEN_KEYS = 1.0


def pair(build="stout", poses="TA", size=1.0, scale=1.0, y_up=False, place=None):
    """Source and target with the known map, and the source's rig."""
    source, target = Figure("Source", pose=poses[0]), Figure("Target", build, poses[1], seed=3, size=size)
    if place is not None:
        target.obj.matrix_world = place
        bpy.context.view_layer.update()
    target.store_known(source)
    return source, target, source.rigged(scale, y_up)


def worst(scene, rig, own, facing=None, names=None):
    """Over all frames the largest angle between limbs, and the largest error of the hips' way, in legs."""
    facing = np.eye(3) if facing is None else facing
    angles, ways = [], []
    for frame in FRAMES:
        scene.frame_set(frame)
        first, second = limbs(rig), limbs(own)
        angles.append(max(apart(facing @ first[name], second[name]) for name in names or first))
        ways.append([head_of(rig, "hips") / leg_of(rig), head_of(own, "hips") / leg_of(own)])
    ways = np.array(ways) - ways[0]
    assert np.linalg.norm(ways[:, 0], axis=1).max() > 0.5
    return max(angles), np.linalg.norm(ways[:, 0] @ facing.T - ways[:, 1], axis=1).max()


@pytest.mark.parametrize("poses", ["TA", "AT"])
@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("y_up", [False, True])
def test_limbs_point_as_the_source_s(scene, poses, scale, y_up):
    source, target, rig = pair(poses=poses, size=1.7, scale=scale, y_up=y_up)
    walk(rig)
    for _ in range(2):
        transfer(source.obj, target.obj, kinds="groups,armature")
        assert notice.done().endswith(", rig, 1 action")
        own = target.obj.find_armature()
        angle, way = worst(scene, rig, own)
        assert angle < EXACT and way < 2e-3
        assert len(bpy.data.actions) == 2
    assert np.cbrt(own.matrix_world.determinant()) == pytest.approx(scale, rel=1e-5)


def test_how_far_it_is_with_many_actions_is_told(scene):
    source, target, rig = pair()
    walk(rig)
    tracks = rig.animation_data.nla_tracks
    for number in range(5):
        tracks.new().strips.new(f"Walk {number}", 1 + 30 * number, rig.animation_data.action.copy())
    choose(source.obj, target.obj)
    going = carry(
        bpy.context, None, [target.obj], scene.spectral_match, lambda kind, _: kind.identifier == "armature"
    )
    shares = [share for share, words in going if words == ANIMATING]
    assert len(shares) == 6 and shares == sorted(set(shares)) and WRITTEN <= shares[0] and shares[-1] < 1.0


def test_a_rig_as_mixamo_s_moves_on_five_targets(scene):
    """A hundredth in size, y up, by its names, one bone with a constraint that looks at another."""
    source = Figure("Source", pose="T")
    rig = source.rigged(0.01, y_up=True)
    walk(rig)
    for bone in rig.data.bones:
        name, _, side = bone.name.partition(".")
        bone.name = f"mixamorig:{ {'L': 'Left', 'R': 'Right'}.get(side, '') }{name.title()}"
    looking = rig.pose.bones["mixamorig:Head"].constraints.new("COPY_ROTATION")
    looking.target, looking.subtarget, looking.influence = rig, "mixamorig:Hips", 0.5
    targets = (("stout", "A"), ("slender", ""), ("plain", "A"), ("stout", "T"), ("slender", "A"))
    for number, (build, pose) in enumerate(targets):
        target = Figure(f"Target {number}", build, pose, seed=3, size=1.0 + 0.2 * number)
        target.store_known(source)
        transfer(source.obj, target.obj, kinds="groups,armature")
        own = target.obj.find_armature()
        held = [constraint for bone in own.pose.bones for constraint in bone.constraints]
        assert [constraint.target for constraint in held] == [own] and held[0].is_valid
        for frame in FRAMES:
            scene.frame_set(frame)
            first, second = limbs(rig), limbs(own)
            assert len(first) > 15 and max(apart(first[name], second[name]) for name in first) < EXACT


@pytest.mark.parametrize("modes", [("QUATERNION",), ("XYZ", "ZYX"), ("AXIS_ANGLE",)])
def test_between_keys_limbs_point_as_the_source_s(scene, modes):
    source, target, rig = pair()
    walk(rig, modes=modes, every=6)
    transfer(source.obj, target.obj, kinds="groups,armature")
    angle, way = worst(scene, rig, target.obj.find_armature())
    assert angle < BETWEEN_KEYS and way < 5e-3


@pytest.mark.parametrize(
    "turn", [Euler((0.0, 0.0, 1.1)), Euler((np.pi / 2, 0.0, 0.0)), Euler((0.3, -0.8, 2.0))]
)
def test_a_target_that_faces_another_way_walks_its_own_way(scene, turn):
    """The object is turned; also onto its back, as files with y for up come in."""
    source, target, rig = pair(place=Matrix.Translation((3, 1, 0)) @ turn.to_matrix().to_4x4())
    walk(rig)
    transfer(source.obj, target.obj, kinds="groups,armature")
    angle, way = worst(scene, rig, target.obj.find_armature(), np.array(turn.to_matrix()))
    assert angle < EXACT and way < 2e-3


def test_a_mesh_with_other_axes_walks_as_it_stands(scene):
    """Turned by a quarter in its mesh, its object not turned at all."""
    source, target, rig = pair()
    quarter = Matrix.Rotation(np.pi / 2, 4, "X")
    target.obj.data.transform(quarter)
    target.store_known(source)
    walk(rig)
    transfer(source.obj, target.obj, kinds="groups,armature")
    angle, way = worst(scene, rig, target.obj.find_armature(), np.array(quarter)[:3, :3])
    assert angle < EXACT and way < 2e-3


def test_feet_stand_where_they_stood(scene):
    """While the source rests; the target's legs are apart at rest and come together."""
    source, target, rig = pair(poses="TA")
    walk(rig)
    transfer(source.obj, target.obj, kinds="groups,armature")
    own = target.obj.find_armature()
    # At frame 20 all swings are through zero, and the hips 0.04 higher than at rest.
    scene.frame_set(20)
    lifted = 0.04 * leg_of(own) / leg_of(rig)
    for name in ("foot.L", "foot.R"):
        assert head_of(own, name)[2] == pytest.approx(head_of(own, name, posed=False)[2] + lifted, abs=2e-3)


def test_a_mirroring_match_walks_in_a_mirror(scene):
    source, target, rig = pair(build="plain", poses="TA")
    vertices = target.made.vertices * (-1, 1, 1)
    target.obj.data.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    target.obj.data.flip_normals()
    target.store_known(source)
    walk(rig)
    transfer(source.obj, target.obj, kinds="groups,armature", mirror_names=True)
    own, mirror = target.obj.find_armature(), np.array((-1.0, 1.0, 1.0))
    sides = {"L": "R", "R": "L"}
    for frame in FRAMES:
        scene.frame_set(frame)
        first, second = limbs(rig), limbs(own)
        for name, along in first.items():
            other = name[:-1] + sides[name[-1]] if name[-2:-1] == "." else name
            assert apart(along * mirror, second[other]) < EXACT


def test_actions_play_as_they_are_on_request(scene):
    source, target, rig = pair(scale=0.01)
    walk(rig)
    transfer(source.obj, target.obj, kinds="groups,armature", fit_animation=False)
    own = target.obj.find_armature()
    assert own.animation_data.action == rig.animation_data.action and notice.done().endswith(", 1 action")
    for frame in FRAMES:
        scene.frame_set(frame)
        for bone, other in zip(rig.pose.bones, own.pose.bones, strict=True):
            np.testing.assert_array_equal(bone.matrix_basis, other.matrix_basis)
    # Metres are metres: places of the hips are as far apart as on the source.
    places = []
    for frame in (1, 20):
        scene.frame_set(frame)
        places.append([head_of(each, "hips") for each in (rig, own)])
    way = np.linalg.norm(np.subtract(*places), axis=1)
    assert way[1] == pytest.approx(way[0], rel=1e-3)
    # And fitted again, and back.
    transfer(source.obj, target.obj, kinds="armature")
    assert worst(scene, rig, own)[0] < EXACT
    transfer(source.obj, target.obj, kinds="armature", fit_animation=False)
    assert bpy.data.actions[:] == [rig.animation_data.action]


def test_bones_that_only_rest_are_turned_too(scene):
    """An action of the hips alone: arms of the target go from their rest to that of the source."""
    source, target, rig = pair()
    walk(rig, only=("hips",))
    transfer(source.obj, target.obj, kinds="groups,armature")
    assert worst(scene, rig, target.obj.find_armature())[0] < EXACT


def test_an_action_that_is_laid_over_another_moves_no_other_bones(scene):
    source, target, rig = pair()
    walk(rig, only=("hips", "thigh.L", "thigh.R"))
    held = rig.animation_data
    base, held.action = held.action, None
    held.nla_tracks.new().strips.new("Base", 1, base)
    walk(rig, only=("upper_arm.L",))
    over, held.action = held.action, None
    held.nla_tracks.new().strips.new("Over", 1, over)
    transfer(source.obj, target.obj, kinds="groups,armature")
    own = target.obj.find_armature()
    strips = [track.strips[0] for track in own.animation_data.nla_tracks]
    assert {curve.data_path for curve in curves_used(strips[1])} == {
        f'pose.bones["upper_arm.L"].{path}' for path in ("rotation_quaternion",)
    }
    assert len(curves_used(strips[0])) > len(curves_used(rig.animation_data.nla_tracks[0].strips[0]))
    assert worst(scene, rig, own)[0] < EXACT
    # The source's own are as they were.
    assert {strip.action for track in held.nla_tracks for strip in track.strips} == {base, over}


def test_animation_that_comes_later_is_fitted_to_the_rig_that_is_there(scene):
    source, target, rig = pair()
    transfer(source.obj, target.obj, kinds="groups,armature")
    own = target.obj.find_armature()
    assert own.animation_data is None
    walk(rig)
    transfer(source.obj, target.obj, kinds="armature")
    assert target.obj.find_armature() == own and worst(scene, rig, own)[0] < EXACT
    # An action of the artist on it stays.
    mine = own.animation_data.action = bpy.data.actions.new("Mine")
    turn_bone(own.pose.bones["head"], Euler((0.2, 0.0, 0.0)).to_quaternion(), 1)
    transfer(source.obj, target.obj, kinds="armature")
    assert own.animation_data.action == mine
