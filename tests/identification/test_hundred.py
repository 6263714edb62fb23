"""A hundred motions whose model error the code under test is not told: how near it comes, how often it covers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj.identification.bank import bank
from icmj.identification.identification import identify
from icmj.identification.inverse import Inverse
from icmj.identification.observed import Observed
from icmj.identification.unknown import Unknown

PENDULUM = icmj.load_run("simple-0.8")
# what the code under test is given: nothing of b
BLIND = Unknown(PENDULUM.with_(**{"actual.gain": None}))
FAR = Inverse(replace(BLIND, longest=8.0))
NOISE = {"kind": "noise", "input": "torque", "size": 0.005, "corner": 0.5, "seed": 1, "terms": 20}


def motion(b: float, plant: str = "linear", run: icmj.RunFile = PENDULUM, **changes: object) -> icmj.Simulation:
    return icmj.simulate(icmj.prepare(run.with_(**{"actual.gain": b}, **changes)), plant)


@pytest.mark.slow
def test_on_a_hundred_motions_of_the_engine_the_error_is_below_one_percent() -> None:
    errors = []
    for b in np.random.default_rng(5).uniform(0.8, 1.2, 100):
        seen = Observed.of_simulation(motion(float(b), "mujoco"))
        found = identify(BLIND, seen, plant="mujoco", refine=False, known=FAR)
        assert found.value is not None, (b, found.words)
        errors.append(abs(found.value / b - 1))
    assert max(errors) < 1e-2
    assert np.median(errors) < 1e-4


@pytest.mark.slow
def test_under_noise_the_interval_covers_as_often_as_it_says() -> None:
    run = BLIND.run.with_(**{"simulation.duration": 60.0, "simulation.disturbance": [NOISE]})
    noisy = replace(BLIND, run=run)
    truth = np.random.default_rng(8).uniform(0.8, 1.2, 100)
    seen = [
        Observed.of_simulation(motion(float(b), run=run, **{"simulation.disturbance[0].seed": 8000 + i}))
        for i, b in enumerate(truth)
    ]
    known = bank(noisy, seen[0])
    found = [identify(noisy, each, known=known) for each in seen]
    told = [(each, b) for each, b in zip(found, truth, strict=True) if each.value is not None]
    covered = sum(each.holds(b) for each, b in told)
    assert len(told) == 100
    assert 90 <= covered <= 99
