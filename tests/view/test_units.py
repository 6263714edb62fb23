"""A unit on an axis only where everything on it has that unit."""

from icmj.view.units import shared_unit


def test_a_unit_is_told_where_it_is_shared():
    assert shared_unit(("rad", "rad")) == " [rad]"
    assert shared_unit(("rad",), "/s") == " [rad/s]"
    assert shared_unit(("rad", "m")) == ""
    assert shared_unit(("", "")) == ""
    assert shared_unit(()) == ""
