"""GLB, that is glTF 2.0 in one file: the triangles of its scene in world space, and nothing else of it.

Everything is checked against the file before memory is taken; pictures and materials are never read. By the
Khronos Group's specification of glTF 2.0: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .source import Source, amount

_JSON, _BIN = b"JSON", b"BIN\0"
_JSON_FACTOR = 30
"""Bytes that Python takes for each byte of JSON at most: an empty object, "{},", has three and takes 72."""
_TEXT_FACTOR, _MARK_BYTES = 3, 170
"""The same of words and numbers alone, as bytes and twice as text; and what each mark between them takes: an
object of one name takes 232 and has two, of more names less for each."""
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_ROWS = 3 * 2**15
"""Rows of an accessor that are looked at together; a multiple of three, so that triangles stay whole."""
_NODE_BYTES, _PART_BYTES = 500, 300
"""What a node and a piece take beside the description: matrices and entries of tables."""
_PARTS = 10_000
"""Pieces between two looks at what is held."""
_SETS = 16
"""Of four joints and weights for each vertex; games use one, films up to four."""
_ROUNDING = 1e-5
"""By which products of matrices in single precision may differ, over their largest entry."""
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_INSTANCES = "EXT_mesh_gpu_instancing"


@dataclass
class _Part:
    """Triangles of a primitive at a node."""

    primitive: dict
    node: int
    name: str
    world: np.ndarray
    """(4, 4) from the node's coordinates to the world's."""
    joints: np.ndarray | None
    """(j, 4, 4) from the mesh's coordinates to the world's, for each joint of a skin."""
    vertex_count: int
    face_count: int


def read(source: Source) -> tuple[np.ndarray, np.ndarray, list[tuple[str, int]]]:
    """Vertices, triangles, and each node's name with the number of its first triangle."""
    file = _File(source)
    parts = file.parts()
    n, m = sum(part.vertex_count for part in parts), sum(part.face_count for part in parts)
    source.allow(file.held + 24 * (n + m), f"its {n:,} vertices and {m:,} triangles")
    vertices, faces = np.zeros((n, 3)), np.zeros((m, 3), np.int64)
    names: list[tuple[str, int]] = []
    first = begun = 0
    node = None
    for part in parts:
        if part.node != node:
            node = part.node
            names.append((part.name, begun))
        own, triangles = vertices[first : first + part.vertex_count], faces[begun : begun + part.face_count]
        file.fill(part, own, triangles)
        triangles += first
        first, begun = first + part.vertex_count, begun + part.face_count
    return vertices, faces, names


