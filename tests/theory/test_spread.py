"""The predicted spread of intervals under noise, against runs of the linear plant and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_continuous_lyapunov
from theory_cases import DOUBLE, INTEGRATOR, pendulum, pendulum_design, random_systems, shipped, system_beside

from icmj import (
    Bias,
    BoxTrigger,
    Controller,
    Delay,
    Design,
    EventTrigger,
    Gaussian,
    Impulse,
    LinearPlant,
    Noise,
    Settings,
    load_run,
    output_weight,
    predict,
    prepare,
)
from icmj.controller.hold import system_matched
from icmj.errors import AnalysisError, IcmjError
from icmj.linear.run import simulate
from icmj.theory import SmallNoise, predict_spread
from icmj.theory.error_system import error_system
from icmj.theory.spread import gather, make_noise_states


def rule_of(system, q_t=0.01):
    return EventTrigger(output_weight(system.design), q_t, 1e-3)


def noises(system, kind, size, *, interval=0.01, corner=None):
    """The same noise on each reading or each command: as theory takes it, and as a run does."""
    n, n_u, n_y = system.n, system.actual.n_u, system.actual.n_y
    names = system.actual.outputs if kind == "output" else system.actual.inputs
    effects = [(np.zeros(n), e) for e in np.eye(n_y)] if kind == "output" else [
        (system.actual.B[:, j], np.zeros(n_y)) for j in range(n_u)
    ]  # fmt: skip
    small = [SmallNoise(size * rate, size * reading, interval, corner) for rate, reading in effects]
    drawn = [
        Gaussian(**{kind: name}, size=size, interval=interval, corner=corner, seed=seed)
        for seed, name in enumerate(names, 1)
    ]
    return small, drawn


def intervals(system, rule, orbit, drawn, events):
    """Intervals of a run of so many that starts on the orbit, without the first."""
    x, x_o, x_h = system.start(orbit.x_bar)
    controller = Controller(system.design, system_matched(system.design), rule, system.delay)
    settings = Settings(duration=events * orbit.delta, record_interval=1e5, limit=1e6, disturbance=tuple(drawn))
    run = simulate(system.actual, controller, settings, x0=x, x_o0=x_o, x_h0=x_h)
    assert run.outcome.kind == "completed"
    return np.diff(run.events.t)[50:]


def assert_agrees(spread, found, bend=0.0):
    """Within four standard errors, as the predicted correlations make them (Bartlett), and ``bend`` of the deviation.

    Returns the standard error of the mean.
    """
    count, rho = len(found), spread.correlation
    assert abs(rho[-1]) < 0.05, "more correlations are needed for these bounds"
    off = found - found.mean()
    variance = np.mean(off**2)
    assert np.sqrt(variance) / spread.deviation == pytest.approx(
        1, abs=4 * np.sqrt((1 + 2 * np.sum(rho**2)) / (2 * count)) + bend
    )
    for k in (1, 2):
        assert np.mean(off[k:] * off[:-k]) / variance == pytest.approx(rho[k - 1], abs=4 / np.sqrt(count) + bend)
    return spread.deviation * np.sqrt((1 + 2 * rho.sum()) / count)


@pytest.mark.parametrize(("case", "kind", "size", "deviation", "correlation"), [
    ("b=0.9 three-link", "output", 1e-4, 0.030707, None),
    ("b=1.2", "output", 3e-4, 0.031066, -0.243),
    ("b=0.9 three-link", "input", 0.05, 0.023618, None),
])  # fmt: skip
def test_shipped_cases(case, kind, size, deviation, correlation):
    """The numbers are those of a process in continuous time with the same density and curvature."""
    system = shipped(case)
    rule = rule_of(system)
    prediction = predict(system, rule)
    small, drawn = noises(system, kind, size)
    spread = predict_spread(system, rule, prediction.orbit, small)
    assert spread.deviation == pytest.approx(deviation, rel=0.015)
    if correlation is not None:
        assert spread.correlation[0] == pytest.approx(correlation, abs=1e-3)
    assert spread.interval == prediction.delta_crit
    error = assert_agrees(spread, found := intervals(system, rule, prediction.orbit, drawn, 4000), bend=0.01)
    assert found.mean() - spread.interval == pytest.approx(spread.shift, abs=4 * error)


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_the_hold_error_spreads_over_the_interval_as_in_runs(delay):
    """At half and four fifths of the interval, which no event comes before: SD of 1,500 events in a run of the rule."""
    system = shipped("b=1.2")
    if delay:
        system = error_system(system.actual, system.design, delay=Delay(delay))
    rule, events = rule_of(system), 1500
    orbit = predict(system, rule).orbit
    small, drawn = noises(system, "output", 3e-4)
    spread = predict_spread(system, rule, orbit, small)
    assert (spread.t[0], spread.t[-1]) == (delay, pytest.approx(orbit.delta))
    assert spread.hold_error[-1] == pytest.approx(spread.epsilon, rel=1e-9)
    if not delay:
        assert spread.hold_error[0] == 0
    x, x_o, x_h = system.start(orbit.x_bar)
    controller = Controller(system.design, system_matched(system.design), rule, system.delay)
    settings = Settings(duration=events * orbit.delta, record_interval=5e-3, limit=1e6, disturbance=tuple(drawn))
    run = simulate(system.actual, controller, settings, x0=x, x_o0=x_o, x_h0=x_h)
    faces = rule.faces(system.design)
    size = np.sqrt(faces.squares((run.x_h - run.x_o) @ faces.R.T).max(axis=1))
    begun = run.events.t[50:-1]
    for part in (0.5, 0.8):
        # between rows the hold error is as good as straight
        found = np.interp(begun + part * orbit.delta, run.t, size)
        expected = np.interp(part * orbit.delta, spread.t, spread.hold_error)
        rho = np.abs(spread.correlation)
        error = np.sqrt((1 + 2 * np.sum(rho**2)) / (2 * len(found)))
        assert found.std() == pytest.approx(expected, rel=4 * error + 0.02)
        mean = np.interp(part * orbit.delta, orbit.t, np.sqrt(faces.squares(orbit.e_hp @ faces.R.T).max(axis=1)))
        assert found.mean() == pytest.approx(mean, abs=4 * expected / np.sqrt(len(found)) * (1 + 2 * rho.sum()) + 0.01)


def test_the_mean_interval_to_second_order():
    system = shipped("b=1.2")
    rule = rule_of(system)
    orbit = predict(system, rule).orbit
    small, drawn = noises(system, "output", 9e-4)
    spread = predict_spread(system, rule, orbit, small)
    half = predict_spread(system, rule, orbit, [replace(of, reading=of.reading / 2) for of in small])
    assert half.shift == pytest.approx(spread.shift / 4)
    assert half.deviation == pytest.approx(spread.deviation / 2)
    error = assert_agrees(spread, found := intervals(system, rule, orbit, drawn, 10_000), bend=0.03)
    assert 5 * error < spread.shift
    assert found.mean() - spread.interval == pytest.approx(spread.shift, abs=4 * error)


@pytest.mark.parametrize("seed", range(8))
def test_random_loops(seed):
    """Of two to four states, half of them with a delay, noise with a corner or without, on readings or commands."""
    random = np.random.default_rng(seed)
    for plain in random_systems(seed, 20):
        delay = Delay(0.2 * random.uniform(0.2, 1)) if seed % 2 else plain.delay
        system = error_system(plain.actual, plain.design, delay=delay)
        rule = rule_of(system)
        prediction = predict(system, rule, delta_max=5.0)
        if prediction.verdict == "attracting" and np.abs(prediction.multipliers).max() < 0.65:
            break
    kind, corner = ("output", "input")[seed // 2 % 2], (None, 1.0)[seed // 4 % 2]
    orbit = prediction.orbit
    interval = orbit.delta / 80
    small, _ = noises(system, kind, 1e-6, interval=interval, corner=corner)
    size = 1e-6 * 0.01 / predict_spread(system, rule, orbit, small).epsilon
    small, drawn = noises(system, kind, size, interval=interval, corner=corner)
    spread = predict_spread(system, rule, orbit, small)
    assert spread.epsilon == pytest.approx(0.01)
    assert_agrees(spread, intervals(system, rule, orbit, drawn, 2000))


@pytest.mark.parametrize("corner", [None, 0.5, 8.0])
def test_noise_states_have_the_density_of_noise_on_a_grid(corner):
    interval = 0.02
    a = 0.0 if corner is None else np.exp(-2 * np.pi * corner * interval)
    f = np.linspace(0, 12, 25)
    turn = np.exp(-2j * np.pi * f * interval)
    exact = interval * (1 - a**2) / np.abs(1 - a * turn) ** 2 * np.sinc(f * interval) ** 4  # two-sided
    before = np.inf
    for order in (1, 2, 3, 4, 6):
        A, Q = make_noise_states(SmallNoise(np.zeros(1), np.zeros(1), interval, corner), order)
        G = np.array([np.linalg.inv(2j * np.pi * at * np.eye(order) - A)[0] for at in f])
        off = np.einsum("fi,ij,fj->f", G, Q, G.conj()).real / exact - 1
        assert off.min() > -1e-9  # from above: each power of the inverse makes it smaller
        assert off.max() < before
        before = off.max()
    assert before < 1e-4


def test_what_noise_gathers_approaches_the_stationary_covariance():
    random = np.random.default_rng(3)
    A = random.normal(size=(5, 5)) - 3 * np.eye(5)
    G = random.normal(size=(5, 2))
    stationary = solve_continuous_lyapunov(A, -G @ G.T)
    for t in (0.01, 0.7, 20.0):
        flown, S = gather(A, G @ G.T, t)
        np.testing.assert_allclose(flown, expm(A * t), atol=1e-12)
        left = expm(A * t) @ stationary @ expm(A * t).T
        np.testing.assert_allclose(S, stationary - left, atol=1e-12 * np.abs(stationary).max())


def refused(match, system, rule, noise, orbit=None):
    with pytest.raises(AnalysisError, match=f"^no spread is predicted.*{match}") as caught:
        predict_spread(system, rule, orbit or predict(system, rule).orbit, noise)
    assert "\n" not in str(caught.value)


def test_what_is_refused():
    system = shipped("b=1.7")
    refused("does not attract", system, rule_of(system), noises(system, "output", 1e-5)[0])
    system = shipped("b=1.2")
    rule = rule_of(system)
    refused("without noise", system, rule, [])
    refused("by 0.4 of the threshold", system, rule, noises(system, "output", 3e-3)[0])
    orbit = predict(system, rule).orbit
    refused("not admissible: a reason", system, rule, noises(system, "output", 1e-5)[0],
            replace(orbit, admissible=False, reason="a reason"))  # fmt: skip
    late = EventTrigger(rule.Q_t, rule.q_t, orbit.delta - 0.05)
    refused("as short as Δ_min", system, late, noises(system, "output", 3e-4)[0])
    plain, one = shipped("b=0.8"), pendulum_design()
    twice = [LinearPlant(*(block_diag(M, M) for M in (of.A, of.B, of.C))) for of in (plain.actual, one.plant)]
    system = error_system(twice[0], Design(twice[1], block_diag(one.k, one.k), block_diag(one.L, one.L)))
    refused("does not attract", system, rule_of(system), noises(system, "output", 1e-5)[0])  # along their family
    system = shipped("b=0.9 three-link")
    refused("too coarse", system, rule_of(system), noises(system, "output", 1e-5, interval=0.1)[0])


def test_faces_that_are_reached_together_are_refused():
    """Two equal outputs with nearly equal thresholds: noise says which one is first."""
    one, design = pendulum(0.8), pendulum_design()
    twice = np.vstack([one.C, one.C])
    both, model = (LinearPlant(of.A, of.B, twice) for of in (one, design.plant))
    system = error_system(both, Design(model, design.k, np.hstack([design.L, design.L]) / 2))
    rule = BoxTrigger(np.array([0.01, 0.0101]))
    refused("another face", system, rule, noises(system, "output", 3e-4)[0])
    apart = BoxTrigger(np.array([0.01, 0.02]))
    assert predict_spread(system, apart, predict(system, apart).orbit, noises(system, "output", 3e-4)[0]).deviation > 0


def test_an_event_that_noise_lets_slip_is_refused():
    """On this random loop E turns back soon after the event: with enough noise some events come much later."""
    system = list(random_systems(1, 25))[24]
    rule = BoxTrigger(np.full(system.actual.n_y, 0.01))
    orbit = predict(system, rule, delta_max=6.0).orbit
    size = 0.002 / predict_spread(system, rule, orbit, noises(system, "input", 1e-6)[0]).epsilon * 1e-6
    assert predict_spread(system, rule, orbit, noises(system, "input", size)[0]).epsilon == pytest.approx(0.002)
    small, drawn = noises(system, "input", 50 * size)
    refused("turns back after the event", system, rule, small, orbit)
    assert intervals(system, rule, orbit, drawn, 500).max() > 2 * orbit.delta


def test_a_mode_that_only_noise_moves_is_refused():
    """A constant torque on the pendulum, which the loop feels and cannot change."""
    A = [[0, 1, 1], [1, 0, 0], [0, 0, 0]]
    actual = LinearPlant(A, [[0.8], [0], [0]], [[0, 1, 0]], ("v", "y", "d"), ("u",), ("y",))
    system = error_system(actual, pendulum_design())
    refused("with a mode that drifts under noise: constant offset", system, rule_of(system),
            noises(system, "output", 1e-5)[0])  # fmt: skip


@pytest.mark.parametrize("extra", [INTEGRATOR, DOUBLE])
def test_a_mode_that_the_loop_does_not_feel_changes_nothing(extra):
    """Though noise moves it, too, and without end."""
    plain = shipped("b=0.8")
    rule = rule_of(plain)
    small, _ = noises(plain, "input", 1e-3)
    alone = predict_spread(plain, rule, predict(plain, rule).orbit, small)
    driven = np.zeros((len(extra), 2))
    driven[-1, 1] = 1.0
    system = system_beside(extra, known=False, driven=driven)
    more = replace(small[0], rate=np.append(small[0].rate, np.full(len(extra), 1e-3)))
    beside = predict_spread(system, rule, predict(system, rule).orbit, [more])
    assert beside.deviation == pytest.approx(alone.deviation, rel=1e-9)
    assert beside.shift == pytest.approx(alone.shift, rel=1e-6)
    np.testing.assert_allclose(beside.correlation, alone.correlation, atol=1e-9)


def with_noise(name, *sources):
    case = prepare(load_run(name))
    return replace(case, settings=replace(case.settings, disturbance=sources))


def test_the_spread_of_a_case():
    names = ("shank", "thigh", "trunk")
    drawn = [Gaussian(output=name, size=1e-4, seed=seed) for seed, name in enumerate(names)]
    case = with_noise("three-link-0.9", *drawn, Impulse(input="hip_torque", size=0.1))
    spread = case.spread()
    assert spread.deviation == pytest.approx(0.0307, rel=0.02)
    assert "a standard deviation of 0.0304" in spread.words
    # one signal on all of them is another thing than three
    same = with_noise("three-link-0.9", *(replace(of, seed=1) for of in drawn)).spread()
    small, _ = noises(case.system, "output", 1e-4)
    whole = replace(small[0], reading=np.full(3, 1e-4))
    orbit = case.prediction.orbit
    assert same.deviation == predict_spread(case.system, case.rule, orbit, [whole]).deviation
    # of sinusoids the spectrum is that of the process in continuous time, cut where 3 % of the power lie beyond
    sines = with_noise("three-link-0.9", Noise(input="hip_torque", size=0.01, corner=1.0)).spread()
    fine = with_noise("three-link-0.9", Gaussian(input="hip_torque", size=0.01, corner=1.0, interval=1e-3)).spread()
    assert sines.deviation / fine.deviation == pytest.approx(np.sqrt(np.pi / 2 / np.arctan(20)), rel=1e-3)
    # a torque on the trunk, whose angle is the sum of those of the joints, is the same torque in each of them
    push = {"size": 0.01, "seed": 5}
    pushed = with_noise("three-link-0.9", Gaussian(body="trunk", torque=(0, 1, 0), **push)).spread()
    inputs = case.controller.plant.inputs
    joints = with_noise("three-link-0.9", *(Gaussian(input=name, on="body", **push) for name in inputs)).spread()
    assert pushed.deviation == pytest.approx(joints.deviation, rel=1e-9)


@pytest.mark.parametrize(("name", "sources", "match"), [
    ("simple-1.7", [Gaussian(output="angle", size=1e-4)], "does not attract"),
    ("simple-1.2", [Bias(output="angle", size=1e-4)], "kind 'bias', which moves the orbit"),
    ("simple-1.2", [Noise(output="angle", size=1e-4, bandwidth=1)], "give a corner"),
    ("simple-1.2", [Gaussian(input="torque", share=0.1)], "share of the command"),
    ("simple-1.2", [Gaussian(output="angle", size=1e-4, corner=c) for c in (1, 2)], "the seed 0 differ"),
    ("simple-1.2", [Gaussian(output="elsewhere", size=1e-4)], "the plant's outputs are angle"),
    ("simple-1.2", [], "without noise"),
])  # fmt: skip
def test_what_is_refused_of_a_case(name, sources, match):
    with pytest.raises(IcmjError, match=match) as caught:
        with_noise(name, *sources).spread()
    assert "\n" not in str(caught.value)


def test_quiet_standing_is_refused():
    with pytest.raises(AnalysisError, match="does not attract"):
        prepare(load_run("quiet-standing")).spread()


def test_commands_say_it(root, tmp_path, shell):
    text = (root / "runs" / "simple-1.2.toml").read_text(encoding="utf-8")
    text = text.replace("../models", str(root / "models"))
    drawn = '\n[[simulation.disturbance]]\nkind = "gaussian"\noutput = "angle"\nsize = {}\nseed = 1\n'
    for name, size in (("small", 3e-4), ("large", 3e-3)):
        (tmp_path / f"{name}.toml").write_text(text + drawn.format(size), encoding="utf-8")
    small, large = (["analyse", str(tmp_path / f"{name}.toml")] for name in ("small", "large"))
    assert "a standard deviation of 0.031 s, and a correlation of −0.243 from" in " ".join(shell.says(small).split())
    found = shell.answers([*small, "--json"])["spread"]
    assert found["deviation"] == pytest.approx(0.031, abs=1e-4)
    assert len(found["correlation"]) == 8
    assert "No spread is predicted: noise moves the hold error" in " ".join(shell.says(large).split())
    found = shell.answers([*large, "--json"])
    assert found["spread"] is None
    assert found["no_spread"].startswith("no spread is predicted: noise moves")
    assert "spread" not in shell.answers(["analyse", str(root / "runs" / "simple-1.2.toml"), "--json"])
    run = ["run", small[1], "--plant", "linear", "--out", str(tmp_path / "out")]
    assert "the predicted intervals have a mean of 1.52839 s" in " ".join(shell.says(run).split())


@pytest.mark.parametrize("given", [
    {"rate": [np.nan, 0]}, {"interval": 0.0}, {"interval": -0.01}, {"corner": 0.0}, {"rate": [0, 0, 0]},
    {"reading": [1e-5, 0]},
])  # fmt: skip
def test_a_noise_that_does_not_fit(given):
    system = shipped("b=1.2")
    orbit = predict(system, rule_of(system)).orbit
    fitting = {"rate": [0, 0], "reading": [1e-5], "interval": 0.01}
    assert predict_spread(system, rule_of(system), orbit, [SmallNoise(**fitting)]).deviation > 0
    with pytest.raises(AnalysisError, match="noise"):
        predict_spread(system, rule_of(system), orbit, [SmallNoise(**{**fitting, **given})])
