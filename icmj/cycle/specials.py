"""What happens along a branch: the path so far, changes of stability, and how it ends.

The path along a curve: its points by arc length, and the polynomials through them, which predict the next point.

The degree of the predicting polynomial is the one that would have predicted the last points best: a low one where the
curve has bent or the points carry rounding, a high one where it is smooth.

Changes of stability along a branch: test functions of the multipliers, and the points at which one is zero.

With κ the multipliers of sign · P^p, a fold or a branch point has ∏(κ − 1) = 0, a flip or the loss of the mirror
symmetry ∏(κ + 1) = 0, and a Neimark–Sacker point ∏_{i<j}(κ_i κ_j − 1) = 0. All three are smooth and real.

How a branch ends: an event grazes, an interval falls to the least one or grows without bound, or the body falls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, leading
from icmj.cycle.branch import Kind, SpecialPoint
from icmj.cycle.curve import Curve, Miss, Point, correct

_FIRST, _HIGHEST = 4, 13  # degrees: up to which nothing is asked, and the highest
_FEW = 3  # derivatives that are all taken
_RECENT = 2  # points that judge a degree
_BENDING = 8  # points through which the derivative is interpolated, at most


class Trail:
    """Points of a curve in the order of continuation.

    Attributes:
        s: length along the curve up to each.
        u: where each is, better than it was flown by what the flight showed, shapes (m,).
        known: numbers of the points whose derivative D is known, rising.
        D: these derivatives.
    """

    def __init__(self, u: Array) -> None:
        self.s, self.u = [0.0], [u]
        self.known: list[int] = []
        self.D: list[Array] = []
        self._errors: list[Array] = []  # of the last points, by degree
        self._wrong: list[Array] = []  # of the last derivatives, by how many points gave them

    def __len__(self) -> int:
        return len(self.s)

    def add(self, u: Array, length: float) -> None:
        """Append a point at a distance ``length`` from the last."""
        s = self.s[-1] + length
        errors = np.full(_HIGHEST + 1, np.inf)
        for degree in range(1, min(len(self), _HIGHEST + 1, self.degree + 3)):
            errors[degree] = np.abs(self._ahead(degree, s)[:-1] - u[:-1]).max()
        self._errors = [*self._errors[1 - _RECENT :], errors]
        self.s.append(s)
        self.u.append(u)

    def cut(self, length: int) -> None:
        """Forget all but the first ``length`` points."""
        del self.s[length:], self.u[length:]
        kept = sum(i < length for i in self.known)
        del self.known[kept:], self.D[kept:]

    def derive(self, i: int, D: Array) -> None:
        """The derivative at a point beyond those at which it is known."""
        errors = np.full(_BENDING + 1, np.inf)
        for count in range(2, min(len(self.known), _BENDING) + 1):
            errors[count] = np.abs(self._flat(self.s[i], count) - D.reshape(-1)).max()
        self._wrong = [*self._wrong[1 - _RECENT :], errors]
        self.known.append(i)
        self.D.append(D)

    @property
    def degree(self) -> int:
        """Degree of the predicting polynomial."""
        n = len(self)
        if n <= _FIRST + 1:
            return n - 1
        return int(np.argmin(np.max(self._errors, axis=0)))

    def predict(self, ds: float, tangent: Array) -> Array:
        """The point a length ``ds`` on from the last; along ``tangent`` where there is one point only."""
        if len(self) == 1:
            return np.asarray(self.u[-1] + ds * tangent)
        return self._ahead(self.degree, self.s[-1] + ds)

    def derivative(self, s: float) -> Array:
        """D at arc length s, interpolated through as many neighbours as would have predicted the last ones best."""
        count = len(self.known)
        if count > _FEW:
            count = int(np.argmin(np.max(self._wrong, axis=0)))
        return self._flat(s, count).reshape(self.D[-1].shape)

    def _flat(self, s: float, count: int) -> Array:
        nearest = np.sort(np.argsort(np.abs(np.array([self.s[i] for i in self.known]) - s))[:count])
        where = np.array([self.s[self.known[j]] for j in nearest])
        return interpolate(where, np.array([self.D[j].reshape(-1) for j in nearest]), s)

    def between(self, i: int, s: float) -> Array:
        """The point at a length s between points i and i + 1."""
        first = max(min(i + 4, len(self)) - _FIRST - 2, 0)
        chosen = slice(first, first + _FIRST + 2)
        return interpolate(np.array(self.s[chosen]), np.array(self.u[chosen]), s)

    def slope(self) -> Array:
        """du/ds at the last point."""
        recent = min(len(self), _FIRST + 1)
        s, u = np.array(self.s[-recent:]), np.array(self.u[-recent:])
        h = 1e-3 * (s[-1] - s[-2])
        return np.asarray((interpolate(s, u, s[-1] + h) - interpolate(s, u, s[-1] - h)) / (2 * h))

    def _ahead(self, degree: int, s: float) -> Array:
        return interpolate(np.array(self.s[-degree - 1 :]), np.array(self.u[-degree - 1 :]), s)


def interpolate(s: Array, values: Array, at: float) -> Array:
    """The polynomial through (s_i, values_i) at a place; shapes (k,), (k, m) → (m,)."""
    gaps = s[:, None] - s[None, :]
    np.fill_diagonal(gaps, 1.0)
    ratios = (at - s)[None, :] / gaps
    np.fill_diagonal(ratios, 1.0)
    return np.asarray(ratios.prod(axis=1) @ values)


Test = Literal["+1", "-1", "pair"]
TESTS: tuple[Test, ...] = ("+1", "-1", "pair")
_NEAR = 1e-2  # a κ this near to the circle is on it; a neutral saddle, two real ones of product 1, does not count


def kappas(
    multipliers: NDArray[np.complex128], sign: int, neutral: int, alternating: bool = False
) -> NDArray[np.complex128]:
    """κ without those of neutral modes, and without the −1 of mirrored cycles that are of a family."""
    kappa = sign * multipliers
    kappa = kappa[np.sort(np.argsort(np.abs(kappa - 1))[neutral:])]
    return np.delete(kappa, np.abs(kappa + 1).argmin()) if alternating else kappa


def value_of(test: Test, kappa: NDArray[np.complex128]) -> float:
    """A test function."""
    if test == "+1":
        return float(np.prod(kappa - 1).real)
    if test == "-1":
        return float(np.prod(kappa + 1).real)
    i, j = np.triu_indices(len(kappa), 1)
    # far inside, products are next to nothing and each factor next to −1
    return float(np.prod(1 - kappa[i] * kappa[j]).real)


def find_crossed(before: NDArray[np.complex128], after: NDArray[np.complex128]) -> list[Test]:
    """The tests that change sign between two points."""
    return [test for test in TESTS if value_of(test, before) * value_of(test, after) < 0]


def locate(
    left: Point, right: Point, f: Callable[[Point], float], between: Callable[[float], Point | None], close: float
) -> Point | None:
    """The point where f is zero, between two of different sign, by Brent's method.

    Args:
        left, right: points at the parts 0 and 1 of the way.
        f: the test function.
        between: the point at a part of the way; ``None`` if there is none.
        close: distance in the parameter that is near enough.

    Returns:
        the point, or ``None`` where the curve cannot be reached in between.
    """
    from scipy.optimize import brentq

    known = {0.0: left, 1.0: right}

    def at(part: float) -> float:
        if part not in known:
            found = between(part)
            if found is None:
                raise _Unreached
            known[part] = found
        return f(known[part])

    gap = max(abs(right.value - left.value), 1e-300)
    try:
        root = float(brentq(at, 0.0, 1.0, xtol=min(max(0.2 * close / gap, 1e-10), 1e-2), rtol=1e-14))
        at(root)
    except _Unreached:
        return None
    return known[root]


class _Unreached(Exception):
    pass


def critical(test: Test, kappa: NDArray[np.complex128]) -> complex | None:
    """The κ that is on the circle; ``None`` where there is none, as at a neutral saddle."""
    if test != "pair":
        target = 1 if test == "+1" else -1
        nearest = complex(kappa[np.argmin(np.abs(kappa - target))])
        return nearest if abs(nearest - target) < _NEAR else None
    complexes = kappa[kappa.imag > 1e-8]
    if not len(complexes):
        return None
    nearest = complexes[np.argmin(np.abs(np.abs(complexes) - 1))]
    return complex(nearest) if abs(abs(nearest) - 1) < _NEAR else None


def direction(J: Array, multiplier: complex) -> Array:
    """The real eigenvector of J at a real multiplier, of unit norm, shape (N,)."""
    values, vectors = np.linalg.eig(J)
    v = vectors[:, np.argmin(np.abs(values - multiplier))]
    v = np.real(v * np.exp(-1j * np.angle(v[leading(v)])))
    return np.asarray(v / np.linalg.norm(v))


def describe_crossing(curve: Curve, test: Test, kappa: complex, at: Point, index: int, turns: bool) -> SpecialPoint:
    """A crossing in words."""
    name, value, p = curve.family.parameter.name, at.value, curve.p
    where = f"at {name} = {value:.8g}"
    if test == "+1":
        kind = "fold" if turns else "branch point"
        words = f"The branch turns about {where}." if turns else f"Another branch goes through it {where}."
    elif test == "-1" and curve.sign > 0:
        kind, words = "flip", f"A cycle of {2 * p} intervals branches off {where}."
    elif test == "-1":
        kind, words = "symmetry breaking", f"A pair of cycles with unlike halves branches off {where}."
    else:
        angle = abs(np.degrees(np.angle(kappa)))
        kind = "Neimark–Sacker"
        words = f"A pair of multipliers at ±{angle:.4g}° crosses the unit circle {where}: quasi-periodic sway near by."
    return SpecialPoint(
        kind,  # type: ignore[arg-type]
        value,
        index,
        at.states[0],
        at.intervals,
        at.y_peak,
        curve.sign * kappa,
        words,
    )


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
    if touching(points):
        words = f"The event is itself a touch of the threshold at {where}: beyond it the event does not come."
        return _ends(points, "grazing", words)
    if why.lost is not None:
        return _ends(points, "end", f"No cycle beyond {where}: there the motion {why.lost.outcome.message}.")
    return _ends(points, "end", f"No cycle was found beyond {where}.")


def touching(points: Sequence[Point]) -> bool:
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


def homoclinic(curve: Curve, points: list[Point], settle: Callable[[float, float], Point | None]) -> Ending | None:
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
    if closed < _WORN or len(points) < 5 or touching(points) or longest[-1] < _GROWN * longest.min():
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
