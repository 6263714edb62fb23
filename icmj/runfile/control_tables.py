"""The tables of the controller: weights of its design, hold and event rule, set-point, and range of the analysis.

The tables of controllers that are not intermittent; ``[controller] kind`` selects one.

The tables of a set-point r(t): its target quantity and its course.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from icmj.base.array import MOST_ENTRIES, Array, Finite, NonNegative, Positive, instants, real
from icmj.controller.controller import Controller, Law, expect_law
from icmj.controller.delayed import Channel, DelayedPID, PredictorController, SwitchingChannels, SwitchingPD, slope_of
from icmj.controller.design import HOLDS, Delay, Design, Hold
from icmj.controller.setpoint import (
    Setpoint,
    StepPairs,
    Target,
    double_steps,
    polygon,
    pulse,
    ramp,
    sines,
    step,
    ternary,
)
from icmj.controller.trigger import BoxTrigger, EventRule, EventTrigger, as_weight, expect_own_rule
from icmj.errors import AnalysisError, RunFileError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import Kind
from icmj.runfile.run_tables import ColumnTable, HarmonicTable, SequenceTable, read_column
from icmj.runfile.table import (
    Interval,
    Line,
    Matrix,
    Numbers,
    Parameters,
    Positives,
    Reference,
    TomlTable,
    Weight,
    keys_of,
    make,
)
from icmj.work.own_code import Code, guard, pick_accepted

_RULES = ("quadratic", "box")


class Weights(TomlTable):
    """LQ weights of the state feedback (Q_c, R_c) and the observer (Q_o, R_o), or the gains k and L instead."""

    Q_c: Weight = "output"
    """Weight of the states: ``"output"`` for ĈᵀĈ, ``"identity"`` for I, the diagonal, or the matrix."""
    R_c: Positive | Positives = 1.0
    """Weight of the inputs: one number for all, or a list with one for each."""
    Q_o: Literal["input", "identity"] | Numbers | Matrix = "input"
    """Covariance of the process noise: ``"input"`` for B̂B̂ᵀ, ``"identity"`` for I, the diagonal, or the matrix."""
    R_o: Positive | Positives = 1.0
    """Variance of the sensor noise: one number for all outputs, or a list with one for each."""
    k: Matrix | Numbers | None = None
    """State-feedback gain k̂ instead of weights, row by row; for a single input, also a list of its entries."""
    L: Matrix | Numbers | None = None
    """Observer gain L instead of weights, row by row; for a single output, also a list of its entries."""

    @model_validator(mode="after")
    def _weights_or_gains(self) -> Weights:
        for gain, weights in (("k", ("Q_c", "R_c")), ("L", ("Q_o", "R_o"))):
            foreign = [name for name in weights if name in self.model_fields_set]
            if getattr(self, gain) is not None and foreign:
                raise ValueError(f"give either {gain} or {foreign[0]}")
        return self


@dataclass(frozen=True)
class Parts:
    """What the table of a controller makes its controller of.

    Attributes:
        assumed: the assumed plant.
        delay: actual and assumed delay.
        code: the code that the run file may name.
        design: gains by the weights of the run file; computed when asked for.
        setpoint: the set-point of the run file, for the assumed plant; computed when asked for.
    """

    assumed: LinearPlant
    delay: Delay
    code: Code
    design: Callable[[], Design]
    setpoint: Callable[[], Setpoint | None]


class ControllerTable(TomlTable):
    """A table ``[controller]`` of any kind."""

    has_events: ClassVar[bool] = False
    """Whether its controller has an event rule, and with it a critical interval and a prediction."""
    follows: ClassVar[bool] = False
    """Whether its controller follows a set-point."""

    def law(self, parts: Parts) -> Law:
        """The controller for the assumed plant; with the actual delay, if it is none of a design.

        Raises:
            DesignError, AnalysisError: if the weights give none, or a part does not fit the plant.
            RunFileError: if a controller, rule or hold of one's own may not be made, or cannot be, or a file of the
                set-point cannot be read.
        """
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """Values that make it another controller for the paper's theory, for fingerprints."""
        return self.model_dump()


