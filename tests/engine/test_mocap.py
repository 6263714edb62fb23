"""Mocap bodies stand where the keyframe puts them, in everything that looks at the model."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from model_cases import HOOKED, written

from icmj import load_plant, parse_run, prepare, simulate
from icmj.engine.dynamics import Dynamics
from icmj.engine.model import get_operating_point
from icmj.engine.operating_point import find_equilibria
from icmj.engine.pose import make_scene
from icmj.plant.body import OperatingRule

RUN = """
case = {{ name = "hooked", title = "Hooked" }}
assumed = {{ model = "model.xml", keyframe = "aside", operating_point = "{kind}", outputs = ["lean", "roll"] }}
actual = {{ gain = 0.8 }}
controller = {{ q_t = 0.001 }}
simulation = {{ duration = 2.0, initial = {{ lean = 0.001 }} }}
"""


def own(model: mujoco.MjModel, qpos: np.ndarray, ctrl: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, C and the acceleration by differences, with the hook where the keyframe says."""
    data = mujoco.MjData(model)
    data.mocap_pos[:], data.mocap_quat[:] = model.key_mpos[0], model.key_mquat[0]

    def rates(z: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:], data.ctrl[:] = qpos + z[:2], z[2:], ctrl
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.sensordata])

    steps = 1e-5 * np.eye(4)
    J = np.array([(rates(step) - rates(-step)) / 2e-5 for step in steps]).T
    return J[:4], J[4:], rates(np.zeros(4))[2:4]


@pytest.mark.parametrize("kind", ["as given", "static control", "balance"])
def test_linearisation_and_rest_are_those_of_the_keyframe(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, HOOKED)
    plant = load_plant(path, keyframe="aside", operating=OperatingRule(kind))
    point = plant.linearisation.point
    A, C, left = own(mujoco.MjModel.from_xml_path(str(path)), point.qpos, point.ctrl)
    np.testing.assert_allclose(plant.linearisation.plant.A, A, atol=1e-7 * np.abs(A).max())
    np.testing.assert_allclose(plant.linearisation.plant.C, C, atol=1e-7)
    if kind != "as given":
        assert np.abs(left).max() < 1e-8
    assert plant.quality.at_rest == (kind != "as given")


def test_a_model_of_one_s_own_is_searched_where_the_keyframe_puts_it(tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, HOOKED)))
    (point,) = find_equilibria(model, get_operating_point(model, "aside"), OperatingRule("static control"))
    assert np.abs(own(model, point.qpos, point.ctrl)[2]).max() < 1e-8


@pytest.mark.parametrize("timestep", ["", ", timestep = 0.002"])
def test_a_run_and_its_poses_are_those_of_the_keyframe(tmp_path: Path, timestep: str) -> None:
    path = written(tmp_path, HOOKED)
    text = RUN.format(kind="static control").replace("duration = 2.0", f"duration = 2.0{timestep}")
    case = prepare(parse_run(text, tmp_path / "run.toml"))
    found = simulate(case, "mujoco")
    # the acceleration between rows is the engine's own, at these states and with this control
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.mocap_pos[:], data.mocap_quat[:] = model.key_mpos[0], model.key_mquat[0]
    rates = np.zeros((len(found.t), 2))
    for rate, x, u in zip(rates, found.x, found.u, strict=True):
        data.qpos[:], data.qvel[:] = case.model.linearisation.point.qpos + x[:2], x[2:]
        data.ctrl[:] = case.model.linearisation.point.ctrl + 0.8 * u
        mujoco.mj_forward(model, data)
        rate[:] = data.qacc
    first = (found.t > 0) & (found.t <= (found.events.t[0] if len(found.events) else 2.0))
    t, v, a = found.t[first], found.x[first, 2:], rates[first]
    gained = np.cumsum((a[1:] + a[:-1]) / 2 * np.diff(t)[:, None], axis=0)
    np.testing.assert_allclose(v[1:] - v[0], gained, atol=2e-3 * np.abs(v).max())
    shown = make_scene(case.model, found)
    hook = shown.bodies.index("hook")
    np.testing.assert_allclose(shown.xpos[:, hook], np.broadcast_to(model.key_mpos[0], (len(found.t), 3)))
    turn = model.key_mquat[0] / np.linalg.norm(model.key_mquat[0])
    np.testing.assert_allclose(shown.xquat[:, hook], np.broadcast_to(turn, (len(found.t), 4)), atol=1e-15)


def test_the_plant_as_a_system_of_others_is_that_of_the_keyframe(tmp_path: Path) -> None:
    path = written(tmp_path, HOOKED)
    plant = load_plant(path, keyframe="aside", operating=OperatingRule("static control"))
    point, x = plant.linearisation.point, np.array([0.1, -0.2, 0.3, 0.4])
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_path(str(path)))
    data.mocap_pos[:], data.mocap_quat[:] = model.key_mpos[0], model.key_mquat[0]
    data.qpos[:], data.qvel[:], data.ctrl[:] = point.qpos + x[:2], x[2:], point.ctrl
    mujoco.mj_forward(model, data)
    rate, y = Dynamics(plant)(x, np.zeros(2))
    np.testing.assert_allclose(rate, np.concatenate([data.qvel, data.qacc]), rtol=1e-12)
    np.testing.assert_allclose(y + plant.linearisation.y, data.sensordata, rtol=1e-12)
