"""The panels of one case: the paper's six (a)–(f), and further ones.

Panel (d): velocity against position for the latter part of the run, over the predicted orbit.

Panels (c) and (e): outputs and open-loop intervals against time.

Panel (f): the eigendecomposition χ of x̄ for the latter part of the run.

Panels (g) and (h): inputs that differ from the command, and the centre of pressure of a standing body.

Panel (i): the hold error from event to event under noise, beside the predicted orbit and its spread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, is_between
from icmj.case.laid_orbit import beside, lay_orbit
from icmj.case.motion import acting, curve, event_rows, latter_part, modes, output_rate, reduce_state, with_resets
from icmj.case.noise import spread_about
from icmj.case.quantity import Quantity, quantities
from icmj.errors import IcmjError, ReportError
from icmj.report import style
from icmj.report.case_runs import CaseRuns, compares, shown_interval
from icmj.report.loci import LOCUS, MODULUS
from icmj.report.panel import Panel
from icmj.simulation.pressure import Pressure
from icmj.simulation.simulation import Simulation
from icmj.theory.orbit import Orbit
from icmj.theory.spread import Spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from icmj.case.result import PredictedResult

SHOWN = 8  # intervals


def _draw_phase_panel(case: CaseRuns) -> Figure:
    count = case.last.actual.n_y
    if case.last.simulation.noisy and count > 1:  # on each other they would be a tangle
        figure, stack = style.new_figure(style.TALL, count)
        for output, axes in enumerate(stack):
            draw_phase(axes, case, [output])
            axes.set_xlabel(axes.get_xlabel() if axes is stack[-1] else "")
            axes.set_ylabel(
                quantities(case.last.actual)[output].label(style.words(case.last.actual.outputs[output]), "/s")
            )
        figure.align_ylabels(stack)
        style.link("plane", *stack)
        style.legend(figure, stack[0])
        return figure
    figure, (axes,) = style.new_figure(style.TALL if count > 1 else style.HEIGHT)
    draw_phase(axes, case)
    style.link("plane", axes)
    style.legend(figure, axes)
    return figure


def draw_phase(axes: Axes, case: CaseRuns, chosen: Sequence[int] = ()) -> None:
    """(d) Velocity against position of every output, or of those chosen, with the states at events marked."""
    outputs = case.last.actual.outputs
    chosen = chosen or range(len(outputs))
    prediction, laid = case.prediction, lay_orbit(case.last) if compares(case) else None
    units = quantities(case.last.actual)
    drawn = {plant: curve(result, *latter_part(result.simulation, SHOWN)) for plant, result in case.runs.items()}
    for i in chosen:
        name, shown, first = outputs[i], units[i], i == chosen[0]
        if laid is not None:
            y, v = (laid.whole(signal)[:, i] * shown.factor for signal in (laid.orbit.y, laid.rate))
            verdict = beside(prediction, case.last.measurement).verdict
            label = {"attracting": "predicted", "family": "predicted, of a family", "repelling": "repelling orbit"}.get(
                verdict, "not admissible"
            )
            axes.plot(y, v, label=label if first else None, **style.PREDICTED)
        for plant, result in case.runs.items():
            y, v = (signal[:, i] * shown.factor for signal in drawn[plant])
            axes.plot(y, v, label=style.NAME[plant] if first else None, **style.RUN[plant])
            if result is case.last and len(chosen) > 1 and len(y):
                _label(axes, style.words(name), float(y[np.nanargmax(v)]), float(np.nanmax(v)))
        _mark_events(axes, case.last, i, shown, first)
    axes.set(xlabel=_label_of("position $x_2$", units), ylabel=_label_of("velocity $x_1$", units, "/s"))
    if len(outputs) > 1:
        angles = units[0].unit == "deg" and len(set(units)) == 1
        words = ("segment angle", "segment velocity") if angles else ("output", "rate of the output")
        axes.set(xlabel=_label_of(words[0], units), ylabel=_label_of(words[1], units, "/s"))
    axes.margins(0.08)


def _label_of(words: str, units: tuple[Quantity, ...], per: str = "") -> str:
    """With the unit of all; outputs of several units share one scale of SI numbers and degrees."""
    return units[0].label(words, per) if len(set(units)) == 1 else f"{words} (each in its own unit)"


def _label(axes: Axes, name: str, y: float, v: float) -> None:
    behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
    axes.annotate(
        name, (y, v), xytext=(0, 4), textcoords="offset points", ha="center", style="italic", bbox=behind, zorder=6
    )


def _mark_events(axes: Axes, result: PredictedResult, output: int, shown: Quantity, named: bool) -> None:
    simulation = result.simulation
    start, end = latter_part(simulation, SHOWN)
    rows = event_rows(simulation)
    rows = rows[is_between(simulation.t[rows], start, end)]
    if not len(rows):
        return
    y = simulation.y[rows, output] * shown.factor
    v = output_rate(result, simulation.x[rows], simulation.u[rows])[:, output] * shown.factor
    if result.measurement.kind == "cycle" and len(result.actual.outputs) == 1:
        for n in range(-min(result.measurement.p or 0, len(y)), 0):
            axes.axvline(y[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
            axes.axhline(v[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
    axes.plot(
        y, v, "o", markersize=3.2, markerfacecolor="white", markeredgecolor="#222222", markeredgewidth=0.8,
        label="at events" if named else None, zorder=5,
    )  # fmt: skip


def _phase_caption(case: CaseRuns) -> str:
    each = ", one output in each" if case.last.simulation.noisy and case.last.actual.n_y > 1 else ""
    return f"Velocity against position in the last part of the run{each}; circles: states at events."


PHASE = Panel("d", _draw_phase_panel, _phase_caption)


LEAST = 1e-16  # relative error that is drawn of what agrees to the last digit


def _draw_outputs(case: CaseRuns) -> Figure:
    """(c) Outputs of the run and, if it is there, under continuous control against time, with events dotted."""
    figure = style.each_output(case.last.actual.n_y, lambda axes, i: draw_output(axes, case, i), "$t$ (s)")
    style.link("time", *figure.axes)
    return figure


def draw_output(axes: Axes, case: CaseRuns, output: int) -> None:
    """One output of the run and, if it is there, under continuous control against time, with events dotted."""
    top = case.last
    name, shown = top.actual.outputs[output], quantities(top.actual)[output]
    laid = lay_orbit(top) if case.prediction.cycle else None
    style.event_lines(axes, top.simulation.events.t)
    if laid is not None:
        whole = laid.whole(laid.orbit.y)[:, output] * shown.factor
        axes.axhspan(whole.min(), whole.max(), label="predicted range", **style.BAND)
    reach = 0.0
    for plant, result in case.runs.items():
        y = result.simulation.y[:, output] * shown.factor
        reach = max(reach, float(np.abs(y[np.isfinite(y)]).max(initial=0.0)))
        axes.plot(result.simulation.t, y, label=style.NAME[plant], **style.RUN[plant])
    reach = reach or 1.0
    if (continuous := _continuous(case)) is not None:
        y_c = continuous.y[:, output] * shown.factor
        # an unstable continuous controller would flatten everything else
        inside = np.where(np.abs(y_c) < 3 * reach, y_c, np.nan)
        axes.plot(continuous.t, inside, label="$y_c$", **style.CONTINUOUS)
    axes.set_ylim(-1.12 * reach, 1.12 * reach)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=shown.label(style.words(name) if top.actual.n_y > 1 else "$y$"))


def _continuous(case: CaseRuns) -> Simulation | None:
    """The run under continuous control: on MuJoCo if there, else on the linear plant, or none."""
    runs = (result.continuous for result in reversed(case.runs.values()))
    return next((run for run in runs if run is not None), None)


def _draw_intervals(case: CaseRuns) -> Figure:
    if not _settles(case):
        figure, (axes,) = style.new_figure()
        draw_intervals(axes, case)
        style.link("time", axes)
        style.legend(figure, axes)
        return figure
    figure, (axes, strip) = style.new_figure(style.MIDDLE, shares=(2.2, 1))
    draw_intervals(axes, case)
    draw_interval_errors(strip, case)
    axes.set_xlabel("")
    figure.align_ylabels([axes, strip])
    style.link("time", axes, strip)
    style.legend(figure, axes)
    return figure


def _settles(case: CaseRuns) -> bool:
    return case.prediction.cycle and not case.first.simulation.noisy


def draw_intervals(axes: Axes, case: CaseRuns) -> None:
    """(e) Open-loop interval at each event against time, Δ_crit dotted where it is to be compared with."""
    delta_crit = shown_interval(case)
    largest = 0.0 if delta_crit is None else delta_crit
    for plant, result in case.runs.items():
        events = result.simulation.events
        if len(events):
            largest = max(largest, float(events.interval.max()))
        look = {**style.RUN[plant], **style.MARK[plant], "linewidth": 0.6 if len(events) <= style.CROWDED else 0.3}
        if len(events) > style.CROWDED:
            look["markersize"] *= 0.6
        axes.plot(events.t, events.interval, label=style.NAME[plant], **look)
    if delta_crit is not None:
        axes.axhline(delta_crit, label=rf"$\Delta_{{crit}}={delta_crit:.4g}$ s", **style.CRITICAL)
    axes.set(
        xlim=(0, float(case.last.simulation.t[-1])),
        ylim=(0, 1.15 * largest or 1.0),
        xlabel="$t$ (s)",
        ylabel=r"$\Delta_{ol}$ (s)",
    )


def draw_interval_errors(axes: Axes, case: CaseRuns) -> None:
    """Magnitude of the relative error of each open-loop interval with respect to Δ_crit, on a logarithmic axis.

    Raises:
        ReportError: if there is no Δ_crit.
    """
    delta = case.prediction.delta_crit
    if delta is None:
        raise ReportError(f"case {case.name!r}: no Δ_crit, which errors of intervals are relative to")
    for plant, result in case.runs.items():
        events, look = result.simulation.events, dict(style.MARK[plant])
        look["markersize"] *= 0.6
        error = np.maximum(np.abs(events.interval / delta - 1), LEAST)
        axes.plot(events.t, error, linestyle="none", label=style.NAME[plant], **look)
    style.residual(axes, "rel. error")
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)")


def _output_caption(case: CaseRuns) -> str:
    several = "s" if len(case.first.actual.outputs) > 1 else ""
    band = " Faint band: predicted range." if case.prediction.cycle else ""
    beside = ", and under continuous control of the same design (y_c)" if _continuous(case) is not None else ""
    return f"Output{several} under intermittent control on each plant{beside}; dotted: events.{band}"


def _interval_caption(case: CaseRuns) -> str:
    dotted = ""
    if shown_interval(case) is not None:
        predicted = "predicted interval Δ_crit" if case.prediction.cycle else "Δ_crit, at which no cycle is predicted"
        dotted = f"; dotted: {predicted}"
    beneath = ". Beneath: magnitude of the relative error, |Δ_ol/Δ_crit − 1|" if _settles(case) else ""
    return f"Open-loop interval Δ_ol that ends at each event{dotted}{beneath}."


OUTPUTS = Panel("c", _draw_outputs, _output_caption)
INTERVALS = Panel("e", _draw_intervals, _interval_caption)


SHOWN_MODES = 6  # intervals


def _draw_mode_panel(case: CaseRuns) -> Figure:
    """(f) χ_k1 and the norm of the other elements of χ against time, events and ±γ dotted.

    Where χ is undefined (no Δ_crit), the norm of x̄ is drawn instead.
    """
    if case.prediction.V_inv is None:
        figure, (axes,) = style.new_figure()
        draw_norm(axes, case)
        style.link("time", axes)
        style.legend(figure, axes)
        return figure
    settles = case.prediction.cycle and not case.first.simulation.noisy
    if settles:
        figure, stack = style.new_figure(style.MIDDLE, shares=(1.2, 1.2, 1))
        draw_mode_errors(stack[2], case)
    else:
        figure, stack = style.new_figure(rows=2)
    critical, others = stack[:2]
    draw_critical(critical, case)
    draw_others(others, case)
    for axes in stack[:-1]:
        axes.set_xlabel("")
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, critical)
    return figure


def draw_critical(axes: Axes, case: CaseRuns) -> None:
    """The critical mode χ_k1 over the latter part of the runs, its prediction, ±γ and events dotted.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    _draw_modes(axes, case, lambda chi: chi[:, 0].real)
    if case.prediction.gamma is not None and compares(case):
        for n, sign in enumerate((1, -1)):
            axes.axhline(sign * case.prediction.gamma, label=r"$\pm\gamma$" if n == 0 else None, **style.CRITICAL)
    axes.set_ylabel(r"$\chi_{k_1}$")


