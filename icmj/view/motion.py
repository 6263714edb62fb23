"""A motion in the quantities that pictures show: outputs against their rates, the state x̄ and its modes χ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.measurement.measurement import reduced_states
from icmj.plant.linear_plant import transformation
from icmj.result.result import Result
from icmj.result.tried import Tried


def output_rate(result: Result | Tried, x: Array, u: Array) -> Array:
    """ẏ = C(Ax + Bu) of the linearised actual plant; shapes (..., n), (..., n_u) → (..., n_y)."""
    plant = result.actual
    return x @ (plant.C @ plant.A).T + u @ (plant.C @ plant.B).T


def reduced(result: Result, x: Array, x_o: Array, x_h: Array) -> Array:
    """x̄ = (x, x_o − T̂x), from event to event the whole state; shapes (..., n), (..., n̂), (..., n̂) → (..., n + n̂).

    With a delay x_h − T̂x belongs to it: (..., n + 2n̂).
    """
    delayed = x_h if result.simulation.delay else None
    return reduced_states(x, x_o, transformation(result.assumed, result.actual), delayed)


def modes(result: Result, x_bar: Array) -> NDArray[np.complex128]:
    """χ = V⁻¹x̄ (eq. chi), the critical mode first; shape (..., n + n̂). Only where the prediction has V⁻¹.

    A mode is real if its eigenvalue is, as the critical one is; of a complex pair the real part is one phase.
    """
    V_inv = result.prediction.V_inv
    assert V_inv is not None
    return x_bar @ V_inv.T
