"""Whatever limits a plant on a motion is told, whichever way the model says it; what is smooth is not."""

from pathlib import Path

import numpy as np
import pytest
from model_cases import written

from icmj import MujocoPlant, load_plant, parse_run, prepare
from icmj.engine.corners import find_corners

MODEL = """
<mujoco model="limited">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="RK4"/>
  <worldbody>
    {world}
    <body name="rod"><joint name="lean" axis="0 1 0" {joint}/>
      <inertial pos="0 0 0.9" mass="70" diaginertia="6 6 1"/>
      <geom name="head" type="sphere" size="0.1" pos="0 0 1.8" mass="0"/><site name="top" pos="0 0 1.8"/></body>
  </worldbody>
  <tendon>{tendon}</tendon>
  <actuator>{actuator}</actuator>
  <sensor><jointpos name="angle" joint="lean" {sensor}/></sensor>
  <keyframe><key name="at" {key}/></keyframe>
</mujoco>"""
MOTOR, PULLED = '<motor name="ankle" joint="lean"/>', '<motor name="ankle" tendon="rope"/>'
ROPE = '<fixed name="rope" {}><joint joint="lean" coef="2"/></fixed>'
TONIC = (
    '<muscle name="ankle" joint="lean" force="600" range="0.75 1.05" lengthrange="-1 1" gear="-1" tausmooth="0.2"/>'
    '<muscle name="back" joint="lean" force="600" range="0.75 1.05" lengthrange="-1 1" tausmooth="0.2"/>'
)


def model(
    actuator: str = MOTOR, joint: str = "", tendon: str = "", sensor: str = "", world: str = "", key: str = 'qpos="0"'
) -> str:
    return MODEL.format(actuator=actuator, joint=joint, tendon=tendon, sensor=sensor, world=world, key=key)


# the model; how far θ and u may go; the notice: kind, words
LIMITS = {
    "ctrlrange": (
        model('<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-20 30"/>'), "u", 20,
        "saturation", "moves ankle by {peak}, and its ctrlrange leaves 20",
    ),
    "forcerange": (
        model('<motor name="ankle" joint="lean" gear="5" forcelimited="true" forcerange="-20 20"/>'), "u", 20,
        "saturation", "passes the forcerange of ankle",
    ),
    "actrange": (
        model('<general name="ankle" joint="lean" dyntype="filter" dynprm="0.1" actlimited="true" actrange="-9 9"/>'),
        "act", 9, "saturation", "passes the actrange of ankle",
    ),
    "joint force": (
        model(joint='actuatorfrclimited="true" actuatorfrcrange="-20 20"'), "u", 20,
        "saturation", "passes the actuatorfrcrange of joint lean",
    ),
    "joint force through a tendon": (
        model(PULLED, 'actuatorfrclimited="true" actuatorfrcrange="-20 20"', ROPE.format("")), "u", 10,
        "saturation", "passes the actuatorfrcrange of joint lean",
    ),
    "tendon force": (
        model(PULLED, "", ROPE.format('actuatorfrclimited="true" actuatorfrcrange="-20 20"')), "u", 20,
        "saturation", "passes the actuatorfrcrange of tendon rope",
    ),
    "cutoff": (model(sensor='cutoff="0.02"'), "θ", 0.02, "saturation", "passes the cutoff of sensor angle"),
    "joint range": (
        model(joint='limited="true" range="-0.02 0.05"'), "θ", 0.02,
        "joint limit", "moves lean by {peak}, and 0.02 are left to an end of its range",
    ),
    "tendon range": (
        model(tendon=ROPE.format('limited="true" range="-0.04 1"')), "θ", 0.02,
        "joint limit", "passes an end of the range of tendon rope",
    ),
    "dead band": (
        model(tendon=ROPE.format('stiffness="100" springlength="-0.04 0.06"')), "θ", 0.02,
        "not linear", "passes an end of the springlength of tendon rope",
    ),
    "yielding joint": (
        model(joint='stiffness="100" springyield="0.02"'), "θ", 0.02,
        "not linear", "strains the spring of joint lean by {peak}, and it yields at 0.02",
    ),
    "yielding tendon": (
        model(tendon=ROPE.format('stiffness="100" springlength="0" springyield="0.04"')), "θ", 0.02,
        "not linear", "strains the spring of tendon rope",
    ),
    "engaged spring": (
        model(tendon=ROPE.format('stiffness="100" springlength="-0.2 -0.04"'), key='qpos="0" ctrl="8"'), "θ", 0.02,
        "not linear", "passes an end of the springlength of tendon rope",
    ),
    "contact": (
        model(world='<geom name="wall" type="box" size="0.5 1 2" pos="0.636 0 2" solref="0.02 1"/>'), "θ", 0.02,
        "not linear", "passes a corner of the plant, at {share} of its size: head and wall touch, or let go",
    ),
    "muscle": (
        model(TONIC, key='qpos="0" act="0.1 0.1" ctrl="0.1 0.1"'), "u", 0.1,
        "saturation", "the excitation of ankle is beyond 0 to 1",
    ),
}  # fmt: skip


