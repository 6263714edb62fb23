"""The activations of a model's actuators: their rates and limits, and the second-order lag that icmj adds.

An actuator with ``dyntype="user" actdim="2" dynprm="ω_n ζ"`` has the transfer function
ω_n²/(s² + 2ζω_n s + ω_n²) from control to torque (paper, section 4.1, "Neglected dynamics").
Its activations are (torque rate, torque); MuJoCo takes the last as the actuator's activation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.errors import ModelError
from icmj.plant.activation import Activation, Lag


def is_second_order_lag(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether this actuator is a second-order lag by the convention above."""
    return (
        model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_USER
        and model.actuator_actnum[actuator] == 2
        and model.actuator_dynprm[actuator, 0] > 0
    )


def lag(u: float, rate: float, torque: float, omega_n: float, zeta: float) -> tuple[float, float]:
    """d/dt of (rate, torque) of a second-order lag with the input ``u``; compiled code calls it, too."""
    return omega_n * omega_n * (u - torque) - 2 * zeta * omega_n * rate, rate


def clamp(model: mujoco.MjModel, act: Array) -> Array:
    """Activations as a step of the engine leaves them: within ``actrange``, shape (na,)."""
    there = act.copy()
    for i in np.flatnonzero(model.actuator_actlimited):
        own = slice(model.actuator_actadr[i], model.actuator_actadr[i] + model.actuator_actnum[i])
        there[own] = np.clip(act[own], *model.actuator_actrange[i])
    return there


def free_activation_rates(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Rates of the activations after a forward pass, shape (na,), with those of second-order lags.

    Such a lag is unknown to MuJoCo, whose ``act_dot`` of it is zero without a callback; its force is that of its state.
    """
    rates = data.act_dot.copy()
    for i in map(int, np.flatnonzero(model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_USER))):
        if is_second_order_lag(model, i):
            own = slice(model.actuator_actadr[i], model.actuator_actadr[i] + 2)
            rates[own] = lag(data.ctrl[i], *data.act[own], *model.actuator_dynprm[i, :2])
    return rates


def activation_rates(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The same, shape (na,), as limited by ``actrange``."""
    rates = free_activation_rates(model, data)
    wanted = data.act + model.opt.timestep * rates
    there = clamp(model, wanted)
    return np.where(there == wanted, rates, (there - data.act) / model.opt.timestep)


def select_muscles(names: Sequence[str], activation: Activation | None, inputs: Sequence[str] | None) -> dict[int, Lag]:
    """Lags by actuator among ``names``; only those in ``inputs`` have a lag, or all if it is not given.

    Raises:
        ModelError: if the activation names what is no input.
    """
    if activation is None:
        return {}
    chosen = [name for name in inputs or names if name in names]  # others are refused with the ports
    pairs = zip(chosen, activation.lags(chosen), strict=True)
    return {names.index(name): lag for name, lag in pairs if lag is not None}


def activate(spec: mujoco.MjSpec, model: mujoco.MjModel, names: Sequence[str], lags: Mapping[int, Lag]) -> None:
    """Give the actuators of ``spec`` (compiled: ``model``) these lags, at rest in its keyframes.

    Raises:
        ModelError: if one of them is no motor, or has dynamics of its own.
    """
    at_keys = [add_muscles(model.actuator_actnum, lags, model.key_act[i], model.key_ctrl[i]) for i in range(model.nkey)]
    for i, lag in lags.items():
        actuator = spec.actuators[i]
        if actuator.dyntype != mujoco.mjtDyn.mjDYN_NONE:
            raise ModelError(f"activation: input {names[i]!r} has dynamics of its own; leave one of them out")
        if actuator.gaintype != mujoco.mjtGain.mjGAIN_FIXED or actuator.biastype != mujoco.mjtBias.mjBIAS_NONE:
            raise ModelError(
                f"activation: input {names[i]!r} is no motor, whose force is in proportion to its control; "
                "name the inputs that are, such as time_constant = { ankle = 0.1 }"
            )
        prm = np.zeros(len(actuator.dynprm))
        prm[: len(lag)] = lag
        actuator.dynprm = prm
        actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTER if len(lag) == 1 else mujoco.mjtDyn.mjDYN_USER
        if len(lag) == 2:
            actuator.actdim = 2
        actuator.actlimited, actuator.actearly = mujoco.mjtLimited.mjLIMITED_FALSE, False
    for key, act in zip(spec.keys, at_keys, strict=True):
        key.act = act


def add_muscles(sizes: Sequence[int], lags: Mapping[int, Lag], act: Array, ctrl: Array) -> Array:
    """Activations of a model with muscles, these at rest, from those of the model without, ``sizes`` by actuator."""
    parts, at = [np.zeros(0)], 0
    for i, size in enumerate(sizes):
        own = len(lags[i]) if i in lags else 0
        parts += [act[at : at + size], np.zeros(max(own - 1, 0)), ctrl[i : i + min(own, 1)]]
        at += size
    return np.concatenate(parts)


def count_without_muscles(model: mujoco.MjModel, lags: Mapping[int, Lag]) -> list[int]:
    """The number of activations of each actuator of ``model`` without those of these muscles."""
    return [0 if i in lags else int(size) for i, size in enumerate(model.actuator_actnum)]


def remove_muscles(model: mujoco.MjModel, lags: Mapping[int, Lag], act: Array) -> Array:
    """Activations of a model without its muscles, from those of ``model``, which has them."""
    of = [i for i, size in enumerate(model.actuator_actnum) for _ in range(int(size))]
    return act[[i not in lags for i in of]]
