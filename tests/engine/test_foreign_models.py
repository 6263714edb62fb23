"""Models of gymnasium and dm_control from run files of five lines: they do what is predicted, or stop for a reason.

On the orbit that the theory predicts the linear plant's interval is the predicted one to rounding, and MuJoCo's departs
from it with the square of the threshold where the model is its own mirror image, and in proportion to it where it is
not (knees bend one way only).
"""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest
from kernel_cases import computed, kernels
from scipy.linalg import expm

from icmj import Case, IcmjError, MujocoPlant, RunFile, open_loop, parse_run, prepare
from icmj.case.plants import assumed_plant

FOLDERS = {"gymnasium": "envs/mujoco/assets", "dm_control": "suite"}
JOINTS = 'outputs = "joints"'
AS_GIVEN, STATIC, BALANCE = (
    f'{JOINTS}, operating_point = "{kind}"' for kind in ("as given", "static control", "balance")
)
BENT = f"{BALANCE}, pose = {{ thigh_joint = -0.2, leg_joint = -0.4, foot_joint = 0.2 }}"
STRAIGHT = f"{BALANCE}, pose = {{ thigh_joint = 0.0, leg_joint = 0.0, foot_joint = 0.0 }}"
SLOW = pytest.mark.slow

# package, file, what [assumed] says beside the model, and the power of q_t with which MuJoCo departs from the theory
RUNNING = [
    ("gymnasium", "inverted_pendulum.xml", "", 2),
    ("gymnasium", "inverted_double_pendulum.xml", "", 2),
    ("gymnasium", "hopper.xml", "", 1),
    ("gymnasium", "hopper.xml", BENT, 1),
    ("gymnasium", "walker2d.xml", "", 1),
    ("gymnasium", "walker2d_v5.xml", "", 2),
    ("dm_control", "cartpole.xml", "", 2),
    ("dm_control", "acrobot.xml", "", 2),
    ("dm_control", "pendulum.xml", "", 2),
    ("dm_control", "hopper.xml", JOINTS, 1),  # its own sensors tell forces
    ("dm_control", "walker.xml", JOINTS, 1),  # its own sensors tell nothing of the legs
]
HUMANOID = pytest.param("dm_control", "humanoid.xml", JOINTS, 1, marks=SLOW)  # the other one is no other kind

# package, file, [assumed], and the reason of nature why there is nothing to predict
REFUSED = [
    # its mass lies beside the pole's axis, as the environment is known for
    ("gymnasium", "inverted_pendulum.xml", AS_GIVEN, r"^\S+: not at rest: hinge accelerates by 0.0498 rad/s²"),
    ("gymnasium", "inverted_pendulum.xml", STATIC, "on hinge 0.0246 N m"),
    # in the air a body falls
    ("gymnasium", "hopper.xml", AS_GIVEN, "not at rest: rootz accelerates by 9.81 m/s², 1 of gravity"),
    ("gymnasium", "humanoid.xml", STATIC, "on root.2 413 N are missing"),
    # straight legs stand at the ends of their joints' ranges
    ("gymnasium", "hopper.xml", STRAIGHT, "kink: .*'thigh_joint': a joint limit"),
    # a force jumps with the torque; on a level floor no joint moves the whole
    ("dm_control", "hopper.xml", "", "feedthrough: output 'touch_toe'.*or take outputs = \"joints\""),
    ("gymnasium", "hopper.xml", 'outputs = ["rootx", "rootz", "rooty"]', r"no input moves rootx.*drop = \[\"rootx\"\]"),
]


def five_lines(package: str, name: str, assumed: str) -> RunFile:
    """The run file, beside the model in its package; five lines, and one that keeps the search short."""
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed")
    text = f"""
    case = {{ name = "foreign", title = "A model of others" }}
    assumed = {{ model = "{name}"{assumed and ", "}{assumed} }}
    actual = {{ gain = 0.9 }}
    controller = {{ q_t = 1e-4 }}
    simulation = {{ integrator = "RK4", timestep = 0.001 }}
    analysis = {{ delta_max = 1.0 }}"""
    if name in ("walker.xml", "humanoid.xml"):
        text = text.replace("delta_max = 1.0", "delta_max = 0.3")  # poles of 13 rad/s: the search takes long beyond
    return parse_run(text, Path(found.origin).parent / FOLDERS[package] / "run.toml")


def departure(case: Case, plant: str, q_t: float) -> float:
    """Relative error of the interval of ``plant``, from the state that the theory predicts at an event."""
    orbit, n, n_hat = case.prediction.orbit, case.system.n, case.system.n_hat
    assert orbit is not None
    assert orbit.admissible, orbit.reason
    X = case.system.to_original(case.system.T_bar @ orbit.x_bar) * (q_t / case.rule.size)
    flown = open_loop(case, plant, trigger=case.rule.resized(q_t))(X[:n], X[n : n + n_hat])
    assert flown.outcome is None, flown.outcome
    return abs(flown.length / orbit.delta - 1)


