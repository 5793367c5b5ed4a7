"""Facial shape keys from one body onto another, the truth being known: errors, closed gaps, exchanged sheets.

    .venv/bin/python .ci/face_benchmark.py MAKEHUMAN [--pairs NAME …] [--keys NAME …] [--json OUT]

    .venv/bin/python .ci/face_benchmark.py MAKEHUMAN --keys all --json OUT.json
    .venv/bin/python .ci/tables.py --record OUT.json --machine TEXT

MAKEHUMAN is a folder with MakeHuman's CC0 sources: `base.obj`, `targets/macrodetails`,
`targets/expression/units/caucasian` and `base/proxymeshes`. A target displaces the same vertices on every
body, so a face unit is the truth for every other body, and through the bindings of a proxy for other
triangles. Lengths in metres, z up.
"""

import argparse
import gzip
import json
import sys
import time
from pathlib import Path

import numpy as np
import sgmds
from scipy.spatial import cKDTree

FEMALE = "macrodetails/caucasian-female-{0}", "macrodetails/universal-female-{0}-averagemuscle-{1}weight"
MALE = "macrodetails/caucasian-male-{0}", "macrodetails/universal-male-{0}-averagemuscle-{1}weight"
BODIES = {
    f"{name}{'' if age == 'young' else ' ' + age}{' ' + build if build in ('max', 'min') else ''}": tuple(
        part.format(age, build) for part in sex
    )
    for name, sex in (("woman", FEMALE), ("man", MALE))
    for age in ("young", "old", "child")
    for build in ("average", "max", "min")
}
UNITS = "expression/units/caucasian/"
# Groups of the base mesh that a face consists of besides the body.
PIECES = (
    *(f"helper-{side}-{part}" for side in "lr" for part in ("eye", "eyelashes-1", "eyelashes-2")),
    *("helper-upper-teeth", "helper-lower-teeth", "helper-tongue"),
)
KEYS = {"blink": "eye-left-closure", "smile": "mouth-corner-puller", "jawOpen": "mouth-open"}
# Vertices that move by more than this share of the largest displacement are measured.
MOVING = 0.6
# A gap is closed by a key when this share of it is left at most.
CLOSED = 0.25
# Lengths on the base body, whose height is 1.6 m: from where gaps and lips count, and how far sheets are told
# apart.
LEAST_GAP = 0.002
SHEETS_WITHIN = 0.008
HEAD_ABOVE_CHIN = 0.03


