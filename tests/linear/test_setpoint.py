"""A set-point on the linear plant: closed forms of the continuous predictor controller, and DOP853 in the large."""

from dataclasses import replace

import linear_cases
import numpy as np
import pytest
from oracles.setpoint import follow
from scipy.linalg import expm

from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import Hold, system_matched, zero_order
from icmj.controller.rules.box import BoxTrigger
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import Target, pulse, ramp, setpoint, sines, step
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.linear.open_loop import open_loop
from icmj.linear.run import simulate
from icmj.plant.linear_plant import LinearPlant


def retimed(design, followed, jumps, t):
    """y of the continuous predictor controller with an exact model from rest, whose set-point jumps at these times."""
    y = np.zeros((len(t), design.plant.n_y))
    for at, channel, size in jumps:
        away = followed.x_ss[:, channel] * size
        for i in np.flatnonzero(t > at):
            y[i] += design.plant.C @ (away - expm(design.A_c * (t[i] - at)) @ away)
    return y


@pytest.mark.parametrize("t_d", [0.0, 0.2])
@pytest.mark.parametrize("n_u", [1, 2])
def test_a_step_under_an_event_rule_is_the_retimed_one_of_the_continuous_predictor_controller(n_u, t_d) -> None:
    design = linear_cases.random_loop(3, 4, 4, n_u, n_u)[1] if n_u > 1 else linear_cases.pendulum_design()
    plant = design.plant
    first, last = plant.outputs[0], plant.outputs[-1]
    # the second comes while the rule does not look yet, and is taken up when it does; the third when it comes
    steps = [(first, 0.5, 1.0), (last, -0.3, 1.2), (first, 0.4, 2.5)]
    followed = setpoint(plant, [Target({name: 1.0}, step(size, at)) for name, size, at in steps])
    trigger = EventTrigger(output_weight(design), 1e-3, delta_min=0.35)
    controller = Controller(design, system_matched(design), trigger, Delay(t_d), followed)
    run = simulate(plant, controller, linear_cases.settings(6.0))
    np.testing.assert_allclose(run.events.t, [1.0, 1.35, 2.5], rtol=0, atol=1e-12)
    channel = followed.names.index
    when = [(1.0, channel(first), 0.5), (1.35, channel(last), -0.3), (2.5, channel(first), 0.4)]
    expected = retimed(design, followed, [(at + t_d, which, size) for at, which, size in when], run.t)
    np.testing.assert_allclose(run.y, expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(run.r[run.t == 1.0], followed(1.0)[None])


@pytest.mark.parametrize("start", [1.03, 1.0])
def test_a_clock_takes_it_up_at_its_next_tick(start) -> None:
    design = linear_cases.pendulum_design()
    followed = setpoint(design.plant, [Target({"angle": 1.0}, step(0.2, start))])
    controller = Controller(design, system_matched(design), ClockTrigger(0.25), setpoint=followed)
    run = simulate(design.plant, controller, linear_cases.settings(5.0))
    expected = retimed(design, followed, [(np.ceil(start / 0.25) * 0.25, 0, 0.2)], run.t)
    np.testing.assert_allclose(run.y, expected, rtol=0, atol=1e-9)


def test_a_clock_faster_than_its_delay_runs_on_past_all_edges() -> None:
    """More events than are collected at a time, the last of them where what acts from outside is worked out anew."""
    design = design_lq(LinearPlant([[-20.0]], [20.0], [1.0], outputs=("dot",)))
    followed = setpoint(
        design.plant, [Target({"dot": 1.0}, pulse(0.2, 0.3, 0.3)), Target({"dot": 1.0}, step(0.1, 0.6))]
    )
    controller = Controller(design, system_matched(design), ClockTrigger(0.05), Delay(0.14), followed)
    run = simulate(design.plant, controller, linear_cases.settings(60.0))
    np.testing.assert_allclose(run.events.t, 0.05 * np.arange(1, len(run.events) + 1), rtol=1e-12)
    assert len(run.events) >= 1199
    assert run.outcome.kind == "completed"  # a clock has no least interval that it could collapse to
    np.testing.assert_allclose(run.y[-1], 0.1, rtol=0, atol=1e-9)


@pytest.mark.parametrize("trigger", [Continuous(), ClockTrigger(0.1), None])
def test_with_an_exact_model_the_plant_comes_to_rest_at_the_set_point(trigger) -> None:
    design = linear_cases.random_loop(5, 3, 3, 2, 2)[1]
    controller = linear_cases.event_controller(design, q_t=1e-4)
    followed = setpoint(design.plant, [Target({name: 1.0}, step(0.4)) for name in design.plant.outputs])
    controller = replace(controller, setpoint=followed, trigger=trigger or controller.trigger)
    run = simulate(design.plant, controller, linear_cases.settings(120.0))
    np.testing.assert_allclose(run.x[-1], followed.x_ss @ [0.4, 0.4], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.u[-1], followed.u_ss @ [0.4, 0.4], rtol=0, atol=1e-9)


def moving(names):
    """A set-point that does everything, and the same written down as a plain function."""
    parts = [
        Target({names[0]: 1.0}, step(0.10, 0.0)),
        Target({names[0]: 1.0}, pulse(-0.15, 0.77, 0.6)),
        Target({names[-1]: 1.0}, ramp(0.2, 0.5, 1.4)),
        Target({names[-1]: 1.0}, sines([0.03, 0.02], [0.3, 1.7], [0.4, 2.0], 0.9)),
    ]

    def r(t, side):
        def since(at):
            return t >= at - 1e-12 if side > 0 else t > at + 1e-12

        one = 0.10 - 0.15 * since(0.77) + 0.15 * since(0.77 + 0.6)
        other = np.interp(t, [0.5, 0.5 + 1.4], [0, 0.2])
        other += since(0.9) * (
            0.03 * np.sin(2 * np.pi * 0.3 * (t - 0.9) + 0.4) + 0.02 * np.sin(2 * np.pi * 1.7 * (t - 0.9) + 2.0)
        )
        return np.array([one, other]) if len(names) > 1 else np.array([one + other])

    return parts, r, (0.5, 0.77, 0.9, 0.77 + 0.6, 0.5 + 1.4)


@pytest.mark.parametrize("t_d", [0.0, 0.13])
@pytest.mark.parametrize(
    "kind", ["event", "box", "clock", "continuous", "zero-order", "own", "late", "late and seldom"]
)
@pytest.mark.parametrize("inputs", [1, 2])
def test_whatever_it_does_with_a_wrong_model_is_what_dop853_finds(inputs, kind, t_d) -> None:
    if kind == "continuous" and t_d:
        pytest.skip("control that is continuous has no delay")
    plant, design = linear_cases.random_loop(11, 4, 3, 2, 2) if inputs > 1 else (None, linear_cases.pendulum_design())
    if plant is None:
        P = design.plant
        plant = replace(P, B=0.9 * P.B, A=P.A + np.array([[0, 0], [0.1, -0.05]]))
    trigger = {
        "clock": ClockTrigger(0.19) if not t_d else ClockTrigger(0.05),  # several predictions under way
        "continuous": Continuous(),
        "box": BoxTrigger(np.full(design.plant.n_y, 0.01), delta_min=0.05),
    }.get(kind, EventTrigger(output_weight(design), 0.017, delta_min=0.05))
    hold = {
        "zero-order": zero_order(design), "own": Hold("own", design.A_c - 0.3 * np.eye(design.plant.n)),
    }.get(kind, system_matched(design))  # fmt: skip
    parts, r, edges = moving(design.plant.outputs)
    followed = setpoint(design.plant, parts)
    if kind == "late and seldom":
        trigger = replace(trigger, delta_min=0.3)
    controller = Controller(design, hold, trigger, Delay(t_d), followed, 0.09 * kind.startswith("late"))
    x, x_o = 0.02 * np.arange(1, plant.n + 1), 0.01 * np.ones(design.plant.n)
    run = simulate(plant, controller, linear_cases.settings(2.5), x0=x, x_o0=x_o)
    times, states, end = follow(plant, controller, (followed.x_ss, followed.u_ss), r, edges, 2.5, x, x_o)
    assert kind == "continuous" or len(times) >= 4
    assert not kind.startswith("late") or np.diff(times).min() >= controller.least - 1e-9
    ticks = run.events.t if kind != "clock" else run.events.t[: len(times)]
    np.testing.assert_allclose(ticks, times, rtol=0, atol=1e-9)
    scale = max(1.0, np.abs(states).max(initial=0.0))
    n, m = plant.n, design.plant.n
    found = np.hstack([run.events.x, run.events.x_o, run.events.x_h])[: len(times)]
    np.testing.assert_allclose(found, states, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(run.x[-1], end[:n], rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(run.x_o[-1], end[n : n + m], rtol=0, atol=1e-9 * scale)


def test_without_one_nothing_is_there() -> None:
    controller = linear_cases.event_controller(linear_cases.pendulum_design())
    assert controller.model == (controller.design, controller.hold)
    assert controller.realisation.layout.sizes == (2, 2)
    assert not controller.realisation.signals.size
    assert simulate(linear_cases.PENDULUM, controller, linear_cases.settings(1.0)).r.shape == (101, 0)


def test_an_interval_alone_is_refused() -> None:
    design = linear_cases.pendulum_design()
    followed = setpoint(design.plant, [Target({"angle": 1.0}, step(0.2, 1.0))])
    controller = replace(linear_cases.event_controller(design), setpoint=followed)
    with pytest.raises(Exception, match="signals of its own"):
        open_loop(design.plant, controller, linear_cases.settings(1.0))
