"""The exact simulation, against closed forms, SciPy's DOP853 with events, and the eigen-analysis."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from linear_cases import (
    PENDULUM,
    event_controller,
    ivp_events,
    loop_matrix,
    neglected,
    pendulum_design,
    random_loop,
    settings,
    settings_from,
)
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from icmj.controller.controller import Controller
from icmj.controller.design import Design, design_lq
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger, as_weight
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.errors import SimulationError
from icmj.linear.loop import make_linear_loop
from icmj.linear.run import simulate
from icmj.measurement.measurement import measure, measured_gamma
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.disturbance import make_pushes
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Impulse, Noise, Step
from icmj.theory.error_system import error_system
from icmj.theory.prediction import predict

MODELS = Path(__file__).parents[2] / "models"


def scalar_loop(a: float, gain: float, q_t: float, delta_min: float = 0.0) -> tuple[LinearPlant, Controller]:
    """ẋ = a x + u, y = x with an exact model: the hold error is e(τ) = d₀ (e^{aτ} − e^{(a − gain)τ})."""
    plant = LinearPlant([[a]], [[1.0]], [[1.0]])
    design = Design(plant, np.array([[a + 0.5]]), np.array([[gain]]))
    return plant, Controller(design, system_matched(design), EventTrigger(np.eye(1), q_t, delta_min))


def test_intervals_in_closed_form():
    # a = 1, gain = 3: e = d₀(z − z⁻²) with z = e^τ; from d₀ = q/1.75 the first event is at z = 2, the observer
    # error there is d₀/4, hence the second at z − z⁻² = 7
    plant, controller = scalar_loop(1.0, 3.0, 0.02)
    run = simulate(plant, controller, settings(3.0), x0=[0.0], x_o0=[0.02 / 1.75])
    second = np.log(np.roots([1, -7, 0, -1]).real.max())
    assert run.events.interval[:2] == pytest.approx([np.log(2), second], abs=1e-12)
    assert run.events.x_o[0] == pytest.approx(run.events.x[0] + 0.02 / 1.75 / 4, abs=1e-16)


@pytest.mark.parametrize("margin", [1e-3, 1e-6, 1e-9, 1e-11, 1e-12])
def test_grazing(margin):
    # a = −1, gain = 1: e = d₀(z − z²) with z = e^{−τ}, greatest at z = ½ with d₀/4. E passes zero by `margin` for a
    # time of about 4 √margin s, far inside one internal step
    plant, controller = scalar_loop(-1.0, 1.0, 0.5)
    over = simulate(plant, controller, settings(5.0), x0=[0.0], x_o0=[2.0 * (1 + margin)])
    first = -np.log((1 + np.sqrt(margin / (1 + margin))) / 2)
    assert over.events.t[0] == pytest.approx(first, abs=1e-15 / np.sqrt(margin) + 1e-12)
    under = simulate(plant, controller, settings(5.0), x0=[0.0], x_o0=[2.0 * (1 - margin)])
    assert len(under.events) == 0
    assert under.E.max() < 0


def test_grazing_under_random_plants():
    """E at its first interior maximum decides: q_t a hair above gives no event there, a hair below gives one."""
    tested = 0
    for seed in range(40):
        plant, design = random_loop(seed, 3, 3, 1, 1)
        random = np.random.default_rng(seed)
        x, x_o = random.standard_normal(3), random.standard_normal(3)
        calm = event_controller(design, Q_t="identity", q_t=1e6)
        M = loop_matrix(plant, calm)
        t = np.linspace(0, 3, 3001)
        P, z, size = expm(M * t[1]), np.concatenate([x, x_o, x_o]), []
        for _ in t:
            size.append(np.linalg.norm(z[6:] - z[3:6]))
            z = P @ z
        size = np.array(size)
        peaks = np.nonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] >= size[:-2].max()))[0] + 1
        peaks = [i for i in peaks if size[i] > size[:i].max()]
        if not peaks:
            continue
        i = peaks[0]
        # the maximum itself, by golden section on the matrix exponential
        from scipy.optimize import minimize_scalar

        def hold_error(time, M=M, x=x, x_o=x_o):
            w = expm(M * time) @ np.concatenate([x, x_o, x_o])
            return np.linalg.norm(w[6:] - w[3:6])

        top = -minimize_scalar(
            lambda time: -hold_error(time), bounds=(t[i - 1], t[i + 1]), method="bounded", options={"xatol": 1e-9}
        ).fun
        # until a time after the peak at which the error is still below it
        end = t[i + 1 + int(np.argmin(size[i + 1 : i + 40]))] if size[i + 1 : i + 40].min() < top else t[i + 1]
        if size[(t <= end)].max() > top * (1 + 1e-12):
            continue
        tested += 1
        for factor, expected in ((1 - 1e-8, True), (1 + 1e-8, False)):
            controller = event_controller(design, Q_t="identity", q_t=top * factor, delta_min=0.0)
            run = simulate(plant, controller, settings(float(end)), x0=x, x_o0=x_o)
            assert (len(run.events) > 0) is expected
    assert tested >= 8


@pytest.mark.parametrize(
    ("seed", "n", "n_hat", "n_u", "n_y", "hold"),
    [
        (1, 2, 2, 1, 1, "system-matched"),
        (2, 3, 3, 2, 2, "system-matched"),
        (3, 4, 2, 1, 1, "system-matched"),
        (4, 4, 3, 2, 1, "zero-order"),
        (5, 2, 2, 1, 2, "zero-order"),
    ],
)
def test_events_agree_with_dop853(seed, n, n_hat, n_u, n_y, hold):
    plant, design = random_loop(seed, n, n_hat, n_u, n_y)
    random = np.random.default_rng(seed)
    x, x_o = 0.1 * random.standard_normal(n), 0.1 * random.standard_normal(n_hat)
    controller = event_controller(design, Q_t="identity", q_t=0.02, delta_min=0.03, hold=hold)
    run = simulate(plant, controller, settings(4.0), x0=x, x_o0=x_o)
    times, states = ivp_events(plant, controller, 4.0, x, x_o)
    assert len(times) > 3
    assert len(run.events) == len(times)
    assert np.abs(run.events.t - times).max() < 1e-9
    assert np.abs(np.hstack([run.events.x, run.events.x_o, run.events.x_h]) - states).max() < 1e-9


def test_recorded_samples_agree_with_dop853():
    plant, design = PENDULUM.scaled(0.8), pendulum_design()
    controller = event_controller(design)
    run = simulate(plant, controller, settings(6.0, initial={"hinge": 0.02}, record_interval=0.05))
    M = loop_matrix(plant, controller)
    z, checked = np.array([0.02, 0, 0, 0, 0, 0]), 0
    edges = [0.0, *run.events.t, 6.0]
    for start, end in pairwise(edges):
        inside = (run.t > start) & (run.t <= end)
        part = solve_ivp(
            lambda t, z: M @ z, (start, end), z, t_eval=run.t[inside], method="DOP853", rtol=1e-12, atol=1e-15
        )
        states = np.hstack([run.x, run.x_o, run.x_h])[inside]
        assert np.abs(states - part.y.T).max() < 1e-10
        assert np.abs(run.u[inside] + states[:, 4:] @ design.k.T).max() < 1e-15
        e = states[:, 4:] - states[:, 2:4]
        assert run.E[inside] == pytest.approx(e[:, 0] ** 2 - 0.01**2, abs=1e-12)
        z, checked = part.y[:, -1].copy(), checked + inside.sum()
        z[4:] = z[2:4]
    assert checked == len(run.t) - 1
    grid = np.arange(121) * 0.05
    assert all(np.abs(run.t - t).min() < 1e-11 for t in grid)
    assert np.all(np.diff(run.t) > 0)
    assert len(run.t) == 121 + len(run.events)


def test_extremes_of_the_outputs_are_exact():
    plant, design = random_loop(11, 4, 3, 1, 2)
    controller = event_controller(design, Q_t="identity", q_t=0.05, delta_min=0.05)
    run = simulate(plant, controller, settings(4.0, record_interval=1e-4), x0=[0.1, -0.2, 0.1, 0.3])
    assert len(run.events) > 3
    start = 0.0
    inside_extreme = 0
    for i, end in enumerate(run.events.t):
        y = run.y[(run.t >= start) & (run.t <= end)]
        if i > 0:  # the sample right at the reset is not in the next interval's record
            y = np.vstack([run.events.x[i - 1] @ plant.C.T, y])
        bend = np.abs(np.diff(y, 2, axis=0)).max()
        assert np.all(run.events.y_max[i] >= y.max(axis=0) - 1e-15)
        assert np.all(run.events.y_min[i] <= y.min(axis=0) + 1e-15)
        assert np.all(run.events.y_max[i] <= y.max(axis=0) + bend)
        assert np.all(run.events.y_min[i] >= y.min(axis=0) - bend)
        ends = np.maximum(y[0], y[-1])
        inside_extreme += np.sum(run.events.y_max[i] > ends + 1e-6)
        start = end
    assert inside_extreme > 0


def test_an_extreme_in_closed_form():
    # undriven oscillator y = sin t: u = 0 with k = 0; e stays 0
    plant = LinearPlant([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]])
    design = Design(plant, np.zeros((1, 2)), np.zeros((2, 1)))
    controller = Controller(design, system_matched(design), ClockTrigger(2.0))
    run = simulate(plant, controller, settings(4.0), x0=[0.0, 1.0], x_o0=[0.0, 1.0])
    assert run.events.y_max[:, 0] == pytest.approx([1.0, np.sin(2.0)], abs=1e-15)
    assert run.events.y_min[:, 0] == pytest.approx([0.0, np.sin(4.0)], abs=1e-14)


def test_pending_event_fires_exactly_at_delta_min():
    plant, controller = scalar_loop(1.0, 3.0, 0.02, delta_min=0.9)
    run = simulate(plant, controller, settings(1.0), x0=[0.0], x_o0=[0.02 / 1.75])
    assert run.events.t.tolist() == [0.9]
    # and one that falls on Δ_min itself
    plant, controller = scalar_loop(1.0, 3.0, 0.02, delta_min=np.log(2) - 1e-15)
    run = simulate(plant, controller, settings(1.0), x0=[0.0], x_o0=[0.02 / 1.75])
    assert run.events.t[0] == pytest.approx(np.log(2), abs=1e-12)


def test_excursion_that_is_over_by_delta_min_is_no_event():
    # e = d₀(z − z²) exceeds q_t only around τ = ln 2
    plant, controller = scalar_loop(-1.0, 1.0, 0.5, delta_min=1.5)
    run = simulate(plant, controller, settings(5.0), x0=[0.0], x_o0=[2.2])
    assert len(run.events) == 0


def test_initial_hold_error_is_sampled_at_delta_min():
    plant, controller = scalar_loop(-1.0, 1.0, 0.5, delta_min=0.1)
    run = simulate(plant, controller, settings(0.5), x0=[0.0], x_o0=[0.0], x_h0=[3.0])
    assert run.events.t[0] == 0.1
    assert run.E[0] == pytest.approx(9 - 0.25)


def test_event_on_a_recording_instant_is_recorded_once():
    plant, controller = scalar_loop(1.0, 3.0, 0.02)
    run = simulate(plant, controller, settings(1.0, record_interval=np.log(2)), x0=[0.0], x_o0=[0.02 / 1.75])
    assert run.t == pytest.approx([0, np.log(2), 1.0], abs=1e-12)
    assert run.E[1] == pytest.approx(0, abs=1e-16)


def test_event_at_the_end_of_the_run():
    plant, controller = scalar_loop(1.0, 3.0, 0.02)
    for duration, expected in ((np.log(2), 1), (np.log(2) + 1e-9, 1), (np.log(2) - 1e-9, 0)):
        run = simulate(plant, controller, settings(duration), x0=[0.0], x_o0=[0.02 / 1.75])
        assert len(run.events) == expected
        assert run.t[-1] == duration
        assert run.outcome.kind == "completed"


def test_the_clock_samples_as_phi_says():
    plant, design = neglected(0.5), pendulum_design()
    controller = Controller(design, system_matched(design), ClockTrigger(0.7))
    run = simulate(plant, controller, settings(14.0), x0=[0.02, 0, 0, 0])
    system = error_system(plant, design)
    assert run.events.t == pytest.approx(0.7 * np.arange(1, 21), abs=1e-13)
    x_bar = np.array([0.02, 0, 0, 0, -0.02, 0])
    for x, x_o in zip(run.events.x, run.events.x_o, strict=True):
        x_bar = system.phi(0.7) @ x_bar
        assert np.concatenate([x, x_o - system.T_hat @ x]) == pytest.approx(x_bar, abs=1e-12)
    assert np.isnan(run.E).all()
    assert run.control == "clock"


def test_continuous_control_is_a_matrix_exponential():
    plant, design = PENDULUM.scaled(1.2), pendulum_design()
    controller = replace(event_controller(design), trigger=Continuous())
    run = simulate(plant, controller, settings(3.0, initial={"hinge": 0.1}, observer={"hinge_rate": 0.3}))
    A = np.block([[plant.A, -plant.B @ design.k], [design.L @ plant.C, design.A_o - design.plant.B @ design.k]])
    for t, x, x_o in zip(run.t[::50], run.x[::50], run.x_o[::50], strict=True):
        assert np.concatenate([x, x_o]) == pytest.approx(expm(A * t) @ [0.1, 0, 0, 0.3], abs=1e-13)
    assert np.array_equal(run.x_h, run.x_o)
    assert run.control == "continuous"
    assert len(run.events) == 0


def test_disturbances_agree_with_dop853():
    plant, design = PENDULUM.scaled(0.9), pendulum_design()
    controller = event_controller(design)
    disturbance = [
        {"kind": "impulse", "input": "torque", "size": 0.01, "start": 0.5, "duration": 0.2, "on": "command"},
        {"kind": "step", "input": "torque", "size": 0.02, "start": 1.0, "on": "command"},
        {"kind": "noise", "input": "torque", "size": 0.02, "bandwidth": 2.0, "seed": 3, "start": 1.5},
    ]
    chosen = settings_from({"duration": 3.0, "limit": 1e6, "initial": {"hinge": 0.02}, "disturbance": disturbance})
    run = simulate(plant, controller, chosen)
    from icmj.simulation.disturbance import make_disturbance

    torque = make_disturbance(chosen.disturbance, plant.inputs)
    times, states = ivp_events(plant, controller, 3.0, [0.02, 0], [0, 0], torque=torque, max_step=1e-3)
    assert len(run.events) == len(times) == 4
    assert np.abs(run.events.t - times).max() < 1e-7  # DOP853 steps across the edges of the windows
    assert np.abs(run.events.x - states[:, :2]).max() < 1e-8


def test_pushes_on_the_plant_itself_pass_no_gain_and_agree_with_dop853():
    """What pushes by p at b = 0.9 does what p/b does beside the command; the controller's model stays as it was."""
    plant, controller = PENDULUM.scaled(0.9), event_controller(pendulum_design())
    sources = (
        Impulse("torque", 0.009, 0.5, 0.2),
        Step("torque", 0.018, 1.0),
        Noise("torque", 0.018, 2.0, seed=3, start=1.5, on="body"),
    )
    chosen = settings(3.0, initial={"hinge": 0.02}, disturbance=sources)
    run, size = simulate(plant, controller, chosen), make_pushes(chosen).size
    times, states = ivp_events(plant, controller, 3.0, [0.02, 0], [0, 0], torque=lambda t: size(t) / 0.9, max_step=1e-3)
    assert len(run.events) == len(times) == 4
    assert np.abs(run.events.t - times).max() < 1e-7
    assert np.abs(run.events.x - states[:, :2]).max() < 1e-8
    assert (run.push_names, run.applied.size) == (("torque",), 0)
    np.testing.assert_array_equal(run.push_values, size(run.t))


