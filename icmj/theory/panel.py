"""The panel: a stretch of Δ short enough that the test functions on it are Chebyshev polynomials."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.theory.chebyshev import coefficients
from icmj.theory.circle import KINDS, Kind, Spectrum, away, circle_function, once

DEGREE = 24
_QUIET = 1e-3  # last Chebyshev coefficients of the logarithm of a function without zeros nearby; a zero makes 1e-1


def series(g: Spectrum, delta: Array) -> dict[Kind, Array]:
    """Chebyshev coefficients of the test functions of the near eigenvalues on one panel; none where there are none."""
    if not g.shape[-1]:
        return {}
    g = once(g)
    return {kind: coefficients(DEGREE) @ circle_function(kind, g, delta) for kind in KINDS}


def quiet(g: Spectrum, delta: Array) -> bool:
    """Whether eigenvalues that are on one side of the circle at every node stay there between the nodes."""
    return not g.shape[-1] or bool(np.abs(away(g, delta) @ coefficients(DEGREE)[-3:].T).max() < _QUIET)


def tail(c: Array) -> float:
    return float(np.abs(c[-3:]).max() / np.abs(c).max())
