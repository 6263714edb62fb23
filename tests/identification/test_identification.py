"""Model errors are found again from the motions that they make: blind, on many motions, with intervals that cover."""

from dataclasses import replace

import numpy as np
import pytest
from terminal_cases import told

import icmj
from icmj.errors import IcmjError
from icmj.identification.identification import identify
from icmj.identification.inversion import Inverse
from icmj.identification.observed import Observed
from icmj.identification.rhythm import Rhythm
from icmj.identification.unknown import Unknown

PENDULUM = icmj.load_run("simple-0.8")
# what the code under test is given: nothing of b
BLIND = Unknown(PENDULUM.with_(**{"actual.gain": None}))
FAR = Inverse(replace(BLIND, longest=8.0))
WIDE = Inverse(replace(BLIND, high=1.6))
# its cycles leave the output on one side, and move it little
RIPPLE = PENDULUM.with_(**{"design.R_c": 6.237156619, "design.R_o": 0.3583997, "simulation.duration": 60.0})
LOW = Inverse(replace(BLIND, low=0.4, high=0.7))


def motion(b: float, plant: str = "linear", run: icmj.RunFile = PENDULUM, **changes: object) -> icmj.Simulation:
    return icmj.simulate(icmj.prepare(run.with_(**{"actual.gain": b}, **changes)), plant)


@pytest.mark.parametrize("b", [0.8, 0.99, 1.01, 1.2])
def test_events_since_the_start_tell_b_on_either_side_of_the_exact_model(b: float) -> None:
    found = identify(BLIND, Observed.of_simulation(motion(b)), known=FAR)
    assert found.way == "sequence"
    assert found.value == pytest.approx(b, rel=1e-10)
    assert found.holds(b)


@pytest.mark.parametrize(("value", "R_c", "R_o", "delay"), [
    # slow: on the grid the first three events are nearer to those of 1.25
    (1.1157174078676704, 9.488780519667834, 0.2701365850908323, 0.0),
    # the third interval is 6.4 s, and other on the grid
    (0.7823407075636001, 0.4614895283958323, 0.4350920083310742, 0.0),
    # the second is 5.3 s; 1.1745 gives the times but not the outputs
    (1.183453319330955, 0.16261506351287042, 0.3885904823288247, 0.02227856241633144),
])  # fmt: skip
def test_an_exact_log_is_explained_where_other_values_explain_its_first_events_better(
    value: float, R_c: float, R_o: float, delay: float
) -> None:
    """Each of these was refused."""
    changes = {"design.R_c": R_c, "design.R_o": R_o, "assumed.delay": delay, "simulation.duration": 60.0}
    unknown = Unknown(PENDULUM.with_(**changes), low=0.4, high=2.0, longest=4.0)
    run = icmj.simulate(icmj.prepare(unknown.at(value)), "linear")
    found = identify(unknown, Observed.of_simulation(run))
    assert found.value == pytest.approx(value, rel=1e-9)


class Drawn(Inverse):
    """Another map from the unknown to the rate: two waves, which end, jump, and vanish where the model is right."""

    def __init__(self, seed: int) -> None:
        super().__init__(BLIND)
        random = np.random.default_rng(seed)
        self.phase, self.ends = random.uniform(0, 6, 2), np.sort(random.uniform([0.5, 1.2], [0.8, 1.5]))
        self.exact, self.jump = random.uniform(0.9, 1.0), random.uniform(1.0, 1.2)

    def rate(self, value: float, rhythm: Rhythm | None = None) -> tuple[float, int]:
        if not self.ends[0] < value < self.ends[1]:
            return float("nan"), 0
        off = value - self.exact
        wave = 1 + 0.4 * np.sin(9 * value + self.phase[0]) + 0.1 * np.sin(23 * value + self.phase[1])
        return float((wave + 0.3 * (value > self.jump)) / (1 - np.log(abs(off) + 1e-300))), -1 if off > 0 else 1


