"""A section of the page: a heading, a template, and the facts and pictures that the template prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file name without suffix, its SVG as a data URI, and its alternative text.

    ``linked`` says where its axes of time, or its plane, are in it, as :func:`icmj.report.style.links` writes it.
    """

    name: str
    uri: str
    alt: str
    linked: str = ""


@dataclass(frozen=True)
class DrawnPanel:
    """A panel of one case on the page: letter, picture, and caption."""

    letter: str
    picture: Picture
    caption: str


@dataclass(frozen=True)
class Section:
    """One section of the page.

    Attributes:
        anchor: its id in the page.
        title: heading.
        template: file name in ``templates``.
        context: what the template prints.
    """

    anchor: str
    title: str
    template: str
    context: Mapping[str, Any] = field(default_factory=dict)
