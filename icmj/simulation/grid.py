"""Values on a regular time grid, linear between its points: Gaussian noise, exact in law, and given values.

White noise has independent values; a first-order low-pass is an Ornstein–Uhlenbeck process, x_{k+1} = a x_k +
√(1 − a²) ξ_k with a = exp(−2π f_c Δ), which at the points of the grid is the continuous one's own law. It is a function
of time, so that it acts alike whatever steps are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from icmj.base.array import Array, at_or_after
from icmj.simulation.sources import Gaussian, Gridded, Sampled

_SAME = 1e-9  # of an interval: points of a grid nearer to an edge are that edge
_BLOCK, _BLOCKS = 256, 16  # points that are worked out at once: as many whatever the run's length, to the last bit


def draw_at_points(source: Gridded, first: int, last: int) -> Array:
    """The values at points ``first`` to ``last`` − 1 of its grid, counted from zero [its unit, or of a command: 1]."""
    if isinstance(source, Sampled):
        held = source.at_points
        return np.asarray(held[np.minimum(np.arange(first, last), len(held) - 1)])
    assert isinstance(source, Gaussian)
    count = -(-last // (_BLOCK * _BLOCKS))
    values = _draw(source.seed, _memory(source), 1 << max(count - 1, 0).bit_length())[first:last]
    return (source.share or source.size) * values


def interpolate_at(source: Gridded, t: Array) -> Array:
    """The value of the noise at any times [s], zero before its start."""
    if not t.size:
        return np.zeros(t.shape)
    place = np.maximum(t, 0) / source.interval
    point = np.floor(place).astype(int)
    values = draw_at_points(source, 0, int(point.max()) + 2)
    between = values[point] + (place - point) * (values[point + 1] - values[point])
    return np.asarray(np.where(at_or_after(t, source.start), between, 0.0))


def list_lines(sources: Sequence[Gridded], duration: float) -> tuple[Array, Array]:
    """Disturbances in a run of ``duration`` [s] as straight lines, on stretches that all share.

    Returns:
        where each stretch but the first begins [s], and infinity, shape (K,); the value at its begin and the slope of
        each source there, shape (K, S, 2).
    """
    starts = np.unique([source.start for source in sources if 0 < source.start < duration])
    begins = np.append(0.0, list_points(starts, sources, duration))
    after = begins[-1] + 1e-3 * min(source.interval for source in sources)  # in the same interval as the last begin
    middle, found = begins + np.diff(begins, append=after) / 2, np.zeros((len(begins), len(sources), 2))
    for number, source in enumerate(sources):
        point = np.floor(middle / source.interval).astype(int)
        values = draw_at_points(source, 0, int(point.max(initial=0)) + 2)
        slope = np.where(middle >= source.start, np.diff(values)[point] / source.interval, 0.0)
        found[:, number, 1] = slope
        there = np.where(middle >= source.start, values[point], 0.0)
        found[:, number, 0] = there + slope * (begins - point * source.interval)
    return np.append(begins[1:], np.inf), found


def _memory(source: Gaussian) -> float:
    """The correlation a of values at successive grid points."""
    return 0.0 if source.corner is None else float(np.exp(-2 * np.pi * source.corner * source.interval))


@lru_cache(maxsize=8)  # of up to 16 MB
def _draw(seed: int, a: float, parts: int) -> Array:
    """Random values of variance one for a number of grid intervals."""
    random = np.random.default_rng(seed)
    fresh = random.standard_normal(parts * _BLOCKS * _BLOCK).reshape(parts, _BLOCKS, _BLOCK)
    if a == 0:
        return fresh.ravel()
    left = _weigh_past(a)
    fresh *= np.sqrt(1 - a**2)
    fresh[0, 0, 0] /= np.sqrt(1 - a**2)  # it has been going on for ever
    found, last = np.empty_like(fresh), 0.0
    for part in range(parts):
        found[part] = (left @ fresh[part].T).T
        for block in found[part]:
            block += a * left[:, 0] * last
            last = float(block[-1])
    return found.ravel()


@lru_cache(maxsize=16)
def _weigh_past(a: float) -> Array:
    """The contribution of each point of a block to each other point, shape (256, 256)."""
    order = np.arange(_BLOCK)
    since = order[:, None] - order
    return np.where(since >= 0, (a ** order.astype(float))[np.abs(since)], 0.0)


def count_points(source: Gridded, duration: float) -> int:
    """Number of points of its grid that a run of ``duration`` [s] takes, one beyond the end with it."""
    return int(duration / source.interval * (1 + 1e-12)) + 2


def list_points(edges: Array, noises: Sequence[Gridded], duration: float) -> Array:
    """The points of the finest of these grids in a run, where they bend, among ``edges``; rising [s]."""
    if not noises:
        return edges
    finest = min(noises, key=lambda noise: noise.interval)
    points = finest.interval * np.arange(1, count_points(finest, duration) - 1)
    place = np.searchsorted(edges, points)
    beside = np.r_[-np.inf, edges, np.inf]
    alone = np.minimum(points - beside[place], beside[place + 1] - points) > _SAME * finest.interval
    return np.union1d(edges, points[alone])
