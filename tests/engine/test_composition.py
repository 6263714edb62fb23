"""The composed model: an ordinary MuJoCo model that is the closed loop."""

from dataclasses import replace
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
import pytest
from engine_cases import MODELS, controller, design, plant
from model_cases import RICH, pendulum, written

from icmj.controller.controller import Controller
from icmj.controller.design import Design, design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.engine.block import Slot, find_block
from icmj.engine.closed_loop import close_loop
from icmj.engine.composition import NAME, compose
from icmj.engine.deviation import Deviation
from icmj.engine.flow import follow
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import LEAST_ROOM
from icmj.engine.native.field import callbacks
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.plant.body import OperatingRule
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.simulation.disturbance import make_no_disturbance
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gaussian
from icmj.theory.error_system import error_system

CASES = [("pendulum", "pendulum"), ("three_link", "three_link"), ("pendulum_neglected", "pendulum")]


def closed_loop_matrix(model: mujoco.MjModel, qpos: np.ndarray, n_plant: int) -> np.ndarray:
    """d/dt of (plant state, x_o, x_h) against the same, by central differences of ``mj_forward`` with the callbacks."""
    block = find_block(model)
    assert block is not None
    nv, data = model.nv, mujoco.MjData(model)
    size = 2 * nv + model.na
    act_0 = np.zeros(model.na)
    eps = 1e-5

    def rate(z: np.ndarray) -> np.ndarray:
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, z[:nv], 1.0)
        data.qvel[:] = z[nv : 2 * nv]
        data.act[:] = act_0 + z[2 * nv :]
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    return np.column_stack([(rate(eps * e) - rate(-eps * e)) / (2 * eps) for e in np.eye(size)])


@pytest.mark.parametrize(("actual", "assumed"), CASES)
def test_composed_model_is_the_error_system(actual: str, assumed: str) -> None:
    body = plant(actual, 0.9)
    control = controller(assumed)
    model = compose(body, control, make_no_disturbance(body.linearisation.plant.n_u))
    with isolate_engine(*callbacks()):
        A = closed_loop_matrix(model, body.linearisation.point.qpos, body.linearisation.plant.n)
    system = error_system(body.linearisation.plant, control.design, control.hold)
    S = system.from_original(np.eye(system.n + 2 * system.n_hat)).T  # X̄ = S (x, x_o, x_h)
    expected = np.linalg.solve(S, system.A_C @ S)
    np.testing.assert_allclose(A, expected, atol=1e-7 * np.abs(expected).max())


def test_plant_and_its_file_are_untouched_and_keyframes_still_fit() -> None:
    before = (MODELS / "three_link.xml").read_bytes()
    body = load_plant(MODELS / "three_link.xml", keyframe="upright")
    xml = body.xml
    model = compose(body, controller("three_link"), make_no_disturbance(3))
    assert body.xml == xml
    assert (MODELS / "three_link.xml").read_bytes() == before
    assert (model.nu, model.na, model.nkey) == (4, 12, 1)
    assert model.actuator(NAME).id == 3
    block = find_block(model)
    assert block is not None
    assert find_block(body.spec.copy().compile()) is None
    gains = design("three_link")
    np.testing.assert_array_equal(block.K[:, 6:], gains.k)
    np.testing.assert_array_equal(block.M[6:, 6:], gains.A_c)
    np.testing.assert_array_equal(block.N[:6], gains.L)


def test_geoms_for_the_eye_are_left_out_and_the_motion_stays_the_same() -> None:
    body = plant("three_link", 0.9)
    bare = body.spec.copy().compile()
    model = compose(body, controller("three_link"), make_no_disturbance(3))
    assert bare.ngeom > 20
    assert model.ngeom == 0
    ends = []
    for m in (bare, model):  # no callbacks: both fall freely
        data = mujoco.MjData(m)
        data.qpos[:], data.ctrl[:3] = [0.02, -0.01, 0.03], [1.0, -2.0, 0.5]
        mujoco.mj_step(m, data, nstep=300)
        ends.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    np.testing.assert_array_equal(*ends)
    wet = body.spec.copy()
    wet.option.density = 1.2
    assert compose(replace(body, spec=wet), controller("three_link"), make_no_disturbance(3)).ngeom == bare.ngeom


@pytest.fixture
def rich(tmp_path: Path) -> Path:
    path = tmp_path / "rich.xml"
    path.write_text(RICH)
    return path


def random_controller(n_u: int, n_y: int, trigger: bool = True) -> Controller:
    """A stable design on a random assumed plant of order 3."""
    random = np.random.default_rng(5)
    A, B, C = random.normal(size=(3, 3)), random.normal(size=(3, n_u)), random.normal(size=(n_y, 3))
    gains = design_lq(LinearPlant(A, B, C))
    return Controller(gains, system_matched(gains), EventTrigger(np.eye(3), 0.02) if trigger else Continuous())


