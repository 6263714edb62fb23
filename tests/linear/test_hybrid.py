"""Any hybrid controller on the linear plant: against DOP853 with every instant carried out, and the event loop."""

from dataclasses import replace

import numpy as np
import pytest
from hybrid_cases import FOLDER, NAMES, RAMPS, START, Bare, Given, Ramp, body, law, plant, weak
from oracles.hybrid import Hybrid
from scipy.linalg import expm

import icmj
from icmj.case.plants import linear_plant
from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Realisation, parallel
from icmj.errors import AnalysisError, SimulationError
from icmj.linear.run import simulate_tapped
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Gaussian, Step
from icmj.simulation.start import start_states


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("name", NAMES)
def test_a_controller_of_ones_own_is_what_an_integrator_gives(name) -> None:
    own, there = law(name), weak()
    run = simulate_tapped(there, own, Settings(duration=4.0, record_interval=0.05), x0=START)
    oracle = Hybrid(there, own.realisation, START).run(4.0)
    assert run.events.t == pytest.approx(oracle.events, abs=3e-9 if name == "reflex" else 1e-10)
    assert len(run.events) == {"plain-pd": 0, "hysteresis": 12, "reflex": 3, "alert": 15, "saturating": 15}[name]
    states = np.array([oracle.x(t) for t in run.t])
    np.testing.assert_allclose(run.x, states, atol=3e-9 * np.abs(states).max(), rtol=0)


def test_plain_pd_is_a_matrix_exponential() -> None:
    own, there = law("plain-pd"), plant()
    closed = there.A - there.B @ np.array([[900.0, 300.0]]) @ there.C
    run = icmj.simulate_plant(there, own, Settings(duration=3.0, record_interval=0.25), x0=START)
    np.testing.assert_allclose(run.x, [expm(closed * t) @ START for t in run.t], atol=1e-14)
    roots = icmj.theory.rightmost_roots(icmj.theory.delay_loop(there, own))
    np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(np.linalg.eigvals(closed)), rtol=1e-12)


@pytest.mark.parametrize("name", ["alert", "hysteresis"])
def test_memory_is_a_mode(name) -> None:
    run = simulate_tapped(weak(), law(name), Settings(duration=6.0, record_interval=0.01), x0=START)
    changes = np.diff(run.mode)
    if name == "alert":  # from the step of the set-point on, until s = size e^{−t/T} has fallen to the level
        up, down = run.t[np.flatnonzero(changes > 0)], run.t[np.flatnonzero(changes < 0)]
        assert up == pytest.approx([1.5], abs=0.011)
        assert down == pytest.approx([1.5 + np.log(0.02 / 0.002)], abs=0.011)
    else:  # what fires is spent; an error beyond the alarm fires out of that, and leaves the rule armed
        fired = np.searchsorted(run.t, run.events.t)
        assert ((run.mode[fired] == 0) == (run.mode[fired + 1] == 1)).all()
        assert 0 < (run.mode[fired] == 1).sum() < len(fired) / 2


RULES = ("rule", "box", "clock", "sampled", "undelayed", "setpoint")


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("acted", [False, True])
def test_the_intermittent_controller_is_what_the_event_loop_gives(rule, acted) -> None:
    changes = {
        "rule": {},
        "box": {"controller.rule": "box", "controller.q_t": None, "controller.threshold": 0.002},
        "clock": {},
        "sampled": {"controller.sampling_delay": 0.05},
        "undelayed": {"assumed.delay": 0.0, "controller.delta_min": 0.05},
        "setpoint": {"setpoint": [{"kind": "step", "output": "lean", "size": 0.01, "start": 1.3}]},
    }[rule]
    run = icmj.load_run("runs/rivals/one-link-event.toml").with_(**changes, **{"simulation.duration": 8.0})
    case = icmj.prepare(run)
    if rule == "clock":
        case = replace(case, controller=case.controller.triggered_by(icmj.ClockTrigger(0.13)))
    beside = (
        Step("ankle_torque", 0.5, 2.1),
        Gaussian(input="ankle_torque", size=0.5, seed=3, interval=0.1),
        Bias("lean", 0.0005, 3.3),
    )
    settings = replace(case.settings, disturbance=beside if acted else ())
    there = linear_plant(case.actual, settings)
    x, a = start_states(there, case.controller, settings, None, None, None)
    one = icmj.simulate_plant(there, case.controller, settings)
    other = simulate_tapped(there, Bare(case.controller), settings, x0=x, a0=a)
    assert len(one.events) >= 15
    assert other.events.t == pytest.approx(one.events.t, abs=1e-10)
    assert np.abs(other.events.x - one.events.x).max() <= 1e-9 * np.abs(one.x).max()
    # what is right before actions and edges, of which the other has rows of its own
    row, n_u = np.searchsorted(other.t, other.events.t), one.u.shape[1]
    known = np.column_stack([other.events.t, other.u[row]])  # an action there comes after it
    if other.leads.size:
        known = np.vstack([known, other.leads[:, : 1 + n_u]])
    assert len(one.leads) >= (15 if case.controller.delay.t_d else 1 if acted else 0)
    for t, *left in one.leads[one.leads[:, 0] < one.t[-1]] if one.leads.size else ():
        nearest = int(np.abs(known[:, 0] - t).argmin())
        assert abs(known[nearest, 0] - t) < 1e-9
        np.testing.assert_allclose(left[:n_u], known[nearest, 1:], atol=1e-8 * np.abs(one.u).max())
    size = np.abs(one.events.y_max).max()
    assert np.abs(other.events.y_max - one.events.y_max).max() <= 1e-9 * size
    assert np.abs(other.events.y_min - one.events.y_min).max() <= 1e-9 * size


