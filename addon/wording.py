# SPDX-License-Identifier: GPL-3.0-or-later
"""A match in an artist's words: its grade, and what speaks for and against it."""

import re
from collections.abc import Iterable

from .typed import StoredMatch

# How the core begins or ends a reason, and what the panel says of it; None is for Details alone.
PLAIN = (
    ("distances, curvatures and orientation agree", "Everything that was compared agrees"),
    ("as it is worn", "The target is worn by the source: each point takes what lies below it"),
    ("that it is a copy of", "Both have the same pieces: each point takes the same one"),
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
    ("together it says that the map is right", "Not all signs agree, but together they say it is right"),
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
    "stay beside the new ones, in groups of their own",
    "came beside it as",
    "Its own stay in its slots",
    "was replaced: it stays in the scene",
    "hung on the old rig and follow the new one now",
    "Weights went to bones at the same places",
    "was not fitted",
    "locked vertex groups of",
    "were split along seams",
    "were baked into a new UV map",
    "and look alike there",
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


# What the core calls an alternative, and the panel a map.
MAPS = (
    ("this is an alternative", "this is one to compare"),
    ("compare the alternatives or set a landmark", "compare the maps or add landmarks"),
    ("try the next alternative", "try the next map"),
)


def details(reasons: Iterable[str]) -> list[str]:
    """The core's reasons in its own terms, but for its word for a map."""
    found = []
    for reason in reasons:
        for theirs, ours in MAPS:
            reason = reason.replace(theirs, ours)
        found.append(reason)
    return found


# What the core says of a failure in its own terms, and an artist's words for it.
FAILURES = (
    (r"the Laplace operator could not be factorised", "the surface could not be measured"),
    (
        r"the distances on a surface could not be expressed in its eigenfunctions",
        "the distances on a surface could not be measured",
    ),
    (r"the equations could not be set up", "there was no room for the computation"),
    (
        r"\S+ of \S+ eigenpairs converged \([^)]*\): ask for fewer, or clean up needle triangles",
        "the shape could not be measured: clean up needle triangles",
    ),
    (
        r"every candidate is mirrored; if one shape is a mirror image, allow that",
        "each map found is mirrored. If one shape is a mirror image of the other, allow mirrored maps",
    ),
    (
        r"no candidate has a finite distortion; check the shapes' scale and holes",
        "no map holds together. Check scale and holes of the meshes",
    ),
    (r"no candidate stood in the vote", "no map was convincing. Add landmarks on hands, feet and head"),
    (
        r"vertex \d+ has a coordinate that is not finite: remove or repair that vertex",
        "a vertex has a coordinate that is not finite: remove or repair it",
    ),
    (
        r"face \d+ refers to vertex \d+, but there are \d+ vertices \([^)]*\): repair the face list",
        "a face has a vertex that is not there: repair the mesh",
    ),
)


def failure(words: str) -> str:
    """Words of the core on why something failed, in plain ones; others stay."""
    for sign, plain_words in FAILURES:
        words = re.sub(sign, plain_words, words)
    return words


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


def is_good(stored: StoredMatch) -> bool:
    """Whether a stored match leaves no doubt."""
    return of(stored) == GRADES["green"]


def of(stored: StoredMatch) -> str:
    """The verdict on a stored match."""
    return verdict(stored.grade, stored.reasons.splitlines(), stored.mean_confidence)
