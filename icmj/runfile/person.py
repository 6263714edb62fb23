"""A person in a run file: ``[assumed.person]`` and ``[actual.person]``."""

from __future__ import annotations

from typing import Literal

from icmj.plant.person import Person
from icmj.runfile.table import NonNegative, Positive, TomlTable


class SegmentTable(TomlTable):
    """Values of a segment that replace the default ones; see :class:`icmj.plant.person.Segment`."""

    mass: Positive | None = None
    """Mass as a fraction of that of the body, both sides together."""
    length: Positive | None = None
    """Length as a fraction of the height."""
    com: Positive | None = None
    """Centre of mass from the lower end, as a fraction of the length."""
    gyration: Positive | None = None
    """Radius of gyration about the centre of mass, as a fraction of the length."""


class PersonTable(TomlTable):
    """Height [m] and mass [kg], passive torque, and segments; see :class:`icmj.plant.person.Person`."""

    height: Positive = 1.80
    """Height of the person [m]."""
    mass: Positive = 80.0
    """Mass of the person [kg]."""
    stiffness: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.8, 0.8)
    """Passive stiffness of ankle, knee and hip, as shares of the toppling stiffness."""
    damping: NonNegative = 0.005
    """Passive damping of every joint, divided by its toppling stiffness [s]."""
    segments: dict[Literal["shank", "thigh", "trunk", "foot"], SegmentTable] = {}
    """Segments by name whose values differ from the default ones."""

    def person(self) -> Person:
        """The person that the table describes."""
        person = Person(self.height, self.mass, self.stiffness, self.damping)
        for name, table in self.segments.items():
            person = person.with_segment(name, **table.model_dump(exclude_none=True))
        return person
