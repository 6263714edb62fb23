"""The arrays of real numbers that every floor computes with.

Their type, the conversion of arguments to it, the bounds of numbers in files, and small operations on them.
"""

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
SEMIDEFINITE = 1e-12
"""How far below zero an eigenvalue of :func:`compute_balanced_modes` may lie, by rounding, where none is negative."""
_ROUNDS = 8  # each halves the decades by which the largest entry of a row or column differs from 1
_TERMS = 20  # of the Taylor series of an exponential whose exponent is at most 1
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


def compute_balanced_modes(W: Array) -> tuple[Array, Array, Array]:
    """Scales s, eigenvalues λ and eigenvectors V of a symmetric matrix in the units of its diagonal, W = S V Λ VᵀS.

    There Λ does not depend on the units of the coordinates, so a weight that is small only by its unit is not lost in
    the rounding of others; its smallest entry tells whether W is semidefinite. S = diag(s), Λ = diag(λ).

    Args:
        W: shape (n, n).

    Returns:
        s, λ in ascending order and V by columns; shapes (n,), (n,), (n, n).
    """
    diagonal = np.abs(np.diag(W))
    scales = np.sqrt(np.where(diagonal > 0, diagonal, np.abs(W).max(initial=0.0) or 1.0))
    return scales, *np.linalg.eigh(W / scales / scales[:, None])


def choose_units(M: Array) -> tuple[Array, Array]:
    """Factors of rows and columns of M ≥ 0 that make its entries alike, whatever units it is given in; (m,) and (n,).

    They make the squared logarithms of all entries but zeros least (Curtis, Reid 1972), and then no entry larger
    than 1.
    """
    m = len(M)
    there = M > 0
    counts = np.block([[np.diag(there.sum(axis=1)), there], [there.T, np.diag(there.sum(axis=0))]])
    sizes = np.log(M, out=np.zeros(M.shape), where=there)
    factors = np.linalg.lstsq(counts, -np.concatenate([sizes.sum(axis=1), sizes.sum(axis=0)]), rcond=None)[0]
    left, right = np.exp(factors[:m]), np.exp(factors[m:])
    for _ in range(_ROUNDS):
        largest = (left[:, None] * M * right).max(axis=1)
        left = left / np.sqrt(np.where(largest > 0, largest, 1.0))
        largest = (left[:, None] * M * right).max(axis=0)
        right = right / np.sqrt(np.where(largest > 0, largest, 1.0))
    return left, right


def balance(M: Array, least: float = 0.0) -> tuple[Array, Array]:
    """S⁻¹ M S with rows and columns of like norms, and the diagonal of S: powers of two, so that no digit is lost.

    LAPACK passes over a row or column of zeros, such as an end of a chain of integrators has. What only acts on a part
    that does not act back has no rate, and its size is a matter of units: it is made no larger than what acts both
    ways, or than ``least`` where that is larger.

    Args:
        M: shape (N, N).
        least: in the unit of M; with 0, there is no such bound where nothing acts both ways.

    Returns:
        S⁻¹ M S and the diagonal of S, shapes (N, N) and (N,).
    """
    from scipy.linalg import matrix_balance

    with np.errstate(invalid="ignore"):  # scales beyond integers, among which SciPy seeks a permutation
        balanced, (scale, _) = matrix_balance(M, permute=False, separate=True)
    acts = _acts(M)
    both = acts & acts.T
    size = np.abs(balanced)
    own = max(float(size[both].max(initial=0.0)), least)
    if own > 0 and size.max(initial=0.0) > own:
        one_way, part = np.where(both, 0.0, size / own), np.ones(len(M))
        for _ in range(len(M)):  # along any chain of parts
            reached = np.exp2(np.ceil(np.log2(np.maximum((one_way * part).max(axis=1), 1.0))))
            part = np.where(both, reached, 1.0).max(axis=1)  # the states of a part together
        balanced, scale = balanced * part / part[:, None], scale * part
    return np.asarray(balanced), np.asarray(scale)


def _acts(M: Array) -> NDArray[np.bool_]:
    """Whether each state (row) is acted on by each other, itself included, by whatever way."""
    acts = np.eye(len(M)) + (M != 0)
    for _ in range(len(M).bit_length()):  # as numbers, which BLAS multiplies; truth it does not
        acts = np.minimum(acts @ acts, 1.0)
    return np.asarray(acts > 0)


def compute_exponential(M: Array) -> Array:
    """e^M, balanced first: where states differ by orders of magnitude, SciPy alone loses many digits.

    What does not act on a state, by no way through others, keeps an exact zero: round-off of x must not leak into d.
    """
    from scipy.linalg import expm

    balanced, scale = balance(M, 1.0)
    return np.where(_acts(M), expm(balanced) * (scale[:, None] / scale), 0.0)


def propagate(A: Array, x: Array, t: Array) -> Array:
    """e^(A tᵢ) xᵢ for each of several states after a time of its own [s]; shapes (n, n), (N, n), (N,) → (N, n).

    Whole multiples of 1/‖A‖ are steps of powers of two, the same for all; the rest is a Taylor series.
    """
    balanced, scale = balance(A, 1.0 / max(float(t.max(initial=0.0)), np.finfo(float).tiny))
    rate = float(np.linalg.norm(balanced, 2))
    unit = 1.0 / rate if rate > 0 else np.inf
    whole, rest = np.divmod(t, unit)
    part = result = x / scale
    for order in range(1, _TERMS):
        part = part @ balanced.T * (rest / order)[:, None]
        result = result + part
    step: Array | None = None
    while whole.any():
        step = compute_exponential(balanced * unit) if step is None else step @ step
        odd = whole % 2 == 1
        result[odd] = result[odd] @ step.T
        whole = np.floor(whole / 2)
    return np.asarray(result * scale)


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
