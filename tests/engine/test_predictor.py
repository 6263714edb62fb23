"""The continuous predictor controller on the engine, against the linear plant, DOP853's order, and a retimed step."""

import numpy as np
import pytest
from tapped_cases import person

import icmj
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.predictor import PredictorController
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import Target, setpoint, step
from icmj.engine.run import simulate
from icmj.simulation.settings import Settings

START = np.array([0.1, 0.03])
LINEAR = person().linearisation.plant
DESIGN = design_lq(LINEAR, R_c=1e-5, R_o=1e-5)


@pytest.mark.parametrize("delay", [Delay(0.1), Delay(0.1, 0.08)])
def test_it_is_the_linear_plant_to_third_order_in_the_sway(delay: Delay) -> None:
    """The body is odd in its angle: relative to the sway the difference falls with its square."""
    law, errors = PredictorController(DESIGN, delay), []
    for size in (1.0, 0.5, 0.25):
        settings = Settings(duration=1.5, record_interval=1.5, tolerance=1e-12)
        run = simulate(person(), law, settings, x0=START * size, error_estimate=False)
        linear = icmj.simulate_plant(LINEAR, law, settings, x0=START * size)
        errors.append(np.abs(run.x[-1] - linear.x[-1]).max() / size)
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes == pytest.approx([2.0, 2.0], abs=0.05)
    assert run.control == "predictor"


def test_fixed_steps_converge_with_their_order() -> None:
    law, errors = PredictorController(DESIGN, Delay(0.1)), []
    fine = simulate(person(), law, Settings(duration=1.2, tolerance=1e-13), x0=START, error_estimate=False)
    for h in (0.005, 0.0025):
        settings = Settings(duration=1.2, timestep=h, integrator="RK4")
        run = simulate(person(), law, settings, x0=START, error_estimate=False)
        errors.append(np.abs(run.x[-1] - fine.x[-1]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)
    assert errors[-1] < 1e-8


def test_a_step_under_an_event_rule_is_the_retimed_one_of_it_to_second_order_in_the_step() -> None:
    """Relative to the step; until the body's curvature shows, which no model has, the rule has nothing to correct."""
    errors, at = [], np.linspace(0.1, 1.8, 18)
    for size in (0.08, 0.04, 0.02):
        followed = setpoint(LINEAR, [Target({"theta": 1.0}, step(size, 0.4))])
        settings = Settings(duration=1.8, record_interval=0.1, tolerance=1e-11)
        rule = EventTrigger(output_weight(DESIGN), 0.3 * size, delta_min=0.35)
        events = Controller(DESIGN, system_matched(DESIGN), rule, Delay(0.1), followed)
        runs = [
            simulate(person(), law, settings, error_estimate=False)
            for law in (events, PredictorController(DESIGN, Delay(0.1), followed))
        ]
        assert runs[0].events.t == pytest.approx([0.4], abs=1e-9)
        one, other = (run.y[np.searchsorted(run.t, at - 1e-9), 0] for run in runs)
        errors.append(np.abs(one - other).max() / size)
        assert np.abs(one).max() > 0.5 * size
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes == pytest.approx([2.0, 2.0], abs=0.1)
