"""A picture of a page: a figure that is drawn into a folder, as SVG and PDF, and shown from there as a data URI."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_LINKED = re.compile(rb"<dc:description>([^<]*)<")
_PATH = re.compile(rb' (?:d|x|y)="[^"]*"')
_INDENT = re.compile(rb"\n +")
_BEYOND = re.compile(rb"(?<=\.\d\d)\d+")


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn: its file name without suffix, its alternative text, and the function that draws it."""

    name: str
    alt: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file name without suffix, its SVG as a data URI, and its alternative text.

    ``linked`` says where its axes of time, or its plane, are in it, as :func:`icmj.report.style.links` writes it.
    """

    name: str
    uri: str
    alt: str
    linked: str = ""


def name_file(name: str) -> str:
    """A name without what a file cannot be called by; a sweep or a branch may say anything."""
    return re.sub(r"[^\w.+-]", "-", name).lstrip(".")


def save(figure: Figure, folder: Path, name: str) -> None:
    """A figure as SVG and PDF."""
    for kind in ("svg", "pdf"):
        (folder / f"{name}.{kind}").write_bytes(style.save(figure, kind))


def show(folder: Path, drawing: Drawing) -> Picture:
    """A figure that was drawn into ``folder``, as the page shows it: paths to a hundredth of a point, half as long."""
    svg = (folder / f"{drawing.name}.svg").read_bytes()
    linked = _LINKED.search(svg)
    svg = _INDENT.sub(b"\n", _PATH.sub(lambda path: _BEYOND.sub(b"", path[0]), svg))
    uri = f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
    return Picture(drawing.name, uri, drawing.alt, linked[1].decode() if linked else "")
