"""Packages that only some of the work needs: which of our extras brings them."""

from importlib.util import find_spec

_OTHERS = {"distributed": "batch", "pyFM": "peers"}
"""Packages that are not of the extra "tools"."""


def missing(module: str) -> str:
    """Words on a package that is not there."""
    if module == "pygeodesic":
        return f"{module} is missing: pip install {module}"
    extra = _OTHERS.get(module, "tools")
    return f'{module} is missing: pip install ".[{extra}]" in a clone of the repository'


def require(*modules: str) -> None:
    """Raises `ImportError` with these words, before any work, for the first package that is not there."""
    for module in modules:
        if find_spec(module) is None:
            raise ImportError(missing(module), name=module)
