"""Linearisation of an MJCF plant by centred finite differences of ``mj_forward``."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.activations import activation_rates, is_second_order_lag
from icmj.engine.forces import compute_effects
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import (
    OperatingPoint,
    depart,
    get_model_name,
    get_operating_point,
    make_data,
    name_inputs,
    name_outputs,
    name_states,
    solve_fully,
)
from icmj.engine.ports import Ports, find_ports, find_still
from icmj.engine.push_table import push_rows
from icmj.engine.units import name_input_units, name_output_units, name_state_units
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import IDLE

EPS = 1e-5  # balances truncation (eps²) against rounding (1/eps): 2e-9 on the three-link model
EPS_TOUCHING = 1e-6  # the same where something touches: contacts give way over tenths of a millimetre
_SHALLOWEST = 2e-9  # m or rad: what touches less is at the end of its touch, and no difference stays on one side of it
_PART = 0.5  # of the room that a control has before it, or the force that it makes, is limited; of the depth of a touch
_TOUCHING = [
    int(of)
    for of in (
        mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT,
        mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC,
    )
]


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
    ports = ports or find_ports(model)
    point = point or get_operating_point(model, keyframe)
    found = difference_model(model, point, step_of(model, point) if eps is None else eps)
    rows, columns, kept = ports.entries, ports.actuators, ports.states
    V = find_still(found.A, np.setdiff1d(np.arange(model.nv), kept), kept[kept < model.nv])
    V = {i: v for i, v in V.items() if np.abs(found.C[rows] @ v).max(initial=0.0) <= IDLE * np.abs(found.C).max()}
    ports = replace(ports, left=np.array([*V], dtype=int), still=np.array([*V.values()]).reshape(len(V), ports.size))
    plant = LinearPlant(
        np.ascontiguousarray(ports.reduce(found.A[:, kept].T).T),
        np.ascontiguousarray(ports.reduce(found.B[:, columns].T).T) * ports.b,
        found.C[np.ix_(rows, kept)] * ports.g[:, None],
        *(
            _pick(of(model), at)
            for of, at in (
                *((name_states, kept), (name_inputs, columns), (name_outputs, rows)),
                *((name_state_units, kept), (name_input_units, columns), (name_output_units, rows)),
            )
        ),
    )
    B_d = compute_effects(model, point, push_rows(model, columns))[kept]
    plant = replace(plant, B_d=B_d, error=IDLE * float(np.abs(plant.A).max(initial=0.0)))
    D = found.D[np.ix_(rows, columns)] * ports.b * ports.g[:, None]
    y = ports.read(found.sensordata)
    return Linearisation(plant, point, y, float(np.abs(found.rate).max()), ports, D)


def step_of(model: mujoco.MjModel, point: OperatingPoint) -> float:
    """Step ``eps`` of the centred differences that suits the model at ``point``.

    Where something touches, it is at most half as far as the contact or limit that touches least is deep, so that no
    difference lifts it off.
    """
    data = make_data(model, point)
    mujoco.mj_fwdPosition(model, data)
    if not data.nefc:
        return EPS
    depth = (data.efc_margin - data.efc_pos)[np.isin(data.efc_type, _TOUCHING)]
    return float(min(EPS_TOUCHING, _PART * depth.min(initial=np.inf, where=depth > _SHALLOWEST)))


def choose_control_steps(model: mujoco.MjModel, point: OperatingPoint, eps: float) -> Array:
    """Half the distances of the differences over controls, each in its own unit; shape (nu,).

    That is ``eps``, of the control at the operating point where that is larger than 1, for a sum of large forces is
    rounded to 1e-16 of them; and at most half of what is left before the control or its force is limited, for beyond
    that it moves nothing. At a limit, where no step is right, it is half of the range, so that the kink is seen.
    """
    steps = eps * np.maximum(1.0, np.abs(point.ctrl))
    data = make_data(model, point)
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


def difference_model(model: mujoco.MjModel, point: OperatingPoint, eps: float = EPS) -> Differences:
    """Derivatives of the model at ``point`` by differences over ± ``eps``; controls have :func:`choose_control_steps`.

    Raises:
        ModelError: if an actuator has user dynamics that icmj does not know, or a derivative is not finite.
    """
    name = get_model_name(model)
    for i in range(model.nu):
        if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_USER and not is_second_order_lag(model, i):
            raise ModelError(
                f"model {name!r}: actuator {name_inputs(model)[i]!r} has user activation dynamics that icmj does not "
                'know; it knows second-order lags, actdim="2" dynprm="ω_n ζ" with ω_n > 0'
            )
    data = make_data(model, point)
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
        steps = np.append(np.full(n, eps), choose_control_steps(model, point, eps))
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
