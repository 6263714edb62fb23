"""Reconstruction of reaction times: step times with which a linear model reproduces the recorded control.

The step times of the set-point are moved until a linear model's response is nearest to the recorded control. With an
exact model, a system-matched hold and no noise the control of the intermittent controller is that of the continuous
one to a set-point whose steps stand at the sampling instants, a delay apart: then nothing is left of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array, between
from icmj.base.card import Card, Shown
from icmj.base.numbers import amount
from icmj.controller.step_pairs import StepPairs
from icmj.errors import DataError
from icmj.experiments.double_step.response import FittedResponse, StepResponse, fit_order, fit_response, sampled
from icmj.experiments.double_step.search import BEFORE, Windows, move
from icmj.series.even import even_series
from icmj.series.series import Series

FEWEST = 4  # pairs, to fit a model to
_PASSES, _SETTLED = 12, 0.02  # of moving times and fitting in turn; rows by which times still move on average
_TEMPLATES, _TRIED = 4, 12  # pairs that a first model is fitted to, and pairs that it is tried on
_DELAYS, _GUESS = 60, (2, 2)  # delays tried for a first model, and its order
_SHIFTS = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # rows by which all times are moved together
_RAYLEIGH = float(-np.log(0.01))  # N |mean|² of N uniform phases exceeds it with a probability of 1 %
_MOST_ROWS = 40_000  # that a model is fitted to


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction(Shown):
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
    earliest: float = -0.1,
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
        pairs: true times and sizes of the steps: those of :func:`icmj.double_steps` if they are known, otherwise those
            that :func:`icmj.find_step_pairs` finds.
        response: a linear model that is used instead of a fitted one, such as :func:`icmj.own_response`.
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
    even = even_series(series.chosen([control]), rate)
    t, u, step = even.t, even.values[:, 0], float(even.t[-1] - even.t[0]) / (len(even) - 1)
    _check(pairs, t, u, step, earliest, latest, control, fitted=response is None)
    window = Windows(t[0], step, len(t), pairs, earliest, latest)
    if response is not None:
        moved, left, explained = move(u, pairs, window, sampled(response, step, window.memory))
    else:
        response = _first_guess(u, pairs, window, order)
        moved, left, explained = move(u, pairs, window, sampled(response, step, window.memory))
        for _ in range(_PASSES):
            response = _refitted(u[:_MOST_ROWS], moved, pairs, step, order)
            before = moved
            moved, left, explained = move(u, pairs, window, sampled(response, step, window.memory))
            if np.abs(moved - before).mean() < _SETTLED:
                break
        late = _common(moved[explained >= worth])
        if late is not None:
            response = fit_response(
                u[:_MOST_ROWS], _stepped(moved - late, pairs.sizes, len(u))[:_MOST_ROWS], step, order
            )
            moved, left, explained = move(u, pairs, window, sampled(response, step, window.memory))
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
    if not between(ends + step, step, t[-1] - t[0] + step).all():
        raise DataError(
            f"the record is from {t[0]:g} to {t[-1]:g} s; expected {BEFORE - min(earliest, 0.0):g} s before the first "
            f"step ({pairs.t[0, 0]:g} s) and {latest:g} s after the last ({pairs.t[-1, 1]:g} s)"
        )
    if not between(pairs.isi, 2 * step).all():
        raise DataError(
            f"steps {pairs.isi.min():g} s apart in rows {step:g} s apart; expected rows twice as close, or closer"
        )
    if not between(pairs.t[1:, 0] - pairs.t[:-1, 1], latest).all():
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


def _stepped(moved: Array, sizes: Array, N: int) -> Array:
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
            r = _stepped(window.at[i, :1] + late - rows.start, pairs.sizes[i, :1], rows.stop - rows.start)
            if np.ptp(r):
                models.append(fit_order(u[rows], r, window.step, *(order or _GUESS)))
        found = [model for model in models if model is not None]
        if found:
            model = min(found, key=lambda model: model.residual)
            share = float(
                np.median(move(u, pairs, window, sampled(model, window.step, window.memory), tried)[2][tried])
            )
            if best is None or share > best[0]:
                best = share, model
    if best is None:
        raise DataError("no stable linear model fits the record; is it the control of this set-point?")
    return best[1]


def _refitted(u: Array, moved: Array, pairs: StepPairs, step: float, order: tuple[int, int] | None) -> FittedResponse:
    """A model of the control to the moved steps, all of them earlier or later by what suits it best."""
    chosen = fit_response(u, _stepped(moved, pairs.sizes, len(u)), step, order)
    p, q = len(chosen.a), len(chosen.b)
    shifted = [fit_order(u, _stepped(moved + by, pairs.sizes, len(u)), step, p, q) for by in _SHIFTS]
    return min([chosen, *(model for model in shifted if model is not None)], key=lambda model: model.residual)
