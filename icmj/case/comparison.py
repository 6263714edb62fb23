"""The comparison of one simulated run with its prediction: numbers for tables, and a verdict in words.

A relative error is (measured − predicted)/predicted and is given only where both exist: the interval wherever the
run had events and Δ_crit is defined by a predicted cycle, the others only where the run settled on a cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from icmj.base.array import Array, agree, argmax_abs
from icmj.base.card import Card, WithCard
from icmj.base.numbers import Fact, amount, collect_facts, count, ordinal, plain, relative
from icmj.case.laid_orbit import beside, settled_on
from icmj.case.result import Result
from icmj.controller.controller import expect_intermittent
from icmj.measurement.measurement import Measurement, measured_gamma
from icmj.measurement.statistics import Statistics
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.simulation.simulation import Simulation, get_relative_error
from icmj.theory.prediction import PREDICTION, Prediction


@dataclass(frozen=True, eq=False)
class Ran:
    """What the facts of a run are read from; an :class:`icmj.case.result.Result` has all of it, too."""

    assumed: LinearPlant
    actual: LinearPlant
    prediction: Prediction
    simulation: Simulation
    measurement: Measurement
    statistics: Statistics | None


def on_predicted_cycle(prediction: Prediction, measurement: Measurement) -> bool:
    """Whether the run ended on a predicted cycle; see :func:`icmj.case.laid_orbit.settled_on`."""
    return settled_on(prediction, measurement) is not None


def _gamma(of: Any) -> float | None:
    prediction = beside(of.prediction, of.measurement)
    if not prediction.cycle or prediction.V_inv is None or of.measurement.kind != "cycle":
        return None
    return measured_gamma(of.simulation, prediction.V_inv, transformation(of.assumed, of.actual))


def _error(of: Any) -> float | None:
    prediction, interval = beside(of.prediction, of.measurement), of.measurement.interval
    predicted = prediction.delta_crit if prediction.cycle else None
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
    Fact("interval", "open-loop interval", "s",
         "mean open-loop interval over the last period; without a cycle, over many of the last",
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
           lambda of: get_relative_error(of.simulation), only="mujoco"),
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


def verdict_in_words(result: Result, converged: bool) -> str:
    """The prediction and the measured motion in words, for a reader who does not know the theory.

    Args:
        result: the run and its prediction.
        converged: whether the run settled on the predicted cycle.
    """
    prediction, measurement, outcome = result.expect_prediction(), result.motion, result.simulation.outcome
    if converged:
        found = beside(prediction, measurement)
        mirror = f"twice the interval, {halves(measurement, found)}" if measurement.p == 2 else "one interval"
        return f"Settles on the predicted cycle{_which(found)} (period is {mirror})."
    if measurement.kind == "noisy":
        return f"{_in_distribution(measurement, prediction)}."
    ended = _describe_ending(measurement, prediction.cycle)
    if outcome.kind in ("fell", "diverged", "interrupted", "stalled"):
        ended = f"the run {'was interrupted' if outcome.kind == 'interrupted' else outcome.kind} at {outcome.t:.3g} s"
    elif outcome.kind == "sliding":
        ended = "every interval collapses to Δ_min"
    if prediction.delta_crit is None:
        if result.simulation.plant == "mujoco" and measurement.kind == "cycle" and _is_exact(result):
            # odd symmetry makes the departure cubic: the interval grows by 2 ln 10/λ for each decade of the threshold
            ended += (
                ". No linear model of this nonlinear plant is exact; its nonlinearity acts as a model error that "
                "limits the growth of the intervals, and the smaller the threshold, the longer they become"
            )
        if not prediction.crossings and prediction.observer_feedback_stable:
            return f"No cycle predicted, because no eigenvalue reaches the unit circle {_reach(prediction)}; {ended}."
        return f"No cycle predicted, because no eigenvalue leaves the unit circle at ±1 {_reach(prediction)}; {ended}."
    if not prediction.cycle:
        return f"No cycle at Δ_crit, as predicted, because {_why_no_cycle(prediction)}; {ended}."
    attracts = "although it attracts"
    if prediction.verdict == "family":
        attracts = "which is one of a family of cycles beside it"
    elif not prediction.observer_feedback_stable:
        attracts = "which attracts only what starts near it, because continuous feedback is unstable"
    return f"Does not settle on the predicted cycle{_which(prediction)}, {attracts}; {ended}."


def _which(prediction: Prediction) -> str:
    """Which of the predicted orbits it is about, where that is not the paper's, or not the only one to settle on."""
    orbits = prediction.orbits
    if prediction.by_paper and sum(one.settles for one in orbits) <= 1:
        return ""
    place = next((i for i, one in enumerate(orbits) if one.orbit is prediction.orbit), 0)
    words = f" of {amount(prediction.delta_crit, 's', 4)}"
    return f"{words}, the {ordinal(place)} of {len(orbits)} predicted orbits" if len(orbits) > 1 else words


