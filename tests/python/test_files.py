"""Mesh files: the vertex order of the file, polygons fanned, damaged files named."""

import base64
import gzip
import json
import os
import signal
import struct
import subprocess
import sys
import time
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from sgmds import MeshError, NotEnoughMemory, Shape, _core, files, memory
from sgmds.cli import main
from sgmds.files import read_mesh, source

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


class Glb:
    """A GLB file under construction: `header` may be changed at will before `bytes`."""

    KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}

    def __init__(self):
        self.body = b""
        self.header = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
        }
        self.header |= {"bufferViews": [], "accessors": [], "meshes": []}

    def accessor(self, values, width, **more):
        """Stores an array; returns the number of its accessor."""
        values = np.asarray(values)
        view = {"buffer": 0, "byteOffset": len(self.body), "byteLength": values.nbytes}
        self.header["bufferViews"].append(view)
        self.body += values.tobytes() + bytes(-values.nbytes % 4)
        entry = {"bufferView": len(self.header["bufferViews"]) - 1, "type": width, "count": len(values)}
        entry["componentType"] = self.KINDS[values.dtype.str[1:]]
        self.header["accessors"].append(entry | more)
        return len(self.header["accessors"]) - 1

    def mesh(self, vertices, faces=None, mode=None, **attributes):
        """Adds a mesh of one primitive; returns its number."""
        primitive = {"attributes": {"POSITION": self.accessor(vertices, "VEC3")} | attributes}
        if faces is not None:
            primitive["indices"] = self.accessor(np.ravel(faces), "SCALAR")
        if mode is not None:
            primitive["mode"] = mode
        self.header["meshes"].append({"primitives": [primitive]})
        return len(self.header["meshes"]) - 1

    def bytes(self):
        header = self.header | {"buffers": self.header.get("buffers", [{"byteLength": len(self.body)}])}
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.body), b"BIN\0") + self.body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


SQUARE4, FAN2 = SQUARE.astype("<f4"), FAN.astype("<u2")


@pytest.fixture
def square():
    """A file of one square."""
    glb = Glb()
    glb.mesh(SQUARE4, FAN2)
    return glb


def written(tmp_path, glb):
    path = tmp_path / "scene.glb"
    path.write_bytes(glb.bytes() if isinstance(glb, Glb) else glb)
    return path


@pytest.mark.parametrize("kind", ["<u1", "<u2", "<u4"])
def test_glb(tmp_path, kind):
    glb = Glb()
    glb.mesh(SQUARE4, FAN.astype(kind))
    same(written(tmp_path, glb))


def test_meshes_of_a_glb_come_in_the_order_of_its_nodes(tmp_path):
    """Siblings, nodes below one another, a mesh of three primitives, one mesh in two places, no names."""
    glb = Glb()
    for k in range(6):
        glb.mesh(np.array([[0, 0, k], [1, 0, k], [0, 1, k]], "<f4"))
    # Mesh 2 has the triangles of 2, 3 and 4.
    meshes = glb.header["meshes"]
    meshes[2]["primitives"] += meshes[3]["primitives"] + meshes[4]["primitives"]
    glb.header["scenes"] = [{"nodes": [1, 0]}]
    glb.header["nodes"] = [
        {"name": "skin", "mesh": 0},
        {"name": "rig", "children": [3, 2]},
        {"name": "eye", "mesh": 1, "translation": [1, 0, 0]},
        {"mesh": 2, "children": [4, 5]},
        {"mesh": 5},
        {"mesh": 1, "translation": [2, 0, 0]},
    ]
    scene = files.read_scene(written(tmp_path, glb))
    np.testing.assert_array_equal(scene.faces, np.arange(21).reshape(7, 3))
    assert scene.vertices[::3, [0, 2]].tolist() == [[0, 2], [0, 3], [0, 4], [0, 5], [2, 1], [1, 1], [0, 0]]
    assert [(piece.name, len(piece.faces)) for piece in scene.pieces] == [
        ("", 3),
        ("", 1),
        ("", 1),
        ("eye", 1),
        ("skin", 1),
    ]
    assert [face for piece in scene.pieces for face in piece.faces] == [*range(7)]


