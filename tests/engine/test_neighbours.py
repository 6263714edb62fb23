"""Rates at many states and their neighbours, compiled, are those of the engine's own forward pass in Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine_cases import MODELS
from model_cases import MOTOR, MUSCLE, RICH, pendulum, written

from icmj.controller.controller import Controller
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched
from icmj.controller.trigger import EventTrigger
from icmj.engine.open_loop import EngineOpenLoop, open_loop
from icmj.engine.plant import load_plant
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.settings import Settings, Step

TEXTS = {
    "muscle": pendulum(MUSCLE),
    "limited": pendulum(MOTOR, joint='limited="true" range="-1 1"'),
    "rich": RICH,
}


def flights(name: str, folder: Path, settings: Settings) -> list[EngineOpenLoop]:
    """Of one model under a controller of another plant with as many inputs and outputs: compiled, and in Python."""
    path = written(folder, TEXTS[name], f"{name}.xml") if name in TEXTS else MODELS / f"{name}.xml"
    body = load_plant(path, keyframe={"rich": "up"}.get(name, "stand" if name in TEXTS else "upright"))
    n_u, n_y = body.linearisation.plant.n_u, body.linearisation.plant.n_y
    random = np.random.default_rng(5)
    gains = design_lq(LinearPlant(-np.eye(3), random.normal(size=(3, n_u)), random.normal(size=(n_y, 3))))
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(3), 0.02))
    return [open_loop(body, control, replace(settings, native=native)) for native in (True, False)]


@pytest.mark.parametrize("name", ["three_link", "pendulum_neglected", "muscle", "limited", "rich"])
def test_they_are_what_the_engine_says(name: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    compiled, plain = flights(name, tmp_path, Settings())
    model = plain.loop.model
    size = model.nq + model.nv + model.na
    rows = 0.1 * rng.normal(size=(4, size))
    rows[:, : model.nq] += model.qpos0
    moves = 1e-2 * rng.normal(size=(9, size))
    moves[[2, 3, 6, 8], : model.nq + model.nv] = 0.0  # which are not worth going through the positions again
    moves[0] = 0.0
    found, expected = compiled.rates(rows, moves), plain.rates(rows, moves)
    assert found.shape == (4, 9, 2 * model.nv + model.na)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(compiled.rates(rows, moves), found)


def test_a_flight_between_leaves_no_trace(tmp_path: Path) -> None:
    settings = Settings(duration=1.0, timestep=2e-3, disturbance=(Step("ankle_torque", 0.5, start=0.2),))
    compiled, _ = flights("three_link", tmp_path, settings)
    rows = np.full((2, compiled.loop.model.nq * 2 + compiled.loop.model.na), 0.01)
    moves = np.zeros((1, rows.shape[1]))
    before = compiled.rates(rows, moves)
    compiled(np.full(6, 0.01), np.zeros(3))
    np.testing.assert_array_equal(compiled.rates(rows, moves), before)
