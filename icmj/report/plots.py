"""Every figure of the report as a function that draws into your axes; public as ``icmj.plots``.

The first argument is the axes, followed by the results of one case: one run, or one on each plant. A function sets
labels, scales and limits, adds a legend above the axes unless ``legend=False``, and returns the axes; figure, fonts and
title are yours. Angles are in degrees, other outputs in their own unit. Typical use::

    with icmj.plots.style():  # one column of a journal
        figure, axes = matplotlib.pyplot.subplots()
        icmj.plots.phase(axes, icmj.read_log("runs/out/three-link-0.9.mujoco.rrd"))
        figure.savefig("phase.pdf")

Functions for a sweep take the sweep and the columns that vary: ``icmj.plots.validity(axes, swept, "b", "q_t")``.
Functions for sway take a result of :func:`icmj.measure_sway`, those for double steps one of :func:`icmj.refractoriness`
or :func:`icmj.experiments.reconstruct_steps`.

All of them raise ReportError if there is no result, if two results belong to different cases or to the same plant, or
if a result does not contain what is to be drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from icmj.case.result import Result
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.experiments.reconstruction import Reconstruction
from icmj.experiments.refractoriness import Refractoriness
from icmj.measurement.sway import Sway
from icmj.report.axes.eigenvalues import draw_locus, draw_modulus, draw_scale
from icmj.report.axes.hold_error import draw_hold_error
from icmj.report.axes.inputs import acting_inputs, draw_acting
from icmj.report.axes.intervals import draw_interval_errors, draw_intervals
from icmj.report.axes.law import draw_law, find_law
from icmj.report.axes.modes import draw_critical, draw_mode_errors, draw_norm, draw_others
from icmj.report.axes.noise import draw_histogram, draw_spectrum
from icmj.report.axes.outputs import draw_output
from icmj.report.axes.phase import draw_phase
from icmj.report.axes.pressure import draw_pressure, pressed_axes
from icmj.report.case_runs import CaseRuns, pair
from icmj.report.findings import draw_reactions, draw_reconstruction
from icmj.report.interval_curve import draw_curve
from icmj.report.maps import draw_basins, draw_validity
from icmj.report.style import Journal, journal
from icmj.report.sway_figures import draw_diffusion, draw_path, draw_spectra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def style(
    columns: float = 1,
    *,
    width: float | None = None,
    height: float | None = None,
    size: float = 8.0,
    font: str = "STIXGeneral",
) -> Journal:
    """Settings for a figure in a journal, for a ``with`` block or ``matplotlib.rcParams.update``.

    They give the size of new figures, the typeface and its sizes, thin axes, a layout that keeps legends inside the
    figure, and embedded TrueType fonts (type 42) in PDF and PostScript. Save figures within the block, too: fonts are
    embedded when a file is written.

    Args:
        columns: 1, 1.5 or 2 columns of a page: 85, 114 or 174 mm.
        width: width instead of that [mm].
        height: height [mm]; by default two thirds of the width, at most 75 mm.
        size: size of labels [pt]; numbers at the ticks and legends are a little smaller.
        font: family of an installed font; the default is shipped with matplotlib.

    Raises:
        ReportError: if there is no such number of columns, or a size is not positive.
    """
    return journal(columns, width, height, size, font)


def panels(*results: Result, settings: Journal | None = None, letters: bool = True) -> Figure:
    """The six panels (a) to (f) of a case in one new figure, which keeps its style when it is saved.

    Args:
        results: one run of a case, or one on each plant.
        settings: from :func:`icmj.report.plots.style`; by default those of two columns. The width is theirs.
        letters: whether each panel has its letter.

    Returns:
        A matplotlib figure; panel (c) shows the first four outputs.
    """
    from icmj.report.sheet import draw_sheet

    return draw_sheet(_case(results), style(2) if settings is None else settings, letters)


def modulus(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(a) Largest |λ| of φ(Δ_ol) for the actual plant and for an exact model; points: growth measured under a clock."""
    return _panel(draw_modulus, axes, results, legend)


def locus(axes: Axes, *results: Result, scale: bool = True, legend: bool = True) -> Axes:
    """(b) Eigenvalues of φ and the unit circle for increasing Δ_ol; ``scale`` adds a colour scale right of the axes."""
    case = _case(results)
    draw_locus(axes, case)
    if scale:
        draw_scale(axes.inset_axes((1.04, 0, 0.036, 1)), case)
    return _legend(axes, legend)


