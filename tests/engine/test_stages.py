"""Fewer stages of the engine, the same accelerations: to the last bit, on shipped models and models of users."""

from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numba
import numpy as np
import pytest
from engine_cases import MODELS
from model_cases import BIASED, MOTOR, MUSCLE, RICH, SERVO, pendulum, two, written
from scipy.integrate import solve_ivp

from icmj import Controller, EventTrigger, LinearPlant, MujocoPlant, Settings, design_lq, load_plant, system_matched
from icmj.engine.block import Slot, find_block
from icmj.engine.closed_loop import close_loop
from icmj.engine.isolation import isolate_engine
from icmj.engine.native.field import callbacks, flow
from icmj.engine.native.state import PROGRESS, engine_of
from icmj.engine.native.steps import save, step, undo
from icmj.engine.stages import Stages, choose_stages, may_constrain


@cache
def compiled() -> tuple[Any, Any]:
    """The flow, and one step of the loop, as functions of their own."""

    @numba.njit
    def rates(engine):  # type: ignore[no-untyped-def]
        flow(engine)

    @numba.njit
    def one(engine, progress, length):  # type: ignore[no-untyped-def]
        save(engine)
        step(engine, progress, length)

    return rates, one


def composed(body: MujocoPlant) -> mujoco.MjModel:
    """The plant under a controller that was designed on some stable plant with as many inputs and outputs."""
    n_u, n_y = body.linearisation.plant.n_u, body.linearisation.plant.n_y
    random = np.random.default_rng(5)
    gains = design_lq(LinearPlant(-np.eye(3), random.normal(size=(3, n_u)), random.normal(size=(n_y, 3))))
    return close_loop(body, Controller(gains, system_matched(gains), EventTrigger(np.eye(3), 0.02)), Settings()).model


def bodies(folder: Path) -> list[tuple[str, MujocoPlant, Stages]]:
    """Models by name, with the stages that each needs."""
    wet = pendulum(MOTOR).replace('timestep="0.002"', 'timestep="0.002" density="1.2" viscosity="0.01"')
    limited = pendulum(MOTOR, joint='limited="true" range="-1 1"')
    texts = {
        "motor": (pendulum(MOTOR), Stages.PLAIN),
        "wet": (wet, Stages.PLAIN),
        "geared": (pendulum('<motor name="ankle" joint="lean" gear="-3"/>'), Stages.PLAIN),
        "servo": (pendulum(SERVO), Stages.SMOOTH),
        "biased": (pendulum(BIASED), Stages.SMOOTH),
        "muscle": (pendulum(MUSCLE), Stages.SMOOTH),
        "clamped": (pendulum('<motor name="ankle" joint="lean" ctrlrange="-1 1"/>'), Stages.SMOOTH),
        "limited": (limited, Stages.WHOLE),
        "rich": (RICH, Stages.PLAIN),
    }
    found = []
    for name, (text, stages) in texts.items():
        body = load_plant(written(folder, text, f"{name}.xml"), keyframe="up" if name == "rich" else "stand")
        found.append((name, body, stages))
    found.append(("two", load_plant(two(folder)), Stages.PLAIN))
    smooth = {"pendulum": Stages.PLAIN, "three_link": Stages.PLAIN, "pendulum_neglected": Stages.SMOOTH}
    found += [(name, load_plant(MODELS / f"{name}.xml", keyframe="upright"), stages) for name, stages in smooth.items()]
    return found


def moved(data: mujoco.MjData, rng: np.random.Generator) -> None:
    model = data.model
    mujoco.mj_integratePos(model, data.qpos, 0.1 * rng.normal(size=model.nv), 1.0)
    data.qvel[:], data.act[:] = rng.normal(size=model.nv), 0.3 * rng.normal(size=model.na)


@pytest.mark.slow
def test_the_fewest_stages_give_the_engine_s_own_rates_and_steps_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    flow_of, one = compiled()
    for name, body, stages in bodies(tmp_path):
        model = composed(body)
        assert choose_stages(model) is stages, name
        block = find_block(model)
        assert block is not None
        data, other = mujoco.MjData(model), mujoco.MjData(model)
        with isolate_engine(*callbacks()):
            mujoco.mj_forward(model, data)
            engine = engine_of(model, data, block.header[Slot.PHASE : Slot.PHASE + 1])
            for _ in range(5):
                moved(data, rng)
                mujoco.mj_copyData(other, model, data)
                flow_of(engine)
                mujoco.mj_forward(model, other)
                for field in ("qacc", "act_dot", "ctrl", "sensordata"):
                    np.testing.assert_array_equal(getattr(data, field), getattr(other, field), err_msg=name)
            mujoco.mj_forward(model, data)
            mujoco.mj_copyData(other, model, data)
            mujoco.mj_forward(model, other)
            model.opt.timestep = h = 2e-3
            progress = np.zeros(1, PROGRESS)
            progress[0]["end"] = progress[0]["length"] = h
            one(engine, progress, h)
            mujoco.mj_RungeKutta(model, other, 4)
        for field in ("qpos", "qvel", "act") if model.nq == model.nv else ():
            np.testing.assert_array_equal(getattr(data, field), getattr(other, field), err_msg=name)


