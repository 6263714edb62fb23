"""Quiet standing: the measures are those of `icmj measure`, intervals those of the events; what is refused."""

from pathlib import Path

import numpy as np
import pytest

import icmj
from icmj.errors import DataError
from icmj.experiments import Recording
from icmj.experiments.quiet_standing import YOUNG_PEOPLE


def recording(seed: int, events=(), outcome: str = "", unit: str = "m") -> Recording:
    random = np.random.default_rng(seed)
    x = np.cumsum(random.standard_normal(1000)) * 1e-3
    return Recording(icmj.Series(np.arange(1000) / 50, x[:, None], ("cop",), (unit,)), np.array(events), outcome)


def test_measures_are_those_of_measure_sway_and_fallen_trials_are_left_out():
    trials = [recording(0, [0.3, 0.9, 1.0]), recording(1, [0.2, 0.7]), recording(2, outcome="fell")]
    found = icmj.quiet_standing(trials, low_pass=5.0, resamples=9)
    alone = [icmj.measure_sway(one.series, low_pass=5.0).coordinates[0] for one in trials[:2]]
    np.testing.assert_array_equal(found.measures["cop.rms"], [one.rms for one in alone])
    np.testing.assert_array_equal(found.measures["cop.short.H"], [one.diffusion.short.H for one in alone])
    np.testing.assert_allclose(found.intervals, [0.6, 0.1, 0.5], rtol=1e-12)
    assert found.interval_modes is None  # of three intervals
    assert found.numbers["cop, RMS (m)"] == pytest.approx(np.mean([one.rms for one in alone]))
    assert len(found.curves["trial"]) == 2
    assert all(len(values) == 2 for values in found.curves.values())
    assert len(found.positions) == 2000


def test_what_cannot_be_told_is_refused_in_one_line():
    for trials, words in (
        ([recording(0, outcome="fell")], "all 1 fell"),
        ([], "no trial"),
        ([recording(0, unit="")], "has no unit"),
        ([recording(0), recording(1, unit="mm")], "other signals or units"),
    ):
        with pytest.raises(DataError, match=words):
            icmj.quiet_standing(trials)


def test_words_give_millimetres_and_the_scatter_over_trials():
    trials = [recording(0, [0.3, 0.9, 1.0]), recording(1, [0.2, 0.7])]
    found = icmj.quiet_standing(trials, resamples=9)
    rms = 1e3 * found.measures["cop.rms"]
    assert f"cop has an RMS of {rms.mean():.3g} ± {rms.std(ddof=1):.2g} mm" in found.words
    assert " of 2 trials" in found.words
    assert found.deviations["cop, RMS (m)"] == pytest.approx(1e-3 * rms.std(ddof=1))
    alone = icmj.quiet_standing(trials[:1], resamples=9)
    assert not alone.deviations
    assert "±" not in alone.words


def test_values_of_young_people_are_those_of_the_table_that_comes_with_the_examples():
    """In SI units; the rows of the table are in millimetres."""
    path = Path(__file__).parents[2] / "examples" / "young_people.csv"
    rows = [line.split(";") for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    table = {name: (float(mean), float(spread)) for name, at, mean, spread in rows[1:] if not at}
    names = ("RMS (mm)", "mean speed (mm/s)", "slope of the spectrum", "mean frequency (Hz)")
    names += ("H, short times", "H, long times")
    for name, (key, values), factor in zip(names, YOUNG_PEOPLE.items(), (1e3, 1e3, 1, 1, 1, 1), strict=True):
        np.testing.assert_allclose(factor * np.array(values), table[name], rtol=1e-12, err_msg=f"{name}, {key}")