def test_no_value_of_a_dense_scan_is_lost_up_to_the_ends_at_jumps_and_at_extrema() -> None:
    wanted = 0
    for seed in range(30):
        drawn, random = Drawn(seed), np.random.default_rng([seed, 1])
        dense = np.linspace(0.5, 1.5, 20_001)
        rates, signs = np.array([drawn.rate(float(value)) for value in dense]).T
        inside = np.flatnonzero(np.isfinite(rates))
        # at random, beside an end, and beside an extremum
        extrema = [i for i in inside[1:-1] if (rates[i] - rates[i - 1]) * (rates[i + 1] - rates[i]) < 0]
        for i in (random.choice(inside), inside[0] + 3, inside[-1] - 3, random.choice(extrema) + 20):
            target = rates[i] + 1e-9
            crossed = (rates[:-1] - target) * (rates[1:] - target) < 0
            crossed &= (signs[:-1] == signs[1:]) & (abs(np.diff(rates)) < 5e-3)
            found = np.array(drawn.candidates(Rhythm(1 / target, 0, 10)))
            for value in dense[:-1][crossed]:
                wanted += 1
                assert np.abs(found - value - 2.5e-5).min() < 5e-5, (seed, value, found)
            assert all(abs(drawn.rate(float(value))[0] / target - 1) < 1e-6 for value in found)
    assert wanted > 150


@pytest.mark.parametrize("kind", ["log", "times", "samples"])
def test_no_exact_motion_is_refused_though_its_cycle_attracts_slowly(kind: str) -> None:
    """A multiplier of 0.954: after 40 s intervals still alternate by three per cent."""
    run = motion(1.5, **{"simulation.duration": 40.0})
    t = np.arange(0.0, 40.0, 0.04)
    seen = {
        "log": Observed.of_simulation(run),
        "times": Observed.of_times(run.events.t[5:]),
        "samples": Observed.of_samples(t, np.interp(t, run.t, run.y[:, 0])[:, None]),
    }[kind]
    found = identify(replace(BLIND, high=1.6), seen, known=WIDE)
    assert found.holds(1.5), found.words
    assert found.probability is not None
    assert found.probability > 0.01
    if kind != "samples":
        assert all(high - low < 1e-6 for low, high in found.intervals)


@pytest.mark.slow
def test_a_motion_that_begins_far_from_its_cycle_is_explained_by_its_later_events() -> None:
    """Its first interval differs by a tenth, and no small step leads from the orbit to all that follows."""
    delayed = icmj.load_run("simple-1.2").with_(**{"assumed.delay": 0.1, "simulation.duration": 60.0})
    run = motion(1.31, run=delayed)
    found = identify(
        Unknown(delayed.with_(**{"actual.gain": None}), low=1.2, high=1.5), Observed.of_times(run.events.t)
    )
    assert found.holds(1.31), found.words
    assert found.value == pytest.approx(1.31, abs=1e-7)
    assert found.probability is not None
    assert found.probability > 0.01


@pytest.mark.slow
def test_intervals_cover_where_cycles_attract_slowly() -> None:
    """Multipliers of 0.83 to 0.99: times rounded to a millisecond, without a known start."""
    held, widths = [], []
    for b in np.random.default_rng(6).uniform(0.477, 0.53, 5):
        seen = Observed.of_times(np.round(motion(float(b)).events.t[5:], 3))
        found = identify(replace(BLIND, low=0.4, high=0.7), seen, known=LOW)
        held.append(found.holds(float(b)))
        widths += [high - low for low, high in found.intervals]
    assert sum(held) >= 4
    assert np.median(widths) < 1e-4


def test_intervals_that_grow_tell_that_the_model_is_exact() -> None:
    found = identify(BLIND, Observed.of_simulation(motion(1.0)), known=FAR)
    assert found.way == "sequence"
    assert found.value == pytest.approx(1.0, abs=1e-6)


def test_what_the_run_file_says_of_the_unknown_is_not_looked_at() -> None:
    seen = Observed.of_simulation(motion(0.9))
    values = {identify(replace(BLIND, run=PENDULUM.with_(**{"actual.gain": b})), seen).value for b in (0.6, 0.9)}
    assert len(values) == 1
    assert values.pop() == pytest.approx(0.9, rel=1e-8)


