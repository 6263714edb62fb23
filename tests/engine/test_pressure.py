"""The person on a free foot: as on a fixed one while it stands, the centre of pressure, and where the foot lifts."""

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from icmj import Case, Person, Simulation, load_plant, parse_run, prepare, simulate
from icmj.engine.reaction import Pressure, centre_of_pressure, ground_force
from icmj.errors import ModelError
from icmj.plant.body import OperatingRule
from icmj.simulation.simulation import list_remarks

ROOT = Path(__file__).parents[2]
FLOOR = 'model = "models/three_link_floor.xml"\ndrop = ["foot_x"]'
FIXED = 'model = "models/three_link.xml"'
RUN = """
case = {{ name = "floor", title = "On a floor" }}
[assumed]
{model}
keyframe = "upright"
[actual]
gain = {gain}
[design]
R_c = 5e-7
R_o = 2e-7
[controller]
q_t = 1e-4
delta_min = 0.01
[simulation]
record_interval = 0.001
[analysis]
delta_max = 1.0
"""


@cache
def standing(gain: float, model: str = FLOOR) -> Case:
    return prepare(parse_run(RUN.format(model=model, gain=gain), ROOT / "run.toml"))


def swaying(case: Case, q_t: float, plant: str = "mujoco", duration: float = 1.6) -> tuple[Simulation, Pressure]:
    """From the predicted orbit, at the threshold q_t."""
    orbit, n, n_hat = case.prediction.orbit, case.system.n, case.system.n_hat
    assert orbit is not None
    X = case.system.to_original(case.system.T_bar @ orbit.x_bar) * (q_t / case.rule.size)
    trigger, start = case.rule.resized(q_t), (X[:n], X[n : n + n_hat])
    run = simulate(case, plant, trigger=trigger, start=start, duration=duration)
    assert run.pressure is not None
    return run, run.pressure


def test_the_upright_body_has_the_poles_of_the_fixed_foot():
    mine, fixed = (np.linalg.eigvals(standing(0.9, m).actual.linearisation.plant.A) for m in (FLOOR, FIXED))
    for pole in fixed:
        assert np.abs(mine - pole).min() < 1e-3 * abs(pole)
    others = sorted(mine.real)[:5]  # of the contacts
    assert max(others) < -150


@pytest.mark.parametrize(("gain", "sign"), [(0.9, 1), (1.1, -1)])
def test_the_cycle_is_that_of_the_fixed_foot_to_a_tenth_of_a_per_cent(gain, sign):
    free, fixed = standing(gain).prediction, standing(gain, FIXED).prediction
    assert free.verdict == "attracting"
    assert free.eigenvalue.real == pytest.approx(sign)
    assert free.delta_crit == pytest.approx(fixed.delta_crit, rel=1e-3)
    run, _ = swaying(standing(gain), 1e-4, duration=8.0)
    pairs = run.events.interval[2:10].reshape(-1, 2).mean(axis=1)
    np.testing.assert_allclose(pairs, free.delta_crit, rtol=3e-5)


def test_at_rest_pressure_is_below_the_centre_of_mass():
    case = standing(0.9)
    _, found = swaying(case, 1e-4, duration=0.05)
    model, point = case.actual.spec.compile(), case.actual.linearisation.point
    data = mujoco.MjData(model)
    data.qpos[:] = point.qpos
    mujoco.mj_forward(model, data)
    assert found.geoms == ("heel", "toe")
    assert found.at_rest[0] == pytest.approx(data.subtree_com[0, 0], abs=1e-8)
    assert found.load_at_rest.sum() == pytest.approx(80 * 9.81, rel=1e-6)


def test_pressure_in_sway_is_what_newton_and_euler_ask_for():
    """Force and moment that move the whole, by inverse dynamics without contacts, act at the centre of pressure.

    At rows, where what acts is recorded, and right after events, where it is the reset controller's torque.
    """
    case = standing(0.9)
    run, found = swaying(case, 0.01)
    plant, k = case.actual, case.controller.design.k
    model, free, ports = plant.spec.compile(), plant.spec.compile(), plant.linearisation.ports
    free.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data, bare = mujoco.MjData(model), mujoco.MjData(free)
    model.opt.tolerance, model.opt.iterations = 0.0, 200
    at = np.searchsorted(run.t, run.events.t)
    places = [(i, run.applied[i], found.centre[i], found.load[i]) for i in range(50, len(run.t), 97)]
    after = zip(at, -run.events.x_o @ k.T, found.centre_after, found.load_after, strict=True)
    for i, acts, there, load in (*places, *after):
        data.qpos[:], data.qvel[:] = run.qpos[i], ports.whole(run.x[i])[model.nv : 2 * model.nv]
        data.ctrl[:] = plant.linearisation.point.ctrl + ports.b * acts
        mujoco.mj_forward(model, data)
        bare.qpos[:], bare.qvel[:], bare.qacc[:] = data.qpos, data.qvel, data.qacc
        mujoco.mj_inverse(free, bare)
        along, up, moment = bare.qfrc_inverse[:3]  # M = z F_x − x F_z about the ankle
        ankle, floor = data.body("foot").xpos, data.contact[0].pos[2]
        centre = ankle[0] + ((floor - ankle[2]) * along - moment) / up
        assert there[0] == pytest.approx(centre, abs=1e-5)
        assert load.sum() == pytest.approx(up, rel=1e-9)
    assert len(found.t_after) == len(run.events) > 1


