"""The MJCF model: loading, deviation, operating point, and the names of its elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.activations import activate, select_muscles
from icmj.engine.body_measures import shape
from icmj.engine.deviation import Deviation
from icmj.engine.isolation import isolate_engine
from icmj.errors import ModelError, prefix_errors
from icmj.plant.activation import Activation
from icmj.plant.person import Person

LEAST_ROOM = 4096  # numbers of a controller: those of most, with some noise


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """The point of linearisation: position, velocity, activation and control, in MuJoCo's layout.

    ``mpos`` and ``mquat`` are where mocap bodies stand, shapes (nmocap, 3) and (nmocap, 4).
    """

    qpos: Array
    qvel: Array
    act: Array
    ctrl: Array
    mpos: Array
    mquat: Array


class Models:
    """What is compiled of one spec, each of it once: its model, and that model with room for a controller.

    Compiling takes longer than a short run, and a case has many runs. What differs between them (the controller's
    numbers, disturbances, the integrator) is written into a copy, which takes microseconds. The models here are read
    by all threads; copy before editing.
    """

    def __init__(self, spec: mujoco.MjSpec, bare: mujoco.MjModel | None = None) -> None:
        """Compile nothing yet; ``bare`` is the model of ``spec``, if it is there."""
        self.spec, self._bare = spec, bare
        self._roomy: dict[int, tuple[int, mujoco.MjModel]] = {}

    def at(self, point: OperatingPoint) -> mujoco.MjModel:
        """The model itself, with its mocap bodies where ``point`` has them."""
        if self._bare is None:
            # of a copy, for compiling changes the spec, and threads that share a plant may ask at once
            with isolate_engine():
                self._bare = self.spec.copy().compile()
        if self._bare.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
            self._bare.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER  # for rates, not what a step makes of them
        return _copy_at(self._bare, point) if self._bare.nmocap else self._bare

    def copy_with_room(
        self, point: OperatingPoint, size: int, count: int, make: Callable[[int], mujoco.MjModel]
    ) -> mujoco.MjModel:
        """A copy of the model with a controller of ``size`` states and room for ``count`` numbers of it.

        ``make`` compiles one with so much room, which is done where none is there with enough.
        """
        room, model = self._roomy.get(size, (0, None))
        if model is None or room < count:
            room = max(LEAST_ROOM, 1 << (count - 1).bit_length())
            with isolate_engine():
                model = make(room)
            self._roomy[size] = room, model
        return _copy_at(model, point)


def _copy_at(model: mujoco.MjModel, point: OperatingPoint) -> mujoco.MjModel:
    """A copy of a model with its mocap bodies where ``point`` has them in all data that are made or reset."""
    model = copy(model)
    # not in the spec: lengths at rest and welds are made of the pose that the file gives a body
    mocap = model.body_mocapid >= 0
    order = model.body_mocapid[mocap]
    model.body_pos[mocap], model.body_quat[mocap] = point.mpos[order], point.mquat[order]
    return model


def load_spec(path: Path, deviation: Deviation | None = None, person: Person | None = None) -> mujoco.MjSpec:
    """The spec as :func:`load_model` gives it, without activation."""
    return load_model(path, deviation, person)[0]


@isolate_engine()
def load_model(
    path: Path,
    deviation: Deviation | None = None,
    person: Person | None = None,
    activation: Activation | None = None,
    inputs: Sequence[str] | None = None,
) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The model of an MJCF file with the measures of ``person`` and then what ``deviation`` changes in it.

    Between the two its ``inputs``, all actuators by default, get the lags of ``activation``. The file itself is not
    touched. Gains of inputs and sensors are not in the model; see :mod:`icmj.engine.ports`.

    Returns:
        the spec, and what it compiles to.

    Raises:
        ModelError: if the file is missing, is not MJCF, does not compile, or person, activation or deviation do not
            fit it.
    """
    path = Path(path)
    if not path.is_file():
        raise ModelError(f"{path}: no such model file")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"{path}: not a usable MJCF model: {reason}") from error
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        # constraints as they are stated, which this integrator can take; else they would hang on each step of a run
        for option in (spec.option, model.opt):
            option.disableflags = int(option.disableflags) | int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
    with prefix_errors(path.name):
        if person is not None:
            model = shape(spec, model, person)
        if activation is not None:
            names = name_inputs(model)
            activate(spec, model, names, select_muscles(names, activation, inputs))
            model = spec.compile()
        if deviation is not None:
            model = deviation.apply(spec, model)
    return spec, model


def get_operating_point(model: mujoco.MjModel, keyframe: str | None = None) -> OperatingPoint:
    """The operating point of a keyframe, or of the model's reference configuration if ``None``.

    Raises:
        ModelError: if the model has no such keyframe.
    """
    data = mujoco.MjData(model)
    if keyframe is not None:
        key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe)
        if key < 0:
            known = ", ".join(model.key(i).name or str(i) for i in range(model.nkey)) or "none"
            raise ModelError(f"model {get_model_name(model)!r} has no keyframe {keyframe!r}; it has {known}")
        mujoco.mj_resetDataKeyframe(model, data, key)
    parts = (data.qpos, data.qvel, data.act, data.ctrl, data.mocap_pos, data.mocap_quat)
    return OperatingPoint(*(part.copy() for part in parts))