class MakeHuman:
    """The base mesh, its targets and proxies."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.vertices, self.faces, groups = read_obj(self.folder / "base.obj")
        self.body = [self.faces[i] for i in groups["body"]]
        self.pieces = [self.faces[i] for name in PIECES for i in groups[name]]
        # Number of the piece of each vertex, the body 0.
        self.piece = np.zeros(len(self.vertices), int)
        for number, name in enumerate(PIECES, 1):
            for i in groups[name]:
                self.piece[self.faces[i]] = number

    def target(self, *names):
        """Displacements of some targets together, (n, 3)."""
        moved = np.zeros_like(self.vertices)
        for name in names:
            with gzip.open(self.folder / "targets" / f"{name}.target.gz", "rt") as lines:
                for line in lines:
                    part = line.split()
                    if len(part) == 4 and part[0][0] != "#":
                        moved[int(part[0])] += [float(x) for x in part[1:]]
        return moved

    def proxy(self, name, positions):
        """A proxy's faces, the base vertices (n, 3) that carry each of its vertices, their weights, and its
        place on a body.
        """
        folder = self.folder / "base/proxymeshes" / name
        _, faces, _ = read_obj(folder / f"{name}.obj")
        scale, rows, inside = np.ones(3), [], False
        for line in open(folder / f"{name}.proxy", errors="replace"):
            part = line.split()
            if part and part[0] in ("x_scale", "y_scale", "z_scale"):
                axis = "xyz".index(part[0][0])
                a, b = (positions[int(v), axis] for v in part[1:3])
                scale[axis] = abs(a - b) / float(part[3])
            elif part and part[0] == "verts":
                inside = True
            elif inside and part and part[0].isdigit():
                rows.append(part if len(part) >= 9 else [part[0]] * 3 + ["1", "0", "0", "0", "0", "0"])
            elif inside and part:
                break
        by = np.array([[int(x) for x in row[:3]] for row in rows])
        weights = np.array([[float(x) for x in row[3:6]] for row in rows])
        offsets = np.array([[float(x) for x in row[6:9]] for row in rows]) * scale
        return faces, by, weights, np.einsum("ij,ijc->ic", weights, positions[by]) + offsets


class Body:
    """A mesh whose vertices are carried by base vertices."""

    def __init__(self, name, makehuman, shape, proxy=None, pieces=False):
        positions = makehuman.vertices + makehuman.target(*BODIES[shape])
        if proxy is None:
            faces = makehuman.body + (makehuman.pieces if pieces else [])
            by, weights, place = np.arange(len(positions))[:, None], None, positions
        else:
            faces, by, weights, place = makehuman.proxy(proxy, positions)
        used = np.unique(np.concatenate([np.asarray(f) for f in faces]))
        new = np.full(len(place), -1)
        new[used] = np.arange(len(used))
        self.name, self.by = name, by[used]
        self.weights = np.ones((len(used), 1)) if weights is None else weights[used]
        self.vertices = in_metres(place[used])
        self.triangles = np.array(
            [[new[f[0]], new[f[k]], new[f[k + 1]]] for f in faces for k in range(1, len(f) - 1)]
        )

    def carried(self, values):
        """Values of base vertices at the own ones, (n, …)."""
        return np.einsum("ij,ij...->i...", self.weights, np.asarray(values, float)[self.by])

    def cut(self, keep):
        """The faces whose corners are all kept, and of these the largest connected part."""
        faces = self.triangles[keep[self.triangles].all(axis=1)]
        used = np.unique(faces)
        new = np.full(len(self.vertices), -1)
        new[used] = np.arange(len(used))
        return self._with(self.vertices[used], new[faces], self.by[used], self.weights[used])

    def head(self, height):
        """What lies above a height of the base."""
        return self.cut(self.vertices[:, 2] > height)

    def subdivided(self):
        """Each triangle cut into four."""
        n, faces = len(self.vertices), self.triangles
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = n + number.reshape(3, -1)
        a, b, c = faces.T
        cut = np.concatenate([np.stack(f, 1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        middle = self.vertices[edges].mean(axis=1)
        by = np.concatenate([self.by[edges[:, 0]], self.by[edges[:, 1]]], axis=1)
        weights = np.concatenate([self.weights[edges[:, 0]], self.weights[edges[:, 1]]], axis=1) / 2
        pad = ((0, 0), (0, self.by.shape[1]))
        return self._with(
            np.concatenate([self.vertices, middle]),
            cut,
            np.concatenate([np.pad(self.by, pad), by]),
            np.concatenate([np.pad(self.weights, pad), weights]),
        )

    def turned(self, seed=1):
        """The same surface elsewhere, of another size, with its vertices and triangles in another order."""
        rng = np.random.default_rng(seed)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        order = rng.permutation(len(self.vertices))
        new = np.argsort(order)
        faces = new[self.triangles][rng.permutation(len(self.triangles))]
        return self._with(1.7 * self.vertices[order] @ turn.T + 3, faces, self.by[order], self.weights[order])

    def _with(self, vertices, triangles, by, weights):
        made = object.__new__(Body)
        made.name, made.vertices, made.triangles, made.by, made.weights = (
            self.name,
            vertices,
            triangles,
            by,
            weights,
        )
        return made

    @property
    def mesh(self):
        return self.vertices, self.triangles


class Sheets:
    """Upper and lower lid and lip on the base: 1 above, −1 below, 0 elsewhere; and the pairs of vertices that
    a key brings together.
    """

    def __init__(self, makehuman):
        self.body = np.unique(np.concatenate([np.asarray(f) for f in makehuman.body]))
        rest = in_metres(makehuman.vertices + makehuman.target(*BODIES["woman"]))
        self.rest = rest
        sheets = np.zeros((2, len(rest)))
        blink = in_metres(makehuman.target(UNITS + "eye-left-closure"))
        self.lid_pairs = self.brought_together(rest, blink)
        sheets[0] = self.apart(rest, rest[self.lid_pairs].mean(axis=1))
        jaw = in_metres(makehuman.target(UNITS + "mouth-open"))
        length = np.linalg.norm(jaw, axis=1) / np.linalg.norm(jaw, axis=1).max()
        near = cKDTree(rest[self.body]).query_pairs(0.003, output_type="ndarray")
        i, j = self.body[near].T
        slit = np.abs(length[i] - length[j]) > 0.5
        self.lip_pairs = np.stack(
            [np.where(length[i] > length[j], j, i), np.where(length[i] > length[j], i, j)], 1
        )[slit]
        near_slit = cKDTree(rest[self.lip_pairs].mean(axis=1)).query(rest)[0] < SHEETS_WITHIN
        front = near_slit & (rest[:, 1] < rest[self.lip_pairs.ravel(), 1].mean())
        sheets[1] = np.where(front, np.where(length > 0.5, -1, np.where(length < 0.3, 1, 0)), 0)
        self.sheets = sheets

    def brought_together(self, rest, moved):
        """Pairs of vertices, the upper one first, that a displacement brings together."""
        after = rest + moved
        near = cKDTree(after[self.body]).query_pairs(0.002, output_type="ndarray")
        pairs = self.body[near]
        gap, left = (np.linalg.norm(p[pairs[:, 0]] - p[pairs[:, 1]], axis=1) for p in (rest, after))
        pairs = pairs[(gap > LEAST_GAP) & (left < CLOSED * gap)]
        upper = np.argmax(rest[pairs, 2], axis=1)
        return np.stack([pairs[np.arange(len(pairs)), upper], pairs[np.arange(len(pairs)), 1 - upper]], 1)

    def apart(self, rest, middle):
        """1 above and −1 below the slit whose middle is given, within reach of it."""
        distance, nearest = cKDTree(middle[:, [0, 1]]).query(rest[:, [0, 1]])
        height = rest[:, 2] - middle[nearest, 2]
        near = cKDTree(middle).query(rest)[0] < SHEETS_WITHIN
        return np.where(near & (distance < 0.004) & (np.abs(height) > 0.001), np.sign(height), 0)


def in_metres(v):
    """Decimetres with y up as metres with z up."""
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], -1) / 10


def read_obj(path):
    """Vertices, faces and the faces of each group."""
    vertices, faces, groups, group = [], [], {}, None
    for line in open(path, errors="replace"):
        part = line.split()
        if part and part[0] == "v":
            vertices.append([float(x) for x in part[1:4]])
        elif part and part[0] == "g":
            group = part[1]
        elif part and part[0] == "f":
            groups.setdefault(group, []).append(len(faces))
            faces.append([int(corner.split("/")[0]) - 1 for corner in part[1:]])
    return np.array(vertices), faces, groups


def pairs_of(makehuman):
    """Name → function that makes (source, target)."""

    def body(name, *proxy, **options):
        return Body(name, makehuman, name, *proxy, **options)

    def heads(*names, **options):
        made = []
        for name in names:
            whole = body(name, **options)
            jaw = whole.carried(np.linalg.norm(makehuman.target(UNITS + "mouth-open"), axis=1))
            made.append(whole.head(whole.vertices[jaw > 0.5 * jaw.max(), 2].min() - HEAD_ABOVE_CHIN))
        return made

    return {
        "woman → man": lambda: (body("woman"), body("man")),
        "woman → child": lambda: (body("woman"), body("man child")),
        "man → old woman": lambda: (body("man"), body("woman old")),
        "woman → heavy man": lambda: (body("woman"), body("man max")),
        "woman → man, other topology": lambda: (body("woman"), body("man", "male_generic")),
        "other topology → man": lambda: (body("woman", "female_generic"), body("man")),
        "woman → man, low to high": lambda: (body("woman"), body("man").subdivided()),
        "head → head": lambda: tuple(heads("woman", "man")),
        "head → head, subdivided": lambda: tuple(h.subdivided() for h in heads("woman", "man")),
        "faces of ten pieces, woman → child": lambda: tuple(heads("woman", "man child", pieces=True)),
        "faces of ten pieces, man → old woman": lambda: tuple(heads("man", "woman old", pieces=True)),
        "head → body": lambda: (heads("woman")[0], body("man")),
        "woman → its copy": lambda: (body("woman"), body("woman").turned()),
    }


def measured(source, target, keys, sheets, makehuman, keep_contacts=True):
    """Rows of figures for each key of a pair, and of the pair."""
    start, worked = time.perf_counter(), time.process_time()
    found = sgmds.match(source.mesh, target.mesh)
    seconds = time.perf_counter() - start
    worked = time.process_time() - worked
    way = sgmds.SurfaceMap.of(found, source.mesh, target.mesh)
    scale = np.linalg.norm(np.ptp(target.vertices, axis=0)) / np.linalg.norm(np.ptp(source.vertices, axis=0))
    rows = {}
    for name, unit in keys.items():
        moved = in_metres(makehuman.target(UNITS + unit))
        right, offsets = target.carried(moved), source.carried(moved)
        made = way.displacements(offsets, keep_contacts=keep_contacts)
        turn = aligned(source, target)
        right, size = right @ turn.T, np.linalg.norm(right, axis=1) * np.linalg.norm(turn[0])
        most = size > MOVING * size.max()
        off = np.linalg.norm(made - right, axis=1)[most]
        cosine = (made * right).sum(axis=1)[most] / np.maximum(
            np.linalg.norm(made, axis=1)[most] * size[most], 1e-12
        )
        rows[name] = {
            "moves mm": 1e3 * size[most].mean(),
            "error %": 100 * off.mean() / size[most].mean(),
            "95 %": 100 * np.quantile(off, 0.95) / size[most].mean(),
            "angle": float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()),
            "closed": closed_share(source, target, made, right, moved, sheets),
        }
    images = found.barycentric, source.triangles[found.faces]
    exchanged = []
    for sheet in sheets.sheets:
        side = np.einsum("ij,ij->i", images[0], source.carried(sheet)[images[1]])
        exchanged.append(int(((side * target.carried(sheet)) < -0.5).sum()))
    place = np.einsum("ij,ijc->ic", images[0], source.vertices[images[1]])
    piece = [makehuman.piece[each.by[:, 0]] for each in (source, target)]
    pair = {
        "vertices": [len(source.vertices), len(target.vertices)],
        "seconds": seconds,
        "CPU seconds": worked,
        "lids": exchanged[0],
        "lips": exchanged[1],
        "pieces": int((piece[0][images[1][:, 0]] != piece[1]).sum()),
        "grade": found.quality.grade,
        "scale": scale,
    }
    if source.name == target.name and source.by.shape == target.by.shape:
        own = np.empty(len(makehuman.vertices), int)
        own[source.by[:, 0]] = np.arange(len(source.by))
        pair["copy mm"] = 1e3 * np.linalg.norm(place - source.vertices[own[target.by[:, 0]]], axis=1).max()
    return rows, pair


def aligned(source, target):
    """Turn and scale of a moved copy, the identity for other bodies."""
    if source.name != target.name or source.by.shape[1] != 1 or target.by.shape[1] != 1:
        return np.eye(3)
    own = np.empty(max(source.by.max(), target.by.max()) + 1, int)
    own[source.by[:, 0]] = np.arange(len(source.by))
    there, here = target.vertices, source.vertices[own[target.by[:, 0]]]
    return np.linalg.lstsq(here - here.mean(axis=0), there - there.mean(axis=0), rcond=None)[0].T


def closed_share(source, target, made, right, moved, sheets):
    """Of the gaps that a key closes on the target's own body, the share that it closes as made; nothing where
    it closes none.
    """
    if target.by.shape[1] != 1:
        return None
    pairs = sheets.brought_together(sheets.rest, moved)
    own = np.full(len(sheets.rest), -1)
    own[target.by[:, 0]] = np.arange(len(target.by))
    pairs = own[pairs]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    if len(pairs) == 0:
        return None
    rest, wanted, got = (
        np.linalg.norm(p[pairs[:, 0]] - p[pairs[:, 1]], axis=1)
        for p in (target.vertices, target.vertices + right, target.vertices + made)
    )
    opened = rest > wanted
    return float(np.mean((rest - got)[opened] / (rest - wanted)[opened])) if opened.any() else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("makehuman", help="folder with MakeHuman's sources")
    parser.add_argument("--pairs", nargs="*", help="pairs to measure, all by default")
    parser.add_argument("--keys", nargs="*", help="blink, smile, jawOpen by default; `all` face units")
    parser.add_argument("--open", action="store_true", help="keys carried without keeping contacts")
    parser.add_argument("--json", help="file for the figures")
    options = parser.parse_args()
    makehuman = MakeHuman(options.makehuman)
    units = sorted(
        p.name.removesuffix(".target.gz") for p in (makehuman.folder / "targets" / UNITS).glob("*.target.gz")
    )
    known = KEYS | {unit: unit for unit in units}
    wanted = units if options.keys == ["all"] else options.keys or list(KEYS)
    keys = {name: known[name] for name in wanted}
    sheets, pairs, table = Sheets(makehuman), pairs_of(makehuman), {}
    for name in options.pairs or pairs:
        source, target = pairs[name]()
        rows, pair = measured(source, target, keys, sheets, makehuman, not options.open)
        table[name] = {"keys": rows, "pair": pair}
        print(
            f"{name}: {len(source.vertices)} → {len(target.vertices)} vertices, {pair['seconds']:.2f} s "
            f"({pair['CPU seconds']:.2f} s of CPU), grade {pair['grade']}, "
            f"exchanged: lids {pair['lids']}, lips {pair['lips']}, pieces {pair['pieces']}"
            + (f", copy off by {pair['copy mm']:.4f} mm" if "copy mm" in pair else "")
        )
        for key, row in rows.items():
            closed = "" if row["closed"] is None else f"  closes {row['closed']:.2f}"
            print(
                f"    {key:28} moves {row['moves mm']:5.1f} mm  error {row['error %']:5.1f} %  "
                f"95 % {row['95 %']:6.1f} %  angle {row['angle']:4.0f}°{closed}",
                flush=True,
            )
    if options.json:
        Path(options.json).write_text(json.dumps({"faces": table}, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    sys.exit(main())
