# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the other side, for a match that turned left into right."""

import re

import bpy

from .copies import copied

# A side to people, though Blender exchanges it only at the ends of a name.
SIDED = re.compile(r"(?<![A-Za-z])(?:[LlRr]|left|right|LEFT|RIGHT)(?![A-Za-z])|Left|Right")


def flip_name(name):
    """The name with its side exchanged as Blender does it, a namespace left aside."""
    space, colon, own = name.rpartition(":")
    return space + colon + bpy.utils.flip_name(own)


def name_on_target(name, options):
    return flip_name(name) if options.mirror_names else name


def rename(items, named, *animated):
    """Give bones, vertex groups or shape keys new names, which may be names that others of them have.

    Blender renames the paths in actions too: those of the `animated` IDs are copied, for others share them.
    """
    renamed = [(item, named[item.name]) for item in items if named[item.name] != item.name]
    for holder in animated if renamed else ():
        own_actions(holder, actions_of(holder))
    # Twice, since two of them may exchange their names.
    for number, (item, _) in enumerate(renamed):
        item.name = f"spectral_match {number}"
    for item, name in renamed:
        item.name = name


def actions_of(holder):
    """Actions that animate an ID, in its NLA strips too, each once."""
    return list(dict.fromkeys(user.action for user in _action_users(holder) if user.action is not None))


def own_actions(holder, actions):
    """Exchange these actions of an ID for copies; returns the copies."""
    made = {action: copied(action) for action in actions}
    for user in _action_users(holder):
        if user.action in made:
            # From Blender 4.4.
            slot = getattr(user, "action_slot", None)
            user.action = made[user.action]
            if slot is not None:
                user.action_slot = user.action.slots[slot.identifier]
    for action in actions:
        if not action.users:
            bpy.data.actions.remove(action)
    return list(made.values())


def _action_users(holder):
    held = holder.animation_data
    return [] if held is None else [held, *(strip for track in held.nla_tracks for strip in track.strips)]


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
