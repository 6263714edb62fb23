"""Calibration: whether posteriors say of synthetic people, whose numbers are known, what is true of them.

Simulation-based calibration (Talts et al. 2018): people are drawn from the prior, their trials simulated, their
posteriors drawn. A true number's rank among its draws is then uniform, and an interval of 90 % holds it in nine of ten.
How much narrower the posterior is than the prior says whether there is anything in the data about a number at all: one
that the data do not tell has a calibrated posterior, its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError

IDENTIFIED = 0.5
"""Contraction from which a number is called identified: the posterior's variance is at most half of the prior's."""
MASS = 0.9
_REFUSED = 0.01  # p-value, for each number: rather one too many is refused
_BELIEVED = 0.05  # how far from 90 % the coverage of an identified number may be
_LEAST_PEOPLE = 20  # people


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibration of p numbers over n synthetic people.

    Attributes:
        names: of the numbers.
        ranks: share of the draws below the truth, shape (n, p).
        p_values: that ranks as uneven, or a coverage as far from 90 %, arise from calibrated posteriors: the smaller of
            Kolmogorov's test of the ranks and the binomial test of the coverage, doubled; shape (p,).
        coverage: share of people whose central interval of 90 % holds the truth, shape (p,).
        coverage_low, coverage_high: its confidence interval of 95 % (Clopper and Pearson).
        contraction: 1 − mean variance of the posteriors / variance of the prior, shape (p,); 1 is all, 0 nothing.
        bias: mean of (posterior's mean − truth) / posterior's deviation, shape (p,).
        correlation: of the posterior's mean with the truth, shape (p,).
        verdicts: ``identified``, ``not identified`` or ``not calibrated``, each.
    """

    names: tuple[str, ...]
    ranks: Array
    p_values: Array
    coverage: Array
    coverage_low: Array
    coverage_high: Array
    contraction: Array
    bias: Array
    correlation: Array
    verdicts: tuple[str, ...]

    @property
    def identified(self) -> tuple[str, ...]:
        """Names of the numbers that the data tell, with intervals that can be believed."""
        return tuple(n for n, verdict in zip(self.names, self.verdicts, strict=True) if verdict == "identified")

    def judge(self, contraction: Array) -> tuple[str, ...]:
        """The verdicts on the numbers of one person, by the contraction of that person's own posterior, shape (p,).

        What is identified of most people is not of one whose recordings leave it as wide as before.
        """
        pairs = zip(self.verdicts, contraction, strict=True)
        return tuple("not identified" if v == "identified" and own < IDENTIFIED else v for v, own in pairs)

    def expected(self, masses: ArrayLike) -> Array:
        """Share of people whose central intervals of these masses hold the truth, shape (len(masses), p)."""
        wide = np.abs(2 * self.ranks - 1)
        return np.array([(wide <= mass).mean(axis=0) for mass in np.atleast_1d(masses)])


def calibrate(z: ArrayLike, draws: ArrayLike, names: Sequence[str], spread: ArrayLike = 1.0) -> Calibration:
    """Compare posteriors with the truth.

    A number is ``not calibrated`` if its p-value is below 1 %; else ``not identified`` if its contraction is below
    ``IDENTIFIED``; else ``identified`` if its coverage is between 85 and 95 %, and ``not calibrated`` if it is not.

    Args:
        z: true numbers of n people, shape (n, p).
        draws: from the posterior of each, shape (n, draws, p).
        names: of the numbers.
        spread: standard deviation of the prior; one, of what is standard normal.

    Raises:
        FitError: if there are fewer than twenty people, or shapes do not fit.
    """
    from scipy.stats import beta, binom, kstest

    truth, drawn = np.asarray(z, dtype=float), np.asarray(draws, dtype=float)
    n, p = truth.shape
    if drawn.ndim != 3 or drawn.shape[::2] != (n, p) or p != len(names) or drawn.shape[1] < 19:
        raise FitError(f"draws of shape {drawn.shape}; expected ({n}, at least 19, {len(names)})")
    if n < _LEAST_PEOPLE:
        raise FitError(f"{n} people to calibrate with; expected at least {_LEAST_PEOPLE}")
    L = drawn.shape[1]
    ranks = ((drawn < truth[:, None]).sum(axis=1) + 0.5) / (L + 1)
    held = (np.abs(2 * ranks - 1) <= MASS).sum(axis=0)
    inside = int((np.abs(2 * (np.arange(L + 1) + 0.5) / (L + 1) - 1) <= MASS).sum()) / (L + 1)  # of so many draws
    uneven = np.array([kstest(column, "uniform").pvalue for column in ranks.T])
    tails = np.minimum(binom.cdf(held, n, inside), binom.sf(held - 1, n, inside))
    p_values = np.minimum(2 * np.minimum(uneven, np.minimum(2 * tails, 1.0)), 1.0)
    mean, deviation = drawn.mean(axis=1), drawn.std(axis=1)
    contraction = 1 - (deviation**2).mean(axis=0) / np.broadcast_to(np.square(spread), p)
    believed = np.abs(held / n - MASS) <= _BELIEVED + 1e-9  # a share that is 95 % but for rounding is
    verdicts = tuple(
        "not calibrated"
        if worth < _REFUSED or (told >= IDENTIFIED and not close)
        else ("identified" if told >= IDENTIFIED else "not identified")
        for worth, told, close in zip(p_values, contraction, believed, strict=True)
    )
    return Calibration(
        tuple(names),
        ranks,
        p_values,
        held / n,
        np.where(held > 0, beta.ppf(0.025, held, n - held + 1), 0.0),
        np.where(held < n, beta.ppf(0.975, held + 1, n - held), 1.0),
        contraction,
        ((mean - truth) / np.maximum(deviation, 1e-12)).mean(axis=0),
        np.array([_correlation(a, b) for a, b in zip(mean.T, truth.T, strict=True)]),
        verdicts,
    )


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / size) if size > 0 else 0.0
