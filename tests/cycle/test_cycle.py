"""Exact cycles: on the linear plant the theory's orbit, on the engine what simulations settle on, or never show."""

import numpy as np
import pytest
from cycle_cases import case, return_map

import icmj
from icmj.cycle.cycle import Cycle, find_cycle
from icmj.cycle.guess import guess_from_prediction
from icmj.errors import CycleError

PREDICTED = ("simple-0.8", "simple-1.2", "simple-1.7", "three-link-0.9", "neglected-0.1", "three-link-1.1-delay")


@pytest.mark.parametrize("name", PREDICTED)
def test_on_the_linear_plant_it_is_the_predicted_orbit(name: str) -> None:
    of = case(name)
    loop, predicted = return_map(of, "linear"), of.prediction
    guess = guess_from_prediction(of.theory, loop, of.theory.rule.size)
    off = guess.z + 2e-3 * guess.scale * np.random.default_rng(1).uniform(-1, 1, len(guess.z))
    found = find_cycle(of, "linear", start=type(guess)(off, guess.scale, guess.p, guess.sign, guess.longest))
    assert len(found.history) > 2, "the guess was not off"
    assert found.closure <= 1e-10
    assert found.interval == pytest.approx(predicted.delta_crit, rel=1e-9)
    assert found.period == pytest.approx(predicted.orbit.period, rel=1e-9)
    np.testing.assert_allclose(found.y_peak, predicted.orbit.y_peak, rtol=1e-9)
    np.testing.assert_allclose(found.y_range, predicted.orbit.y_range, rtol=1e-9)
    np.testing.assert_allclose(found.states[0], guess.z, atol=1e-9 * np.abs(guess.z).max())
    np.testing.assert_allclose(found.multipliers, predicted.multipliers, atol=1e-9)
    assert np.all(np.abs(found.multipliers - predicted.multipliers) <= found.multiplier_errors)
    assert found.attracting == (predicted.verdict == "attracting")


def settled(of: icmj.Case, found: Cycle, events: int = 40) -> icmj.Simulation:
    """A simulation from next to a cycle, off it along its slowest direction."""
    values, vectors = np.linalg.eig(found.J)
    slowest = np.real(vectors[:, np.argmax(np.abs(values))])
    z = found.states[0] + 1e-5 * slowest / np.abs(slowest / found.scale).max()
    start = return_map(of).split(z)
    return icmj.simulate(of, "mujoco", start=start, duration=events * found.interval)


def observed(run: icmj.Simulation, of: icmj.Case, found: Cycle) -> complex:
    """The multiplier that the departures from the cycle show, for one turn of ``found.intervals``."""
    events, p = run.events, len(found.intervals)
    z = return_map(of).join(events.x, events.x_o, events.x_h)[p - 1 :: p]
    turns = np.arange(1, len(z) + 1)
    d = (z - found.states[0] * (float(found.sign) ** turns)[:, None]) / found.scale
    size = np.abs(d).max(axis=1)
    d = d[(size > 1e-10) & (size < 1e-3)]
    if not found.multipliers[0].imag:
        a, b = d[:-1].ravel(), d[1:].ravel()
        return complex(a @ b / (a @ a))
    # of a pair: d_{i+1} = (μ + μ*) d_i − |μ|² d_{i−1}
    A = np.stack([d[1:-1].ravel(), d[:-2].ravel()], axis=1)
    s, q = np.linalg.lstsq(A, d[2:].ravel(), rcond=None)[0]
    return complex(max(np.roots([1, -s, -q]), key=lambda root: root.imag))


def agrees_with_a_long_simulation(name: str, q_t: float) -> None:
    of = case(name, controller__q_t=q_t)
    start = "simulation" if of.prediction.verdict != "attracting" else "prediction"
    found = find_cycle(of, "mujoco", start=start)
    assert found.attracting
    assert found.closure <= 1e-10
    assert len(found.history) <= 12
    run = settled(of, found)
    motion = icmj.measure(run, T_hat=of.system.T_hat)
    assert (motion.p, motion.mirrored) == (found.events, found.mirrored)
    p = len(found.intervals)
    assert run.events.interval[-p:].sum() == pytest.approx(found.intervals.sum(), rel=1e-9)
    np.testing.assert_allclose(motion.amplitude, found.y_peak, rtol=1e-8)
    if abs(found.multipliers[0]) > 0.02:  # else two turns are at the floor of what a flight resolves
        assert abs(observed(run, of, found) - found.multipliers[0]) < 1e-3


@pytest.mark.parametrize(("name", "q_t"), [("simple-0.8", 0.3), ("three-link-1.1", 0.01)])
def test_it_is_what_a_long_simulation_settles_on(name: str, q_t: float) -> None:
    agrees_with_a_long_simulation(name, q_t)


ATTRACTING = (
    *("simple-0.8", "simple-1.2", "simple-1.7", "simple-exact", "three-link-0.9", "three-link-1.1"),
    *("neglected-0.1", "neglected-0.5", "three-link-0.9-delay", "three-link-1.1-delay"),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ATTRACTING)
@pytest.mark.parametrize("q_t", [0.01, 0.3])
def test_every_shipped_case_at_a_small_and_a_large_threshold(name: str, q_t: float) -> None:
    agrees_with_a_long_simulation(name, q_t)


def test_towards_small_thresholds_it_tends_to_the_linear_orbit_with_the_square() -> None:
    gaps = []
    for q_t in (4e-3, 2e-3, 1e-3):
        of = case("simple-0.8", controller__q_t=q_t)
        found, predicted = find_cycle(of), of.prediction
        gaps.append(
            [
                abs(found.interval / predicted.delta_crit - 1),
                abs(found.y_peak[0] / predicted.orbit.y_peak[0] - 1),
                abs(found.multipliers - predicted.multipliers)[0],
            ]
        )
    slopes = np.log2(np.array(gaps)[:-1] / np.array(gaps)[1:])
    np.testing.assert_allclose(slopes, 2, atol=0.02)


def test_a_repelling_cycle_is_found_which_no_simulation_shows() -> None:
    of = case("simple-1.7")
    found = find_cycle(of)
    assert not found.attracting
    assert found.interval == pytest.approx(of.prediction.delta_crit, rel=1e-6)
    run = settled(of, found, events=100)
    away = np.abs(run.events.interval - found.interval)
    assert away[:8].max() < 1e-3
    assert away[-10:].min() > 0.1
    assert abs(observed(settled(of, found, events=20), of, found) - found.multipliers[0]) < 1e-3


@pytest.mark.parametrize(("name", "changes", "plant", "words"), [
    ("simple-exact", {}, "linear", "grows without bound"),
    ("simple-0.8", {"controller__delta_min": 2.0}, "mujoco", "least one, 2 s"),
    ("simple-0.8", {"controller__q_t": 0.5, "simulation__limit": 0.2}, "mujoco", "fell"),
    ("quiet-standing", {}, "mujoco", "noise acts"),
])  # fmt: skip
def test_where_there_is_none_it_says_why(name: str, changes: dict[str, float], plant: str, words: str) -> None:
    with pytest.raises(CycleError, match=words):
        find_cycle(case(name, **changes), plant)
