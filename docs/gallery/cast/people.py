# SPDX-License-Identifier: GPL-3.0-or-later
"""Mia and Bruno: their builds, their pieces, what is painted on them, and what moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from . import paint, sculpt, wardrobe
from .anatomy import FINGERS, INDEX, MOUTH, SKELETON, Build, Puff, skin_weights

SKIN = ("Head", "Hands", "Body")
"""Pieces whose every point both characters have."""


@dataclass(frozen=True)
class Piece:
    """A mesh of a character.

    `places` (n, 3) are its vertices on the template, `vertices` on the character; `faces` are quads or
    triangles. `weights` (n, bones) are those of the template's bones. `keys` are displacements of the
    character's vertices by name. `cell` is the part of the texture that it gets: left, bottom and side.
    """

    name: str
    places: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    brush: Callable
    roughness: float
    cell: tuple[float, float, float]
    keys: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def normals(self):
        """On the template."""
        return sculpt.normals(
            self.places, self.faces if self.faces.shape[1] == 4 else self.faces[:, [0, 1, 2, 2]]
        )


@dataclass(frozen=True)
class Person:
    """`bones` has for each bone of the template the name that it has in this rig."""

    name: str
    build: Build
    bones: dict[str, str]
    pieces: list[Piece]

    def piece(self, name):
        return next(piece for piece in self.pieces if piece.name == name)


MIA = Build(
    scales={
        "hips": (0.90, 0.92, 1.0),
        "spine": (0.82, 0.86, 0.98),
        "chest": (0.86, 0.90, 0.94),
        "neck": (0.80, 0.80, 0.92),
        "head": (1.04, 1.02, 1.0),
        "upper_arm": (0.84, 0.95),
        "forearm": (0.86, 0.95),
        "hand": (0.95, 0.95, 0.95),
        "thigh": (0.84, 0.97),
        "shin": (0.86, 0.97),
        "foot": (0.92, 0.94, 0.95),
    },
    puffs=(
        Puff((0.060, -0.13, 1.412), (0.050, 0.10, 0.058), (1.16, 1.0, 1.22)),
        Puff((0, -0.16, 1.362), (0.030, 0.05, 0.030), (0.72, 0.78, 0.72), (0, 0.004, 0.004)),
        Puff((0, -0.06, 1.265), (0.10, 0.10, 0.06), (0.86, 1.0, 0.92), (0, 0.0, 0.004)),
    ),
)

BRUNO = Build(
    scales={
        "hips": (1.28, 1.36, 1.02),
        "spine": (1.42, 1.52, 1.06),
        "chest": (1.36, 1.34, 1.04),
        "neck": (1.45, 1.40, 0.72),
        "head": (1.02, 1.02, 0.94),
        "shoulder": (1.20, 1.2, 1.1),
        "upper_arm": (1.42, 0.92),
        "forearm": (1.52, 0.90),
        "hand": (1.24, 1.30, 1.24),
        "thigh": (1.24, 0.70),
        "shin": (1.30, 0.70),
        "foot": (1.25, 1.18, 1.15),
    },
    turns={"upper_arm": -9.0, "forearm": 6.0},
    puffs=(
        Puff((0, -0.08, 0.92), (0.16, 0.12, 0.11), (1.10, 1.0, 1.0), (0, -0.045, -0.01)),
        Puff((0, -0.155, 1.362), (0.042, 0.06, 0.036), (1.85, 1.60, 1.50), (0, -0.012, -0.004)),
        Puff((0.060, -0.13, 1.412), (0.050, 0.08, 0.050), (0.84, 1.0, 0.80)),
        Puff((0.155, 0.02, 1.385), (0.045, 0.06, 0.060), (1.35, 1.25, 1.25)),
        Puff((0.09, -0.03, 1.29), (0.08, 0.10, 0.06), (1.12, 1.05, 1.0)),
    ),
)


def _names(plain, sided, finger):
    """Names of a rig for the template's bones, for both sides."""
    found = dict(plain)
    for side in ("L", "R"):
        for bone, name in sided.items():
            found[f"{bone}.{side}"] = name(side)
        for each in FINGERS:
            for part in (1, 2):
                found[f"{each}_{part}.{side}"] = finger(each, part, side)
    return found


