"""Characteristic roots of delayed feedback: printed numbers, closed forms, and a count that does not know them."""

import numpy as np
import pytest
from scipy.special import lambertw

from icmj import LinearPlant, SwitchingPD
from icmj.errors import AnalysisError
from icmj.theory.delay_roots import DelayLoop, count_unstable, delay_loop, rightmost_roots, stability_limit

MASS, LENGTH, GRAVITY, DELAY = 60.0, 1.0, 9.81, 0.2
MGH, INERTIA = MASS * GRAVITY * LENGTH, MASS * LENGTH**2


def body(stiffness: float = 0.8, damping: float = 4.0) -> LinearPlant:
    """The one-link person of Asai et al. (2009)."""
    A = np.array([[0.0, 1.0], [(1 - stiffness) * MGH / INERTIA, -damping / INERTIA]])
    B = np.array([0.0, 1 / INERTIA])
    return LinearPlant(A, B, np.eye(2), ("lean", "lean_rate"), ("ankle",), ("theta", "omega"))


def loop(P: float, D: float) -> DelayLoop:
    """Of that body under delayed feedback that is always on."""
    return delay_loop(body(), SwitchingPD(body(), "theta", "omega", P * MGH, D, DELAY, switches=False))


def test_roots_at_the_printed_continuous_gains() -> None:
    found = rightmost_roots(loop(0.8, 270.0), 3)
    np.testing.assert_allclose(found[0], -1.283231 + 5.200224j, atol=1e-6)
    np.testing.assert_allclose(found[1], -1.283231 - 5.200224j, atol=1e-6)
    np.testing.assert_allclose(found[2], -2.059143, atol=1e-6)


def test_the_printed_intermittent_gains_held_on_are_unstable() -> None:
    found = rightmost_roots(loop(0.25, 10.0), 2)
    np.testing.assert_allclose(found, [0.1266 + 0.683274j, 0.1266 - 0.683274j], atol=5e-5)


@pytest.mark.parametrize(("D", "limit", "frequency"), [
    (50, 0.444487, 1.612284), (100, 0.803373, 2.660691), (150, 1.102807, 3.444279), (200, 1.333084, 4.124364),
    (250, 1.481136, 4.754237), (270, 1.513461, 4.998884), (300, 1.528569, 5.362550),
])  # fmt: skip
def test_limits_of_stability(D: float, limit: float, frequency: float) -> None:
    P, omega = stability_limit(lambda P: loop(P, D), 0.3, 2.0)
    assert pytest.approx(limit, abs=1e-6) == P
    assert omega == pytest.approx(frequency, abs=1e-6)
    # on the limit the equation of the loop holds on the imaginary axis, in real numbers
    s = 1j * omega
    delta = INERTIA * s**2 + 4 * s - 0.2 * MGH + (P * MGH + D * s) * np.exp(-s * DELAY)
    assert abs(delta) < 1e-8 * MGH


def test_the_lower_limit_is_that_of_the_stiffness_alone() -> None:
    P, omega = stability_limit(lambda P: loop(P, 100.0), 0.3, 0.1)
    assert pytest.approx(0.2, abs=1e-12) == P
    assert omega == 0


@pytest.mark.parametrize("gain", [0.3, 1.0, 4.0])
def test_scalar_roots_are_lamberts(gain: float) -> None:
    """ẋ = −k x(t − τ): s = W_j(−k τ)/τ."""
    tau = 0.7
    found = rightmost_roots(DelayLoop(np.zeros((1, 1)), np.array([[[-gain]]]), np.array([tau])), 5)
    branches = np.array([lambertw(-gain * tau, k) / tau for k in range(-8, 9)])
    nearest = [np.abs(branches - root).min() for root in found]
    assert max(nearest) < 1e-10
    expected = branches[np.argsort(-branches.real)][: len(found)]
    np.testing.assert_allclose(np.sort(found.real)[::-1], expected.real, atol=1e-10)


def test_without_delayed_feedback_they_are_eigenvalues() -> None:
    random = np.random.default_rng(3)
    F = random.standard_normal((4, 4))
    found = rightmost_roots(DelayLoop(F, np.zeros((1, 4, 4)), np.array([0.3])), 3)
    expected = np.linalg.eigvals(F)
    for root in found:
        assert np.abs(expected - root).min() < 1e-10


