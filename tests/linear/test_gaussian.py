"""Gaussian noise: its law, its spectrum, and what a loop makes of it, against closed forms and SciPy's integrator."""

import numpy as np
import pytest
from linear_cases import (
    PLANT,
    continuous,
    driven,
    event_controller,
    ivp_run,
    pendulum_design,
    settings,
    settings_from,
)
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.signal import welch
from scipy.stats import chi2

from icmj.errors import SimulationError
from icmj.linear.run import simulate
from icmj.measurement.statistics import statistics
from icmj.simulation.disturbance import make_disturbance, make_reading_error
from icmj.simulation.grid import draw_at_points, interpolate_at
from icmj.simulation.sources import Gaussian, Impulse, Noise


@pytest.mark.parametrize("corner", [None, 0.5, 8.0])
def test_the_law_at_the_points(corner):
    noise = Gaussian(output="angle", size=3.0, corner=corner, interval=0.02, seed=7)
    x = draw_at_points(noise, 0, 200_000) / 3.0
    a = 0.0 if corner is None else np.exp(-2 * np.pi * corner * 0.02)
    # x² is correlated as a²: this many values are independent
    count = len(x) * (1 - a**2) / (1 + a**2)
    assert np.mean(x**2) == pytest.approx(1.0, abs=3 * np.sqrt(2 / count))
    fresh = (x[1:] - a * x[:-1]) / np.sqrt(1 - a**2)
    assert np.mean(fresh**2) == pytest.approx(1.0, abs=3 * np.sqrt(2 / len(fresh)))
    for lag in (1, 2, 5):
        assert abs(np.mean(fresh[lag:] * fresh[:-lag])) < 3 / np.sqrt(len(fresh))
    assert np.mean(fresh**4) == pytest.approx(3.0, abs=3 * np.sqrt(96 / len(fresh)))  # as normal as that


def test_the_beginning_is_the_same_however_much_follows():
    noise = Gaussian(input="torque", corner=1.0, seed=3)
    short = draw_at_points(noise, 0, 300).copy()
    np.testing.assert_array_equal(draw_at_points(noise, 0, 70_000)[:300], short)
    np.testing.assert_array_equal(draw_at_points(noise, 250, 300), short[250:])
    assert interpolate_at(noise, np.array([0.105]))[0] == pytest.approx((short[10] + short[11]) / 2)


@pytest.mark.parametrize("corner", [None, 2.0])
def test_the_spectrum_is_the_closed_form(corner):
    noise = Gaussian(input="torque", size=2.0, corner=corner, interval=0.02, seed=11)
    rate, length = 400.0, 4000
    signal = interpolate_at(noise, np.arange(400 * length) / rate)
    f, power = welch(signal, rate, "hann", length, noverlap=0, detrend=False)
    a = 0.0 if corner is None else np.exp(-2 * np.pi * corner * 0.02)
    turn = np.exp(-2j * np.pi * f * 0.02)
    # a sequence's spectrum, through the triangle that joins its points
    exact = 2 * 4.0 * 0.02 * (1 - a**2) / np.abs(1 - a * turn) ** 2 * np.sinc(f * 0.02) ** 4
    for band in np.array_split(np.arange(5, 300), 12):  # from half a hertz to 30 Hz
        share = np.mean(power[band] / exact[band])
        # of Hann's window two neighbours are about as good as one that is independent
        degrees = 400 * len(band)
        low, high = chi2.ppf([5e-4, 1 - 5e-4], degrees) / degrees
        assert low < share < high, (f[band[0]], share)


