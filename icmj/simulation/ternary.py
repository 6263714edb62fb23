"""An integrated pseudo-random ternary sequence as its spectral lines."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array, count_steps
from icmj.controller.setpoint import TERNARY_INTERVALS, ternary
from icmj.errors import SimulationError

_MOST_LINES = 20000


def make_ternary_lines(size: float, interval: float, highest: float) -> Array:
    """The lines of an integrated pseudo-random ternary sequence, without its mean.

    Args:
        size: of the sequence from peak to peak.
        interval: between its corners [s]; it repeats after 242 of them.
        highest: frequency of the last line [Hz].

    Returns:
        (a, ω, φ) of each a cos(ωt + φ) that is not zero, shape (L, 3).

    Raises:
        SimulationError: if there are too many lines.
    """
    period = TERNARY_INTERVALS * interval
    if not highest * period <= _MOST_LINES:
        raise SimulationError(
            f"ternary: {highest * period:.3g} lines up to {highest:g} Hz; expected at most {_MOST_LINES}; give a lower "
            "bandwidth or a shorter interval"
        )
    slopes = ternary(size, interval, 0.0, period)
    k = np.arange(1, count_steps(highest * period) + 1)
    omega = 2 * np.pi * k / period
    # of a periodic path with slopes v_j from t_j to t_j': c_k = Σ v_j (e^{−iωt_j'} − e^{−iωt_j}) / (ω² T)
    turns = np.exp(-1j * np.outer(omega, slopes[:, 4])) - np.exp(-1j * np.outer(omega, slopes[:, 3]))
    c = (turns @ slopes[:, 0]) / (period * omega**2)
    there = np.abs(c) > 1e-12 * np.abs(c).max(initial=0.0)
    return np.column_stack([2 * np.abs(c), omega, np.angle(c)])[there]