def _humanoid(part):
    return lambda side: ("Left" if side == "L" else "Right") + part


def _engine(part):
    return lambda side: f"{part}_{side.lower()}"


# As in VRM and Unity, and as in Unreal.
HUMANOID = _names(
    {"hips": "Hips", "spine": "Spine", "chest": "Chest", "neck": "Neck", "head": "Head"},
    {
        bone: _humanoid(name)
        for bone, name in {
            "shoulder": "Shoulder",
            "upper_arm": "UpperArm",
            "forearm": "LowerArm",
            "hand": "Hand",
            "thigh": "UpperLeg",
            "shin": "LowerLeg",
            "foot": "Foot",
            "toes": "Toes",
        }.items()
    },
    lambda each, part, side: _humanoid(each.capitalize() + ("Proximal" if part == 1 else "Distal"))(side),
)
ENGINE = _names(
    {"hips": "pelvis", "spine": "spine_01", "chest": "spine_02", "neck": "neck_01", "head": "head"},
    {
        bone: _engine(name)
        for bone, name in {
            "shoulder": "clavicle",
            "upper_arm": "upperarm",
            "forearm": "lowerarm",
            "hand": "hand",
            "thigh": "thigh",
            "shin": "calf",
            "foot": "foot",
            "toes": "ball",
        }.items()
    },
    lambda each, part, side: _engine(f"{'pinky' if each == 'little' else each}_0{part}")(side),
)


# ------------------------------------------------------------------ weights and keys


def _by_skin(places):
    return skin_weights(places)


def _on(bone):
    def weigh(places):
        weights = np.zeros((len(places), len(SKELETON)))
        weights[:, INDEX[bone]] = 1.0
        return weights

    return weigh


def _skirt(places):
    """As skin, but below the hips the cloth hangs between both legs."""
    weights = skin_weights(places)
    trunk = np.abs(places[:, 0]) < 0.30
    low = np.clip((0.86 - places[:, 2]) / 0.10, 0.0, 1.0) * trunk
    hang = np.zeros_like(weights)
    left = np.clip(0.5 + places[:, 0] / 0.22, 0.0, 1.0)
    share = 0.25 + 0.45 * np.clip((0.86 - places[:, 2]) / 0.26, 0.0, 1.0)
    hang[:, INDEX["hips"]] = 1.0 - share
    hang[:, INDEX["thigh.L"]], hang[:, INDEX["thigh.R"]] = share * left, share * (1.0 - left)
    return weights + low[:, None] * (hang - weights)


def _bag(places):
    """The pouch hangs on the hips, the strap lies on the coat."""
    weights = _skirt(places)
    pouch = (places[:, 0] < -0.15) & (places[:, 2] < 0.90)
    weights[pouch] = 0.0
    weights[pouch, INDEX["hips"]] = 1.0
    return weights


def _side(places, sign):
    return np.clip(0.5 + sign * places[:, 0] / 0.02, 0.0, 1.0)[:, None]


def _bump(places, centre, reach, shift, sign):
    """A shift around a place of the left side, mirrored for the other."""
    flip = np.array((sign, 1, 1))
    weight = np.exp(-(((places - flip * centre) / reach) ** 2).sum(axis=1))[:, None]
    return weight * flip * shift


