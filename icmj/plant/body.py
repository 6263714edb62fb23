"""A body: a person's measures, muscles, what of a model becomes the plant, and changes of it.

A standing person by height and mass: segments after Winter, and passive torque at the joints.

Segments are fractions of height and mass: masses, centres of mass and radii of gyration after Winter (2009,
*Biomechanics and Motor Control of Human Movement*, table 4.1, from Dempster), lengths after Drillis and Contini (1966;
Winter's figure 4.1). Both legs are one segment. With G_j = g · (moment of the mass above joint j), the toppling
stiffness, passive stiffness and damping are fractions of G_j. These fractions were calibrated by this project to the
published critical intervals, for a person of 80 kg and 1.80 m; it is an assumption that they are the same for every
person.

What of a model becomes the plant: its inputs, outputs and states, and the rule for its operating point.

Activation dynamics of muscles: a lag between the command of an input and its action.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Literal, get_args

import numpy as np

from icmj.base.array import Array, Finite, NonNegative, Positive
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant

GRAVITY = 9.81


@dataclass(frozen=True)
class Segment:
    """A segment of a standing person, described by fractions.

    Attributes:
        mass: mass of both sides together, as a fraction of the body mass.
        length: length, as a fraction of the body height.
        com: distance of the centre of mass from the lower end, as a fraction of the length of the segment.
        gyration: radius of gyration about the centre of mass, as a fraction of the length of the segment.

    Raises:
        ModelError: on construction, if one of them is not positive.
    """

    mass: Positive
    length: Positive
    com: Positive
    gyration: Positive

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value > 0):
                raise ModelError(f"a segment's {item.name} must be positive, got {value}")


SEGMENTS: Mapping[str, Segment] = {
    "shank": Segment(mass=2 * 0.0465, length=0.246, com=0.567, gyration=0.302),
    "thigh": Segment(mass=2 * 0.100, length=0.245, com=0.567, gyration=0.323),
    "trunk": Segment(mass=0.678, length=0.288, com=0.626, gyration=0.496),
}
"""From the ankle upwards; the trunk is head, arms and trunk."""
FOOT = Segment(mass=2 * 0.0145, length=0.152, com=0.5, gyration=0.475)
"""Its length is along the floor."""
ANKLE_HEIGHT = 0.039
"""Of the ankle above the floor, of the body's height."""


