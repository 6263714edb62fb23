"""The double-step experiment from its file: told on the linear plant, and refused where it cannot be told."""

import numpy as np
import pytest

import icmj
from icmj.controller.step_pairs import double_steps
from icmj.errors import DataError, RunFileError
from icmj.runfile.reading import parse_toml
from icmj.series.series import Series
from icmj.study.experiment_file import ExperimentFile

T_D = 0.14  # s

TEXT = """
[experiment]
name = "short"
plants = ["linear"]
repetitions = 2
[double_step]
output = "angle"
size = 0.02
isi = [0.1, 0.25, 0.5]
repetitions = 2
recovery = [1.5, 2.0]
[[case]]
run = "simple-exact"
set.assumed.delay = 0.14
set.controller.delta_min = 0.35
set.simulation.initial.hinge = 0.0
"""


def file_of(text, tmp_path) -> ExperimentFile:
    return ExperimentFile.validated(parse_toml(text, tmp_path / "short.toml"), tmp_path / "short.toml", text)


@pytest.mark.slow
def test_an_event_rule_is_told_from_two_trials_and_again_from_their_recordings(tmp_path):
    done = icmj.run_experiment(file_of(TEXT, tmp_path), tmp_path / "out", jobs=1)
    found = done["simple-exact"].finding
    assert found.told.kind == "event"
    assert found.numbers["slope −1 (s)"] == pytest.approx(0.35, abs=0.01)
    expected = 0.14 + np.maximum(0, 0.35 - np.array([0.1, 0.25, 0.5]))
    np.testing.assert_allclose(found.curves["RT2 (s)"], expected, atol=0.02)
    np.testing.assert_array_equal(found.curves["pairs"], 8)
    files = [tmp_path / "out" / "trials" / f"simple-exact.linear.{i:04d}.parquet" for i in (0, 1)]
    first, second = (icmj.read_series(path) for path in files)
    assert first.units[0] == "rad"
    assert len(first) != len(second) or (first["target"] != second["target"]).any()
    again = icmj.analyse_recordings(done.file, files).found[0].finding
    np.testing.assert_array_equal(again.curves["RT2 (s)"], found.curves["RT2 (s)"])
    icmj.write_series(first.chosen(["control"]), tmp_path / "half.csv")
    with pytest.raises(DataError, match="no column 'target'"):
        icmj.analyse_recordings(done.file, [tmp_path / "half.csv"])


def answered(late, tmp_path):
    """What the shipped analysis finds of steps that jumps of the control answer, by ``late(isi, same)`` seconds."""
    pairs = double_steps((0.1, 0.2, 0.3, 0.5, 0.8), 6, recovery=(1.5, 2.0), seed=4)
    seconds = T_D + np.column_stack([0 * pairs.isi, late(pairs.isi, pairs.same)])
    t = 0.01 * np.arange(round(100 * pairs.end))
    target = (t[:, None] >= pairs.t.ravel() - 1e-9) @ pairs.sizes.ravel()
    since = t[:, None] - (pairs.t + seconds).ravel()
    control = np.where(since >= 0, 1 + 1.4 * np.exp(-28 * np.maximum(since, 0)), 0) @ pairs.sizes.ravel()
    series = Series(t, np.column_stack([target, control]), ("target", "control"), ("rad", "N m"))
    icmj.write_series(series, tmp_path / "anna.csv")
    return icmj.analyse_recordings(file_of(TEXT, tmp_path), [tmp_path / "anna.csv"], tmp_path / "out")


def test_who_is_refractory_at_reversals_only_is_so_in_that_direction_and_has_no_pooled_verdict(tmp_path):
    done = answered(lambda isi, same: np.where(same, 0, np.maximum(0, 0.35 - isi)), tmp_path)
    found = done.found[0].finding
    assert found.pooled is found.told is found.refractory is None
    same, reversal = (found.directions[name] for name in ("same direction", "reversal"))
    assert (same.explanation.kind, reversal.explanation.kind) == ("continuous", "event")
    assert reversal.refractory.fixed.value == pytest.approx(0.35, abs=0.01)
    assert same.refractory.fixed.low == 0
    assert same.refractory.fixed.high < 0.1 + 0.01  # what is shorter than the least interval cannot show; and a row
    assert found.numbers["reversal, slope −1 (s)"] == reversal.refractory.fixed.value
    assert not {"slope −1 (s)", "BIC, event", "ISI (s)"} & {*found.numbers, *found.curves}
    assert "directions differ. Same direction: classified as continuous; no refractory period" in found.words
    assert "Reversal: classified as event-driven; a refractory period of 0.35 s" in found.words
    assert "directions differ" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_who_is_refractory_in_both_directions_has_a_pooled_verdict_beside_those_of_both(tmp_path):
    found = answered(lambda isi, same: np.maximum(0, 0.35 - isi), tmp_path).found[0].finding
    assert found.told.kind == "event"
    for name in ("", "same direction, ", "reversal, "):
        assert found.numbers[f"{name}slope −1 (s)"] == pytest.approx(0.35, abs=0.01)
        np.testing.assert_array_equal(found.curves[f"{name}pairs"], 6 if name else 12)
    assert found.words.endswith("from 60 pairs of steps, and the same in both directions.")


