# SPDX-License-Identifier: GPL-3.0-or-later
"""Cuts the panels out of pictures of Blender's window: `panels.py FROM TO`, for each NAME.png with the place
of the sidebar in NAME.txt."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

TABS = 20
"""Width of the tabs at the right, and below the panels what is kept of the empty sidebar, in pixels."""
BELOW = 6
FRAME = 12

given, wanted = map(Path, sys.argv[1:])
for place in sorted(given.glob("*.txt")):
    left, top, width, height = map(int, place.read_text(encoding="utf-8").split())
    with Image.open(place.with_suffix(".png")) as picture:
        panel = picture.convert("RGB").crop((left, top, left + width - TABS, top + height))
    # Within the sidebar's frame: what differs from its empty end.
    pixels = np.asarray(panel, int)[:-FRAME, FRAME:-FRAME]
    filled = np.flatnonzero((np.abs(pixels - pixels[-1, 0]) > 12).any(axis=(1, 2)))
    panel = panel.crop((0, 0, panel.width, min(filled[-1] + BELOW, panel.height)))
    panel.quantize(256).save(wanted / f"panel-{place.stem}.png", optimize=True)
