"""How accurate a run is, measured by repeating a stretch of it at half the timestep.

The stretch is the last complete open-loop interval, from the state right after the sample that begins it; where
there are fewer than two samples it is the last second. With a method of order p the error at step h is
2^p/(2^p − 1) times the difference between h and h/2. It costs as much as three intervals of the run.

What the step should be follows from the same number: errors fall with h^p, so :func:`choose_timestep` measures one
step and scales it to the tolerance asked for. The default is the model file's own timestep; the shipped ones (2 ms
for the three-link, 5 ms for the pendulum) keep the relative error of an interval below 1e-9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.controller import EventTrigger
from icmj.engine.closed_loop import ClosedLoop, Rows
from icmj.engine.schedule import Schedule

ORDERS = {mujoco.mjtIntegrator.mjINT_RK4: 4}  # all other integrators are of first order in the activations


@dataclass(frozen=True)
class Accuracy:
    """Estimated error over one open-loop interval.

    Attributes:
        order: p of the integrator.
        interval: error of the interval [s]; NaN where its end is not an event (E = 0).
        output: error of the outputs at the end of the stretch, relative to their largest departure in it.
        stretch: length of the stretch [s].
    """

    order: int
    interval: float
    output: float
    stretch: float


def order_of(model: mujoco.MjModel) -> int:
    """Order of the model's integrator for plant, observer and hold together."""
    return ORDERS.get(mujoco.mjtIntegrator(model.opt.integrator), 1)


def estimate(loop: ClosedLoop, schedule: Schedule, rows: Rows) -> Accuracy:
    """Estimate the error of a run; all NaN where the run is too short to repeat a stretch of it."""
    p = order_of(loop.model)
    scale = 2**p / (2**p - 1)
    nothing = Accuracy(p, float("nan"), float("nan"), 0.0)
    triggered = isinstance(loop.controller.trigger, EventTrigger)
    by_events = len(rows.events) >= 2
    if by_events:
        first, last = rows.events[-2], rows.events[-1]
    else:
        # a sample that is an event shows the state before the reset
        usable = rows.samples[~np.isin(rows.samples[:, 0], rows.events[:, 0])]
        if len(usable) < 3:
            return nothing
        first, last = usable[np.searchsorted(usable[:, 0], usable[-1, 0] - 1.0)], usable[-1]
    stretch = float(last[0] - first[0])
    if stretch < 2 * schedule.timestep:
        return nothing
    margin = 0.1 * stretch + 10 * schedule.timestep if by_events and triggered else 0.0
    start = loop.departures(first[None, :])
    ends, size = [], 0.0
    for h in (schedule.timestep, schedule.timestep / 2):
        data = loop.start(start.x[0], start.x_o[0], (start.x_o if by_events else start.x_h)[0], float(first[0]))
        again = loop.run(data, replace(schedule, timestep=h, t_end=float(last[0]) + margin))
        if by_events and not len(again.events):
            return nothing
        ends.append(again.events[:1] if by_events else again.samples[-1:])
        size = max(size, float(np.abs(loop.departures(again.samples).y).max()))
    y_1, y_2 = (loop.departures(end).y for end in ends)
    interval = scale * abs(float(ends[0][0, 0] - ends[1][0, 0])) if by_events and triggered else float("nan")
    output = scale * float(np.abs(y_1 - y_2).max()) / size if size > 0 else 0.0
    return Accuracy(p, interval, output, stretch)


def choose_timestep(timestep: float, accuracy: Accuracy, tolerance: float, fastest: float) -> float:
    """The timestep at which the relative error of an interval is ``tolerance``, from one measured at ``timestep``.

    Args:
        timestep: h of the run that ``accuracy`` was measured on [s].
        accuracy: its estimate.
        tolerance: relative error of the interval wanted.
        fastest: fastest rate of the loop [rad/s]; the step stays below 1/``fastest``, where the estimate holds.
    """
    error = accuracy.interval / accuracy.stretch if np.isfinite(accuracy.interval) else accuracy.output
    if not (np.isfinite(error) and error > 0):
        return min(timestep, 1 / fastest)
    return float(min(0.9 * timestep * (tolerance / error) ** (1 / accuracy.order), 1 / fastest))
