"""What depends on the coordinates and what does not: only γ and x̄ do."""

import numpy as np
import pytest
from theory_cases import neglected, pendulum, pendulum_design, random_systems, three_link, three_link_design

from icmj import EventTrigger, LinearPlant, error_system, predict
from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.hold import system_matched, zero_order
from icmj.theory.flow import make_flow

CASES = {
    "b=0.8": (pendulum(0.8), pendulum_design()),
    "b=1.7": (pendulum(1.7), pendulum_design()),
    "zeta=0.5": (neglected(0.5), pendulum_design()),
    "three-link": (three_link(0.9), three_link_design()),
}


def assert_same(found, expected, system, other):
    assert found.delta_crit == pytest.approx(expected.delta_crit, rel=1e-9)
    assert (found.verdict, found.cycle, found.eigenvalue) == (expected.verdict, expected.cycle, expected.eigenvalue)
    ordered = [np.sort_complex(np.round(p.multipliers, 6)) for p in (found, expected)]
    np.testing.assert_allclose(*ordered, atol=2e-6)
    a, b = found.orbit, expected.orbit
    # the grids are of powers of two steps, finer where the coordinates make it so: start, middle and end are common
    X, Y = (s.to_original(o.X[[0, len(o.t) // 2, -1]]) for s, o in ((other, a), (system, b)))
    size = np.abs(Y).max(axis=0)
    sign = np.sign((X[0] * Y[0]).sum())  # which of an orbit and its mirror image is shown is a convention
    np.testing.assert_allclose(sign * X, Y, atol=1e-7 * size.max())
    for name in ("y_peak", "u_peak", "x_peak", "y_range", "u_range", "x_range"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_only_gamma_depends_on_T_hat(case):
    actual, design = CASES[case]
    system, rng = error_system(actual, design), np.random.default_rng(2)
    rule = EventTrigger(np.eye(system.n_hat), 0.01)
    expected = predict(system, rule)
    gammas = [expected.gamma]
    for _ in range(5):
        other = error_system(actual, design, T_hat=system.T_hat + 0.3 * rng.normal(size=system.T_hat.shape))
        found = predict(other, rule)
        assert_same(found, expected, system, other)
        gammas.append(found.gamma)
        # γ is the length of x̄ in these coordinates, and nothing more
        assert found.gamma == pytest.approx(np.linalg.norm(found.orbit.x_bar), rel=1e-12)
    assert np.ptp(gammas) > 1e-3 * expected.gamma


def test_the_same_for_random_plants():
    rng, compared = np.random.default_rng(5), 0
    for system in random_systems(81, 60):
        rule = EventTrigger(np.eye(system.n_hat), 0.01)
        expected = predict(system, rule, delta_max=1.5)
        if expected.verdict not in ("attracting", "repelling") or np.abs(expected.multipliers).max() > 50:
            continue
        change = rng.normal(size=system.T_hat.shape)
        other = error_system(system.actual, system.design, T_hat=system.T_hat + 0.1 * change)
        assert_same(predict(other, rule, delta_max=1.5), expected, system, other)
        compared += 1
    assert compared >= 10


def test_gamma_depends_on_units():
    """The same pendulum with its rate in other units: the orbit is the same motion, γ another number."""
    S = np.diag([2.0, 1.0])
    plain = pendulum_design()

    def changed(plant):
        return type(plant)(S @ plant.A @ np.linalg.inv(S), S @ plant.B, plant.C @ np.linalg.inv(S), plant.states)

    design = type(plain)(changed(plain.plant), plain.k @ np.linalg.inv(S), S @ plain.L)
    before = predict(error_system(pendulum(0.8), plain), EventTrigger(np.eye(2), 0.01))
    weight = np.linalg.inv(S) ** 2
    after = predict(error_system(changed(pendulum(0.8)), design), EventTrigger(weight, 0.01))
    assert after.delta_crit == pytest.approx(before.delta_crit, rel=1e-12)
    np.testing.assert_allclose(after.amplitude, before.amplitude, rtol=1e-9)
    assert abs(after.gamma / before.gamma - 1) > 0.1


@pytest.mark.parametrize("hold", [system_matched, zero_order])
@pytest.mark.parametrize("t_d", [0.0, 0.1])
def test_no_unit_of_time_changes_anything_but_times(hold, t_d):
    """Seconds, milliseconds, or 1e9 s: of A, B and L rates are counted per unit, and all else is the same."""
    with_orbits = 0
    for system in random_systems(700, 20):
        found = []
        for unit in (1.0, 1e3, 1e7, 1e-9):
            assumed, actual = (
                LinearPlant(plant.A * unit, plant.B * unit, plant.C) for plant in (system.design.plant, system.actual)
            )
            design = Design(assumed, system.design.k, system.design.L * unit)
            own = error_system(actual, design, hold=hold(design), delay=Delay(t_d / unit))
            rule = EventTrigger(np.eye(own.n_hat), 0.01, 1e-3 / unit)
            found.append((unit, predict(own, rule, delta_max=3.0 / unit)))
        _, expected = found[0]
        for unit, got in found[1:]:
            assert [(c.kind, c.direction) for c in got.crossings] == [(c.kind, c.direction) for c in expected.crossings]
            deltas = [[c.delta * u for c in p.crossings] for u, p in ((unit, got), (1.0, expected))]
            np.testing.assert_allclose(*deltas, rtol=1e-8)
            assert [o.verdict for o in got.orbits] == [o.verdict for o in expected.orbits]
            assert (got.cycle, got.verdict) == (expected.cycle, expected.verdict)
            if expected.orbit is not None:
                np.testing.assert_allclose(got.amplitude, expected.amplitude, rtol=1e-6)
                with_orbits += 1
    assert with_orbits > 20


@pytest.mark.parametrize("unit", [2.0**-300, 2.0**60, 2.0**300])
def test_a_flow_is_the_same_to_the_bit_in_any_unit_of_time(unit):
    """However large the rates are in it; the eighteenth power of 2^60 / s is beyond numbers."""
    A, t = next(iter(random_systems(700, 20))).A_C, np.array([0.0, 0.01, 0.3, 3.0])
    np.testing.assert_array_equal(make_flow(A * unit).increment(t / unit), make_flow(A).increment(t))


@pytest.mark.parametrize("hold", [system_matched, zero_order])
@pytest.mark.parametrize("t_d", [0.0, 0.1])
def test_no_unit_of_a_state_an_input_or_an_output_changes_anything_but_numbers_in_it(hold, t_d):
    """Units of up to 1e6 of those of the plant, of each state, input and output another: the same motions."""
    rng, with_orbits = np.random.default_rng(8), 0
    for system in random_systems(710, 20):
        x, u, y = (10.0 ** rng.integers(-6, 7, size) for size in (system.n, system.actual.n_u, system.actual.n_y))
        found = []
        for X, U, Y in ((x**0, u**0, y**0), (x, u, y)):
            assumed, actual = (
                LinearPlant(plant.A * X / X[:, None], plant.B * U / X[:, None], plant.C * X / Y[:, None])
                for plant in (system.design.plant, system.actual)
            )
            design = Design(assumed, system.design.k * X / U[:, None], system.design.L * Y / X[:, None])
            own = error_system(actual, design, hold=hold(design), delay=Delay(t_d))
            found.append(predict(own, EventTrigger(np.diag(X**2), 0.01)))
        expected, got = found
        assert [(c.kind, c.direction) for c in got.crossings] == [(c.kind, c.direction) for c in expected.crossings]
        np.testing.assert_allclose(*([c.delta for c in p.crossings] for p in found), rtol=1e-8)
        assert got.observer_feedback_stable == expected.observer_feedback_stable
        for a, b in zip(got.orbits, expected.orbits, strict=True):
            assert a.verdict == b.verdict
            for name, unit in (("y_peak", y), ("u_peak", u), ("x_range", x)):
                there, here = getattr(a.orbit, name) * unit, getattr(b.orbit, name)
                np.testing.assert_allclose(there, here, rtol=1e-6, atol=1e-9 * here.max())
            with_orbits += 1
    assert with_orbits > 10
