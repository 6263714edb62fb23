"""Outcomes of a run: the same rules and words for both simulators.

One open-loop interval as a function: from the state at an event to the state at the next, without a recording.

Both simulators provide it. Growth, amplitude law, attractors and accuracy use it, as does code that iterates or
differentiates the return map. Its course gives the states at any time, and the variational equation along it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from icmj.base.array import Array, Positive
from icmj.controller.controller import Controller
from icmj.errors import SimulationError

Limit = Positive | Mapping[str, Positive] | None
"""How far positions may depart: one number for all, or by name, or what fits their units."""
UNITS: Mapping[str, float] = {
    "rad": 1.0, "mrad": 1e3, "deg": 180 / np.pi, "°": 180 / np.pi, "rev": 0.5 / np.pi,
    "m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "µm": 1e6, "km": 1e-3, "in": 1 / 0.0254, "ft": 1 / 0.3048,
}  # fmt: skip
"""One radian, or one metre, in units of angle and length."""
OutcomeKind = Literal["completed", "fell", "diverged", "interrupted", "sliding", "stalled"]

WINDOW = 5000  # events over which their pace is taken
MOST_EVENTS = 1e7  # more than these in a run, at the pace of the last window, and it gets nowhere
SLIDING = 20  # successive intervals at Δ_min at the end of a run that are called sliding


@dataclass(frozen=True)
class Outcome:
    """How a simulation ended.

    Attributes:
        kind: ``completed``; ``fell`` (a position passed the limit in the settings); ``diverged`` (not finite, or
            an engine warning); ``interrupted``; ``sliding`` (every interval collapsed to Δ_min);
            ``stalled`` (events come so fast that time does not go on).
        t: when [s].
        message: what the run did, to be read after "The run": ``ran to 40 s``.
    """

    kind: OutcomeKind
    t: float
    message: str


def fell(t: float, state: str, limit: float, unit: str = "") -> Outcome:
    """A position departed further than its limit."""
    return Outcome(
        "fell", t, f"fell at {t:.6g} s: {state} departed further than its limit of {limit:g} {unit}".rstrip()
    )


def limits_of(limit: Limit, positions: Sequence[str], units: Sequence[str]) -> Array:
    """The deviation that each position may have [its own unit]; infinite if there is no limit.

    Args:
        limit: one number is of all [rad or m], and stands for as much in another unit of angle or length; of any other
            unit, or none, it is the number itself. By name it is in the position's own unit, and the others have 1 rad
            or 1 m, as all have for ``None``: what is neither an angle nor a length has no limit then.
        positions: names, P of them.
        units: of each; "" where it is not known.

    Returns:
        shape (P,).

    Raises:
        SimulationError: if a name is none of the positions.
    """
    sizes = [UNITS.get(unit, np.inf) for unit in units]
    if isinstance(limit, Mapping):
        for name in limit:
            if name not in positions:
                raise SimulationError(
                    f"limit: no position {name!r} in the plant; expected one of {', '.join(positions)}"
                )
        sizes = [limit.get(name, size) for name, size in zip(positions, sizes, strict=True)]
    elif limit is not None:
        sizes = [limit * (size if np.isfinite(size) else 1.0) for size in sizes]
    return np.array(sizes, dtype=float)


def diverged(t: float, why: str) -> Outcome:
    """The outcome of a run whose numbers are not finite, or in which the engine failed."""
    return Outcome("diverged", t, f"diverged at {t:.6g} s: {why}")


def interrupted(t: float, duration: float) -> Outcome:
    """The outcome of a run that the user interrupted."""
    return Outcome("interrupted", t, f"was interrupted at {t:.6g} s of {duration:g} s")


def stalled(t: float, took: float | None = None) -> Outcome:
    """The outcome of a run in which too many events occur in too little time, ``took`` [s]; or too many switches."""
    if took is None:
        return Outcome(
            "stalled",
            t,
            f"stalled at {t:.6g} s: the modes of the controller switch to and fro without an end; make the next switch "
            "depend on more than the guard that has just changed, or on a delay",
        )
    return Outcome(
        "stalled",
        t,
        f"stalled at {t:.6g} s: {WINDOW} events in the last {took:.2g} s; give it a delta_min, or a higher threshold",
    )


class EventPace:
    """Detects events so frequent that a run makes no progress, because the hold error passes its threshold at once."""

    def __init__(self, duration: float) -> None:
        self._least = duration / MOST_EVENTS * WINDOW
        self._times: list[float] = []

    def stalled(self, *times: float) -> float | None:
        """Add the times of events [s]; how long the last window took [s] if that is too little, else ``None``."""
        self._times += times
        if len(self._times) < WINDOW:
            return None
        took = self._times[-1] - self._times[-WINDOW]
        self._times = self._times[1 - WINDOW :]
        return took if took < self._least else None


def ran(duration: float, intervals: Array, delta_min: float) -> Outcome:
    """The outcome of a run that reached its end: completed, or sliding if its last :data:`SLIDING` intervals are Δ_min.

    Args:
        duration: [s].
        intervals: open-loop intervals of the whole run [s], shape (K,).
        delta_min: the least interval, Δ_min or a longer delay [s]; 0 if there is none.
    """
    longer = np.flatnonzero(intervals > delta_min * (1 + 1e-9) + 1e-12)
    collapsed = len(intervals) - (int(longer[-1]) + 1 if len(longer) else 0)
    if delta_min > 0 and collapsed >= SLIDING:
        return Outcome(
            "sliding",
            duration,
            f"slid: the last {collapsed} intervals all collapsed to the least one, {delta_min:g} s: "
            "the event rule no longer decides when to act",
        )
    return Outcome("completed", duration, f"ran to {duration:g} s")


@dataclass(frozen=True, eq=False)
class OpenLoopInterval:
    """The result of simulating one open-loop interval.

    Attributes:
        length: Δ_ol [s], or the duration of the flight if it did not end in an event.
        x, x_o, x_h: plant, observer and hold state at its end, before the reset; shapes (n,), (n̂,), (n̂,).
        y: outputs at its end, shape (n_y,).
        y_max, y_min: extremes of the outputs over the interval, shape (n_y,); NaN if it did not end in an event.
        outcome: ``None`` if it ended in an event, otherwise how it ended.
    """

    length: float
    x: Array
    x_o: Array
    x_h: Array
    y: Array
    y_max: Array
    y_min: Array
    outcome: Outcome | None


def one_in_flight(controller: Controller) -> None:
    """Refuse loops whose state at an event is more than x, x_o and x_h: a clock faster than the delay, signals.

    Raises:
        SimulationError: if there is any.
    """
    if len(controller.realisation.signals):
        raise SimulationError(
            "the controller follows signals of its own: an interval is no function of the state at its event; take "
            "them away, or simulate the run instead"
        )
    if controller.delay.in_flight(controller.trigger.clock) > 1:
        raise SimulationError(
            f"a clock of {controller.trigger.clock:g} s ticks again before the delay of {controller.delay.t_d:g} s is "
            "over: an interval is no function of the state at its event; simulate the run instead"
        )


class OpenLoop(Protocol):
    """A closed loop prepared for simulations from event to event."""

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """Fly from an event at time ``t``.

        Args:
            x, x_o: plant and observer state there, shapes (n,) and (n̂,).
            x_h: hold state right after it, shape (n̂,); ``x_o`` if ``None``, which is the reset. With a delay the event
                resets nothing yet, and x_h is needed.
            t: time of the event [s]; matters for clocks and disturbances.
        """


@dataclass(frozen=True, eq=False)
class Sample:
    """An interval at some of its times, departures from the operating point.

    Attributes:
        t: since the event that begins it [s], shape (K,).
        x, x_o, x_h: shapes (K, n), (K, n̂), (K, n̂).
        y, u: outputs and commands, shapes (K, n_y), (K, n_u).
        qpos: MuJoCo's positions, shape (K, nq); (K, 0) on the linear plant.
    """

    t: Array
    x: Array
    x_o: Array
    x_h: Array
    y: Array
    u: Array
    qpos: Array


class Course(Protocol):
    """A simulated open-loop interval.

    Attributes:
        cuts: ends of its smooth parts [s], rising from 0 to its length.
        rate: dw/dt at its end, shape (n + N_a,).
    """

    cuts: tuple[float, ...]
    rate: Array

    def sample(self, t: Array) -> Sample:
        """The trajectory at increasing times within the interval [s], shape (K,)."""

    def generators(self, t: Array, part: int) -> Array:
        """F(t) of δẇ = F δw at times within a part [s]; shape (K, n + N_a, n + N_a)."""
