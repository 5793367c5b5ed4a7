"""Reading meshes from files, with vertices and faces in the order of the file.

OBJ, OFF and PLY are read here, because other readers split vertices at UV seams, reorder faces or refuse
polygons of several sizes; the other formats come through trimesh, told to change nothing.
"""

from __future__ import annotations

import codecs
import gzip
import io
import itertools
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from . import extras

FORMATS = ("obj", "off", "ply", "stl", "glb")
GZIPPED = ("off", "obj", "ply")
_PLY_KINDS = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"},
    **{"float": "f", "double": "d", "float32": "f", "float64": "d"},
}
_PLY_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
# How often corners of a polygon that were no ears are looked at again; a polygon that does not cross itself
# needs two or three.
_ROUNDS = 8


def mesh_format(path) -> str:
    """Format of a mesh file by its name: `"obj"`, `"off"`, … or `"obj.gz"`, …; empty when it is none of
    ours."""
    suffixes = [s.lstrip(".").lower() for s in Path(path).suffixes]
    if suffixes and suffixes[-1] in FORMATS:
        return suffixes[-1]
    if len(suffixes) > 1 and suffixes[-1] == "gz" and suffixes[-2] in GZIPPED:
        return suffixes[-2] + ".gz"
    return ""


def mesh_name(path) -> str:
    """File name without the ending of its format."""
    return Path(path).name[: -len(mesh_format(path)) - 1]


