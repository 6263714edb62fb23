"""Test functions of the unit circle on eigenvalues chosen by hand."""

import numpy as np
import pytest

from icmj.theory.chebyshev import nodes
from icmj.theory.circle import KINDS, circle_function, outside

DELTA = 1.0 + 0.1 * nodes(8)


def spectra(branches):
    """g = (λ − 1)/Δ for branches λ(Δ), shape (nodes, count)."""
    values = np.array([[branch(delta) for branch in branches] for delta in DELTA], dtype=complex)
    return (values - 1) / DELTA[:, None]


CROSSING = {
    "+1": [lambda d: 1 + (d - 1), lambda d: 0.3],
    "-1": [lambda d: -1 - (d - 1), lambda d: 0.3],
    "complex": [
        lambda d: (1 + (d - 1)) * np.exp(1j),
        lambda d: (1 + (d - 1)) * np.exp(-1j),
        lambda d: 0.3,
    ],
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_function_of_a_kind_and_no_other_changes_sign_at_its_crossing(kind):
    g = spectra(CROSSING[kind])
    for other in KINDS:
        values = circle_function(other, g, DELTA)
        changes = np.count_nonzero(np.diff(np.sign(values[values != 0])))
        assert changes == (1 if other == kind else 0)


@pytest.mark.parametrize("kind", KINDS)
def test_eigenvalues_outside_are_counted(kind):
    count = outside(spectra(CROSSING[kind]), DELTA)
    expected = 2 if kind == "complex" else 1
    np.testing.assert_array_equal(count, np.where(DELTA > 1 + 1e-9, expected, 0))


def test_an_eigenvalue_that_stays_on_the_circle_hides_no_crossing():
    g = spectra([*CROSSING["-1"], lambda d: 1.0, lambda d: -1.0])
    values = circle_function("-1", g, DELTA)
    assert np.count_nonzero(np.diff(np.sign(values[values != 0]))) == 1
