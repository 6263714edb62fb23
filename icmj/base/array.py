"""Arrays of real numbers: their type, polynomials on them, and arrays and tables from untrusted files.

The type of every array of real numbers, and the conversion of arguments to it; numbers with the bounds of files.

Polynomials on [0, 1] in Bernstein form: the matrices that lead to it and halve it.

A polynomial lies in the convex hull of its Bernstein coefficients, so these bound it without sampling it; halving
the interval makes the bound converge quadratically. Points of R^r work alike: the norm of a polynomial curve is at
most the largest norm of its control points. That is how a whole integration step is decided at once. First roots and
extremes are found so in compiled code (:mod:`icmj.base.roots`), and here the maxima of many polynomials at once.

Arrays from an untrusted npz file: without pickles, within bounds, with one kind of error.

Tables from untrusted Parquet files: within bounds, with one kind of error.

A few kilobytes may stand for gigabytes: repeated values take no room in a file. What a file says of its sizes is
checked before anything is read, and what is read is counted.
"""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import comb
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal

import numpy as np
from annotated_types import Ge, Le, Len
from numpy.typing import ArrayLike, NDArray

from icmj.base.files import open_file
from icmj.base.process import run_bounded
from icmj.base.text import one_line

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

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
"""How far below zero an eigenvalue of :func:`balanced_modes` may lie, by rounding, for a semidefinite matrix."""
_LAST_BITS = 16 * np.finfo(float).eps
"""How far an instant may be from itself, relative to it, as the sum or product of two others: 3 · 0.1 is not 0.3."""


def leading(values: NDArray[Any]) -> int:
    """Index of the first entry of largest magnitude; entries that are equal but for rounding count as equal.

    Where two are equal, as in an eigenvector (1, −1), the last bit of either would decide with ``argmax``.
    """
    size = np.abs(values)
    return int(np.argmax(size >= (1 - RELATIVE_ROUNDING) * size.max()))


def falling(keys: Array, *ties: Array) -> NDArray[np.int64]:
    """Indices that sort ``keys`` in descending order; keys that are equal but for rounding, by descending ``ties``."""
    order = np.argsort(-keys, kind="stable")
    size = np.abs(keys[order])
    apart = np.abs(np.diff(keys[order])) > RELATIVE_ROUNDING * size[:-1] + 1e-13 * size.max(initial=0.0)
    group = np.zeros(len(keys), int)
    group[order[1:]] = np.cumsum(apart)
    return np.lexsort((*(-tie for tie in reversed(ties)), group))


def between(values: ArrayLike, low: float, high: float = np.inf) -> NDArray[np.bool_]:
    """Mask of the values from ``low`` to ``high``, both included, though rounding may have moved them a bit outside."""
    values = np.asarray(values, dtype=float)
    return np.asarray((values >= low - RELATIVE_ROUNDING * abs(low)) & (values <= high + RELATIVE_ROUNDING * abs(high)))


def steps_in(count: ArrayLike) -> Any:
    """Whole steps in ``count`` of them, as integers; one that is whole but for rounding is: in 0.3 / 0.1 are three."""
    count = np.asarray(count, dtype=float)
    found = np.floor(count + RELATIVE_ROUNDING * np.maximum(np.abs(count), 1.0)).astype(np.int64)
    return int(found) if found.ndim == 0 else found


def instants(step: float, end: float, first: int = 0) -> Array:
    """The multiples of ``step`` from ``first`` times it to ``end``, which is one of them if it is but for rounding."""
    return np.asarray(step * np.arange(first, steps_in(end / step) + 1, dtype=float))


def since(t: Array | float, start: Array | float) -> NDArray[np.bool_]:
    """Mask of the instants from ``start`` ≥ 0 on, up to the last bits; one that is just before it is told apart."""
    return np.asarray(t >= start * (1 - _LAST_BITS))


def extent(values: Array) -> tuple[float, float]:
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


