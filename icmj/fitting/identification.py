"""The inverse question of the paper's conclusion: the model error that explains a motion, and its uncertainty.

Inversion of the interval: all values, on every branch, whose predicted interval is the observed one.

A test whether a value that explains the intervals also explains the amplitude and shape of the motion.

The motion that the value predicts is simulated, on the plant that moved, and laid on the one observed; what is left is
measured in standard deviations of the errors that times and outputs are allowed. The sum of squares has, where only
these errors are between the two, a chi-square distribution.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

from icmj.base.array import Array, between
from icmj.base.process import limit_to_one_thread
from icmj.case.case import Case, PlantKind, expect_rule, simulate
from icmj.cycle.cycle import find_cycle
from icmj.errors import IcmjError, IdentificationError
from icmj.fitting.observed import FEWEST, SETTLED, SPAN, Observed, Rhythm, Sequence, Unknown, rhythm
from icmj.simulation.simulation import Simulation

_POINTS = 33  # of the interval in which it is sought
_SAME = 1e-6  # relative: a root at which the interval is not the one observed is a jump


@dataclass(frozen=True)
class Candidate:
    """A value that explains the observed interval, its uncertainty due to that of the interval, and the sign."""

    value: float
    error: float
    sign: int


class Inverse:
    """The map from the unknown to the predicted interval, with a cache of its values."""

    def __init__(self, unknown: Unknown) -> None:
        self.unknown = unknown
        self._known: dict[float, tuple[float, int]] = {}
        self._like: Case | None = None

    @classmethod
    def up_to(cls, unknown: Unknown, rhythm: Rhythm) -> Inverse:
        """A map whose crossings are searched beyond the observed interval."""
        return cls(replace(unknown, longest=2.0 ** np.ceil(np.log2(1.5 * rhythm.interval))))

    def reaches(self, interval: float) -> bool:
        """Whether an interval [s] would be found."""
        return max(self.unknown.longest or 0.0, self.unknown.run.analysis.delta_max) > 1.2 * interval

    def rate(self, value: float) -> tuple[float, int]:
        """1/Δ_crit [1/s] and the sign of λ; 0 where intervals grow without bound, NaN where no cycle attracts."""
        if value not in self._known:
            case = self.unknown.case(value, self._like)
            self._like = case or self._like
            self._known[value] = _rate(case)
        return self._known[value]

    def candidates(self, rhythm: Rhythm) -> list[Candidate]:
        """Every value whose predicted cycle has this interval and, where it was observed, this sign."""
        grid = np.linspace(self.unknown.low, self.unknown.high, _POINTS)
        return [candidate for a, b in pairwise(grid) for candidate in self._between(float(a), float(b), rhythm)]

    def _between(self, a: float, b: float, rhythm: Rhythm) -> Iterator[Candidate]:
        (rate_a, sign_a), (rate_b, sign_b) = self.rate(a), self.rate(b)
        if not np.isfinite(rate_a + rate_b):
            return
        if sign_a and sign_b and sign_a != sign_b:  # over a value that the model has right, where intervals grow
            middle = (a + b) / 2
            if abs(b - a) > 1e-9 * max(1.0, abs(a)):
                yield from self._between(a, middle, rhythm)
                yield from self._between(middle, b, rhythm)
            return
        sign = sign_a or sign_b
        target = 1 / rhythm.interval
        if not sign or (rhythm.sign and sign != rhythm.sign) or (rate_a - target) * (rate_b - target) > 0:
            return

        def off(value: float) -> float:
            rate = self.rate(value)[0]
            return (rate if np.isfinite(rate) else 0.0) - target

        value = float(brentq(off, a, b, xtol=1e-12, rtol=1e-14))
        if abs(off(value)) < _SAME * target:
            yield Candidate(value, self._error(value, rhythm, b - a), sign)

    def slope(self, value: float, step: float) -> float:
        """dΔ_crit/dvalue [s]; infinite where there is no cycle beside it."""
        rates = [self.rate(value + side * step)[0] for side in (1, -1)]
        if not all(np.isfinite(rates)) or min(rates) <= 0:
            return float("inf")
        return (1 / rates[0] - 1 / rates[1]) / (2 * step)

    def _error(self, value: float, rhythm: Rhythm, width: float) -> float:
        slope = self.slope(value, 1e-4 * width)
        return 0.0 if not np.isfinite(slope) else rhythm.error / abs(slope) if slope else float("inf")


def refine_candidate(inverse: Inverse, candidate: Candidate, rhythm: Rhythm) -> Candidate:
    """The candidate by the exact cycle of the engine's loop, not the linear theory's; as it is, if there is none."""
    value = candidate.value
    try:
        for _ in range(3):
            case = inverse.unknown.case(value)
            if case is None:
                return candidate
            missing = rhythm.interval - find_cycle(case, "mujoco").interval
            slope = inverse.slope(value, 1e-5)
            if not np.isfinite(slope) or slope == 0:
                return candidate
            value += missing / slope
            if abs(missing) < max(1e-10 * rhythm.interval, 0.01 * rhythm.error):
                break
    except IcmjError:
        return candidate
    return Candidate(value, candidate.error, candidate.sign)


def _rate(case: Case | None) -> tuple[float, int]:
    if case is None or case.theory is None:
        return float("nan"), 0
    found = case.theory.prediction
    if found.delta_crit is None or found.eigenvalue is None:
        return 0.0, 0
    if not found.cycle or found.verdict != "attracting":
        return float("nan"), 0
    return 1 / found.delta_crit, int(np.sign(found.eigenvalue.real))


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
    runs = _simulate(unknown, value, observed, found, plant)
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


def _simulate(
    unknown: Unknown, value: float, observed: Observed, found: Rhythm, plant: PlantKind
) -> tuple[Simulation, ...]:
    """The motion from the run file's start if that is known, else from the predicted orbit or its mirror image."""
    try:
        if observed.whole:
            case = unknown.case(value, None, **{"simulation.duration": observed.duration + found.interval / 2})
            return () if case is None else (simulate(case, plant),)
        step = min(unknown.run.simulation.settings().record_interval, found.interval / 200)
        changes: dict[str, Any] = {"simulation.disturbance": [], "simulation.record_interval": step}
        case = unknown.case(value, None, **changes)
        theory = None if case is None else case.theory
        if case is None or theory is None or theory.prediction.orbit is None:
            return ()
        parts = theory.system.start(theory.prediction.orbit.x_bar)
        mirrored = tuple(-part for part in parts)
        length = (_TURNS + 0.5) * theory.prediction.orbit.delta
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


