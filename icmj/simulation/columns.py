"""Columns of recorded values of one kind, under their names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array


@dataclass(frozen=True, eq=False)
class Block:
    """Some columns of one kind: rows (N, w), and values on the other side of jumps, ``None`` where not known.

    Those are right after the rows that contain what is before, (K, w), and right before those that contain what is
    after, (S, w).
    """

    kind: str
    bare: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    after: Array | None
    before: Array | None = None

    def right_after(self, count: int) -> Array:
        """Values right after the first events, NaN where not known."""
        return np.full((count, len(self.bare)), np.nan) if self.after is None else self.after[:count]

    def right_before(self, count: int) -> Array:
        """Values right before so many jumps, NaN where not known."""
        return np.full((count, len(self.bare)), np.nan) if self.before is None else self.before

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, each with the kind before it."""
        return tuple(f"{self.kind}.{name}" if self.kind else name for name in self.bare)


def look_up_columns(
    kind: str,
    names: tuple[str, ...],
    units: tuple[str, ...],
    values: Array,
    after: Array | None = None,
    before: Array | None = None,
) -> Block:
    """The columns of ``values``, with numbers for names that are not known."""
    width = values.shape[1]
    names = names if len(names) == width else tuple(str(i) for i in range(width))
    units = units if len(units) == width else ("",) * width
    return Block(kind, names, units, values, after, before)
