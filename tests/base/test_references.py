"""A named tuple handed on by its address is read as the named tuple itself is."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from icmj.base.compilation import allocating, compiled
from icmj.base.process import INTERPRETED
from icmj.base.references import refer

pytestmark = pytest.mark.skipif(INTERPRETED, reason="nothing is compiled")


class Inner(NamedTuple):
    values: Any
    rows: Any
    many: int
    known: bool


class Outer(NamedTuple):
    factor: float
    inner: Inner
    also: Any


@compiled
def _move(inner, by):  # type: ignore[no-untyped-def]
    for i in range(inner.many):
        inner.values[i] += by
        inner.rows[1, i] = inner.values[i]


@allocating
def _sum(outer):  # type: ignore[no-untyped-def]
    _move(outer.inner, outer.factor)
    copied = outer.inner.values.copy()
    return copied.sum() + outer.also[0] + (10000.0 if outer.inner.known else 0.0)


def test_fields_of_all_kinds_are_read_and_arrays_written() -> None:
    import numba

    expected = np.array([0.5, 1.5, 2.5, 3.0])
    for read in (lambda outer: _sum(outer), lambda outer: _sum(refer(outer))):
        values, rows = np.arange(4.0), np.zeros((2, 4))[:, ::-1]
        outer = Outer(0.5, Inner(values, rows, 3, True), np.array([[7.0, 8.0]])[0])
        assert numba.njit(read)(outer) == 10000.0 + 7.0 + expected.sum()
        np.testing.assert_array_equal(values, expected)
        np.testing.assert_array_equal(rows, [[0.0] * 4, [*expected[:3], 0.0]])


def test_what_is_no_field_is_refused_as_it_is_compiled() -> None:
    import numba

    outer = Outer(0.5, Inner(np.zeros(1), np.zeros((1, 1)), 1, False), np.zeros(1))
    with pytest.raises(numba.errors.TypingError, match="missing"):
        numba.njit(lambda outer: refer(outer).missing)(outer)
