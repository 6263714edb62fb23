"""The experiment file: cases, a stimulus, repetitions, and an analysis.

The tables of each kind of experiment: its stimulus, and the settings of its analysis.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from icmj.base.array import MOST_ENTRIES, Finite, NonNegative, Positive, Positives
from icmj.controller.setpoint import TERNARY_INTERVALS, double_steps
from icmj.errors import RunFileError
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import LISTED, Interval, Line, Name, TomlTable, keys_of
from icmj.work.own_code import EXPERIMENTS

_Rate = Annotated[Positive, Field(ge=1.0, le=1e5)]
_Text = Annotated[Line, Field(min_length=1)]


class IntersectionPointTable(TomlTable):
    """Intersection point of ground reaction forces: windows, and range of frequencies.

    The noise in the run file moves the body.
    """

    duration: Positive = 60.0
    """Duration of the part of a trial that is analysed [s]."""
    settle: NonNegative = 10.0
    """Duration before this part, which is left out [s]."""
    rate: _Rate = 100.0
    """Sampling rate [Hz]."""
    window: Positive = 5.12
    """Length of a window [s]. Windows overlap by half."""
    low: Positive = 0.4
    """Lowest frequency [Hz]."""
    high: Positive = 8.0
    """Highest frequency [Hz]."""
    axis: Literal["x", "y"] = "x"
    """Direction in the world: forwards or sideways."""
    height: Positive | None = None
    """Height of the centre of mass above the ground [m] (default: that of the model; needed for ratios of a recording).
    """
    angle: _Text = "force_angle"
    """For a recording: column of the angle −F_x / F_z [rad, deg], instead of ``force``."""
    force: Annotated[tuple[_Text, _Text], LISTED] = ("force.x", "force.z")
    """For a recording: columns of the horizontal and the vertical force (default: those along ``axis``)."""
    cop: _Text = "cop.x"
    """For a recording: column of the centre of pressure [m, cm, mm] (default: that along ``axis``)."""

    @model_validator(mode="after")
    def _has_one_source_of_the_angle(self) -> IntersectionPointTable:
        if {"angle", "force"} <= self.model_fields_set:
            raise ValueError("angle and force: give one, the angle of the force is read or computed")
        return self


class QuietStandingTable(TomlTable):
    """Quiet standing: duration of the trials, and measured signals."""

    duration: Positive = 60.0
    """Duration of the part of a trial that is analysed [s]."""
    settle: NonNegative = 10.0
    """Duration before this part, which is left out [s]."""
    rate: _Rate = 100.0
    """Sampling rate [Hz]."""
    low_pass: Positive | None = 10.0
    """Cut-off frequency of the filter that is applied before all measures [Hz]."""
    columns: Annotated[list[_Text], Field(max_length=2)] = []
    """Signals that are measured (default: the centre of pressure, forwards; without a model, the outputs)."""


class MultisineTable(TomlTable):
    """A sum of sinusoids with given lines and random phases, as a disturbance or as a set-point.

    Lines are integer multiples of 1 / period, so that the record is periodic.
    """

    input: _Text | None = None
    """Input to whose command the stimulus is added. Give either ``input`` or ``setpoint``."""
    setpoint: _Text | None = None
    """Output, or state, of the assumed plant whose set-point moves."""
    amplitude: Positive
    """Amplitude of each line [unit of the input or output]."""
    period: Positive = 10.0
    """Period of the stimulus [s]."""
    lines: Annotated[Positives, Field(max_length=MOST_ENTRIES)]
    """Frequencies [Hz], each an integer multiple of 1 / period."""
    periods: Annotated[int, Field(ge=2, le=10_000)] = 10
    """Number of periods that are analysed."""
    settle: Annotated[int, Field(ge=0, le=10_000)] = 2
    """Number of periods before them, in which transients die out."""
    rate: _Rate = 100.0
    """Sampling rate [Hz]. A period must contain a whole number of samples."""
    response: _Text | None = None
    """Signal whose response is analysed, such as u.ankle_torque (default: the first command)."""
    stimulus: _Text = "stimulus"
    """For a recording: column of the stimulus."""

    @model_validator(mode="after")
    def _is_periodic(self) -> MultisineTable:
        if (self.input is None) == (self.setpoint is None):
            raise ValueError("give one of input and setpoint")
        cycles = [line * self.period for line in self.lines]
        wrong = [line for line, turns in zip(self.lines, cycles, strict=True) if abs(turns - round(turns)) > 1e-6]
        wrong += [line for line, turns in zip(self.lines, cycles, strict=True) if round(turns) < 1]
        if wrong:
            raise ValueError(
                f"lines: {wrong[0]:g} Hz is no whole multiple of 1 / period, {1 / self.period:g} Hz; the record would "
                "not be periodic"
            )
        if len({round(turns) for turns in cycles}) < len(cycles):
            raise ValueError("lines: a frequency is repeated")
        if abs(self.rate * self.period - round(self.rate * self.period)) > 1e-6:
            raise ValueError(f"a period of {self.period:g} s has no whole number of samples at {self.rate:g} Hz")
        if max(self.lines) >= self.rate / 2:
            raise ValueError(f"lines: {max(self.lines):g} Hz is not below half the rate, {self.rate / 2:g} Hz")
        return self


class PerturbedStanceTable(TomlTable):
    """A pseudo-random ternary tilt of the support surface, and the response of the angle of the body in space."""

    size: Positive
    """Peak-to-peak size of the tilt [rad]."""
    interval: Annotated[Positive, Field(ge=1e-2)] = 0.25
    """Duration of each velocity of the sequence [s]. The sequence repeats after 242 intervals."""
    highest: Positive = 2.0
    """Highest line of the stimulus [Hz]."""
    axis_height: NonNegative = 0.0
    """Height of the axis of the tilt in the world, which is that of the ankle [m]."""
    vertical: dict[str, Finite] = {}
    """Share of the tilt that is added to the reading of an output, by name: 1 − W, with the weight W of the surface."""
    vertical_rate: dict[str, Finite] = {}
    """The same share of the rate of the tilt, for outputs that are rates."""
    output: _Text | None = None
    """Output that gives the angle of the body to the surface (default: the first)."""
    periods: Annotated[int, Field(ge=2, le=1000)] = 3
    """Number of periods that are analysed."""
    settle: Annotated[int, Field(ge=0, le=1000)] = 1
    """Number of periods before them, in which transients die out."""
    rate: _Rate = 100.0
    """Sampling rate [Hz]."""
    inertia: Positive | None = None
    """Moment of inertia of a one-link person about the ankle [kg m²]. With this and the next three keys, the
    independent channels are fitted."""
    toppling: Positive | None = None
    """Toppling stiffness m g h [N m/rad]."""
    stiffness: NonNegative = 0.0
    """Passive stiffness of the ankle [N m/rad]."""
    damping: NonNegative = 0.0
    """Passive damping of the ankle [N m s/rad]."""
    stimulus: _Text = "stimulus"
    """For a recording: column of the tilt [rad]."""
    response: _Text = "body"
    """For a recording: column of the angle of the body in space [rad]."""

    @property
    def period(self) -> float:
        """Period of the sequence [s]."""
        return TERNARY_INTERVALS * self.interval

    @model_validator(mode="after")
    def _has_samples_and_lines(self) -> PerturbedStanceTable:
        if abs(self.rate * self.period - round(self.rate * self.period)) > 1e-6:
            raise ValueError(f"a period of {self.period:g} s has no whole number of samples at {self.rate:g} Hz")
        if not 1 / self.period <= self.highest < self.rate / 2:
            raise ValueError(
                f"highest: {self.highest:g} Hz; expected between the first line, {1 / self.period:.3g} Hz, and half "
                "the rate"
            )
        if (self.inertia is None) != (self.toppling is None):
            raise ValueError("a fit needs both inertia and toppling")
        if self.inertia is None and (self.stiffness or self.damping):
            raise ValueError("stiffness and damping are those of a fit, which needs inertia and toppling")
        return self


@keys_of(double_steps, without=("seed", "start"))
class DoubleStepTable(TomlTable):
    """Double steps: pairs of steps of a set-point, in random order."""

    output: _Text | None = None
    """Output, or state, of the assumed plant that follows the steps. Give either ``output`` or ``combination``."""
    combination: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST_ENTRIES)] = {}
    """Weights of several outputs or states, such as ``{ shank = 0.44, thigh = 0.44, trunk = 0.69 }`` for the head."""
    unit: Line = ""
    """Unit of a combination."""
    size: Positive
    isi: Annotated[Positives, Field(min_length=3, max_length=MOST_ENTRIES)]
    repetitions: Annotated[int, Field(ge=1, le=10_000)] = 5
    """Number of repetitions of each interval in each direction, in one trial."""
    directions: Annotated[list[Literal["same", "reversal"]], Field(min_length=1, max_length=2)] = ["same", "reversal"]
    recovery: Annotated[tuple[Positive, Positive], LISTED] = (2.0, 3.0)
    rate: _Rate = 100.0
    """Sampling rate [Hz]."""
    latest: Positive = 1.0
    """Longest reaction time that is considered [s]. It must not exceed the shortest recovery."""
    shortest: NonNegative = 0.0
    """Shortest inter-step interval that the regressions use [s]."""
    control: _Text | None = None
    """Signal that responds, such as u.ankle_torque (default: the first command; in a recording, the column control)."""
    target: _Text = "target"
    """For a recording: column of the set-point."""

    @model_validator(mode="after")
    def _responses_end_before_the_next_pair(self) -> DoubleStepTable:
        if (self.output is None) == (not self.combination):
            raise ValueError("give one of output and combination")
        if self.latest > self.recovery[0]:
            raise ValueError(
                f"latest of {self.latest:g} s is longer than the least recovery, {self.recovery[0]:g} s; lengthen that"
            )
        if self.recovery[0] > self.recovery[1]:
            raise ValueError("recovery: give the shortest time first, then the longest")
        if len(set(self.isi)) < len(self.isi) or len(set(self.directions)) < len(self.directions):
            raise ValueError("isi and directions: an entry is repeated")
        return self


MOST_TRIALS = 100_000


class ExperimentTable(TomlTable):
    """Name of the experiment, plants and repetitions."""

    name: Name
    """Name of the experiment and of its folder."""
    title: Line = ""
    """Title in tables and figures (default: the name)."""
    plants: Annotated[list[Literal["linear", "mujoco"]], Field(min_length=1, max_length=2)] = ["linear", "mujoco"]
    """Plants on which each case is simulated. Cases given by matrices have the linear plant only."""
    repetitions: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = 1
    """Number of trials of each case on each plant."""
    seed: Annotated[int, Field(ge=0, le=2**62)] = 0
    """Seed of the first trial; the next ones have the following numbers. It changes the seeds of noise and stimulus."""


class CaseTable(TomlTable):
    """One case: a run file with some values replaced, and the kind of control."""

    run: str
    """Run file, relative to the experiment file, or the name of a shipped case."""
    name: Name | None = None
    """Name of the case in results (default: that of the run file)."""
    title: Line = ""
    """Title in tables and figures (default: the name, or the title of the run file)."""
    control: Literal["own", "continuous", "clock"] = "own"
    """Kind of control: the controller of the run file, the continuous controller of the same design (with a delay, a
    clock with an interval of a twentieth of it), or a clock instead of the event rule."""
    interval: Interval | None = None
    """Interval of the clock [s]."""
    set: dict[str, Any] = {}
    """Values of the run file that are replaced, such as ``set.controller.q_t = 0.01``."""

    @model_validator(mode="after")
    def _a_clock_has_an_interval(self) -> CaseTable:
        if (self.control == "clock") != (self.interval is not None):
            raise ValueError('interval is that of control = "clock", which needs it')
        return self


class ExperimentFile(FileOfRuns):
    """A validated experiment file. One of the tables determines the kind of experiment and its analysis."""

    experiment: ExperimentTable
    """Name, plants and repetitions."""
    case: Annotated[list[CaseTable], Field(min_length=1, max_length=50)]
    """Cases that are compared."""
    quiet_standing: QuietStandingTable | None = None
    """Quiet standing: measures of sway, and distributions of position and intervals."""
    perturbed_stance: PerturbedStanceTable | None = None
    """Perturbed stance: response to a pseudo-random tilt of the support surface."""
    multisine: MultisineTable | None = None
    """Multi-sine: frequency response and remnant."""
    double_step: DoubleStepTable | None = None
    """Double steps: reaction times and refractory duration."""
    intersection_point: IntersectionPointTable | None = None
    """Intersection point of ground reaction forces."""

    _runs: tuple[RunFile, ...] = PrivateAttr(default=())

    @classmethod
    def validated(cls, data: Mapping[str, Any], path: Path, text: str = "", allow_code: bool = False) -> ExperimentFile:
        """Validate plain data as an experiment file; run files are in the folder of ``path``, or shipped ones.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        made = cls._read(data, path, text)
        made._runs = tuple(
            made._run(case.run, case.set, f"case[{i}].set", allow_code) for i, case in enumerate(made.case)
        )
        twice = sorted({name for name in made.names if made.names.count(name) > 1})
        if twice:
            raise RunFileError(f"{path}: two cases are called {twice[0]!r}; give one a name")
        return made

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> ExperimentFile:
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            said = " and ".join(f"[{name}]" for name in given) or "none"
            raise ValueError(f"expected one table of {', '.join(f'[{name}]' for name in KINDS)}, got {said}")
        return self

    @property
    def kind(self) -> str:
        """The kind of experiment: the name of its table."""
        return next(name for name in KINDS if getattr(self, name) is not None)

    @property
    def settings(self) -> Any:
        """The table of its kind."""
        return getattr(self, self.kind)

    @property
    def runs(self) -> tuple[RunFile, ...]:
        """The run file of each case, with its values replaced."""
        return self._runs

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return tuple(case.name or run.case.name for case, run in zip(self.case, self._runs, strict=True))

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the cases."""
        return tuple(case.title or case.name or run.case.title for case, run in zip(self.case, self._runs, strict=True))


KINDS = tuple(name for name in ExperimentFile.model_fields if name not in ("experiment", "case"))


def load_experiment(path: Path | str, *, allow_code: bool = False) -> ExperimentFile:
    """Read and validate an experiment file and the run files that it names; the name of a shipped one stands for it.

    Args:
        path: the file, or the name.
        allow_code: whether Python code that a run file names (``module:name``) may be run once the case is prepared.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path, text = read_text(Path(path), EXPERIMENTS)
    return ExperimentFile.validated(parse_toml(text, path), path, text, allow_code)
