"""What can go wrong. Every message ends with what to do."""


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
