"""The matrix exponential with balancing, for badly scaled states."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array


def exponential(M: Array) -> Array:
    """e^M, balanced first: where states differ by orders of magnitude, SciPy alone loses two digits.

    What does not act on a state, by no way through others, keeps an exact zero: round-off of x must not leak into d.
    """
    from scipy.linalg import expm, matrix_balance

    balanced, (scale, _) = matrix_balance(M, permute=False, separate=True)
    acts = np.eye(len(M), dtype=bool) | (M != 0)
    for _ in range(len(M).bit_length()):
        acts = acts @ acts
    return np.where(acts, expm(balanced) * (scale[:, None] / scale), 0.0)
