"""First guesses of a cycle: from the linear prediction, or from the end of a simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Theory, simulate_plant
from icmj.cycle.newton import _MOST_EVENTS, _QUIET
from icmj.cycle.return_map import ReturnMap
from icmj.errors import CycleError
from icmj.measurement.measurement import closure, event_states, measure


@dataclass(frozen=True, eq=False)
class Guess:
    """A first guess of a cycle.

    Attributes:
        z: state at an event, departures from the operating point; shape (N,).
        scale: size of each state on the cycle, positive, shape (N,).
        p: number of intervals after which it returns.
        sign: −1 if it returns as its mirror image.
        longest: its longest interval [s].
    """

    z: Array
    scale: Array
    p: int
    sign: int
    longest: float


def guess_from_prediction(theory: Theory, loop: ReturnMap, size: float) -> Guess:
    """The linear orbit at the threshold ``size``.

    Raises:
        CycleError: if the theory has none.
    """
    orbit, system = theory.prediction.orbit, theory.system
    if orbit is None or not np.isfinite(orbit.gamma):
        why = "the linear theory has no orbit" if orbit is None else orbit.reason
        raise CycleError(f"{why}; start from a simulation")
    factor = size / theory.rule.size
    parts = system.start(orbit.x_bar * factor)
    z = loop.join(*parts)
    n, m = system.n, system.n_hat
    X = np.abs(system.to_original(orbit.X) * factor).max(axis=0)
    scale = make_positive(loop.join(X[:n], X[n : n + m], X[n + m :]))
    sign, p = orbit.sign, 1
    if sign < 0 and not loop.odd(z, scale):
        sign, p = 1, 2  # no mirror image: nearly mirrored halves
    return Guess(z, scale, p, sign, orbit.delta)


def guess_from_simulation(loop: ReturnMap, T_hat: Array, progress: Callable[[float], None] | None = None) -> Guess:
    """The approximate return to an earlier state at the end of a run.

    Raises:
        CycleError: if the run has no events, falls, or diverges.
    """
    run = simulate_plant(loop.plant, loop.controller, loop.settings, progress=progress, match="position")
    K = len(run.events)
    if run.outcome.kind not in ("completed", "sliding") or K < 4:
        raise CycleError(f"no cycle to start from: the run {run.outcome.message}, after {K} events")
    measured = measure(run, T_hat=T_hat)
    if measured.kind in ("homoclinic", "growth", "decay"):
        raise CycleError(f"no cycle to start from. {measured.words}")
    states = event_states(run, T_hat)
    if measured.p is not None:
        sign = -1 if measured.mirrored else 1
        p = measured.p // 2 if measured.mirrored else measured.p
    else:
        ways = [(q, s) for q in range(1, min(_MOST_EVENTS, K // 3) + 1) for s in (1, -1)]
        # a longer period must close clearly better
        p, sign = min(ways, key=lambda way: closure(states, run.events.interval, *way)[-way[0] :].max() * 1.5 ** way[0])
    events = run.events
    z = loop.join(events.x[-1], events.x_o[-1], events.x_h[-1])
    late = run.t >= events.t[-min(2 * p + 1, K)]
    scale = make_positive(loop.join(*(np.abs(part[late]).max(axis=0) for part in (run.x, run.x_o, run.x_h))))
    return Guess(z, scale, p, sign, float(events.interval[-2 * p :].max()))


def make_positive(scale: Array) -> Array:
    """The scale, with a small positive number for states that do not move."""
    good = np.isfinite(scale) & (scale > 0)
    if not good.any():
        raise CycleError("no cycle to start from: nothing moves")
    least = _QUIET * float(np.median(scale[good]))
    return np.where(good, np.maximum(scale, 1e-6 * least), least)
