"""The prediction of the model's state after the delay: x_o(t + t_d) ≈ E_p (x_o, x_h)(t).

The model is run over the delay under the current hold (Gawthrop, Loram, Lakie and Gollee 2011).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icmj.base.array import Array
from icmj.base.balancing import compute_exponential
from icmj.controller.design import Design
from icmj.controller.hold import Hold
from icmj.errors import AnalysisError

_GROWTH = 36.0  # e³⁶: over a delay with more growth than that, rounding is as large as the state that is predicted


def make_predictor(design: Design, hold: Hold, delay: float, resets: Sequence[float] = ()) -> Array:
    """E_p, which takes (x_o, x_h, p_1 … p_r) to the state of the model after ``delay``.

    It is the first block row of expm([[Â, −B̂k̂], [0, A_h]] t_d), taken through resets x_h := p_j on the way.

    Args:
        design, hold: of the controller.
        delay: how far ahead [s].
        resets: when x_h will be reset to p_1 … p_r, rising, each less than ``delay`` [s].

    Returns:
        shape (n̂, (2 + r) n̂).

    Raises:
        AnalysisError: if the model or the hold grows so much over the delay that no digit of the prediction is right.
    """
    n, known = design.plant.n, 2 + len(resets)
    M = np.block([[design.plant.A, -design.plant.B @ design.k], [np.zeros((n, n)), hold.A_h]])
    expect_predictable(M, delay)
    state, now = np.eye(2 * n, known * n), 0.0
    for j, at in enumerate(resets):
        state = compute_exponential(M * (at - now)) @ state
        state[n:] = 0
        state[n:, (2 + j) * n : (3 + j) * n] = np.eye(n)
        now = at
    return np.asarray((compute_exponential(M * (delay - now)) @ state)[:n])


def expect_predictable(M: Array, delay: float) -> None:
    """Refuse to predict the motion of ẋ = M x over a delay [s] in which it grows by more than a number has digits.

    Raises:
        AnalysisError: if it does.
    """
    fastest = float(np.linalg.eigvals(M).real.max(initial=0.0))
    if fastest * delay > _GROWTH:
        raise AnalysisError(
            f"no prediction over a delay of {delay:g} s: the model grows e^{fastest * delay:.3g}-fold in it, which "
            "leaves no significant digit; assume a shorter delay"
        )