def test_a_plant_without_a_body_has_none_to_push():
    with pytest.raises(SimulationError, match="push on 'trunk': a linear plant knows no bodies"):
        simulate(
            PENDULUM, event_controller(pendulum_design()), settings(disturbance=(Step(body="trunk", force=(1, 0, 0)),))
        )


def test_fall_is_exact_and_keeps_the_run():
    plant = neglected(0.5).scaled(-1.0)  # control with the wrong sign
    controller = replace(event_controller(pendulum_design()), trigger=Continuous())
    run = simulate(plant, controller, settings(60.0, initial={"hinge": 0.01}, limit=0.5))
    assert run.outcome.kind == "fell"
    assert "hinge" in run.outcome.message
    assert abs(run.x[-1, 0]) == pytest.approx(0.5, abs=1e-12)
    assert np.abs(run.x[:-1, 0]).max() < 0.5
    assert run.t[-1] == run.outcome.t
    assert list(make_linear_loop(plant, controller).positions) == [0]


def in_units(unit, factor):
    """The pendulum with its angle, and its output, in another unit."""
    T, units = factor * np.eye(2), (unit, f"{unit}/s")
    A, B, C = T @ PENDULUM.A @ np.linalg.inv(T), T @ PENDULUM.B, PENDULUM.C
    return LinearPlant(A, B, C, ("hinge", "hinge_rate"), ("torque",), ("angle",), units, ("N m",), (unit,))


