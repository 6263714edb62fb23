"""The figure of the amplitude law."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import result

from icmj.case.quantity import threshold_unit
from icmj.case.result import AmplitudeLaw
from icmj.controller.rules.box import BoxTrigger
from icmj.controller.rules.quadratic import EventTrigger
from icmj.report import style
from icmj.report.case_runs import pair
from icmj.report.sections.amplitude_law import list_drawings

Q_T = np.array([1e-2, 1e-3, 1e-4])


def draw(law):
    (drawing,) = list_drawings(*pair([replace(result("three-link", "mujoco"), law=law)]))
    return drawing.draw()


def test_points_lie_on_a_line_of_the_fitted_slope():
    law = AmplitudeLaw(Q_T, 2.3 * Q_T**2, -1.4 * Q_T**2, 2.0, 2.0)
    with style.apply():
        axes = draw(law).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert axes.get_xlabel() == "threshold (rad)"
    for factor, label in ((2.3, "interval, slope 2.000"), (1.4, "amplitude, slope 2.000")):
        points = next(item for item in axes.get_lines() if item.get_label() == label)
        assert points.get_ydata() == pytest.approx(factor * Q_T**2)
        fitted = axes.get_lines()[axes.get_lines().index(points) - 1]
        assert fitted.get_ydata() == pytest.approx(factor * np.asarray(fitted.get_xdata()) ** 2)


def test_zero_and_missing_errors_are_left_out():
    law = AmplitudeLaw(Q_T, np.array([1e-4, 0.0, np.nan]), np.full(3, np.nan), 2.0, np.nan)
    with style.apply():
        lines = draw(law).axes[0].get_lines()
    assert [len(item.get_xdata()) for item in lines] == [2, 1]


@pytest.mark.parametrize(("rule", "units", "unit"), [
    (None, ("m",) * 3, "m"),
    (None, ("rad", "m", "rad"), "each in its own unit"),
    (None, (), ""),
    (BoxTrigger(np.full(3, 0.1)), ("m",) * 3, "m"),
    (BoxTrigger(np.full(6, 0.1), "state"), ("m",) * 3, ""),
    (EventTrigger(np.eye(6), 0.1), ("m",) * 3, ""),
])  # fmt: skip
def test_the_threshold_has_the_unit_of_what_the_rule_weighs(rule, units, unit):
    found = result("three-link")
    if rule is not None:
        found = replace(found, controller=found.controller.triggered_by(rule))
    assert threshold_unit(replace(found, assumed=replace(found.assumed, output_units=units))) == unit
