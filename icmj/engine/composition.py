"""The closed loop as an ordinary MuJoCo model: the plant and an actuator whose activations are the controller's states.

The composed model is the plant's, with two elements more, both named ``icmj_controller``:

* an actuator without force (``gainprm="0"``, on the first joint) with ``dyntype="user"`` and as many activations as the
  controller has states, so that MuJoCo's integrator takes plant, observer and hold through the same stages,
  and save, restore, roll-out and finite differences see them;
* a ``<numeric>`` that holds the controller (:mod:`icmj.engine.block`), so that a callback needs nothing but the model
  it is called on.

Geoms that are only for the eye are left out, which a step is a seventh faster for: poses are drawn with the plant's own
model. They stay where they could matter, in a medium or under a rangefinder.

Disturbances act beside commands, pushes on the plant itself; the observer is driven by the command u, which is all that
a controller knows, and by the outputs with their errors, which the plant does not feel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.law import Law
from icmj.controller.layout import Layout
from icmj.controller.realisation import Mode, Realisation
from icmj.engine.block import pack, read_numbers
from icmj.engine.model import get_model_name
from icmj.engine.moving_ground import spread
from icmj.engine.plant import MujocoPlant
from icmj.engine.push_table import make_table
from icmj.errors import ModelError
from icmj.simulation.disturbance import NO_PUSHES, Acting, Disturbance, Pushes, make_no_disturbance
from icmj.simulation.taps import POWERS

NAME = "icmj_controller"


def compose(
    plant: MujocoPlant,
    controller: Law,
    disturbance: Disturbance,
    errors: Disturbance | None = None,
    pushes: Pushes = NO_PUSHES,
    duration: float = 0.0,
) -> mujoco.MjModel:
    """The closed-loop model of ``plant`` under ``controller``; the plant's file and spec are not touched.

    Outputs and inputs are those of the plant's ports; the operating point of the actual plant is where controls and
    outputs are counted from. ``errors`` are those of the outputs as the observer reads them, ``pushes`` act on the
    plant itself; Gaussian noise is drawn for a run of ``duration`` [s].

    Raises:
        ModelError: if the numbers of inputs or outputs do not fit the design, or a sensor needs accelerations (it
            would close an algebraic loop through the controller).
        SimulationError: if the model has not what is pushed.
    """
    bare = plant.model
    _check(bare, get_model_name(bare), plant, controller)
    there = embed(controller)
    errors = make_no_disturbance(plant.linearisation.plant.n_y) if errors is None else errors
    data = _pack(bare, bare.nu, bare.na, plant, there, Acting(disturbance, errors, pushes), duration)
    size = there.real.layout.size
    model = plant.models.copy_with_room(
        plant.linearisation.point, size, len(data), lambda room: _compile(plant.spec.copy(), bare, size, room)
    )
    read_numbers(model)[: len(data)] = data
    return model


def _compile(spec: mujoco.MjSpec, bare: mujoco.MjModel, size: int, room: int) -> mujoco.MjModel:
    """The model of ``spec`` with an actuator of ``size`` states, and ``room`` numbers that are still zero."""
    ranging = np.any(bare.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
    spec.compiler.discardvisual = not (ranging or bare.opt.density or bare.opt.viscosity)
    # what contacts leave unsolved is an error of every step that falls neither with the step nor with the threshold
    spec.option.tolerance, spec.option.iterations = 0.0, max(200, spec.option.iterations)
    for key in spec.keys:
        # a keyframe that lists controls or activations must list those of the controller, too
        if len(key.ctrl):
            key.ctrl = [*key.ctrl, 0.0]
        if len(key.act):
            key.act = [*key.act, *np.zeros(size)]
    first = spec.joints[0]
    first.name = first.name or f"{NAME}_joint"
    never = mujoco.mjtLimited.mjLIMITED_FALSE
    # every law and limit is named, for a model's own defaults would give it a servo's bias or a muscle's force
    spec.add_actuator(
        name=NAME, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=first.name,
        dyntype=mujoco.mjtDyn.mjDYN_USER, actdim=size, dynprm=np.zeros(10),
        gaintype=mujoco.mjtGain.mjGAIN_FIXED, gainprm=np.zeros(10),
        biastype=mujoco.mjtBias.mjBIAS_NONE, biasprm=np.zeros(10), damping=np.zeros(3), armature=0.0,
        ctrllimited=never, forcelimited=never, actlimited=never, inheritrange=0.0, nsample=0, delay=0.0,
    )  # fmt: skip
    spec.add_numeric(name=NAME, data=np.zeros(room), size=room)
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(
            f"model {get_model_name(bare)!r} cannot take the controller: {' '.join(str(error).split())}"
        ) from error


@dataclass(frozen=True, eq=False)
class EmbeddedController:
    """What of a controller is in a composed model.

    Attributes:
        real: a realisation of one mode, with what the engine integrates as its state.
        powers: number of coefficients of what enters as a function of time alone.
        own: number of the controller's states that the engine integrates.
        rated: whether that enters the rates of the state, too.
    """

    real: Realisation
    powers: int = 0
    own: int = 0
    rated: bool = False


def goes_by_steps(law: Law) -> bool:
    """Whether a run of a controller is followed step by step in MuJoCo; of any other it is stretch by stretch.

    Of one that reads the current outputs alone all that matters is known where a step ends. What a controller without
    a trigger does at the begin or the end of a run is a matter of stretches, which know a command's two sides: signals
    of its own, actions, and resets with a period.
    """
    real = law.realisation
    bare = not (real.delay or len(real.signals)) and real.period == np.inf and real.layout.size > 0
    return real.plain and (law.observed or bare)


def embed(controller: Law) -> EmbeddedController:
    """What of a controller is in a composed model.

    One that goes by steps is, whole. What a controller that reads delayed outputs commands is known ahead: an idle
    state stands for it, and its command as polynomials in time. Any other moves with the plant in the mode that it is
    in, under what delayed readings and signals add to its rates and to its command; events, guards and modes are the
    affair of whoever follows it.
    """
    real = controller.realisation
    if goes_by_steps(controller):
        return EmbeddedController(real, own=real.layout.size)
    n_u, n_y = controller.plant.n_u, controller.plant.n_y
    joint = not real.tapped
    own = real.layout.size if joint else 0
    size = max(own, 1)
    M, N, K, S = np.zeros((size, size)), np.zeros((size, n_y)), np.zeros((n_u, size)), np.zeros((n_u, n_y))
    if joint:
        first = real.modes[0]
        M[:own, :own], N[:own], K[:, :own], S[:] = first.M, first.N[:, :n_y], first.K, first.S[:, :n_y]
    mode = Mode("own", M, N, K, S)
    return EmbeddedController(Realisation.of_modes(Layout.of(own=size), (mode,)), POWERS, own, joint)


def repack(model: mujoco.MjModel, plant: MujocoPlant, controller: Law, acting: Acting, duration: float) -> Array | None:
    """The numeric data that a composed ``model`` of the same spec would have for another controller or gain.

    Returns:
        the data; ``None`` where they would not lie alike, number for number and zero for zero.

    Raises:
        ModelError: as for :func:`compose`.
    """
    there, held = embed(controller), read_numbers(model)
    _check(model, get_model_name(model), plant, controller)
    na = int(model.na - model.actuator_actnum[-1])
    data = _pack(model, model.nu - 1, na, plant, there, acting, duration)
    if len(data) > len(held):
        return None
    data = np.append(data, np.zeros(len(held) - len(data)))
    return data if np.array_equal(data != 0, held != 0) else None


def _pack(
    model: mujoco.MjModel,
    nu: int,
    na: int,
    plant: MujocoPlant,
    there: EmbeddedController,
    acting: Acting,
    duration: float,
) -> Array:
    """The controller at the ports of the plant: gains enter K, N, S and the disturbance only."""
    ports, point, controls = plant.linearisation.ports, plant.linearisation.point, there.real
    # signals of the controller's own stand behind all sensors
    signals = controls.N.shape[1] - len(ports.entries)
    entries = np.append(ports.entries, model.nsensordata + np.arange(signals))
    g = np.append(ports.g, np.ones(signals))
    mode, y_0 = at_ports(plant, controls.modes[0], nu, model.nsensordata, signals), np.zeros(model.nsensordata)
    # what the controller takes for the operating point: a bias makes it read more than there is
    y_0[ports.entries] = (plant.linearisation.y - ports.beta) / ports.g
    disturbance, errors, pushes = acting
    beside = replace(
        disturbance,
        n_u=nu,
        input=ports.actuators[disturbance.input],
        amplitude=ports.b[disturbance.input] * disturbance.amplitude,
    )
    # errors are of what is read, after the sensor's gain
    reading = replace(
        errors,
        n_u=mode.N.shape[1],
        input=entries[errors.input],
        amplitude=errors.amplitude / g[errors.input],
    )
    stage = max(int(model.sensor_needstage[i]) for i in _sensors(model, plant))
    pushes = spread(plant.model, point, pushes)
    where = make_table(model, pushes.places, plant.linearisation.plant.inputs, ports.actuators)
    scaled = replace(controls, modes=(mode,))
    drawn = (
        [(int(ports.actuators[i]), float(ports.b[i]), noise) for i, noise in disturbance.gaussian],
        [(int(entries[i]), 1 / float(g[i]), noise) for i, noise in errors.gaussian],
        [(i, 1.0, noise) for i, noise in pushes.size.gaussian],
        [(int(ports.actuators[i]), 1.0, noise) for i, noise in disturbance.shares],
    )
    return pack(
        scaled, y_0, point.ctrl, beside, reading, where, pushes.size, na, stage, there.powers, there.rated, drawn,
        duration,
    )  # fmt: skip


def at_ports(plant: MujocoPlant, mode: Mode, nu: int, entries: int, signals: int = 0) -> Mode:
    """A mode that reads ``entries`` sensor data and then ``signals``, and commands ``nu`` actuators.

    Its matrices are those of the controller's readings and commands, with the gains of the ports: of a mode that reads
    the current outputs first.
    """
    ports, n_y = plant.linearisation.ports, len(plant.linearisation.ports.entries)
    size, columns = len(mode.M), np.append(ports.entries, entries + np.arange(signals))
    g = np.append(ports.g, np.ones(signals))
    K, N, S = np.zeros((nu, size)), np.zeros((size, entries + signals)), np.zeros((nu, entries + signals))
    K[ports.actuators] = ports.b[:, None] * mode.K
    N[:, columns] = mode.N[:, : n_y + signals] * g
    S[np.ix_(ports.actuators, ports.entries)] = ports.b[:, None] * mode.S[:, :n_y] * ports.g
    return Mode(mode.name, mode.M, N, K, S)


def _sensors(bare: mujoco.MjModel, plant: MujocoPlant) -> list[int]:
    """The sensors that outputs are read from."""
    entries = plant.linearisation.ports.entries
    return sorted({int(np.searchsorted(bare.sensor_adr, entry, side="right")) - 1 for entry in entries})


def _check(bare: mujoco.MjModel, name: str, plant: MujocoPlant, controller: Law) -> None:
    mine, assumed = plant.linearisation.plant, controller.plant
    if (mine.n_u, mine.n_y) != (assumed.n_u, assumed.n_y):
        raise ModelError(
            f"model {name!r} has {mine.n_u} inputs and {mine.n_y} outputs, the controller's design "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    for i in _sensors(bare, plant):
        if bare.sensor_needstage[i] == mujoco.mjtStage.mjSTAGE_ACC:
            raise ModelError(
                f"model {name!r}: sensor {bare.sensor(i).name!r} needs accelerations, which depend on the control it "
                "would determine; use position or velocity sensors as outputs"
            )
    if bare.nplugin:
        raise ModelError(f"model {name!r} has engine plugins, whose state a step cannot be undone over")
