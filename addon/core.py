# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled core, imported at first use so that a broken one costs a message and not the add-on."""

import importlib
from types import ModuleType

from . import wording


class CoreMissingError(Exception):
    """The core cannot be imported; the text says why and what to do."""


def load() -> ModuleType:
    """Return the `sgmds` module; raises `CoreMissingError` where it cannot be imported."""
    try:
        importlib.import_module("sgmds._core")
        return importlib.import_module("sgmds")
    except ImportError as reason:
        raise CoreMissingError(
            f"The computing core of Spectral Match does not load here ({reason}). "
            "Install the zip made for this operating system and restart Blender"
        ) from reason


def explain(error: Exception) -> str:
    """Words for an exception out of a match: the core's own in plain words, others name their kind."""
    if isinstance(error, CoreMissingError) or isinstance(error, load().SgmdsError):
        return wording.failure(str(error))
    return f"The match stopped with an unexpected error ({type(error).__name__}: {error}). Please report it"
