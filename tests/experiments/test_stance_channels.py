"""Independent channels on a surface that tilts: their fit, and the experiment from file to figure."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import icmj
from icmj.errors import DataError, IcmjError
from icmj.experiments.stance_channels import StanceChannels, fit_channels

BODY = StanceChannels(60.0, 588.6, 470.88, 4.0)
LINES = np.arange(1, 60) / 60.5


@pytest.mark.parametrize("seed", range(6))
def test_a_fit_returns_the_numbers_put_in(seed):
    random = np.random.default_rng(seed)
    P = random.uniform(0.6, 1.2) * BODY.toppling
    draw = random.uniform
    put = replace(BODY, P=P, D=draw(0.3, 0.6) * P, delay=draw(0.08, 0.22), weight=draw(0.2, 1))
    found = fit_channels(BODY, LINES, put.response(LINES), np.zeros(len(LINES)))
    for name in ("P", "D", "delay", "weight"):
        assert getattr(found, name) == pytest.approx(getattr(put, name), rel=1e-5)


def test_a_still_body_follows_the_surface_and_a_free_one_the_vertical():
    """At low frequencies: W of one alone turns with the surface as stiffness and toppling say."""
    stiff = replace(BODY, P=1e7, weight=1.0)
    assert stiff.response(1e-3) == pytest.approx(1.0, rel=1e-3)
    blind = replace(BODY, stiffness=0.0, damping=0.0, P=1e7, weight=0.0)
    assert abs(blind.response(1e-3)) < 1e-12


def test_too_few_lines_are_refused():
    with pytest.raises(DataError, match="three lines or more"):
        fit_channels(BODY, LINES[:2], np.ones(2, complex), np.zeros(2))


def test_without_noise_the_confidence_intervals_shrink_to_the_value():
    put = replace(BODY, P=470.0, D=270.0, delay=0.15, weight=0.6)
    found = fit_channels(BODY, LINES, put.response(LINES), np.zeros(len(LINES)))
    assert (found.half_widths < 1e-5 * np.array([470.0, 270.0, 0.15, 0.6])).all()


EXPERIMENT = """
[experiment]
name = "tilt"
plants = PLANTS
[perturbed_stance]
size = 0.004
highest = 1.0
axis_height = 0.06
vertical = { lean = 0.4 }
vertical_rate = { lean_rate = 0.4 }
periods = 2
inertia = 60.0
toppling = 588.6
stiffness = 470.88
damping = 4.0
[[case]]
run = "one-link-delayed-pd"
name = "delayed"
set.simulation.disturbance = []
set.simulation.initial = {}
"""


def test_the_experiment_finds_the_channels_that_were_simulated(tmp_path):
    (tmp_path / "tilt.toml").write_text(EXPERIMENT.replace("PLANTS", '["linear"]'))
    done = icmj.run_experiment(tmp_path / "tilt.toml", tmp_path / "out", jobs=1)
    found = done["delayed.linear"].finding
    assert found.measured.remnant < 1e-15
    fitted = found.channels
    assert (fitted.P, fitted.D, fitted.delay, fitted.weight) == pytest.approx((470.88, 270.0, 0.2, 0.6), rel=1e-3)
    # the transfer function of the body that was simulated, not of the fit
    exact = replace(BODY, P=470.88, D=270.0, delay=0.2, weight=0.6).response(found.measured.line)
    np.testing.assert_allclose(found.measured.response, exact, rtol=1e-5)
    # the same trial as a recording: in degrees it has the same channels, and in volts none
    path = tmp_path / "out" / "trials" / "delayed.linear.0000.parquet"
    trial = icmj.read_series(path)
    analyse, degrees = partial(icmj.analyse_recordings, tmp_path / "tilt.toml"), np.degrees(trial.values)
    icmj.write_series(replace(trial, values=degrees, units=("deg", "deg")), tmp_path / "deg.csv")
    again = analyse([tmp_path / "deg.csv"], tmp_path / "again").found[0].finding.channels
    assert (again.P, again.D, again.delay, again.weight) == pytest.approx((470.88, 270.0, 0.2, 0.6), rel=1e-3)
    icmj.write_series(replace(trial, units=("rad", "V")), tmp_path / "volt.csv")
    with pytest.raises(IcmjError, match="body: is in 'V'; expected one of rad, deg"):
        analyse([tmp_path / "volt.csv"], tmp_path / "volts")


def test_events_alone_make_a_remnant_and_continuous_feedback_makes_none(tmp_path):
    """The shipped file's first and last case, on the linear plant."""
    shipped = (Path(icmj.__file__).parent / "shipped/experiments/perturbed-stance.toml").read_text()
    head, delayed, *_, event = shipped.replace(', "mujoco"]', "]").split("[[case]]")
    (tmp_path / "tilt.toml").write_text("[[case]]".join([head, delayed, event]))
    done = icmj.run_experiment(tmp_path / "tilt.toml", tmp_path / "out", jobs=1)
    assert done["delayed.linear"].finding.measured.remnant < 1e-15
    assert done["event.linear"].finding.measured.remnant > 1e-3


@pytest.mark.parametrize(("old", "new", "words"), [
    ("highest = 1.0", "highest = 0.001", "expected between the first line"),
    ("toppling = 588.6", "", "needs both inertia and toppling"),
    ("{ lean = 0.4 }", "{ trunk = 0.4 }", "trunk"),
    ("highest = 1.0", "rate = 33.3", "no whole number of samples"),
])  # fmt: skip
def test_what_cannot_be_is_one_line(old, new, words, tmp_path):
    (tmp_path / "tilt.toml").write_text(EXPERIMENT.replace("PLANTS", '["linear"]').replace(old, new))
    with pytest.raises(IcmjError, match=words):
        icmj.run_experiment(tmp_path / "tilt.toml", tmp_path / "out", jobs=1)


@pytest.mark.slow
def test_confidence_intervals_of_a_fit_contain_what_was_put_in():
    """Of 80 noisy responses each, with the weights of four noisy periods; fewer than 68 of 80 happen to one in 10⁴."""
    put, lines, random = replace(BODY, P=470.0, D=270.0, delay=0.15, weight=0.6), LINES[::2], np.random.default_rng(5)
    truth, exact = np.array([470.0, 270.0, 0.15, 0.6]), put.response(lines)
    size, inside = 0.3 * np.abs(exact) * np.linspace(0.3, 1.5, len(lines)), np.zeros(4)
    for _ in range(80):
        periods = exact + size * (random.normal(size=(4, len(lines))) + 1j * random.normal(size=(4, len(lines))))
        scatter = np.sqrt((np.abs(periods - periods.mean(axis=0)) ** 2).sum(axis=0) / 3)
        found = fit_channels(BODY, lines, periods.mean(axis=0), scatter)
        inside += np.abs([found.P, found.D, found.delay, found.weight] - truth) <= found.half_widths
    assert (inside >= 68).all(), inside
