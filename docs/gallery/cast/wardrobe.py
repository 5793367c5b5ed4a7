# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of the two characters on the template: meshes of quads for skin, eyes, hair and clothes."""

from __future__ import annotations

import numpy as np

from . import sculpt
from .anatomy import (
    EYE,
    EYE_RADII,
    MOUTH,
    NECK_CUT,
    Puff,
    arm_solid,
    below_wrist,
    cone,
    eye_turn,
    hand_solid,
    head_solid,
    joint,
    leg_solid,
    neck_solid,
    skin_solid,
    trunk_solid,
)
from .sculpt import blend, box, carve, common, ellipsoid, grown, mirrored, ring, round_cone, tube

LOW, HIGH = np.array((-0.66, -0.26, -0.01)), np.array((0.66, 0.26, 1.66))
HEAD_LOW, HIGH_HEAD = np.array((-0.26, -0.27, 1.10)), np.array((0.26, 0.26, 1.66))
FINER_FACE = Puff((0.0, -0.13, 1.35), (0.085, 0.12, 0.085), (0.55, 0.55, 0.55))


def sheet(solid, region, spacing, turn, thickness=0.0, low=LOW, high=HIGH):
    """A solid's surface as far as a region goes, with a hem."""
    vertices, quads = sculpt.trimmed(solid, region, *sculpt.surface(solid, low, high, spacing, turn))
    return sculpt.hemmed(vertices, quads, thickness) if thickness else (vertices, quads)


# ------------------------------------------------------------------ skin, eyes, mouth


def head(spacing, turn):
    """Finer around eyes and mouth."""
    solid = mirrored(blend(0.03, head_solid(), neck_solid()))
    vertices, quads = sculpt.magnified(solid, FINER_FACE, HEAD_LOW, HIGH_HEAD, spacing, turn)
    return sculpt.trimmed(solid, lambda p: p[:, 2] - NECK_CUT, vertices, quads)


def hands(spacing, turn):
    solid = mirrored(blend(0.02, arm_solid(), hand_solid()))
    meshes = []
    for side in (1, -1):
        ends = np.sort([side * 0.30, side * 0.62])
        low, high = np.array((ends[0], -0.12, 0.66)), np.array((ends[1], 0.10, 0.95))
        meshes.append(sheet(solid, below_wrist, spacing, side * turn, low=low, high=high))
    return sculpt.joined(*meshes)


def body(spacing, turn):
    def region(p):
        return np.minimum(NECK_CUT + 0.006 - p[:, 2], 0.004 - below_wrist(p))

    return sheet(skin_solid(), region, spacing, turn)


def eyes(rings):
    """Two ellipsoids, with a pole at the pupil."""
    return sculpt.joined(*(_dome(side, 1.0, rings, np.pi) for side in (1, -1)))


def _dome(side, size, rings, until):
    angle, about = np.meshgrid(
        np.linspace(0.06, until - 0.06, rings), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    )
    local = np.stack([np.sin(angle) * np.cos(about), -np.cos(angle), np.sin(angle) * np.sin(about)], axis=-1)
    quads = _grid(2 * rings, rings, closed=True)
    caps = [about_row * rings + end for end in (0, rings - 1) for about_row in range(2 * rings)]
    points = local.reshape(-1, 3)
    # Both small holes are closed by a fan of quads around the pole.
    poles = np.array([(0, -1, 0), (0, 1, 0)])
    pole = []
    for end, offset in ((0, 0), (1, 2 * rings)):
        row = caps[offset : offset + 2 * rings]
        for k in range(0, 2 * rings, 2):
            fan = [len(points) + end, row[k], row[(k + 1) % len(row)], row[(k + 2) % len(row)]]
            pole.append(fan if end else fan[::-1])
    points = np.concatenate([points, poles])
    return _in_eye(points * size, side), np.concatenate([quads, pole])


def _in_eye(local, side):
    return EYE * (side, 1, 1) + (local * EYE_RADII) @ eye_turn(side)


def _grid(rows, columns, closed=False):
    """Quads of a grid of vertices; closed joins the last row with the first."""
    first = np.arange(rows if closed else rows - 1)
    here, there = first[:, None] * columns, ((first + 1) % rows)[:, None] * columns
    k = np.arange(columns - 1)
    return np.stack([here + k, there + k, there + k + 1, here + k + 1], axis=-1).reshape(-1, 4)


