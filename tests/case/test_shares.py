"""Noise whose size is a share of the command, from a run file to both plants and the log; what does not fit."""

import numpy as np
import pytest

import icmj
from icmj import IcmjError, load_run, prepare, simulate
from icmj.simulation.grid import interpolate_at
from icmj.simulation.sources import Gaussian

MOTOR = {"kind": "gaussian", "input": "ankle_torque", "share": 0.3, "corner": 2.0, "seed": 3}
SHORT = {"simulation.duration": 2.0, "study.growth_points": 0, "study.law_q_t": [], "study.attractor_starts": 0}


def _run(root, *sources, **more):
    run = load_run(root / "runs" / "three-link-0.9.toml")
    return run.with_(**SHORT, **{"simulation.disturbance": list(sources)}, **more)


def test_both_plants_feel_the_same_and_a_log_keeps_it(root, tmp_path):
    run = _run(root, MOTOR, **{"controller.q_t": 1e-3, "simulation.initial": {"ankle": 1e-3}})
    case = prepare(run)
    assert case.settings.disturbance == (Gaussian(input="ankle_torque", share=0.3, corner=2.0, seed=3),)
    linear, engine = (simulate(case, plant) for plant in ("linear", "mujoco"))
    assert linear.noisy
    assert len(linear.events) == len(engine.events) > 1
    np.testing.assert_allclose(engine.events.t, linear.events.t, atol=2e-4)
    np.testing.assert_array_equal(linear.applied[:, 1:], linear.u[:, 1:])
    assert np.abs(linear.applied - linear.u).max() > 0.05 * np.abs(linear.u).max()
    result = icmj.run_case(run, "linear")
    icmj.write_log(result, tmp_path / "motor.rrd")
    back = icmj.read_log(tmp_path / "motor.rrd")
    assert back.run.simulation.settings().disturbance == case.settings.disturbance
    np.testing.assert_array_equal(back.simulation.applied, linear.applied)


def test_the_command_is_what_a_set_point_adds_to_too(root):
    """A lean asks for a torque, and the noise is in proportion to the whole."""
    lean = {"kind": "step", "output": "shank", "size": 0.001, "start": 0.1}
    case = prepare(_run(root, MOTOR, setpoint=[lean], **{"controller.q_t": 1e-3}))
    runs = [simulate(case, plant) for plant in ("linear", "mujoco")]
    for run in runs:
        assert np.abs(run.u[:, 0]).max() > 0.1
        xi = interpolate_at(case.settings.disturbance[0], run.t)
        np.testing.assert_allclose((run.applied - run.u)[:, 0], xi * run.u[:, 0], atol=1e-12)
    assert len(runs[0].events) == len(runs[1].events) > 1
    np.testing.assert_allclose(runs[1].events.t, runs[0].events.t, atol=1e-3)


@pytest.mark.parametrize(("wrong", "words"), [
    ({"size": 1.0}, "give size or share, not both"),
    ({"share": -0.1}, "share"),
    ({"share": 0.0}, "share"),
    ({"input": None, "output": "shank"}, "a share is of a command"),
    ({"on": "body"}, "a share is of a command"),
    ({"input": None, "body": "trunk", "force": [1.0, 0.0, 0.0]}, "a share is of a command"),
])  # fmt: skip
def test_what_does_not_fit_is_one_line(root, wrong, words):
    table = {key: value for key, value in {**MOTOR, **wrong}.items() if value is not None}
    with pytest.raises(IcmjError, match=words):
        _run(root, table).simulation.settings()


def test_a_controller_of_delayed_readings_is_refused_before_anything_runs(root):
    run = load_run(root / "runs" / "rivals" / "one-link-delayed-pd.toml").with_(**{"simulation.disturbance": [MOTOR]})
    with pytest.raises(IcmjError, match=r"share = 0\.3 needs commands that follow from a hold"):
        prepare(run)
