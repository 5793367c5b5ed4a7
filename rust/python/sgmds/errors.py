"""What can go wrong. Every message ends with what to do."""

BEGINNING, END = 700, 300
"""Letters of a message that are shown: the file and what is wrong with it come first, what to do last."""


def in_one_line(words: str) -> str:
    """Words as a terminal can show them: no ends of lines, nothing that moves the cursor, not without end.

    Names of files and what is quoted of a file may hold anything.
    """
    line = " ".join(words.split())
    if len(line) > BEGINNING + END:
        line = f"{line[:BEGINNING]} … {line[-END:]}"
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in line)


class SgmdsError(Exception):
    """Base of all errors of this package."""


class MeshError(SgmdsError, ValueError):
    """The mesh, or the file it came from, cannot be used."""


class ArgumentError(SgmdsError, ValueError):
    """An argument has the wrong shape, type or value."""


class NotEnoughMemory(SgmdsError, MemoryError):  # noqa: N818 - the public name
    """The computation would not fit into the memory that is free; the message says how much it needs."""


class MatchError(SgmdsError):
    """No plausible map was found, or a stage could not finish."""


class Cancelled(SgmdsError):  # noqa: N818 - the public name
    """The progress callback asked to stop."""


class InternalError(SgmdsError):
    """A defect of this package; the message names the stage."""