def test_nodes_of_a_glb_carry_what_hangs_on_them(tmp_path):
    """Turned, scaled unevenly and moved, by parts and by a matrix, one below the other."""
    glb = Glb()
    glb.mesh(SQUARE4, FAN2)
    half = np.sqrt(0.5)
    # A quarter turn about z: x becomes y.
    glb.header["nodes"] = [
        {"rotation": [0, 0, half, half], "scale": [2, 3, 4], "translation": [10, 0, 0], "children": [1]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    vertices, _ = read_mesh(written(tmp_path, glb))
    expected = [[10 - 3 * y, 2 * x, 4 * (z + 5)] for x, y, z in SQUARE]
    np.testing.assert_allclose(vertices, expected, atol=1e-12)


def test_a_mirrored_node_of_a_glb_keeps_its_outside(tmp_path):
    glb = Glb()
    glb.mesh(SQUARE4, FAN2)
    glb.header["nodes"] = [{"mesh": 0, "scale": [-1, 1, 1]}]
    vertices, faces = read_mesh(written(tmp_path, glb))
    # Seen from above the square still turns to the left.
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert vertices[:, 0].min() == -1 and (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_strips_and_fans_of_a_glb(tmp_path):
    corners = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0]], "<f4")
    expected = {5: [[0, 1, 2], [2, 1, 3], [2, 3, 4]], 6: [[0, 1, 2], [0, 2, 3], [0, 3, 4]]}
    for mode, faces in expected.items():
        for given in (None, np.arange(5, dtype="<u2")):
            glb = Glb()
            glb.mesh(corners, given, mode=mode)
            _, found = read_mesh(written(tmp_path, glb))
            assert [sorted(face) for face in found.tolist()] == [sorted(face) for face in faces]
            if mode == 5:
                a, b, c = (corners[found[:, k]] for k in range(3))
                assert (np.cross(b - a, c - a)[:, 2] < 0).all(), "a strip's triangles face one way"


