"""The linear plant under controllers that read delayed outputs, against DOP853 by the method of steps, and roots."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from oracles.delay import of_law
from patience import PATIENCE
from tapped_cases import BODY, CONTINUOUS, DELAY, HOMOGENEOUS, MGH, SWITCHING, Tapped, pid, two_taps

import icmj
from icmj import Bias, Gaussian, Impulse, LinearPlant, Noise, Sampled, Settings, Step
from icmj.controller.realisation import Guard, Mode
from icmj.errors import SimulationError
from icmj.linear.run import simulate_tapped

START = np.array([0.01, 0.003])


def agrees(run, oracle, bound: float) -> None:
    """Rows and switches of a run are those of an oracle, the rows relative to the largest of each state."""
    n = run.x.shape[1]
    there = np.array([oracle.z(t)[:n] for t in run.t])
    assert np.abs(run.x - there).max(axis=0) / np.abs(there).max(axis=0) == pytest.approx(np.zeros(n), abs=bound)
    assert len(run.events) == len(oracle.switches)
    assert run.events.t == pytest.approx(oracle.switches, abs=1e-10)


@pytest.mark.parametrize("law", [CONTINUOUS, HOMOGENEOUS, SWITCHING, pid(), two_taps()])
def test_it_is_what_the_method_of_steps_gives(law) -> None:
    run = simulate_tapped(BODY, law, Settings(duration=5.0, record_interval=0.05), x0=START)
    agrees(run, of_law(BODY, law, START).run(5.0), 1e-11)
    assert run.t[-1] == 5.0
    assert (len(run.events) > 3) == (law in (HOMOGENEOUS, SWITCHING))


def recurrence(theta: np.ndarray, step: float) -> tuple[complex, float]:
    """The slowest pair of roots from samples of a motion that is little else, and what is left unexplained."""
    lead = np.column_stack([theta[1:-1], theta[:-2]]) * (scale := 1 / np.abs(theta[2:]))[:, None]
    (b, c), *_ = np.linalg.lstsq(lead, theta[2:] * scale, rcond=None)
    root = np.log(np.roots([1, -b, -c]).astype(complex)) / step
    left = np.abs(lead @ [b, c] - theta[2:] * scale).max()
    return complex(root[np.argmax(root.imag)]), float(left)


def test_its_slowest_mode_is_the_rightmost_root() -> None:
    """−1.283231 ± 5.200224j; the next is real, −2.059143, and has decayed to 1e-8 of it by then."""
    run = simulate_tapped(BODY, CONTINUOUS, Settings(duration=30.0, record_interval=0.1), x0=START)
    root, left = recurrence(run.y[250:, 0], 0.1)
    assert root == pytest.approx(-1.283231 + 5.200224j, abs=2e-6)
    assert left < 1e-6


@pytest.mark.parametrize(("factor", "grows"), [(1 - 1e-5, False), (1 + 1e-5, True)])
def test_it_decays_below_the_limit_of_stability_and_grows_above(factor: float, grows: bool) -> None:
    law = replace(CONTINUOUS, P=1.513461 * MGH * factor)
    run = simulate_tapped(BODY, law, Settings(duration=60.0, record_interval=0.1), x0=START)
    root, _ = recurrence(run.y[400:, 0], 0.1)
    assert (root.real > 0) == grows
    assert root.imag == pytest.approx(4.998884, abs=2e-4)
    assert run.outcome.kind == "completed"


@pytest.mark.parametrize("scale", [-1.0, 3.7, 1e-6])
def test_without_a_dead_zone_a_scaled_start_gives_the_scaled_motion(scale: float) -> None:
    settings = Settings(duration=20.0, limit=1e3)
    one, other = (simulate_tapped(BODY, HOMOGENEOUS, settings, x0=START * s) for s in (1.0, scale))
    assert other.events.t == pytest.approx(one.events.t, abs=1e-10)
    assert len(one.events) > 20
    assert other.x[-1] == pytest.approx(scale * one.x[-1], rel=1e-9)
    y_max, y_min = (other.events.y_max, other.events.y_min) if scale > 0 else (other.events.y_min, other.events.y_max)
    assert y_max == pytest.approx(scale * one.events.y_max, rel=1e-9)
    assert y_min == pytest.approx(scale * one.events.y_min, rel=1e-9)


def test_without_a_dead_zone_every_round_is_the_one_before_scaled() -> None:
    """As docs/controllers.md says: 1.155262 s, 0.73140938; by DOP853, too."""
    run = simulate_tapped(BODY, HOMOGENEOUS, Settings(duration=40.0), x0=START)
    rounds = run.events.t[2:] - run.events.t[:-2]
    assert rounds[6:] == pytest.approx(rounds[6], abs=1e-9)
    factors = run.events.x[8:] / run.events.x[6:-2]
    assert factors == pytest.approx(factors[0, 0], rel=1e-9)
    oracle = of_law(BODY, HOMOGENEOUS, START).run(6.0)
    before, after = (oracle.z(oracle.switches[k])[0] for k in (3, 5))
    assert after / before == pytest.approx(factors[0, 0], rel=1e-9)
    assert (rounds[6], factors[0, 0]) == pytest.approx((1.155262, 0.73140938), abs=1e-6)


def test_with_a_dead_zone_there_is_a_cycle_of_four_switches() -> None:
    """4.131 s, as docs/controllers.md says."""
    run = simulate_tapped(BODY, SWITCHING, Settings(duration=200.0), x0=START)
    rounds = run.events.t[4:] - run.events.t[:-4]
    assert rounds[-8:] == pytest.approx(np.full(8, 4.131), abs=5e-4)
    assert (run.x[run.t > 150, 0] > 0).all()


def test_sizes_are_in_proportion_to_the_dead_zone() -> None:
    settings = Settings(duration=40.0)
    one, other = (
        simulate_tapped(BODY, replace(SWITCHING, dead_zone=0.004 * s), settings, x0=START * s) for s in (1.0, 0.3)
    )
    assert other.events.t == pytest.approx(one.events.t, abs=1e-9)
    assert other.x[-1] == pytest.approx(0.3 * one.x[-1], rel=1e-8)


DISTURBED = (
    Noise("ankle", 0.5, bandwidth=6.0, seed=1, start=0.2), Impulse("ankle", 0.4, start=0.5003, duration=0.0371),
    Step("ankle", 0.3, 1.1), Noise(output="theta", size=3e-4, bandwidth=4.0, seed=2), Bias("omega", 2e-3, 0.9),
)  # fmt: skip


GAUSSIAN = (
    Gaussian(input="ankle", size=0.6, corner=2.0, interval=0.05, seed=4, on="body"),
    Gaussian(input="ankle", size=0.3, interval=0.1, seed=5, start=0.33),
    Gaussian(output="theta", size=3e-4, corner=3.0, interval=0.1, seed=6),
    Sampled(input="ankle", values=(0, 0, 0.2, 0.4, 0.1, 0.1), interval=0.15, start=0.2), Bias("omega", 2e-3, 0.9),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("disturbed", [DISTURBED, GAUSSIAN])
@pytest.mark.parametrize("law", [CONTINUOUS, SWITCHING, pid(), two_taps()])
def test_what_disturbs_it_is_exact_too(law, disturbed) -> None:
    from icmj.simulation.disturbance import make_disturbance, make_pushes, make_reading_error

    settings = Settings(duration=4.0, record_interval=0.05, disturbance=disturbed)
    run = simulate_tapped(BODY, law, settings, x0=START)
    acting, pushes = make_disturbance(disturbed, BODY.inputs), make_pushes(settings)
    errors = make_reading_error(disturbed, BODY.outputs)

    def disturbance(t):  # the pushes act where the input does
        return acting(t) + pushes.size(t).sum(axis=-1)

    bends = 0.05 * np.arange(1, 80) if disturbed is GAUSSIAN else ()
    edges = sorted({*acting.edges, *pushes.size.edges, *errors.edges, *bends})
    oracle = of_law(BODY, law, START, disturbance, errors, edges).run(4.0)
    agrees(run, oracle, 1e-10)
    assert run.noisy
    assert run.applied == pytest.approx(run.u + acting(run.t))
    assert run.pushed.shape == (len(run.t), 1)


@pytest.mark.parametrize("seed", range(12))
def test_any_stable_plant_under_any_law(seed: int) -> None:
    """Random plants, gains, taps, states and switching lines."""
    random = np.random.default_rng(seed)
    n, n_u, n_y, size, count = 2 + seed % 3, 1 + seed % 2, 2, seed % 3, 1 + seed % 2
    A = random.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    plant = LinearPlant(A, random.standard_normal((n, n_u)), random.standard_normal((n_y, n)))
    taps = tuple(np.sort(random.uniform(0.05, 0.6, count)))
    n_v = n_y * count

    def mode(name: str) -> Mode:
        M = random.standard_normal((size, size)) - 2 * np.eye(size)
        shapes = (size, n_v), (n_u, size), (n_u, n_v)
        return Mode(name, M, *(0.5 * random.standard_normal(shape) for shape in shapes))

    line = random.standard_normal((n_v, n_v))
    guards = (Guard(line + line.T), Guard(np.eye(n_v), -0.1))
    table = random.integers(0, 3, (3, 4))
    law = Tapped(plant, (mode("a"), mode("b"), mode("c")), taps, guards, table)
    x0 = random.standard_normal(n)
    run = simulate_tapped(plant, law, Settings(duration=3.0, record_interval=0.05, limit=1e6), x0=x0)
    agrees(run, of_law(plant, law, x0, longest=0.05).run(3.0), 1e-9)
    assert run.mode[-1] == oracle_mode(law, run)


def oracle_mode(law: Tapped, run) -> int:
    """The mode that the last row's delayed readings give, if the table forgets where it came from; else its own."""
    real, at = law.realisation, run.t[-1]
    v = np.concatenate([run.y[np.argmin(np.abs(run.t - (at - tau)))] for tau in real.taps])
    candidates = {real.following(mode, v) for mode in range(3)}
    return candidates.pop() if len(candidates) == 1 else int(run.mode[-1])


