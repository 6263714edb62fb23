"""Crossings against brute force, published values, and systems built to have pairs, tangencies and defects."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from theory_cases import random_systems, shipped

from icmj.errors import AnalysisError
from icmj.theory.crossings import crossings, search
from icmj.theory.error_system import ErrorSystem

GRID = 1e-4


def brute_force(system: ErrorSystem, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of φ on a grid of 1e-4 s, stepping e^{Ā_C Δ} of scipy from one point to the next."""
    steps = int(end / GRID)
    block = 100
    inner = np.stack([expm(system.A_C * GRID * (i + 1)) for i in range(block)])
    delta, values, here = [], [], np.eye(len(system.A_C))
    for start in range(0, steps, block):
        E = inner @ here
        here = E[-1]
        delta.append(GRID * (start + 1 + np.arange(block)))
        values.append(np.linalg.eigvals(system.T @ system.A_D @ E @ system.T_bar))
    delta, values = np.concatenate(delta), np.concatenate(values)
    keep = delta <= end
    return delta[keep], values[keep]


def step(crossing) -> int:
    size = 2 if crossing.kind == "complex" else 1
    return size * {"rising": 1, "falling": -1, "tangent": 0}[crossing.direction]


def assert_agrees_with_brute_force(system: ErrorSystem, end: float) -> int:
    result = search(system, end)
    delta, values = brute_force(system, result.delta_end)
    magnitude = np.abs(values)
    outside = (magnitude > 1).sum(axis=1)
    explained = sum(step(c) * (delta > c.delta) for c in result.crossings) + np.zeros(len(delta), int)
    # a grid point that falls on a crossing itself may be counted either way
    unsure = np.abs(magnitude - 1).min(axis=1) < 1e-7
    np.testing.assert_array_equal(outside[~unsure], explained[~unsure])
    for c in result.crossings:
        exact = np.linalg.eigvals(system.phi(c.delta)).astype(complex)
        i = np.abs(exact - c.eigenvalue).argmin()
        assert abs(exact[i] - c.eigenvalue) < 1e-7
        rest = np.delete(exact, i)
        if c.kind == "complex":
            assert abs(c.eigenvalue.imag) > 0
            rest = np.delete(rest, np.abs(rest - exact[i].conj()).argmin())
        else:
            assert c.eigenvalue == {"+1": 1, "-1": -1}[c.kind]
        assert np.abs(rest).max() == pytest.approx(c.largest_other, abs=1e-6, rel=1e-6)
    return len(result.crossings)


@pytest.mark.slow
def test_random_plants_agree_with_a_brute_force_scan():
    found = [assert_agrees_with_brute_force(system, 2.0) for system in random_systems(1, 60)]
    assert sum(found) > 60