def output(axes: Axes, *results: Result, output: int | str = 0, legend: bool = True) -> Axes:
    """(c) One output, by number or name, against time, also under continuous control if that is there; dots: events."""
    case = _case(results)
    return _draw(draw_output, axes, legend, case, _output(case, output))


def phase(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(d) Velocity against position of every output, last part of the run, and the predicted orbit; circles: events.

    Between recorded rows the curve is interpolated; rows every 10 ms would be a polygon after each event.
    """
    return _panel(draw_phase, axes, results, legend)


def intervals(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(e) Open-loop intervals against the time of the event that ends them; dotted: Δ_crit."""
    return _panel(draw_intervals, axes, results, legend)


def critical_mode(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(f), upper part: the critical mode χ_k1 during the last intervals; dotted: events and ±γ."""
    return _panel(draw_critical, axes, results, legend)


def other_modes(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(f), lower part: the norm of the other modes during the last intervals; on a cycle it is zero at events."""
    return _panel(draw_others, axes, results, legend)


def interval_errors(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(e), strip: relative error of each open-loop interval with respect to Δ_crit, on a logarithmic axis."""
    return _panel(draw_interval_errors, axes, results, legend)


def mode_errors(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(f), strip: relative error of |χ_k1| at the last events with respect to γ, on a logarithmic axis."""
    return _panel(draw_mode_errors, axes, results, legend)


def state_norm(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """The norm of x̄ on a logarithmic scale; panel (f) shows it if there is no Δ_crit and therefore no χ."""
    return _panel(draw_norm, axes, results, legend)


def interval_histogram(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """Density of the open-loop intervals of runs under noise; dotted: Δ_crit, dashed: the minimum interval."""
    return _draw(draw_histogram, axes, legend, _under_noise(_case(results)))


def spectrum(axes: Axes, *results: Result, output: int | str = 0, legend: bool = True) -> Axes:
    """Power spectrum of one output, by number or name, of runs under noise, with its 95 % confidence."""
    case = _under_noise(_case(results))
    return _draw(draw_spectrum, axes, legend, case, _output(case, output))


def amplitude_law(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """Differences from the linear prediction against the threshold, with the fitted slopes."""
    case = _case(results)
    if (found := find_law(case)) is None:
        raise ReportError(
            f"case {case.name!r} has no amplitude law; run it with --study, or see icmj.experiments.measure_law"
        )
    return _draw(draw_law, axes, legend, *found)


def acting(axes: Axes, *results: Result, input: int | str | None = None, legend: bool = True) -> Axes:
    """(g) The command and the acting input, for an input (number or name); by default the first where they differ."""
    case = _case(results)
    there, names = acting_inputs(case), case.first.actual.inputs
    if not there:
        raise ReportError(f"case {case.name!r}: nothing but the command acts on its inputs")
    wanted = there[0] if input is None else _find_output("input", names, input, case)
    if wanted not in there:
        raise ReportError(f"case {case.name!r}: nothing but the command acts on {names[wanted]!r}")
    return _draw(draw_acting, axes, legend, case, wanted)


def pressure(axes: Axes, *results: Result, axis: str | None = None, legend: bool = True) -> Axes:
    """(h) The centre of pressure along ``x`` or ``y`` against time, for a body that stands on a floor."""
    case = _case(results)
    there = pressed_axes(case)
    if axis not in ("x", "y", None) or not there:
        why = f"no axis {axis!r}; expected x or y" if there else "nothing stands on a floor"
        raise ReportError(f"case {case.name!r}: {why}")
    return _draw(draw_pressure, axes, legend, case, axis or there[0])


def hold_error(axes: Axes, *results: Result, legend: bool = True) -> Axes:
    """(i) Size of the hold error in thresholds over the time since the event, in each of the last intervals.

    With the predicted orbit; in runs under noise with ± 2 predicted standard deviations, where those are predicted.
    """
    return _panel(draw_hold_error, axes, results, legend)


def validity(axes: Axes, swept: SweepTable, x: str, y: str, *, plant: str | None = None, legend: bool = True) -> Axes:
    """Relative error of the predicted interval over columns ``x`` and ``y`` of a sweep; contours: 0.1, 1 and 10 %.

    By default it is that in MuJoCo, or on the linear plant if there is no other.
    """
    return _map(draw_validity, axes, legend, swept, x, y, plant)


def critical_interval(axes: Axes, swept: SweepTable, x: str, *, legend: bool = True) -> Axes:
    """Δ_crit and the intervals of the measured cycles over the column ``x`` of a sweep."""
    return _draw(draw_curve, axes, legend, swept, x)


def basins(axes: Axes, swept: SweepTable, x: str, y: str, *, plant: str | None = None, legend: bool = True) -> Axes:
    """The motion that each initial state leads to, over the two columns of initial states of a sweep.

    By default it is that of the linear plant, or in MuJoCo if there is no other.
    """
    return _map(draw_basins, axes, legend, swept, x, y, plant)


def sway_path(axes: Axes, sway: Sway, *, legend: bool = True) -> Axes:
    """The path of a swaying point with its 95 % prediction ellipse."""
    return _draw(draw_path, axes, legend, sway)


def sway_diffusion(axes: Axes, sway: Sway, *, legend: bool = True) -> Axes:
    """Stabilogram diffusion: mean square displacement against time lag, with the lines at short and long times."""
    return _draw(draw_diffusion, axes, legend, sway)


def sway_spectrum(axes: Axes, sway: Sway, *, legend: bool = True) -> Axes:
    """Power spectra of measured sway; dotted: median frequencies."""
    return _draw(draw_spectra, axes, legend, sway)


def reaction_times(axes: Axes, found: Refractoriness, *, legend: bool = True) -> Axes:
    """Mean reaction times to first and second steps against the interval between them, with both regressions."""
    return _draw(draw_reactions, axes, legend, found)


def reconstruction(axes: Axes, found: Reconstruction, pair: int = 0, *, legend: bool = True) -> Axes:
    """The control around one pair of steps, and that of the linear model with the steps at the times that fit best."""
    return _draw(draw_reconstruction, axes, legend, found, pair)


def _case(results: tuple[Result, ...]) -> CaseRuns:
    cases = pair(results)
    if len(cases) > 1:
        names = ", ".join(case.name for case in cases)
        raise ReportError(f"results of different cases in one picture ({names}); draw each into axes of its own")
    return cases[0]


def _panel(draw: Callable[[Axes, CaseRuns], object], axes: Axes, results: tuple[Result, ...], legend: bool) -> Axes:
    return _draw(draw, axes, legend, _case(results))


def _draw(draw: Callable[..., object], axes: Axes, legend: bool, *of: object) -> Axes:
    draw(axes, *of)
    return _legend(axes, legend)


def _map(draw: Callable[..., object], axes: Axes, legend: bool, *of: object) -> Axes:
    """What has a legend of its own."""
    draw(axes, *of)
    if not legend and (drawn := axes.get_legend()) is not None:
        drawn.remove()
    return axes


def _under_noise(case: CaseRuns) -> CaseRuns:
    if all(result.statistics is None for result in case.runs.values()):
        raise ReportError(f"case {case.name!r}: no statistics, which only runs under noise have; see icmj.statistics")
    return case


def _output(case: CaseRuns, output: int | str) -> int:
    return _find_output("output", case.first.actual.outputs, output, case)


def _find_output(what: str, names: tuple[str, ...], wanted: int | str, case: CaseRuns) -> int:
    if wanted in names:
        return names.index(str(wanted))
    if isinstance(wanted, int) and -len(names) <= wanted < len(names):
        return wanted % len(names)
    raise ReportError(f"case {case.name!r}: no {what} {wanted!r}; expected one of {', '.join(names)}, or its number")


def _legend(axes: Axes, wanted: bool) -> Axes:
    """Above the axes, where it hides no data, in as many columns as there is room for."""
    entries = len(axes.get_legend_handles_labels()[0])
    for columns in range(min(4, entries), 0, -1) if wanted else ():
        look: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0, 1), "frameon": False, "borderaxespad": 0.2}
        legend = axes.legend(ncols=columns, **look)
        if legend.get_window_extent().width <= axes.bbox.width:
            break
    return axes
