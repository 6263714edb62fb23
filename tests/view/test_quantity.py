"""Angles are shown in degrees, everything else in its own unit."""

import numpy as np
import pytest

from icmj.case.quantity import in_brackets, in_unit, quantities, shared_unit
from icmj.plant.linear_plant import LinearPlant


def plant(*units: str) -> LinearPlant:
    C = np.eye(2)[: len(units)] if units else np.eye(2)
    return LinearPlant([[0, 1], [1, 0]], [[0], [1]], C, output_units=units)


@pytest.mark.parametrize(
    ("unit", "shown", "value"),
    [("rad", "y (deg)", 180.0), ("rad/s", "y (deg/s)", 180.0), ("m", "y (m)", np.pi), ("N m", "y (N m)", np.pi)],
)
def test_only_angles_are_turned_into_degrees(unit: str, shown: str, value: float) -> None:
    (quantity,) = quantities(plant(unit))
    assert quantity.label("y") == shown
    assert np.pi * quantity.factor == pytest.approx(value, rel=1e-15)


def test_a_rate_is_per_second_what_is_not_known_has_no_unit_and_several_share_one_or_say_so() -> None:
    angle, way = quantities(plant("rad", "m"))
    assert (angle.label("v", "/s"), way.label("v", "/s")) == ("v (deg/s)", "v (m/s)")
    assert [(q.factor, q.label("v", "/s")) for q in quantities(plant())] == [(1.0, "v")] * 2
    for units, words in ((("m", "m"), "y (m)"), (("m", "rad"), "y (each in its own unit)"), ((), "y"), (("", ""), "y")):
        assert in_unit("y", shared_unit(units)) == words


def test_a_unit_in_brackets_says_per_second_only_of_itself() -> None:
    assert in_brackets("rad") == " [rad]"
    assert in_brackets("rad", "/s") == " [rad/s]"
    assert in_brackets("each in its own unit", "/s") == " [each in its own unit]"
    assert in_brackets("", "/s") == ""