@dataclass(frozen=True)
class Person:
    """A standing person.

    Attributes:
        height: body height [m].
        mass: body mass [kg].
        stiffness: passive stiffness of ankle, knee and hip, as shares of the toppling stiffness.
        damping: passive damping of every joint, divided by its toppling stiffness [s].
        segments: replacements for Winter's segments, by name (shank, thigh, trunk, foot).

    Raises:
        ModelError: on construction, if height or mass is not positive, a fraction is negative, or a segment is unknown.
    """

    height: Positive = 1.80
    mass: Positive = 80.0
    stiffness: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.8, 0.8)
    damping: NonNegative = 0.005
    segments: Mapping[str, Segment] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("height", "mass"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ModelError(f"a person's {name} must be positive, got {value}")
        if len(self.stiffness) != 3 or not all(np.isfinite(part) and part >= 0 for part in self.stiffness):
            raise ModelError(f"a person's stiffness: expected three shares, none negative, got {self.stiffness}")
        if not (np.isfinite(self.damping) and self.damping >= 0):
            raise ModelError(f"a person's damping must not be negative, got {self.damping}")
        unknown = [name for name in self.segments if name not in (*SEGMENTS, "foot")]
        if unknown:
            raise ModelError(f"a person has no segment {unknown[0]!r}; it has {', '.join(SEGMENTS)}, foot")

    def __getitem__(self, name: str) -> Segment:
        """The segment of this name, as fractions."""
        return self.segments.get(name, FOOT if name == "foot" else SEGMENTS[name])

    def with_segment(self, name: str, **fractions: float) -> Person:
        """The same person with some fractions of a segment changed.

        Raises:
            ModelError: if there is no such segment.
        """
        if name not in (*SEGMENTS, "foot"):
            raise ModelError(f"a person has no segment {name!r}; it has {', '.join(SEGMENTS)}, foot")
        return replace(self, segments={**self.segments, name: replace(self[name], **fractions)})

    def mass_of(self, name: str) -> float:
        """Mass of a segment [kg]."""
        return self[name].mass * self.mass

    def length_of(self, name: str) -> float:
        """Length of a segment [m]."""
        return self[name].length * self.height

    def com_of(self, name: str) -> float:
        """Height of the centre of mass above the segment's lower end [m]."""
        return self[name].com * self.length_of(name)

    def inertia_of(self, name: str) -> float:
        """Moment of inertia about the centre of mass, in the plane of sway [kg m²]."""
        return self.mass_of(name) * (self[name].gyration * self.length_of(name)) ** 2

    def toppling_stiffness(self, g: float = GRAVITY) -> Array:
        """Toppling stiffness of ankle, knee and hip: G_j = g · (moment of the mass above the joint) [N m/rad], (3,)."""
        names = list(SEGMENTS)
        G = np.zeros(3)
        for j in range(3):
            base = 0.0
            for name in names[j:]:
                G[j] += g * self.mass_of(name) * (base + self.com_of(name))
                base += self.length_of(name)
        return G


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


Each = Positive | Mapping[str, Positive]
"""A number for all inputs, or one for each input that it names."""

Lag = tuple[float] | tuple[float, float]
"""Parameters of one lag: τ [s] of the first order; ω₀ [rad/s] and ζ of the second."""


@dataclass(frozen=True)
class Activation:
    """Activation dynamics: a lag of unit gain between the command u of an input and the activation a that acts there.

    The first order is τ ȧ = u − a, the second order is ä + 2ζω₀ ȧ + ω₀² a = ω₀² u. The states of the input ``ankle``
    are called ``ankle_act`` or, for the second order, ``ankle_act0`` for ȧ and ``ankle_act1`` for a. The unit of a is
    that of the command.

    Attributes:
        order: order of the lag: 1 is ``1/(τs + 1)``, 2 is ``ω₀²/(s² + 2ζω₀s + ω₀²)``; 0 is none where the assumed plant
            has one.
        time_constant: time constant τ [s]. For the second order it is 1/ω₀. This and the following are one number for
            all inputs, or one number for each input by name; inputs that are not named have no lag.
        frequency: natural frequency ω₀ of the second order, instead of a time constant [rad/s].
        damping_ratio: damping ratio ζ of the second order (default: 1, critically damped).

    Raises:
        ModelError: on construction, if the keys do not define a lag of this order, or a number is not positive.
    """

    order: int
    time_constant: Each | None = None
    frequency: Each | None = None
    damping_ratio: Each | None = None

    def __post_init__(self) -> None:
        if isinstance(self.order, bool) or self.order not in (0, 1, 2):
            raise ModelError(f"activation: order must be 0, 1 or 2, got {self.order}")
        given = [field.name for field in fields(self)[1:] if getattr(self, field.name) is not None]
        allowed = {0: (), 1: ("time_constant",), 2: ("time_constant", "frequency", "damping_ratio")}[self.order]
        for name in given:
            if name not in allowed:
                raise ModelError(f"activation: a lag of order {self.order} has no {name}")
            value = getattr(self, name)
            if isinstance(value, Mapping) and not value:
                raise ModelError(f"activation: {name} names no input")
            for number in value.values() if isinstance(value, Mapping) else (value,):
                if not 0 < float(number) < np.inf:
                    raise ModelError(f"activation: {name} must be a positive number, got {number}")
        if self.order and (self.time_constant is None) == (self.frequency is None):
            ways = "a time_constant [s]" if self.order == 1 else "either a time_constant [s] or a frequency [rad/s]"
            raise ModelError(f"activation: give a lag of order {self.order} {ways}")
        named = self._pace
        if isinstance(self.damping_ratio, Mapping) and isinstance(named, Mapping):
            for name in self.damping_ratio:
                if name not in named:
                    raise ModelError(f"activation: damping_ratio names {name!r}, which is given no lag")

    @property
    def _pace(self) -> Each | None:
        return self.time_constant if self.frequency is None else self.frequency

    def lags(self, inputs: Sequence[str]) -> tuple[Lag | None, ...]:
        """The parameters of the lag of each of the ``inputs``; ``None`` for an input without a lag.

        Raises:
            ModelError: if it names what is no input.
        """
        for value in (self._pace, self.damping_ratio):
            for name in value if isinstance(value, Mapping) else ():
                if name not in inputs:
                    raise ModelError(f"activation: no input {name!r}; there are {', '.join(inputs)}")
        return tuple(self._lag(name) for name in inputs)

    def _lag(self, name: str) -> Lag | None:
        pace = _of(self._pace, name)
        if pace is None:
            return None
        if self.order == 1:
            return (pace,)
        return (pace if self.frequency is not None else 1 / pace, _of(self.damping_ratio, name) or 1.0)

    def before(self, plant: LinearPlant) -> LinearPlant:
        """The linear plant with this lag between its commands and its inputs.

        The states of the lag follow those of the plant. Pushes act on the plant itself, after the lag.

        Raises:
            ModelError: if it names what is no input of the plant.
            AnalysisError: if a state of the plant has the name of an activation.
        """
        lags = self.lags(plant.inputs)
        sizes = [0 if lag is None else len(lag) for lag in lags]
        n, size = plant.n, plant.n + sum(sizes)
        A, B, C = np.zeros((size, size)), np.zeros((size, plant.n_u)), np.zeros((plant.n_y, size))
        A[:n, :n], B[:n], C[:, :n] = plant.A, plant.B, plant.C
        states, units, at = list(plant.states), list(plant.state_units), n
        for j, (lag, of) in enumerate(zip(lags, plant.inputs, strict=True)):
            if lag is None:
                continue
            unit = plant.input_units[j]
            last = at + len(lag) - 1  # the activation itself
            A[:n, last], B[:n, j] = plant.B[:, j], 0.0
            if len(lag) == 1:
                A[at, at], B[at, j] = -1 / lag[0], 1 / lag[0]
            else:
                omega, zeta = lag
                A[at, at], A[at, last], A[last, at] = -2 * zeta * omega, -omega * omega, 1.0
                B[at, j] = omega * omega
            states += activation_names(of, len(lag))
            units += [unit and f"{unit}/s", unit][-len(lag) :]
            at = last + 1
        none = np.zeros((size - n, plant.n_u))
        pushes = {push: np.append(effect, none[:, 0]) for push, effect in plant.pushes.items()}
        names = {"states": tuple(states), "state_units": tuple(units)}
        return replace(plant, A=A, B=B, C=C, B_d=np.vstack([plant.B_d, none]), pushes=pushes, **names)


def activation_names(of: str, size: int) -> list[str]:
    """Names of the activations of the input ``of``."""
    return [f"{of}_act"] if size == 1 else [f"{of}_act{i}" for i in range(size)]


def is_activation(state: str, inputs: Sequence[str]) -> bool:
    """Whether a state has the name of an activation of one of the inputs."""
    return any(state in (*activation_names(of, 1), *activation_names(of, 2)) for of in inputs)


def _of(value: Each | None, name: str) -> float | None:
    found = value.get(name) if isinstance(value, Mapping) else value
    return None if found is None else float(found)
