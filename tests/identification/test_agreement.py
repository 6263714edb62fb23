"""Nothing fits, or it fits, and how well: true motions pass as often as is said, others are refused in one line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest
from terminal_cases import told

import icmj
from icmj.cli.main import main
from icmj.errors import IdentificationError
from icmj.identification.course import LEVEL
from icmj.identification.identification import Identification, identify
from icmj.identification.inversion import Inverse
from icmj.identification.observed import Observed
from icmj.identification.unknown import Unknown

PENDULUM = icmj.load_run("simple-0.8")
BLIND = Unknown(PENDULUM.with_(**{"actual.gain": None}))
FAR = Inverse(replace(BLIND, longest=8.0))
NOISE = {"kind": "noise", "input": "torque", "size": 0.005, "corner": 0.5, "seed": 1, "terms": 20}
NOISY = replace(BLIND, run=BLIND.run.with_(**{"simulation.duration": 60.0, "simulation.disturbance": [NOISE]}))
T = np.arange(0, 40, 0.04)


def motion(b: float, run: icmj.RunFile = PENDULUM, **changes: object) -> icmj.Simulation:
    return icmj.simulate(icmj.prepare(run.with_(**{"actual.gain": b}, **changes)), "linear")


def sampled(run: icmj.Simulation, t: np.ndarray = T) -> np.ndarray:
    return np.interp(t, run.t, run.y[:, 0])[:, None]


def refused(found: Identification) -> bool:
    return (
        (found.value, found.intervals, found.way) == (None, (), "none")
        and found.probability is not None
        and found.probability < LEVEL
        and found.words.startswith("No value of b between 0.5 and 1.5 fits the motion")
        and "\n" not in found.words
    )


@pytest.mark.parametrize(("period", "size"), [(3.6, 0.0093), (3.0, 0.03), (2.5, 0.0093)])
def test_a_sine_with_the_rhythm_of_a_cycle_is_none(period: float, size: float) -> None:
    """Of the amplitude of the cycle, too: then by its shape."""
    found = identify(BLIND, Observed.of_samples(T, size * np.sin(2 * np.pi / period * T)[:, None]), known=FAR)
    assert refused(found), found.words
    assert "the outputs are off by" in found.words


@pytest.mark.slow
@pytest.mark.kernels
def test_outputs_of_another_size_refuse_a_rhythm_and_a_sequence_of_events() -> None:
    for b in (0.8, 1.2, 1.0):
        seen = Observed.of_simulation(motion(b))
        assert identify(BLIND, seen, known=FAR).value == pytest.approx(b, rel=1e-6)
        found = identify(BLIND, replace(seen, outputs=1.5 * seen.outputs), known=FAR)
        assert refused(found), found.words
        assert "are off by" in found.words


def test_times_alone_are_told_to_say_nothing_of_amplitude_and_shape() -> None:
    found = identify(BLIND, Observed.of_times(motion(0.8).events.t[5:]), known=FAR)
    assert found.intervals
    assert "Amplitude and shape were not observed" in found.words


@pytest.mark.slow
def test_true_motions_with_errors_of_times_and_readings_pass_as_often_as_is_said() -> None:
    """Forty motions, from samples and from events with outputs: probabilities are even, and intervals cover."""
    random, t = np.random.default_rng(3), np.arange(20, 60, 0.04)
    probabilities, covered = [], 0
    for b in random.uniform(0.8, 1.2, 40):
        run = motion(float(b), **{"simulation.duration": 60.0})
        timing, reading = 0.01, 3e-4
        y = sampled(run, t + timing * random.standard_normal(len(t)))
        samples = Observed.of_samples(t, y + reading * random.standard_normal(y.shape))
        events = Observed.of_simulation(run)
        moved = events.times + timing * random.standard_normal(len(events.times))
        outputs = events.outputs + reading * random.standard_normal(events.outputs.shape)
        for seen in (samples, replace(events, times=moved, outputs=outputs)):
            found = identify(BLIND, seen.with_errors(timing, reading), known=FAR)
            assert found.probability is not None, (b, found.words)
            probabilities.append(found.probability)
            covered += found.holds(float(b))
    assert sum(p < LEVEL for p in probabilities) <= 2
    assert kstest(probabilities, "uniform").pvalue > 0.01
    assert covered >= 74


def test_errors_beyond_those_allowed_refuse_a_motion_and_larger_ones_allowed_take_it() -> None:
    random, t = np.random.default_rng(4), np.arange(8, 40, 0.04)
    y = sampled(motion(1.2), t) + 5e-4 * random.standard_normal((len(t), 1))
    seen = Observed.of_samples(t, y)
    fits = identify(BLIND, seen.with_errors(None, 5e-4), known=FAR)
    assert fits.holds(1.2)
    assert fits.probability is not None
    assert fits.probability > LEVEL
    assert refused(identify(BLIND, seen.with_errors(None, 3.5e-4), known=FAR))
    # errors that are allowed are told in the width of the interval
    (narrow,), (wide,) = (
        identify(BLIND, Observed.of_simulation(motion(1.2)).with_errors(timing, None), known=FAR).intervals
        for timing in (1e-4, 1e-2)
    )
    assert 50 < (wide[1] - wide[0]) / (narrow[1] - narrow[0]) < 101


@pytest.mark.slow
@pytest.mark.kernels
def test_an_estimate_at_the_edge_of_the_range_says_so() -> None:
    seen = Observed.of_simulation(motion(0.8)).with_errors(0.01, None)
    for low, high, edge in ((0.79995, 1.2, 0.79995), (0.6, 0.80005, 0.80005), (0.6, 1.2, None)):
        found = identify(replace(BLIND, low=low, high=high), seen)
        assert found.holds(0.8)
        assert found.edge == edge
        assert ("reaches the edge of the range" in found.words) is (edge is not None)


def test_under_noise_the_fit_is_named_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = Observed.of_times(np.arange(9.0))
    with pytest.raises(IdentificationError, match=r"simple-0\.8\.toml: has noise, .* infer b by icmj fit"):
        identify(NOISY, seen)
    np.savetxt(tmp_path / "times.csv", seen.times)
    noise = "simulation.disturbance=[{kind='noise', input='torque', size=0.005, corner=0.5, seed=1}]"
    assert main(["identify", str(tmp_path / "times.csv"), "--run", str(PENDULUM.path), "--set", noise]) == 2
    assert "by icmj fit, with a family of this run file" in told(capsys.readouterr().err)[-1]


def test_an_accuracy_that_is_none_is_an_error() -> None:
    for timing, reading in ((-1.0, None), (None, float("nan"))):
        with pytest.raises(IdentificationError, match="expected a standard deviation"):
            Observed.of_times(np.arange(9.0)).with_errors(timing, reading)


@pytest.mark.slow
def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], shell) -> None:
    known = ["--run", str(PENDULUM.path), "--plant", "linear", "--low", "1.0", "--high", "1.4"]
    sine, true = tmp_path / "sine.csv", tmp_path / "true.csv"
    t = np.arange(8, 40, 0.04)
    y = sampled(motion(1.2), t) + 5e-4 * np.random.default_rng(4).standard_normal((len(t), 1))
    for path, values in ((sine, 0.03 * np.sin(2 * np.pi / 2.5 * t)), (true, y[:, 0])):
        np.savetxt(path, np.column_stack([t, values]), delimiter=",", header="t [s],angle [rad]", comments="")
    capsys.readouterr()
    shown = shell.says(["identify", str(sine), *known])
    assert shown.count("\n") == 1
    assert "No value of b between 1 and 1.4 fits the motion" in shown
    assert main(["identify", str(sine), str(true), *known, "--reading", "5e-4", "--timing", "0.001", "--json"]) == 0
    one, two = json.loads(capsys.readouterr().out)
    assert (one["value"], one["intervals"], one["edge"]) == (None, [], None)
    assert one["probability"] < LEVEL < two["probability"]
    assert two["value"] == pytest.approx(1.2, rel=1e-3)
    assert len(told(shell.refuses(["identify", str(true), *known, "--reading", "-1"]))) == 1
