"""Charts: points where the values are, a line of slope 2 that is one, and nothing where there is nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from log_cases import made_up

from icmj.log.chart import GROWTH, LAW, Axis, charts
from icmj.result.result import AmplitudeLaw, Growth, Result

Q_T = np.array([1e-2, 1e-3, 1e-4])


def with_both() -> Result:
    result, _ = made_up(duration=6.0)
    delta = np.linspace(0.2, 2.2, 6)
    law = AmplitudeLaw(Q_T, 2.3 * Q_T**2, -1.4 * Q_T**2, 2.0, 2.0)
    return replace(result, growth=Growth(delta, np.full(6, 0.7), np.full(6, 0.7)), law=law)


def test_an_axis_places_values_between_its_ends() -> None:
    assert Axis("x", -1.0, 3.0, ()).place([-1.0, 0.0, 3.0]) == pytest.approx([0.0, 0.25, 1.0])
    assert Axis("x", 1e-4, 1.0, (), logarithmic=True).place([1e-4, 1e-3, 1.0]) == pytest.approx([0.0, 0.25, 1.0])


def test_growth_crosses_the_circle_at_delta_crit() -> None:
    """The pendulum with b = 0.8: published 1.8 s."""
    chart = charts(with_both())[GROWTH]
    lines = {name: (x, y) for name, x, y, _ in chart.lines}
    delta, largest = lines["predicted"]
    late = delta > 1.0
    assert np.interp(1.0, largest[late], delta[late]) == pytest.approx(1.8065, abs=1e-3)
    assert lines["Δ_crit"][0] == pytest.approx([1.8065, 1.8065], abs=5e-5)
    assert (lines["unit circle"][1] == 1).all()


def test_the_law_has_a_line_of_slope_two_through_its_largest_error() -> None:
    chart = charts(with_both())[LAW]
    ((name, q, error, _),) = chart.lines
    assert name == "slope 2"
    assert np.diff(np.log(error)) / np.diff(np.log(q)) == pytest.approx([2.0])
    assert (q[0], error[0]) == pytest.approx((1e-2, 2.3e-4))
    for axis, values in ((chart.x, Q_T), (chart.y, np.concatenate([p[2] for p in chart.points]))):
        assert axis.low <= values.min()
        assert values.max() <= axis.high
    assert chart.x.label == "threshold [rad]"
    assert (chart.x.low, chart.x.high) == pytest.approx((1e-4, 1e-2))


def test_what_was_not_measured_has_no_chart() -> None:
    both = with_both()
    assert charts(replace(both, growth=None, law=None)) == {}
    nothing = AmplitudeLaw(Q_T, np.zeros(3), np.full(3, np.nan), np.nan, np.nan)
    assert set(charts(replace(both, law=nothing))) == {GROWTH}