LID_OPEN, LID_SHUT, LID_BACK = 0.66, -0.55, 1.9
LOWER_OPEN, LOWER_BACK = -0.78, -1.9


def lids(columns, rows):
    """Upper and lower lids as shells over the eyes, and how each vertex moves when the eyes are shut."""
    meshes, moves = [], []
    for side in (1, -1):
        for rim, back, shut, thick in (
            (LID_OPEN, LID_BACK, LID_SHUT, 0.09),
            (LOWER_OPEN, LOWER_BACK, LID_SHUT - 0.08, 0.07),
        ):
            share = np.linspace(0, 1, rows)
            opened, shut = (_shell(columns, at + share * (back - at), thick, side) for at in (rim, shut))
            quads = _grid(columns, rows + 1)
            meshes.append((opened, quads if back > 0 else quads[:, ::-1]))
            moves.append(shut - opened)
    return sculpt.joined(*meshes), np.concatenate(moves)


def lashes(columns, size=0.12):
    """A wedge on the rim of each upper lid, wider outwards, and how it moves when the eyes are shut."""
    meshes, moves = [], []
    for side in (1, -1):
        opened, shut = (_lash(columns, rim, size, side) for rim in (LID_OPEN, LID_SHUT))
        quads = _grid(columns, 4)
        meshes.append((opened, quads if side > 0 else quads[:, ::-1]))
        moves.append(shut - opened)
    return sculpt.joined(*meshes), np.concatenate(moves)


def _shell(columns, hinges, thick, side):
    """Points around an eye: `hinges` (rows,) are angles up from the front; the first row is folded
    inwards."""
    across = np.linspace(-1.45, 1.45, columns)[:, None]
    hinges = np.concatenate([hinges[:1], hinges])
    size = np.full(len(hinges), 1.0 + thick)
    size[0] = 1.0
    # Towards the corners of the eye lids meet.
    bend = hinges[None] * (1.0 - 0.22 * (across / 1.45) ** 4)
    local = np.stack(
        [np.sin(across) * np.ones_like(bend), -np.cos(across) * np.cos(bend), np.cos(across) * np.sin(bend)],
        axis=-1,
    )
    return _in_eye((local * size[None, :, None]).reshape(-1, 3), side)


def _lash(columns, rim, lash, side):
    across = np.linspace(-1.35, 1.40, columns)[:, None]
    outer = across * 1.0
    height = lash * (0.35 + 0.65 * np.clip((outer + 1.35) / 2.75, 0, 1))
    hinge = rim * (1.0 - 0.22 * (across / 1.45) ** 4)
    rows = [hinge - 0.25 * height, hinge - 0.1 * height, hinge + height, hinge + 0.6 * height]
    sizes = [1.02, 1.16 + 0.6 * height, 1.14 + 0.25 * height, 1.05 + 0 * height]
    points = []
    for angle, size in zip(rows, sizes, strict=True):
        local = np.stack(
            [np.sin(across), -np.cos(across) * np.cos(angle), np.cos(across) * np.sin(angle)], axis=-1
        )
        points.append(local * np.broadcast_to(size, across.shape)[..., None])
    local = np.concatenate(points, axis=1)
    return _in_eye(local.reshape(-1, 3) * (side, 1, 1), side)


def on_front(solid, x, z, start=-0.30):
    """The y at which a ray from the front meets a solid."""
    place = np.array((x, start, z), float)
    for _ in range(60):
        step = float(solid(place[None])[0])
        place[1] += max(step, 1e-4) * 0.7
        if step < 1e-4:
            break
    return place[1]


def brows(spacing, turn, thick=1.0, slope=0.0):
    face = mirrored(head_solid())
    path = []
    for share in np.linspace(0, 1, 5):
        x = 0.026 + 0.068 * share
        z = 1.474 + 0.012 * np.sin(np.pi * (0.15 + 0.75 * share)) + slope * (share - 0.5)
        path.append((x, on_front(face, x, z) + 0.001, z))
    solid = tube(np.array(path), thick * np.array((0.0060, 0.0080, 0.0078, 0.0065, 0.0035)))
    return sculpt.surface(mirrored(solid), (-0.13, -0.20, 1.43), (0.13, -0.04, 1.53), spacing, turn)


