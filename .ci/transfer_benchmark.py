"""Quality of transfer where the truth is known, beside nearest-surface transfer and Blender's Data Transfer.

    .venv/bin/python .ci/transfer_benchmark.py [--size N] [--data FOLDER] [--json OUT]

Generated characters know which points correspond, and carry exact weights and a layout. FOLDER, if given, is
a set of characters as OBJ files with `pairs.txt` (target, source), `corr_pairs` and `weights`, of which only
weights are measured, where the target has a counterpart: for the pairs of the list, and for all that stand in
one rest pose. Needs bpy and the "tools" extra.
"""

import argparse
import json
import sys
import time
from itertools import permutations
from pathlib import Path

import bpy
import numpy as np
import sgmds
from mathutils.bvhtree import BVHTree
from sgmds import characters

TEXTURE = 1024
UV_TEXELS = 2048
METHODS = ("nearest", "modifier", "ours")
# What the map cannot better: transfer along the known map, and the source itself.
REFERENCES = ("true map", "source")


class Side:
    """A mesh with what it carries, as triangles: vertices, faces, weights (n, bones), uv (m, 3, 2)."""

    def __init__(self, vertices, faces, weights, uv=None):
        self.vertices, self.faces = np.asarray(vertices, float), np.asarray(faces, int)
        self.weights, self.uv = weights, uv
        self.size = np.linalg.norm(np.ptp(self.vertices, axis=0))

    @property
    def mesh(self):
        return self.vertices, self.faces

    @property
    def polygons(self):
        return np.arange(len(self.faces) + 1) * 3, self.faces.ravel()


def nearest_map(source, target):
    """The nearest point of the source to each target vertex, as they stand."""
    tree = BVHTree.FromPolygons(source.vertices.tolist(), source.faces.tolist(), all_triangles=True)
    found = [tree.find_nearest(point)[::2] for point in target.vertices.tolist()]
    face = np.array([index for _, index in found])
    a, b, c = (source.vertices[source.faces[face, k]] for k in range(3))
    point = np.array([place for place, _ in found])
    u, v, d = b - a, c - a, point - a
    uu, uv, vv = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v)))
    ud, vd = (u * d).sum(axis=1), (v * d).sum(axis=1)
    area = np.maximum(uu * vv - uv * uv, 1e-30)
    s, t = (vv * ud - uv * vd) / area, (uu * vd - uv * ud) / area
    weights = np.clip(np.stack([1 - s - t, s, t], axis=1), 0.0, 1.0)
    return face, weights / weights.sum(axis=1, keepdims=True)


def sparse(table):
    vertex, group = np.nonzero(table)
    return np.append(0, np.cumsum((table != 0).sum(axis=1))), group, table[vertex, group]


def carried_weights(way, source):
    """As the extension carries them by default: as many a vertex as come, rows scaled back to their sum."""
    found = way.skin_weights(*sparse(source.weights), source.weights.shape[1], prune=1e-3)
    return found.dense(source.weights.shape[1])


def new_object(name, side, with_data):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(side.vertices.tolist(), [], side.faces.tolist())
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    if with_data:
        for group in range(side.weights.shape[1]):
            made = obj.vertex_groups.new(name=str(group))
            for vertex in np.flatnonzero(side.weights[:, group]).tolist():
                made.add([vertex], float(side.weights[vertex, group]), "REPLACE")
        if side.uv is not None:
            mesh.uv_layers.new(name="UV").uv.foreach_set("vector", side.uv.astype(np.float32).ravel())
    return obj