class Control(ControllerTable):
    """Hold and event rule: ``quadratic`` with Q_t and q_t, or ``box`` with a threshold for each output or state.

    ``delta_min`` is Δ_min, the shortest time between two events [s], which psychologists call the refractory period.
    """

    kind: Literal["intermittent"] = "intermittent"
    """Kind of controller: this one, ``"predictor"``, ``"switching"``, ``"delayed-pid"``, or your own, by its
    ``module:name``."""
    hold: Literal["system-matched", "zero-order", "own"] | Reference = "system-matched"
    """Hold, which drives the plant between events: the assumed closed loop (system-matched), a constant control
    (zero-order), or A_h (own); or the ``module:name`` of a function that makes a hold, or its matrix, from the
    design."""
    A_h: Matrix | None = None
    """Matrix of the hold ``own``, ẋ_h = A_h x_h, row by row."""
    rule: Literal["quadratic", "box"] | Reference = "quadratic"
    """Event rule; or the ``module:name`` of a class of event rules."""
    parameters: Parameters = {}
    """Parameters by name of a rule given as ``module:name``."""
    hold_parameters: Parameters = {}
    """Parameters by name of a hold given as ``module:name``."""
    Q_t: Weight = "output"
    """Weight of the hold error in the quadratic rule, in the same forms as ``design.Q_c``."""
    q_t: Positive | None = None
    """Threshold of the quadratic rule, required for it: an event occurs when √(eᵀQ_te) = q_t [unit of the outputs]."""
    on: Literal["output", "state"] = "output"
    """Whether the box rule compares outputs or states."""
    threshold: Positive | Positives | None = None
    """Threshold of the box rule, required for it: one for all, or a list with one for each [unit of each]."""
    delta_min: NonNegative = 1e-3
    """Shortest interval between two events [s]: the refractory period."""
    sampling_delay: NonNegative = 0.0
    """Time from the instant at which the rule reaches its threshold to the event, at which observer and set-point are
    sampled [s]. ``delta_min`` then counts from threshold to threshold, and the rule is evaluated again after the
    action. The prediction does not account for it."""

    has_events: ClassVar[bool] = True
    follows: ClassVar[bool] = True

    def law(self, parts: Parts) -> Controller:
        design = parts.design()
        rule = self.trigger(design, parts.code)
        hold = self.make_hold(design, parts.code)
        return Controller(design, hold, rule, parts.delay, parts.setpoint(), sampling_delay=self.sampling_delay)

    def identity(self) -> dict[str, Any]:
        """Hold and weight of the rule; its threshold is none of the theory."""
        return self.model_dump(include={"hold", "Q_t"} | ({"A_h"} if self.A_h else set()))

    def trigger(self, design: Design, code: Code) -> EventRule:
        """The event rule for a controller of this design; ``code`` creates a user-defined rule.

        Raises:
            AnalysisError: if it does not fit the design, or user code does not return a rule. RunFileError: if user
                code may not be executed, or fails.
        """
        if self.rule not in _RULES:
            given = pick_accepted(code.find(self.rule), {"delta_min": self.delta_min})
            rule = code.make(self.rule, **{**given, **self.parameters})
            with guard(self.rule):
                return expect_own_rule(rule, design)
        if self.rule == "box":
            assert self.threshold is not None
            return BoxTrigger(np.array(self.threshold), self.on, self.delta_min)
        assert self.q_t is not None
        return EventTrigger(as_weight(self.Q_t, design), self.q_t, self.delta_min)

    def make_hold(self, design: Design, code: Code) -> Hold:
        """The hold for a controller of this design; ``code`` creates a user-defined hold.

        Raises:
            AnalysisError: if it does not fit the design.
            RunFileError: if user code may not be executed, or fails.
        """
        if ":" in self.hold:
            made = code.make(self.hold, design, **self.hold_parameters)
            return made if isinstance(made, Hold) else Hold(self.hold, real(made, self.hold, AnalysisError))
        if self.A_h is None:
            return HOLDS[self.hold](design)
        n = design.plant.n
        if len(self.A_h) != n or any(len(row) != n for row in self.A_h):
            raise AnalysisError(f"A_h does not fit the assumed plant; expected {n} rows of {n} numbers")
        return Hold("own", np.array(self.A_h))

    @model_validator(mode="after")
    def _own_hold_has_its_matrix(self) -> Control:
        if self.hold_parameters and ":" not in self.hold:
            raise ValueError(f"the {self.hold} hold has no parameters; only a hold given as module:name has parameters")
        if (self.hold == "own") != (self.A_h is not None):
            raise ValueError('A_h is the matrix of hold = "own", which needs it')
        return self

    @model_validator(mode="after")
    def _keys_are_those_of_the_rule(self) -> Control:
        if self.rule not in _RULES:
            theirs = [name for name in ("Q_t", "q_t", "on", "threshold") if name in self.model_fields_set]
            if theirs:
                raise ValueError(f"a rule given as module:name has no key {theirs[0]}; put its numbers into parameters")
            return self
        if self.parameters:
            raise ValueError(f"the {self.rule} rule has no parameters; only a rule given as module:name has parameters")
        needed, others = ("threshold", ("Q_t", "q_t")) if self.rule == "box" else ("q_t", ("on", "threshold"))
        if getattr(self, needed) is None:
            raise ValueError(f"the {self.rule} rule needs {needed}")
        foreign = [name for name in others if name in self.model_fields_set]
        if foreign:
            raise ValueError(f"the {self.rule} rule has no {foreign[0]}")
        return self


