# SPDX-License-Identifier: GPL-3.0-or-later
"""Data carried across: onto a copy it comes back as it was, onto another mesh nothing is smeared."""

import bpy
import numpy as np
import pytest
import sgmds
from conftest import choose, lumpy, new_object, triangle_vertices

from addon import mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.operators import carry


def store_map(source, target, faces, barycentric):
    """Store a known map as the match, so that a test of transfer is not one of matching."""
    write_attribute(target.data, "match_face", "INT", "POINT", faces)
    write_attribute(target.data, "match_barycentric", "FLOAT_VECTOR", "POINT", barycentric)
    write_attribute(target.data, "match_confidence", "FLOAT", "POINT", np.ones(len(faces)))
    target.data.update()
    stored = target.data.spectral_match
    target.spectral_match_source = source
    stored.source_name, stored.grade = source.name, "green"
    stored.source_fingerprint = str(mesh_read.fingerprint(source.data))
    stored.target_fingerprint = str(mesh_read.fingerprint(target.data))


def store_identity(source, target):
    """Each vertex lies on the vertex of the same number; of the triangles there, the last is named."""
    triangles = triangle_vertices(source.data)
    face, corner = np.empty(len(source.data.vertices), int), np.empty(len(source.data.vertices), int)
    for k in range(3):
        face[triangles[:, k]], corner[triangles[:, k]] = np.arange(len(triangles)), k
    store_map(source, target, face, np.eye(3)[corner])


def store_nearest(source, target):
    """Each vertex lies on the nearest point of the source, both as they stand in object space."""
    from mathutils.bvhtree import BVHTree

    points, triangles = mesh_read.positions(source.data), triangle_vertices(source.data)
    tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist(), all_triangles=True)
    faces, weights = [], []
    for vertex in target.data.vertices:
        place, _, index, _ = tree.find_nearest(vertex.co)
        corners = points[triangles[index]].astype(float)
        solved = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), [*place, 1.0], rcond=None)[0]
        faces.append(index)
        weights.append(np.clip(solved, 0.0, 1.0) / np.clip(solved, 0.0, 1.0).sum())
    store_map(source, target, np.array(faces), np.array(weights))


