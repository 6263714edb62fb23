"""A picture of a page: a figure that is drawn into a folder, as SVG and PDF, and what a page shows of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn: its file name without suffix, its alternative text, and the function that draws it."""

    name: str
    alt: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file name without suffix, its SVG, and its alternative text.

    ``linked`` says where its axes of time, or its plane, are in it, as :func:`icmj.report.style.links` writes it.
    """

    name: str
    svg: bytes
    alt: str
    linked: str = ""


def name_file(name: str) -> str:
    """A name without what a file cannot be called by; a sweep or a branch may say anything."""
    return re.sub(r"[^\w.+-]", "-", name).lstrip(".")


def save(figure: Figure, folder: Path, name: str) -> None:
    """A figure as SVG and PDF."""
    for kind in ("svg", "pdf"):
        (folder / f"{name}.{kind}").write_bytes(style.save(figure, kind))
