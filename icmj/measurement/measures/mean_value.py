"""Where a coordinate is on average."""

from icmj.measurement.measure import Signal, define_measure


@define_measure("mean", "mean", "U", of=["coordinate"], standard=True)
def mean_value(signal: Signal) -> float:
    """Mean value of a coordinate [unit]."""
    return float(signal.mean)


MEASURE = mean_value
