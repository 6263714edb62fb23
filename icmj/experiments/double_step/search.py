"""The search for the step times of pairs with which a linear response is nearest to a control.

Times are in rows of the record. Both times of a pair are searched together, at the middle of every two rows, from sums
of squares and products that are the same for all pairs of one interval; then downhill by Gauss and Newton.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from icmj.base.array import Array, steps_in
from icmj.controller.step_pairs import StepPairs
from icmj.experiments.double_step.response import Sampled

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
        self.first = steps_in(at + earliest / step)  # where the search begins
        self.many = 1 - steps_in((earliest - latest) / step)
        self.begin = np.maximum(self.first[:, 0] - round(BEFORE / step), 0)
        after = np.append(steps_in(at[1:, 0]), N)
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
        s = search.refined(search.coarse(middle, known))
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
            H = [self._shifted(middle, int(first)) for first in self.first]
            known[key] = (*H, (H[0] ** 2).sum(axis=1), (H[1] ** 2).sum(axis=1), H[0] @ H[1].T)
        H1, H2, one, two, both = known[key]
        cost = (a * a * one - 2 * a * (H1 @ self.y))[:, None] + (b * b * two - 2 * b * (H2 @ self.y)) + 2 * a * b * both
        n = np.arange(self.many)
        cost[self.first[0] + n[:, None] > self.first[1] + n] = np.inf
        return self.first + np.array(np.unravel_index(np.argmin(cost), cost.shape)) + 0.5

    def _shifted(self, h: Array, first: int) -> Array:
        """Responses to steps at each row of the search, without their means; shape (many, window)."""
        n = len(self.y)
        padded = np.concatenate([np.zeros(n), h[:n]])
        at = n - first - np.arange(self.many)
        H = np.lib.stride_tricks.sliding_window_view(padded, n)[at]
        return H - H.mean(axis=1, keepdims=True)

    def _placed(self, s: Array) -> tuple[Array, Array]:
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
        left = self.y - self._placed(s)[0]
        return float(left @ left)

    def refined(self, s: Array) -> Array:
        """Refine the steps from there by descent, within rows and across them."""
        least = self.missed(s)
        for _ in range(_ROUNDS):
            value, slopes = self._placed(s)
            by = _solved(slopes, self.y - value)
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


def _solved(X: Array, y: Array) -> Array:
    """The least-squares solution of few columns, the least one where they are alike."""
    return np.asarray(np.linalg.pinv(X.T @ X, rcond=1e-12, hermitian=True) @ (X.T @ y))