def balanced_modes(W: Array) -> tuple[Array, Array, Array]:
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


def naturals(given: object, what: str, error: type[Exception]) -> NDArray[np.int64]:
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


@lru_cache(maxsize=64)
def from_powers(degree: int) -> Array:
    """Matrix from power coefficients a_j (of θ^j) to Bernstein coefficients, shape (degree + 1, degree + 1).

    All entries lie in [0, 1], so the conversion in this direction loses no accuracy.
    """
    return np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])


@lru_cache(maxsize=64)
def halves(degree: int) -> tuple[Array, Array]:
    """De Casteljau's matrices from the coefficients on [0, 1] to those on [0, ½] and [½, 1]."""
    left = np.array([[comb(i, j) / 2.0**i for j in range(degree + 1)] for i in range(degree + 1)])
    return left, left[::-1, ::-1].copy()


@lru_cache(maxsize=64)
def economise(degree: int, highest: int) -> tuple[Array, Array]:
    """Each power above ``degree`` as nearly the same polynomial of that degree: its Chebyshev series, cut there.

    With the polynomials T*_n(θ) = T_n(2θ − 1), θ^j is 2^(1−2j) Σ_k C(2j, k) T*_{j−k}, the last term halved (Lanczos'
    economization of power series).

    Returns:
        power coefficients by columns, for θ^(degree + 1) to θ^highest, shape (degree + 1, highest − degree); and bounds
        of their errors on [0, 1], shape (highest − degree,).
    """
    chebyshev = [[1], [-1, 2]]
    while len(chebyshev) <= degree:
        last, before = chebyshev[-1], [*chebyshev[-2], 0, 0]
        chebyshev.append(
            [4 * up - 2 * here - then for up, here, then in zip([0, *last], [*last, 0], before, strict=True)]
        )
    columns, errors = [], []
    for j in range(degree + 1, highest + 1):
        column = [Fraction(0)] * (degree + 1)
        for n, polynomial in enumerate(chebyshev[: degree + 1]):
            share = Fraction(comb(2 * j, j - n), 2 ** (2 * j - 1) * (1 if n else 2))
            for i, coefficient in enumerate(polynomial):
                column[i] += share * coefficient
        columns.append([float(of) for of in column])
        errors.append(float(Fraction(sum(comb(2 * j, k) for k in range(j - degree)), 2 ** (2 * j - 1))))
    return np.array(columns).reshape(-1, degree + 1).T, np.array(errors)


@dataclass(frozen=True, eq=False)
class Maxima:
    """Largest value of each group of polynomials.

    Attributes:
        value: shape (G,).
        cell: index of the polynomial that attains it, shape (G,).
        s: where on [0, 1] in that cell, shape (G,).
    """

    value: Array
    cell: np.ndarray
    s: Array


def maxima(coefficients: Array, tolerance: float = 1e-14) -> Maxima:
    """Maximum over all cells of each group.

    Args:
        coefficients: by rising power of s ∈ [0, 1], shape (d + 1, cells, groups).
        tolerance: gap between bound and value at which to stop, relative to the largest coefficient of the group.

    Returns:
        for each group the largest value, its cell and its place.
    """
    d, cells, groups = coefficients.shape[0] - 1, coefficients.shape[1], coefficients.shape[2]
    ends = np.concatenate([coefficients[0], coefficients.sum(axis=0)])  # values at both ends of every cell
    at = ends.argmax(axis=0)
    value = ends[at, np.arange(groups)]
    cell, s = at % cells, (at >= cells).astype(float)
    size = np.abs(coefficients)
    slack = tolerance * size.max(axis=(0, 1))
    # most cells fall to this cheap bound, before any Bernstein coefficient is computed
    index, group = np.nonzero(coefficients[0] + size[1:].sum(axis=0) > value + slack)
    b = from_powers(d) @ coefficients[:, index, group]
    start, width = np.zeros(b.shape[1]), 1.0
    left, right = halves(d)
    for _ in range(60):
        open_ = b.max(axis=0) > value[group] + slack[group]
        if not open_.any():
            break
        b, group, index, start = b[:, open_], group[open_], index[open_], start[open_]
        b = np.concatenate([left @ b, right @ b], axis=1)
        width /= 2
        start = np.concatenate([start, start + width])
        group, index = np.tile(group, 2), np.tile(index, 2)
        middle = b[0]
        # ascending order, so that the last write to a group is its best
        order = np.argsort(middle, kind="stable")
        better = order[middle[order] > value[group[order]]]
        value[group[better]] = middle[better]
        cell[group[better]] = index[better]
        s[group[better]] = start[better]
    return Maxima(value, cell, s)


