"""Each way in which a model is not what a linear theory takes it for is seen, and said in words that name it."""

import numpy as np
import pytest
from engine_cases import MODELS
from model_cases import MOTOR, MUSCLE, SERVO, pendulum, two, written

from icmj.engine.plant import load_plant
from icmj.plant.body import Selection

LEAN = f'qpos="{np.radians(3)}"'
ONE_WAY = '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="0 300"/>'
TWO_WAYS = '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-20 20"/>'
ACCELEROMETER = '<accelerometer name="acceleration" site="top"/>'

CASES = {
    "leaning without control": (
        pendulum(MOTOR, key=LEAN),
        "not at rest",
        "lean accelerates by 0.516 rad/s², 0.053 of gravity",
    ),
    "turning": (pendulum(MOTOR, key='qpos="0" qvel="1"'), "not at rest", "lean has a velocity"),
    "one-way input": (pendulum(ONE_WAY), "kink", "input 'ankle': its control 0 is at an end of its ctrlrange 0 to 300"),
    "muscle at rest": (pendulum(MUSCLE), "kink", "input 'ankle': a muscle at excitation 0"),
    "joint limit": (
        pendulum(MOTOR, joint='limited="true" range="0 1"'),
        "kink",
        "state 'lean': a joint limit, a contact or dry friction",
    ),
    "dry friction": (pendulum(MOTOR, joint='frictionloss="1"'), "dry friction", "lean has dry friction"),
    "accelerometer": (pendulum(MOTOR, sensor=ACCELEROMETER), "feedthrough", "output 'acceleration.0' jumps"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_an_error_that_names_it(tmp_path, case):
    text, kind, words = CASES[case]
    notices = load_plant(written(tmp_path, text), keyframe="stand").quality.notices
    told = [notice for notice in notices if notice.kind == kind]
    assert told, notices
    assert told[0].severity == "error"
    assert words in told[0].words


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, TWO_WAYS])
def test_a_smooth_plant_at_rest_needs_no_word(tmp_path, actuator):
    quality = load_plant(written(tmp_path, pendulum(actuator)), keyframe="stand").quality
    assert quality.notices == ()
    assert quality.at_rest
    assert max(quality.errors) < 1e-8


def test_an_output_that_is_not_used_does_not_matter(tmp_path):
    path = written(tmp_path, pendulum(MOTOR, sensor=ACCELEROMETER))
    assert load_plant(path, keyframe="stand", selection=Selection(outputs=("angle",))).quality.notices == ()


def test_margins_are_those_of_the_range(tmp_path):
    plant = load_plant(written(tmp_path, pendulum(TWO_WAYS, key='qpos="0" ctrl="5"')), keyframe="stand")
    margin = plant.quality.margins[0]
    assert (margin.of, margin.down, margin.up) == ("ankle", 25.0, 15.0)


def test_a_place_that_does_not_matter_is_told_with_what_to_do(tmp_path):
    plant = load_plant(two(tmp_path), selection=Selection(outputs=("angle",)))
    (notice,) = plant.quality.notices
    assert notice.words == 'x does not matter to any output; drop = ["x"], or add an output that shows it'
    assert notice.severity == "warning"
    assert load_plant(two(tmp_path), selection=Selection(outputs=("angle",), drop=("x",))).quality.notices == ()


@pytest.mark.parametrize("solver", ["Newton", "CG", "PGS"])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_place_is_left_out_though_derivatives_are_too_coarse_to_tell_that_no_input_moves_it(tmp_path, cone, solver):
    """Forces that a number of iterations keeps from slipping are hardly smooth."""
    option = f'cone="{cone}" solver="{solver}" noslip_iterations="10"'
    text = (MODELS / "three_link_floor.xml").read_text(encoding="utf-8").replace('cone="elliptic"', option)
    path = written(tmp_path, text)
    found, told = (load_plant(path, keyframe="upright", selection=Selection(drop=drop)) for drop in ((), ("foot_x",)))
    assert "foot_x" not in found.linearisation.plant.states
    np.testing.assert_array_equal(found.linearisation.plant.A, told.linearisation.plant.A)
    assert [notice.kind for notice in found.told] == ["dropped state"]
    shown = load_plant(path, keyframe="upright", selection=Selection(outputs="joints"))
    undecided = [one for one in shown.quality.notices if "does not tell whether an input moves it" in one.words]
    assert bool(undecided) == ("foot_x" in shown.linearisation.plant.states) == (cone == "elliptic")
    assert {one.severity for one in undecided} <= {"error"}
