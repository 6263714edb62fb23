"""The accuracy of a run, estimated by repeating a part of it at half the timestep.

Under a trigger this part is the last complete open-loop interval, from the state right after the event that begins it;
if there are fewer than two events, it is the last second. Under any other controller it is the last seconds. With a
method of order p the error at step h is 2^p/(2^p − 1) times the difference between h and h/2. The estimate costs as
much as two intervals of the run. All rows of this part are compared: what is fast errs most soon after an event, and
little is left of that at the next.

The required step follows from the same number: errors are proportional to h^p, so :func:`choose_timestep` scales one
measured step to the requested tolerance. The default is the timestep of the model file; the shipped ones (2 ms for the
three-link, 5 ms for the pendulum) keep the relative error of an interval below 1e-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array, is_between
from icmj.base.process import INTERPRETED
from icmj.controller.controller import expect_intermittent
from icmj.engine.closed_loop import ComposedLoop
from icmj.engine.flow import Record, Stand, follow
from icmj.engine.open_loop import EngineOpenLoop
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule
from icmj.engine.stepping import Stepping
from icmj.errors import SimulationError
from icmj.simulation.simulation import Simulation
from icmj.simulation.taps import copy_of

ORDERS = {mujoco.mjtIntegrator.mjINT_RK4: 4}  # all other integrators are of first order in the activations

SAME_ROW = 1e-10  # s between rows of one instant: counted in steps of either run, it is rounded
SMALL = 1e-9  # departure, of the largest, below which a state is still but for rounding


@dataclass(frozen=True)
class Accuracy:
    """Estimated error over one open-loop interval.

    Attributes:
        order: order p of the integrator.
        interval: error of the interval [s]; NaN if its end is not an event (E = 0).
        output: largest error of the outputs at the rows evaluated, relative to their largest deviation there.
        state: largest error of a state of plant, observer or hold there, relative to its own largest departure.
        stretch: length of the evaluated time [s].
        outputs: largest error of each output there, relative to its own largest deviation, shape (n_y,).
    """

    order: int
    interval: float
    output: float
    state: float
    stretch: float
    outputs: Array

    def facts(self, schedule: Schedule, outputs: Sequence[str]) -> dict[str, float | int | str]:
        """The same facts as a run reports them, for outputs with these names."""
        each = (f"{name} {error:.2g}" for name, error in zip(outputs, self.outputs, strict=True))
        return {
            "interval_error": self.interval,
            "output_error": self.output,
            "state_error": self.state,
            "error_stretch": self.stretch,
            "fastest_rate": schedule.rate,
            "output_errors": ", ".join(each),
        }


def list_facts(loop: ComposedLoop, steps: Stepping, record: Record, seconds: float) -> dict[str, float | int | str]:
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
        found["tolerance"] = steps.tolerance
    if steps.refusal:
        found["not_adaptive"] = steps.refusal
    return found


def order_of(model: mujoco.MjModel) -> int:
    """Order of the model's integrator for plant, observer and hold together."""
    return ORDERS.get(mujoco.mjtIntegrator(model.opt.integrator), 1)


