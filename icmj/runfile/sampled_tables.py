"""The tables of disturbances that are given at the points of a grid: a ramp, values, or a column of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from icmj.base.array import Array, steps_in
from icmj.errors import DataError, RunFileError, SimulationError
from icmj.runfile.place_table import PlaceTable
from icmj.runfile.table import Finite, Line, NonNegative, Positive
from icmj.simulation.sources import GRID, MOST_VALUES, Sampled, Source

_SCALES = {"deg": ("rad", np.pi / 180), "°": ("rad", np.pi / 180), "cm": ("m", 0.01), "mm": ("m", 0.001)}


class SampledTable(PlaceTable):
    """Values at the points of a regular grid from t = 0 on, with linear interpolation; the last value is held."""

    kind: Literal["sampled"]
    """Kind of the disturbance."""
    values: Annotated[list[Finite], Field(min_length=1, max_length=MOST_VALUES)]
    """Values at the points of the grid [unit of the disturbed signal]. For a body, factors on force and torque."""
    interval: Positive = GRID
    """Distance between the points of the grid [s]. Those of several grids must be integer multiples of the shortest."""
    start: NonNegative = 0.0
    """Time before which the disturbance is zero [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""
    made_by: Line = ""
    """File and column from which the values were read."""

    def source(self) -> Source:
        """The source that it stands for."""
        keys = {key: getattr(self, key) for key in ("input", "output", "interval", "start")}
        return Sampled(values=tuple(self.values), **keys, **self.placed)


class RampTable(PlaceTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    """Kind of the disturbance."""
    size: Finite | None = None
    """Value at the end of the ramp [unit of the disturbed signal]. For a body, a factor on force and torque (default:
    1)."""
    start: NonNegative = 0.0
    """Start [s], an integer multiple of ``interval``."""
    duration: Positive
    """Duration [s], an integer multiple of ``interval``."""
    interval: Positive = GRID
    """Distance between the points of the grid on which it starts and ends [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""

    def source(self) -> Source:
        """The source that it stands for."""
        first, last = self.start / self.interval, (self.start + self.duration) / self.interval
        if max(abs(first - round(first)), abs(last - round(last))) > 1e-6 or last > MOST_VALUES - 1:
            raise SimulationError(
                f"ramp: start {self.start:g} s and duration {self.duration:g} s must be integer multiples of its "
                f"interval, {self.interval:g} s, and at most {MOST_VALUES} of them"
            )
        share = np.clip((np.arange(round(last) + 1) - round(first)) / (round(last) - round(first)), 0.0, 1.0)
        values = tuple((self.sized(self.size) * share).tolist())
        return Sampled(
            input=self.input, output=self.output, values=values, interval=self.interval, **self.placed
        )  # fmt: skip


class FileTable(PlaceTable):
    """A disturbance whose values are a column of a file of time series; the log contains these values."""

    kind: Literal["file"]
    """Kind of the disturbance."""
    file: Annotated[Line, Field(min_length=1)]
    """File of time series, relative to the run file: CSV, Parquet, npz, OpenSim's or C3D."""
    column: Annotated[Line, Field(min_length=1)]
    """Name of the column in the file; degrees are converted to radians, millimetres and centimetres to metres."""
    size: Finite = 1.0
    """Factor on the column."""
    start: NonNegative = 0.0
    """Time of the run at which the file begins [s]. Before this time, the disturbance is zero."""
    interval: Positive = GRID
    """Distance between the points at which the column is sampled, with linear interpolation between its rows [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""

    def source(self) -> None:
        """Nothing before the file has been read (:meth:`drawn`)."""

    def drawn(self, folder: Path, duration: float) -> dict[str, Any]:
        """The table of kind ``sampled`` for a run of ``duration`` [s] whose run file lies in ``folder``.

        Raises:
            RunFileError: if the file cannot be read, has gaps, or makes too many values.
        """
        times, values, _ = read_column("disturbance", folder / self.file, self.column)
        count = min(times[-1] + self.start, duration) / self.interval
        if count > MOST_VALUES - 2:
            raise RunFileError(
                f"disturbance: {self.file} makes {count:.3g} values {self.interval:g} s apart; expected at most "
                f"{MOST_VALUES}; set its interval"
            )
        at = self.interval * np.arange(1 - steps_in(-count))
        taken = self.size * np.interp(at, times + self.start, values)
        kept = self.model_dump(exclude={"kind", "file", "column", "size"}, exclude_unset=True, mode="json")
        return {**kept, "kind": "sampled", "values": taken.tolist(), "made_by": f"{self.file}: {self.column}"}


def read_column(what: str, path: Path, column: str) -> tuple[Array, Array, str]:
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
        raise RunFileError(f"{what}: {path}: {column} has no number in row {row + 1}; fill its gaps")
    return series.t - series.t[0], values, unit