@pytest.mark.parametrize("trigger", [True, False])
def test_several_inputs_outputs_velocities_and_ball_joints(rich: Path, trigger: bool) -> None:
    body = load_plant(rich, keyframe="up")
    control = random_controller(2, 3, trigger)
    rng = np.random.default_rng(1)
    x, x_o = 0.1 * rng.normal(size=10), 0.1 * rng.normal(size=3)
    loop = close_loop(body, control, Settings())
    record = follow(loop, loop.data(x, np.tile(x_o, 2)), loop.schedule(Settings(duration=0.3, limit=100.0), 2e-3))
    assert len(record.events) > 1 or not trigger
    # what the callbacks compute, from the equations of the paper
    model = compose(body, control, make_no_disturbance(2))
    data = loop.data(x, np.concatenate([x_o, 2 * x_o]))
    with isolate_engine(*callbacks()):
        mujoco.mj_forward(model, data)
    gains: Design = control.design
    y = np.array([data.qpos[0], data.qpos[1], data.qvel[1]]) - body.linearisation.y
    u = -gains.k @ (2 * x_o if trigger else x_o)
    np.testing.assert_allclose(data.ctrl[:2], u + np.array([1.0, 2.0]), rtol=1e-12)
    expected = gains.plant.A @ x_o + gains.plant.B @ u - gains.L @ (gains.plant.C @ x_o - y)
    np.testing.assert_allclose(data.act_dot[:3], expected, rtol=1e-12)
    np.testing.assert_allclose(data.act_dot[3:], gains.A_c @ (2 * x_o) if trigger else expected, rtol=1e-12)


def test_what_cannot_be_composed_is_refused(rich: Path, tmp_path: Path) -> None:
    body = load_plant(rich, keyframe="up")
    with pytest.raises(ModelError, match="2 inputs and 3 outputs, the controller's design 1 and 1"):
        compose(body, controller("pendulum"), make_no_disturbance(2))
    path = tmp_path / "acceleration.xml"
    path.write_text(
        RICH.replace('<jointvel name="spin" joint="turn"/>', '<jointactuatorfrc name="force" joint="turn"/>')
    )
    with pytest.raises(ModelError, match="'force' needs accelerations"):
        compose(load_plant(path, keyframe="up"), random_controller(2, 3), make_no_disturbance(2))


def test_loop_steps_are_the_engine_s_own_steps_but_for_rounding() -> None:
    """Two compilers make two codes of one method, which on some processors agree to the last bit and on others not."""
    body, control = plant("three_link", 0.9), controller("three_link", 1e3)
    loop = close_loop(body, control, Settings())
    x = 0.01 * np.ones(6)
    record = follow(loop, loop.data(x, np.zeros(12)), loop.schedule(Settings(duration=0.5), 2e-3))
    data = loop.data(x, np.zeros(12))
    with isolate_engine(*callbacks()):
        mujoco.mj_step(loop.model, data)  # to Δ_min
        loop.model.opt.timestep = 1e-3
        data = loop.data(x, np.zeros(12))
        mujoco.mj_step(loop.model, data)
        loop.model.opt.timestep = 2e-3
        mujoco.mj_step(loop.model, data, nstep=249)
        loop.model.opt.timestep = 1e-3
        mujoco.mj_step(loop.model, data)
    there = np.concatenate([data.qpos, data.qvel, data.act])
    rounding = 252 * 4 * np.finfo(float).eps * np.abs(there).max()  # one a stage
    np.testing.assert_allclose(record.rows[-1, 1:19], there, rtol=0, atol=rounding)


