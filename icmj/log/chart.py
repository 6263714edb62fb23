"""Pictures beside the run: growth under the clock, the amplitude law, and the phase plane, with ticks, curves, points.

They are drawn in 2D views, which have equal axes and y downwards: values are scaled to a frame of fixed shape, whose
ticks name them. In the phase plane every output is drawn against its rate, the run over the predicted orbit; its ticks
are round numbers, and the present point moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from icmj.base.array import Array, between
from icmj.log import palette
from icmj.log.palette import Colour
from icmj.log.sink import time_column
from icmj.simulation.scene import frames
from icmj.view.laid_orbit import laid_orbit, predicted_growth
from icmj.view.motion import event_rows, output_rate
from icmj.view.quantity import in_brackets, shared_unit, threshold_unit

if TYPE_CHECKING:
    from icmj.result.result import PredictedResult

WIDE = 1.6  # width of the frame over its height
GROWTH, LAW = "growth", "law"
LIMIT = 1.6  # largest |λ| drawn
ROOT = "phase"
LATE = 0.5  # the part of a run at its end that is drawn bright; before it is the approach, drawn dim


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of a chart: its quantity, its range, and its labelled values."""

    label: str
    low: float
    high: float
    ticks: Sequence[float] | Array
    logarithmic: bool = False

    def place(self, values: Array | Sequence[float]) -> Array:
        """Positions of values on the axis, 0 to 1."""
        v = np.asarray(values, dtype=float)
        if self.logarithmic:
            return np.log(v / self.low) / np.log(self.high / self.low)
        return (v - self.low) / (self.high - self.low)


@dataclass(frozen=True, eq=False)
class Chart:
    """A frame, and the curves in it as (name, x, y, colour).

    Attributes:
        x, y: its axes.
        lines: curves, the name at their end.
        points: marks.
    """

    x: Axis
    y: Axis
    lines: list[tuple[str, Array, Array, Colour]] = field(default_factory=list)
    points: list[tuple[str, Array, Array, Colour]] = field(default_factory=list)


def charts(result: PredictedResult) -> dict[str, Chart]:
    """The charts for which ``result`` has data, by entity path."""
    found = {GROWTH: _growth(result), LAW: _law(result)}
    return {path: chart for path, chart in found.items() if chart is not None}


def write_charts(recording: rr.RecordingStream, result: PredictedResult) -> None:
    """Write every chart of ``result``."""
    for path, chart in charts(result).items():
        _write(recording, path, chart)


def _growth(result: PredictedResult) -> Chart | None:
    """Largest |λ(φ)| against the interval of the clock, with measured growth, the unit circle and Δ_crit."""
    if result.growth is None:
        return None
    delta, largest = predicted_growth(result)
    delta, largest = delta[largest <= LIMIT], largest[largest <= LIMIT]
    end = float(max(delta.max(initial=0.0), result.growth.delta.max(initial=0.0))) or 1.0
    x = Axis("Δ_ol [s]", 0.0, end, _steps(end))
    y = Axis("largest |λ|", 0.0, LIMIT, (0.0, 0.5, 1.0, 1.5))
    lines = [("unit circle", np.array([0.0, end]), np.ones(2), palette.GREY)]
    if result.prediction.delta_crit is not None:
        at = result.prediction.delta_crit
        lines.append(("Δ_crit", np.full(2, at), np.array([0.0, LIMIT]), palette.LEVEL))
    lines.append(("predicted", delta, largest, palette.SKY))
    seen = result.growth.measured <= LIMIT
    measured = ("measured", result.growth.delta[seen], result.growth.measured[seen], palette.VERMILION)
    return Chart(x, y, lines, [measured])


