"""Reconstruction of reaction times: step times with which a linear model reproduces the recorded control.

The step times of the set-point are moved until a linear model's response, a controller's own or one fitted to a record,
is nearest to the recorded control. With an exact model, a system-matched hold and no noise the control of the
intermittent controller is that of the continuous one to a set-point whose steps stand at the sampling instants, a delay
apart: then nothing is left of it. Times are in rows of the record. Both times of a pair are searched together, at the
middle of every two rows, from sums of squares and products that are the same for all pairs of one interval; then
downhill by Gauss and Newton.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from icmj.base.array import Array, count_steps, is_between
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount
from icmj.controller.controller import Controller
from icmj.controller.step_pairs import StepPairs
from icmj.errors import AnalysisError, DataError, expect
from icmj.series.even_rows import resample_series
from icmj.series.series import Series

MOST_POLES, MOST_ZEROS = 3, 3  # of a fitted model
_ITERATIONS = 6  # of a fit; its poles have settled by then
_FLOOR = 1e-10  # of the power: a residual beneath is as good as none, and does not choose an order


class Sampled(Protocol):
    """A response that is evaluated at the rows of a record."""

    def after(self, f: float) -> tuple[Array, Array]:
        """The response to a step at k + f rows, 0 ≤ f ≤ 1, and its derivative by f, at rows k, k + 1, …; (n,) each."""


@dataclass(frozen=True, eq=False)
class StepResponse:
    """The response h(t) = rest + row exp(A t) state to a step of size 1 at t = 0; before t = 0 it is 0.

    Attributes:
        A: matrix of the response, shape (n, n) [1/s].
        state, row: vectors of the response, shape (n,).
        rest: final value [unit of the control per unit of the set-point].
    """

    A: Array
    state: Array
    row: Array
    rest: float

    def __call__(self, t: Array) -> Array:
        """h at times t [s], shape (N,)."""
        from scipy.linalg import expm

        t = np.asarray(t, dtype=float)
        gone = expm(self.A * np.maximum(t, 0.0)[:, None, None]) @ self.state
        return np.where(t > 0, self.rest + gone @ self.row, 0.0)


@dataclass(frozen=True, eq=False)
class _Exact:
    of: StepResponse
    step: float
    rows: Array

    def after(self, f: float) -> tuple[Array, Array]:
        from scipy.linalg import expm

        x = expm(self.of.A * (self.step * (1 - f))) @ self.of.state
        value = self.of.rest + self.rows @ x
        slope = -self.step * (self.rows @ (self.of.A @ x))
        return np.append(0.0, value), np.append(0.0, slope)


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """A model u_k = Σ a_i u_{k−i} + Σ b_j r_{k−j}, fitted to a record; its response is linear between rows.

    Attributes:
        a: its p coefficients from i = 1 on, shape (p,).
        b: its q coefficients from j = 0 on, shape (q,).
        step: time between the rows [s].
        residual: root mean square of the residual [unit of the control].
        bic: Bayesian information criterion, N ln σ² + (p + q + 1) ln N; the order with the smallest value is chosen.
    """

    a: Array
    b: Array
    step: float
    residual: float
    bic: float


@dataclass(frozen=True, eq=False)
class _Straight:
    h: Array
    slope: Array

    def after(self, f: float) -> tuple[Array, Array]:
        return self.h + f * self.slope, self.slope


def sample_response(response: StepResponse | FittedResponse, step: float, n: int) -> Sampled:
    """A response at n rows, ``step`` [s] apart; that of a fitted one is the step of its record."""
    if isinstance(response, FittedResponse):
        from scipy.signal import lfilter

        h = lfilter(response.b, np.append(1.0, -response.a), np.ones(n))
        return _Straight(h, -np.diff(h, prepend=0.0))
    from scipy.linalg import expm

    once, rows = expm(response.A * step), np.empty((n - 1, len(response.row)))
    now = response.row
    for j in range(n - 1):
        rows[j], now = now, now @ once
    return _Exact(response, step, rows)


def own_response(controller: Controller, channel: int = 0, input: int = 0) -> StepResponse:
    """The response of a controller's command to a step of its set-point, for an exact model and a system-matched hold.

    Apart from the delay, this is the response of the continuous controller of the same design: after an event at rest,
    the intermittent controller has the same response.

    Args:
        controller: a controller with a set-point.
        channel: index of the channel of the set-point.
        input: index of the input of the plant.

    Raises:
        AnalysisError: if the controller has no set-point.
    """
    expect(controller, Controller, "its own response")
    design, followed = controller.design, controller.setpoint
    if followed is None:
        raise AnalysisError("the controller has no set-point to respond to")
    k = design.k[input]
    return StepResponse(design.A_c, followed.x_ss[:, channel], k, float(followed.u_ss[input, channel]))


def fit_response(u: Array, r: Array, step: float, order: tuple[int, int] | None = None) -> FittedResponse:
    """The linear model from r to u with the least Bayes' criterion, or that of one order.

    Its output, not the next row from those before it, is fitted (after Steiglitz and McBride): noise on u does not
    bias its poles. A constant is fitted beside it.

    Args:
        u, r: control and set-point at even rows, shape (N,).
        step: between the rows [s].
        order: (p, q), numbers of coefficients a and b; all up to (3, 3) are tried by default.

    Raises:
        DataError: if no model could be fitted.
    """
    orders = [(p, q) for p in range(MOST_POLES + 1) for q in range(1, MOST_ZEROS + 1)] if order is None else [order]
    found = [model for p, q in orders if (model := fit_order(u, r, step, p, q)) is not None]
    if not found:
        raise DataError("no stable linear model fits the record; is it the control of this set-point?")
    return min(found, key=lambda model: (round(model.bic, 6), len(model.a) + len(model.b)))


def fit_order(u: Array, r: Array, step: float, p: int, q: int) -> FittedResponse | None:
    """The model of one order; ``None`` where it is not stable, or the control does not move."""
    from scipy.signal import lfilter

    N, a, best, u, r = len(u), np.zeros(p), None, u - u[0], r - r[0]
    ones = np.ones(N)
    for _ in range(_ITERATIONS if p else 1):
        polynomial = np.append(1.0, -a)
        U, R, O = (lfilter([1.0], polynomial, signal) for signal in (u, r, ones))
        columns = [_late(U, i) for i in range(1, p + 1)] + [_late(R, j) for j in range(q)] + [O]
        X = np.column_stack(columns)
        solved = np.linalg.lstsq(X, U, rcond=1e-12)[0]
        a, b = solved[:p], solved[p : p + q]
        if p and np.abs(np.roots(np.append(1.0, -a))).max() >= 1:
            break
        left = u - lfilter(b, np.append(1.0, -a), r)
        sigma2 = float(left.var())
        if best is None or sigma2 < best[0]:
            best = sigma2, a, b
    if best is None:
        return None
    sigma2, a, b = best
    power = sigma2 + _FLOOR * float(u.var())
    if not power > 0:
        return None
    bic = N * np.log(power) + (p + q + 1) * np.log(N)
    return FittedResponse(a, b, step, float(np.sqrt(sigma2)), float(bic))


def _late(signal: Array, rows: int) -> Array:
    return np.concatenate([np.zeros(rows), signal[: len(signal) - rows]])


BEFORE, TAIL = 0.2, 0.6  # s before a pair and after the last possible response that are compared
_MEMORY = 30.0  # s for which a response is followed; a constant goes on from there
_NOTHING = 1e-9  # of the variance of the control: less is none
_ROUNDS, _SHORTER, _STILL = 30, (1.0, 0.5, 0.1, 0.02), 1e-11  # of the way downhill; rows by which it has come to rest


class Windows:
    """The rows that are compared for each pair, and the range in which its steps are sought; times are in rows."""

    def __init__(self, start: float, step: float, N: int, pairs: StepPairs, earliest: float, latest: float) -> None:
        """Windows for N rows from ``start`` on."""
        self.at = at = (pairs.t - start) / step
        self.soonest = round(earliest / step)
        self.first = count_steps(at + earliest / step)  # where the search begins
        self.many = 1 - count_steps((earliest - latest) / step)
        self.begin = np.maximum(self.first[:, 0] - round(BEFORE / step), 0)
        after = np.append(count_steps(at[1:, 0]), N)
        self.end = np.minimum(self.first[:, 1] + self.many + round(TAIL / step), after)
        self.memory = min(round(_MEMORY / step), N) + 1
        self.step = step


def move(
    u: Array, pairs: StepPairs, window: Windows, response: Sampled, some: np.ndarray | None = None
) -> tuple[Array, Array, Array]:
    """Best times [rows] (P, 2), what is left of the control (N,), and the share explained of each pair (P,).

    Only ``some`` of the pairs are looked at, if these are given.
    """
    left, moved, explained = u - u[0], np.zeros(pairs.t.shape), np.zeros(len(pairs))
    nothing = _NOTHING * float(u.var())
    known: dict[tuple[int, ...], tuple[Array, ...]] = {}
    middle = response.after(0.5)[0]
    for i in range(len(pairs)) if some is None else some:
        rows = slice(window.begin[i], window.end[i])
        y = left[rows] - left[rows].mean()
        search = _Pair(y, window, i, pairs.sizes[i], response)
        s = search.refine(search.coarse(middle, known))
        moved[i] = s + window.begin[i]
        least = len(y) * nothing  # a pair that moves nothing is not explained by moving nothing
        explained[i] = 1 - (search.missed(s) + least) / (float(y @ y) + least)
        for at, size in zip(moved[i], pairs.sizes[i], strict=True):
            k = int(at)
            h = size * response.after(at - k)[0][: len(left) - k]
            left[k : k + len(h)] -= h
            left[k + len(h) :] -= h[-1]
        left[window.begin[i] :] -= left[rows].mean()
    return moved, left, explained


class _Pair:
    """The search for the times of one pair, in rows from the beginning of its window."""

    def __init__(self, y: Array, window: Windows, i: int, sizes: Array, response: Sampled) -> None:
        self.y, self.sizes, self.response, self.many = y, sizes, response, window.many
        self.first = window.first[i] - window.begin[i]
        self.last = self.first + window.many

    def coarse(self, middle: Array, known: dict[tuple[int, ...], tuple[Array, ...]]) -> Array:
        """The best middles of rows, of all pairs of them."""
        key, (a, b) = (len(self.y), *self.first), self.sizes
        if key not in known:
            H = [self._shift(middle, int(first)) for first in self.first]
            known[key] = (*H, (H[0] ** 2).sum(axis=1), (H[1] ** 2).sum(axis=1), H[0] @ H[1].T)
        H1, H2, one, two, both = known[key]
        cost = (a * a * one - 2 * a * (H1 @ self.y))[:, None] + (b * b * two - 2 * b * (H2 @ self.y)) + 2 * a * b * both
        n = np.arange(self.many)
        cost[self.first[0] + n[:, None] > self.first[1] + n] = np.inf
        return self.first + np.array(np.unravel_index(np.argmin(cost), cost.shape)) + 0.5

    def _shift(self, h: Array, first: int) -> Array:
        """Responses to steps at each row of the search, without their means; shape (many, window)."""
        n = len(self.y)
        padded = np.concatenate([np.zeros(n), h[:n]])
        at = n - first - np.arange(self.many)
        H = np.lib.stride_tricks.sliding_window_view(padded, n)[at]
        return H - H.mean(axis=1, keepdims=True)

    def _place(self, s: Array) -> tuple[Array, Array]:
        """The response to both steps and its derivatives by their times, without means; (n,) and (n, 2)."""
        n, value = len(self.y), np.zeros(len(self.y))
        slopes = np.zeros((n, 2))
        for j, (at, size) in enumerate(zip(s, self.sizes, strict=True)):
            k = min(int(at), n - 1)
            h, slope = self.response.after(at - k)
            value[k:] += size * h[: n - k]
            slopes[k:, j] = size * slope[: n - k]
        return value - value.mean(), slopes - slopes.mean(axis=0)

    def missed(self, s: Array) -> float:
        """The sum of squares that these times leave."""
        left = self.y - self._place(s)[0]
        return float(left @ left)

    def refine(self, s: Array) -> Array:
        """Refine the steps from there by descent, within rows and across them."""
        least = self.missed(s)
        for _ in range(_ROUNDS):
            value, slopes = self._place(s)
            by = _solve(slopes, self.y - value)
            for shorter in _SHORTER:
                tried = [(self.missed(new), new) for new in self._candidates(s, shorter * by)]
                best, new = min(tried, key=lambda pair: pair[0])
                if best < least:
                    break
            else:
                break
            gone, s, least = np.abs(new - s).max(), new, best
            if gone < _STILL:
                break
        return s

    def _candidates(self, s: Array, by: Array) -> Iterator[Array]:
        """The result of a step, with and without leaving the row, beyond which a response may jump."""
        whole = np.clip(s + by, self.first, self.last)
        inside = np.clip(whole, np.floor(s), np.nextafter(np.floor(s) + 1, 0))
        out = whole != inside
        tried = [whole, inside] if out.any() else [whole]
        if out.all():
            tried += [np.array([whole[0], inside[1]]), np.array([inside[0], whole[1]])]
        for new in tried:
            new[1] = max(new)
            yield new


def _solve(X: Array, y: Array) -> Array:
    """The least-squares solution of few columns, the least one where they are alike."""
    return np.asarray(np.linalg.pinv(X.T @ X, rcond=1e-12, hermitian=True) @ (X.T @ y))


EARLIEST = -0.1  # s: of a reaction time, as noise may move that of an immediate one
FEWEST = 4  # pairs, to fit a model to
_PASSES, _SETTLED = 12, 0.02  # of moving times and fitting in turn; rows by which times still move on average
_TEMPLATES, _TRIED = 4, 12  # pairs that a first model is fitted to, and pairs that it is tried on
_DELAYS, _GUESS = 60, (2, 2)  # delays tried for a first model, and its order
_SHIFTS = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # rows by which all times are moved together
_RAYLEIGH = float(-np.log(0.01))  # N |mean|² of N uniform phases exceeds it with a probability of 1 %
_MOST_ROWS = 40_000  # that a model is fitted to


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction(WithCard):
    """Reaction times to the steps of P pairs, from moved step times.

    Attributes:
        pairs: true times and sizes of the steps.
        rt: reaction times to first and second steps, moved minus true times [s], shape (P, 2); NaN if the model
            explains too little.
        explained: share of the variance of the control around each pair that the model explains, shape (P,).
        response: the linear model.
        t, u: times of the rows [s] and control that were compared, shape (N,).
        fit: control of the model with moved step times, shape (N,); it follows slow drifts from pair to pair.
        step: time between the rows [s].
        unit: unit of the control.
    """

    pairs: StepPairs
    rt: Array
    explained: Array
    response: StepResponse | FittedResponse
    t: Array
    u: Array
    fit: Array
    step: float
    unit: str = ""

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        first, second = (float(column[np.isfinite(column)].mean()) for column in self.rt.T)
        rows = (
            ("mean RT1", amount(first, "s")),
            ("mean RT2", amount(second, "s")),
            ("explained, median", f"{np.median(self.explained):.4%}"),
        )
        return Card(f"{len(self.pairs)} pairs of steps, mean RT1 {first:.3g} s, RT2 {second:.3g} s", rows)


def reconstruct_steps(
    series: Series,
    control: str,
    pairs: StepPairs,
    *,
    response: StepResponse | FittedResponse | None = None,
    order: tuple[int, int] | None = None,
    rate: float | None = None,
    earliest: float = EARLIEST,
    latest: float = 1.0,
    worth: float = 0.5,
) -> Reconstruction:
    """Determine reaction times by moving the steps of a set-point until a linear model of the control fits best.

    Without a ``response``, a model is fitted first, to the pair whose model fits the others best. Then times are moved
    and the model is fitted alternately until the times no longer change (van de Kamp et al. 2013 fit the model to the
    true steps, and move the steps once). The order of the model is the one with the smallest Bayesian information
    criterion. A fitted model has no delay of its own, so reaction times include the whole delay; their common part is
    known to about one sampling interval. For each pair, times at every row are tried, and the best are refined between
    rows. The remaining responses to earlier pairs are subtracted; the mean of the control in each pair is free.

    A control signal that jumps shows between which rows it jumped, but hardly where between them: the moved times are
    then at nearly the same fraction of a row. The fitted response is interpolated linearly, so that its slope changes
    at the rows. If the fraction is closer to one row than to the next, noise displaces a time further in one direction
    than in the other, and the mean error depends on the size of the step relative to the noise: steps of different
    size differ in their mean reaction time. The last model is therefore fitted to times that are shifted to the rows.
    There both directions are equivalent: the slopes are the forward and the backward differences of the response,
    which have the same sum of squares.

    Args:
        series: a series that contains the control. Use the rows as they were sampled, because a response that jumps
            cannot be interpolated.
        control: name of the control signal.
        pairs: true times and sizes of the steps: those of :func:`icmj.controller.double_steps` if they are known,
            otherwise those that :func:`icmj.controller.find_step_pairs` finds.
        response: a linear model that is used instead of a fitted one, such as :func:`icmj.experiments.own_response`.
        order: order of the fitted model, (number of coefficients of past control, of the set-point); by default it is
            chosen.
        rate: rows per second to which the series is resampled [Hz]; by default the recorded rows are used.
        earliest, latest: bounds of reaction times [s].
        worth: share of the variance of the control around a pair that the model must explain; for other pairs the
            times are NaN.

    Returns:
        Reaction times; the moved steps of a pair remain in their order.

    Raises:
        DataError: if there are too few pairs, there is no such signal, it does not cover the pairs or is constant,
            rows are too far apart, pairs follow each other too quickly, or no model can be fitted.
    """
    even = resample_series(series.chosen([control]), rate)
    t, u, step = even.t, even.values[:, 0], float(even.t[-1] - even.t[0]) / (len(even) - 1)
    _check(pairs, t, u, step, earliest, latest, control, fitted=response is None)
    window = Windows(t[0], step, len(t), pairs, earliest, latest)
    if response is not None:
        moved, left, explained = move(u, pairs, window, sample_response(response, step, window.memory))
    else:
        response = _first_guess(u, pairs, window, order)
        moved, left, explained = move(u, pairs, window, sample_response(response, step, window.memory))
        for _ in range(_PASSES):
            response = _refit(u[:_MOST_ROWS], moved, pairs, step, order)
            before = moved
            moved, left, explained = move(u, pairs, window, sample_response(response, step, window.memory))
            if np.abs(moved - before).mean() < _SETTLED:
                break
        late = _common(moved[explained >= worth])
        if late is not None:
            response = fit_response(
                u[:_MOST_ROWS], _make_steps(moved - late, pairs.sizes, len(u))[:_MOST_ROWS], step, order
            )
            moved, left, explained = move(u, pairs, window, sample_response(response, step, window.memory))
    rt = np.where((explained >= worth)[:, None], t[0] + step * moved - pairs.t, np.nan)
    return Reconstruction(pairs, rt, explained, response, t, u, u - left, step, even.units[0])


def _check(
    pairs: StepPairs, t: Array, u: Array, step: float, earliest: float, latest: float, control: str, fitted: bool
) -> None:
    if fitted and len(pairs) < FEWEST:
        raise DataError(
            f"{len(pairs)} pairs of steps; expected at least {FEWEST} to fit a model to, or give a response"
        )
    if not earliest < latest:
        raise DataError(f"reaction times from {earliest:g} to {latest:g} s; expected the earliest before the latest")
    ends = np.array([pairs.t[0, 0] + min(earliest, 0.0) - BEFORE, pairs.t[-1, 1] + latest]) - t[0]
    # counted from a row before the first, as no rounding is small relative to zero
    if not is_between(ends + step, step, t[-1] - t[0] + step).all():
        raise DataError(
            f"the record is from {t[0]:g} to {t[-1]:g} s; expected {BEFORE - min(earliest, 0.0):g} s before the first "
            f"step ({pairs.t[0, 0]:g} s) and {latest:g} s after the last ({pairs.t[-1, 1]:g} s)"
        )
    if not is_between(pairs.isi, 2 * step).all():
        raise DataError(
            f"steps {pairs.isi.min():g} s apart in rows {step:g} s apart; expected rows twice as close, or closer"
        )
    if not is_between(pairs.t[1:, 0] - pairs.t[:-1, 1], latest).all():
        at = int(np.argmin(pairs.t[1:, 0] - pairs.t[:-1, 1]))
        raise DataError(
            f"a pair at {pairs.t[at + 1, 0]:g} s begins before the response to the one before it may be over, "
            f"{latest:g} s after its last step; give a smaller latest"
        )
    if not np.ptp(u) > 0:
        raise DataError(f"{control}: does not move; there is nothing to reconstruct")


def _common(moved: Array) -> float | None:
    """The fraction of a row at which moved times concentrate, as for a control that jumps; ``None`` if they do not."""
    mean = np.exp(2j * np.pi * moved).mean() if moved.size else 0.0
    return float(np.angle(mean)) / (2 * np.pi) if moved.size * np.abs(mean) ** 2 > _RAYLEIGH else None


def _make_steps(moved: Array, sizes: Array, N: int) -> Array:
    """A set-point of N rows whose steps stand at these rows and fractions."""
    rises = np.zeros(N + 1)
    k, f = np.divmod(moved.ravel(), 1.0)
    at = np.clip(k.astype(int), 0, N - 1)
    np.add.at(rises, at, (1 - f) * sizes.ravel())
    np.add.at(rises, at + 1, f * sizes.ravel())
    return np.cumsum(rises[:N])


def _first_guess(u: Array, pairs: StepPairs, window: Windows, order: tuple[int, int] | None) -> FittedResponse:
    """A model of the response to a single pair, sharp as an average is not: the one that suits other pairs best.

    The pairs with the longest intervals are tried, each late by the one delay that suits it best.
    """
    tried = np.argsort(-pairs.isi, kind="stable")[:_TRIED]
    near = max(window.many // _DELAYS, 1)
    best: tuple[float, FittedResponse] | None = None
    for i in tried[:_TEMPLATES]:
        rows = slice(window.begin[i], int(window.at[i, 1]))
        models = []
        for late in range(max(window.soonest, 0), window.many, near):
            r = _make_steps(window.at[i, :1] + late - rows.start, pairs.sizes[i, :1], rows.stop - rows.start)
            if np.ptp(r):
                models.append(fit_order(u[rows], r, window.step, *(order or _GUESS)))
        found = [model for model in models if model is not None]
        if found:
            model = min(found, key=lambda model: model.residual)
            share = float(
                np.median(move(u, pairs, window, sample_response(model, window.step, window.memory), tried)[2][tried])
            )
            if best is None or share > best[0]:
                best = share, model
    if best is None:
        raise DataError("no stable linear model fits the record; is it the control of this set-point?")
    return best[1]


def _refit(u: Array, moved: Array, pairs: StepPairs, step: float, order: tuple[int, int] | None) -> FittedResponse:
    """A model of the control to the moved steps, all of them earlier or later by what suits it best."""
    chosen = fit_response(u, _make_steps(moved, pairs.sizes, len(u)), step, order)
    p, q = len(chosen.a), len(chosen.b)
    shifted = [fit_order(u, _make_steps(moved + by, pairs.sizes, len(u)), step, p, q) for by in _SHIFTS]
    return min([chosen, *(model for model in shifted if model is not None)], key=lambda model: model.residual)
