"""A run file of what was put together in code says all of it: the case made of it is the one that was meant."""

import numpy as np
import pytest

import icmj
from icmj.errors import RunFileError

ASSUMED = icmj.LinearPlant(
    [[0, 1, 0], [2, -0.3, 1], [0, 0, -20]], [[0], [0], [20]], [[1, 0, 0]], ("angle", "angle_rate", "act"), ("u",),
    output_units=("rad",),
)  # fmt: skip
ACTUAL = icmj.LinearPlant([[0, 1], [2, -0.3]], [[0], [1.1]], [[1, 0]], ("angle", "angle_rate"), ("u",))


def controller(rule=None, delay=None):
    design = icmj.design_lq(ASSUMED, R_c=0.1, R_o=0.01)
    hold = icmj.Hold("mine", 0.5 * icmj.system_matched(design).A_h)
    rule = rule or icmj.EventTrigger(icmj.output_weight(design), q_t=0.01, delta_min=0.02)
    return icmj.Controller(design, hold, rule, delay or icmj.Delay())


@pytest.mark.parametrize(
    ("rule", "delay"),
    [
        (None, None),
        (icmj.BoxTrigger(np.array([0.01, 0.02, 1.0]), "state", 0.01), icmj.Delay(0.05, 0.04)),
        (icmj.BoxTrigger(np.array(0.01)), None),
    ],
)
def test_the_case_of_it_is_what_was_meant(rule, delay):
    meant = controller(rule, delay)
    settings = icmj.Settings(
        duration=3.0,
        initial={"angle": 0.02},
        disturbance=(icmj.Step("u", 0.01, 1.0), icmj.Noise("u", 0.001, 2.0, seed=3, terms=5), icmj.Bias("y0", 0.001)),
    )
    run = icmj.compose_run(ACTUAL, meant, settings, name="mine")
    case = icmj.prepare(icmj.parse_run(run.text, run.path))
    assert case.settings == settings
    for plant, given in ((case.actual, ACTUAL), (case.assumed, ASSUMED)):
        for letter in "ABC":
            np.testing.assert_array_equal(getattr(plant.linearisation.plant, letter), getattr(given, letter))
    assert case.assumed.linearisation.plant.output_units == ("rad",)
    np.testing.assert_array_equal(case.controller.design.k, meant.design.k)
    np.testing.assert_array_equal(case.controller.hold.A_h, meant.hold.A_h)
    there = icmj.simulate_plant(ACTUAL, meant, settings)
    here = icmj.simulate(case, "linear")
    np.testing.assert_array_equal(here.x, there.x)
    np.testing.assert_array_equal(here.events.t, there.events.t)


def test_pushes_of_a_plant_of_less_gain_stay_what_they_are():
    """B_d goes with it: what a push does is not B where an input is weaker."""
    weak, meant = ACTUAL.scaled(0.8), controller()
    settings = icmj.Settings(
        duration=3.0,
        disturbance=(icmj.Step("u", 0.01), icmj.Step("u", 0.01, 1.0, on="command"), icmj.Impulse("u", 0.01)),
    )
    run = icmj.compose_run(weak, meant, settings, name="mine")
    case = icmj.prepare(icmj.parse_run(run.text, run.path))
    assert case.settings == settings
    np.testing.assert_array_equal(case.actual.linearisation.plant.B_d, ACTUAL.B)
    here, there = icmj.simulate(case, "linear"), icmj.simulate_plant(weak, meant, settings)
    np.testing.assert_array_equal(here.x, there.x)
    with pytest.raises(RunFileError, match=r"disturbance names 'trunk', which the model lacks; expected none"):
        icmj.prepare(run.with_(**{"simulation.disturbance": [{"kind": "step", "body": "trunk", "force": [1, 0, 0]}]}))


def test_it_is_logged_and_read_back(tmp_path):
    run = icmj.compose_run(ACTUAL, controller(), icmj.Settings(duration=2.0, initial={"angle": 0.02}), name="mine")
    result = icmj.run_case(run.with_(**{"study.growth_points": 0}), "linear")
    icmj.write_log(result, tmp_path / "mine.rrd")
    back = icmj.read_log(tmp_path / "mine.rrd")
    np.testing.assert_array_equal(back.simulation.x, result.simulation.x)
    np.testing.assert_array_equal(back.controller.hold.A_h, controller().hold.A_h)
    icmj.build_report([back], tmp_path / "report.html")
    assert "k given, L given" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_what_has_no_place_in_a_run_file_is_told():
    with pytest.raises(RunFileError, match=r"my case.toml: case.name: does not match"):
        icmj.compose_run(ACTUAL, controller(), name="my case")
    with pytest.raises(RunFileError, match="controller"):
        icmj.compose_run(ACTUAL, controller(icmj.ClockTrigger(0.5)), name="clock")