@pytest.mark.parametrize("name", RAMPS)
@pytest.mark.parametrize("taps", [(0.1,), (0.0,), (0.0, 0.1)])
def test_what_falls_on_one_instant_has_an_order(name, taps) -> None:
    """Events that are known by hand, on both plants, whatever the controller reads."""
    numbers, events = RAMPS[name]
    own = Ramp(plant(), taps, **numbers)
    for there in (plant(), body()):
        run = icmj.simulate_plant(there, own, Settings(duration=6.0, record_interval=0.1), x0=START)
        assert run.events.t == pytest.approx(events, abs=1e-9 if there is body() else 1e-12), there
        # right after an event, whose row has the command before it, nothing but the ramp has changed
        inside = run.events.t < 6.0 - 1e-6
        assert run.jumps[:, 0] == pytest.approx(run.events.t[inside], abs=0)
        before = run.u[np.searchsorted(run.t, run.jumps[:, 0])]
        least = {"clock": 0.75, "sampling": 1.3}
        reached = next((least[key] for key in least if key in numbers), 1.0)
        if name not in ("a rule beyond when its least time ends", "a delay longer than the interval"):
            expected = 10 * reached * (1 - numbers.get("keep", 0.0))
            np.testing.assert_allclose(run.jumps[:, 1:] - before, expected, atol=1e-6)


@pytest.mark.parametrize("there", ["linear", "mujoco"])
def test_a_piece_that_ends_soon_after_an_event_is_as_exact_as_others(there, tmp_path) -> None:
    """An event at 0.9 s, and an edge 2.37 ms later: there is no row between, or one. A log tells it as the run does."""
    run = icmj.load_run(FOLDER / "alert.toml", allow_code=True)
    edge = {"kind": "step", "input": "ankle_torque", "size": 1.0, "start": 0.90237}
    changes = {"assumed.delay": 0.15, "simulation.duration": 1.2, "simulation.disturbance": [edge]}
    series = []
    for interval in (0.002, 0.0002):
        given = run.with_(**changes, **{"simulation.record_interval": interval})
        result = icmj.run_case(given, there)
        series.append(result.simulation.to_series(1000.0)["u.ankle_torque"])
        icmj.write_log(result, tmp_path / "alert.rrd")
        read = icmj.read_log(tmp_path / "alert.rrd").simulation
        np.testing.assert_array_equal(read.to_series(1000.0)["u.ankle_torque"], series[-1])
    np.testing.assert_allclose(*series, atol=1e-4 * np.abs(series[1]).max())


