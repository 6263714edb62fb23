"""A first run file for a model runs as it is, with the model's own names in it, or says what is in the way."""

import importlib.util
import tomllib
from pathlib import Path

import numpy as np
import pytest
from model_cases import MOTOR, MUSCLE, SERVO, pendulum, two, written

from icmj import load_run, prepare, simulate
from icmj.case.drafting import case_name, draft_run
from icmj.engine.inventory import list_inventory
from icmj.errors import ModelError
from icmj.simulation.simulation import get_relative_error

SHIPPED = ("pendulum", "pendulum_neglected", "three_link", "three_link_floor")
FOREIGN = (("gymnasium", "envs/mujoco/assets/inverted_pendulum.xml"), ("dm_control", "suite/cartpole.xml"))


def runs_as_it_is(model: Path, folder: Path):
    """The case of a draft, read from the file that it was written to, after it has moved on either plant."""
    out = folder / "first.toml"
    draft = draft_run(model, out)
    assert draft.trouble == ""
    out.write_text(draft.text, encoding="utf-8")
    run = load_run(out)
    case = prepare(run)
    assert np.isfinite(case.controller.design.k).all()
    for plant in ("linear", "mujoco"):
        simulation = simulate(case, plant, duration=0.5)
        assert simulation.outcome.kind == "completed"
        assert np.abs(simulation.x).max() > 1e-3  # it has somewhere to start from
    there = list_inventory(model)
    for name in (*there.keyframes, *there.inputs, *there.outputs, *there.joints):
        assert name in draft.text
    return case


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_models(root, tmp_path, name):
    case = runs_as_it_is(root / "models" / f"{name}.xml", tmp_path)
    assert case.run.assumed.keyframe == "upright"
    assert case.prediction.cycle
    assert "foot_x" not in case.actual.linearisation.plant.states


@pytest.mark.slow
@pytest.mark.parametrize(("package", "file"), FOREIGN)
def test_models_of_others(tmp_path, package, file):
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        pytest.skip(f"{package} is not installed")
    case = runs_as_it_is(Path(spec.origin).parent / file, tmp_path)
    assert case.run.assumed.outputs == "joints"  # their sensors, if any, tell no positions
    assert case.prediction.delta_crit is not None


@pytest.mark.parametrize("actuator", [MOTOR, SERVO])
def test_any_actuator(tmp_path, actuator):
    case = runs_as_it_is(written(tmp_path, pendulum(actuator)), tmp_path)
    assert case.run.assumed.model == "model.xml"
    assert case.run.simulation.initial == {"lean": 0.02}


TOUCHES = (
    pendulum(MOTOR)
    .replace('integrator="RK4"><flag contact="disable"/></option>', 'integrator="{}"/>')
    .replace("<worldbody>", '<worldbody><geom name="ground" type="plane" size="1 1 1" pos="0 0 -1"/>')
    .replace('<site name="top"', '<geom name="head" size="0.1" pos="0 0 1.8" mass="0"/><site name="top"')
)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_where_steps_of_first_order_would_be_taken_better_ones_are_written(tmp_path, integrator):
    """Something could touch, so no step is chosen, and the first run erred by percent."""
    case = runs_as_it_is(written(tmp_path, TOUCHES.format(integrator)), tmp_path)
    assert case.run.simulation.integrator == "RK4"
    assert 0 < case.run.simulation.timestep <= 0.002
    assert get_relative_error(simulate(case, "mujoco", duration=6.0)) < 1e-6
    own = prepare(case.run.with_(**{"simulation.timestep": None, "simulation.integrator": None}))
    assert get_relative_error(simulate(own, "mujoco", duration=6.0)) > 1e-3


def test_where_the_model_has_its_steps_or_they_are_chosen_none_are_written(tmp_path):
    for text in (TOUCHES.format("RK4"), pendulum(MOTOR).replace("RK4", "Euler")):
        case = draft_run(written(tmp_path, text), tmp_path / "first.toml").case
        assert case is not None
        assert (case.run.simulation.integrator, case.run.simulation.timestep) == (None, None)


def test_of_several_keyframes_one_at_rest_is_taken_and_the_others_are_named(tmp_path):
    two_keys = '<key name="leaning" qpos="0.3"/><key name="upright" qpos="0"/>'
    text = pendulum(MOTOR).replace('<key name="stand" qpos="0"/>', two_keys)
    model = written(tmp_path, text)
    case = draft_run(model, tmp_path / "first.toml").case
    assert case is not None
    assert (case.run.assumed.keyframe, case.run.assumed.operating_point) == ("upright", "as given")
    leaning = draft_run(model, tmp_path / "first.toml", "leaning")
    assert leaning.case is not None
    assert leaning.case.run.assumed.operating_point == "static control"
    assert "or upright" in leaning.text
    with pytest.raises(ModelError, match="no keyframe 'lying'; it has leaning, upright"):
        draft_run(model, tmp_path / "first.toml", "lying")


def test_sensors_that_jump_or_tell_no_place_are_not_taken(tmp_path):
    text = pendulum(MOTOR, sensor='<accelerometer name="jerky" site="top"/>')
    case = draft_run(written(tmp_path, text), tmp_path / "first.toml").case
    assert case is not None
    assert "angle" in case.run.assumed.outputs
    assert not [name for name in case.run.assumed.outputs if name.startswith("jerky")]


def test_weights_go_with_the_plant_s_gain(tmp_path):
    """A motor with a gear of 100 costs ten thousand times as much for one unit of its control."""
    R = []
    for gear in (1, 100):
        actuator = MOTOR.replace("/>", f' gear="{gear}"/>')
        case = draft_run(written(tmp_path, pendulum(actuator)), tmp_path / "first.toml").case
        assert case is not None
        R.append((case.run.design.R_c, case.run.design.R_o))
    np.testing.assert_allclose(np.divide(*R), 1e-4, rtol=1e-9)


@pytest.mark.parametrize(("text", "trouble"), [
    (pendulum(MOTOR, joint='frictionloss="1"'), "dry friction: lean has dry friction"),
    (pendulum(MUSCLE), "kink: the plant answers differently up and down in input 'ankle': a muscle"),
])  # fmt: skip
def test_what_is_in_the_way_is_told_and_the_rest_is_written(tmp_path, text, trouble):
    draft = draft_run(written(tmp_path, text), tmp_path / "first.toml")
    assert draft.case is None
    assert draft.trouble.startswith(trouble)
    assert "\n" not in draft.trouble
    assert tomllib.loads(draft.text)["assumed"]["inputs"] == ["ankle"]


def test_names_that_are_no_bare_words_and_paths_elsewhere(tmp_path):
    text = two(tmp_path).read_text(encoding="utf-8").replace('"tilt"', '"tilt # of ζ.1"')
    (tmp_path / "models").mkdir()
    (tmp_path / "runs").mkdir()
    model = written(tmp_path / "models", text, "my model (2).xml")
    draft = draft_run(model, tmp_path / "runs" / "first.toml")
    said = tomllib.loads(draft.text)
    assert said["assumed"]["model"] == "../models/my model (2).xml"
    assert said["case"]["name"] == case_name(model) == "my-model-2"
    assert draft.trouble == "", draft.trouble
    assert draft_run(model, Path("/first.toml")).text.count(f'model = "{model.as_posix()}"') == 1