_END = ".npy"
_LARGEST = 1e9  # bytes of a file


def read_npz(path: Path | BinaryIO, most_bytes: float, only: Collection[str] = ()) -> dict[str, Any]:
    """The arrays of a file, or of one that is open, by name, or only those of some names.

    What is pickled is refused, files other than arrays are left out.

    Raises:
        ValueError: in one line, if they are more than so many bytes, or it cannot be read as an npz file.
        OSError: if the file cannot be opened.
    """
    return dict(each_npz(path, most_bytes, only))


def each_npz(path: Path | BinaryIO, most_bytes: float, only: Collection[str] = ()) -> Iterator[tuple[str, Any]]:
    """The arrays of :func:`read_npz`, one after the other, so that not all need be in memory at once.

    Raises:
        ValueError, OSError: as :func:`read_npz`.
    """
    with _open_npz(path) as packed:
        members = {member.filename.removesuffix(_END): member for member in _arrays(packed)}
        chosen = {name: member for name, member in members.items() if not only or name in only}
        size = sum(member.file_size for member in chosen.values())
        for name, member in chosen.items() if size <= most_bytes else ():
            with packed.open(member) as stream:
                array = np.lib.format.read_array(stream, allow_pickle=False)
            yield name, array
    if size > most_bytes:
        raise ValueError(f"{size / 1e6:.0f} MB of arrays; expected at most {most_bytes / 1e6:g} MB")


def npz_headers(path: Path) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
    """Shape and type of each array in ``path`` by name, from their headers alone.

    Raises:
        ValueError: in one line, if it cannot be read as an npz file, or holds what is pickled.
        OSError: if the file cannot be opened.
    """
    found = {}
    with _open_npz(path) as packed:
        for member in _arrays(packed):
            with packed.open(member) as stream:
                version = np.lib.format.read_magic(stream)
                read = getattr(np.lib.format, f"read_array_header_{min(version[0], 2)}_0")
                shape, _, kind = read(stream)
            if kind.hasobject:
                raise TypeError(f"{member.filename!r} is pickled")
            found[member.filename.removesuffix(_END)] = shape, kind
    return found


