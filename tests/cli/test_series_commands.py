"""Commands on time series: what they write and print, and one line for what they refuse."""

import numpy as np
import pytest
from report_cases import result, swaying
from terminal_cases import told

from icmj import read_series, write_log
from icmj.cli.main import main


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


def test_measure_prints_a_table(log, root, shell):
    shown = shell.says(["measure", str(root / "examples" / "standing.csv"), "--rate", "100"])
    assert "60 s at 100 Hz" in shown
    row = next(line for line in shown.splitlines() if "mean speed" in line)
    assert row.split()[-1] == "0.6202"
    shown = shell.says(["measure", str(log), "--since", "6"])
    assert "y.angle (deg)" in shown
    assert "54" in shown


def test_measure_json_has_every_measure(root, shell):
    file = str(root / "examples" / "standing.csv")
    found = shell.answers(["measure", file, "--rate", "100", "--low-pass", "10", "--band", "0.15", "5", "--json"])
    assert [c["name"] for c in found["coordinates"]] == ["ap", "ml"]
    assert found["coordinates"][0]["unit"] == "cm"
    assert found["plane"]["ellipse"]["area"] == pytest.approx(0.9447, rel=1e-3)
    assert found["low_pass"] == 10
    assert 0.15 < found["coordinates"][0]["frequencies"]["mean"] < 5
    assert found["coordinates"][0]["diffusion"]["short"]["H"] > 0.5
    assert len(found["spectrum"]["power"]) == 2


def test_measure_takes_the_centre_of_pressure_from_a_torque(log, shell):
    found = shell.answers(["measure", str(log), "--torque", "u.torque", "--weight", "700", "--json"])
    rows = result("b0.8").to_series(100.0)
    assert found["coordinates"][0]["name"] == "cop"
    assert found["coordinates"][0]["rms"] == pytest.approx(rows["u.torque"].std() / 700)


def test_measure_takes_the_centre_of_pressure_of_who_stands_on_a_floor(root, tmp_path, shell):
    write_log(swaying(result("b0.8")), tmp_path / "floor.rrd")
    assert "cop.x (mm)" in shell.says(["measure", str(tmp_path / "floor.rrd")])


FILES = {
    "gap.csv": "t,a\n" + "".join(f"{t:.2f},1\n" for t in np.arange(0, 9, 0.01) if not 3 < t < 4),
    "nan.csv": "t,a\n" + "".join(f"{t:.2f},{'nan' if t > 5 else t}\n" for t in np.arange(0, 9, 0.01)),
    "short.csv": "t [s],a\n0,1\n1,2\n",
    "wide.csv": ("t [s]," + ",".join("abcdefgh") + "\n") + "0,1,1,1,1,1,1,1,1\n1,1,1,1,1,1,1,1,1\n",
    "clockless.csv": "a,b\n1,2\n3,4\n",
    "words.csv": "once upon a time\nthere was no table\n",
}


@pytest.mark.parametrize(("arguments", "words"), [
    (["export"], "the following arguments are required: PATH"),
    (["export", "none.rrd"], "none.rrd: no such log"),
    (["export", "LOG", "--rate", "0"], "a rate must be positive"),
    (["export", "LOG", "--rate", "1e12"], "expected at most"),
    (["export", "LOG", "--to", "npz", "--out", "run.csv"], "ends in .npz, as --to says"),
    (["export", "LOG", "--out", "run.xlsx"], "ends in .csv, .parquet, .npz"),
    (["export", "LOG", "--to", "xlsx"], "--to"),
    (["measure"], "the following arguments are required: PATH"),
    (["measure", "none.csv"], "none.csv: cannot be read (No such file"),
    (["measure", "none.rrd"], "none.rrd: no such log"),
    (["measure", "gap.csv"], "gap.csv: a gap of 1 s after 3 s"),
    (["measure", "nan.csv"], "nan.csv: a: 399 of 900 values are missing or not finite, the first at 5.01 s"),
    (["measure", "short.csv"], "short.csv: 2 rows; expected at least 20"),
    (["measure", "short.csv", "--since", "9"], "short.csv: no rows from 9 s; it has rows from 0 to 1 s"),
    (["measure", "wide.csv"], "wide.csv: 8 signals (a, b, c, d, ...); name up to 6 by --columns"),
    (["measure", "clockless.csv"], "say with --rate how many rows a second has"),
    (["measure", "words.csv"], "no rows of numbers"),
    (["measure", "LOG", "--columns", "hip"], "no column 'hip'"),
    (["measure", "LOG", "--low-pass", "60"], "low-pass of 60 Hz"),
    (["measure", "LOG", "--band", "5", "1"], "a band of 5 to 1 Hz"),
    (["measure", "LOG", "--torque", "torque"], "--torque and --weight go together"),
    (["measure", "LOG", "--torque", "torque", "--weight", "0"], "a weight must be positive"),
])  # fmt: skip
def test_bad_input_is_one_line_status_2_and_no_file(log, arguments, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    before = sorted(tmp_path.iterdir())
    assert main([str(log) if word == "LOG" else word for word in arguments]) == 2
    _, err = capfd.readouterr()
    assert len(told(err)) == 1, err
    assert words in err
    assert sorted(tmp_path.iterdir()) == before
