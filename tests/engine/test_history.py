"""Sensors and actuators that remember: a delay in the model is refused, a memory that only looks on changes nothing."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from model_cases import MOTOR, pendulum, written

from icmj.case.case import prepare
from icmj.controller.controller import Controller
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.engine.deviation import Deviation
from icmj.engine.linearisation import linearise
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.plant.body import Selection
from icmj.runfile.reading import parse_run
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation

RATE = '<jointvel name="rate" joint="lean"{}/>'
PLAIN = pendulum(MOTOR, sensor=RATE.format(""))
LATE = {
    "sensor": (
        pendulum(MOTOR, sensor=RATE.format(' nsample="50" delay="0.1"')),
        "output 'rate' has a delay of 0.1 s; remove it from the model, and give the loop's as .*assumed.* delay",
    ),
    "actuator": (
        pendulum('<motor name="ankle" joint="lean" nsample="50" delay="0.1" interp="linear"/>'),
        "input 'ankle' has a delay of 0.1 s; remove it from the model",
    ),
    "default": (
        PLAIN.replace("<worldbody>", '<default><motor nsample="9" delay="0.01"/></default><worldbody>'),
        "input 'ankle' has a delay of 0.01 s",
    ),
    "interval": (
        pendulum(MOTOR, sensor=RATE.format(' nsample="5" interval="0.05"')),
        "output 'rate' is read every 0.05 s only; remove its interval",
    ),
}
RUN = """
case = { name = "brought", title = "Brought along" }
assumed = { model = "model.xml", keyframe = "stand" }
actual = { gain = 0.9 }
controller = { q_t = 0.001 }
"""


@pytest.mark.parametrize("which", LATE)
def test_a_delay_of_the_model_is_refused_wherever_it_is_loaded(tmp_path: Path, which: str) -> None:
    text, words = LATE[which]
    path = written(tmp_path, text)
    with pytest.raises(ModelError, match=words):
        load_plant(path, keyframe="stand")
    with pytest.raises(ModelError, match=words):
        linearise(mujoco.MjModel.from_xml_path(str(path)), "stand")
    with pytest.raises(ModelError, match=words) as caught:
        prepare(parse_run(RUN, tmp_path / "run.toml"))
    assert "\n" not in str(caught.value)


def moved(path: Path, settings: Settings) -> Simulation:
    assumed = load_plant(path, keyframe="stand").linearisation.plant
    size = float(np.abs(assumed.B).max())
    design = design_lq(assumed, R_c=1e-2 * size**2, R_o=1e-2 * size**2)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    return simulate(load_plant(path, Deviation(0.9), "stand"), control, settings, x0=[0.02, 0.0])


@pytest.mark.parametrize("timestep", [None, 0.002])
def test_a_memory_that_only_looks_on_changes_nothing(tmp_path: Path, timestep: float | None) -> None:
    motor = '<motor name="ankle" joint="lean" nsample="7" interp="cubic"/>'
    keen = pendulum(motor, sensor=RATE.format(' nsample="4"')).replace("<jointpos ", '<jointpos nsample="3" ')
    plain, other = written(tmp_path, PLAIN, "plain.xml"), written(tmp_path, keen, "keen.xml")
    mine, theirs = (load_plant(path, keyframe="stand") for path in (plain, other))
    for letter in "ABC":
        here, there = (getattr(plant.linearisation.plant, letter) for plant in (mine, theirs))
        np.testing.assert_array_equal(here, there)
    settings = Settings(duration=4.0, timestep=timestep)
    one, two = moved(plain, settings), moved(other, settings)
    assert len(one.events) > 1
    for field in ("t", "x", "y", "u", "x_o", "x_h", "E"):
        np.testing.assert_array_equal(getattr(one, field), getattr(two, field))
    assert one.precision["interval_error"] == two.precision["interval_error"]
    assert one.precision.get("tolerance") == two.precision.get("tolerance")


def test_a_delay_of_what_is_not_used_does_not_matter(tmp_path: Path) -> None:
    late = pendulum(
        MOTOR + '<motor name="spare" joint="lean" nsample="50" delay="0.1"/>',
        sensor=RATE.format(' nsample="50" delay="0.1"'),
        key='qpos="0" ctrl="1 -1"',
    )
    path = written(tmp_path, late)
    selection = Selection(inputs=("ankle",), outputs=("angle",))
    plant = load_plant(path, keyframe="stand", selection=selection)
    assert plant.quality.at_rest
    J = 6 + 70 * 0.9**2
    np.testing.assert_allclose(plant.linearisation.plant.A, [[0, 1], [70 * 9.81 * 0.9 / J, 0]], atol=1e-7)
    np.testing.assert_allclose(plant.linearisation.plant.B, [[0], [1 / J]], rtol=1e-8)
    design = design_lq(plant.linearisation.plant, R_c=1e-6, R_o=1e-6)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    still = simulate(plant, control, Settings(duration=1.0), x0=[0.0, 0.0])
    assert np.abs(still.x).max() < 1e-12
