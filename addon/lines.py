# SPDX-License-Identifier: GPL-3.0-or-later
"""What the lists of the panels have in common."""

from typing import Any

import bpy
from bpy.types import UIList


class Lines(UIList):
    """A list of which a line is drawn by what it stands for alone."""

    def draw_line(self, context: bpy.types.Context, layout: bpy.types.UILayout, data: Any, item: Any) -> None:
        """Draw the line of an item of the data's."""
        raise NotImplementedError

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: Any,
        _icon: int | None,
        _active_data: Any,
        _active_name: str | None,
        _index: int | None = 0,
        _flag: int | None = 0,
    ) -> None:
        self.draw_line(context, layout, data, item)
