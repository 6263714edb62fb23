"""The named elements of a model that can be selected: keyframes, actuators, sensors, joints, bodies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco

from icmj.engine.model import (
    load_model,
    name_inputs,
    name_outputs,
)
from icmj.engine.safety import check_names, check_sizes, use_model
from icmj.engine.units import name_input_units, name_output_units

_UNITS = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}


@dataclass(frozen=True)
class Inventory:
    """Names in the model's order; quantities are mapped to their units, "" where the unit is unknown.

    Attributes:
        keyframes, bodies: names.
        inputs, outputs, joints: names and units; an output is one entry of a sensor.
        driven: joints that an actuator drives by itself.
        timestep: the model's own [s].
    """

    keyframes: tuple[str, ...]
    inputs: dict[str, str]
    outputs: dict[str, str]
    joints: dict[str, str]
    bodies: tuple[str, ...]
    driven: tuple[str, ...]
    timestep: float


def list_inventory(path: Path) -> Inventory:
    """The selectable elements of the model in an MJCF file.

    Raises:
        ModelError: if it cannot be loaded; see :func:`icmj.engine.model.load_model`.
    """
    with use_model(path):
        spec, model = load_model(path)
        check_names(path, spec)
        check_sizes(path, model)
    return Inventory(
        tuple(model.key(i).name for i in range(model.nkey) if model.key(i).name),
        dict(zip(name_inputs(model), name_input_units(model), strict=True)),
        dict(zip(name_outputs(model), name_output_units(model), strict=True)),
        {
            model.joint(i).name or f"joint{i}": _UNITS.get(mujoco.mjtJoint(model.jnt_type[i]), "")
            for i in range(model.njnt)
        },
        tuple(model.body(i).name for i in range(1, model.nbody) if model.body(i).name),
        tuple(
            model.joint(int(model.actuator_trnid[i, 0])).name
            for i in range(model.nu)
            if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        ),
        float(model.opt.timestep),
    )
