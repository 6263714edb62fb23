"""The tables of the controller: weights of its design, hold and event rule, and range of the analysis."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import model_validator

from icmj.base.array import Matrix, NonNegative, Numbers, Positive, Positives, Weight, real
from icmj.base.similar_names import suggest
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.hold import HOLDS, Hold
from icmj.controller.law import Law
from icmj.controller.rules import RULES
from icmj.controller.setpoint import (
    Setpoint,
)
from icmj.controller.trigger import EventRule, expect_own_rule
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import Fault
from icmj.runfile.table import (
    Interval,
    Line,
    Parameters,
    Reference,
    TomlTable,
    keys_of,
)
from icmj.work.own_code import Code, guard, pick_accepted

if TYPE_CHECKING:
    RuleName = str
else:
    RuleName = Literal[RULES.names]


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

    if TYPE_CHECKING:
        kind: str

    has_events: ClassVar[bool] = False
    """Whether its controller has an event rule, and with it a critical interval and a prediction."""
    follows: ClassVar[bool] = False
    """Whether its controller follows a set-point."""

    @classmethod
    def takes(cls, data: Mapping[str, Any]) -> bool:
        """Whether a table with its ``kind`` is one of these; several may share a kind, and the first takes it."""
        return True

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


class HoldAndRule(ControllerTable):
    """Which hold and which event rule an intermittent controller has."""

    kind: Literal["intermittent"] = "intermittent"
    """Kind of controller: this one, ``"predictor"``, ``"switching"``, ``"delayed-pid"``, or your own, by its
    ``module:name``."""
    hold: Literal["system-matched", "zero-order", "own"] | Reference = "system-matched"
    """Hold, which drives the plant between events: the assumed closed loop (system-matched), a constant control
    (zero-order), or A_h (own); or the ``module:name`` of a function that makes a hold, or its matrix, from the
    design."""
    A_h: Matrix | None = None
    """Matrix of the hold ``own``, ẋ_h = A_h x_h, row by row."""
    rule: RuleName | Reference = RULES.names[0]
    """Event rule; or the ``module:name`` of a class of event rules."""
    parameters: Parameters = {}
    """Parameters by name of a rule given as ``module:name``."""
    hold_parameters: Parameters = {}
    """Parameters by name of a hold given as ``module:name``."""


RULE_KEYS = {name: tuple(signature(RULES[name].from_keys).parameters)[1:-1] for name in RULES.names}
"""The keys of each event rule: what it is made of, but for the design and Δ_min."""
if TYPE_CHECKING:
    Ruled = HoldAndRule
else:
    Ruled = HoldAndRule
    for _rule in RULES:
        Ruled = keys_of(_rule.from_keys, without=("design", "delta_min"))(Ruled)


class Control(Ruled):
    """Hold and event rule: ``quadratic`` with Q_t and q_t, or ``box`` with a threshold for each output or state.

    ``delta_min`` is Δ_min, the shortest time between two events [s], which psychologists call the refractory period.
    """

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
        if ":" in self.rule:
            given = pick_accepted(code.find(self.rule), {"delta_min": self.delta_min})
            rule = code.make(self.rule, **{**given, **self.parameters})
            with guard(self.rule):
                return expect_own_rule(rule, design)
        keys = {name: getattr(self, name) for name in RULE_KEYS[self.rule]}
        made: EventRule = RULES[self.rule].from_keys(design, **keys, delta_min=self.delta_min)
        return made

    def at_threshold_of(self, other: Control) -> Control:
        """The same with the threshold of another, on which the theory does not depend, where it is one number."""
        return self.model_copy(update={"q_t": other.q_t}) if hasattr(other, "q_t") else self

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
        known = [name for names in RULE_KEYS.values() for name in names]
        if ":" in self.rule:
            theirs = [name for name in known if name in self.model_fields_set]
            if theirs:
                raise ValueError(f"a rule given as module:name has no key {theirs[0]}; put its numbers into parameters")
            return self
        if self.parameters:
            raise ValueError(f"the {self.rule} rule has no parameters; only a rule given as module:name has parameters")
        own = RULE_KEYS[self.rule]
        for needed in own:
            if getattr(self, needed) is None:
                raise ValueError(f"the {self.rule} rule needs {needed}")
        foreign = [name for name in known if name not in own and name in self.model_fields_set]
        if foreign:
            raise ValueError(f"the {self.rule} rule has no {foreign[0]}")
        return self


class Analysis(TomlTable):
    """Range of the search for crossings, and notices that are accepted although they are errors."""

    delta_max: Interval = 3.0
    """Upper end of the search for crossings [s]."""
    allow: list[Fault | Line] = []
    """Kinds of notice that are reported instead of stopping the run as errors; other kinds never stop it."""

    @model_validator(mode="after")
    def _names_are_no_slips(self) -> Analysis:
        """Kinds that never stop a run are not listed anywhere; what is nearly the name of one that does is a slip."""
        known = get_args(Fault)
        for kind in self.allow:
            if kind not in known and (near := suggest(kind, known)):
                raise ValueError(f"allow: no notice is called {kind!r}{near}")
        return self
