"""A column of a file of time series, linear between its rows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from icmj.base.array import Array, Finite, NonNegative, Positive, count_steps, list_multiples
from icmj.controller.setpoint import Target, polygon
from icmj.errors import AnalysisError, DataError, RunFileError
from icmj.runfile.place import PlaceTable
from icmj.runfile.shapes import kind_of_course
from icmj.runfile.table import Line, TomlTable, keys_of
from icmj.runfile.target import MOST_INTERVALS, TargetTable
from icmj.simulation.sources import GRID, MOST_VALUES, Sampled
from icmj.work.own_code import Code

_SCALES = {"deg": ("rad", np.pi / 180), "°": ("rad", np.pi / 180), "cm": ("m", 0.01), "mm": ("m", 0.001)}


class ColumnTable(TomlTable):
    """A course that is a column of a file."""

    file: Annotated[Line, Field(min_length=1)]
    """File of time series, relative to the run file: CSV, Parquet, npz, OpenSim's or C3D."""
    column: Annotated[Line, Field(min_length=1)]
    """Name of the column in the file; degrees are converted to radians, millimetres and centimetres to metres."""
    size: Finite = 1.0
    """Factor on the column."""

    @property
    def files(self) -> tuple[str, ...]:
        return (self.file,)


@keys_of(Sampled, without=("values",))
class FileTable(ColumnTable, PlaceTable):
    """A disturbance whose values are a column of a file of time series; the log contains these values."""

    kind: Literal["file"]
    start: NonNegative = 0.0
    """Time of the run at which the file begins [s]. Before this time, the disturbance is zero."""
    interval: Positive = GRID
    """Distance between the points at which the column is sampled, with linear interpolation between its rows [s]."""

    def source(self) -> None:
        """Nothing before the file has been read (:meth:`drawn`)."""

    def resolve(self, code: Code, folder: Path, duration: float) -> dict[str, Any]:
        """The table of kind ``sampled`` with the values of the column.

        Raises:
            RunFileError: if the file cannot be read, has gaps, or makes too many values.
        """
        times, values, _ = _read_column("disturbance", folder / self.file, self.column)
        count = min(times[-1] + self.start, duration) / self.interval
        if count > MOST_VALUES - 2:
            raise RunFileError(
                f"disturbance: {self.file} makes {count:.3g} values {self.interval:g} s apart; expected at most "
                f"{MOST_VALUES}; set its interval"
            )
        at = self.interval * np.arange(1 - count_steps(-count))
        taken = self.size * np.interp(at, times + self.start, values)
        kept = self.model_dump(exclude={"kind", "file", "column", "size"}, exclude_unset=True, mode="json")
        made_by = f"{self.file}: {self.column}"
        return {**kept, "kind": kind_of_course(Sampled), "values": taken.tolist(), "made_by": made_by}


class FileSetpoint(ColumnTable, TargetTable):
    """A column of a file, linearly interpolated; r is 0 before its first row, and constant after its last row."""

    kind: Literal["file"]
    start: NonNegative = 0.0
    """Time of the run at which the file begins [s]."""
    interval: Positive | None = None
    """Time between the values that are used from the column [s]. By default, every row is used."""

    @property
    def ends_with_run(self) -> bool:
        return True

    def target(self, end: float, folder: Path = Path()) -> Target:
        times, values, unit = self._read(folder / self.file)
        keep = np.searchsorted(times, end) + 1  # rows after the end of the run move nothing
        terms = polygon(times[:keep], values[:keep])
        if len(terms) > MOST_INTERVALS:
            raise AnalysisError(
                f"setpoint: {self.file} has {len(terms)} pieces in this run; expected at most {MOST_INTERVALS}; set "
                "its interval"
            )
        return self._target(terms, unit)

    def terms(self, end: float) -> Array:
        return self.target(end).terms

    def _read(self, path: Path) -> tuple[Array, Array, str]:
        """Times in the run [s], values, and their unit."""
        t, values, unit = _read_column("setpoint", path, self.column)
        values = self.size * values
        if self.interval is not None:
            count = t[-1] / self.interval
            if count > MOST_INTERVALS:
                raise RunFileError(
                    f"setpoint: interval {self.interval:g} s makes {count:.3g} pieces of {path}; expected at most "
                    f"{MOST_INTERVALS}"
                )
            at = np.append(list_multiples(self.interval, float(t[-1])), t[-1:])
            at = at[np.diff(at, prepend=-1.0) > 1e-9]
            t, values = at, np.interp(at, t, values)
        return t + self.start, values, unit


def _read_column(what: str, path: Path, column: str) -> tuple[Array, Array, str]:
    """Times from zero on [s], values, and their unit, which is radians or metres for an angle or a length.

    Raises:
        RunFileError: if the file cannot be read, or a value is missing; ``what`` it is for begins the message.
    """
    from icmj.series.reading import read_series

    try:
        series = read_series(path, columns=(column,))
    except DataError as error:
        raise RunFileError(f"{what}: {error}") from error
    unit, scale = _SCALES.get(series.units[0].lower(), (series.units[0], 1.0))
    values = scale * series.values[:, 0]
    if not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values))[0])
        raise RunFileError(f"{what}: {path} has no number in {column}, row {row + 1}; fill its gaps")
    return series.t - series.t[0], values, unit


DISTURBANCE, SETPOINT = FileTable, FileSetpoint
