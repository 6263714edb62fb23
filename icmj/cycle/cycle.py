"""A cycle of the simulated loop, attracting or not, with its multipliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import Case, expect_rule, expect_theory
from icmj.case.plants import linear_plant
from icmj.cycle.guess import Guess, guess_from_prediction, guess_from_simulation
from icmj.cycle.jacobian import compute_jacobian, compute_multipliers, difference_jacobian
from icmj.cycle.newton import ClosedCycle, solve_newton, solve_shortest
from icmj.cycle.return_map import LostInterval, PlantKind, ReturnMap, Turn
from icmj.errors import CycleError, prefix_errors

Start = Literal["auto", "prediction", "simulation"]
Verdict = Literal["attracting", "family", "marginal", "repelling"]
LONGEST = 20.0  # of the first guess's intervals: a flight this long without an event does not come back
_SAME = 1e-7  # relative: a state that closes this well after fewer events shows the shorter period


@dataclass(frozen=True, eq=False)
class Cycle:
    """A periodic orbit of the event-driven loop.

    Attributes:
        plant: ``linear`` or ``mujoco``.
        events: number of events per period; a mirrored cycle has twice as many as ``intervals``.
        mirrored: whether its second half is the first with opposite sign.
        intervals: open-loop intervals over the period, or over its first half if it is mirrored [s], shape (p,).
        period: time after which the state repeats [s].
        states: z = (x, x_o), with a delay (x, x_o, x_h), at the event that begins each interval, deviations from the
            operating point; shape (p, N).
        scale: size of each state on the cycle, shape (N,); closure and differences are relative to it.
        y_peak: largest magnitude of every output over the period, shape (n_y,).
        y_range: peak-to-peak range of every output over the period, shape (n_y,).
        J: derivative of the return map P over ``intervals``, shape (N, N). On a mirrored cycle −P returns the state,
            but J is the derivative of P, as in the linear theory.
        multipliers: eigenvalues of J, by decreasing magnitude, shape (N,).
        multiplier_errors: error estimate of each multiplier, shape (N,).
        closure: largest |±P(z) − z| relative to ``scale``.
        history: closures of Newton's iterates, the first guess first.
        interval_error: relative error of the mean interval due to the step of the integrator; 0 on the linear plant.
        neutral: number of directions in which the cycle is not isolated; their multipliers are ±1.
        alternating: whether it is a mirrored one of a family of cycles of two unequal intervals, as with a zero-order
            hold and no predicted delay; one multiplier is then +1 by the structure of the loop.
        mixed: whether it is one of a family of mixtures of several shapes, whose directions are among the ``neutral``.
    """

    plant: PlantKind
    events: int
    mirrored: bool
    intervals: Array
    period: float
    states: Array
    scale: Array
    y_peak: Array
    y_range: Array
    J: Array
    multipliers: NDArray[np.complex128]
    multiplier_errors: Array
    closure: float
    history: tuple[float, ...]
    interval_error: float = 0.0
    neutral: int = 0
    alternating: bool = False
    mixed: bool = False

    @property
    def sign(self) -> int:
        """−1 for a mirrored cycle, else +1."""
        return -1 if self.mirrored else 1

    @property
    def interval(self) -> float:
        """Mean open-loop interval [s]."""
        return float(self.intervals.mean())

    @property
    def isolated(self) -> NDArray[np.complex128]:
        """The multipliers without those of neutral modes, and without the +1 of a family."""
        gap = np.abs(self.multipliers - self.sign)
        left = self.multipliers[np.sort(np.argsort(gap)[self.neutral :])] if self.neutral else self.multipliers
        return np.delete(left, np.abs(left - 1).argmin()) if self.alternating else left

    @property
    def attracting(self) -> bool:
        """Whether all multipliers, except those that are ±1 by construction, are inside the circle beyond rounding."""
        return bool(np.abs(self.isolated).max(initial=0.0) < 1 - RELATIVE_ROUNDING)

    @property
    def verdict(self) -> Verdict:
        """What runs beside it do: settle on it, settle beside it on others of its family, or leave it."""
        if self.attracting:
            return "family" if self.alternating or self.mixed else "attracting"
        return "marginal" if np.abs(self.isolated).max(initial=0.0) <= 1 + RELATIVE_ROUNDING else "repelling"

    @property
    def name(self) -> str:
        """A description, such as ``mirrored period-2 cycle``."""
        return f"{'mirrored ' if self.mirrored else ''}period-{self.events} cycle"

    @property
    def words(self) -> str:
        """The cycle in one sentence."""
        kind = {"attracting": "An attracting", "family": "A", "marginal": "A marginal", "repelling": "A repelling"}
        rhythm = ", ".join(f"{interval:.6g}" for interval in self.intervals)
        told = f", modulo {self.neutral} neutral" if self.neutral else ""
        for kin, there in (("cycles of unequal intervals", self.alternating), ("mixtures of shapes", self.mixed)):
            told += f", modulo the family of {kin} that it is one of" if there else ""
        told += ", on another of which a run that starts beside it settles" if self.verdict == "family" else ""
        if self.verdict == "marginal":
            told += ", which is 1 up to rounding, so that attraction cannot be decided"
        return (
            f"{kind[self.verdict]} {self.name} of {self.period:.6g} s, open-loop interval {rhythm} s, largest "
            f"multiplier {abs(self.isolated[0]):.4g}{told}."
        )


@limit_to_one_thread()
def find_cycle(
    case: Case,
    plant: PlantKind = "mujoco",
    *,
    start: Start | Guess = "auto",
    size: float | None = None,
    limit: float | None = None,
    refinement: float = 1.0,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Cycle:
    """The cycle of a case that is nearest to a first guess, by Newton's method on the return map.

    Like the prediction, it is that of r = 0, as the notices of a case with a set-point say.

    Args:
        case: the case.
        plant: ``linear`` or ``mujoco``.
        start: the first guess: the linear ``prediction``, the end of a ``simulation`` of the run file, your own guess,
            or ``auto``, which is the prediction if it has an orbit, and otherwise the simulation.
        size: threshold instead of the case's [unit of the weighted state].
        limit: limit on all positions, instead of that of the run file [rad or m].
        refinement: factor on the timestep.
        threads: number of threads that compute differences in parallel.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        CycleError: if there is no cycle near the guess, with the reason, or if a disturbance changes in time.
        SimulationError: if a flight cannot be prepared.
    """
    law, theory = expect_rule(case, "find_cycle"), expect_theory(case, "find_cycle")
    rule = theory.rule if size is None else theory.rule.resized(size)
    settings = replace(case.settings, limit=case.settings.limit if limit is None else limit)
    actual = linear_plant(case.actual, settings) if plant == "linear" else case.model
    controller = replace(law.triggered_by(rule), setpoint=None)
    loop = ReturnMap(actual, controller, settings).refine(refinement)
    orbit = theory.prediction.orbit
    if start == "auto":
        start = "prediction" if orbit is not None and np.isfinite(orbit.gamma) else "simulation"
    tell, begun = progress or (lambda done: None), 0.1
    tell(begun)
    if start == "prediction":
        with prefix_errors(case.run.path):
            guess = guess_from_prediction(theory, loop, rule.size)
    elif start == "simulation":
        begun = 0.5
        guess = guess_from_simulation(loop, theory.system.T_hat, lambda done: tell(0.1 + 0.4 * done))
    else:
        guess = start
    loop = replace(loop, settings=replace(loop.settings, duration=LONGEST * guess.longest))
    try:
        found = solve_cycle(loop, guess, lambda done: tell(begun + (1 - begun) * done), threads)
    except CycleError as error:
        why = f"; of the predicted orbit: {orbit.reason}" if orbit and orbit.reason and start == "prediction" else ""
        raise CycleError(f"{case.run.path}: {error}{why}") from error
    return replace(found, mixed=found.neutral > 0 and theory.prediction.family is not None)


def close_cycle(loop: ReturnMap, guess: Guess, progress: Callable[[float], None] | None = None) -> ClosedCycle:
    """The cycle nearest to ``guess`` without its multipliers.

    Raises:
        CycleError: if there is none, or the event rule no longer ends one of its intervals.
    """

    def derivative(turn: Turn) -> Array:
        return compute_jacobian(loop, turn, guess.scale)

    found = solve_newton(loop, guess.z, guess.scale, derivative, p=guess.p, sign=guess.sign, progress=progress)
    if any(loop.has_collapsed(interval) for interval in found.turn.intervals):
        least = loop.controller.least
        raise CycleError(f"no cycle of the event rule, because an interval has decreased to the least one, {least:g} s")
    return found


def solve_cycle(loop: ReturnMap, guess: Guess, progress: Callable[[float], None], threads: int = 1) -> Cycle:
    """The cycle nearest to ``guess``, with multipliers by differences of flights.

    Raises:
        CycleError: if there is none.
    """
    scale = guess.scale
    found = close_cycle(loop, guess, lambda done: progress(0.6 * done))
    found, p, sign = reduce_period(loop, found, guess.p, guess.sign, scale)
    J = difference_jacobian(loop, found.z, scale, p, threads=threads, rounding=found.closure)
    values, errors = compute_multipliers(J, scale)
    peak, spread = found.turn.extent(sign)
    return Cycle(
        plant=loop.kind,
        events=p if sign > 0 else 2 * p,
        mirrored=sign < 0,
        intervals=found.turn.intervals,
        period=float(found.turn.intervals.sum() * (1 if sign > 0 else 2)),
        states=found.turn.states,
        scale=scale,
        y_peak=peak,
        y_range=spread,
        J=J.J,
        multipliers=values,
        multiplier_errors=errors,
        closure=found.closure,
        history=found.history,
        interval_error=estimate_interval_error(loop, found, p, sign, scale, J.J),
        neutral=found.neutral,
        alternating=loop.is_alternating(p, sign),
    )


def estimate_interval_error(loop: ReturnMap, found: ClosedCycle, p: int, sign: int, scale: Array, J: Array) -> float:
    """Relative error of the mean interval due to the timestep, estimated from the cycle at half the timestep.

    The cycle at half the step is one Newton step away, with the same derivative.
    """
    if loop.kind == "linear":
        return 0.0
    finer = loop.refine(0.5)
    try:
        turn = finer.turn(found.z, p)
        step, _ = solve_shortest(
            (sign * J - np.eye(len(J))) * (scale[None, :] / scale[:, None]), (found.z - sign * turn.end) / scale
        )
        turn = finer.turn(found.z + step * scale, p)
    except LostInterval:
        return float("nan")
    return float(abs(turn.intervals.mean() / found.turn.intervals.mean() - 1) * 16 / 15)


def reduce_period(loop: ReturnMap, found: ClosedCycle, p: int, sign: int, scale: Array) -> tuple[ClosedCycle, int, int]:
    """The same cycle with its smallest number of intervals."""
    states, mirror = found.turn.states, loop.odd(found.z, scale)
    for q in range(1, p + 1):
        for s in (1, -1):
            if (q, s) == (p, sign) or p % q or (s < 0 and not mirror):
                continue
            if (q < p and s ** (p // q) != sign) or (q == p and not (sign > 0 > s)):
                continue
            closing = states[q] if q < p else found.turn.end
            if np.abs(s * closing - found.z).max() < _SAME * np.abs(found.z).max():
                turn = loop.turn(found.z, q)
                closure = float((np.abs(s * turn.end - found.z) / scale).max())
                return replace(found, turn=turn, closure=closure), q, s
    return found, p, sign
