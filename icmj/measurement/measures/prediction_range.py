"""The width of the interval about the mean that holds a further value with a probability of 95 %."""

import numpy as np

from icmj.base.array import Array
from icmj.measurement.measure import Definition, Signal, define_measure

LEVEL = 0.95


@define_measure(
    "prediction_range", "prediction range", "U", of=["coordinate"], standard=True,
    definitions=[Definition(
        "95 % prediction range",
        r"$2\,t_{0.975,N-1}\,\sigma_x\sqrt{1+1/N}$: the width of the range that contains a further value with a "
        r"probability of 95 %; $\sigma_x$ is the standard deviation",
        "Schubert & Kirchner 2014",
    )],
)  # fmt: skip
def of_signal(signal: Signal) -> float:
    """Width of the 95 % prediction interval of a coordinate [unit]."""
    return prediction_range(signal.about)


def prediction_range(values: Array, level: float = LEVEL) -> float:
    """Width of the interval about the mean that holds a further value with probability ``level``: 2 t s √(1 + 1/N).

    Values are taken as independent: of a record that is not much longer than the memory of its motion, fewer further
    ones lie in it.

    Args:
        values: shape (N,), N > 1, normally distributed.
        level: probability.
    """
    from scipy.special import stdtrit

    N = len(values)
    return float(2 * stdtrit(N - 1, (1 + level) / 2) * values.std(ddof=1) * np.sqrt(1 + 1 / N))


MEASURE = of_signal
