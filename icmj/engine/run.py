"""Simulation of a controller on the physics engine.

The accuracy of a run, estimated by repeating a part of it at half the timestep.

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

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, between
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.process import INTERPRETED
from icmj.controller.controller import Law, has_trigger
from icmj.engine.buffers import States
from icmj.engine.closed_loop import ComposedLoop, close_loop
from icmj.engine.flow import Record, follow
from icmj.engine.limits import apply_limits, find_clipped, has_limit, shares
from icmj.engine.open_loop import EngineOpenLoop
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule
from icmj.engine.stepping import Stepping, stepping_of
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.labels import labels_of
from icmj.simulation.readings import expect_no_observer, expect_readings
from icmj.simulation.rows import ControllerRows, collect_drives, keep_rows
from icmj.simulation.settings import Settings, plant_start, start_states
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.taps import copy_of, least_of, modes_of

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
        found["tolerance"] = steps.tolerance
    if steps.refusal:
        found["not_adaptive"] = steps.refusal
    return found


def order_of(model: mujoco.MjModel) -> int:
    """Order of the model's integrator for plant, observer and hold together."""
    return ORDERS.get(mujoco.mjtIntegrator(model.opt.integrator), 1)


def estimate(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    """Estimate the error of a run; all NaN where the run is too short to repeat a stretch of it."""
    if not has_trigger(loop.controller):
        return _since_a_stand(loop, schedule, record)
    if loop.controller.delay.in_flight(loop.controller.trigger.clock) > 1:
        return _nothing(loop)  # a row does not hold the events that have not acted yet
    # an interval alone knows nothing of what a set-point is at, which is a state of the controller, too
    if len(record.events) >= 2 and not loop.controller.setpoint:
        return _over_an_interval(loop, schedule, record)
    return _over_a_second(loop, schedule, record)


def _over_an_interval(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    controller = loop.controller
    assert has_trigger(controller)
    first, last = loop.departures(record.events[-2:-1]), record.events[-1]
    begin, stretch = float(record.events[-2, 0]), float(last[0] - record.events[-2, 0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    plan = replace(finer(schedule), t_end=float(last[0]) + 0.1 * stretch + 10 * schedule.timestep)
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
    found = apart(loop, own, rows[:-1], (record.events[-1:], rows[-1:]))
    return scale_error(loop, interval, found, stretch)


def _over_a_second(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    # a row that is an event shows the state before the reset
    usable = record.rows[~np.isin(record.rows[:, 0], record.events[:, 0])]
    if len(usable) < 3 or loop.controller.realisation.delay:
        return _nothing(loop)
    first, last = usable[between(usable[:, 0], usable[-1, 0] - 1.0)][0], usable[-1]
    stretch = float(last[0] - first[0])
    if stretch < 2 * schedule.timestep:
        return _nothing(loop)
    data = loop.data(loop.departures(first[None, :]).x[0], loop.state(first), float(first[0]))
    again = follow(loop, data, replace(finer(schedule), t_end=float(last[0])))
    found = apart(loop, record.rows[record.rows[:, 0] > first[0]], again.rows, (last[None, :], again.rows[-1:]))
    return scale_error(loop, float("nan"), found, stretch)


def _since_a_stand(loop: ComposedLoop, schedule: Schedule, record: Record) -> Accuracy:
    """The error of the run's last seconds: of the outputs at their end, and of their last switch.

    What is read at their begin is that of the run; they are some delays long, so that what is read later is not.
    """
    end, stand, runs = float(record.rows[-1, 0]), record.stand, []
    assert stand is not None
    for plan in (schedule, finer(schedule)):
        history, now = copy_of(stand.history, stand.now)
        there = replace(stand, history=history, now=now)
        runs.append(follow(loop, stand.data(loop.model), replace(plan, t_end=end), stand=there))
    coarse, fine = runs
    both_switched = 0 < len(coarse.events) == len(fine.events)
    interval = abs(float(coarse.events[-1, 0] - fine.events[-1, 0])) if both_switched else float("nan")
    found = apart(loop, coarse.rows, fine.rows, (coarse.rows[-1:], fine.rows[-1:]))
    return scale_error(loop, interval, found, end - stand.t)


def finer(schedule: Schedule) -> Schedule:
    """The loop with half the timestep, and rows at the same instants."""
    if schedule.tolerance > 0:
        return replace(schedule, timestep=schedule.timestep / 2)
    every = max(float(np.ceil(schedule.record_interval / schedule.timestep - 1e-9)), 1.0)
    return replace(schedule, timestep=schedule.timestep / 2, record_interval=every * schedule.timestep)


class Apart(NamedTuple):
    """How far two runs are apart at most, and the largest departures, of outputs and of states.

    Attributes:
        y, size: differences and sizes of the outputs, shapes (n_y,).
        z, extent: the same of all states, shapes (n + …,).
    """

    y: Array
    size: Array
    z: Array
    extent: Array


def apart(loop: ComposedLoop, coarse: Array, fine: Array, ends: tuple[Array, Array]) -> Apart:
    """Compare the rows of two runs at the instants that both have, and at their ``ends``, shapes (1, width)."""
    near = np.minimum(np.searchsorted(fine[:, 0], coarse[:, 0] - SAME_ROW), len(fine) - 1)
    common = np.abs(fine[near, 0] - coarse[:, 0]) < SAME_ROW
    one, other = (
        loop.departures(np.concatenate(pair)) for pair in ((coarse[common], ends[0]), (fine[near[common]], ends[1]))
    )
    z, w = (np.hstack([of.x, of.x_o, of.x_h]) for of in (one, other))
    y, v = one.y, other.y
    return Apart(
        _largest(y - v), np.maximum(_largest(y), _largest(v)), _largest(z - w), np.maximum(_largest(z), _largest(w))
    )


def _largest(values: Array) -> Array:
    return np.asarray(np.abs(values).max(axis=0))


def scale_error(loop: ComposedLoop, interval: float, found: Apart, stretch: float) -> Accuracy:
    """The error of a run from its differences to a finer one (:func:`finer`)."""
    p = order_of(loop.model)
    scale = 2**p / (2**p - 1)
    largest = float(found.size.max())
    each, states = (
        scale * np.divide(error, size, out=np.zeros_like(error), where=size > SMALL * size.max(initial=0.0))
        for error, size in ((found.y, found.size), (found.z, found.extent))
    )
    output = scale * float(found.y.max()) / largest if largest > 0 else 0.0
    return Accuracy(p, scale * interval, output, float(states.max(initial=0.0)), stretch, each)


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


@limit_to_one_thread()
def simulate(
    plant: MujocoPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
    error_estimate: bool = True,
) -> Simulation:
    """Simulate ``plant`` on the engine under ``controller``; outputs before t = 0 are those at the start.

    Args:
        plant: the actual plant.
        controller: design, hold and trigger, or any other, by its realisation (:mod:`icmj.engine.flow`).
        settings: duration, start, steps and disturbance; see :func:`icmj.engine.stepping.stepping_of`.
        x0: plant state at t = 0 as departure from the operating point, shape (n,); replaces ``settings.initial``.
        x_o0: observer state at t = 0, shape (n̂,); replaces ``settings.observer``.
        x_h0: hold state at t = 0, shape (n̂,); x_o0 if ``None``, because t = 0 is an event.
        a0: start of the state of a controller without a trigger (N_a,), right after an event; zero if ``None``.
        progress: called repeatedly with the completed fraction, 0–1.
        error_estimate: measure the error by repeating the last interval, or the last seconds, at half the timestep.

    Returns:
        The run, recorded at multiples of ``record_interval`` (of a given timestep where a step ends next), at every
        event (values just before the reset), at every action and where what is given jumps (values after it), and at
        the end. Events are those of the trigger, or of the controller's rule or clock, or, of one without them, its
        switches. What the state of a controller without a trigger means is not known here: observer, hold and event
        function are not recorded. ``u`` is the command; ``applied`` what acts of it and the disturbance beside it.
        ``precision``
        has ``integrator``, ``order``, ``timestep`` [s] (and the ``tolerance`` that it is chosen for, if it is),
        ``event_tolerance`` [s], ``interval_error`` [s], ``output_error`` (relative; both estimated over one interval),
        ``output_errors`` (of each output), ``state_error`` (largest of a state), ``steps``, ``seconds``,
        ``implementation``; where
        there are limits ``saturated_share`` (of rows) and ``saturated`` (which inputs, how often); where sensors reach
        their cutoffs ``clipped_share`` and ``clipped`` (which outputs).

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a named state or input does not exist, a start state has the wrong shape, or the timestep
            is not usable.
    """
    linear, real = plant.linearisation.plant, controller.realisation
    x, a = _start(linear, controller, settings, (x0, x_o0, x_h0, a0))
    loop = close_loop(plant, controller, settings)
    steps = stepping_of(loop, settings)
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    repeatable = error_estimate and not has_trigger(controller)
    inside = np.zeros(len(loop.block.M))
    inside[: 0 if real.tapped else len(a)] = a[: 0 if real.tapped else len(a)]
    record = follow(loop, loop.data(x, inside), schedule, progress, repeatable=repeatable)
    precision = facts(loop, steps, schedule, record, time.perf_counter() - begin)
    if error_estimate:
        precision |= estimate(loop, schedule, record).facts(schedule, linear.outputs)

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    held, at_events = _hold_rows(controller, rows, record.u), _hold_rows(controller, events, record.u[:0])
    acting, reached = _limits(plant, loop, record.rows, held.u)
    return Simulation(
        plant="mujoco",
        control=controller.kind,
        t=record.rows[:, 0],
        x=rows.x,
        y=rows.y,
        u=held.u,
        x_o=held.x_o,
        x_h=held.x_h,
        E=held.E,
        events=Events(record.events[:, 0], events.x, at_events.x_o, at_events.x_h, record.y_max, record.y_min),
        outcome=record.outcome,
        precision=precision | reached,
        qpos=record.rows[:, 1 : 1 + loop.model.nq],
        delay=real.delay if real.eventful else 0.0,
        applied=acting,
        least=least_of(real),
        noisy=settings.noisy,
        labels=labels_of(linear, controller.plant) if has_trigger(controller) else labels_of(linear),
        **modes_of(real, record.mode),
        **collect_drives(controller, loop.acting, record.rows[:, 0]),
    )


def _start(
    plant: LinearPlant, law: Law, settings: Settings, given: tuple[ArrayLike | None, ...]
) -> tuple[Array, Array]:
    """Where plant and controller start, where ``given`` are x0, x_o0, x_h0 and a0."""
    x0, x_o0, x_h0, a0 = given
    if has_trigger(law):
        return start_states(plant, law, settings, x0, x_o0, x_h0)
    expect_no_observer(law, settings, x_o0, x_h0)
    size = expect_readings(law, plant).layout.size
    a = np.zeros(size) if a0 is None else np.asarray(a0, dtype=float)
    return plant_start(plant, settings, x0), a


def _hold_rows(law: Law, states: States, u: Array) -> ControllerRows:
    """The controller at rows where its states are these, and its commands ``u``."""
    if has_trigger(law):
        return keep_rows(law, states.x_o, states.x_h)
    return ControllerRows(states.x_o, states.x_h, u, np.full(len(states.x), np.nan))


def _limits(plant: MujocoPlant, loop: ComposedLoop, rows: Array, u: Array) -> tuple[Array, dict[str, float | str]]:
    """What acts at recorded rows of the commands ``u``, and the limits of actuators and sensors that were reached."""
    acting, cut = apply_limits(plant, loop.disturbance, rows, u)
    linear = plant.linearisation.plant
    reached = shares(linear.inputs, cut) if has_limit(loop.model) else {}
    if (short := find_clipped(plant, rows)).any():
        reached |= shares(linear.outputs, short, "clipped")
    return acting, reached
