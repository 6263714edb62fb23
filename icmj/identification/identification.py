"""The inverse question of the paper's conclusion: the model error that explains a motion, and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from icmj.base.environment import single_threaded
from icmj.case.case import PlantKind
from icmj.errors import IdentificationError
from icmj.identification.agreement import Agreement, agreement, agreement_of_sequence
from icmj.identification.inverse import Candidate, Inverse, refined
from icmj.identification.observed import FEWEST, Observed
from icmj.identification.rhythm import Rhythm, rhythm
from icmj.identification.sequence import Sequence
from icmj.identification.unknown import Unknown

Way = Literal["rhythm", "sequence", "none"]
_EDGE = 1e-6  # of the range: what is so near to its end reaches it
_BAD_FIT = 0.05  # mean intervals: events that the best value does not explain


@dataclass(frozen=True, eq=False)
class Identification:
    """The estimate of the unknown from a motion.

    Attributes:
        name: name of the unknown.
        value: best value, or ``None`` if the motion does not determine it.
        intervals: the 95 % confidence set: one pair (low, high), or several if branches cannot be distinguished; empty
            if the motion does not determine the value.
        way: the method: the settled ``rhythm``, the ``sequence`` of events since the start, or ``none``.
        words: a description in words.
        probability: probability that a motion with the best value, because of errors of times and readings, would agree
            less well with its own prediction than the observed motion does; ``None`` if nothing was compared. Below
            :data:`icmj.identification.agreement.LEVEL` no value fits, and none is determined.
        edge: an end of the range that the intervals reach, beyond which the value may lie; otherwise ``None``.
    """

    name: str
    value: float | None
    intervals: tuple[tuple[float, float], ...]
    way: Way
    words: str
    probability: float | None = None
    edge: float | None = None

    def holds(self, value: float) -> bool:
        """Whether the intervals contain a value."""
        return any(low <= value <= high for low, high in self.intervals)


@single_threaded()
def identify(
    unknown: Unknown,
    observed: Observed,
    *,
    plant: PlantKind = "linear",
    refine: bool = True,
    known: Inverse | None = None,
) -> Identification:
    """Estimate one model error and its uncertainty from a motion, or report that the motion does not determine it.

    The estimate is the value whose cycle has the settled interval and sign; if the motion has not settled and its start
    is known, it is the value whose simulated events are those observed. What moves under noise has no such interval:
    :func:`icmj.fit` infers its parameters.

    Args:
        unknown: the parameter to be identified, and the run file with everything that is known.
        observed: the motion.
        plant: the plant of the motion, which is simulated: ``linear`` or ``mujoco``.
        refine: whether the exact cycle of the nonlinear plant corrects the linear theory; only for ``mujoco``.
        known: predictions computed for another motion.

    Raises:
        IdentificationError: if the run file has noise.
        IcmjError: if the run file does not have the unknown, or no motion can be simulated.
    """
    with unknown.run.at_hand() as run:  # of a log from elsewhere, with the models that it carries
        return _identified(replace(unknown, run=run), observed, plant, refine, known)


def _identified(
    unknown: Unknown,
    observed: Observed,
    plant: PlantKind,
    refine: bool,
    known: Inverse | None,
) -> Identification:
    if unknown.run.drawn().simulation.settings().noisy:
        raise IdentificationError(
            f"{unknown.run.path}: has noise, under which no interval repeats; infer {unknown.name} by icmj fit, with a "
            "family of this run file"
        )
    found = None if unknown.run.setpoint else rhythm(observed)  # what is predicted of a rhythm is that of r = 0
    case = unknown.checked()
    least = case.controller.least
    if found is not None and found.interval <= least * (1 + 1e-3) + observed.resolution:
        return _cannot(
            unknown, f"every interval is the least one, {least:g} s: the event rule does not determine the events"
        )
    if found is not None:
        inverse = known if known is not None and known.reaches(found.interval) else Inverse.up_to(unknown, found)
        candidates = inverse.candidates(found)
        if plant == "mujoco" and refine:
            candidates = [refined(inverse, each, found) for each in candidates]
        if candidates:
            return _from_rhythm(inverse.unknown, observed, found, candidates, plant)
    if observed.whole and len(observed.times) >= FEWEST - 2:
        return _from_sequence(unknown, observed, plant)
    if found is not None:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} predicts an attracting cycle with an interval of "
            f"{found.interval:.6g} s",
        )
    why = "a set-point moves it" if unknown.run.setpoint else "the motion does not settle"
    return _cannot(unknown, f"{why}; its initial state is not known, and the run file has no noise to explain it")


def _from_rhythm(
    unknown: Unknown, observed: Observed, found: Rhythm, candidates: list[Candidate], plant: PlantKind
) -> Identification:
    if len(candidates) > 1 and observed.whole:
        sequence = Sequence(unknown, observed, plant)
        count = min(len(observed.times), 6)
        off = [float(np.sum(sequence.residuals(each.value, count, plant) ** 2)) for each in candidates]
        candidates = [candidates[int(np.argmin(off))]]
    if any(not np.isfinite(each.error) for each in candidates):
        return _cannot(unknown, f"the interval does not depend on {unknown.name} here")
    agreements = [agreement(unknown, each.value, observed, found, plant) for each in candidates]
    nearest = max(agreements, key=lambda each: each.probability)
    if not nearest.fits:
        best = candidates[agreements.index(nearest)]
        return _nothing_fits(
            unknown, f"{unknown.name} = {best.value:.5g} gives the rhythm, but {nearest.words}", nearest
        )
    candidates = [each for each, how in zip(candidates, agreements, strict=True) if how.fits]
    best = candidates[0]
    intervals = tuple((each.value - each.error, each.value + each.error) for each in candidates)
    values = " or ".join(f"{each.value:.6g} ± {each.error:.1g}" for each in candidates)
    sign = {1: ", not mirrored", -1: ", mirrored", 0: ""}[found.sign]
    words = f"{unknown.name} = {values}, from a settled interval of {found.interval:.7g} s{sign}."
    if len(candidates) > 1:
        words += " These data do not distinguish the branches; outputs at the events, or a known initial state, would."
    if not nearest.predicted:
        words += " Amplitude and shape were not observed; only the regularity of the events could be compared."
    value = best.value if len(candidates) == 1 else None
    return _found(unknown, value, intervals, "rhythm", words, nearest.probability)


def _from_sequence(unknown: Unknown, observed: Observed, plant: PlantKind) -> Identification:
    fit = Sequence(unknown, observed, plant).fit()
    if fit.residual <= _BAD_FIT and not np.isfinite(fit.error):
        return _cannot(unknown, f"the events do not depend on {unknown.name} here")
    if fit.residual > _BAD_FIT:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} gives these events: the best one is off by "
            f"{100 * fit.residual:.2g} % of an interval",
        )
    how = agreement_of_sequence(unknown, fit.value, observed, plant)
    if not how.fits:
        return _nothing_fits(unknown, f"{unknown.name} = {fit.value:.5g} fits the events best, but {how.words}", how)
    words = f"{unknown.name} = {fit.value:.6g} ± {fit.error:.1g}, from {len(observed.times)} events since the start."
    interval = (fit.value - fit.error, fit.value + fit.error)
    return _found(unknown, fit.value, (interval,), "sequence", words, how.probability)


def _found(
    unknown: Unknown,
    value: float | None,
    intervals: tuple[tuple[float, float], ...],
    way: Way,
    words: str,
    probability: float,
) -> Identification:
    """The result, with its goodness of fit and an end of the range that it reaches."""
    room = _EDGE * (unknown.high - unknown.low)
    low, high = min(pair[0] for pair in intervals), max(pair[1] for pair in intervals)
    edge = unknown.low if low <= unknown.low + room else unknown.high if high >= unknown.high - room else None
    words += f" Goodness of fit: p = {probability:.2g}."
    if edge is not None:
        words += f" This reaches the edge of the range, {edge:g}, beyond which the value may lie: widen the range."
    return Identification(unknown.name, value, intervals, way, words, probability, edge)


def _nothing_fits(unknown: Unknown, why: str, how: Agreement) -> Identification:
    words = (
        f"No value of {unknown.name} between {unknown.low:g} and {unknown.high:g} fits the motion: {why} "
        f"(p {_small(how.probability)})."
    )
    return Identification(unknown.name, None, (), "none", words, how.probability)


def _small(probability: float) -> str:
    return f"= {probability:.1g}" if probability >= 1e-6 else "< 1e-6"


def _cannot(unknown: Unknown, why: str) -> Identification:
    return Identification(unknown.name, None, (), "none", f"The motion cannot tell {unknown.name}: {why}.")
