"""The MJCF plant: loading, deviating, and its operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.errors import ModelError


@dataclass(frozen=True)
class Deviation:
    """How the actual plant departs from an MJCF model; the default is no departure.

    Attributes:
        gain: b, factor on every input of the plant (one number) or on each (one for each actuator).
        dynprm: replaces ``dynprm`` of the named actuators.
        rho: ρ of the paper's family A = Â − ρÃ₁: 0 no deviation, 1 all of it.
            Acts on ``gain`` only: the gain applied is 1 + ρ (gain − 1).
    """

    gain: float | Sequence[float] = 1.0
    dynprm: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rho: float = 1.0


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """Where a model is linearised: position, velocity, activation, control; all in MuJoCo's layout."""

    qpos: Array
    qvel: Array
    act: Array
    ctrl: Array


def load_spec(path: Path, deviation: Deviation | None = None) -> mujoco.MjSpec:
    """The model of an MJCF file, with ``deviation`` applied; the file itself is not touched.

    Raises:
        ModelError: if the file is missing, is not MJCF, does not compile, or the deviation names
            an actuator that it does not have.
    """
    path = Path(path)
    if not path.is_file():
        raise ModelError(f"{path}: no such model file")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"{path}: not a usable MJCF model: {reason}") from error
    if deviation is not None:
        _apply(spec, deviation, path)
    return spec


def _apply(spec: mujoco.MjSpec, deviation: Deviation, path: Path) -> None:
    actuators = list(spec.actuators)
    gain = np.asarray(deviation.gain, dtype=float)
    if gain.ndim > 1 or (gain.ndim == 1 and gain.size != len(actuators)):
        raise ModelError(f"{path}: gain has {gain.size} entries for {len(actuators)} actuators")
    applied = 1 + deviation.rho * (np.broadcast_to(gain, (len(actuators),)) - 1)
    for actuator, b in zip(actuators, applied, strict=True):
        actuator.gear = np.asarray(actuator.gear) * b
    for name, values in deviation.dynprm.items():
        match = [a for a in actuators if a.name == name]
        if not match:
            known = ", ".join(a.name for a in actuators)
            raise ModelError(f"{path}: no actuator {name!r} to deviate; it has {known}")
        dynprm = np.array(match[0].dynprm, dtype=float)
        dynprm[: len(values)] = values
        match[0].dynprm = dynprm


def operating_point(model: mujoco.MjModel, keyframe: str | None = None) -> OperatingPoint:
    """The operating point of a keyframe, or of the model's reference configuration if ``None``.

    Raises:
        ModelError: if the model has no such keyframe.
    """
    data = mujoco.MjData(model)
    if keyframe is not None:
        key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe)
        if key < 0:
            known = ", ".join(model.key(i).name or str(i) for i in range(model.nkey)) or "none"
            raise ModelError(f"model {model_name(model)!r} has no keyframe {keyframe!r}; it has {known}")
        mujoco.mj_resetDataKeyframe(model, data, key)
    return OperatingPoint(data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.ctrl.copy())


def model_name(model: mujoco.MjModel) -> str:
    """The name in the ``<mujoco model=...>`` element."""
    return model.names[: model.names.index(b"\0")].decode()


def input_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the actuators, which are the plant's inputs."""
    return tuple(model.actuator(i).name or f"u{i}" for i in range(model.nu))


def output_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the sensors, one for each entry of ``sensordata``; they are the plant's outputs."""
    names: list[str] = []
    for i in range(model.nsensor):
        name, dim = model.sensor(i).name or f"y{i}", int(model.sensor_dim[i])
        names += [name] if dim == 1 else [f"{name}.{j}" for j in range(dim)]
    return tuple(names)


def state_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the states: nv positions (tangent), nv velocities, na activations."""
    q: list[str] = []
    for i in range(model.njnt):
        name, kind = model.joint(i).name or f"joint{i}", int(model.jnt_type[i])
        dofs = {int(mujoco.mjtJoint.mjJNT_FREE): 6, int(mujoco.mjtJoint.mjJNT_BALL): 3}.get(kind, 1)
        q += [name] if dofs == 1 else [f"{name}.{j}" for j in range(dofs)]
    act: list[str] = []
    for i in range(model.nu):
        n = int(model.actuator_actnum[i])
        name = model.actuator(i).name or f"u{i}"
        act += [f"{name}_act"] if n == 1 else [f"{name}_act{j}" for j in range(n)]
    return (*q, *(f"{name}_rate" for name in q), *act)
