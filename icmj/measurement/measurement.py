"""The motion of a simulation, classified by recurrence in the sequence of its states at events.

Closure after q steps, its trend, and the separation of neighbouring states tell whether it settled on a cycle, grew,
decayed or wandered, or was too short to tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount, amounts
from icmj.measurement.statistics import statistics
from icmj.simulation.simulation import Simulation

MotionKind = Literal[
    "cycle", "quasi-periodic", "irregular", "growth", "decay", "homoclinic", "noisy", "too short", "no events"
]


@dataclass(frozen=True, eq=False, repr=False)
class Measurement(WithCard):
    """The motion at the end of a run, read from its events.

    Attributes:
        kind: kind of the motion. ``homoclinic``: the last intervals grow while the state decays; ``noisy``: noise
            drives the motion, which is then described by its :mod:`icmj.measurement.statistics`.
        p: events per period, or ``None`` without a cycle. A mirrored cycle has an even p.
        mirrored: whether the second half of the cycle is the first with opposite sign.
        asymmetry: largest relative departure of the second half of a cycle of an even number of events from the mirror
            image of the first, of x̄ and of the intervals; NaN with an odd number or without a cycle.
        interval: mean open-loop interval over the last period [s]; of a quasi-periodic or irregular motion, over the
            second half of the events; of another motion without a cycle, over the last ten; under noise, over the
            run; ``None`` without events.
        intervals: the intervals of the last period [s], shape (p,); empty without a cycle.
        period: time after which the state repeats [s], or ``None``.
        amplitude: peak magnitude of every output over the last period or, without a cycle, over the intervals of
            ``interval`` and the rows that follow the last event; shape (n_y,).
        residual: largest relative closure error of the last period, of x̄ and of the intervals after p events (on
            a mirrored cycle after p/2 events, up to the sign); NaN without a cycle.
        words: the motion in one sentence.
        outputs, output_units: names and units of the outputs; empty if unknown.
    """

    kind: MotionKind
    p: int | None
    mirrored: bool
    interval: float | None
    intervals: Array
    period: float | None
    amplitude: Array
    residual: float
    words: str
    asymmetry: float = float("nan")
    outputs: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        name: str = self.kind
        if self.p is not None:
            name = f"{'mirrored ' if self.mirrored else ''}period-{self.p} cycle"
        interval = "" if self.interval is None else f", open-loop interval {amount(self.interval, 's')}"
        rows = (
            ("motion", name),
            ("period", amount(self.period, "s")),
            ("open-loop interval", amount(self.interval, "s")),
            ("peak of the outputs", amounts(self.amplitude, self.outputs, self.output_units)),
            ("closes to", amount(self.residual, figures=2)),
        )
        return Card(name + interval, rows, self.words)


MOST = 2000  # states that are compared pair by pair


@dataclass(frozen=True)
class Trend:
    """A fit of log r_i = a + i·log(ratio).

    Attributes:
        ratio: factor per step.
        clear: whether the fit explains more than 80 % of the variance.
        change: factor over all steps.
        steady: whether the first and the second half have the same slope: to a tenth of that of the whole, or to
            three standard errors. A speed that varies along a closed curve, or that slows down as 1/i does, has no
            such trend.
    """

    ratio: float
    clear: bool
    change: float = 1.0
    steady: bool = False


def closure(states: Array, intervals: Array, q: int, sign: int) -> Array:
    """Closure error after q steps, of states and intervals; shape (K − q,).

    It is the larger of |s_i − sign·s_{i−q}| and |Δ_i − Δ_{i−q}|, each relative to the larger of the two it compares.

    Args:
        states: shape (K, m).
        intervals: shape (K,).
        q: steps, at least 1.
        sign: +1, or −1 for a mirrored return.
    """
    return _apart((states[q:], intervals[q:]), (states[:-q], intervals[:-q]), sign)


def _apart(here: tuple[Array, Array], there: tuple[Array, Array], sign: int) -> Array:
    """Relative distance of states and intervals from others, which are one or as many; shape (K,)."""
    size = np.maximum(*(np.linalg.norm(states, axis=-1) for states, _ in (here, there)))
    gap = np.linalg.norm(here[0] - sign * there[0], axis=-1)
    state = np.divide(gap, size, out=np.full(size.shape, np.inf), where=size > 0)
    longer = np.maximum(np.maximum(here[1], there[1]), 1e-300)
    return np.maximum(state, np.abs(here[1] - there[1]) / longer)


def trend(values: Array) -> Trend:
    """Geometric trend of values ≥ 0; zeros count as the smallest normal number, infinite ones as the largest."""
    if len(values) < 3:
        return Trend(1.0, False)
    logs = np.log(np.clip(values, np.finfo(float).tiny, np.finfo(float).max))
    slope, _, explained = _line(logs)
    middle = len(logs) // 2
    (first, one, _), (second, other, _) = _line(logs[: middle + 1]), _line(logs[middle:])
    steady = abs(first - second) <= max(abs(slope) / 10, 3 * np.hypot(one, other))
    ratio, change = (float(np.exp(np.clip(slope * n, -700, 700))) for n in (1, len(logs) - 1))
    return Trend(ratio, explained > 0.8, change, bool(steady))


def _line(y: Array) -> tuple[float, float, float]:
    """Slope of a straight line, its standard error (0 of two points) and the share of the variance that it explains."""
    steps = np.arange(len(y)) - (len(y) - 1) / 2
    extent, variance = float(steps @ steps), float(((y - y.mean()) ** 2).sum())
    slope = float(steps @ y) / extent
    left = max(variance - slope**2 * extent, 0.0)
    error = np.sqrt(left / max(len(y) - 2, 1) / extent)
    return slope, float(error), slope**2 * extent / variance if variance > 0 else 0.0


def dominant_growth(states: Array, cut: float = 1e-6) -> float:
    """Largest |eigenvalue| of the linear map s_i ↦ s_{i+1} that fits best, all steps weighted alike.

    Args:
        states: shape (K, m), none of them zero.
        cut: directions in which the states extend less than this, relative to their largest extent, are left out;
            there the map cannot be told from round-off.
    """
    size = np.linalg.norm(states[:-1], axis=1)[:, None]
    U, extents, V = np.linalg.svd((states[:-1] / size).T, full_matrices=False)
    kept = extents > cut * extents[0]
    reduced = U[:, kept].T @ (states[1:] / size).T @ V[kept].T / extents[kept]
    return float(np.abs(np.linalg.eigvals(reduced)).max())


def separation(states: Array, ahead: int = 12, apart: int = 9) -> float:
    """Growth factor per step of the distance between neighbouring states (the largest Lyapunov exponent's e-power).

    Close to 1 on a quasi-periodic motion, clearly above 1 on an irregular one (Rosenstein, Collins & De Luca 1993).

    Args:
        states: shape (K, m), K > ahead + apart; of very many the last :data:`MOST` are looked at, pair by pair.
        ahead: steps over which the distance is followed.
        apart: least number of steps between neighbours.
    """
    states = states[-MOST:]
    count = len(states) - ahead
    distance = np.linalg.norm(states[:count, None] - states[None, :count], axis=2)
    near_in_time = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) < apart
    distance[near_in_time] = np.inf
    neighbour = distance.argmin(axis=1)
    # the closest pairs have most room to part before they are as far apart as the motion is wide
    closest = np.argsort(distance[np.arange(count), neighbour])[: max(count // 3, 5)]
    steps = np.arange(ahead + 1)
    gaps = np.linalg.norm(states[closest[:, None] + steps] - states[neighbour[closest][:, None] + steps], axis=2)
    typical = np.median(np.log(np.maximum(gaps, 1e-300)), axis=0)
    return float(np.exp(np.polyfit(steps, typical, 1)[0]))


NOTHING = ": it starts at rest and nothing disturbs it; give it [simulation] initial or a disturbance"
MANY = 120  # events from which on an open motion is called quasi-periodic or irregular
SHORT = 8  # events of a period of which every return is looked at; of longer ones those that are close
_CLOSE = 0.01  # closure error of the last event on a longer cycle
_SEEN = 6  # periods of a longer cycle, to tell where it leads
_SLOW = 1 / 15  # change per period of log closure error that shows in a longer part of the run than others
_CHANGED = 0.9  # factor of the closure error by which it has changed
_AWAY = 0.5  # of the state: distance from a cycle beyond which none is approached or left


@dataclass(frozen=True)
class _Return:
    """The return of the event sequence after ``q`` events with sign ``sign``."""

    q: int
    sign: int
    states: Array
    intervals: Array

    @cached_property
    def residuals(self) -> Array:
        """Closure error after q events, shape (K − q,)."""
        return closure(self.states, self.intervals, self.q, self.sign)

    @property
    def p(self) -> int:
        return self.q if self.sign > 0 else 2 * self.q

    @property
    def name(self) -> str:
        return f"mirrored period-{self.p}" if self.sign < 0 else f"period-{self.p}"

    @cached_property
    def residual(self) -> float:
        """Largest closure error of the last period."""
        return float(self.residuals[-self.p :].max())

    @cached_property
    def fit(self) -> Trend:
        """Trend per period of the largest closure error in each of the last periods, three to thirty of them."""
        return self._fit(30)

    def _fit(self, most: int) -> Trend:
        periods = min(max(len(self.residuals) // (2 * self.p), 3), most, len(self.residuals) // self.p)
        return trend(self.residuals[-periods * self.p :].reshape(periods, self.p).max(axis=1))

    def leads(self, way: int) -> bool:
        """Whether the motion approaches a cycle (way −1) or leaves it (+1): the closure error is geometric.

        Its sum to the end, or from the beginning, is the distance from the cycle; after two turns it is so even if
        turns alternate. A motion on a closed curve near a resonance returns with an error that also rises and falls,
        but that has no steady ratio, or not for long, or adds up to more than the curve is wide: of random circle maps
        near resonances at most 2 % are taken for an approach or a departure.
        """
        fit = self.fit
        if abs(np.log(fit.ratio)) < _SLOW:
            fit = self._fit(len(self.residuals))
        ratio, change = (fit.ratio, fit.change) if way < 0 else (1 / fit.ratio, 1 / fit.change)
        known = self.p <= SHORT or len(self.states) >= _SEEN * self.p
        if not (known and fit.clear and fit.steady and change < _CHANGED):
            return False
        twice = closure(self.states, self.intervals, 2 * self.q, 1)[-self.p :].max()
        return bool(min(self.residual / (1 - ratio), twice / (1 - ratio**2)) < _AWAY)

    @property
    def converging(self) -> bool:
        """Whether the closure error clearly falls."""
        return self.leads(-1)

    def settled(self, tolerance: float, floor: float) -> bool:
        """Whether the remaining closure error is below ``tolerance`` and does not grow."""
        fit = self.fit
        if self.residual <= floor or not fit.clear:
            return True
        return fit.ratio < 1 and self.residual / (1 - fit.ratio) <= tolerance


@limit_to_one_thread()
def measure(
    simulation: Simulation,
    *,
    T_hat: Array | None = None,
    max_period: int = 1000,
    tolerance: float = 1e-6,
    floor: float = 1e-11,
) -> Measurement:
    """Classify the motion of ``simulation`` from the states x̄ = (x, x_o − T̂x) and the intervals at its events.

    A *cycle* is a return of x̄ and of the interval after p events that is seen three times, within ``tolerance`` of its
    limit: while the closure error decreases geometrically, its remainder (r/(1 − ratio)) must be below ``tolerance``;
    if it clearly grows, the motion is leaving the cycle. The smallest p for which the cycle closes is used.

    Args:
        simulation: a run on the linear plant or in MuJoCo, driven by events or a clock.
        T_hat: T̂, shape (n̂, n); ``None`` where there is no model that it could be of: zero.
        max_period: largest number of events per period that is tried.
        tolerance: relative closure error that counts as settled.
        floor: closure error that is attributed to rounding, so that its trend is ignored.
    """
    K = len(simulation.events)
    events = simulation.events
    T_hat = np.zeros((events.x_o.shape[1], simulation.x.shape[1])) if T_hat is None else T_hat
    states = event_states(simulation, T_hat)
    if simulation.outcome.kind in ("fell", "diverged"):
        return _other(simulation, "growth", f"No cycle: the run {simulation.outcome.message}.")
    if simulation.outcome.kind == "stalled":
        return _other(simulation, "too short", f"Too short to tell: the run {simulation.outcome.message}.")
    told = statistics(simulation) if simulation.noisy else None
    if told is not None:
        interval = None if told.interval is None else told.interval.value
        return replace(_other(simulation, "noisy", told.words), interval=interval)
    if K == 0:
        why = NOTHING if _at_rest(simulation) else ""
        return _other(simulation, "no events", f"No event in {simulation.outcome.t:g} s{why}.")
    if _homoclinic(simulation, states):
        last = ", ".join(f"{d:.3g}" for d in events.interval[-4:])
        return _other(
            simulation,
            "homoclinic",
            f"No limit cycle: the open-loop interval grows without bound (last {last} s) and the state decays.",
        )
    silence = simulation.outcome.t - events.t[-1]
    running = silence <= 1.5 * events.interval[-max(SHORT, K // 2) :].max()
    returns = _returns(states, events.interval, min(max_period, K // 3))
    for candidate in returns if running else []:
        if candidate.residual < tolerance and candidate.settled(tolerance, floor):
            # a cycle approached with alternating sign closes after two turns long before it does after one
            finest = next(
                r
                for r in returns
                if candidate.p % r.p == 0 and (r is candidate or r.residual < tolerance or r.converging)
            )
            if finest.residual < tolerance:
                return _cycle(simulation, states, finest)
            break
    return _open(simulation, states, returns, running, tolerance, floor)


def _returns(states: Array, intervals: Array, longest: int) -> list[_Return]:
    """Returns after at most so many events, by rising period: all of the short ones, of others those that are close."""
    found = []
    for sign, most in ((-1, longest // 2), (1, longest)):
        before = states[-most - 1 : -1][::-1], intervals[-most - 1 : -1][::-1]
        last = _apart((states[-1:], intervals[-1:]), before, sign) if most else np.zeros(0)
        steps = np.arange(1, most + 1)
        for q in steps[(steps * (1 if sign > 0 else 2) <= SHORT) | (last < _CLOSE)]:
            found.append(_Return(int(q), sign, states, intervals))
    return sorted(found, key=lambda one: one.p)


def _at_rest(simulation: Simulation) -> bool:
    """Whether the run starts at the operating point and no input acts on it."""
    beside = simulation.applied.size and not np.array_equal(simulation.applied, simulation.u)
    return not (simulation.x[:1].any() or simulation.x_o[:1].any() or beside or simulation.pushed.any())


def reduced_states(x: Array, x_o: Array, T_hat: Array, x_h: Array | None = None) -> Array:
    """x̄ = (x, x_o − T̂x), which a reset does not change; shapes (..., n), (..., n̂), (n̂, n) → (..., n + n̂).

    With a delay the whole state at an event has x_h − T̂x, too: give x_h, and the shape is (..., n + 2n̂).
    """
    seen = x @ np.asarray(T_hat, float).T
    return np.concatenate([x, x_o - seen, *([] if x_h is None else [x_h - seen])], axis=-1)


def event_states(simulation: Simulation, T_hat: Array) -> Array:
    """The states at the events between which φ maps, shape (K, n + n̂), with a delay (K, n + 2n̂)."""
    events = simulation.events
    return reduced_states(events.x, events.x_o, T_hat, events.x_h if simulation.delay else None)


def measured_gamma(simulation: Simulation, V_inv: NDArray[np.complex128], T_hat: Array) -> float:
    """γ = |χ_k1| at the events, the mean of the last two (eq. gamma); NaN with fewer than two events.

    Args:
        simulation: a run that has settled on the predicted cycle.
        V_inv: rows map the state at events to χ, the critical one first.
        T_hat: T̂, shape (n̂, n).
    """
    states = event_states(simulation, T_hat)
    return float(np.abs(states[-2:] @ V_inv[0]).mean()) if len(states) >= 2 else float("nan")


def growth_per_interval(states: Array) -> float:
    """Growth factor of x̄ per interval over the second half of the events: a point of panel (a) under the clock.

    It is the largest |eigenvalue| of the linear map that best takes each x̄ to the next, so that a complex pair, under
    which |x̄| swings, is measured as sharply as a real one. NaN with fewer than six events or where the motion dies
    out.

    Args:
        states: x̄ at successive events, shape (K, n + n̂).
    """
    recent = states[len(states) // 2 :]
    size = np.linalg.norm(recent, axis=1)
    if len(recent) < 3 or not (size.min() > 0 and np.isfinite(size).all()):
        return float("nan")
    return dominant_growth(recent)


def _homoclinic(simulation: Simulation, states: Array) -> bool:
    """Whether each of the last four intervals is at least 1.3 times the one before, and nothing grows."""
    interval = simulation.events.interval
    if simulation.control != "event" or len(interval) < 4:
        return False
    still = simulation.outcome.t - simulation.events.t[-1]
    growing = np.all(interval[-3:] >= 1.3 * interval[-4:-1])
    size = np.linalg.norm(states[-4:], axis=1)
    longest = max(interval[-1], still)
    return bool(growing and size[-1] <= 2 * size[0] and longest >= 5 * np.median(interval))


def _cycle(simulation: Simulation, states: Array, found: _Return) -> Measurement:
    p, residual, name = found.p, found.residual, found.name
    intervals = simulation.events.interval[-p:]
    asymmetry = np.nan if p % 2 else float(closure(states, simulation.events.interval, p // 2, -1)[-p:].max())
    period = float(intervals.sum())
    rhythm = f"{intervals.mean():.6g} s" if np.ptp(intervals) < 1e-5 * period else _list(intervals)
    if p > SHORT:
        rhythm = f"{intervals.min():.6g} to {intervals.max():.6g} s, mean {intervals.mean():.6g} s"
    return Measurement(
        kind="cycle",
        p=p,
        mirrored=found.sign < 0,
        interval=float(intervals.mean()),
        intervals=intervals,
        period=period,
        amplitude=_amplitude(simulation, p),
        residual=residual,
        asymmetry=asymmetry,
        outputs=simulation.labels.outputs,
        output_units=simulation.labels.output_units,
        words=f"Settled on a {name} cycle of {period:.6g} s, open-loop interval {rhythm}; it closes to {residual:.1e}.",
    )


def _open(
    simulation: Simulation, states: Array, returns: list[_Return], running: bool, tolerance: float, floor: float
) -> Measurement:
    """The classification of a motion that has not closed."""
    K = len(states)
    if not running:
        silence = simulation.outcome.t - simulation.events.t[-1]
        left = float(np.linalg.norm(simulation.x[-1])) / max(float(np.linalg.norm(simulation.events.x[-1])), 1e-300)
        what = f"no event in the last {silence:.3g} s, longer than any interval before"
        if left < 1e-3:
            words = f"The motion decays: {what}, and the state has fallen to {left:.1e} of what it was at the last."
            return _other(simulation, "decay", words)
        return _other(simulation, "too short", f"Too short to tell: {what}.")
    size = np.linalg.norm(states[K // 2 :], axis=1)
    overall = trend(size)
    lasting = overall.clear and abs(np.log(overall.ratio)) * len(size) > np.log(3)
    if lasting and overall.ratio > 1:
        return _other(simulation, "growth", f"The motion grows by a factor {overall.ratio:.4g} per event.")
    # the event rule keeps the state about the size of the threshold: there a fall is a transient, not a decay
    if lasting and simulation.control != "event":
        return _other(simulation, "decay", f"The motion decays by a factor {overall.ratio:.4g} per event.")
    for candidate in returns:
        if candidate.converging:
            return _other(simulation, "too short", _approach(simulation, candidate, tolerance))
        if candidate.leads(1) and floor < candidate.residual < 0.1:
            ratio = candidate.fit.ratio
            words = f"Too short to tell: it leaves a {candidate.name} cycle, by a factor {ratio:.3f} per period."
            return _other(simulation, "too short", words)
    if K < MANY:
        words = f"Too short to tell: {K} events, no return within {tolerance:g} among them."
        return _other(simulation, "too short", words)
    for candidate in _returns(states, simulation.events.interval, 2 * K // 3):
        if candidate.residuals[-SHORT:].max() < tolerance:
            words = (
                f"Too short to tell: the last {SHORT} events are as {candidate.q} before, which is not seen for long."
            )
            return _other(simulation, "too short", words)
    growth = separation(states[-2 * K // 3 :])
    if growth < 1.03:
        words = (
            "Quasi-periodic: bounded, neighbouring motions stay neighbours, but no return within "
            f"{tolerance:g} after up to {K // 3} events."
        )
        return _other(simulation, "quasi-periodic", words, K - K // 2)
    words = f"Irregular: bounded, but neighbouring motions part by a factor {growth:.3f} per event."
    return _other(simulation, "irregular", words, K - K // 2)


def _approach(simulation: Simulation, candidate: _Return, tolerance: float) -> str:
    residual, ratio = candidate.residual, candidate.fit.ratio
    periods = max(np.log(tolerance * (1 - ratio) / residual) / np.log(ratio), 1.0)
    more = periods * float(simulation.events.interval[-candidate.p :].sum())
    return (
        f"Too short to tell: approaching a {candidate.name} cycle, closure error {residual:.1e} falling by a factor "
        f"{ratio:.3f} per period; about {more:.2g} s more would settle it."
    )


def _other(simulation: Simulation, kind: MotionKind, words: str, last: int = 10) -> Measurement:
    """A motion without a cycle, with interval and amplitude over its last events."""
    interval = simulation.events.interval
    return Measurement(
        kind=kind,
        p=None,
        mirrored=False,
        interval=float(interval[-last:].mean()) if len(interval) else None,
        intervals=np.zeros(0),
        period=None,
        amplitude=np.maximum(_amplitude(simulation, last), _peak_since(simulation)),
        residual=float("nan"),
        words=words,
        outputs=simulation.labels.outputs,
        output_units=simulation.labels.output_units,
    )


def _amplitude(simulation: Simulation, last: int) -> Array:
    """Peak of every output over the last intervals; over the second half of the rows without events."""
    events = simulation.events
    if len(events) == 0:
        return np.abs(simulation.y[len(simulation.y) // 2 :]).max(axis=0)
    return np.maximum(np.abs(events.y_max[-last:]), np.abs(events.y_min[-last:])).max(axis=0)


def _peak_since(simulation: Simulation) -> Array:
    """Peak of every output over the rows from the last event on; zero where there is none."""
    start = simulation.events.t[-1] if len(simulation.events) else np.inf
    return np.abs(simulation.y[simulation.t >= start]).max(axis=0, initial=0.0)


def _list(intervals: Array) -> str:
    return ", ".join(f"{d:.6g}" for d in intervals) + " s"
