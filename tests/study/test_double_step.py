"""The double-step experiment from its file: told on the linear plant, and refused where it cannot be told."""

import numpy as np
import pytest

import icmj
from icmj.errors import DataError, RunFileError
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.runfile.reading import parse_toml

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
