"""How often a point would turn on a circle with the mean distance and the mean speed of a sway."""

import numpy as np

from icmj.measurement.measure import Definition, Signal, define_measure


@define_measure(
    "rotation_frequency", "rotation frequency", "Hz", standard=True,
    definitions=[Definition(
        "rotation frequency",
        r"mean speed / ($4\sqrt2$ mean distance); in a plane, mean speed / ($2\pi$ mean distance)",
        "Prieto 1996 (MFREQ)",
    )],
)  # fmt: skip
def rotation_frequency(signal: Signal) -> float:
    """Frequency of a rotation with this mean distance and speed [Hz]; NaN of what does not move.

    Of a coordinate it has the factor 4√2 as Prieto et al. printed it, and is 1.11 f for a sinusoid of frequency f.
    """
    distance, speed = float(signal.distance.mean()), signal.path / signal.duration
    turn = 2 * np.pi if signal.planar else 4 * np.sqrt(2)
    return float(speed / (turn * distance)) if distance > 0 else float("nan")


MEASURE = rotation_frequency
