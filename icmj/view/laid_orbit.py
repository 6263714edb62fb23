"""The predicted orbit laid on a run, so that the two can be seen on each other.

The theory does not say when a cycle starts, nor which of the two mirror images ±X̄(t) it is. Both are taken from the
last event of the run, and nothing else is: the orbit is in step with that event, and of the two images it is the one
whose x̄ there is nearer to the run's. As t = 0 is an event, there always is a last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array
from icmj.theory.orbit import Orbit
from icmj.view.motion import output_rate, reduced

if TYPE_CHECKING:
    from icmj.result.result import PredictedResult


@dataclass(frozen=True, eq=False)
class LaidOrbit:
    """The predicted orbit with the phase and the sign of a run.

    A *signal* is what is linear in the state of the orbit, over one interval at ``orbit.t``, shape (M, w): its outputs
    ``orbit.y``, its inputs ``orbit.u``, ``rate`` or ``reduced``.

    Attributes:
        orbit: over one interval, from an event on.
        start: time of the event that it is laid on [s].
        side: +1 or −1, the sign of the orbit in the interval that begins there.
        rate: ẏ over one interval, shape (M, n_y).
        reduced: x̄ over one interval, shape (M, n + n̂).
    """

    orbit: Orbit
    start: float
    side: int
    rate: Array
    reduced: Array

    def at(self, t: Array, signal: Array) -> Array:
        """A signal at times t [s], the orbit repeated before and after ``start``; shapes (N,), (M, w) → (N, w).

        Where it jumps, which inputs do at an event, rounding decides on which side of the reset the value is.
        """
        intervals, tau = np.divmod(t - self.start, self.orbit.delta)
        side = self.side * np.where(intervals % 2 == 0, 1, self.orbit.sign)
        return side[:, None] * np.column_stack([np.interp(tau, self.orbit.t, column) for column in signal.T])

    def whole(self, signal: Array) -> Array:
        """A signal over one period from ``start`` on, shape (M, w), or (2M, w) where its halves are mirrored."""
        halves = [signal] if self.orbit.sign > 0 else [signal, -signal]
        return self.side * np.concatenate(halves)

    def times(self, begin: float, end: float) -> Array:
        """The times from ``begin`` to ``end`` [s] at which the repeated orbit is known without interpolation."""
        first, after = ((bound - self.start) / self.orbit.delta for bound in (begin, end))
        interval = np.arange(np.floor(first), np.ceil(after))[:, None]
        t = (self.start + self.orbit.delta * interval + self.orbit.t[:-1]).ravel()
        return t[(t >= begin) & (t <= end)]


def laid_orbit(result: PredictedResult) -> LaidOrbit | None:
    """The orbit at Δ_crit aligned with the run, whether or not a cycle is predicted; ``None`` without an orbit."""
    orbit, simulation = result.prediction.orbit, result.simulation
    if orbit is None:
        return None
    n, n_hat = result.actual.n, result.assumed.n
    if len(simulation.events):
        events = simulation.events
        start, x_bar = events.t[-1], reduced(result, events.x[-1], events.x_o[-1], events.x_h[-1])
    else:
        start, x_bar = simulation.t[0], reduced(result, simulation.x[0], simulation.x_o[0], simulation.x_h[0])
    return LaidOrbit(
        orbit,
        float(start),
        # |x̄ + o| < |x̄ − o| just where x̄ · o < 0; what is not a number is nearer to neither
        -1 if float(x_bar @ orbit.x_bar) < 0 else 1,
        output_rate(result, orbit.X[:, :n], orbit.u),
        orbit.X if simulation.delay else orbit.X[:, : n + n_hat],
    )