def test_rows_events_and_extremes() -> None:
    settings = Settings(duration=8.0, record_interval=0.01)
    run = simulate_tapped(BODY, SWITCHING, settings, x0=START)
    grid = 0.01 * np.arange(801)
    assert np.isin(np.round(grid, 9), np.round(run.t, 9)).all()
    # what a switch does is read a delay later, which bends the command; so is the start, on the grid
    np.testing.assert_allclose(run.leads[:, 0], [DELAY, 2 * DELAY, *(run.events.t + DELAY)], atol=1e-12)
    assert len(run.t) == 801 + 2 * len(run.events)
    assert (np.diff(run.t) > 0).all()
    at = np.searchsorted(run.t, run.events.t)
    assert run.t[at] == pytest.approx(run.events.t, abs=0)
    # the row at a switch is the one before it
    assert (run.mode[at] != run.mode[at + 1]).all()
    assert run.modes == ("on", "off")
    off = run.mode == 1
    assert (run.u[off] == 0).all()
    late = run.t > DELAY
    reading = np.column_stack([np.interp(run.t - DELAY, run.t, run.y[:, i]) for i in range(2)])
    command = -reading @ SWITCHING.realisation.modes[0].S.T
    assert run.u[late & ~off] == pytest.approx(command[late & ~off], abs=2e-3)
    for k, (begin, end) in enumerate(zip([0.0, *run.events.t], run.events.t, strict=False)):
        inside = run.y[(run.t >= begin) & (run.t <= end)]
        assert run.events.y_max[k] == pytest.approx(inside.max(axis=0), abs=3e-7)
        assert (run.events.y_max[k] >= inside.max(axis=0) - 1e-15).all()
        assert (run.events.y_min[k] <= inside.min(axis=0) + 1e-15).all()
    assert run.x_o.shape == run.x_h.shape == (len(run.t), 0)
    assert np.isnan(run.E).all()
    series = run.to_series(rate=50.0)
    assert "u.ankle" in series.names


