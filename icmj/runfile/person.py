"""A person in a run file: ``[assumed.person]`` and ``[actual.person]``."""

from __future__ import annotations

from typing import Literal

from icmj.plant.person import Person
from icmj.runfile.table import NonNegative, Positive, TomlTable


class SegmentTable(TomlTable):
    """What is not Winter's of a segment; see :class:`icmj.plant.person.Segment`."""

    mass: Positive | None = None
    length: Positive | None = None
    com: Positive | None = None
    gyration: Positive | None = None


class PersonTable(TomlTable):
    """Height [m] and mass [kg], passive torque, and segments; see :class:`icmj.plant.person.Person`."""

    height: Positive = 1.80
    mass: Positive = 80.0
    stiffness: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.8, 0.8)
    damping: NonNegative = 0.005
    segments: dict[Literal["shank", "thigh", "trunk", "foot"], SegmentTable] = {}

    def person(self) -> Person:
        """The person that it stands for."""
        person = Person(self.height, self.mass, self.stiffness, self.damping)
        for name, table in self.segments.items():
            person = person.with_segment(name, **table.model_dump(exclude_none=True))
        return person
