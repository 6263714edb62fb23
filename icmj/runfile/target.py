"""What every set-point of a run file shares: the quantity that follows it, and when it begins.

Its course over time is its shape, of the shelf :mod:`icmj.runfile.shapes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from icmj.base.array import MOST_ENTRIES, Array, Finite, NonNegative
from icmj.controller.setpoint import Target
from icmj.runfile.table import Line, TomlTable
from icmj.work.own_code import Code

MOST_INTERVALS = 5_000  # of a ternary sequence or a file: each is a term that a run carries


class TargetTable(TomlTable):
    """A channel of the set-point, or a part of it: entries with the same name are added."""

    output: Annotated[Line, Field(min_length=1)] | None = None
    """Output, or state, of the assumed plant that follows the set-point. Give either ``output`` or ``combination``."""
    combination: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST_ENTRIES)] = {}
    """Weights of outputs or states whose sum follows the set-point, such as ``{ shank = 0.5, thigh = 0.3 }``."""
    name: Line = ""
    """Name of the set-point; a combination needs one."""
    unit: Line = ""
    """Unit of the set-point; by default that of the output."""
    kind: str
    """Kind of motion."""
    start: NonNegative = 0.0
    """Start [s]."""

    @property
    def ends_with_run(self) -> bool:
        """Whether its course is known no longer than for the run of its run file."""
        return False

    @property
    def whole(self) -> float | None:
        """The duration of a run that has all of it [s]; ``None`` if that is not its own to say."""
        return None

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it reads, relative to the run file."""
        return ()

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any] | None:
        """The same as numbers alone, as of a disturbance (:meth:`icmj.runfile.place.DisturbanceTable.resolve`)."""
        return None

    def terms(self, end: float) -> Array:
        """Terms of its motion until ``end`` [s], in the form of :class:`icmj.controller.setpoint.Target`."""
        raise NotImplementedError

    def target(self, end: float, folder: Path = Path()) -> Target:
        """The target that it stands for, of a run until ``end`` [s] whose run file lies in ``folder``."""
        return self._target(self.terms(end))

    def _target(self, terms: Array, unit: str = "") -> Target:
        return Target(self.combination or {str(self.output): 1.0}, terms, self.name, unit=self.unit or unit)

    @model_validator(mode="after")
    def _one_of_output_and_combination(self) -> TargetTable:
        if (self.output is None) == (not self.combination):
            raise ValueError("give one of output and combination")
        if self.combination and not self.name:
            raise ValueError("a combination needs a name")
        return self


def make_targets(tables: Sequence[TargetTable], end: float, path: Path) -> list[Target]:
    """The targets of a set-point in a run until ``end`` [s] of the run file ``path``.

    Raises:
        RunFileError, AnalysisError: if a file of one cannot be read, or it has too many pieces.
    """
    return [table.target(end, path.parent) for table in tables]


def find_files(tables: Sequence[TargetTable], path: Path) -> list[Path]:
    """The files of a set-point of the run file ``path``."""
    return [path.parent / name for table in tables for name in table.files]
