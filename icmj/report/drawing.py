"""Drawing: every figure of a case as SVG and PDF in a folder, from where the page takes them.

A page's figures take longer than all else of it, and one case's know nothing of another's, so that processes may draw
them side by side.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.text import one_line
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.panels import PANELS
from icmj.report.sections import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from icmj.report.panel import Panel


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


def panels_of(case: CaseRuns) -> list[tuple[Panel, Drawing]]:
    """The panels that a case has."""
    title, shown = case.first.run.title, (panel for panel in PANELS.collect("PANEL") if panel.applies(case))
    return [
        (panel, Drawing(f"{case.name}_{panel.letter}", f"{title}, panel ({panel.letter})", partial(panel.draw, case)))
        for panel in shown
    ]


def law_of(case: CaseRuns) -> Drawing | None:
    """The amplitude law, where it was measured."""
    from icmj.report.axes.law import law_figure

    measured = next((result for result in reversed(case.runs.values()) if result.law is not None), None)
    if measured is None:
        return None
    return Drawing(f"{case.name}_law", f"{case.first.run.title}, amplitude law", lambda: law_figure(measured))


def noise_of(case: CaseRuns) -> tuple[Drawing, Drawing] | None:
    """Intervals and spectra of runs under noise."""
    from icmj.report.noise_figures import histogram_figure, spectrum_figure

    if all(result.statistics is None for result in case.runs.values()):
        return None
    title = case.first.run.title
    return (
        Drawing(f"{case.name}_intervals", f"{title}, histogram of intervals", lambda: histogram_figure(case)),
        Drawing(f"{case.name}_spectra", f"{title}, spectra of the outputs", lambda: spectrum_figure(case)),
    )


def drawings_of(case: CaseRuns) -> Iterator[Drawing]:
    """All drawings of a case."""
    yield from (drawing for _, drawing in panels_of(case))
    if (law := law_of(case)) is not None:
        yield law
    yield from noise_of(case) or ()


def draw_case(case: CaseRuns, folder: Path) -> None:
    """Draw all figures of a case into ``folder``.

    Raises:
        ReportError: if numbers are too far apart to draw, or files cannot be written.
    """
    try:
        with style.apply():
            for drawing in drawings_of(case):
                save(drawing.draw(), folder, drawing.name)
    except (np.linalg.LinAlgError, ArithmeticError) as error:
        why = f"numbers too far apart ({one_line(error)})"
        raise ReportError(f"the report of {case.name} cannot be drawn: {why}") from error
    except OSError as error:
        raise ReportError(f"{error.filename or folder}: the report cannot be written ({error.strerror})") from error


def save(figure: Figure, folder: Path, name: str) -> None:
    """A figure as SVG and PDF."""
    for kind in ("svg", "pdf"):
        (folder / f"{name}.{kind}").write_bytes(style.save(figure, kind))


def picture(folder: Path, drawing: Drawing) -> Picture:
    """A figure that was drawn into ``folder``, as the page shows it: paths to a hundredth of a point, half as long."""
    svg = (folder / f"{drawing.name}.svg").read_bytes()
    linked = _LINKED.search(svg)
    svg = _INDENT.sub(b"\n", _PATH.sub(lambda path: _BEYOND.sub(b"", path[0]), svg))
    uri = f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
    return Picture(drawing.name, uri, drawing.alt, linked[1].decode() if linked else "")
