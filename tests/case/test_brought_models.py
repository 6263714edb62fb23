"""Models that other people made run from a few lines and do what is predicted, or stop with a reason of nature."""

import importlib.util
from pathlib import Path

import pytest

from icmj import IcmjError, parse_run, prepare, simulate

FOLDERS = {"gymnasium": "envs/mujoco/assets", "dm_control": "suite"}
GIVEN = ', operating_point = "as given"'
LINES = """
case = {{ name = "brought", title = "Brought along" }}
assumed = {{ model = "{model}", outputs = "joints"{more} }}
actual = {{ gain = 0.9 }}
design = {{ Q_c = "identity", R_c = {R_c}, R_o = 0.01 }}
controller = {{ q_t = 1e-4 }}
simulation = {{ duration = 20.0, initial = {{ {joint} = 1e-4 }}, integrator = "RK4", timestep = 0.002 }}
"""


def run_file(package, name, more="", R_c=0.1, joint="hinge"):
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed")
    folder = Path(found.origin).parent / FOLDERS[package]
    text = LINES.format(model=name, more=more, R_c=R_c, joint=joint)
    return parse_run(text, folder / "run.toml")


@pytest.mark.parametrize(("package", "name", "more", "R_c", "joint"), [
    ("gymnasium", "inverted_pendulum.xml", ', operating_point = "balance", free = ["hinge"]', 0.1, "hinge"),
    ("dm_control", "pendulum.xml", "", 1.0, "hinge"),
    ("dm_control", "cartpole.xml", "", 0.1, "hinge_1"),
])  # fmt: skip
def test_a_brought_model_does_what_is_predicted(package, name, more, R_c, joint):
    case = prepare(run_file(package, name, more, R_c, joint))
    assert case.notices == ()
    assert case.prediction.verdict == "attracting"
    run = simulate(case, "mujoco")
    assert run.events.interval[-1] == pytest.approx(case.prediction.delta_crit, rel=1e-5)


@pytest.mark.parametrize(("package", "name", "more", "joint", "reason"), [
    # as it is: the pole leans by the offset that the environment is known for
    ("gymnasium", "inverted_pendulum.xml", GIVEN, "hinge", "not at rest: hinge accelerates by 0.0498 rad/s²"),
    # its file has gravity lean by a millionth
    ("gymnasium", "inverted_double_pendulum.xml", GIVEN, "hinge", "not at rest: slider accelerates by 1e-05 m/s²"),
    ("dm_control", "walker.xml", GIVEN, "rooty", "not at rest: rootz accelerates by 9.81"),
])  # fmt: skip
def test_a_model_that_cannot_be_predicted_is_refused_with_the_reason(package, name, more, joint, reason):
    with pytest.raises(IcmjError, match=reason):
        prepare(run_file(package, name, more, joint=joint))


@pytest.mark.slow
def test_a_walker_whose_place_on_the_floor_is_dropped_has_a_design():
    """Standing on two feet is controllable but for where it stands; the whole theory of it takes minutes."""
    from icmj.case.plants import assumed_plant
    from icmj.controller.design import design_lq

    plant = assumed_plant(run_file("dm_control", "walker.xml"))
    assert plant.quality.notices == ()
    assert plant.quality.at_rest
    assert "rootx" not in (*plant.linearisation.plant.states, *plant.linearisation.plant.outputs)
    design_lq(plant.linearisation.plant, R_c=0.01, R_o=0.01)
