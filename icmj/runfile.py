"""The run file: one TOML file that says everything about a case, validated on load."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from icmj.errors import RunFileError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
MOST_SAMPLES = 2e6  # some hundred bytes each, in memory and in the log
Weight = Literal["output", "identity"] | list[Finite] | list[list[Finite]]


class Section(BaseModel):
    """Base of all sections: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Paper(Section):
    """What the paper says of this case; shown beside our numbers, never used in a computation."""

    figure: str = ""
    delta_crit: Positive | None = None
    eigenvalue: Literal[1, -1] | None = None
    cycle: bool | None = None
    statements: list[str] = []
    note: str = ""


class Identity(Section):
    """Name (also the log's file name) and title."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)]
    title: str
    paper: Paper = Paper()


class Assumed(Section):
    """The plant that the controller believes in."""

    model: str
    keyframe: str | None = None


class Actual(Section):
    """The plant that is really there: another model, or the same one with a deviation."""

    model: str | None = None
    keyframe: str | None = None
    gain: Finite | list[Finite] = 1.0
    dynprm: dict[str, list[Finite]] = {}
    rho: Finite = 1.0


class Weights(Section):
    """LQ weights of state feedback (Q_c, R_c) and observer (Q_o, R_o)."""

    Q_c: Weight = "output"
    R_c: Positive | list[Positive] = 1.0
    Q_o: Literal["input", "identity"] | list[Finite] | list[list[Finite]] = "input"
    R_o: Positive | list[Positive] = 1.0


class Control(Section):
    """Hold and event trigger."""

    hold: Literal["system-matched", "zero-order"] = "system-matched"
    Q_t: Weight = "output"
    q_t: Positive
    delta_min: NonNegative = 1e-3


class Analysis(Section):
    """Range of Δ searched for crossings [s]."""

    delta_max: Positive = 3.0


class Impulse(Section):
    """A torque impulse on one input: ``size`` [N m s] spread evenly over ``duration`` [s] from ``start`` [s]."""

    kind: Literal["impulse"]
    input: str
    size: Finite
    start: NonNegative = 0.0
    duration: Positive = 0.05


class Step(Section):
    """A torque step on one input: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    input: str
    size: Finite
    start: NonNegative = 0.0


class Noise(Section):
    """Band-limited noise on one input: standard deviation ``size`` [N m], up to ``bandwidth`` [Hz], from ``seed``."""

    kind: Literal["noise"]
    input: str
    size: Positive
    bandwidth: Positive
    seed: Annotated[int, Field(ge=0)]
    start: NonNegative = 0.0


Disturbance = Annotated[Impulse | Step | Noise, Field(discriminator="kind")]


class SimulationSettings(Section):
    """How long, from where, and how finely.

    ``initial`` names plant states and their departure from the operating point; the observer starts at
    ``observer`` (named states of the assumed plant), by default all zero: the controller has seen nothing yet.
    ``limit``: the run has *fallen* when any position state of the plant departs further than this [rad or m].
    """

    duration: Positive = 30.0
    initial: dict[str, Finite] = {}
    observer: dict[str, Finite] = {}
    timestep: Positive | None = None
    integrator: Literal["RK4", "Euler", "implicit", "implicitfast", "discrete"] | None = None
    record_interval: Positive = 0.01
    limit: Positive = 1.0
    disturbance: list[Disturbance] = []

    @model_validator(mode="after")
    def _samples_fit_into_memory(self) -> SimulationSettings:
        samples = self.duration / self.record_interval
        if samples > MOST_SAMPLES:
            raise ValueError(
                f"duration / record_interval asks for {samples:.3g} samples; expected at most {MOST_SAMPLES:.0e}, "
                "raise record_interval"
            )
        return self


class Study(Section):
    """What the study adds to one run.

    Clock-driven points for panel (a), thresholds for the amplitude law, random starts in search of attractors.
    """

    growth_points: Annotated[int, Field(ge=0, le=200)] = 8
    law_q_t: list[Positive] = []
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    seed: Annotated[int, Field(ge=0)] = 0
    magnification: Positive = 10.0


class RunFile(Section):
    """A validated run file."""

    case: Identity
    assumed: Assumed
    actual: Actual = Actual()
    design: Weights = Weights()
    controller: Control
    analysis: Analysis = Analysis()
    simulation: SimulationSettings = SimulationSettings()
    study: Study = Study()

    _text: str = PrivateAttr(default="")
    _path: Path = PrivateAttr(default=Path("run.toml"))

    @model_validator(mode="after")
    def _law_needs_two_points(self) -> RunFile:
        if len(self.study.law_q_t) == 1:
            raise ValueError("study.law_q_t needs at least two thresholds to fit a slope")
        return self

    @property
    def text(self) -> str:
        """The TOML text as read."""
        return self._text

    @property
    def path(self) -> Path:
        """Where it was read from; model files are relative to its folder."""
        return self._path

    @property
    def assumed_path(self) -> Path:
        """The assumed plant's MJCF file."""
        return self._path.parent / self.assumed.model

    @property
    def actual_path(self) -> Path:
        """The actual plant's MJCF file; the assumed plant's if none is named."""
        return self._path.parent / (self.actual.model or self.assumed.model)


def load_run(path: Path | str) -> RunFile:
    """Read and validate a run file.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise RunFileError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise RunFileError(f"{path}: not UTF-8 text at byte {error.start}") from error
    return parse_run(text, path)


def parse_run(text: str, path: Path | str = "run.toml") -> RunFile:
    """Validate the text of a run file; ``path`` locates its models and names it in errors.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path = Path(path)
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RunFileError(f"{path}: not TOML: {error}") from error
    try:
        run = RunFile.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"]) or "file"
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        shown = "" if first["type"] == "missing" else f", got {first['input']!r:.60}"
        raise RunFileError(f"{path}: {key}: {first['msg']}{shown}{more}") from error
    run._text, run._path = text, path
    return run