def _face_keys(places):
    """ARKit's names."""
    front = np.clip((-places[:, 1] - 0.02) / 0.05, 0, 1)[:, None]
    keys = {}
    for name, sign in (("Left", 1), ("Right", -1)):
        corner = MOUTH + np.array((0.040, -0.004, 0.006))
        keys[f"mouthSmile{name}"] = _bump(
            places, corner, (0.030, 0.05, 0.030), np.array((0.012, 0.008, 0.013)), sign
        )
        keys[f"mouthFrown{name}"] = _bump(
            places, corner, (0.030, 0.05, 0.030), np.array((0.002, 0.002, -0.014)), sign
        )
        keys[f"cheekSquint{name}"] = _bump(
            places, (0.065, -0.11, 1.355), (0.03, 0.05, 0.02), np.array((0, -0.006, 0.006)), sign
        )
    low = 1 / (1 + np.exp((places[:, 2] - MOUTH[2] + 0.002) / 0.004))
    wide = np.exp(-((places[:, 0] / 0.075) ** 2)) * np.clip((places[:, 2] - 1.20) / 0.03, 0, 1)
    keys["jawOpen"] = (low * wide)[:, None] * front * np.array((0, 0.006, -0.024))
    keys["mouthPucker"] = (
        front
        * np.exp(-(((places - MOUTH) / (0.05, 0.06, 0.035)) ** 2).sum(axis=1))[:, None]
        * np.column_stack([-0.38 * places[:, 0], np.full(len(places), -0.010), 0 * places[:, 0]])
    )
    puff = sum(
        _bump(places, (0.068, -0.09, 1.315), (0.03, 0.05, 0.03), np.array((0.012, -0.010, 0)), sign)
        for sign in (1, -1)
    )
    keys["cheekPuff"] = puff
    return keys


def _brow_keys(places):
    keys = {"browInnerUp": np.exp(-((places[:, :1] / 0.05) ** 2)) * np.array((0, 0, 0.016))}
    for name, sign in (("Left", 1), ("Right", -1)):
        keys[f"browDown{name}"] = _side(places, sign) * np.array((-0.004 * sign, -0.002, -0.010))
    return keys


def _mouth_keys(places):
    tongue = (places[:, 2] < MOUTH[2] - 0.0075)[:, None]
    return {"jawOpen": tongue * np.array((0, 0.002, -0.016))}


# ------------------------------------------------------------------ making


def _made(build, specification, triangles):
    pieces = []
    for name, mesh, options in specification:
        mesh, moved = mesh() if options.get("moves") else (mesh(), None)
        places, quads = mesh
        keys = {}
        if moved is not None:
            keys = {
                f"eyeBlink{side}": _side(places, sign) * moved for side, sign in (("Left", 1), ("Right", -1))
            }
        elif "keys" in options:
            keys = options["keys"](places)
        vertices = build(places)
        keys = {key: build(places + shift) - vertices for key, shift in keys.items()}
        weights = options.get("weights", _by_skin)(places)
        faces = _halved(vertices, quads) if triangles else quads
        pieces.append(
            Piece(
                name,
                places,
                vertices,
                faces,
                weights,
                options["brush"],
                options["roughness"],
                options["cell"],
                keys,
            )
        )
    return pieces


