"""Formulae as MathML, made when the site is built: browsers draw it by themselves, with no script and no network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="formula">{convert(_laid_out(node.astext()), display="block")}</div>')
    raise nodes.SkipNode


def _laid_out(text: str) -> str:
    """Lines that are to stand under each other are put into an ``aligned`` environment."""
    bare = text.strip()
    if r"\\" in bare and r"\begin" not in bare:
        return rf"\begin{{aligned}}{bare}\end{{aligned}}"
    return bare


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer to Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
