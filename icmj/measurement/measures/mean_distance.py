"""The mean distance of a sway from its mean."""

from icmj.measurement.measure import Definition, Signal, define_measure


@define_measure(
    "mean_distance", "mean distance", "U", standard=True,
    definitions=[Definition(
        "mean distance",
        r"$\frac1N\sum \lvert x_i-\langle x_i\rangle\rvert$; in a plane, the mean of the distance from the mean point",
        "Prieto 1996 (MDIST)",
    )],
)  # fmt: skip
def mean_distance(signal: Signal) -> float:
    """Mean distance from the mean [unit]."""
    return float(signal.distance.mean())


MEASURE = mean_distance