def estimate(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    """Estimate the error of a run; all NaN where the run is too short to repeat a stretch of it."""
    if record.stand is not None:
        return _since_a_stand(loop, schedule, record, record.stand)
    controller = expect_intermittent(loop.controller)
    if controller.delay.in_flight(controller.trigger.clock) > 1:
        return _nothing(loop)  # a row does not hold the events that have not acted yet
    # an interval alone knows nothing of what a set-point is at, which is a state of the controller, too
    if len(record.events) >= 2 and not controller.setpoint:
        return _over_an_interval(loop, schedule, record)
    return _over_a_second(loop, schedule, record)


def _over_an_interval(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    controller = expect_intermittent(loop.controller)
    first, last = loop.departures(record.events[-2:-1]), record.events[-1]
    begin, stretch = float(record.events[-2, 0]), float(last[0] - record.events[-2, 0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    plan = replace(halve_timestep(schedule), t_end=float(last[0]) + 0.1 * stretch + 10 * schedule.timestep)
    hold = first.x_h[0] if controller.delay else None
    again = EngineOpenLoop(loop, plan, plan.record_interval)
    flight, rows = again.recorded(first.x[0], first.x_o[0], hold, begin)
    if flight.outcome is not None:
        return _nothing(loop)
    # neither a clock's interval has an error, nor one that Δ_min or the delay ends: E had been passed long before
    least = controller.least
    given = np.isfinite(controller.trigger.clock) or min(stretch, flight.length) <= least * (1 + 1e-9) + 1e-12
    interval = float("nan") if given else abs(stretch - flight.length)
    own = record.rows[(record.rows[:, 0] > begin) & (record.rows[:, 0] < last[0])]
    # an event's own row is of another instant in both, by the error of the interval
    return measure_error(loop, interval, stretch, own, rows[:-1], (record.events[-1:], rows[-1:]))


def _over_a_second(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    # a row that is an event shows the state before the reset
    usable = record.rows[~np.isin(record.rows[:, 0], record.events[:, 0])]
    if len(usable) < 3 or loop.controller.realisation.delay:
        return _nothing(loop)
    first, last = usable[is_between(usable[:, 0], usable[-1, 0] - 1.0)][0], usable[-1]
    stretch = float(last[0] - first[0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    data = loop.data(loop.departures(first[None, :]).x[0], loop.state(first), float(first[0]))
    again = follow(loop, data, replace(halve_timestep(schedule), t_end=float(last[0])))
    own = record.rows[record.rows[:, 0] > first[0]]
    return measure_error(loop, float("nan"), stretch, own, again.rows, (last[None, :], again.rows[-1:]))


def _since_a_stand(loop: ComposedLoop, schedule: Schedule, record: Record, stand: Stand) -> Accuracy:
    """The error of the run's last seconds: of the outputs at their end, and of their last switch.

    What is read at their begin is that of the run; they are some delays long, so that what is read later is not.
    """
    end, runs = float(record.rows[-1, 0]), []
    for plan in (schedule, halve_timestep(schedule)):
        history, now = copy_of(stand.history, stand.now)
        there = replace(stand, history=history, now=now)
        runs.append(follow(loop, stand.data(loop.model), replace(plan, t_end=end), stand=there))
    coarse, fine = runs
    both_switched = 0 < len(coarse.events) == len(fine.events)
    interval = abs(float(coarse.events[-1, 0] - fine.events[-1, 0])) if both_switched else float("nan")
    ends = coarse.rows[-1:], fine.rows[-1:]
    return measure_error(loop, interval, end - stand.t, coarse.rows, fine.rows, ends)


def halve_timestep(schedule: Schedule) -> Schedule:
    """The loop with half the timestep, and rows at the same instants."""
    if schedule.tolerance > 0:
        return replace(schedule, timestep=schedule.timestep / 2)
    every = max(float(np.ceil(schedule.record_interval / schedule.timestep - 1e-9)), 1.0)
    return replace(schedule, timestep=schedule.timestep / 2, record_interval=every * schedule.timestep)


def measure_error(
    loop: ComposedLoop, interval: float, stretch: float, coarse: Array, fine: Array, ends: tuple[Array, Array]
) -> Accuracy:
    """The error of a run from its differences to a finer one (:func:`halve_timestep`).

    Its rows are compared at the instants that both have, and at their ``ends``, shapes (1, width).
    """
    near = np.minimum(np.searchsorted(fine[:, 0], coarse[:, 0] - SAME_ROW), len(fine) - 1)
    common = np.abs(fine[near, 0] - coarse[:, 0]) < SAME_ROW
    one, other = (
        loop.departures(np.concatenate(pair)) for pair in ((coarse[common], ends[0]), (fine[near[common]], ends[1]))
    )
    y, size = _compare(one.y, other.y)
    z, extent = _compare(*(np.hstack([of.x, of.x_o, of.x_h]) for of in (one, other)))
    p = order_of(loop.model)
    scale = 2**p / (2**p - 1)
    largest = float(size.max())
    each, states = (
        scale * np.divide(error, size, out=np.zeros_like(error), where=size > SMALL * size.max(initial=0.0))
        for error, size in ((y, size), (z, extent))
    )
    output = scale * float(y.max()) / largest if largest > 0 else 0.0
    return Accuracy(p, scale * interval, output, float(states.max(initial=0.0)), stretch, each)


def _compare(v: Array, w: Array) -> tuple[Array, Array]:
    """How far the columns of two arrays are apart at most, and the largest in either."""
    apart, *sizes = (np.abs(values).max(axis=0) for values in (v - w, v, w))
    return apart, np.maximum(*sizes)


def _nothing(loop: ComposedLoop) -> Accuracy:
    unknown = np.full(loop.plant.linearisation.plant.n_y, np.nan)
    return Accuracy(order_of(loop.model), float("nan"), float("nan"), float("nan"), 0.0, unknown)


def choose_timestep(simulation: Simulation, tolerance: float) -> float:
    """The timestep [s] at which the relative error of an interval would be ``tolerance``, estimated from one run.

    Args:
        simulation: a run in MuJoCo, with an error estimate.
        tolerance: required relative error of the interval, or of the outputs if the run has no events.

    Returns:
        The timestep, at most the inverse of the loop's fastest rate, beyond which the estimate is not valid.

    Raises:
        SimulationError: if the simulation was not in MuJoCo, or its timestep was chosen for a tolerance.
    """
    facts = simulation.precision
    if "timestep" not in facts or "fastest_rate" not in facts:
        raise SimulationError("a timestep can only be chosen from a run on the engine")
    if "tolerance" in facts:
        raise SimulationError("this run's timestep was chosen for a tolerance; ask for another tolerance")
    timestep, longest = float(facts["timestep"]), 1 / float(facts["fastest_rate"])
    error, stretch = float(facts["interval_error"]), float(facts["error_stretch"])
    error = error / stretch if np.isfinite(error) and stretch > 0 else float(facts["output_error"])
    if not (np.isfinite(error) and error > 0):
        return min(timestep, longest)
    return float(min(0.9 * timestep * (tolerance / error) ** (1 / float(facts["order"])), longest))
