"""Response and remnant of a multi-sine, against exact theory, known noise and what cannot be told."""

import numpy as np
import pytest

import icmj
from icmj.errors import DataError, RunFileError
from icmj.runfile.reading import parse_toml
from icmj.study.experiment_file import ExperimentFile

LINES = (0.2, 0.6, 1.0, 2.2)
TEXT = """
[experiment]
name = "sines"
plants = ["linear"]
[multisine]
input = "torque"
amplitude = 0.05
period = 5.0
lines = [0.2, 0.6, 1.0, 2.2]
periods = 4
settle = 6
[[case]]
run = "simple-0.8"
name = "continuous"
control = "continuous"
[[case]]
run = "simple-0.8"
name = "intermittent"
"""
# a rival: delayed feedback of angle and rate that is never switched off
RIVAL = """
[case]
name = "rival"
title = "rival"
[assumed]
A = [[0.0, 1.0], [1.0, 0.0]]
B = [[0.0], [1.0]]
C = [[1.0, 0.0], [0.0, 1.0]]
outputs = ["angle", "rate"]
inputs = ["torque"]
delay = 0.1
units = { angle = "rad", rate = "rad/s", torque = "N m" }
[controller]
kind = "switching"
position = "angle"
rate = "rate"
P = 2.0
D = 2.0
switches = false
"""


def run_of(text, tmp_path):
    file = ExperimentFile.validated(parse_toml(text, tmp_path / "sines.toml"), tmp_path / "sines.toml", text)
    return icmj.run_experiment(file, jobs=1)


@pytest.mark.parametrize("by", ["input", "setpoint"])
def test_linear_loops_leave_nothing_and_intermittent_control_leaves_more(by, tmp_path):
    text = TEXT
    if by == "setpoint":  # of the threshold's size: beside a large stimulus a threshold is small
        text = TEXT.replace('input = "torque"', 'setpoint = "angle"').replace("0.05", "0.01")
    done = run_of(text, tmp_path)
    linear, event = done["continuous"].finding, done["intermittent"].finding
    assert linear.measured.remnant < 1e-20  # of rounding, squared
    np.testing.assert_allclose(linear.measured.response, linear.theory, rtol=1e-6)
    np.testing.assert_allclose(linear.measured.coherence, 1.0, atol=1e-12)
    assert linear.measured.explained(linear.theory) == pytest.approx(1.0, abs=1e-11)
    assert event.measured.remnant > 0.01
    assert event.measured.explained() <= 1 - event.measured.remnant + 1e-12
    assert event.numbers["explained by continuous control"] <= event.measured.explained()


def test_a_rival_that_reads_delayed_outputs_is_linear_too(tmp_path):
    (tmp_path / "rival.toml").write_text(RIVAL)
    text = TEXT.partition("[[case]]")[0] + '[[case]]\nrun = "rival.toml"\n'
    found = run_of(text, tmp_path)["rival"].finding
    assert found.measured.remnant < 1e-20
    np.testing.assert_allclose(found.measured.response, found.theory, rtol=1e-6)


def series_of(noise: float, seed: int, P: int = 8) -> icmj.Series:
    """A gain of 2 and a lag, and white noise on top; 20 Hz, period 5 s."""
    random, t = np.random.default_rng(seed), np.arange(100 * P) / 20
    u = sum(np.cos(2 * np.pi * f * t + k) for k, f in enumerate(LINES))
    y = sum(2 * np.cos(2 * np.pi * f * t + k - 0.3) for k, f in enumerate(LINES))
    y = y + noise * random.standard_normal(len(t))
    return icmj.Series(t, np.column_stack([u, y]), ("u", "y"), ("N m", "rad"))


def test_confidence_remnant_and_coherence_are_those_of_known_noise():
    inside, remnant, coherence = [], [], []
    for seed in range(200):
        found = icmj.multisine(series_of(3.0, seed), "u", "y", period=5.0, lines=LINES)
        inside.append(np.abs(found.response - 2 * np.exp(-0.3j)) <= found.radius)
        remnant.append(found.remnant)
        coherence.append(found.coherence)
    assert found.unit == "rad/(N m)"
    # 800 circles: 0.95 ± four deviations
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 800))
    # noise of variance 9 beside four lines of 2²/2, less what is at the four lines
    assert np.mean(remnant) == pytest.approx(9 / 17 * (1 - 4 / 400), abs=0.01)
    assert 0.5 < np.mean(coherence) < 1
    silent = icmj.multisine(series_of(0.0, 0), "u", "y", period=5.0, lines=LINES)
    np.testing.assert_allclose(silent.response, 2 * np.exp(-0.3j), rtol=1e-10)
    assert silent.explained(np.ones(4)) == pytest.approx(1 - abs(2 * np.exp(-0.3j) - 1) ** 2 / 4)