def test_recording_changes_nothing() -> None:
    coarse, fine = (
        simulate_tapped(BODY, SWITCHING, Settings(duration=30.0, record_interval=dt), x0=START) for dt in (10.0, 1e-3)
    )
    assert (coarse.events.t == fine.events.t).all()
    assert (coarse.x[-1] == fine.x[-1]).all()


def test_it_falls_at_its_limit_and_diverges_without() -> None:
    law = replace(CONTINUOUS, P=0.0, D=0.0)
    run = simulate_tapped(BODY, law, Settings(duration=60.0, limit={"lean": 0.5}), x0=[0.01, 0.0])
    assert run.outcome.kind == "fell"
    # x = c₁e^(λ₁t) + c₂e^(λ₂t) by hand
    roots = np.roots([1.0, 4 / 60, -0.2 * 9.81])
    c = np.linalg.solve([[1, 1], roots], [0.01, 0.0])
    assert c @ np.exp(roots * run.t[-1]) == pytest.approx(0.5, rel=1e-11)
    assert run.x[-1, 0] == pytest.approx(0.5, rel=1e-12)
    assert "lean departed further than its limit of 0.5" in run.outcome.message
    lost = simulate_tapped(BODY, law, Settings(duration=60.0, limit=1e15), x0=[0.01, 0.0])
    assert lost.outcome.kind == "diverged"


def test_a_long_way_back_is_remembered() -> None:
    """Hundreds of stretches lie within a long tap: the history grows."""
    law = replace(CONTINUOUS, P=30.0, D=20.0, delay=3.0)
    noise = (Noise("ankle", 0.1, bandwidth=30.0, seed=3),)
    run = simulate_tapped(BODY, law, Settings(duration=9.0, record_interval=0.5, disturbance=noise), x0=START * 0.1)
    from icmj.simulation.disturbance import make_disturbance

    agrees(run, of_law(BODY, law, START * 0.1, make_disturbance(noise, BODY.inputs)).run(9.0), 1e-10)


