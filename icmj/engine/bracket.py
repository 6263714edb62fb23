"""What the event function at both ends of a step tells of the step: whether it may hold a zero, and where."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.engine.schedule import EVENT_TOLERANCE

SPLITS = 64  # finest division of a step in which E is looked at before a near-touch counts as none


def any_may_reach_zero(E_0: Array, dE_0: Array, E_1: Array, dE_1: Array, step: float, margin: Array) -> bool:
    """Whether any face's E_j may reach zero inside the step; see :func:`may_reach_zero`."""
    faces = zip(E_0, dE_0, E_1, dE_1, margin, strict=True)
    return any(may_reach_zero(e_0, de_0, e_1, de_1, step, m) for e_0, de_0, e_1, de_1, m in faces)


def may_reach_zero(E_0: float, dE_0: float, E_1: float, dE_1: float, step: float, margin: float) -> bool:
    """Whether E, negative at the start, may reach zero *inside* the step and fall again, with E and dE/dt at both ends.

    The cubic Hermite interpolant's interior maximum is compared with zero, allowing for ``margin`` of error.
    """
    # H(s) = E_0 + dE_0 s + c s² + d s³
    c = (3 * (E_1 - E_0) / step - 2 * dE_0 - dE_1) / step
    d = (dE_0 + dE_1 - 2 * (E_1 - E_0) / step) / step**2
    disc = c * c - 3 * d * dE_0
    if disc <= 0:
        return False
    # of the two stationary points the maximum is where H'' = −2 √disc; this form of the root does not cancel
    root = np.sqrt(disc)
    s = dE_0 / (root - c) if c < 0 else (-c - root) / (3 * d) if d != 0 else -1.0
    if not 0 < s < step:
        return False
    return bool(E_0 + s * (dE_0 + s * (c + s * d)) + margin >= 0)


def hermite_root(low: float, E_l: float, dE_l: float, high: float, E_h: float, dE_h: float) -> float:
    """Root of the cubic Hermite interpolant of E between ``low`` (E < 0) and ``high`` (E ≥ 0)."""
    step = high - low
    c = (3 * (E_h - E_l) / step - 2 * dE_l - dE_h) / step
    d = (dE_l + dE_h - 2 * (E_h - E_l) / step) / step**2
    a, b = 0.0, step
    s = step * E_l / (E_l - E_h)
    for _ in range(50):
        value = E_l + s * (dE_l + s * (c + s * d))
        if value >= 0:
            b = s
        else:
            a = s
        slope = dE_l + s * (2 * c + s * 3 * d)
        new = s - value / slope if slope > 0 else -1.0
        if not a < new < b:
            new = (a + b) / 2
        if abs(new - s) <= 1e-15 * step:
            break
        s = new
    return low + max(s, 1e-3 * EVENT_TOLERANCE)
