# SPDX-License-Identifier: GPL-3.0-or-later
"""What is painted on each piece, and how it gets into a texture.

A brush is a function of places and normals on the template, both (n, 3), to sRGB colours (n, 3).
"""

from __future__ import annotations

import numpy as np

from .anatomy import EYE, EYE_RADII, HEADS, INDEX, MOUTH, TAILS, eye_turn


def mixed(colours, other, share):
    return colours + np.clip(share, 0.0, 1.0)[:, None] * (np.array(other, float) - colours)


def flat(points, colour):
    return np.tile(np.array(colour, float), (len(points), 1))


def near(points, place, reach):
    """1 at a place and, mirrored, on the other side, falling off smoothly."""
    folded = np.column_stack([np.abs(points[:, 0]), points[:, 1:]])
    return np.exp(-(((folded - place) / reach) ** 2).sum(axis=1))


def step(values, at, width):
    """From 0 to 1 around a value."""
    return np.clip((values - at) / width + 0.5, 0.0, 1.0)


def grain(points, fine: float):
    """A soft pattern without direction, in −1…1."""
    x, y, z = (fine * points).T
    return (
        np.sin(x + 1.7 * np.sin(0.7 * y))
        + np.sin(1.3 * y + 1.9 * np.sin(0.8 * z))
        + np.sin(1.1 * z + 1.3 * np.sin(x))
    ) / 3


def skin(tone, blush, lips, freckles=False):
    def brush(points, normals):
        colours = flat(points, tone)
        colours = mixed(colours, blush, 0.55 * near(points, (0.078, -0.112, 1.345), (0.036, 0.08, 0.030)))
        colours = mixed(colours, blush, 0.45 * near(points, (0, -0.175, 1.362), (0.020, 0.03, 0.018)))
        colours = mixed(colours, blush, 0.35 * near(points, (0.155, 0.02, 1.385), (0.02, 0.03, 0.04)))
        for finger in ("thumb", "index", "middle", "ring", "little"):
            tip = TAILS[INDEX[f"{finger}_2.L"]]
            colours = mixed(colours, blush, 0.35 * near(points, tip, (0.016,) * 3))
        if freckles:
            rng = np.random.default_rng(4)
            for x, z, size in zip(
                rng.uniform(0.012, 0.092, 15),
                rng.uniform(1.342, 1.374, 15),
                rng.uniform(0.0016, 0.0028, 15),
                strict=True,
            ):
                front = points[:, 1] < -0.08
                away = np.hypot(np.abs(points[:, 0]) - x, points[:, 2] - z)
                colours = mixed(
                    colours,
                    np.array(tone) * (0.72, 0.58, 0.50),
                    0.75 * front * (1 - step(away, size, 0.0012)),
                )
        x, y, z = (points - MOUTH).T
        rim = np.hypot(x / 0.043, (z - 0.002 - 3.0 * x**2) / 0.0205)
        front = step(-y, 0.004, 0.012)
        colours = mixed(colours, lips, 0.80 * front * np.exp(-(((rim - 0.90) / 0.22) ** 2)))
        # Inside of the mouth.
        hollow = (
            ((x / 0.038) ** 2 + ((z - 0.001) / 0.019) ** 2 < 0.8)
            & (y > -0.022)
            & (y < 0.06)
            & (normals[:, 1] < 0.9)
        )
        return mixed(colours, (0.30, 0.07, 0.07), 1.0 * hollow)

    return brush


def underwear(tone, cloth):
    """Skin with a vest and shorts, which clothes cover."""

    def brush(points, normals):
        trunk = np.abs(points[:, 0]) < 0.15
        vest = (
            trunk
            & (points[:, 2] < 1.09 + 0.6 * np.maximum(np.abs(points[:, 0]) - 0.05, 0))
            & (points[:, 2] > 0.70)
        )
        return mixed(flat(points, tone), cloth, 1.0 * vest)

    return brush


def eye(iris, rim):
    def brush(points, normals):
        side = np.sign(points[:, 0])
        local = np.zeros_like(points)
        for each in (1, -1):
            own = side == each
            local[own] = (points[own] - EYE * (each, 1, 1)) @ eye_turn(each).T / EYE_RADII
        # Both look slightly inwards, to what is before them.
        x, z = local[:, 0] + 0.20 * side, local[:, 2] - 0.02
        away = np.hypot(x, z * 0.92)
        front = local[:, 1] < 0
        colours = flat(points, (0.97, 0.97, 0.96))
        colours = mixed(colours, (0.80, 0.82, 0.86), step(local[:, 2], 0.55, 0.5))
        inner = np.array(iris) * (0.75 + 0.65 * np.clip(-z / 0.6 + 0.25, 0, 1))[:, None]
        colours = colours + (front * (1 - step(away, 0.60, 0.05)))[:, None] * (np.minimum(inner, 1) - colours)
        colours = mixed(colours, rim, front * np.exp(-(((away - 0.57) / 0.055) ** 2)))
        colours = mixed(colours, (0.03, 0.02, 0.03), front * (1 - step(away, 0.29, 0.05)))
        for dx, dz, size in ((-0.20, 0.24, 0.125), (0.22, -0.24, 0.06)):
            # Both eyes have their glint on the same side, as from one lamp.
            spot = np.hypot(local[:, 0] + 0.20 * side - dx, z - dz)
            colours = mixed(colours, (1, 1, 1), front * (1 - step(spot, size, 0.04)))
        return colours

    return brush


