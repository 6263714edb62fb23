"""Rounds of switched feedback: against a plain integration with a history, scaling, and long simulations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from terminal_cases import told

from icmj import LinearPlant, Settings, load_run, prepare, run_case, simulate_plant
from icmj.controller.switching import SwitchingPD, compute_slope
from icmj.errors import AnalysisError
from icmj.experiments.switching_rounds import attraction, rounds, rounds_of

MGH, INERTIA = 60 * 9.81, 60.0
A = np.array([[0, 1], [0.2 * MGH / INERTIA, -4 / INERTIA]])
PLANT = LinearPlant(A, [[0], [1 / INERTIA]], np.eye(2), states=("theta", "theta_rate"), inputs=("torque",),
                    outputs=("theta", "omega"))  # fmt: skip
LAW = SwitchingPD(PLANT, "theta", "omega", P=0.25 * MGH, D=10.0, delay=0.2, slope=-0.4)


def plain(P: float, D: float, duration: float, step: float = 2e-4) -> np.ndarray:
    """θ and θ' by Heun's steps, with a list of what was."""
    late = round(0.2 / step)
    x = np.tile([1.0, 0.0], (late + 1, 1))
    states = list(x)

    def rate(now: np.ndarray, then: np.ndarray) -> np.ndarray:
        on = then[0] * (then[1] + 0.4 * then[0]) > 0
        return A @ now - np.array([0, (P * then[0] + D * then[1]) / INERTIA * on])

    for _ in range(round(duration / step)):
        now, then, next_then = states[-1], states[-1 - late], states[-late]
        first = rate(now, then)
        states.append(now + step / 2 * (first + rate(now + step * first, next_then)))
    return np.array(states)


def test_the_published_gains_stand_by_the_factor_that_the_page_says() -> None:
    found = rounds(PLANT, LAW)
    assert found.factor == pytest.approx(0.73140938, abs=5e-9)
    assert found.period == pytest.approx(1.155262, abs=5e-7)
    assert (found.switches, found.verdict) == (2, "stands")


@pytest.mark.parametrize(("P", "D"), [(0.25, 10.0), (0.7, 15.0), (0.9, 20.0)])
def test_a_plain_integration_grows_or_shrinks_as_fast(P: float, D: float) -> None:
    found = rounds(PLANT, replace(LAW, P=P * MGH, D=D))
    size = np.linalg.norm(plain(P * MGH, D, 8 * found.period), axis=1)
    late = round(found.period / 2e-4)
    # a switch is met up to a step late, which is of first order; over these gains a part in five hundred at most
    assert size[-1] / size[-1 - 2 * late] == pytest.approx(found.factor**2, rel=5e-3)


def test_size_and_sign_of_the_start_do_not_matter() -> None:
    ones = [rounds(PLANT, LAW, direction=direction) for direction in ([1, 0], [-3, 0], [1, 0.5], [-1, -0.5])]
    np.testing.assert_allclose([one.factor for one in ones], ones[0].factor, rtol=1e-9)
    with pytest.raises(AnalysisError, match="only without one are rounds in proportion"):
        rounds(PLANT, replace(LAW, dead_zone=0.004))


def test_the_map_tells_who_stands_as_long_simulations_do() -> None:
    random = np.random.default_rng(3)
    P, D = MGH * random.uniform(0.05, 1.4, 6), random.uniform(-20, 280, 6)
    drawn = attraction(PLANT, LAW, P, D)
    assert drawn.factor.shape == (6, 6)
    settings = Settings(duration=150.0, limit=1e8, record_interval=1.0)
    agreed = 0
    for j, d in enumerate(D):
        for i, p in enumerate(P):
            run = simulate_plant(PLANT, replace(LAW, P=p, D=d), settings, x0=[1e-4, 2e-5])
            size = np.linalg.norm(run.x, axis=1)
            grows = run.outcome.kind == "fell" or size[-1] > size[len(size) // 2]
            assert grows != drawn.stands[j, i], (p / MGH, d)
            agreed += 1
    assert agreed == 36


def test_with_a_dead_zone_there_is_a_cycle_in_proportion_to_it() -> None:
    found = {}
    for r in (0.004, 0.02):
        run = simulate_plant(PLANT, replace(LAW, dead_zone=r), Settings(duration=300.0), x0=[2.5 * r, 0])
        found[r] = rounds_of(run), np.abs(run.y[run.t > 280]).max(axis=0) / r
    (small, size), (large, other) = found.values()
    assert (small.switches, small.words) == (4, "It settles on a cycle of 4.13103 s (4 switches).")
    assert small.period == pytest.approx(large.period, rel=1e-7)
    assert small.multiplier == pytest.approx(large.multiplier, rel=1e-2)
    np.testing.assert_allclose(size, other, rtol=1e-3)  # at rows


def test_what_is_left_of_a_departure_is_what_one_put_in_leaves() -> None:
    law, settings = replace(LAW, dead_zone=0.004), Settings(duration=200.0)
    paths = [simulate_plant(PLANT, law, settings, x0=[0.01 + push, 0]) for push in (0.0, 1e-7)]
    apart = np.abs(paths[1].events.t - paths[0].events.t)[20::4]
    # times of one side move as the phase does, which keeps what the start put in: their differences do not
    steps = np.abs(np.diff(apart))[:20]
    told_by_two = np.exp(np.polyfit(np.arange(20), np.log(steps), 1)[0])
    long = simulate_plant(PLANT, law, Settings(duration=300.0), x0=[0.01, 0])
    assert rounds_of(long).multiplier == pytest.approx(told_by_two, rel=0.02)


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_on_the_command_line(plant: str, shell) -> None:
    said = shell.answers(["cycle", "one-link-switching", "--plant", plant, "--json"])
    assert said["switches"] == 4
    assert said["period"] == pytest.approx(4.131, abs=5e-4)
    (line,) = told(shell.refuses(["cycle", "one-link-delayed-pd", "--plant", plant]))
    assert "never switches has no cycle of its own" in line


@pytest.mark.slow
@pytest.mark.kernels
def test_shipped_persons_under_other_controllers_stand(root: Path) -> None:
    for path in sorted((root / "runs" / "rivals").glob("*.toml")):
        run = load_run(path)
        assert run.case.name == path.stem
        result = run_case(prepare(run.with_(**{"simulation.duration": 8.0, "study.growth_points": 0})), "mujoco")
        assert result.simulation.outcome.kind == "completed"
        assert np.abs(result.simulation.y).max() < 0.1


def test_a_share_of_the_plane_is_a_slope(root: Path) -> None:
    assert compute_slope(0.5) == pytest.approx(0, abs=1e-15)
    assert compute_slope(0.621) == pytest.approx(-0.4, abs=2e-3)  # of a public implementation, see field notes
    with pytest.raises(AnalysisError, match="between 0 and 1"):
        compute_slope(1.0)
    run = load_run("one-link-switching")
    shared = run.with_(**{"controller.slope": None, "controller.share": 0.621})
    result = run_case(shared.with_(**{"simulation.duration": 1.0}), "linear")
    assert result.controller.facts()["slope"] == compute_slope(0.621)
    with pytest.raises(Exception, match="give slope or share, not both"):
        run.with_(**{"controller.share": 0.7})
