# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair, curves and texts on a character, and what constraints tie to it, across a known map."""

import bpy
import numpy as np
import pytest
from conftest import lumpy, new_object, renumbered, turned
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree
from test_transfer import ball, store_identity, store_nearest, transfer
from test_transfer_kinds import add_bone, copies_of, rigged, small_ball, store_copy, uv_cube

from addon import mesh_read, notice
from addon.mesh_write import read_attribute, write_attribute
from addon.transfer import companions

# The target of `grown` is so much larger than the source.
SIZE = 2.5
ROTATION = (turned(np.eye(3)) - turned(np.zeros((1, 3)))).T


@pytest.fixture
def grown(scene):
    """A body and its turned, renumbered and larger copy; both have a UV map without seams."""
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    moved, other_faces, old = renumbered(vertices, faces)
    target = new_object("Target", SIZE * moved, other_faces)
    target.matrix_world = Matrix.LocRotScale(turned(np.zeros(3)), Matrix(ROTATION.tolist()), None)
    for obj, points in ((source, vertices), (target, moved)):
        flat = (points @ np.array([[0.2, 0.05], [0.03, 0.2], [0.1, -0.07]])).astype(np.float32)
        uv = flat[mesh_read.corner_vertices(obj.data)]
        obj.data.uv_layers.new(name="Attach").uv.foreach_set("vector", uv.ravel())
    store_copy(source, target, old)
    bpy.context.view_layer.update()
    return source, target, old, ROTATION


def grown_place(points):
    return turned(SIZE * np.asarray(points, np.float64))


def places_on(obj, count, seed=0):
    """Random points of an object's surface, and their UVs if it has a UV map."""
    rng = np.random.default_rng(seed)
    corners, _ = mesh_read.triangle_corners(obj.data)
    corners = corners[rng.integers(len(corners), size=count)]
    weights = rng.dirichlet(np.ones(3), size=count)
    points = mesh_read.positions(obj.data).astype(float)[mesh_read.corner_vertices(obj.data)[corners]]
    found = np.einsum("ik,ikc->ic", weights, points)
    if not obj.data.uv_layers:
        return found, None
    uv = np.empty(len(obj.data.loops) * 2, np.float32)
    obj.data.uv_layers[0].uv.foreach_get("vector", uv)
    return found, np.einsum("ik,ikc->ic", weights, uv.reshape(-1, 2)[corners])


def hair_on(source, surface=None, count=40, seed=1):
    """Hair curves of unequal lengths, rooted on the surface (the source), bent at random."""
    rng = np.random.default_rng(seed)
    surface = surface or source
    roots, uv = places_on(surface, count, seed)
    hair = bpy.data.hair_curves.new("Hair")
    if not hasattr(hair, "add_curves"):
        pytest.skip("Python cannot make hair curves in this Blender")
    sizes = rng.integers(2, 9, size=count)
    hair.add_curves(sizes.tolist())
    starts = np.cumsum(sizes) - sizes
    steps = 0.06 * rng.normal(size=(sizes.sum(), 3))
    for start, size, root in zip(starts, sizes, roots, strict=True):
        steps[start] = root
        steps[start : start + size] = np.cumsum(steps[start : start + size], axis=0)
    write_attribute(hair, "position", "FLOAT_VECTOR", "POINT", steps)
    write_attribute(hair, "radius", "FLOAT", "POINT", rng.uniform(0.001, 0.01, size=len(steps)))
    write_attribute(hair, "clump", "INT", "CURVE", np.arange(count) % 7)
    hair.surface = surface
    if uv is not None:
        hair.surface_uv_map = "Attach"
        write_attribute(hair, "surface_uv_coordinate", "FLOAT2", "CURVE", uv)
    obj = bpy.data.objects.new("Hair", hair)
    bpy.context.collection.objects.link(obj)
    obj.parent = source
    bpy.context.view_layer.update()
    return obj


def layer(obj, name):
    return read_attribute(obj.data.attributes[name])


def in_world(obj, points):
    return np.array([obj.matrix_world @ Vector(point) for point in points])