def lids(tone):
    def brush(points, normals):
        return mixed(
            flat(points, np.array(tone) * 0.97),
            np.array(tone) * (0.86, 0.72, 0.70),
            near(points, EYE + (0, -0.02, 0.045), (0.05, 0.04, 0.02)),
        )

    return brush


def hair(dark, light, along=90.0):
    def brush(points, normals):
        about = np.arctan2(points[:, 0], -(points[:, 1] - 0.03))
        streak = 0.5 + 0.5 * np.sin(along * about / 2 + 3 * grain(points, 30))
        shine = np.exp(-(((points[:, 2] - 1.54) / 0.035) ** 2))
        colours = mixed(flat(points, dark), light, 0.35 * streak + 0.45 * shine)
        return colours * (0.86 + 0.14 * np.clip((points[:, 2] - 1.1) / 0.4, 0, 1))[:, None]

    return brush


def plain(colour, variation=0.03, fine=25.0):
    def brush(points, normals):
        return flat(points, colour) * (1 + variation * grain(points, fine))[:, None]

    return brush


def oilskin(colour, seam):
    """A raincoat: placket, stitches along the hem, a darker inner side of the hood."""

    def brush(points, normals):
        colours = plain(colour, 0.025, 14.0)(points, normals)
        colours = colours * (0.90 + 0.10 * np.clip((points[:, 2] - 0.58) / 0.3, 0, 1))[:, None]
        front = (points[:, 1] < 0) & (points[:, 2] < 1.15)
        edge = np.exp(-(((np.abs(points[:, 0]) - 0.0215) / 0.0022) ** 2)) * front
        colours = mixed(colours, np.array(colour) * 0.62, 0.8 * edge)
        stitch = np.exp(-(((points[:, 2] - 0.622) / 0.002) ** 2)) * (
            np.sin(260 * np.arctan2(points[:, 0], points[:, 1]) * 0.2) > -0.3
        )
        colours = mixed(colours, seam, 0.9 * stitch)
        elbow, wrist = HEADS[INDEX["forearm.L"]], HEADS[INDEX["hand.L"]]
        way = wrist - elbow
        along = (np.column_stack([np.abs(points[:, 0]), points[:, 1:]]) - elbow) @ way / (way @ way)
        return mixed(
            colours,
            np.array(colour) * 0.7,
            (np.abs(points[:, 0]) > 0.3) * np.exp(-(((along - 0.785) / 0.012) ** 2)),
        )

    return brush


def stripes(colour, other, width):
    """Stripes around trunk and sleeves."""

    def brush(points, normals):
        shoulder, wrist = HEADS[INDEX["upper_arm.L"]], HEADS[INDEX["hand.L"]]
        way = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        folded = np.column_stack([np.abs(points[:, 0]), points[:, 1:]])
        along = (folded - shoulder) @ way
        sleeve = (along > 0.035) & (folded[:, 0] > 0.125) & (points[:, 2] > 0.84)
        place = np.where(sleeve, along + 0.4 * width, points[:, 2])
        band = step(np.abs((place / width) % 2 - 1), 0.5, 0.10)
        colours = mixed(flat(points, colour), other, band)
        collar = (points[:, 2] > 1.158) | ((folded[:, 0] > 0.3) & (along > 0.352))
        colours = mixed(colours, other, 1.0 * collar)
        return colours * (1 + 0.02 * grain(points, 40))[:, None]

    return brush


def denim(colour, seam):
    def brush(points, normals):
        weave = 0.035 * np.sin(900 * (points[:, 2] + 0.5 * points[:, 0])) + 0.05 * grain(points, 12)
        colours = flat(points, colour) * (1 + weave)[:, None]
        knee = near(points, (0.09, -0.08, 0.44), (0.06, 0.06, 0.10))
        colours = mixed(colours, np.minimum(np.array(colour) * 1.5 + 0.06, 1), 0.45 * knee)
        side = (
            np.exp(-(((points[:, 1] - 0.012) / 0.0025) ** 2))
            * (np.abs(points[:, 0]) > 0.10)
            * (points[:, 2] > 0.16)
        )
        colours = mixed(colours, seam, 0.55 * side)
        turned = step(0.150 - points[:, 2], 0.0, 0.004)
        return mixed(colours, np.minimum(np.array(colour) * 1.35 + 0.10, 1), 0.8 * turned)

    return brush


