"""Formulas as MathML, which browsers render themselves: no script, no external fonts."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.writers.html5 import HTML5Translator


def inline_formula(writer: HTML5Translator, node: nodes.math) -> None:
    """Return an inline formula."""
    writer.body.append(convert(node.astext(), display="inline"))
    raise nodes.SkipNode


def block_formula(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Return a display formula."""
    writer.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode
