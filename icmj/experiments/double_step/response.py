"""The linear response of a control to a step of its set-point: a controller's own, or fitted to a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.errors import AnalysisError, DataError, expect

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


def sampled(response: StepResponse | FittedResponse, step: float, n: int) -> Sampled:
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
    """The model of one order; ``None`` where it is not stable."""
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
    bic = N * np.log(sigma2 + _FLOOR * u.var()) + (p + q + 1) * np.log(N)
    return FittedResponse(a, b, step, float(np.sqrt(sigma2)), float(bic))


def _late(signal: Array, rows: int) -> Array:
    return np.concatenate([np.zeros(rows), signal[: len(signal) - rows]])