@pytest.mark.parametrize(("unit", "factor"), [("deg", 180 / np.pi), ("rad", 1.0), ("mm", 1e3)])
@pytest.mark.parametrize("limit", [None, 1.0, {}, {"hinge": 0.3}], ids=str)
def test_a_limit_does_not_depend_on_the_unit(unit, factor, limit):
    """One motion in three units falls at one time, at 1 rad or 1 m unless another limit is given in the unit."""
    plant = in_units(unit, factor)
    design = design_lq(plant, R_c=0.1 * factor**2, R_o=0.01 * factor**2)
    controller = Controller(design, system_matched(design), EventTrigger(as_weight("output", design), 0.01 * factor))
    there = {name: size * factor for name, size in limit.items()} if isinstance(limit, dict) else limit
    chosen = Settings(duration=20.0, initial={"hinge": 0.02 * factor}, limit=there)
    run = simulate(plant.scaled(-1.0), controller, chosen)
    at = 0.3 if limit == {"hinge": 0.3} else 1.0
    assert run.outcome.kind == "fell"
    assert abs(run.x[-1, 0]) == pytest.approx(at * factor, rel=1e-9)
    assert f"its limit of {at * factor:g} {unit}" in run.outcome.message
    before = Settings(duration=20.0, initial={"hinge": 0.02}, limit=at)
    assert run.t[-1] == pytest.approx(
        simulate(PENDULUM.scaled(-1.0), event_controller(pendulum_design(), delta_min=1e-3), before).t[-1], rel=1e-6
    )


