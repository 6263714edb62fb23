"""The verdict on one simulated run in words: what was predicted, and what came of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.measurement.measurement import Measurement
from icmj.theory.prediction import Prediction

if TYPE_CHECKING:
    from icmj.result.result import PredictedResult


def verdict_in_words(result: PredictedResult, converged: bool) -> str:
    """The prediction and the measured motion in words, for a reader who does not know the theory.

    Args:
        result: the run and its prediction.
        converged: whether the run settled on the predicted cycle.
    """
    prediction, measurement, outcome = result.prediction, result.measurement, result.simulation.outcome
    if converged:
        mirror = f"twice the interval, {halves(measurement)}" if measurement.p == 2 else "one interval"
        return f"Settles on the predicted cycle (period is {mirror})."
    if measurement.kind == "noisy":
        return f"{_in_distribution(measurement, prediction)}."
    ended = _how_it_ended(measurement, prediction.cycle)
    if outcome.kind in ("fell", "diverged", "interrupted", "stalled"):
        ended = f"the run {'was interrupted' if outcome.kind == 'interrupted' else outcome.kind} at {outcome.t:.3g} s"
    elif outcome.kind == "sliding":
        ended = "every interval collapses to Δ_min"
    if prediction.delta_crit is None:
        if result.simulation.plant == "mujoco" and measurement.kind == "cycle":
            # odd symmetry makes the departure cubic: the interval grows by 2 ln 10/λ for each decade of the threshold
            ended += (
                ". No linear model of this nonlinear plant is exact; its nonlinearity acts as a model error that "
                "limits the growth of the intervals, and the smaller the threshold, the longer they become"
            )
        if not prediction.crossings and prediction.observer_feedback_stable:
            return (
                f"No cycle predicted, because no eigenvalue reaches the unit circle {_searched(prediction)}; {ended}."
            )
        return (
            f"No cycle predicted, because no eigenvalue leaves the unit circle at ±1 {_searched(prediction)}; {ended}."
        )
    if not prediction.cycle:
        why = _why_no_cycle(prediction)
        return f"No cycle at Δ_crit, as predicted, because {why}; {ended}."
    if prediction.verdict == "repelling":
        return f"Does not settle on the predicted cycle, because it is repelling ({_multiplier(prediction)}); {ended}."
    if prediction.verdict == "not admissible":
        reason = prediction.orbit.reason if prediction.orbit is not None else ""
        return f"Does not settle on the predicted cycle, because it is not admissible ({reason.rstrip('.')}); {ended}."
    return f"Does not settle on the predicted cycle, although it attracts; {ended}."


def halves(measurement: Measurement) -> str:
    """The halves of a cycle that has settled on a predicted mirrored one; see :data:`.facts.MIRROR_TOLERANCE`."""
    if measurement.mirrored:
        return "mirrored halves"
    return f"halves mirrored to {100 * measurement.asymmetry:.2g} %, as plant and controller are not quite symmetric"


def _searched(prediction: Prediction) -> str:
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
    attracting = "" if prediction.verdict == "attracting" else f" ({prediction.verdict})"
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
    return " and ".join(parts) or "the eigenvalues cross the circle inwards"


def _multiplier(prediction: Prediction) -> str:
    if prediction.multipliers is None or not len(prediction.multipliers):
        return "multiplier unknown"
    return f"largest multiplier {np.abs(prediction.multipliers).max():.2f}"


def _how_it_ended(measurement: Measurement, predicted: bool) -> str:
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
