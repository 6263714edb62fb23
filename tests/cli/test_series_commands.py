"""Commands on time series: what they write and print, and one line for what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from report_cases import result

from icmj.cli.main import main
from icmj.log import write_log
from icmj.series.reading import read_series


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "b0.8.linear.rrd"
    write_log(result("b0.8"), path)
    return path


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_export_writes_rows_and_events(log, tmp_path, kind, capsys):
    out = tmp_path / f"run.{kind}"
    assert main(["export", str(log), "--out", str(out)]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {f"run.events.{kind}", f"run.{kind}"}
    rows, events = read_series(out), read_series(tmp_path / f"run.events.{kind}")
    simulation = result("b0.8").simulation
    np.testing.assert_array_equal(rows.t, simulation.t)
    np.testing.assert_array_equal(rows["x.hinge"], simulation.x[:, 0])
    np.testing.assert_array_equal(events["interval"], simulation.events.interval)
    assert rows.units[rows.place("y.angle")] == "rad"
    assert str(out) in capsys.readouterr().out


def test_export_at_a_rate_is_even(log, tmp_path):
    assert main(["export", str(log), "--to", "csv", "--rate", "250", "--out", str(tmp_path / "run.csv")]) == 0
    rows = read_series(tmp_path / "run.csv")
    assert np.diff(rows.t) == pytest.approx(0.004)
    assert rows.t[-1] == pytest.approx(result("b0.8").simulation.t[-1])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["export"], "missing PATH"),
        (["export", "none.rrd"], "none.rrd: no such log"),
        (["export", "LOG", "--rate", "0"], "a rate must be positive"),
        (["export", "LOG", "--rate", "1e12"], "expected at most"),
        (["export", "LOG", "--to", "npz", "--out", "run.csv"], "ends in .npz, as --to says"),
        (["export", "LOG", "--out", "run.xlsx"], "ends in .csv, .parquet, .npz"),
        (["export", "LOG", "--to", "xlsx"], "--to"),
    ],
)
def test_bad_input_is_one_line_status_2_and_no_file(log, arguments, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main([str(log) if word == "LOG" else word for word in arguments]) == 2
    _, err = capfd.readouterr()
    assert len(err.strip().splitlines()) == 1, err
    assert words in err
    assert not list(tmp_path.iterdir())