def draw_others(axes: Axes, case: CaseRuns) -> None:
    """The norm of the other modes over the latter part of the runs, its prediction, events dotted.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    _draw_modes(axes, case, lambda chi: np.linalg.norm(chi[:, 1:], axis=1))
    axes.set_ylabel(r"$\|\chi_{k\neq k_1}\|$")
    axes.set_ylim(bottom=0)


def draw_mode_errors(axes: Axes, case: CaseRuns) -> None:
    """Magnitude of the relative error of |χ_k1| at the last events with respect to γ, on a logarithmic axis.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    gamma = case.prediction.gamma
    if gamma is None or case.prediction.V_inv is None:
        raise ReportError(f"case {case.name!r}: χ and γ are undefined without Δ_crit")
    start, end = latter_part(case.last.simulation, SHOWN_MODES)
    for plant, result in case.runs.items():
        events = result.simulation.events
        late = is_between(events.t, start, end)
        chi = modes(result, reduce_state(result, events.x[late], events.x_o[late], events.x_h[late]))[:, 0]
        error = np.maximum(np.abs(np.abs(chi) / gamma - 1), LEAST)
        axes.plot(events.t[late], error, linestyle="none", label=style.NAME[plant], **style.MARK[plant])
    style.residual(axes, "rel. error")
    axes.set(xlim=(start, end), xlabel="$t$ (s)")


