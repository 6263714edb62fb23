"""The continuous predictor controller on the linear plant: closed forms, DOP853 by the method of steps, and limits."""

from dataclasses import replace

import linear_cases
import numpy as np
import pytest
from oracles.delay import Delayed
from scipy.linalg import expm

from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import output_weight
from icmj.controller.hold import system_matched
from icmj.controller.predictor import PredictorController
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.setpoint import Target, pulse, ramp, setpoint, sines, step
from icmj.controller.trigger import ClockTrigger
from icmj.linear.run import simulate
from icmj.simulation.disturbance import make_disturbance, make_pushes, make_reading_error
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Impulse, Noise, Step
from icmj.theory.delay_roots import rightmost_roots
from icmj.theory.predictor_roots import predictor_loop

DESIGN = linear_cases.pendulum_design()
START = np.array([0.01, 0.003])


def by_method_of_steps(plant, law, x0, duration, disturbance=(), terms=None) -> Delayed:
    """z = (x, x_o, p, r) as they act, by DOP853; p by its differential equation, whose own mode grows little in that
    time."""
    d, t_d, assumed = law.design, law.delay.t_d, law.delay.predicted
    n, m, E, k_r = plant.n, d.plant.n, expm(d.plant.A * law.delay.predicted), 0.0
    r = law.setpoint or (lambda t: np.zeros(1))
    k_r = law.setpoint.gain(d.k) if law.setpoint else np.zeros((plant.n_u, 1))
    acts, errs = make_disturbance(disturbance, plant.inputs), make_reading_error(disturbance, plant.outputs)
    pushes = make_pushes(Settings(disturbance=disturbance))
    E_d = np.column_stack([np.zeros((n, 0)), *(plant.effect(push) for push in pushes.places)])
    taps, n_y = tuple(sorted({t_d, assumed})), plant.n_y
    each = n_y + plant.n_u

    def command(t, z):
        return -d.k @ z[n + m :] + k_r @ (r(t - t_d) if t >= t_d else 0 * r(0.0))

    def rate(t, z, v, mode):
        x, x_o, p, u = z[:n], z[n : n + m], z[n + m :], command(t, z)
        late, gone = v[each * taps.index(t_d) :][:each], v[each * taps.index(assumed) :][:each][n_y:]
        e = d.L @ (late[:n_y] - d.plant.C @ x_o)
        return np.concatenate([
            plant.A @ x + plant.B @ (u + acts(t)) + E_d @ pushes.size(t),
            d.plant.A @ x_o + d.plant.B @ late[n_y:] + e,
            d.plant.A @ p + d.plant.B @ u + E @ (d.plant.B @ (late[n_y:] - gone) + e),
        ])  # fmt: skip

    jumps = [] if law.setpoint is None else [at + t_d for at in (0.0, *law.setpoint.edges)]
    edges = sorted({*acts.edges, *pushes.size.edges, *errs.edges, *jumps})
    return Delayed(
        rate, lambda t, z: np.concatenate([plant.C @ z[:n] + errs(t), command(t, z)]), taps,
        np.concatenate([x0, np.zeros(2 * m)]), edges=tuple(edges),
    ).run(duration)  # fmt: skip


def apart(run, oracle) -> float:
    there = np.array([oracle.z(t)[: run.x.shape[1]] for t in run.t])
    return float((np.abs(run.x - there).max(axis=0) / np.abs(there).max(axis=0)).max())


def closed_form(design, t_d: float, x0, times):
    """x of the exact model whose controller begins at zero t_d ago and reads what is there at 0 until then."""
    A, B, C, k, L, n = design.plant.A, design.plant.B, design.plant.C, design.k, design.L, design.plant.n
    E, Z = expm(A * t_d), np.zeros((n, n))
    y0 = C @ x0
    # (x, x_o, p, 1) while it reads y0, and nothing that it has commanded acts
    early = np.zeros((3 * n + 1,) * 2)
    early[:-1, :-1] = np.block([[A, Z, -B @ k], [Z, design.A_o, Z], [Z, -E @ L @ C, design.A_c]])
    early[n : 2 * n, -1], early[2 * n : -1, -1] = L @ y0, E @ L @ y0
    # (p, e) from then on, as of t_d ago, with e = x − x_o; x is what was predicted, but for the error's growth
    later, now = np.block([[design.A_c, E @ L @ C], [Z, design.A_o]]), np.hstack([np.eye(n), E])
    first = np.concatenate([x0, np.zeros(2 * n), [1.0]])
    at = expm(early * t_d) @ first
    then = np.concatenate([at[2 * n : -1], x0 - at[n : 2 * n]])
    return np.array([
        (expm(early * t) @ first)[:n] if t < t_d else now @ expm(later * (t - t_d)) @ then for t in times
    ])  # fmt: skip


