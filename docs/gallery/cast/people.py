# SPDX-License-Identifier: GPL-3.0-or-later
"""Mia and Bruno: their builds, their pieces, what is painted on them, and what moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

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


@dataclass(frozen=True)
class Design:
    """What a piece is made of.

    `mesh` gives vertices on the template and quads, and where it `moves`, also how they move when the eyes
    close. `keys` gives displacements by name for such vertices, `weights` theirs of the template's bones.
    """

    name: str
    mesh: Callable
    brush: Callable
    roughness: float
    cell: tuple[float, float, float]
    weights: Callable | None = None
    keys: Callable | None = None
    moves: bool = False


def _made(build, designs, triangles):
    pieces = []
    for design in designs:
        mesh, moved = design.mesh() if design.moves else (design.mesh(), None)
        places, quads = mesh
        keys = design.keys(places) if design.keys else {}
        if moved is not None:
            keys = {
                f"eyeBlink{side}": _side(places, sign) * moved for side, sign in (("Left", 1), ("Right", -1))
            }
        vertices = build(places)
        keys = {key: build(places + shift) - vertices for key, shift in keys.items()}
        weights = (design.weights or _by_skin)(places)
        faces = _halved(vertices, quads) if triangles else quads
        look = design.brush, design.roughness, design.cell
        pieces.append(Piece(design.name, places, vertices, faces, weights, *look, keys))
    return pieces


def _halved(vertices, quads):
    """Quads cut along their shorter diagonal."""
    lengths = [np.linalg.norm(vertices[quads[:, a]] - vertices[quads[:, a + 2]], axis=1) for a in (0, 1)]
    first = np.where((lengths[0] <= lengths[1])[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where((lengths[0] <= lengths[1])[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.concatenate([first, second])


CELL = 1 / 8
"""Side of the smallest part of the texture."""


class Look(NamedTuple):
    """What differs in the pieces that both have: colours, and the lengths of edges."""

    tone: tuple
    blush: tuple
    lips: tuple
    """Of `paint.skin`, beside tone and blush."""
    underwear: tuple
    iris: tuple
    brow: tuple
    lids: tuple
    """Their columns and rows."""
    edges: dict
    """By piece."""
    brows: dict
    """How they are shaped."""


def _bare(of, look):
    """What both have: skin, and what is in a face."""
    on_head, edges = _on("head"), look.edges
    skin = partial(paint.skin, look.tone, look.blush)
    eye, inner = (0.5, 0.25, 0.25), (0.75, 0.375, CELL)
    return [
        Design("Head", of(wardrobe.head, edges["Head"]), skin(*look.lips), 0.5, (0, 0, 0.5), keys=_face_keys),
        Design("Hands", of(wardrobe.hands, edges["Hands"]), skin(look.blush), 0.5, (0.5, 0, 0.25)),
        Design(
            "Body",
            of(wardrobe.body, edges["Body"]),
            paint.underwear(look.tone, look.underwear),
            0.5,
            (0.75, 0, 0.25),
        ),
        Design("Eyes", partial(wardrobe.eyes, 14), paint.eye(*look.iris), 0.08, eye, on_head),
        Design(
            "Lids",
            partial(wardrobe.lids, *look.lids),
            paint.lids(look.tone),
            0.5,
            (0.75, 0.25, CELL),
            on_head,
            moves=True,
        ),
        Design("Mouth", of(wardrobe.mouth, edges["Mouth"]), paint.teeth, 0.2, inner, on_head, _mouth_keys),
        Design(
            "Brows",
            of(wardrobe.brows, edges["Brows"], **look.brows),
            paint.plain(look.brow),
            0.7,
            (0.875, 0.375, CELL),
            on_head,
            _brow_keys,
        ),
    ]


def mia(fineness: float = 1.0) -> Person:
    """A slim girl in a raincoat: quads on an upright grid. `fineness` divides the lengths of edges."""
    on_head = _on("head")
    look = Look(
        tone=(0.93, 0.72, 0.58),
        blush=(0.92, 0.47, 0.40),
        lips=((0.80, 0.33, 0.32), True),
        underwear=(0.90, 0.90, 0.92),
        iris=((0.22, 0.55, 0.35), (0.05, 0.16, 0.10)),
        brow=(0.30, 0.13, 0.07),
        lids=(17, 6),
        edges={"Head": 0.0105, "Hands": 0.0085, "Body": 0.0200, "Mouth": 0.0065, "Brows": 0.0050},
        brows={},
    )

    def of(function, spacing, **options):
        return partial(function, spacing / fineness, 0.0, **options)

    def metal(points):
        return (points[:, 0] < -0.244) & (points[:, 2] < 0.83)

    trim = paint.leather(
        (0.42, 0.24, 0.10), (0.93, 0.66, 0.10), lambda p: (np.abs(p[:, 0]) > 0.04) & (p[:, 2] < 0.815)
    )
    oilskin = paint.oilskin((0.96, 0.72, 0.10), (0.99, 0.90, 0.55))
    striped = paint.stripes((0.20, 0.22, 0.38), (0.86, 0.84, 0.82), 0.026)
    rubber = paint.rubber((0.80, 0.14, 0.13), (0.94, 0.91, 0.85))
    satchel = paint.leather((0.46, 0.25, 0.12), (0.88, 0.70, 0.32), metal)
    hair = paint.hair((0.36, 0.16, 0.08), (0.66, 0.34, 0.16))
    lashes = Design(
        "Lashes",
        partial(wardrobe.lashes, 17),
        paint.plain((0.10, 0.05, 0.04)),
        0.6,
        (0.875, 0.25, CELL),
        on_head,
        moves=True,
    )
    bare = _bare(of, look)
    designs = [
        *bare[:5],
        lashes,
        *bare[5:],
        Design("Hair", of(wardrobe.girl_hair, 0.0130), hair, 0.42, (0, 0.5, 0.25), on_head),
        Design(
            "Ties",
            of(wardrobe.girl_ties, 0.0080),
            paint.plain((0.82, 0.16, 0.18)),
            0.7,
            (0, 0.75, CELL),
            on_head,
        ),
        Design("Coat", of(wardrobe.coat, 0.0185), oilskin, 0.34, (0.5, 0.5, 0.5), _skirt),
        Design("Buttons", of(wardrobe.coat_trim, 0.0095), trim, 0.4, (CELL, 0.75, CELL), _skirt),
        Design("Leggings", of(wardrobe.leggings, 0.0190), striped, 0.8, (0.25, 0.5, 0.25)),
        Design("Boots", of(wardrobe.boots, 0.0140), rubber, 0.22, (0.25, 0.75, 0.25)),
        Design("Satchel", of(wardrobe.bag, 0.0110), satchel, 0.5, (0, 0.875, CELL), _bag),
    ]
    return Person("Mia", MIA, HUMANOID, _made(MIA, designs, triangles=False))


def bruno(fineness: float = 1.0) -> Person:
    """A stocky sailor with a beard: triangles on a grid that is turned by 20 degrees, and coarser."""
    on_head = _on("head")
    look = Look(
        tone=(0.87, 0.62, 0.48),
        blush=(0.84, 0.36, 0.30),
        lips=((0.70, 0.34, 0.30),),
        underwear=(0.72, 0.74, 0.78),
        iris=((0.25, 0.45, 0.70), (0.06, 0.12, 0.25)),
        brow=(0.40, 0.17, 0.06),
        lids=(15, 5),
        edges={"Head": 0.0125, "Hands": 0.0085, "Body": 0.0220, "Mouth": 0.0070, "Brows": 0.0060},
        brows={"thick": 1.75, "slope": -0.012},
    )

    def of(function, spacing, **options):
        return partial(function, spacing / fineness, 0.35, **options)

    def buckle(points):
        return (np.abs(points[:, 0]) < 0.036) & (points[:, 1] < -0.09) & (np.abs(points[:, 2] - 0.888) < 0.03)

    beard = paint.hair((0.50, 0.22, 0.08), (0.78, 0.42, 0.18), 60.0)
    knit = paint.knit((0.74, 0.15, 0.13), (0.95, 0.92, 0.86))
    striped = paint.stripes((0.93, 0.92, 0.89), (0.13, 0.20, 0.38), 0.032)
    denim = paint.denim((0.16, 0.22, 0.34), (0.78, 0.60, 0.35))
    leather = paint.leather((0.40, 0.21, 0.09), (0.88, 0.72, 0.34), buckle)
    sole = paint.rubber((0.36, 0.20, 0.10), (0.20, 0.13, 0.09))
    designs = [
        *_bare(of, look),
        Design("Beard", of(wardrobe.beard, 0.0125), beard, 0.55, (0, 0.5, 0.25), on_head),
        Design("Beanie", of(wardrobe.beanie, 0.0125), knit, 0.85, (0, 0.75, 0.25), on_head),
        Design("Shirt", of(wardrobe.shirt, 0.0180), striped, 0.8, (0.5, 0.5, 0.5)),
        Design("Trousers", of(wardrobe.trousers, 0.0190), denim, 0.8, (0.25, 0.5, 0.25)),
        Design("Belt", of(wardrobe.belt, 0.0110), leather, 0.45, (0.875, 0.25, CELL)),
        Design("Shoes", of(wardrobe.shoes, 0.0140), sole, 0.4, (0.25, 0.75, 0.25)),
    ]
    return Person("Bruno", BRUNO, ENGINE, _made(BRUNO, designs, triangles=True))
