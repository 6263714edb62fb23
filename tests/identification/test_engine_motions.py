"""Motions of the engine whose model error the code under test is not told: how near it comes."""

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj.identification.identification import identify
from icmj.identification.inversion import Inverse
from icmj.identification.observed import Observed
from icmj.identification.unknown import Unknown

PENDULUM = icmj.load_run("simple-0.8")
# what the code under test is given: nothing of b
BLIND = Unknown(PENDULUM.with_(**{"actual.gain": None}))
FAR = Inverse(replace(BLIND, longest=8.0))


def motion(b: float, plant: str = "linear", run: icmj.RunFile = PENDULUM, **changes: object) -> icmj.Simulation:
    return icmj.simulate(icmj.prepare(run.with_(**{"actual.gain": b}, **changes)), plant)


@pytest.mark.slow
def test_on_fifteen_motions_of_the_engine_the_error_is_below_one_percent() -> None:
    """Were one motion in five off by more, fifteen would show it in 96 of 100 draws."""
    errors = []
    for b in np.random.default_rng(5).uniform(0.8, 1.2, 15):
        seen = Observed.of_simulation(motion(float(b), "mujoco"))
        found = identify(BLIND, seen, plant="mujoco", refine=False, known=FAR)
        assert found.value is not None, (b, found.words)
        errors.append(abs(found.value / b - 1))
    assert max(errors) < 1e-2
    assert np.median(errors) < 1e-4