Way = Literal["rhythm", "sequence", "none"]
_EDGE = 1e-6  # of the range: what is so near to its end reaches it
_BAD_FIT = 0.05  # mean intervals: events that the best value does not explain


@dataclass(frozen=True, eq=False)
class Identification:
    """The estimate of the unknown from a motion.

    Attributes:
        name: name of the unknown.
        value: best value, or ``None`` if the motion does not determine it.
        intervals: the 95 % confidence set: one pair (low, high), or several if branches cannot be distinguished; empty
            if the motion does not determine the value.
        way: the method: the settled ``rhythm``, the ``sequence`` of events since the start, or ``none``.
        words: a description in words.
        probability: probability that a motion with the best value, because of errors of times and readings, would agree
            less well with its own prediction than the observed motion does; ``None`` if nothing was compared. Below
            :data:`icmj.fitting.identification.LEVEL` no value fits, and none is determined.
        edge: an end of the range that the intervals reach, beyond which the value may lie; otherwise ``None``.
    """

    name: str
    value: float | None
    intervals: tuple[tuple[float, float], ...]
    way: Way
    words: str
    probability: float | None = None
    edge: float | None = None

    def holds(self, value: float) -> bool:
        """Whether the intervals contain a value."""
        return any(low <= value <= high for low, high in self.intervals)


@limit_to_one_thread()
def identify(
    unknown: Unknown,
    observed: Observed,
    *,
    plant: PlantKind = "linear",
    refine: bool = True,
    known: Inverse | None = None,
) -> Identification:
    """Estimate one model error and its uncertainty from a motion, or report that the motion does not determine it.

    The estimate is the value whose cycle has the settled interval and sign; if the motion has not settled and its start
    is known, it is the value whose simulated events are those observed. What moves under noise has no such interval:
    :func:`icmj.fit` infers its parameters.

    Args:
        unknown: the parameter to be identified, and the run file with everything that is known.
        observed: the motion.
        plant: the plant of the motion, which is simulated: ``linear`` or ``mujoco``.
        refine: whether the exact cycle of the nonlinear plant corrects the linear theory; only for ``mujoco``.
        known: predictions computed for another motion.

    Raises:
        IdentificationError: if the run file has noise.
        IcmjError: if the run file does not have the unknown, or no motion can be simulated.
    """
    with unknown.run.at_hand() as run:  # of a log from elsewhere, with the models that it carries
        return _identify(replace(unknown, run=run), observed, plant, refine, known)


def _identify(
    unknown: Unknown,
    observed: Observed,
    plant: PlantKind,
    refine: bool,
    known: Inverse | None,
) -> Identification:
    if unknown.run.drawn().simulation.settings().noisy:
        raise IdentificationError(
            f"{unknown.run.path}: has noise, under which no interval repeats; infer {unknown.name} by icmj fit, with a "
            "family of this run file"
        )
    found = None if unknown.run.setpoint else rhythm(observed)  # what is predicted of a rhythm is that of r = 0
    case = unknown.checked()
    least = expect_rule(case, "identification").least
    if found is not None and found.interval <= least * (1 + 1e-3) + observed.resolution:
        return _cannot(
            unknown, f"every interval is the least one, {least:g} s: the event rule does not determine the events"
        )
    if found is not None:
        inverse = known if known is not None and known.reaches(found.interval) else Inverse.up_to(unknown, found)
        candidates = inverse.candidates(found)
        if plant == "mujoco" and refine:
            candidates = [refine_candidate(inverse, each, found) for each in candidates]
        if candidates:
            return _from_rhythm(inverse.unknown, observed, found, candidates, plant)
    if observed.whole and len(observed.times) >= FEWEST - 2:
        return _from_sequence(unknown, observed, plant)
    if found is not None:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} predicts an attracting cycle with an interval of "
            f"{found.interval:.6g} s",
        )
    why = "a set-point moves it" if unknown.run.setpoint else "the motion does not settle"
    return _cannot(unknown, f"{why}; its initial state is not known, and the run file has no noise to explain it")


