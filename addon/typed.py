# SPDX-License-Identifier: GPL-3.0-or-later
"""Types that many modules name in their annotations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

    import bpy

    from .operators.carry import GivenOptions
    from .properties import (
        SPECTRAL_MATCH_PG_landmark,
        SPECTRAL_MATCH_PG_panel,
        SPECTRAL_MATCH_PG_settings,
        SPECTRAL_MATCH_PG_stored_match,
    )
    from .transfer.kind import Kind

Floats = NDArray[np.floating[Any]]
Integers = NDArray[np.integer[Any]]
Flags = NDArray[np.bool_]
Values = NDArray[Any]
# Weights: vertices, numbers of groups or bones, and the weights of these for those.
Entries = tuple[Integers, Integers, Floats]
# Which groups are locked, and sum and number of the locked weights of each vertex.
Locks = tuple[Flags, Floats, Integers]

# What an operator says when it was executed, invoked or asked about an event.
Outcome = set[Literal["RUNNING_MODAL", "CANCELLED", "FINISHED", "PASS_THROUGH", "INTERFACE"]]
# One of the names that Blender has for icons, modes or types, of which its versions have others.
EnumItem: TypeAlias = Any

# An object that a property points to: None where there is none, which those who ask may rule out.
Pointed: TypeAlias = "bpy.types.Object | Any"

Settings: TypeAlias = "SPECTRAL_MATCH_PG_settings"
PanelState: TypeAlias = "SPECTRAL_MATCH_PG_panel"
Landmark: TypeAlias = "SPECTRAL_MATCH_PG_landmark"
StoredMatch: TypeAlias = "SPECTRAL_MATCH_PG_stored_match"
# Settings of a scene, or of an operator where it was given some.
Options: TypeAlias = "SPECTRAL_MATCH_PG_settings | GivenOptions"
# Whether the item of this name and kind is carried over.
Chosen: TypeAlias = "Callable[[Kind, str], bool]"
# IDs of the source → those of the target.
Exchanged: TypeAlias = "dict[bpy.types.ID, bpy.types.ID]"
