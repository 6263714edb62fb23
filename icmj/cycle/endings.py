"""How a branch ends: an event grazes, an interval falls to the least one or grows without bound, or the body falls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from icmj.cycle.bracketing import locate
from icmj.cycle.branch import Kind, SpecialPoint
from icmj.cycle.curve import Curve, Miss, correct
from icmj.cycle.point import Point
from icmj.cycle.trail import Trail

CLOSE = 1e-6  # of the parameter, to which special points are located
_ALMOST = 0.02  # an inner maximum of E this close to zero, relative to the threshold squared, is about to cut in
_GROWN = 2.5  # times the shortest so far: from here on an interval is suspected of growing without bound
_SHRINK = 5.0  # by which the distance to a homoclinic point falls in a step
_APART = 0.03  # relative, of the intervals of points that a homoclinic one is estimated from
_WORN = 2e-9  # a closure that cannot be undercut any more
_TOWARDS = 0.5  # of the way left, by which two successive guesses of where it leads to may differ
_AGREE = 0.02  # relative, of two successive estimates of μ
_NEARBY = 0.3  # of a step: if it passes the first point as closely, whether it goes through it is asked
_SAME = 1e-6  # distance of points, relative to the state's size, that are one
_LOOSE = 1e-7  # closure there: rounding grows with the interval as the plant's fastest mode does


@dataclass(frozen=True, eq=False)
class Ending:
    """Why a branch ends.

    Attributes:
        special: what is there, or ``None`` where it is only the end of the range.
        words: one sentence.
    """

    special: SpecialPoint | None
    words: str


def end_where_lost(curve: Curve, points: Sequence[Point], why: Miss) -> Ending:
    """The end of a branch beyond which no cycle was found, however short the step."""
    last, name = points[-1], curve.family.parameter.name
    where = f"{name} = {last.value:.8g}"
    if why.lost is not None and why.lost.outcome.kind == "fell":
        return _ends(points, "fall", f"The body falls beyond {where}: a position reaches its limit.")
    if last.least < CLOSE:
        return _end_in_fall(curve, points, last)
    if abs(last.graze) < _ALMOST:
        words = (
            f"The event function grazes zero before the event at {where}: beyond it an earlier event cuts in and there "
            "is no such cycle."
        )
        return _ends(points, "grazing", words)
    if is_touching(points):
        words = f"The event is itself a touch of the threshold at {where}: beyond it the event does not come."
        return _ends(points, "grazing", words)
    if why.lost is not None:
        return _ends(points, "end", f"No cycle beyond {where}: there the motion {why.lost.outcome.message}.")
    return _ends(points, "end", f"No cycle was found beyond {where}.")


def is_touching(points: Sequence[Point]) -> bool:
    """Whether the event function hardly rises at an event any more."""
    slopes = [p.slope for p in points]
    return slopes[-1] < 0.05 * float(np.median(slopes))


def end_at_least_interval(curve: Curve, points: Sequence[Point], between: Callable[[float], Point | None]) -> Ending:
    """The end of a branch on whose last step the shortest interval has fallen to the least one."""
    left, right = points[-2:]

    # beyond the point intervals are the least one exactly, and E at their end says how far it is
    def f(at: Point) -> float:
        return -_beyond(curve, at) if at.fallen else at.least

    return _end_in_fall(curve, points, locate(left, right, f, between, CLOSE) or right, len(points) - 2)


def _end_in_fall(curve: Curve, points: Sequence[Point], at: Point, index: int | None = None) -> Ending:
    least, name = curve.loop(at.sigma).controller.least, curve.family.parameter.name
    words = f"An interval falls to the least one, {least:g} s, at {name} = {at.value:.8g}: the rule no longer decides."
    return _ends(points, "least interval", words, at, index)


def _beyond(curve: Curve, at: Point) -> float:
    """The time [s] by which E has passed zero at the end of the shortest interval."""
    loop = curve.loop(at.sigma)
    sample = at.samples[int(np.argmin(at.intervals))]
    E = float(loop.controller.faces.levels(sample.x_h[-1:] - sample.x_o[-1:]).max())
    return max(E, 1e-12) * float(at.intervals.min())


def find_homoclinic_end(
    curve: Curve, points: list[Point], settle: Callable[[float, float], Point | None]
) -> Ending | None:
    """The end of a branch whose longest interval grows as −ln|λ − λ*|/μ; λ* is approached until it stands to 1e-6."""
    longest = np.array([p.intervals.max() for p in points])
    if len(points) < 5 or longest[-1] < _GROWN * longest.min() or not (np.diff(longest[-4:]) > 0).all():
        return None
    guess = _limit(points)
    if guess is None:
        return None
    kept, estimates = len(points), [guess]
    for _ in range(25):
        curve.patient(float(points[-1].intervals.max()))
        value = guess[0] - (guess[0] - points[-1].value) / _SHRINK
        if settle(value, _LOOSE) is None or points[-1].intervals.max() <= points[-2].intervals.max():
            break
        guess = _limit(points)
        if guess is None:
            break
        estimates.append(guess)
        if _agree(estimates, 0.1 * CLOSE):
            break
    if not _agree(estimates, CLOSE):
        del points[kept:]
        return None
    limit, mu = estimates[-1]
    name = curve.family.parameter.name
    words = (
        f"The interval grows without bound towards {name}* = {limit:.8g}, as −ln|{name} − {name}*|/({mu:.4g} rad/s): "
        "a homoclinic orbit, beyond which there is no such cycle."
    )
    return _ends(points, "homoclinic", words, value=limit)


def _agree(estimates: Sequence[tuple[float, float]], close: float) -> bool:
    """Whether the last two estimates of (λ*, μ) are the same."""
    if len(estimates) < 2:
        return False
    (before, mu_before), (after, mu_after) = estimates[-2:]
    return abs(after - before) < close and abs(mu_after / mu_before - 1) < _AGREE


def round_trip(curve: Curve, points: Sequence[Point], trail: Trail, closed: float) -> Ending | None:
    """The end of a branch that is a closed curve: it is at its start again, from the other side."""
    start, last, now = trail.u[0], trail.u[-2], trail.u[-1]
    du = now - last
    row = curve.normal(du)
    part = float(row @ (start - last) / (row @ du))
    off = curve.length(start - last - part * du)
    if len(trail) < 5 or not 0 < part <= 1 or off > _NEARBY * curve.length(du) or row @ (trail.u[1] - start) <= 0:
        return None
    u = trail.between(len(trail) - 2, trail.s[-2] + part * (trail.s[-1] - trail.s[-2]))
    u -= row @ (u - start) / (row @ du) * du
    found = correct(curve, u, points[-1].D, row, closed)
    if isinstance(found, Miss) or curve.length(found.best - start) > _SAME:
        return None
    return Ending(None, f"is closed: it came back to where it began, {points[0].value:.6g}, from the other side")


def end_by_rounding(curve: Curve, points: Sequence[Point], closed: float) -> Ending | None:
    """The end of a branch on which intervals have grown until the map magnifies rounding too much to go on."""
    longest = np.array([p.intervals.max() for p in points])
    if closed < _WORN or len(points) < 5 or is_touching(points) or longest[-1] < _GROWN * longest.min():
        return None
    last, name = points[-1], curve.family.parameter.name
    guess, before = (_limit(upto) if longest[-1] > longest[-4] else None for upto in (points, points[:-1]))
    if guess and (before is None or abs(guess[0] - before[0]) > _TOWARDS * abs(guess[0] - last.value)):
        guess = None
    towards = "" if guess is None else f", growing without bound towards about {name} = {guess[0]:.6g}"
    words = (
        f"At {name} = {last.value:.8g} an interval has grown to {longest[-1]:.4g} s{towards}; over so long a "
        "time the plant magnifies rounding too much to follow it further."
    )
    return _ends(points, "end" if guess is None else "homoclinic", words, value=None if guess is None else guess[0])


def _limit(points: Sequence[Point]) -> tuple[float, float] | None:
    """λ* and μ of Δ = c − ln|λ − λ*|/μ through three points that are well apart; ``None`` if there is none ahead."""
    from scipy.optimize import brentq

    chosen = [points[-1]]
    for p in reversed(points[:-1]):
        if p.intervals.max() < (1 - _APART) * chosen[0].intervals.max():
            chosen.insert(0, p)
        if len(chosen) == 3:
            break
    if len(chosen) < 3:
        return None
    x, y = np.array([p.value for p in chosen]), np.array([p.intervals.max() for p in chosen])
    ratio = (y[2] - y[1]) / (y[1] - y[0])
    step = x[2] - x[1]
    if step == 0 or (x[1] - x[0]) * step <= 0:
        return None

    def f(log_ahead: float) -> float:
        ahead = x[2] + step * np.exp(log_ahead)
        a, b, c = (np.log(abs(ahead - xi)) for xi in x)
        return float((b - c) / (a - b) - ratio)

    low, high = -14.0, 6.0
    if f(low) * f(high) > 0:
        return None
    ahead = x[2] + step * np.exp(brentq(f, low, high, xtol=1e-12))
    mu = (np.log(abs(ahead - x[1])) - np.log(abs(ahead - x[2]))) / (y[2] - y[1])
    return float(ahead), float(mu)


def _ends(
    points: Sequence[Point],
    kind: Kind,
    words: str,
    at: Point | None = None,
    index: int | None = None,
    value: float | None = None,
) -> Ending:
    at, index = at or points[-1], len(points) - 1 if index is None else index
    value = at.value if value is None else value
    special = SpecialPoint(kind, value, index, at.states[0], at.intervals, at.y_peak, complex("nan"), words)
    return Ending(special, words)
