"""Noise on the engine: against the linear plant, itself at other steps and in other threads."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from engine_cases import controller, plant

from icmj import Bias, Delay, Gaussian, Noise, Settings, Simulation
from icmj.engine.block import find_block
from icmj.engine.closed_loop import close_loop
from icmj.engine.run import simulate
from icmj.errors import SimulationError
from icmj.linear.run import simulate as simulate_linear
from icmj.simulation.disturbance import make_reading_error
from icmj.simulation.sources import Source

Kind = Callable[[float], tuple[Source, ...]]


def sources(size: float = 1.0) -> tuple[Source, ...]:
    """Noise on an input and on two outputs, and a bias."""
    return (
        Noise(input="ankle_torque", size=0.5 * size, corner=0.5, seed=1),
        Noise(output="shank", size=5e-4 * size, corner=1.0, seed=2, start=0.1234),
        Noise(output="trunk", size=5e-4 * size, bandwidth=5.0, seed=3),
        Bias("thigh", 3e-4 * size, start=0.5003),
    )


def drawn(size: float = 1.0) -> tuple[Source, ...]:
    """Gaussian noise on an input, two outputs and a body, on two grids, and a bias that begins between their points."""
    return (
        Gaussian(input="ankle_torque", size=0.5 * size, corner=0.5, interval=0.02, seed=1),
        Gaussian(output="shank", size=5e-4 * size, corner=1.0, interval=0.02, seed=2, start=0.1234),
        Gaussian(output="trunk", size=3e-4 * size, interval=0.04, seed=3),
        Gaussian(body="trunk", force=(1.0, 0.0, 0.0), size=0.5 * size, corner=1.0, interval=0.02, seed=4),
        Bias("thigh", 3e-4 * size, start=0.5003),
    )


KINDS = pytest.mark.parametrize("kind", [sources, drawn])


def run(size: float = 1.0, delay: float = 0.0, kind: Kind = sources, **more: object) -> Simulation:
    chosen = Settings(**{"duration": 3.0, "disturbance": kind(size), **more})  # type: ignore[arg-type]
    control = replace(controller("three_link", 0.01 * size), delay=Delay(delay))
    return simulate(plant("three_link", 0.9), control, chosen, x0=0.01 * size * np.ones(6))


@KINDS
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_both_plants_driven_by_the_same_noise_agree_to_the_order_of_the_nonlinearity(delay: float, kind: Kind) -> None:
    body = plant("three_link", 0.9)
    departures, sizes = [], (0.2, 0.1, 0.05)
    for size in sizes:
        engine = run(size, delay, kind, timestep=5e-4)
        control = replace(controller("three_link", 0.01 * size), delay=Delay(delay))
        chosen = Settings(duration=3.0, disturbance=kind(size))
        linear = simulate_linear(body.pushed(chosen.pushes), control, chosen, x0=0.01 * size * np.ones(6))
        assert len(engine.events) == len(linear.events) >= 4
        departures.append(np.abs(engine.events.t - linear.events.t).max())
    slope = np.polyfit(np.log(sizes), np.log(departures), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.05)


@KINDS
def test_event_times_converge_at_fourth_order(kind: Kind) -> None:
    exact = run(kind=kind, timestep=2.5e-4).events.t
    errors = [np.abs(run(kind=kind, timestep=h).events.t - exact).max() for h in (8e-3, 4e-3, 2e-3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.7), orders


@KINDS
def test_chosen_steps_keep_to_their_tolerance(kind: Kind) -> None:
    exact = run(kind=kind, timestep=2.5e-4).events.t
    for tolerance in (1e-5, 1e-8):
        times = run(kind=kind, tolerance=tolerance).events.t
        assert np.abs(np.diff(times) / np.diff(exact) - 1).max() < 5 * tolerance  # aimed at in each interval


@KINDS
def test_one_seed_gives_the_same_bits_repeated_and_in_threads(kind: Kind) -> None:
    alone = run(kind=kind)
    with ThreadPoolExecutor(2) as pool:
        for other in [run(kind=kind), *pool.map(lambda _: run(kind=kind), range(4))]:
            for name in ("t", "x", "x_o", "x_h"):
                np.testing.assert_array_equal(getattr(alone, name), getattr(other, name))


def test_the_noise_itself_does_not_depend_on_the_step() -> None:
    tables = []
    for timestep, integrator in ((1e-3, "RK4"), (4e-3, "Euler")):
        chosen = Settings(timestep=timestep, integrator=integrator, disturbance=sources())  # type: ignore[arg-type]
        block = find_block(close_loop(plant("three_link", 0.9), controller("three_link"), chosen).model)
        assert block is not None
        tables.append((block.terms.copy(), block.errors.copy()))
    for a, b in zip(*tables, strict=True):
        assert len(a) > 0
        np.testing.assert_array_equal(a, b)
    n = make_reading_error(sources(), ("shank", "thigh", "trunk"))
    t, errors = 1.7, tables[0][1]
    for output in range(3):
        mine = errors[errors[:, 0] == output]
        total = (mine[:, 1] * np.cos(mine[:, 2] * t + mine[:, 3]) * (mine[:, 4] <= t)).sum()
        assert total == pytest.approx(n(t)[output], abs=1e-15)


def test_the_plant_does_not_feel_what_the_observer_reads() -> None:
    heard = run(disturbance=(Bias("shank", 1e-3),))
    np.testing.assert_allclose(heard.y, np.cumsum(heard.x[:, :3], axis=1), atol=1e-15)
    assert not heard.noisy
    assert np.abs(heard.x[-1] - run(disturbance=()).x[-1]).max() > 1e-4


def test_noise_on_an_output_that_is_not_there_is_one_line() -> None:
    with pytest.raises(SimulationError, match="output 'knee': the plant's outputs are shank, thigh, trunk"):
        run(disturbance=(Noise(output="knee", size=1.0, corner=1.0),))
