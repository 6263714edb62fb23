"""A crossing: an interval Δ at which an eigenvalue of φ(Δ) meets the unit circle, as a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["+1", "-1", "complex"]


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
        uncertainty: how far rounding may have moved ``delta`` [s]; 0 if by no more than some millionths of the range.
    """

    delta: float
    eigenvalue: complex
    kind: Kind
    direction: Direction
    largest_other: float
    multiplicity: int = 1
    dimension: int = 1
    uncertainty: float = 0.0

    @property
    def range(self) -> tuple[float, float]:
        """The first and last Δ at which it may be [s]."""
        return self.delta - self.uncertainty, self.delta + self.uncertainty


@dataclass(frozen=True, eq=False)
class Search:
    """The crossings found and the range that could be resolved.

    Attributes:
        crossings: by rising Δ.
        delta_end: end of the interval searched [s]: ``delta_max``, or earlier where φ has grown so large that
            eigenvalues near the circle drown in its rounding (‖φ‖ > 1e8 in balanced coordinates).
        unresolved: first and last Δ of each part of it [s] in which crossings may be missing: over it the number of
            eigenvalues outside changes by more or less than the crossings found explain, or rounding decides it.
    """

    crossings: tuple[Crossing, ...]
    delta_end: float
    unresolved: tuple[tuple[float, float], ...] = ()


def change_outside(crossing: Crossing) -> int:
    """Change of the number of eigenvalues outside."""
    sign = {"rising": 1, "falling": -1, "tangent": 0}[crossing.direction]
    return sign * crossing.multiplicity * (2 if crossing.kind == "complex" else 1)


def select_distinct(found: list[Crossing], resolution: float) -> list[Crossing]:
    """Crossings without duplicates from neighbouring panels, or from a panel and a zoom."""
    kept: list[Crossing] = []
    for c in found:
        same = [
            k
            for k in kept[-8:]
            if k.kind == c.kind
            and abs(k.delta - c.delta) < resolution * (1 if "tangent" in (k.direction, c.direction) else 1e-3)
            and abs(k.eigenvalue - c.eigenvalue) < 1e-6
            and (k.direction == c.direction or "tangent" in (k.direction, c.direction))
        ]
        if not same:
            kept.append(c)
    return kept
