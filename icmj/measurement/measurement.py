"""The motion of a simulation: the cycle on which it settled, or that it grew, decayed, wandered or was too short."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.environment import single_threaded
from icmj.measurement.motion import Measurement, MotionKind
from icmj.measurement.recurrence import Trend, closure, dominant_growth, separation, trend
from icmj.measurement.statistics import statistics
from icmj.simulation.simulation import Simulation

NOTHING = ": it starts at rest and nothing disturbs it; give it [simulation] initial or a disturbance"
MANY = 120  # events from which on an open motion is called quasi-periodic or irregular


@dataclass(frozen=True)
class _Return:
    """The return of the event sequence after ``q`` events with sign ``sign``."""

    q: int
    sign: int
    residuals: Array

    @property
    def p(self) -> int:
        return self.q if self.sign > 0 else 2 * self.q

    @property
    def name(self) -> str:
        return f"mirrored period-{self.p}" if self.sign < 0 else f"period-{self.p}"

    @property
    def residual(self) -> float:
        """Largest closure error of the last period."""
        return float(self.residuals[-self.p :].max())

    @property
    def fit(self) -> Trend:
        """Trend per period of the largest closure error in each of the last periods, three to thirty of them."""
        periods = min(max(len(self.residuals) // (2 * self.p), 3), 30, len(self.residuals) // self.p)
        return trend(self.residuals[-periods * self.p :].reshape(periods, self.p).max(axis=1))

    @property
    def converging(self) -> bool:
        """Whether the closure error clearly falls."""
        return self.residual < 0.5 and self.fit.clear and self.fit.ratio < 0.999

    def settled(self, tolerance: float, floor: float) -> bool:
        """Whether the remaining closure error is below ``tolerance`` and does not grow."""
        fit = self.fit
        if self.residual <= floor or not fit.clear:
            return True
        return fit.ratio < 1 and self.residual / (1 - fit.ratio) <= tolerance


@single_threaded()
def measure(
    simulation: Simulation, *, T_hat: Array, max_period: int = 8, tolerance: float = 1e-6, floor: float = 1e-11
) -> Measurement:
    """Classify the motion of ``simulation`` from the states x̄ = (x, x_o − T̂x) and the intervals at its events.

    A *cycle* is a return of x̄ and of the interval after p events that is seen three times, within ``tolerance`` of its
    limit: while the closure error decreases geometrically, its remainder (r/(1 − ratio)) must be below ``tolerance``;
    if it clearly grows, the motion is leaving the cycle. The smallest p for which the cycle closes is used.

    Args:
        simulation: a run on the linear plant or in MuJoCo, driven by events or a clock.
        T_hat: T̂, shape (n̂, n).
        max_period: largest number of events per period that is tried.
        tolerance: relative closure error that counts as settled.
        floor: closure error that is attributed to rounding, so that its trend is ignored.
    """
    K = len(simulation.events)
    events = simulation.events
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
    running = silence <= 1.5 * events.interval[-max_period:].max()
    returns = [
        _Return(q, sign, closure(states, events.interval, q, sign))
        for q in range(1, max_period + 1)
        for sign in (1, -1)
        if q * (1 if sign > 0 else 2) <= max_period and 3 * q * (1 if sign > 0 else 2) <= K
    ]
    returns.sort(key=lambda r: r.p)
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
    which |x̄| swings, is measured as sharply as a real one. NaN with fewer than six events or where the motion dies out.

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
        fit = candidate.fit
        if fit.clear and fit.ratio > 1.001 and floor < candidate.residual < 0.1:
            words = f"Too short to tell: it leaves a {candidate.name} cycle, by a factor {fit.ratio:.3f} per period."
            return _other(simulation, "too short", words)
    if K < MANY:
        words = f"Too short to tell: {K} events, no return within {tolerance:g} among them."
        return _other(simulation, "too short", words)
    growth = separation(states[-2 * K // 3 :])
    if growth < 1.03:
        words = (
            "Quasi-periodic: bounded, neighbouring motions stay neighbours, but no return within "
            f"{tolerance:g} after up to {returns[-1].p} events."
        )
        return _other(simulation, "quasi-periodic", words)
    words = f"Irregular: bounded, but neighbouring motions part by a factor {growth:.3f} per event."
    return _other(simulation, "irregular", words)


def _approach(simulation: Simulation, candidate: _Return, tolerance: float) -> str:
    residual, ratio = candidate.residual, candidate.fit.ratio
    periods = max(np.log(tolerance * (1 - ratio) / residual) / np.log(ratio), 1.0)
    more = periods * float(simulation.events.interval[-candidate.p :].sum())
    return (
        f"Too short to tell: approaching a {candidate.name} cycle, closure error {residual:.1e} falling by a factor "
        f"{ratio:.3f} per period; about {more:.2g} s more would settle it."
    )


def _other(simulation: Simulation, kind: MotionKind, words: str) -> Measurement:
    interval = simulation.events.interval
    return Measurement(
        kind=kind,
        p=None,
        mirrored=False,
        interval=float(interval[-10:].mean()) if len(interval) else None,
        intervals=np.zeros(0),
        period=None,
        amplitude=_amplitude(simulation, 10),
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


def _list(intervals: Array) -> str:
    return ", ".join(f"{d:.6g}" for d in intervals) + " s"