def ball(name, segments, rings):
    """Blender's own UV sphere: one island, cut along a meridian, with a corner UV of its own at each pole."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=rings)
    bpy.context.object.name = name
    return bpy.context.object


def uv_of(obj):
    values = np.empty(len(obj.data.loops) * 2, np.float32)
    obj.data.uv_layers[0].uv.foreach_get("vector", values)
    return values.reshape(-1, 2)


def without_data(source, name):
    """A copy that has lost everything there is to carry."""
    copy = bpy.data.objects.new(name, source.data.copy())
    bpy.context.collection.objects.link(copy)
    copy.vertex_groups.clear()
    while copy.data.uv_layers:
        copy.data.uv_layers.remove(copy.data.uv_layers[0])
    while copy.data.color_attributes:
        copy.data.color_attributes.remove(copy.data.color_attributes[0])
    bpy.context.view_layer.update()
    return copy


def weights_of(obj):
    return {
        (vertex.index, obj.vertex_groups[entry.group].name): entry.weight
        for vertex in obj.data.vertices
        for entry in vertex.groups
    }


def transfer(source, target, **properties):
    choose(source, target)
    assert bpy.ops.spectral_match.transfer(**properties) == {"FINISHED"}


def test_uv_comes_back_on_a_copy_seams_and_poles_included(scene):
    source = ball("Source", 24, 12)
    target = without_data(source, "Target")
    store_identity(source, target)
    transfer(source, target)
    np.testing.assert_allclose(uv_of(target), uv_of(source), atol=1e-5)


def test_seams_stay_beside_the_cuts_of_a_layout(scene):
    """Those of the target, or in their place those carried from the source, that cut nothing."""
    source = ball("Source", 24, 12)
    target = without_data(source, "Target")
    store_identity(source, target)

    def seams(obj):
        values = np.empty(len(obj.data.edges), bool)
        obj.data.edges.foreach_get("use_seam", values)
        return values

    transfer(source, target, kinds="uv")
    cuts = seams(target)
    # Along the meridian, of 12 edges, and at each pole, where every face has a UV of its own.
    assert 10 <= cuts.sum() < 0.2 * len(cuts)
    given, own = np.random.default_rng(9).random((2, len(cuts))) < 0.2
    source.data.edges.foreach_set("use_seam", given)
    target.data.edges.foreach_set("use_seam", own)
    transfer(source, target, kinds="uv")
    np.testing.assert_array_equal(seams(target), own | cuts)
    for _ in range(2):
        transfer(source, target, kinds="marks,uv")
        np.testing.assert_array_equal(seams(target), given | cuts)


def test_no_face_spans_a_seam_of_another_mesh(scene):
    """Around the ball u runs once from 0 to 1: a smeared face would be wide in u, whichever way it is cut."""
    source, target = ball("Source", 48, 24), ball("Target", 31, 17)
    target.data.uv_layers.remove(target.data.uv_layers[0])
    store_nearest(source, target)
    transfer(source, target)
    uv = uv_of(target)
    starts = mesh_read.face_starts(target.data)
    width = np.array([np.ptp(uv[a:b, 0]) for a, b in zip(starts[:-1], starts[1:], strict=True)])
    # A face of the target is 1/31 wide; next to the poles the chart itself is stretched without bound.
    middle = np.array([abs(face.center.z) < 0.9 for face in target.data.polygons])
    assert width[middle].max() < 1.5 / 31
    height = np.array([np.ptp(uv[a:b, 1]) for a, b in zip(starts[:-1], starts[1:], strict=True)])
    assert height.max() < 1.5 / 17


def test_no_face_mixes_islands(scene):
    """Six islands far apart: every target face lies in the surroundings of one."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    bpy.context.view_layer.objects.active = source
    layer = source.data.uv_layers.new(name="UVMap")
    side = np.arange(len(faces)) // (len(faces) // 6)
    for face in source.data.polygons:
        for corner in face.loop_indices:
            x, y, z = source.data.vertices[source.data.loops[corner].vertex_index].co
            flat = {0: (y, z), 1: (x, z), 2: (x, y)}[side[face.index] // 2]
            layer.uv[corner].vector = (flat[0] * 0.1 + 10.0 * side[face.index], flat[1] * 0.1)
    target = new_object("Target", *lumpy(9))
    store_nearest(source, target)
    transfer(source, target)
    uv, starts = uv_of(target), mesh_read.face_starts(target.data)
    island = np.round(uv[:, 0] / 10.0)
    for a, b in zip(starts[:-1], starts[1:], strict=True):
        assert np.ptp(island[a:b]) == 0
        assert np.ptp(uv[a:b, 0]) < 0.2


def test_islands_hang_together_at_common_uv():
    triangles = np.array([[0, 1, 2], [2, 1, 3], [3, 4, 5]])
    uv = np.array([[[0, 0], [1, 0], [0, 1]], [[0, 1], [1, 0], [1, 1]], [[5, 5], [6, 5], [5, 6]]], float)
    island = sgmds.uv_islands(np.eye(6, 3), triangles, uv)
    assert island[0] == island[1] != island[2]


def test_weights_come_back_on_a_copy(scene):
    source = ball("Source", 16, 8)
    rng = np.random.default_rng(1)
    for name in ("Bone.L", "Bone.R", "Pin"):
        group = source.vertex_groups.new(name=name)
        for vertex in rng.choice(len(source.data.vertices), 40, replace=False).tolist():
            group.add([vertex], float(rng.uniform(0.1, 1.0)), "REPLACE")
    target = without_data(source, "Target")
    target.vertex_groups.new(name="Own").add([3], 0.25, "REPLACE")
    store_identity(source, target)
    for _ in range(2):
        transfer(source, target)
        carried = weights_of(target)
        assert carried.pop((3, "Own")) == pytest.approx(0.25)
        assert carried == pytest.approx(weights_of(source), abs=1e-6)


def test_limited_weights_keep_their_sum(scene):
    source, target = ball("Source", 16, 8), ball("Target", 21, 13)
    rng = np.random.default_rng(2)
    share = rng.dirichlet(np.ones(7), len(source.data.vertices))
    for k in range(7):
        group = source.vertex_groups.new(name=f"Bone {k}")
        for vertex, weight in enumerate(share[:, k].tolist()):
            group.add([vertex], weight, "REPLACE")
    store_nearest(source, target)
    scene.spectral_match.limit_total = True
    transfer(source, target)
    rows = [[entry.weight for entry in vertex.groups] for vertex in target.data.vertices]
    assert max(map(len, rows)) == 4
    np.testing.assert_allclose([sum(row) for row in rows], 1.0, atol=1e-6)


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
@pytest.mark.parametrize("data_type", ["FLOAT_COLOR", "BYTE_COLOR"])
def test_colours_come_back_on_a_copy(scene, domain, data_type):
    """In the corner domain every face has a colour of its own: the hardest borders there are."""
    source = ball("Source", 16, 8)
    layer = source.data.color_attributes.new("Paint", data_type, domain)
    rng = np.random.default_rng(3)
    if domain == "POINT":
        colours = rng.random((len(source.data.vertices), 4), np.float32)
    else:
        starts = mesh_read.face_starts(source.data)
        colours = np.repeat(rng.random((len(starts) - 1, 4), np.float32), np.diff(starts), axis=0)
    if data_type == "FLOAT_COLOR":
        # Numbers that are no colours are kept in them, too.
        colours = 4.0 * colours - 2.0
    layer.data.foreach_set("color", colours.ravel())
    target = without_data(source, "Target")
    store_identity(source, target)
    transfer(source, target)
    carried = target.data.color_attributes["Paint"]
    assert (carried.domain, carried.data_type) == (domain, data_type)
    # Bytes are rounded once more on the way.
    tolerance = 1e-5 if data_type == "FLOAT_COLOR" else 0.01
    np.testing.assert_allclose(read_attribute(carried), read_attribute(layer), atol=tolerance)


def test_unchecked_items_stay_behind(scene):
    source = ball("Source", 16, 8)
    source.vertex_groups.new(name="Keep").add([0], 1.0, "REPLACE")
    source.vertex_groups.new(name="Leave").add([0], 1.0, "REPLACE")
    target = without_data(source, "Target")
    store_identity(source, target)
    bpy.ops.spectral_match.toggle_item(item="groups/Leave")
    scene.spectral_match.use_uv = False
    transfer(source, target)
    assert [group.name for group in target.vertex_groups] == ["Keep"] and not target.data.uv_layers


def test_scripts_name_the_kinds(scene):
    source = ball("Source", 16, 8)
    target = without_data(source, "Target")
    store_identity(source, target)
    choose(source, target)
    with pytest.raises(RuntimeError, match="There are: groups, keys, marks, normals, uv"):
        bpy.ops.spectral_match.transfer(kinds="hair")
    transfer(source, target, kinds="uv")
    assert target.data.uv_layers and not target.vertex_groups


def test_other_topology_is_refused_in_words(scene):
    source = ball("Source", 16, 8)
    target = without_data(source, "Target")
    store_identity(source, target)
    target.data.spectral_match.target_fingerprint = "other:other"
    choose(source, target)
    with pytest.raises(RuntimeError, match="Match again"):
        bpy.ops.spectral_match.transfer()


def test_ninth_uv_map_is_refused_in_words(scene):
    source = ball("Source", 16, 8)
    source.data.uv_layers[0].name = "New"
    target = without_data(source, "Target")
    while len(target.data.uv_layers) < 8:
        target.data.uv_layers.new(name=f"Own {len(target.data.uv_layers)}")
    store_identity(source, target)
    choose(source, target)
    with pytest.raises(RuntimeError, match="Remove one"):
        bpy.ops.spectral_match.transfer()


def known_pair():
    source = new_object("Source", *lumpy(4))
    target = without_data(source, "Target")
    store_identity(source, target)
    choose(source, target)
    return source, target


def test_what_the_core_refuses_is_said_in_words(scene, monkeypatch):
    def refuses(*_):
        raise sgmds.SgmdsError("nothing finite")

    known_pair()
    monkeypatch.setattr(carry, "carry_all", refuses)
    with pytest.raises(RuntimeError) as refused:
        bpy.ops.spectral_match.transfer()
    assert "Traceback" not in str(refused.value)
    assert notice.words == "Nothing was carried from 'Source' to 'Target': nothing finite"


def test_removed_attribute_is_said_in_words(scene):
    _, target = known_pair()
    target.data.attributes.remove(target.data.attributes["match_confidence"])
    with pytest.raises(RuntimeError, match="was removed from its attributes"):
        bpy.ops.spectral_match.transfer()


def test_another_source_than_the_matched_one_is_refused(scene):
    source, target = known_pair()
    source.vertex_groups.new(name="Group").add([0], 1.0, "REPLACE")
    choose(new_object("Other", *lumpy(4)), target)
    with pytest.raises(RuntimeError, match="'Target' was matched with 'Source'"):
        bpy.ops.spectral_match.transfer()
    assert not target.vertex_groups
    # Alone, the target means the source that it was matched with.
    choose(target)
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"} and target.vertex_groups


def test_unknown_item_is_refused_in_words(scene):
    source, target = known_pair()
    source.vertex_groups.new(name="Hand.L").add([0], 1.0, "REPLACE")
    with pytest.raises(RuntimeError, match="'Source' does not have groups/Hnad.L"):
        bpy.ops.spectral_match.transfer(items="groups/Hand.L\ngroups/Hnad.L")
    assert not target.vertex_groups
    assert bpy.ops.spectral_match.transfer(items="groups/Hand.L") == {"FINISHED"} and target.vertex_groups


def test_refused_transfer_leaves_dynamic_topology_on(scene):
    source, target = known_pair()
    bpy.ops.spectral_match.pin()
    choose(target)
    bpy.ops.object.mode_set(mode="SCULPT")
    bpy.ops.sculpt.dynamic_topology_toggle()
    with pytest.raises(RuntimeError, match="Leave Sculpt Mode first"):
        bpy.ops.spectral_match.transfer()
    assert target.mode == "SCULPT" and target.use_dynamic_topology_sculpting
