"""The facts that only sweeps tell: of exact cycles, and of runs without a prediction."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from icmj.base.array import Array
from icmj.base.fact import Fact
from icmj.cycle.cycle import Cycle
from icmj.experiments.rounds import Rounds
from icmj.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Sought:
    """A cycle that was sought, or why there is none, and Δ_crit where a cycle is predicted [s]."""

    cycle: Cycle | None
    words: str
    delta_crit: float | None


@dataclass(frozen=True, eq=False)
class Moved:
    """A run with its rounds, and the outputs of its second half, shape (N, n_y)."""

    run: Simulation
    rounds: Rounds
    late: Array


CYCLE = (
    Fact("found", "found", "",
         "whether Newton found a cycle from the prediction or, where there is none, from the run",
         lambda of: of.cycle is not None, "truth"),
    Fact("words", "words", "", "why not", attrgetter("words"), "text"),
    Fact("interval", "open-loop interval", "s", "mean open-loop interval of the exact cycle",
         attrgetter("cycle.interval")),
    Fact("error", "error of the interval", "", "its relative departure from Δ_crit, where a cycle is predicted",
         lambda of: of.cycle.interval / of.delta_crit - 1 if of.delta_crit else None),
    Fact("period", "period", "s", "period of the exact cycle", attrgetter("cycle.period")),
    Fact("p", "events in a period", "", "events in it", attrgetter("cycle.events"), "whole"),
    Fact("mirrored", "mirrored", "", "whether its second half is the first with opposite sign",
         attrgetter("cycle.mirrored"), "truth"),
    Fact("attracting", "attracting", "", "whether every multiplier is inside the unit circle",
         attrgetter("cycle.attracting"), "truth"),
    Fact("multiplier", "largest multiplier", "", "magnitude of the largest multiplier",
         lambda of: np.abs(of.cycle.isolated).max(initial=0.0)),
    Fact("peak", "peak of each output", "", "largest magnitude of each output over it",
         attrgetter("cycle.y_peak"), "outputs"),
)  # fmt: skip
WITHOUT_PREDICTION = (
    Fact("outcome", "outcome", "", "completed, fell, diverged, stalled", attrgetter("run.outcome.kind"), "text"),
    Fact("end", "end", "s", "when the run ended", attrgetter("run.outcome.t")),
    Fact("switches", "switches", "", "switches in the run", lambda of: len(of.run.events), "count"),
    Fact("growth", "growth", "1/s",
         "rate at which the size of the motion changes, over its last rounds or its second half",
         attrgetter("rounds.growth")),
    Fact("factor", "factor", "", "size of a round over that of the one before; empty without rounds",
         attrgetter("rounds.factor")),
    Fact("period", "period", "s", "period of a round; empty without rounds", attrgetter("rounds.period")),
    Fact("peak", "peak of each output", "", "largest magnitude of each output in the second half of the run",
         lambda of: np.abs(of.late).max(axis=0), "outputs"),
    Fact("rms", "RMS of each output", "", "standard deviation of each output in the second half of the run",
         lambda of: of.late.std(axis=0), "outputs"),
)  # fmt: skip
