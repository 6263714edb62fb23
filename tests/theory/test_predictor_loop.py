"""Roots, responses and variance of the continuous predictor controller, by other ways to the same numbers."""

from dataclasses import replace

import linear_cases
import numpy as np
import pytest
from linear_cases import pendulum_design
from theory_cases import three_link_design

from icmj import Delay, PredictorController
from icmj.controller.setpoint import Target, setpoint, step
from icmj.errors import AnalysisError
from icmj.theory.delay_roots import DelayLoop, count_unstable, delay_loop, rightmost_roots
from icmj.theory.predictor_roots import predictor_loop
from icmj.theory.stationary_covariance import predictor_covariance


def poles(design) -> np.ndarray:
    found = np.concatenate([np.linalg.eigvals(design.A_c), np.linalg.eigvals(design.A_o)])
    return np.sort_complex(found)


def designs():
    return [pendulum_design(), *(linear_cases.random_loop(seed, n, n, 2, 2)[1] for seed, n in ((7, 3), (3, 4)))]


@pytest.mark.parametrize("design", designs(), ids=["pendulum", "of order 3", "of order 4"])
@pytest.mark.parametrize("t_d", [0.03, 0.1, 0.3])
def test_with_an_exact_model_the_poles_are_those_of_regulator_and_observer_and_no_others(design, t_d) -> None:
    loop, expected = predictor_loop(design.plant, PredictorController(design, Delay(t_d))), poles(design)
    for s in (0.3 + 0.7j, -4 + 11j, 8 - 3j, 0j, complex(np.linalg.eigvals(design.plant.A)[0])):
        det = np.linalg.det(loop.characteristic(s))
        assert det == pytest.approx(np.prod(s - expected), rel=1e-10)
    # each of them is a root, by a step of Newton's from beside it
    for root in expected:
        near = root + 1e-7
        step = np.trace(np.linalg.solve(loop.characteristic(near), loop.slope(near)))
        assert near - 1 / step == pytest.approx(root, abs=1e-10)


@pytest.mark.parametrize("design", designs()[:2], ids=["pendulum", "of order 3"])
@pytest.mark.parametrize("t_d", [0.03, 0.1])
def test_the_rightmost_roots_are_found_among_no_others(design, t_d) -> None:
    loop, expected = predictor_loop(design.plant, PredictorController(design, Delay(t_d))), poles(design)
    found = rightmost_roots(loop, 3)
    assert len(found) >= 3
    np.testing.assert_allclose(np.sort_complex(found), expected[-len(found) :], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    ("t_d", "assumed", "b"), [(0.1, 0.1, 0.8), (0.1, 0.12, 1.0), (0.2, 0.15, 1.1), (0.1, 0.0, 1.0)]
)
def test_otherwise_they_are_those_of_the_differential_equations_but_for_the_models_own(t_d, assumed, b) -> None:
    design = pendulum_design()
    loop = predictor_loop(design.plant.scaled(b), PredictorController(design, Delay(t_d, assumed)))
    found = rightmost_roots(loop, 4)
    with_own = rightmost_roots(DelayLoop(loop.F, loop.G, loop.tau), 6 if assumed else 4)
    own = np.linalg.eigvals(design.plant.A) if assumed else np.zeros(0)
    for root in own:
        assert np.abs(with_own - root).min() < 1e-9
        assert np.abs(found - root).min() > 1e-2
    rest = [root for root in with_own if np.abs(own - root).min(initial=1) > 1e-6]
    count = min(len(found), len(rest))
    assert count >= 4
    np.testing.assert_allclose(found[:count], rest[:count], atol=1e-9)


@pytest.mark.parametrize("design", designs(), ids=["pendulum", "of order 3", "of order 4"])
@pytest.mark.parametrize("gain", [0.0, 0.3, 1.0, -1.0])
def test_what_grows_is_counted_without_the_models_own(design, gain) -> None:
    """With an exact model it is what Â − B̂k̂ and Â − LĈ have right of the axis, whatever k̂ is."""
    design = replace(design, k=gain * design.k)
    loop = predictor_loop(design.plant, PredictorController(design, Delay(0.1)))
    assert count_unstable(loop) == (poles(design).real > 0).sum()


def test_the_slope_is_that_of_the_characteristic_matrix() -> None:
    loop = predictor_loop(linear_cases.PLANT, PredictorController(pendulum_design(), Delay(0.2, 0.15)))
    for s in (0.4 + 2j, -3.0 + 1j):
        h = 1e-5
        central = (loop.characteristic(s + h) - loop.characteristic(s - h)) / (2 * h)
        np.testing.assert_allclose(loop.slope(s), central, atol=1e-8)


