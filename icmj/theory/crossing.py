"""The crossing: where an eigenvalue of φ(Δ) meets the unit circle, as a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from icmj.theory.circle import Kind

Direction = Literal["rising", "falling", "tangent"]


@dataclass(frozen=True)
class Crossing:
    """One crossing of the unit circle by an eigenvalue of φ(Δ), or by several equal ones together.

    Attributes:
        delta: Δ at the crossing [s].
        eigenvalue: where on the circle (the one with Im ≥ 0 of a complex pair).
        kind: ``+1``, ``-1`` or ``complex`` (a pair: Neimark–Sacker).
        direction: ``rising`` (outwards with growing Δ), ``falling`` or ``tangent``.
        largest_other: largest magnitude of the other eigenvalues there, those that cross together left out.
        multiplicity: how many equal eigenvalues (or pairs) cross together.
        dimension: of their eigenspace; less than ``multiplicity`` if they are defective.
    """

    delta: float
    eigenvalue: complex
    kind: Kind
    direction: Direction
    largest_other: float
    multiplicity: int = 1
    dimension: int = 1


@dataclass(frozen=True, eq=False)
class Search:
    """What was found and how far the search could see.

    Attributes:
        crossings: by rising Δ.
        delta_end: end of the interval searched [s]: ``delta_max``, or earlier where φ has grown so large that
            eigenvalues near the circle drown in its rounding (‖φ‖ > 1e8 in balanced coordinates).
    """

    crossings: tuple[Crossing, ...]
    delta_end: float
