"""Noise on the linear plant: against SciPy's integrator, Lyapunov equations and integrals over frequency."""

import tracemalloc
from functools import cache

import numpy as np
import pytest
from kernel_cases import computed, kernels
from linear_cases import (
    PLANT,
    continuous,
    driven,
    event_controller,
    ivp_events,
    pendulum_design,
    settings,
    settings_from,
)
from scipy.integrate import quad
from scipy.linalg import solve_continuous_lyapunov

from icmj import Bias, Impulse, Noise, statistics
from icmj.linear.run import simulate
from icmj.simulation.disturbance import LOW_PASS_END, make_disturbance, make_reading_error


def sources(seed: int, colour: dict[str, float]) -> tuple[Noise, Noise]:
    """Process and sensor noise whose lines are too many to be told from noise within a run."""
    return (
        Noise(input="torque", size=0.02, seed=2 * seed, terms=300, **colour),
        Noise(output="angle", size=0.004, seed=2 * seed + 1, terms=300, **colour),
    )


def test_memory_does_not_grow_with_what_switches() -> None:
    """Each stretch of time has tables of its own, of 17 MB here; they were made for all of them, and kept."""
    acts: list[Noise | Impulse] = [Noise("torque", 0.01, bandwidth=5.0, terms=2000)]
    acts += [Impulse("torque", 1e-4, start=i / 100, duration=0.003) for i in range(40)]
    tracemalloc.start()
    simulate(PLANT, event_controller(pendulum_design()), settings(duration=0.5, disturbance=tuple(acts)))
    assert tracemalloc.get_traced_memory()[1] < 2.5e8
    tracemalloc.stop()


def test_noise_and_bias_agree_with_dop853() -> None:
    controller = event_controller(pendulum_design())
    disturbance = [
        {"kind": "noise", "output": "angle", "size": 2e-3, "bandwidth": 2.0, "seed": 3},
        {"kind": "noise", "input": "torque", "size": 0.01, "corner": 0.3, "seed": 4},
        {"kind": "bias", "output": "angle", "size": 1e-3},
    ]
    chosen = settings_from({"duration": 4.0, "limit": 1e6, "initial": {"hinge": 0.02}, "disturbance": disturbance})
    run = simulate(PLANT, controller, chosen)
    torque = make_disturbance(chosen.disturbance, PLANT.inputs)
    reading = make_reading_error(chosen.disturbance, PLANT.outputs)
    times, states = ivp_events(PLANT, controller, 4.0, [0.02, 0], [0, 0], torque=torque, reading=reading, max_step=0.01)
    assert len(run.events) == len(times) >= 4
    assert np.abs(run.events.t - times).max() < 1e-8
    assert np.abs(np.hstack([run.events.x, run.events.x_o, run.events.x_h]) - states).max() < 1e-9
    np.testing.assert_allclose(run.y, run.x @ PLANT.C.T)  # what is recorded is what is there, not what is read


def test_a_bias_leans_the_plant_as_statics_says() -> None:
    A, B, C = driven()
    run = simulate(PLANT, continuous(), settings(20.0, disturbance=(Bias("angle", 0.01),)))
    assert run.y[-1] == pytest.approx(-C @ np.linalg.solve(A, B @ [0, 0.01]), rel=1e-9)
    assert not run.noisy


def test_variance_under_low_pass_noise_solves_a_lyapunov_equation() -> None:
    corner = 1.0
    A, B, C = driven()
    # each noise is a first-order filter of white noise, a state more
    filters = 2 * np.pi * corner * np.eye(2)
    F = np.block([[A, B], [np.zeros((2, 4)), -filters]])
    Q = np.zeros((6, 6))
    Q[4:, 4:] = 2 * filters * np.array([0.02, 0.004]) ** 2
    exact = (C @ solve_continuous_lyapunov(F, -Q)[:4, :4] @ C.T).item()
    # the power beyond the spectrum's end is spread over what is within it, and the pendulum sways little beyond
    assert_rms(np.sqrt(exact * (np.pi / 2) / np.arctan(LOW_PASS_END)), {"corner": corner})


def test_variance_under_flat_noise_is_an_integral_over_frequency() -> None:
    bandwidth = 2.0
    A, B, C = driven()
    sizes = np.array([0.02, 0.004])

    def density(f: float) -> float:
        gain = (C @ np.linalg.solve(2j * np.pi * f * np.eye(4) - A, B))[0]
        return float(np.sum(np.abs(gain) ** 2 * sizes**2) / bandwidth)

    assert_rms(np.sqrt(quad(density, 0, bandwidth, limit=200)[0]), {"bandwidth": bandwidth})


def assert_rms(exact: float, colour: dict[str, float]) -> None:
    """Eight runs of different seeds: their RMS agrees with the theory's, to the confidence that each claims."""
    found = []
    for seed in range(8):
        run = simulate(PLANT, continuous(), settings(150.0, record_interval=0.02, disturbance=sources(seed, colour)))
        told = statistics(run)
        assert told is not None
        found.append(told.rms[0])
    within = [abs(rms.value - exact) <= rms.error for rms in found]
    assert sum(within) >= 7, [(rms.value / exact, rms.error / exact) for rms in found]
    assert np.sqrt(np.mean([rms.value**2 for rms in found])) == pytest.approx(exact, rel=0.03)
    assert max(rms.error for rms in found) < 0.25 * exact


# one seed by several steps and numbers of BLAS threads, a line each: the bits' hash, and the events with the last state
RUNS = """
import functools, gc, hashlib
from linear_cases import PENDULUM, event_controller, pendulum_design, settings
from threadpoolctl import threadpool_info, threadpool_limits
from icmj.linear.run import simulate
from icmj.simulation.sources import Noise
for threads, timestep in ((1, 1e-3), (1, 5e-3), (2, 1e-3), (4, 1e-3)):
    threadpool_limits(threads, "blas")
    for kept in gc.get_objects():  # no matrix of the run before
        if type(kept) is functools._lru_cache_wrapper and str(kept.__module__).startswith("icmj."):
            kept.cache_clear()
    assert {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"} == {threads}
    chosen = settings(8.0, timestep=timestep, disturbance=(
        Noise(input="torque", size=0.02, corner=0.5, seed=1, terms=200),
        Noise(output="angle", size=1e-3, bandwidth=3.0, seed=2)
    ))
    run = simulate(PENDULUM.scaled(0.9), event_controller(pendulum_design()), chosen, x0=[0.01, 0.0])
    bits = hashlib.sha256(run.x.tobytes() + run.t.tobytes() + run.events.t.tobytes()).hexdigest()
    print(bits, *run.events.t, *run.x[-1])
"""


@cache
def of_kernel(kernel: str) -> list[str]:
    return computed(RUNS, kernel, threads=4).splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("kernel", kernels())
def test_one_seed_gives_the_same_bits_whatever_step_and_threads(kernel: str) -> None:
    said = of_kernel(kernel)
    assert len(said) == 4
    assert len({*said}) == 1


@pytest.mark.slow
def test_one_seed_gives_the_same_motion_to_nine_digits_on_other_processors() -> None:
    """For some seconds: later rounding has grown until it decides when events are, and motions are equal in law."""
    runs = [of_kernel(kernel)[0] for kernel in kernels()]
    first, *others = (np.array(run.split()[1:], dtype=float) for run in runs)
    assert len(first) >= 5
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-9, atol=1e-12)
