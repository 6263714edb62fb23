"""J against finite differences of a return map simulated in original coordinates, written here from the paper."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, linear_sum_assignment
from theory_cases import SHIPPED, random_systems, shipped

from icmj.controller.trigger import EventTrigger
from icmj.theory.orbit import jacobian, multipliers
from icmj.theory.prediction import predict


class EventMap:
    """(x, x_o) after one sample to (x, x_o) after the next, in the coordinates of plant, observer and hold."""

    def __init__(self, system, trigger):
        A, B, C = system.actual.A, system.actual.B, system.actual.C
        d = system.design
        n, m = system.n, system.n_hat
        self.n, self.m, self.trigger = n, m, trigger
        self.M = np.zeros((n + 2 * m, n + 2 * m))
        self.M[:n] = np.hstack([A, np.zeros((n, m)), -B @ d.k])
        self.M[n : n + m] = np.hstack([d.L @ C, d.plant.A - d.L @ d.plant.C, -d.plant.B @ d.k])
        self.M[n + m :, n + m :] = d.A_c

    def excess(self, z):
        e = z[self.n + self.m :] - z[self.n : self.n + self.m]
        return e @ self.trigger.Q_t @ e - self.trigger.q_t**2

    def __call__(self, z, near):
        """One interval whose event lies within 5 % of ``near``, of a complex state that is real but for a tiny part."""
        start = np.concatenate([z, z[self.n :]])
        base = expm(self.M * 0.95 * near) @ start
        tau = brentq(lambda s: self.excess(expm(self.M * s) @ base.real), 0.0, 0.1 * near, xtol=1e-15, rtol=1e-14)
        end = expm(self.M * tau) @ base
        e, rate = (z[self.n + self.m :] - z[self.n : self.n + self.m] for z in (end, self.M @ end))
        tiny = self.excess(end) / (2 * e @ self.trigger.Q_t @ rate)  # the event of the tiny part lies elsewhere
        return (end - self.M @ end * tiny)[: self.n + self.m]


def finite_differences(system, trigger, orbit):
    """Differences of the map along the imaginary axis, Im f(x + ih)/h, in coordinates x̄ = (x, x̃_o).

    Nothing is cut off, and nothing cancels.
    """
    step_map = EventMap(system, trigger)
    n, m = system.n, system.n_hat
    S = np.eye(n + m)  # x̄ = S (x, x_o)
    S[n:, :n] = -system.T_hat
    inverse = np.linalg.inv(S)
    h = 1e-30 * np.abs(orbit.x_bar).max()
    columns = [S @ step_map(inverse @ (orbit.x_bar + 1j * h * e), orbit.delta).imag / h for e in np.eye(n + m)]
    return np.column_stack(columns)


def assert_multipliers_agree(system, trigger, prediction):
    J = jacobian(system, trigger, prediction.orbit)
    measured = finite_differences(system, trigger, prediction.orbit)
    # what is left is rounding: that of a state which grows some thousandfold within an interval
    assert np.abs(J - measured).max() < 1e-9 * max(1.0, np.abs(J).max())
    other = np.linalg.eigvals(measured)
    gap = np.abs(prediction.multipliers[:, None] - other)
    rows, columns = linear_sum_assignment(gap)
    largest = np.abs(prediction.multipliers).max()
    assert gap[rows, columns].max() < 1e-9 * max(1.0, largest)
    assert abs(np.abs(other).max() - largest) < 1e-9 * max(1.0, largest)


@pytest.mark.parametrize("case", [c for c in SHIPPED if c != "exact"])
@pytest.mark.parametrize("weight", ["identity", "output"])
def test_shipped_cases_agree_with_finite_differences(case, weight):
    system = shipped(case)
    C = system.design.plant.C
    trigger = EventTrigger(np.eye(system.n_hat) if weight == "identity" else C.T @ C, 0.01)
    assert_multipliers_agree(system, trigger, predict(system, trigger, delta_max=4.0))


@pytest.mark.slow
def test_random_plants_agree_with_finite_differences():
    tested = 0
    for system in random_systems(99, 400):
        trigger = EventTrigger(np.eye(system.n_hat), 0.01)
        prediction = predict(system, trigger, delta_max=2.0)
        if prediction.verdict in ("attracting", "repelling"):
            assert_multipliers_agree(system, trigger, prediction)
            tested += 1
        if tested == 40:
            break
    assert tested == 40


def test_the_published_failure_is_repelling():
    system = shipped("b=1.7")
    prediction = predict(system, EventTrigger(np.eye(2), 0.01))
    assert prediction.verdict == "repelling"
    assert np.abs(prediction.multipliers).max() == pytest.approx(1.19, abs=0.005)  # notes, section 3


def test_a_grazing_event_has_no_jacobian():
    system = shipped("b=0.8")
    trigger = EventTrigger(np.eye(2), 0.01)
    orbit = predict(system, trigger).orbit
    X = orbit.X[-1]
    velocity = system.T_t @ system.A_C @ X
    # Q_t that sees only the direction across e' and e: E is stationary there
    e = system.T_t @ X
    across = np.array([-velocity[1], velocity[0]])
    blind = EventTrigger(np.outer(across, across), 0.01)
    assert across @ e != 0
    assert np.isnan(jacobian(system, blind, orbit)).all()


def test_multipliers_come_by_falling_magnitude():
    J = np.diag([0.1, -2.0, 0.5])
    np.testing.assert_allclose(multipliers(J), [-2.0, 0.5, 0.1])
