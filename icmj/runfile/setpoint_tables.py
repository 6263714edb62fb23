"""The tables of a run: its set-point, how it is simulated, and what the study adds.

The tables of a set-point r(t): its target quantity and its course.

The tables of a run: how it is simulated, and what the study adds.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from icmj.base.array import Array, instants
from icmj.base.process import SWITCH
from icmj.controller.setpoint import StepPairs, Target, double_steps, polygon, pulse, ramp, sines, step, ternary
from icmj.errors import AnalysisError, RunFileError, SimulationError
from icmj.runfile.source_tables import SourceTable, read_column
from icmj.runfile.table import (
    LISTED,
    MOST_ENTRIES,
    Finite,
    Line,
    NonNegative,
    Numbers,
    Positive,
    Positives,
    Reference,
    TomlTable,
)
from icmj.simulation.settings import Integrator, Settings

MOST_STEPS = 10_000  # of pairs of steps
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

    @abstractmethod
    def terms(self, end: float) -> Array:
        """Terms of its motion until ``end`` [s], in the form of :class:`icmj.controller.setpoint.Target`."""

    def target(self, end: float, folder: Path = Path()) -> Target:
        """The target that it stands for, of a run until ``end`` [s] whose run file lies in ``folder``."""
        combination = self.combination or {str(self.output): 1.0}
        return Target(combination, self.terms(end), self.name, unit=self.unit)

    @model_validator(mode="after")
    def _one_of_output_and_combination(self) -> TargetTable:
        if (self.output is None) == (not self.combination):
            raise ValueError("give one of output and combination")
        if self.combination and not self.name:
            raise ValueError("a combination needs a name")
        return self


class StepSetpoint(TargetTable):
    """A step of ``size`` at ``start`` [s], by default at the beginning of the run."""

    kind: Literal["step"]
    """Kind of motion."""
    size: Finite
    """Size of the step [unit of the output]."""
    start: NonNegative = 0.0
    """Start [s]."""

    def terms(self, end: float) -> Array:
        return step(self.size, self.start)


class PulseSetpoint(TargetTable):
    """A pulse of ``size`` from ``start`` [s] on, which ends after ``duration`` [s]."""

    kind: Literal["pulse"]
    """Kind of motion."""
    size: Finite
    """Size of the pulse [unit of the output]."""
    start: NonNegative = 0.0
    """Start [s]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return pulse(self.size, self.start, self.duration)


