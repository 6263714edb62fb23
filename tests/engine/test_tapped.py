"""Controllers that read delayed outputs on the engine, against the linear plant, and DOP853 by the method of steps."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import Delayed
from tapped_cases import (
    BODY,
    CONTINUOUS,
    DAMPING,
    DELAY,
    HOMOGENEOUS,
    INERTIA,
    MGH,
    STIFFNESS,
    SWITCHING,
    Tapped,
    person,
    pid,
    two_taps,
)

import icmj
from icmj.controller.realisation import Guard, Mode
from icmj.engine.run import simulate
from icmj.errors import SimulationError
from icmj.linear.run import simulate as simulate_linear
from icmj.simulation.disturbance import make_disturbance, make_pushes, make_reading_error
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Gaussian, Impulse, Noise, Sampled, Step

START = np.array([0.1, 0.03])
DISTURBED = (
    Noise("ankle", 5.0, bandwidth=4.0, seed=1, start=0.2), Impulse("ankle", 4.0, start=0.5003, duration=0.0371),
    Step("ankle", 3.0, 1.1), Noise(output="theta", size=3e-3, bandwidth=3.0, seed=2), Bias("omega", 2e-2, 0.9),
)  # fmt: skip


GAUSSIAN = (
    Gaussian(input="ankle", size=6.0, corner=2.0, interval=0.05, seed=4, on="body"),
    Gaussian(input="ankle", size=3.0, interval=0.1, seed=5, start=0.33),
    Gaussian(output="theta", size=3e-3, corner=3.0, interval=0.1, seed=6),
    Sampled(input="ankle", values=(0, 0, 2, 4, 1, 1), interval=0.15, start=0.2), Bias("omega", 2e-2, 0.9),
)  # fmt: skip


STEPS = {"timestep": 1e-3, "integrator": "RK4"}


def swinging(law, start, settings: Settings, bends=()) -> Delayed:
    """The same person by hand: I θ'' = mgh sin θ − K θ − B θ' + u + d, by DOP853."""
    real, sources = law.realisation, settings.disturbance
    acting, pushes = make_disturbance(sources, BODY.inputs), make_pushes(settings)
    errors = make_reading_error(sources, BODY.outputs)

    def rate(t, z, v, mode):
        m = real.modes[mode]
        u = -m.K @ z[2:] - m.S @ v + acting(t) + pushes.size(t).sum(axis=-1)
        force = MGH * np.sin(z[0]) - STIFFNESS * z[0] - DAMPING * z[1] + u[0]
        return np.concatenate([[z[1], force / (INERTIA + 1e-6)], m.M @ z[2:] + m.N @ v])

    edges = sorted({*acting.edges, *pushes.size.edges, *errors.edges, *bends})
    guards = tuple((lambda v, g=g: float(v @ g.Q @ v + g.c)) for g in real.guards)
    return Delayed(
        rate, lambda t, z: z[:2] + errors(t), real.taps, np.concatenate([start, np.zeros(real.layout.size)]), guards,
        lambda mode, signs: real.chosen(mode, signs), tuple(edges),
    )  # fmt: skip


def apart(run, oracle) -> float:
    """How far the rows of a run are from an oracle's, relative to the largest of each state."""
    there = np.array([oracle.z(t)[:2] for t in run.t])
    return float((np.abs(run.x - there).max(axis=0) / np.abs(there).max(axis=0)).max())


@pytest.mark.parametrize("law", [CONTINUOUS, HOMOGENEOUS, replace(SWITCHING, dead_zone=0.04), pid(), two_taps()])
@pytest.mark.parametrize("steps", [{"timestep": 1e-3, "integrator": "RK4"}, {"tolerance": 1e-11}])
def test_it_is_what_the_method_of_steps_gives(law, steps) -> None:
    settings = Settings(duration=5.0, record_interval=0.05, **steps)
    run = simulate(person(), law, settings, x0=START)
    oracle = swinging(law, START, settings).run(5.0)
    assert apart(run, oracle) < 2e-10
    assert run.events.t == pytest.approx(oracle.switches, abs=1e-9)
    assert run.outcome.kind == "completed"
    assert run.t[-1] == 5.0
    # what it says of its error is of the order of the error that it has
    assert run.precision["output_error"] < 2e-10


