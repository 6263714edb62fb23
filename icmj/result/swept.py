"""The table of a sweep, and what varies in it: what its pictures are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True, eq=False)
class Swept:
    """One sweep as read back.

    Attributes:
        name, title: of the sweep file.
        varies: what varies: the name of its column, and the field of the run file, "" for a change of the model.
        points: how many there are to be.
        table: the rows that are finished (docs/sweeps.md tells the columns).
    """

    name: str
    title: str
    varies: tuple[tuple[str, str], ...]
    points: int
    table: pa.Table

    def numbers(self, column: str) -> Array:
        """A column of numbers, or of true and false; NaN where there is nothing. Shape (rows,)."""
        return np.array([np.nan if value is None else float(value) for value in self.texts(column)])

    def texts(self, column: str) -> list[Any]:
        """A column as it is."""
        return list(self.table[column].to_pylist())