@pytest.mark.parametrize("t_d", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("order", [2, 4])
def test_with_an_exact_model_it_is_the_closed_form(t_d: float, order: int) -> None:
    """For a minute, in which a difference between p and its integral would have grown e^60-fold."""
    design = DESIGN if order == 2 else linear_cases.random_loop(3, 4, 4, 2, 2)[1]
    x0 = 0.01 * np.arange(1, order + 1)
    run = simulate(
        design.plant, PredictorController(design, Delay(t_d)), linear_cases.settings(60.0, record_interval=0.5), x0=x0
    )
    assert run.outcome.kind == "completed"
    expected = closed_form(design, t_d, x0, run.t)
    np.testing.assert_allclose(run.x, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert np.abs(run.x[-1]).max() < 1e-9
    assert run.control == "predictor"


DISTURBED = (
    Noise("torque", 0.02, bandwidth=4.0, seed=1, start=0.2), Impulse("torque", 0.1, start=0.5003, duration=0.0371),
    Step("torque", 0.01, 1.1), Noise(output="angle", size=3e-4, bandwidth=3.0, seed=2), Bias("angle", 2e-4, 0.9),
)  # fmt: skip


@pytest.mark.parametrize(("t_d", "assumed", "b"), [(0.2, 0.2, 0.8), (0.2, 0.15, 1.0), (0.1, 0.14, 1.1)])
def test_it_is_what_the_method_of_steps_gives(t_d: float, assumed: float, b: float) -> None:
    plant, law = DESIGN.plant.scaled(b), PredictorController(DESIGN, Delay(t_d, assumed))
    run = simulate(plant, law, linear_cases.settings(2.5, record_interval=0.05, disturbance=DISTURBED), x0=START)
    assert apart(run, by_method_of_steps(plant, law, START, 2.5, DISTURBED)) < 1e-9


@pytest.mark.slow
def test_a_set_point_that_does_everything() -> None:
    targets = [
        Target({"angle": 1.0}, part)
        for part in (
            step(0.1), pulse(-0.15, 0.77, 0.6), ramp(0.2, 0.5, 1.4), sines([0.03, 0.02], [0.3, 1.7], [0.4, 2.0], 0.9),
        )
    ]  # fmt: skip
    followed = setpoint(DESIGN.plant, targets)
    for plant, delay in ((DESIGN.plant, Delay(0.2)), (DESIGN.plant.scaled(0.9), Delay(0.2, 0.17))):
        law = PredictorController(DESIGN, delay, followed)
        run = simulate(plant, law, linear_cases.settings(2.2, record_interval=0.05), x0=[0.0, 0.0])
        assert apart(run, by_method_of_steps(plant, law, np.zeros(2), 2.2)) < 1e-9
        # a row that is an edge but for rounding is exactly that
        met = np.abs(run.t[:, None] - followed.edges).min(axis=1) < 1e-9
        np.testing.assert_array_equal(run.r[~met], followed(run.t[~met]))
        np.testing.assert_allclose(run.r[met], followed(run.t[met]), rtol=0, atol=1e-15)


@pytest.mark.parametrize(("t_d", "assumed", "b"), [(0.2, 0.17, 1.0), (0.1, 0.0, 1.0)])
def test_the_motion_decays_as_the_rightmost_root_says(t_d: float, assumed: float, b: float) -> None:
    plant, law = DESIGN.plant.scaled(b), PredictorController(DESIGN, Delay(t_d, assumed))
    roots = rightmost_roots(predictor_loop(plant, law), 4)
    run = simulate(plant, law, linear_cases.settings(12.0), x0=START)
    # the rows of the end are sums of the slowest motions, and nothing of what a faster one leaves
    slow = [root for root in roots if root.real > roots[0].real - 2.0]
    late = (run.t > 8) & (run.t < 11.9)
    basis = np.exp(np.outer(run.t[late] - 8, slow))
    c, *_ = np.linalg.lstsq(basis, run.x[late, 1].astype(complex), rcond=None)
    left = np.abs(basis @ c - run.x[late, 1]).max()
    assert left < 1e-3 * np.abs(run.x[late, 1]).max()


def clocks(delay: Delay, count: int, target, law) -> list[float]:
    """How far the clock-driven controller is from the continuous one, as its interval is halved."""
    found, at = [], np.linspace(0.5, 4.0, 36)
    settings = linear_cases.settings(4.0, record_interval=0.1, disturbance=(Impulse("torque", 0.2, 0.13, 0.3),))
    plant = DESIGN.plant.scaled(0.9)
    one = simulate(plant, law, settings, x0=[0.0, 0.0])
    for i in range(count):
        clock = 0.025 / 2**i
        controller = Controller(DESIGN, system_matched(DESIGN), ClockTrigger(clock), delay, target)
        other = simulate(plant, controller, settings, x0=[0.0, 0.0])
        x = [run.x[np.searchsorted(run.t, at - 1e-9), 1] for run in (one, other)]
        found.append(float(np.abs(x[0] - x[1]).max()))
    return found


@pytest.mark.parametrize(("delay", "order"), [(Delay(0.1), 1.0), (Delay(0.1, 0.075), 1.0)])
def test_a_clock_tends_to_it_as_its_interval_goes_to_zero(delay: Delay, order: float) -> None:
    errors = clocks(delay, 4, None, PredictorController(DESIGN, delay))
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes[-2:] == pytest.approx([order, order], abs=0.1)


@pytest.mark.parametrize("t_d", [0.0, 0.1])
def test_an_event_rule_without_a_threshold_is_the_clock_of_its_least_interval(t_d: float) -> None:
    settings = linear_cases.settings(4.0, disturbance=(Noise("torque", 0.05, bandwidth=4.0, seed=1),))
    runs = []
    for trigger in (EventTrigger(output_weight(DESIGN), 1e-12, delta_min=0.25), ClockTrigger(0.25)):
        controller = Controller(DESIGN, system_matched(DESIGN), trigger, Delay(t_d))
        runs.append(simulate(DESIGN.plant.scaled(0.9), controller, settings, x0=START, x_o0=START, x_h0=START))
    np.testing.assert_allclose(runs[0].events.t, runs[1].events.t[: len(runs[0].events)], rtol=0, atol=1e-9)
    same = np.intersect1d(runs[0].t.round(9), runs[1].t.round(9))
    x = [run.x[np.searchsorted(run.t, same - 1e-8)] for run in runs]
    np.testing.assert_allclose(x[0], x[1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("several", [False, True])
def test_a_step_under_an_event_rule_is_the_retimed_one_of_it(several: bool) -> None:
    design = linear_cases.random_loop(3, 4, 4, 2, 2)[1] if several else DESIGN
    plant, delay = design.plant, Delay(0.2)
    first, last = plant.outputs[0], plant.outputs[-1]
    # the second comes while the rule does not look yet, and is taken up when it does; the third when it comes
    steps = [(first, 0.5, 1.0), (last, -0.3, 1.2), (first, 0.4, 2.5)]
    followed, retimed = (
        setpoint(plant, [Target({name: 1.0}, step(size, when)) for name, size, when in given])
        for given in (steps, [steps[0], (last, -0.3, 1.35), steps[2]])
    )
    trigger = EventTrigger(output_weight(design), 1e-3, delta_min=0.35)
    settings = linear_cases.settings(6.0, record_interval=0.05)
    events = simulate(plant, Controller(design, system_matched(design), trigger, delay, followed), settings)
    np.testing.assert_allclose(events.events.t, [1.0, 1.35, 2.5], rtol=0, atol=1e-12)
    run = simulate(plant, PredictorController(design, delay, retimed), settings)
    at = np.linspace(0.05, 6, 120)
    one, other = (r.y[np.searchsorted(r.t, at - 1e-9)] for r in (run, events))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    assert np.abs(one).max() > 0.2


def test_it_follows_a_sinusoid_and_a_disturbance_as_its_frequency_response_says() -> None:
    plant, omega = DESIGN.plant.scaled(0.9), 2 * np.pi * 0.8
    followed = setpoint(DESIGN.plant, [Target({"angle": 1.0}, sines([0.1], [0.8], [0.0]))])
    law = PredictorController(DESIGN, Delay(0.15, 0.12), followed)
    run = simulate(plant, law, linear_cases.settings(40.0, record_interval=0.05), x0=[0.0, 0.0])
    *_, s = predictor_loop(plant, law).response([omega])
    late = run.t > 35
    expected = 0.1 * np.imag(np.exp(1j * omega * run.t[late])[:, None] * s[0, :, 0])
    np.testing.assert_allclose(np.hstack([run.x, run.u])[late], expected, rtol=0, atol=1e-9)


def test_it_falls_and_observers_have_no_start() -> None:
    from icmj.errors import SimulationError

    law = PredictorController(replace(DESIGN, k=0 * DESIGN.k), Delay(0.2))
    assert simulate(DESIGN.plant, law, linear_cases.settings(20.0, limit=1.0), x0=START).outcome.kind == "fell"
    with pytest.raises(SimulationError, match="leave out where they start"):
        simulate(DESIGN.plant, law, linear_cases.settings(20.0), x_o0=START)
