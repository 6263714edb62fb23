"""The predicted orbit that a run settled on, laid on the run so that the two can be seen on each other.

The theory does not say when a cycle starts, nor which of the two mirror images ±X̄(t) it is. Both are taken from the
last event of the run, and nothing else is: the orbit is in step with that event, and of the two images it is the one
whose x̄ there is nearer to the run's. As t = 0 is an event, there always is a last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array
from icmj.case.motion import output_rate, reduce_state
from icmj.measurement.measurement import Measurement
from icmj.theory.orbit import Orbit
from icmj.theory.prediction import PredictedOrbit, Prediction

if TYPE_CHECKING:
    from icmj.case.result import Result

INTERVAL_TOLERANCE = 0.05
"""Largest relative departure of an open-loop interval from Δ_crit at which a cycle still counts as the predicted
one. The nonlinear plant's own departure grows as the square of the threshold and stays far below; coexisting cycles
are further away."""
MIRROR_TOLERANCE = 2 * INTERVAL_TOLERANCE
"""Largest asymmetry of a cycle that counts as a predicted mirrored one: an interval and the next, or a state and the
mirror image of the next, may each depart by :data:`INTERVAL_TOLERANCE`, hence from one another by twice as much.

A mirrored cycle is exactly mirrored only where plant and controller are odd. An attracting cycle persists if they are
slightly not: one cycle of two events remains near it, whose intervals and states depart in proportion to the threshold,
the first by as much as the second but in opposite directions, so that their mean still departs with its square."""


def settled_on(prediction: Prediction, measurement: Measurement) -> PredictedOrbit | None:
    """The orbit of the catalogue that a run ended on, of those that attract or are a family; ``None`` if on none.

    The run has that number of events in a period and every interval within :data:`INTERVAL_TOLERANCE` of the orbit's.
    With λ = −1 its halves are mirror images, exactly or within :data:`MIRROR_TOLERANCE`. An orbit that repels may have
    lost its symmetry to two other cycles, which lie close to it, and is not looked for.
    """
    if measurement.kind != "cycle" or measurement.interval is None:
        return None
    intervals, found = np.append(measurement.intervals, measurement.interval), {}
    for one in prediction.orbits:
        mirrored = one.crossing.eigenvalue.real < 0
        alike = measurement.mirrored or (mirrored and measurement.asymmetry <= MIRROR_TOLERANCE)
        off = float(np.abs(intervals / one.crossing.delta - 1).max())
        if one.settles and measurement.p == (2 if mirrored else 1) and alike == mirrored and off <= INTERVAL_TOLERANCE:
            found[off] = one
    return found[min(found)] if found else None


def beside(prediction: Prediction, measurement: Measurement | None) -> Prediction:
    """The prediction that a run is compared with: about the orbit that it settled on, or else as it is."""
    found = None if measurement is None else settled_on(prediction, measurement)
    return prediction if found is None or found.orbit is prediction.orbit else prediction.about(found)


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


def lay_orbit(result: Result) -> LaidOrbit | None:
    """The orbit that the run settled on, or else that at Δ_crit, aligned with the run; ``None`` without an orbit."""
    orbit, simulation = beside(result.expect_prediction(), result.motion).orbit, result.simulation
    if orbit is None:
        return None
    n, n_hat = result.actual.n, result.assumed.n
    at, i = (simulation.events, -1) if len(simulation.events) else (simulation, 0)
    x_bar = reduce_state(result, at.x[i], at.x_o[i], at.x_h[i])
    return LaidOrbit(
        orbit,
        float(at.t[i]),
        # |x̄ + o| < |x̄ − o| just where x̄ · o < 0; what is not a number is nearer to neither
        -1 if float(x_bar @ orbit.x_bar) < 0 else 1,
        output_rate(result, orbit.X[:, :n], orbit.u),
        orbit.X if simulation.delay else orbit.X[:, : n + n_hat],
    )