def data_transfer(source, target):
    """Weights and UVs of Blender's Data Transfer modifier with its best mappings."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    given, taker = new_object("Source", source, True), new_object("Target", target, False)
    modifier = taker.modifiers.new("Data Transfer", "DATA_TRANSFER")
    modifier.object = given
    modifier.use_vert_data, modifier.data_types_verts = True, {"VGROUP_WEIGHTS"}
    modifier.vert_mapping = "POLYINTERP_NEAREST"
    if source.uv is not None:
        modifier.use_loop_data, modifier.data_types_loops = True, {"UV"}
        modifier.loop_mapping = "POLYINTERP_NEAREST"
    with bpy.context.temp_override(object=taker, active_object=taker):
        bpy.ops.object.datalayout_transfer(modifier=modifier.name)
    shown = taker.evaluated_get(bpy.context.evaluated_depsgraph_get())
    weights = np.zeros((len(target.vertices), source.weights.shape[1]))
    place = {group.index: int(group.name) for group in taker.vertex_groups}
    for vertex in shown.data.vertices:
        for entry in vertex.groups:
            weights[vertex.index, place[entry.group]] = entry.weight
    uv = None
    if source.uv is not None:
        uv = np.empty(len(target.faces) * 6, np.float32)
        shown.data.uv_layers[0].uv.foreach_get("vector", uv)
        uv = uv.reshape(-1, 3, 2).astype(float)
    return weights, uv


class Posed:
    """Linear blend skinning of one body from its rest into a pose."""

    def __init__(self, rest, pose):
        self.turn = np.einsum("bki,bkj->bij", pose.frames, rest.frames)
        self.before, self.after = rest.starts, pose.starts

    def __call__(self, points, weights):
        moved = np.einsum("bij,nbj->nbi", self.turn, points[:, None] - self.before) + self.after
        return np.einsum("nb,nbi->ni", weights, moved)


def weight_errors(found, truth):
    """Half the sum of absolute differences: the share of a vertex's weight that hangs on wrong bones."""
    wrong = np.abs(found - truth).sum(axis=1) / 2
    return 100 * wrong.mean(), 100 * np.quantile(wrong, 0.95)


def bulges(character):
    """A shape key known on every body: a bulge on one side of each bone, in units of the bone's radius."""
    body, part = character.body, character.part
    axis = body.ends[part] - body.starts[part]
    at = body.starts[part] + character.axial[:, None] * axis
    outward = character.vertices - at
    height = 0.3 * np.clip(np.cos(character.angle), 0, None) ** 2
    height *= np.sin(np.pi * np.clip(character.axial, 0, 1)) ** 2
    return outward * height[:, None]


def picture(kind, side):
    y, x = (np.mgrid[:side, :side] + 0.5) / side
    image = np.ones((side, side, 4), np.float32)
    if kind == "checker":
        image[..., :3] = ((np.floor(x * 64) + np.floor(y * 64)) % 2)[..., None]
        return image
    rng = np.random.default_rng(0)
    for c in range(3):
        total = np.zeros((side, side))
        for frequency in (2, 4, 8, 16, 32, 64, 96):
            for _ in range(3):
                a, b = rng.normal(size=2) * frequency
                total += np.cos(2 * np.pi * (a * x + b * y) + rng.uniform(0, 6.3)) / frequency
        image[..., c] = (total - total.min()) / np.ptp(total)
    return image


def psnr(way, source, target, image, chosen):
    """Of an image baked into a layout that is the source's own at corresponding points."""
    uv = target.uv.copy()
    uv[~chosen] = 0.0
    baked = way.bake(source.uv, uv, image, TEXTURE, TEXTURE, margin=0)
    inside = baked[..., 3] > 0.5
    return 10 * np.log10(1.0 / np.mean((baked[inside][:, :3] - image[inside][:, :3]) ** 2))


def cell_of(uv, columns):
    return np.floor(uv * columns).astype(int)


TURN = 0.6
"""Width of a full turn around a bone in an island's cell."""