def test_rollout_in_threads_sees_the_whole_loop() -> None:
    body, control = plant("three_link", 0.9), controller("three_link", 1e3)
    loop = close_loop(body, control, Settings())
    starts = []
    for i in range(4):
        data = loop.data(0.001 * (i + 1) * np.ones(6), np.repeat([0.0, 0.001], 6))
        state = np.empty(mujoco.mj_stateSize(loop.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(loop.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        starts.append(state)
    with isolate_engine(*callbacks()):
        states, _ = mujoco.rollout.rollout(
            loop.model, [mujoco.MjData(loop.model) for _ in range(2)], np.array(starts), nstep=100
        )
        for i in range(4):
            data = loop.data(0.001 * (i + 1) * np.ones(6), np.repeat([0.0, 0.001], 6))
            mujoco.mj_step(loop.model, data, nstep=100)
            end = np.empty_like(starts[0])
            mujoco.mj_getState(loop.model, data, end, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            np.testing.assert_array_equal(states[i, -1], end)


def test_header_is_as_documented() -> None:
    block = find_block(compose(plant("pendulum_neglected"), controller("pendulum", 0.02), make_no_disturbance(1)))
    assert block is not None
    assert block.header[[Slot.SIZE, Slot.N_U, Slot.N_Y, Slot.ACT, Slot.FACES]].tolist() == [4, 1, 1, 2, 1]
    np.testing.assert_allclose(block.R.T @ block.R, np.outer([-1, 0, 1, 0], [-1, 0, 1, 0]) / 0.02**2, rtol=1e-12)
    np.testing.assert_array_equal(block.J, [[1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]])
    assert block.header[Slot.PHASE] == -1
    assert block.act == slice(2, 6)
    assert transformation(design("pendulum").plant, plant("pendulum_neglected").linearisation.plant).shape == (2, 4)


@pytest.mark.parametrize(
    "default",
    [
        '<position kp="100" kv="3" ctrlrange="-1 1" forcerange="-2 2"/>',
        '<muscle ctrllimited="true" ctrlrange="0 1" force="1500" range="0.75 1.05" timeconst="0.02 0.04"/>',
        '<general biastype="affine" biasprm="5 -30 -4" gainprm="7" actlimited="true" actrange="-1e-3 1e-3"/>',
    ],
)
def test_a_model_s_defaults_give_the_controller_no_force_and_no_limit(tmp_path, default):
    motor = (
        '<general name="ankle" joint="lean" gaintype="fixed" gainprm="1" biastype="none" dyntype="none" '
        'ctrllimited="false" forcelimited="false" actlimited="false" armature="0"/>'
    )
    text = pendulum(motor, key='qpos="0.1"').replace("<option", f"<default>{default}</default><option", 1)
    path = written(tmp_path, text)
    plant = load_plant(path, keyframe="stand", operating=OperatingRule("static control"))
    gains = design_lq(plant.linearisation.plant)
    controller = Controller(gains, system_matched(gains), EventTrigger(output_weight(gains), 0.01))
    composed, bare = compose(plant, controller, make_no_disturbance(1)), plant.spec.compile()
    rate = []
    for model in (bare, composed):
        data = mujoco.MjData(model)
        data.qpos[0], data.qvel[0] = 0.3, 0.5
        mujoco.mj_forward(model, data)
        rate.append(data.qacc[0])
        if model is composed:
            assert data.actuator_force[-1] == 0
            assert not model.actuator_actlimited[-1]
    assert rate[1] == pytest.approx(rate[0], rel=1e-12)


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many blocks of a controller each model has that MuJoCo compiles."""
    found: list[int] = []
    compile_ = mujoco.MjSpec.compile

    def counted(spec: mujoco.MjSpec) -> mujoco.MjModel:
        found.append(len(spec.numerics))
        return compile_(spec)

    monkeypatch.setattr(mujoco.MjSpec, "compile", counted)
    return found


def test_what_varies_in_time_or_between_runs_does_not_compile_the_model_again(compilations: list[int]) -> None:
    body, control = load_plant(MODELS / "three_link.xml", Deviation(0.9), "upright"), controller("three_link")
    assert len(compilations) == 1
    runs = []
    for seed in (1, 2):
        noise = Gaussian(input="ankle_torque", size=0.3, interval=0.01, seed=seed)
        runs.append(simulate(body, control, Settings(duration=1.0, disturbance=(noise,))))
    runs.append(simulate(body, control, Settings(duration=2.0, integrator="implicitfast")))
    runs.append(simulate(body, control.triggered_by(Continuous()), Settings(duration=1.0)))
    runs.append(
        simulate(body, control.triggered_by(ClockTrigger(0.2)), Settings(duration=1.0, initial={"ankle": 0.01}))
    )
    assert compilations == [0, 1]
    assert len({run.y.tobytes() for run in runs}) == 5
    # of a plant of its own each, which has to compile its own
    again = load_plant(MODELS / "three_link.xml", Deviation(0.9), "upright")
    noise = Gaussian(input="ankle_torque", size=0.3, interval=0.01, seed=2)
    alone = simulate(again, control, Settings(duration=1.0, disturbance=(noise,)))
    np.testing.assert_array_equal(alone.y, runs[1].y)


def test_a_controller_for_which_there_is_no_room_gets_more(compilations: list[int]) -> None:
    body, control = load_plant(MODELS / "three_link.xml", keyframe="upright"), controller("three_link")
    lean = find_block(close_loop(body, control, Settings()).model)
    noise = Gaussian(input="ankle_torque", size=0.3, interval=0.01, seed=1)
    wide = find_block(close_loop(body, control, Settings(duration=100.0, disturbance=(noise,))).model)
    assert compilations == [0, 1, 1]
    assert lean is not None
    assert wide is not None
    assert len(wide.values) > 10_000 > LEAST_ROOM
    np.testing.assert_array_equal(wide.M, lean.M)
    close_loop(body, control, Settings())
    assert len(compilations) == 3
