"""The closed loop of a linear plant as an input-output system of python-control, in three forms.

Under continuous control it is a linear system in (x, x_o). Under a clock it is a linear one in discrete time, from tick
to tick. Under an event rule it is neither, as when it samples depends on its state; but looked at every ``dt`` it is a
nonlinear system in discrete time, whose events are late by up to ``dt``.

Inputs are d_<input>, which acts beside the command, and n_<output>, an error of the observer's reading; outputs are the
plant's and u_<input>, the command. States are the plant's, then x_o_<state>, x_h_<state> of the controller's model.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.controller.closed_loop import compose
from icmj.controller.controller import Controller
from icmj.controller.delay import NO_DELAY
from icmj.controller.trigger import Continuous
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.labels import name_loop_signals

if TYPE_CHECKING:
    from control import NonlinearIOSystem, StateSpace


def continuous_loop(plant: LinearPlant, controller: Controller) -> StateSpace:
    """The loop under u = −k̂ x_o, whatever the controller's trigger is; states (x, x_o)."""
    import control

    loop = compose(plant, replace(controller, trigger=Continuous(), delay=NO_DELAY))
    kept = slice(0, plant.n + controller.design.plant.n)
    C = np.vstack([np.hstack([plant.C, np.zeros((plant.n_y, controller.design.plant.n))]), -loop.K[:, kept]])
    B = np.hstack([loop.D, loop.E])
    return control.ss(loop.F[kept, kept], B[kept], C, 0, **name_loop_signals(plant, controller.design.plant, "x_o"))


def clocked_loop(plant: LinearPlant, controller: Controller) -> StateSpace:
    """The loop under a clock, in discrete time; states (x, x_o) at its ticks, inputs constant in between.

    Raises:
        AnalysisError: if the trigger is no clock, or there is a delay.
    """
    import control

    step = controller.trigger.clock
    if not np.isfinite(step):
        raise AnalysisError("the controller's trigger is no clock")
    refuse_delay(controller)
    n, m = plant.n, controller.design.plant.n
    Phi, Gamma = _hold_step(plant, controller, step)
    keep = np.eye(n + m, n + 2 * m)  # (x, x_o) of (x, x_o, x_h)
    taken = np.vstack([np.eye(n + m), np.eye(m, n + m, n)])  # x_h := x_o
    C = np.zeros((plant.n_y + plant.n_u, n + m))
    C[: plant.n_y, :n], C[plant.n_y :, n:] = plant.C, -controller.design.k
    return control.ss(
        keep @ Phi @ taken, keep @ Gamma, C, 0, step, **name_loop_signals(plant, controller.design.plant, "x_o")
    )


def event_loop(plant: LinearPlant, controller: Controller, dt: float) -> NonlinearIOSystem:
    """The loop under an event rule that is evaluated every ``dt`` [s]: an event is the first sample with E ≥ 0.

    One more state, ``since``, is the time since the last event [s]. The command is the one right after the sample.

    Raises:
        AnalysisError: if ``dt`` is no time, or there is a delay.
    """
    import control

    refuse_delay(controller)
    if not (np.isfinite(dt) and dt > 0):
        raise AnalysisError(f"dt must be positive and finite, got {dt:g} s")
    n, m, k = plant.n, controller.design.plant.n, controller.design.k
    Phi, Gamma = _hold_step(plant, controller, dt)
    faces, least = controller.trigger.faces(controller.design), controller.trigger.delta_min

    def taken(state: Array) -> Array:
        """The state right after the sample."""
        e = state[n + m : n + 2 * m] - state[n : n + m]
        if state[-1] >= least * (1 - 1e-9) and faces.E(e) >= 0:
            state = state.copy()
            state[n + m : n + 2 * m], state[-1] = state[n : n + m], 0.0
        return state

    def update(t: float, state: Array, inputs: Array, params: Any) -> Array:
        state = taken(np.asarray(state, float))
        return np.append(Phi @ state[:-1] + Gamma @ np.asarray(inputs, float), state[-1] + dt)

    def output(t: float, state: Array, inputs: Array, params: Any) -> Array:
        state = taken(np.asarray(state, float))
        return np.concatenate([plant.C @ state[:n], -k @ state[n + m : n + 2 * m]])

    named = name_loop_signals(plant, controller.design.plant, "x_o", "x_h")
    named["states"] = [*named["states"], "since"]
    return control.NonlinearIOSystem(update, output, dt=dt, name="event_loop", **named)


def refuse_delay(controller: Controller) -> None:
    """Check that there is neither a delay nor a sampling delay.

    Raises:
        AnalysisError: if there is one.
    """
    if controller.delay or controller.sampling_delay:
        raise AnalysisError("a loop with a delay has no such form; simulate it, and take to_timeresponse() of the run")


def _hold_step(plant: LinearPlant, controller: Controller, step: float) -> tuple[Array, Array]:
    """(x, x_o, x_h) after ``step`` from right after a sample, and the share of constant inputs (d, n)."""
    from scipy.linalg import expm

    loop = compose(plant, controller)
    A, B, width = loop.F, np.hstack([loop.D, loop.E]), len(loop.F)
    whole = np.zeros((width + B.shape[1],) * 2)
    whole[:width] = np.hstack([A, B]) * step
    flow = expm(whole)[:width]
    return flow[:, :width], flow[:, width:]
