"""Rates at many states and their neighbours are those of the engine's own forward pass."""

import numpy as np
import pytest
from engine_cases import plant
from engine_runs import BODIES, around, stranger
from oracles.engine import rates

from icmj import EventTrigger, Settings, Step
from icmj.engine.open_loop import open_loop


@pytest.mark.parametrize("name", BODIES)
def test_they_are_what_the_engine_says(name: str) -> None:
    fly, rows, moves = around(BODIES[name]())
    found, expected = fly.rates(rows, moves), rates(fly.loop, rows, moves)
    model = fly.loop.model
    assert found.shape == (4, 9, 2 * model.nv + model.na)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(fly.rates(rows, moves), found)


def test_a_flight_between_leaves_no_trace() -> None:
    settings = Settings(duration=1.0, timestep=2e-3, disturbance=(Step("ankle_torque", 0.5, start=0.2),))
    body = plant("three_link")
    fly = open_loop(body, stranger(body, EventTrigger(np.eye(3), 0.02)), settings)
    rows = np.full((2, fly.loop.model.nq * 2 + fly.loop.model.na), 0.01)
    moves = np.zeros((1, rows.shape[1]))
    before = fly.rates(rows, moves)
    fly(np.full(6, 0.01), np.zeros(3))
    np.testing.assert_array_equal(fly.rates(rows, moves), before)