def rubber(colour, sole):
    def brush(points, normals):
        colours = flat(points, colour) * (0.93 + 0.07 * np.clip(points[:, 2] / 0.1, 0, 1))[:, None]
        colours = mixed(colours, sole, 1 - step(points[:, 2], 0.027, 0.003))
        return mixed(colours, np.minimum(np.array(colour) * 1.12 + 0.04, 1), step(points[:, 2], 0.286, 0.004))

    return brush


def knit(colour, brim):
    def brush(points, normals):
        about = np.arctan2(points[:, 0], -(points[:, 1] - 0.03))
        ribs = 0.06 * np.cos(26 * about) + 0.03 * np.sin(500 * points[:, 2])
        colours = flat(points, colour) * (1 + ribs)[:, None]
        return mixed(colours, brim, step(points[:, 2], 1.664, 0.006))

    return brush


def leather(colour, metal, bright):
    """`bright(points)` tells where metal is."""

    def brush(points, normals):
        colours = flat(points, colour) * (1 + 0.10 * grain(points, 45))[:, None]
        return mixed(colours, metal, 1.0 * bright(points))

    return brush


def teeth(points, normals):
    return mixed(
        flat(points, (0.97, 0.96, 0.93)),
        (0.86, 0.36, 0.36),
        1 - step(points[:, 2] - MOUTH[2], -0.0075, 0.002),
    )


# ------------------------------------------------------------------ texture


def painted(size: int, pieces) -> np.ndarray:
    """An image (size, size, 3), first row lowest, of pieces: (brush, places, normals, triangles, corner UVs
    (m, 3, 2))."""
    image = np.zeros((size, size, 3), np.float32)
    filled = np.zeros((size, size), bool)
    for brush, places, normals, triangles, uv in pieces:
        texel, face, weights = _covered(size * uv)
        within = ((texel >= 0) & (texel < size)).all(axis=1)
        texel, face, weights = texel[within], face[within], weights[within]
        corners = triangles[face]
        at = np.einsum("ni,nid->nd", weights, places[corners])
        up = np.einsum("ni,nid->nd", weights, normals[corners])
        image[texel[:, 1], texel[:, 0]] = np.clip(brush(at, up), 0.0, 1.0)
        filled[texel[:, 1], texel[:, 0]] = True
    return _spread(image, filled)


def _covered(uv):
    """Texels whose middle lies in a triangle (n, 2), the triangle, and its weights there."""
    low = np.floor(uv.min(axis=1) - 0.5).astype(int)
    extent = np.ceil(uv.max(axis=1) + 0.5).astype(int) - low
    found = []
    for width, height in np.unique(extent, axis=0):
        chosen = np.flatnonzero((extent == (width, height)).all(axis=1))
        offsets = np.stack(np.meshgrid(np.arange(width), np.arange(height), indexing="ij"), axis=-1).reshape(
            -1, 2
        )
        for some in np.array_split(chosen, len(chosen) * len(offsets) // 2_000_000 + 1):
            texel = low[some][:, None] + offsets
            a, b, c = (uv[some, k][:, None] for k in range(3))
            whole = _crossed(b - a, c - a)
            weights = np.stack(
                [_crossed(b - texel - 0.5, c - texel - 0.5), _crossed(c - texel - 0.5, a - texel - 0.5)],
                axis=-1,
            )
            weights = weights / np.where(np.abs(whole) > 1e-12, whole, np.inf)[..., None]
            weights = np.concatenate([weights, 1.0 - weights.sum(axis=-1, keepdims=True)], axis=-1)
            inside = (weights > -0.02).all(axis=-1) & (np.abs(whole) > 1e-12)
            row, place = np.nonzero(inside)
            found.append((texel[row, place], some[row], weights[row, place]))
    return tuple(np.concatenate(each) for each in zip(*found, strict=True))


def _crossed(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _spread(image, filled, rounds: int = 6):
    """Colours beyond the borders of islands, as filters read them."""
    for _ in range(rounds):
        total, count = np.zeros_like(image), np.zeros(filled.shape, np.float32)
        for axis in (0, 1):
            for shift in (1, -1):
                there = np.roll(filled, shift, axis)
                total += np.roll(image, shift, axis) * there[..., None]
                count += there
        fresh = ~filled & (count > 0)
        image[fresh] = total[fresh] / count[fresh][:, None]
        filled = filled | fresh
    return image
