"""What speaks against a result is said before it, and what laboratories record as a stimulus is analysed."""

import numpy as np
import pytest

import icmj
from icmj.controller.step_pairs import double_steps
from icmj.errors import DataError
from icmj.experiments import explain_reactions
from icmj.experiments.refractoriness import analyse_reactions
from icmj.experiments.stance_channels import StanceChannels, fit_channels
from icmj.series.series import Series
from icmj.simulation.ternary import make_ternary_lines
from icmj.study.experiment_file import ExperimentFile

BODY = StanceChannels(60.0, 588.6, 100.0, 4.0, 800.0, 250.0, 0.15, 0.6)
STANCE = {
    "size": 0.0175, "interval": 0.05, "highest": 1.0, "inertia": 60.0, "toppling": 588.6, "stiffness": 100.0,
    "damping": 4.0,
}  # fmt: skip


def tilt(scale=1.0, noise=0.0, step=0.01, digits=None, error=0.0, periods=6):
    """A tilt of half a degree about 0, whose lines a body answers as its channels do, times ``scale``."""
    period, draw = 242 * 0.05, np.random.default_rng(1)
    lines = make_ternary_lines(0.0175, 0.05, 1.0)
    t = step * np.arange(round(periods * period / step))
    turns = np.exp(1j * (np.outer(t, lines[:, 1]) + lines[:, 2])) * lines[:, 0]
    stimulus, body = turns.sum(axis=1).real, (turns @ BODY.response(lines[:, 1] / (2 * np.pi))).real * scale
    body = body + noise * body.std() * draw.standard_normal(len(t))
    stimulus = stimulus + error * stimulus.std() * draw.standard_normal(len(t))
    values = np.degrees(np.column_stack([stimulus, body]))
    return Series(t, values if digits is None else values.round(digits), ("stimulus", "body"), ("deg", "deg"))


def stance(series, path, **changes):
    icmj.write_series(series, path / "trial.csv")
    data = {"experiment": {"name": "s"}, "perturbed_stance": {**STANCE, **changes}, "case": [{"run": "simple-0.8"}]}
    file = ExperimentFile.validated(data, path / "s.toml")
    return icmj.analyse_recordings(file, [path / "trial.csv"]).found[0].finding


def test_a_fit_that_fits_begins_with_the_remnant(tmp_path):
    found = stance(tilt(noise=0.02), tmp_path)
    assert found.channels.doubts == ()
    assert "Not to be relied on" not in found.words
    assert (found.channels.P, found.channels.weight) == pytest.approx((800.0, 0.6), rel=0.05)


def test_a_body_of_the_wrong_sign_is_said_first_to_have_no_channels(tmp_path):
    """P 1.18e+04 (−6.07e+05 to 6.3e+05), weight −0.5 were told like any, both at their bounds."""
    found = stance(tilt(scale=-1.0, noise=0.02), tmp_path)
    assert found.words.startswith("Not to be relied on: ")
    first = found.words.partition(". ")[0]
    assert "at an end of the range sought" in first
    assert "% of the power" in found.words


def test_an_interval_as_wide_as_the_range_is_said(tmp_path):
    lines = np.array([0.1, 0.3, 0.9])  # as many numbers as parameters, nearly: nothing is certain
    draw = np.random.default_rng(3)
    noise = draw.standard_normal(3) + 1j * draw.standard_normal(3)
    found = fit_channels(BODY, lines, BODY.response(lines) + 0.8 * noise, np.ones(3))
    wide = 2 * found.half_widths > np.array([20 * 588.6, 5 * found.P, 0.6, 2.0])
    assert wide.any()
    assert any("as wide as the range sought" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("shown", [
    {"digits": 3}, {"error": 0.01}, {"error": 0.1}, {"step": 0.01 * (1 + 2e-6)}, {"step": 0.01 * (1 - 2e-6)},
])  # fmt: skip
def test_a_stimulus_as_it_is_recorded_is_analysed(shown, tmp_path):
    """Three decimals of a degree, 1 % of noise and a clock off by 2 ppm were "not periodic in 60.5 s"."""
    found = stance(tilt(noise=0.02, **shown), tmp_path)
    fitted = found.channels
    assert (fitted.P, fitted.D, fitted.delay, fitted.weight) == pytest.approx((800.0, 250.0, 0.15, 0.6), rel=0.1)
    share = found.measured.off_lines
    # of noise of e times the stimulus, what is not at the lines: all but a few lines of thousands
    assert share == pytest.approx(shown.get("error", 0.0) ** 2 / (1 + shown.get("error", 0.0) ** 2), rel=0.1, abs=1e-4)
    assert ("of the stimulus's power is off its lines" in found.words) == (share > 1e-6)


def test_what_is_no_stimulus_of_these_lines_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"stimulus: .* % of its power is off the lines"):
        stance(tilt(error=0.3), tmp_path)


