"""Dense maps between deformable surfaces by spectral generalised multidimensional scaling.

A correspondence gives, for every vertex of the *target*, one point of the *source* surface;
values are carried from source to target.
"""

from typing import TYPE_CHECKING, Any

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


if TYPE_CHECKING:
    from .evaluation import evaluate


def __getattr__(name: str) -> Any:
    # Reading files and plotting need more than numpy, so they are imported when asked for.
    if name == "evaluate":
        from .evaluation import evaluate

        return evaluate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
