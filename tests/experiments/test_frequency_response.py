"""The frequency response of closed loops, against state-space forms of the composed loop, and against simulation."""

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj.controller.closed_loop import compose
from icmj.controller.setpoint import Target, sines
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant

F = np.array([0.1, 0.4, 1.0, 3.0])


def plant_of(seed: int, n: int = 3, n_u: int = 2, n_y: int = 2) -> LinearPlant:
    random = np.random.default_rng(seed)
    A, B, C = random.standard_normal((n, n)), random.standard_normal((n, n_u)), random.standard_normal((n_y, n))
    return LinearPlant(A, B, C)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_that_of_the_composed_loop(seed):
    assumed = plant_of(seed)
    actual = replace(assumed, B=0.9 * assumed.B, A=assumed.A + 0.02)
    design = icmj.design_lq(assumed, R_c=0.1, R_o=0.1)
    controller = icmj.Controller(design, icmj.system_matched(design), icmj.Continuous())
    found = icmj.experiments.frequency_response(actual, controller, F)
    loop = compose(actual, controller)
    x = np.linalg.solve(2j * np.pi * F[:, None, None] * np.eye(len(loop.F)) - loop.F, np.hstack([loop.D, loop.E]))
    np.testing.assert_allclose(found.x, x[:, :3], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.u, -loop.K @ x, rtol=1e-9, atol=1e-12)
    assert found.signals == ("d.u0", "d.u1", "n.y0", "n.y1")


def test_with_a_delay_it_is_the_limit_of_faster_clocks():
    plant = LinearPlant(np.array([[0.0, 1.0], [4.0, 0.0]]), np.array([[0.0], [1.0]]), np.eye(2))
    design = icmj.design_lq(plant, R_c=0.1, R_o=0.01)
    errors = []
    for ticks in (20, 40):
        delay = icmj.Delay(0.1)
        clock = icmj.ClockTrigger(0.1 / ticks)
        controller = icmj.Controller(design, icmj.system_matched(design), clock, delay)
        G = icmj.experiments.frequency_response(plant, controller, [0.5]).u[0, 0, 0]
        wave = icmj.Sinusoids(input="u0", terms=((1.0, np.pi, 0.0),))
        settings = icmj.Settings(duration=20.0, disturbance=(wave,), record_interval=0.01)
        run = icmj.simulate_plant(plant, controller, settings)
        t = run.t[run.t >= 16.0]
        phasor = 2 * np.trapezoid(run.u[run.t >= 16.0, 0] * np.exp(-1j * np.pi * t), t) / (t[-1] - t[0])
        errors.append(abs(phasor / G - 1))
    assert errors[1] < 0.02
    assert errors[1] < 0.6 * errors[0]


def test_of_a_set_point_it_is_the_gain_at_low_frequency():
    plant = LinearPlant(np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]))
    plant = replace(plant, states=("q", "v"), outputs=("y",), inputs=("u",), state_units=("rad", "rad/s"))
    design = icmj.design_lq(plant, R_c=0.1, R_o=0.01)
    r = icmj.setpoint(plant, [Target({"y": 1.0}, sines(1.0, 0.1, 0.0))])
    controller = icmj.Controller(design, icmj.system_matched(design), icmj.Continuous(), setpoint=r)
    found = icmj.experiments.frequency_response(plant, controller, [1e-4, 0.5])
    assert found.y[0, 0, found.of("r.y")] == pytest.approx(1.0, abs=1e-2)
    with pytest.raises(AnalysisError, match=r"no signal 'r\.x'"):
        found.of("r.x")


def test_what_is_not_linear_has_none():
    plant = plant_of(1, n=2, n_u=1, n_y=2)
    plant = replace(plant, outputs=("q", "v"), inputs=("u",))
    law = icmj.SwitchingPD(plant, "q", "v", 1.0, 1.0, 0.1)
    with pytest.raises(AnalysisError, match="not linear"):
        icmj.experiments.frequency_response(plant, law, F)
    with pytest.raises(AnalysisError, match="positive"):
        icmj.experiments.frequency_response(plant, law, [-1.0])
