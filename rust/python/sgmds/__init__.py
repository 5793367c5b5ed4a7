"""Dense maps between deformable surfaces by spectral generalised multidimensional scaling.

A correspondence gives, for every vertex of the *target*, one point of the *source* surface;
values are carried from source to target.
"""

from ._core import __version__
from .correspondence import Correspondence, Quality
from .errors import ArgumentError, Cancelled, InternalError, MatchError, MeshError, SgmdsError
from .matching import match
from .shape import Shape

__all__ = [
    "ArgumentError",
    "Cancelled",
    "Correspondence",
    "InternalError",
    "MatchError",
    "MeshError",
    "Quality",
    "SgmdsError",
    "Shape",
    "__version__",
    "evaluate",
    "match",
]


def evaluate(*args, **kwargs):
    """Accuracy over a folder of shapes with known correspondences; see `sgmds.evaluation.evaluate`."""
    # Reading files and plotting need more than numpy, so they are imported when asked for.
    from .evaluation import evaluate as run

    return run(*args, **kwargs)