class Chart:
    """The islands of a layout in UV, one for each cell that has triangles."""

    # Corners, middles of the edges, middle.
    WEIGHTS = np.array(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3] * 3]
    )
    INSIDE = 1e-6

    def __init__(self, uv, columns):
        flat = np.concatenate([uv.reshape(-1, 2), np.zeros((3 * len(uv), 1))], axis=1)
        rows = np.arange(len(flat)).reshape(-1, 3).tolist()
        self._tree = BVHTree.FromPolygons(flat.tolist(), rows, all_triangles=True)
        self._island = cell_of(uv.mean(axis=1), columns) @ (1, columns)
        self._turn = TURN / columns

    def _shows(self, places):
        """The islands on which places lie; a place between islands shows none."""
        found = (self._tree.find_nearest((*place, 0.0)) for place in places.tolist())
        return {self._island[face] for _, _, face, away in found if away < self.INSIDE}

    def over_two(self, uv):
        """How many triangles show parts of two islands."""
        return sum(len(self._shows(self.WEIGHTS @ triangle)) > 1 for triangle in uv)

    def over_a_cut(self, uv):
        """Which triangles go the long way around their bone, over the cut that opens it."""
        around = np.sort(uv[..., 0] % self._turn, axis=1)
        gaps = np.concatenate([np.diff(around, axis=1), around[:, :1] + self._turn - around[:, 2:]], axis=1)
        return np.ptp(uv[..., 0], axis=1) > self._turn - gaps.max(axis=1) + CUT_ROOM * self._turn


CUT_ROOM = 0.1
"""Share of a turn by which the long way is longer before it counts: near half a turn both are as good."""


def true_map(source, target, given, taker):
    """The known map, and the target's vertices whose counterpart has a closed form."""
    exact, _ = characters.truth(taker, given)
    points = characters.carried(taker.vertices, taker.body, given.body)
    return sgmds.SurfaceMap(
        source.mesh, target.mesh, *nearest_map(source, Side(points, target.faces, None))
    ), exact


def characters_table(kind, builds, poses, size):
    """Figures of one pair of generated characters: {what: {method: figure}}."""
    given = characters.make(kind, builds[0], poses[0], size, seed=0)
    taker = characters.make(kind, builds[1], poses[1], size, seed=1)
    source = Side(given.vertices, given.faces, given.weights, given.uv)
    target = Side(taker.vertices, taker.faces, taker.weights, taker.uv)
    corr = sgmds.match(source.mesh, target.mesh)
    ways = {
        "ours": sgmds.SurfaceMap.of(corr, source.mesh, target.mesh),
        "nearest": sgmds.SurfaceMap(source.mesh, target.mesh, *nearest_map(source, target)),
    }
    true, exact = true_map(source, target, given, taker)
    modifier_weights, modifier_uv = data_transfer(source, target)
    weights = {name: carried_weights(way, source) for name, way in ways.items()}
    weights |= {"modifier": modifier_weights, "true map": carried_weights(true, source)}
    figures = {}

    def note(what, method, figure):
        figures.setdefault(what, {})[method] = float(figure)

    rest, walk = taker.body, characters.make(kind, builds[1], "walk", 500).body
    pose = Posed(rest, walk)
    true_pose = pose(target.vertices, target.weights)
    for name, found in weights.items():
        mean, most = weight_errors(found, target.weights)
        note("weight error, mean %", name, mean)
        note("weight error, 95 % quantile", name, most)
        posed = pose(target.vertices, found / np.maximum(found.sum(axis=1, keepdims=True), 1e-9))
        away = np.linalg.norm(posed - true_pose, axis=1) / target.size
        note(DEFORMATION, name, 100 * away.mean())
        known_mean, _ = weight_errors(found[exact], target.weights[exact])
        note("weight error where the map is known, mean %", name, known_mean)
        note("weight rows, largest error of the sum", name, np.abs(found.sum(axis=1) - 1).max())

    columns = int(np.ceil(np.sqrt(len(given.body.names))))
    layouts = {name: way.layout(*target.polygons, source.uv) for name, way in ways.items()}
    found_uv = {name: layout.uv.reshape(-1, 3, 2) for name, layout in layouts.items()}
    found_uv["modifier"] = modifier_uv
    part = cell_of(taker.uv.mean(axis=1), columns) @ (1, columns)
    known = (taker.addressed[taker.faces] & (taker.part[taker.faces] == part[:, None])).all(axis=1)
    straddling = layouts["ours"].straddles
    chart = Chart(source.uv, columns)
    for name, uv in found_uv.items():
        same = known & (cell_of(uv.mean(axis=1), columns) @ (1, columns) == part)
        step = uv - taker.uv
        step[..., 0] -= np.round(step[..., 0] / (0.6 / columns)) * (0.6 / columns)
        far = np.linalg.norm(step, axis=-1).mean(axis=1) * UV_TEXELS
        note("UV error away from seams, texels of 2K", name, far[same & ~straddling].mean())
        note("UV error at seams, texels of 2K", name, far[same & straddling].mean())
        note("triangles over two islands", name, chart.over_two(uv))
        note("triangles over a cut", name, chart.over_a_cut(uv)[known].sum())

    field, truth = bulges(given), bulges(taker)
    asked = taker.addressed
    size_of = np.linalg.norm(truth[asked], axis=1).mean()
    for name, way in ways.items():
        moved = (
            way.displacements(field)
            if name == "ours"
            else (field[source.faces[way.faces]] * way.barycentric[..., None]).sum(axis=1)
        )
        miss = np.linalg.norm(moved[asked] - truth[asked], axis=1).mean()
        note("shape-key displacement error, % of the key's", name, 100 * miss / size_of)
        for what in ("checker", "photo"):
            figure = psnr(way, source, target, picture(what, TEXTURE), known & ~straddling)
            note(f"texture: {what}, PSNR dB", name, figure)

    ends = np.concatenate([given.body.starts, given.body.ends])
    held = [(np.flatnonzero(column), column[column > 0]) for column in given.weights.T]
    placed, _, _ = ways["ours"].joints(ends, held + held)
    true_ends = np.concatenate([taker.body.starts, taker.body.ends])
    joints = np.linalg.norm(placed - true_ends, axis=1) / target.size
    note("rig: joint position error, % of size", "ours", 100 * joints.mean())
    fitted = Rig(taker.body, placed[: len(held)])
    bend = pose.turn
    own = fitted(target.vertices, weights["ours"], bend)
    reference = Rig(given.body, given.body.starts)(source.vertices, source.weights, bend)
    for what, measure in MEASURES:
        note(
            f"rig: {what} after posing, % of rest",
            "ours",
            100 * measure(own, target) / measure(target.vertices, target),
        )
        note(
            f"rig: {what} after posing, % of rest",
            "source",
            100 * measure(reference, source) / measure(source.vertices, source),
        )
    return figures


