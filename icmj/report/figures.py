"""Figures of a case beside its panels: eigenvalues, amplitude law, noise, sway, several controllers.

Panels (a) and (b): the eigenvalues of φ(Δ_ol), their largest magnitude and their loci.

The figure of the amplitude law: departures from the linear prediction against the threshold.

The figures of a case under noise: histogram of intervals, spectra of outputs, the predicted cycle in both.

Figures of measured sway: the path with its prediction ellipse, stabilogram diffusion, spectra.

The figures of several controllers of one body: spectra of the outputs, and their paths, on each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import between, steps_in
from icmj.case.motion import curve
from icmj.case.quantity import in_unit, quantities, shared_unit, threshold_unit
from icmj.case.result import AmplitudeLaw, Result, has_prediction
from icmj.errors import DataError, ReportError
from icmj.measurement.stabilogram import Diffusion
from icmj.measurement.sway import Sway, measure_sway
from icmj.plant.linear_plant import LinearPlant
from icmj.report import style
from icmj.report.wording import CaseRuns, Panel
from icmj.series.series import Series
from icmj.theory.error_system import Locus, error_system, locus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Spectrum = NDArray[np.complex128]

POINTS = 512
SHADES = 14  # steps of the colour scale of Δ_ol along a locus
REACH = 1.3  # half height of panel (b): the unit circle and its surroundings


def _draw_modulus(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    draw_modulus(axes, case)
    style.legend(figure, axes)
    return figure


def draw_modulus(axes: Axes, case: CaseRuns) -> None:
    """(a) Largest |λ| of φ against Δ_ol for ρ = 0 and ρ = 1, and the growth measured under the clock."""
    prediction = case.prediction
    actual, exact = shown_locus(case, case.first.actual), shown_locus(case, case.first.assumed)
    axes.axhline(1, **style.CRITICAL)
    axes.plot(actual.delta, actual.largest, label=r"$\rho=1$", **style.ACTUAL)
    axes.plot(exact.delta, exact.largest, label=r"$\rho=0$", **style.EXACT)
    for plant, result in case.runs.items():
        if result.growth is not None:
            growth = result.growth
            axes.plot(growth.delta, growth.measured, linestyle="none", label=style.NAME[plant], **style.MARK[plant])
    if prediction.delta_crit is not None:
        axes.axvline(prediction.delta_crit, **style.CRITICAL)
        axes.annotate(
            rf"$\Delta_{{crit}}={prediction.delta_crit:.4g}$ s",
            (prediction.delta_crit, 0.93),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )
    top = max(1.15, min(1.6, 1.1 * float(actual.largest.max())))
    axes.set(xlim=(0, actual.delta[-1]), ylim=(0, top))
    axes.set(xlabel=r"$\Delta_{ol}$ (s)", ylabel=r"$\max_j\,|\lambda_j(\varphi)|$")


def _draw_locus(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    box = axes.get_position()
    axes.set_position((box.x0, box.y0, box.width * 0.84, box.height))
    draw_locus(axes, case)
    draw_scale(figure.add_axes((box.x0 + box.width * 0.875, box.y0, box.width * 0.03, box.height)), case)
    style.legend(figure, axes)
    return figure


def draw_locus(axes: Axes, case: CaseRuns) -> None:
    """(b) Eigenvalues of φ in the complex plane as Δ_ol grows, about the unit circle."""
    prediction = case.prediction
    shown = shown_locus(case, case.first.actual)
    shades = _shades()
    chunks = np.array_split(np.arange(len(shown.delta)), SHADES)
    for branch in shown.eigenvalues.T:
        near = np.where(np.maximum(abs(branch.real), abs(branch.imag)) < 4, branch, np.nan)
        for chunk, shade in zip(chunks, shades, strict=True):
            part = near[chunk[0] : chunk[-1] + 2]
            if np.isfinite(part).any():
                axes.plot(part.real, part.imag, color=shade, linewidth=1.2)
        _arrow(axes, branch, shades, chunks)
    angle = np.linspace(0, 2 * np.pi, 181)
    axes.plot(np.cos(angle), np.sin(angle), color="#333333", linewidth=0.6, zorder=1)
    axes.axhline(0, color="#cccccc", linewidth=0.4, zorder=0)
    axes.axvline(0, color="#cccccc", linewidth=0.4, zorder=0)
    if prediction.delta_crit is not None and prediction.eigenvalue is not None:
        at = _eigenvalues_at(case, prediction.delta_crit)
        all_name, name = r"all $\lambda_j$ at $\Delta_{crit}$", rf"$\lambda_{{crit}}={prediction.eigenvalue.real:+.0f}$"
        axes.plot(at.real, at.imag, label=all_name, **style.EIGENVALUE)
        axes.plot(prediction.eigenvalue.real, prediction.eigenvalue.imag, label=name, **style.CRITICAL_EIGENVALUE)
    width, height = axes.get_window_extent().size
    axes.set(xlim=(-REACH * width / height, REACH * width / height), ylim=(-REACH, REACH))
    axes.set(xlabel=r"$\mathrm{Re}\,\lambda$", ylabel=r"$\mathrm{Im}\,\lambda$", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    axes.set_aspect("equal")  # whatever becomes of the figure


def shown_locus(case: CaseRuns, plant: LinearPlant) -> Locus:
    """The eigenvalues with ``plant`` in the loop, from Δ = 0 to somewhat beyond Δ_crit."""
    controller, end = case.first.controller, _last_interval(case)
    system = error_system(plant, controller.design, controller.hold, delay=controller.delay, match="position")
    found = locus(system, end, points=POINTS)
    if controller.delay:
        return found  # from the delay on
    # φ(0) is the identity
    eigenvalues = np.vstack([np.ones((1, found.eigenvalues.shape[1])), found.eigenvalues])
    return Locus(np.append(0.0, found.delta), eigenvalues)


def _last_interval(case: CaseRuns) -> float:
    prediction = case.prediction
    if prediction.delta_crit is None:
        return prediction.delta_max
    return min(prediction.delta_max, 1.6 * prediction.delta_crit)


def _eigenvalues_at(case: CaseRuns, delta: float) -> Spectrum:
    controller = case.first.controller
    phi = error_system(
        case.first.actual, controller.design, controller.hold, delay=controller.delay, match="position"
    ).phi(delta)
    return np.linalg.eigvals(phi).astype(complex)


def _shades() -> list[tuple[float, ...]]:
    from matplotlib import colormaps

    return [tuple(shade) for shade in colormaps["cividis"](np.linspace(0.9, 0.0, SHADES))]


def draw_scale(bar: Axes, case: CaseRuns) -> None:
    """The colour scale of Δ_ol along the loci, in separate axes."""
    from matplotlib.ticker import MaxNLocator

    end = _last_interval(case)
    step = end / SHADES
    bar.bar(0, step * 1.02, width=1, bottom=step * np.arange(SHADES), color=_shades(), linewidth=0)
    bar.set(xlim=(-0.5, 0.5), ylim=(0, end), xticks=[])
    bar.set_ylabel(r"$\Delta_{ol}$ (s)", labelpad=2)
    bar.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.spines[:].set_visible(False)


def _arrow(axes: Axes, branch: Spectrum, shades: list[tuple[float, ...]], chunks: list[NDArray[Any]]) -> None:
    """An arrowhead half-way along the visible part of the branch, pointing to growing Δ."""
    step = np.abs(np.diff(branch))
    near = (np.abs(branch.imag[:-1]) < REACH) & (np.abs(branch.real[:-1]) < 1.3 * REACH) & (step < 0.3)
    travelled = np.cumsum(np.where(near, step, 0))
    if travelled[-1] < 0.25:
        return
    i = int(np.searchsorted(travelled, 0.5 * travelled[-1]))
    direction = branch[i + 1] - branch[i]
    head = branch[i] + 0.02 * direction / abs(direction)
    shade = shades[next(n for n, chunk in enumerate(chunks) if i <= chunk[-1])]
    look = {"arrowstyle": "-|>", "color": shade, "lw": 0.8, "mutation_scale": 6.5, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (head.real, head.imag), (branch[i].real, branch[i].imag), arrowprops=look)


def _modulus_caption(case: CaseRuns) -> str:
    measured = any(result.growth is not None for result in case.runs.values())
    points = " Points: growth measured in clock-driven simulations." if measured else ""
    return (
        "Largest magnitude of the eigenvalues λ of φ(Δ_ol), which maps the state at one event to the next, against a "
        f"constant interval Δ_ol; with the changes of the plant (ρ = 1) and without (ρ = 0).{points}"
    )


def _locus_caption(case: CaseRuns) -> str:
    return "Eigenvalues λ of φ(Δ_ol) near the unit circle, coloured by Δ_ol; arrowheads point towards longer intervals."


MODULUS = Panel("a", _draw_modulus, _modulus_caption)
LOCUS = Panel("b", _draw_locus, _locus_caption)


def law_figure(result: Result) -> Figure:
    """The figure of :func:`draw_law`, of a result that has a law."""
    figure, (axes,) = style.new_figure()
    assert result.law is not None
    draw_law(axes, result.law, threshold_unit(result))
    style.legend(figure, axes)
    return figure


def draw_law(axes: Axes, law: AmplitudeLaw, unit: str = "") -> None:
    """Relative errors of interval and amplitude against the threshold on logarithmic axes, with the fitted lines."""
    for values, slope, name, colour, marker in (
        (law.interval_error, law.interval_slope, "interval", "#0072b2", "o"),
        (law.amplitude_error, law.amplitude_slope, "amplitude", "#d55e00", "s"),
    ):
        size = np.abs(values)
        known = np.isfinite(size) & (size > 0)
        if not known.any():
            continue
        threshold, size = law.q_t[known], size[known]
        # the fitted line has the given slope and passes through the points' centre
        level = np.exp(np.mean(np.log(size)) - slope * np.mean(np.log(threshold)))
        span = np.geomspace(threshold.min() / 1.5, threshold.max() * 1.5, 2)
        axes.loglog(span, level * span**slope, color=colour, linewidth=0.8, linestyle=(0, (5, 1.5)))
        axes.loglog(
            threshold, size, marker, markersize=4, color=colour, markerfacecolor="white", markeredgewidth=1.0,
            label=f"{name}, slope {slope:.3f}",
        )  # fmt: skip
    axes.set(xlabel=in_unit("threshold", unit), ylabel="relative error")


FASTEST = 10.0  # [Hz] drawn: a body this heavy sways no faster
LOWEST = 1e-6  # of the largest density drawn


def histogram_figure(case: CaseRuns) -> Figure:
    """The figure of :func:`draw_histogram`."""
    figure, (axes,) = style.new_figure()
    draw_histogram(axes, case)
    style.legend(figure, axes)
    return figure


def draw_histogram(axes: Axes, case: CaseRuns) -> None:
    """Density of the open-loop intervals on each plant; predicted Δ_crit dotted, the least interval dashed."""
    for plant, result in case.runs.items():
        found = result.statistics
        if found is not None and len(found.counts):
            density = found.counts / (found.counts.sum() * np.diff(found.edges))
            axes.stairs(density, found.edges, label=style.NAME[plant], **_line(plant))
    least = case.first.simulation.least
    if least > 0:
        axes.axvline(least, label=rf"least, {least:.3g} s", **style.EXACT)
    if case.prediction.cycle and case.prediction.delta_crit is not None:
        name = rf"$\Delta_{{crit}}={case.prediction.delta_crit:.4g}$ s"
        axes.axvline(case.prediction.delta_crit, label=name, **style.CRITICAL)
    axes.set(xlabel=r"$\Delta_{ol}$ (s)", ylabel="density (1/s)")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)


def spectrum_figure(case: CaseRuns) -> Figure:
    """Power spectrum of every output on each plant, one axes for each."""
    return style.each_output(case.first.actual.n_y, lambda axes, i: draw_spectrum(axes, case, i), "frequency (Hz)")


def draw_spectrum(axes: Axes, case: CaseRuns, output: int) -> None:
    """Power spectrum of one output on each plant, confidence of the last, and the predicted cycle's frequency."""
    name, shown = case.first.actual.outputs[output], quantities(case.first.actual)[output]
    largest = 0.0
    for plant, result in case.runs.items():
        if result.statistics is None:
            continue
        spectrum = result.statistics.spectrum
        drawn = (spectrum.frequency > 0) & between(spectrum.frequency, 0.0, FASTEST)
        frequency = spectrum.frequency[drawn]
        power, low, high = (
            values[drawn, output] * shown.factor**2 for values in (spectrum.power, spectrum.low, spectrum.high)
        )
        largest = max(largest, float(power.max(initial=0.0)))
        if result is case.last:
            axes.fill_between(frequency, low, high, label="95 %", **style.BAND)
        axes.loglog(frequency, power, label=style.NAME[plant], **style.RUN[plant])
    if case.prediction.cycle and case.prediction.period is not None:
        axes.axvline(1 / case.prediction.period, label="predicted cycle", **style.CRITICAL)
    axes.set_ylim(bottom=LOWEST * (largest or 1.0))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(shown.label(style.words(name) if case.first.actual.n_y > 1 else "power", "²/Hz"))


