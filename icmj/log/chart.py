"""Pictures beside the run: growth under the clock, and the amplitude law, each a frame with ticks, curves and points.

They have no time, so they are drawn in 2D views, which have equal axes and y downwards: values are scaled to a frame of
fixed shape, whose ticks name them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from icmj.base.array import Array
from icmj.log import palette
from icmj.log.palette import Colour
from icmj.result.result import Result
from icmj.view.laid_orbit import predicted_growth
from icmj.view.quantity import in_brackets, threshold_unit

WIDE = 1.6  # width of the frame over its height
GROWTH, LAW = "growth", "law"
LIMIT = 1.6  # largest |λ| drawn


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


def charts(result: Result) -> dict[str, Chart]:
    """The charts for which ``result`` has data, by entity path."""
    found = {GROWTH: _growth(result), LAW: _law(result)}
    return {path: chart for path, chart in found.items() if chart is not None}


def write_charts(recording: rr.RecordingStream, result: Result) -> None:
    """Write every chart of ``result``."""
    for path, chart in charts(result).items():
        _write(recording, path, chart)


def _growth(result: Result) -> Chart | None:
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


def _law(result: Result) -> Chart | None:
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
