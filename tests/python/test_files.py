"""Mesh files: the vertex order of the file, polygons fanned, damaged files named."""

import gzip
import json
import struct
import sys

import numpy as np
import pytest
from sgmds import MeshError, files
from sgmds.files import read_mesh

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FAN = np.array([[0, 1, 2], [0, 2, 3]])


def same(path, vertices=SQUARE, faces=FAN):
    read_vertices, read_faces = read_mesh(path)
    assert read_vertices.dtype == np.float64 and read_faces.dtype == np.int64
    # float32 in binary files
    np.testing.assert_allclose(read_vertices, vertices, rtol=1e-6)
    # A reader may start a triangle at another corner, not turn it round.
    turned = [np.roll(read_faces, shift, axis=1) for shift in range(3)]
    assert all(any((t[i] == face).all() for t in turned) for i, face in enumerate(faces))


TEXTS = {
    "plain.off": "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    "one_line_header.off": "OFF 4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
    "comments.off": "OFF\n# made by hand\n4 2 0\n0 0 0\n1 0 0 # right\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
    "faces_in_colour.off": "COFF\n4 2 0\n0 0 0 9 9 9 9\n1 0 0 9 9 9 9\n1 1 0 9 9 9 9\n0 1 0 9 9 9 9\n"
    "3 0 1 2 255 0 0\n3 0 2 3 0.1 0.2 0.3\n",
    "marked.off": "\ufeffOFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    "marked.obj": "\ufeffv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    "old_mac.obj": "v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3 4\r",
    "comments.obj": "v 0 0 0 # first\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 # all\n",
    "positions.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    "negative.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n",
    "continued.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n3 4\n",
    "seams.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\nvn 0 0 1\n"
    "f 1/1/1 2/2/1 3/3/1\nf 1/5/1 3/4/1 4/1/1\n",
    "text.ply": "ply\nformat ascii 1.0\nelement vertex 4\n"
    "property float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("zipped", [False, True])
def test_text_formats(tmp_path, name, zipped):
    path = tmp_path / (name + (".gz" if zipped else ""))
    data = TEXTS[name].encode()
    path.write_bytes(gzip.compress(data) if zipped else data)
    same(path)


def test_windows_line_ends(tmp_path):
    path = tmp_path / "square.OBJ"
    path.write_bytes(TEXTS["positions.obj"].replace("\n", "\r\n").encode())
    same(path)


def test_binary_ply_keeps_order_and_unused_vertices(tmp_path):
    vertices = np.concatenate([[[9, 9, 9]], SQUARE, [[8, 8, 8]]])
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
        "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    body = vertices.astype("<f4").tobytes()
    body += b"".join(
        struct.pack("<B3i", 3, *(face + 1)) for face in FAN.tolist() for face in [np.array(face)]
    )
    path = tmp_path / "square.ply"
    path.write_bytes(header.encode() + body)
    same(path, vertices, FAN + 1)


MIXED = [[0, 1, 4, 2, 3], [1, 4, 2], [0, 1, 2, 3]]
MIXED_CORNERS = np.concatenate([SQUARE, [[2, 0.5, 0]]])
MIXED_TRIANGLES = [[0, 1, 4], [0, 4, 2], [0, 2, 3], [1, 4, 2], [0, 1, 2], [0, 2, 3]]


def ply(form, faces, vertex="", face=""):
    """Header of a PLY with further properties of vertices and faces."""
    return (
        f"ply\nformat {form} 1.0\ncomment TextureFile skin.png\nelement vertex 5\nproperty float x\n"
        f"property float y\nproperty float z\n{vertex}element face {faces}\n"
        f"property list uchar int vertex_indices\n{face}end_header\n"
    )


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_of_several_sizes_of_polygons(tmp_path, order):
    """What Blender writes of any character: triangles and quads, and a UV at each vertex."""
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    data = ply(form, 3, "property float s\nproperty float t\n").encode()
    data += b"".join(struct.pack(order + "5f", *v, *v[:2]) for v in MIXED_CORNERS)
    data += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in MIXED)
    path = tmp_path / "mixed.ply"
    path.write_bytes(data)
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(vertices, MIXED_CORNERS)
    np.testing.assert_array_equal(faces, MIXED_TRIANGLES)
    path.write_bytes(data[:-3])
    with pytest.raises(MeshError, match="announces 3 of element face, 2 are there; it may be cut short"):
        read_mesh(path)