def test_what_is_no_angle_and_no_length_has_no_limit_unless_one_is_given():
    plant, controller = PENDULUM.scaled(-1.0), event_controller(pendulum_design())
    for limit, end in ((None, "diverged"), (2.0, "fell"), ({"hinge": 2.0}, "fell")):
        run = simulate(plant, controller, Settings(duration=60.0, initial={"hinge": 0.02}, limit=limit))
        assert run.outcome.kind == end
        assert end == "diverged" or abs(run.x[-1, 0]) == pytest.approx(2.0, rel=1e-9)


def test_a_limit_of_what_is_no_position_is_refused():
    for name in ("knee", "hinge_rate"):
        with pytest.raises(SimulationError, match=f"limit: no position '{name}' in the plant; expected one of hinge"):
            simulate(PENDULUM, event_controller(pendulum_design()), settings(limit={name: 1.0}))


def test_divergence():
    plant, design = PENDULUM.scaled(-1.0), pendulum_design()
    run = simulate(plant, event_controller(design), settings(200.0, initial={"hinge": 0.1}, limit=1e30))
    assert run.outcome.kind == "diverged"
    assert np.isfinite(run.x).all()
    assert run.t[-1] == run.outcome.t < 200


def test_sliding():
    plant, design = PENDULUM.scaled(0.8), pendulum_design()
    controller = event_controller(design, q_t=1e-9, delta_min=0.05)
    run = simulate(plant, controller, settings(2.0, initial={"hinge": 0.1}))
    assert run.outcome.kind == "sliding"
    assert run.events.interval == pytest.approx(np.full(40, 0.05), abs=1e-12) or len(run.events) == 39