def make_data(model: mujoco.MjModel, point: OperatingPoint) -> mujoco.MjData:
    """New data of ``model``, or of one that has more controls and activations, at an operating point."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = point.qpos, point.qvel
    data.act[: len(point.act)], data.ctrl[: len(point.ctrl)] = point.act, point.ctrl
    data.mocap_pos[:], data.mocap_quat[:] = point.mpos, point.mquat
    return data


def depart(
    model: mujoco.MjModel, data: mujoco.MjData, point: OperatingPoint, z: Array, qpos: Array | None = None
) -> None:
    """Put ``data`` where positions, velocities and activations are z off an operating point, or at positions qpos."""
    nv = len(point.qvel)
    data.qpos[:] = point.qpos if qpos is None else qpos
    if qpos is None:
        mujoco.mj_integratePos(model, data.qpos, np.ascontiguousarray(z[:nv]), 1.0)
    data.qvel[:], data.act[: len(point.act)] = point.qvel + z[nv : 2 * nv], point.act + z[2 * nv :]


def forget(spec: mujoco.MjSpec) -> None:
    """Remove the history buffers of sensors and actuators, and with them their delays."""
    for actuator in spec.actuators:
        actuator.nsample, actuator.delay = 0, 0.0
    for sensor in spec.sensors:
        sensor.nsample, sensor.delay, sensor.interval = 0, 0.0, [0.0, 0.0]


def get_model_name(model: mujoco.MjModel) -> str:
    """The name in the ``<mujoco model=...>`` element."""
    return model.names[: model.names.index(b"\0")].decode()


def name_inputs(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the actuators, which are the plant's inputs.

    Raises:
        ModelError: if an actuator has several controls or none, or several forces.
    """
    names = _name_elements("u", [model.actuator(i).name for i in range(model.nactuator)])
    for name, controls, forces in zip(names, model.actuator_ctrlnum, model.actuator_outnum, strict=True):
        if (controls, forces) != (1, 1):
            raise ModelError(
                f"model {get_model_name(model)!r}: actuator {name!r} has {controls} inputs and {forces} outputs; icmj "
                'takes actuators with one of each: give a pid or dcmotor one input, such as input="pos", '
                "or write the servo as motors"
            )
    return names


def name_outputs(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the sensors, one for each entry of ``sensordata``; they are the plant's outputs."""
    names: list[str] = []
    for i, name in enumerate(_sensors(model)):
        dim = int(model.sensor_dim[i])
        names += [name] if dim == 1 else [f"{name}.{j}" for j in range(dim)]
    return tuple(names)


def place_sensors(model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    """The places of each sensor in ``sensordata``, by its name."""
    places = {}
    for i, name in enumerate(_sensors(model)):
        first = int(model.sensor_adr[i])
        places[name] = tuple(range(first, first + int(model.sensor_dim[i])))
    return places


def name_states(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the states: nv positions (tangent), nv velocities, na activations."""
    q: list[str] = []
    for i in range(model.njnt):
        name, kind = model.joint(i).name or f"joint{i}", int(model.jnt_type[i])
        dofs = {int(mujoco.mjtJoint.mjJNT_FREE): 6, int(mujoco.mjtJoint.mjJNT_BALL): 3}.get(kind, 1)
        q += [name] if dofs == 1 else [f"{name}.{j}" for j in range(dofs)]
    act: list[str] = []
    inputs = name_inputs(model)
    for i in range(model.nu):
        n = int(model.actuator_actnum[i])
        name = inputs[i]
        act += [f"{name}_act"] if n == 1 else [f"{name}_act{j}" for j in range(n)]
    return (*q, *(f"{name}_rate" for name in q), *act)


@contextmanager
def solve_fully(model: mujoco.MjModel) -> Iterator[None]:
    """Let the constraint solver converge fully, because differences divide its error by eps."""
    before = model.opt.tolerance, model.opt.iterations
    model.opt.tolerance, model.opt.iterations = 0.0, max(200, model.opt.iterations)
    try:
        yield
    finally:
        model.opt.tolerance, model.opt.iterations = before


def _sensors(model: mujoco.MjModel) -> tuple[str, ...]:
    return _name_elements("y", [model.sensor(i).name for i in range(model.nsensor)])


def _name_elements(letter: str, names: list[str]) -> tuple[str, ...]:
    """The names; elements without a name get a unique one, made of a letter and their number."""
    found = []
    for i, name in enumerate(names):
        label = name or f"{letter}{i}"
        while not name and label in names:
            label += "_"
        found.append(label)
    return tuple(found)
