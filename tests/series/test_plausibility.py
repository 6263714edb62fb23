"""What no standing person's recording is, is told; so are copies, and trials that stand one below the other."""

import shutil
import subprocess

import numpy as np
import pytest

import icmj
from icmj.errors import DataError, LogError
from icmj.fits import read_trials
from icmj.log.program import find_program
from icmj.series.plausibility import note_oddities
from icmj.series.series import Series

STANDING = '[experiment]\nname = "s"\n[quiet_standing]\n[[case]]\nrun = "simple-0.8"\n'


def sway(seconds=40, seed=1, size=4.0, unit="mm"):
    draw = np.random.default_rng(seed)
    x = np.cumsum(draw.standard_normal(100 * seconds))
    x = size * (x - x.mean()) / x.std()
    return Series(np.arange(len(x)) / 100, x[:, None], ("ap",), (unit,))


def changed(series, rows, value):
    values = series.values.copy()
    values[rows] = value
    return Series(series.t, values, series.names, series.units)


def told(series):
    return note_oddities(series).facts.get("odd", "")


@pytest.mark.parametrize("sentinel", [-9999.0, 9999.0, -999.0, 99999.0])
def test_a_sentinel_is_told(sentinel, tmp_path, shell):
    """−9999 in some rows gave an RMS of 688 mm without a word."""
    icmj.write_series(changed(sway(), slice(100, 120), sentinel), tmp_path / "s.csv")
    (note,) = shell.answers(["measure", str(tmp_path / "s.csv"), "--json"])["notices"]
    assert note == f"ap: {sentinel:g} in 20 of 4000 rows, far from all others, as where values are missing"


def test_a_marker_that_is_lost_at_the_origin_is_told_and_a_sway_about_it_is_not():
    marker = sway()
    marker = Series(marker.t, marker.values + 900.0, marker.names, marker.units)
    assert "ap: 0 in 50 of 4000 rows" in told(changed(marker, slice(700, 750), 0.0))
    assert told(marker) == ""
    assert told(changed(sway(), slice(700, 750), 0.0)) == ""  # a sway about 0 is there now and then


@pytest.mark.parametrize(("unit", "size", "words"), [
    ("mm", 4.0, ""), ("cm", 0.4, ""), ("m", 4.0, "a range of"), ("cm", 40.0, "a range of"), ("N m", 40.0, ""),
    ("N m", 400.0, "a torque of"), ("N mm", 40e3, ""), ("N·mm", 400e3, "a torque of"), ("deg", 4000.0, ""),
    ("", 1e4, ""),
])  # fmt: skip
def test_sway_and_torques_beyond_a_person_s_are_told_in_any_unit(unit, size, words):
    said = told(sway(size=size, unit=unit))
    assert (said == "") if not words else (words in said)


def drifting(size):
    standing = sway(60)
    return Series(standing.t, standing.values + np.linspace(0, size, len(standing))[:, None], ("ap",), ("mm",))


@pytest.mark.parametrize(("factor", "said"), [(1e-3, "1e-05 s"), (1.0, ""), (0.04, ""), (25.0, ""), (1e3, "10 s")])
def test_times_in_another_unit_than_theirs_are_told(factor, said):
    """Milliseconds that are called seconds made speeds a thousandth."""
    standing = sway()
    words = told(Series(factor * standing.t, standing.values, ("y",), ("mm",)))
    assert words == (said and f"rows are {said} apart, and those of people hardly ever; are the times in this unit?")


