"""Long tables: trials one below the other are read, measured, analysed and fitted as the files of each would be."""

import numpy as np
import pandas as pd
import pytest

import icmj
from icmj.errors import DataError, FitError
from icmj.fits import read_trials
from icmj.series.reading import read_long_table, read_series
from icmj.series.series import Series

ROWS, RATE = 4000, 100.0
EACH = [(person, condition, trial) for person in ("P1", "P2") for condition in ("open", "closed") for trial in (1, 2)]
LABELS = ["subject_id", "condition", "trial"]


def walk(seed):
    x = np.cumsum(np.random.default_rng(seed).standard_normal((ROWS, 2)), axis=0)
    return np.round(4 * (x - x.mean(axis=0)) / x.std(axis=0), 5)  # mm


@pytest.fixture(scope="module")
def frame():
    """Eight trials; as exporters write them, each with times of its own."""
    parts = []
    for seed, labels in enumerate(EACH):
        part = pd.DataFrame(walk(seed), columns=["ap [mm]", "ml [mm]"])
        part.insert(0, "t [s]", np.arange(ROWS) / RATE)
        parts.append(part.assign(**dict(zip(LABELS, labels, strict=True))))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture
def written(frame, tmp_path):
    """A function that writes the table, or a part of it, in a format."""

    def write(suffix=".csv", table=frame):
        path = tmp_path / f"long{suffix}"
        if suffix == ".csv":
            table.to_csv(path, index=False)
        elif suffix == ".parquet":
            table.astype({"condition": "category"}).to_parquet(path)
        else:
            texts = {name: np.array(table[name], dtype=str) for name in ("subject_id", "condition")}
            np.savez(path, **{name: table[name].to_numpy() for name in table if name not in texts}, **texts)
        return path

    return write


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
@pytest.mark.parametrize("order", ["one below the other", "sorted by time", "without times"])
def test_each_trial_is_as_in_a_file_of_its_own(suffix, order, frame, written):
    table = frame.sort_values("t [s]", kind="stable") if order == "sorted by time" else frame
    table = table.drop(columns="t [s]") if order == "without times" else table
    trials = read_long_table(written(suffix, table), rate=RATE)
    assert [tuple(one.facts[key] for key in ("person", "condition", "trial")) for one in trials] == [
        (person, condition, str(trial)) for person, condition, trial in EACH
    ]
    for seed, one in enumerate(trials):
        np.testing.assert_array_equal(one.values, walk(seed))
        assert one.t == pytest.approx(np.arange(ROWS) / RATE)
        assert one.names == ("ap", "ml")
        assert not set(LABELS) & set(one.facts.get("left out", "").replace(",", "").split())


def test_a_reader_of_one_series_refuses_several(written):
    with pytest.raises(
        DataError, match=r"8 trials one below the other \(person P1, condition open, trial 1; .*; \.\.\.\)"
    ):
        read_series(written())


def test_a_table_with_one_trial_is_one_series(frame, written):
    path = written(table=frame[:ROWS])
    np.testing.assert_array_equal(read_series(path).values, walk(0))
    assert read_series(path).names == ("ap", "ml")
    # a column that is asked for by name is a signal
    assert set(read_series(path, columns=["trial"])["trial"]) == {1.0}


def test_rows_at_the_end_without_anything_are_none_and_others_need_labels(frame, written):
    path = written()
    path.write_text(path.read_text() + ",,,,,\n,,,,,\n")
    assert len(read_long_table(path)) == len(EACH)
    for label in LABELS:  # as spreadsheets with merged cells write them
        merged = frame.astype({label: object})
        merged.loc[merged.index % ROWS > 0, label] = None
        with pytest.raises(DataError, match=r"row 2 has no (person|condition|trial); write it into every row"):
            read_long_table(written(table=merged))