def test_several_trials_add_their_periods():
    both = icmj.multisine([series_of(3.0, 1), series_of(3.0, 2)], "u", "y", period=5.0, lines=LINES)
    one = icmj.multisine(series_of(3.0, 1), "u", "y", period=5.0, lines=LINES)
    assert (both.periods, one.periods) == (16, 8)
    assert np.mean(both.radius) < np.mean(one.radius)


@pytest.mark.parametrize(("changes", "words"), [
    ({"lines": (0.25,)}, "whole multiples of 1 / period"),
    ({"lines": (0.2, 0.6, 1.0)}, "off the lines"),
    ({"lines": (*LINES, 3.0)}, "has no power at one of the lines"),
    ({"lines": (*LINES, 12.0)}, "not below half the rate"),
    ({"period": 5.03, "lines": (1 / 5.03,)}, "off the lines|no power"),
    ({"period": 30.0, "lines": (1.0,)}, "expected at least 2"),
    ({"lines": ()}, "whole multiples"),
    ({"signal": "z"}, "no column 'z'"),
])  # fmt: skip
def test_what_cannot_be_told_is_refused_in_one_line(changes, words):
    given = {"stimulus": "u", "signal": "y", "period": 5.0, "lines": LINES} | changes
    with pytest.raises(DataError, match=words):
        icmj.multisine(series_of(0.1, 0), **given)


def test_units_lengths_and_models_must_fit():
    good = series_of(0.1, 0)
    plain = icmj.Series(good.t, good.values, good.names)
    with pytest.raises(DataError, match="has no unit"):
        icmj.multisine(plain, "u", "y", period=5.0, lines=LINES)
    with pytest.raises(DataError, match="trials differ"):
        icmj.multisine([good, series_of(0.1, 0, P=4)], "u", "y", period=5.0, lines=LINES)
    with pytest.raises(DataError, match="expected one number for each"):
        icmj.multisine(good, "u", "y", period=5.0, lines=LINES).explained([1.0])


@pytest.mark.parametrize(("before", "after", "words"), [
    ("0.6,", "0.65,", "no whole multiple of 1 / period"),
    ("0.6,", "0.2,", "a frequency is repeated"),
    ('input = "torque"', "", "one of input and setpoint"),
    ("period = 5.0", "period = 5.0\nrate = 77.77", "no whole number of samples"),
    ("2.2]", "60.0]", "not below half the rate"),
    ("periods = 4", "periods = 1", "at least 2"),
    ("amplitude = 0.05", "amplitude = 0.0", "amplitude"),
])  # fmt: skip
def test_a_stimulus_that_is_wrong_is_refused_in_one_line(before, after, words, tmp_path):
    assert before in TEXT
    with pytest.raises(RunFileError, match=words):
        run_of(TEXT.replace(before, after), tmp_path)


def test_a_recording_is_analysed_by_its_columns(tmp_path):
    icmj.write_series(series_of(0.5, 1), tmp_path / "joystick.parquet")
    text = TEXT.replace("settle = 6", 'settle = 3\nstimulus = "u"\nresponse = "y"')
    file = ExperimentFile.validated(parse_toml(text, tmp_path / "s.toml"), tmp_path / "s.toml", text)
    found = icmj.analyse_recordings(file, [tmp_path / "joystick.parquet"])["joystick"].finding
    np.testing.assert_allclose(np.abs(found.measured.response), 2.0, rtol=0.1)
    assert np.isnan(found.numbers["explained by continuous control"])


def test_a_trial_of_the_experiment_is_a_recording_of_the_same_result(tmp_path):
    """Its first sample was left out, and the last one, which begins the next period, was analysed instead."""
    file = ExperimentFile.validated(parse_toml(TEXT, tmp_path / "s.toml"), tmp_path / "s.toml", TEXT)
    done = icmj.run_experiment(file, tmp_path / "out", jobs=1)
    trial = tmp_path / "out" / "trials" / "intermittent.linear.0000.parquet"
    text = TEXT.replace("settle = 6", 'settle = 6\nresponse = "response"')
    named = ExperimentFile.validated(parse_toml(text, tmp_path / "s.toml"), tmp_path / "s.toml", text)
    found = icmj.analyse_recordings(named, [trial]).found[0].finding.curves
    for name in ("real", "imag", "radius", "power"):
        np.testing.assert_array_equal(found[name], done["intermittent"].finding.curves[name])
