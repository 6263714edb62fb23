"""A standing person by height and mass: segments after Winter, and passive torque at the joints.

Segments are fractions of height and mass: masses, centres of mass and radii of gyration after Winter (2009,
*Biomechanics and Motor Control of Human Movement*, table 4.1, from Dempster), lengths after Drillis and Contini (1966;
Winter's figure 4.1). Both legs are one segment. With G_j = g · (moment of the mass above joint j), the toppling
stiffness, passive stiffness and damping are fractions of G_j. These fractions were calibrated by this project to the
published critical intervals, for a person of 80 kg and 1.80 m; it is an assumption that they are the same for every
person.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from icmj.base.array import Array, NonNegative, Positive
from icmj.errors import ModelError

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
