"""The real numbers that every floor computes with: their type, their bounds in files, and equality up to rounding."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le, Len
from numpy.typing import ArrayLike, NDArray

from icmj.base.text import one_line

Array = NDArray[np.float64]

# what a file may say: far beyond anything physical, and near enough to 1 for squares and products to be numbers
SMALLEST, LARGEST = 1e-15, 1e12
Positive = Annotated[float, Ge(SMALLEST), Le(LARGEST)]
NonNegative = Annotated[float, Ge(0), Le(LARGEST)]
Finite = Annotated[float, Ge(-LARGEST), Le(LARGEST)]
MOST_ENTRIES = 200  # of a list: more states, inputs or thresholds than can be computed with
Seed = Annotated[int, Ge(0), Le(2**63 - 1)]
Numbers = Annotated[list[Finite], Len(1, MOST_ENTRIES)]
Positives = Annotated[list[Positive], Len(1, MOST_ENTRIES)]
Matrix = Annotated[list[Numbers], Len(1, MOST_ENTRIES)]
Weight = Literal["output", "identity"] | Numbers | Matrix

RELATIVE_ROUNDING = 1e-9
"""How far numbers may be apart, relative to them, and count as equal: rounding, with room for other processors."""
_LAST_BITS = 16 * np.finfo(float).eps
"""How far an instant may be from itself, relative to it, as the sum or product of two others: 3 · 0.1 is not 0.3."""


def argmax_abs(values: NDArray[Any]) -> int:
    """Index of the first entry of largest magnitude; entries that are equal but for rounding count as equal.

    Where two are equal, as in an eigenvector (1, −1), the last bit of either would decide with ``argmax``.
    """
    size = np.abs(values)
    return int(np.argmax(size >= (1 - RELATIVE_ROUNDING) * size.max()))


def argsort_descending(keys: Array, *ties: Array) -> NDArray[np.int64]:
    """Indices that sort ``keys`` in descending order; keys that are equal but for rounding, by descending ``ties``."""
    order = np.argsort(-keys, kind="stable")
    size = np.abs(keys[order])
    apart = np.abs(np.diff(keys[order])) > RELATIVE_ROUNDING * size[:-1] + 1e-13 * size.max(initial=0.0)
    group = np.zeros(len(keys), int)
    group[order[1:]] = np.cumsum(apart)
    return np.lexsort((*(-tie for tie in reversed(ties)), group))


def is_between(values: ArrayLike, low: float, high: float = np.inf) -> NDArray[np.bool_]:
    """Mask of the values from ``low`` to ``high``, both included, though rounding may have moved them a bit outside."""
    values = np.asarray(values, dtype=float)
    return np.asarray((values >= low - RELATIVE_ROUNDING * abs(low)) & (values <= high + RELATIVE_ROUNDING * abs(high)))


def count_steps(count: ArrayLike) -> Any:
    """Whole steps in ``count`` of them, as integers; one that is whole but for rounding is: in 0.3 / 0.1 are three."""
    count = np.asarray(count, dtype=float)
    found = np.floor(count + RELATIVE_ROUNDING * np.maximum(np.abs(count), 1.0)).astype(np.int64)
    return int(found) if found.ndim == 0 else found


def list_multiples(step: float, end: float, first: int = 0) -> Array:
    """The multiples of ``step`` from ``first`` times it to ``end``, which is one of them if it is but for rounding."""
    return np.asarray(step * np.arange(first, count_steps(end / step) + 1, dtype=float))


def at_or_after(t: Array | float, start: Array | float) -> NDArray[np.bool_]:
    """Mask of the instants from ``start`` ≥ 0 on, up to the last bits; one that is just before it is told apart."""
    return np.asarray(t >= start * (1 - _LAST_BITS))


def agree(matrices: Iterable[Array], others: Iterable[Array]) -> bool:
    """Whether matrices have the shapes of others and, to rounding, the same numbers."""
    pairs = zip(matrices, others, strict=True)
    return all(a.shape == b.shape and bool(np.allclose(a, b, rtol=RELATIVE_ROUNDING, atol=1e-12)) for a, b in pairs)


def find_range(values: Array) -> tuple[float, float]:
    """The range of a histogram of some values; where they are equal but for rounding, as wide as they are large."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low > RELATIVE_ROUNDING * size:
        return low, high
    half, middle = size / 2 or 0.5, (low + high) / 2
    return middle - half, middle + half


def real(given: ArrayLike, what: str, error: type[Exception]) -> Array:
    """A new array of real numbers; complex numbers are accepted if their imaginary parts are zero.

    Raises:
        error: if ``given`` is no array of numbers, as truth and text are not, or one has an imaginary part; the message
            begins with ``what``.
    """
    try:
        array = np.array(given)
        # a list of both becomes an array of numbers
        each = [array.dtype.type()] if isinstance(given, np.ndarray) else np.array(given, dtype=object).flat
        if any(isinstance(value, bool | np.bool_ | str | bytes) for value in each):
            raise TypeError
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


def as_naturals(given: object, what: str, error: type[Exception]) -> NDArray[np.int64]:
    """A vector of whole numbers from 0 to 2⁶³ − 1, or of one such number.

    Raises:
        error: at the first entry that is none, as truth and 1.0 are not; the message begins with ``what``.
    """
    numbers = given.tolist() if isinstance(given, np.ndarray) else given
    each = list(numbers) if isinstance(numbers, Iterable) else [numbers]
    for number in each:
        if isinstance(number, bool) or not isinstance(number, Integral) or not 0 <= int(number) < 2**63:
            raise error(f"{what}: {one_line(repr(number), 60)}; expected a whole number from 0 to 2^63 − 1")
    return np.array(each, dtype=np.int64)
