"""The tables of a run: its disturbances, how it is simulated, and what the study adds.

The tables of disturbances: each kind with its shape, and the place where it acts. Shapes that a set-point may have,
too, are here.

The keys of a disturbance that determine where it acts: on an input, on a body, or on the support surface.

The tables of disturbances that are given at the points of a grid: a ramp, values, or a column of a file.

The tables of disturbances that are sums of chosen sinusoids: some, or those of a pseudo-random sequence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar, cast

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from icmj.base.array import LARGEST, MOST_ENTRIES, Array, Finite, NonNegative, Positive, Seed, steps_in
from icmj.base.process import SWITCH
from icmj.errors import DataError, RunFileError, SimulationError
from icmj.plant.linear_plant import ZERO
from icmj.runfile.table import (
    LISTED,
    Line,
    Numbers,
    Parameters,
    Positives,
    Reference,
    TomlTable,
    check_by,
    keys_of,
    make,
    short,
)
from icmj.simulation.disturbance import ternary_lines, tilt_sources
from icmj.simulation.settings import (
    GRID,
    MOST_VALUES,
    Bias,
    Duration,
    Gaussian,
    Impulse,
    Noise,
    On,
    Sampled,
    Settings,
    Sinusoids,
    Source,
    Step,
)
from icmj.work.own_code import Code, digest_of, pick_accepted

Kind = TypeVar("Kind", bound=Source)
Vector = Annotated[tuple[Finite, Finite, Finite], LISTED]


class ColumnTable(TomlTable):
    """A course that is a column of a file."""

    file: Annotated[Line, Field(min_length=1)]
    """File of time series, relative to the run file: CSV, Parquet, npz, OpenSim's or C3D."""
    column: Annotated[Line, Field(min_length=1)]
    """Name of the column in the file; degrees are converted to radians, millimetres and centimetres to metres."""
    size: Finite = 1.0
    """Factor on the column."""


class HarmonicTable(TomlTable):
    """A course that is a sum of sinusoids."""

    size: Finite | Numbers
    """Amplitude a: one number for all, or one for each sinusoid [unit of the signal]."""
    frequencies: Positives
    """Frequency f of each sinusoid [Hz]."""
    phases: Numbers | None = None
    """Phase φ of each sinusoid [rad]. By default, phases are drawn at random."""
    seed: Seed = 0
    """Seed of the phases."""

    @property
    def all_phases(self) -> Array:
        """The phases, also those that are drawn [rad]."""
        drawn = 2 * np.pi * np.random.default_rng(self.seed).random(len(self.frequencies))
        return drawn if self.phases is None else np.array(self.phases)


class SequenceTable(TomlTable):
    """A course that is a pseudo-random ternary sequence of velocities, integrated."""

    size: Finite
    """Peak-to-peak size of the sequence [unit of the signal]. A negative size gives the mirror image."""
    interval: Annotated[Positive, Field(ge=1e-3)] = 0.25
    """Duration of each velocity [s]."""


class DisturbanceTable(TomlTable):
    """A disturbance of any kind."""

    kind: str
    """Kind of the disturbance."""