def test_directions_of_other_durations_differ(tmp_path):
    found = answered(lambda isi, same: np.maximum(0, np.where(same, 0.25, 0.45) - isi), tmp_path).found[0].finding
    assert found.pooled is None
    assert found.words.startswith("The two directions differ.")


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_a_sampling_delay_is_told_on_both_plants(tmp_path, plant):
    text = TEXT.replace('["linear"]', f'["{plant}"]').replace("isi = [0.1, 0.25, 0.5]", "isi = [0.05, 0.2, 0.3, 0.6]")
    text = text.replace("repetitions = 2\n[double_step]", "repetitions = 1\n[double_step]")
    done = icmj.run_experiment(file_of(text + "set.controller.sampling_delay = 0.12\n", tmp_path), jobs=1)
    found = done["simple-exact"].finding
    assert found.told.kind == "sampling"
    assert 0.05 <= found.told.parameters["sampling"]["d_s"] <= 0.2
    assert found.numbers["slope −1 (s)"] == pytest.approx(0.35, abs=0.01)
    # both steps of the shortest pairs are seen at once, d_s after the first
    np.testing.assert_allclose(found.curves["RT1 (s)"], 0.26, atol=0.02)
    np.testing.assert_allclose(found.curves["RT2 (s)"], [0.21, 0.41, 0.31, 0.26], atol=0.02)


@pytest.mark.parametrize(("before", "after", "words"), [
    ("recovery = [1.5, 2.0]", "recovery = [0.5, 2.0]", "longer than the least recovery"),
    ("recovery = [1.5, 2.0]", "recovery = [2.5, 2.0]", "the shortest time first"),
    ("isi = [0.1, 0.25, 0.5]", "isi = [0.1, 0.25]", "at least 3"),
    ("isi = [0.1, 0.25, 0.5]", "isi = [0.1, 0.1, 0.5]", "an entry is repeated"),
    ("size = 0.02", "size = 0.0", "size"),
])  # fmt: skip
def test_a_table_that_is_wrong_is_refused_in_one_line(before, after, words, tmp_path):
    with pytest.raises(RunFileError, match=words):
        file_of(TEXT.replace(before, after), tmp_path)


HEAD = """
[experiment]
name = "head"
plants = ["linear"]
[double_step]
combination = { shank = 0.4428, thigh = 0.4410, trunk = 0.685 }
unit = "m"
size = 0.01
isi = [0.1, 0.3, 0.6]
repetitions = 3
recovery = [2.5, 3.0]
[[case]]
run = "three-link-0.9"
set.assumed.delay = 0.14
set.actual.gain = 1.0
set.controller.q_t = 0.003
set.controller.delta_min = 0.45
set.simulation.initial.ankle = 0.0
"""


def test_a_head_follows_a_combination_of_angles(tmp_path):
    done = icmj.run_experiment(file_of(HEAD, tmp_path), tmp_path / "out", jobs=1)
    found = done["three-link-0.9"].finding
    assert found.told.kind == "event"
    assert found.numbers["slope −1 (s)"] == pytest.approx(0.45, abs=0.01)
    trial = icmj.read_series(tmp_path / "out" / "trials" / "three-link-0.9.linear.0000.parquet")
    assert trial.units == ("m", "N m")
    assert np.abs(np.diff(trial["target"])).max() == pytest.approx(0.02)


@pytest.mark.parametrize("more", ['output = "shank"\n', None])
def test_one_of_output_and_combination_says_what_follows(more, tmp_path):
    line = HEAD.splitlines(keepends=True)[5]
    text = HEAD.replace(line, line + more) if more else HEAD.replace(line, "")
    with pytest.raises(RunFileError, match="give one of output and combination"):
        file_of(text, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["joystick-0", "joystick-1-unstable", "joystick-2", "joystick-2-unstable"])
def test_a_joystick_is_refractory_for_what_its_file_says(name, tmp_path):
    text = TEXT.replace('"angle"', '"dot"').replace("size = 0.02", "size = 1.0").split("[[case]]")[0]
    text = text.replace("repetitions = 2\n[double_step]", "repetitions = 1\n[double_step]")
    done = icmj.run_experiment(file_of(f'{text}[[case]]\nrun = "{name}"\n', tmp_path), jobs=1)
    found = done[name].finding
    np.testing.assert_allclose(found.refractory.fixed.value, done.file.runs[0].controller.delta_min, atol=0.005)