@pytest.mark.slow
@pytest.mark.parametrize("law", [CONTINUOUS, replace(SWITCHING, dead_zone=0.04), pid(), two_taps()])
@pytest.mark.parametrize(
    ("steps", "disturbed"),
    [(STEPS, DISTURBED), ({"tolerance": 1e-10}, DISTURBED), ({"tolerance": 1e-10}, GAUSSIAN)],
)
def test_disturbances_noise_and_pushes_act_on_it(law, steps, disturbed) -> None:
    settings = Settings(duration=3.0, record_interval=0.05, disturbance=disturbed, **steps)
    run = simulate(person(), law, settings, x0=START)
    bends = 0.05 * np.arange(1, 60) if disturbed is GAUSSIAN else ()
    oracle = swinging(law, START, settings, bends).run(3.0)
    assert apart(run, oracle) < 1e-9
    assert run.events.t == pytest.approx(oracle.switches, abs=1e-8)
    assert run.noisy
    assert run.applied == pytest.approx(run.u + make_disturbance(disturbed, BODY.inputs)(run.t))


@pytest.mark.parametrize("law", [CONTINUOUS, pid(), two_taps(), HOMOGENEOUS])
def test_it_is_the_linear_plant_to_third_order_in_the_sway(law) -> None:
    """The body is odd in its angle: what it departs by from its linearisation is of third order."""
    exact, errors = person().linearisation.plant, []
    for size in (0.2, 0.1, 0.05):
        settings = Settings(duration=2.5, record_interval=2.5, tolerance=1e-12)
        run = simulate(person(), law, settings, x0=START * size, error_estimate=False)
        linear = icmj.simulate_plant(exact, law, settings, x0=START * size)
        errors.append(np.abs(run.x[-1] - linear.x[-1]).max())
        assert len(run.events) == len(linear.events)
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes == pytest.approx([3.0, 3.0], abs=0.05)


def test_without_a_dead_zone_a_mirrored_start_gives_the_mirrored_motion() -> None:
    settings = Settings(duration=6.0, timestep=2e-3)
    one, other = (simulate(person(), HOMOGENEOUS, settings, x0=s * START, error_estimate=False) for s in (1, -1))
    assert other.events.t == pytest.approx(one.events.t, abs=1e-12)
    assert other.x == pytest.approx(-one.x, abs=1e-13)


