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
from icmj.base.card import Card, Shown, plain
from icmj.base.fact import told
from icmj.base.numbers import amount, relative
from icmj.comparison.facts import RUN
from icmj.comparison.verdict import verdict_in_words
from icmj.errors import AnalysisError
from icmj.result.result import Result, has_prediction
from icmj.theory.facts import PREDICTION

COMPARED = tuple((fact, next(f for f in PREDICTION if f.name == fact.against)) for fact in RUN if fact.against)
"""Facts of a run with the facts of the prediction that they are compared with."""


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

    ``converged`` states whether it settled on the predicted cycle, as
    :func:`icmj.comparison.facts.on_predicted_cycle` decides.
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
        rows = [("case", f"{self.case}, {self.plant} plant")]
        for fact, expected in COMPARED:
            key = fact.key("record")
            found, off = getattr(measured, key), getattr(error, key)
            off = error.largest_amplitude if fact.kind == "outputs" else off
            at = (self.outputs, self.output_units)
            rows.append((f"{expected.label}, predicted", expected.shown(getattr(predicted, expected.name), *at)))
            rows.append((f"{fact.label}, measured", f"{fact.shown(found, *at)}, error {relative(off)}"))
        rows.append(("on the predicted cycle", "yes" if measured.converged else "no"))
        interval = f"{amount(measured.interval, 's')} for Δ_crit = {amount(predicted.delta_crit, 's')}"
        settled = "on the predicted cycle" if measured.converged else measured.kind
        return Card(f"{self.case} on the {self.plant} plant, {settled}, {interval}", tuple(rows), self.words)


def compare(result: Result) -> Comparison:
    """Compare a simulated run with the prediction for it.

    Raises:
        AnalysisError: if its controller has no event rule, and hence no prediction.
    """
    if not has_prediction(result):
        kind = result.controller.kind
        raise AnalysisError(f"{result.run.case.name}: a run under {kind} control has no prediction to be compared with")
    predicted = Predicted(**told(PREDICTION, result.prediction, "record"))
    measured = Measured(**told(RUN, result, "record"))
    off = {
        fact.name: _relative(getattr(measured, fact.name), getattr(predicted, expected.name))
        for fact, expected in COMPARED
    }
    if not predicted.cycle:
        off = dict.fromkeys(off)
    if measured.kind != "cycle":  # its peaks are of late in the run
        off["amplitude"] = None
    return Comparison(
        result.run.case.name,
        result.simulation.plant,
        predicted,
        measured,
        RelativeError(**off),
        verdict_in_words(result, measured.converged),
        result.notices,
        {} if result.simulation.pressure is None else result.simulation.pressure.facts,
        result.actual.outputs,
        result.actual.output_units,
        result.measures,
    )


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


def to_record(result: Result) -> dict[str, Any]:
    """A record of ``summary.json`` for any run: that of its comparison or, without a prediction, what it did."""
    if has_prediction(result):
        return to_json(compare(result))
    return {
        "case": result.run.case.name,
        "plant": result.simulation.plant,
        "control": result.controller.kind,
        "controller": plain(dict(result.controller.facts())),
        "outcome": result.simulation.outcome.kind,
        "switches": len(result.simulation.events),
        "words": result.words,
        "notices": list(result.notices),
        "measures": plain(dict(result.measures)),
    }


def finite(value: float | None) -> float | None:
    """A plain float, or ``None`` for a missing or non-finite one."""
    return None if value is None or not np.isfinite(value) else float(value)


def _relative(measured: Any, predicted: Any) -> Any:
    """The relative error of a number, or of each output; ``None`` where either is missing."""
    if measured is None or predicted is None or np.shape(measured) != np.shape(predicted) or np.any(predicted == 0):
        return None
    return measured / predicted - 1 if np.ndim(measured) else finite(measured / predicted - 1)
