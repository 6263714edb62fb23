"""Links to the glossary: ``[hold](glossary.md#term-hold)`` leads to the term; where Markdown is read, to the page."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

LINK = re.compile(r"\[([^\]\n]+)\]\(glossary\.md#term-([\w-]+)\)")


def link_terms(app: Sphinx, docname: str, source: list[str]) -> None:
    """Write each such link as a reference to the term, which must exist."""
    source[0] = LINK.sub(lambda found: f"{{term}}`{found[1]} <{found[2].replace('_', ' ')}>`", source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen for pages being read."""
    app.connect("source-read", link_terms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