def draw_norm(axes: Axes, case: CaseRuns) -> None:
    """The norm of x̄ on a logarithmic scale, events dotted; it is drawn if χ is undefined."""
    style.event_lines(axes, case.last.simulation.events.t)
    for plant, result in case.runs.items():
        simulation = result.simulation
        norm = np.linalg.norm(reduce_state(result, simulation.x, simulation.x_o, simulation.x_h), axis=1)
        axes.semilogy(simulation.t, np.maximum(norm, 1e-300), label=style.NAME[plant], **style.RUN[plant])
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)", ylabel=r"$\|\bar{x}\|$  ($\chi$ undefined)")


def _draw_modes(axes: Axes, case: CaseRuns, part: Callable[[NDArray[np.complex128]], Array]) -> None:
    """A part of χ, shape (N, n + n̂) → (N,), for the latter part of every run."""
    if case.prediction.V_inv is None:
        raise ReportError(f"case {case.name!r}: χ is undefined without Δ_crit; draw the norm of x̄ instead")
    top = case.last
    start, end = latter_part(top.simulation, SHOWN_MODES)
    events = top.simulation.events.t
    style.event_lines(axes, events[is_between(events, start, end)])
    laid = lay_orbit(top) if case.prediction.cycle else None
    if laid is not None:
        t = laid.times(start, end)
        axes.plot(t, part(modes(top, laid.at(t, laid.reduced))), label="predicted", **style.PREDICTED)
    for plant, result in case.runs.items():
        simulation = result.simulation
        late = is_between(simulation.t, start, end)
        chi = modes(result, reduce_state(result, simulation.x[late], simulation.x_o[late], simulation.x_h[late]))
        axes.plot(simulation.t[late], part(chi), label=style.NAME[plant], **style.RUN[plant])
    axes.locator_params(axis="y", nbins=4, steps=[1, 2, 5, 10])
    axes.set_xlim(start, end)
    axes.set_xlabel("$t$ (s)")


