"""Segments of a vector, and the controller as one linear system in them."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import event_controller, pendulum_design

from icmj.controller.controller import make_layout
from icmj.controller.layout import Layout
from icmj.controller.trigger import Continuous


def test_split_and_join_are_inverse() -> None:
    layout = Layout.of(first=2, second=1, third=3)
    assert layout.size == 6
    assert layout["third"] == slice(3, 6)
    vectors = np.arange(12.0).reshape(2, 6)
    parts = layout.split(vectors)
    np.testing.assert_array_equal(parts["second"], [[2.0], [8.0]])
    np.testing.assert_array_equal(layout.join(**parts), vectors)


def test_what_is_not_given_is_zero_and_unknown_segments_are_errors() -> None:
    layout = Layout.of(first=2, second=1)
    np.testing.assert_array_equal(layout.join(second=np.array([4.0])), [0.0, 0.0, 4.0])
    with pytest.raises(ValueError, match="not in tuple"):
        _ = Layout.of(first=2)["third"]


@pytest.mark.parametrize("hold", ["system-matched", "zero-order"])
def test_the_realisation_is_the_paper_s_controller(hold: str) -> None:
    controller = event_controller(pendulum_design(), hold=hold)
    design, found, random = controller.design, controller.realisation, np.random.default_rng(0)
    layout = make_layout(controller)
    a, y = random.standard_normal(4), random.standard_normal(1)
    x_o, x_h = a[layout["x_o"]], a[layout["x_h"]]
    u = -design.k @ x_h
    np.testing.assert_allclose(-found.K @ a, u)
    observer = design.plant.A @ x_o + design.plant.B @ u + design.L @ (y - design.plant.C @ x_o)
    rate = found.M @ a + found.N @ y
    np.testing.assert_allclose(rate[layout["x_o"]], observer, rtol=1e-12)
    np.testing.assert_allclose(rate[layout["x_h"]], controller.hold.A_h @ x_h, rtol=1e-12)
    np.testing.assert_array_equal(found.J @ a, np.concatenate([x_o, x_o]))
    E = controller.trigger.faces(design).E(x_h - x_o)
    assert controller.trigger.q_t**2 * (np.sum((found.R @ a) ** 2) - 1) == pytest.approx(E, rel=1e-12)


def test_continuous_control_takes_the_hold_along() -> None:
    controller = replace(event_controller(pendulum_design()), trigger=Continuous())
    found, random = controller.realisation, np.random.default_rng(1)
    x_o, y = random.standard_normal(2), random.standard_normal(1)
    rate = found.M @ np.tile(x_o, 2) + found.N @ y
    np.testing.assert_array_equal(rate[:2], rate[2:])
    np.testing.assert_allclose(found.K @ np.tile(x_o, 2), controller.design.k @ x_o)
    assert len(found.R) == 0
