"""What of a model becomes the plant: inputs, outputs, states, the rule for its operating point, and changes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from icmj.base.array import Array, Finite
from icmj.errors import ModelError


@dataclass(frozen=True)
class Selection:
    """The inputs, outputs and states of a plant, by name; ``None`` selects all of the model.

    Attributes:
        inputs: actuators, in this order; the others keep the control of the operating point.
        outputs: sensors, or single entries ``sensor.0`` of one, in this order; the name of a joint selects its position
            and ``<joint>_rate`` its velocity; ``"joints"`` selects the positions of all joints.
        states: states that are kept, in the order of the model.
        drop: states that are left out, if ``states`` is ``None``.
        spare: whether outputs that show a dropped state are left out, too, as with ``"joints"``.
    """

    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | str | None = None
    states: tuple[str, ...] | None = None
    drop: tuple[str, ...] = ()
    spare: bool = False


OperatingKind = Literal["as given", "static control", "balance", "found"]


@dataclass(frozen=True)
class OperatingRule:
    """The rule that completes the operating point: which values a keyframe gives, and which follow from rest.

    Attributes:
        kind: ``as given``: pose, velocity, activation and control are those of the keyframe. ``static control``: the
            pose is that of the keyframe, and controls and activations are those that hold it. ``balance``: the joints
            in ``free`` may move, too. ``found``: as given if the plant is at rest there, otherwise balance.
        free: names of the joints that may move; all if empty.
        pose: positions of hinge and slide joints, instead of those of the keyframe [rad, m].

    If the solution is not unique, the forces of the actuators differ as little as possible from those of the keyframe's
    controls or, without such controls, from zero.
    """

    kind: OperatingKind = "as given"
    free: tuple[str, ...] = ()
    pose: Mapping[str, float] = field(default_factory=dict)


What = Literal[
    "input_gain", "mass", "inertia", "centre_of_mass", "length", "stiffness", "damping", "armature", "gainprm",
    "biasprm", "dynprm", "sensor_gain", "sensor_bias", "gravity",
]  # fmt: skip


@dataclass(frozen=True)
class Change:
    """One change of one property of a plant, by name: an error of the controller's model.

    A change is a factor on one property, or a value that replaces it, of one named element or of all elements that have
    it:

    ================= ======== ====================================================================================
    ``what``          ``of``   effect
    ================= ======== ====================================================================================
    input_gain        actuator changes b in ctrl = ctrl_0 + b (u + d); the operating point keeps its control
    mass              body     changes its mass, and its inertia in proportion: the same shape with another density
    inertia           body     changes only its moments of inertia
    centre_of_mass    body     moves its centre of mass in the body's frame [m]: a factor, or three numbers
    length            body     scales the positions in its frame (children, joints, geoms, sites, centre of mass) by a
                               factor; the mass stays, and the inertia is scaled by the square
    stiffness         joint,   a factor scales the linear and higher coefficients; a value replaces the linear one. A
                      tendon   name is that of a joint or, otherwise, of a tendon; without a name, a factor applies to
                               all joints and tendons, and a value to all joints
    damping           joint,   the same, also for actuators that have damping of their own
                      tendon
    armature          joint,   the same as damping [kg m² or kg]
                      tendon
    gainprm, biasprm, actuator changes the parameters of its force and dynamics: all by a factor, or the first by values
    dynprm
    sensor_gain       sensor   changes g in y = g sensordata + β
    sensor_bias       sensor   changes β, in the sensor's unit
    gravity           –        changes gravity by a factor, or to three numbers [m/s²]
    ================= ======== ====================================================================================

    ρ scales all changes, from no change at 0 to the whole change at 1: a factor f becomes 1 + ρ (f − 1), and a value is
    approached linearly (the family A = Â − ρÃ₁ of the paper, in the parameters of the model).

    Attributes:
        what: property to change.
        of: name of the element whose property changes (default: all elements that have the property).
        factor: factor on the property; give either ``factor`` or ``value``.
        value: new value of the property [unit of the property].

    Raises:
        ModelError: on construction, if ``what`` is not known, or not exactly one of factor and value is given.
    """

    what: What
    of: str | None = None
    factor: Finite | None = None
    value: Finite | Sequence[Finite] | None = None

    def __post_init__(self) -> None:
        if self.what not in get_args(What):
            raise ModelError(f"no change of {self.what!r}; expected one of {', '.join(get_args(What))}")
        if (self.factor is None) == (self.value is None):
            raise ModelError(f"change of {self.what}: give either a factor or a value")
        if self.what == "length" and self.factor is None:
            raise ModelError("change of length: give a factor; a body has no length of its own")
        given = self.factor if self.value is None else self.value
        if not np.isfinite(np.asarray(given, dtype=float)).all():
            raise ModelError(f"change of {self.what}: expected finite numbers, got {given}")

    def __call__(self, before: Array | float, rho: float = 1.0) -> Array:
        """The property after the change, from what it was; a value shorter than it replaces its first entries."""
        old = np.array(before, dtype=float)
        if self.factor is not None:
            return old * (1 + rho * (self.factor - 1))
        new, value = np.atleast_1d(old.copy()), np.atleast_1d(np.asarray(self.value, dtype=float))
        if len(value) > len(new):
            raise ModelError(f"change of {self.what}: {len(value)} numbers for a property of {len(new)}")
        new[: len(value)] += rho * (value - new[: len(value)])
        return new.reshape(old.shape)
