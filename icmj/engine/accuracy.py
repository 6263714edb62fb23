"""The accuracy of a run, estimated by repeating a part of it at half the timestep or a hundredth of the tolerance.

This part is the last complete open-loop interval, from the state right after the event that begins it; if there are
fewer than two events, it is the last second. With a method of order p the error at step h is 2^p/(2^p − 1) times the
difference between h and h/2. Between a tolerance and a hundredth of it the difference is the error; if stability bounds
the steps, a hundredth changes little, and :data:`FINE` is used. The estimate costs as much as three intervals of the
run.

The required step follows from the same number: errors are proportional to h^p, so :func:`choose_timestep` scales one
measured step to the requested tolerance. The default is the timestep of the model file; the shipped ones (2 ms for the
three-link, 5 ms for the pendulum) keep the relative error of an interval below 1e-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array, between
from icmj.base.environment import INTERPRETED
from icmj.controller.controller import layout_of
from icmj.engine.closed_loop import ComposedLoop, Record
from icmj.engine.open_loop import EngineOpenLoop
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule
from icmj.engine.stepping import Stepping
from icmj.engine.tableau import METHODS
from icmj.errors import SimulationError
from icmj.simulation.simulation import Simulation

ORDERS = {mujoco.mjtIntegrator.mjINT_RK4: 4}  # all other integrators are of first order in the activations

FINE = 1e-10  # tolerance beside which any above 1e-8 is coarse


@dataclass(frozen=True)
class Accuracy:
    """Estimated error over one open-loop interval.

    Attributes:
        order: order p of the integrator.
        interval: error of the interval [s]; NaN if its end is not an event (E = 0).
        output: error of the outputs at the end of the evaluated time, relative to their largest deviation in it.
        stretch: length of the evaluated time [s].
        outputs: error of each output, relative to its own largest deviation in this time, shape (n_y,).
    """

    order: int
    interval: float
    output: float
    stretch: float
    outputs: Array

    def facts(self, schedule: Schedule, outputs: Sequence[str]) -> dict[str, float | int | str]:
        """The same facts as a run reports them, for outputs with these names."""
        each = (f"{name} {error:.2g}" for name, error in zip(outputs, self.outputs, strict=True))
        return {
            "interval_error": self.interval,
            "output_error": self.output,
            "error_stretch": self.stretch,
            "fastest_rate": schedule.rate,
            "output_errors": ", ".join(each),
        }


def facts(
    loop: ComposedLoop, steps: Stepping, schedule: Schedule, record: Record, seconds: float
) -> dict[str, float | int | str]:
    """The facts of a run on its integration."""
    found: dict[str, float | int | str] = {
        "integrator": mujoco.mjtIntegrator(loop.model.opt.integrator).name.removeprefix("mjINT_"),
        "order": order_of(loop.model),
        "timestep": steps.timestep,
        "event_tolerance": EVENT_TOLERANCE,
        "steps": record.steps,
        "seconds": seconds,
        "implementation": "interpreted" if INTERPRETED else "compiled",
    }
    if steps.tolerance:
        mean = float(record.rows[-1, 0]) / max(record.steps, 1)
        found |= {"integrator": METHODS[schedule.method.order][0], "order": schedule.method.order}
        found |= {"tolerance": steps.tolerance, "timestep": mean}
    if steps.refusal:
        found["not_adaptive"] = steps.refusal
    return found


def order_of(model: mujoco.MjModel) -> int:
    """Order of the model's integrator for plant, observer and hold together."""
    return ORDERS.get(mujoco.mjtIntegrator(model.opt.integrator), 1)


