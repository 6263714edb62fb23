"""What a motion is, on sequences of events that are known by construction and on simulated loops."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, neglected, pendulum_design, settings
from scipy.linalg import expm

from icmj import ClockTrigger, Controller, error_system, load_run, prepare, system_matched
from icmj.case.case import simulate as simulate_case
from icmj.linear.run import simulate
from icmj.measurement.measurement import growth_per_interval, measure, measured_gamma, reduced_states
from icmj.simulation.ending import Outcome
from icmj.simulation.simulation import Events, Simulation

T_HAT = np.eye(2)


def motion(states, intervals, *, after=0.0, control="event", outcome="completed"):
    """A run with these states x̄ = (x, x_o − x), shape (K, 4), at events this far apart."""
    states, intervals = np.asarray(states, float), np.asarray(intervals, float)
    t = np.cumsum(intervals)
    K = len(t)
    end = (t[-1] if K else 10.0) + after
    x, x_o = states[:, :2], states[:, 2:] + states[:, :2]
    samples = np.array([0.0, end])
    none = np.zeros((2, 2))
    return Simulation(
        plant="linear", control=control, t=samples, x=none, y=np.array([[0.5], [-0.25]]), u=np.zeros((2, 1)),
        x_o=none, x_h=none, E=np.zeros(2), outcome=Outcome(outcome, end, outcome),
        events=Events(t, x, x_o, x_o, y_max=x[:, :1] + 0.1, y_min=x[:, :1] - 0.1),
    )  # fmt: skip


def periodic(p, K=100, sign=1, noise=0.0, seed=0):
    """States and intervals of period p (mirrored after p of 2p if ``sign`` is −1)."""
    random = np.random.default_rng(seed)
    base, rhythm = random.standard_normal((p, 4)), random.uniform(0.5, 1.5, p)
    turn = np.arange(K) // p
    states = base[np.arange(K) % p] * np.where(turn % 2 == 1, sign, 1)[:, None]
    return states + noise * random.standard_normal((K, 4)), rhythm[np.arange(K) % p]


@pytest.mark.parametrize("p", range(1, 9))
@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_cycles_of_every_period(p, noise):
    states, intervals = periodic(p, noise=noise, seed=p)
    found = measure(motion(states, intervals), T_hat=T_HAT)
    assert (found.kind, found.p, found.mirrored) == ("cycle", p, False)
    assert found.period == pytest.approx(intervals[:p].sum())
    assert found.interval == pytest.approx(intervals[:p].mean())
    assert sorted(found.intervals) == pytest.approx(sorted(intervals[:p]))
    last = np.abs(states[-p:, 0])
    assert found.amplitude == pytest.approx([last.max() + 0.1], abs=1e-12)
    assert found.residual <= 1e-14 if noise == 0 else 1e-11 < found.residual < 1e-7


@pytest.mark.parametrize("half", range(1, 5))
def test_mirrored_cycles(half):
    found = measure(motion(*periodic(half, sign=-1, seed=half)), T_hat=T_HAT)
    assert (found.kind, found.p, found.mirrored) == ("cycle", 2 * half, True)
    assert "mirrored" in found.words


@pytest.mark.parametrize("p", [9, 10, 18, 40, 56, 65])
def test_cycles_of_many_events(p):
    """Approached at any rate, seen three times, with rounding: p, period and mean interval of whole periods."""
    for seed, rate in enumerate((0.0, 0.2, 0.8, -0.5, -0.9)):
        K = 3 * p + (int(p * np.log(1e-10) / np.log(abs(rate))) if rate else 0) + seed
        states, intervals = periodic(p, K=K, noise=1e-12, seed=seed)
        turn, direction = np.arange(K) // p, np.random.default_rng(seed).standard_normal((2, p, 4))
        states = states + 0.1 * rate ** turn[:, None] * direction[0][np.arange(K) % p]
        found = measure(motion(states, intervals), T_hat=T_HAT)
        assert (found.kind, found.p, found.mirrored) == ("cycle", p, False)
        assert found.period == pytest.approx(intervals[:p].sum(), rel=1e-12)
        assert found.interval == pytest.approx(intervals[:p].mean(), rel=1e-12)
        longer = measure(motion(*periodic(p, K=4 * p, sign=-1, seed=seed)), T_hat=T_HAT)
        assert (longer.kind, longer.p) == ("too short", None)  # the mirrored one of 2p is seen twice
        longer = measure(motion(*periodic(p, K=6 * p, sign=-1, seed=seed)), T_hat=T_HAT)
        assert (longer.kind, longer.p, longer.mirrored) == ("cycle", 2 * p, True)
    assert measure(motion(states, intervals), T_hat=T_HAT, max_period=p - 1).kind != "cycle"


@pytest.mark.parametrize("p", [10, 28])
@pytest.mark.parametrize("rate", [0.9, -0.95])
def test_a_long_cycle_still_being_approached_is_named(p, rate):
    turn = np.arange(12 * p) // p
    states, intervals = periodic(p, K=12 * p, seed=p)
    states = states + 2e-3 * rate ** turn[:, None]
    found = measure(motion(states, intervals), T_hat=T_HAT)
    assert found.kind == "too short"
    assert f"approaching a period-{p} cycle" in found.words


@pytest.mark.parametrize(("gain", "p", "period"), [(2.13, 10, 6.007258), (2.02, 18, 10.005183), (2.06, 40, 24.408809)])
def test_long_cycles_of_a_simulated_case(gain, p, period, root):
    """Against periods that Newton's method found."""
    run = load_run(root / "runs" / "simple-1.7.toml").with_(**{"actual.gain": gain, "simulation.duration": 600.0})
    found = measure(simulate_case(prepare(run), "linear"), T_hat=T_HAT)
    assert (found.kind, found.p) == ("cycle", p)
    assert found.period == pytest.approx(period, abs=5e-7)
    assert found.interval == pytest.approx(period / p, abs=5e-7)