def test_a_step_of_a_ball_joint_errs_by_the_fifth_power_of_its_length(tmp_path: Path) -> None:
    """Against DOP853 on ``mj_forward``; quaternions are four numbers."""
    free = RICH.replace('type="ball" damping="0.3"', 'type="ball"')  # which would be as fast as 700/s
    model = composed(load_plant(written(tmp_path, free), keyframe="up"))
    block, one = find_block(model), compiled()[1]
    assert block is not None
    assert model.nq == model.nv + 1
    data, start = mujoco.MjData(model), mujoco.MjData(model)
    moved(start, np.random.default_rng(3))
    nq, nv, turn = model.nq, model.nv, int(model.jnt_qposadr[np.argmax(model.jnt_type == mujoco.mjtJoint.mjJNT_BALL)])
    first = int(model.jnt_dofadr[np.argmax(model.jnt_type == mujoco.mjtJoint.mjJNT_BALL)])

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        data.time, data.qpos[:], data.qvel[:], data.act[:] = t, s[:nq], s[nq : nq + nv], s[nq + nv :]
        data.qpos[turn : turn + 4] /= np.linalg.norm(data.qpos[turn : turn + 4])
        mujoco.mj_forward(model, data)
        spin = np.zeros(4)  # q' = q ω/2, in the frame of what turns
        mujoco.mju_mulQuat(spin, np.array(s[turn : turn + 4]), np.append(0.0, data.qvel[first : first + 3]) / 2)
        others = np.concatenate([data.qvel[:first], data.qvel[first + 3 :]])
        return np.concatenate([others[:turn], spin, others[turn:], data.qacc, data.act_dot])

    begin, errors = np.concatenate([start.qpos, start.qvel, start.act]), []
    with isolate_engine(*callbacks()):
        for h in (0.004, 0.002, 0.001):
            exact = solve_ivp(rates, (0, h), begin, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
            mujoco.mj_copyData(data, model, start)
            mujoco.mj_forward(model, data)
            progress = np.zeros(1, PROGRESS)
            progress[0]["end"] = progress[0]["length"] = model.opt.timestep = h
            one(engine_of(model, data, block.header[Slot.PHASE : Slot.PHASE + 1]), progress, h)
            errors.append(np.abs(np.concatenate([data.qpos, data.qvel, data.act]) - exact).max())
            assert abs(np.linalg.norm(data.qpos[turn : turn + 4]) - 1) < 1e-15
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 4.8).all()


def test_a_step_is_undone_where_a_spring_has_yielded(tmp_path: Path) -> None:
    model = composed(load_plant(written(tmp_path, pendulum(MOTOR, joint='stiffness="9" springyield="0.1"'))))
    block, data = find_block(model), mujoco.MjData(model)
    assert block is not None
    data.qpos[0] = 1.0

    @numba.njit
    def back(engine, progress, length):  # type: ignore[no-untyped-def]
        save(engine)
        step(engine, progress, length)
        yielded = engine.plastic[0]
        undo(engine, progress)
        return yielded

    with isolate_engine(*callbacks()):
        mujoco.mj_forward(model, data)
        before = data.qacc.copy()
        progress = np.zeros(1, PROGRESS)
        progress[0]["end"] = progress[0]["length"] = 1e-3
        yielded = back(engine_of(model, data, block.header[Slot.PHASE : Slot.PHASE + 1]), progress, 1e-3)
    assert yielded > 0.8
    assert (data.qpos[0], data.plastic[0]) == (1.0, 0.0)
    np.testing.assert_array_equal(data.qacc, before)


def test_nothing_can_constrain_where_everything_that_could_is_off() -> None:
    spec = mujoco.MjSpec.from_file(str(MODELS / "three_link_floor.xml"))
    assert may_constrain(spec.compile())
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    assert not may_constrain(spec.compile())
