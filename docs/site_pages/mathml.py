"""Equations as MathML, converted when the site is built: browsers set it, offline and without a
script.
"""

import re
from typing import Any

from latex2mathml.converter import convert
from sphinx.errors import ExtensionError


def typeset(latex: str, display: str) -> str:
    """An equation as an element of a page. Raises `ExtensionError` for LaTeX that cannot be set."""
    primed = re.sub(r"(\w''+)\^", r"{\1}^", latex)  # the converter takes X''^2 for two exponents
    try:
        return convert(primed, display=display)
    except Exception as error:
        raise ExtensionError(f"this equation cannot be set ({error!r}): {latex}") from error


def inline(page: Any, node: Any) -> None:
    page.body.append(typeset(node.astext(), "inline"))
    raise _done()


def displayed(page: Any, node: Any) -> None:
    page.body.append(f'<div class="equation">{typeset(node.astext(), "block")}</div>')
    raise _done()


def _done() -> Exception:
    from docutils.nodes import SkipNode

    return SkipNode()


def setup(app: Any) -> dict[str, Any]:
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