def circle_maps(count, K, seed):
    """Motions θ ↦ θ + Ω + k/2π sin 2πθ near resonances, on random closed curves; those that are not locked."""
    random = np.random.default_rng(seed)
    q = random.integers(1, 9, count)
    omega = random.integers(1, q + 1) / q + random.choice((-1, 1), count) * 10 ** random.uniform(-4, -1.5, count)
    k = random.choice((0.0, 1.0), count) * random.uniform(0, 0.95, count)
    angle, angles = random.uniform(0, 1, count), []
    for _ in range(1000 + K + 20_000):
        angles.append(angle)
        angle = angle + omega + k / (2 * np.pi) * np.sin(2 * np.pi * angle)
    far = np.log(1 + k * np.cos(2 * np.pi * np.array(angles[-10_000:]))).mean(axis=0)  # Lyapunov exponent
    for of in np.flatnonzero(far > -1e-5):
        phase = 2 * np.pi * np.array(angles[1000 : 1000 + K])[:, of, None] * [1, 2, 3]
        a, b = random.standard_normal((2, 4, 3)) / [1, 2, 3]
        yield np.cos(phase) @ a.T + np.sin(phase) @ b.T, 1 + 0.2 * np.cos(phase[:, 0])


@pytest.mark.parametrize("count", [60, pytest.param(600, marks=pytest.mark.slow)])
def test_quasi_periodic_motions_near_a_resonance_are_seldom_said_to_approach_a_cycle(count):
    """At most 2 % of them; with as many, two standard deviations of the binomial distribution more."""
    motions = list(circle_maps(count, 400, count))
    found = [measure(motion(*one), T_hat=T_HAT) for one in motions]
    assert not any(one.kind == "cycle" for one in found)
    wrong = sum("a cycle" in one.words or "approaching" in one.words or "leaves" in one.words for one in found)
    assert wrong <= 0.02 * len(found) + 2 * np.sqrt(0.02 * len(found))
    for one, (_, intervals) in zip(found, motions, strict=True):
        if one.kind == "quasi-periodic":
            assert one.interval == pytest.approx(intervals[200:].mean(), rel=1e-12)


@pytest.mark.parametrize("rate", [0.5, 0.9, 0.99, -0.97])
def test_a_cycle_still_being_approached_is_not_settled(rate):
    """Convergence to a period-1 cycle: a cycle exactly if what is left of the way is below the tolerance."""
    for K in (30, 60, 200, 600, 2500):
        states = np.array([1.0, 0.3, -0.2, 0.5]) + 0.1 * rate ** np.arange(K)[:, None] * [1, 2, 0, 1]
        found = measure(motion(states, np.ones(K)), T_hat=T_HAT)
        left = 0.1 * abs(rate) ** (K - 1) * np.sqrt(6)
        if left < 1e-7:
            assert (found.kind, found.p) == ("cycle", 1)
        if left > 1e-5:
            assert found.kind == "too short"
            assert "approaching a period-1 cycle" in found.words