def _line(plant: str) -> dict[str, Any]:
    return {key: style.RUN[plant][key] for key in ("color", "linewidth")}


LOWEST_POWER = 1e-7  # of the largest density drawn
# Okabe-Ito, one for each signal
COLOURS = ("#0072b2", "#d55e00", "#007a55", "#cc79a7", "#56b4e9", "#e69f00")


def draw_path(axes: Axes, sway: Sway) -> None:
    """The path in the plane, the second coordinate against the first, with the 95 % prediction ellipse.

    Raises:
        ReportError: if the sway is not one in a plane.
    """
    plane = sway.plane
    if plane is None:
        raise ReportError("a path needs two signals of the same unit; measure two")
    axes.plot(*sway.series.values.T, color="#56b4e9", linewidth=0.6, label="path")
    axes.plot(*plane.ellipse.outline().T, color="#222222", linewidth=1.0, label="95 % prediction ellipse")
    axes.set_aspect("equal")
    axes.set(
        **{f"{axis}label": _label(style.words(name), plane.unit) for axis, name in zip("xy", plane.names, strict=True)}
    )


def draw_diffusion(axes: Axes, sway: Sway) -> None:
    """Mean square displacement against time on logarithmic axes, with both exponents H, of each coordinate."""
    named: list[tuple[str, Diffusion]] = [(c.name, c.diffusion) for c in sway.coordinates]
    if sway.plane is not None:
        named.append(("plane", sway.plane.diffusion))
    for (name, found), colour in zip(named, _colours(len(named)), strict=True):
        moved = found.displacement > 0
        if not moved.any():
            continue
        exponents = ", ".join("–" if part is None else f"{part.H:.2f}" for part in (found.short, found.long))
        label = f"{style.words(name)}, H = {exponents}"
        axes.loglog(found.lag[moved], found.displacement[moved], color=colour, linewidth=1.4, label=label)
        for part in (found.short, found.long):
            if part is not None:
                span = np.array([part.start, part.end])
                inside = between(found.lag, part.start, part.end)
                # a line of slope 2H through the middle of what it was fitted to
                middle = [np.log(values[inside]).mean() for values in (found.lag, found.displacement)]
                axes.loglog(span, np.exp(middle[1] + 2 * part.H * (np.log(span) - middle[0])), **style.CRITICAL)
    units = {c.unit for c in sway.coordinates}
    unit = f" ({units.pop()}²)" if len(units) == 1 and "" not in units else ""
    axes.set(xlabel=r"$\Delta t$ (s)", ylabel=rf"$\langle\Delta x^2\rangle${unit}")


