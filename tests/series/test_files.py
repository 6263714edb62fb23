"""Files of series: bit for bit both ways, readable by others, and hostile ones refused in one line."""

import contextlib
import csv
import json
import re
import tracemalloc

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from icmj.errors import DataError
from icmj.series import reading
from icmj.series.columns import name_and_unit
from icmj.series.formats import csv as csv_format
from icmj.series.formats import parquet
from icmj.series.reading import read_series
from icmj.series.series import Series
from icmj.series.writing import write_series

KINDS = (".csv", ".parquet", ".npz")


def awkward():
    values = np.array([[0.1 + 0.2, -0.0], [np.nextafter(0, 1), np.nan], [1 / 3, 1e300]])
    return Series(np.array([0.0, 0.1, 0.1 + 1e-12]), values, ("x.ankle", 'a, "b"'), ("rad", "N m"), {"plant": "linear"})


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_reads_back_bit_for_bit(tmp_path, kind):
    series, path = awkward(), tmp_path / f"run{kind}"
    write_series(series, path)
    found = read_series(path)
    assert (found.names, found.units) == (series.names, series.units)
    assert found.t.tobytes() == series.t.tobytes()
    np.testing.assert_array_equal(found.values, series.values)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_others_read_it(tmp_path):
    series = awkward()
    for kind in KINDS:
        write_series(series, tmp_path / f"run{kind}")
    with open(tmp_path / "run.csv", newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["t [s]", "x.ankle [rad]", 'a, "b" [N m]']
    assert [float(row[1]) for row in rows] == series.values[:, 0].tolist()
    schema = pq.read_schema(tmp_path / "run.parquet")
    assert [field.metadata[b"unit"].decode() for field in schema] == ["s", "rad", "N m"]
    assert schema.metadata[b"icmj.plant"] == b"linear"
    with np.load(tmp_path / "run.npz", allow_pickle=False) as arrays:
        assert dict(zip(arrays["names"], arrays["units"], strict=True))["x.ankle"] == "rad"
        assert json.loads(str(arrays["facts"])) == {"plant": "linear"}
        assert arrays["x.ankle"].shape == (3,)


def test_what_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(DataError, match=r"cannot write \.xlsx; expected \.csv, \.parquet, \.npz"):
        write_series(awkward(), tmp_path / "run.xlsx")
    with pytest.raises(DataError, match="the name 'units' is reserved in npz files"):
        write_series(Series(np.zeros(1), np.zeros((1, 1)), ("units",)), tmp_path / "run.npz")
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_series(awkward(), tmp_path / "file" / "run.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


TABLES = {
    "commas": "t,ap [cm],ml (cm)\n0,1,2\n0.01,1.5,-2e-1\n",
    "tabs": "t\tap [cm]\tml (cm)\n0\t1\t2\n0.01\t1.5\t-2e-1\n",
    "semicolons and decimal commas": "t;ap [cm];ml (cm)\n0,00;1,0;2,0\n0,01;1,5;-2e-1\n",
    "blanks": "t ap ml\n  0    1   2 \n 0.01 1.5  -2e-1\n",
    "a preamble": "Subject;12\nRate;100;Hz\n\nt;ap [cm];ml (cm)\n0;1;2\n0.01;1.5;-0.2\n",
    "a header behind a mark": "# t,ap [cm],ml (cm)\n0,1,2\n0.01,1.5,-0.2",
    "a byte-order mark and carriage returns": "\ufefft,ap [cm],ml (cm)\r\n0,1,2\r\n0.01,1.5,-0.2\r\n",
    "milliseconds": "Time [ms],ap [cm],ml (cm)\n0,1,2\n10,1.5,-0.2\n",
    "a column of text": "t,phase,ap [cm],ml (cm)\n0,quiet,1,2\n0.01,quiet,1.5,-0.2\n",
}


@pytest.mark.parametrize("kind", TABLES)
def test_tables_of_many_makes_are_read(tmp_path, kind):
    path = tmp_path / "sway.csv"
    path.write_bytes(TABLES[kind].encode())
    found = read_series(path)
    assert found.names == ("ap", "ml")
    assert found.units == (("", "") if kind == "blanks" else ("cm", "cm"))
    assert found.t == pytest.approx([0, 0.01])
    assert found.values == pytest.approx(np.array([[1, 2], [1.5, -0.2]]))


def test_a_table_without_header_and_times_takes_a_rate(tmp_path):
    path = tmp_path / "sway.txt"
    np.savetxt(path, [[0.0, 1.0], [3.0, 3.0], [4.0, 5.5]])
    found = read_series(path, rate=50.0)
    assert found.names == ("column 1", "column 2")
    assert found.t == pytest.approx([0, 0.02, 0.04])
    assert read_series(path, rate=50.0, columns=["column 2"]).values.ravel() == pytest.approx([1, 3, 5.5])


HOSTILE = {
    "nothing": (b"", "the file is empty"),
    "blank": (b" \n\n", "the file is empty"),
    "blank for text": (b"\x1c", "the file is empty"),
    "binary": (b"RRF2\0\0\0" * 50, "not text"),
    "prose": (b"once upon a time\nthere was a table\n", "no rows of numbers in its first 2 lines"),
    "one long line": (b"1," * 200_000, "line 1 has more than"),
    "no times": (b"a,b\n1,2\n3,4\n", "no column of times (t, time); say with --rate"),
    "times alone": (b"t\n1\n2\n", "no column of numbers beside the times"),
    "falling times": (b"t,a\n0,1\n1,1\n0.5,1\n", "times do not rise at row 3"),
    "missing times": (b"t [s],a\n0,1\n1,2\n,1\n", "times do not rise at row 3"),
    "hours": (b"t [h],a\n0,1\n1,2\n", "times in 'h'"),
    "twice": (b"t,a,a\n0,1,2\n1,1,2\n", "several signals are called a"),
    "ragged": (b"t,a\n0,1\n1,2\n2\n", "not a table of numbers after line 2"),
    "words": (b"t,a\n0,1\n1,2\n2,stop\n", "a: 'stop' is no number"),
    "words later": (
        b"t [s],a\n" + b"".join(b"%d,1\n" % i for i in range(300)) + b"300,stop\n",
        "not a table of numbers",
    ),
    "wide": (b",".join([b"1"] * 3000) + b"\n" + b",".join([b"1"] * 3000), "3000 columns"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused_in_one_line(tmp_path, kind):
    content, words = HOSTILE[kind]
    path = tmp_path / "sway.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match=f"^{re.escape(str(path))}.*{re.escape(words)}"):
        read_series(path)


@pytest.mark.parametrize("kind", [".parquet", ".npz", ".csv"])
def test_no_file_no_folder_and_no_rubbish(tmp_path, kind, monkeypatch):
    path = tmp_path / f"sway{kind}"
    with pytest.raises(DataError, match="No such file"):
        read_series(path)
    path.write_bytes(b"PK\x03\x04 rubbish\0")
    with pytest.raises(DataError, match="not"):
        read_series(path)
    with pytest.raises(DataError, match="not a file"):
        read_series(tmp_path)
    monkeypatch.setattr(reading, "MOST_BYTES", 3)
    with pytest.raises(DataError, match="expected at most"):
        read_series(path)


@pytest.mark.parametrize("kind", [".csv", ".parquet"])
def test_a_signal_may_be_called_as_the_times_are(tmp_path, kind):
    series, path = Series(np.arange(3.0), np.eye(3)[:, :2], ("t", "ankle"), ("N", "rad")), tmp_path / f"run{kind}"
    write_series(series, path)
    back = read_series(path)
    assert (back.names, back.units) == (series.names, series.units)
    np.testing.assert_array_equal(back.t, series.t)
    np.testing.assert_array_equal(back.values, series.values)


def _many(path, rows):
    """Very many numbers in a small file."""
    zeros = np.zeros(rows, dtype=np.uint8)
    if path.suffix == ".npz":
        np.savez_compressed(path, t=zeros, a=zeros)
    elif path.suffix == ".parquet":
        pq.write_table(pa.table({"t": zeros, "a": zeros}), path)
    else:
        path.write_bytes(b"t,a\n" + b"0,0\n" * rows)


@pytest.mark.parametrize("kind", KINDS)
def test_more_than_fits_is_refused_before_it_is_read(tmp_path, kind):
    """Headers say how much there is: a Parquet file of 1.8 MB took 10.8 GB."""
    path = tmp_path / f"sway{kind}"
    _many(path, 7_000_000)
    tracemalloc.start()
    with pytest.raises(DataError, match=r"about 700000[01] rows of 2 columns; expected at most 12 million numbers"):
        read_series(path)
    assert tracemalloc.get_traced_memory()[1] < 5e7
    tracemalloc.stop()


@pytest.mark.parametrize("kind", KINDS)
def test_only_what_is_asked_for_is_read(tmp_path, kind, monkeypatch):
    monkeypatch.setattr(csv_format, "PART", 100_000)
    monkeypatch.setattr(parquet, "BUFFER", 100_000)
    rows, names = 20_000, tuple(f"c{i}" for i in range(60))
    series = Series(np.arange(rows) / 100, np.arange(rows * 60.0).reshape(rows, 60), names)
    write_series(series, tmp_path / f"sway{kind}")
    tracemalloc.start()
    found = read_series(tmp_path / f"sway{kind}", columns=["c7", "c3"])
    assert tracemalloc.get_traced_memory()[1] < 4e6  # all of it would be 9.8e6
    tracemalloc.stop()
    np.testing.assert_array_equal(found.values, series.values[:, [7, 3]])
    np.testing.assert_array_equal(found.t, series.t)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("part", [7, 8, 9, 100])
def test_a_table_is_the_same_in_parts(tmp_path, monkeypatch, end, part):
    monkeypatch.setattr(csv_format, "PART", part)
    rows = [f"{i / 10},{i * i},{-i}" for i in range(30)]
    (tmp_path / "a.csv").write_bytes(end.join(["t,a,b", *rows, "", rows[-1].replace("2.9", "3.0"), ""]).encode())
    found = read_series(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.t, np.arange(31) / 10)
    np.testing.assert_array_equal(found.values[:30], [(i * i, -i) for i in range(30)])


def test_pickles_are_not_unpacked(tmp_path):
    np.savez(tmp_path / "bad.npz", t=np.arange(2.0), a=np.array([{}, {}], dtype=object))
    with pytest.raises(DataError, match="not an npz file of plain arrays"):
        read_series(tmp_path / "bad.npz")


WORDS = ["0", "1", "2.5", "-3e5", "nan", "inf", ",", ";", "\t", "\n", "\r", " ", "a", "[cm]", '"', "#", "1e999", "0,5"]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.binary(max_size=200)
    | st.lists(st.sampled_from(WORDS), max_size=60).map(lambda words: "".join(words).encode()),
    kind=st.sampled_from([".csv", ".parquet", ".npz"]),
)
def test_whatever_is_in_a_file_it_is_a_series_or_one_line(tmp_path, content, kind):
    path = tmp_path / f"mutant{kind}"
    path.write_bytes(content)
    with contextlib.suppress(DataError):
        found = read_series(path, rate=10.0)
        assert found.values.shape == (len(found.t), len(found.names))


@pytest.mark.parametrize(("text", "expected"), [
    ("ankle [rad]", ("ankle", "rad")), (" COP ap (cm) ", ("COP ap", "cm")), ("plain", ("plain", "")), ("", ("", "")),
])  # fmt: skip
def test_names_and_units(text, expected):
    assert name_and_unit(text) == expected


@pytest.mark.parametrize("where", ["header", "row", "row alone"])
def test_a_field_of_any_length_is_refused_in_words(tmp_path, where):
    """The csv module takes fields up to 131,072 characters, and raises an error of its own."""
    long = "x" * 140_000
    header, row = (f"t,{long}", "0,1") if where == "header" else ("t,a", f"0,{long}")
    text = f"{long},1\n" if where == "row alone" else f"{header}\n{row}\n{row}\n"
    (tmp_path / "long.csv").write_text(text)
    with pytest.raises(DataError, match=r"long\.csv: .*(not a row of a table|no rows of numbers)") as caught:
        read_series(tmp_path / "long.csv")
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("key", ["names", "units"])
@pytest.mark.parametrize("texts", [
    pytest.param(np.zeros(2, dtype=[("a", "U3"), ("b", "f8", (2,))]), id="nested"),
    pytest.param(np.zeros(2, dtype=[("a", "U3")]), id="structured"),
    pytest.param(np.zeros(2), id="numbers"),
    pytest.param(np.zeros((), "V4"), id="void"),
    pytest.param(np.array(["2020-01-01"], "M8[D]"), id="times"),
])  # fmt: skip
def test_names_in_npz_are_text(tmp_path, key, texts):
    arrays = {"names": np.array(["t", "a"]), "units": np.array(["s", "m"]), key: texts}
    np.savez(tmp_path / "a.npz", t=np.arange(3.0), a=np.arange(3.0), **arrays)
    with pytest.raises(DataError, match="names and units are not arrays of text"):
        read_series(tmp_path / "a.npz")