def mouth(spacing, turn):
    """Teeth and tongue."""
    arch = common(
        0.004,
        ellipsoid(MOUTH + (0, 0.012, 0.010), (0.043, 0.042, 0.015)),
        lambda p: 0.0 - (p[:, 2] - (MOUTH[2] - 0.0035 + 6.0 * p[:, 0] ** 2)),
    )
    arch = common(0.004, arch, lambda p: p[:, 2] - (MOUTH[2] + 0.016))
    tongue = ellipsoid(MOUTH + (0, 0.016, -0.017), (0.026, 0.034, 0.009))
    low, high = MOUTH - (0.07, 0.06, 0.05), MOUTH + (0.07, 0.08, 0.05)
    return sculpt.joined(
        sculpt.surface(arch, low, high, spacing, turn), sculpt.surface(tongue, low, high, spacing, turn)
    )


# ------------------------------------------------------------------ Mia


def girl_hair(spacing, turn):
    def locks(points):
        """Grooves that run from the crown."""
        about = np.arctan2(points[:, 0], -(points[:, 1] - 0.04))
        fade = np.clip((1.60 - points[:, 2]) / 0.06, 0, 1)
        return 0.0035 * fade * np.cos(15 * about)

    cap = ellipsoid((0, 0.026, 1.458), (0.170, 0.172, 0.168))
    nape = ellipsoid((0, 0.075, 1.36), (0.135, 0.105, 0.125))
    hair = sculpt.bumped(blend(0.05, cap, nape), locks)
    window = blend(
        0.03,
        ellipsoid((0, -0.20, 1.395), (0.128, 0.20, 0.105)),
        ellipsoid((0.0, -0.12, 1.26), (0.15, 0.155, 0.09)),
    )
    hair = carve(0.018, hair, window)
    # Bangs swept to one side, and strands before the ears.
    bangs = [
        tube(
            np.array(
                [
                    (0.035, -0.060, 1.592),
                    (0.035 + 0.45 * (x - 0.035), -0.120, 1.562),
                    (0.02 + 0.85 * (x - 0.02), -0.148 + 0.30 * abs(x), 1.515),
                    (x, -0.152 + 0.40 * abs(x), z),
                ]
            ),
            (0.020, 0.026, 0.026, 0.006),
        )
        for x, z in (
            (-0.112, 1.440),
            (-0.072, 1.458),
            (-0.028, 1.470),
            (0.020, 1.474),
            (0.066, 1.462),
            (0.104, 1.448),
        )
    ]
    hair = blend(0.007, hair, *bangs)
    strand = tube(
        np.array(
            [(0.125, -0.075, 1.50), (0.152, -0.072, 1.42), (0.148, -0.080, 1.34), (0.132, -0.090, 1.285)]
        ),
        (0.026, 0.024, 0.020, 0.006),
    )
    tail = [
        (0.158, 0.055, 1.345),
        (0.196, 0.055, 1.325),
        (0.216, 0.050, 1.280),
        (0.214, 0.042, 1.235),
        (0.198, 0.032, 1.195),
    ]
    pig = tube(np.array(tail), (0.028, 0.042, 0.046, 0.036, 0.010))
    pig = sculpt.bumped(pig, lambda p: 0.003 * np.cos(9 * np.arctan2(p[:, 0] - 0.210, p[:, 1] - 0.048)))
    hair = blend(0.010, hair, mirrored(strand), mirrored(pig))
    return sculpt.surface(hair, (-0.27, -0.25, 1.05), (0.27, 0.25, 1.68), spacing, turn)


def girl_ties(spacing, turn):
    tie = ring((0.170, 0.056, 1.340), (0.85, 0.0, -0.50), 0.029, 0.012)
    return sculpt.surface(mirrored(tie), (-0.24, -0.02, 1.25), (0.24, 0.14, 1.40), spacing, turn)


COAT_LOW = 0.60
CUFF = 0.93


