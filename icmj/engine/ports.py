"""The plant's ports: which actuators, sensor entries and states of a model its u, y and x are, and how they enter.

    ctrl = ctrl_0 + b (u + d)  on the chosen actuators, ctrl_0 on all others
    y    = g sensordata + β    at the chosen entries

b is the true input gain of the paper: it multiplies the departure of the control and not the control that holds the
operating point, so a wrong gain leaves the plant in balance, and whatever an actuator is (motor, servo, muscle), its
share in A stays as it is. g and β are gain and bias of the sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.deviation import Deviation
from icmj.engine.model import (
    get_model_name,
    name_inputs,
    name_outputs,
    name_states,
    place_sensors,
)
from icmj.errors import ModelError
from icmj.plant.body import Selection
from icmj.plant.quality import IDLE


@dataclass(frozen=True, eq=False)
class Ports:
    """The places of u, y and x of a plant in its model.

    Attributes:
        actuators: of each input, shape (n_u,).
        b: input gains, shape (n_u,).
        entries: of ``sensordata``, of each output, shape (n_y,).
        g, beta: gains and biases of the outputs, shape (n_y,).
        states: of the model's (nv positions, nv velocities, na activations), of each state, shape (n,).
        size: how many states the model has.
        left: positions that are left out and on which nothing depends if others go along, such as the heading of a body
            that is not quite upright; shape (k,).
        still: these directions, 1 at the position itself, shape (k, size).
    """

    actuators: np.ndarray
    b: Array
    entries: np.ndarray
    g: Array
    beta: Array
    states: np.ndarray
    size: int
    left: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    still: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def read(self, sensordata: Array) -> Array:
        """Outputs without bias, shape (..., n_y)."""
        return self.g * sensordata[..., self.entries]

    def reduce(self, z: Array) -> Array:
        """The plant's states from the model's, shape (..., n), without what goes along with those left out."""
        z = z - z[..., self.left] @ self.still if len(self.left) else z
        return z[..., self.states]

    def whole(self, x: Array) -> Array:
        """The model's states from the plant's, shape (..., size); what the plant leaves out is zero."""
        state = np.zeros((*np.shape(x)[:-1], self.size))
        state[..., self.states] = x
        return state


def find_ports(model: mujoco.MjModel, selection: Selection | None = None, deviation: Deviation | None = None) -> Ports:
    """The ports of ``model``, with the gains and biases of ``deviation``.

    Raises:
        ModelError: if a name is not one of the model's, nothing is left, or an input or output has a delay of its own.
    """
    chosen, name = selection or Selection(), get_model_name(model)
    inputs, outputs, states = name_inputs(model), name_outputs(model), name_states(model)
    if not inputs or not outputs:
        missing = "actuator" if not inputs else "sensor"
        hint = "" if not inputs else '; outputs = "joints" takes the positions of its joints'
        raise ModelError(f"model {name!r} has no {missing}; inputs are its actuators and outputs its sensors{hint}")
    entries = place_sensors(model)
    if isinstance(chosen.outputs, str):
        raise ModelError(f'outputs = "{chosen.outputs}": expected names, or "joints" when a plant is loaded')
    actuators = [
        index for label in chosen.inputs or inputs
        for index in _find(label, {n: (i,) for i, n in enumerate(inputs)}, "input", name)
    ]  # fmt: skip
    wanted = [
        index for output in chosen.outputs or outputs
        for index in _find(output, {**{n: (i,) for i, n in enumerate(outputs)}, **entries}, "output", name)
    ]  # fmt: skip
    kept = _states(states, chosen, name)
    for what, indices in (("input", actuators), ("output", wanted)):
        if len(set(indices)) < len(indices):
            raise ModelError(f"model {name!r}: an {what} is chosen twice; name each once")
    _check_prompt(model, actuators, wanted)
    b, g, beta = np.ones(len(actuators)), np.ones(len(outputs)), np.zeros(len(outputs))
    if deviation is not None:
        b = deviation.input_gains(inputs, actuators, name)
        g, beta = deviation.sensor_errors(outputs, entries, name)
    rows, columns = np.array(wanted, dtype=int), np.array(actuators, dtype=int)
    return Ports(columns, b, rows, g[rows], beta[rows], kept, len(states))


def _find(label: str, known: dict[str, tuple[int, ...]], what: str, model: str) -> tuple[int, ...]:
    if label not in known:
        raise ModelError(f"model {model!r} has no {what} {label!r}; it has {', '.join(known)}")
    return known[label]


def _check_prompt(model: mujoco.MjModel, actuators: Sequence[int], entries: Sequence[int]) -> None:
    """Check that no input and no output used has a delay in the engine: its derivatives there are zeros."""
    advice = "remove it from the model, and give the loop's as [assumed] delay, [actual] delay in the run file"
    sensors = [int(np.searchsorted(model.sensor_adr, entry, side="right")) - 1 for entry in entries]
    late = [(f"input {name_inputs(model)[i]!r}", model.actuator_delay[i]) for i in actuators]
    late += [
        (f"output {name_outputs(model)[at]!r}", model.sensor_delay[i]) for at, i in zip(entries, sensors, strict=True)
    ]
    for what, delay in late:
        if delay > 0:
            raise ModelError(f"model {get_model_name(model)!r}: {what} has a delay of {delay:g} s; {advice}")
    for at, i in zip(entries, sensors, strict=True):
        if (interval := float(model.sensor_interval[i, 0])) > 0:
            raise ModelError(
                f"model {get_model_name(model)!r}: output {name_outputs(model)[at]!r} is read every {interval:g} s "
                "only; remove its interval, because the observer reads continuously"
            )


def _states(states: Sequence[str], chosen: Selection, model: str) -> np.ndarray:
    for label in (*(chosen.states or ()), *chosen.drop):
        _find(label, {n: (i,) for i, n in enumerate(states)}, "state", model)
    kept = [i for i, n in enumerate(states) if n in (chosen.states or states) and n not in chosen.drop]
    if not kept:
        raise ModelError(f"model {model!r}: no state is left; keep at least one")
    return np.array(kept, dtype=int)


def find_still(A: Array, outside: np.ndarray, inside: np.ndarray) -> dict[int, Array]:
    """The directions v with A v = 0 of positions ``outside`` a plant that are none alone, with others ``inside``."""
    size, found = np.abs(A).max(initial=0.0), {}
    for i in map(int, outside):
        if np.abs(A[:, i]).max() <= IDLE * size:
            continue
        v = np.zeros(len(A))
        v[i], v[inside] = 1.0, np.linalg.lstsq(A[:, inside], -A[:, i], rcond=IDLE)[0]
        if np.abs(A @ v).max() <= IDLE * size:
            found[i] = v
    return found
