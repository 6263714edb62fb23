"""What a network was shown: how summaries are scaled and pooled over trials, and whether a person's are among them.

A network says something of whatever it is given. Of summaries that no simulation had it knows nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError

_CUT = 6.0  # deviations up to which a network is shown a summary
_LEAST = 1e-8  # of the largest variance: directions with less are none, as shares of a histogram sum up to one
_RARE = 0.01  # share of simulations that lie as far out
_QUANTILES = 1001


@dataclass(frozen=True, eq=False)
class Misfit:
    """The distance of a person's summary statistics from those of all simulations.

    Attributes:
        outside: names of the summaries beyond every simulation.
        excess: how far beyond, in standard deviations of the simulations, by name.
        share: of simulations that lie at least as far from their mean, by Mahalanobis distance.
        distance: this distance.
        words: one line; empty where nothing is amiss.
    """

    outside: tuple[str, ...]
    excess: Mapping[str, float]
    share: float
    distance: float
    words: str

    def __bool__(self) -> bool:
        return bool(self.words)


@dataclass(frozen=True, eq=False)
class SeenSummaries:
    """The simulations' summaries, by the number k = 1 … K of trials that are averaged.

    Attributes:
        names: of the s summaries.
        centre, scale: median and robust standard deviation of single trials, shape (s,).
        low, high: least and largest mean over k trials, shape (K, s).
        mean: of these, shape (K, s).
        spread: their standard deviation, shape (K, s).
        whitening: makes of what is left of a mean, in units of ``scale``, uncorrelated parts of variance one; shape
            (K, s, s), with zeros where there is no direction.
        distances: quantiles 0, 0.1, …, 100 % of Mahalanobis distances, shape (K, 1001).
    """

    names: tuple[str, ...]
    centre: Array
    scale: Array
    low: Array
    high: Array
    mean: Array
    spread: Array
    whitening: Array
    distances: Array

    @classmethod
    def of(cls, S: ArrayLike, names: Sequence[str]) -> SeenSummaries:
        """The range and moments of the summary statistics of simulations (n, K, s).

        Raises:
            FitError: if they are not finite, or not of this shape.
        """
        given = np.asarray(S, dtype=float)
        if given.ndim != 3 or given.shape[2] != len(names) or len(given) < 2:
            raise FitError(f"summaries of shape {given.shape}; expected (draws, trials, {len(names)})")
        if not np.isfinite(given).all():
            raise FitError("summaries that are not finite")
        flat = given.reshape(-1, given.shape[2])
        low, centre, high = np.quantile(flat, (0.1587, 0.5, 0.8413), axis=0)
        deviation = flat.std(axis=0)
        scale = np.where(high > low, (high - low) / 2, deviation)
        scale = np.maximum(scale, 0.1 * deviation)  # where most are alike and few far away
        scale = np.where(scale > 0, scale, 1.0)
        parts = [cls._of_means(given[:, :k].mean(axis=1), centre, scale) for k in range(1, given.shape[1] + 1)]
        return cls(tuple(names), centre, scale, *(np.array(column) for column in zip(*parts, strict=True)))

    def refuse_unsound(self) -> None:
        """Check that this is what :meth:`of` gives, when it comes from a file.

        Raises:
            ValueError: if shapes, or values, cannot be.
        """
        s, K = len(self.names), len(self.low) if self.low.ndim else 0
        shapes = {"centre": (s,), "scale": (s,), "whitening": (K, s, s), "distances": (K, _QUANTILES)}
        for field in fields(self)[1:]:
            values, shape = getattr(self, field.name), shapes.get(field.name, (K, s))
            if values.shape != shape or not K or values.dtype != float or not np.isfinite(values).all():
                raise ValueError(f"seen.{field.name} of shape {values.shape} is not {shape} of finite numbers")
        reach = 1e-9 * (np.abs(self.low) + np.abs(self.high))
        sound = {
            "scale": self.scale > 0,
            "spread": self.spread >= 0,
            "mean": (self.mean >= self.low - reach) & (self.mean <= self.high + reach),
            "distances": np.diff(self.distances, prepend=0.0) >= 0,
        }
        wrong = [name for name, good in sound.items() if not good.all()]
        if wrong:
            raise ValueError(f"seen.{wrong[0]} holds what cannot be")

    @staticmethod
    def _of_means(means: Array, centre: Array, scale: Array) -> tuple[Array, ...]:
        scaled = (means - centre) / scale
        covariance = np.atleast_2d(np.cov(scaled.T))
        values, vectors = np.linalg.eigh(covariance)
        kept = values > _LEAST * max(float(values[-1]), 1e-30)
        whitening = vectors * np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
        distance = np.linalg.norm((scaled - scaled.mean(axis=0)) @ whitening, axis=1)
        quantiles = np.quantile(distance, np.linspace(0, 1, _QUANTILES))
        return means.min(axis=0), means.max(axis=0), means.mean(axis=0), means.std(axis=0), whitening, quantiles

    @property
    def trials(self) -> int:
        """The largest number of trials that a network was shown at once."""
        return len(self.low)

    def pool(self, S: ArrayLike) -> Array:
        """The conditions of a network, shape (n, s + 1), of summaries (n, k, s): their mean, and how many trials.

        Raises:
            FitError: if there are more trials than were simulated, or none.
        """
        given = np.asarray(S, dtype=float)
        if given.ndim != 3 or given.shape[2] != len(self.names):
            raise FitError(f"summaries of shape {given.shape}; expected (people, trials, {len(self.names)})")
        if not 1 <= given.shape[1] <= self.trials:
            raise FitError(f"{given.shape[1]} trials of a person; expected 1 to {self.trials}")
        return _pool(self.scaled(given), np.ones(given.shape[:2]))

    def draw_pooled(self, S: Array, generator: np.random.Generator) -> Array:
        """The conditions of simulations (n, K, s), each pooled over a random number of its trials."""
        n, K, _ = S.shape
        chosen = np.arange(K) < generator.integers(1, K + 1, n)[:, None]
        return _pool(self.scaled(S), generator.permuted(chosen, axis=1).astype(float))

    def scaled(self, S: Array) -> Array:
        """Summaries as networks are shown them."""
        return np.clip((S - self.centre) / self.scale, -_CUT, _CUT)

    def misfit(self, S: ArrayLike) -> Misfit:
        """Whether a person's trials (k, s) lie where something was simulated.

        Raises:
            FitError: if there are more trials than were simulated.
        """
        given = np.asarray(S, dtype=float)
        self.pool(given[None])
        k = len(given) - 1
        mean = given.mean(axis=0)
        beyond = np.maximum(mean - self.high[k], self.low[k] - mean)
        spread = np.where(self.spread[k] > 0, self.spread[k], self.scale)
        beyond = np.where(beyond > 1e-9 * spread, beyond / spread, 0.0)
        order = [i for i in np.argsort(-beyond) if beyond[i] > 0]
        distance = float(np.linalg.norm((mean - self.mean[k]) / self.scale @ self.whitening[k]))
        share = float(np.mean(self.distances[k] >= distance))
        excess = {self.names[i]: float(beyond[i]) for i in order}
        return Misfit(tuple(excess), excess, share, distance, self._words(mean, order, k, share))

    def _words(self, mean: Array, order: Sequence[int], k: int, share: float) -> str:
        if not order and share >= _RARE:
            return ""
        told = [
            f"{self.names[i]} {mean[i]:.3g} (simulated {self.low[k, i]:.3g} to {self.high[k, i]:.3g})"
            for i in order[:3]
        ]
        more = f", and {len(order) - 3} more" if len(order) > 3 else ""
        far = f"only {share:.1%}" if share > 0 else "none"
        where = f"; outside of everything simulated are {', '.join(told)}{more}" if order else ""
        return f"do not trust this fit, because {far} of the simulated people are as unusual{where}"


def _pool(scaled: Array, chosen: Array) -> Array:
    count = chosen.sum(axis=1)
    mean = np.einsum("nks,nk->ns", scaled, chosen) / count[:, None]
    return np.column_stack([mean, 1.5 * np.log(count) - 0.8])