class Analysis(TomlTable):
    """Range of the search for crossings, and notices that are accepted although they are errors."""

    delta_max: Interval = 3.0
    """Upper end of the search for crossings [s]."""
    allow: list[Kind] = []
    """Kinds of notice that are reported instead of stopping the run as errors."""


Share = Annotated[float, Field(gt=0, le=1)]


class SwitchedTable(TomlTable):
    """What bounds the region where feedback is off, in one plane."""

    share: Annotated[float, Field(gt=0, le=1)] | None = None
    """Share ρ of the plane in which feedback is on, instead of ``slope`` = −tan(π(ρ − ½)); 1 means everywhere."""

    @property
    def line(self) -> dict[str, Any]:
        """What ``share`` says instead of ``slope``, where it is given: the line, or that there is none."""
        if self.share is None:
            return {}
        return {"slope": 0.0, "switches": False} if self.share == 1 else {"slope": slope_of(self.share)}

    @model_validator(mode="after")
    def _says_it_once(self) -> SwitchedTable:
        if self.share is not None and "slope" in self.model_fields_set:
            raise ValueError("give slope or share, not both")
        return self


@keys_of(Channel)
class SwitchingChannel(SwitchedTable):
    """One channel of a switching controller of several joints: for a joint, or for the virtual pendulum."""

    @property
    def channel(self) -> Channel:
        """The channel."""
        return make(Channel, self, **self.line)


@keys_of(SwitchingPD, without=("assumed", "delay"))
class Switching(SwitchedTable, ControllerTable):
    """Feedback of delayed outputs that is switched on and off in their state plane (Asai et al. 2009).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["switching"]
    """Kind of controller."""
    position: str
    rate: str
    P: Finite | Numbers
    D: Finite | Numbers

    def law(self, parts: Parts) -> Law:
        return make(SwitchingPD, self, assumed=parts.assumed, delay=parts.delay.t_d, **self.line)


class Channelled(ControllerTable):
    """Switched feedback for a body with several joints: each channel is switched in its own plane.

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    tag: ClassVar[str] = "channels"

    kind: Literal["switching"]
    """Kind of controller; it has channels instead of one position and rate."""
    channel: Annotated[list[SwitchingChannel], Field(min_length=1, max_length=MOST_ENTRIES)]
    """The channels, one ``[[controller.channel]]`` each."""

    def law(self, parts: Parts) -> Law:
        return SwitchingChannels(parts.assumed, tuple(each.channel for each in self.channel), parts.delay.t_d)


@keys_of(DelayedPID, without=("assumed", "delay"))
class DelayedPIDTable(ControllerTable):
    """Continuous delayed feedback, proportional, integral and derivative, with force feedback (Peterka's family).

    Its delay is that of the plant: ``delay`` of ``[actual]``, or else of ``[assumed]``.
    """

    kind: Literal["delayed-pid"]
    """Kind of controller."""

    def law(self, parts: Parts) -> Law:
        return make(DelayedPID, self, assumed=parts.assumed, delay=parts.delay.t_d)


class Predictor(ControllerTable):
    """The continuous predictor controller: observer, predictor over the delay, and feedback act continuously.

    Its gains are those of ``[design]``, its delay is that of the plant, and its predictor uses the assumed delay.
    """

    kind: Literal["predictor"]
    """Kind of controller."""

    follows: ClassVar[bool] = True

    def law(self, parts: Parts) -> Law:
        return PredictorController(parts.design(), parts.delay, parts.setpoint())