def test_uvs_at_the_corners_of_a_ply_leave_its_vertices_alone(tmp_path, capfd):
    """What MeshLab writes: the same vertex has another UV in each face."""
    lines = [" ".join(map(str, v)) for v in MIXED_CORNERS]
    lines += [f"3 {a} {b} {c} 6 0 0 .{i} 0 1 1" for i, (a, b, c) in enumerate(MIXED_TRIANGLES)]
    path = tmp_path / "wedges.ply"
    path.write_text(ply("ascii", 6, face="property list uchar float texcoord\n") + "\n".join(lines))
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(vertices, MIXED_CORNERS)
    np.testing.assert_array_equal(faces, MIXED_TRIANGLES)
    assert capfd.readouterr().err == ""


def test_off_of_several_sizes_of_polygons_keeps_the_order_of_its_faces(tmp_path):
    rows = [*MIXED_CORNERS.tolist(), *([len(f), *f] for f in MIXED)]
    path = tmp_path / "mixed.off"
    path.write_text("OFF\n5 3 0\n" + "\n".join(" ".join(map(str, row)) for row in rows))
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(vertices, MIXED_CORNERS)
    np.testing.assert_array_equal(faces, MIXED_TRIANGLES)


def test_stl_corners_are_joined(tmp_path):
    path = tmp_path / "square.stl"
    triangles = b"".join(struct.pack("<12fH", 0, 0, 1, *SQUARE[face].reshape(-1), 0) for face in FAN)
    path.write_bytes(bytes(80) + struct.pack("<I", 2) + triangles)
    same(path)


def test_glb(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "square.glb"
    trimesh.Trimesh(SQUARE, FAN, process=False).export(path)
    same(path)


def glb(nodes, meshes, scene):
    """A GLB in which primitive k is a triangle in the plane z = k."""
    corners = [np.array([[0, 0, k], [1, 0, k], [0, 1, k]], "<f4") for k in range(sum(meshes))]
    accessor = {"componentType": 5126, "count": 3, "type": "VEC3"}
    numbers = iter(range(len(corners)))
    header = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36 * len(corners)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 36 * k, "byteLength": 36} for k in range(len(corners))],
        "accessors": [accessor | {"bufferView": k} for k in range(len(corners))],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": next(numbers)}} for _ in range(count)]}
            for count in meshes
        ],
        "nodes": nodes,
        "scenes": [{"nodes": scene}],
        "scene": 0,
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(c.tobytes() for c in corners)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_meshes_of_a_glb_come_in_the_order_of_its_nodes(tmp_path):
    """Siblings, nodes below one another, a mesh of three primitives, one mesh in two places, no names."""
    pytest.importorskip("trimesh")
    nodes = [
        {"name": "skin", "mesh": 0},
        {"name": "rig", "children": [3, 2]},
        {"name": "eye", "mesh": 1, "translation": [1, 0, 0]},
        {"mesh": 2, "children": [4, 5]},
        {"mesh": 3},
        {"mesh": 1, "translation": [2, 0, 0]},
    ]
    path = tmp_path / "scene.glb"
    path.write_bytes(glb(nodes, [1, 1, 3, 1], [1, 0]))
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(faces, np.arange(21).reshape(7, 3))
    assert vertices[::3, [0, 2]].tolist() == [[0, 2], [0, 3], [0, 4], [0, 5], [2, 1], [1, 1], [0, 0]]