def asking(obj, seen):
    """A geometry nodes modifier that has an object as its input."""
    group = bpy.data.node_groups.new("Asks", "GeometryNodeTree")
    for way, kind in (("INPUT", "NodeSocketGeometry"), ("OUTPUT", "NodeSocketGeometry")):
        group.interface.new_socket("Geometry", in_out=way, socket_type=kind)
    socket = group.interface.new_socket("Surface", in_out="INPUT", socket_type="NodeSocketObject")
    modifier = obj.modifiers.new("Asks", "NODES")
    modifier.node_group = group
    modifier[socket.identifier] = seen
    return socket.identifier


def test_hair_on_a_grown_copy_is_the_grown_hair(grown):
    source, target, _, _ = grown
    hair = hair_on(source)
    socket = asking(hair, source)
    source.add_rest_position_attribute = True
    given = {one.name: read_attribute(one) for one in hair.data.attributes}
    # A layout of the target's own, beside the source's.
    for corner in target.data.uv_layers[0].uv:
        corner.vector[0] += 0.25
    for _ in range(2):
        transfer(source, target, kinds="objects")
    (copy,) = copies_of("Hair")
    assert copy.parent == target and copy.data != hair.data and copy.data.surface == target
    bpy.context.view_layer.update()
    # Single precision of places up to ten away.
    np.testing.assert_allclose(
        in_world(copy, layer(copy, "position")), grown_place(given["position"]), rtol=0.0, atol=5e-6
    )
    np.testing.assert_allclose(layer(copy, "radius"), SIZE * given["radius"], rtol=1e-6)
    np.testing.assert_array_equal(layer(copy, "clump"), given["clump"])
    # Roots are found again in single precision: a ten millionth of a body that is 0.4 of the layout wide.
    np.testing.assert_allclose(
        layer(copy, "surface_uv_coordinate"),
        given["surface_uv_coordinate"] + (0.25, 0.0),
        rtol=0.0,
        atol=1e-6,
    )
    # A body pressed flat lies twice in its layout.
    assert "overlapping area" in notice.words
    assert copy.data.surface_uv_map == "Attach" and target.add_rest_position_attribute
    assert copy.modifiers["Asks"][socket] == target and hair.modifiers["Asks"][socket] == source
    # The source's hair is as it was.
    assert (hair.data.surface, hair.parent) == (source, source)
    for name, values in given.items():
        np.testing.assert_array_equal(layer(hair, name), values)


def test_hair_that_a_broken_layout_cannot_attach_is_told_of(grown):
    source, target, _, _ = grown
    hair_on(source)
    target.data.uv_layers[0].uv[0].vector = (np.nan, 0.0)
    transfer(source, target, kinds="objects")
    assert "'Attach' of 'Target' has places that are no numbers" in notice.words
    assert len(copies_of("Hair")) == 1


def state_of_all():
    """What is in the file, where it is and what it hangs on."""
    bpy.context.view_layer.update()
    return {
        obj.name: (
            obj.type,
            tuple(map(tuple, obj.matrix_world)),
            obj.parent and obj.parent.name,
            obj.data.name,
            [constraint.name for constraint in obj.constraints],
            obj.add_rest_position_attribute,
        )
        for obj in bpy.data.objects
    }, [len(each) for each in (bpy.data.hair_curves, bpy.data.curves, bpy.data.meshes)]


def test_undo_takes_all_copies_back(grown):
    source, target, _, _ = grown
    rig = rigged(grown)
    hair_on(source)
    source.add_rest_position_attribute = True
    curve_object("Braid", "POLY", np.linspace((-1.0, -1.0, -1.5), (1.0, 0.8, 1.5), 7), source)
    tied("Hat", "CHILD_OF", source, rig, "High")
    before = state_of_all()
    bpy.ops.ed.undo_push(message="Before")
    transfer(source, target, kinds="groups,armature,objects")
    bpy.ops.ed.undo_push(message="Transfer")
    assert {"Hair Target", "Braid Target", "Hat Target"} <= set(bpy.data.objects.keys())
    bpy.ops.ed.undo()
    assert state_of_all() == before


