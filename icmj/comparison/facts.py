"""The facts of a run beside its prediction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from icmj.base.fact import Fact
from icmj.measurement.measurement import Measurement, measured_gamma
from icmj.measurement.statistics import Statistics
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.simulation.remarks import relative_error
from icmj.simulation.simulation import Simulation
from icmj.theory.prediction import Prediction

INTERVAL_TOLERANCE = 0.05
"""Largest relative departure of an open-loop interval from Δ_crit at which a cycle still counts as the predicted
one. The nonlinear plant's own departure grows as the square of the threshold and stays far below; coexisting cycles
are further away."""
MIRROR_TOLERANCE = 2 * INTERVAL_TOLERANCE
"""Largest asymmetry of a cycle that counts as a predicted mirrored one: an interval and the next, or a state and the
mirror image of the next, may each depart by :data:`INTERVAL_TOLERANCE`, hence from one another by twice as much.

A mirrored cycle is exactly mirrored only where plant and controller are odd. An attracting cycle persists if they are
slightly not: one cycle of two events remains near it, whose intervals and states depart in proportion to the threshold,
the first by as much as the second but in opposite directions, so that their mean still departs with its square."""


@dataclass(frozen=True, eq=False)
class Ran:
    """What the facts of a run are read from; an :class:`icmj.result.result.Result` has all of it, too."""

    assumed: LinearPlant
    actual: LinearPlant
    prediction: Prediction
    simulation: Simulation
    measurement: Measurement
    statistics: Statistics | None


def on_predicted_cycle(prediction: Prediction, measurement: Measurement) -> bool:
    """Whether the run ended on the predicted cycle; false where none is predicted.

    It has that number of events in a period and every interval within :data:`INTERVAL_TOLERANCE` of Δ_crit. With λ = −1
    its halves are mirror images: exactly or, where the predicted cycle attracts, within :data:`MIRROR_TOLERANCE`. One
    that repels may have lost its symmetry to two other cycles, which lie close to it.
    """
    if not prediction.cycle or prediction.delta_crit is None or prediction.eigenvalue is None:
        return False
    if measurement.kind != "cycle" or measurement.interval is None:
        return False
    mirrored = prediction.eigenvalue.real < 0
    nearly = prediction.verdict == "attracting" and measurement.asymmetry <= MIRROR_TOLERANCE
    if measurement.p != (2 if mirrored else 1) or (measurement.mirrored or (mirrored and nearly)) != mirrored:
        return False
    intervals = np.append(measurement.intervals, measurement.interval)
    return bool(np.all(np.abs(intervals / prediction.delta_crit - 1) <= INTERVAL_TOLERANCE))


def _gamma(of: Any) -> float | None:
    if not of.prediction.cycle or of.prediction.V_inv is None or of.measurement.kind != "cycle":
        return None
    return measured_gamma(of.simulation, of.prediction.V_inv, transformation(of.assumed, of.actual))


def _error(of: Any) -> float | None:
    interval, predicted = of.measurement.interval, of.prediction.delta_crit if of.prediction.cycle else None
    return interval / predicted - 1 if of.measurement.kind == "cycle" and interval and predicted else None


def _noisy(name: str, part: str) -> Callable[[Any], float | None]:
    """What reads a part of an estimate under noise."""

    def read(of: Any) -> float | None:
        estimate = None if of.statistics is None else getattr(of.statistics, name)
        return None if estimate is None else getattr(estimate, part)

    return read


def _rms(of: Any) -> list[float] | None:
    return None if of.statistics is None else [rms.value for rms in of.statistics.rms]


_swept = partial(Fact, record="", logged="")
RUN = (
    _swept("outcome", "outcome", "", "completed, fell, diverged, sliding or stalled",
           attrgetter("simulation.outcome.kind"), "text"),
    _swept("end", "end", "s", "when the run ended", attrgetter("simulation.outcome.t")),
    Fact("kind", "motion", "",
         "cycle, quasi-periodic, irregular, growth, decay, homoclinic, noisy, too short, no events",
         attrgetter("measurement.kind"), "text"),
    Fact("on_predicted", "on the predicted cycle", "", "whether it settled on the predicted cycle",
         lambda of: on_predicted_cycle(of.prediction, of.measurement), "truth", record="converged", logged=""),
    Fact("interval", "open-loop interval", "s", "mean open-loop interval over the last period, or of the last ones",
         attrgetter("measurement.interval"), against="delta_crit"),
    _swept("error", "error of the interval", "",
           "relative departure of a settled interval from Δ_crit, where a cycle is predicted", _error),
    Fact("p", "events in a period", "", "events in a period", attrgetter("measurement.p"), "whole", record="",
         logged="events_per_period"),
    Fact("mirrored", "mirrored", "", "whether the second half of the cycle is the first with opposite sign",
         attrgetter("measurement.mirrored"), "truth", record=""),
    Fact("period", "period", "s", "time after which the state repeats", attrgetter("measurement.period"),
         against="period"),
    Fact("residual", "closes to", "", "relative closure error of the last period", attrgetter("measurement.residual"),
         figures=2, record=""),
    _swept("events", "events", "", "events in the run", lambda of: len(of.simulation.events), "count"),
    _swept("step_error", "error by the step", "",
           "relative error by the engine's step, estimated on the last interval",
           lambda of: relative_error(of.simulation), only="mujoco"),
    _swept("interval_error", "confidence of the interval", "s",
           "half width of the 95 % confidence interval of the mean interval", _noisy("interval", "error"),
           only="noise"),
    _swept("interval_deviation", "deviation of the intervals", "s", "standard deviation of the intervals",
           _noisy("interval_deviation", "value"), only="noise"),
    _swept("binding", "intervals at Δ_min", "", "share of the intervals that end at Δ_min", _noisy("binding", "value"),
           only="noise"),
    Fact("gamma", "γ", "", "size of the critical mode at the events of a cycle, where one is predicted", _gamma,
         against="gamma", column=""),
    Fact("amplitude", "peak of each output", "",
         "largest magnitude of each output over a period, or of late in the run",
         attrgetter("measurement.amplitude"), "outputs", figures=4, against="amplitude", column="peak"),
    _swept("rms", "RMS of each output", "", "standard deviation of each output", _rms, "outputs", figures=4,
           only="noise"),
)  # fmt: skip
"""In the order of a sweep's columns."""
