"""A push from a run file to both plants, log, export and what the viewer shows."""

import numpy as np
import pytest

import icmj
from icmj import load_run, prepare, simulate
from icmj.errors import RunFileError
from icmj.log.groups import list_groups

TRUNK = {"kind": "impulse", "body": "trunk", "force": [0.02, 0.0, 0.0], "point": [0.0, 0.0, 0.3], "start": 0.4}
PUSHES = [
    TRUNK,
    {"kind": "step", "input": "hip_torque", "size": 0.003, "start": 0.7},
    {"kind": "step", "input": "hip_torque", "size": 0.002, "start": 0.9, "on": "command"},
]
SHORT = {"simulation.duration": 2.0, "study.growth_points": 0, "study.law_q_t": [], "study.attractor_starts": 0}


@pytest.fixture(scope="module")
def case(root):
    run = load_run(root / "runs" / "three-link-0.9.toml").with_(**{"controller.q_t": 1e-3, **SHORT})
    return prepare(run.with_(**{"simulation.disturbance": PUSHES, "simulation.initial": {"ankle": 1e-3}}))


def test_both_plants_feel_the_same(case):
    linear, engine = (simulate(case, plant) for plant in ("linear", "mujoco"))
    assert len(linear.events) == len(engine.events) > 1
    np.testing.assert_allclose(engine.events.t, linear.events.t, atol=2e-4)
    for run in (linear, engine):
        assert run.push_names == ("trunk", "hip_torque")
        assert run.push_units == ("N", "N m")
        late = run.t > 1.0
        np.testing.assert_allclose((run.applied - run.u)[late, 2], 0.002, atol=1e-12)
        np.testing.assert_allclose(run.push_values[late], [[0.0, 0.003]] * late.sum(), atol=1e-15)
        during = (run.t > 0.401) & (run.t < 0.449)
        np.testing.assert_allclose(run.push_values[during, 0], 0.02 / 0.05)


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_it_is_logged_exported_and_shown(case, tmp_path, plant):
    result = icmj.run_case(case.run, plant)
    path = tmp_path / "pushed.rrd"
    icmj.write_log(result, path)
    back = icmj.read_log(path)
    assert back.simulation.pushes == result.simulation.pushes
    np.testing.assert_array_equal(back.simulation.pushed, result.simulation.pushed)
    np.testing.assert_array_equal(back.actual.B_d, result.actual.B_d)
    series = back.to_series(200.0)
    columns = [series.names.index(name) for name in ("push.trunk", "push.hip_torque")]
    assert [series.units[i] for i in columns] == ["N", "N m"]
    shown = {group.path: group for group in list_groups(back)}["inputs/pushes"]
    assert shown.names == ("push on trunk [N]", "push on hip_torque [N m]")
    np.testing.assert_array_equal(shown.values, result.simulation.push_values)


def test_names_that_are_not_there_are_told_with_those_that_are_and_a_limit_has_the_names_of_states(case):
    wrong = [{**TRUNK, "body": "trnk"}]
    with pytest.raises(RunFileError, match=r"simulation.disturbance names 'trnk', which the model lacks.*trunk"):
        prepare(case.run.with_(**{"simulation.disturbance": wrong}))
    with pytest.raises(RunFileError, match=r"simulation.limit names 'anckle', which the model lacks.*ankle"):
        prepare(case.run.with_(**{"simulation.limit": {"anckle": 0.5}}))
    run = simulate(prepare(case.run.with_(**{"simulation.limit": {"hip": 1e-4}})), "linear")
    assert "hip departed further than its limit of 0.0001 rad" in run.outcome.message