def _law(result: PredictedResult) -> Chart | None:
    """Relative errors of interval and amplitude against the threshold, on logarithmic axes, with a slope of 2."""
    law = result.law
    if law is None:
        return None
    sets = [("interval", np.abs(law.interval_error)), ("amplitude", np.abs(law.amplitude_error))]
    known = [(name, e, np.isfinite(e) & (e > 0)) for name, e in sets]
    values = np.concatenate([e[good] for _, e, good in known])
    if not len(values):
        return None
    threshold = f"threshold{in_brackets(threshold_unit(result))}"
    x, y = _decades(threshold, law.q_t), _decades("relative error", values)
    colours = (palette.SKY, palette.ORANGE)
    points = [(name, law.q_t[good], e[good], c) for (name, e, good), c in zip(known, colours, strict=True)]
    top = float(values.max())
    square = np.array([law.q_t.max(), law.q_t.max() * np.sqrt(max(y.low / top, (x.low / law.q_t.max()) ** 2))])
    line = ("slope 2", square, top * (square / law.q_t.max()) ** 2, palette.GREY)
    return Chart(x, y, [line], points)


def _decades(label: str, values: Array) -> Axis:
    """A logarithmic axis over whole decades, every one or every second of them named."""
    low, high = np.floor(np.log10(values.min()) + 1e-9), np.ceil(np.log10(values.max()) - 1e-9)
    high = max(high, low + 1)
    every = 1 if high - low <= 4 else 2
    return Axis(label, 10.0**low, 10.0**high, 10.0 ** np.arange(low, high + 1, every), logarithmic=True)


def _steps(end: float) -> Array:
    """Three to seven round values from 0 to ``end``."""
    rough = end / 4
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= rough * 0.99)
    return np.arange(0.0, end * (1 + 1e-9), step)


def _write(recording: rr.RecordingStream, root: str, chart: Chart) -> None:
    def placed(x: Array | Sequence[float], y: Array | Sequence[float]) -> Array:
        return np.column_stack([WIDE * chart.x.place(x), -chart.y.place(y)])

    corner = [[(0.0, 0.0), (WIDE, 0.0)], [(0.0, 0.0), (0.0, -1.0)]]
    recording.log(f"{root}/axes", rr.LineStrips2D(corner, colors=[palette.GREY], radii=[-0.6]), static=True)
    along, up = np.asarray(chart.x.ticks, dtype=float), np.asarray(chart.y.ticks, dtype=float)
    at = np.vstack([
        np.column_stack([WIDE * chart.x.place(along), np.full(len(along), 0.08)]),
        np.column_stack([np.full(len(up), -0.1), -0.035 - chart.y.place(up)]),
        [[WIDE / 2, 0.2], [0.0, -1.12]],
    ])  # fmt: skip
    labels = [*(f"{value:g}" for value in (*along, *up)), chart.x.label, chart.y.label]
    _write_words(recording, f"{root}/ticks", at, labels, palette.WHITE)
    for order, (name, x, y, colour) in enumerate(chart.lines):
        line = placed(x, y)
        strip = rr.LineStrips2D([line], colors=[colour], radii=[-1.0], draw_order=10.0 + order)
        recording.log(f"{root}/{_part(name)}", strip, static=True)
        _write_words(recording, f"{root}/{_part(name)}/name", line[-1:] - np.array([0.0, 0.05]), [name], colour)
    for order, (name, x, y, colour) in enumerate(chart.points):
        marks = rr.Points2D(placed(x, y), colors=[colour], radii=[-4.0], draw_order=30.0 + order)
        recording.log(f"{root}/{_part(name)}", marks, static=True)
        if len(x):
            _write_words(
                recording, f"{root}/{_part(name)}/name", placed(x, y)[:1] - np.array([0.0, 0.08]), [name], colour
            )


def _part(name: str) -> str:
    return name.replace(" ", "_").replace("Δ", "delta")


def _write_words(recording: rr.RecordingStream, path: str, at: Array, labels: list[str], colour: Colour) -> None:
    words = rr.Points2D(at, labels=labels, colors=[colour], radii=[0.0], show_labels=True)
    recording.log(path, words, static=True)