def _modes_caption(case: CaseRuns) -> str:
    if case.prediction.V_inv is None:
        return (
            "Norm of x̄, the states of the plant and the errors of the observer; dotted: events. There is no Δ_crit, so "
            "the modes χ are undefined."
        )
    beneath = ""
    if case.prediction.cycle and not case.first.simulation.noisy:
        beneath = " Beneath: relative error of the magnitude of χ_k1 at events with respect to γ."
    orbit = "" if case.prediction.cycle else f" on the {case.prediction.verdict} orbit of Δ_crit"
    gamma = (
        f", and ±γ, the {'predicted ' if not orbit else ''}values of χ_k1 at events{orbit}" if compares(case) else ""
    )
    return (
        "Critical mode χ_k1, the coordinate of the state along the eigenvector of λ_crit, and norm of the other modes "
        f"in the last part of the run; dotted: events{gamma}.{beneath}"
    )


MODES = Panel("f", _draw_mode_panel, _modes_caption)


MM = 1e3


def acting_inputs(case: CaseRuns) -> list[int]:
    """Inputs whose action differs from the command."""
    return sorted({i for result in case.runs.values() for i in acting(result)})


def _draw_acting(case: CaseRuns) -> Figure:
    """(g) Command and what acts, of every input where they differ; under noise the latter part."""
    inputs = acting_inputs(case)
    figure, stack = style.new_figure(style.TALL if len(inputs) > 1 else style.HEIGHT, len(inputs))
    for axes, i in zip(stack, inputs, strict=True):
        draw_acting(axes, case, i)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
        if len(inputs) > 1:  # names of inputs are longer than axes are high
            name, _, unit = axes.get_ylabel().partition(" (")
            axes.set_ylabel(f"({unit}" if unit else "")
            axes.text(0.01, 0.98, name, transform=axes.transAxes, va="top", style="italic")
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


