"""The tables of the controller: weights of its design, hold and event rule, and how far the analysis searches."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import model_validator

from icmj.controller.design import Design
from icmj.controller.trigger import BoxTrigger, EventRule, EventTrigger, as_weight
from icmj.plant.notice import Kind
from icmj.runfile.table import (
    Interval,
    Matrix,
    NonNegative,
    Numbers,
    Positive,
    Positives,
    TomlTable,
    Weight,
)


class Weights(TomlTable):
    """LQ weights of state feedback (Q_c, R_c) and observer (Q_o, R_o)."""

    Q_c: Weight = "output"
    R_c: Positive | Positives = 1.0
    Q_o: Literal["input", "identity"] | Numbers | Matrix = "input"
    R_o: Positive | Positives = 1.0


class Control(TomlTable):
    """Hold and event rule: ``quadratic`` by Q_t and q_t, or ``box`` by a threshold for each output or state.

    ``delta_min`` is Δ_min, the least time between two events [s]: what psychologists call the refractory period.
    """

    hold: Literal["system-matched", "zero-order"] = "system-matched"
    rule: Literal["quadratic", "box"] = "quadratic"
    Q_t: Weight = "output"
    q_t: Positive | None = None
    on: Literal["output", "state"] = "output"
    threshold: Positive | Positives | None = None
    delta_min: NonNegative = 1e-3

    def trigger(self, design: Design) -> EventRule:
        """The event rule for a controller of this design.

        Raises:
            AnalysisError: if it does not fit the design.
        """
        if self.rule == "box":
            assert self.threshold is not None
            return BoxTrigger(np.array(self.threshold), self.on, self.delta_min)
        assert self.q_t is not None
        return EventTrigger(as_weight(self.Q_t, design), self.q_t, self.delta_min)

    @model_validator(mode="after")
    def _keys_are_those_of_the_rule(self) -> Control:
        needed, others = ("threshold", ("Q_t", "q_t")) if self.rule == "box" else ("q_t", ("on", "threshold"))
        if getattr(self, needed) is None:
            raise ValueError(f"the {self.rule} rule needs {needed}")
        foreign = [name for name in others if name in self.model_fields_set]
        if foreign:
            raise ValueError(f"the {self.rule} rule has no {foreign[0]}")
        return self


class Analysis(TomlTable):
    """Range of Δ searched for crossings [s], and what to go on with although it makes a prediction doubtful."""

    delta_max: Interval = 3.0
    allow: list[Kind] = []