@pytest.mark.parametrize(("series", "words"), [
    (sway(60, size=0.4), "ap: an RMS of 0.4 mm in 60 s, and those who stand quietly have 1 to 20 mm"),
    (sway(60, size=45.0), "ap: an RMS of 45 mm in 60 s"), (drifting(200.0), "ap: an RMS of 5"),
    (sway(60, size=4.5, unit="cm"), "ap: an RMS of 45 mm in 60 s"), (sway(20, size=0.3), "ap: an RMS of 0.3 mm"),
    (sway(60, size=1.1), ""), (sway(60, size=25.0), ""), (sway(10, size=0.3), ""), (sway(20, size=0.5), ""),
    (drifting(50.0), ""), (sway(60, size=0.4, unit=""), ""), (sway(60, size=0.4, unit="deg"), ""),
    (Series(sway().t, 0.1 * sway().values, ("C7.x",), ("mm",)), ""), (sway(60, size=0.0), ""),
])  # fmt: skip
def test_a_centre_of_pressure_in_a_wrong_unit_or_with_a_drift_is_told(series, words):
    """Centimetres that are called millimetres, and a drift of 0.2 m, were measured without a word."""
    said = told(Series(series.t, np.nan_to_num(series.values), series.names, series.units))
    assert said.startswith(words)
    assert bool(said) == bool(words)


def test_it_is_told_of_recordings_of_an_experiment_too(tmp_path):
    (tmp_path / "s.toml").write_text(STANDING)
    icmj.write_series(sway(size=0.4, unit="m"), tmp_path / "far.csv")
    (note,) = icmj.analyse_recordings(tmp_path / "s.toml", [tmp_path / "far.csv"]).notes
    assert note.startswith("far.csv: ap: a range of")


def test_a_copy_is_no_further_trial(tmp_path, shell):
    """The same file three times was "3 trials, ± 0"."""
    (tmp_path / "s.toml").write_text(STANDING)
    for name in ("a", "b"):
        icmj.write_series(sway(seed=1), tmp_path / f"{name}.csv")
    icmj.write_series(sway(seed=2), tmp_path / "c.csv")
    a, b, c = (tmp_path / f"{name}.csv" for name in "abc")
    for twice in ([a, a], [a, b], [a, c, b]):
        with pytest.raises(DataError, match=f"holds the same values as {a}; a copy is no further trial"):
            icmj.analyse_recordings(tmp_path / "s.toml", twice)
    assert icmj.analyse_recordings(tmp_path / "s.toml", [a, c]).found[0].trials == 2
    said = shell.refuses(["fit", str(a), str(b), "--model", "none.toml"])
    assert f"{b}: holds the same values as {a}; a copy is no further trial" in said


@pytest.mark.parametrize(("seconds", "parts", "note"), [
    (60, 1, None), (100, 1, "cut to its first 60 s, without the last 40 s"), (120, 2, "cut into 2 trials of 60 s"),
    (150, 2, "cut into 2 trials of 60 s, without the last 30 s"),
])  # fmt: skip
def test_what_is_left_out_of_long_records_is_said(seconds, parts, note, tmp_path):
    """Records of 90 to 120 s were not cut, and of longer ones the rest was dropped without a word."""
    icmj.write_series(sway(seconds), tmp_path / "long.csv")
    found = read_trials(tmp_path / "long.csv")
    assert len(found) == parts
    assert all(len(trial.cop) == 6000 for trial in found)
    assert [list(trial.notes) for trial in found] == [[note] if note else []] * parts


def test_measures_of_a_trial_that_is_too_short_for_them_are_those_of_the_others(tmp_path):
    """A trial of 9 s beside one of 60 s made slopes NaN for both."""
    icmj.write_series(sway(60), tmp_path / "long.csv")
    icmj.write_series(sway(9, seed=2), tmp_path / "short.csv")
    (tmp_path / "s.toml").write_text(STANDING)
    alone, both = (
        icmj.analyse_recordings(tmp_path / "s.toml", [tmp_path / f"{name}.csv" for name in names]).found[0].finding
        for names in (["long"], ["long", "short"])
    )
    assert both.numbers["ap, H, long times"] == alone.numbers["ap, H, long times"]
    assert np.isfinite(both.numbers["ap, H, long times"])
    assert "some measures are of fewer trials, as 1 of 2 are too short for them" in both.words
    assert "fewer trials" not in alone.words