def write_phase_plane(recording: rr.RecordingStream, result: PredictedResult) -> None:
    """Write the phase plane of ``result``: approach dim, second half bright, events, orbit, and the present point."""
    simulation = result.simulation
    y, rate = simulation.y, output_rate(result, simulation.x, simulation.u)
    laid = laid_orbit(result) if result.prediction.cycle else None
    orbit = None if laid is None else (laid.whole(laid.orbit.y), laid.whole(laid.rate))
    late = between(simulation.t, simulation.t[-1] * (1 - LATE))
    seen = [(y[late], rate[late])] + ([orbit] if orbit is not None else [])
    scale_y, scale_rate = (round_up(max(float(np.abs(pair[i]).max(initial=0.0)) for pair in seen)) for i in (0, 1))

    def placed(y: Array, rate: Array) -> Array:
        return np.column_stack([WIDE * y / scale_y, -rate / scale_rate])

    _write_frame(recording, scale_y, scale_rate, shared_unit(result.actual.output_units))
    colours = palette.series(result.actual.n_y)
    approach = ~late
    events = event_rows(simulation)
    events = events[late[events]]
    for i, (name, colour) in enumerate(zip(result.actual.outputs, colours, strict=True)):
        root = f"{ROOT}/{name}"
        strips = _inside(placed(y[approach, i], rate[approach, i]))
        if strips:
            faint = palette.dim(palette.dim(colour))
            recording.log(
                f"{root}/approach", rr.LineStrips2D(strips, colors=[faint], radii=[-0.5], draw_order=1.0), static=True
            )
        if orbit is not None:
            line = placed(orbit[0][:, i], orbit[1][:, i])
            recording.log(
                f"{root}/orbit",
                rr.LineStrips2D([line], colors=[palette.dim(palette.WHITE)], radii=[-3.0], draw_order=10.0 + i),
                static=True,
            )
        line = placed(y[late, i], rate[late, i])
        recording.log(
            f"{root}/run", rr.LineStrips2D([line], colors=[colour], radii=[-1.25], draw_order=20.0 + i), static=True
        )
        if len(events):
            at = placed(y[events, i], rate[events, i])
            recording.log(
                f"{root}/events",
                rr.Points2D(at, colors=[palette.EVENT], radii=[-3.5], draw_order=30.0 + i),
                static=True,
            )
    shown = frames(simulation.t)
    now = np.stack([placed(y[shown, i], rate[shown, i]) for i in range(result.actual.n_y)], axis=1)
    style = rr.Points2D.from_fields(
        colors=colours, radii=[-6.0], labels=list(result.actual.outputs), show_labels=True, draw_order=40.0
    )
    recording.log(f"{ROOT}/now", style, static=True)
    positions = rr.Points2D.columns(positions=now.reshape(-1, 2)).partition(np.full(len(shown), result.actual.n_y))
    recording.send_columns(f"{ROOT}/now", [time_column(simulation.t[shown])], positions)


def round_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten; 1 for zero."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9)))


def _inside(line: Array, reach: float = 1.2) -> list[Array]:
    """The parts of a line that stay within the frame."""
    inside = np.abs(line / [WIDE, 1.0]).max(axis=1) <= reach
    cuts = np.flatnonzero(np.diff(inside.astype(int))) + 1
    return [
        part
        for part, kept in zip(np.split(line, cuts), np.split(inside, cuts), strict=True)
        if len(part) > 1 and kept[0]
    ]


def _write_frame(recording: rr.RecordingStream, scale_y: float, scale_rate: float, unit: str) -> None:
    axes = [[[-1.2 * WIDE, 0], [1.2 * WIDE, 0]], [[0, -1.2], [0, 1.2]]]
    recording.log(
        f"{ROOT}/axes", rr.LineStrips2D(axes, colors=[palette.GREY], radii=[-0.6], draw_order=0.0), static=True
    )
    ticks = [[-WIDE, 0.0], [WIDE, 0.0], [0.0, -1.0], [0.0, 1.0]]
    labels = [f"{-scale_y:g}", f"{scale_y:g}", f"{scale_rate:g}", f"{-scale_rate:g}"]
    recording.log(
        f"{ROOT}/ticks",
        rr.Points2D(ticks, labels=labels, colors=[palette.WHITE], radii=[-2.0], show_labels=True, draw_order=0.5),
        static=True,
    )
    recording.log(
        f"{ROOT}/names",
        rr.Points2D(
            [[1.15 * WIDE, -0.16], [0.0, -1.3]],
            labels=[f"y{in_brackets(unit)}", f"dy/dt{in_brackets(unit, '/s')}"],
            colors=[palette.WHITE],
            radii=[0.0],
            show_labels=True,
        ),
        static=True,
    )