class _File:
    """The description of a GLB file, and its accessors."""

    def __init__(self, source: Source):
        self._source = source
        head = source.read(12)
        if head[:4] != b"glTF" or len(head) < 12:
            raise ValueError('it should begin with "glTF"')
        version, length = (int.from_bytes(head[k : k + 4], "little") for k in (4, 8))
        if version != 2:
            raise ValueError(f"it is of version {version}: export it as glTF 2.0")
        if length > source.size:
            raise ValueError(
                f"it should have {amount(length)} and has {amount(source.size)}; it may be cut short"
            )
        text, self._bin, self.held = b"", (0, 0), 0
        place = 12
        while place + 8 <= length:
            source.seek(place)
            head = source.read(8)
            size, kind = int.from_bytes(head[:4], "little"), head[4:]
            place += 8
            if place + size > length:
                raise ValueError(f"its part {kind!r} should have {amount(size)}; it may be cut short")
            if kind == _JSON and not text:
                text = source.read(size)
                marks = sum(map(text.count, (b",", b":", b"{", b"[")))
                self.held = min(_JSON_FACTOR * size, _TEXT_FACTOR * size + _MARK_BYTES * marks)
                source.allow(self.held, "the descriptions of its scene")
            elif kind == _BIN and not self._bin[1]:
                self._bin = place, size
            place += size
        try:
            self._tree = json.loads(text)
        except RecursionError:
            raise ValueError("the description of its scene is nested too deeply; it is damaged") from None
        except ValueError as error:
            raise ValueError(f"the description of its scene is damaged: {error}") from error
        if not isinstance(self._tree, dict):
            raise ValueError("the description of its scene is no object; it is damaged")
        self._embedded: dict[int, bytes] = {}
        self._shown: dict[int, list[tuple[dict, int, int]]] = {}
        self._skins: dict[int, np.ndarray] = {}

    # What the description says, each time checked.

    def _list(self, name: str) -> list[Any]:
        found = self._tree.get(name, [])
        if not isinstance(found, list):
            raise ValueError(f"its {name} are no list; it is damaged")
        return found

    def _at(self, name: str, number: Any, of: str) -> dict:
        """Entry `number` of a list of the description, that `of` refers to."""
        entries = self._list(name)
        if type(number) is not int or not 0 <= number < len(entries) or not isinstance(entries[number], dict):
            raise ValueError(f"{of} refers to entry {number!r} of its {len(entries)} {name}; it is damaged")
        return entries[number]

    def parts(self) -> list[_Part]:
        """All that the scene shows, in the order of its nodes, each before what hangs on it."""
        parts: list[_Part] = []
        for part in self._parts():
            parts.append(part)
            if len(parts) % _PARTS == 0:
                self._source.allow(self.held + _PART_BYTES * len(parts), f"its {len(parts):,} or more pieces")
        self.held += _PART_BYTES * len(parts)
        return parts

    def _parts(self) -> Iterator[_Part]:
        worlds = self._worlds()
        for number, world in worlds.items():
            node = self._at("nodes", number, "its scene")
            extensions = node.get("extensions", {})
            if "mesh" not in node:
                continue
            of = f"its node {number}"
            if _INSTANCES in extensions:
                raise ValueError(
                    f"{of} has instances by {_INSTANCES}, which are not read: export them as objects"
                )
            mesh = self._at("meshes", node["mesh"], of)
            joints = self._joints(node["skin"], worlds, of) if "skin" in node else None
            name = str(node.get("name", mesh.get("name", "")))
            yield from self._primitives(node["mesh"], number, name, world, joints)
        if not worlds:
            # A library of meshes without a scene.
            for number in range(len(self._list("meshes"))):
                mesh = self._at("meshes", number, "it")
                yield from self._primitives(number, number, str(mesh.get("name", "")), np.eye(4), None)

    def _primitives(
        self, mesh: int, node: int, name: str, world: np.ndarray, joints: np.ndarray | None
    ) -> Iterator[_Part]:
        if mesh not in self._shown:
            # Once, however many nodes show it.
            self._shown[mesh] = list(self._surfaces(self._list("meshes")[mesh], f"a mesh of its node {node}"))
        for primitive, vertices, faces in self._shown[mesh]:
            yield _Part(primitive, node, name, world, joints, vertices, faces)

    def _surfaces(self, mesh: dict, of: str) -> Iterator[tuple[dict, int, int]]:
        """Primitives of a mesh that have triangles, and how many vertices and triangles."""
        primitives = mesh.get("primitives", [])
        for primitive in primitives if isinstance(primitives, list) else []:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in primitive.get("attributes", {}):
                continue
            position = self._at("accessors", primitive["attributes"]["POSITION"], of)
            packed = [name for name in _PACKED if name in primitive.get("extensions", {})]
            if packed and "bufferView" not in position:
                raise ValueError(
                    f"{of} is packed by {packed[0]}, which is not read: export it without compression"
                )
            count = corners = self._count(position, of)
            if "indices" in primitive:
                corners = self._count(self._at("accessors", primitive["indices"], of), of)
            if mode == _TRIANGLES and corners % 3:
                raise ValueError(f"{of} has {corners} corners, which are no whole triangles; it is damaged")
            yield primitive, count, corners // 3 if mode == _TRIANGLES else max(corners - 2, 0)

    def _worlds(self) -> dict[int, np.ndarray]:
        """Each node of the scene, parents first, and its (4, 4) matrix to the world."""
        nodes = self._list("nodes")
        self.held += _NODE_BYTES * len(nodes)
        self._source.allow(self.held, f"its {len(nodes):,} nodes")
        if scenes := self._list("scenes"):
            number = self._tree.get("scene", 0)
            roots = self._at("scenes", number, "it").get("nodes", [])
            if not scenes[number].get("nodes"):
                raise ValueError("its scene is empty: export the objects with the scene")
        else:
            below = {child for node in nodes if isinstance(node, dict) for child in node.get("children", [])}
            roots = [number for number in range(len(nodes)) if number not in below]
        worlds: dict[int, np.ndarray] = {}
        waiting = [(number, None, np.eye(4)) for number in reversed(roots)]
        while waiting:
            number, parent, above = waiting.pop()
            node = self._at("nodes", number, "its scene" if parent is None else f"its node {parent}")
            if number in worlds:
                raise ValueError(f"its node {number} hangs on itself or in two places; it is damaged")
            local = _local(node, number)
            world = worlds[number] = above if local is None else above @ local
            waiting += [(child, number, world) for child in reversed(node.get("children", []))]
        return worlds

    def _joints(self, number: Any, worlds: dict[int, np.ndarray], of: str) -> np.ndarray:
        """(j, 4, 4) from the coordinates of a skinned mesh to the world, one for each joint of its skin.

        The node that shows the mesh has no part in it, by the specification.
        """
        if number in self._skins:
            return self._skins[number]
        skin = self._at("skins", number, of)
        of = f"its skin {number}"
        joints = skin.get("joints", [])
        if lost := [joint for joint in joints if joint not in worlds]:
            raise ValueError(f"{of} has joint {lost[0]!r}, which is not in the scene; it is damaged")
        # Twice, and the inverse ones.
        self._source.allow(self.held + 3 * 128 * len(joints), f"the {len(joints):,} joints of {of}")
        matrices = np.stack([worlds[joint] for joint in joints]) if joints else np.zeros((0, 4, 4))
        if "inverseBindMatrices" in skin:
            inverse = self._rows(skin["inverseBindMatrices"], "MAT4", len(joints), of)
            # Stored column by column.
            matrices = matrices @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
        self.held += matrices.nbytes
        self._skins[number] = matrices
        return matrices

    # Numbers.

    def _count(self, accessor: dict, of: str) -> int:
        count = accessor.get("count")
        if type(count) is not int or count < 0:
            raise ValueError(f"{of} has {count!r} entries; it is damaged")
        return count

    def _bytes(self, view: Any, first: int, count: int, of: str) -> bytes:
        """Bytes of a buffer view, from its byte `first`."""
        entry = self._at("bufferViews", view, of)
        packed = [name for name in _PACKED if name in entry.get("extensions", {})]
        if packed:
            raise ValueError(
                f"{of} is packed by {packed[0]}, which is not read: export it without compression"
            )
        start, length = entry.get("byteOffset", 0), entry.get("byteLength", -1)
        number: Any = entry.get("buffer")
        buffer = self._at("buffers", number, f"its buffer view {view}")
        if any(type(value) is not int or value < 0 for value in (start, length)):
            raise ValueError(f"its buffer view {view} has no sound place; it is damaged")
        if first < 0 or first + count > length:
            raise ValueError(f"{of} reaches beyond its buffer view {view}; it is damaged")
        uri = buffer.get("uri")
        if uri is not None:
            data = self._data(number, uri)
            if start + length > len(data):
                raise ValueError(f"its buffer view {view} reaches beyond its buffer; it may be cut short")
            return data[start + first : start + first + count]
        place, size = self._bin
        if number != 0 or start + length > size:
            raise ValueError(f"its buffer view {view} reaches beyond its buffer; it may be cut short")
        self._source.seek(place + start + first)
        return self._source.read(count)

    def _data(self, number: int, uri: Any) -> bytes:
        """A buffer that is embedded as text."""
        if number not in self._embedded:
            head, comma, text = str(uri).partition(",")
            if not comma or not head.startswith("data:") or not head.endswith(";base64"):
                raise ValueError(
                    f"its geometry is in another file ({str(uri)[:80]!r}), which is not read: "
                    "export everything as one .glb"
                )
            self.held += len(text)
            self._source.allow(self.held, "its embedded buffers")
            self._embedded[number] = base64.b64decode(text, validate=True)
        return self._embedded[number]

    def _blocks(self, number: Any, width: str, of: str) -> Iterator[tuple[int, np.ndarray]]:
        """Rows of an accessor as stored, (rows, width) or for scalars (rows,), with the first's number."""
        accessor = self._at("accessors", number, of)
        of = f"its accessor {number}"
        if accessor.get("type") != width or accessor.get("componentType") not in _KINDS:
            raise ValueError(
                f"{of} should be {width} of a known kind, is {accessor.get('type')!r} of "
                f"{accessor.get('componentType')!r}; it is damaged"
            )
        kind = np.dtype(_KINDS[accessor["componentType"]])
        count, columns = self._count(accessor, of), _WIDTHS[width]
        size = kind.itemsize * columns
        offset = accessor.get("byteOffset", 0)
        if type(offset) is not int:
            raise ValueError(f"{of} has no sound place; it is damaged")
        changed, values = self._sparse(accessor, kind, columns, of)
        for first in range(0, count, _ROWS):
            rows = min(_ROWS, count - first)
            if "bufferView" in accessor:
                stride = self._at("bufferViews", accessor["bufferView"], of).get("byteStride", size)
                if type(stride) is not int or stride < size:
                    raise ValueError(f"{of} has rows of {stride!r} bytes, needs {size}; it is damaged")
                data = self._bytes(
                    accessor["bufferView"], offset + first * stride, (rows - 1) * stride + size, of
                )
                block: np.ndarray = np.ndarray((rows, columns), kind, data, strides=(stride, kind.itemsize))
            else:
                block = np.zeros((rows, columns), kind)
            if changed is not None:
                here = slice(*np.searchsorted(changed, (first, first + rows)))
                block = block.copy()
                block[changed[here] - first] = values[here]
            yield first, block[:, 0] if width == "SCALAR" else block

    def _sparse(self, accessor: dict, kind: np.dtype, columns: int, of: str) -> tuple[Any, Any]:
        """Rows that are stored apart, in ascending order, and what is in them."""
        sparse = accessor.get("sparse")
        if sparse is None:
            return None, None
        count = self._count(sparse, of)
        ids, values = sparse["indices"], sparse["values"]
        id_kind = np.dtype(_KINDS[ids["componentType"]])
        self._source.allow(self.held + count * (8 + 2 * kind.itemsize * columns), "its sparse values")
        data = self._bytes(ids["bufferView"], ids.get("byteOffset", 0), count * id_kind.itemsize, of)
        changed = np.frombuffer(data, id_kind).astype(np.int64)
        # The last one is the largest then.
        outside = count and not 0 <= changed[0] <= changed[-1] < self._count(accessor, of)
        if outside or (np.diff(changed) <= 0).any():
            raise ValueError(f"{of} has sparse rows out of order; it is damaged")
        size = kind.itemsize * columns
        data = self._bytes(values["bufferView"], values.get("byteOffset", 0), count * size, of)
        return changed, np.frombuffer(data, kind).reshape(count, columns)

    def _rows(self, number: Any, width: str, wanted: int, of: str) -> np.ndarray:
        """The first rows of an accessor as float64."""
        count = self._count(self._at("accessors", number, of), of)
        if count < wanted:
            raise ValueError(
                f"{of} needs {wanted} rows of accessor {number}, which has {count}; it is damaged"
            )
        self._source.allow(self.held + 8 * wanted * _WIDTHS[width], f"the numbers of {of}")
        rows = np.zeros((wanted, _WIDTHS[width]))
        for first, block in self._blocks(number, width, of):
            # There may be any number more.
            if first >= wanted:
                break
            rows[first : first + len(block)] = block[: wanted - first]
        return rows

    # Geometry.

    def fill(self, part: _Part, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Writes a part's vertices in world space, and its triangles counted from its first vertex."""
        attributes = part.primitive["attributes"]
        for first, block in self._floats(attributes["POSITION"], "VEC3"):
            vertices[first : first + len(block)] = block
        common: np.ndarray | None = part.world
        if part.joints is not None and len(part.joints) and "JOINTS_0" in attributes:
            common = _common(part.joints)
        if common is not None:
            for first in range(0, len(vertices), _ROWS):
                block = vertices[first : first + _ROWS]
                block[:] = block @ common[:3, :3].T + common[:3, 3]
            mirrors = _mirrors(common)
        else:
            assert part.joints is not None
            self._pose(part, part.joints, vertices)
            mirrors = _mirrors(part.joints[0])
        self._triangles(part, faces)
        if len(faces) and faces.max() >= part.vertex_count:
            raise ValueError(f"a triangle names vertex {faces.max()} of {part.vertex_count}; it is damaged")
        if mirrors:
            begins = faces[:, 0].copy()
            faces[:, 0], faces[:, 2] = faces[:, 2], begins

    def _floats(self, number: Any, width: str) -> Iterator[tuple[int, np.ndarray]]:
        """Rows of an accessor as the numbers that they mean: normalised ones are −1…1."""
        is_normalised = self._at("accessors", number, "a mesh").get("normalized")
        for first, block in self._blocks(number, width, "a mesh"):
            if is_normalised and block.dtype.kind in "iu":
                yield first, np.maximum(block / np.iinfo(block.dtype).max, -1.0)
            else:
                yield first, block

    def _pose(self, part: _Part, skin: np.ndarray, vertices: np.ndarray) -> None:
        """Places vertices by linear blend skinning: the mean of where their joints carry them, by weights."""
        attributes = part.primitive["attributes"]
        if f"JOINTS_{_SETS}" in attributes:
            raise ValueError(f"a mesh has more than {4 * _SETS} joints a vertex: limit them in the export")
        sets = [k for k in range(_SETS) if f"JOINTS_{k}" in attributes and f"WEIGHTS_{k}" in attributes]
        readers = []
        for number in (attributes[f"{word}_{k}"] for word in ("JOINTS", "WEIGHTS") for k in sets):
            if self._count(self._at("accessors", number, "a mesh"), "a mesh") != part.vertex_count:
                raise ValueError("a mesh has more or fewer joints than vertices; it is damaged")
            readers.append(self._floats(number, "VEC4"))
        for blocks in zip(*readers, strict=True):
            first, rows = blocks[0][0], len(blocks[0][1])
            points = vertices[first : first + rows]
            placed, total = np.zeros_like(points), np.zeros((rows, 1))
            for (_, joints), (_, weights) in zip(blocks[: len(sets)], blocks[len(sets) :], strict=True):
                for joint, weight in zip(joints.T, weights.T[:, :, None], strict=True):
                    # Rows without weight often name no joint.
                    used = np.where(weight[:, 0] != 0, joint, 0)
                    if used.min() < 0 or used.max() >= len(skin):
                        raise ValueError(
                            f"a mesh has joints {used.min()}…{used.max()} of {len(skin)}; it is damaged"
                        )
                    matrices = skin[used]
                    carried = np.einsum("nij,nj->ni", matrices[:, :3, :3], points) + matrices[:, :3, 3]
                    placed += weight * carried
                    total += weight
            free = total[:, 0] == 0
            placed[free] = points[free] @ part.world[:3, :3].T + part.world[:3, 3]
            total[free] = 1
            points[:] = placed / total

    def _triangles(self, part: _Part, faces: np.ndarray) -> None:
        mode = part.primitive.get("mode", _TRIANGLES)
        indices = part.primitive.get("indices")
        if mode == _TRIANGLES:
            flat = faces.reshape(-1)
            if indices is None:
                flat[:] = np.arange(len(flat))
            else:
                for first, block in self._blocks(indices, "SCALAR", "a mesh"):
                    flat[first : first + len(block)] = block
            return
        ids = np.arange(part.vertex_count)
        if indices is not None:
            self._source.allow(self.held + 72 * (part.face_count + 2), "its strips and fans")
            ids = np.concatenate(
                [block.astype(np.int64) for _, block in self._blocks(indices, "SCALAR", "a mesh")]
            )
        if len(faces):
            faces[:, 0], faces[:, 1], faces[:, 2] = (
                (ids[0], ids[1:-1], ids[2:]) if mode == _FAN else (ids[:-2], ids[1:-1], ids[2:])
            )
            if mode == _STRIP:
                faces[1::2] = faces[1::2][:, [1, 0, 2]]


def _local(node: dict, number: int) -> np.ndarray | None:
    """(4, 4) from a node's coordinates to its parent's; None for the same."""
    if "matrix" in node:
        return _numbers(node, "matrix", 16, number).reshape(4, 4).T
    if not node.keys() & {"translation", "rotation", "scale"}:
        return None
    local = np.eye(4)
    if "rotation" in node:
        x, y, z, w = _numbers(node, "rotation", 4, number)
        length = x * x + y * y + z * z + w * w
        if not length > 0:
            raise ValueError(f"its node {number} has a rotation of no length; it is damaged")
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        local[:3, :3] += 2 / length * (w * cross + cross @ cross)
    if "scale" in node:
        local[:3, :3] *= _numbers(node, "scale", 3, number)
    if "translation" in node:
        local[:3, 3] = _numbers(node, "translation", 3, number)
    return local


def _numbers(node: dict, name: str, count: int, number: int) -> np.ndarray:
    values = node[name]
    sound = isinstance(values, list) and len(values) == count
    if not sound or not all(type(v) in (int, float) and math.isfinite(v) for v in values):
        raise ValueError(f"its node {number} has no sound {name}; it is damaged")
    return np.array(values, float)


def _common(joints: np.ndarray) -> np.ndarray | None:
    """The one matrix that all joints are up to rounding, as in the pose of binding; else None.

    By one matrix vertices that lie in one place stay in one place, whatever their weights.
    """
    spread = np.ptp(joints, axis=0).max()
    return joints.mean(axis=0) if spread <= _ROUNDING * np.abs(joints).max() else None


def _mirrors(matrix: np.ndarray) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0)
