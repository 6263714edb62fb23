"""The comparison of one simulated run with its prediction: numbers for tables, with the verdict in words.

A relative error is (measured − predicted)/predicted and is given only where both exist: the interval wherever the
run had events and Δ_crit is defined by a predicted cycle, the others only where the run settled on a cycle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from icmj.base.array import Array, leading
from icmj.base.card import Card, Shown, amount, amounts, relative
from icmj.base.plain import plain
from icmj.comparison.verdict import verdict_in_words
from icmj.measurement.measurement import Measurement, measured_gamma
from icmj.plant.linear_plant import transformation
from icmj.result.result import Result
from icmj.theory.prediction import Prediction

INTERVAL_TOLERANCE = 0.05
"""Largest relative departure of an open-loop interval from Δ_crit at which a cycle still counts as the predicted
one. The nonlinear plant's own departure grows as the square of the threshold and stays far below; coexisting cycles
are further away."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """The linear prediction: Δ_crit [s], λ_crit, period [s], γ, peak of every output, and verdict on the orbit."""

    delta_crit: float | None
    eigenvalue: complex | None
    cycle: bool
    period: float | None
    gamma: float | None
    amplitude: Array | None
    verdict: str


@dataclass(frozen=True, eq=False)
class Measured:
    """The measured motion of the run: interval and period [s], peak of every output, |χ_k1| at events, kind of motion.

    ``converged`` states whether it settled on the predicted cycle: with the predicted number of events in a period,
    mirrored or not, and every interval within :data:`INTERVAL_TOLERANCE` of Δ_crit.
    """

    interval: float | None
    period: float | None
    amplitude: Array
    gamma: float | None
    converged: bool
    kind: str


@dataclass(frozen=True, eq=False)
class RelativeError:
    """(measured − predicted)/predicted, ``None`` if either is missing; amplitude for every output, shape (n_y,)."""

    interval: float | None
    period: float | None
    amplitude: Array | None
    gamma: float | None

    @property
    def largest_amplitude(self) -> float | None:
        """The amplitude error of largest magnitude, with its sign."""
        if self.amplitude is None or not len(self.amplitude):
            return None
        return float(self.amplitude[leading(self.amplitude)])


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Shown):
    """The comparison of one run with its prediction.

    Attributes:
        case, plant: name of the case, and ``linear`` or ``mujoco``.
        predicted, measured, relative_error: predicted and measured values, and their relative differences.
        words: the verdict in one or two sentences.
        notices: notices about plants and run.
        pressure: for a body that stands on a floor, :attr:`icmj.simulation.pressure.Pressure.facts`; otherwise empty.
        outputs, output_units: names and units of the outputs.
        measures: results of the user's own measures, by name.
    """

    case: str
    plant: str
    predicted: Predicted
    measured: Measured
    relative_error: RelativeError
    words: str
    notices: tuple[str, ...] = ()
    pressure: Mapping[str, float] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        predicted, measured, error = self.predicted, self.measured, self.relative_error
        named = (self.outputs, self.output_units)
        rows = (
            ("case", f"{self.case}, {self.plant} plant"),
            ("Δ_crit, predicted", amount(predicted.delta_crit, "s")),
            ("open-loop interval, measured", f"{amount(measured.interval, 's')}, error {relative(error.interval)}"),
            ("period, predicted", amount(predicted.period, "s")),
            ("period, measured", f"{amount(measured.period, 's')}, error {relative(error.period)}"),
            ("peak of the outputs, predicted", amounts(predicted.amplitude, *named)),
            ("peak of the outputs, measured", amounts(measured.amplitude, *named)),
            ("largest error of a peak", relative(error.largest_amplitude)),
            ("on the predicted cycle", "yes" if measured.converged else "no"),
        )
        interval = f"{amount(measured.interval, 's')} for Δ_crit = {amount(predicted.delta_crit, 's')}"
        settled = "on the predicted cycle" if measured.converged else measured.kind
        return Card(f"{self.case} on the {self.plant} plant, {settled}, {interval}", rows, self.words)


def compare(result: Result) -> Comparison:
    """Compare a simulated run with the prediction for it."""
    prediction, measurement = result.prediction, result.measurement
    converged = on_predicted_cycle(prediction, measurement)
    gamma = None
    if prediction.cycle and prediction.V_inv is not None and measurement.kind == "cycle":
        T_hat = transformation(result.assumed, result.actual)
        gamma = finite(measured_gamma(result.simulation, prediction.V_inv, T_hat))
    predicted = Predicted(
        delta_crit=finite(prediction.delta_crit),
        eigenvalue=prediction.eigenvalue,
        cycle=bool(prediction.cycle),
        period=finite(prediction.period),
        gamma=finite(prediction.gamma),
        amplitude=None if prediction.amplitude is None else np.asarray(prediction.amplitude, float),
        verdict=prediction.verdict,
    )
    measured = Measured(
        interval=finite(measurement.interval),
        period=finite(measurement.period),
        amplitude=np.asarray(measurement.amplitude, float),
        gamma=gamma,
        converged=converged,
        kind=measurement.kind,
    )
    error = RelativeError(
        interval=_relative(measured.interval, predicted.delta_crit if predicted.cycle else None),
        period=_relative(measured.period, predicted.period),
        amplitude=_relative_each(measured.amplitude, predicted.amplitude)
        if predicted.cycle and measurement.kind == "cycle"
        else None,
        gamma=_relative(measured.gamma, predicted.gamma),
    )
    return Comparison(
        result.run.case.name,
        result.simulation.plant,
        predicted,
        measured,
        error,
        verdict_in_words(result, converged),
        result.notices,
        {} if result.simulation.pressure is None else result.simulation.pressure.facts,
        result.actual.outputs,
        result.actual.output_units,
        result.measures,
    )


def on_predicted_cycle(prediction: Prediction, measurement: Measurement) -> bool:
    """Whether the run ended on the predicted cycle (see :class:`Measured`); false where none is predicted."""
    if not prediction.cycle or prediction.delta_crit is None or prediction.eigenvalue is None:
        return False
    if measurement.kind != "cycle" or measurement.interval is None:
        return False
    mirrored = prediction.eigenvalue.real < 0
    if measurement.p != (2 if mirrored else 1) or measurement.mirrored != mirrored:
        return False
    intervals = np.append(measurement.intervals, measurement.interval)
    return bool(np.all(np.abs(intervals / prediction.delta_crit - 1) <= INTERVAL_TOLERANCE))


def to_json(comparison: Comparison) -> dict[str, Any]:
    """A record of ``summary.json``: plain numbers, lists and ``None``; a complex number is [re, im]."""
    return {
        "case": comparison.case,
        "plant": comparison.plant,
        "predicted": plain(vars(comparison.predicted)),
        "measured": plain(vars(comparison.measured)),
        "relative_error": plain(vars(comparison.relative_error)),
        "words": comparison.words,
        "notices": list(comparison.notices),
        **({"pressure": plain(dict(comparison.pressure))} if comparison.pressure else {}),
        **({"measures": plain(dict(comparison.measures))} if comparison.measures else {}),
    }


def finite(value: float | None) -> float | None:
    """A plain float, or ``None`` for a missing or non-finite one."""
    return None if value is None or not np.isfinite(value) else float(value)


def _relative(measured: float | None, predicted: float | None) -> float | None:
    if measured is None or predicted is None or predicted == 0:
        return None
    return finite(measured / predicted - 1)


def _relative_each(measured: Array, predicted: Array | None) -> Array | None:
    if predicted is None or measured.shape != predicted.shape or np.any(predicted == 0):
        return None
    return measured / predicted - 1