def coat_solid():
    skirt = round_cone((0, 0.0, 1.06), (0, 0, 0.56), 0.125, 0.235)

    def squeezed(points):
        return skirt(points * (1.0, 1.28, 1.0)) / 1.14

    folds = sculpt.bumped(
        squeezed,
        lambda p: (
            0.007 * np.clip((0.95 - p[:, 2]) / 0.3, 0, 1) * np.cos(10 * np.arctan2(p[:, 0], -1.28 * p[:, 1]))
        ),
    )
    sleeve = blend(0.03, cone("upper_arm.L", 0.062, 0.056), cone("forearm.L", 0.056, 0.056))
    trunk = grown(trunk_solid(), 0.016)
    coat = blend(0.05, folds, trunk)
    coat = blend(0.035, coat, sleeve)
    hood = carve(
        0.03,
        ellipsoid((0, 0.105, 1.165), (0.125, 0.075, 0.075)),
        ellipsoid((0, 0.075, 1.235), (0.085, 0.055, 0.06)),
    )
    collar = ring((0, 0.012, 1.178), (0, -0.30, 1.0), 0.088, 0.023, (1.05, 1.0, 1.0))
    cuff = _cuff(CUFF - 0.10, 0.058, 0.011)
    placket = box((0, -0.2, 0.87), (0.020, 0.15, 0.29), 0.004)
    coat = blend(0.006, coat, common(0.004, grown(coat, 0.005), placket))
    return mirrored(blend(0.010, blend(0.02, coat, hood), collar, cuff))


def _cuff(share, major, minor):
    elbow, wrist = joint("forearm.L"), joint("hand.L")
    return ring(elbow + share * (wrist - elbow), wrist - elbow, major, minor)


def sleeve_end(share):
    """Way to the end of the sleeves, at a share of the forearm; positive on all else."""
    elbow, wrist = joint("forearm.L"), joint("hand.L")
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    end = elbow + share * (wrist - elbow)

    def way(p):
        folded = np.column_stack([np.abs(p[:, 0]), p[:, 1:]])
        return np.maximum((end - folded) @ along, 0.28 - folded[:, 0])

    return way


def neck_hole(radius, height):
    """Distance from the axis of the neck, above a height."""
    return lambda p: np.maximum(np.hypot(p[:, 0], p[:, 1] - 0.012) - radius, height - p[:, 2])


def coat(spacing, turn):
    end, hole = sleeve_end(CUFF), neck_hole(0.068, 1.16)

    def region(p):
        return np.minimum.reduce([p[:, 2] - COAT_LOW, end(p), hole(p)])

    return sheet(coat_solid(), region, spacing, turn, 0.008)


def coat_trim(spacing, turn):
    """Buttons and pocket flaps."""
    solid = coat_solid()
    places = [(0.0, z) for z in (1.08, 0.99, 0.90, 0.81)]
    parts = [ellipsoid((x, on_front(solid, x, z) - 0.004, z), (0.016, 0.007, 0.016)) for x, z in places]
    meshes = [
        sculpt.surface(part, (x - 0.03, -0.32, z - 0.03), (x + 0.03, 0.0, z + 0.03), 0.6 * spacing, turn)
        for part, (x, z) in zip(parts, places, strict=True)
    ]
    flap = common(0.005, grown(solid, 0.011), box((0.118, -0.2, 0.775), (0.046, 0.19, 0.026), 0.012))
    for side in (1, -1):
        ends = np.sort([side * 0.05, side * 0.19])
        cut = common(0.002, mirrored(flap), lambda p: -solid(p) - 0.004)
        meshes.append(sculpt.surface(cut, (ends[0], -0.30, 0.73), (ends[1], 0.0, 0.82), spacing, turn))
    return sculpt.joined(*meshes)


def leggings(spacing, turn):
    solid = grown(mirrored(blend(0.035, trunk_solid(), leg_solid())), 0.007)

    def region(p):
        return np.minimum.reduce([0.90 - p[:, 2], p[:, 2] - 0.20, 0.25 - np.abs(p[:, 0])])

    return sheet(solid, region, spacing, turn)


def boots(spacing, turn):
    ankle = joint("foot.L")
    shaft = round_cone((0.092, 0.012, 0.34), (0.096, 0.022, 0.08), 0.066, 0.055)
    foot = blend(
        0.03,
        round_cone(ankle + (0, 0.022, -0.03), joint("toes.L") + (0, 0, 0.012), 0.054, 0.052),
        round_cone(joint("toes.L") + (0, 0, 0.012), joint("toes.L") + (0.006, -0.052, 0.010), 0.052, 0.047),
    )
    boot = blend(0.035, shaft, foot)
    boot = blend(0.006, boot, ring((0.0925, 0.013, 0.298), (0.01, 0.02, 1), 0.064, 0.010))
    boot = common(0.010, boot, lambda p: 0.004 - p[:, 2])
    sole = common(0.008, grown(boot, 0.008), lambda p: p[:, 2] - 0.026)
    boot = mirrored(blend(0.004, boot, sole))
    return sheet(boot, lambda p: 0.302 - p[:, 2], spacing, turn, 0.010)


