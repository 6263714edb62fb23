"""What ``icmj fit`` refuses, in one line each, before anything is simulated; and people by a table."""

import os
import re

import numpy as np
import pytest

from icmj.cli.commands.fit import FitCommand, list_people
from icmj.errors import FitError
from icmj.fits.recording_tables import MOST
from icmj.fits.recordings import TrialOf
from icmj.work.shipped import FAMILIES


@pytest.fixture
def recording(tmp_path):
    generator = np.random.default_rng(0)
    x = np.cumsum(generator.normal(size=(6000, 2)), axis=0)
    x = 5 * (x - x.mean(axis=0)) / x.std(axis=0)
    rows = "\n".join(f"{i / 100:.2f},{a:.6f},{b:.6f}" for i, (a, b) in enumerate(x))
    path = tmp_path / "anna.csv"
    path.write_text(f"t [s],first [mm],second [mm]\n{rows}\n")
    return path


@pytest.mark.parametrize(("more", "line"), [
    ((), "no family; give --model"),
    (("--model", "event", "--table", "people.csv"), "either recordings or --table"),
    (("--model", "event", "--simulations", "10"), "--simulations 10: expected at least 200"),
    (("--model", "event", "--draws", "1"), "--draws 1: expected at least 100"),
    (("--model", "event", "--hold-out", "-1"), "--hold-out -1: expected at least 0"),
    (("--model", "event", "--jobs", "0"), "--jobs 0: expected at least 1"),
    (("--model", "event"), "which column is front to back"),
])  # fmt: skip
def test_one_line_each(recording, more, line, shell, tmp_path) -> None:
    (said,) = shell.refuses(["fit", str(recording), *more, "--out", str(tmp_path / "out")]).splitlines()
    assert line in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("family", "known"), [("event", False), ("delayed-pd", False), (None, True)])
def test_a_delay_is_said_not_to_be_identified_before_anything_is_simulated(
    family, known, recording, shell, tmp_path, monkeypatch
) -> None:
    def end(*_, **__):
        raise FitError("here the simulations would begin")

    if family is None:  # a family whose delay is known
        text = (FAMILIES.folder / "delayed-pd.toml").read_text()
        text = re.sub(r'\[\[parameter\]\]\nname = "delay"\n(?:.+\n)+', "", text)
        family = tmp_path / "mine.toml"
        family.write_text(text.replace('run = "', f'run = "{FAMILIES.folder}/'))
    monkeypatch.setattr("icmj.fits.network.library", lambda: None)
    monkeypatch.setattr("icmj.fits.fit.fit", end)
    told = ["fit", str(recording), "--columns", "first", "--model", str(family), "--out", str(tmp_path / "out")]
    said = shell.refuses(told)
    assert "here the simulations would begin" in said
    assert ("the delay cannot be identified from quiet standing" in said) is not known


@pytest.mark.parametrize(("table", "line"), [
    ("file,who\nanna.csv,anna\n", "no column 'person'"),
    ("file,person,age\nanna.csv,anna,30\n", "unknown column 'age'"),
    ("file,person\n", "lists no people"),
    ("file,person\nanna.csv,\n", "line 2: lacks the file or the person"),
    ("file,person\n\nanna.csv\n", "line 3: lacks the file or the person"),
    ("file,person\nanna.csv,anna,first\n", "line 2: has 3 cells, and the header 2"),
    ("file,person,file\nanna.csv,anna,anna.csv\n", "has the column 'file' twice"),
    ("file,person,column\nanna.csv,anna,first\n./anna.csv,anna,first\n", "./anna.csv is given twice for anna"),
    ("file,person\n" + "anna.csv,anna\n" * 900_000, "has 12.6 MB or more; expected at most 10 MB"),
    ('file,person\n"anna.csv,anna\n', "is not a table of text (unexpected end of data)"),
    ("file,person\n/dev/zero,anna\n", "/dev/zero"),
    ("file,person\npipe,anna\n", "pipe"),
    ("file,person,column\nanna.csv,anna,third\n", "third"),
    ("file,person\nberta.csv,berta\n", "berta.csv"),
])  # fmt: skip
def test_a_wrong_table_is_one_line(recording, table, line, shell, tmp_path) -> None:
    path = tmp_path / "people.csv"
    path.write_text(table)
    os.mkfifo(tmp_path / "pipe")
    (said,) = shell.refuses(["fit", "--table", str(path), "--model", "event"]).splitlines()
    assert line in said


@pytest.mark.parametrize("name", ["people.csv", "BDSinfo.txt"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "large"])
def test_a_table_that_is_no_file_is_one_line(name, kind, shell, tmp_path) -> None:
    """A pipe was waited for without end, and 6.4 GB of a device were read."""
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        with path.open("wb") as file:
            file.truncate(20_000_000)
    said = shell.refuses(["fit", "--table", str(path), "--model", "event"]).strip()
    words = "has 20 MB or more; expected at most 10 MB" if kind == "large" else f"{name} is a {kind}, not a file"
    assert said == f"icmj: {path}: cannot be read ({words})"


def test_names_of_columns_may_have_spaces_around_them(recording, tmp_path) -> None:
    path = tmp_path / "people.csv"
    path.write_text("\ufefffile , person, column\n anna.csv , anna ,first\n\nanna.csv,anna,second\n", encoding="utf-8")
    (found,) = list_people(FitCommand(model=("event",), table=path))
    assert (found.label, len(found.trials)) == ("anna", 2)


def test_many_rows_are_refused_before_any_recording_is_read(tmp_path, monkeypatch) -> None:
    """Of 900,000 rows each copied those of the same person before it, without a word, for minutes."""

    def trial(path):
        return TrialOf("ap", np.full(1, float(path.name)))

    monkeypatch.setattr("icmj.fits.recordings.read_trials", lambda path, *_, **__: (trial(path),))
    path = tmp_path / "people.csv"
    path.write_text("file,person\n" + "".join(f"{i},a\n" for i in range(MOST + 1)))
    with pytest.raises(FitError, match=f"lists more than {MOST} recordings; fit them in parts"):
        list_people(FitCommand(model=("event",), table=path))
    path.write_text("file,person\n" + "".join(f"{i},a\n" for i in range(MOST)))
    shares: list[float] = []
    (found,) = list_people(FitCommand(model=("event",), table=path), lambda _, done: shares.append(done))
    assert len(found.trials) == len(shares) == MOST
    assert shares[-1] == 1
    monkeypatch.setattr("icmj.fits.recordings.read_trials", lambda path, *_, **__: (trial(path),) * 2)
    with pytest.raises(FitError, match=f"hold more than {MOST} trials"):
        list_people(FitCommand(model=("event",), table=path))


def test_a_table_says_whose_trials_belong_together(recording, tmp_path) -> None:
    path = tmp_path / "people.csv"
    rows = ["first,anna,old,open", "second,anna,old,open", "first,anna,old,closed", "second,ben,young,open"]
    path.write_text("file,column,person,group,condition\n" + "\n".join(f"anna.csv,{row}" for row in rows))
    found = list_people(FitCommand(model=("event",), table=path, hold_out=1))
    assert [(one.label, one.group, len(one.trials)) for one in found] == [
        ("anna, open", "old", 2), ("anna, closed", "old", 1), ("ben, open", "young", 1),
    ]  # fmt: skip
    assert found[0].held == 1
    assert np.std(found[0].trials[0]) == pytest.approx(0.005)