@pytest.mark.parametrize("there", ["linear", "mujoco"])
def test_both_sides_are_known_of_actions_edges_and_what_is_read_of_them(there) -> None:
    """What the rows before tell, by a parabola through three of them; and there is a jump where the delay ends."""
    run = icmj.load_run(FOLDER / "reflex.toml", allow_code=True)
    edge = {"kind": "step", "input": "ankle_torque", "size": 1.0, "start": 0.90237}
    changes = {"assumed.delay": 0.06, "simulation.duration": 1.2, "simulation.disturbance": [edge]}
    given = run.with_(**changes, **{"simulation.record_interval": 0.0002, "simulation.timestep": None})
    found = icmj.simulate(icmj.prepare(given), there)
    late, breaks = 0.05, np.unique(np.concatenate([found.actions, found.edges, found.actions + 0.05]))
    assert len(found.events) > 2
    assert np.abs(found.leads[:, 0] - breaks[breaks < 1.2][:, None]).min(axis=1).max() < 1e-12
    others, fewer = np.sort(np.append(found.leads[:, 0], found.events.t)), 0
    for t, *left in found.leads:
        at = int(np.searchsorted(found.t, t))
        if ((others > found.t[at - 3]) & (others < t)).any():
            fewer += 1
            continue
        before = np.column_stack([of for of in (found.u, found.applied, found.pushed) if of.size])[at - 3 : at]
        told = np.polynomial.polynomial.polyfit(found.t[at - 3 : at] - t, before, 2)[0]
        np.testing.assert_allclose(left, told, atol=1e-6 * np.abs(found.u).max())
    assert fewer < len(found.leads) / 4
    jumped = np.isin(found.leads[:, 0], found.actions[1:])
    row = np.searchsorted(found.t, found.leads[:, 0])
    step = np.abs(found.u[row] - found.leads[:, 1:2])[:, 0]
    assert jumped.sum() == len(found.actions[found.actions < 1.2]) - 1
    assert step[jumped].min() > 1e-3 * np.abs(found.u).max()
    read = np.abs(found.leads[:, :1] - (found.actions + late)).min(axis=1) < 1e-12
    assert step[read].max() < 1e-9 * np.abs(found.u).max()


@pytest.mark.parametrize("there", ["linear", "mujoco"])
def test_an_event_on_an_edge_tells_what_is_before_both(there) -> None:
    """Ticks and steps of the torque at multiples of 0.75 s: the row is after the step and before the tick's command."""
    own = Ramp(plant(), (0.0, 0.1), clock=0.75)
    steps = tuple(Step("ankle_torque", 2.0, 0.75 * tick) for tick in (1, 2, 3))
    settings = Settings(duration=2.6, record_interval=0.04, disturbance=steps, tolerance=1e-9)
    body_ = plant() if there == "linear" else body()
    found = icmj.simulate_plant(body_, own, settings, x0=START)
    fine = icmj.simulate_plant(body_, own, replace(settings, record_interval=1e-3), x0=START)
    assert found.events.t == pytest.approx([0.75, 1.5, 2.25], abs=1e-9)
    at = np.searchsorted(found.leads[:, 0], found.events.t - 1e-9)
    assert found.leads[at, 0] == pytest.approx(found.events.t, abs=1e-12)
    row = np.searchsorted(found.t, found.events.t)
    np.testing.assert_allclose(found.leads[at, 1:2], found.u[row], atol=1e-12)
    np.testing.assert_allclose(found.pushed[row] - found.leads[at, -1:], 2.0, atol=1e-9)
    one, other = (run.to_series(1000.0) for run in (found, fine))
    short = np.abs(one.t[:, None] - found.events.t + 0.02).min(axis=1) < 0.02  # the rows before each
    for name in ("u.ankle_torque", "push.ankle_torque"):
        np.testing.assert_allclose(one[name][short], other[name][short], atol=1e-6 * np.abs(other[name]).max())


@pytest.mark.parametrize("name", NAMES)
def test_noise_that_is_a_share_of_the_command_is_refused(name) -> None:
    share = Settings(duration=1.0, disturbance=(Gaussian(input="ankle_torque", share=0.1, interval=0.1),))
    for there in (plant(), body()):
        with pytest.raises(SimulationError, match="needs commands that follow from a hold"):
            icmj.simulate_plant(there, law(name), share)


@pytest.mark.parametrize("name", NAMES)
def test_between_rows_a_series_keeps_the_side_of_an_action(name) -> None:
    runs = [
        simulate_tapped(weak(), law(name), Settings(duration=4.0, record_interval=every), x0=START)
        for every in (0.01, 0.003)
    ]
    between = runs[0].to_series(1 / 0.003)
    at = np.searchsorted(runs[1].t, between.t - 1e-9)
    there = np.abs(runs[1].t[at] - between.t) < 1e-9
    assert there.all()
    # a spline goes round the corner where a command leaves its limit
    bound = (3e-2 if name == "saturating" else 5e-3) * np.abs(runs[1].u).max()
    assert np.abs(between["u.ankle_torque"] - runs[1].u[at, 0]).max() < bound