def _halved(vertices, quads):
    """Quads cut along their shorter diagonal."""
    lengths = [np.linalg.norm(vertices[quads[:, a]] - vertices[quads[:, a + 2]], axis=1) for a in (0, 1)]
    first = np.where((lengths[0] <= lengths[1])[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where((lengths[0] <= lengths[1])[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.concatenate([first, second])


def mia(fineness: float = 1.0) -> Person:
    """A slim girl in a raincoat: quads on an upright grid. `fineness` divides the lengths of edges."""
    tone, blush, brown = (0.93, 0.72, 0.58), (0.92, 0.47, 0.40), (0.36, 0.16, 0.08)
    yellow, cell = (0.96, 0.72, 0.10), 1 / 8
    on_head = _on("head")

    def of(function, spacing):
        return partial(function, spacing / fineness, 0.0)

    def metal(points):
        return (points[:, 0] < -0.244) & (points[:, 2] < 0.83)

    trim = paint.leather(
        (0.42, 0.24, 0.10), (0.93, 0.66, 0.10), lambda p: (np.abs(p[:, 0]) > 0.04) & (p[:, 2] < 0.815)
    )
    specification = [
        (
            "Head",
            of(wardrobe.head, 0.0105),
            {
                "brush": paint.skin(tone, blush, (0.80, 0.33, 0.32), True),
                "roughness": 0.5,
                "cell": (0, 0, 0.5),
                "keys": _face_keys,
            },
        ),
        (
            "Hands",
            of(wardrobe.hands, 0.0085),
            {"brush": paint.skin(tone, blush, blush), "roughness": 0.5, "cell": (0.5, 0, 0.25)},
        ),
        (
            "Body",
            of(wardrobe.body, 0.0200),
            {"brush": paint.underwear(tone, (0.90, 0.90, 0.92)), "roughness": 0.5, "cell": (0.75, 0, 0.25)},
        ),
        (
            "Eyes",
            partial(wardrobe.eyes, 14),
            {
                "brush": paint.eye((0.22, 0.55, 0.35), (0.05, 0.16, 0.10)),
                "roughness": 0.08,
                "cell": (0.5, 0.25, 0.25),
                "weights": on_head,
            },
        ),
        (
            "Lids",
            partial(wardrobe.lids, 17, 6),
            {
                "brush": paint.lids(tone),
                "roughness": 0.5,
                "cell": (0.75, 0.25, cell),
                "weights": on_head,
                "moves": True,
            },
        ),
        (
            "Lashes",
            partial(wardrobe.lashes, 17),
            {
                "brush": paint.plain((0.10, 0.05, 0.04)),
                "roughness": 0.6,
                "cell": (0.875, 0.25, cell),
                "weights": on_head,
                "moves": True,
            },
        ),
        (
            "Mouth",
            of(wardrobe.mouth, 0.0065),
            {
                "brush": paint.teeth,
                "roughness": 0.2,
                "cell": (0.75, 0.375, cell),
                "weights": on_head,
                "keys": _mouth_keys,
            },
        ),
        (
            "Brows",
            of(wardrobe.brows, 0.0050),
            {
                "brush": paint.plain((0.30, 0.13, 0.07)),
                "roughness": 0.7,
                "cell": (0.875, 0.375, cell),
                "weights": on_head,
                "keys": _brow_keys,
            },
        ),
        (
            "Hair",
            of(wardrobe.girl_hair, 0.0130),
            {
                "brush": paint.hair(brown, (0.66, 0.34, 0.16)),
                "roughness": 0.42,
                "cell": (0, 0.5, 0.25),
                "weights": on_head,
            },
        ),
        (
            "Ties",
            of(wardrobe.girl_ties, 0.0080),
            {
                "brush": paint.plain((0.82, 0.16, 0.18)),
                "roughness": 0.7,
                "cell": (0, 0.75, cell),
                "weights": on_head,
            },
        ),
        (
            "Coat",
            of(wardrobe.coat, 0.0185),
            {
                "brush": paint.oilskin(yellow, (0.99, 0.90, 0.55)),
                "roughness": 0.34,
                "cell": (0.5, 0.5, 0.5),
                "weights": _skirt,
            },
        ),
        (
            "Buttons",
            of(wardrobe.coat_trim, 0.0095),
            {"brush": trim, "roughness": 0.4, "cell": (cell, 0.75, cell), "weights": _skirt},
        ),
        (
            "Leggings",
            of(wardrobe.leggings, 0.0190),
            {
                "brush": paint.stripes((0.20, 0.22, 0.38), (0.86, 0.84, 0.82), 0.026),
                "roughness": 0.8,
                "cell": (0.25, 0.5, 0.25),
            },
        ),
        (
            "Boots",
            of(wardrobe.boots, 0.0140),
            {
                "brush": paint.rubber((0.80, 0.14, 0.13), (0.94, 0.91, 0.85)),
                "roughness": 0.22,
                "cell": (0.25, 0.75, 0.25),
            },
        ),
        (
            "Satchel",
            of(wardrobe.bag, 0.0110),
            {
                "brush": paint.leather((0.46, 0.25, 0.12), (0.88, 0.70, 0.32), metal),
                "roughness": 0.5,
                "cell": (0, 0.875, cell),
                "weights": _bag,
            },
        ),
    ]
    return Person("Mia", MIA, HUMANOID, _made(MIA, specification, triangles=False))


def bruno(fineness: float = 1.0) -> Person:
    """A stocky sailor with a beard: triangles on a grid that is turned by 20 degrees, and coarser."""
    tone, blush, ginger = (0.87, 0.62, 0.48), (0.84, 0.36, 0.30), (0.50, 0.22, 0.08)
    cell, on_head = 1 / 8, _on("head")

    def of(function, spacing, **options):
        return partial(function, spacing / fineness, 0.35, **options)

    def buckle(points):
        return (np.abs(points[:, 0]) < 0.036) & (points[:, 1] < -0.09) & (np.abs(points[:, 2] - 0.888) < 0.03)

    specification = [
        (
            "Head",
            of(wardrobe.head, 0.0125),
            {
                "brush": paint.skin(tone, blush, (0.70, 0.34, 0.30)),
                "roughness": 0.5,
                "cell": (0, 0, 0.5),
                "keys": _face_keys,
            },
        ),
        (
            "Hands",
            of(wardrobe.hands, 0.0085),
            {"brush": paint.skin(tone, blush, blush), "roughness": 0.5, "cell": (0.5, 0, 0.25)},
        ),
        (
            "Body",
            of(wardrobe.body, 0.0220),
            {"brush": paint.underwear(tone, (0.72, 0.74, 0.78)), "roughness": 0.5, "cell": (0.75, 0, 0.25)},
        ),
        (
            "Eyes",
            partial(wardrobe.eyes, 14),
            {
                "brush": paint.eye((0.25, 0.45, 0.70), (0.06, 0.12, 0.25)),
                "roughness": 0.08,
                "cell": (0.5, 0.25, 0.25),
                "weights": on_head,
            },
        ),
        (
            "Lids",
            partial(wardrobe.lids, 15, 5),
            {
                "brush": paint.lids(tone),
                "roughness": 0.5,
                "cell": (0.75, 0.25, cell),
                "weights": on_head,
                "moves": True,
            },
        ),
        (
            "Mouth",
            of(wardrobe.mouth, 0.0070),
            {
                "brush": paint.teeth,
                "roughness": 0.2,
                "cell": (0.75, 0.375, cell),
                "weights": on_head,
                "keys": _mouth_keys,
            },
        ),
        (
            "Brows",
            of(wardrobe.brows, 0.0060, thick=1.75, slope=-0.012),
            {
                "brush": paint.plain((0.40, 0.17, 0.06)),
                "roughness": 0.7,
                "cell": (0.875, 0.375, cell),
                "weights": on_head,
                "keys": _brow_keys,
            },
        ),
        (
            "Beard",
            of(wardrobe.beard, 0.0125),
            {
                "brush": paint.hair(ginger, (0.78, 0.42, 0.18), 60.0),
                "roughness": 0.55,
                "cell": (0, 0.5, 0.25),
                "weights": on_head,
            },
        ),
        (
            "Beanie",
            of(wardrobe.beanie, 0.0125),
            {
                "brush": paint.knit((0.74, 0.15, 0.13), (0.95, 0.92, 0.86)),
                "roughness": 0.85,
                "cell": (0, 0.75, 0.25),
                "weights": on_head,
            },
        ),
        (
            "Shirt",
            of(wardrobe.shirt, 0.0180),
            {
                "brush": paint.stripes((0.93, 0.92, 0.89), (0.13, 0.20, 0.38), 0.032),
                "roughness": 0.8,
                "cell": (0.5, 0.5, 0.5),
            },
        ),
        (
            "Trousers",
            of(wardrobe.trousers, 0.0190),
            {
                "brush": paint.denim((0.16, 0.22, 0.34), (0.78, 0.60, 0.35)),
                "roughness": 0.8,
                "cell": (0.25, 0.5, 0.25),
            },
        ),
        (
            "Belt",
            of(wardrobe.belt, 0.0110),
            {
                "brush": paint.leather((0.40, 0.21, 0.09), (0.88, 0.72, 0.34), buckle),
                "roughness": 0.45,
                "cell": (0.875, 0.25, cell),
            },
        ),
        (
            "Shoes",
            of(wardrobe.shoes, 0.0140),
            {
                "brush": paint.rubber((0.36, 0.20, 0.10), (0.20, 0.13, 0.09)),
                "roughness": 0.4,
                "cell": (0.25, 0.75, 0.25),
            },
        ),
    ]
    return Person("Bruno", BRUNO, ENGINE, _made(BRUNO, specification, triangles=True))
