"""How Sphinx builds the pages: ``make docs``, without a network, every warning an error."""

import sys
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))

from making.docstrings import as_rst
from making.formulas import block_formula, inline_formula
from making.placeholders import filled

project = "planfly"
project_copyright = "the authors of planfly, BSD-3-Clause"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["making", "style"]
html_static_path = ["style"]
html_css_files = ["pages.css"]
html_theme = "furo"
html_title = "planfly"
html_show_sourcelink = False
html_copy_source = False
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
# `name` in a docstring is code.
default_role = "code"
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"exclude-members": "__init__, __new__"}
python_maximum_signature_line_length = 80
nitpicky = False
html_math_renderer = "mathml"


def _fill(app: Sphinx, docname: str, source: list[str]) -> None:
    source[0] = filled(source[0], built=True)


def _docstring(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = as_rst(lines)


def setup(app: Sphinx) -> None:
    """Fill the placeholders of a page as it is read, lay out docstrings, and draw formulas."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (block_formula, None))
    app.connect("source-read", _fill)
    app.connect("autodoc-process-docstring", _docstring)
