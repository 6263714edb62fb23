"""The type of every array of real numbers, and how one is made of what somebody gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def real(given: ArrayLike, what: str, error: type[Exception]) -> Array:
    """A new array of real numbers; complex ones are taken if no imaginary part is there.

    Raises:
        error: if ``given`` is no array of numbers, or one has an imaginary part; the message begins with ``what``.
    """
    try:
        array = np.array(given)
        if np.iscomplexobj(array):
            if np.any(array.imag):
                raise error(
                    f"{what} is complex, with imaginary parts up to {np.abs(array.imag).max():.3g}; expected real"
                )
            array = array.real
        return np.array(array, dtype=float)
    except (TypeError, ValueError) as reason:
        raise error(f"{what} is not a matrix: rows differ in length, or hold what is no number") from reason
