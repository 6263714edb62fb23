"""The mean speed of a sway: the length of its path divided by the duration."""

from icmj.measurement.measure import Definition, Signal, define_measure


@define_measure(
    "speed", "mean speed", "U/s", standard=True,
    definitions=[Definition(
        "mean speed",
        r"$\frac{f_s}N\sum \lvert x_{i+1}-x_i\rvert$; in a plane, the length of the path divided by $N/f_s$",
        "Prieto 1996 (MVELO)",
    )],
)  # fmt: skip
def mean_speed(signal: Signal) -> float:
    """Length of the path divided by the duration [unit/s]."""
    return signal.path / signal.duration


MEASURE = mean_speed
