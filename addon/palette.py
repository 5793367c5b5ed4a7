# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that show a map: one for every point, and a heat map for colour-blind eyes too."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]

# OKLab (Ottosson 2020): cone responses from lightness and opponent axes, and linear sRGB from cone responses.
_CONES_FROM_LAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_RGB_FROM_CONES = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)
# Hue runs over less than a full turn, so that head and feet do not meet in one colour.
FIRST_HUE, LAST_HUE = np.radians(285.0), np.radians(-15.0)
# From right to left the hue turns by so much, within this share of the width: a limb on the other
# side has another colour.
SIDE_HUE, SIDE_BAND = np.radians(110.0), 0.2
DARKEST, LIGHTEST = 0.54, 0.90
DULLEST, STRONGEST = 0.07, 0.19

# Certain to doubtful, linear sRGB: deep blue, grey, bright yellow. Lightness rises all the way, and blue to
# yellow is the axis that red-green blindness leaves intact.
HEAT_STOPS = np.array(
    [[0.010, 0.055, 0.24], [0.09, 0.15, 0.30], [0.28, 0.27, 0.26], [0.72, 0.48, 0.10], [1.0, 0.84, 0.20]]
)


def surface_colours(points: Floats) -> Floats:
    """Smooth colouring of a surface, (n, 3) points to (n, 4) linear RGBA.

    The longest side of the bounding box runs through the hues, the second through lightness, the shortest
    through strength of colour, so that front differs from back and top from bottom. Left and right, along x
    whichever axis points up, differ in hue besides.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    share = (points - low) / np.where(extent > 0.0, extent, 1.0)
    long, middle, short = np.argsort(-extent, kind="stable")
    hue = FIRST_HUE + (LAST_HUE - FIRST_HUE) * share[:, long]
    side = np.clip((share[:, 0] - 0.5) / SIDE_BAND + 0.5, 0.0, 1.0)
    hue += SIDE_HUE * side * side * (3.0 - 2.0 * side)
    lightness = DARKEST + (LIGHTEST - DARKEST) * share[:, middle]
    strength = DULLEST + (STRONGEST - DULLEST) * share[:, short]
    lab = np.stack([lightness, strength * np.cos(hue), strength * np.sin(hue)], axis=1)
    rgb = (lab @ _CONES_FROM_LAB.T) ** 3 @ _RGB_FROM_CONES.T
    return _opaque(np.clip(rgb, 0.0, 1.0))


def heat_colours(confidence: Floats) -> Floats:
    """Confidence in [0, 1] to linear RGBA: blue where the map is sure, yellow where it is not."""
    doubt = 1.0 - np.clip(np.nan_to_num(confidence), 0.0, 1.0)
    stops = np.linspace(0.0, 1.0, len(HEAT_STOPS))
    return _opaque(np.stack([np.interp(doubt, stops, HEAT_STOPS[:, c]) for c in range(3)], axis=1))


def _opaque(rgb: Floats) -> Floats:
    return np.concatenate([rgb, np.ones((len(rgb), 1))], axis=1).astype(np.float32)


# Okabe and Ito's set (2008), apart under every common colour blindness, on dark and light backgrounds; sRGB.
LANDMARK_COLOURS = (
    (0.902, 0.624, 0.0),
    (0.337, 0.706, 0.914),
    (0.0, 0.620, 0.451),
    (0.941, 0.894, 0.259),
    (0.835, 0.369, 0.0),
    (0.800, 0.475, 0.655),
)
# Their names, and the icons of a list that come nearest to them.
LANDMARK_NAMES = ("Orange", "Blue", "Green", "Yellow", "Red", "Pink")
LANDMARK_ICONS = tuple(f"COLLECTION_COLOR_0{number}" for number in (2, 5, 4, 3, 1, 7))
# Ends of the lines' scale, sRGB: the heat map's two hues, both bright enough for thin lines.
SURE_LINE, DOUBTFUL_LINE = np.array([0.337, 0.706, 0.914]), np.array([1.0, 0.86, 0.2])


def landmark_colour(number: int) -> tuple[float, float, float]:
    """Colour of a landmark, sRGB, again from the first after six."""
    return LANDMARK_COLOURS[number % len(LANDMARK_COLOURS)]


def line_colours(confidence: Floats) -> Floats:
    """Confidence in [0, 1] to sRGB colours of lines, (n, 4)."""
    doubt = 1.0 - np.clip(np.nan_to_num(confidence), 0.0, 1.0)[:, None]
    return _opaque(SURE_LINE + (DOUBTFUL_LINE - SURE_LINE) * doubt)