def test_interruption_keeps_what_was_simulated():
    def stop(part: float) -> None:
        if part > 0.25:
            raise KeyboardInterrupt

    plant, controller = PENDULUM.scaled(0.8), event_controller(pendulum_design())
    chosen = settings(20.0, initial={"hinge": 0.02})
    run, whole = simulate(plant, controller, chosen, progress=stop), simulate(plant, controller, chosen)
    assert run.outcome.kind == "interrupted"
    assert 5 < run.outcome.t == run.t[-1] < 20
    assert np.array_equal(run.events.t, whole.events.t[: len(run.events)])


def test_progress_rises_to_the_end():
    times = []
    simulate(PENDULUM, event_controller(pendulum_design()), settings(5.0), x0=[0.01, 0], progress=times.append)
    assert times == sorted(times)
    assert times[-1] == 1.0


def test_exact_model_is_homoclinic_until_nothing_is_left():
    run = simulate(PENDULUM, event_controller(pendulum_design()), settings(2000.0, initial={"hinge": 0.02}))
    assert run.outcome.kind == "completed"
    # the observer error falls as e^{−αt}, α its slowest rate, and what is left of it at a sample grows as e^{τ} to q_t:
    # Δ_{i+1} = α t_i + constant, hence t_i and Δ_i grow by the factor 1 + α
    slowest = -np.linalg.eigvals(pendulum_design().A_o).real.max()
    ratio = run.events.interval[1:] / run.events.interval[:-1]
    assert ratio[-1] == pytest.approx(1 + slowest, rel=1e-3)
    assert len(run.events) < 12
    assert run.E[-1] == pytest.approx(-1e-4)