def draw_acting(axes: Axes, case: CaseRuns, i: int) -> None:
    """Command and what acts on one input; under noise the latter part."""
    plant = case.last.actual
    result = next(r for r in reversed(case.runs.values()) if i in acting(r))
    simulation, after = result.simulation, result.simulation.u_after(result.controller)
    t, command = with_resets(simulation, simulation.u[:, i : i + 1], after[:, i : i + 1])
    axes.plot(t, command, label="command $u$", **style.CONTINUOUS)
    axes.plot(simulation.t, simulation.applied[:, i], label="what acts", **style.RUN[simulation.plant])
    axes.margins(x=0)
    if simulation.noisy:
        axes.set_xlim(*latter_part(simulation, SHOWN))
    unit = plant.input_units[i] if plant.input_units else ""
    name = style.words(plant.inputs[i]) if len(acting_inputs(case)) > 1 else "$u$"
    axes.set(xlabel="$t$ (s)", ylabel=f"{name} ({unit})" if unit else name)


def _standing(case: CaseRuns) -> dict[str, tuple[Simulation, Pressure]]:
    runs = {plant: result.simulation for plant, result in case.runs.items()}
    return {plant: (run, run.pressure) for plant, run in runs.items() if run.pressure is not None}


def _draw_pressure(case: CaseRuns) -> Figure:
    """(h) Centre of pressure against time, its place at rest dotted."""
    names = pressed_axes(case) or ["x"]
    figure, stack = style.new_figure(style.TALL if len(names) > 1 else style.HEIGHT, len(names))
    for axes, name in zip(stack, names, strict=True):
        draw_pressure(axes, case, name)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


def pressed_axes(case: CaseRuns) -> list[str]:
    """The axes, of x and y, along which the centre of pressure moves; none without a floor."""
    return sorted({axis for _, pressure in _standing(case).values() for axis in pressure.axes})


def draw_pressure(axes: Axes, case: CaseRuns, axis: str) -> None:
    """Centre of pressure along one axis, x or y, against time, its place at rest dotted."""
    i = "xy".index(axis)
    for plant, (run, pressure) in _standing(case).items():
        t, centre = run.t, pressure.centre
        if len(pressure.t_after):
            t, centre = with_resets(run, centre, pressure.centre_after)
        axes.plot(t, MM * centre[:, i], label=style.NAME[plant], **style.RUN[plant])
    axes.axhline(MM * pressure.at_rest[i], label="at rest", **style.CRITICAL)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=f"centre of pressure, ${axis}$ (mm)")


def _acting_caption(case: CaseRuns) -> str:
    limits = any(float(r.simulation.precision.get("saturated_share", 0.0)) > 0 for r in case.runs.values())
    reason = "is limited by the actuators" if limits else "includes the disturbance"
    return f"Command of the controller, and the input that acts on the plant, which {reason}."


def _pressure_caption(case: CaseRuns) -> str:
    *_, (_, pressure) = _standing(case).values()
    return f"Centre of pressure; {pressure.words[-1]}."


ACTING = Panel("g", _draw_acting, _acting_caption, lambda case: bool(acting_inputs(case)))
PRESSURE = Panel("h", _draw_pressure, _pressure_caption, lambda case: bool(_standing(case)))


WITHIN = 2  # SD that the band around the predicted hold error has on either side