def test_a_fault_names_its_trial(frame, written):
    table = frame.copy()
    table.loc[ROWS + 7, "t [s]"] = 0.0
    with pytest.raises(DataError, match="person P1, condition open, trial 2: times do not rise at row 8"):
        read_long_table(written(table=table))


def test_many_labels_do_not_overflow(tmp_path):
    rows = "\n".join(f"{i // 4},{i // 4},{i // 4},{i // 4},{i // 4},{i % 4},{i}.5" for i in range(8000))
    (tmp_path / "many.csv").write_text(f"person,subject,participant,condition,trial,t [s],ap [mm]\n{rows}\n")
    trials = read_long_table(tmp_path / "many.csv")
    assert len(trials) == 2000
    assert trials[1234].facts["person"] == "1234, 1234, 1234"
    np.testing.assert_array_equal(trials[1234]["ap"], 4 * 1234 + np.arange(4) + 0.5)
    rows = "\n".join(f"{i},{i},0.5" for i in range(10_001))
    (tmp_path / "many.csv").write_text(f"trial,t [s],ap [mm]\n{rows}\n")
    with pytest.raises(DataError, match="more than 10000 trials one below the other; cut it into parts"):
        read_long_table(tmp_path / "many.csv")


def test_measure_gives_each_trial(written, shell):
    path = written()
    found = shell.answers(["measure", str(path), "--json"])
    assert [(one["person"], one["condition"], one["trial"]) for one in found] == [
        (person, condition, str(trial)) for person, condition, trial in EACH
    ]
    alone = icmj.measure_sway(Series(np.arange(ROWS) / RATE, walk(5), ("ap", "ml"), ("mm", "mm")))
    assert [one["rms"] for one in found[5]["coordinates"]] == pytest.approx([one.rms for one in alone.coordinates])
    assert "long.csv, person P2, condition closed, trial 2: 40 s at 100 Hz" in shell.says(["measure", str(path)])


def test_an_experiment_has_a_result_for_each_person_and_condition(written, tmp_path):
    (tmp_path / "s.toml").write_text('[experiment]\nname = "s"\n[quiet_standing]\n[[case]]\nrun = "simple-0.8"\n')
    done = icmj.analyse_recordings(tmp_path / "s.toml", [written()], tmp_path / "out")
    assert [(one.title, one.trials) for one in done.found] == [
        (f"person {person}, condition {condition}", 2) for person in ("P1", "P2") for condition in ("open", "closed")
    ]
    files = []
    for trial in (0, 1):
        files.append(tmp_path / f"{trial}.csv")
        icmj.write_series(Series(np.arange(ROWS) / RATE, walk(2 + trial), ("ap", "ml"), ("mm", "mm")), files[-1])
    alone = icmj.analyse_recordings(tmp_path / "s.toml", files).found[0]
    assert done.found[1].finding.numbers == pytest.approx(alone.finding.numbers, nan_ok=True)
    with pytest.raises(DataError, match="person P1, condition open, trial 1: holds the same values as"):
        icmj.analyse_recordings(tmp_path / "s.toml", [written(), written()])


def test_a_fit_takes_people_and_conditions_from_the_table(written, tmp_path):
    from icmj.cli.commands.fit import FitCommand, list_people

    path = written()
    trials = read_trials(path, ["ap"])
    assert (trials[3].name, trials[3].person, trials[3].condition) == (
        "person P1, condition closed, trial 2, ap", "P1", "closed",
    )  # fmt: skip
    people = list_people(FitCommand(recordings=(path,), columns=("ap",)))
    assert [(one.name, one.condition, len(one.trials)) for one in people] == [
        (person, condition, 2) for person in ("P1", "P2") for condition in ("open", "closed")
    ]
    (tmp_path / "people.csv").write_text(f"file,person\n{path.name},anna\n")
    with pytest.raises(FitError, match="holds several people; give it instead of --table"):
        list_people(FitCommand(table=tmp_path / "people.csv", columns=("ap",)))
