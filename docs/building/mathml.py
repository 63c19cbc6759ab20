"""Equations as MathML: browsers draw it themselves, without a script and without a network.

docutils translates LaTeX; a command that it does not know is an error of the build.
"""

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

logger = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer; conf.py chooses it by name."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def translated(node: nodes.Element, as_block: bool) -> str:
    """The equation of a node as MathML; empty, with a warning, when it cannot be translated."""
    try:
        return tex2mathml(node.astext().strip(), as_block=as_block)
    except MathError as error:
        logger.warning("equation cannot be translated: %s", error, location=node)
        return ""


def visit_inline(translator: HTML5Translator, node: nodes.math) -> None:
    """An equation within a line."""
    translator.body.append(translated(node, as_block=False))
    raise nodes.SkipNode


def visit_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """An equation of its own, in a box that scrolls where the page is narrow."""
    translator.body.append(translator.starttag(node, "div", CLASS="equation"))
    translator.body.append(translated(node, as_block=True))
    translator.body.append("</div>\n")
    raise nodes.SkipNode