def bag(spacing, turn):
    """A satchel on the right hip and its strap over the left shoulder."""
    solid = coat_solid()
    place = np.array((-0.206, 0.005, 0.80))
    lean = np.array([(0.96, 0.0, 0.28), (0, 1, 0), (-0.28, 0, 0.96)])
    pouch = box(place, (0.034, 0.080, 0.064), 0.022, lean)
    flap = box(place + (-0.007, 0, 0.028), (0.036, 0.085, 0.042), 0.018, lean)
    pouch = blend(0.004, pouch, flap)
    buckle = box(place + (-0.046, 0, 0.0), (0.006, 0.016, 0.014), 0.005, lean)
    pouch = blend(0.003, pouch, buckle)
    low, high = (-0.31, -0.12, 0.68), (-0.13, 0.13, 0.92)
    # The strap lies in a plane through the shoulder and the pouch.
    low_end, high_end = np.array((-0.20, 0.0, 0.85)), np.array((0.115, 0.0, 1.17))
    up = (high_end - low_end) / np.linalg.norm(high_end - low_end)
    strap = sculpt.ribbon(
        grown(solid, 0.001),
        (low_end + high_end) / 2,
        (up, (0, -1, 0)),
        (-0.97 * np.pi, 0.97 * np.pi),
        0.015,
        0.007,
        72,
    )
    return sculpt.joined(sculpt.surface(pouch, low, high, spacing, turn), strap)


# ------------------------------------------------------------------ Bruno


def beanie(spacing, turn):
    dome = ellipsoid((0, 0.030, 1.490), (0.160, 0.166, 0.190))
    dome = sculpt.bumped(dome, lambda p: 0.003 * np.cos(26 * np.arctan2(p[:, 0], -(p[:, 1] - 0.03))))
    brim = ring((0, 0.030, 1.532), (0, -0.10, 1.0), 0.149, 0.031, (0.985, 1.0, 1.0))
    brim = sculpt.bumped(brim, lambda p: 0.0035 * np.cos(40 * np.arctan2(p[:, 0], -(p[:, 1] - 0.03))))
    pompom = sculpt.bumped(
        ellipsoid((0, 0.050, 1.705), (0.050, 0.050, 0.046)),
        lambda p: 0.004 * np.cos(130 * p[:, 0]) * np.cos(130 * p[:, 1]) * np.cos(130 * p[:, 2]),
    )
    cap = common(0.01, dome, lambda p: 1.525 - p[:, 2])
    solid = blend(0.008, blend(0.006, cap, brim), pompom)
    return sheet(
        solid,
        lambda p: ellipsoid((0, 0.02, 1.45), (0.149, 0.155, 0.150))(p),
        spacing,
        turn,
        low=(-0.25, -0.25, 1.40),
        high=(0.25, 0.28, 1.80),
    )


def beard(spacing, turn):
    """Sideburns, a full beard and a moustache, hair at the nape."""

    def strands(points):
        about = np.arctan2(points[:, 0], -points[:, 1])
        return 0.0040 * np.cos(24 * about + 10 * (points[:, 2] - 1.3))

    jaw = blend(
        0.04,
        ellipsoid((0, -0.060, 1.285), (0.122, 0.100, 0.085)),
        ellipsoid((0, -0.092, 1.205), (0.075, 0.062, 0.075)),
        ellipsoid((0.110, -0.010, 1.375), (0.044, 0.058, 0.100)),
        ellipsoid((0, 0.085, 1.36), (0.128, 0.085, 0.110)),
    )
    jaw = sculpt.bumped(jaw, strands)
    face = blend(
        0.03,
        ellipsoid((0, -0.170, 1.395), (0.098, 0.11, 0.070)),
        ellipsoid((0, -0.165, 1.312), (0.056, 0.09, 0.030)),
    )
    jaw = carve(0.012, jaw, face)
    jaw = carve(0.010, jaw, ellipsoid((0.165, 0.010, 1.39), (0.035, 0.034, 0.048)))
    moustache = tube(
        np.array(
            [(0.006, -0.166, 1.342), (0.034, -0.163, 1.338), (0.064, -0.142, 1.322), (0.084, -0.118, 1.325)]
        ),
        (0.013, 0.0175, 0.014, 0.004),
    )
    moustache = sculpt.bumped(moustache, lambda p: 0.0018 * np.cos(260 * (p[:, 2] + 0.25 * p[:, 0])))
    solid = mirrored(blend(0.006, jaw, moustache))
    return sculpt.surface(solid, (-0.20, -0.23, 1.08), (0.20, 0.22, 1.52), spacing, turn)