def test_rows_change_no_bit_of_it() -> None:
    runs = [
        simulate_tapped(weak(), law("hysteresis"), Settings(duration=4.0, record_interval=every), x0=START)
        for every in (0.01, 0.37)
    ]
    for name in ("t", "x", "y_max", "y_min"):
        assert np.array_equal(getattr(runs[0].events, name), getattr(runs[1].events, name))


@pytest.mark.parametrize("seed", range(6))
def test_a_sum_moves_as_its_parts_command_together(seed) -> None:
    """Parts that are linear and without events: u of the sum is the sum, so the loop is known by its matrices."""
    random = np.random.default_rng(seed)
    there = plant()

    def part(size: int, tap: float):
        M = random.standard_normal((size, size)) - 2 * np.eye(size)
        mode = Mode("on", M, random.standard_normal((size, 2)), 30 * random.standard_normal((1, size)),
                    np.array([[600.0, 200.0]]))  # fmt: skip
        real = law("plain-pd").realisation
        own, none = replace(real.layout, names=("a",), sizes=(size,)), np.zeros((0, size))
        return replace(real, layout=own, modes=(mode,), J=np.eye(size), G=np.eye(size), R=none, taps=(tap,))

    one, other = part(2, 0.0), part(1, 0.07)
    both = parallel(one, other, 2)
    assert both.taps == (0.0, 0.07)
    sum_ = replace(law("plain-pd"))
    object.__setattr__(sum_, "realisation", both)
    run = simulate_tapped(there, sum_, Settings(duration=2.0, record_interval=0.1, limit=1e3), x0=START)

    oracle = Hybrid(there, both, START, longest=0.01)
    first, second = one.modes[0], other.modes[0]

    def rate(t, z, begin, end):
        t = min(max(t, begin), end)
        x, a, b = z[:2], z[2:4], z[4:]
        late = there.C @ oracle.x(t - 0.07)
        u = -first.K @ a - first.S @ (there.C @ x) - second.K @ b - second.S @ late
        return np.concatenate([
            there.A @ x + there.B @ u, first.M @ a + first.N @ (there.C @ x), second.M @ b + second.N @ late,
        ])  # fmt: skip

    oracle.rate = rate
    oracle.run(2.0)
    states = np.array([oracle.x(t) for t in run.t])
    np.testing.assert_allclose(run.x, states, atol=1e-10 * np.abs(states).max(), rtol=0)


def test_what_does_not_fit_is_refused() -> None:
    real = law("hysteresis").realisation
    with pytest.raises(AnalysisError, match="only one of the two can"):
        parallel(real, real, 2)
    with pytest.raises(AnalysisError, match="the matrix of a guard has the shape"):
        replace(real, guards=(*real.guards[:1], Guard(np.eye(3))))
    two = tuple(replace(mode, K=np.zeros((2, 6)), S=np.zeros((2, 2))) for mode in real.modes)
    stiff = tuple(replace(mode, M=1e20 * mode.M) for mode in real.modes)
    for wrong, words in (
        (None, "the realisation of the given controller is None"),
        (replace(real, modes=two), "mode 'armed' of the given controller has S of shape"),
        (replace(real, signals=np.zeros((1, 6))), "enters through reading 0"),
        (replace(real, modes=stiff), "up to 1e\\+13 rad/s can be simulated"),
    ):
        for there in (plant(), body()):
            with pytest.raises(SimulationError, match=words):
                icmj.simulate_plant(there, Given(plant(), wrong), Settings(duration=1.0))


@pytest.mark.parametrize("there", [plant, body])
def test_a_controller_whose_state_grows_beyond_bounds_is_an_end(there) -> None:
    """Its modes have a rate of +10⁴/s, and the rest of the loop follows no faster than that: e^27 is 10^12."""
    real = law("hysteresis").realisation
    modes = tuple(replace(mode, M=mode.M + 1e4 * np.eye(6)) for mode in real.modes)
    run = icmj.simulate_plant(there(), Given(plant(), replace(real, modes=modes)), Settings(duration=1.0), x0=START)
    assert run.outcome.kind == "diverged"
    assert run.outcome.t < 0.01