@pytest.mark.parametrize(
    "name, data, reason",
    [
        ("a.xyz", b"", "unknown kind"),
        ("a.off", b"", "cannot be read|no vertices"),
        ("a.off", b"OFF\n0 0 0\n", "cannot be read|no vertices"),
        ("a.off", b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "no faces: export"),
        ("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "outside|cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "triangle 0 names a vertex outside"),
        ("a.off", b"OFF\r3 2 0\r\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r3 0 2\r", "2 faces, 1 are there"),
        ("a.obj", b"v 0 0\nf 1 2 3\n", "line 1"),
        ("a.off", b"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "announces 2 faces, 1 are there"),
        ("a.off", b"OFF 3 2 0 # two\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2\n", "2 faces, 1 are there"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n", "line 5 .*three corners or more"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nf 0 1 2\nv 0 1 0\n", "line 3 .*counted from 1"),
        ("a.off", b"OFF\n", "does not say how many"),
        ("a.ply", ply("ascii", -1).encode() + b"0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 3 0 1 2", "no faces"),
        ("a.off", b"OFF BINARY\n\0\0", "should be text"),
        (
            "a.ply",
            ply("ascii", 2).encode() + b"0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 3 0 1 2 3 0 2",
            "face, 1 are there",
        ),
        ("a.obj.gz", b"not gzip", "gzip"),
        ("a.ply", b"ply\n", "cannot be read"),
    ],
)
def test_bad_files_name_file_and_reason(tmp_path, name, data, reason):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(MeshError, match=reason) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(MeshError, match="No such file"):
        read_mesh(tmp_path / "none.off")


def test_a_folder_is_no_mesh(tmp_path):
    with pytest.raises(MeshError, match="is a folder; name one mesh file"):
        read_mesh(tmp_path)


def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch):
    path = tmp_path / "square.stl"
    path.write_text("solid\nendsolid\n")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MeshError, match=r'trimesh is missing: pip install "\.\[tools\]"'):
        read_mesh(path)


def test_a_polygon_that_crosses_itself_has_its_triangles():
    """What is left without an ear becomes a fan: as many triangles as any polygon of its size has."""
    random = np.random.default_rng(0)
    for size in (5, 30, 300):
        corners = random.normal(size=(size, 3))
        faces = files._triangulated(corners, [list(range(size))])
        assert faces.shape == (size - 2, 3) and set(faces.ravel()) == set(range(size))
        # Each side of the polygon belongs to one triangle, each other edge to two.
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        assert (counts == 1).sum() == size


def area(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


HOLLOW = {
    # An L, an arrow, a ring whose hole is joined to the outside by a double edge, a point on an edge.
    "l": ([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], None, 5),
    "arrow": ([(0, 0), (2, -2), (1, 0), (2, 2)], None, 2),
    "ring": (
        [(0, 0), (4, 0), (4, 4), (0, 4), (1, 1), (1, 3), (3, 3), (3, 1)],
        [0, 1, 2, 3, 0, 4, 5, 6, 7, 4],
        12,
    ),
    # Every second corner is hollow; once it took a time that grows with the cube of the corners.
    "star": (
        [[(1 + k % 2) * f(np.pi * k / 400) for f in (np.cos, np.sin)] for k in range(800)],
        None,
        800 * np.sin(np.pi / 400),
    ),
    "point on an edge": ([(0, 0), (1, 0), (2, 0), (2, 2), (0, 2)], None, 4),
}


@pytest.mark.parametrize("name", HOLLOW)
@pytest.mark.parametrize("turn", [0, 1, 3])
@pytest.mark.parametrize("plane", [(0, 1, 2), (2, 0, 1), (1, 2, 0), (1, 0, 2)])
def test_hollow_polygons_are_covered_once(tmp_path, name, turn, plane):
    points, order, expected = HOLLOW[name]
    order = np.roll(order or range(len(points)), turn)
    corners = np.insert(np.array(points, float), 2, 0.5, axis=1)[:, plane]
    path = tmp_path / "polygon.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(str(i + 1) for i in order)]
    path.write_text("\n".join(lines))
    vertices, faces = read_mesh(path)
    assert len(faces) == len(order) - 2 and set(faces.ravel()) == set(order)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    # No triangle is turned over, so equal areas mean that nothing is covered twice.
    assert area(vertices, faces) == pytest.approx(expected)
    assert np.linalg.norm(normals.sum(axis=0)) / 2 == pytest.approx(expected)
