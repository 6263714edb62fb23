"""One change of one property of a plant, by name: an error of the controller's model.

A change is a factor on one property, or a value that replaces it, of one named element or of all elements that have it:

=================  ==========  ====================================================================================
``what``           ``of``      is changed
=================  ==========  ====================================================================================
input_gain         actuator    b in ctrl = ctrl_0 + b (u + d): the operating point keeps its control
mass               body        its mass, and its inertia in proportion: the same shape of another density
inertia            body        its moments of inertia alone
centre_of_mass     body        where its centre of mass is, in the body's frame [m]: a factor, or three numbers
length             body        everything that is placed in its frame (children, joints, geoms, sites, centre of mass)
                               moves away from its origin by a factor; the mass stays, inertia goes with the square
stiffness          joint,      linear and higher coefficients by a factor; a value replaces the linear one. A name is
                   tendon      that of a joint or else of a tendon; without one a factor is for all of both, and a value
                               for all joints
damping            joint,      the same, of actuators that have damping of their own, too
                   tendon
armature           joint,      the same as damping [kg m² or kg]
                   tendon
gainprm, biasprm,  actuator    parameters of its force and of its dynamics: all by a factor, or the first few by value
dynprm
sensor_gain        sensor      g in y = g sensordata + β
sensor_bias        sensor      β, in the sensor's unit
gravity            –           by a factor, or three numbers [m/s²]
=================  ==========  ====================================================================================

ρ scales all changes, from none at 0 to the whole change at 1: a factor f becomes 1 + ρ (f − 1), a value is approached
linearly (the paper's family A = Â − ρÃ₁, in the parameters of the model).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from icmj.base.array import Array
from icmj.errors import ModelError

What = Literal[
    "input_gain", "mass", "inertia", "centre_of_mass", "length", "stiffness", "damping", "armature", "gainprm",
    "biasprm", "dynprm", "sensor_gain", "sensor_bias", "gravity",
]  # fmt: skip


@dataclass(frozen=True)
class Change:
    """A change of one property; the module lists the properties.

    Attributes:
        what: the property.
        of: name of the element; all elements that have the property if ``None``.
        factor: factor on the property, or
        value: value that replaces it.

    Raises:
        ModelError: on construction, if ``what`` is not known, or not exactly one of factor and value is given.
    """

    what: What
    of: str | None = None
    factor: float | None = None
    value: float | Sequence[float] | None = None

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