def _from_rhythm(
    unknown: Unknown, observed: Observed, found: Rhythm, candidates: list[Candidate], plant: PlantKind
) -> Identification:
    if len(candidates) > 1 and observed.whole:
        sequence = Sequence(unknown, observed, plant)
        count = min(len(observed.times), 6)
        off = [float(np.sum(sequence.residuals(each.value, count, plant) ** 2)) for each in candidates]
        candidates = [candidates[int(np.argmin(off))]]
    if any(not np.isfinite(each.error) for each in candidates):
        return _cannot(unknown, f"the interval does not depend on {unknown.name} here")
    agreements = [agreement(unknown, each.value, observed, found, plant) for each in candidates]
    nearest = max(agreements, key=lambda each: each.probability)
    if not nearest.fits:
        best = candidates[agreements.index(nearest)]
        return _nothing_fits(
            unknown, f"{unknown.name} = {best.value:.5g} gives the rhythm, but {nearest.words}", nearest
        )
    candidates = [each for each, how in zip(candidates, agreements, strict=True) if how.fits]
    best = candidates[0]
    intervals = tuple((each.value - each.error, each.value + each.error) for each in candidates)
    values = " or ".join(f"{each.value:.6g} ± {each.error:.1g}" for each in candidates)
    sign = {1: ", not mirrored", -1: ", mirrored", 0: ""}[found.sign]
    words = f"{unknown.name} = {values}, from a settled interval of {found.interval:.7g} s{sign}."
    if len(candidates) > 1:
        words += " These data do not distinguish the branches; outputs at the events, or a known initial state, would."
    if not nearest.predicted:
        words += " Amplitude and shape were not observed; only the regularity of the events could be compared."
    value = best.value if len(candidates) == 1 else None
    return _complete(unknown, value, intervals, "rhythm", words, nearest.probability)


def _from_sequence(unknown: Unknown, observed: Observed, plant: PlantKind) -> Identification:
    fit = Sequence(unknown, observed, plant).fit()
    if fit.residual <= _BAD_FIT and not np.isfinite(fit.error):
        return _cannot(unknown, f"the events do not depend on {unknown.name} here")
    if fit.residual > _BAD_FIT:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} gives these events: the best one is off by "
            f"{100 * fit.residual:.2g} % of an interval",
        )
    how = agreement_of_sequence(unknown, fit.value, observed, plant)
    if not how.fits:
        return _nothing_fits(unknown, f"{unknown.name} = {fit.value:.5g} fits the events best, but {how.words}", how)
    words = f"{unknown.name} = {fit.value:.6g} ± {fit.error:.1g}, from {len(observed.times)} events since the start."
    interval = (fit.value - fit.error, fit.value + fit.error)
    return _complete(unknown, fit.value, (interval,), "sequence", words, how.probability)


def _complete(
    unknown: Unknown,
    value: float | None,
    intervals: tuple[tuple[float, float], ...],
    way: Way,
    words: str,
    probability: float,
) -> Identification:
    """The result, with its goodness of fit and an end of the range that it reaches."""
    room = _EDGE * (unknown.high - unknown.low)
    low, high = min(pair[0] for pair in intervals), max(pair[1] for pair in intervals)
    edge = unknown.low if low <= unknown.low + room else unknown.high if high >= unknown.high - room else None
    words += f" Goodness of fit: p = {probability:.2g}."
    if edge is not None:
        words += f" This reaches the edge of the range, {edge:g}, beyond which the value may lie: widen the range."
    return Identification(unknown.name, value, intervals, way, words, probability, edge)


def _nothing_fits(unknown: Unknown, why: str, how: Agreement) -> Identification:
    words = (
        f"No value of {unknown.name} between {unknown.low:g} and {unknown.high:g} fits the motion: {why} "
        f"(p {_small(how.probability)})."
    )
    return Identification(unknown.name, None, (), "none", words, how.probability)


def _small(probability: float) -> str:
    return f"= {probability:.1g}" if probability >= 1e-6 else "< 1e-6"


def _cannot(unknown: Unknown, why: str) -> Identification:
    return Identification(unknown.name, None, (), "none", f"The motion does not determine {unknown.name}: {why}.")
