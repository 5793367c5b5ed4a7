# SPDX-License-Identifier: GPL-3.0-or-later
"""Animation that is carried: shape keys move on the target as they do on the source."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object
from test_transfer import store_identity, transfer

from addon import notice
from addon.transfer.actions import curves_used

FRAMES = np.linspace(-3.0, 45.0, 25)


@pytest.fixture
def faces(scene):
    """Two like bodies; the source smiles and blinks by keys."""
    vertices, polygons = lumpy(6)
    source, target = new_object("Source", vertices, polygons), new_object("Target", vertices, polygons)
    store_identity(source, target)
    source.shape_key_add(name="Basis", from_mix=False)
    for name in ("Smile", "Blink.L"):
        key = source.shape_key_add(name=name, from_mix=False)
        key.slider_max = 3.0
        key.data.foreach_set("co", (vertices + 0.1).astype(np.float32).ravel())
    return source, target


def animate(obj, name, values, setting="value"):
    """Keys of different kinds at these frames."""
    block = obj.data.shape_keys.key_blocks[name]
    for frame, value in values.items():
        setattr(block, setting, value)
        block.keyframe_insert(setting, frame=frame)
    (curve,) = [c for c in curves_used(obj.data.shape_keys.animation_data) if name in c.data_path]
    for point, interpolation in zip(curve.keyframe_points, ("BEZIER", "ELASTIC", "CONSTANT"), strict=False):
        point.interpolation = interpolation
        point.handle_right_type = "FREE"
        point.handle_right = (point.co.x + 3.0, point.co.y + 0.4)
    return curve


def shown(obj, name, scene):
    """A key's value, as shown, at all frames."""
    values = []
    for frame in FRAMES.tolist():
        scene.frame_set(int(np.floor(frame)), subframe=frame % 1.0)
        values.append(obj.data.shape_keys.key_blocks[name].value)
    return values


def test_keys_move_as_those_of_the_source(faces, scene):
    source, target = faces
    animate(source, "Smile", {1: 0.0, 10: 1.0, 20: 0.3})
    curve = animate(source, "Blink.L", {5: 0.2, 15: 0.9})
    modifier = curve.modifiers.new("CYCLES")
    modifier.mode_after = "REPEAT_OFFSET"
    for _ in range(2):
        transfer(source, target, kinds="keys")
        for name in ("Smile", "Blink.L"):
            assert np.ptp(shown(source, name, scene)) > 0.5
            np.testing.assert_array_equal(shown(target, name, scene), shown(source, name, scene))
        assert notice.done() == "Done: 2 keys, 1 action"
    # A copy of the source's, which stays as it is, and one at both times.
    actions = [obj.data.shape_keys.animation_data.action for obj in (source, target)]
    assert actions[0] != actions[1] and set(bpy.data.actions) == set(actions)
    assert len(curves_used(source.data.shape_keys.animation_data)) == 2


def test_only_curves_of_carried_keys_come_by_their_names_on_the_target(faces, scene):
    source, target = faces
    animate(source, "Smile", {1: 0.0, 10: 1.0})
    animate(source, "Blink.L", {1: 0.3, 10: 0.0})
    transfer(source, target, items="keys/Blink.L", mirror_names=True)
    assert notice.done() == "Done: 1 key, 1 action"
    (curve,) = curves_used(target.data.shape_keys.animation_data)
    assert curve.data_path == 'key_blocks["Blink.R"].value'
    values = shown(target, "Blink.R", scene)
    np.testing.assert_array_equal(values, shown(source, "Blink.L", scene))


def test_animation_of_the_target_s_other_keys_stays(faces, scene):
    """In an action that the artist may use elsewhere, and that stays as it is."""
    source, target = faces
    animate(source, "Smile", {1: 0.0, 10: 1.0})
    target.shape_key_add(name="Basis", from_mix=False)
    for name in ("Own", "Smile"):
        target.shape_key_add(name=name, from_mix=False)
        animate(target, name, {2: 0.0, 30: 0.5})
    own = target.data.shape_keys.animation_data.action
    before = shown(target, "Own", scene)
    for _ in range(2):
        transfer(source, target, kinds="keys")
        np.testing.assert_array_equal(shown(target, "Own", scene), before)
        np.testing.assert_array_equal(shown(target, "Smile", scene), shown(source, "Smile", scene))
    assert own.name in bpy.data.actions and own.use_fake_user
    assert target.data.shape_keys.animation_data.action != own
    assert len(bpy.data.actions) == 3


def test_strips_come_along(faces, scene):
    source, target = faces
    animate(source, "Smile", {1: 0.0, 10: 1.0, 20: 0.3})
    held = source.data.shape_keys.animation_data
    action, held.action = held.action, None
    track = held.nla_tracks.new()
    track.name = "Performance"
    for start, scale, influence in ((3, 0.5, 1.0), (20, 1.0, 0.6)):
        strip = track.strips.new(action.name, start, action)
        strip.scale, strip.influence, strip.blend_in = scale, influence, 2.0
    for _ in range(2):
        transfer(source, target, kinds="keys")
        np.testing.assert_array_equal(shown(target, "Smile", scene), shown(source, "Smile", scene))
        assert np.ptp(shown(target, "Smile", scene)) > 0.5
    assert [track.name for track in target.data.shape_keys.animation_data.nla_tracks] == ["Performance"]
    assert len(bpy.data.actions) == 3


@pytest.mark.skipif(bpy.app.version < (4, 4), reason="slots are of Blender 4.4")
def test_of_an_action_for_several_objects_the_keys_slot_is_taken(faces, scene):
    source, target = faces
    animate(source, "Smile", {1: 0.0, 10: 1.0})
    held = source.data.shape_keys.animation_data
    source.animation_data_create().action = held.action
    source.animation_data.action_slot = held.action.slots.new(id_type="OBJECT", name="Body")
    source.keyframe_insert("location", frame=4)
    transfer(source, target, kinds="keys")
    made = target.data.shape_keys.animation_data
    assert [slot.target_id_type for slot in made.action.slots] == ["KEY"]
    assert [curve.data_path for curve in curves_used(made)] == ['key_blocks["Smile"].value']
    np.testing.assert_array_equal(shown(target, "Smile", scene), shown(source, "Smile", scene))
