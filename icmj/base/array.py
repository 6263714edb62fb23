"""The type of every array of real numbers, and the conversion of arguments to it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SAME = 1e-9
"""How far numbers may be apart, relative to them, and count as equal: rounding, with room for other processors."""


def leading(values: NDArray[Any]) -> int:
    """Index of the first entry of largest magnitude; entries that are equal but for rounding count as equal.

    Where two are equal, as in an eigenvector (1, −1), the last bit of either would decide with ``argmax``.
    """
    size = np.abs(values)
    return int(np.argmax(size >= (1 - SAME) * size.max()))


def falling(keys: Array, *ties: Array) -> NDArray[np.int64]:
    """Indices that sort ``keys`` in descending order; keys that are equal but for rounding, by descending ``ties``."""
    order = np.argsort(-keys, kind="stable")
    size = np.abs(keys[order])
    apart = np.abs(np.diff(keys[order])) > SAME * size[:-1] + 1e-13 * size.max(initial=0.0)
    group = np.zeros(len(keys), int)
    group[order[1:]] = np.cumsum(apart)
    return np.lexsort((*(-tie for tie in reversed(ties)), group))


def real(given: ArrayLike, what: str, error: type[Exception]) -> Array:
    """A new array of real numbers; complex numbers are accepted if their imaginary parts are zero.

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
        raise error(
            f"{what} is not a matrix: rows differ in length, or contain a value that is not a number"
        ) from reason
