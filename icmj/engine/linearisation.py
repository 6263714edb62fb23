"""The linearisation of a model: its ports, the places where forces act on it, and finite differences.

The plant's ports: which actuators, sensor entries and states of a model its u, y and x are, and how they enter.

    ctrl = ctrl_0 + b (u + d)  on the chosen actuators, ctrl_0 on all others
    y    = g sensordata + β    at the chosen entries

b is the true input gain of the paper: it multiplies the departure of the control and not the control that holds the
operating point, so a wrong gain leaves the plant in balance, and whatever an actuator is (motor, servo, muscle), its
share in A stays as it is. g and β are gain and bias of the sensors.

Forces on a model itself: their places as numbers for the loops, the generalised forces, and their effect.

A row of the table of places is (kind, index, nine numbers): of a hinge or slide joint its degree of freedom; of any
other input its actuator and 1/|gear|, for the actuator's moment follows the motion; of a body its number, the point in
its frame, force and torque along the axes of the world.

Linearisation of an MJCF plant by centred finite differences of ``mj_forward``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.deviation import Deviation
from icmj.engine.model import (
    OperatingPoint,
    activation_rates,
    data_at,
    depart,
    input_names,
    is_second_order_lag,
    model_name,
    operating_point,
    output_names,
    sensor_entries,
    solve_fully,
    state_names,
)
from icmj.engine.operating_point import input_units, output_units, state_units
from icmj.engine.safety import isolate_engine
from icmj.errors import ModelError, SimulationError
from icmj.plant.body import Selection
from icmj.plant.linear_plant import LinearPlant, Push, vector
from icmj.plant.quality import IDLE
from icmj.simulation.disturbance import Pushes


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


def ports_of(model: mujoco.MjModel, selection: Selection | None = None, deviation: Deviation | None = None) -> Ports:
    """The ports of ``model``, with the gains and biases of ``deviation``.

    Raises:
        ModelError: if a name is not one of the model's, nothing is left, or an input or output has a delay of its own.
    """
    chosen, name = selection or Selection(), model_name(model)
    inputs, outputs, states = input_names(model), output_names(model), state_names(model)
    if not inputs or not outputs:
        missing = "actuator" if not inputs else "sensor"
        hint = "" if not inputs else '; outputs = "joints" takes the positions of its joints'
        raise ModelError(f"model {name!r} has no {missing}; inputs are its actuators and outputs its sensors{hint}")
    entries = sensor_entries(model)
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
    late = [(f"input {input_names(model)[i]!r}", model.actuator_delay[i]) for i in actuators]
    late += [
        (f"output {output_names(model)[at]!r}", model.sensor_delay[i]) for at, i in zip(entries, sensors, strict=True)
    ]
    for what, delay in late:
        if delay > 0:
            raise ModelError(f"model {model_name(model)!r}: {what} has a delay of {delay:g} s; {advice}")
    for at, i in zip(entries, sensors, strict=True):
        if (interval := float(model.sensor_interval[i, 0])) > 0:
            raise ModelError(
                f"model {model_name(model)!r}: output {output_names(model)[at]!r} is read every {interval:g} s only; "
                "remove its interval, because the observer reads continuously"
            )


def _states(states: Sequence[str], chosen: Selection, model: str) -> np.ndarray:
    for label in (*(chosen.states or ()), *chosen.drop):
        _find(label, {n: (i,) for i, n in enumerate(states)}, "state", model)
    kept = [i for i, n in enumerate(states) if n in (chosen.states or states) and n not in chosen.drop]
    if not kept:
        raise ModelError(f"model {model!r}: no state is left; keep at least one")
    return np.array(kept, dtype=int)


FREEDOM, ACTUATOR, BODY = 0, 1, 2
WIDTH = 11
_PUSH = 1e-4  # half the distance of a difference over a push, as a share of the forces at rest, by what they accelerate


def places(
    model: mujoco.MjModel, pushes: Sequence[Push], inputs: Sequence[str], actuators: Sequence[int] | np.ndarray
) -> Array:
    """The table of where ``pushes`` act, shape (K, 11); ``actuators`` are those of the plant's ``inputs``.

    Raises:
        SimulationError: if there is no such input or body, or it is the world, or what the input moves has no gear.
    """
    table = np.zeros((len(pushes), WIDTH))
    for row, push in zip(table, pushes, strict=True):
        if push.input is not None:
            if push.input not in inputs:
                raise SimulationError(f"push on input {push.input!r}: the plant's inputs are {', '.join(inputs)}")
            row[:3] = _along(model, int(actuators[list(inputs).index(push.input)]))
            if row[2] == 0:
                raise SimulationError(f"push on input {push.input!r}: its gear is zero; push a body")
            continue
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, str(push.body))
        if body <= 0:
            known = ", ".join(filter(None, (model.body(i).name for i in range(1, model.nbody))))
            raise SimulationError(f"push on body {push.body!r}: the model's bodies are {known}")
        point = model.body_ipos[body] if push.point is None else push.point
        row[:] = BODY, body, *point, *push.force, *push.torque
    return table


def on_bodies(model: mujoco.MjModel, point: OperatingPoint, push: Push) -> tuple[Push, ...]:
    """The pushes on bodies that a push is: itself, or what a motion of the surface is for each body that it carries.

    These are −m a of a translation; −m φ n × g of gravity turned by a tilt φ about n; −m φ̈ n × r and −I n φ̈ of a
    turning, with the positions r and the inertias I of the operating point.

    Raises:
        SimulationError: if a body that the surface carries has no name.
    """
    if push.surface is None:
        return (push,)
    data, axis, found = data_at(model, point), np.array(push.axis), []
    mujoco.mj_fwdPosition(model, data)
    for body in range(1, model.nbody):
        mass, name = float(model.body_mass[body]), model.body(body).name
        if mass == 0 or model.body_weldid[body] == 0:
            continue
        if not name:
            raise SimulationError(f"{push.where}: body {body} of the model has no name; give it one")
        force, torque = -mass * axis, np.zeros(3)
        if push.surface == "gravity":
            # what compensates gravity turns with it
            force = -mass * (1 - float(model.body_gravcomp[body])) * np.cross(axis, model.opt.gravity)
        elif push.surface == "turning":
            turned = data.ximat[body].reshape(3, 3)
            force = -mass * np.cross(axis, data.xipos[body] - np.array(push.point or (0.0, 0.0, 0.0)))
            torque = -turned @ (model.body_inertia[body] * (turned.T @ axis))
        if np.any(force) or np.any(torque):
            found.append(Push(None, name, vector(force), vector(torque)))
    return tuple(found)


def spread(model: mujoco.MjModel, point: OperatingPoint, pushes: Pushes) -> Pushes:
    """The same with every motion of the surface as pushes on bodies, each with all terms of it."""
    if all(push.surface is None for push in pushes.places):
        return pushes
    parts = [on_bodies(model, point, push) for push in pushes.places]
    first, size = np.cumsum([0, *map(len, parts)]), pushes.size
    of = [range(first[i], first[i + 1]) for i in range(len(parts))]
    term = np.array([i for i, at in enumerate(size.input) for _ in of[at]], dtype=int)
    each = {name: getattr(size, name)[term] for name in ("amplitude", "omega", "phase", "start", "end")}
    rows = np.array([row for at in size.input for row in of[at]], dtype=int)
    gaussian = tuple((row, noise) for at, noise in size.gaussian for row in of[at])
    return Pushes(sum(parts, ()), replace(size, n_u=int(first[-1]), input=rows, gaussian=gaussian, **each))


def forces(model: mujoco.MjModel, data: mujoco.MjData, table: Array, sizes: Array) -> Array:
    """Generalised forces of pushes of these sizes where the model is, shape (nv,), after its positions are known."""
    total = np.zeros(model.nv)
    for (kind, index, *numbers), size in zip(table, sizes, strict=True):
        at = int(index)
        if kind == FREEDOM:
            total[at] += size * numbers[0]
        elif kind == ACTUATOR:
            first, count = int(data.moment_rowadr[at]), int(data.moment_rownnz[at])
            row = slice(first, first + count)
            total[data.moment_colind[row]] += size * numbers[0] * data.actuator_moment[row]
        else:
            point, force, torque = np.split(np.array(numbers), 3)
            there = data.xpos[at] + data.xmat[at].reshape(3, 3) @ point
            mujoco.mj_applyFT(model, data, size * force, size * torque, there, at, total)
    return total


def effects(model: mujoco.MjModel, point: OperatingPoint, table: Array) -> Array:
    """Effects of pushes of size 1 on the rates of (qpos, qvel, act) at ``point``, shape (n, K).

    Where no constraint acts, accelerations are linear in forces; elsewhere they are differenced.
    """
    nv, data, found = model.nv, data_at(model, point), np.zeros((2 * model.nv + model.na, len(table)))

    def accelerate(force: Array) -> Array:
        """The accelerations that a force would cause without constraints, M⁻¹ f."""
        result = np.zeros((1, nv))
        mujoco.mj_solveM(model, data, result, np.ascontiguousarray(force[None]))
        return result[0]

    with isolate_engine(), solve_fully(model):
        mujoco.mj_forward(model, data)
        acting = (data.qfrc_bias, data.qfrc_passive, data.qfrc_actuator, data.qfrc_constraint)
        rest = max(float(force @ accelerate(force)) for force in acting)
        for column, row in zip(found.T, table, strict=True):
            force = forces(model, data, row[None], np.ones(1))
            column[nv : 2 * nv] = free = accelerate(force)
            if not data.nefc or not force.any():
                continue
            step, column[nv : 2 * nv] = _PUSH * np.sqrt(rest / (force @ free)) if rest > 0 else 1.0, 0.0
            for sign in (1.0, -1.0):
                data.qfrc_applied[:] = sign * step * force
                mujoco.mj_forward(model, data)
                column[nv : 2 * nv] += sign / (2 * step) * data.qacc
    return found


def push_rows(model: mujoco.MjModel, actuators: Sequence[int] | np.ndarray) -> Array:
    """Rows of the table for pushes along what these actuators move; zero where gear says of none."""
    table = np.zeros((len(actuators), WIDTH))
    for row, actuator in zip(table, actuators, strict=True):
        row[:3] = _along(model, int(actuator))
    return table


def _along(model: mujoco.MjModel, actuator: int) -> tuple[float, float, float]:
    """Kind, index and factor of an input: 1 N or 1 N m on what it moves, along its length; 0 without a gear."""
    kind, gear = mujoco.mjtTrn(model.actuator_trntype[actuator]), model.actuator_gear[actuator]
    scalar = kind in (mujoco.mjtTrn.mjTRN_TENDON, mujoco.mjtTrn.mjTRN_SLIDERCRANK)
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        joint = int(model.actuator_trnid[actuator, 0])
        if mujoco.mjtJoint(model.jnt_type[joint]) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            return FREEDOM, float(model.jnt_dofadr[joint]), float(np.sign(gear[0]) or 1.0)
    size = abs(gear[0]) if scalar else 1.0 if kind == mujoco.mjtTrn.mjTRN_BODY else float(np.linalg.norm(gear))
    return ACTUATOR, float(actuator), 1.0 / size if size > 0 else 0.0


EPS = 1e-5  # balances truncation (eps²) against rounding (1/eps): 2e-9 on the three-link model
EPS_TOUCHING = 1e-6  # the same where something touches: contacts give way over tenths of a millimetre
_PART = 0.5  # of the room that a control has before it, or the force that it makes, is limited


@dataclass(frozen=True, eq=False)
class Differences:
    """Derivatives of a whole model at a point: all its states, actuators and sensor entries.

    Attributes:
        A, B, C, D: centred differences; shapes (n, n), (n, nu), (n_s, n), (n_s, nu).
        rate: d/dt of (velocities, activations) at the point, shape (nv + na,).
        sensordata: there, shape (n_s,).
        right, left: one-sided differences of (rate, sensordata), shape (nv + na + n_s, n + nu). How much they disagree
            falls with the step where the model is smooth, and stays where it has a kink.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    rate: Array
    sensordata: Array
    right: Array
    left: Array


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A linear plant and where it holds.

    Attributes:
        plant: ẋ = A x + B u, y = C x in departures from the operating point;
            x = (nv positions in the tangent space, nv velocities, na activations), as far as ``ports`` keeps them.
        point: the operating point.
        y: the outputs there, shape (n_y,).
        residual: largest |acceleration| or |activation rate| there; zero at an equilibrium.
        ports: where u, y and x are in the model.
        D: how the outputs jump with the inputs, shape (n_y, n_u); a plant for intermittent control has none.
    """

    plant: LinearPlant
    point: OperatingPoint
    y: Array
    residual: float
    ports: Ports
    D: Array


def linearise(
    model: mujoco.MjModel,
    keyframe: str | None = None,
    eps: float | None = None,
    *,
    ports: Ports | None = None,
    point: OperatingPoint | None = None,
) -> Linearisation:
    """Linearise ``model`` at a keyframe (or its reference configuration), or at ``point``.

    Positions are perturbed in the tangent space, so quaternion joints are right too. Actuators that are
    second-order lags (see :mod:`icmj.engine.model`) are included; any callback installed is taken off meanwhile.

    Args:
        model: the model.
        keyframe: operating point, where no ``point`` is given.
        eps: half the distance of a difference; that of :func:`step_of` if ``None``.
        ports: which inputs, outputs and states; all of the model's if ``None``.
        point: operating point instead of a keyframe's.

    Raises:
        ModelError: if there is no such keyframe, the model has no input or no output, an actuator has user
            dynamics other than a second-order lag, or a derivative is not finite.
    """
    ports = ports or ports_of(model)
    point = point or operating_point(model, keyframe)
    found = differences(model, point, step_of(model, point) if eps is None else eps)
    rows, columns, kept = ports.entries, ports.actuators, ports.states
    V = still(found.A, np.setdiff1d(np.arange(model.nv), kept), kept[kept < model.nv])
    V = {i: v for i, v in V.items() if np.abs(found.C[rows] @ v).max(initial=0.0) <= IDLE * np.abs(found.C).max()}
    ports = replace(ports, left=np.array([*V], dtype=int), still=np.array([*V.values()]).reshape(len(V), ports.size))
    plant = LinearPlant(
        np.ascontiguousarray(ports.reduce(found.A[:, kept].T).T),
        np.ascontiguousarray(ports.reduce(found.B[:, columns].T).T) * ports.b,
        found.C[np.ix_(rows, kept)] * ports.g[:, None],
        *(
            _pick(of(model), at)
            for of, at in (
                *((state_names, kept), (input_names, columns), (output_names, rows)),
                *((state_units, kept), (input_units, columns), (output_units, rows)),
            )
        ),
    )
    plant = replace(plant, B_d=effects(model, point, push_rows(model, columns))[kept])
    D = found.D[np.ix_(rows, columns)] * ports.b * ports.g[:, None]
    y = ports.read(found.sensordata)
    return Linearisation(plant, point, y, float(np.abs(found.rate).max()), ports, D)


def still(A: Array, outside: np.ndarray, inside: np.ndarray) -> dict[int, Array]:
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


def step_of(model: mujoco.MjModel, point: OperatingPoint) -> float:
    """Step ``eps`` of the centred differences that suits the model at ``point``."""
    data = data_at(model, point)
    mujoco.mj_fwdPosition(model, data)
    return EPS_TOUCHING if data.nefc else EPS


def control_steps(model: mujoco.MjModel, point: OperatingPoint, eps: float) -> Array:
    """Half the distances of the differences over controls, each in its own unit; shape (nu,).

    That is ``eps``, of the control at the operating point where that is larger than 1, for a sum of large forces is
    rounded to 1e-16 of them; and at most half of what is left before the control or its force is limited, for beyond
    that it moves nothing. At a limit, where no step is right, it is half of the range, so that the kink is seen.
    """
    steps = eps * np.maximum(1.0, np.abs(point.ctrl))
    data = data_at(model, point)
    mujoco.mj_forward(model, data)
    for i in range(model.nu):
        ranges = [(point.ctrl[i], model.actuator_ctrlrange[i], 1.0)] if model.actuator_ctrllimited[i] else []
        fixed = model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
        if model.actuator_forcelimited[i] and fixed and model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_NONE:
            gain = abs(float(model.actuator_gainprm[i, 0]))
            ranges.append((data.actuator_force[i], model.actuator_forcerange[i], gain))
        for value, (low, high), gain in ranges:
            room = min(value - low, high - value)
            steps[i] = min(steps[i], _PART * (room if room > 0 else high - low) / (gain or np.inf)) or steps[i]
    return steps


def differences(model: mujoco.MjModel, point: OperatingPoint, eps: float = EPS) -> Differences:
    """Derivatives of the model at ``point`` by differences over ± ``eps``, of controls over :func:`control_steps`.

    Raises:
        ModelError: if an actuator has user dynamics that icmj does not know, or a derivative is not finite.
    """
    name = model_name(model)
    for i in range(model.nu):
        if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_USER and not is_second_order_lag(model, i):
            raise ModelError(
                f"model {name!r}: actuator {input_names(model)[i]!r} has user activation dynamics that icmj does not "
                'know; it knows second-order lags, actdim="2" dynprm="ω_n ζ" with ω_n > 0'
            )
    data = data_at(model, point)
    nv, na, nu = model.nv, model.na, model.nu
    n = 2 * nv + na

    def evaluate(z: Array) -> Array:
        """d/dt of the state, and the sensors, at a departure of state and control."""
        depart(model, data, point, z[:n])
        data.ctrl[:] = point.ctrl + z[n:]
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, activation_rates(model, data), data.sensordata])

    slopes, right, left = np.zeros((3, n + model.nsensordata, n + nu))
    with isolate_engine(), solve_fully(model):
        rest = evaluate(np.zeros(n + nu))
        steps = np.append(np.full(n, eps), control_steps(model, point, eps))
        for j in range(n + nu):
            step = np.zeros(n + nu)
            step[j] = steps[j]
            up, down = evaluate(step), evaluate(-step)
            # a control is rounded where it is large: what counts is how far it went
            above, below = steps[j], steps[j]
            if j >= n:
                at = point.ctrl[j - n]
                above, below = (at + steps[j]) - at, at - (at - steps[j])
            slopes[:, j] = (up - down) / (above + below)
            right[:, j], left[:, j] = (up - rest) / above, (rest - down) / below
    A, B, C, D = slopes[:n, :n], slopes[:n, n:], slopes[n:, :n], slopes[n:, n:]
    A[:nv] = np.hstack([np.zeros((nv, nv)), np.eye(nv), np.zeros((nv, na))])
    B[:nv] = 0
    if not np.isfinite(slopes).all():
        raise ModelError(f"model {name!r} has no finite linearisation at this operating point")
    return Differences(A, B, C, D, rest[nv:n], rest[n:], right[nv:], left[nv:])


def _pick(names: tuple[str, ...], at: np.ndarray) -> tuple[str, ...]:
    return tuple(names[i] for i in at)
