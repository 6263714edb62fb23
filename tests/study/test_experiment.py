"""The frame of experiments: trials kept, taken up again and analysed as recordings; and what it refuses."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import icmj
from icmj.cli.main import main
from icmj.errors import DataError, IcmjError, RunFileError, StudyError
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.runfile.reading import parse_toml
from icmj.runfile.shipped import EXPERIMENTS

TEXT = """
[experiment]
name = "short"
plants = ["linear"]
repetitions = 2
[intersection_point]
duration = 8.0
settle = 2.0
[[case]]
run = "quiet-standing"
name = "own"
[[case]]
run = "quiet-standing"
name = "continuous"
control = "continuous"
set.controller.q_t = 0.004
"""


def file_of(text: str, tmp_path) -> ExperimentFile:
    return ExperimentFile.validated(parse_toml(text, tmp_path / "short.toml"), tmp_path / "short.toml", text)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("experiment")
    return folder, icmj.run_experiment(file_of(TEXT, folder), folder, jobs=1)


def test_all_of_it_stands_in_the_folder(done):
    folder, experiment = done
    assert [f"{told.case}.{told.plant}" for told in experiment.found] == ["own.linear", "continuous.linear"]
    assert {path.name for path in folder.iterdir()} == {
        "experiment.json", "trials", "results.parquet", "summary.json", "figure.png", "figure.svg", "report.html"
    }  # fmt: skip
    rows = pq.read_table(folder / "results.parquet")
    assert set(rows["case"].to_pylist()) == {"own", "continuous"}
    numbers = json.loads((folder / "summary.json").read_text())["found"][0]["numbers"]
    assert numbers == pytest.approx(dict(experiment["own"].finding.numbers), nan_ok=True)
    assert "own" in (folder / "report.html").read_text()
    with pytest.raises(DataError, match="no case 'other'"):
        experiment["other"]


def test_seeds_differ_and_the_case_stays_the_same(done):
    folder, _ = done
    first, second = (icmj.read_series(folder / "trials" / f"own.linear.{i:04d}.parquet") for i in (0, 1))
    assert first.units[first.place("cop.x")] == "m"
    assert not np.allclose(first["cop.x"], second["cop.x"])
    np.testing.assert_allclose(first.t, np.arange(801) / 100, atol=1e-9)


def test_it_goes_on_where_it_ended_with_the_same_numbers(done, tmp_path):
    folder, experiment = done
    again = tmp_path / "again"
    again.mkdir()
    (again / "trials").mkdir()
    for path in (folder / "experiment.json", *(folder / "trials").glob("*.0000*.parquet")):
        (again / path.relative_to(folder)).write_bytes(path.read_bytes())
    marks = {path: path.stat().st_mtime_ns for path in (again / "trials").iterdir()}
    resumed = icmj.run_experiment(file_of(TEXT, folder), again, jobs=1)
    assert {path: path.stat().st_mtime_ns for path in marks} == marks
    for told, before in zip(resumed.found, experiment.found, strict=True):
        for name, curve in before.finding.curves.items():
            np.testing.assert_array_equal(told.finding.curves[name], curve)
    with pytest.raises(StudyError, match="holds another experiment"):
        icmj.run_experiment(file_of(TEXT.replace("0.004", "0.005"), folder), again, jobs=1)


@pytest.mark.slow
def test_two_processes_find_the_same(done):
    folder, experiment = done
    other = icmj.run_experiment(file_of(TEXT, folder), jobs=2)
    for told, before in zip(other.found, experiment.found, strict=True):
        np.testing.assert_array_equal(told.finding.curves["z (m)"], before.finding.curves["z (m)"])


def test_a_trial_is_a_recording_like_anybody_s(done):
    folder, experiment = done
    files = [folder / "trials" / f"own.linear.{i:04d}.parquet" for i in (0, 1)]
    found = icmj.analyse_recordings(experiment.file, files)["own.linear.0000"].finding
    np.testing.assert_array_equal(found.curves["z (m)"], experiment["own"].finding.curves["z (m)"])
    with pytest.raises(DataError, match="no recording"):
        icmj.analyse_recordings(experiment.file, [])


def test_recordings_from_the_command_line(done, tmp_path, capsys):
    folder, _ = done
    series = icmj.read_series(folder / "trials" / "own.linear.0000.parquet").chosen(["force.x", "force.z", "cop.x"])
    icmj.write_series(series, tmp_path / "plate.csv")
    (tmp_path / "short.toml").write_text(TEXT)
    words = ["experiment", str(tmp_path / "short.toml"), "--recording", str(tmp_path / "plate.csv"), "--json"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    told = json.loads(capsys.readouterr().out)["found"]
    assert told[0]["plant"] == "recording"
    assert told[0]["numbers"]["z at 1 Hz (m)"] > 0
    bad = icmj.Series(series.t, series.values, series.names)
    icmj.write_series(bad, tmp_path / "plain.csv")
    assert main([*words[:3], str(tmp_path / "plain.csv"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "plain.csv: force.x: has no unit" in said


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("[intersection_point]", "[other]", "other"),
        ("[intersection_point]\nduration = 8.0\nsettle = 2.0", "", "expected one table of"),
        ('control = "continuous"', 'control = "clock"', "interval is that of control"),
        ('name = "continuous"', 'name = "own"', "two cases are called 'own'"),
        ('run = "quiet-standing"', 'run = "quiet-sitting"', "did you mean quiet-standing"),
        ("q_t = 0.004", "q_z = 0.004", r"case\[1\].set"),
        ("repetitions = 2", "repetitions = 0", "at least 1"),
        ("duration = 8.0", "duration = -1.0", "duration"),
        ("duration = 8.0", "rate = 1e9", "rate"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(before, after, words, tmp_path):
    assert before in TEXT
    with pytest.raises(RunFileError, match=words) as refused:
        file_of(TEXT.replace(before, after), tmp_path)
    assert "\n" not in str(refused.value)


def test_a_plant_by_matrices_has_no_weight(tmp_path):
    (tmp_path / "matrices.toml").write_text(
        '[case]\nname = "m"\ntitle = "m"\n[assumed]\nA = [[0.0, 1.0], [1.0, 0.0]]\nB = [[0.0], [1.0]]\n'
        "C = [[1.0, 0.0]]\n[controller]\nq_t = 0.01\n"
    )
    text = TEXT.replace("quiet-standing", "matrices.toml").replace("set.controller.q_t = 0.004", "")
    with pytest.raises(IcmjError, match="needs a model"):
        icmj.run_experiment(file_of(text, tmp_path), jobs=1)
    only = text.replace('["linear"]', '["mujoco"]')
    with pytest.raises(RunFileError, match="given by matrices"):
        icmj.run_experiment(file_of(only, tmp_path), jobs=1)


@pytest.mark.parametrize("name", sorted(EXPERIMENTS.files))
def test_shipped_ones_validate(name):
    file = icmj.load_experiment(name)
    assert file.experiment.name == name
    assert file.path.stem == name