def nodes_that_deform(obj):
    """The modifier of Blender's own hair: strands follow the surface that they are attached to."""
    group = bpy.data.node_groups.new("Deform", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes = [group.nodes.new(f"NodeGroup{end}") for end in ("Input", "Output")]
    deform = group.nodes.new("GeometryNodeDeformCurvesOnSurface")
    group.links.new(nodes[0].outputs[0], deform.inputs[0])
    group.links.new(deform.outputs[0], nodes[1].inputs[0])
    obj.modifiers.new("Deform", "NODES").node_group = group


def test_the_copy_of_hair_follows_the_target_when_it_is_posed(grown):
    """Deform Curves on Surface asks surface, UV map, coordinates and rest position."""
    source, target, _, _ = grown
    rig = rigged(grown)
    for obj in (source, target):
        obj.data.uv_layers.remove(obj.data.uv_layers[0])
    uv_cube(source, "Attach")
    hair = hair_on(source)
    nodes_that_deform(hair)
    source.add_rest_position_attribute = True
    transfer(source, target, kinds="groups,uv,armature,objects")
    assert "overlapping" not in notice.words
    (copy,) = copies_of("Hair")
    rest = in_world(copy, layer(copy, "position"))
    pose(rig, 1.0)
    pose(target.find_armature(), SIZE)
    graph = bpy.context.evaluated_depsgraph_get()
    before, after = (in_world(obj, layer(obj.evaluated_get(graph), "position")) for obj in (hair, copy))
    assert np.abs(after - rest).max() > 0.3
    # Blender turns strands as triangles turn, in single precision, of places up to ten away.
    np.testing.assert_allclose(after, grown_place(before), rtol=0.0, atol=2e-5)


def test_hair_edited_since_is_made_anew(grown):
    source, target, _, _ = grown
    hair = hair_on(source)
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Hair")
    hair.data.add_curves([3])
    position = layer(hair, "position")
    position[-3:] = position[0] + np.array([[0.0, 0, 0], [0, 0, 0.1], [0, 0, 0.2]])
    write_attribute(hair.data, "position", "FLOAT_VECTOR", "POINT", position)
    data = len(bpy.data.hair_curves)
    transfer(source, target, kinds="objects")
    assert copies_of("Hair") == [copy] and len(bpy.data.hair_curves) == data
    bpy.context.view_layer.update()
    found = in_world(copy, layer(copy, "position"))
    np.testing.assert_allclose(found, grown_place(position), rtol=0.0, atol=5e-6)


def test_strands_stand_on_another_surface_and_keep_their_shape(scene):
    """Balls of other faces and size: every strand is turned and scaled as a whole, its root on the target."""
    source, target = ball("Source", 48, 24), ball("Target", 31, 17)
    store_nearest(source, target)
    points = mesh_read.positions(target.data) * np.float32((1.0, 1.3, 0.8))
    target.data.vertices.foreach_set("co", points.ravel())
    target.data.spectral_match.target_fingerprint = str(mesh_read.fingerprint(target.data))
    hair = hair_on(source, count=60)
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Hair")
    before, after = (layer(obj, "position").astype(float) for obj in (hair, copy))
    first = [curve.first_point_index for curve in hair.data.curves]
    tree = BVHTree.FromPolygons(points.tolist(), [list(p.vertices) for p in target.data.polygons])
    # In single precision, in which the tree measures too.
    assert max(tree.find_nearest(after[i])[3] for i in first) < 2e-6
    scales = []
    for curve in hair.data.curves:
        part = slice(curve.first_point_index, curve.first_point_index + curve.points_length)
        apart = [np.linalg.norm(each[part, None] - each[None, part], axis=-1) for each in (before, after)]
        scales.append(apart[1].sum() / apart[0].sum())
        np.testing.assert_allclose(apart[1], scales[-1] * apart[0], rtol=0.0, atol=2e-6)
    # The body is wider here and lower there.
    assert 0.8 < min(scales) < 1.0 < max(scales) < 1.3


def test_strands_without_a_counterpart_are_told_of(grown):
    source, target, _, _ = grown
    hair = hair_on(source)
    transfer(source, target, kinds="objects")
    assert "counterpart" not in notice.words
    below = mesh_read.positions(target.data)[:, 2] < 0.0
    write_attribute(target.data, "match_confidence", "FLOAT", "POINT", np.where(below, 0.0, 1.0))
    transfer(source, target, kinds="objects")
    roots = layer(hair, "position")[[curve.first_point_index for curve in hair.data.curves]]
    told = int(notice.words.split(" of 40 strands")[0].split()[-1])
    # A face is a fifth long: strands nearer than that to the border have some confidence.
    assert (roots[:, 2] < -0.2).sum() <= told <= (roots[:, 2] < 0.0).sum() and told > 5


@pytest.mark.parametrize("own", [None, "Other"])
def test_a_missing_uv_map_of_the_surface_is_told_of(grown, own):
    source, target, _, _ = grown
    hair_on(source)
    target.data.uv_layers.remove(target.data.uv_layers[0])
    if own is not None:
        target.data.uv_layers.new(name=own)
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Hair")
    if own is None:
        assert "'Target' has none" in notice.words
        transfer(source, target, kinds="uv,objects")
        assert copy.data.surface_uv_map == "Attach" and "has none" not in notice.words
    else:
        assert "attached by 'Other'" in notice.words and copy.data.surface_uv_map == "Other"


def test_hair_on_a_scalp_stands_on_the_copy_of_the_scalp(grown):
    """Attached by its surface alone, the scalp by its parent."""
    source, target, _, _ = grown
    scalp = small_ball("Scalp", source)
    scalp.data.uv_layers[0].name = "Attach"
    hair = hair_on(source, scalp)
    hair.parent = None
    hair.matrix_world = scalp.matrix_world
    bpy.context.view_layer.update()
    given = in_world(hair, layer(hair, "position"))
    assert companions.names(source) == ["Hair", "Scalp"]
    for _ in range(2):
        transfer(source, target, kinds="objects")
    (copy,), (surface,) = copies_of("Hair"), copies_of("Scalp")
    assert copy.data.surface == surface and copy.parent == target
    for name in ("surface_uv_coordinate", "clump"):
        np.testing.assert_array_equal(layer(copy, name), layer(hair, name))
    np.testing.assert_allclose(in_world(copy, layer(copy, "position")), grown_place(given), atol=5e-6)


def test_hair_of_stretched_objects_is_right_in_the_world(grown):
    source, target, old, _ = grown
    for obj, scale in ((source, (1.0, 2.0, 0.5)), (target, (0.5, 0.7, 3.0))):
        obj.data.vertices.foreach_set("co", (mesh_read.positions(obj.data) / np.float32(scale)).ravel())
        obj.scale = scale
    bpy.context.view_layer.update()
    store_copy(source, target, old)
    hair = hair_on(source)
    given = in_world(hair, layer(hair, "position"))
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Hair")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(in_world(copy, layer(copy, "position")), grown_place(given), atol=1e-5)


def curve_object(name, kind, points, parent):
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new(kind)
    held = spline.bezier_points if kind == "BEZIER" else spline.points
    held.add(len(points) - 1)
    for element, place in zip(held, points.tolist(), strict=True):
        element.co[:3], element.radius = place, 0.7
        if kind == "NURBS":
            element.co[3] = 1.0
        if kind == "BEZIER":
            element.handle_left_type = element.handle_right_type = "FREE"
            element.handle_left, element.handle_right = np.add(place, 0.1), np.subtract(place, (0.1, 0, 0.05))
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    obj.parent = parent
    bpy.context.view_layer.update()
    return obj


def seen_points(obj):
    """The object's evaluated mesh in the world: what is seen of it."""
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    points = in_world(obj, [vertex.co for vertex in mesh.vertices])
    shown.to_mesh_clear()
    return points


@pytest.mark.parametrize("kind", ["BEZIER", "NURBS", "POLY"])
def test_long_curves_follow_point_by_point(grown, kind):
    source, target, _, _ = grown
    line = np.linspace((-1.0, -1.0, -1.5), (1.0, 0.8, 1.5), 7)
    curve = curve_object("Braid", kind, line, source)
    curve.shape_key_add(name="Basis", from_mix=False)
    waved = curve.shape_key_add(name="Wave", from_mix=False)
    # From Blender 5.0 on a new key is fully on.
    waved.value = 0.0
    for element in waved.data:
        element.co[0] += 0.2
    given = seen_points(curve)
    for _ in range(2):
        transfer(source, target, kinds="objects")
    (copy,) = copies_of("Braid")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(seen_points(copy), grown_place(given), atol=1e-5)
    (spline,) = copy.data.splines
    radii = [element.radius for element in (spline.bezier_points or spline.points)]
    np.testing.assert_allclose(radii, 0.7 * SIZE, rtol=1e-6)
    for obj in (curve, copy):
        obj.data.shape_keys.key_blocks["Wave"].value = 1.0
    bpy.context.view_layer.update()
    moved = seen_points(curve)
    assert np.abs(moved - given).max() > 0.1
    np.testing.assert_allclose(seen_points(copy), grown_place(moved), atol=1e-5)


def test_curves_edited_since_are_made_anew(grown):
    source, target, _, _ = grown
    line = np.linspace((-1.0, -1.0, -1.5), (1.0, 0.8, 1.5), 7)
    curve = curve_object("Braid", "POLY", line, source)
    transfer(source, target, kinds="objects")
    (copy,) = copies_of("Braid")
    data = copy.data
    data.bevel_depth = 0.3
    transfer(source, target, kinds="objects")
    # What the copy was given of its own stays.
    assert copy.data == data and copy.data.bevel_depth == np.float32(0.3)
    curve.data.splines.new("BEZIER").bezier_points[0].co = (0.5, 0.0, 2.0)
    count = len(bpy.data.curves)
    transfer(source, target, kinds="objects")
    assert copies_of("Braid") == [copy] and len(bpy.data.curves) == count
    found = in_world(copy, [copy.data.splines[1].bezier_points[0].co])
    np.testing.assert_allclose(found, grown_place([(0.5, 0.0, 2.0)]), atol=1e-5)


def test_large_surfaces_follow_point_by_point(grown):
    source, target, _, _ = grown
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=0.9)
    bubble = bpy.context.object
    bubble.parent = source
    given = seen_points(bubble)
    transfer(source, target, kinds="objects")
    (copy,) = copies_of(bubble.name)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(seen_points(copy), grown_place(given), atol=1e-5)