def _is_exact(result: Result) -> bool:
    """Whether the controller's model is the linearised plant, and its hold the closed loop that this model assumes."""
    law = expect_intermittent(result.controller)
    assumed, actual = result.assumed, result.actual
    mine, theirs = (assumed.A, assumed.B, assumed.C, law.hold.A_h), (actual.A, actual.B, actual.C, law.design.A_c)
    return agree(mine, theirs)


def halves(measurement: Measurement, prediction: Prediction) -> str:
    """The halves of a cycle that has settled on a predicted mirrored one, within :data:`.result.MIRROR_TOLERANCE`."""
    if measurement.mirrored:
        return "mirrored halves"
    if prediction.verdict == "family":
        return f"halves mirrored to {100 * measurement.asymmetry:.2g} %, as it is one of a family of unequal ones"
    return f"halves mirrored to {100 * measurement.asymmetry:.2g} %, as plant and controller are not quite symmetric"


def _reach(prediction: Prediction) -> str:
    """Over which range that is known, and what a quick look beyond it shows."""
    words = f"up to Δ = {prediction.delta_max:.4g} s (the range searched)"
    if prediction.beyond is not None:
        return f"{words}, but one does beyond it, at {prediction.beyond.delta:.3g} s; raise analysis.delta_max"
    return f"{words}, where the largest |λ| still grows" if prediction.growing else words


def _in_distribution(measurement: Measurement, prediction: Prediction) -> str:
    interval = (
        "no open-loop interval" if measurement.interval is None else f"a mean interval of {measurement.interval:.3g} s"
    )
    if not prediction.cycle:
        return f"The motion is driven by noise, and no cycle is predicted without it; it has {interval}"
    attracting = "" if prediction.verdict == "attracting" else ", one of a family,"
    return (
        f"The motion is driven by noise, with {interval}; the predicted cycle{attracting} without noise has "
        f"{prediction.delta_crit:.4g} s"
    )


def _why_no_cycle(prediction: Prediction) -> str:
    parts = []
    others = [c.largest_other for c in prediction.crossings if c.delta == prediction.delta_crit]
    if others and others[0] > 1:
        parts.append(f"another eigenvalue is outside the circle there (|λ| = {others[0]:.2f})")
    if prediction.verdict == "repelling":
        parts.append(f"the orbit is repelling ({_multiplier(prediction)})")
    elif prediction.orbit is not None and prediction.orbit.reason:
        parts.append(f"the orbit is not admissible ({prediction.orbit.reason.rstrip('.')})")
    if prediction.others:
        parts.append(f"nothing settles on {count(len(prediction.others), 'other orbit')} at ±1 either")
    return " and ".join(parts)