def test_contacts_and_the_motion_of_the_mass_tell_one_centre_of_pressure():
    case = standing(0.9)
    for plant in ("mujoco", "linear"):
        run, found = swaying(case, 0.01, plant, duration=0.4)
        force = ground_force(case.actual, run)
        np.testing.assert_allclose(force["force.z"], found.load.sum(axis=1), rtol=1e-9)
        # the contacts give way, so that they lie a little below the level that the moment is taken about
        np.testing.assert_allclose(force["cop.x"], found.centre[:, 0], rtol=0, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "threshold"), [(0.9, 0.0250), (1.1, 0.0173)])
def test_the_foot_lifts_at_the_threshold_that_small_sway_tells(gain, threshold):
    case = standing(gain)
    _, small = swaying(case, 1e-4)
    _, linear = swaying(case, 1e-4, "linear")
    lifts = 1e-4 / small.unloading
    assert lifts == pytest.approx(threshold, abs=5e-5)
    assert 1e-4 / linear.unloading == pytest.approx(lifts, rel=1e-3)
    below, still = swaying(case, 0.97 * lifts)
    run, above = swaying(case, 1.05 * lifts)
    assert above.lifted
    assert not still.lifted
    told = [[one.kind for one in list_remarks(of)] for of in (below, run)]
    assert ["lift-off" in kinds for kinds in told] == [False, True]
    # the toe, for the heel bears more; pressure has come to the heel by then
    assert above.load.min(axis=0)[0] > 0
    assert above.centre[:, 0].min() == pytest.approx(-0.07, abs=1e-3)
    assert run.outcome.kind == "completed"


def test_a_run_has_its_pressure_and_says_what_of_it_matters():
    run, found = swaying(standing(0.9), 1e-3, "linear")
    alone = centre_of_pressure(standing(0.9).actual, run)
    np.testing.assert_array_equal(alone.centre, found.centre)
    assert not len(alone.t_after)
    assert found.axes == ("x",)
    facts = found.facts
    assert set(facts) == {"x_at_rest", "x_least", "x_most", "unloading"}
    # torque jumps at an event: that the body is unloaded most right after one, no row shows but the first, for the run
    # starts on the cycle right after an event
    assert facts["unloading"] > alone.since(0.0015).unloading
    assert facts["unloading"] == pytest.approx(alone.unloading, rel=1e-9)
    assert facts["x_least"] == min(found.centre[:, 0].min(), found.centre_after[:, 0].min())
    later = found.since(1.0)
    assert later.t[0] >= 1.0
    assert (later.t_after >= 1.0).all()
    assert len(later.centre_after) == len(later.load_after) == len(later.t_after)
    assert simulate(standing(0.9, FIXED), "linear", duration=0.1).pressure is None


def test_far_above_it_he_falls():
    run, _ = swaying(standing(1.1), 0.05, duration=8.0)
    assert run.outcome.kind == "fell"


def test_another_person_stands_on_the_floor_too():
    person = Person(1.65, 60)
    rule = OperatingRule("balance", ("foot_z", "foot_pitch", "ankle"))
    plant = load_plant(ROOT / "models" / "three_link_floor.xml", keyframe="upright", operating=rule, person=person)
    assert plant.quality.at_rest
    model = plant.spec.compile()
    assert model.body_mass.sum() == pytest.approx(60, rel=1e-6)
    np.testing.assert_allclose(model.geom("toe").pos[0], 0.18 * 1.65 / 1.8, rtol=1e-6)


def test_who_stands_on_nothing_has_no_pressure():
    case = standing(0.9, FIXED)
    with pytest.raises(ModelError, match="nothing stands on the ground"):
        centre_of_pressure(case.actual, simulate(case, "linear", duration=0.1))
    with pytest.raises(ModelError, match="has 6 states, not 11"):
        centre_of_pressure(standing(0.9).actual, simulate(case, "linear", duration=0.1))