@pytest.mark.parametrize("bad", [[0.0], [np.nan, 0.0]])
def test_start_states_are_checked(bad):
    with pytest.raises(SimulationError, match="start state of the plant"):
        simulate(PENDULUM, event_controller(pendulum_design()), settings(), x0=bad)


def test_unknown_start_state_is_named():
    with pytest.raises(SimulationError, match="'knee'"):
        simulate(PENDULUM, event_controller(pendulum_design()), settings(initial={"knee": 0.1}))


@pytest.mark.parametrize("Q_t", ["output", "identity"])
@pytest.mark.parametrize(
    ("plant", "duration", "p"),
    [
        (PENDULUM.scaled(0.8), 60.0, 1),
        (PENDULUM.scaled(1.2), 60.0, 2),
        (neglected(0.1), 100.0, 1),
        (neglected(0.5), 80.0, 1),
    ],
    ids=["gain 0.8", "gain 1.2", "damping 0.1", "damping 0.5"],
)
def test_interval_and_gamma_agree_with_the_prediction(plant, duration, p, Q_t):
    check_prediction(plant, pendulum_design(), duration, p, Q_t, delta_max=4.5)


@pytest.mark.parametrize("Q_t", ["output", "identity"])
@pytest.mark.parametrize(("b", "p"), [(0.9, 1), (1.1, 2)])
def test_three_link_agrees_with_the_prediction(b, p, Q_t):
    from icmj.controller.design import design_lq
    from icmj.engine.linearisation import linearise
    from icmj.engine.model import load_spec

    assumed = linearise(load_spec(MODELS / "three_link.xml").compile(), "upright").plant
    design = design_lq(assumed, R_c=5e-7, R_o=2e-7)
    check_prediction(assumed.scaled(b), design, 40.0, p, Q_t, delta_max=3.0)


def check_prediction(plant, design, duration, p, Q_t, delta_max):
    controller = event_controller(design, Q_t=Q_t)
    run = simulate(plant, controller, settings(duration, initial={plant.states[0]: 0.02}))
    system = error_system(plant, design)
    prediction = predict(system, controller.trigger, delta_max=delta_max)
    found = measure(run, T_hat=system.T_hat)
    assert prediction.verdict == "attracting"
    assert (found.kind, found.p, found.mirrored) == ("cycle", p, p == 2)
    assert found.interval == pytest.approx(prediction.delta_crit, rel=1e-11)
    assert found.period == pytest.approx(prediction.period, rel=1e-11)
    assert measured_gamma(run, prediction.V_inv, system.T_hat) == pytest.approx(prediction.gamma, rel=1e-11)
    assert found.amplitude == pytest.approx(prediction.amplitude, rel=1e-10)