def test_times_alone_leave_two_branches_and_say_so() -> None:
    run = motion(1.2)
    found = identify(BLIND, Observed.of_times(np.round(run.events.t[5:], 3)), known=FAR)
    assert found.value is None
    assert len(found.intervals) == 2
    assert found.holds(1.2)
    assert max(high - low for low, high in found.intervals) < 1e-3
    assert "do not distinguish the branches" in found.words


@pytest.mark.parametrize("b", [0.8, 1.2])
def test_a_sampled_output_has_the_rhythm_without_any_event(b: float) -> None:
    run = motion(b)
    t = np.arange(10.0, 40.0, 0.04)
    found = identify(BLIND, Observed.of_samples(t, np.interp(t, run.t, run.y[:, 0])[:, None]), known=FAR)
    assert found.value == pytest.approx(b, rel=1e-4)


def test_of_samples_that_errors_hide_the_answer_says_what_would_tell() -> None:
    """That this motion does not settle, as was said, is wrong: its events tell b, and so do better readings."""
    unknown, value = Unknown(RIPPLE, low=0.8, high=0.95, longest=8.0), 0.8882087791568766
    run, t, known = motion(value, run=RIPPLE), np.arange(10.0, 60.0, 0.04), Inverse(unknown)
    y = np.interp(t, run.t, run.y[:, 0])
    error = 0.01 * np.abs(y).max() * np.random.default_rng(0).normal(size=len(t))
    assert error.std() > y[len(y) // 2 :].std()
    hidden, better = (
        Observed.of_samples(t, (y + part * error)[:, None]).with_errors(0.0, part * error.std()) for part in (1.0, 0.1)
    )
    found = identify(unknown, hidden, known=known)
    assert found.value is None
    assert "do not repeat themselves within their errors" in found.words
    assert "a longer record, readings with smaller errors, or the times of its events may" in found.words
    for seen in (better, Observed.of_times(run.events.t[5:])):
        found = identify(unknown, seen, known=known)
        assert found.holds(value), found.words


def test_any_field_and_any_named_change_can_be_unknown() -> None:
    heavier = PENDULUM.with_(**{"actual.gain": 1.0, "actual.change": [{"what": "gravity", "factor": 1.15}]})
    seen = Observed.of_simulation(icmj.simulate(icmj.prepare(heavier), "linear"))
    gravity = Unknown(PENDULUM.with_(**{"actual.gain": 1.0}), "", icmj.plant.Change("gravity", None, 1.0), 0.8, 1.3)
    assert identify(gravity, seen).value == pytest.approx(1.15, rel=1e-6)
    half = PENDULUM.with_(**{"actual.rho": 0.5})
    seen = Observed.of_simulation(icmj.simulate(icmj.prepare(half), "linear"))
    assert identify(Unknown(PENDULUM, "actual.rho", low=0.1, high=1.4), seen).value == pytest.approx(0.5, rel=1e-6)


def test_the_engine_s_own_cycle_takes_the_nonlinearity_out() -> None:
    seen = Observed.of_simulation(motion(0.85, "mujoco"))
    linear = identify(BLIND, seen, plant="mujoco", refine=False, known=FAR)
    exact = identify(BLIND, seen, plant="mujoco", known=FAR)
    assert linear.value is not None
    assert 1e-6 < abs(linear.value / 0.85 - 1) < 1e-4
    assert exact.value == pytest.approx(0.85, rel=1e-8)


@pytest.mark.slow
@pytest.mark.kernels
def test_motions_that_cannot_tell() -> None:
    sliding = identify(BLIND, Observed.of_times(np.arange(40) * 0.01))
    assert "every interval is the least one, 0.01 s" in sliding.words
    none = identify(BLIND, Observed.of_times(np.arange(10) * 0.05), known=FAR)
    assert "no value between 0.5 and 1.5 predicts" in none.words
    wild = identify(BLIND, Observed.of_times(np.cumsum(np.random.default_rng(0).uniform(0.5, 3.0, 30))))
    assert "does not settle" in wild.words
    # what does not act on the loop leaves no trace in its motion
    without = identify(Unknown(PENDULUM, "simulation.limit", low=1.0, high=2.0), Observed.of_simulation(motion(0.8)))
    exact = identify(Unknown(PENDULUM, "simulation.limit", low=1.0, high=2.0), Observed.of_simulation(motion(1.0)))
    assert "depend on simulation.limit" in without.words
    for found in (sliding, none, wild, without, exact):
        assert (found.value, found.intervals, found.way) == (None, (), "none"), found.words


def test_a_wrong_unknown_and_a_wrong_record_are_errors() -> None:
    seen = Observed.of_times(np.arange(10) * 1.8)
    for unknown in (Unknown(PENDULUM, "actual.gian"), Unknown(PENDULUM, "", icmj.plant.Change("mass", "nobody", 1.0))):
        with pytest.raises(IcmjError):
            identify(unknown, seen)
    for wrong in ([1.0, 2.0], [1.0, 3.0, 2.0, 4.0], [1.0, 2.0, 3.0, np.nan]):
        with pytest.raises(IcmjError):
            Observed.of_times(np.array(wrong))


@pytest.mark.slow
def test_on_the_command_line_from_a_log_times_and_outputs(tmp_path, capsys, shell):
    run = PENDULUM.with_(**{"actual.gain": 0.9, "study.attractor_starts": 0, "study.growth_points": 0})
    result = icmj.run_case(run, "linear")
    log, times, samples = tmp_path / "a.rrd", tmp_path / "times.csv", tmp_path / "angle.csv"
    icmj.write_log(result, log)
    np.savetxt(times, result.simulation.events.t[4:], header="event times (s)")
    t = np.arange(8.0, 40.0, 0.05)
    degrees = np.degrees(np.interp(t, result.simulation.t, result.simulation.y[:, 0]))
    np.savetxt(samples, np.column_stack([t, degrees]), delimiter=",", header="t [s],angle [deg]", comments="")
    capsys.readouterr()
    searched = ["--low", "0.8", "--high", "1.0", "--json"]
    (found,) = shell.answers(["identify", str(log), *searched])
    assert found["value"] == pytest.approx(0.9, rel=1e-8)
    assert found["way"] == "sequence"
    known = ["--run", str(PENDULUM.path), "--plant", "linear"]
    one, two = shell.answers(["identify", str(times), str(samples), *known, *searched])
    assert any(low <= 0.9 <= high for low, high in one["intervals"])
    assert two["value"] == pytest.approx(0.9, rel=1e-4)
    assert "--run must say" in shell.refuses(["identify", str(times)])
    assert len(told(shell.refuses(["identify", str(tmp_path / "none.csv"), *known]))) == 1


def test_of_several_attracting_orbits_the_one_that_a_motion_is_on_gives_the_value(root):
    """At b = 1.325 the three-link person has attracting orbits of 0.1492 and 0.4571 s."""
    run = icmj.load_run(root / "runs" / "three-link-0.9.toml")
    case = icmj.prepare(run.with_(**{"actual.gain": 1.325}))
    inverse = Inverse(Unknown(run, low=1.305, high=1.345))
    attracting = [one for one in case.theory.prediction.orbits if one.verdict == "attracting"]
    assert [one.crossing.delta for one in attracting] == pytest.approx([0.14923, 0.457133], abs=1e-6)
    for one in attracting:
        assert inverse.candidates(Rhythm(one.crossing.delta, one.orbit.sign, 10)) == pytest.approx([1.325], abs=1e-8)
    start = case.theory.system.start(1.001 * attracting[1].orbit.x_bar)
    run_of_it = icmj.simulate(case, "linear", start=start, duration=20.0)
    found = identify(inverse.unknown, Observed.of_times(run_of_it.events.t[10:]), known=inverse)
    assert found.value == pytest.approx(1.325, abs=1e-8)
