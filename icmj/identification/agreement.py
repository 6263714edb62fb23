"""A test whether a value that explains the intervals also explains the amplitude and shape of the motion.

The motion that the value predicts is simulated, on the plant that moved, and laid on the one observed; what is left is
measured in standard deviations of the errors that times and outputs are allowed. The sum of squares has, where only
these errors are between the two, a chi-square distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.stats import chi2

from icmj.base.array import Array, between
from icmj.case.case import PlantKind, simulate
from icmj.errors import IcmjError
from icmj.identification.observed import Observed
from icmj.identification.rhythm import SETTLED, SPAN, Rhythm
from icmj.identification.unknown import Unknown
from icmj.simulation.simulation import Simulation

LEVEL = 0.002
"""Probability below which nothing fits; so often is a motion refused that the run file describes."""
_TURNS = 12  # intervals from the predicted orbit on, which the engine's loop needs to come to its own
_PHASES = 48  # at which the predicted motion is laid first


@dataclass(frozen=True)
class Agreement:
    """The agreement of the predicted motion with the observed one.

    Attributes:
        probability: that errors of times and outputs alone would make it agree less.
        off: root mean square of what is left of the outputs, relative to that of the outputs; NaN without outputs.
        observed, predicted: largest magnitudes of the outputs that were compared [their unit], shape (n_y,).
        whole: whether outputs were compared, and not times of events alone.
    """

    probability: float
    off: float = float("nan")
    observed: tuple[float, ...] = ()
    predicted: tuple[float, ...] = ()

    @property
    def fits(self) -> bool:
        """Whether the value is compatible with the observation."""
        return self.probability >= LEVEL

    @property
    def words(self) -> str:
        """The differences from the prediction, in words."""
        if not self.predicted:
            return "the times of the events scatter by more than their errors"
        if not np.isfinite(self.off):
            return "the motion that it predicts cannot be simulated"
        peaks = (", ".join(f"{value:.3g}" for value in values) for values in (self.predicted, self.observed))
        return "the outputs are off by {:.2g} % of their size (predicted peak {}, observed {})".format(
            100 * self.off, *peaks
        )


def agreement(unknown: Unknown, value: float, observed: Observed, found: Rhythm, plant: PlantKind) -> Agreement:
    """Agreement of a settled motion with the cycle that a value of the unknown predicts on ``plant``.

    Its rhythm is free, for the value was taken from it; scatter of the times, amplitude and shape are compared.
    """
    if len(observed.times) and not observed.outputs.shape[1]:
        return _told(*_scatter(observed, found))
    runs = _simulated(unknown, value, observed, found, plant)
    compare = _at_events if len(observed.times) else _of_samples
    fits = [compare(run, observed, found) for run in runs if len(run.events) > 3]
    return max(fits, key=lambda each: each.probability, default=Agreement(0.0, predicted=(np.nan,)))


def agreement_of_sequence(unknown: Unknown, value: float, observed: Observed, plant: PlantKind) -> Agreement:
    """Agreement of all events since a known start with the predicted ones, by times and outputs."""
    scale = float(np.mean(observed.intervals))
    case = unknown.case(value, None, **{"simulation.duration": observed.duration + scale})
    try:
        run = None if case is None else simulate(case, plant)
    except IcmjError:
        run = None
    count = len(observed.times)
    if run is None or len(run.events) < count:
        return Agreement(0.0, predicted=(np.nan,))
    timing = max(observed.jitter, SETTLED * scale)
    off = observed.times - run.events.t[:count]
    square, freedom = float(np.sum((off / timing) ** 2)), count - 1
    y = observed.outputs
    if not y.shape[1]:
        return _told(square, freedom)
    seen = Observed.of_simulation(run).outputs[:count, : y.shape[1]]
    peak = np.abs(run.y).max(axis=0)[: y.shape[1]]
    rate = np.column_stack([np.interp(observed.times, run.t, each) for each in np.gradient(run.y, run.t, axis=0).T])
    sigma = np.maximum(np.hypot(observed.unsure(peak), timing * rate[:, : y.shape[1]]), 1e-12 * peak + 1e-300)
    square += float(np.sum(((y - seen) / sigma) ** 2))
    relative = float(np.sqrt(np.sum((y - seen) ** 2) / np.sum(y**2)))
    peaks = {"observed": tuple(np.abs(y).max(axis=0)), "predicted": tuple(np.abs(seen).max(axis=0))}
    return _told(square, freedom + y.size, off=relative, **peaks)


def _simulated(
    unknown: Unknown, value: float, observed: Observed, found: Rhythm, plant: PlantKind
) -> tuple[Simulation, ...]:
    """The motion from the run file's start if that is known, else from the predicted orbit or its mirror image."""
    try:
        if observed.whole:
            case = unknown.case(value, None, **{"simulation.duration": observed.duration + found.interval / 2})
            return () if case is None else (simulate(case, plant),)
        step = min(unknown.run.simulation.record_interval, found.interval / 200)
        changes: dict[str, Any] = {"simulation.disturbance": [], "simulation.record_interval": step}
        case = unknown.case(value, None, **changes)
        if case is None or case.prediction.orbit is None:
            return ()
        parts = case.system.start(case.prediction.orbit.x_bar)
        mirrored = tuple(-part for part in parts)
        length = (_TURNS + 0.5) * case.prediction.orbit.delta
        return tuple(simulate(case, plant, start=start, duration=length) for start in (parts, mirrored))
    except IcmjError:
        return ()


