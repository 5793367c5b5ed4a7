"""Settings of the documentation site: `.venv/bin/just -f .ci/justfile docs` builds it into build/docs."""

import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "rust" / "python"))

import sgmds

project = "Spectral Match"
author = "The Spectral Match developers"
copyright = f"2026, {author}"
release = version = sgmds.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = []
suppress_warnings = ["toc.not_included"]

autodoc_member_order = "bysource"
# Arrays and callbacks under the names that the code gives them.
autodoc_type_aliases = {
    name: name for name in ("ArrayLike", "NDArray", "Floats", "Ids", "Mesh", "Progress", "np.ndarray")
}
autodoc_typehints_format = "short"
napoleon_google_docstring = False
# Types of the standard library and numpy have their pages elsewhere; our own names are still checked.
nitpick_ignore_regex = [
    ("py:class", r"(?!sgmds\.)(.*)|sgmds\._core\..*"),
    ("py:data", r"(typing|collections)\..*"),
]

html_theme = "furo"
html_title = f"Spectral Match {release}"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#8cc4ea", "color-brand-content": "#8cc4ea"},
}


def _inline(self, node):
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(self, node):
    self.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


html_math_renderer = "mathml"


def _plain_aliases(app, what, name, obj, options, signature, returned):
    """Aliases by their names alone; Sphinx 9.0 writes the name of its own wrapper around them."""
    wrapper = re.compile(r"TypeAliasForwardRef\('([\w.]+)'\)")
    return tuple(text and wrapper.sub(r"\1", text) for text in (signature, returned))


def setup(app):
    app.connect("autodoc-process-signature", _plain_aliases)
    # Browsers draw MathML themselves, so that the pages need no script from elsewhere.
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