def test_two_recordings_in_one_log_are_refused(tmp_path):
    """Merged by rerun's own command, one was read and the other lost."""
    for name in ("simple-0.8", "simple-1.2"):
        case = icmj.prepare(icmj.load_run(name).with_(**{"simulation.duration": 2.0}))
        icmj.write_log(icmj.run_case(case.run, plant="linear"), tmp_path / f"{name}.rrd")
    merged = tmp_path / "both.rrd"
    command = [find_program(), "rrd", "merge", "-o", merged, tmp_path / "simple-0.8.rrd", tmp_path / "simple-1.2.rrd"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    for read in (icmj.read_log, icmj.log.read_summary):
        with pytest.raises(LogError, match="2 recordings in one file; a log has one"):
            read(merged)
    shutil.copy(tmp_path / "simple-0.8.rrd", merged)
    assert icmj.read_log(merged).run.case.name == "simple-0.8"


def test_trials_one_below_the_other_and_lost_markers_are_told_once_where_times_go_on(tmp_path, shell):
    """Two trials of 3.81 and 7.62 whose times go on were one of 11.67, without a word."""
    first, second = sway(15, seed=1, size=3.81).values[:, 0], sway(15, seed=2, size=7.62).values[:, 0]
    both = np.concatenate([first, second + 15])
    series = Series(np.arange(3000) / 100, np.column_stack([both, 0.5 * both]), ("ap", "ml"), ("mm", "mm"))
    icmj.write_series(series, tmp_path / "both.csv")
    (note,) = shell.answers(["measure", str(tmp_path / "both.csv"), "--json"])["notices"]
    assert note.startswith("ap, ml: a jump after 14.99 s, such as no sway makes; are trials one below the other")
    (trial,) = read_trials(tmp_path / "both.csv", ["ap"])
    assert any("a jump after 14.99 s" in note for note in trial.notes)
    near = changed(sway(), slice(700, 750), 0.0)
    near.values[:700] += 20
    near.values[750:] += 20
    assert "ap: a jump after 6.99 s, and 1 later" in told(near)


@pytest.mark.parametrize("rate", [25.0, 100.0, 1000.0])
def test_sway_control_that_jumps_often_steps_of_a_stimulus_and_what_an_event_resets_are_not_doubted(rate):
    """Brownian motion and white noise, whose steps are Gaussian; jumps in every second; one step of a stimulus."""
    t = np.arange(round(60 * rate)) / rate
    for seed in range(5):
        draw = np.random.default_rng(seed)
        for x in (np.cumsum(draw.standard_normal(len(t))) / np.sqrt(rate), draw.standard_normal(len(t))):
            assert told(Series(t, 4 * x[:, None], ("ap",), ("mm",))) == ""
    often, rarely = np.sin(t) + 5 * (np.floor(t) % 2), np.where(t < 30, 0.0, 5.0)
    assert told(Series(t, np.column_stack([often, rarely]), ("ap", "stimulus"), ("mm", "deg"))) == ""
    events = np.floor(t / 12)
    reset = np.column_stack([np.sin(t) + 5 * events, events])
    assert told(Series(t, reset, ("cop.x", "interval"), ("mm", ""))) == ""


@pytest.mark.parametrize("name", ["Fx", "Fz1", "force.z", "plate1.force.x", "GRF_z", "F"])
def test_a_force_in_a_unit_of_length_is_told(name):
    series = sway()
    renamed = Series(series.t, series.values, (name,), ("mm",))
    assert told(renamed) == f"{name}: a force by its name, and in mm; what is it?"
    assert told(Series(series.t, series.values, (name,), ("N",))) == ""
    assert told(Series(series.t, series.values, ("forefoot",), ("mm",))) == ""


def test_one_value_between_others_is_told_and_stillness_before_a_push_is_not():
    filled = sway()
    filled.values[500:600] = filled.values[500]
    assert told(filled) == "ap: one value for 0.99 s from 5 s on, as where a gap is filled or a sensor at its end"
    still = changed(sway(), slice(0, 300), 0.0)
    still.values[300:] -= still.values[300]
    assert told(still) == ""
    assert "less than a force plate sees of who stands" in told(sway(size=4e-3))
