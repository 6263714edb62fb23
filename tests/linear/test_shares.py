"""Noise whose size is a share of the command: against SciPy's integrator and a generalised Lyapunov equation."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import PLANT, event_controller, ivp_run, pendulum_design, random_loop, settings
from scipy.linalg import expm

from icmj import ClockTrigger, Controller, Delay, EventTrigger, Gaussian, Noise, Step, system_matched
from icmj.controller.rules.quadratic import as_weight
from icmj.linear.run import simulate
from icmj.simulation.disturbance import make_disturbance
from icmj.simulation.grid import interpolate_at, list_lines


def test_lines_are_the_noise_between_its_points():
    noises = (
        Gaussian(input="a", share=0.5, corner=1.0, interval=0.02, seed=1, start=0.137),
        Gaussian(input="b", share=0.2, interval=0.06, seed=2),
    )
    points, found = list_lines(noises, 1.0)
    t = np.linspace(0, 1, 5003)[:-1]
    stretch = np.searchsorted(points, t, side="right")
    begins = np.append(0.0, points[:-1])
    for number, noise in enumerate(noises):
        value, slope = found[stretch, number].T
        np.testing.assert_allclose(value + slope * (t - begins[stretch]), interpolate_at(noise, t), atol=1e-14)


def _loops():
    design = pendulum_design()
    event = event_controller(design, q_t=0.004, delta_min=0.05)
    yield "event", PLANT, event, [0.02, 0.0]
    yield "zero order", PLANT, event_controller(design, q_t=0.004, delta_min=0.05, hold="zero-order"), [0.02, 0.0]
    yield "delay", PLANT, replace(event, delay=Delay(0.07)), [0.02, 0.0]
    yield "clock", PLANT, replace(event, trigger=ClockTrigger(0.037)), [0.02, 0.0]
    yield "clock and delay", PLANT, replace(event, trigger=ClockTrigger(0.037), delay=Delay(0.1)), [0.02, 0.0]
    plant, wide = random_loop(3, 4, 3, 2, 2)
    trigger = EventTrigger(as_weight("output", wide), 0.02, 0.05)
    yield "two inputs", plant, Controller(wide, system_matched(wide), trigger), 0.05 * np.ones(4)


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize(("plant", "controller", "x"), [pytest.param(*of, id=name) for name, *of in _loops()])
def test_motion_agrees_with_dop853(plant, controller, x, beside):
    name = plant.inputs[0]
    shares = [Gaussian(input=name, share=0.6, corner=3.0, interval=0.02, seed=1, start=0.113)]
    shares += [Gaussian(input=plant.inputs[-1], share=0.4, interval=0.04, seed=4)]
    other = [Gaussian(input=name, size=0.02, interval=0.04, seed=2), Noise(input=name, size=0.01, corner=1.0, seed=3)]
    other += [Step(input=name, size=0.01, start=0.213)]
    acts = (*shares, *(other if beside else []))
    found = simulate(plant, controller, settings(1.0, disturbance=acts, record_interval=0.003), x0=x)
    d = make_disturbance(acts, plant.inputs)
    on_body = np.linalg.pinv(plant.B) @ plant.effect(other[2].push) if beside else np.zeros((plant.n_u, 1))

    def share(t):
        return d.beside(np.array([t]), np.ones((1, plant.n_u)))[0] - d(t)

    def torque(t):
        return d(t) + 0.01 * np.ravel(on_body) * (beside and t >= 0.213)

    bends = np.sort([*np.arange(1, 50) * 0.02, 0.113, 0.213])
    held = controller.design.plant.n
    times, states, last = ivp_run(
        plant, controller, 1.0, x, np.zeros(held), torque=torque, share=share, bends=bends, max_step=0.02
    )
    assert len(times) == len(found.events) >= 3
    np.testing.assert_allclose(found.events.t, times, atol=1e-9, rtol=0)
    np.testing.assert_allclose(found.events.x, states[:, : plant.n], atol=1e-10, rtol=1e-9)
    np.testing.assert_allclose(found.x[-1], last[: plant.n], atol=1e-10, rtol=1e-9)
    np.testing.assert_allclose(found.applied, found.u + d.at_rows(found.t, found.u), atol=1e-15)
    assert np.abs(found.applied - found.u).max() > 0.1 * np.abs(found.u).max()


def test_rows_change_no_bit_and_a_share_of_next_to_nothing_changes_next_to_nothing():
    controller = event_controller(pendulum_design(), q_t=0.004, delta_min=0.05)

    def events(interval, share):
        acts = (Gaussian(input="torque", share=share, seed=1),) if share else ()
        return simulate(PLANT, controller, settings(3.0, disturbance=acts, record_interval=interval), x0=[0.02, 0.0])

    fine, coarse = events(0.003, 0.3), events(0.7, 0.3)
    np.testing.assert_array_equal(fine.events.t, coarse.events.t)
    np.testing.assert_array_equal(fine.x[-1], coarse.x[-1])
    assert np.abs(events(0.7, 1e-12).events.t - events(0.7, 0.0).events.t).max() < 1e-9


def _stationary(controller, share, size, interval):
    """RMS of the plant's states at the ticks, from the closed equation of second moments.

    At a point of the grid z = (x, x_o, x_h, 1) is α + ξ β + η γ, with ξ and η the values there of the two noises, which
    are independent of α, β and γ; from point to point these follow from one another, with coefficients in ξ and η.
    """
    d = controller.design
    M = np.zeros((7, 7))
    M[:2, :2], M[:2, 4:6] = PLANT.A, -PLANT.B @ d.k
    M[2:4, :2], M[2:4, 2:4], M[2:4, 4:6] = d.L @ PLANT.C, d.plant.A - d.L @ d.plant.C, -d.plant.B @ d.k
    M[4:6, 4:6] = controller.hold.A_h
    Phi = expm(M * interval)

    def effect(kappa):
        """Of a line from 1 to 0, and from 0 to 1, times what ``kappa`` makes of z, by products with z."""
        whole = np.zeros((21, 21))  # z, p, q
        whole[:7, :7] = whole[7:14, 7:14] = whole[14:, 14:] = M
        whole[7:14, 14:] = np.eye(7)
        whole[:2, 7:14] = PLANT.B @ kappa[None]
        flow = expm(whole * interval)[:7]
        rising = flow[:, 14:] / interval
        return flow[:, 7:14] - rising, rising

    first, last = effect(np.r_[np.zeros(4), -share * d.k[0], 0.0])
    own, next_own = effect(np.r_[np.zeros(6), size])
    O = np.zeros((7, 7))
    powers = {  # of (ξ, η): what becomes of (α, β, γ)
        (0, 0): [[Phi, O, O], [last, O, O], [next_own, O, O]],
        (1, 0): [[first, Phi, O], [O, last, O], [O, next_own, O]],
        (0, 1): [[own, O, Phi], [O, O, last], [O, O, next_own]],
        (2, 0): [[O, first, O], [O, O, O], [O, O, O]],
        (1, 1): [[O, own, first], [O, O, O], [O, O, O]],
        (0, 2): [[O, O, own], [O, O, O], [O, O, O]],
    }
    moment = {0: 1.0, 1: 0.0, 2: 1.0, 3: 0.0, 4: 3.0}
    maps = {power: np.block(rows) for power, rows in powers.items()}
    pairs = [(a, b, weight) for a in maps for b in maps if (weight := moment[a[0] + b[0]] * moment[a[1] + b[1]])]
    jump = np.eye(7)
    jump[4:6, 4:6], jump[4:6, 2:4] = 0, np.eye(2)
    taken = np.kron(np.eye(3), jump)
    P = np.zeros((21, 21))
    P[6, 6] = 1.0
    for _ in range(150):
        for _ in range(round(controller.trigger.clock / interval)):
            P = sum(weight * (maps[a] @ P @ maps[b].T) for a, b, weight in pairs)
        at_tick, P = P, taken @ P @ taken.T
    alpha, beta, gamma = (at_tick[i : i + 2, i : i + 2] for i in (0, 7, 14))
    return np.sqrt(np.diag(alpha + beta + gamma))


def test_the_variance_solves_the_generalised_lyapunov_equation():
    controller = replace(event_controller(pendulum_design()), trigger=ClockTrigger(0.1))
    share, size, interval = 1.5, 0.02, 0.02
    exact, alone = _stationary(controller, share, size, interval), _stationary(controller, 0.0, size, interval)
    assert (exact / alone > 1.1).all()
    found = []
    for seed in range(24):
        acts = [Gaussian(input="torque", size=size, interval=interval, seed=2 * seed)]
        acts += [Gaussian(input="torque", share=share, interval=interval, seed=2 * seed + 1)]
        run = simulate(PLANT, controller, settings(410.0, record_interval=0.1, disturbance=acts))
        found.append(np.mean(run.events.x[run.events.t > 10] ** 2, axis=0))
    mean, error = np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    np.testing.assert_array_less(np.abs(mean - exact**2), 2.1 * error)
    assert (error < 0.05 * mean).all()
    assert (np.abs(mean - alone**2) > 5 * error).all()  # it would tell
