"""Recurrence in a sequence of states: closure after q steps, its trend, and the separation of neighbouring states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array

MOST = 2000  # states that are compared pair by pair


@dataclass(frozen=True)
class Trend:
    """A fit of log r_i = a + i·log(ratio).

    Attributes:
        ratio: factor per step.
        clear: whether the fit explains more than 80 % of the variance.
    """

    ratio: float
    clear: bool


def closure(states: Array, intervals: Array, q: int, sign: int) -> Array:
    """Closure error after q steps, of states and intervals; shape (K − q,).

    It is the larger of |s_i − sign·s_{i−q}| and |Δ_i − Δ_{i−q}|, each relative to the larger of the two it compares.

    Args:
        states: shape (K, m).
        intervals: shape (K,).
        q: steps, at least 1.
        sign: +1, or −1 for a mirrored return.
    """
    norms = np.linalg.norm(states, axis=1)
    size = np.maximum(norms[q:], norms[:-q])
    gap = np.linalg.norm(states[q:] - sign * states[:-q], axis=1)
    state = np.divide(gap, size, out=np.full(len(size), np.inf), where=size > 0)
    longer = np.maximum(np.maximum(intervals[q:], intervals[:-q]), 1e-300)
    return np.maximum(state, np.abs(intervals[q:] - intervals[:-q]) / longer)


def trend(values: Array) -> Trend:
    """Geometric trend of positive values; zeros count as the smallest normal number."""
    if len(values) < 3:
        return Trend(1.0, False)
    logs = np.log(np.maximum(values, np.finfo(float).tiny))
    steps = np.arange(len(logs)) - (len(logs) - 1) / 2
    slope = steps @ logs / (steps @ steps)
    variance = ((logs - logs.mean()) ** 2).sum()
    explained = slope**2 * (steps @ steps) / variance if variance > 0 else 0.0
    return Trend(float(np.exp(np.clip(slope, -700, 700))), bool(explained > 0.8))


def dominant_growth(states: Array, cut: float = 1e-6) -> float:
    """Largest |eigenvalue| of the linear map s_i ↦ s_{i+1} that fits best, all steps weighted alike.

    Args:
        states: shape (K, m), none of them zero.
        cut: directions in which the states extend less than this, relative to their largest extent, are left out;
            there the map cannot be told from round-off.
    """
    size = np.linalg.norm(states[:-1], axis=1)[:, None]
    U, extents, V = np.linalg.svd((states[:-1] / size).T, full_matrices=False)
    kept = extents > cut * extents[0]
    reduced = U[:, kept].T @ (states[1:] / size).T @ V[kept].T / extents[kept]
    return float(np.abs(np.linalg.eigvals(reduced)).max())


def separation(states: Array, ahead: int = 12, apart: int = 9) -> float:
    """Growth factor per step of the distance between neighbouring states (the largest Lyapunov exponent's e-power).

    Close to 1 on a quasi-periodic motion, clearly above 1 on an irregular one (Rosenstein, Collins & De Luca 1993).

    Args:
        states: shape (K, m), K > ahead + apart; of very many the last :data:`MOST` are looked at, pair by pair.
        ahead: steps over which the distance is followed.
        apart: least number of steps between neighbours.
    """
    states = states[-MOST:]
    count = len(states) - ahead
    distance = np.linalg.norm(states[:count, None] - states[None, :count], axis=2)
    near_in_time = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) < apart
    distance[near_in_time] = np.inf
    neighbour = distance.argmin(axis=1)
    # the closest pairs have most room to part before they are as far apart as the motion is wide
    closest = np.argsort(distance[np.arange(count), neighbour])[: max(count // 3, 5)]
    steps = np.arange(ahead + 1)
    gaps = np.linalg.norm(states[closest[:, None] + steps] - states[neighbour[closest][:, None] + steps], axis=2)
    typical = np.median(np.log(np.maximum(gaps, 1e-300)), axis=0)
    return float(np.exp(np.polyfit(steps, typical, 1)[0]))
