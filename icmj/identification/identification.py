"""The inverse question of the paper's conclusion: the model error that explains a motion, and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.case import PlantKind, expect_rule
from icmj.cycle.cycle import find_cycle
from icmj.errors import IcmjError, IdentificationError
from icmj.identification.course import MANY, Agreement, Course, Fit
from icmj.identification.inversion import POINTS, Inverse, find_minima
from icmj.identification.observed import FEWEST, Observed
from icmj.identification.rhythm import Rhythm, rhythm
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
        way: the method: the ``rhythm`` of a cycle, the ``sequence`` of events since the start, or ``none``.
        words: a description in words.
        probability: probability that a motion with the best value, because of errors of times and readings, would agree
            less well with its own prediction than the observed motion does; ``None`` if nothing was compared. Below
            :data:`icmj.identification.course.LEVEL` no value fits, and none is determined.
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


@limit_to_one_thread()
def identify(
    unknown: Unknown,
    observed: Observed,
    *,
    plant: PlantKind = "linear",
    refine: bool = True,
    known: Inverse | None = None,
) -> Identification:
    """Estimate one model error and its uncertainty from a motion, or report that the motion does not determine it.

    From a known start, the estimate is the value whose simulated events are those observed. Else it is the value whose
    predicted orbit the motion is on, or approaches: the motion is simulated from an event near it. What moves under
    noise has no such orbit: :func:`icmj.fit` infers its parameters.

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
        return _identify(replace(unknown, run=run), observed, plant, refine, known)


def _identify(
    unknown: Unknown,
    observed: Observed,
    plant: PlantKind,
    refine: bool,
    known: Inverse | None,
) -> Identification:
    if unknown.run.resolve().simulation.settings().noisy:
        raise IdentificationError(
            f"{unknown.run.path}: has noise, under which no interval repeats; infer {unknown.name} by icmj fit, with a "
            "family of this run file"
        )
    found = None if unknown.run.setpoint else rhythm(observed)  # what is predicted of a rhythm is that of r = 0
    case = unknown.checked()
    least = expect_rule(case, "identification").least
    if found is not None and found.interval <= least * (1 + 1e-3) + observed.resolution:
        return _cannot(
            unknown, f"every interval is the least one, {least:g} s: the event rule does not determine the events"
        )
    whole = observed.whole and len(observed.times) >= FEWEST - 2
    if found is None and not whole:
        why, instead = (
            ("a set-point moves it", "a log from the start on")
            if unknown.run.setpoint
            else ("the motion does not settle", "a longer record, or a log from the start on,")
            if len(observed.times)
            else (
                "its outputs do not repeat themselves within their errors",
                "a longer record, readings with smaller errors, or the times of its events",
            )
        )
        return _cannot(
            unknown,
            f"{why}; its initial state is not known, and the run file has no noise to explain it; {instead} may",
        )
    inverse = known
    if found is not None and (inverse is None or not inverse.reaches(found.interval)):
        inverse = Inverse.up_to(unknown, found)
    if whole:
        values = inverse.candidates(found) if inverse and found else []
        return _from_sequence(unknown, observed, plant if refine else "linear", values)
    assert inverse is not None
    assert found is not None
    return _from_rhythm(inverse, observed, found, plant == "mujoco" and refine)