def _multiplier(prediction: Prediction) -> str:
    if prediction.multipliers is None or not len(prediction.multipliers):
        return "multiplier unknown"
    size = float(np.abs(prediction.multipliers).max())
    # as many decimals as tell it from 1
    return f"largest multiplier {size:.{max(2, int(np.ceil(-np.log10(abs(size - 1) + 1e-15))))}f}"


def _describe_ending(measurement: Measurement, predicted: bool) -> str:
    interval = "" if measurement.interval is None else f"{measurement.interval:.3g} s"
    match measurement.kind:
        case "homoclinic":
            return "the intervals grow without bound"
        case "cycle":
            which = "another" if predicted else "a"
            mirrored = "mirrored " if measurement.mirrored else ""
            events = "1 event" if measurement.p == 1 else f"{measurement.p} events"
            return f"it settles on {which} {mirrored}cycle of {events}, mean interval {interval}"
        case "quasi-periodic" | "irregular":
            return f"the motion stays {measurement.kind}, mean interval {interval}"
        case "growth":
            return "the motion grows"
        case "decay":
            return "the motion dies out"
        case "no events":
            return "no event occurs"
        case _:
            return "the run is too short to settle"


COMPARED = tuple((fact, next(f for f in PREDICTION if f.name == fact.against)) for fact in RUN if fact.against)
"""Facts of a run with the facts of the prediction that they are compared with."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """The linear prediction: Δ_crit [s], λ_crit, period [s], γ, peak of every output, and verdict on the orbit.

    All of the orbit that the run settled on, or else of that at Δ_crit; ``by_paper`` is of the paper's condition.
    """

    delta_crit: float | None
    eigenvalue: complex | None
    cycle: bool
    period: float | None
    gamma: float | None
    amplitude: Array | None
    verdict: str
    by_paper: bool


@dataclass(frozen=True, eq=False)
class Measured:
    """The measured motion of the run: interval and period [s], peak of every output, |χ_k1| at events, kind of motion.

    ``converged`` states whether it settled on the predicted cycle, as
    :func:`icmj.case.comparison.on_predicted_cycle` decides.
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
        return float(self.amplitude[argmax_abs(self.amplitude)])


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(WithCard):
    """The comparison of one run with its prediction.

    Attributes:
        case, plant: name of the case, and ``linear`` or ``mujoco``.
        predicted, measured, relative_error: predicted and measured values, and their relative differences.
        words: the verdict in one or two sentences.
        notices: notices about plants and run.
        pressure: for a body that stands on a floor, :attr:`icmj.simulation.pressure.Pressure.facts`; otherwise empty.
        outputs, output_units: names and units of the outputs.
        measures: results of the user's own measures, by name.
        changes: what of the run file has changed since it was read, in one sentence; empty if nothing has.
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
    changes: str = ""

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


_RECORDED = (
    "case", "plant", "changes", "predicted", "measured", "relative_error", "words", "notices", "pressure", "measures",
)  # fmt: skip


def compare(result: Result) -> Comparison:
    """Compare a simulated run with the prediction for it.

    Raises:
        AnalysisError: if its controller has no event rule, and hence no prediction.
    """
    about = beside(result.expect_prediction(), result.motion)
    predicted = Predicted(**collect_facts(PREDICTION, about, "record"))
    measured = Measured(**collect_facts(RUN, result, "record"))
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
        result.run.changes_in_words,
    )


def to_json(comparison: Comparison) -> dict[str, Any]:
    """A record of ``summary.json``: plain numbers, lists and ``None``; a complex number is [re, im]."""
    told = plain(vars(comparison))
    return {key: told[key] for key in _RECORDED if told[key] or key not in ("changes", "pressure", "measures")}


def to_record(result: Result) -> dict[str, Any]:
    """A record of ``summary.json`` for any run: that of its comparison or, without a prediction, what it did."""
    if result.prediction is not None:
        return to_json(compare(result))
    return {
        "case": result.run.case.name,
        "plant": result.simulation.plant,
        **({"changes": result.run.changes_in_words} if result.run.changes else {}),
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
