"""The frame of experiments: trials kept, taken up again and analysed as recordings; and what it refuses."""

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from terminal_cases import told as signs_apart

import icmj
from icmj.engine.reaction import ground_force
from icmj.errors import DataError, IcmjError, RunFileError, StudyError
from icmj.runfile.reading import parse_toml
from icmj.simulation.settings import reseed
from icmj.study.experiment import conditions_of, resume_experiment, trial
from icmj.study.experiment_file import ExperimentFile
from icmj.work.shipped import EXPERIMENTS

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


CASES = ("own", "continuous")


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
        *(".lock", "experiment.json", "trials", "results.parquet", "summary.json"),
        *("figure.png", "figure.svg", "report.html", "SHA256SUMS"),
    }
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


def test_two_processes_are_not_at_one_folder(tmp_path):
    file, out = file_of(TEXT, tmp_path), tmp_path / "out"
    script = (
        "import sys; from icmj.study.experiment_file import load_experiment as load\n"
        "from icmj.study.experiment import resume_experiment\n"
        "with resume_experiment(sys.argv[2], load(sys.argv[1])):\n    print('there', flush=True); sys.stdin.read()"
    )
    (tmp_path / "short.toml").write_text(TEXT)
    command = [sys.executable, "-c", script, str(tmp_path / "short.toml"), str(out)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "there\n"
        words = rf"another experiment \(process {other.pid}\) is writing there; wait for it, or choose another --out"
        with pytest.raises(StudyError, match=words):
            icmj.run_experiment(file, out, jobs=1)
        other.kill()  # the lock goes with it
    with resume_experiment(out, file):
        pass


def test_it_goes_on_where_it_ended_with_the_same_numbers(done, tmp_path):
    folder, experiment = done
    again = tmp_path / "again"
    again.mkdir()
    (again / "trials").mkdir()
    kept = (folder / "trials").glob("*.0000*.parquet")
    for path in (folder / "experiment.json", folder / "SHA256SUMS", *kept):
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


def test_recordings_from_the_command_line(done, tmp_path, shell):
    folder, _ = done
    series = icmj.read_series(folder / "trials" / "own.linear.0000.parquet").chosen(["force.x", "force.z", "cop.x"])
    icmj.write_series(series, tmp_path / "plate.csv")
    words = ["experiment", str(tmp_path / "short.toml"), "--recording", str(tmp_path / "plate.csv"), "--json"]
    (tmp_path / "short.toml").write_text(TEXT)  # a copy as CSV does not say that its first 2 s are left out already
    assert "8.01 s of record; settle and duration ask for 10 s" in shell.refuses([*words, "--out", f"{tmp_path}/out"])
    (tmp_path / "short.toml").write_text(TEXT.replace("duration = 8.0\nsettle = 2.0\n", ""))
    told = shell.answers([*words, "--out", str(tmp_path / "out")])["found"]
    assert told[0]["plant"] == "recording"
    assert told[0]["numbers"]["z at 1 Hz (m)"] > 0
    bad = icmj.Series(series.t, series.values, series.names)
    icmj.write_series(bad, tmp_path / "plain.csv")
    (said,) = signs_apart(shell.refuses([*words[:3], str(tmp_path / "plain.csv"), "--out", str(tmp_path / "out")]))
    assert "plain.csv: force.x: has no unit" in said


@pytest.mark.parametrize(("before", "after", "words"), [
    ("[intersection_point]", "[other]", "other"),
    ("[intersection_point]\nduration = 8.0\nsettle = 2.0", "", "expected one table of"),
    ('control = "continuous"', 'control = "clock"', "interval is that of control"),
    ('name = "continuous"', 'name = "own"', "two cases are called 'own'"),
    ('run = "quiet-standing"', 'run = "quiet-sitting"', "did you mean quiet-standing"),
    ("q_t = 0.004", "q_z = 0.004", r"case\[1\].set"),
    ("repetitions = 2", "repetitions = 0", "at least 1"),
    ("duration = 8.0", "duration = -1.0", "duration"),
    ("duration = 8.0", "rate = 1e9", "rate"),
])  # fmt: skip
def test_a_file_that_is_wrong_is_refused_in_one_line(before, after, words, tmp_path):
    assert before in TEXT
    with pytest.raises(RunFileError, match=words):
        file_of(TEXT.replace(before, after), tmp_path)


def test_a_plant_by_matrices_has_no_weight(tmp_path):
    (tmp_path / "matrices.toml").write_text(
        '[case]\nname = "m"\ntitle = "m"\n[assumed]\nA = [[0.0, 1.0], [1.0, 0.0]]\nB = [[0.0], [1.0]]\n'
        "C = [[1.0, 0.0]]\n[controller]\nq_t = 0.01\n"
    )
    text = TEXT.replace("quiet-standing", "matrices.toml").replace("set.controller.q_t = 0.004", "")
    with pytest.raises(IcmjError, match="needs a model"):
        icmj.run_experiment(file_of(text, tmp_path), tmp_path / "out", jobs=1)
    assert not (tmp_path / "out").exists()  # nothing was done, so nothing is kept
    only = text.replace('["linear"]', '["mujoco"]')
    with pytest.raises(RunFileError, match="given by matrices"):
        icmj.run_experiment(file_of(only, tmp_path), jobs=1)


@pytest.mark.parametrize("name", sorted(EXPERIMENTS.files))
def test_shipped_ones_validate(name):
    file = icmj.load_experiment(name)
    assert file.experiment.name == name
    assert file.path.stem == name


FORCES = {"force.x": "N", "force.z": "N", "cop.x": "m"}
STEPS, SINES, SWAY = {"target": "rad", "control": "N m"}, {"stimulus": "N m", "u": "N m"}, {"cop.x": "mm"}
REMNANT = (
    Path(EXPERIMENTS.files["remnant"])
    .read_text(encoding="utf-8")
    .replace("[multisine]", '[multisine]\nresponse = "u"')
    .replace("periods = 6\nsettle = 3\n", "")
)


def recording(columns, rows=6000, of=None):
    """A slow random motion of some columns at 100 Hz, one of them another one."""
    t, draw = 0.01 * np.arange(rows), np.random.default_rng(1)
    values = 1e-3 * np.cumsum(draw.standard_normal((rows, len(columns))), axis=0)
    values[:, [name == "force.z" for name in columns]] += 700
    if of is not None:
        values[:, 0] = of(t)
    return icmj.Series(t, values, tuple(columns), tuple(columns.values()))


@pytest.mark.parametrize(("name", "series", "words"), [
    ("intersection-point", recording(FORCES, rows=300), "windows|rows|shorter"),
    ("intersection-point", recording(FORCES | {"force.z": ""}), r"force.z: has no unit; .*'force.z \[N\]'"),
    ("intersection-point", recording(FORCES | {"cop.x": "s"}), "cop.x: is in 's'; expected one of m"),
    ("standing", recording(SWAY, rows=10), "10 (values|rows)"),
    ("standing", recording({"cop.x": ""}), "cop.x: has no unit"),
    ("remnant", recording(SINES, of=lambda t: np.sin(2 * np.pi * 0.137 * t)), "not periodic in 10 s|no power"),
    ("remnant", recording(SINES, rows=1500, of=lambda t: np.sin(0.2 * np.pi * t)), "1 whole periods of 10 s"),
    (
        "remnant",
        recording(SINES | {"u": ""}, of=lambda t: np.sin(0.2 * np.pi * t)),
        "u: has no unit|response: has no unit",
    ),
    ("double-step", recording(STEPS, of=lambda t: (t > 5) & (t < 5.3)), "1 pairs of steps; expected at least 4"),
    (
        "double-step",
        recording(STEPS | {"target": ""}, of=lambda t: (t > 5) & (t < 5.3)),
        "target is 0 in some rows and then 1; .* or give it a unit",
    ),
    ("double-step-joystick", recording(STEPS), "moves from row to row"),
    ("double-step-head", recording({"target": "m"}), "no column 'control'"),
    ("double-step-head", recording(STEPS, rows=300, of=lambda t: 0 * t), "never moves"),
])  # fmt: skip
def test_a_shipped_analysis_refuses_what_it_cannot_tell_in_one_line(name, series, words, tmp_path):
    if name == "remnant":
        file = ExperimentFile.validated(parse_toml(REMNANT, tmp_path / "r.toml"), tmp_path / "r.toml", REMNANT)
    else:
        file = icmj.load_experiment(name)
    icmj.write_series(series, tmp_path / "recording.csv")
    with pytest.raises(DataError, match=words) as refused:
        icmj.analyse_recordings(file, [tmp_path / "recording.csv"], tmp_path / "out")
    assert str(refused.value).startswith(f"{tmp_path / 'recording.csv'}: ")
    assert not (tmp_path / "out").exists()


def test_a_folder_of_results_belongs_to_its_recordings(tmp_path):
    """Another recording replaced results, figure and page, and nothing told whose they were."""
    file = icmj.load_experiment("standing")
    t, random = np.arange(3000) / 100, np.random.default_rng(3)
    for name in ("anna", "ben"):
        sway = np.cumsum(random.standard_normal((3000, 1)), axis=0)
        icmj.write_series(icmj.Series(t, sway / sway.std(), ("cop.x",), ("mm",)), tmp_path / f"{name}.csv")
    anna, ben, out = tmp_path / "anna.csv", tmp_path / "ben.csv", tmp_path / "out"
    icmj.analyse_recordings(file, [anna], out)
    source = json.loads((out / "experiment.json").read_text())["recordings"]
    assert source[0]["name"] == "anna.csv"
    assert source[0]["sha256"] == hashlib.sha256(anna.read_bytes()).hexdigest()
    kept = (out / "results.parquet").read_bytes()
    icmj.analyse_recordings(file, [anna], out)
    other = file_of(file.text.replace("low_pass = 10.0", "low_pass = 9.0"), tmp_path)
    for made, others, part, words in (
        (file, [ben], {}, "of the recordings anna.csv"),
        (file, [anna, ben], {}, "of the recordings anna.csv"),
        (file, [anna], {"since": 5.0}, "of another part or rate of anna.csv"),
        (other, [anna], {}, "of another experiment file"),
    ):
        with pytest.raises(StudyError, match=f"holds another experiment, {words}; choose another --out"):
            icmj.analyse_recordings(made, others, out, **part)
    with pytest.raises(StudyError, match="holds another experiment, of recordings; choose another"):
        icmj.run_experiment(file, out)
    anna.write_bytes(ben.read_bytes())
    with pytest.raises(StudyError, match=r"holds another experiment, of anna\.csv, changed since; choose another"):
        icmj.analyse_recordings(file, [anna], out)
    assert (out / "results.parquet").read_bytes() == kept


def test_a_rate_that_the_times_contradict_is_refused(tmp_path, shell):
    """It had no effect, and nothing said so."""
    t = np.arange(4000) / 100
    sway = np.cumsum(np.random.default_rng(3).standard_normal((4000, 1)), axis=0)
    icmj.write_series(icmj.Series(t, 4 * sway / sway.std(), ("ap",), ("mm",)), tmp_path / "a.csv")
    path, words = str(tmp_path / "a.csv"), "has times, of 100 rows a second, where a rate of 50 Hz was said"
    given = ["--recording", path, "--out", str(tmp_path / "out"), "--rate"]
    assert words in shell.refuses(["experiment", "standing", *given, "50"])
    shell.answers(["experiment", "standing", *given, "100", "--json"])
    assert words in shell.refuses(["fit", path, "--rate", "50", "--model", "none.toml"])


def test_rows_and_events_of_a_trial_are_counted_from_the_same_instant(tmp_path):
    """Both from ``settle`` on: laid over each other, they were as far apart as that is long."""
    file = file_of(TEXT, tmp_path)
    kind, (own, _) = file.settings, conditions_of(file)
    found = trial(kind, own, 3)
    case = icmj.prepare(kind.stimulate(own.run, 3))
    run = icmj.simulate(replace(case, settings=reseed(case.settings, 3)), "linear")
    late = run.events.t[run.events.t >= 2.0]
    assert 0 < len(late) < len(run.events)
    np.testing.assert_allclose(found.events, late - 2.0, atol=1e-12)
    rows = np.searchsorted(run.t, found.series.t + 2.0 - 1e-9)
    force = ground_force(case.actual, run)
    for name in ("force.x", "cop.x"):
        np.testing.assert_allclose(found.series[name], force[name][rows], atol=1e-9 * np.abs(force[name]).max())


def test_continuous_control_has_no_events(done):
    """What stands for it in a simulation, a clock of a few milliseconds, was reported as intervals of 5 ms."""
    folder, _ = done
    counts = {case: pq.read_table(folder / "trials" / f"{case}.linear.0000.events.parquet").num_rows for case in CASES}
    assert counts["own"] > 10
    assert counts["continuous"] == 0