def test_what_would_take_too_much_to_remember_is_refused(monkeypatch) -> None:
    monkeypatch.setattr("icmj.simulation.taps.ROOM", 1e6)
    law, fast = replace(CONTINUOUS, delay=3.0), (Noise("ankle", 0.1, bandwidth=3000.0, seed=3),)
    with pytest.raises(SimulationError, match="would have to be remembered within the controller's delay"):
        simulate_tapped(BODY, law, Settings(duration=9.0, record_interval=0.5, disturbance=fast), x0=START)


def test_from_rest_a_guard_that_is_zero_throughout_the_delay_does_not_change() -> None:
    """θ θ' > 0 with θ' = 0: off until a rate is read, which is a delay later. It switched for ever at t = 0."""
    settings = Settings(duration=6.0, record_interval=0.05)
    run = simulate_tapped(BODY, replace(HOMOGENEOUS, slope=0.0), settings, x0=[0.01, 0.0])
    assert run.events.t[0] == pytest.approx(0.2, abs=1e-12)
    assert len(run.events) > 3
    # a line that leaves the start on its off side reads the same, and comes but so much later
    beside = simulate_tapped(BODY, replace(HOMOGENEOUS, slope=1e-9), settings, x0=[0.01, 0.0])
    np.testing.assert_allclose(run.events.t, beside.events.t, atol=1e-7)
    np.testing.assert_allclose(run.x[-1], beside.x[-1], atol=1e-8)


def test_outputs_are_matched_by_name_and_what_does_not_fit_is_refused() -> None:
    turned = LinearPlant(
        BODY.A, BODY.B, BODY.C[::-1], BODY.states, BODY.inputs, ("omega", "theta"),
    )  # fmt: skip
    settings = Settings(duration=2.0)
    one = icmj.simulate_plant(BODY, SWITCHING, settings, x0=START)
    other = icmj.simulate_plant(turned, SWITCHING, settings, x0=START)
    assert (one.x == other.x).all()
    assert one.control == "switching"
    with pytest.raises(SimulationError, match="neither observer nor hold"):
        icmj.simulate_plant(BODY, SWITCHING, settings, x0=START, x_o0=START)
    with pytest.raises(SimulationError, match="neither observer nor hold"):
        icmj.simulate_plant(BODY, SWITCHING, Settings(duration=2.0, observer={"lean": 0.1}))
    with pytest.raises(SimulationError, match="expected 2 finite numbers"):
        icmj.simulate_plant(BODY, SWITCHING, settings, x0=[0.1])
    with pytest.raises(SimulationError, match="1 inputs and 1 outputs"):
        simulate_tapped(replace(BODY, C=BODY.C[:1], outputs=("theta",), output_units=("",)), SWITCHING, settings)
    narrow = replace(pid(), taps=(0.1, 0.2))
    with pytest.raises(SimulationError, match=r"has S of shape \(1, 2\); expected \(1, 4\)"):
        icmj.simulate_plant(BODY, narrow, settings)


def test_interpreted_it_is_the_same() -> None:
    script = (
        "import sys; sys.path.insert(0, 'tests')\n"
        "from tapped_cases import BODY, SWITCHING; from icmj.linear.run import simulate_tapped\n"
        "from icmj.simulation.settings import Settings\n"
        "run = simulate_tapped(BODY, SWITCHING, Settings(duration=4.0, record_interval=1.0), x0=[0.01, 0.003])\n"
        "print(*map(float.hex, run.events.t))"
    )
    run = simulate_tapped(BODY, SWITCHING, Settings(duration=4.0, record_interval=1.0), x0=START)
    told = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, timeout=PATIENCE,
        env={**os.environ, "ICMJ_INTERPRETED": "1"}, cwd=os.path.dirname(os.path.dirname(os.path.dirname(__file__))),
    )  # fmt: skip
    assert [float.fromhex(word) for word in told.stdout.split()] == pytest.approx(run.events.t, abs=1e-11)


def test_what_falls_at_the_start_is_recorded_there_once() -> None:
    """Two rows at 0 made a log that was refused when it was read back."""
    run = simulate_tapped(BODY, SWITCHING, Settings(duration=1.0, limit=1.0), x0=[10.0, 0.0])
    assert run.outcome.kind == "fell"
    np.testing.assert_array_equal(run.t, [0.0])
    np.testing.assert_array_equal(run.x, [[10.0, 0.0]])