def _scatter(observed: Observed, found: Rhythm) -> tuple[float, int]:
    """Sum of squares about even times, and its degrees of freedom."""
    times = observed.times[-(found.count + 1) :]
    k = np.arange(len(times))
    left = times - np.polyval(np.polyfit(k, times, 1), k)
    sigma = max(observed.jitter, SETTLED * found.interval)
    return float(np.sum(left**2)) / sigma**2, len(times) - 2


def _told(square: float, freedom: int, **more: object) -> Agreement:
    return Agreement(float(chi2.sf(square, max(freedom, 1))), **more)  # type: ignore[arg-type]


def _at_events(run: Simulation, observed: Observed, found: Rhythm) -> Agreement:
    """Outputs at the settled events, separately for even and odd events."""
    y = observed.outputs[-(found.count + 1) :]
    wave = _Wave(run)
    peak = wave.peak[: y.shape[1]]
    timing = max(observed.jitter, SETTLED * found.interval)
    square, freedom = _scatter(observed, found)
    best = None
    for turn in (0.0, wave.period / 2):
        at = wave.end - turn - np.arange(len(y))[::-1] * wave.period / 2
        expected, rate = wave.at(at)[:, : y.shape[1]], wave.at(at, 1)[:, : y.shape[1]]
        sigma = np.maximum(np.hypot(observed.unsure(peak), timing * rate), 1e-12 * peak + 1e-300)
        of_outputs = float(np.sum(((y - expected) / sigma) ** 2))
        if best is None or of_outputs < best[0]:
            best = of_outputs, float(np.sqrt(np.sum((y - expected) ** 2) / np.sum(y**2)))
    assert best is not None
    seen = tuple(np.abs(y).max(axis=0))
    expected = np.abs(wave.at(wave.end - np.arange(2) * wave.period / 2)[:, : y.shape[1]]).max(axis=0)
    return _told(square + best[0], freedom + y.size, off=best[1], observed=seen, predicted=tuple(expected))


def _of_samples(run: Simulation, observed: Observed, found: Rhythm) -> Agreement:
    """Outputs over the last part of the record, with the rhythm and the phase that fit best."""
    kept = between(observed.t, observed.t[-1] - SPAN * (observed.t[-1] - observed.t[0]))
    t, y = observed.t[kept], observed.y[kept]
    wave = _Wave(run)
    unsure, middle = observed.unsure(wave.peak), (t[0] + t[-1]) / 2

    def left(at: Array) -> Array:
        """Residuals of the outputs in standard deviations, for a phase and the log of a factor on the interval."""
        speed = wave.period / (2 * found.interval) * np.exp(at[1])
        place = at[0] + (t - middle) * speed
        rate = wave.at(place, 1) * speed
        sigma = np.maximum(np.hypot(unsure, observed.jitter * rate), 1e-12 * wave.peak + 1e-300)
        return ((y - wave.at(place)) / sigma).ravel()

    phases = wave.period * np.arange(_PHASES) / _PHASES
    first = min(phases, key=lambda phase: float(np.sum(left(np.array([phase, 0.0])) ** 2)))
    slack = max(0.02, found.error / found.interval)
    best = least_squares(left, [first, 0.0], bounds=([-np.inf, -slack], [np.inf, slack]), x_scale=[wave.period, 0.01])
    place = best.x[0] + (t - middle) * wave.period / (2 * found.interval) * np.exp(best.x[1])
    off = float(np.sqrt(np.sum((y - wave.at(place)) ** 2) / np.sum(y**2)))
    seen = tuple(np.abs(y).max(axis=0))
    return _told(float(np.sum(best.fun**2)), y.size - 2, off=off, observed=seen, predicted=tuple(wave.peak))


class _Wave:
    """The outputs over the last two open-loop intervals of a run, repeated before and after."""

    def __init__(self, run: Simulation) -> None:
        begin, self.end = float(run.events.t[-3]), float(run.events.t[-1])
        rows = (run.t >= begin) & (run.t <= self.end)
        self.period = self.end - begin
        self._curve = CubicSpline(run.t[rows], run.y[rows])
        self._begin = begin
        self.peak = np.abs(run.y[rows]).max(axis=0)

    def at(self, t: Array, derivative: int = 0) -> Array:
        """Outputs, or their rates, shapes (N,) → (N, n_y)."""
        return np.asarray(self._curve(self._begin + np.mod(t - self._begin, self.period), derivative))