def test_modes_that_switch_without_an_end_stop_the_run() -> None:
    """A relay whose sign makes it grow on either side: where it switches, time does not advance."""
    n_y, one = plant().n_y, np.eye(1)
    grow, fall = (
        Mode(name, np.zeros((1, 1)), np.zeros((1, n_y + 1)), np.zeros((1, 1)), np.zeros((1, n_y + 1)))
        for name in ("grow", "fall")
    )
    grow.N[0, -1], fall.N[0, -1] = 1.0, -1.0
    Q = np.zeros((n_y + 2, n_y + 2))
    Q[-1, -1] = 1.0
    sliding = Realisation(
        Layout.of(a=1), (grow, fall), one, one, np.zeros((0, 1)), np.zeros(1, dtype=int), guards=(Guard(Q, -1.0),),
        table=np.array([[0, 1], [0, 1]]), signals=np.array([[0, 1.0, 0, 0, 0, np.inf]]), clock=10.0,
    )  # fmt: skip
    for there in (plant(), body()):
        run = icmj.simulate_plant(there, Given(plant(), sliding), Settings(duration=3.0), x0=0 * START)
        assert run.outcome.kind == "stalled", there
        assert run.outcome.t == pytest.approx(1.0, abs=1e-3)
        assert "switch to and fro" in run.outcome.message


@pytest.mark.parametrize("off", [-9e-13, -1e-13, 0.0, 1e-15, 1e-13, 9e-13, 1e-11])
def test_a_switch_comes_after_what_acts_at_its_instant(off) -> None:
    """A state that grows by 1/s would switch at 0.5 s; an impulse there takes it back, and then nothing switches."""
    size = np.eye(1)
    N = np.array([[0.0, 0.0, 1.0]])
    modes = tuple(Mode(name, 0 * size, N, 0 * size, np.zeros((1, 3))) for name in "pq")
    Q = np.zeros((4, 4))
    Q[3, 3] = 1.0
    signals = np.array([[0, 1.0, 0, 0, 0, np.inf], [0, -0.3, 0, 0, 0.5 + off, 0.5 + off]])
    own = Realisation(
        Layout.of(a=1), modes, size, size, np.zeros((0, 1)), np.zeros(1, dtype=int), taps=(5.0,),
        guards=(Guard(Q, -0.25),), table=np.array([[0, 1], [0, 1]]), signals=signals,
    )  # fmt: skip
    for there in (plant(), body()):
        run = icmj.simulate_plant(there, Given(plant(), own), Settings(duration=0.6, limit=100.0), x0=0 * START)
        assert len(run.events.t) == (2 if off == 1e-11 else 0), there


@pytest.mark.parametrize("edge", [False, True])
@pytest.mark.parametrize("rule", ["clock", "threshold"])
@pytest.mark.parametrize("duration", [0.5, 0.75])
@pytest.mark.parametrize("off", [-1e-13, 0.0, 1e-13])
def test_a_fall_comes_after_what_is_due_at_its_instant(off, duration, rule, edge) -> None:
    """A body that moves at 2 rad/s falls at 0.5 s, where the clock ticks or a state that grows by 1/s is at its face.

    Whether the run ends there, too, or a disturbance begins, changes neither.
    """
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    free = icmj.LinearPlant(A, B, np.eye(2), plant().outputs, plant().inputs, plant().states)
    size = np.eye(1)
    grow = Mode("grow", 0 * size, np.array([[0.0, 0.0, 1.0]]), 0 * size, np.zeros((1, 3)))
    faces = {"clock": (np.zeros((0, 1)), np.zeros(1, dtype=int)), "threshold": (2 * size, np.array([0, 1]))}[rule]
    own = Realisation(
        Layout.of(a=1), (grow,), 0 * size, size, *faces, clock=0.5 if rule == "clock" else np.inf,
        signals=np.array([[0, 1.0, 0, 0, 0, np.inf]]),
    )  # fmt: skip
    acts = (Step(free.inputs[0], 0.1, 0.5),) if edge else ()
    settings = Settings(duration=duration, limit=1.0 + off, disturbance=acts)
    run = simulate_tapped(free, Given(free, own), settings, x0=np.array([0.0, 2.0]))
    assert run.events.t == pytest.approx([0.5], abs=1e-12)
    late = off > 0 and duration == 0.5  # a limit that is not reached by the end
    assert run.outcome.kind == ("completed" if late else "fell")
    assert run.t[-1] == run.outcome.t == pytest.approx(0.5, abs=1e-12)
