# SPDX-License-Identifier: GPL-3.0-or-later
"""A sort of data that can be carried over, declared once for panels, operators and scripts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import bpy

from ..translation import said
from ..typed import EnumItem, Options

if TYPE_CHECKING:
    from .route import Route


def _nothing() -> None:
    """Write nothing."""


@dataclass(frozen=True)
class Prepared:
    """Data ready on the other side: `write` puts it onto the target, `notes` need the artist's attention.

    Where it changes how the target is shaded, `shade(mesh)` puts it onto any mesh with the target's faces.
    `left_out` names what is not put onto the target after all, and the notes say why.
    """

    write: Callable[[], None] = _nothing
    notes: Sequence[str] = ()
    shade: Callable[[bpy.types.Mesh], None] | None = None
    left_out: Sequence[str] = ()


def shading(target: bpy.types.Object, shade: Callable[[bpy.types.Mesh], None]) -> Prepared:
    """`Prepared` data that change how the target is shaded."""
    return Prepared(partial(shade, target.data), shade=shade)


class Bodies(NamedTuple):
    """The meshes of a source and those of its targets."""

    sources: Sequence[bpy.types.Object]
    targets: Sequence[bpy.types.Object]


# Whether an option changes anything as the others are set; between which bodies is unknown in Adjust Last
# Operation, which begins with those of before the transfer.
Effect = Callable[[Options, Bodies | None], bool]


@dataclass(frozen=True)
class Kind:
    """One sort of data.

    `identifier` names it in scripts and, after `use_` or `open_`, in settings. `names(source)` lists what the
    source object has of it. `prepare(route, names, options)` reads that, carries it along the route and
    returns a `Prepared`; it changes nothing and raises `UnusableObjectError` when something is wrong.
    `options` are its bpy properties by name, in the order in which a panel shows them; `borrowed` names some
    of other kinds that concern this one too, which a panel shows before them. `effects` tell of options that
    change nothing at times when they do; a panel shows them grey else.
    """

    identifier: str
    label: str
    icon: EnumItem
    description: str
    names: Callable[[bpy.types.Object], list[str]]
    prepare: Callable[[Route, list[str], Options], Prepared]
    options: Mapping[str, Any] = field(default_factory=dict)
    default: bool = True
    # One and many of its items, in the summary of a transfer; one word alone is not counted.
    words: tuple[str, ...] = ()
    borrowed: tuple[str, ...] = ()
    effects: Mapping[str, Effect] = field(default_factory=dict)

    @property
    def shown(self) -> tuple[str, ...]:
        """Names of the options that a panel shows."""
        return (*self.borrowed, *self.options)

    def counted(self, many: int) -> str:
        """Words such as "41 groups"."""
        if len(self.words) == 1:
            return said(self.words[0])
        one, several = self.words or (self.label.lower(), self.label.lower())
        return said(f"{{}} {one if many == 1 else several}", many)