@pytest.mark.parametrize("seed", range(6))
def test_every_root_solves_the_equation_and_none_is_missed(seed: int) -> None:
    """By a grid of Newton's starts, which knows nothing of the method."""
    random = np.random.default_rng(seed)
    some = DelayLoop(random.standard_normal((3, 3)), random.standard_normal((2, 3, 3)), np.array([0.2, 0.5]))
    found = rightmost_roots(some, 4)
    for root in found:
        singular = np.linalg.svd(some.characteristic(complex(root)), compute_uv=False)
        assert singular[-1] < 1e-9 * singular[0]
    least = found.real.min()

    def solved(s: complex) -> complex:
        for _ in range(60):
            delta = some.characteristic(s)
            s -= 1 / np.trace(np.linalg.solve(delta, some.slope(s)))
        return s

    for real in np.linspace(least, 4, 8):
        for imaginary in np.linspace(0, 12, 13):
            with np.errstate(all="ignore"):
                try:
                    root = solved(complex(real, imaginary))
                except np.linalg.LinAlgError:  # right on a root
                    continue
            if not np.isfinite(root) or root.real <= least + 1e-6:
                continue
            singular = np.linalg.svd(some.characteristic(root), compute_uv=False)
            if singular[-1] < 1e-9 * singular[0]:  # else Newton's method is still under way
                assert np.abs(found - root).min() < 1e-6 or np.abs(found - root.conjugate()).min() < 1e-6


@pytest.mark.parametrize("seed", range(8))
def test_what_grows_is_counted_as_a_plain_sum_along_a_large_half_circle_counts_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    some = DelayLoop(random.standard_normal((3, 3)), random.standard_normal((2, 3, 3)), np.array([0.2, 0.5]))
    R = sum(np.linalg.norm(M, 2) for M in (some.F, *some.G)) + 1
    arc, axis = R * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 4001)), 1j * np.linspace(R, -R, 8001)
    turned = np.unwrap(np.angle([np.linalg.det(some.characteristic(s)) for s in (*arc, *axis)]))
    assert count_unstable(some) == round((turned[-1] - turned[0]) / (2 * np.pi))


def test_a_neutral_mode_does_not_grow_whatever_its_last_bit_is() -> None:
    for at in (-1e-15, 0.0, 1e-15):
        assert count_unstable(DelayLoop(np.array([[at]]), np.zeros((1, 1, 1)), np.array([0.1]))) == 0
    assert count_unstable(DelayLoop(np.array([[1e-3]]), np.zeros((1, 1, 1)), np.array([0.1]))) == 1


def test_what_has_no_such_roots_is_told(root: object) -> None:
    with pytest.raises(AnalysisError, match="counted from 0; got 3"):
        delay_loop(body(), SwitchingPD(body(), "theta", "omega", 1.0, 1.0, DELAY), mode=3)
    with pytest.raises(AnalysisError, match="expected a stable and an unstable loop"):
        stability_limit(lambda P: loop(P, 100.0), 0.3, 0.4)


@pytest.mark.parametrize("unit", [1e-6, 1e3, 1e6])
def test_no_unit_of_time_changes_how_many_roots_grow(unit):
    rng, grown = np.random.default_rng(3), 0
    for _ in range(10):
        n, k = rng.integers(1, 5), rng.integers(1, 3)
        F, G, tau = rng.normal(size=(n, n)), rng.normal(size=(k, n, n)), rng.uniform(0.05, 1, k)
        found = count_unstable(DelayLoop(F, G, tau))
        assert count_unstable(DelayLoop(F / unit, G / unit, tau * unit)) == found
        grown += found
    assert grown > 5


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 3600.0, 1e9])
def test_no_unit_of_time_changes_which_roots_are_rightmost(unit):
    rng = np.random.default_rng(4)
    for _ in range(5):
        n, k = rng.integers(1, 4), rng.integers(1, 3)
        F, G, tau = rng.normal(size=(n, n)), rng.normal(size=(k, n, n)), rng.uniform(0.05, 1, k)
        expected = rightmost_roots(DelayLoop(F, G, tau), 3)
        found = rightmost_roots(DelayLoop(F / unit, G / unit, tau * unit), 3) * unit
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
