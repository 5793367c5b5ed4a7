# SPDX-License-Identifier: GPL-3.0-or-later
"""A match in an artist's words: its grade, and what speaks for and against it."""

import re
from collections.abc import Iterable
from typing import Any

# How the core begins or ends a reason, and what the panel says of it; None is for Details alone.
PLAIN = (
    ("distances, curvatures and orientation agree", "Everything that was compared agrees"),
    ("as it is worn", "The target is worn by the source: each point takes what lies below it"),
    ("pieces were matched as one figure", None),
    ("the target looks like a part of the source", "The target looks like a part of the source"),
    ("the source looks like a part of the target", "The source looks like a part of the target"),
    ("mirror image of the other", "One looks like the other in a mirror: try Allow Mirrored Match"),
    ("this is an alternative", "Another map fits better: this is one to compare"),
    ("other maps fit almost as well", "Another map fits nearly as well: compare the maps"),
    ("bumps and hollows do not agree", "Bumps and hollows differ: look whether the parts are the same"),
    ("left and right are hard to tell apart", "Left and right are hard to tell apart: look at Colors"),
    ("the surface turns in places", "Some places may be turned: look at Colors"),
    ("the shapes differ, or one is a part", "The shapes differ much, or one lacks parts of the other"),
    ("the bodies differ", "The bodies have different proportions"),
    ("unconnected part", "Loose parts were left out of the search: look at Colors"),
    ("is seen was placed beside", "Some parts have no match of their own: look at Confidence"),
    ("too few to be sure", "A mesh is too coarse to be sure: look at Colors"),
    ("looks the same when it is turned", "One looks the same when it is turned: add landmarks"),
    ("not refined on what the part covers", "The part was matched with the whole alone: look at Colors"),
    ("does not judge its map", "This method does not judge its map: look at Colors"),
    ("far out: ", "A point far out was taken to lie between its neighbours"),
    ("neighbours on the target", "Limbs may have grown together where they touch"),
)
# What tells of a transfer how it was done; all else that it notes needs a look.
TOLD = (
    "that both its rig and the source's have are kept",
    "came beside it as",
    "Its own stay in its slots",
    "was replaced: it stays in the scene",
    "What hung on its bones follows the new rig",
    "Weights went to bones that hold the same",
    "was not fitted",
    "locked vertex groups of",
    "were split along seams",
    "each of them got images of its own",
    "Weights of other bones gave way",
    "and were left out",
    "and was left out",
)
# Reasons that are no doubts.
NO_DOUBT = frozenset(words for sign, words in PLAIN[:5] if words)
GRADES = {"green": "Good match", "amber": "Check this match", "red": "Poor match"}
# A green match that leaves a doubt, or is less sure than this on average.
NEARLY_GOOD, SURE = "Mostly good match", 0.6


def plain(reasons: Iterable[str]) -> list[str]:
    """The core's reasons in plain words, without figures of its own measures; each once."""
    found = []
    for reason in reasons:
        words = next((words for sign, words in PLAIN if sign in reason), reason)
        if words is not None:
            found.append(re.sub(r" \([^)]*\d[^)]*\)", "", words[:1].upper() + words[1:]))
    return list(dict.fromkeys(found))


def notes_in_order(notes: Iterable[str]) -> tuple[list[str], list[str]]:
    """Notes on a transfer: those that need a look, and those that tell how it was done."""
    look: list[str] = []
    told: list[str] = []
    for note in notes:
        (told if any(sign in note for sign in TOLD) else look).append(note)
    return look, told


def verdict(grade: str, reasons: Iterable[str], confidence: float) -> str:
    """The grade in words, which never calls good what leaves doubts."""
    doubts = set(plain(reasons)) - NO_DOUBT
    if grade == "green" and (doubts or confidence < SURE):
        return NEARLY_GOOD
    return GRADES.get(grade, grade)


def of(stored: Any) -> str:
    """The verdict on a stored match."""
    return verdict(stored.grade, stored.reasons.splitlines(), stored.mean_confidence)
