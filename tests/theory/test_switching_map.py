"""Where a switched loop leads by two numbers: against published rounds, the method of steps, and long simulations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import of_law
from tapped_cases import BODY, DELAY, HOMOGENEOUS, MGH

from icmj.errors import AnalysisError
from icmj.linear.run import simulate
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.settings import Settings
from icmj.theory.delay_roots import delay_loop, rightmost_roots
from icmj.theory.switching_map import AXIS, EDGE, LINE, STAYS, switching_map

SLOPE = -0.4
OSCILLATING = LinearPlant(
    np.array([[0.0, 1.0], [-3.0, 0.2]]), np.array([0.0, 1 / 60]), np.eye(2), ("lean", "lean_rate"), ("ankle",),
    ("theta", "omega"),
)  # fmt: skip


def of(P: object, D: object, plant: LinearPlant = BODY, slope: float = SLOPE):
    return switching_map(plant, "theta", "omega", P, D, DELAY, slope)


def test_the_gains_of_asai() -> None:
    found = of(0.25 * MGH, 10.0)
    assert found.follows.tolist() == [[LINE], [LINE]]
    assert found.factor[LINE, 0] == pytest.approx(0.73140938, abs=5e-9)
    assert found.period[LINE, 0] == pytest.approx(1.155262, abs=5e-7)
    assert found.verdict[0] == "stands"


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize(("P", "D", "edge"), [(0.25, 10.0, LINE), (0.7, 60.0, AXIS)])
def test_a_round_is_that_of_the_method_of_steps(P: float, D: float, edge: int) -> None:
    found = of(P * MGH, D)
    assert found.follows[edge, 0] == edge
    law = replace(HOMOGENEOUS, P=P * MGH, D=D)
    motion = of_law(BODY, law, np.array([0.0, -1.0] if edge == AXIS else [0.02, -1.0])).run(14.0)
    on = [s for s in motion.switches if law.realisation.following(0, motion.v(s + 1e-9)) == 0]
    before, after = (motion.v(s) for s in on[-2:])
    assert on[-1] - on[-2] == pytest.approx(found.period[edge, 0], abs=1e-9)
    assert after == pytest.approx(found.scale[edge, 0] * before, rel=1e-8, abs=1e-10 * np.abs(before).max())


def test_feedback_that_stays_on_grows_at_its_rightmost_root() -> None:
    P, D = np.array([0.1, 0.15, 0.22]) * MGH, np.array([20.0, 150.0, 300.0])
    found = of(P, D)
    for i in range(3):
        assert found.follows[LINE, i] == STAYS
        on = replace(HOMOGENEOUS, P=P[i], D=D[i], switches=False)
        root = rightmost_roots(delay_loop(BODY, on), 1)[0]
        assert root.imag == 0
        assert found.growth[LINE, i] == pytest.approx(root.real, abs=1e-10)
    assert np.sign(found.growth[LINE]).tolist() == [1, 1, -1]


def _agreement(count: int, seed: int, plant: LinearPlant = BODY) -> int:
    """How many random loops were told; each must go on in a long simulation as one of the two edges says."""
    random, told = np.random.default_rng(seed), 0
    P, D = random.uniform(0, 2, count) * MGH, random.uniform(0, 300, count)
    found = of(P, D, plant)
    for i in range(count):
        growth = found.growth[:, i]
        if found.verdict[i] in ("undecided", "on the edge"):
            continue
        # long enough for the size to change by more than it does within a round
        duration = min(30.0 + 4 / np.abs(growth).min(), 300.0)
        law = replace(HOMOGENEOUS, assumed=plant, P=P[i], D=D[i])
        settings = Settings(duration=duration, limit=1e150, record_interval=0.02)
        run = simulate(plant, law, settings, x0=1e-6 * random.standard_normal(2))
        size, cuts = np.linalg.norm(run.x, axis=1), [(0.2, 0.4), (0.8, 1.0)]
        early, late = (size[(run.t >= a * run.t[-1]) & (run.t <= b * run.t[-1])].max() for a, b in cuts)
        verdict = "stands" if late < early else "falls"
        assert verdict in {"stands" if rate < 0 else "falls" for rate in growth}, (P[i] / MGH, D[i], growth)
        told += 1
    return told


def test_long_simulations_of_random_gains_agree() -> None:
    assert _agreement(30, 5) >= 28
    assert _agreement(10, 6, OSCILLATING) >= 5


@pytest.mark.slow
def test_long_simulations_of_a_thousand_random_gains_agree() -> None:
    assert _agreement(1000, 7) >= 980  # the map leaves few untold


def test_what_is_within_rounding_of_one_is_on_the_edge() -> None:
    low, high = 0.9 * MGH, 2.0 * MGH
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if of(middle, 60.0).growth[AXIS, 0] < 0 else (low, middle)
    assert abs(np.log(of(low, 60.0).factor[AXIS, 0])) < EDGE
    assert of(low, 60.0).verdict[0] == "on the edge"
    assert [str(word) for word in of([0.99 * low, 1.01 * low], 60.0).verdict] == ["stands", "falls"]


def test_many_gains_are_as_each_alone() -> None:
    P, D = np.array([0.25, 0.7, 0.1, 1.9]) * MGH, np.array([10.0, 60.0, 20.0, 250.0])
    together = of(P, D)
    for i in range(4):
        alone = of(P[i], D[i])
        assert alone.growth[:, 0] == pytest.approx(together.growth[:, i], rel=1e-9)
        assert alone.follows[:, 0].tolist() == together.follows[:, i].tolist()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": "knee"}, "no output 'knee'"),
        ({"position": "omega", "rate": "theta"}, "'theta' is not the rate of 'omega'"),
        ({"delay": 0.0}, "positive delay"),
        ({"P": np.nan}, "finite numbers"),
        ({"P": [1.0, 2.0], "D": [1.0, 2.0, 3.0]}, "do not fit"),
        ({"plant": LinearPlant(-np.eye(3), np.ones(3), np.eye(3), outputs=("theta", "omega", "x"))}, "3 states"),
    ],
)
def test_what_makes_no_sense_is_refused(change: dict, words: str) -> None:
    given = {"plant": BODY, "position": "theta", "rate": "omega", "P": 1.0, "D": 1.0, "delay": 0.2, "slope": -0.4}
    with pytest.raises(AnalysisError, match=words) as told:
        switching_map(**(given | change))
    assert "\n" not in str(told.value)
