"""How far apart the largest and the smallest value of a coordinate are."""

import numpy as np

from icmj.measurement.measure import Definition, Signal, define_measure


@define_measure(
    "range", "range", "U", of=["coordinate"], standard=True,
    definitions=[Definition("range", r"$\max x_i - \min x_i$", "Prieto 1996 (RANGE)")],
)  # fmt: skip
def peak_to_peak(signal: Signal) -> float:
    """Largest minus smallest value of a coordinate [unit]."""
    return float(np.ptp(signal.values))


MEASURE = peak_to_peak
