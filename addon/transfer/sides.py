# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the other side, for a match that turned left into right."""

import re

import bpy

# A side to people, though Blender exchanges it only at the ends of a name.
SIDED = re.compile(r"(?<![A-Za-z])(?:[LlRr]|left|right|LEFT|RIGHT)(?![A-Za-z])|Left|Right")


def flip_name(name):
    """The name with its side exchanged as Blender does it, a namespace left aside."""
    space, colon, own = name.rpartition(":")
    return space + colon + bpy.utils.flip_name(own)


def rename(items, named):
    """Give bones, vertex groups or shape keys new names, which may be names that others of them have."""
    renamed = [(item, named[item.name]) for item in items if named[item.name] != item.name]
    # Twice, since two of them may exchange their names.
    for number, (item, _) in enumerate(renamed):
        item.name = f"spectral_match {number}"
    for item, name in renamed:
        item.name = name


def names_on_target(names, options):
    """The target's name for each of the source's, and notes about sides that are not exchanged."""
    if not options.mirror_names:
        return {name: name for name in names}, []
    named = {name: flip_name(name) for name in names}
    kept = [name for name, other in named.items() if name == other and SIDED.search(name)]
    if not kept:
        return named, []
    return named, [
        "Mirror Names exchanges sides at the beginning or end of a name only. These were left as they are: "
        + ", ".join(kept)
    ]