@pytest.mark.parametrize("corner", [None, 1.0])
def test_the_variance_solves_lyapunovs_equation(corner):
    interval, sizes = 0.01, np.array([0.1, 0.01])
    A, B, C = driven()
    M = np.zeros((8, 8))
    M[:4, :4], M[:4, 4:6], M[4:6, 6:] = A, B, np.eye(2) / interval
    Phi = expm(M * interval)[:4]
    at_end, at_start = Phi[:, 6:], Phi[:, 4:6] - Phi[:, 6:]
    a = 0.0 if corner is None else np.exp(-2 * np.pi * corner * interval)
    F = np.block([[Phi[:, :4], at_start + a * at_end], [np.zeros((2, 4)), a * np.eye(2)]])
    G = np.vstack([at_end, np.eye(2)]) * sizes * np.sqrt(1 - a**2)
    P = solve_discrete_lyapunov(F, G @ G.T)
    exact = float(np.sqrt((C @ P[:4, :4] @ C.T).item()))
    found = []
    for seed in range(8):
        acts = (
            Gaussian(input="torque", size=sizes[0], corner=corner, interval=interval, seed=2 * seed),
            Gaussian(output="angle", size=sizes[1], corner=corner, interval=interval, seed=2 * seed + 1),
        )
        told = statistics(simulate(PLANT, continuous(), settings(150.0, record_interval=0.02, disturbance=acts)))
        assert told is not None
        found.append(told.rms[0])
    within = [abs(rms.value - exact) <= rms.error for rms in found]
    assert sum(within) >= 7, [(rms.value / exact, rms.error / exact) for rms in found]
    assert np.sqrt(np.mean([rms.value**2 for rms in found])) == pytest.approx(exact, rel=0.04)


@pytest.mark.slow
@pytest.mark.kernels
def test_motion_agrees_with_dop853_beside_all_else():
    acts = (
        Gaussian(input="torque", size=0.05, corner=3.0, interval=0.05, seed=1, start=0.32),
        Gaussian(output="angle", size=2e-3, interval=0.1, seed=2),
        Gaussian(input="torque", on="body", size=0.02, interval=0.05, seed=3),
        Noise(input="torque", size=0.03, bandwidth=6.0, seed=3),
        Impulse("torque", 0.01, 0.513, 0.02, on="command"),
    )
    plant, controller = PLANT, event_controller(pendulum_design(), q_t=0.004, delta_min=0.05)
    chosen = settings(1.5, disturbance=acts, record_interval=0.003)
    found = simulate(plant, controller, chosen, x0=[0.02, 0.0])
    beside = make_disturbance(acts, plant.inputs)
    on_body, reading = make_disturbance(acts[2:3], ()), make_reading_error(acts, plant.outputs)
    assert len(on_body) == 0

    def torque(t):  # on the body a torque is one behind the gain
        return beside(t) + interpolate_at(acts[2], np.asarray(t)) / 0.9

    times, states, _ = ivp_run(
        plant, controller, 1.5, [0.02, 0.0], [0.0, 0.0], torque=torque, reading=reading, max_step=2e-4
    )
    assert len(times) == len(found.events) >= 4
    np.testing.assert_allclose(found.events.t, times, atol=1e-7, rtol=0)
    np.testing.assert_allclose(found.events.x, states[:, :2], atol=1e-7, rtol=0)
    coarse = simulate(plant, controller, settings(1.5, disturbance=acts, record_interval=0.7), x0=[0.02, 0.0])
    np.testing.assert_array_equal(coarse.events.t, found.events.t)


def test_a_run_file_gives_it_and_what_does_not_fit_is_refused():
    table = {"kind": "gaussian", "input": "torque", "size": 0.1, "corner": 2.0, "interval": 0.02, "seed": 5}
    chosen = settings_from({"disturbance": [table]})
    assert chosen.disturbance == (Gaussian(input="torque", size=0.1, corner=2.0, interval=0.02, seed=5),)
    assert chosen.noisy
    with pytest.raises(SimulationError, match="whole multiples"):
        settings(disturbance=(*chosen.disturbance, Gaussian(output="angle", interval=0.03)))
    for wrong in ({"size": 0}, {"corner": -1.0}, {"interval": 0.0}, {"seed": -1}, {"start": -1.0}):
        with pytest.raises(SimulationError, match=r"^gaussian\b"):
            Gaussian(input="torque", **wrong)