def test_leaving_a_cycle_is_not_a_cycle():
    grow = 1e-9 * 1.2 ** np.arange(40)[:, None]
    states = np.array([1.0, 0.3, -0.2, 0.5]) + grow * [1, 0, 0, 1]
    found = measure(motion(states, np.ones(40)), T_hat=T_HAT)
    assert found.kind == "too short"
    assert "leaves" in found.words


def test_growth_and_decay_under_the_clock():
    for rate, kind in ((1.05, "growth"), (0.95, "decay"), (-1.05, "growth")):
        states = rate ** np.arange(60.0)[:, None] * [1, 2, 3, 4]
        found = measure(motion(states, np.ones(60), control="clock"), T_hat=T_HAT)
        assert found.kind == kind
        assert f"{abs(rate):.4g}" in found.words


def test_homoclinic_growth_of_the_interval():
    intervals = 0.3 * 2.0 ** np.arange(7)
    found = measure(motion(0.5 ** np.arange(7)[:, None] * np.ones(4), intervals), T_hat=T_HAT)
    assert found.kind == "homoclinic"
    assert "without bound" in found.words


def test_few_events_and_two_turns_of_a_cycle_are_too_short_and_a_fall_is_growth():
    random = np.random.default_rng(3)
    few = motion(random.standard_normal((20, 4)), random.uniform(1, 2, 20))
    known = ((few, "too short"), (motion(*periodic(3, K=8)), "too short"), (motion(*periodic(3, K=9)), "cycle"))
    for run, kind in (*known, (motion(*periodic(1), outcome="fell"), "growth")):
        assert measure(run, T_hat=T_HAT).kind == kind


def test_quasi_periodic_and_irregular():
    angle = 2 * np.pi * (np.sqrt(5) - 1) / 2 * np.arange(150)
    states = np.column_stack([np.cos(angle), np.sin(angle), 0.2 * np.cos(angle), 0.1 * np.sin(angle)])
    assert measure(motion(states, 1 + 0.1 * np.sin(angle)), T_hat=T_HAT).kind == "quasi-periodic"
    s = [0.3, 0.5]
    for _ in range(250):  # the Hénon map
        s.append(1 - 1.4 * s[-1] ** 2 + 0.3 * s[-2])
    s = np.array(s)
    states = np.column_stack([s[1:], s[:-1], s[1:], s[:-1]])
    assert measure(motion(states, 1 + 0.1 * s[1:]), T_hat=T_HAT).kind == "irregular"


def test_a_cycle_that_fell_silent_is_no_cycle_nor_is_a_run_without_events():
    found = measure(motion(*periodic(1), after=30.0), T_hat=T_HAT)
    assert found.kind == "decay"  # x at the end of this run is zero
    assert "no event" in found.words
    assert found.amplitude == pytest.approx([max(np.abs(periodic(1)[0][0, 0]) + 0.1, 0.25)])
    found = measure(motion(np.zeros((0, 4)), []), T_hat=T_HAT)
    assert (found.kind, found.interval) == ("no events", None)
    assert found.amplitude == pytest.approx([0.25])


def test_a_run_in_which_nothing_could_happen_says_so(root):
    """It starts at rest and nothing disturbs it, on either plant; a start or a push is enough."""
    run = load_run(root / "runs" / "simple-0.8.toml").with_(**{"simulation.initial": {}, "simulation.duration": 2.0})
    pushed = [{"kind": "impulse", "input": "torque", "size": 1e-4}]
    for kind in ("linear", "mujoco"):
        moved = ({"simulation.initial": {"hinge": 1e-6}}, {"simulation.disturbance": pushed})
        runs = (run, *(run.with_(**changes) for changes in moved))
        still, *others = (measure(simulate_case(prepare(one), kind), T_hat=np.eye(2)) for one in runs)
        why = "it starts at rest and nothing disturbs it; give it [simulation] initial or a disturbance"
        assert still.words == f"No event in 2 s: {why}."
        assert [other.words for other in others] == ["No event in 2 s."] * 2