def _from_rhythm(inverse: Inverse, observed: Observed, found: Rhythm, refine: bool) -> Identification:
    unknown = inverse.unknown
    fits: dict[Fit, Rhythm] = {}
    for search in (inverse.candidates, inverse.nearest):
        for like, value in ((each, value) for each in found.readings for value in search(each)):
            course = Course(unknown, observed, "linear", like)
            fit, few = course.fit(value), min(course.fewest(value), MANY)
            while not (fit and fit.agreement.fits) and like.count // 2 >= few:  # the later, the nearer to the cycle
                like = replace(like, count=like.count // 2)
                fit = Course(unknown, observed, "linear", like).fit(value)
            if fit and all(abs(fit.value - other.value) > fit.error + other.error for other in fits):
                fits[fit] = like
        if any(fit.agreement.fits for fit in fits):
            break
    if not fits:
        return _cannot(
            unknown,
            f"no value between {unknown.low:g} and {unknown.high:g} predicts an attracting cycle with an interval of "
            f"{found.interval:.6g} s",
        )
    if any(fit.agreement.fits and fit.error > unknown.high - unknown.low for fit in fits):
        return _cannot(unknown, f"the interval does not depend on {unknown.name} here")
    nearest = max(fits, key=lambda fit: fit.agreement.probability)
    if not nearest.agreement.fits:
        return _nothing_fits(
            unknown,
            f"{unknown.name} = {nearest.value:.5g} gives the rhythm, but {nearest.agreement.words}",
            nearest.agreement,
        )
    fits = {fit: like for fit, like in fits.items() if fit.agreement.fits}
    if refine:
        fits = {refine_fit(inverse, fit, like): like for fit, like in fits.items()}
    intervals = tuple((fit.value - fit.error, fit.value + fit.error) for fit in fits)
    shown = " or ".join(f"{fit.value:.6g} ± {fit.error:.1g}" for fit in fits)
    best, like = next(iter(fits.items()))
    rate, sign = inverse.rate(best.value, like)
    turned = ("", ", not mirrored", ", mirrored")[sign if found.sign else 0]
    words = f"{unknown.name} = {shown}, from a settled interval of {1 / rate:.7g} s{turned}."
    if len(fits) > 1:
        words += " These data do not distinguish the branches; outputs at the events, or a known initial state, would."
    if not nearest.agreement.predicted:
        words += " Amplitude and shape were not observed; only the regularity of the events could be compared."
    only = best.value if len(fits) == 1 else None
    return _complete(unknown, only, intervals, "rhythm", words, nearest.agreement.probability)


def _from_sequence(unknown: Unknown, observed: Observed, plant: PlantKind, values: list[float]) -> Identification:
    course, few = Course(unknown, observed, plant), min(FEWEST - 1, len(observed.times))
    fits = [fit for value in values if (fit := course.fit(value, (2 * few,)))]
    start, grid = Course(unknown, observed, "linear"), np.linspace(unknown.low, unknown.high, POINTS)
    for first in range(few, 0, -1):
        if any(map(_explains, fits)):
            break
        # later events are too far off where the value is; the first ones may be nearly those of another, too, and one
        # that comes late is so far off on either side of the value that only those before it can be compared
        most = np.inf if first == few else _BAD_FIT
        for i in find_minima(np.array([start.distance(at, first) for at in grid])):
            if fit := course.fit(float(grid[i]), tuple(range(first, few)) + tuple(few * 2**k for k in range(12)), most):
                fits.append(fit)
                if _explains(fit):
                    break
    fit = min(fits, key=lambda fit: fit.cost, default=None)
    if fit is None or fit.off > _BAD_FIT:
        off = "" if fit is None else f": the best one is off by {100 * fit.off:.2g} % of an interval"
        return _cannot(unknown, f"no value between {unknown.low:g} and {unknown.high:g} gives these events{off}")
    if fit.error > unknown.high - unknown.low:
        return _cannot(unknown, f"the events do not depend on {unknown.name} here")
    how = fit.agreement
    if not how.fits:
        return _nothing_fits(unknown, f"{unknown.name} = {fit.value:.5g} fits the events best, but {how.words}", how)
    words = f"{unknown.name} = {fit.value:.6g} ± {fit.error:.1g}, from {len(observed.times)} events since the start."
    interval = (fit.value - fit.error, fit.value + fit.error)
    return _complete(unknown, fit.value, (interval,), "sequence", words, how.probability)


def _explains(fit: Fit) -> bool:
    return fit.off <= _BAD_FIT and fit.agreement.fits


def _complete(
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
    return Identification(unknown.name, None, (), "none", f"The motion does not determine {unknown.name}: {why}.")


def refine_fit(inverse: Inverse, fit: Fit, like: Rhythm) -> Fit:
    """The fit by the exact cycle of the engine's loop, not the linear theory's; as it is, if there is none."""
    value, interval = fit.value, 1 / inverse.rate(fit.value, like)[0]
    try:
        for _ in range(3):
            case, slope = inverse.unknown.case(value), inverse.slope(value, 1e-5, like)
            if case is None or case.theory is None or not np.isfinite(slope) or slope == 0:
                return fit
            if (orbit := like.find_orbit(case.theory.prediction)) is not None:
                case = replace(case, theory=replace(case.theory, prediction=case.theory.prediction.about(orbit)))
            missing = interval - find_cycle(case, "mujoco").interval
            value += missing / slope
            if abs(missing) < max(1e-10 * interval, 0.01 * fit.error * abs(slope)):
                break
    except IcmjError:
        return fit
    return replace(fit, value=value)
