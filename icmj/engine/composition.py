"""The closed loop as an ordinary MuJoCo model: plant + an actuator whose activations are the controller's states.

The composed model is the plant's, with two elements more, both named ``icmj_controller``:

* an actuator without force (``gainprm="0"``, on the first joint) with ``dyntype="user"`` and as many activations as the
  controller has states, so that MuJoCo's integrator takes plant, observer and hold through the same stages,
  and save, restore, roll-out and finite differences see them;
* a ``<numeric>`` that holds the controller (:mod:`icmj.engine.block`), so that a callback needs nothing but the model
  it is called on.

Geoms that are only for the eye are left out, which a step is a seventh faster for: poses are drawn with the plant's own
model. They stay where they could matter, in a medium or under a rangefinder.

Disturbances act on the plant's inputs; the observer is driven by the command u, which is all that a controller knows,
and by the outputs with their errors, which the plant does not feel.
"""

from __future__ import annotations

import mujoco
import numpy as np

from icmj.controller.controller import Controller, realise
from icmj.engine.block import pack
from icmj.engine.model import model_name
from icmj.engine.plant import MujocoPlant
from icmj.errors import ModelError
from icmj.simulation.disturbance import Disturbance, no_disturbance

NAME = "icmj_controller"


def compose(
    plant: MujocoPlant, controller: Controller, disturbance: Disturbance, errors: Disturbance | None = None
) -> mujoco.MjModel:
    """The closed-loop model of ``plant`` under ``controller``; the plant's file and spec are not touched.

    Outputs are the plant's sensors and inputs its actuators, in their order; the operating point of the actual plant is
    where controls and outputs are counted from. ``errors`` are those of the outputs as the observer reads them.

    Raises:
        ModelError: if the numbers of inputs or outputs do not fit the design, or a sensor needs accelerations (it
            would close an algebraic loop through the controller) or has a delay.
    """
    bare = plant.spec.copy().compile()
    name = model_name(bare)
    _check(bare, name, controller)
    point, controls = plant.linearisation.point, realise(controller)
    stage = int(bare.sensor_needstage.max())
    errors = no_disturbance(bare.nsensordata) if errors is None else errors
    data = pack(controls, plant.linearisation.y, point.ctrl, disturbance, errors, bare.na, stage)

    spec, size = plant.spec.copy(), controls.layout.size
    ranging = np.any(bare.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
    spec.compiler.discardvisual = not (ranging or bare.opt.density or bare.opt.viscosity)
    for key in spec.keys:
        # a keyframe that lists controls or activations must list those of the controller, too
        if len(key.ctrl):
            key.ctrl = [*key.ctrl, 0.0]
        if len(key.act):
            key.act = [*key.act, *np.zeros(size)]
    spec.add_actuator(
        name=NAME, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=spec.joints[0].name or _named(spec.joints[0]),
        dyntype=mujoco.mjtDyn.mjDYN_USER, actdim=size, gainprm=np.zeros(10),
    )  # fmt: skip
    spec.add_numeric(name=NAME, data=data, size=len(data))
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"model {name!r} cannot take the controller: {' '.join(str(error).split())}") from error


def _check(bare: mujoco.MjModel, name: str, controller: Controller) -> None:
    design = controller.design
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


def _named(joint: mujoco.MjsJoint) -> str:
    joint.name = f"{NAME}_joint"
    return str(joint.name)