def read_mesh(path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64 of a mesh file.

    Polygons are triangulated as they lie in space, also hollow ones and those with holes that a double edge
    joins to the outside. Vertices keep the order of the file, unused ones too. STL has no vertices of its
    own, only corners: equal ones are joined, in order of first appearance. A GLB scene comes in world space,
    its meshes one after the other in the order of its nodes, each before what hangs on it.

    Raises `MeshError` naming the file and the reason; what a mesh must satisfy to be matched is checked by
    `Shape`.
    """
    from sgmds import MeshError

    if Path(path).is_dir():
        raise MeshError(f"{path}: is a folder; name one mesh file, or use `sgmds batch`")
    kind = mesh_format(path)
    if not kind:
        known = ", ".join("." + f for f in FORMATS) + ", " + ", ".join(f".{f}.gz" for f in GZIPPED)
        raise MeshError(f"{path}: unknown kind of file; use one of {known}")
    try:
        data = Path(path).read_bytes()
        if kind.endswith(".gz"):
            data = gzip.decompress(data)
    except (OSError, EOFError) as error:
        raise MeshError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    try:
        read = _READERS.get(kind.removesuffix(".gz"))
        vertices, faces = read(data.removeprefix(codecs.BOM_UTF8)) if read else _through_trimesh(data, kind)
    except Exception as error:
        # Readers fail in many ways on damaged files; each of them is the file's fault.
        raise MeshError(f"{path}: cannot be read as {kind.split('.')[0].upper()}: {error}") from error
    if len(vertices) == 0:
        raise MeshError(f"{path}: has no vertices: export the mesh again")
    if len(faces) == 0:
        raise MeshError(f"{path}: has no faces: export the surface, not its points alone")
    if faces.min() < 0 or faces.max() >= len(vertices):
        bad = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
        raise MeshError(
            f"{path}: triangle {bad} names a vertex outside 0…{len(vertices) - 1}; "
            "the file is damaged or cut short"
        )
    return vertices, faces


def _obj(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    positions: list[tuple[float, float, float]] = []
    polygons: list[list[int]] = []
    continued = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for number, line in enumerate(continued.splitlines(), start=1):
        words = line.split(b"#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] == b"v":
                positions.append((float(words[1]), float(words[2]), float(words[3])))
            elif words[0] == b"f":
                ids = [int(word.split(b"/", 1)[0]) for word in words[1:]]
                if 0 in ids:
                    raise ValueError("vertices are counted from 1")
                # Negative ids count back from the last vertex so far.
                ids = [i - 1 if i > 0 else len(positions) + i for i in ids]
                if len(ids) < 3:
                    raise ValueError("a face has three corners or more")
                polygons.append(ids)
        except (ValueError, IndexError) as error:
            raise ValueError(f"line {number} is not understood: {error}") from error
    vertices = np.array(positions, dtype=np.float64).reshape(-1, 3)
    return vertices, _triangulated(vertices, polygons)


def _triangulated(vertices: np.ndarray, polygons: list[list[int]]) -> np.ndarray:
    """Triangles of polygons, in their order: fans where the polygon is convex, else ears are cut."""
    sizes = np.array([len(p) for p in polygons], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(sizes - 2)])
    triangles = np.zeros((first[-1], 3), dtype=np.int64)
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size)
        group = np.array([polygons[i] for i in chosen])
        for k in range(1, size - 1):
            triangles[first[chosen] + k - 1] = group[:, [0, k, k + 1]]
        known = (group.min(axis=1) >= 0) & (group.max(axis=1) < len(vertices))
        if size == 3 or not known.any():
            # An id that is out of range is reported by the caller.
            continue
        chosen, group = chosen[known], group[known]
        points = vertices[group]
        with np.errstate(all="ignore"):
            points = points - points.mean(axis=1, keepdims=True)
            edges = np.roll(points, -1, axis=1) - points
            turns = np.cross(edges, np.roll(edges, -1, axis=1))
            # Newell's normal: right for polygons that are hollow or not quite plane.
            normals = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
            along = np.einsum("pkc,pc->pk", turns, normals)
            hollow = along.min(axis=1) < -1e-9 * np.abs(along).max(axis=1)
        for i in np.flatnonzero(hollow):
            ears = _ears(points[i], normals[i])
            triangles[first[chosen[i]] : first[chosen[i]] + size - 2] = group[i][ears]
    return triangles


def _ears(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Triangles (k − 2, 3) of a polygon of k corners, projected along its normal, by cutting ears off.

    The ear with the shortest cut goes first. What is left without an ear, when a polygon crosses itself,
    becomes a fan, so that the work grows with k² and not with k³.
    """
    axis = np.argmax(np.abs(normal))
    flat = np.delete(points, axis, axis=1) * (1, 1 if (normal[axis] > 0) == (axis != 1) else -1)
    corners = np.arange(len(flat))
    before, after = np.roll(corners, 1), np.roll(corners, -1)
    left = np.ones(len(flat), dtype=bool)
    # Length of the cut, infinite where a corner is no ear. A cut makes no ear of another corner useless.
    cut = np.full(len(flat), np.inf)
    triangles: list[tuple[int, ...]] = []

    def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    def judge(corner: int) -> None:
        a, b, c = (flat[k] for k in (before[corner], corner, after[corner]))
        cut[corner] = np.inf
        if turn(a, b, c) <= 0:
            return
        others = flat[left]
        inside = (turn(a, b, others) >= 0) & (turn(b, c, others) >= 0) & (turn(c, a, others) >= 0)
        # The three themselves, and doubles of them: a bridge to a hole passes its ends twice.
        inside &= ~((others[:, None] == (a, b, c)).all(axis=2).any(axis=1))
        if not inside.any():
            cut[corner] = ((c - a) ** 2).sum()

    waiting = corners
    for _ in range(_ROUNDS):
        # Corners that were blocked may have come free.
        for corner in waiting:
            judge(corner)
        while len(triangles) < len(flat) - 3 and np.isfinite(cut[corner := int(np.argmin(cut))]):
            triangles.append((before[corner], corner, after[corner]))
            left[corner], cut[corner] = False, np.inf
            after[before[corner]], before[after[corner]] = after[corner], before[corner]
            judge(before[corner])
            judge(after[corner])
        waiting = np.flatnonzero(left)
        if len(waiting) == 3:
            break
    triangles += [(waiting[0], b, c) for b, c in itertools.pairwise(waiting[1:])]
    return np.array(triangles)


def _off(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    text = re.sub(rb"#[^\r\n]*", b"", data)
    name = re.match(rb"\s*(ST)?C?N?OFF(?!\s*BINARY)", text)
    if not name:
        raise ValueError('it should be text that begins with "OFF"')
    rows = [words for words in map(bytes.split, text[name.end() :].splitlines()) if words]
    if not rows or len(rows[0]) < 2:
        raise ValueError("it does not say how many vertices and faces it has; it may be cut short")
    count, announced = (int(word) for word in rows[0][:2])
    positions, faces = rows[1 : count + 1], rows[count + 1 : count + 1 + announced]
    for what, wanted, whole in (
        ("vertices", count, sum(len(row) >= 3 for row in positions)),
        ("faces", announced, sum(len(row) > int(row[0]) for row in faces)),
    ):
        if whole < wanted:
            raise ValueError(f"its header announces {wanted} {what}, {whole} are there; it may be cut short")
    vertices = np.array([row[:3] for row in positions], np.float64).reshape(-1, 3)
    polygons = [[int(word) for word in row[1 : int(row[0]) + 1]] for row in faces]
    return vertices, _triangulated(vertices, [polygon for polygon in polygons if len(polygon) >= 3])


def _ply(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    header = re.match(rb"ply\s(.*?)\send_header[ \t]*(\r\n|\n|\r)", data, re.DOTALL)
    if not header:
        raise ValueError("it has no whole header of a PLY file")
    body, order = data[header.end() :], ""
    elements: list[tuple[str, int, list[tuple[str, str, str]]]] = []
    for line in header[1].decode("latin-1").splitlines():
        match line.split():
            case ["format", name, _]:
                order = _PLY_ORDERS[name]
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", length, kind, name]:
                elements[-1][2].append((name, _PLY_KINDS[kind], _PLY_KINDS[length]))
            case ["property", kind, name]:
                elements[-1][2].append((name, _PLY_KINDS[kind], ""))
    if order == "=":
        # The numbers of a text are read as if they were binary ones.
        body = np.array(body.split(), np.float64).tobytes()
        elements = [(e, n, [(p, "d", length and "d") for p, _, length in ps]) for e, n, ps in elements]
    found: dict[str, dict[str, Any]] = {}
    place = 0
    for name, count, properties in elements:
        found[name], place = _ply_element(body, place, order, name, count, properties)
    corners, faces = found.get("vertex", {}), found.get("face", {})
    if not corners:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    vertices = np.column_stack([corners[axis] for axis in "xyz"]).astype(np.float64)
    lists = faces.get("vertex_indices", faces.get("vertex_index", ()))
    if isinstance(lists, np.ndarray):
        if lists.shape[1] == 3:
            return vertices, lists.astype(np.int64)
        lists = lists.tolist()
    polygons = [[int(i) for i in ids] for ids in lists]
    return vertices, _triangulated(vertices, [polygon for polygon in polygons if len(polygon) >= 3])


def _ply_element(
    data: bytes, start: int, order: str, element: str, count: int, properties: list[tuple[str, str, str]]
) -> tuple[dict[str, Any], int]:
    """The values of each property (name, kind, kind of a list's length) of an element, and where it ends."""

    def row(place: int) -> tuple[list[Any], int]:
        values: list[Any] = []
        for _, kind, length_kind in properties:
            length = 1
            if length_kind:
                length = int(struct.unpack_from(order + length_kind, data, place)[0])
                place += struct.calcsize(order + length_kind)
            form = f"{order}{length}{kind}"
            read = struct.unpack_from(form, data, place)
            values.append(read if length_kind else read[0])
            place += struct.calcsize(form)
        return values, place

    if count <= 0 or not properties:
        return {}, start
    rows: list[list[Any]] = []
    place = start
    try:
        # Mostly all rows have lists of the same lengths, and are read at once.
        fields: list[Any] = []
        for (name, kind, length_kind), value in zip(properties, row(start)[0], strict=True):
            if length_kind:
                fields.append((f"length of {name}", order + length_kind))
            fields.append((name, order + kind, (len(value),) if length_kind else ()))
        form = np.dtype(fields)
        if count * form.itemsize <= len(data) - start:
            table = np.frombuffer(data, form, count, start)
            lengths = [table[f"length of {name}"] for name, _, length_kind in properties if length_kind]
            if all((column == column[0]).all() for column in lengths):
                return {name: table[name] for name, *_ in properties}, start + count * form.itemsize
        for _ in range(count):
            values, place = row(place)
            rows.append(values)
    except struct.error:
        raise ValueError(
            f"its header announces {count} of element {element}, {len(rows)} are there; it may be cut short"
        ) from None
    return {
        name: column for (name, *_), column in zip(properties, zip(*rows, strict=True), strict=True)
    }, place


def _places_of_nodes(graph: Any) -> dict[str, int]:
    """Where each node of a scene comes in the file's order.

    The reader of GLB takes the children of a node from the last to the first; another such walk turns them
    round again.
    """
    place: dict[str, int] = {}
    waiting = [graph.base_frame]
    while waiting:
        node = waiting.pop()
        place[node] = len(place)
        waiting += graph.transforms.children.get(node, ())
    return place


def _node_of(graph: Any, part: Any) -> str:
    """The file's node of a part: a mesh of several primitives has a node for each, below that one."""
    node = part.metadata["node"]
    return graph.transforms.parents[node] if part.metadata["from_gltf_primitive"] else node


_READERS = {"obj": _obj, "off": _off, "ply": _ply}


def _through_trimesh(data: bytes, kind: str) -> tuple[np.ndarray, np.ndarray]:
    extras.require("trimesh")
    import trimesh

    scene: Any = trimesh.load(
        io.BytesIO(data), file_type=kind, force="scene", process=False, maintain_order=True
    )
    parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    if kind == "glb":
        place = _places_of_nodes(scene.graph)
        parts.sort(key=lambda part: place[_node_of(scene.graph, part)])
    mesh: Any = trimesh.util.concatenate(parts)
    vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.array(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
    if kind == "stl":
        _, first, joined = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        vertices, faces = vertices[first[order]], rank[joined.reshape(-1)][faces]
    return vertices, faces
