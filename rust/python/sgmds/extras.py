"""Packages that only some of the work needs: which of our extras brings them."""

from importlib.util import find_spec


def missing(module: str) -> str:
    """Words on a package that is not there."""
    extra = "batch" if module == "distributed" else "tools"
    return f'{module} is missing: pip install "sgmds[{extra}]"'


def require(*modules: str) -> None:
    """Raises `ImportError` with these words, before any work, for the first package that is not there."""
    for module in modules:
        if find_spec(module) is None:
            raise ImportError(missing(module), name=module)