def test_quantised_interleaved_and_sparse_positions_of_a_glb(tmp_path):
    glb = Glb()
    whole = np.zeros(4, [("p", "<i2", 3), ("rest", "V10")])
    whole["p"] = SQUARE * 32767
    data = whole.tobytes()
    glb.mesh(SQUARE4, FAN2)
    glb.header["bufferViews"].append(
        {"buffer": 0, "byteOffset": len(glb.body), "byteLength": len(data), "byteStride": 16}
    )
    glb.body += data
    glb.header["accessors"].append(
        {"bufferView": 2, "componentType": 5122, "normalized": True, "count": 4, "type": "VEC3"}
    )
    glb.header["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 2
    same(written(tmp_path, glb))
    # Zeros but for what is stored apart.
    rows = glb.accessor(np.array([1, 2, 3], "<u1"), "SCALAR")
    values = glb.accessor(SQUARE4[1:], "VEC3")
    views = [glb.header["accessors"][k]["bufferView"] for k in (rows, values)]
    glb.header["accessors"][2] = {
        "componentType": 5126,
        "count": 4,
        "type": "VEC3",
        "sparse": {
            "count": 3,
            "indices": {"bufferView": views[0], "componentType": 5121},
            "values": {"bufferView": views[1]},
        },
    }
    same(written(tmp_path, glb))


def skinned(weights, joints, moved):
    """A square whose left side hangs on one joint and whose right side on another, which is `moved`."""
    glb = Glb()
    attributes = {
        "JOINTS_0": glb.accessor(np.array(joints, "<u1"), "VEC4"),
        "WEIGHTS_0": glb.accessor(np.array(weights, "<f4"), "VEC4"),
    }
    glb.mesh(SQUARE4, FAN2, **attributes)
    # Joints at (0, 0, 1) and (1, 0, 1) when bound; the node of the mesh is far away, which does not count.
    inverse = np.tile(np.eye(4, dtype="<f4"), (2, 1, 1))
    inverse[:, 3, :3] = [[0, 0, -1], [-1, 0, -1]]
    glb.header["skins"] = [{"joints": [1, 2], "inverseBindMatrices": glb.accessor(inverse, "MAT4")}]
    glb.header["scenes"] = [{"nodes": [0, 1]}]
    glb.header["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [0, 0, 1], "children": [2]},
        {"translation": np.add([1, 0, 0], moved).tolist()},
    ]
    return glb


def test_a_skinned_mesh_of_a_glb_is_where_its_joints_hold_it(tmp_path):
    sides = [[0, 1, 0, 0], [1, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]
    weights = [[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0, 0, 0], [0.25, 0.25, 0, 0]]
    same(written(tmp_path, skinned(weights, sides, (0, 0, 0))))
    expected = SQUARE + [[0, 0, 0], [0, 0, 3], [0, 0, 3], [0, 0, 1.5]]
    same(written(tmp_path, skinned(weights, sides, (0, 0, 3))), expected)


def test_pictures_of_a_glb_are_not_looked_at(tmp_path, square, monkeypatch):
    """Neither those within nor those elsewhere: nothing is opened but the file itself."""
    picture = square.accessor(np.arange(64, dtype="<u1"), "SCALAR")
    view = square.header["accessors"][picture]["bufferView"]
    square.header |= {
        "images": [{"bufferView": view, "mimeType": "image/png"}, {"uri": "other.png"}],
        "textures": [{"source": 0}, {"source": 1}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}],
    }
    square.header["meshes"][0]["primitives"][0]["material"] = 0
    path = written(tmp_path, square)
    opened = []
    real = open
    monkeypatch.setattr(
        "builtins.open", lambda name, *rest, **more: opened.append(name) or real(name, *rest, **more)
    )
    same(path)
    assert {str(name) for name in opened if not str(name).startswith(("/proc", "/sys"))} == {str(path)}


def _broken(change):
    glb = Glb()
    glb.mesh(SQUARE4, FAN2)
    change(glb.header)
    return glb.bytes()


def _set(path, value):
    """A change of the entry at a path of names and numbers."""

    def change(header):
        *above, last = path
        for step in above:
            header = header[step]
        header[last] = value

    return change


PRIMITIVE = ("meshes", 0, "primitives", 0)
BROKEN_GLB = {
    "huge": (
        _set(("accessors", 0), {"componentType": 5126, "count": 10**9, "type": "VEC3"}),
        "24,000 MB.*may take 140 MB",
    ),
    "huge faces": (
        _set(("accessors", 1), {"componentType": 5125, "count": 6 * 10**8, "type": "SCALAR"}),
        "4,800 MB",
    ),
    "negative": (_set(("accessors", 0, "count"), -1), "has -1 entries"),
    "beyond": (_set(("bufferViews", 0, "byteLength"), 10**6), "beyond its buffer"),
    "beyond its view": (_set(("accessors", 0, "byteOffset"), 44), "reaches beyond its buffer view"),
    "before": (_set(("accessors", 0, "byteOffset"), -4), "reaches beyond its buffer view"),
    "other type": (_set(("accessors", 0, "type"), "VEC2"), "should be VEC3"),
    "no mesh": (_set(("nodes", 0, "mesh"), 3), "refers to entry 3 of its 1 meshes"),
    "elsewhere": (
        _set(("buffers",), [{"byteLength": 60, "uri": "square.bin"}]),
        "in another file .'square.bin'",
    ),
    "circle": (_set(("nodes",), [{"children": [1]}, {"children": [0], "mesh": 0}]), "hangs on itself"),
    "itself": (_set(("nodes", 0, "children"), [0]), "hangs on itself"),
    "nothing in it": (_set(("scenes", 0, "nodes"), []), "scene is empty"),
    "vertex of others": (_set(("accessors", 0, "count"), 3), "names vertex 3 of 3"),
    "corners left over": (_set(("accessors", 1, "count"), 5), "no whole triangles"),
    "packed": (
        lambda header: (
            header["accessors"][0].pop("bufferView"),
            _set((*PRIMITIVE, "extensions"), {"KHR_draco_mesh_compression": {}})(header),
        ),
        "KHR_draco_mesh_compression",
    ),
    "instances": (
        _set(("nodes", 0, "extensions"), {"EXT_mesh_gpu_instancing": {}}),
        "EXT_mesh_gpu_instancing",
    ),
    "turned by nothing": (_set(("nodes", 0, "rotation"), [0, 0, 0, 0]), "rotation of no length"),
    "moved by a word": (_set(("nodes", 0, "translation"), ["far", 0, 0]), "no sound translation"),
    "children of a number": (_set(("nodes", 0, "children"), 5), "it is damaged .TypeError"),
    "no primitive": (_set(PRIMITIVE, "x"), "it is damaged .AttributeError"),
}


@pytest.mark.parametrize("name", BROKEN_GLB)
def test_a_broken_glb_is_refused_with_its_cause(tmp_path, name):
    change, reason = BROKEN_GLB[name]
    path = written(tmp_path, _broken(change))
    with pytest.raises(MeshError, match=reason) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


def test_rows_and_joints_below_zero_are_no_rows_from_behind(tmp_path, square):
    rows = square.accessor(np.array([-1, 0, 1], "<i1"), "SCALAR")
    values = square.accessor(SQUARE4[1:], "VEC3")
    views = [square.header["accessors"][k]["bufferView"] for k in (rows, values)]
    indices = {"bufferView": views[0], "componentType": 5120}
    square.header["accessors"][0]["sparse"] = {
        "count": 3,
        "indices": indices,
        "values": {"bufferView": views[1]},
    }
    with pytest.raises(MeshError, match="sparse rows out of order"):
        read_mesh(written(tmp_path, square))
    glb = skinned([[1, 0, 0, 0]] * 4, [[1, 0, 0, 0]] * 4, (0, 0, 3))
    joints = glb.header["accessors"][glb.header["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]]
    joints["componentType"] = Glb.KINDS["i1"]
    glb.body = glb.body.replace(b"\1\0\0\0" * 4, b"\xff\0\0\0" * 4, 1)
    with pytest.raises(MeshError, match="joints -1…-1 of 2"):
        read_mesh(written(tmp_path, glb))


@pytest.mark.filterwarnings("error")
def test_numbers_beyond_all_range_are_told_of_by_the_shape_alone(tmp_path, square):
    """Not by numpy on standard error too."""
    square.header["nodes"] = [{"children": [1], "scale": [1e308] * 3}, {"mesh": 0, "scale": [1e308] * 3}]
    vertices, faces = read_mesh(written(tmp_path, square))
    with pytest.raises(MeshError, match="vertex"):
        Shape(vertices, faces)
    path = tmp_path / "corners.stl"
    # Bits of a number that is none, and of which a processor tells.
    path.write_bytes(bytes(80) + struct.pack("<I", 1) + bytes(12) + b"\1\0\x80\x7f" * 9 + bytes(2))
    assert np.isnan(read_mesh(path)[0]).all()


def test_a_description_that_is_no_json_is_called_so(tmp_path):
    for text in (b'{"a": "\xff\xfe"}', b'{"a":' + b"9" * 5000 + b"}", b"{} {}", b""):
        text += b" " * (-len(text) % 4)
        data = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text
        with pytest.raises(MeshError, match="the description of its scene is damaged: "):
            read_mesh(written(tmp_path, data))


def test_a_glb_that_is_cut_short_or_nested_too_deeply(tmp_path, square):
    data = square.bytes()
    for length in (0, 8, 19, 60, len(data) - 1):
        with pytest.raises(MeshError, match="begin with|cut short"):
            read_mesh(written(tmp_path, data[:length]))
    text = b'{"nodes":' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    deep = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text
    with pytest.raises(MeshError, match="nested too deeply"):
        read_mesh(written(tmp_path, deep))


def test_a_long_chain_of_nodes_is_no_recursion(tmp_path, square):
    count = 5000
    square.header["nodes"] = [{"children": [k + 1], "translation": [1, 0, 0]} for k in range(count)] + [
        {"mesh": 0}
    ]
    vertices, _ = read_mesh(written(tmp_path, square))
    np.testing.assert_allclose(vertices, SQUARE + [count, 0, 0])


def test_objects_of_an_obj_are_its_pieces(tmp_path):
    path = tmp_path / "two.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in SQUARE]
    path.write_text(
        "\n".join(["o nothing", "o Body of one", *lines, "f 1 2 3", "f 1 2 3 4", "o Eye", "f 2 3 4"])
    )
    assert files.read_scene(path).pieces == [
        files.Piece("Body of one", range(3)),
        files.Piece("Eye", range(3, 4)),
    ]


def test_strips_of_a_ply(tmp_path):
    corners = "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n"
    header = (
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips {}\nproperty list int int vertex_indices\nend_header\n"
    )
    path = tmp_path / "strips.ply"
    # Two strips in one list, the first with a triangle of no area that turns it.
    path.write_text(header.format(2) + corners + "10 0 1 2 3 3 4 -1 2 3 4\n3 0 1 3\n")
    vertices, faces = read_mesh(path)
    assert faces.tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4], [0, 1, 3]]
    a, b, c = (vertices[faces[:3, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()


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
        ("a.ply", ply("ascii", -1).encode() + b"0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 3 0 1 2", "announces -1 of"),
        ("a.off", b"OFF BINARY\n\0\0", "should be text"),
        (
            "a.ply",
            ply("ascii", 2).encode() + b"0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 3 0 1 2 3 0 2",
            "face, 1 are there",
        ),
        ("a.obj.gz", b"not gzip", "gzip is damaged.*copy or pack it again"),
        ("a.obj.gz", gzip.compress(b"v 0 0 0\n" * 1000, mtime=0)[:-20], "gzip is damaged or cut short"),
        ("a.obj.gz", gzip.compress(b"v 0 0 0\n", mtime=0) + b"more", "gzip is damaged"),
        (
            "a.obj.gz",
            bytearray(gzip.compress(np.random.default_rng(0).bytes(500), mtime=0))[:60] + bytes(40),
            "gzip is damaged",
        ),
        ("a.obj", b"v 0 0 0\nf 1 1 99999999999999999999\n", "line 2 .*too large"),
        ("a.off", b"OFF\n-3 -1 0\n0 0 0\n", "announces -3 vertices"),
        ("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "1 faces, 0 are there"),
        ("a.off", b"OFF\n1 1 0\n0 0 0\n3 0 0 99999999999999999999\n", "damaged .OverflowError"),
        ("a.obj", "v 0 0 0\nf 1 1 1\n".encode("utf-16"), "should be text and has bytes of zero"),
        ("a.obj.gz", gzip.compress(gzip.compress(b"v 0 0 0\nf 1 1 1\n", mtime=0), mtime=0), "should be text"),
        ("a.off", b"OFF\n99999999999 9 0\n0 0 0\n", "announces 99999999999 vertices, 1 are there"),
        ("a.stl", bytes(80) + struct.pack("<I", 7) + bytes(130), "announces 7 triangles, 2 are there"),
        ("a.stl", bytes(30), "0 are there; it may be cut short"),
        (
            "a.stl",
            b"solid".ljust(80) + struct.pack("<I", 7) + bytes(130),
            "announces 7 triangles, 2 are there",
        ),
        ("a.stl", b"solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "does not end with endsolid"),
        ("a.stl", b"solid a\nfacet\nouter loop\nvertex 0 0 0\nendloop\n", "line 5 ends a facet of 1 corners"),
        ("a.stl", b"solid a\nvertex 0 0 x\n", "line 2 is not understood"),
        ("a.ply", ply("binary_little_endian", 3).encode() + bytes(20), "5 of element vertex, 1 are there"),
        ("a.ply", ply("ascii", 1).encode() + b"0 " * 15 + b"-3 0 1 2", "has a list of -3"),
        ("a.ply", ply("ascii", 1).encode() + b"0 " * 15 + b"nan 0 1 2", "has a list of nan"),
        ("a.ply", ply("strange", 1).encode(), "its format is 'strange'"),
        ("a.ply", ply("ascii", 1).replace("indices", "numbers").encode() + b"0 " * 19, "no list 'vertex_ind"),
        ("a.ply", ply("ascii", 1, "element face 1\n").encode(), "element face twice"),
        ("a.ply", ply("ascii", 1, "property text t\n").encode(), "of kind 'text'"),
        ("a.ply", b"ply\n", "no whole header"),
        ("a.ply", b"ply\n" + b"comment\n" * 2**17, "header does not end within 1,048,576 bytes"),
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


def test_what_has_no_end_is_not_opened(tmp_path):
    endless, pipe = tmp_path / "zero.obj", tmp_path / "pipe.obj"
    endless.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    for path in (endless, pipe):
        with pytest.raises(MeshError, match="no regular file"):
            read_mesh(path)


def test_names_that_move_the_cursor_stay_in_their_line(tmp_path, capsys):
    path = tmp_path / "a\x1b[31m\nb.obj"
    path.write_text("v x")
    assert main(["match", str(path), str(path), "-o", str(tmp_path / "map.npz")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "\x1b" not in line and "a\\x1b[31m b.obj" in line


def test_a_message_of_any_length_is_shown_with_its_beginning_and_end(tmp_path, capsys):
    assert main(["evaluate", f"{tmp_path}/{'y' * 1_000_000}"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) < 1_100 and line.startswith(f"sgmds: {tmp_path}/yyy") and line.endswith("too long")


def limited(code, *arguments, megabytes=4000):
    """Runs Python with a limit of address space: (its output, its peak in MB beyond what importing took)."""
    # The peak that `getrusage` tells is the larger of this program's and of that which started it.
    code = f"""
import re, resource, sys
def peak():
    return int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
resource.setrlimit(resource.RLIMIT_AS, ({megabytes} << 20,) * 2)
from sgmds import MeshError
from sgmds.files import read_mesh, source
before = peak()
{code}
print((peak() - before) / 1024)
"""
    done = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *words, peak = done.stdout.splitlines()
    return "\n".join(words), float(peak)


# Megabytes of a block that is looked at: as lines of one letter it is half a million objects of 40 bytes, in
# a list. Of the 200 MB that any file may take they are a part.
BLOCKS = 40


def test_a_small_file_that_unpacks_to_much_is_refused_with_the_number(tmp_path):
    """Some kilobytes that are 50 MB of vertices, or of remarks; 20 MB are allowed here to any file."""
    for block in (b"v 0 0 0\n" * 2**17, (b"#" * 1023 + b"\n") * 2**10):
        path = tmp_path / "bomb.obj.gz"
        packer = zlib.compressobj(1, zlib.DEFLATED, 31)
        with open(path, "wb") as file:
            file.writelines(packer.compress(block) for _ in range(50))
            file.write(packer.flush())
        allowed = (source.FACTOR * path.stat().st_size + 20e6) / 1e6
        code = "source.BASE = 20_000_000\n"
        code += "try: read_mesh(sys.argv[1])\nexcept MeshError as error: print(error)"
        words, peak = limited(code, path)
        assert f"may take {allowed:,.0f} MB: unpack it first" in words
        assert peak < allowed + BLOCKS


def _hostile_ply(rows, body, length="uchar"):
    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {rows}\nproperty list {length} int vertex_indices\nend_header\n"
    ).encode() + (bytes(36) + body)


def _hostile_glb(change):
    glb = Glb()
    glb.mesh(np.tile(SQUARE4, (250, 1)), np.tile(FAN2, (250, 1)))
    change(glb.header)
    return glb.bytes()


def _hostile_stl():
    """Triangles of which none shares a corner with another."""
    count = 40_000
    triangles = np.zeros(count, [("n", "<f4", 3), ("v", "<f4", 9), ("a", "<u2")])
    triangles["v"] = np.random.default_rng(0).normal(size=(count, 9))
    return bytes(80) + struct.pack("<I", count) + triangles.tobytes()


# What takes most in memory for its bytes: the shortest numbers and lines, one line only, rows and entries of
# nothing.
HOSTILE = {
    "terse.obj": lambda: b"v 0 0 0\n" * 3 + b"f 1 2 3\n" * 250_000,
    "one line.obj": lambda: b"v 0 0 0\nf" + b" 1" * 1_000_000 + b"\n",
    "one remark.obj": lambda: b"#" + b"x " * 1_000_000 + b"\n",
    # As slow as it has parts, not as their square.
    "continued.obj": lambda: b"v 0 0 0\nf 1 \\\n" + b"1 \\\n" * 500_000 + b"1\n",
    "long continued.obj": lambda: b"v 0 0 0\n" + (b"f 1 \\\n" + b"1 \\\n" * 2_000 + b"1\n") * 250,
    "names.obj": lambda: b"v 0 0 0\n" + b"o\nf 1 1 1\n" * 200_000,
    "polygons.obj": lambda: b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + b"f 1 2 3 4\n" * 200_000,
    "terse.off": lambda: b"OFF 3 250000 0\n" + b"0 0 0\n" * 3 + b"3 0 1 2\n" * 250_000,
    "points.off": lambda: b"OFF 300000 1 0\n" + b"0 0 0\n" * 300_000 + b"3 0 1 2\n",
    "empty rows.off": lambda: b"OFF 3 1000000 0\n" + b"0 0 0\n" * 3 + b"0\n" * 1_000_000,
    "empty rows.ply": lambda: _hostile_ply(2_000_000, bytes(2_000_000)),
    "one row.ply": lambda: _hostile_ply(1, struct.pack("<I", 500_000) + bytes(2_000_000), "uint"),
    "short rows.ply": lambda: _hostile_ply(400_000, b"\1\0\0\0\0" * 400_000),
    "terse.ply": lambda: (
        b"ply\nformat ascii 1.0\nelement vertex 300000\nproperty float x\n"
        b"property float y\nproperty float z\n"
        b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        + b"0 " * 900_000
        + b"3 0 1 2\n"
    ),
    "terse.stl": lambda: b"solid\n" + (b"vertex 0 0 0\n" * 3 + b"endloop\n") * 40_000 + b"endsolid\n",
    "apart.stl": _hostile_stl,
    "instances.glb": lambda: _hostile_glb(
        lambda header: header.update(nodes=[{"mesh": 0}] * 50_000, scenes=[{"nodes": [*range(50_000)]}])
    ),
    "nothing stored.glb": lambda: _hostile_glb(
        lambda header: (
            header["accessors"].insert(0, {"type": "VEC3", "componentType": 5126, "count": 999_999_999})
            or header["meshes"][0].update(primitives=[{"attributes": {"POSITION": 0}}])
        )
    ),
    "empty entries.glb": lambda: _hostile_glb(lambda header: header.update(extras=[{}] * 700_000)),
    "chain.glb": lambda: _hostile_glb(
        lambda header: header.update(nodes=[{"children": [n + 1]} for n in range(50_000)] + [{"mesh": 0}])
    ),
}

# Files that have no triangle to be read.
NO_SURFACE = ("one remark.obj", "empty rows.off", "empty rows.ply", "short rows.ply")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak is read from /proc")
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_read_within_the_bound_or_refused_with_the_number(tmp_path, name):
    """In a process of its own. 10 MB are allowed here to any file, so that the factor is what counts."""
    path = tmp_path / name
    path.write_bytes(HOSTILE[name]())
    code = "source.BASE = 10_000_000\n"
    code += "try: print('read', len(read_mesh(sys.argv[1])[1]))\nexcept MeshError as error: print(error)"
    words, peak = limited(code, path)
    size = path.stat().st_size / 1e6
    allowed = source.FACTOR * size + 10
    print(f"{name}: {size:.1f} MB, peak {peak:.1f} MB of {allowed:.0f}: {words[-150:]}")
    assert peak < allowed + BLOCKS
    assert words.startswith("read") or "may take" in words or name in NO_SURFACE


def test_reading_holds_a_bounded_multiple_of_the_file(tmp_path, monkeypatch):
    """Each kind in its most common form, and the tersest text there is; see `source.BASE` for small files."""
    n = 100
    i = np.arange(n * n).reshape(n, n)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    tris = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    x, y = np.unravel_index(np.arange(n * n), (n, n))
    corners = np.column_stack([x, y, np.sin(0.1 * x)]).astype("<f4")
    rows = [f"{a:.5f} {b:.5f} {c:.5f}" for a, b, c in corners.tolist()]
    texts = {
        "quads.obj": [f"v {row}" for row in rows]
        + [f"f {a} {b} {c} {d}" for a, b, c, d in (quads + 1).tolist()],
        "tris.off": [
            "OFF",
            f"{n * n} {len(tris)} 0",
            *rows,
            *(f"3 {a} {b} {c}" for a, b, c in tris.tolist()),
        ],
        "terse.obj": ["v 0 0 0"] * 20_000 + ["f 1 2 3"] * 40_000,
        "text.stl": [
            "solid",
            *(
                "facet normal 0 0 0\nouter loop\n"
                + "\n".join(f"vertex {rows[k]}" for k in t)
                + "\nendloop\nendfacet"
                for t in tris.tolist()
            ),
            "endsolid",
        ],
    }
    for name, lines in texts.items():
        (tmp_path / name).write_text("\n".join(lines))
    triangles = np.zeros(len(tris), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    triangles["v"] = corners[tris]
    (tmp_path / "binary.stl").write_bytes(bytes(80) + struct.pack("<I", len(tris)) + triangles.tobytes())
    glb = Glb()
    glb.mesh(corners, tris.astype("<u4"))
    (tmp_path / "mesh.glb").write_bytes(glb.bytes())
    mixed = np.array([*quads.tolist(), *tris[:1000].tolist()], dtype=object)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {n * n}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(mixed)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    body = b"".join(struct.pack(f"<B{len(f)}i", len(f), *f) for f in mixed)
    (tmp_path / "mixed.ply").write_bytes(header.encode() + corners.tobytes() + body)
    for path in sorted(tmp_path.iterdir()):
        tracemalloc.start()
        read_mesh(path)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        # Blocks that are looked at together are the same however large the file is.
        assert peak < source.FACTOR * path.stat().st_size + 20e6, path.name
    # And what would be beyond is refused before it is taken.
    monkeypatch.setattr(source, "BASE", 0)
    monkeypatch.setattr(source, "FACTOR", 0)
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(MeshError, match="would take .* may take"):
            read_mesh(path)


def test_too_little_free_memory_is_told_with_the_numbers(tmp_path, monkeypatch):
    path = tmp_path / "plain.off"
    path.write_text("OFF\n20000 1 0\n" + "0 0 0\n" * 20_000 + "4 0 1 2 3\n")
    monkeypatch.setattr(memory, "available", lambda: 100_000)
    with pytest.raises(NotEnoughMemory, match="take .* 100,000 bytes are free"):
        read_mesh(path)


def test_memory_that_the_system_refuses_is_no_fault_of_the_file(tmp_path, square, monkeypatch):
    def refused(source):
        raise MemoryError

    monkeypatch.setitem(files._READERS, "glb", refused)
    with pytest.raises(NotEnoughMemory, match="scene.glb: memory is used up: close other programs"):
        read_mesh(written(tmp_path, square))


def test_what_is_promised_includes_all_that_is_held(tmp_path):
    """A kilobyte that unpacks to 80 MB of triangles, more than may be held: refused below 200 MB."""
    path = tmp_path / "many.off.gz"
    path.write_bytes(gzip.compress(b"OFF\n9 9999999 0\n" + b"0 0 0\n" * 9 + b"3 1 2 3\n" * 9_999_999))
    code = "try: read_mesh(sys.argv[1])\nexcept MeshError as error: print(error)"
    words, peak = limited(code, path)
    assert "its vertices and faces would take" in words
    assert 1.024**2 * peak < 200 + 12 * path.stat().st_size / 1e6


def test_a_buffer_that_is_embedded_as_text_is_no_tree(tmp_path):
    """Eight megabytes of one word in the description: what it takes is told by its marks, not its letters."""
    data = base64.b64encode(np.zeros((500_000, 3), "<f4").tobytes()).decode()
    path = tmp_path / "embedded.glb"
    path.write_bytes(
        terse_glb(
            {
                "accessors": [POINT | {"count": 499_998, "bufferView": 0}],
                "bufferViews": [{"buffer": 0, "byteLength": 6_000_000}],
                "buffers": [{"byteLength": 6_000_000, "uri": f"data:;base64,{data}"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
            }
        )
    )
    words, peak = limited("print(len(read_mesh(sys.argv[1])[0]))", path)
    assert words == "499998" and 1.024**2 * peak < 200 + 12 * path.stat().st_size / 1e6


def terse_glb(description):
    """A GLB of nothing but a description."""
    text = json.dumps({"asset": {"version": "2.0"}} | description).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


NOTHING = {"componentType": 5126, "count": 0, "type": "VEC3"}
LINES = {"mode": 1, "attributes": {"POSITION": 0}}
ZEROS = {"componentType": 5126, "count": 1_000_000, "type": "MAT4"}
POINT = {"componentType": 5126, "count": 3, "type": "VEC3"}
JOINTED = {f"{word}_{k}": 0 for k in range(3_000) for word in ("JOINTS", "WEIGHTS")}


@pytest.mark.parametrize(
    ("description", "words"),
    [
        (
            {
                "accessors": [NOTHING],
                "meshes": [{"primitives": [LINES] * 10_000}],
                "scenes": [{"nodes": list(range(10_000))}],
                "nodes": [{"mesh": 0}] * 10_000,
            },
            "no vertices",
        ),
        (
            {
                "accessors": [POINT, ZEROS],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "scenes": [{"nodes": list(range(2_000))}],
                "nodes": [{"mesh": 0, "skin": n} for n in range(2_000)],
                "skins": [{"joints": [0], "inverseBindMatrices": 1}] * 2_000,
            },
            "",
        ),
        (
            {
                "accessors": [POINT | {"type": "VEC4"}, POINT],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 1} | JOINTED}]}],
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0, "skin": 0}, {"translation": [1, 0, 0]}],
                "skins": [{"joints": [0]}],
            },
            "",
        ),
    ],
    ids=["lines shown often", "matrices of zeros", "joints"],
)
def test_what_a_glb_repeats_is_looked_at_once(tmp_path, description, words):
    """Some hundred kilobytes whose parts name one another: as many steps as parts, not their product."""
    path = tmp_path / "many.glb"
    path.write_bytes(terse_glb(description))
    begun = time.process_time()
    if words:
        with pytest.raises(MeshError, match=words):
            read_mesh(path)
    else:
        read_mesh(path)
    # Half a second; the products take 40 s and more.
    assert time.process_time() - begun < 8


def test_reading_is_interrupted_at_once(tmp_path):
    """Corners that cross themselves everywhere: cutting them takes far longer than what comes before it."""
    count = 300_000
    points = np.random.default_rng(0).random((count, 2))
    path = tmp_path / "crossing.obj"
    path.write_text(
        "".join(f"v {x} {y} 0\n" for x, y in points) + "f " + " ".join(map(str, range(1, count + 1))) + "\n"
    )
    command = [
        sys.executable,
        "-m",
        "sgmds.command",
        "match",
        str(path),
        str(path),
        "-o",
        str(tmp_path / "m.npz"),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while process.poll() is None and _cpu_seconds(process.pid) < 2:
        time.sleep(0.1)
    try:
        process.send_signal(signal.SIGINT)
        _, words = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, words) == (130, "cancelled\n")


def _cpu_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_polygon_that_crosses_itself_has_its_triangles():
    """What is left without an ear becomes a fan: as many triangles as any polygon of its size has."""
    random = np.random.default_rng(0)
    for size in (5, 30, 300):
        corners = random.normal(size=(size, 3))
        faces = _core.triangulate(corners, np.arange(size), np.array([size]))
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
    # Every second corner is hollow.
    "star": (
        [[(1 + k % 2) * f(np.pi * k / 10_000) for f in (np.cos, np.sin)] for k in range(20_000)],
        None,
        20_000 * np.sin(np.pi / 10_000),
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
