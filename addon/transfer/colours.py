# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour attributes, point and corner domain, in linear colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..mesh_write import OURS, check_name, read_attribute, write_attribute
from ..typed import Options, Values
from .kind import Kind, Prepared

if TYPE_CHECKING:
    from .route import Route


def names(source: bpy.types.Object) -> list[str]:
    return [layer.name for layer in source.data.color_attributes if not layer.name.startswith(OURS)]


def prepare(route: Route, wanted: Sequence[str], _options: Options) -> Prepared:
    source = route.body.data
    carried = []
    for name in wanted:
        layer = source.color_attributes[name]
        check_name(route.target, name, layer.data_type, layer.domain)
        values = read_attribute(layer).astype(np.float64)
        if layer.domain == "POINT":
            values = route.to_points(values)
        else:
            values = route.map.corner_values(*route.faces, values[route.triangle_corners])
        carried.append((name, layer.data_type, layer.domain, values))
    return Prepared(lambda: _write(route, wanted, carried))


def _write(route: Route, wanted: Sequence[str], carried: Sequence[tuple[str, str, str, Values]]) -> None:
    source, target = route.body.data, route.target.data
    for layer in carried:
        write_attribute(target, *layer)
    active, shown = source.color_attributes.active_color, target.color_attributes.active_color
    if active is not None and active.name in wanted and (shown is None or not shown.name.startswith(OURS)):
        target.color_attributes.active_color = target.color_attributes[active.name]
    render = source.color_attributes.render_color_index
    name = source.color_attributes[render].name if render >= 0 else ""
    if name in wanted:
        target.color_attributes.render_color_index = target.color_attributes.find(name)


KIND = Kind(
    "colours",
    "Color Attributes",
    "GROUP_VCOL",
    "Carry painted colors",
    names,
    prepare,
    words=("color layer", "color layers"),
)