@pytest.mark.parametrize("law", [CONTINUOUS, HOMOGENEOUS, pid()])
def test_fixed_steps_converge_with_their_order(law) -> None:
    fine = simulate(person(), law, Settings(duration=3.0, tolerance=1e-13), x0=START, error_estimate=False)
    errors = []
    for h in (0.01, 0.005, 0.0025):
        settings = Settings(duration=3.0, timestep=h, integrator="RK4")
        run = simulate(person(), law, settings, x0=START, error_estimate=False)
        # of one that switches the times say more: stretches between its jumps are short, and its states soon rounding
        found = (run.events.t, fine.events.t) if law is HOMOGENEOUS else (run.x[-1], fine.x[-1])
        errors.append(np.abs(np.subtract(*found)).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([4.0, 4.0], abs=0.2)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_other_integrators_converge_with_theirs(integrator: str) -> None:
    fine = simulate(person(), SWITCHING, Settings(duration=2.0, tolerance=1e-13), x0=START, error_estimate=False)
    errors = []
    for h in (2e-3, 1e-3):
        settings = Settings(duration=2.0, timestep=h, integrator=integrator)
        run = simulate(person(), SWITCHING, settings, x0=START, error_estimate=False)
        errors.append(np.abs(run.x[-1] - fine.x[-1]).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("law", [CONTINUOUS, HOMOGENEOUS])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_chosen_steps_keep_their_tolerance(law, tolerance: float) -> None:
    settings = Settings(duration=4.0, record_interval=0.05)
    oracle = swinging(law, START, settings).run(4.0)
    run = simulate(person(), law, replace(settings, tolerance=tolerance), x0=START)
    assert apart(run, oracle) < tolerance
    assert run.precision["tolerance"] == tolerance
    assert run.precision["output_error"] < tolerance


@pytest.mark.slow
@pytest.mark.parametrize("steps", [{"timestep": 5e-4, "integrator": "RK4"}, {"tolerance": 1e-9}])
def test_fast_noise_of_torque_and_readings(steps) -> None:
    """Up to 40 Hz: polynomials of a stretch take in three radians of that."""
    fast = (Noise("ankle", 3.0, corner=2.0, seed=5), Noise(output="omega", size=5e-3, corner=2.0, seed=6))
    settings = Settings(duration=1.5, record_interval=0.05, disturbance=fast, **steps)
    law = replace(SWITCHING, dead_zone=0.04)
    run, oracle = simulate(person(), law, settings, x0=START), swinging(law, START, settings).run(1.5)
    assert apart(run, oracle) < 1e-9
    assert run.events.t == pytest.approx(oracle.switches, abs=1e-8)


@pytest.mark.parametrize("steps", [{"timestep": 2.3e-3, "integrator": "RK4"}, {"tolerance": 1e-11}])
def test_rows_are_at_the_multiples_of_their_interval_at_every_break_and_at_the_end(steps) -> None:
    law, settings = replace(SWITCHING, dead_zone=0.04), Settings(duration=5.0, record_interval=0.03, **steps)
    run = simulate(person(), law, settings, x0=START)
    oracle = swinging(law, START, settings).run(5.0)
    # the start is read a delay later, at which the command jumps; that bends the command another delay later, as what
    # a switch does bends it one delay later
    read = np.add(oracle.switches, DELAY)
    breaks = [DELAY, 2 * DELAY, *read[read < 5.0 - 1e-6]]
    expected = np.sort(np.concatenate([0.03 * np.arange(167), breaks, oracle.switches, [5.0]]))
    np.testing.assert_allclose(run.t, expected, atol=1e-8)
    # between steps, too, rows are as exact as the steps: of fourth order from the 2e-10 at 1 ms of the test above
    assert apart(run, oracle) < 2e-10 * 2.3**4


@pytest.mark.parametrize("steps", [{"timestep": 2.3e-3, "integrator": "RK4"}, {"tolerance": 1e-9}])
def test_a_row_where_the_command_jumps_has_the_side_of_the_linear_plant(steps) -> None:
    """A reading's bias is read a delay later, on a row of the grid but for rounding; D on the rate makes it a jump."""
    bias = Bias("omega", 0.02, 0.7)
    settings = Settings(duration=2.0, record_interval=0.1, disturbance=(bias,), **steps)
    run, linear = (of(body, CONTINUOUS, settings, x0=0.01 * START) for of, body in (
        (simulate, person()), (simulate_linear, person().linearisation.plant)))  # fmt: skip
    np.testing.assert_allclose(run.t, linear.t, atol=1e-12)
    jump = float(CONTINUOUS.D[0]) * 0.02
    np.testing.assert_allclose(run.u, linear.u, atol=1e-3 * jump)
    assert run.u[9, 0] - run.u[8, 0] == pytest.approx(-jump, rel=0.1)


def test_rows_events_and_extremes() -> None:
    for steps in ({"timestep": 2e-3}, {"tolerance": 1e-9}):
        run = simulate(person(), SWITCHING, Settings(duration=6.0, record_interval=0.01, **steps), x0=0.1 * START)
        assert (np.diff(run.t) > 0).all()
        # what a switch does is read a delay later, which bends the command
        read = run.events.t + DELAY
        read = read[read < 6.0]
        np.testing.assert_allclose(run.leads[:, 0], [DELAY, 2 * DELAY, *read], atol=1e-12)
        grid = run.t[~np.isin(run.t, [*run.events.t, *run.leads[2:, 0]])]
        np.testing.assert_allclose(grid, 0.01 * np.arange(601), atol=1e-12)
        at = np.searchsorted(run.t, run.events.t)
        assert run.t[at] == pytest.approx(run.events.t, abs=0)
        assert (run.mode[at] != run.mode[at + 1]).all()
        assert run.modes == ("on", "off")
        assert (run.u[run.mode == 1] == 0).all()
        dense = simulate(person(), SWITCHING, Settings(duration=6.0, record_interval=1e-3, **steps), x0=0.1 * START)
        for k, (begin, end) in enumerate(zip([0.0, *run.events.t], run.events.t, strict=False)):
            inside = dense.y[(dense.t >= begin - 1e-9) & (dense.t <= end + 1e-9)]
            assert run.events.y_max[k] == pytest.approx(inside.max(axis=0), abs=1e-8)
            assert run.events.y_min[k] == pytest.approx(inside.min(axis=0), abs=1e-8)
        assert run.x_o.shape == run.x_h.shape == (len(run.t), 0)
        assert run.qpos.shape == (len(run.t), 1)
        assert run.events.x_o.shape == (len(run.events), 0)


def test_it_falls_and_can_be_interrupted() -> None:
    weak = replace(CONTINUOUS, P=0.0, D=0.0)
    fallen = simulate(person(), weak, Settings(duration=60.0, timestep=2e-3), x0=START)
    assert fallen.outcome.kind == "fell"
    assert abs(fallen.x[-1, 0]) == pytest.approx(1.0, abs=5e-3)
    assert len(fallen.u) == len(fallen.t)

    def stop(done: float) -> None:
        if done > 0.4:
            raise KeyboardInterrupt

    whole = simulate(person(), CONTINUOUS, Settings(duration=20.0), x0=START)
    part = simulate(person(), CONTINUOUS, Settings(duration=20.0), x0=START, progress=stop)
    assert part.outcome.kind == "interrupted"
    assert 7.5 < part.t[-1] < 8.5
    assert (part.x[:-1] == whole.x[: len(part.t) - 1]).all()


def test_inputs_and_outputs_are_matched_by_name_and_what_does_not_fit_is_refused() -> None:
    settings = Settings(duration=2.0, tolerance=1e-9)
    one = icmj.simulate_plant(person(), SWITCHING, settings, x0=START)
    other = icmj.simulate_plant(person(True), SWITCHING, settings, x0=START)
    assert other.x[-1] == pytest.approx(one.x[-1], abs=1e-12)
    assert one.control == "switching"
    with pytest.raises(SimulationError, match="neither observer nor hold"):
        icmj.simulate_plant(person(), SWITCHING, settings, x0=START, x_h0=START)
    small = replace(BODY, C=BODY.C[:1], outputs=("theta",), output_units=("",))
    with pytest.raises(SimulationError, match="must agree"):
        simulate(person(), replace(pid(), model=small), settings)


def test_a_run_before_or_after_leaves_no_trace() -> None:
    """The model is the loop's own, and what the callbacks read is put back."""
    settings = Settings(duration=2.0, timestep=2e-3)
    one, two = (simulate(person(), SWITCHING, settings, x0=START) for _ in range(2))
    assert (one.x == two.x).all()
    assert (one.events.t == two.events.t).all()


def test_from_rest_a_guard_that_is_zero_throughout_the_delay_does_not_change() -> None:
    """See the test of the same name of the linear plant."""
    law, settings = replace(HOMOGENEOUS, slope=0.0), Settings(duration=3.0, record_interval=0.05)
    run = simulate(person(), law, settings, x0=[1e-4, 0.0])
    linear = simulate_linear(BODY, law, settings, x0=[1e-4, 0.0])
    assert run.events.t[0] == pytest.approx(0.2, abs=1e-9)
    np.testing.assert_allclose(run.events.t, linear.events.t, atol=1e-6)


def test_a_gain_that_the_controller_does_not_know_acts() -> None:
    settings = Settings(duration=3.0, tolerance=1e-10)
    run = simulate(person(gain=0.8), CONTINUOUS, settings, x0=START)
    P, D = 0.8 * CONTINUOUS.P, 0.8 * CONTINUOUS.D  # the same as four fifths of the gains
    same = simulate(person(), replace(CONTINUOUS, P=P, D=D), settings, x0=START)
    assert run.x[-1] == pytest.approx(same.x[-1], abs=1e-9)
    assert run.u[-1] == pytest.approx(same.u[-1] / 0.8, abs=1e-5)


def test_delay_of_the_first_command() -> None:
    """Until the delay has gone by the command is what the start makes it."""
    run = simulate(person(), CONTINUOUS, Settings(duration=1.0, timestep=1e-3), x0=START)
    early = run.t <= DELAY
    expected = -CONTINUOUS.realisation.modes[0].S @ START
    assert run.u[early] == pytest.approx(np.tile(expected, (early.sum(), 1)), rel=1e-12)


def test_several_inputs_and_two_taps_on_the_three_link_body() -> None:
    """A state, two modes, a line between readings of two ages: third order in the sway, and second in switching."""
    from engine_cases import plant

    body, random = plant("three_link"), np.random.default_rng(0)
    M, N, K, S = -3 * np.eye(3), *(random.standard_normal(shape) for shape in ((3, 6), (3, 3), (3, 6)))
    modes = Mode("on", M, N, 20 * K, 50 * S), Mode("off", M, 0 * N, 20 * K, 0 * S)
    line = Guard(np.diag([1.0, 0, 0, -1.0, 0, 0]))
    law = Tapped(body.linearisation.plant, modes, (0.1, 0.17), (line,), np.array([[0, 1], [0, 1]]))
    errors, lags = [], []
    for size in (0.01, 0.005):
        settings = Settings(duration=0.9, tolerance=1e-12, limit=10.0)
        start = size * np.array([1, -1, 0.5, 0, 0, 0])
        run = simulate(body, law, settings, x0=start, error_estimate=False)
        linear = icmj.simulate_plant(body.linearisation.plant, law, settings, x0=start)
        errors.append(np.abs(run.x[-1] - linear.x[-1]).max())
        lags.append(np.abs(run.events.t - linear.events.t).max())
        assert len(run.events) == len(linear.events) == 1
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.2)
    assert np.log2(lags[0] / lags[1]) == pytest.approx(2.0, abs=0.05)


def test_a_body_on_a_floor_gets_its_pressure() -> None:
    """Contacts: fixed steps, whole passes, and the ground's reaction to a command that no observer makes."""
    from engine_cases import plant

    body = plant("three_link_floor")
    linear = body.linearisation.plant
    n_u, n_y = linear.n_u, linear.n_y
    none = np.zeros((0, 0)), np.zeros((0, n_y)), np.zeros((n_u, 0))
    law = Tapped(linear, (Mode("on", *none, 10.0 * np.eye(n_u, n_y)),), (0.05,))
    run = icmj.simulate_plant(body, law, Settings(duration=0.2))
    assert run.outcome.kind == "completed"
    assert run.pressure is not None
    assert np.isfinite(run.pressure.centre).all()


@pytest.mark.parametrize("more", [1e-4, 0.004, 0.03, 0.2])
@pytest.mark.parametrize("law", [pid(), SWITCHING], ids=["delayed", "switched"])
@pytest.mark.parametrize(("steps", "near"), [(STEPS, 2e-3), ({"tolerance": 1e-9}, 1e-2)], ids=["given", "chosen"])
def test_a_fall_within_the_last_stretch_is_where_it_is_in_a_longer_run(law, steps, near, more) -> None:
    """Where a stretch is to end changes neither when it falls, to a step or sample, nor that the last row shows it."""
    settings = Settings(duration=5.0, limit=0.12, disturbance=(Step("ankle", 80.0, 0.05),), **steps)
    whole = simulate(person(), law, settings, x0=START, error_estimate=False)
    assert whole.outcome.kind == "fell"
    late = whole.outcome.t + more
    run = simulate(person(), law, replace(settings, duration=late), x0=START, error_estimate=False)
    assert run.outcome.kind == "fell"
    assert run.outcome.t == run.t[-1] == pytest.approx(whole.outcome.t, abs=near)
    assert 0.12 <= np.abs(run.x[-1, 0]) < 0.12 + 1.5 * near
