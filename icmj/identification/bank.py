"""Simulated motions at many values of the unknown, with different noise seeds, for likelihood-free inference.

The synthetic likelihood of Wood (2010), Nature 466:1102-1104: near each value the summaries of simulated motions are
assumed to be normal, with the mean and the covariance of a local linear regression, and with Student's distribution,
because there are few of them (Sellentin & Heavens 2016, MNRAS 456:L132-L136).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind, simulate
from icmj.errors import IcmjError, IdentificationError
from icmj.identification.observed import Observed
from icmj.identification.summaries import summaries
from icmj.identification.unknown import Unknown
from icmj.simulation.simulation import Simulation

GRID = 201
_COARSE = 51  # values at which the nearest is sought
_TAIL = 0.2  # part of the simulated motions, the furthest, from which it is told how rare one further still is
_WIDTH = 0.07  # of the range: the neighbourhood of the regression


@dataclass(frozen=True, eq=False)
class Bank:
    """Simulated motions for comparison with an observed one.

    Attributes:
        low, high: range from which the unknown was drawn.
        values: values of the unknown, shape (N,).
        told: summary statistics of the motions, shape (N, d).
        least, reference: arguments of :func:`icmj.identification.summaries.summaries` [s].
    """

    low: float
    high: float
    values: Array
    told: Array
    least: float
    reference: float

    def posterior(self, observed: Observed) -> tuple[Array, Array]:
        """Values and their posterior probability density, for a uniform prior.

        Raises:
            IdentificationError: if the observation is too short.
        """
        seen = self._seen(observed)
        grid = np.linspace(self.low, self.high, GRID)
        log = np.array([self._log_likelihood(value, seen) for value in grid])
        density = np.exp(log - log.max())
        return grid, density / np.trapezoid(density, grid)

    def probability(self, observed: Observed) -> float:
        """Probability that a motion of the run file, at any value, agrees less well with its best value.

        It follows from the simulated motions themselves, each compared with all others: the share with a larger
        distance; beyond four fifths of them, a power law that is fitted to the largest distances gives it (Hill 1975,
        Ann. Stat. 3:1163-1174).

        Raises:
            IdentificationError: if the observation is too short.
        """
        gap = self._gap(self._seen(observed))
        begin = float(np.quantile(self._gaps, 1 - _TAIL))
        if gap <= begin:
            return float(np.mean(self._gaps >= gap))
        slope = float(np.mean(np.log(self._gaps[self._gaps > begin] / begin)))
        return float(_TAIL * (gap / begin) ** (-1 / slope))

    @cached_property
    def _gaps(self) -> Array:
        """The distance of each simulated motion from the prediction of the others at the value that fits it best."""
        return np.array([self._gap(told, without=i) for i, told in enumerate(self.told)])

    def _gap(self, seen: Array, without: int | None = None) -> float:
        grid = np.linspace(self.low, self.high, _COARSE)
        return min(self._distance(float(value), seen, without)[0] for value in grid)

    def _seen(self, observed: Observed) -> Array:
        seen = summaries(observed, self.least, self.reference)
        if seen is None:
            raise IdentificationError("too short to tell under noise; observe longer")
        return seen

    def _log_likelihood(self, value: float, seen: Array) -> float:
        distance, spread, count = self._distance(value, seen)
        # Student's distribution for a covariance that is itself estimated
        return -0.5 * spread - 0.5 * count * float(np.log1p(distance / (count - 1)))

    def _distance(self, value: float, seen: Array, without: int | None = None) -> tuple[float, float, float]:
        """Squared distance in local covariances, the logarithm of their determinant, and of how many motions it is."""
        away = (self.values - value) / (_WIDTH * (self.high - self.low))
        weight = np.exp(-0.5 * away**2)
        if without is not None:
            weight[without] = 0.0
        design = np.column_stack([np.ones_like(away), away])
        root = np.sqrt(weight)[:, None]
        fitted = np.linalg.lstsq(design * root, self.told * root, rcond=None)[0]
        rest = self.told - design @ fitted
        count = weight.sum() ** 2 / np.sum(weight**2)
        S = (rest * weight[:, None]).T @ rest / weight.sum() * count / max(count - 2, 1.0)
        S += 1e-9 * np.trace(S) / len(S) * np.eye(len(S)) + 1e-12 * np.eye(len(S))
        gap = seen - fitted[0]
        return float(gap @ np.linalg.solve(S, gap)), float(np.linalg.slogdet(S)[1]), float(count)


def bank(
    unknown: Unknown,
    observed: Observed,
    plant: PlantKind = "linear",
    *,
    size: int = 240,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Bank:
    """Simulate motions of the observed duration at ``size`` values of the unknown.

    Args:
        unknown: the unknown parameter; its run file contains the noise.
        observed: the observed motion.
        plant: the plant on which motions are simulated.
        size: number of motions.
        seed: seed of values and noise.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        IdentificationError: if hardly any of them can be compared: the person falls, or there are no events.
    """
    middle = unknown.checked()
    least = middle.controller.least
    reference = middle.prediction.delta_crit or float(np.median(observed.intervals) if len(observed.times) else 1.0)
    random = np.random.default_rng(seed)
    spread = (np.arange(size) + random.random(size)) / size  # one in each of so many equal parts
    values = unknown.low + (unknown.high - unknown.low) * spread
    sources = len(unknown.run.simulation.disturbance)
    seeds = random.integers(0, 2**31, (size, sources))
    kept, told = [], []
    like: Case | None = middle
    for i, value in enumerate(values):
        changes = {
            f"simulation.disturbance[{j}].seed": int(seeds[i, j])
            for j in range(sources)
            if unknown.run.simulation.disturbance[j].kind in ("noise", "gaussian")
        }
        case = unknown.case(float(value), like, **{"simulation.duration": observed.duration, **changes})
        found = None if case is None else _told(case, plant, observed, least, reference, int(seeds[i].sum()) + i)
        if found is not None and np.isfinite(found).all():
            kept.append(value)
            told.append(found)
        like = case or like
        if progress is not None:
            progress((i + 1) / size)
    if len(kept) < max(40, size // 4):
        raise IdentificationError(
            f"of {size} simulated motions only {len(kept)} can be compared with the one observed; narrow the range, or "
            "see that the run file describes it (threshold, noise, duration)"
        )
    return Bank(unknown.low, unknown.high, np.array(kept), np.array(told), least, reference)


def _told(case: Case, plant: PlantKind, observed: Observed, least: float, reference: float, seed: int) -> Array | None:
    try:
        run = simulate(case, plant)
    except IcmjError:
        return None
    if run.outcome.kind not in ("completed", "sliding"):
        return None
    return summaries(seen_alike(run, observed, seed), least, reference)


def seen_alike(run: Simulation, observed: Observed, seed: int = 0) -> Observed:
    """A simulated run reduced to the observed quantities, with errors of times and readings of the observed size."""
    random = np.random.default_rng(seed)
    timing, reading = observed.timing or 0.0, observed.reading or 0.0
    if len(observed.t):
        t = observed.t - observed.t[0]
        at = t + timing * random.standard_normal(len(t))
        y = np.column_stack([np.interp(at, run.t, column) for column in run.y.T[: observed.y.shape[1]]])
        y += reading * random.standard_normal(y.shape)
        return replace(observed, t=t, y=y, begin=0.0)
    seen = Observed.of_simulation(run)
    outputs = seen.outputs[:, : observed.outputs.shape[1]]
    times, step = seen.times, observed.resolution
    if timing:
        times = np.sort(times + timing * random.standard_normal(len(times)))
    elif step:
        times = np.round(times / step) * step
    outputs = outputs + reading * random.standard_normal(outputs.shape)
    return replace(observed, times=times, outputs=outputs, begin=0.0)
