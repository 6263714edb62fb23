"""A limit that the operating point is already beyond, and an input that moves nothing, are told on either plant."""

import json

import numpy as np
import pytest
from model_cases import MOTOR, MUSCLE, pendulum, written

from icmj import LinearPlant, load_plant, parse_run, prepare
from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.plant.quality import MatrixPlant

LAGGED = '<general name="ankle" joint="lean" dyntype="filter" dynprm="0.1" {}/>'
ROPE = '</actuator><tendon><fixed name="rope" {}><joint joint="lean" coef="2"/></fixed></tendon><actuator>'
PULLED = f'<motor name="ankle" tendon="rope"/>{ROPE}'
OTHER = '<motor name="spare" joint="lean"/>'

# the model; the keyframe within the limit, and beyond it; kind and words; whether the input ankle then moves nothing
BEYOND = {
    "ctrlrange": (
        '<motor name="ankle" joint="lean" ctrlrange="-1 0"/>', "", 'ctrl="-0.5"', 'ctrl="0.3"',
        "saturation", "the ctrlrange of ankle, -1 to 0, where ankle moves nothing", True,
    ),
    "forcerange": (
        '<motor name="ankle" joint="lean" gear="5" forcerange="-1 1"/>', "", 'ctrl="0.5"', 'ctrl="3"',
        "saturation", "the forcerange of ankle, -1 to 1, where ankle moves nothing", True,
    ),
    "actrange": (
        LAGGED.format('actrange="-1 1"'), "", 'act="0.5" ctrl="0.5"', 'act="2" ctrl="2"',
        "saturation", "the actrange of ankle, -1 to 1, where ankle moves nothing", True,
    ),
    "joint force": (
        MOTOR, 'actuatorfrcrange="-1 1"', 'ctrl="0.5"', 'ctrl="3"',
        "saturation", "the actuatorfrcrange of joint lean, -1 to 1", True,
    ),
    "tendon force": (
        PULLED.format('actuatorfrcrange="-1 1"'), "", 'ctrl="0.5"', 'ctrl="3"',
        "saturation", "the actuatorfrcrange of tendon rope, -1 to 1", True,
    ),
    "joint range": (
        MOTOR, 'range="-0.1 0.1"', 'qpos="0.05"', 'qpos="0.12"',
        "joint limit", "an end of the range of joint lean, -0.1 to 0.1", False,
    ),
    "tendon range": (
        PULLED.format('range="-0.2 0.2"'), "", 'qpos="0.05"', 'qpos="0.12"',
        "joint limit", "an end of the range of tendon rope, -0.2 to 0.2", False,
    ),
    "cutoff": (
        MOTOR, "", 'qpos="0.05"', 'qpos="0.12"', "saturation", "the cutoff of sensor angle, 0.1", False,
    ),
}  # fmt: skip


def model(name, key):
    actuator, joint = BEYOND[name][:2]
    text = pendulum(actuator, joint=joint, key=key)
    return text.replace('name="angle"', 'name="angle" cutoff="0.1"') if name == "cutoff" else text


def beyond(quality):
    return [notice for notice in quality.notices if notice.words.startswith("the operating point is beyond")]


@pytest.mark.parametrize("name", BEYOND)
def test_a_limit_is_told_where_the_point_is_beyond_it_and_only_there(tmp_path, name):
    _, _, within, key, kind, words, still = BEYOND[name]
    quality = load_plant(written(tmp_path, model(name, key)), keyframe="stand").quality
    (notice,) = beyond(quality)
    assert (notice.kind, notice.severity) == (kind, "warning")
    assert words in notice.words
    assert quality.dead == (("ankle",) if still else ())
    quality = load_plant(written(tmp_path, model(name, within), "within.xml"), keyframe="stand").quality
    assert beyond(quality) == []
    assert quality.dead == ()


def test_an_excitation_that_a_muscle_does_not_take_is_told(tmp_path):
    path = written(tmp_path, pendulum(MUSCLE, key='qpos="0" act="1" ctrl="1.3"'))
    quality = load_plant(path, keyframe="stand").quality
    assert quality.dead == ("ankle",)
    assert any("input 'ankle' moves nothing" in notice.words for notice in quality.notices)


RUN = """
case = { name = "beyond", title = "Beyond" }
[assumed]
model = "model.xml"
keyframe = "stand"
[actual]
gain = 0.9
[controller]
q_t = 0.001
"""


def test_the_cause_comes_with_the_refusal_of_a_design(tmp_path):
    written(tmp_path, model("ctrlrange", 'ctrl="0.3"'))
    with pytest.raises(IcmjError, match="beyond the ctrlrange of ankle, -1 to 0, where ankle moves nothing"):
        prepare(parse_run(RUN, tmp_path / "run.toml"))


def test_of_several_inputs_the_dead_one_is_told_for_both_plants(tmp_path, capsys):
    both = '<motor name="ankle" joint="lean" ctrlrange="-1 0"/>' + OTHER
    path = written(tmp_path, pendulum(both, key='qpos="0" ctrl="0.3 0"'))
    case = prepare(parse_run(RUN, tmp_path / "run.toml"))
    (notice,) = case.notices
    assert notice.words.startswith("the operating point is beyond the ctrlrange of ankle")
    assert main(["linearise", str(path), "--keyframe", "stand", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["quality"]["dead"] == ["ankle"]
    assert found["notices"][0]["words"] == notice.words


def test_a_range_that_does_not_clamp_is_none(tmp_path):
    text = model("ctrlrange", 'ctrl="0.3"').replace('contact="disable"', 'clampctrl="disable"')
    quality = load_plant(written(tmp_path, text), keyframe="stand").quality
    assert (beyond(quality), quality.dead) == ([], ())


def test_a_column_of_zeros_of_a_matrix_is_told():
    plant = MatrixPlant.of(LinearPlant([[0, 1], [4, 0]], [[0, 0], [1, 0]], np.eye(2)))
    (notice,) = plant.quality.notices
    assert notice.words == "input 'u1' moves nothing (its column of B is zero); leave it out of inputs"