def test_a_record_of_another_clock_keeps_its_periods():
    """Its period is 1210.0024 or 1209.9976 samples; the last of two periods must not be lost to 0.005 of one."""
    for step in (0.01 * (1 + 2e-6), 0.01 * (1 - 2e-6), 0.01 * (1 + 2e-5)):
        series = tilt(step=step, periods=2)
        lines = make_ternary_lines(0.0175, 0.05, 1.0)[:, 1] / (2 * np.pi)
        found = icmj.multisine(series, "stimulus", "body", period=12.1, lines=lines)
        assert found.periods == 2
        np.testing.assert_allclose(found.response, BODY.response(lines), rtol=1e-3)


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_a_spread_of_a_row_or_two_is_no_clock(seed, rows):
    """A constant reaction time whose responses begin at every row, or every second one: was called clock-driven."""
    draw = np.random.default_rng(seed)
    isi = np.repeat([0.1, 0.2, 0.3, 0.5, 0.8], 60) + 0.01 * (draw.random(300) - 0.5)
    times = draw.random(300)[:, None] + np.column_stack([np.zeros(300), isi])
    begin = 0.01 * rows * np.ceil((times + 0.2) / (0.01 * rows))
    assert explain_reactions(isi, begin - times, 0.01).kind == "continuous"


def test_the_interval_of_a_clock_is_told():
    draw, isi, D = np.random.default_rng(2), np.repeat([0.1, 0.2, 0.3, 0.5, 0.8], 12), 0.35
    phase = D * draw.random(len(isi))
    rt = 0.14 + np.column_stack([phase, np.mod(phase - isi, D)]) + 0.005 * draw.standard_normal((len(isi), 2))
    told = analyse_reactions(isi, rt, 0.01)
    assert told.explanation.kind == "clock"
    interval = told.explanation.parameters["clock"]["D"]
    assert interval == pytest.approx(D, abs=0.02)
    assert told.words.startswith(f"classified as clock-driven, with an interval of {interval:.3g} s;")


def test_reaction_times_at_an_end_of_their_range_are_said_first(tmp_path):
    """Responses later than latest lie at its end, or nowhere."""
    pairs = double_steps((0.1, 0.2, 0.3, 0.5), 4, recovery=(2.0, 2.5), seed=4)
    t = 0.01 * np.arange(round(100 * pairs.end))
    target = (t[:, None] >= pairs.t.ravel() - 1e-9) @ pairs.sizes.ravel()
    since = t[:, None] - (pairs.t + np.random.default_rng(1).choice([0.2, 0.6], pairs.t.shape)).ravel()
    control = np.where(since >= 0, 1 + 1.4 * np.exp(-28 * np.maximum(since, 0)), 0) @ pairs.sizes.ravel()
    control = control + 0.01 * np.random.default_rng(2).standard_normal(len(t))
    icmj.write_series(
        Series(t, np.column_stack([target, control]), ("target", "control"), ("rad", "N m")), tmp_path / "late.csv"
    )

    def words(latest):
        data = {
            "experiment": {"name": "s"},
            "double_step": {
                "output": "angle", "size": 1.0, "isi": [0.1, 0.2, 0.3, 0.5], "recovery": [2.0, 2.5], "latest": latest,
            },
            "case": [{"run": "simple-0.8"}],
        }  # fmt: skip
        file = ExperimentFile.validated(data, tmp_path / "s.toml")
        return icmj.analyse_recordings(file, [tmp_path / "late.csv"]).found[0].finding.words

    assert "Not to be relied on" not in words(1.0)
    assert words(0.4).startswith("Not to be relied on: ")