def shirt_solid():
    sleeve = blend(0.03, cone("upper_arm.L", 0.058, 0.048), cone("forearm.L", 0.048, 0.044))
    shirt = blend(0.05, grown(trunk_solid(), 0.013), sleeve)
    cuff = _cuff(0.80, 0.045, 0.008)
    collar = ring((0, 0.014, 1.172), (0, -0.22, 1.0), 0.064, 0.014)
    return mirrored(blend(0.008, shirt, cuff, collar))


def shirt(spacing, turn):
    end, hole = sleeve_end(0.86), neck_hole(0.052, 1.14)

    def region(p):
        return np.minimum.reduce([p[:, 2] - 0.83, end(p), hole(p)])

    return sheet(shirt_solid(), region, spacing, turn, 0.007)


def trousers_solid():
    seat = blend(0.04, grown(trunk_solid(), 0.022), cone("thigh.L", 0.106, 0.082))
    leg = blend(0.03, seat, cone("shin.L", 0.080, 0.072))
    turnup = ring((0.0955, 0.018, 0.128), (0.02, 0.05, 1.0), 0.070, 0.013)
    return mirrored(blend(0.008, leg, turnup))


def trousers(spacing, turn):
    def region(p):
        return np.minimum(0.905 - p[:, 2], p[:, 2] - 0.105)

    return sheet(trousers_solid(), region, spacing, turn, 0.008)


def belt(spacing, turn):
    """A belt with a buckle, and braces over the shoulders."""
    under = blend(0.01, trousers_solid(), shirt_solid())
    band = sculpt.ribbon(under, (0, 0.012, 0.888), ((1, 0, 0), (0, 1, 0)), (0, 2 * np.pi), 0.019, 0.009, 72)
    front = on_front(under, 0.0, 0.888)
    buckle = carve(
        0.003,
        box((0, front - 0.012, 0.888), (0.034, 0.008, 0.027), 0.006),
        box((0, front - 0.020, 0.888), (0.021, 0.008, 0.015), 0.004),
    )
    buckle_mesh = sculpt.surface(
        buckle, (-0.06, front - 0.05, 0.84), (0.06, front + 0.03, 0.94), 0.6 * spacing, turn
    )
    braces = []
    for side in (1, -1):
        axes = (np.array((0.0, -1.0, 0.0)), np.array((0.06 * side, 0.0, 1.0)))
        over = sculpt.ribbon(
            shirt_solid(), (0.070 * side, 0.010, 1.00), axes, (-0.92, np.pi + 0.92), 0.014, 0.007, 44
        )
        braces.append(over)
    return sculpt.joined(band, buckle_mesh, *braces)


def shoes(spacing, turn):
    ankle = joint("foot.L")
    shoe = blend(
        0.03,
        round_cone(ankle + (0, 0.024, -0.034), joint("toes.L") + (0, 0, 0.008), 0.050, 0.047),
        round_cone(joint("toes.L") + (0, 0, 0.010), joint("toes.L") + (0.006, -0.058, 0.012), 0.048, 0.046),
        round_cone(ankle + (0, 0.006, 0.03), ankle + (0, 0, -0.01), 0.048, 0.048),
    )
    shoe = common(0.010, shoe, lambda p: 0.004 - p[:, 2])
    sole = common(0.008, grown(shoe, 0.009), lambda p: p[:, 2] - 0.024)
    lip = ring(ankle + (0, 0.004, 0.022), (0, -0.1, 1), 0.045, 0.010)
    solid = mirrored(blend(0.004, blend(0.008, shoe, lip), sole))
    return sheet(solid, lambda p: 0.112 - p[:, 2] - 0.1 * (p[:, 1] - 0.02), spacing, turn, 0.008)
