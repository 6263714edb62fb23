"""The closed loop as an ordinary MuJoCo model: plant + an actuator whose activations are the controller's states.

The composed model is the plant's, with two elements more, both named ``icmj_controller``:

* an actuator without force (``gainprm="0"``, on the first joint) with ``dyntype="user"``, ``actdim`` 2n̂. Its
  activations are a = (x_o, x_h), so that MuJoCo's integrator takes plant, observer and hold through the same stages,
  and save, restore, roll-out and finite differences see them;
* a ``<numeric>`` that holds the controller, so that a callback needs nothing but the model it is called on.

The numeric is a header of 16 numbers, then row-major blocks (see :class:`Block`):

    header   magic, version, n̂, n_u, n_y, address of a in ``act``, trigger (0 continuous, 1 event, 2 clock),
             last sensor stage needed (1 position, 2 velocity), phase time, number M of disturbance terms, q_t², 0 ...
    M        (2n̂, 2n̂)   ȧ = M a + N (y − y_0)
    N        (2n̂, n_y)
    K        (n_u, 2n̂)   u = −K a, the command; ctrl = ctrl_0 + u + d(t)
    Q_t      (n̂, n̂)      E = (x_h − x_o)ᵀ Q_t (x_h − x_o) − q_t²
    y_0      (n_y,)       outputs at the operating point
    ctrl_0   (n_u,)       controls at the operating point
    terms    (M, 6)       disturbance: input, amplitude, ω, φ, start, end (1e30 for ever)

The *phase time* says which disturbance windows are open: a loop that splits its steps at the windows' edges sets it
to a time between two edges, so that a step ending on an edge still sees the value before it in its last stage. While
it is negative the windows follow the model's own time.

Geoms that are only for the eye are left out, which a step is a seventh faster for: poses are drawn with the plant's own
model. They stay where they could matter, in a medium or under a rangefinder.

Disturbances act on the plant's inputs; the observer is driven by the command u, which is all that a controller knows.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import mujoco
import numpy as np

from icmj.controller import ClockTrigger, Continuous, Controller, EventTrigger
from icmj.disturbance import Disturbance
from icmj.engine.model import model_name
from icmj.engine.plant import MujocoPlant
from icmj.errors import ModelError
from icmj.linear_plant import Array

NAME = "icmj_controller"
MAGIC = 20170508228.0
VERSION = 1.0
HEADER = 16


class Slot(IntEnum):
    """Places in the header."""

    MAGIC = 0
    VERSION = 1
    N_HAT = 2
    N_U = 3
    N_Y = 4
    ACT = 5
    TRIGGER = 6
    STAGE = 7
    PHASE = 8
    TERMS = 9
    Q2 = 10


CONTINUOUS, EVENT, CLOCK = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Block:
    """The controller as it stands in a model: views of the numeric's data, which writing changes.

    Attributes:
        header: shape (16,), by :class:`Slot`.
        M, N, K, Q_t, y_0, ctrl_0, terms: see the module's description.
    """

    header: Array
    M: Array
    N: Array
    K: Array
    Q_t: Array
    y_0: Array
    ctrl_0: Array
    terms: Array

    @property
    def n_hat(self) -> int:
        """Number of states of the assumed plant."""
        return len(self.Q_t)

    @property
    def act(self) -> slice:
        """Where a = (x_o, x_h) stands in ``act``."""
        start = int(self.header[Slot.ACT])
        return slice(start, start + 2 * self.n_hat)


def block_of(model: mujoco.MjModel) -> Block | None:
    """The controller in ``model``, or ``None`` where the model is not a composed one."""
    if model.nnumeric == 0:
        return None
    start, size = int(model.numeric_adr[-1]), int(model.numeric_size[-1])
    data = model.numeric_data[start : start + size]
    if size < HEADER or data[Slot.MAGIC] != MAGIC or data[Slot.VERSION] != VERSION:
        return None
    n, n_u, n_y, terms = (int(data[i]) for i in (Slot.N_HAT, Slot.N_U, Slot.N_Y, Slot.TERMS))
    parts, at = [data[:HEADER]], HEADER
    for shape in ((2 * n, 2 * n), (2 * n, n_y), (n_u, 2 * n), (n, n), (n_y,), (n_u,), (terms, 6)):
        length = int(np.prod(shape))
        parts.append(data[at : at + length].reshape(shape))
        at += length
    return Block(*parts)


def compose(plant: MujocoPlant, controller: Controller, disturbance: Disturbance) -> mujoco.MjModel:
    """The closed-loop model of ``plant`` under ``controller``; the plant's file and spec are not touched.

    Outputs are the plant's sensors and inputs its actuators, in their order; the operating point of the actual plant is
    where controls and outputs are counted from.

    Raises:
        ModelError: if the numbers of inputs or outputs do not fit the design, or a sensor needs accelerations (it
            would close an algebraic loop through the controller) or has a delay.
    """
    spec = plant.spec.copy()
    bare = plant.spec.copy().compile()
    design, name = controller.design, model_name(bare)
    if (bare.nu, bare.nsensordata) != (design.plant.n_u, design.plant.n_y):
        raise ModelError(
            f"model {name!r} has {bare.nu} inputs and {bare.nsensordata} outputs, the controller's design "
            f"{design.plant.n_u} and {design.plant.n_y}; they must agree"
        )
    for i in range(bare.nsensor):
        if bare.sensor_needstage[i] == mujoco.mjtStage.mjSTAGE_ACC:
            raise ModelError(
                f"model {name!r}: sensor {bare.sensor(i).name!r} needs accelerations, which depend on the control it "
                "would determine; use position or velocity sensors as outputs"
            )
    if bare.nhistory:
        raise ModelError(f"model {name!r} has delayed sensors or actuators; the closed loop integrates none")
    if bare.nplugin:
        raise ModelError(f"model {name!r} has engine plugins, whose state a step cannot be undone over")
    stage = int(bare.sensor_needstage.max())

    header = np.zeros(HEADER)
    n = design.plant.n
    header[[Slot.MAGIC, Slot.VERSION, Slot.N_HAT, Slot.N_U, Slot.N_Y]] = MAGIC, VERSION, n, bare.nu, bare.nsensordata
    header[[Slot.ACT, Slot.STAGE, Slot.PHASE, Slot.TERMS]] = bare.na, stage, -1.0, len(disturbance)
    Q_t, kind = np.zeros((n, n)), CONTINUOUS
    match controller.trigger:
        case EventTrigger():
            Q_t, kind = controller.trigger.Q_t, EVENT
            header[Slot.Q2] = controller.trigger.q_t**2
        case ClockTrigger():
            kind = CLOCK
    header[Slot.TRIGGER] = kind
    terms = np.column_stack([
        disturbance.input, disturbance.amplitude, disturbance.omega, disturbance.phase, disturbance.start,
        np.minimum(disturbance.end, 1e30),
    ])  # fmt: skip
    point = plant.linearisation.point
    values = [header, *_dynamics(controller), Q_t, plant.linearisation.y, point.ctrl, terms]
    data = np.concatenate([np.ravel(v) for v in values])

    ranging = np.any(bare.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
    spec.compiler.discardvisual = not (ranging or bare.opt.density or bare.opt.viscosity)
    for key in spec.keys:
        # a keyframe that lists controls or activations must list those of the controller, too
        if len(key.ctrl):
            key.ctrl = [*key.ctrl, 0.0]
        if len(key.act):
            key.act = [*key.act, *np.zeros(2 * n)]
    spec.add_actuator(
        name=NAME, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=spec.joints[0].name or _named(spec.joints[0]),
        dyntype=mujoco.mjtDyn.mjDYN_USER, actdim=2 * n, gainprm=np.zeros(10),
    )  # fmt: skip
    spec.add_numeric(name=NAME, data=data, size=len(data))
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"model {name!r} cannot take the controller: {' '.join(str(error).split())}") from error


def _named(joint: mujoco.MjsJoint) -> str:
    joint.name = f"{NAME}_joint"
    return str(joint.name)


def _dynamics(controller: Controller) -> tuple[Array, Array, Array]:
    """M, N and K of ȧ = M a + N (y − y_0), u = −K a (paper, eqs. obs, hold, u)."""
    design = controller.design
    B, k, L, A_o = design.plant.B, design.k, design.L, design.A_o
    if isinstance(controller.trigger, Continuous):
        # x_h runs along with x_o, so that what is recorded as the hold state is the observer's
        row = np.hstack([A_o - B @ k, np.zeros_like(A_o)])
        return np.vstack([row, row]), np.vstack([L, L]), np.hstack([k, np.zeros_like(k)])
    M = np.block([[A_o, -B @ k], [np.zeros_like(A_o), controller.hold.A_h]])
    return M, np.vstack([L, np.zeros_like(L)]), np.hstack([np.zeros_like(k), k])
