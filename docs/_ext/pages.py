"""No page is lost, and none is listed twice: the index ends with what it does not name, at "(every other page)".

A page that the index includes is part of it, and no page of its own.
"""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

PLACE = "(every other page)"


def list_the_rest(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the pages that are not named in the place of the words."""
    if docname == "index":
        named = set(re.findall(r"^(\w+)$|\{include\} (\w+)\.md$", source[0], flags=re.M))
        named = {name for pair in named for name in pair} | {"index"}
        others = [path.stem for path in sorted(Path(app.srcdir).glob("*.md")) if path.stem not in named]
        source[0] = source[0].replace(PLACE, "\n".join(others))
    if docname.endswith("index"):
        source[0] = "\n".join(_once(source[0].split("\n")))


def _once(lines: list[str]) -> list[str]:
    """The lines without names of pages that were there before."""
    kept: list[str] = []
    for line in lines:
        if not (re.fullmatch(r"[\w/-]+", line) and line in kept):
            kept.append(line)
    return kept


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen for the index being read."""
    app.connect("source-read", list_the_rest)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