def draw_spectra(axes: Axes, sway: Sway) -> None:
    """Power spectrum of each coordinate on logarithmic axes; dotted: its median frequency."""
    found = sway.spectrum
    drawn = found.frequency > 0
    for c, power, colour in zip(sway.coordinates, found.power.T, _colours(len(sway.coordinates)), strict=True):
        axes.loglog(found.frequency[drawn], power[drawn], color=colour, linewidth=1.2, label=style.words(c.name))
        if np.isfinite(c.frequencies.median):
            axes.axvline(c.frequencies.median, color=colour, linewidth=0.8, linestyle=(0, (1, 1.6)))
    largest = float(found.power[drawn].max(initial=0.0))
    if largest > 0:
        axes.set_ylim(bottom=LOWEST_POWER * largest)
    units = {c.unit for c in sway.coordinates}
    unit = f" ({units.pop()}²/Hz)" if len(units) == 1 and "" not in units else ""
    axes.set(xlabel="frequency (Hz)", ylabel=f"power{unit}")


def _colours(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


RATE, FASTEST_RIVAL = 100.0, 10.0  # Hz: of the samples, and drawn
SHOWN = 20.0  # s of a path
LONGEST = 20.0  # s that are drawn, the last of the run: more is a smear


@dataclass(frozen=True, eq=False)
class Rival:
    """One controller of a body: its run, what it is called, and the sway over the second half of the run."""

    name: str
    run: Result
    sway: Sway


def rivals(runs: Sequence[Result]) -> list[list[Rival]]:
    """Runs of one body on one plant under several controllers, one of which at least has no prediction."""
    groups: list[list[Result]] = []
    for run in runs:
        group = next((group for group in groups if _same_body(group[0], run)), None)
        if group is None:
            groups.append(group := [])
        group.append(run)
    found = [[rival for run in group if (rival := _rival(run)) is not None] for group in groups]
    return [group for group in found if len(group) > 1 and not all(has_prediction(rival.run) for rival in group)]


def _same_body(one: Result, other: Result) -> bool:
    a, b = one.actual, other.actual
    if one.simulation.plant != other.simulation.plant or (a.n, a.n_u, a.outputs) != (b.n, b.n_u, b.outputs):
        return False
    return all(np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in ((a.A, b.A), (a.B, b.B), (a.C, b.C)))


def _rival(run: Result) -> Rival | None:
    """The controller's entry; ``None`` if the run is too short or not finite."""
    simulation, shown = run.simulation, quantities(run.actual)
    start, end = float(simulation.t[-1]) / 2, float(simulation.t[-1])
    t = start + np.arange(steps_in((end - start) * RATE)) / RATE
    if not np.isfinite(simulation.y).all() or not len(t):
        return None
    columns = zip(simulation.y.T, shown, strict=True)
    values = np.column_stack([unit.factor * np.interp(t, simulation.t, y) for y, unit in columns])
    series = Series(t, values, run.actual.outputs, tuple(unit.unit for unit in shown))
    try:
        return Rival(run.run.title, run, measure_sway(series))
    except DataError:
        return None


def spectra_figure(group: Sequence[Rival]) -> Figure:
    """Power spectrum of every output under each controller."""
    coordinates = group[0].sway.coordinates

    def draw(axes: Axes, i: int) -> None:
        largest = 0.0
        for n, rival in enumerate(group):
            found = rival.sway.spectrum
            drawn = (found.frequency > 0) & between(found.frequency, 0.0, FASTEST_RIVAL)
            power = found.power[drawn, i]
            largest = max(largest, float(power.max(initial=0.0)))
            axes.loglog(
                found.frequency[drawn],
                power,
                color=COLOURS[n % len(COLOURS)],
                linewidth=1.2,
                label=_rival_label(group, n),
            )
        c = coordinates[i]
        axes.set_ylim(bottom=LOWEST_POWER * (largest or 1.0))
        axes.set_ylabel(f"{style.words(c.name)}{f' ({c.unit}²/Hz)' if c.unit else ''}")

    return style.each_output(len(coordinates), draw, "frequency (Hz)", 6)


def paths_figure(group: Sequence[Rival]) -> Figure:
    """Rate against value of every output under each controller, over the last seconds."""
    plant = group[0].run.actual
    ends = [float(rival.run.simulation.t[-1]) for rival in group]
    paths = [curve(rival.run, end - SHOWN, end) for rival, end in zip(group, ends, strict=True)]

    def draw(axes: Axes, i: int) -> None:
        shown = quantities(plant)[i]
        for n, path in enumerate(paths):
            y, v = (shown.factor * signal[:, i] for signal in path)
            axes.plot(y, v, color=COLOURS[n % len(COLOURS)], linewidth=0.9, label=_rival_label(group, n))
        axes.set_ylabel(shown.label(style.words(plant.outputs[i]), "/s"))

    return style.each_output(plant.n_y, draw, quantities(plant)[-1].label("value"), 6)


def _rival_label(group: Sequence[Rival], n: int) -> str:
    """The number of a controller, with its kind where there is room."""
    return f"{n + 1}: {kind_in_words(group[n].run)}" if len(group) <= 3 else str(n + 1)


def kind_in_words(run: Result) -> str:
    """The kind of a controller; switched feedback that never switches is continuous."""
    facts = run.controller.facts()
    return "continuous" if facts.get("switches") is False else run.controller.kind


def run_figure(runs: Sequence[Result]) -> Figure:
    """Every output of one case, and its inputs beneath, on each plant."""
    first = runs[0]
    shown = quantities(first.actual)
    figure, stack = style.new_figure(style.TALL, first.actual.n_y + 1)
    for run in runs:
        t, line, name = run.simulation.t, style.RUN[run.simulation.plant], style.NAME[run.simulation.plant]
        for i, axes in enumerate(stack[:-1]):
            axes.plot(t, shown[i].factor * run.simulation.y[:, i], label=name, **line)
            axes.set_ylabel(shown[i].label(style.words(first.actual.outputs[i])))
        for i in range(first.actual.n_u):
            stack[-1].plot(t, run.simulation.u[:, i], label=name if i == 0 else None, **line)
    end = max(float(run.simulation.t[-1]) for run in runs)
    for axes in stack:
        axes.set_xlim(max(0.0, end - LONGEST), end)
        drawn = [np.asarray(line.get_xydata(), dtype=float) for line in axes.get_lines()]
        late = np.concatenate([points[between(points[:, 0], end - LONGEST), 1] for points in drawn])
        low, high = float(late.min()), float(late.max())
        if np.isfinite(high - low) and high > low:
            axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    stack[-1].set(xlabel="time (s)", ylabel=in_unit("u", shared_unit(first.actual.input_units)))
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure
