"""What acts from outside on the engine: the same as the plain sum of its terms, at any instant, in any order."""

import mujoco
import numpy as np
import pytest
from engine_cases import controller, plant

from icmj.engine.block import Block, Slot, find_block
from icmj.engine.closed_loop import close_loop
from icmj.engine.isolation import isolate_engine
from icmj.engine.native.field import callbacks
from icmj.simulation.disturbance import make_disturbance, make_reading_error
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Noise, Source, Step

INPUTS, OUTPUTS = ("ankle_torque", "knee_torque", "hip_torque"), ("shank", "thigh", "trunk")
ACTING: tuple[Source, ...] = (
    Noise(input="ankle_torque", size=0.4, corner=0.5, seed=1, terms=60),
    Noise(input="ankle_torque", size=0.1, bandwidth=30.0, seed=2, terms=7, start=0.3),
    Step(input="knee_torque", size=2.0, start=0.7, on="command"),
    Noise(input="hip_torque", size=0.2, bandwidth=1e-3, seed=3, terms=60),
    Noise(output="shank", size=3e-4, corner=1.0, seed=4, terms=200),
    Bias("shank", 1e-3),
    Noise(output="trunk", size=3e-4, bandwidth=200.0, seed=5),
)


def composed() -> tuple[mujoco.MjModel, Block]:
    model = close_loop(plant("three_link"), controller("three_link"), Settings(disturbance=ACTING)).model
    block = find_block(model)
    assert block is not None
    return model, block


def acting_at(times: np.ndarray, phase: float | None = None) -> np.ndarray:
    """Commands and rates of a controller at rest, as a loop has them computed that is in a stretch of time."""
    model, block = composed()
    data, rows = mujoco.MjData(model), []
    data.qpos[:] = plant("three_link").linearisation.point.qpos
    with isolate_engine(*callbacks()):
        for time in times:
            data.time, block.header[Slot.PHASE] = time, time if phase is None else phase
            mujoco.mj_forward(model, data)
            rows.append(np.concatenate([data.ctrl[:-1], data.act_dot[block.act]]))
    return np.array(rows)


def expected_at(times: np.ndarray) -> np.ndarray:
    """The same by the sum of cosines."""
    model, block = composed()
    data = mujoco.MjData(model)
    data.qpos[:] = plant("three_link").linearisation.point.qpos
    mujoco.mj_forward(model, data)
    read = data.sensordata - block.y_0 + make_reading_error(ACTING, OUTPUTS)(times)
    return np.hstack([block.ctrl_0 + make_disturbance(ACTING, INPUTS)(times), read @ block.N.T])


@pytest.mark.parametrize("end", [10.0, 1e4])
def test_a_signal_is_the_sum_of_its_terms(end: float) -> None:
    times = np.random.default_rng(0).uniform(0, end, 2000)
    found, expected = acting_at(times), expected_at(times)
    _, block = composed()
    sums = np.bincount(block.terms[:, 0].astype(int), np.abs(block.terms[:, 1]), 3)
    read = np.bincount(block.errors[:, 0].astype(int), np.abs(block.errors[:, 1]), 3)
    scale = np.concatenate([1 + np.abs(block.ctrl_0) + sums, np.abs(block.N) @ (1 + read)])
    # 1e-13 of the amplitudes' sum, and the phases' own rounding in both
    fastest = max(block.terms[:, 2].max(), block.errors[:, 2].max())
    allowed = scale * (1e-13 + 2 * np.finfo(float).eps * fastest * end)
    assert np.all(np.abs(found - expected) <= allowed), (np.abs(found - expected) / allowed).max()


def test_what_acts_at_an_instant_has_the_same_bits_whatever_was_asked_before() -> None:
    random = np.random.default_rng(1)
    times = np.sort(random.uniform(0, 30.0, 1500))
    order = random.permutation(len(times))
    forwards = acting_at(times)
    np.testing.assert_array_equal(forwards[order], acting_at(times[order]))
    alone = np.vstack([acting_at(times[i : i + 1]) for i in range(0, 1500, 100)])
    np.testing.assert_array_equal(forwards[::100], alone)


def test_windows_open_and_close_by_the_phase_time() -> None:
    edge = np.array([0.3, 0.7])
    before, after = acting_at(edge, 0.2), acting_at(edge, 0.75)
    assert np.all(after[:, 1] - before[:, 1] == 2.0)
    noise = make_disturbance(ACTING[1:2], INPUTS)(edge)[:, 0]
    np.testing.assert_allclose(after[:, 0] - before[:, 0], noise, atol=1e-13)
    np.testing.assert_array_equal(after[:, 2], before[:, 2])


def test_terms_of_one_place_and_window_are_one_signal() -> None:
    _, block = composed()
    assert block.header[[Slot.COMMANDED, Slot.READ, Slot.SIGNALS]].tolist() == [4, 2, 6]
    assert block.header[Slot.WAVES] == 60 + 7 + 1 + 60 + 200 + 1 + 40
    np.testing.assert_array_equal(block.signals[:, 4] - block.signals[:, 3], [60, 7, 1, 60, 201, 40])


def test_without_a_loop_the_model_keeps_nothing() -> None:
    model, block = composed()
    kept, data = block.cells.copy(), mujoco.MjData(model)
    with isolate_engine(*callbacks()):
        mujoco.mj_step(model, data, nstep=10)
    assert data.ctrl[0] != 0
    np.testing.assert_array_equal(block.cells, kept)