def test_hair_and_texts_are_mirrored_by_a_mirroring_match(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    # Turned over, with the same diagonals.
    target = new_object("Target", vertices * (-1, 1, 1), [[a, d, c, b] for a, b, c, d in faces])
    store_identity(source, target)
    hair, text = hair_on(source), badge(source)
    given = seen_points(text)
    transfer(source, target, kinds="objects")
    (copy,), (mirrored,) = copies_of("Hair"), copies_of("Badge")
    bpy.context.view_layer.update()
    # Single precision of places up to two away.
    np.testing.assert_allclose(layer(copy, "position"), layer(hair, "position") * (-1, 1, 1), atol=2e-6)
    np.testing.assert_allclose(seen_points(mirrored), given * (-1, 1, 1), atol=1e-5)


def badge(parent):
    """A text across the body."""
    text = bpy.data.objects.new("Badge", bpy.data.curves.new("Badge", "FONT"))
    text.data.body, text.data.size, text.data.extrude = "Ab", 0.4, 0.02
    bpy.context.collection.objects.link(text)
    text.parent, text.location, text.rotation_euler = parent, (0.2, -0.9, 0.3), (1.2, 0.2, 0.1)
    bpy.context.view_layer.update()
    return text


def test_texts_and_small_curves_follow_as_a_whole(grown):
    source, target, _, _ = grown
    text = badge(source)
    ring = curve_object("Ring", "POLY", 0.05 * np.eye(3) + (0.5, 0.4, 0.9), source)
    ring.data.extrude = 0.03
    bpy.context.view_layer.update()
    given = {obj.name: seen_points(obj) for obj in (text, ring)}
    for _ in range(2):
        transfer(source, target, kinds="objects")
    for name, points in given.items():
        (copy,) = copies_of(name)
        bpy.context.view_layer.update()
        assert len(points) and copy.parent == target
        np.testing.assert_allclose(seen_points(copy), grown_place(points), atol=1e-5)


def tied(name, kind, source, rig, bone="", **settings):
    """A ball that only a constraint ties to a rig or bone; it stays where it was."""
    obj = small_ball(name)
    constraint = obj.constraints.new(kind)
    if kind == "ARMATURE":
        for each in bone.split(","):
            seen = constraint.targets.new()
            seen.target, seen.subtarget = rig, each
    else:
        constraint.target, constraint.subtarget = rig, bone
    for setting, value in settings.items():
        setattr(constraint, setting, value)
    if kind == "CHILD_OF":
        constraint.set_inverse_pending = True
    bpy.context.view_layer.update()
    return obj


def shown_world(obj):
    bpy.context.view_layer.update()
    return in_world(obj, [vertex.co for vertex in obj.data.vertices])


def pose(rig, size):
    """A pose of both bones of a rig that is so much larger than the source's; size 0 is the rest."""
    turns = (0.5, 0.8) if size else (0.0, 0.0)
    for name, turn in zip(("Low", "High"), turns, strict=True):
        rig.pose.bones[name].matrix_basis = Matrix.Rotation(turn, 4, "X")
    rig.pose.bones["Low"].location = (0.1 * size, 0.0, 0.2 * size)
    bpy.context.view_layer.update()


TIES = {
    "Child": ("CHILD_OF", "High", {}),
    "Loose": ("CHILD_OF", "High", {f"use_scale_{axis}": False for axis in "xyz"}),
    "Half": ("CHILD_OF", "High", {f"use_rotation_{axis}": False for axis in "xyz"}),
    "Strap": ("ARMATURE", "Low,High", {}),
    "Whole": ("COPY_TRANSFORMS", "High", {}),
    "Body": ("CHILD_OF", "", {}),
}


@pytest.mark.parametrize("posed", [False, True])
@pytest.mark.parametrize("name", TIES)
def test_what_a_constraint_ties_stays_and_moves_with_the_bone(grown, name, posed):
    """The copy rests in its place and goes with the bone as the source's does, also from a posed source."""
    source, target, _, _ = grown
    rig = rigged(grown)
    kind, bone, settings = TIES[name]
    hat = tied(name, kind, source, rig if bone else source, bone, **settings)
    rest = shown_world(hat)
    pose(rig, 1.0)
    moved = shown_world(hat)
    assert bone == "" or np.abs(moved - rest).max() > 0.1
    if not posed:
        pose(rig, 0.0)
    assert companions.names(source) == [name]
    before = hat.matrix_world.copy()
    for _ in range(2):
        transfer(source, target, kinds="groups,armature,objects")
    fitted, (copy,) = target.find_armature(), copies_of(name)
    pose(fitted, 0.0)
    np.testing.assert_allclose(shown_world(copy), grown_place(rest), atol=2e-5)
    constraints = [constraint.type for constraint in copy.constraints]
    if kind == "COPY_TRANSFORMS":
        assert constraints == [] and (copy.parent, copy.parent_bone) == (fitted, "High")
        assert "Copy Transforms of 'Whole'" in notice.words
    else:
        assert constraints == [kind] and copy.parent is None and "Constraints" not in notice.words
        looks = copy.constraints[0].targets if kind == "ARMATURE" else copy.constraints
        assert {look.target for look in looks} == {fitted if bone else target}
    pose(fitted, SIZE)
    np.testing.assert_allclose(shown_world(copy), grown_place(moved), atol=5e-5)
    # The source's own is as it was.
    assert [c.type for c in hat.constraints] == [kind] and hat.matrix_world == before


def test_constraints_come_with_a_rig_that_is_carried_later(grown):
    source, target, _, _ = grown
    rig = rigged(grown)
    hat = tied("Hat", "CHILD_OF", source, rig, "High")
    rest = shown_world(hat)
    transfer(source, target, kinds="groups,objects")
    (copy,) = copies_of("Hat")
    assert copy.parent == target and not copy.constraints and "Child Of of 'Hat'" in notice.words
    np.testing.assert_allclose(shown_world(copy), grown_place(rest), atol=2e-5)
    transfer(source, target, kinds="groups,armature,objects")
    assert copies_of("Hat") == [copy] and copy.parent is None
    assert copy.constraints["Child Of"].target == target.find_armature()
    np.testing.assert_allclose(shown_world(copy), grown_place(rest), atol=2e-5)


def test_constraints_look_at_copies_of_other_objects(grown):
    """A feather on a hat on a bone, in the order in which the feather comes first."""
    source, target, _, _ = grown
    rig = rigged(grown)
    hat = tied("Hat", "CHILD_OF", source, rig, "High")
    feather = tied("Feather", "CHILD_OF", source, hat)
    free = small_ball("Free", source)
    free.constraints.new("CHILD_OF").target = small_ball("Stone")
    muted = tied("Muted", "CHILD_OF", source, rig, "High", mute=True)
    rest = shown_world(feather)
    assert companions.names(source) == ["Feather", "Free", "Hat"] and muted.constraints[0].mute
    transfer(source, target, kinds="groups,armature,objects")
    assert "Child Of of 'Free'" in notice.words
    fitted, (copy,), (other,) = target.find_armature(), copies_of("Feather"), copies_of("Hat")
    assert copy.constraints[0].target == other and not copies_of("Free")[0].constraints
    np.testing.assert_allclose(shown_world(copy), grown_place(rest), atol=2e-5)
    for armature in (rig, fitted):
        armature.pose.bones["High"].matrix_basis = Matrix.Rotation(0.8, 4, "X")
    np.testing.assert_allclose(shown_world(copy), grown_place(shown_world(feather)), atol=5e-5)


def test_what_hangs_on_something_tied_hangs_on_its_strongest_bone(grown):
    source, target, _, _ = grown
    rig = rigged(grown)
    strap = tied("Strap", "ARMATURE", source, rig, "Low,High")
    strap.constraints[0].targets[0].weight = 0.3
    small_ball("Buckle", strap)
    transfer(source, target, kinds="groups,armature,objects")
    (buckle,) = copies_of("Buckle")
    assert (buckle.parent, buckle.parent_bone) == (target.find_armature(), "High")


def test_a_constraint_to_a_vertex_group_is_told_of(grown):
    source, target, _, _ = grown
    rigged(grown)
    patch = tied("Patch", "CHILD_OF", source, source, "Low")
    rest = shown_world(patch)
    transfer(source, target, kinds="groups,objects")
    (copy,) = copies_of("Patch")
    assert "Child Of of 'Patch'" in notice.words and copy.parent == target and not copy.constraints
    np.testing.assert_allclose(shown_world(copy), grown_place(rest), atol=2e-5)


def test_names_of_bones_in_constraints_are_mirrored(scene):
    vertices, faces = lumpy()
    source = new_object("Source", vertices, faces)
    target = new_object("Target", vertices * (-1, 1, 1), [face[::-1] for face in faces])
    store_identity(source, target)
    rig = rigged((source, target, None, None))
    add_bone(rig, "Hand.R", (0.3, 0.1, 0.2), (0.4, 0.1, 0.3))
    tied("Ring", "CHILD_OF", source, rig, "Hand.R")
    tied("Glove", "ARMATURE", source, rig, "Hand.R")
    transfer(source, target, kinds="groups,armature,objects", mirror_names=True)
    (ring,), (glove,) = copies_of("Ring"), copies_of("Glove")
    assert ring.constraints[0].subtarget == glove.constraints[0].targets[0].subtarget == "Hand.L"


def test_metaballs_and_particle_hair_are_named(grown):
    source, target, _, _ = grown
    small_ball("Eye", source)
    drop = bpy.data.objects.new("Drop", bpy.data.metaballs.new("Drop"))
    bpy.context.collection.objects.link(drop)
    drop.parent = source
    fur = source.modifiers.new("Fur", "PARTICLE_SYSTEM")
    fur.particle_system.settings.type = "HAIR"
    transfer(source, target, kinds="objects")
    assert "'Drop', Fur of 'Source'" in notice.words
