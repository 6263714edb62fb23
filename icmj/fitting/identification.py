"""The inverse question of the paper's conclusion: the model error that explains a motion, and its uncertainty.

Inversion of the interval: all values, on every branch, whose predicted interval is the observed one.

The motion that each value predicts is simulated and laid on the one observed, by least squares on times and outputs in
standard deviations of their errors. This gives the value and its confidence, however slowly the motion settles, and
tells whether a value that explains the intervals also explains amplitude and shape: the sum of squares has, where only
these errors are between the two, a chi-square distribution.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.stats import chi2
from scipy.stats import t as student

from icmj.base.array import Array, is_between
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import Case, PlantKind, Theory, expect_rule, simulate
from icmj.cycle.cycle import find_cycle
from icmj.errors import IcmjError, IdentificationError
from icmj.fitting.observed import EXACT, FEWEST, SETTLED, Observed
from icmj.fitting.rhythm import NEAR, SPAN, Rhythm, rhythm
from icmj.fitting.unknown import Unknown
from icmj.simulation.simulation import Simulation
from icmj.theory.orbit import Orbit

_POINTS = 33  # of the interval in which it is sought
_SAME = 1e-6  # relative: a root at which the interval is not the one observed is a jump
_NARROW = 1e-8  # of a cell: what is so narrow is halved no further
_APART = 1e-4  # of a cell: what is nearer to each other is one value
_EVEN = 1e-10  # relative: an interval that varies less is at an extremum
_FAR = 0.3  # of the interval and of its rise: farther beyond the ends of a cell it does not bend
_STRAIGHT = 0.1  # of the rise: so far from a straight line the interval has no extremum in between


def _find_minima(values: Array) -> list[int]:
    """Where values on a grid are less than beside it, the least first; of equal neighbours the last."""
    left, right = np.append(np.inf, values[:-1]), np.append(values[1:], np.inf)
    return sorted(np.flatnonzero((values <= left) & (values < right)).tolist(), key=lambda i: float(values[i]))


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

    def candidates(self, rhythm: Rhythm) -> list[float]:
        """Every value whose predicted cycle has this interval and, where it was observed, this sign."""
        grid = np.linspace(self.unknown.low, self.unknown.high, _POINTS)
        found: list[float] = []
        for a, b in pairwise(grid):
            for value in self._between(float(a), float(b), rhythm):
                if all(abs(value - other) > _APART * (b - a) for other in found):
                    found.append(value)
        return found

    def nearest(self, rhythm: Rhythm) -> list[float]:
        """Values of the grid, none beside a candidate, whose interval is near that of a motion still on its way."""
        grid = np.linspace(self.unknown.low, self.unknown.high, _POINTS)
        rates, signs = np.transpose([self.rate(float(value)) for value in grid])
        off = np.where(signs * rhythm.sign < 0, np.nan, np.abs(rates * rhythm.interval - 1))
        near = [float(grid[i]) for i in sorted(_find_minima(np.nan_to_num(off, nan=np.inf))) if off[i] < NEAR]
        known, cell = self.candidates(rhythm), grid[1] - grid[0]
        return [value for value in near if all(abs(value - other) > cell for other in known)]

    def _between(self, a: float, b: float, rhythm: Rhythm, part: float = 1.0) -> Iterator[float]:
        """The values in a ``part`` of a cell, halved where the interval does not run nearly straight through it.

        So are found the ends of the region where a cycle attracts, jumps of Δ_crit, values that the model has right,
        where intervals grow, and extrema, with what lies beside each of them.
        """
        target, middle, narrow = 1 / rhythm.interval, (a + b) / 2, part < _NARROW
        (first, sign), (last, other) = self.rate(a), self.rate(b)
        smooth = np.isfinite(first + last) and sign == other
        if smooth:
            rise, missed = abs(last - first), max(min(first, last) - target, target - max(first, last))
            if not sign or sign == -rhythm.sign or missed > _FAR * (5 * rise + part * target):
                return
            bend = abs(self.rate(middle)[0] - (first + last) / 2)
            if missed > 2 * bend + _EVEN * target:
                return
            if narrow or bend <= _STRAIGHT * rise + _EVEN * target:
                if (first - target) * (last - target) <= 0:
                    middle = float(brentq(lambda at: np.nan_to_num(self.rate(at)[0]) - target, a, b, xtol=1e-12))
                if abs(self.rate(middle)[0] - target) < _SAME * target:
                    yield middle
                return
        if not narrow and (smooth or np.isfinite([first, last, self.rate(middle)[0]]).any()):
            yield from self._between(a, middle, rhythm, part / 2)
            yield from self._between(middle, b, rhythm, part / 2)

    def slope(self, value: float, step: float) -> float:
        """dΔ_crit/dvalue [s]; infinite where there is no cycle beside it."""
        rates = [self.rate(value + side * step)[0] for side in (1, -1)]
        if not all(np.isfinite(rates)) or min(rates) <= 0:
            return float("inf")
        return (1 / rates[0] - 1 / rates[1]) / (2 * step)


def refine_fit(inverse: Inverse, fit: Fit) -> Fit:
    """The fit by the exact cycle of the engine's loop, not the linear theory's; as it is, if there is none."""
    value, interval = fit.value, 1 / inverse.rate(fit.value)[0]
    try:
        for _ in range(3):
            case, slope = inverse.unknown.case(value), inverse.slope(value, 1e-5)
            if case is None or not np.isfinite(slope) or slope == 0:
                return fit
            missing = interval - find_cycle(case, "mujoco").interval
            value += missing / slope
            if abs(missing) < max(1e-10 * interval, 0.01 * fit.error * abs(slope)):
                break
    except IcmjError:
        return fit
    return replace(fit, value=value)


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
_STEP = 1e-4  # of the unit of each number: differences that are derivatives
_TRIES = 30
_HOPELESS = 100.0  # variances: what is left where no small step helps any more
_MANY = 32  # intervals, which tell enough of a motion whatever is free
_SMALL = 1e-5  # of the sum of squares, and of the variance of an error: what another step has to win
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


@dataclass(frozen=True)
class Fit:
    """The best value near a first one.

    Attributes:
        value, error: the value, and the half width of its 95 % confidence; infinite where nothing depends on it.
        cost: sum of squares of what is left, in standard deviations of the errors.
        off: root mean square of what is left of the times of events, in mean intervals; 0 of samples.
        agreement: that of the motion.
    """

    value: float
    error: float
    cost: float
    off: float
    agreement: Agreement


class Course:
    """The simulated motion for a value, laid on the observed one by least squares.

    From a known start on, nothing but the value is free. Else the motion begins at an event near the predicted orbit:
    its time is free, and the state after it, and with it the part of each multiplier in what is observed. What the
    motion does not tell of this state is held near the orbit, by a standard deviation of the size of the orbit.
    """

    def __init__(self, unknown: Unknown, observed: Observed, plant: PlantKind, found: Rhythm | None = None) -> None:
        self._unknown, self._plant, self._observed = unknown, plant, observed
        self._whole, self._events = found is None, len(observed.times) > 0
        if self._events:
            first = 0 if found is None else -(found.count + 1)
            self._t, self._y = observed.times[first:], observed.outputs[first:]
        else:
            kept = is_between(observed.t, observed.t[-1] - SPAN * (observed.t[-1] - observed.t[0]))
            self._t, self._y = observed.t[kept], observed.y[kept]
        self._interval = found.interval if found else float(np.mean(observed.intervals))
        self._exact = max(observed.jitter, EXACT * self._interval)
        # events need not come more evenly than a rhythm that has settled
        self._loose = max(observed.jitter, SETTLED * self._interval) if self._events else observed.jitter
        self._like: Case | None = None
        self._ran: tuple[tuple[float, ...], Simulation | None] = ((), None)

    def fit(self, value: float, counts: tuple[int, ...] = ()) -> Fit | None:
        """The best value near this one, from the first ``counts`` events, and then from all that was observed."""
        best: Fit | None = None
        for count in (*(each for each in counts if each < len(self._t)), len(self._t)):
            best = self._least(*self._start(best.value if best else value, count), count)
            if best is None:
                return None
        return best

    def distance(self, value: float, count: int) -> float:
        """Sum of squares of the first ``count`` events since a known start, in mean intervals."""
        left = self._compare(np.array([value]), 1, count)
        return float(count) if left is None else float(np.sum((left[0] * self._exact / self._interval) ** 2))

    def fewest(self, value: float) -> int:
        """The intervals that leave as much to be compared as they tell of what is free beside the value."""
        near = self._near(value)
        return 2 * (2 + (0 if near is None else len(near[2].x_bar)))

    def _start(self, value: float, count: int) -> tuple[Array, int]:
        """The value with what is free beside it, time of the first event and state, and the side that is nearer."""
        near = None if self._whole else self._near(value)
        if near is None:
            return np.array([value]), 1
        back = np.zeros(1) if self._events else np.arange(0.25, 1.25, 1 / _PHASES)
        begins = [np.array([value, self._t[0] - each * self._interval, *0 * near[2].x_bar]) for each in back]
        choices = ((begin, side) for side in (1, -1) for begin in begins)
        return min(choices, key=lambda each: self._cost(self._vector(each[0], each[1], count)))

    def _near(self, value: float) -> tuple[Case, Theory, Orbit] | None:
        case = self._case(value)
        if case is None or case.theory is None or case.theory.prediction.orbit is None:
            return None
        return case, case.theory, case.theory.prediction.orbit

    def _case(self, value: float, **changes: Any) -> Case | None:
        case = self._unknown.case(value, self._like, **changes)
        self._like = case or self._like
        return case

    def _simulate(self, at: Array, side: int, count: int) -> Simulation | None:
        """The motion for a value, from the known start, or from a state right after an event at t = 0."""
        key = (at[0], *at[2:], side, count)
        if self._ran[0] != key:
            try:
                self._ran = key, self._run(at[0], side * at[2:], side, count)
            except IcmjError:
                self._ran = key, None
        return self._ran[1]

    def _run(self, value: float, state: Array, side: int, count: int) -> Simulation | None:
        if self._whole:
            # where intervals are longer the same number of events takes longer
            duration = 1.1 * float(self._t[count - 1] - self._observed.begin) + 2 * self._interval
            case = self._case(value, **{"simulation.duration": duration})
            return None if case is None else simulate(case, self._plant)
        if (near := self._near(value)) is None:
            return None
        case, theory, orbit = near
        step = min(case.settings.record_interval, self._interval / 200)
        case = replace(case, settings=replace(case.settings, disturbance=(), record_interval=step))
        start = theory.system.start(side * orbit.x_bar + _sizes(orbit) * state)
        length = float(self._t[count - 1] - self._t[0]) + 2.5 * self._interval
        return simulate(case, self._plant, start=start, duration=length)

    def _compare(self, at: Array, side: int, count: int) -> tuple[Array, Array, Array, Array] | None:
        """What is left of times and outputs, in standard deviations, and the predicted outputs and their peaks."""
        run = self._simulate(at, side, count)
        if run is None or len(run.t) < 4:
            return None
        when, times = self._t[:count] - (0.0 if self._whole else at[1]), np.zeros(0)
        if self._events:
            events = run.events.t if self._whole else np.append(0.0, run.events.t)
            if len(events) < count:
                return None
            times, when = (when - events[:count]) / self._exact, events[:count]
        y = self._y[:count]
        curve = CubicSpline(run.t, run.y[:, : y.shape[1]])
        # not of what comes before: errors in proportion to it would explain anything
        peak, seen = np.abs(run.y[run.t >= min(when[0], run.t[-1])]).max(axis=0)[: y.shape[1]], curve(when)
        sigma = np.hypot(self._observed.unsure(peak), self._loose * curve(when, 1))
        return times, (y - seen) / np.maximum(sigma, 1e-12 * peak + 1e-300), seen, peak

    def _vector(self, at: Array, side: int, count: int) -> Array | None:
        left = self._compare(at, side, count)
        return None if left is None else np.concatenate([left[0], left[1].ravel(), at[2:]])

    @staticmethod
    def _cost(left: Array | None) -> float:
        return np.inf if left is None else float(left @ left)

    def _least(self, at: Array, side: int, count: int) -> Fit | None:
        """Steps of Gauss and Newton, halved where they lead up, until the next is small beside the errors."""
        unit = np.full(len(at), 0.1)
        unit[:2] = np.array([1e-2 * (self._unknown.high - self._unknown.low), 1e-2 * self._interval])[: len(at)]
        left = self._vector(at, side, count)
        for _ in range(_TRIES):
            if left is None:
                return None
            moved = [self._vector(at + step, side, count) for step in np.diag(_STEP * unit)]
            slopes = np.column_stack([(each - left) / _STEP if each is not None else 0 * left for each in moved])
            step = np.linalg.lstsq(slopes, -left, rcond=None)[0]
            if np.sum((slopes @ step) ** 2) < _SMALL + _SMALL * (left @ left):
                break
            for part in 0.5 ** np.arange(8):
                there = at + part * step * unit
                there[0] = np.clip(there[0], self._unknown.low, self._unknown.high)
                further = self._vector(there, side, count)
                if self._cost(further) < self._cost(left):
                    break
            else:
                break
            stuck = self._cost(further) > max(_HOPELESS * len(left), 0.8 * self._cost(left))
            at, left = there, further
            if stuck:
                break
        found = self._compare(at, side, count)
        if found is None:
            return None
        times, outputs, seen, peak = found
        # what the value alone does, and how many numbers the motion has told
        own, others = slopes[:, 0], slopes[:, 1:]
        told = float(np.linalg.norm(own - others @ np.linalg.lstsq(others, own, rcond=None)[0]))
        known = float(np.sum(np.linalg.qr(slopes)[0][: times.size + outputs.size] ** 2))
        spare = max(times.size - known, 1.0)
        off = float(np.sqrt(np.sum(times**2) / spare)) if times.size else 0.0
        error = unit[0] / told * max(1.96, float(student.ppf(0.975, spare)) * off) if told > 0 else np.inf
        square = float(np.sum((times * self._exact / max(self._loose, self._exact)) ** 2) + np.sum(outputs**2))
        more: dict[str, Any] = {}
        if outputs.size:
            y = self._y[:count]
            more = {"off": float(np.sqrt(np.sum((y - seen) ** 2) / np.sum(y**2)))}
            more |= {
                "observed": tuple(np.abs(y).max(axis=0)),
                "predicted": tuple(peak if not times.size else np.abs(seen).max(axis=0)),
            }
        how = Agreement(float(chi2.sf(square, max(times.size + outputs.size - known, 1.0))), **more)
        return Fit(float(at[0]), float(error), self._cost(left), off * self._exact / self._interval, how)


def _sizes(orbit: Orbit) -> Array:
    """The largest magnitude on the orbit of each entry of x̄."""
    size = np.abs(orbit.X).max(axis=0)[: len(orbit.x_bar)]
    return np.asarray(np.maximum(size, 1e-3 * size.max()))


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
        way: the method: the ``rhythm`` of a cycle, the ``sequence`` of events since the start, or ``none``.
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

    From a known start, the estimate is the value whose simulated events are those observed. Else it is the value whose
    predicted orbit the motion is on, or approaches: the motion is simulated from an event near it. What moves under
    noise has no such orbit: :func:`icmj.fit` infers its parameters.

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
    if unknown.run.resolve().simulation.settings().noisy:
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
    whole = observed.whole and len(observed.times) >= FEWEST - 2
    if found is None and not whole:
        why = "a set-point moves it" if unknown.run.setpoint else "the motion does not settle"
        return _cannot(unknown, f"{why}; its initial state is not known, and the run file has no noise to explain it")
    inverse = known
    if found is not None and (inverse is None or not inverse.reaches(found.interval)):
        inverse = Inverse.up_to(unknown, found)
    if whole:
        values = inverse.candidates(found) if inverse and found else []
        return _from_sequence(unknown, observed, plant if refine else "linear", values)
    assert inverse is not None
    assert found is not None
    return _from_rhythm(inverse, observed, found, plant == "mujoco" and refine)


def _from_rhythm(inverse: Inverse, observed: Observed, found: Rhythm, refine: bool) -> Identification:
    unknown = inverse.unknown
    fits: list[Fit] = []
    for search in (inverse.candidates, inverse.nearest):
        for like, value in ((each, value) for each in found.readings for value in search(each)):
            course = Course(unknown, observed, "linear", like)
            fit, few = course.fit(value), min(course.fewest(value), _MANY)
            while not (fit and fit.agreement.fits) and like.count // 2 >= few:  # the later, the nearer to the cycle
                like = replace(like, count=like.count // 2)
                fit = Course(unknown, observed, "linear", like).fit(value)
            if fit and all(abs(fit.value - other.value) > fit.error + other.error for other in fits):
                fits.append(fit)
        if any(fit.agreement.fits for fit in fits):
            break
    if not fits:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} predicts an attracting cycle with an interval of "
            f"{found.interval:.6g} s",
        )
    if any(fit.agreement.fits and fit.error > unknown.high - unknown.low for fit in fits):
        return _cannot(unknown, f"the interval does not depend on {unknown.name} here")
    nearest = max(fits, key=lambda fit: fit.agreement.probability)
    if not nearest.agreement.fits:
        return _nothing_fits(
            unknown,
            f"{unknown.name} = {nearest.value:.5g} gives the rhythm, but {nearest.agreement.words}",
            nearest.agreement,
        )
    fits = [fit for fit in fits if fit.agreement.fits]
    if refine:
        fits = [refine_fit(inverse, fit) for fit in fits]
    intervals = tuple((fit.value - fit.error, fit.value + fit.error) for fit in fits)
    shown = " or ".join(f"{fit.value:.6g} ± {fit.error:.1g}" for fit in fits)
    rate, sign = inverse.rate(fits[0].value)
    turned = ("", ", not mirrored", ", mirrored")[sign if found.sign else 0]
    words = f"{unknown.name} = {shown}, from a settled interval of {1 / rate:.7g} s{turned}."
    if len(fits) > 1:
        words += " These data do not distinguish the branches; outputs at the events, or a known initial state, would."
    if not nearest.agreement.predicted:
        words += " Amplitude and shape were not observed; only the regularity of the events could be compared."
    only = fits[0].value if len(fits) == 1 else None
    return _complete(unknown, only, intervals, "rhythm", words, nearest.agreement.probability)


def _from_sequence(unknown: Unknown, observed: Observed, plant: PlantKind, values: list[float]) -> Identification:
    course, few = Course(unknown, observed, plant), min(FEWEST - 1, len(observed.times))
    fits = [fit for value in values if (fit := course.fit(value, (2 * few,)))]
    if not any(fit.off <= _BAD_FIT for fit in fits):
        # later events are too far off where the value is; the first ones may be nearly those of another, too
        start, grid = Course(unknown, observed, "linear"), np.linspace(unknown.low, unknown.high, _POINTS)
        for i in _find_minima(np.array([start.distance(at, few) for at in grid])):
            if fit := course.fit(float(grid[i]), tuple(few * 2**k for k in range(12))):
                fits.append(fit)
                if fit.off <= _BAD_FIT:
                    break
    fit = min(fits, key=lambda fit: fit.cost, default=None)
    if fit is None or fit.off > _BAD_FIT:
        off = "" if fit is None else f": the best one is off by {100 * fit.off:.2g} % of an interval"
        return _cannot(unknown, f"no value between {unknown.low:g} and {unknown.high:g} gives these events{off}")
    if fit.error > unknown.high - unknown.low:
        return _cannot(unknown, f"the events do not depend on {unknown.name} here")
    how = fit.agreement
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