class Rig:
    """A chain of joints that turns by given rotations, for posing with joints that were placed by a map."""

    def __init__(self, body, starts):
        self.starts = starts
        self.parents = [
            next(
                (i for i, other in enumerate(characters.SKELETONS[body.kind]) if other.name == bone.parent),
                -1,
            )
            for bone in characters.SKELETONS[body.kind]
        ]

    def __call__(self, points, weights, turn):
        shift = np.zeros_like(self.starts)
        for bone, parent in enumerate(self.parents):
            joint = self.starts[bone]
            shift[bone] = (
                joint if parent < 0 else turn[parent] @ (joint - self.starts[parent]) + shift[parent]
            )
        moved = np.einsum("bij,nbj->nbi", turn, points[:, None] - self.starts) + shift
        return np.einsum("nb,nbi->ni", weights, moved)


def volume(points, side):
    a, b, c = (points[side.faces[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


def edge_length(points, side):
    return np.linalg.norm(points[side.faces] - points[np.roll(side.faces, 1, axis=1)], axis=-1).mean()


DEFORMATION = "deformation error after posing, % of size"
MEASURES = (("volume", volume), ("mean edge length", edge_length))


def copy_table(size):
    """A character and its turned, renumbered copy, matched: every texture comes back."""
    given = characters.make("biped", "plain", "wave", size, seed=0)
    rng = np.random.default_rng(1)
    old = rng.permutation(len(given.vertices))
    new = np.argsort(old)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    order = rng.permutation(len(given.faces))
    source = Side(given.vertices, given.faces, given.weights, given.uv)
    target = Side(given.vertices[old] @ turn.T, new[given.faces][order], given.weights[old], given.uv[order])
    corr = sgmds.match(source.mesh, target.mesh)
    way = sgmds.SurfaceMap.of(corr, source.mesh, target.mesh)
    field = bulges(given)
    field[given.vertices[:, 2] < 0.9] = 0.0
    moved = way.displacements(field)
    still = (field[source.faces[way.faces]] == 0).all(axis=(1, 2))
    figures = {f"texture: {what}, PSNR dB": {} for what in ("checker", "photo")}
    for what in ("checker", "photo"):
        chosen = np.ones(len(target.faces), bool)
        figures[f"texture: {what}, PSNR dB"]["ours"] = float(
            psnr(way, source, target, picture(what, TEXTURE), chosen)
        )
    figures["shape keys: still vertices that moved"] = {"ours": int(moved[still].any(axis=1).sum())}
    figures["weight error, mean %"] = {"ours": weight_errors(carried_weights(way, source), target.weights)[0]}
    return figures


SHAKE = np.radians(20.0)
"""By which every bone turns about its own middle: a pose for bodies that come without a skeleton."""


def shaken(points, weights, centres, turns):
    """Linear blend skinning with each bone turned about its centre."""
    moved = np.einsum("bij,nbj->nbi", turns, points[:, None] - centres) + centres
    return np.einsum("nb,nbi->ni", weights, moved)


def bone_centres(side):
    """Middle of what each bone moves; that of the body for a bone which moves nothing."""
    total = side.weights.sum(axis=0)
    sums = side.weights.T @ side.vertices
    return np.where(total[:, None] > 0, sums / np.maximum(total, 1e-12)[:, None], side.vertices.mean(axis=0))


def bone_turns(count):
    """A turn by `SHAKE` about an axis of its own for each bone."""
    axes = np.random.default_rng(0).normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    cross = np.zeros((count, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, i, j], cross[:, j, i] = -axes[:, k], axes[:, k]
    return np.eye(3) + np.sin(SHAKE) * cross + (1 - np.cos(SHAKE)) * cross @ cross


def read_obj(path):
    """Vertices and triangles of an OBJ file of polygons."""
    vertices, faces = [], []
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
            faces += [[corners[0], *pair] for pair in zip(corners[1:], corners[2:], strict=False)]
    return np.array(vertices), np.array(faces)


def folder_pairs(folder):
    """Target and source of each line of `pairs.txt`, then of characters in their rest pose."""
    listed = [tuple(line.split()) for line in (folder / "pairs.txt").read_text().splitlines()]
    resting = sorted(path.stem for path in folder.glob("*-rest.obj"))
    return listed + [pair for pair in permutations(resting, 2) if pair not in listed]


def counterparts(folder, taker, given, count):
    """The source's vertex for each of the target's, by any pair of these topologies; -1 where unknown."""
    topologies = [name.split("-")[0] for name in (taker, given)]
    if topologies[0] == topologies[1]:
        return np.arange(count)
    found = np.full(count, -1)
    for own, (first, second) in ((1, topologies[::-1]), (0, topologies)):
        for path in (folder / "corr_pairs").glob(f"{first}-*__{second}-*.txt"):
            if not path.name.endswith(".sym.txt"):
                lines = np.loadtxt(path, dtype=int)
                found[lines[:, own]] = lines[:, 1 - own]
    return found


def folder_tables(folder):
    """Weights of a folder of characters."""
    folder = Path(folder)
    for taker, given in folder_pairs(folder):
        kept = [json.loads((folder / f"weights/{n.split('-')[0]}.json").read_text()) for n in (given, taker)]
        names = sorted(set(kept[0]["groups"]) | set(kept[1]["groups"]))
        sides = []
        for name, data in zip((given, taker), kept, strict=True):
            vertices, faces = read_obj(folder / f"{name}.obj")
            weights = np.zeros((len(vertices), len(names)))
            for bone, entries in data["groups"].items():
                for vertex, weight in entries:
                    if vertex < len(vertices):
                        weights[vertex, names.index(bone)] = weight
            sides.append(
                Side(vertices, faces, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9))
            )
        source, target = sides
        corr = sgmds.match(source.mesh, target.mesh)
        ways = {
            "ours": sgmds.SurfaceMap.of(corr, source.mesh, target.mesh),
            "nearest": sgmds.SurfaceMap(source.mesh, target.mesh, *nearest_map(source, target)),
        }
        weights = {name: carried_weights(way, source) for name, way in ways.items()}
        weights["modifier"] = data_transfer(source, target)[0]
        asked = (corr.confidence > 0) & (target.weights.sum(axis=1) > 0.5)
        known = counterparts(folder, taker, given, len(target.vertices))
        if (known >= 0).any():
            asked &= known >= 0
            weights["true map"] = source.weights[known]
        figures = {"weight error, mean %": {}, "weight error, 95 % quantile": {}}
        turns = bone_turns(len(names))
        true_pose = shaken(target.vertices, target.weights, bone_centres(target), turns)
        for name, found in weights.items():
            mean, most = weight_errors(found[asked], target.weights[asked])
            figures["weight error, mean %"][name], figures["weight error, 95 % quantile"][name] = mean, most
            posed = shaken(target.vertices, found, bone_centres(target), turns)
            away = np.linalg.norm(posed - true_pose, axis=1)[asked] / target.size
            figures.setdefault(DEFORMATION, {})[name] = 100 * away.mean()
            if name in REFERENCES:
                continue  # Known where the target has a counterpart, not on the whole body.
            for what, measure in MEASURES:
                row = figures.setdefault(f"rig: {what} after posing, % of rest", {})
                row[name] = 100 * measure(posed, target) / measure(target.vertices, target)
        own = shaken(source.vertices, source.weights, bone_centres(source), turns)
        for what, measure in MEASURES:
            row = figures[f"rig: {what} after posing, % of rest"]
            row["source"] = 100 * measure(own, source) / measure(source.vertices, source)
        yield f"{given} → {taker} ({corr.quality.grade})", figures


def text(title, figures):
    lines = [f"\n{title}", f"{'':46} " + " ".join(f"{name:>10}" for name in (*METHODS, *REFERENCES))]
    for what, row in figures.items():
        cells = (f"{row[name]:10.4g}" if name in row else f"{'–':>10}" for name in (*METHODS, *REFERENCES))
        lines.append(f"{what:46} " + " ".join(cells))
    return "\n".join(lines)


def write_seconds():
    """Processor time of writing 50,000 vertices × 4 of 60 groups in the extension."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from addon.transfer.weights import write_weights

    count, groups = 50_000, 60
    rng = np.random.default_rng(0)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    side = Side(rng.random((count, 3)), np.arange(count // 3 * 3).reshape(-1, 3), np.zeros((count, 1)))
    obj = new_object("Many", side, False)
    group = (rng.integers(0, groups, count)[:, None] + np.arange(4)) % groups
    entries = np.repeat(np.arange(count), 4), group.ravel(), rng.dirichlet(np.ones(4), count).ravel()
    taken = []
    for _ in range(2):
        begun = time.process_time()
        write_weights(obj, [f"Bone {i}" for i in range(groups)], entries)
        taken.append(time.process_time() - begun)
    return {"first time, s": {"ours": taken[0]}, "over earlier weights, s": {"ours": taken[1]}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", type=int, default=5000)
    parser.add_argument("--data", help="folder of characters with weights")
    parser.add_argument("--json", help="where to write the figures")
    given = parser.parse_args()
    tables = {"writing 50,000 × 4 weights, processor time": write_seconds()}
    tables["a character and its turned, renumbered copy"] = copy_table(given.size)
    for kind, builds, poses in (
        ("biped", ("slender", "stout"), ("rest", "rest")),
        ("quadruped", ("slender", "stout"), ("rest", "rest")),
        ("biped", ("plain", "stout"), ("wave", "rest")),
    ):
        title = f"{kind}, {builds[0]} ({poses[0]}) → {builds[1]} ({poses[1]})"
        tables[title] = characters_table(kind, builds, poses, given.size)
        print(text(title, tables[title]), flush=True)
    for title, figures in folder_tables(given.data) if given.data else ():
        tables[title] = figures
        print(text(title, figures), flush=True)
    for title in list(tables)[:2]:
        print(text(title, tables[title]))
    if given.json:
        Path(given.json).write_text(json.dumps(tables, indent=1))


if __name__ == "__main__":
    main()