class OwnController(ControllerTable):
    """Your own controller: the ``module:name`` of a class that inherits from ``icmj.Law``."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The class; it receives the assumed plant, the delay if it accepts one, and the parameters."""
    parameters: Parameters = {}
    """Parameters of the controller, by name."""

    def law(self, parts: Parts) -> Law:
        given = pick_accepted(parts.code.find(self.kind), {"delay": parts.delay.t_d})
        made = parts.code.make(self.kind, parts.assumed, **{**given, **self.parameters})
        if not isinstance(made, Law):
            raise RunFileError(f"controller.kind: {self.kind} makes a {type(made).__name__}; expected an icmj.Law")
        with guard(self.kind):
            return expect_law(made, parts.assumed)


def _kind(table: Any) -> str:
    kind = table.get("kind", "intermittent") if isinstance(table, Mapping) else getattr(table, "kind", "intermittent")
    if kind == "switching" and (isinstance(table, Channelled) or (isinstance(table, Mapping) and "channel" in table)):
        return "channels"
    return "own" if isinstance(kind, str) and ":" in kind else str(kind)


_KINDS = (
    "kind must be 'intermittent', 'predictor', 'switching', 'delayed-pid' or the module:name of a controller of your "
    "own"
)
AnyController = Annotated[
    Annotated[Control, Tag("intermittent")]
    | Annotated[Predictor, Tag("predictor")]
    | Annotated[Switching, Tag("switching")]
    | Annotated[Channelled, Tag("channels")]
    | Annotated[DelayedPIDTable, Tag("delayed-pid")]
    | Annotated[OwnController, Tag("own")],
    Discriminator(_kind, custom_error_type="controller_kind", custom_error_message=_KINDS),
]
"""The controller of a run file, by its ``kind``."""


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
    kind: str
    """Kind of motion."""
    start: NonNegative = 0.0
    """Start [s]."""

    @abstractmethod
    def terms(self, end: float) -> Array:
        """Terms of its motion until ``end`` [s], in the form of :class:`icmj.controller.setpoint.Target`."""

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


class StepSetpoint(TargetTable):
    """A step of ``size`` at ``start`` [s], by default at the beginning of the run."""

    kind: Literal["step"]
    size: Finite
    """Size of the step [unit of the output]."""

    def terms(self, end: float) -> Array:
        return step(self.size, self.start)


class PulseSetpoint(TargetTable):
    """A pulse of ``size`` from ``start`` [s] on, which ends after ``duration`` [s]."""

    kind: Literal["pulse"]
    size: Finite
    """Size of the pulse [unit of the output]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return pulse(self.size, self.start, self.duration)


class RampSetpoint(TargetTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    size: Finite
    """Value at the end of the ramp [unit of the output]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return ramp(self.size, self.start, self.duration)


class SinesSetpoint(HarmonicTable, TargetTable):
    """A sum of sinusoids, Σ a sin(2πf(t − start) + φ)."""

    kind: Literal["sines"]

    def terms(self, end: float) -> Array:
        return sines(self.size, self.frequencies, self.all_phases, self.start)

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


class TernarySetpoint(SequenceTable, TargetTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated; it repeats after 242 intervals."""

    kind: Literal["ternary"]

    def terms(self, end: float) -> Array:
        intervals = (end - self.start) / self.interval
        if intervals > MOST_INTERVALS:
            raise AnalysisError(
                f"a ternary set-point of {self.interval:g} s has {intervals:.3g} intervals in this run; expected at "
                f"most {MOST_INTERVALS}, lengthen its interval"
            )
        return ternary(self.size, self.interval, self.start, end)


@keys_of(double_steps)
class DoubleStepsSetpoint(TargetTable):
    """Pairs of steps of a double-step experiment, in random order; the second step goes on, or back twice as far."""

    kind: Literal["double-steps"]
    size: Finite
    start: Positive = 1.0
    """Time before the first pair [s]."""

    def pairs(self) -> StepPairs:
        """The pairs.

        Raises:
            AnalysisError: if an interval is repeated, the size is zero, or there are too many steps.
        """
        keys = self.model_dump()
        steps = 2 * len(keys["isi"]) * len(keys["directions"]) * keys["repetitions"]
        if steps > MOST_STEPS:
            raise AnalysisError(f"a double-step set-point of {steps} steps; expected at most {MOST_STEPS}")
        return make(double_steps, self)

    def terms(self, end: float) -> Array:
        return self.pairs().terms


class FileSetpoint(ColumnTable, TargetTable):
    """A column of a file, linearly interpolated; r is 0 before its first row, and constant after its last row."""

    kind: Literal["file"]
    start: NonNegative = 0.0
    """Time of the run at which the file begins [s]."""
    interval: Positive | None = None
    """Time between the values that are used from the column [s]. By default, every row is used."""

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
