"""The sheet: the six panels of a case in one figure, which keeps its style when it is drawn and saved later."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from icmj.report import style
from icmj.report.axes.eigenvalues import draw_locus, draw_modulus, draw_scale
from icmj.report.axes.intervals import draw_intervals
from icmj.report.axes.modes import draw_critical, draw_norm, draw_others
from icmj.report.axes.outputs import draw_output
from icmj.report.axes.phase import draw_phase
from icmj.report.case_runs import CaseRuns
from icmj.report.style import Journal

MOST = 4  # outputs in panel (c)


class Sheet(Figure):
    """A figure that is always drawn in the settings that it was made with: fonts of a PDF are chosen at its saving."""

    def __init__(self, *args: Any, settings: Journal, **kwargs: Any) -> None:
        self.settings = settings
        with settings:
            super().__init__(*args, **kwargs)

    def draw(self, renderer: Any) -> None:
        """Draw in these settings."""
        with self.settings:
            super().draw(renderer)

    def savefig(self, fname: Any, **kwargs: Any) -> None:
        """Save in these settings."""
        with self.settings:
            super().savefig(fname, **kwargs)


def draw_sheet(case: CaseRuns, settings: Journal, letters: bool) -> Sheet:
    """Panels (a) to (f) in three rows of two, each with its legend above its axes."""
    outputs = min(case.last.actual.n_y, MOST)
    drawn: tuple[Callable[[SubFigure], list[Axes]], ...] = (
        lambda place: _single(place, case, draw_modulus),
        lambda place: _locus(place, case),
        lambda place: _outputs(place, case, outputs),
        lambda place: _single(place, case, draw_phase),
        lambda place: _single(place, case, draw_intervals),
        lambda place: _modes(place, case),
    )
    rows = (1.0, 1.0 + 0.15 * (outputs - 1), 1.0)
    width, height = settings["figure.figsize"][0], style.HEIGHT * style.MM * sum(rows)
    figure = Sheet(figsize=(width, height), layout="constrained", settings=settings)
    with settings:
        places: Any = figure.subfigures(3, 2, height_ratios=rows, hspace=0.03, wspace=0.02)
        for letter, place, draw in zip("abcdef", places.ravel(), drawn, strict=True):
            first, *_ = draw(place)
            _head(place, first, f"({letter})" if letters else "")
    return figure


def _single(place: SubFigure, case: CaseRuns, draw: Callable[[Axes, CaseRuns], None]) -> list[Axes]:
    axes = place.subplots()
    draw(axes, case)
    return [axes]


def _locus(place: SubFigure, case: CaseRuns) -> list[Axes]:
    axes = place.subplots()
    draw_locus(axes, case)
    draw_scale(axes.inset_axes((1.04, 0, 0.036, 1)), case)
    return [axes]


def _outputs(place: SubFigure, case: CaseRuns, count: int) -> list[Axes]:
    stack = list(place.subplots(count, sharex=True, squeeze=False)[:, 0])
    for i, axes in enumerate(stack):
        draw_output(axes, case, i)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
    return stack


def _modes(place: SubFigure, case: CaseRuns) -> list[Axes]:
    if case.prediction.V_inv is None:
        return _single(place, case, draw_norm)
    critical, others = place.subplots(2, sharex=True)
    draw_critical(critical, case)
    draw_others(others, case)
    critical.set_xlabel("")
    return [critical, others]


def _head(place: SubFigure, axes: Axes, letter: str) -> None:
    """The letter, and right of it, above the axes, the legend in as many columns as there is room for."""
    handles, labels = axes.get_legend_handles_labels()
    room = place.bbox.width - 18 * place.figure.dpi / 72
    for columns in range(min(4, len(handles)), 0, -1):
        legend = place.legend(handles, labels, loc="outside upper right", ncols=columns)
        if columns == 1 or legend.get_window_extent().width < room:
            break
        legend.remove()
    if handles:
        place.text(0.005, 0.995, letter, va="top", weight="bold")
    else:
        place.suptitle(letter, x=0.005, ha="left", weight="bold")
