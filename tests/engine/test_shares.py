"""Noise whose size is a share of the command on the engine: against SciPy's integrator and the linear plant."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
import pytest
from engine_cases import controller, plant
from scipy.integrate import solve_ivp

from icmj import Continuous, Delay, EventTrigger, Gaussian, Settings, Simulation
from icmj.engine.run import simulate
from icmj.errors import SimulationError
from icmj.linear.run import simulate as simulate_linear
from icmj.simulation.grid import interpolate_at
from icmj.simulation.sources import Source

ANKLE, HIP = "ankle_torque", "hip_torque"


def sources(size: float = 1.0) -> tuple[Source, ...]:
    """Two noises on one input and one on another, beside noise of constant size."""
    return (
        Gaussian(input=ANKLE, size=0.2 * size, corner=0.5, interval=0.04, seed=1),
        Gaussian(input=ANKLE, share=0.3, corner=1.0, interval=0.02, seed=2),
        Gaussian(input=ANKLE, share=0.2, interval=0.04, seed=3, start=0.1234),
        Gaussian(input=HIP, share=0.4, interval=0.02, seed=4),
        Gaussian(output="trunk", size=3e-4 * size, interval=0.04, seed=5),
    )


def run(size: float = 1.0, delay: float = 0.0, **more: object) -> Simulation:
    chosen = Settings(**{"duration": 2.0, "disturbance": sources(size), **more})  # type: ignore[arg-type]
    control = replace(controller("three_link", 0.01 * size), delay=Delay(delay))
    return simulate(plant("three_link", 0.9), control, chosen, x0=0.01 * size * np.ones(6))


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_both_plants_agree_to_the_order_of_the_nonlinearity(delay: float) -> None:
    departures, sizes = [], (0.1, 0.05, 0.025)
    for size in sizes:
        engine = run(size, delay, tolerance=1e-11)
        control = replace(controller("three_link", 0.01 * size), delay=Delay(delay))
        chosen = Settings(duration=2.0, disturbance=sources(size))
        body = plant("three_link", 0.9).linearisation.plant
        linear = simulate_linear(body, control, chosen, x0=0.01 * size * np.ones(6))
        assert len(engine.events) == len(linear.events) >= 3
        departures.append(np.abs(engine.events.t - linear.events.t).max())
    slope = np.polyfit(np.log(sizes), np.log(departures), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.05)


def test_event_times_agree_with_dop853_on_the_bare_plant() -> None:
    noise = Gaussian(input=ANKLE, share=0.5, corner=2.0, interval=0.05, seed=2)
    body, control = plant("three_link", 0.9), controller("three_link", 0.01)
    found = simulate(body, control, Settings(duration=2.0, disturbance=(noise,), tolerance=1e-11), x0=0.01 * np.ones(6))
    gains, trigger, point, y_0 = control.design, control.trigger, body.linearisation.point, body.linearisation.y
    assert isinstance(trigger, EventTrigger)
    A, B, C = gains.plant.A, gains.plant.B, gains.plant.C
    model = body.spec.copy().compile()
    data, here = mujoco.MjData(model), body.linearisation.plant.inputs.index(ANKLE)

    def flow(t: float, s: np.ndarray) -> np.ndarray:
        u = -gains.k @ s[12:]
        acting = u.copy()
        acting[here] *= 1 + interpolate_at(noise, np.array([t]))[0]
        data.qpos[:], data.qvel[:] = point.qpos + s[:3], point.qvel + s[3:6]
        data.ctrl[:] = point.ctrl + body.linearisation.ports.b * acting
        mujoco.mj_forward(model, data)
        y = np.array(data.sensordata) - y_0
        seen = A @ s[6:12] + B @ u + gains.L @ (y - C @ s[6:12])
        return np.concatenate([s[3:6], data.qacc, seen, control.hold.A_h @ s[12:]])

    def event(t: float, s: np.ndarray) -> float:
        e = s[12:] - s[6:12]
        return float(e @ trigger.Q_t @ e) - trigger.q_t**2

    event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
    t, s, times = 0.0, np.concatenate([0.01 * np.ones(6), np.zeros(12)]), []
    while t < 2.0 - 1e-12:
        bend = min(0.05 * (np.floor(t / 0.05 + 1e-9) + 1), 2.0)
        part = solve_ivp(flow, (t, bend), s, "DOP853", events=event, rtol=1e-12, atol=1e-15)
        t, s = float(part.t[-1]), part.y[:, -1].copy()
        if part.status == 1:
            times.append(t)
            s[12:] = s[6:12]
    assert len(times) >= 3
    np.testing.assert_allclose(found.events.t, times, atol=1e-9, rtol=0)


def test_event_times_converge_at_fourth_order() -> None:
    exact = run(timestep=2.5e-4).events.t
    errors = [np.abs(run(timestep=h).events.t - exact).max() for h in (4e-3, 2e-3, 1e-3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.7), orders


def test_one_seed_gives_the_same_bits_in_threads_and_the_command_that_acted_is_recorded() -> None:
    alone = run()
    with ThreadPoolExecutor(2) as pool:
        for other in pool.map(lambda _: run(), range(2)):
            for name in ("t", "x", "applied"):
                np.testing.assert_array_equal(getattr(alone, name), getattr(other, name))
    shared = [noise for noise in sources() if isinstance(noise, Gaussian) and noise.share]
    beside = interpolate_at(sources()[0], alone.t)  # type: ignore[arg-type]
    beside = beside + sum(interpolate_at(noise, alone.t) for noise in shared[:2]) * alone.u[:, 0]
    np.testing.assert_allclose(alone.applied[:, 0], alone.u[:, 0] + beside, atol=1e-12)
    np.testing.assert_allclose(
        alone.applied[:, 2], alone.u[:, 2] * (1 + interpolate_at(shared[2], alone.t)), atol=1e-12
    )


@pytest.mark.parametrize("which", ["mujoco", "linear"])
def test_commands_that_follow_from_readings_are_refused(which: str) -> None:
    body, control = plant("three_link", 0.9), replace(controller("three_link"), trigger=Continuous())
    go = partial(simulate, body) if which == "mujoco" else partial(simulate_linear, body.linearisation.plant)
    with pytest.raises(SimulationError, match=r"share = 0\.3 needs commands that follow from a hold .* a continuous"):
        go(control, Settings(disturbance=sources()))
