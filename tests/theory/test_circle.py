"""Test functions of the unit circle on eigenvalues chosen by hand."""

import numpy as np
import pytest

from icmj.theory.chebyshev import make_coefficient_matrix, make_nodes
from icmj.theory.circle import (
    KINDS,
    count_outside,
    evaluate_away,
    evaluate_circle_function,
    find_near,
    merge_repeated,
    sort_outwards,
)

DELTA = 1.0 + 0.1 * make_nodes(8)


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
        values = evaluate_circle_function(other, g, DELTA)
        changes = np.count_nonzero(np.diff(np.sign(values[values != 0])))
        assert changes == (1 if other == kind else 0)


@pytest.mark.parametrize("kind", KINDS)
def test_eigenvalues_outside_are_counted(kind):
    count = count_outside(spectra(CROSSING[kind]), DELTA)
    expected = 2 if kind == "complex" else 1
    np.testing.assert_array_equal(count, np.where(DELTA > 1 + 1e-9, expected, 0))


def test_an_eigenvalue_that_stays_on_the_circle_hides_no_crossing():
    g = spectra([*CROSSING["-1"], lambda d: 1.0, lambda d: -1.0])
    values = evaluate_circle_function("-1", g, DELTA)
    assert np.count_nonzero(np.diff(np.sign(values[values != 0]))) == 1


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6, 0.0])
def test_a_visit_to_the_circle_between_two_nodes_shows_in_the_logarithm(width):
    """λ = c ± √((Δ − a)(b − Δ)): a complex pair inside that turns real, goes out and comes back within b − a."""
    x = make_nodes(24)
    middle = 1.0 + 0.1 * (x[12] + x[13]) / 2
    delta = 1.0 + 0.1 * x

    def spectrum(c):
        root = np.sqrt((delta - middle + 0.05 * width + 0j) * (middle + 0.05 * width - delta)) * 3
        return ((np.column_stack([c + root, c - root, 0.3 + 0 * root]) - 1) / delta[:, None]).astype(complex)

    tails = [np.abs(evaluate_away(spectrum(c), delta) @ make_coefficient_matrix(24)[-3:].T).max() for c in (-1.0, -0.5)]
    assert tails[0] > 1e-2
    assert tails[1] < 1e-3


def test_only_eigenvalues_that_come_near_are_near():
    branches = [lambda d: 3.0 + d, lambda d: 1 + (d - 1), lambda d: 0.5 * d, lambda d: -0.2 + 0 * d]
    g = sort_outwards(spectra(branches), DELTA)[None]
    np.testing.assert_array_equal(find_near(g, DELTA[None]), [[1, 2]])
    g = sort_outwards(spectra([branches[0], *branches[2:]]), DELTA)[None]
    np.testing.assert_array_equal(find_near(g, DELTA[None]), [[1, 1]])


def test_eigenvalues_repeated_at_every_node_are_taken_once():
    twice = [lambda d: 0.9 * d, lambda d: 0.9 * d + 1e-12, lambda d: 0.2 * d]
    assert merge_repeated(spectra(twice)).shape == (9, 2)
    assert merge_repeated(spectra([twice[0], lambda d: 0.9 * d**2, twice[2]])).shape == (9, 3)  # equal at one Δ only