def estimate(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    """Estimate the error of a run; all NaN where the run is too short to repeat a stretch of it."""
    if loop.controller.delay.in_flight(loop.controller.trigger.clock) > 1:
        return _nothing(loop)  # a row does not hold the events that have not acted yet
    # an interval alone knows nothing of signals
    if len(record.events) >= 2 and not len(loop.controller.realisation.signals):
        return _over_an_interval(loop, schedule, record)
    return _over_a_second(loop, schedule, record)


def _over_an_interval(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    first, last = loop.departures(record.events[-2:-1]), record.events[-1]
    begin, stretch = float(record.events[-2, 0]), float(last[0] - record.events[-2, 0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    end = float(last[0]) + 0.1 * stretch + 10 * schedule.timestep
    hold = first.x_h[0] if loop.controller.delay else None
    flights = [
        EngineOpenLoop(loop, replace(plan, t_end=end))(first.x[0], first.x_o[0], hold, begin) for plan in both(schedule)
    ]
    if any(flight.outcome is not None for flight in flights):
        return _nothing(loop)
    coarse, fine = flights
    size = np.abs([[flight.y_max, flight.y_min] for flight in flights]).max(axis=(0, 1))
    # neither a clock's interval has an error, nor one that Δ_min or the delay ends: E had been passed long before
    least = loop.controller.least
    given = np.isfinite(schedule.clock) or min(coarse.length, fine.length) <= least * (1 + 1e-9) + 1e-12
    interval = float("nan") if given else abs(coarse.length - fine.length)
    return scaled(loop, schedule, interval, coarse.y - fine.y, size, stretch)


def _over_a_second(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    # a row that is an event shows the state before the reset
    usable = record.rows[~np.isin(record.rows[:, 0], record.events[:, 0])]
    if len(usable) < 3 or loop.controller.delay:
        return _nothing(loop)
    first, last = usable[between(usable[:, 0], usable[-1, 0] - 1.0)][0], usable[-1]
    stretch = float(last[0] - first[0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    start = loop.departures(first[None, :])
    a = layout_of(loop.controller).join(x_o=start.x_o[0], x_h=start.x_h[0])
    ends, size = [], np.zeros(start.y.shape[1])
    for plan in both(schedule):
        data = loop.data(start.x[0], a, float(first[0]))
        again = loop.departures(loop.run(data, replace(plan, t_end=float(last[0]))).rows)
        ends.append(again.y[-1])
        size = np.maximum(size, np.abs(again.y).max(axis=0))
    return scaled(loop, schedule, float("nan"), ends[0] - ends[1], size, stretch)


def both(schedule: Schedule) -> tuple[Schedule, Schedule]:
    """The loop with its own timestep or tolerance, and with a finer one."""
    if schedule.tolerance > 0:
        return schedule, replace(schedule, tolerance=min(schedule.tolerance / 100, FINE))
    return schedule, replace(schedule, timestep=schedule.timestep / 2)


def scaled(
    loop: ComposedLoop, schedule: Schedule, interval: float, output: Array, size: Array, stretch: float
) -> Accuracy:
    """The error of a run from its difference to a finer one (:func:`both`) at the end of the repeated part."""
    p = order_of(loop.model)
    scale = 1.0 if schedule.tolerance > 0 else 2**p / (2**p - 1)
    error, largest = scale * np.abs(output), float(size.max())
    each = np.divide(error, size, out=np.zeros_like(error), where=size > 0)
    return Accuracy(p, scale * interval, float(error.max()) / largest if largest > 0 else 0.0, stretch, each)


def _nothing(loop: ComposedLoop) -> Accuracy:
    unknown = np.full(loop.plant.linearisation.plant.n_y, np.nan)
    return Accuracy(order_of(loop.model), float("nan"), float("nan"), 0.0, unknown)


def choose_timestep(simulation: Simulation, tolerance: float) -> float:
    """The timestep [s] at which the relative error of an interval would be ``tolerance``, estimated from one run.

    Args:
        simulation: a run in MuJoCo, with an error estimate.
        tolerance: required relative error of the interval, or of the outputs if the run has no events.

    Returns:
        The timestep, at most the inverse of the loop's fastest rate, beyond which the estimate is not valid.

    Raises:
        SimulationError: if the simulation was not in MuJoCo, or its steps were adapted to a tolerance.
    """
    facts = simulation.precision
    if "timestep" not in facts or "fastest_rate" not in facts:
        raise SimulationError("a timestep can only be chosen from a run on the engine")
    if "tolerance" in facts:
        raise SimulationError("this run chose its steps itself; ask for a tolerance instead of a timestep")
    timestep, longest = float(facts["timestep"]), 1 / float(facts["fastest_rate"])
    error, stretch = float(facts["interval_error"]), float(facts["error_stretch"])
    error = error / stretch if np.isfinite(error) and stretch > 0 else float(facts["output_error"])
    if not (np.isfinite(error) and error > 0):
        return min(timestep, longest)
    return float(min(0.9 * timestep * (tolerance / error) ** (1 / float(facts["order"])), longest))