def motion(plant: MujocoPlant, which: str, size: float, phase: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A motion of which one signal reaches ``size``, and others stay well within their limits."""
    t = np.linspace(0, 2 * np.pi, 257)
    x, u = np.zeros((257, plant.linearisation.plant.n)), np.zeros((257, plant.linearisation.plant.n_u))
    if which == "u":
        u[:, 0] = size * np.sin(t + phase)
    else:
        column = {"θ": 0, "act": 2}[which]
        x[:, column] = size * np.sin(t + phase)
        x[:, 1] = 0.01 * np.cos(t)
    return x, u


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_told_where_the_motion_passes_it_and_only_there(tmp_path: Path, name: str) -> None:
    text, which, room, kind, words = LIMITS[name]
    plant = load_plant(written(tmp_path, text), keyframe="at")
    assert find_corners(plant, *motion(plant, which, 0.98 * room)) == ()
    for factor, phase in ((1.02, 0.0), (1.02, 0.4), (1.5, 1.0), (4.0, 2.0)):
        (notice,) = find_corners(plant, *motion(plant, which, factor * room, phase))
        assert notice.kind == kind
        wanted = words.replace("{peak}", f"{factor * room:.3g}")
        assert all(part in notice.words for part in wanted.split("{share}"))
        assert notice.severity == "warning"


def test_limits_that_hide_each_other_are_all_told(tmp_path: Path) -> None:
    both = (
        '<motor name="ankle" tendon="rope" ctrllimited="true" ctrlrange="-9 9" forcelimited="true" forcerange="-9 9"/>'
    )
    rope = ROPE.format('actuatorfrclimited="true" actuatorfrcrange="-9 9" limited="true" range="-0.01 0.01"')
    joint = 'actuatorfrclimited="true" actuatorfrcrange="-18 18" limited="true" range="-0.005 0.005"'
    plant = load_plant(written(tmp_path, model(both, joint, rope)), keyframe="at")
    x, u = motion(plant, "θ", 0.01)[0], motion(plant, "u", 12)[1]
    told = " ".join(notice.words for notice in find_corners(plant, x, u))
    for what in (
        "its ctrlrange",
        "forcerange of ankle",
        "of joint lean",
        "of tendon rope",
        "end of the range of tendon",
    ):
        assert what in told
    assert "to an end of its range" in told


@pytest.mark.parametrize("actuator", [MOTOR, '<position name="ankle" joint="lean" kp="400" kv="30"/>', TONIC])
@pytest.mark.parametrize("size", [1e-6, 1e-3, 0.1, 1.0])
def test_a_curve_is_no_corner_however_far_it_goes(tmp_path: Path, actuator: str, size: float) -> None:
    key = 'qpos="0" act="0.5 0.5" ctrl="0.5 0.5"' if actuator == TONIC else 'qpos="0"'
    text = model(actuator, 'stiffness="40" damping="3"', ROPE.format('stiffness="30" springlength="0"'), key=key)
    plant = load_plant(written(tmp_path, text), keyframe="at")
    x, u = motion(plant, "θ", size)
    u[:, 0] = 0.4 * size * np.cos(3 * np.linspace(0, 6, len(u)))
    assert find_corners(plant, x, u) == ()


def test_a_limit_that_nothing_uses_is_not_told(tmp_path: Path) -> None:
    text = model(MOTOR, 'limited="true" range="-1 1"', ROPE.format('limited="true" range="-3 3"'), 'cutoff="5"')
    plant = load_plant(written(tmp_path, text), keyframe="at")
    assert find_corners(plant, *motion(plant, "θ", 0.5)) == ()


@pytest.mark.parametrize("of", ["tendon", "joint"])
def test_dry_friction_is_an_error_of_whatever_it_is(tmp_path: Path, of: str) -> None:
    text = model(joint='frictionloss="1"') if of == "joint" else model(tendon=ROPE.format('frictionloss="1"'))
    plant = load_plant(written(tmp_path, text), keyframe="at")
    (notice,) = plant.quality.notices
    assert (notice.kind, notice.severity) == ("dry friction", "error")
    assert ("lean has" if of == "joint" else "tendon rope has dry friction") in notice.words
    without = text.replace('integrator="RK4"/>', 'integrator="RK4"><flag frictionloss="disable"/></option>')
    assert load_plant(written(tmp_path, without), keyframe="at").quality.notices == ()


RUN = """
case = { name = "limited", title = "Limited" }
assumed = { model = "plain.xml", keyframe = "at" }
actual = { gain = 0.9, model = "model.xml", keyframe = "at" }
design = { R_c = 1e-7, R_o = 1e-6 }
controller = { q_t = 0.01 }
"""
# the model, with room for a limit; whether that is of b u, or of θ; the notice
FORMS = {
    "ctrlrange": ('<motor name="ankle" joint="lean" ctrlrange="-{0} {0}"/>', "", "", "", True, "saturation"),
    "forcerange": ('<motor name="ankle" joint="lean" forcerange="-{0} {0}"/>', "", "", "", True, "saturation"),
    "joint force": (MOTOR, 'actuatorfrcrange="-{0} {0}"', "", "", True, "saturation"),
    "joint force through a tendon": (
        PULLED, 'actuatorfrcrange="-{0} {0}"', ROPE.replace("2", "1"), "", True, "saturation"
    ),
    "tendon force": (
        PULLED, "", ROPE.replace("2", "1").format('actuatorfrcrange="-{0} {0}"'), "", True, "saturation"
    ),
    "cutoff": (MOTOR, "", "", 'cutoff="{0}"', False, "saturation"),
    "joint range": (MOTOR, 'range="-{0} {0}"', "", "", False, "joint limit"),
    "tendon range": (MOTOR, "", ROPE.replace("2", "1").format('range="-{0} {0}"'), "", False, "joint limit"),
    "dead band": (
        MOTOR, "", ROPE.replace("2", "1").format('stiffness="20" springlength="-{0} {0}"'), "", False, "not linear"
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("name", FORMS)
def test_the_predicted_orbit_is_held_against_every_limit(tmp_path: Path, name: str) -> None:
    *parts, of_u, kind = FORMS[name]
    written(tmp_path, model(), "plain.xml")
    written(tmp_path, model())
    orbit = prepare(parse_run(RUN, tmp_path / "run.toml")).prediction.orbit
    assert orbit is not None
    peak = float(0.9 * orbit.u_peak[0] if of_u else orbit.x_peak[0])
    for factor, kinds in ((1.01, []), (0.99, [kind]), (0.5, [kind])):
        limit = f"{factor * peak:.9g}"
        written(tmp_path, model(*(part.replace("{0}", limit).replace("{}", "") for part in parts)))
        notices = prepare(parse_run(RUN, tmp_path / "run.toml")).notices
        assert [notice.kind for notice in notices] == kinds
