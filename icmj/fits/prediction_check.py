"""Posterior predictive checks: do trials that a fitted controller would stand measure as the recorded ones do?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError
from icmj.fits.calibration import MASS


@dataclass(frozen=True, eq=False)
class Predictive:
    """Measures of single trials that the posterior predicts, with those of the recorded trials.

    Attributes:
        simulated: measures of one trial of each draw that stood, shape (n, m).
        low, high: ends of their central interval of 90 %, shape (m,).
        observed: of the recorded trials, shape (k, m).
        fell: share of the draws that did not stand.
    """

    simulated: Array
    low: Array
    high: Array
    observed: Array
    fell: float

    @property
    def inside(self) -> np.ndarray:
        """Whether the interval holds what was recorded, shape (k, m)."""
        return (self.observed >= self.low) & (self.observed <= self.high)


def check_prediction(stood: ArrayLike, draws: int, observed: ArrayLike) -> Predictive:
    """The check, of measures (n, m) of those of so many draws that stood.

    Raises:
        FitError: if they are fewer than twenty.
    """
    simulated, recorded = np.asarray(stood, dtype=float), np.atleast_2d(np.asarray(observed, dtype=float))
    if len(simulated) < 20:
        raise FitError(f"{len(simulated)} of {draws} draws of the posterior stood; expected at least 20")
    low, high = np.quantile(simulated, ((1 - MASS) / 2, (1 + MASS) / 2), axis=0)
    return Predictive(simulated, low, high, recorded, 1 - len(simulated) / draws)