class RampSetpoint(TargetTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    """Kind of motion."""
    size: Finite
    """Value at the end of the ramp [unit of the output]."""
    start: NonNegative = 0.0
    """Start [s]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return ramp(self.size, self.start, self.duration)


class SinesSetpoint(TargetTable):
    """A sum of sinusoids, Σ a sin(2πf(t − start) + φ)."""

    kind: Literal["sines"]
    """Kind of motion."""
    size: Finite | Numbers
    """Amplitude a: one number for all, or one for each sinusoid [unit of the output]."""
    frequencies: Positives
    """Frequency f of each sinusoid [Hz]."""
    phases: Numbers | None = None
    """Phase φ of each sinusoid [rad]. By default, phases are drawn at random."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of the phases."""
    start: NonNegative = 0.0
    """Start [s]."""

    def terms(self, end: float) -> Array:
        drawn = 2 * np.pi * np.random.default_rng(self.seed).random(len(self.frequencies))
        return sines(self.size, self.frequencies, drawn if self.phases is None else self.phases, self.start)

    @model_validator(mode="after")
    def _one_for_each(self) -> SinesSetpoint:
        count = len(self.frequencies)
        for key in ("size", "phases"):
            given = getattr(self, key)
            if isinstance(given, list) and len(given) != count:
                raise ValueError(f"{key} has {len(given)} numbers for {count} frequencies")
        if self.phases is not None and "seed" in self.model_fields_set:
            raise ValueError("give either phases or their seed")
        return self


class TernarySetpoint(TargetTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated; it repeats after 242 intervals."""

    kind: Literal["ternary"]
    """Kind of motion."""
    size: Finite
    """Peak-to-peak size [unit of the output]. A negative size gives the mirror image."""
    interval: Annotated[Positive, Field(ge=1e-3)] = 0.25
    """Duration of each velocity [s]."""
    start: NonNegative = 0.0
    """Start [s]."""

    def terms(self, end: float) -> Array:
        intervals = (end - self.start) / self.interval
        if intervals > MOST_INTERVALS:
            raise AnalysisError(
                f"a ternary set-point of {self.interval:g} s has {intervals:.3g} intervals in this run; expected at "
                f"most {MOST_INTERVALS}, lengthen its interval"
            )
        return ternary(self.size, self.interval, self.start, end)


class DoubleStepsSetpoint(TargetTable):
    """Pairs of steps of a double-step experiment, in random order; the second step goes on, or back twice as far."""

    kind: Literal["double-steps"]
    """Kind of motion."""
    size: Finite
    """Size of the first step of each pair [unit of the output]."""
    isi: Annotated[Positives, Field(min_length=1, max_length=MOST_ENTRIES)]
    """Inter-step intervals, from the first to the second step [s]."""
    repetitions: Annotated[int, Field(ge=1, le=10_000)] = 5
    """Number of repetitions of each interval in each direction."""
    recovery: Annotated[tuple[Positive, Positive], LISTED] = (2.0, 3.0)
    """Shortest and longest time from a pair to the next [s]. Times are uniformly distributed between them."""
    directions: Annotated[list[Literal["same", "reversal"]], Field(min_length=1, max_length=2)] = ["same", "reversal"]
    """Directions of the second step."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of order, directions and times."""
    start: Positive = 1.0
    """Time before the first pair [s]."""

    def pairs(self) -> StepPairs:
        """The pairs.

        Raises:
            AnalysisError: if an interval is repeated, the size is zero, or there are too many steps.
        """
        steps = 2 * len(self.isi) * len(self.directions) * self.repetitions
        if steps > MOST_STEPS:
            raise AnalysisError(f"a double-step set-point of {steps} steps; expected at most {MOST_STEPS}")
        return double_steps(
            self.isi,
            self.repetitions,
            self.size,
            recovery=self.recovery,
            directions=self.directions,
            seed=self.seed,
            start=self.start,
        )

    def terms(self, end: float) -> Array:
        return self.pairs().terms


class FileSetpoint(TargetTable):
    """A column of a file, linearly interpolated; r is 0 before its first row, and constant after its last row."""

    kind: Literal["file"]
    """Kind of motion."""
    file: Annotated[Line, Field(min_length=1)]
    """File of time series, relative to the run file: CSV, Parquet, npz, OpenSim's or C3D."""
    column: Annotated[Line, Field(min_length=1)]
    """Name of the column in the file; degrees are converted to radians, millimetres and centimetres to metres."""
    size: Finite = 1.0
    """Factor on the column."""
    start: NonNegative = 0.0
    """Time of the run at which the file begins [s]."""
    interval: Positive | None = None
    """Time between the values that are used from the column [s]. By default, every row is used."""

    def target(self, end: float, folder: Path = Path()) -> Target:
        times, values, unit = self._read(folder / self.file)
        combination = self.combination or {str(self.output): 1.0}
        keep = np.searchsorted(times, end) + 1  # rows after the end of the run move nothing
        terms = polygon(times[:keep], values[:keep])
        if len(terms) > MOST_INTERVALS:
            raise AnalysisError(
                f"setpoint: {self.file} has {len(terms)} pieces in this run; expected at most {MOST_INTERVALS}; set "
                "its interval"
            )
        return Target(combination, terms, self.name, unit=self.unit or unit)

    def terms(self, end: float) -> Array:
        return self.target(end).terms

    def _read(self, path: Path) -> tuple[Array, Array, str]:
        """Times in the run [s], values, and their unit."""
        t, values, unit = read_column("setpoint", path, self.column)
        values = self.size * values
        if self.interval is not None:
            count = t[-1] / self.interval
            if count > MOST_INTERVALS:
                raise RunFileError(
                    f"setpoint: interval {self.interval:g} s makes {count:.3g} pieces of {path}; expected at most "
                    f"{MOST_INTERVALS}"
                )
            at = np.append(instants(self.interval, float(t[-1])), t[-1:])
            at = at[np.diff(at, prepend=-1.0) > 1e-9]
            t, values = at, np.interp(at, t, values)
        return t + self.start, values, unit


SetpointTable = Annotated[
    StepSetpoint | PulseSetpoint | RampSetpoint | SinesSetpoint | TernarySetpoint | DoubleStepsSetpoint | FileSetpoint,
    Field(discriminator="kind"),
]


def targets(tables: Sequence[SetpointTable], end: float, path: Path) -> list[Target]:
    """The targets of a set-point in a run until ``end`` [s] of the run file ``path``.

    Raises:
        RunFileError, AnalysisError: if a file of one cannot be read, or it has too many pieces.
    """
    return [table.target(end, path.parent) for table in tables]


def find_files(tables: Sequence[SetpointTable], path: Path) -> list[Path]:
    """The files of a set-point of the run file ``path``."""
    return [path.parent / table.file for table in tables if isinstance(table, FileSetpoint)]


SHORTEST = 1e-6  # s
LONGEST = 1e9  # s, thirty years: the viewer counts nanoseconds in 64 bits


class SimulationTable(TomlTable):
    """Duration, initial state and accuracy of a run; see :class:`icmj.Settings`."""

    duration: Annotated[Positive, Field(ge=SHORTEST, le=LONGEST)] = 30.0
    """Duration of the run [s]."""
    initial: dict[str, Finite] = {}
    """Initial deviations of plant states from the operating point, by name; the others are zero."""
    observer: dict[str, Finite] = {}
    """Initial states of the observer, by name; the others are zero."""
    timestep: Positive | None = None
    """Timestep in MuJoCo, instead of a tolerance [s]. The linear plant needs none."""
    integrator: Integrator | None = None
    """Integrator in MuJoCo (default: that of the model)."""
    record_interval: Positive = 0.01
    """Time between recorded rows [s], which are at its multiples. Events are always recorded."""
    limit: Positive | dict[str, Positive] | None = None
    """Deviation of a position at which the run counts as fallen: one number for all [rad or m, converted to other units
    of angle or length], or positions by name, each in its own unit. Default: 1 rad or 1 m; in plants given by matrices,
    positions with other units have no limit."""
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST_ENTRIES)] = []
    """Disturbances."""
    tolerance: Positive | None = None
    """Relative error of an open-loop interval to which the steps in MuJoCo are adapted. Default, if neither
    timestep nor integrator is given: 10⁻⁸ if no contact, friction or limit can act; else the timestep of the model."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        return Settings(**plain | {"disturbance": tuple(one for table in self.disturbance for one in table.sources())})

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Accepts ``native = true`` of older files; it has no effect any more."""
        if isinstance(data, dict) and "native" in data:
            if data["native"] is not True:
                raise ValueError(f"native = {str(data['native']).lower()} is no longer a key: {SWITCH}")
            return {key: value for key, value in data.items() if key != "native"}
        return data

    @model_validator(mode="after")
    def _fits_together(self) -> SimulationTable:
        try:
            self.settings()
        except SimulationError as error:
            raise ValueError(str(error)) from error
        return self


class StudyTable(TomlTable):
    """Further results that the study adds to one run, and measures of every run.

    The study, and ``icmj run --study``, add clock-driven points for panel (a), the amplitude law, and a search for
    attractors from random starts.
    """

    growth_points: Annotated[int, Field(ge=0, le=200)] = 8
    """Number of clock-driven simulations in panel (a) of the report."""
    law_q_t: Annotated[list[Positive], Field(max_length=MOST_ENTRIES)] = []
    """Thresholds of the amplitude law, at least two [unit of ``controller.q_t``]."""
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts in the search for other attractors."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of these starts."""
    magnification: Positive = 10.0
    """Magnification of the sway in the second body of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST_ENTRIES)] = []
    """Further measures: the ``module:name`` of functions that take a simulation and return numbers by name."""
