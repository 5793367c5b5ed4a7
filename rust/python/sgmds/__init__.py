"""Dense maps between deformable surfaces by spectral generalised multidimensional scaling.

A correspondence gives, for every vertex of the *target*, one point of the *source* surface;
values are carried from source to target.
"""

from importlib import import_module

# Without the module typing, whose import takes longer than all else here: Ctrl-C is heard only behind it.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from ._core import __version__
    from .correspondence import Correspondence, Quality
    from .errors import (
        ArgumentError,
        Cancelled,
        InternalError,
        MatchError,
        MeshError,
        NotEnoughMemory,
        SgmdsError,
    )
    from .evaluation import evaluate
    from .matching import match
    from .shape import Figure, Shape
    from .transfer import SurfaceMap, judge_layout, uv_islands

__all__ = [
    "ArgumentError",
    "Cancelled",
    "Correspondence",
    "Figure",
    "InternalError",
    "MatchError",
    "MeshError",
    "NotEnoughMemory",
    "Quality",
    "SgmdsError",
    "Shape",
    "SurfaceMap",
    "__version__",
    "evaluate",
    "judge_layout",
    "match",
    "uv_islands",
]

_ERRORS = (
    "ArgumentError",
    "Cancelled",
    "InternalError",
    "MatchError",
    "MeshError",
    "NotEnoughMemory",
    "SgmdsError",
)
_PLACES = {
    "__version__": "_core",
    "Correspondence": "correspondence",
    "Quality": "correspondence",
    **dict.fromkeys(_ERRORS, "errors"),
    "evaluate": "evaluation",
    "match": "matching",
    **dict.fromkeys(("Figure", "Shape"), "shape"),
    **dict.fromkeys(("SurfaceMap", "judge_layout", "uv_islands"), "transfer"),
}
"""Which module has each of these names: it is imported when one is first asked for, so that the program
`sgmds` begins at once, and needs of matplotlib and the like only what its work needs."""
_MODULES = ("correspondence", "errors", "matching", "poses", "shape", "transfer")
"""Modules that come without an import of their own."""


def __getattr__(name: str) -> "Any":
    if name in _MODULES:
        return import_module(f"{__name__}.{name}")
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_MODULES})