@pytest.mark.parametrize(("kind", "close"), [("linear", 1e-6), ("mujoco", 1e-3)])
def test_peaks_of_a_run_include_what_follows_its_last_event(root, kind, close):
    """A set-point under an exact model: one event, and then the step response of Â − B̂k̂."""
    step = [{"output": "angle", "kind": "step", "size": 0.03, "start": 2.0}]
    changes = {"simulation.initial": {}, "simulation.duration": 10.0, "setpoint": step}
    case = prepare(load_run(root / "runs" / "simple-exact.toml").with_(**changes))
    run = simulate_case(case, kind)
    assert run.events.t == pytest.approx([2.0])
    design = case.controller.design
    A, B, C = design.plant.A, design.plant.B, design.plant.C
    target = np.linalg.solve(np.block([[A, B], [C, np.zeros((1, 1))]]), [0.0, 0.0, 0.03])[:2]
    closed = A - B @ design.k
    response = [(C @ (target - expm(closed * t) @ target)).item() for t in np.linspace(0, 8, 1601)]
    found = measure(run, T_hat=np.eye(2))
    assert found.kind != "cycle"
    assert found.amplitude == pytest.approx([np.abs(response).max()], rel=close)


def test_short_and_long_run_of_a_simulated_case():
    """Too short while converging, a cycle when settled; the words give a usable estimate of the time it needs."""
    controller = event_controller(pendulum_design(), Q_t="identity")
    plant = PENDULUM.scaled(1.7)
    short = simulate(plant, controller, settings(40.0, initial={"hinge": 0.02}))
    found = measure(short, T_hat=T_HAT)
    assert found.kind == "too short"
    assert "mirrored period-4" in found.words
    more = float(found.words.split("about ")[1].split()[0])
    assert 15 < more < 45
    settled = measure(simulate(plant, controller, settings(40 + 1.3 * more, initial={"hinge": 0.02})), T_hat=T_HAT)
    assert (settled.kind, settled.p, settled.mirrored) == ("cycle", 4, True)


def test_the_exact_model_is_homoclinic():
    for Q_t in ("output", "identity"):
        run = simulate(PENDULUM, event_controller(pendulum_design(), Q_t=Q_t), settings(60.0, initial={"hinge": 0.02}))
        assert measure(run, T_hat=T_HAT).kind == "homoclinic"


def test_the_clock_at_delta_crit_neither_grows_nor_decays():
    """Below, at and above Δ_crit = 1.8065 s of b = 0.8: decay, a marginal cycle, growth."""
    design = pendulum_design()
    kinds = []
    for interval in (1.6, 1.8065407961084052, 2.1):
        controller = Controller(design, system_matched(design), ClockTrigger(interval))
        run = simulate(PENDULUM.scaled(0.8), controller, settings(120.0, initial={"hinge": 0.02}))
        kinds.append(measure(run, T_hat=T_HAT).kind)
    assert kinds == ["decay", "cycle", "growth"]


def test_gamma_is_the_critical_coordinate():
    run = motion(*periodic(1))
    V_inv = np.linalg.inv(np.random.default_rng(5).standard_normal((4, 4))).astype(complex)
    states = np.hstack([run.events.x, run.events.x_o - run.events.x])
    assert measured_gamma(run, V_inv, T_HAT) == pytest.approx(abs(V_inv[0] @ states[-1]))
    none = replace(run, events=motion(np.zeros((0, 4)), []).events)
    assert np.isnan(measured_gamma(none, V_inv, T_HAT))


def test_different_orders():
    run = simulate(neglected(0.1), event_controller(pendulum_design()), settings(80.0, initial={"hinge": 0.02}))
    found = measure(run, T_hat=np.eye(2, 4))
    assert (found.kind, found.p) == ("cycle", 1)
    assert found.interval == pytest.approx(3.593, abs=5e-4)


@pytest.mark.parametrize("interval", [0.4, 1.2, 1.8, 2.3])
@pytest.mark.parametrize("gain", [0.8, 1.2, 1.7])
def test_growth_under_the_clock_is_the_largest_eigenvalue(gain, interval):
    design, plant = pendulum_design(), PENDULUM.scaled(gain)
    controller = Controller(design, system_matched(design), ClockTrigger(interval))
    eigenvalues = np.linalg.eigvals(error_system(plant, design).phi(interval))
    events = min(200, int(20 / abs(np.log(np.abs(eigenvalues).max()))))
    run = simulate(plant, controller, settings(interval * (events + 0.5), limit=1e30, initial={"hinge": 0.02}))
    found = growth_per_interval(reduced_states(run.events.x, run.events.x_o, T_HAT))
    assert found == pytest.approx(np.abs(eigenvalues).max(), rel=1e-6)
