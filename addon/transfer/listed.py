# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in a message: the first few, and how many more there are."""

from collections.abc import Iterable

# More names than these are not read.
MOST_NAMED = 5


def listed(names: Iterable[str], most: int = MOST_NAMED) -> str:
    """The names in one line: at most so many of them, then the number of the others."""
    names = list(names)
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown
