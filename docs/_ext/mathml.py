"""Formulas as MathML, which browsers show by themselves: pages need no script and no network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util import logging

log = logging.getLogger(__name__)


def setup(app: Any) -> dict[str, Any]:
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"version": "1", "parallel_read_safe": True}


def inline(translator: Any, node: Any) -> None:
    translator.body.append(as_mathml(node, "inline"))
    raise nodes.SkipNode


def block(translator: Any, node: Any) -> None:
    translator.body.append(f'<div class="math">{as_mathml(node, "block")}</div>\n')
    raise nodes.SkipNode


def as_mathml(node: Any, display: str) -> str:
    """A formula of a page; a command of LaTeX that is not known is a warning, which fails a build with -W."""
    text = node.astext()
    # The converter knows equations below each other by one name only.
    made: str = convert(text.replace("{aligned}", "{align*}"), display=display)
    if "\\" in made or "<mi>&</mi>" in made:
        log.warning("this formula has no MathML: %s", text, location=node)
    return made
