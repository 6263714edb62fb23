"""Docstrings and signatures as they are written in icmj, in the words that Sphinx understands."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

SPELT = {
    r"~?(numpy\.)?ndarray\[(~?tuple\[~?(typing\.)?Any, \.\.\.\]|~?typing\.Any), "
    r"~?(numpy\.)?dtype\[~?(numpy\.)?float64\]\]": "Array",
    r"~?numpy\._typing\._array_like\._Buffer.*?_NestedSequence\[complex \| bytes \| str\]": "ArrayLike",
    # bounds of what is finite; Sphinx would shorten 1000000000000.0 to 0, as a name
    r"~?typing\.Annotated\[(float|int)(, ~?annotated_types\.[GL][et]\([gl][et]=[^)]*\))+\]": r"\1",
    r"<factory>": "...",
}


def as_meant(app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """|x| is a magnitude, and a colon in the first line of a property is a colon."""
    lines[:] = ["``".join(_halves(line)) for line in lines]
    if what in ("property", "attribute"):
        lines.insert(0, "\\ ")  # nothing, but a line


def _halves(line: str) -> list[str]:
    """Text and literals in turn, magnitudes escaped in the text."""
    return [part if n % 2 else part.replace("|", r"\|") for n, part in enumerate(line.split("``"))]


def short(
    app: Sphinx, what: str, name: str, thing: object, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Arrays of numbers by their short name."""
    return _short(signature), _short(returns)


def _short(text: str | None) -> str | None:
    for spelt, meant in SPELT.items():
        text = re.sub(spelt, meant, text) if text else text
    return text


def setup(app: Sphinx) -> dict[str, bool]:
    """Come before napoleon, which reads the sections of a docstring."""
    app.connect("autodoc-process-docstring", as_meant, priority=400)
    app.connect("autodoc-process-signature", short)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
