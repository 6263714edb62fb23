"""The heading of a body on a floor does not matter, in whatever frame its joint turns: it is left out, exactly."""

from pathlib import Path

import numpy as np
import pytest
from model_cases import written
from scipy.linalg import expm

from icmj import (
    Controller,
    EventTrigger,
    MujocoPlant,
    Settings,
    design_lq,
    load_plant,
    parse_run,
    prepare,
    system_matched,
)  # fmt: skip
from icmj.engine.run import simulate
from icmj.plant.body import OperatingRule, Selection

PLACE = ("root.0", "root.1", "root.5")
SOLE = "".join(
    f'<geom type="sphere" size="0.02" pos="{x} {y} -0.08" mass="0"/>' for x in (-0.07, 0.18) for y in (-0.1, 0.1)
)
# the root's frame is turned by {turn}, and all that is in it by {back}
STANDING = """
<mujoco model="standing"><compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4" cone="elliptic"/>
  <default><geom condim="6" friction="1 0.02 0.01" solref="0.01 1" solimp="0.95 0.95 0.001"/></default>
  <worldbody><geom type="plane" size="3 3 1"/>
    <body name="base" pos="0 0 0.1" quat="{turn}"><freejoint name="root"/><frame quat="{back}">
      <inertial pos="0.02 0 0" mass="5" diaginertia="0.05 0.05 0.05"/>{sole}
      <body name="rod"><joint name="ankle" axis="0 1 0" damping="2"/>
        <inertial pos="0 0 0.8" mass="60" diaginertia="5 5 1"/></body></frame></body></worldbody>
  <actuator><motor name="ankle" joint="ankle"/></actuator>
  <sensor><framezaxis name="up" objtype="xbody" objname="world" reftype="xbody" refname="rod"/>
    <jointpos name="bend" joint="ankle"/></sensor>
</mujoco>"""


def standing(folder: Path, tilt: float) -> Path:
    """A rod on a foot whose joint turns in a frame that is tilted by so many radians; the body is always the same."""
    axis = np.sin(tilt / 2) * np.array([1, 15, 0]) / np.sqrt(226)
    turn, back = (" ".join(f"{q!r}" for q in (float(np.cos(tilt / 2)), *map(float, side))) for side in (axis, -axis))
    return written(folder, STANDING.format(turn=turn, back=back, sole=SOLE), f"standing-{tilt}.xml")


def load(path: Path, drop: tuple[str, ...] = ()) -> MujocoPlant:
    return load_plant(path, selection=Selection(drop=drop), operating=OperatingRule("balance"))


def poles(plant: MujocoPlant) -> np.ndarray:
    """In an order that does not hang on the last bit."""
    found = plant.linearisation.plant.poles
    return found[np.lexsort((found.imag > 0, np.round(np.abs(found), 3)))]


@pytest.mark.parametrize("drop", [(), PLACE], ids=["found", "by hand"])
@pytest.mark.parametrize("tilt", [0.012, 0.3])
def test_the_heading_is_left_out_exactly_in_any_frame(tmp_path: Path, tilt: float, drop: tuple[str, ...]) -> None:
    upright, tilted = load(standing(tmp_path, 0.0)), load(standing(tmp_path, tilt), drop)
    assert tilted.linearisation.plant.states == upright.linearisation.plant.states
    np.testing.assert_allclose(poles(tilted), poles(upright), rtol=1e-6)
    (words,) = [notice.words for notice in tilted.told if "direction" in notice.words]
    assert words.startswith("with root.5 the direction root.5 ")
    # a turn about the vertical, as the root's frame has it
    w, x, y, z = tilted.linearisation.point.qpos[3:7]
    vertical = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)])
    np.testing.assert_allclose(tilted.linearisation.ports.still[0][3:6], vertical / vertical[2], atol=1e-6)


def test_a_run_departs_as_the_plant_without_its_heading_does(tmp_path: Path) -> None:
    plant = load(standing(tmp_path, 0.3))
    linear = plant.linearisation.plant
    gains = design_lq(linear)
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(linear.n), 1e3, delta_min=0.0))
    x0 = np.zeros(linear.n)
    x0[1:4] = 1e-7, -2e-7, 3e-7
    settings = Settings(duration=0.2, timestep=5e-4, integrator="RK4", record_interval=0.02)
    run = simulate(plant, control, settings, x0=x0, x_o0=np.zeros(linear.n), error_estimate=False)
    exact = np.array([expm(linear.A * t) @ x0 for t in run.t])
    assert (np.abs(run.x - exact).max(axis=0) < 1e-4 * np.abs(exact).max(axis=0)).all()


def test_what_is_dropped_in_the_assumed_plant_leaves_no_heading_in_the_actual_one(tmp_path: Path) -> None:
    standing(tmp_path, 0.3)
    text = f"""
    case = {{ name = "heading", title = "Heading" }}
    [assumed]
    model = "standing-0.3.xml"
    operating_point = "balance"
    drop = {list(PLACE)}
    [actual]
    gain = 0.9
    [design]
    R_c = 1e-7
    R_o = 1e-6
    [controller]
    q_t = 1e-3
    """
    case = prepare(parse_run(text, tmp_path / "heading.toml"))
    assert case.actual.linearisation.plant.states == case.assumed.linearisation.plant.states
    assert case.prediction is not None
    assert case.prediction.delta_crit is not None