class PlaceTable(DisturbanceTable):
    """The place at which a disturbance acts: an input, any point of any body of a model, or the support surface."""

    input: str | None = None
    """Name of the input that is disturbed; give either ``input`` or ``body``."""
    on: On | None = None
    """For an input: with ``"body"``, the disturbance acts on the body itself, in the direction in which the length of
    the actuator increases, independent of its gain, gear and dynamics: 1 N m about a hinge (default for impulses and
    steps). With ``"command"``, it is added to the command, before gain, gear and dynamics (default for noise)."""
    body: str | None = None
    """Name of the body that is pushed; needs a model."""
    force: Vector = ZERO
    """Force on the body in world axes, multiplied by ``size`` [N]."""
    torque: Vector = ZERO
    """Torque on the body in world axes, multiplied by ``size`` [N m]."""
    point: Vector | None = None
    """Point of application in the frame of the body [m] (default: its centre of mass). For a tilt, a point of its axis
    in the world (default: the origin)."""
    surface: Literal["translation", "tilt", "gravity", "turning"] | None = None
    """Instead of an input or body, the support surface moves: ``"translation"`` with an acceleration of this ``size``
    [m/s²], or ``"tilt"`` by an angle of this ``size`` [rad], which must be a sum of sinusoids. A tilt consists of
    ``"gravity"``, whose direction turns by this angle, and ``"turning"`` with its angular acceleration [rad/s²]. Needs
    a model."""
    axis: Vector | None = None
    """Direction of a translation (default: x, forwards), or axis of a tilt (default: y; positive angles tilt the
    surface forwards)."""
    vertical: dict[str, Finite] = {}
    """For a tilt: share of the tilt that is added to the observer's reading of an output, by name: 0 (default) for an
    angle to the surface, as joint receptors sense it; 1 for an angle to the vertical."""
    vertical_rate: dict[str, Finite] = {}
    """The same share of the rate of the tilt, for outputs that are rates."""

    def source(self) -> Source | None:
        """The source that it stands for; ``None`` before code of the user's own has drawn it."""
        return self.make_source(
            cast(Callable[..., Source], self.setting), **({"size": self.full_size} if hasattr(self, "size") else {})
        )

    def make_source(self, source: Callable[..., Kind], **more: Any) -> Kind:
        """The source of this class that acts at this place, with its keys that the table has and ``more``."""
        if self.surface is not None:
            axis = self.axis or ((1.0, 0.0, 0.0) if self.surface == "translation" else (0.0, 1.0, 0.0))
            moves = "gravity" if self.surface == "tilt" else self.surface
            more |= {"surface": moves, "axis": axis, "on": "body", "body": None}
        return make(source, self, **more)

    def sources(self) -> Iterator[Source]:
        """The sources that it stands for: of a tilt, the angle, its acceleration, and what is read of it.

        Raises:
            SimulationError: if they do not fit, or a tilt has no acceleration.
        """
        given = {"axis": any(self.axis or ()), "vertical": self.vertical, "vertical_rate": self.vertical_rate}
        of_surface = [key for key, there in given.items() if there]
        if of_surface and self.surface is None:
            raise SimulationError(f"{of_surface[0]} belongs to a motion of the support surface; give surface, too")
        if self.surface is not None and (self.on == "command" or any(self.force) or any(self.torque)):
            raise SimulationError("command, force and torque do not apply to a motion of the support surface")
        found = self.source()
        if self.surface == "tilt" and found is not None:
            yield from tilt_sources(found, self.vertical, self.vertical_rate, self.point)
        elif self.vertical or self.vertical_rate or (self.surface not in (None, "turning") and self.point):
            raise SimulationError("vertical and point apply only to a tilt of the support surface")
        elif found is not None:
            yield found

    @property
    def full_size(self) -> float:
        """The size; 1 where force and torque are given and it is left out."""
        size: float | None = getattr(self, "size", None)
        if size is None and self.body is None and self.surface is None:
            raise SimulationError("size is required")
        return 1.0 if size is None else size


_SCALES = {"deg": ("rad", np.pi / 180), "°": ("rad", np.pi / 180), "cm": ("m", 0.01), "mm": ("m", 0.001)}


@keys_of(Sampled)
class SampledTable(PlaceTable):
    """Values at the points of a regular grid from t = 0 on, with linear interpolation; the last value is held."""

    kind: Literal["sampled"]
    made_by: Line = ""
    """File and column from which the values were read."""