def _arrays(packed: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    return [member for member in packed.infolist() if member.filename.endswith(_END)]


@contextmanager
def _open_npz(path: Path | BinaryIO) -> Iterator[zipfile.ZipFile]:
    with open_file(path, _LARGEST) if isinstance(path, Path) else nullcontext(path) as stream:
        try:
            with zipfile.ZipFile(stream) as packed:
                yield packed
        except Exception as error:  # zipfile, zlib and numpy's reader of headers raise a dozen types on damaged files
            raise ValueError(f"not an npz file of plain arrays ({one_line(error, 160)})") from error


_WIDEST = 8  # bytes of a number
_TEXT = "BYTE_ARRAY"
_AT_A_TIME = 1000  # files that one process tries
_LONGEST, _A_BYTE = 120.0, 5e-7  # s on the clock, and beside it for a byte
_ROOM, _ROOM_A_BYTE = 2 << 30, 8  # bytes of memory, and beside them for a byte
_TRY = """
import sys
import pyarrow.parquet as pq
for index, path in enumerate(sys.argv[1:]):
    sys.stderr.write(f"{index}\\n")
    try:
        with pq.ParquetFile(path, pre_buffer=False) as file:
            for _ in file.iter_batches(4096, use_threads=False):
                pass
    except Exception:
        pass
"""


def find_fatal(paths: Iterable[Path]) -> Path | None:
    """The first of some Parquet files that ends the process which reads it, or needs time or memory beyond its size.

    They are read in a process of their own, as a few flipped bits can abort the reader; that must not be this one.
    Others that cannot be read, :func:`read_parquet` refuses. Takes a third of a second for a thousand small files.
    """
    left = [path for path in paths if path.is_file()]
    while left:
        some, left = left[:_AT_A_TIME], left[_AT_A_TIME:]
        size = sum(path.stat().st_size for path in some)
        command = [sys.executable, "-P", "-c", _TRY, *(str(path.absolute()) for path in some)]
        try:
            done = run_bounded(command, _LONGEST + _A_BYTE * size, data=_ROOM + _ROOM_A_BYTE * size)
            said, ended = done.stderr, done.returncode != 0
        except subprocess.TimeoutExpired as error:
            said, ended = (error.stderr or b"").decode(errors="replace"), True
        reached = [line for line in said.splitlines() if line.isdecimal()]
        if ended and reached:
            return some[int(reached[-1])]
    return None


def refuse_fatal(path: Path) -> None:
    """See that a Parquet file can be read, or refused, by this process.

    Raises:
        ValueError: in one line, if it is of those that :func:`find_fatal` finds.
    """
    if find_fatal([path]) is not None:
        raise ValueError(FATAL)


FATAL = "damaged: reading it ends the process that reads it"


def read_parquet(
    content: bytes,
    most_rows: int,
    most_bytes: float,
    columns: Sequence[str] | None = None,
    check: Callable[[pa.Schema, int], None] | None = None,
) -> pa.Table:
    """The table in the content of a Parquet file.

    Args:
        content: of the file.
        most_rows, most_bytes: of the table.
        columns: those to read; all if ``None``.
        check: called with the schema and the number of rows before any is read; raises ValueError.

    Raises:
        ValueError: in one line, if it is none, or larger.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(pa.BufferReader(content)) as file:
            at_once = _rows_at_once(file.metadata, most_rows, most_bytes)
            if check is not None:
                check(file.schema_arrow, file.metadata.num_rows)
            batches, size = [], 0
            for batch in file.iter_batches(at_once, columns=columns, use_threads=False):
                size += batch.nbytes
                if size > most_bytes:
                    raise ValueError(_too_large(size, most_bytes))
                batches.append(batch)
            schema = file.schema_arrow if columns is None else pa.schema(map(file.schema_arrow.field, columns))
            return pa.Table.from_batches(batches, batches[0].schema if batches else schema)
    except Exception as error:  # arrow raises a dozen types on damaged files, among them one for want of memory
        raise ValueError(one_line(error, 160)) from error


def _rows_at_once(found: pq.FileMetaData, most_rows: int, most_bytes: float) -> int:
    """How many rows may be read together, if it is not too large by what it says of itself.

    Raises:
        ValueError: if it is.
    """
    if found.num_rows > most_rows:
        raise ValueError(f"{found.num_rows} rows; expected at most {most_rows}")
    size, longest = 0, 1
    for group in map(found.row_group, range(found.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            size += max(column.total_uncompressed_size, _WIDEST * column.num_values)
            if column.physical_type == _TEXT:  # each row may be as long as all of them are in the file
                longest = max(longest, column.total_uncompressed_size)
    if size > most_bytes:
        raise ValueError(_too_large(size, most_bytes))
    return max(1, min(1 << 16, int(most_bytes / (4 * longest))))


def _too_large(size: float, most: float) -> str:
    return f"{size / 1e6:.0f} MB of data; expected at most {most / 1e6:g} MB"