def _draw_hold_error_panel(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    draw_hold_error(axes, case)
    style.legend(figure, axes)
    return figure


def draw_hold_error(axes: Axes, case: CaseRuns) -> None:
    """(i) Size of the hold error in thresholds over the time since the event, in each of the last intervals.

    With the predicted orbit, which under noise has its spread where that is predicted.

    Raises:
        ReportError: if no run has a complete interval.
    """
    drawn = {plant: _hold_errors(result) for plant, result in case.runs.items()}
    if not any(drawn.values()):
        raise ReportError(f"case {case.name!r}: no complete interval, over which the hold error could be drawn")
    orbit = beside(case.prediction, case.last.measurement).orbit if compares(case) else None
    if orbit is not None and np.isfinite(orbit.gamma):
        size = _size_of(case.last, orbit.e_hp)
        if (spread := _spread_about(case, orbit)) is not None:
            # with a delay the orbit jumps at the action, where the band begins
            middle, off = np.interp(spread.t, orbit.t, size), WITHIN * spread.hold_error
            axes.fill_between(spread.t, np.maximum(middle - off, 0), middle + off, label=f"± {WITHIN} SD", **style.BAND)
        axes.plot(orbit.t, size, label="predicted", color="#222222", linewidth=1.1, zorder=3)
    for plant, lines in drawn.items():
        look = {**style.RUN[plant], "linewidth": 0.6}
        for n, (tau, size) in enumerate(lines):
            axes.plot(tau, size, label=None if n else style.NAME[plant], **look)
    axes.axhline(1, label="threshold", **style.CRITICAL)
    axes.set(xlabel="time since the event (s)", ylabel="hold error (thresholds)")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)


def _hold_errors(result: PredictedResult) -> list[tuple[Array, Array]]:
    """Times since the event and sizes of the hold error, over each of the last intervals."""
    run, found = result.simulation, []
    events, before = run.events, _size_of(result, run.x_h - run.x_o)
    late = bool(run.delay)  # then the event itself resets nothing
    for k in range(max(len(events) - 1 - SHOWN, 0), len(events) - 1):
        rows = (run.t > events.t[k]) & (run.t < events.t[k + 1])
        first, last = (_size_of(result, events.x_h[i : i + 1] - events.x_o[i : i + 1]) for i in (k, k + 1))
        size = np.concatenate([first if late else 0 * first, before[rows], last])
        found.append((np.concatenate([[events.t[k]], run.t[rows], [events.t[k + 1]]]) - events.t[k], size))
    return found


def _size_of(result: PredictedResult, e: Array) -> Array:
    """The size of hold errors (M, n̂) on the face on which it is largest, in thresholds, shape (M,)."""
    faces = result.controller.faces
    return np.sqrt(faces.squares(e @ faces.R.T).max(axis=1))


def _spread_about(case: CaseRuns, orbit: Orbit) -> Spread | None:
    """The spread about an orbit under the noise of the runs; ``None`` without noise or where none is predicted."""
    if not case.last.simulation.noisy:
        return None
    with suppress(IcmjError):
        return spread_about(case.last, orbit)
    return None


def _hold_error_caption(case: CaseRuns) -> str:
    orbit = beside(case.prediction, case.last.measurement).orbit if compares(case) else None
    beneath = ""
    if orbit is not None:
        beneath = "; black: the predicted orbit"
        if _spread_about(case, orbit) is not None:
            beneath += f", with a band of {WITHIN} predicted standard deviations on either side"
    return (
        "Size of the hold error, in thresholds, over the time since the event, in each of the last intervals; dotted: "
        f"the threshold, at which the next event comes{beneath}."
    )


HOLD_ERROR = Panel(
    "i", _draw_hold_error_panel, _hold_error_caption,
    lambda case: case.last.simulation.noisy and any(_hold_errors(result) for result in case.runs.values()),
)  # fmt: skip


PANELS: tuple[Panel, ...] = (MODULUS, LOCUS, OUTPUTS, PHASE, INTERVALS, MODES)
"""The paper's, of every case, in the order of their letters."""
MORE: tuple[Panel, ...] = (ACTING, PRESSURE, HOLD_ERROR)
"""Those of cases that have what they show."""


__all__ = ["MORE", "PANELS", "Panel"]
