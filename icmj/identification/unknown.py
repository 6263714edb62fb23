"""The unknown of a motion: one field of the run file, or a named change, between two bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from icmj.case.case import Case, expect_theory, prepare
from icmj.errors import IcmjError, IdentificationError
from icmj.plant.body import Change
from icmj.runfile.schema import RunFile


@dataclass(frozen=True)
class Unknown:
    """The parameter that is to be identified.

    Attributes:
        run: the run file; its own value of the parameter is not used.
        field: dotted key of the run file, such as ``actual.gain`` (b) or ``actual.rho`` (ρ); "" for a change.
        change: a change of the actual plant whose factor is sought, or ``None``.
        low, high: bounds of the search.
        longest: Δ up to which crossings are searched [s]; if ``None``, that of the run file.
    """

    run: RunFile
    field: str = "actual.gain"
    change: Change | None = None
    low: float = 0.5
    high: float = 1.5
    longest: float | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite([self.low, self.high]).all() and self.low < self.high):
            raise IdentificationError(f"between {self.low:g} and {self.high:g} there is no range to search")

    @property
    def name(self) -> str:
        """The name that is shown."""
        if self.change is not None:
            return f"factor on {self.change.what}{f' of {self.change.of}' if self.change.of else ''}"
        return {"actual.gain": "b", "actual.rho": "ρ"}.get(self.field, self.field)

    def at(self, value: float, **changes: Any) -> RunFile:
        """The run file with ``value`` for the unknown.

        Raises:
            RunFileError: if this value is not allowed.
        """
        if self.longest is not None:
            changes["analysis.delta_max"] = max(self.longest, self.run.analysis.delta_max)
        if self.change is None:
            return self.run.with_(**{self.field: float(value)}, **changes)
        same = (self.change.what, self.change.of)
        actual = self.run.actual
        tables = zip(actual.change, actual.changes, strict=True)
        kept = [table.model_dump(exclude_none=True) for table, of in tables if (of.what, of.of) != same]
        of = {} if self.change.of is None else {"of": self.change.of}
        deviation = {"what": self.change.what, **of, "factor": float(value)}
        return self.run.with_(**{"actual.change": [*kept, deviation]}, **changes)

    def case(self, value: float, like: Case | None = None, **changes: Any) -> Case | None:
        """The case with this value, or ``None`` if no case with an event rule can be prepared."""
        try:
            case = prepare(self.at(value, **changes), like=like)
            expect_theory(case, "identification")
        except IcmjError:
            return None
        return case

    def checked(self) -> Case:
        """The case in the middle of the range, to check that it can be prepared.

        Raises:
            IcmjError: if the run file or its models do not have the field or change.
        """
        case = prepare(self.at((self.low + self.high) / 2))
        expect_theory(case, "identification")
        return case