@pytest.mark.parametrize(("package", "name", "assumed", "power"), [*RUNNING, HUMANOID])
def test_a_model_of_others_does_what_is_predicted(package, name, assumed, power):
    case = prepare(five_lines(package, name, assumed))
    assert departure(case, "linear", 1e-4) < 1e-9
    at = {q_t: departure(case, "mujoco", q_t) for q_t in (1e-3, 1e-4, 2e-5, 1e-5)}
    assert at[1e-4] < (1e-6 if power == 2 else 2e-4)
    # what finite differences leave of a linearisation does not depend on the threshold, and is seen where all is small
    left = 2 * at[1e-5] - at[2e-5] if at[1e-5] < 1e-8 else 0.0
    # the first power is alone where the second has gone; the second, where rounding has not come yet
    large, small = (at[1e-3], at[1e-4]) if power == 2 else (at[1e-4], at[1e-5])
    assert np.log10((large - left) / (small - left)) == pytest.approx(power, abs=0.15)


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize(("package", "name", "assumed", "reason"), REFUSED)
def test_a_model_of_others_stops_with_one_line_that_names_the_reason(package, name, assumed, reason):
    with pytest.raises(IcmjError, match=reason) as caught:
        prepare(five_lines(package, name, assumed))
    assert "\n" not in str(caught.value)


def test_what_was_chosen_for_a_model_is_told():
    notices = {notice.kind: notice for notice in prepare(five_lines("gymnasium", "hopper.xml", "")).notices}
    assert set(notices) == {"operating point", "outputs", "dropped state"}
    assert all(notice.severity == "warning" for notice in notices.values())
    assert "not at rest; balanced away from it by rooty" in notices["operating point"].words
    assert (
        'nothing depends on rootx, and no input moves it: dropped, as drop = ["rootx"]'
        in notices["dropped state"].words
    )


@pytest.mark.parametrize(("package", "name"), [("gymnasium", "hopper.xml"), ("dm_control", "hopper.xml")])
def test_a_stand_found_has_room_in_its_joints(package, name):
    plant = assumed_plant(five_lines(package, name, JOINTS))
    assert all(plant.quality.merits)
    for joint in plant.quality.room:
        assert min(joint.down, joint.up) > 0.01 * (joint.down + joint.up), joint


def transition(plant: MujocoPlant, timestep: float) -> np.ndarray:
    """A of one step of the engine's implicit integrator, of the states that the plant has; no callback is installed."""
    model, point = plant.spec.compile(), plant.linearisation.point
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_IMPLICIT, timestep
    model.opt.tolerance, model.opt.iterations = 0.0, 200
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = point.qpos, point.ctrl
    A = np.zeros((2 * model.nv, 2 * model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    kept = plant.linearisation.ports.states
    return A[np.ix_(kept, kept)]


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize(("package", "name", "assumed", "power"), RUNNING)
def test_the_engine_s_own_step_tends_to_the_exponential_of_the_linearisation(package, name, assumed, power):
    """(A_d − e^{Ah})/h vanishes with h: to first order for one step, and beyond it when two are extrapolated."""
    plant = assumed_plant(five_lines(package, name, assumed))
    A, h = plant.linearisation.plant.A, 2e-5

    def error(h: float) -> np.ndarray:
        return (transition(plant, h) - expm(A * h)) / h

    size = np.abs(A).max()
    whole, half = error(h), error(h / 2)
    assert np.abs(2 * half - whole).max() < 2e-5 * size
    assert np.abs(whole).max() < 10 * h * np.abs(A @ A).max() + 2e-5 * size


POSES = """
import importlib.util
from pathlib import Path
from icmj.case.plants import assumed_plant
from icmj.runfile.reading import parse_run
for package, folder, name in {models!r}:
    file = Path(importlib.util.find_spec(package).origin).parent / folder / "run.toml"
    text = f'''case = {{{{ name = "foreign", title = "A model of others" }}}}
assumed = {{{{ model = "{{name}}", outputs = "joints" }}}}
controller = {{{{ q_t = 1e-4 }}}}
simulation = {{{{ timestep = 0.001 }}}}'''
    plant = assumed_plant(parse_run(text, file))
    print(*plant.quality.merits, *plant.linearisation.plant.states)
    print(*plant.linearisation.point.qpos)
"""


@pytest.mark.slow
def test_the_poses_found_are_the_same_whatever_the_processor_and_its_threads():
    """To rounding times what stiff contacts make of it; before, the last bit decided between poses."""
    models = (("gymnasium", "walker2d_v5.xml"), ("dm_control", "humanoid.xml"))
    there = [(package, FOLDERS[package], name) for package, name in models if importlib.util.find_spec(package)]
    ways = [(kernels()[0], 1), (kernels()[-1], 2)]
    first, *others = (computed(POSES.format(models=there), *way).splitlines() for way in ways)
    assert len(first) == 2 * len(there) > 0
    for verdict in first[::2]:
        assert verdict.startswith("True True True True True ")
    for other in others:
        assert other[::2] == first[::2]
        for pose, expected in zip(other[1::2], first[1::2], strict=True):
            np.testing.assert_allclose(np.array(pose.split(), float), np.array(expected.split(), float), atol=1e-5)
