"""Models that other people made: linearised as MuJoCo itself does it, balanced, and run or refused for a reason."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest
from model_cases import BIASED, MOTOR, MUSCLE, SERVO, pendulum, two, written

from icmj.engine.isolation import isolate_engine
from icmj.engine.linearisation import step_of
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.plant.body import OperatingRule, Selection

JOINTS, BALANCE = Selection(outputs="joints"), OperatingRule("balance")
BENT = {"thigh_joint": -0.2, "leg_joint": -0.4, "foot_joint": 0.2}

BROUGHT = {
    "gymnasium": {
        "inverted_pendulum.xml": OperatingRule("balance", ("hinge",)),
        "inverted_double_pendulum.xml": BALANCE,
        "hopper.xml": OperatingRule("balance", pose=BENT),
        "walker2d_v5.xml": BALANCE,
        "humanoid.xml": BALANCE,
    },
    "dm_control": {
        "cartpole.xml": OperatingRule(),
        "acrobot.xml": OperatingRule(),
        "pendulum.xml": OperatingRule(),
        "hopper.xml": OperatingRule("balance", pose={"waist": 0.2, "hip": -0.6, "knee": 1.2, "ankle": -0.6}),
        "walker.xml": BALANCE,
    },
}
FOLDERS = {"gymnasium": "envs/mujoco/assets", "dm_control": "suite"}
NAMES = [
    pytest.param(package, name, marks=[pytest.mark.slow] if "humanoid" in name else [])
    for package, names in BROUGHT.items()
    for name in names
]


def brought(package: str, name: str) -> Path:
    """A model file of an installed package, which is found without importing it."""
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed")
    return Path(found.origin).parent / FOLDERS[package] / name


def second_order_lag(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """ω_n²/(s² + 2ζω_n s + ω_n²) from control to force, whose states are (rate, force)."""
    first, (omega_n, zeta) = model.actuator_actadr[actuator], model.actuator_dynprm[actuator, :2]
    rate, force = data.act[first : first + 2]
    data.act_dot[first : first + 2] = omega_n**2 * (data.ctrl[actuator] - force) - 2 * zeta * omega_n * rate, rate
    return 0.0


def transition(plant: MujocoPlant) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C of the whole model from ``mjd_transitionFD``.

    Explicit Euler takes velocities and activations to v + h a: these rows of (A_d − I)/h and B_d/h are those of A and B
    at any h. Rows of positions are velocities by definition.
    """
    model, point = plant.spec.compile(), plant.linearisation.point
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    model.opt.tolerance, model.opt.iterations = 0.0, 200
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = point.qpos, point.qvel, point.act, point.ctrl
    eps = step_of(model, point)
    n, nv, h = 2 * model.nv + model.na, model.nv, model.opt.timestep
    A, B = np.zeros((n, n)), np.zeros((n, model.nu))
    C, D = np.zeros((model.nsensordata, n)), np.zeros((model.nsensordata, model.nu))
    with isolate_engine():
        mujoco.set_mjcb_act_dyn(second_order_lag)
        mujoco.mj_forward(model, data)
        mujoco.mjd_transitionFD(model, data, eps, True, A, B, C, D)
    A, B = (A - np.eye(n)) / h, B / h
    A[:nv], B[:nv] = np.eye(nv, n, nv), 0
    return A, B, C


def agree(plant: MujocoPlant, tolerance: float) -> None:
    found, ports = plant.linearisation.plant, plant.linearisation.ports
    A, B, C = transition(plant)
    kept = ports.states
    mine = (found.A, found.B / ports.b, found.C)
    theirs = (A[np.ix_(kept, kept)], B[np.ix_(kept, ports.actuators)], C[np.ix_(ports.entries, kept)])
    pairs = zip(mine, theirs, strict=True)
    for mine, theirs in pairs:
        assert np.abs(mine - theirs).max() <= tolerance * np.abs(theirs).max()


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, BIASED, MUSCLE])
def test_linearisation_of_every_actuator_is_that_of_the_engine(tmp_path, actuator):
    path = written(tmp_path, pendulum(actuator, key='qpos="-0.05"', joint='stiffness="30" damping="4"'))
    agree(load_plant(path, keyframe="stand", operating=OperatingRule("static control")), 1e-7)


@pytest.mark.parametrize("name", ["pendulum", "pendulum_neglected", "three_link"])
def test_linearisation_of_the_shipped_models_is_that_of_the_engine(root, name):
    agree(load_plant(root / "models" / f"{name}.xml", keyframe="upright"), 1e-7)


def test_linearisation_of_a_cart_is_that_of_the_engine(tmp_path):
    agree(load_plant(two(tmp_path)), 1e-7)


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_a_brought_model_rests_and_is_linearised_as_the_engine_does(package, name):
    plant = load_plant(brought(package, name), selection=JOINTS, operating=BROUGHT[package][name])
    assert plant.quality.at_rest, plant.quality.residual
    agree(plant, 1e-5)


@pytest.mark.parametrize(("name", "free"), [
    ("cheetah.xml", ("rootx_rate", "rootz_rate", "rooty_rate")),
    ("humanoid.xml", tuple(f"root.{i}_rate" for i in range(6))),
    ("manipulator.xml", tuple(f"{what}_{axis}_rate" for what in ("ball", "peg") for axis in "xzy")),
])  # fmt: skip
def test_what_no_input_moves_of_a_body_in_the_air_is_its_momentum_in_each_direction(name, free):
    """Linear and angular momentum are what no joint changes: one mode for each speed of the whole, and no other."""
    plant = load_plant(brought("dm_control", name), selection=JOINTS)
    found = [mode for mode in plant.quality.uncontrollable if not mode.stable]
    assert len(found) == len(free)
    assert all(mode.eigenvalue == 0 for mode in found)
    # the mode of a direction has its speed, and no speed of the whole in another one
    assert sorted(name for mode in found for name in mode.states if name in free) == sorted(free)
