"""Formulae as MathML, made when the site is built: browsers draw it by themselves, with no script and no network."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

# a sign behind an operator or an opening bracket belongs to what follows
SIGN = re.compile(
    r"(<mo[^>]*>(?:=|\(|\[|,|\+|&#x0003D;|&#x00028;|&#x0005B;|&#x0002C;|&#x021D2;)</mo>)<mo>(&#x02212;|&#x0002B;|−|\+|&#x000B1;)</mo>"
)


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="formula">{mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def mathml(text: str, display: str = "inline") -> str:
    """A formula; ``aligned``, and what has lines without saying so, stand under each other."""
    bare = text.strip().replace(":=", "≔").replace("{aligned}", "{align*}")
    bare = bare.replace(r"\lvert", r"\left|").replace(r"\rvert", r"\right|")  # both bars of one height
    if r"\\" in bare and r"\begin" not in bare:
        bare = rf"\begin{{align*}}{bare}\end{{align*}}"
    drawn = SIGN.sub(r'\1<mo form="prefix">\2</mo>', convert(bare, display=display))
    return re.sub("<m([io])>≔</m[io]>", '<mo lspace="0.28em" rspace="0.28em">≔</mo>', drawn)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer to Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