@keys_of(Sampled, without=("values",))
class RampTable(PlaceTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    size: Finite | None = None
    """Value at the end of the ramp [unit of the disturbed signal]. For a body, a factor on force and torque (default:
    1)."""
    start: NonNegative = 0.0
    """Start [s], an integer multiple of ``interval``."""
    duration: Positive
    """Duration [s], an integer multiple of ``interval``."""
    interval: Positive = GRID
    """Distance between the points of the grid on which it starts and ends [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        first, last = self.start / self.interval, (self.start + self.duration) / self.interval
        if max(abs(first - round(first)), abs(last - round(last))) > 1e-6 or last > MOST_VALUES - 1:
            raise SimulationError(
                f"ramp: start {self.start:g} s and duration {self.duration:g} s must be integer multiples of its "
                f"interval, {self.interval:g} s, and at most {MOST_VALUES} of them"
            )
        share = np.clip((np.arange(round(last) + 1) - round(first)) / (round(last) - round(first)), 0.0, 1.0)
        return self.make_source(Sampled, values=tuple((self.full_size * share).tolist()), start=0.0)


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
        raise RunFileError(f"{what}: {path} has no number in {column}, row {row + 1}; fill its gaps")
    return series.t - series.t[0], values, unit


@keys_of(Sinusoids, without=("terms",))
class SinesTable(HarmonicTable, PlaceTable):
    """A sum of sinusoids, Σ a cos(2πf t + φ), with given frequencies."""

    kind: Literal["sines"]

    def source(self) -> Source:
        count, phases = len(self.frequencies), self.all_phases
        size = np.atleast_1d(np.asarray(self.size, dtype=float))
        if len(phases) != count or len(size) not in (1, count):
            raise SimulationError(f"sines: {count} frequencies; expected as many phases, and one size or as many")
        terms = np.column_stack([np.broadcast_to(size, count), 2 * np.pi * np.array(self.frequencies), phases])
        return self.make_source(Sinusoids, terms=tuple(map(tuple, terms.tolist())))


@keys_of(Sinusoids, without=("terms",))
class TernaryTable(SequenceTable, PlaceTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated: the sum of its lines up to ``bandwidth``.

    It repeats after 242 intervals. As a sum of sinusoids it is smooth, like the motion of a platform.
    """

    kind: Literal["ternary"]
    bandwidth: Positive | None = None
    """Highest line [Hz] (default: half of 1 / interval)."""

    def source(self) -> Source:
        highest = 0.5 / self.interval if self.bandwidth is None else self.bandwidth
        terms = ternary_lines(self.size, self.interval, highest)
        if not len(terms) and abs(self.size) < np.finfo(float).tiny:
            raise SimulationError(f"ternary: nothing is left of a size of {self.size:g}; leave the disturbance out")
        if not len(terms):
            raise SimulationError(
                f"ternary: no line up to {highest:g} Hz; the first is at {1 / 242 / self.interval:g} Hz"
            )
        return self.make_source(Sinusoids, terms=tuple(map(tuple, terms.tolist())))


@keys_of(Impulse)
class ImpulseTable(PlaceTable):
    """An impulse on an input or a body: ``size`` [N m s], constant over ``duration`` [s] from ``start`` [s] on."""

    kind: Literal["impulse"]
    size: Finite | None = None


@keys_of(Step)
class StepTable(PlaceTable):
    """A step on an input or a body: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    size: Finite | None = None


@keys_of(Noise)
class NoiseTable(PlaceTable):
    """Coloured noise on one input or body, or on one output as the observer reads it.

    Its standard deviation is ``size``. Its spectrum is flat up to ``bandwidth`` [Hz], or a first-order low-pass with a
    ``corner`` [Hz]; see :class:`icmj.simulation.settings.Noise`.
    """

    kind: Literal["noise"]
    size: Positive | None = None
    seed: Seed


@keys_of(Gaussian)
class GaussianTable(PlaceTable):
    """Gaussian noise on one input or body, or on one output as the observer reads it.

    Its spectrum is white, or a first-order low-pass with a ``corner`` [Hz]. Its distribution is exact at the points of
    a grid; see :class:`icmj.simulation.settings.Gaussian`.
    """

    kind: Literal["gaussian"]
    size: Positive | None = None
    share: Positive | None = None
    """Instead of ``size``, for an ``input``: standard deviation as a share of the controller's command to it, as in
    signal-dependent motor noise. The noise is this share times the command times noise of variance one. Needs a
    controller whose command follows from a hold between events."""
    seed: Seed

    def source(self) -> Source:
        """The source that it stands for."""
        if self.share is not None and self.size is not None:
            raise SimulationError("gaussian noise: give size or share, not both")
        return self.make_source(Gaussian, **({"share": self.share} if self.share else {"size": self.full_size}))


@keys_of(Bias)
class BiasTable(DisturbanceTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]

    def sources(self) -> Iterator[Source]:
        """The source that it stands for."""
        yield make(Bias, self)


@keys_of(Sinusoids)
class SinusoidsTable(PlaceTable):
    """A sum of sinusoids on one input or body, or on one output as the observer reads it.

    See :class:`icmj.simulation.settings.Sinusoids`. Noise from user code is also recorded in this form.
    """

    kind: Literal["sinusoids"]
    made_by: Line = ""
    """Code that drew the terms, as ``module:name``."""
    sha256: str = ""
    """Digest of its source file."""


@keys_of(Sinusoids, without=("terms",))
class OwnNoiseTable(PlaceTable):
    """Noise from your own code: the ``module:name`` of a function that draws the terms of a sum of sinusoids."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The function; it receives the parameters, and ``duration`` [s] if it accepts one."""
    parameters: Parameters = {}
    """Parameters of the function, by name, including its seed."""

    def source(self) -> None:
        """Nothing before its code has drawn it (:meth:`drawn`)."""

    def drawn(self, code: Code, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` for a run of ``duration`` [s], whose terms ``code`` draws.

        Raises:
            RunFileError: if the code may not be run, fails, or draws no terms.
        """
        make = code.find(self.kind)
        told = code.make(self.kind, **{**pick_accepted(make, {"duration": duration}), **self.parameters})
        try:
            terms = np.atleast_2d(np.asarray(told, dtype=float))
        except (TypeError, ValueError):
            terms = np.zeros((0, 0))
        if terms.ndim != 2 or terms.shape[1] not in (3, 5) or not len(terms):
            raise RunFileError(f"{self.kind}: expected rows (a, ω, φ) or (a, ω, φ, start, end), got {short(told)}")
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        drawn = {"terms": np.clip(terms, -LARGEST, LARGEST).tolist(), "made_by": self.kind, "sha256": digest_of(make)}
        return {**kept, "kind": "sinusoids", **drawn}


def draw_tables(tables: Sequence[Any], code: Code, folder: Path, duration: float) -> dict[int, dict[str, Any]]:
    """Those of these tables that stand for code or a file in ``folder``, as numbers for a run of ``duration`` [s].

    Raises:
        RunFileError: if the code may not be run, fails, or draws nothing, or a file cannot be read.
    """
    return {
        i: table.drawn(code, duration) if isinstance(table, OwnNoiseTable) else table.drawn(folder, duration)
        for i, table in enumerate(tables)
        if isinstance(table, OwnNoiseTable | FileTable)
    }


def _kind(table: Any) -> str | None:
    kind = table.get("kind") if isinstance(table, Mapping) else getattr(table, "kind", None)
    return "own" if isinstance(kind, str) and ":" in kind else None if kind is None else str(kind)


SourceTable = Annotated[
    Annotated[ImpulseTable, Tag("impulse")]
    | Annotated[StepTable, Tag("step")]
    | Annotated[NoiseTable, Tag("noise")]
    | Annotated[GaussianTable, Tag("gaussian")]
    | Annotated[BiasTable, Tag("bias")]
    | Annotated[SinusoidsTable, Tag("sinusoids")]
    | Annotated[SinesTable, Tag("sines")]
    | Annotated[TernaryTable, Tag("ternary")]
    | Annotated[RampTable, Tag("ramp")]
    | Annotated[SampledTable, Tag("sampled")]
    | Annotated[FileTable, Tag("file")]
    | Annotated[OwnNoiseTable, Tag("own")],
    Discriminator(_kind),
]
"""A disturbance of a run file, by its ``kind``."""


@keys_of(Settings)
class SimulationTable(TomlTable):
    """Duration, initial state and accuracy of a run; see :class:`icmj.Settings`."""

    duration: Duration = 30.0
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST_ENTRIES)] = []
    """Disturbances."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        return make(Settings, self, disturbance=tuple(one for table in self.disturbance for one in table.sources()))

    _fits_together = check_by("settings")

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Accepts ``native = true`` of older files; it has no effect any more."""
        if isinstance(data, dict) and "native" in data:
            if data["native"] is not True:
                raise ValueError(f"native = {str(data['native']).lower()} is no longer a key: {SWITCH}")
            return {key: value for key, value in data.items() if key != "native"}
        return data


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
    seed: Seed = 0
    """Seed of these starts."""
    magnification: Positive = 10.0
    """Magnification of the sway in the second body of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST_ENTRIES)] = []
    """Further measures: the ``module:name`` of functions that take a simulation and return numbers by name."""
