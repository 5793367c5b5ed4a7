"""What the plots share: names as they are written, and whole files. Needs matplotlib.

Names of folders and files may hold anything. A dollar begins no formula, an underscore hides no curve, and
letters that the font lacks are drawn as boxes.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import in_one_line
from .whole_file import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


def caption(panel: Axes, text: str) -> None:
    """Sets the title of a panel."""
    panel.set_title(in_one_line(text), parse_math=False)


def legend(panel: Axes, curves: Iterable[tuple[Line2D, str]]) -> None:
    """Names the curves of a panel at its lower right."""
    lines, names = zip(*curves, strict=True)
    # Names that begin with an underscore are left out when they are given to the legend itself.
    places = map(str, range(len(lines)))
    shown = panel.legend(lines, places, loc="lower right", frameon=False)
    for text, name in zip(shown.get_texts(), names, strict=True):
        text.set_parse_math(False)
        text.set_text(in_one_line(name))


def save(figure: Figure, path, **options) -> None:
    """Writes a figure in the format that the ending of `path` names, whole or not at all."""
    with whole_file(path, binary=True) as file, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")
        figure.savefig(file, format=Path(path).suffix[1:], **options)
