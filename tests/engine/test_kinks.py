"""A kink is where slopes differ up and down, not where they are nothing or change alike on both sides."""

from pathlib import Path

import pytest
from model_cases import MOTOR, pendulum, written

from icmj.engine.plant import load_plant

# weightless bodies: no slope in their turning, and what they turn by is even in how fast they turn
FREE = """
<mujoco model="free">
  <option gravity="0 0 0" timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="craft" pos="0 0 1"><freejoint name="flight"/>
      <inertial pos="{com}" mass="12" fullinertia="1 2 2.5 {products}"/><site name="nose" pos="0.3 0.1 0.2"/></body>
  </worldbody>
  <actuator>
    <motor name="thrust" site="nose" gear="0 0 1 0 0 0"/><motor name="spin" site="nose" gear="0 0 0 1 2 3"/>
  </actuator>
  <sensor><framepos name="place" objtype="site" objname="nose"/><framequat name="turn" objtype="site" objname="nose"/>
    <framelinvel name="speed" objtype="site" objname="nose"/></sensor>
</mujoco>"""
ARM = """
<mujoco model="arm">
  <option gravity="0 0 0" timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="a"><joint name="low" axis="0 0 1"/><inertial pos="0.5 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
      <body name="b" pos="1 0 0"><joint name="high" axis="0 0 1"/>
        <inertial pos="0.4 0 0" mass="2" diaginertia="0.1 0.1 0.1"/><site name="hand" pos="0.8 0 0"/></body></body>
  </worldbody>
  <actuator><motor name="one" joint="low"/><motor name="two" joint="high"/></actuator>
  <sensor><jointpos name="low" joint="low"/><jointpos name="high" joint="high"/>
    <framepos name="hand" objtype="site" objname="hand"/></sensor>
</mujoco>"""
SMOOTH = {
    "free": FREE.format(com="0 0 0", products="0 0 0"),
    "free, turned inertia": FREE.format(com="0.1 -0.2 0.05", products="0.3 -0.2 0.4"),
    "arm": ARM,
    "bent arm": ARM.replace("</mujoco>", '<keyframe><key name="at" qpos="0.3 -0.8"/></keyframe></mujoco>'),
    "even sensor": pendulum(MOTOR, sensor='<framepos name="height" objtype="site" objname="top"/>'),
}


@pytest.mark.parametrize("which", SMOOTH)
def test_a_smooth_plant_has_none(tmp_path: Path, which: str) -> None:
    text = SMOOTH[which]
    plant = load_plant(written(tmp_path, text), keyframe="at" if 'name="at"' in text else None)
    assert plant.quality.kinks == ()
    assert not [notice for notice in plant.quality.notices if notice.severity == "error"]


def test_a_sensor_at_its_cutoff_is_one(tmp_path: Path) -> None:
    lever = 'stiffness="1" springref="650.8"'
    text = pendulum(MOTOR, joint=lever, key='qpos="0.5" ctrl="-296.2918"', sensor="").replace(
        '<jointpos name="angle" joint="lean"/>', '<jointpos name="angle" joint="lean" cutoff="0.5"/>'
    )
    kinks = load_plant(written(tmp_path, text), keyframe="stand").quality.kinks
    assert [(kink.of, kink.kind) for kink in kinks] == [("lean", "state")]
    assert "output 'angle'" in kinks[0].why


def test_a_weightless_body_at_a_stop_has_one(tmp_path: Path) -> None:
    text = ARM.replace('name="low" axis="0 0 1"', 'name="low" axis="0 0 1" limited="true" range="0 60"')
    kinks = load_plant(written(tmp_path, text)).quality.kinks
    assert [(kink.of, kink.kind) for kink in kinks] == [("low", "state")]


def test_an_activation_at_its_end_is_one(tmp_path: Path) -> None:
    lag = '<general name="ankle" joint="lean" dyntype="filter" dynprm="0.1" actlimited="true" actrange="{} 30"/>'
    path = written(tmp_path, pendulum(lag.format("0")))
    (kink,) = load_plant(path, keyframe="stand").quality.kinks[:1]
    assert (kink.of, kink.kind) == ("ankle", "input")
    assert "its activation 0 is at an end of its actrange 0 to 30" in kink.why
    assert load_plant(written(tmp_path, pendulum(lag.format("-1"))), keyframe="stand").quality.kinks == ()
