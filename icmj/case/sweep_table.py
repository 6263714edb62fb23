"""The table of a sweep and its varied fields, from which its pictures are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.errors import ReportError

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True, eq=False)
class SweepTable:
    """One sweep as read back.

    Attributes:
        name, title: of the sweep file.
        varies: what varies: the name of its column, and the field of the run file, "" for a change of the model.
        points: how many there are to be.
        table: the rows that are finished (docs/sweeps.md describes the columns).
        units: units of what varies and of the outputs, by name, where they are known.
    """

    name: str
    title: str
    varies: tuple[tuple[str, str], ...]
    points: int
    table: pa.Table
    units: Mapping[str, str] = field(default_factory=dict)

    def numbers(self, column: str) -> Array:
        """A numeric or Boolean column, NaN where a value is missing; shape (rows,); raises as :meth:`texts`."""
        return np.array([np.nan if value is None else float(value) for value in self.texts(column)])

    def texts(self, column: str) -> list[Any]:
        """A column without conversion.

        Raises:
            ReportError: if there is no such column.
        """
        names = self.table.column_names
        if column not in names:
            raise ReportError(f"sweep {self.name!r} has no column {column!r}; there are {', '.join(names[:8])} …")
        return list(self.table[column].to_pylist())
