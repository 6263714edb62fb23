"""A section of a page: an anchor, a heading, a template, and the facts and pictures that the template prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Section:
    """One section of a page.

    Attributes:
        anchor: its id in the page.
        title: heading.
        template: Jinja source of its body; it knows the context as ``c``, and what is known to the whole page.
        context: what the template prints.
        listed: anchor and title of each part that the contents of the page list below the section.
    """

    anchor: str
    title: str
    template: str
    context: Mapping[str, Any] = field(default_factory=dict)
    listed: tuple[tuple[str, str], ...] = ()