@pytest.mark.parametrize("design", designs()[::2], ids=["pendulum", "of order 4"])
def test_the_variance_is_the_integral_over_all_frequencies(design) -> None:
    """Σ = ∫ H S Hᴴ dω/2π, by the midpoint rule in arctan(ω/10); what is beyond oscillates, and is of order 1/ω²."""
    law = PredictorController(design, Delay(0.15))
    n, n_u = design.plant.n, design.plant.n_u
    W, V = 0.7 * np.eye(n_u) + 0.2, 0.003
    x, u = predictor_covariance(law, W, V)
    phi = (np.arange(1500) + 0.5) / 1500 * np.pi / 2
    d, e, _ = predictor_loop(design.plant, law).response(10 * np.tan(phi))
    power = np.real(d @ W @ d.conj().swapaxes(1, 2) + V * e @ e.conj().swapaxes(1, 2))
    total = np.einsum("k,kij->ij", 10 / np.cos(phi) ** 2, power) * (np.pi / 2 / 1500) / np.pi
    scale = np.sqrt(np.outer(np.diag(x), np.diag(x)))
    assert np.abs(total[:n, :n] - x).max() < 2e-4 * scale.max()
    np.testing.assert_allclose(np.diag(total)[n:], np.diag(u), rtol=2e-4)


def test_without_noise_after_the_reading_the_variance_of_a_short_delay_is_that_of_none() -> None:
    """With t_d → 0 it is the Lyapunov equation of observer and feedback."""
    from scipy.linalg import solve_continuous_lyapunov

    d = pendulum_design()
    A = np.block([[d.plant.A, -d.plant.B @ d.k], [d.L @ d.plant.C, d.A_o - d.plant.B @ d.k]])
    Q = np.zeros((4, 4))
    Q[:2, :2], Q[2:, 2:] = 0.5 * d.plant.B @ d.plant.B.T, 0.01 * d.L @ d.L.T
    expected = solve_continuous_lyapunov(A, -Q)
    x, u = predictor_covariance(PredictorController(d, Delay(1e-8)), 0.5, 0.01)
    np.testing.assert_allclose(x, expected[:2, :2], rtol=0, atol=1e-6 * expected.max())
    np.testing.assert_allclose(u, d.k @ expected[2:, 2:] @ d.k.T, rtol=1e-6)


def test_what_is_wrong_is_said() -> None:
    design = pendulum_design()
    with pytest.raises(AnalysisError, match="there is none; give one, or take Continuous"):
        PredictorController(design, Delay())
    with pytest.raises(AnalysisError, match="expected a Delay"):
        PredictorController(design, 0.1)  # type: ignore[arg-type]
    with pytest.raises(AnalysisError, match="expected a Design"):
        PredictorController(None, Delay(0.1))  # type: ignore[arg-type]
    with pytest.raises(AnalysisError, match="leaves no significant digit"):
        PredictorController(design, Delay(100.0))
    followed = setpoint(designs()[2].plant, [Target({designs()[2].plant.outputs[0]: 1.0}, step(1.0))])
    with pytest.raises(AnalysisError, match="not of the controller's model"):
        PredictorController(design, Delay(0.1), followed)
    with pytest.raises(AnalysisError, match="this one assumes another"):
        predictor_covariance(PredictorController(design, Delay(0.1, 0.2)), 1.0)
    with pytest.raises(AnalysisError, match="intensity W"):
        predictor_covariance(PredictorController(design, Delay(0.1)), np.eye(3))
    with pytest.raises(AnalysisError, match="take predictor_loop"):
        delay_loop(design.plant, PredictorController(design, Delay(0.1)))
    unstable = PredictorController(replace(design, k=0 * design.k), Delay(0.1))
    with pytest.raises(AnalysisError, match="not stable"):
        predictor_covariance(unstable, 1.0)


def test_large_gains_let_no_step_fall_to_the_last_bit_and_roots_are_found_all_the_same() -> None:
    """The three-link person with gains of 5e4 and 1e3/s, whose poles are known while the model is exact."""
    design, some = three_link_design(), Delay(0.1)
    expected = poles(design)
    found = rightmost_roots(predictor_loop(design.plant, PredictorController(design, some)), 4)
    assert len(found) == 4
    for root in found:
        assert np.abs(expected - root).min() < 1e-9 * abs(root)
    # with another model each solves the equation as well as its neighbours in floating point do
    loop = predictor_loop(design.plant.scaled(0.9), PredictorController(design, some))
    for root in rightmost_roots(loop, 4):
        step = 1 / np.trace(np.linalg.solve(loop.characteristic(complex(root)), loop.slope(complex(root))))
        assert abs(step) < 1e-9 * abs(root)
