"""The root mean square of a sway about its mean."""

import numpy as np

from icmj.measurement.measure import Definition, Signal, define_measure


@define_measure(
    "rms", "RMS", "U", standard=True,
    definitions=[Definition(
        "RMS",
        r"$\sqrt{\frac1N\sum (x_i-\langle x_i\rangle)^2}$; in a plane, the RMS of the distance from the mean point",
        "Prieto 1996 (RDIST)",
    )],
)  # fmt: skip
def root_mean_square(signal: Signal) -> float:
    """Root mean square of the distance from the mean [unit]."""
    return float(np.sqrt((signal.distance**2).mean()))


MEASURE = root_mean_square
