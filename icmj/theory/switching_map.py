"""The result of switched delayed feedback of a one-joint body, without a simulation: a map with two points.

In the plane of position and rate (θ, θ') feedback is on where θ (θ' − a θ) > 0, with readings delayed by t_d
(:mod:`icmj.controller.switching`). When it is switched on after it was off for at least t_d, all readings that are
still to come are those of an open-loop motion: the history is e^{As} ξ, with ξ on one of the two edges of the
region, θ = 0 or θ' = aθ. Without a dead zone the loop is homogeneous, so that only the edge and the size of ξ matter:
from each edge a motion reaches, after feedback was on once and off once, a known edge with its size multiplied by a
known factor. Whether it decays or grows follows from these two numbers.

While feedback is on, the motion is a Taylor series on every part of a delay, whose input is the series one delay
earlier; while it is off, the next crossing has a closed form. Whole maps over the gains are computed at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant

AXIS, LINE, STAYS, SHORT = 0, 1, -1, -2
EDGE = 1e-6  # of a round's log factor: what is nearer to 0 is on the edge
_TERMS, _LOOKS = 25, 8  # of a series that turns by at most a radian; places at which it is looked for a crossing
_NODES = np.linspace(0, 1, _LOOKS + 1)[1:]
_POWERS = np.vander(_NODES, _TERMS, increasing=True).T
_LONGEST = 200  # delays that feedback may be on before it is taken to stay on
_ITERATIONS = 60  # of bisection within Newton's method
_SETTLED = 1e-6  # of the ratio θ'/θ of a motion that stays on, relative to its root
_STANDS, _FALLS, _BOTH, _ON_EDGE, _OPEN = "stands", "falls", "depends on the start", "on the edge", "undecided"


@dataclass(frozen=True, eq=False)
class SwitchingMap:
    """The motion after feedback is switched on at either edge: at θ = 0 (0) and at θ' = aθ (1).

    Attributes:
        P, D: gains, shape (N,).
        follows: edge at which feedback is switched on next; −1 if feedback is never switched again; −2 if it is off for
            less than the delay, so that this map does not determine the edge; shape (2, N).
        scale: size at the next edge divided by that at this one, negative if the side changes; NaN without a next
            edge; shape (2, N).
        length: time until the next edge [s]; NaN without a next edge; shape (2, N).
        growth: final growth rate of the motion [1/s], NaN if it is not determined; shape (2, N).
        factor: final factor per round, over one edge or, if edges alternate, both; NaN without rounds; shape (2, N).
        period: duration of such a round [s], shape (2, N).
    """

    P: Array
    D: Array
    follows: NDArray[np.int64]
    scale: Array
    length: Array
    growth: Array
    factor: Array
    period: Array

    @property
    def verdict(self) -> NDArray[np.str_]:
        """``stands``, ``falls``, ``depends on the start``, ``on the edge`` or ``undecided``, shape (N,)."""
        per_round = np.where(np.isfinite(self.period), self.growth * self.period, self.growth)
        falls, stands = per_round > EDGE, per_round < -EDGE
        found = np.where(falls.all(axis=0), _FALLS, np.where(stands.all(axis=0), _STANDS, _BOTH))
        found = np.where((np.abs(per_round) <= EDGE).any(axis=0), _ON_EDGE, found)
        return np.where(np.isnan(per_round).any(axis=0), _OPEN, found)


def switching_map(
    plant: LinearPlant, position: str, rate: str, P: ArrayLike, D: ArrayLike, delay: float, slope: float
) -> SwitchingMap:
    """The map of a switched loop without a dead zone, for many gains at once.

    Args:
        plant: a plant with two states and one input.
        position, rate: names of the outputs θ and θ'.
        P, D: gains, shapes that broadcast to (N,).
        delay: delay t_d [s].
        slope: slope a [1/s].

    Raises:
        AnalysisError: if the plant has another number of states or inputs, or a number is out of range.
    """
    A, b = _in_the_plane(plant, position, rate)
    if not (np.isfinite(delay) and delay > 0 and np.isfinite(slope)):
        raise AnalysisError(f"expected a positive delay and a finite slope, got {delay} s and {slope} 1/s")
    P, D = (np.atleast_1d(np.asarray(gain, dtype=float)) for gain in (P, D))
    try:
        P, D = np.broadcast_arrays(P, D)
    except ValueError:
        raise AnalysisError(f"gains of shapes {P.shape} and {D.shape} do not fit") from None
    if P.ndim != 1 or not (np.isfinite(P).all() and np.isfinite(D).all()):
        raise AnalysisError("gains must be finite numbers, one row of them")
    loop = _Loops(A, b * P, b * D, float(delay), float(slope))
    follows, scale, length, stays = (np.array(part) for part in zip(*(loop.from_edge(e) for e in (0, 1)), strict=True))
    growth, factor, period = stays.copy(), np.full(scale.shape, np.nan), np.full(scale.shape, np.nan)
    for edge, other in ((0, 1), (1, 0)):
        to, back = follows[edge], follows[other]
        for here, size, time in (
            (to == edge, scale[edge], length[edge]),
            ((to == other) & (back == other), scale[other], length[other]),
            ((to == other) & (back == edge), scale[edge] * scale[other], length[edge] + length[other]),
        ):
            factor[edge, here], period[edge, here] = np.abs(size)[here], time[here]
        ends = (to == other) & (back < 0)
        growth[edge, ends] = stays[other, ends]
    rounds = np.isfinite(period)
    with np.errstate(divide="ignore"):
        growth[rounds] = np.log(factor[rounds]) / period[rounds]
    return SwitchingMap(P, D, follows.astype(np.int64), scale, length, growth, factor, period)


def _in_the_plane(plant: LinearPlant, position: str, rate: str) -> tuple[Array, float]:
    """The plant in (θ, θ'): matrix of its rates, and what a unit of input adds to θ''.

    Raises:
        AnalysisError: if that is not all of it.
    """
    for name in (position, rate):
        if name not in plant.outputs:
            raise AnalysisError(f"no output {name!r}; the plant's outputs are {', '.join(plant.outputs)}")
    T = plant.C[[plant.outputs.index(position), plant.outputs.index(rate)]]
    if plant.n != 2 or plant.n_u != 1 or np.linalg.cond(T) > 1e12:
        raise AnalysisError(
            f"rounds are known ahead of a body with one joint and one input, whose position and rate are its state; "
            f"this plant has {plant.n} states and {plant.n_u} inputs"
        )
    A, b = T @ plant.A @ np.linalg.inv(T), T @ plant.B[:, 0]
    size = np.abs(A).max()
    if np.abs(A[0] - [0, 1]).max() > 1e-9 * size or abs(b[0]) > 1e-9 * abs(b[1]):
        raise AnalysisError(f"the output {rate!r} is not the rate of {position!r}")
    A[0] = 0.0, 1.0
    return A, float(b[1])


class _Loops:
    """Loops with θ'' = A₁·(θ, θ') − p θ_Δ − d θ'_Δ while feedback is on."""

    def __init__(self, A: Array, p: Array, d: Array, delay: float, slope: float) -> None:
        self.A, self.p, self.d, self.delay, self.slope = A, p, d, delay, slope
        # position in units of rate by a time that balances them
        stiff, damped = abs(A[1, 0]) + np.abs(p).max(), abs(A[1, 1]) + np.abs(d).max()
        self.parts = max(1, int(np.ceil(delay * max(np.sqrt(stiff), stiff / max(damped, np.sqrt(stiff)), damped))))
        self.H = delay / self.parts

    def from_edge(self, edge: int) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Next edge, scale, length, and growth of what stays as it is; shapes (N,)."""
        if edge == LINE and not self._rises():  # in open loop it is crossed the other way only
            return self.from_edge(AXIS)
        N, H, delay = len(self.p), self.H, self.delay
        follows = np.full(N, STAYS)
        scale, length, growth = (np.full(N, np.nan) for _ in range(3))
        x = np.tile([0.0, 1.0] if edge == AXIS else [1.0, self.slope], (N, 1))
        left, p, d = np.arange(N), self.p, self.d
        out, short = np.full(N, np.inf), np.zeros(N, bool)  # when it leaves the region
        before: list[Array] = []
        for number in range(-self.parts, _LONGEST * self.parts):
            force = None
            if number >= 0:
                earlier = before.pop(0)
                force = -H * (p[:, None] * earlier[:, 0] + d[:, None] * earlier[:, 1])
            X = _series(self.A * H, x, force)
            before.append(X)
            x, t = X.sum(axis=2), number * H
            self._look(X, t, out, short)
            done = out + delay <= t + H
            if done.any():
                here = left[done]
                at = _values(X[done], (out[done] + delay - t) / H)
                follows[here], scale[here], after, growth[here] = self._falling(at)
                length[here] = out[done] + 2 * delay + after
                follows[here[short[done] | self._inside(at)]] = SHORT
                x, p, d, out = (part[~done] for part in (x, p, d, out))
                left, short = left[~done], short[~done]
                before = [series[~done] for series in before]
            if not len(left):
                break
        growth[left] = self._staying(x, p, d)
        follows[left[np.isnan(growth[left])]] = SHORT
        growth[follows == SHORT] = scale[follows == SHORT] = length[follows == SHORT] = np.nan
        return follows, scale, length, growth

    def _rises(self) -> bool:
        """Whether the plant in open loop crosses the line into the region where feedback is on."""
        return bool(self.A[1] @ [1.0, self.slope] > self.slope**2)

    def _inside(self, x: Array) -> NDArray[np.bool_]:
        """Whether feedback would be off but for θ < 0, or is not, shape (N,)."""
        return np.asarray((x[:, 0] <= 0) | (x[:, 1] >= self.slope * x[:, 0]))

    def _look(self, X: Array, t: float, out: Array, short: NDArray[np.bool_]) -> None:
        """Note on a part of the motion, from ``t`` on, where it leaves the region, and whether it is back too soon."""
        above = X[:, 1] - self.slope * X[:, 0]
        seen, position = above @ _POWERS, X[:, 0] @ _POWERS
        leaves = np.isinf(out) & (seen < 0).any(axis=1)
        if leaves.any():
            last = (seen[leaves] < 0).argmax(axis=1)
            first = np.where(last > 0, _NODES[last - 1], 0.0)
            out[leaves] = t + self.H * _root(above[leaves], first, _NODES[last])
        since = t + self.H * _NODES[None, :] - out[:, None]
        off = (since > 0) & (since < self.delay)
        short |= (off & ((seen > 0) | (position < 0))).any(axis=1)
        # an extremum between two looks that would cross the line there and back
        bend = seen[:, :-2] - 2 * seen[:, 1:-1] + seen[:, 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = seen[:, 1:-1] - (seen[:, 2:] - seen[:, :-2]) ** 2 / (8 * bend)
        low = np.isinf(out)[:, None] & (bend > 0) & (turn < 0)
        high = off[:, 1:-1] & (bend < 0) & (turn > 0)
        near = np.abs(seen[:, 2:] - seen[:, :-2]) < 2 * np.abs(bend)  # the extremum is there
        short |= ((low | high) & near).any(axis=1)

    def _falling(self, x: Array) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """The open-loop motion from ``x``: next edge, size there, time until then, and growth without an edge."""
        times = np.stack([_crossing(self.A, x, row) for row in (np.array([1.0, 0.0]), np.array([-self.slope, 1.0]))])
        after = times.min(axis=0)
        ends = np.isfinite(after)
        edge = np.where(ends, np.where(times[LINE] < times[AXIS], LINE, AXIS), STAYS)
        at = np.einsum("nij,nj->ni", _exponential(self.A, np.where(ends, after, 0.0)), x)
        scale = np.where(edge == LINE, at[:, 0], at[:, 1])
        values = np.linalg.eigvals(self.A)
        fastest = float(values.real.max())
        kept = fastest if not np.iscomplex(values).any() and fastest < self.slope else np.nan
        return edge, np.where(ends, scale, np.nan), np.where(ends, after, np.nan), np.where(ends, np.nan, kept)

    def _staying(self, x: Array, p: Array, d: Array) -> Array:
        """The real characteristic root at which a motion under feedback goes on, NaN where it has not come to one."""
        with np.errstate(all="ignore"):
            ratio = x[:, 1] / x[:, 0]
            s = ratio.copy()
            for _ in range(30):
                late = np.exp(-s * self.delay)
                value = s**2 - self.A[1, 1] * s - self.A[1, 0] + (p + d * s) * late
                s = s - value / (2 * s - self.A[1, 1] + (d - self.delay * (p + d * s)) * late)
            come = (np.abs(s - ratio) <= _SETTLED * (1 + np.abs(s))) & (s > self.slope)
        return np.where(come, s, np.nan)


def _series(A: Array, x: Array, force: Array | None) -> Array:
    """The Taylor series of ẋ = A x + (0, force) from ``x``, shape (N, 2, terms)."""
    X = np.zeros((*x.shape, _TERMS))
    X[:, :, 0] = x
    for j in range(_TERMS - 1):
        X[:, :, j + 1] = X[:, :, j] @ A.T
        if force is not None:
            X[:, 1, j + 1] += force[:, j]
        X[:, :, j + 1] /= j + 1
    return X


def _values(X: Array, at: Array) -> Array:
    """Series at one place each, shape (N, 2)."""
    return np.asarray((X * (at[:, None] ** np.arange(_TERMS))[:, None, :]).sum(axis=2))


def _root(series: Array, low: Array, high: Array) -> Array:
    """The places at which series, shape (N, terms), fall through zero, by Newton's method and bisection."""
    slopes = series[:, 1:] * np.arange(1, _TERMS)
    powers = np.arange(_TERMS)
    at = (low + high) / 2
    for _ in range(_ITERATIONS):
        power = at[:, None] ** powers
        value = (series * power).sum(axis=1)
        low, high = np.where(value > 0, at, low), np.where(value > 0, high, at)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = at - value / (slopes * power[:, :-1]).sum(axis=1)
        after = np.where((step > low) & (step < high), step, (low + high) / 2)
        if np.abs(after - at).max(initial=0.0) <= 1e-15:
            break
        at = after
    return at


def _halves(A: Array) -> tuple[float, float]:
    """For a second-order system, half its trace, and the square of half the distance of its eigenvalues."""
    middle = float(np.trace(A)) / 2
    return middle, middle**2 - float(np.linalg.det(A))


def _crossing(A: Array, x: Array, row: Array) -> Array:
    """The first time after 0 at which row · e^{At} x is zero; infinity where it never is; shape (N,)."""
    middle, square = _halves(A)
    level, slope = x @ row, (x @ (A - middle * np.eye(2)).T) @ row
    w = np.sqrt(abs(square))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = -level / slope  # tanh(w t) / w, or tan
        if square > 0:
            t = np.arctanh(w * ratio) / w
            return np.where((ratio > 0) & (w * ratio < 1), t, np.inf)
        t = np.arctan(w * ratio) / w if w else ratio
        return np.where(t > 0, t, t + np.pi / w if w else np.inf)


def _exponential(A: Array, t: Array) -> Array:
    """e^{At}, shape (N, 2, 2)."""
    middle, square = _halves(A)
    w = np.sqrt(abs(square))
    c, s = (np.cosh(w * t), np.sinh(w * t)) if square > 0 else (np.cos(w * t), np.sin(w * t))
    s = s / w if w else t
    turned = c[:, None, None] * np.eye(2) + s[:, None, None] * (A - middle * np.eye(2))
    return np.asarray(np.exp(middle * t)[:, None, None] * turned)
