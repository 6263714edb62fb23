"""Recordings in the manner of laboratories, exporters and spreadsheets: read as they are meant, or asked about."""

import datetime
import decimal

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from icmj.errors import DataError
from icmj.series.reading import read_long_table, read_series
from icmj.series.units import convert_to_si

N, RATE = 400, 100.0
RANDOM = np.random.default_rng(1)
AP, ML = np.round(3.8 * RANDOM.standard_normal(N), 4), np.round(2.1 * RANDOM.standard_normal(N), 4)  # mm
T = np.arange(N) / RATE
ROWS = list(zip(T, AP, ML, strict=True))


def table(head, rows, between=",", point=".", end=""):
    """Text of a table; what is text in ``rows`` already stands as it is."""
    lines = [] if head is None else [head]
    for row in rows:
        cells = [cell if isinstance(cell, str) else f"{cell:.4f}".replace(".", point) for cell in row]
        lines.append(between.join(cells) + end)
    return "\n".join(lines) + "\n"


def whole(scale=1.0, first=0):
    """Rows that begin with a whole number, 0 or ``first`` and ``scale`` more each."""
    return [(str(first + round(scale * i)), *row[1:]) for i, row in enumerate(ROWS)]


def micrometres(value, thousand):
    return f"{round(1000 * value):,}".replace(",", thousand)


def at_night(form, first=86398.0):
    """Rows whose times are those of the day, as text, and go on over midnight."""
    begin = datetime.datetime(2026, 3, 4)
    return [
        (f"{begin + datetime.timedelta(milliseconds=round(1e3 * (first + t))):{form}}"[:-3], *row) for t, *row in ROWS
    ]


HEAD, COMMAS = "t [s],ap [mm],ml [mm]", "t [s];ap [mm];ml [mm]"
GERMAN = [(f"{t:.2f}".replace(".", ","), micrometres(a, "."), micrometres(m, ".")) for t, a, m in ROWS]
ENGLISH = [(f"{t:.2f}", micrometres(a, ","), micrometres(m, ",")) for t, a, m in ROWS]
READ = {
    "decimal commas between blanks": table("t[s] ap[mm] ml[mm]", ROWS, " ", ","),
    "names with units between blanks": table("t [s] ap [mm] ml [mm]", ROWS, "   "),
    "decimal commas between tabs": table("t [s]\tap [mm]\tml [mm]", ROWS, "\t", ","),
    "thousands with points": table("t [s];ap [µm];ml [µm]", GERMAN, ";"),
    "thousands with commas": table("t [s]\tap [µm]\tml [µm]", ENGLISH, "\t"),
    "typographic minus": table(HEAD, ROWS).replace("-", "−"),
    "exponents with D": table(HEAD, [tuple(f"{v:.6e}".replace("e", "D") for v in row) for row in ROWS]),
    "a row of units": table("time,ap,ml\nms,mm,mm", whole(10)),
    "numbers of packets": table(
        "t [s],packet,ap [mm],ml [mm]", [(t, str(7 + 10 * i), *row) for i, (t, *row) in enumerate(ROWS)]
    ),
    "a row of units in brackets": table("time,ap,ml\n[s],[mm],[mm]", ROWS),
    "keys before it": "age: 23\nmass: 71.2\nheight: 1.8\n\n" + table(HEAD, ROWS),
    "keys in its form before it": "Subject,1\nRate,100\n" + table(HEAD, ROWS),
    "keys with decimal commas before it": "weight;71,2\nheight;1,80\n" + table(COMMAS, ROWS, ";", ","),
    "layers of a marker system": (
        "Format Version,1.23,Take Name,x,Capture Frame Rate,100.0\n\n,,Marker,Marker\n,,p,p\n"
        + table("Frame,Time (Seconds),ap [mm],ml [mm]", [(str(i), *row) for i, row in enumerate(ROWS)])
    ),
    "empty rows at the end": table(HEAD, ROWS) + ",,\n,,\n",
    "a separator at each end": table(HEAD, ROWS, end=","),
    "a separator at each end, of names, too": table(HEAD + ",", ROWS, end=","),
    "numbers of rows without a name": table(HEAD, [(f'"{i + 1}"', *row) for i, row in enumerate(ROWS)]),
    "an index": table("," + HEAD, [(str(i), *row) for i, row in enumerate(ROWS)]),
    "a row of numbers before it": "3000,100,1\n" + table(HEAD, ROWS),
    "names between blanks, numbers between tabs": table("t ap[mm] ml[mm]", ROWS, "\t"),
    "a separator line of spreadsheets": "sep=;\n" + table(COMMAS, ROWS, ";", ","),
    "marks of events": table(HEAD + ",event", [(*row, "" if i else "start") for i, row in enumerate(ROWS)]),
    "marks of events before it": table("event," + HEAD, [("" if i else "start", *row) for i, row in enumerate(ROWS)]),
    "names of the tool above": ("Version 5\n\nabs time (s)\tap\tml\ns\tmm\tmm\n" + table(None, ROWS, "\t")),
    "times in another language": table("Zeit [s],ap [mm],ml [mm]", ROWS),
    "times of a long name": table("abs time (s),ap [mm],ml [mm]", ROWS),
    "a unit in the name of the times": table("time_ms,ap [mm],ml [mm]", whole(10)),
    "a second column of times": table(
        "t [s],time since start [s],ap [mm],ml [mm]", [(row[0], f"{row[0] + 5:.4f}", *row[1:]) for row in ROWS]
    ),
    "numbered frames": table("frame," + HEAD, [(str(7 + i), *row) for i, row in enumerate(ROWS)]),
    "a unit behind each number": table("t [s],ap,ml [mm]", [(t, f"{a:.4f} mm", f"{m:.4f}mm") for t, a, m in ROWS]),
    "a unit behind each number, times too": table(
        "t;ap;ml", [tuple(f"{v:.4f} {u}" for v, u in zip(row, ("s", "mm", "mm"), strict=True)) for row in ROWS], ";"
    ).replace(".", ","),
    "thousands with blanks that hold together": table(
        "t [s]\tap [µm]\tml [µm]",
        [(f"{t:.2f}", micrometres(a, "\u202f"), micrometres(m, "\u00a0")) for t, a, m in ROWS],
        "\t",
    ),
    "thousands with apostrophes": table(
        "t [s];ap [µm];ml [µm]", [(f"{t:.2f}", micrometres(a, "'"), micrometres(m, "’")) for t, a, m in ROWS], ";"
    ),
    "thousands with commas between commas": table(
        "t [s],ap [µm],ml [µm]", [(t, f'"{micrometres(a, ",")}"', f'"{micrometres(m, ",")}"') for t, a, m in ROWS]
    ),
    "numbers of rows between blanks": table(
        '"t [s]" "ap [mm]" "ml [mm]"', [(f'"{i + 1}"', *row) for i, row in enumerate(ROWS)], " "
    ),
    "an index of a part": table("," + HEAD, [(str(i + 500), *row) for i, row in enumerate(ROWS)]),
    "an index that was saved twice": table(
        ",Unnamed: 0," + HEAD, [(str(i), str(i), *row) for i, row in enumerate(ROWS)]
    ),
    "numbered frames by another name": table("Frame#," + HEAD, [(str(7 + i), *row) for i, row in enumerate(ROWS)]),
    "times of LabVIEW": (
        "LabVIEW Measurement\nSeparator\tTab\n***End_of_Header***\n\t\t\nChannels\t2\nSamples\t400\t400\n"
        "Y_Unit_Label\tmm\tmm\nX0\t0.0\t0.0\nDelta_X\t0.01\t0.01\n***End_of_Header***\n"
        + table("X_Value\tap [mm]\tml [mm]\tComment", ROWS, "\t")
    ),
    "units behind a slash": table("Nr.;t/s;ap/mm;ml / mm", [(str(i), *row) for i, row in enumerate(ROWS)], ";", ","),
    "units behind a comma": table("Zeit, ms;ap, mm;ml, mm", whole(10), ";", ","),
    "pipes": table("t [s] | ap [mm] | ml [mm]", ROWS, " | "),
    "pipes with decimal commas": table("t [s]|ap [mm]|ml [mm]", ROWS, "|", ","),
    "pipes at both ends, and a line": (
        "| t [s] | ap [mm] | ml [mm] |\n|---|:---|----|\n" + table(None, [("", *row, "") for row in ROWS], " | ")
    ),
    "units in words": table("Zeit,ap,ml\nSekunden,Millimeter,millimetres", ROWS),
    "times in minutes": table("t [min],ap [mm],ml [mm]", [(f"{t / 60:.12f}", a, m) for t, a, m in ROWS]),
    "times with a date": table("when,ap [mm],ml [mm]", at_night("%Y-%m-%d %H:%M:%S.%f")),
    "times with a date and a zone": table(
        "ap [mm],when,ml [mm]", [(a, f"{t}+01:00", m) for t, a, m in at_night("%Y-%m-%dT%H:%M:%S.%f")]
    ),
    "times with a date of another country": table("Zeit;ap [mm];ml [mm]", at_night("%d.%m.%Y %H:%M:%S,%f"), ";", ","),
    "times of the day": table("time,ap [mm],ml [mm]", at_night("%H:%M:%S.%f")),
    "a title for each channel": (
        "Interval=\t0.01 s\nExcelDateTime=\t4.6e+04\t04.03.2026 09:30:00\nTimeFormat=\tStartOfBlock\n"
        "ChannelTitle=\tap\tml\nRange=\t10.00 V\t10.00 V\nUnitName=\tmm\tmm\n"
        "TopValue=\t10.0\t10.0\nBottomValue=\t-10.0\t-10.0\n" + table(None, ROWS, "\t")
    ),
    "a title for each channel, and ranges below": (
        "ChannelTitle=\tap [mm]\tml [mm]\nRange=\t10.00 V\t10.00 V\n"
        + table(None, at_night("%d.%m.%Y %H:%M:%S.%f"), "\t")
    ),
    "a column of text": table("t [s],ap [mm],eyes,ml [mm]", [(t, a, "open", m) for t, a, m in ROWS]),
}


LEFT = {
    "layers of a marker system": "Frame, which counts rows or time",
    "a second column of times": "time since start, which counts rows or time",
    "numbered frames": "frame, which counts rows or time",
    "units behind a slash": "Nr., which counts rows or time",
    "numbered frames by another name": "Frame#, which counts rows or time",
    "numbers of packets": "packet, which counts rows or time",
    "an index that was saved twice": "Unnamed: 0, which counts rows or time",
    "a column of text": "eyes, which is text",
    "marks of events": "event, which is text",
    "marks of events before it": "event, which is text",
}


def shown(series):
    """The signals in millimetres."""
    return 1e3 * convert_to_si(series, "length", "length").values


@pytest.mark.parametrize("kind", READ)
def test_what_a_person_reads_in_one_way_is_read_so(kind, tmp_path):
    path = tmp_path / "sway.txt"
    path.write_text(READ[kind], encoding="utf-8")
    series = read_series(path)
    assert series.names == ("ap", "ml")
    assert np.diff(series.t) == pytest.approx(1 / RATE)
    np.testing.assert_allclose(shown(series), np.column_stack([AP, ML]), atol=6e-4)
    left = LEFT.get(kind, "")
    assert series.facts.get("left out", "") == (left and f"left out: {left}")


@pytest.mark.parametrize("code", ["cp1252", "utf-16", "utf-8-sig"])
def test_text_of_other_codes_is_read(code, tmp_path):
    (tmp_path / "sway.csv").write_bytes(table("Zeit [s];Höhe [µm];ml [µm]", ROWS, ";", ",").encode(code))
    series = read_series(tmp_path / "sway.csv")
    assert (series.names, series.units) == (("Höhe", "ml"), ("µm", "µm"))
    np.testing.assert_allclose(series["Höhe"], AP, atol=1e-4)


def test_one_column_with_decimal_commas_is_one(tmp_path):
    (tmp_path / "sway.csv").write_text(table("ap [mm]", [(a,) for a in AP], "", ","))
    series = read_series(tmp_path / "sway.csv", rate=RATE)
    assert series.names == ("ap",)
    np.testing.assert_allclose(series["ap"], AP, atol=1e-4)


@pytest.mark.parametrize("word", ["#N/A", "...", "…", "--", "#DIV/0!", "NaN", ""])
def test_a_column_whose_first_cells_are_missing_is_no_text(word, tmp_path):
    rows = [(t, word if i < 2 else a, m) for i, (t, a, m) in enumerate(ROWS)]
    (tmp_path / "sway.csv").write_text(table(HEAD, rows))
    series = read_series(tmp_path / "sway.csv")
    assert series.names == ("ap", "ml")
    assert np.isnan(series["ap"]).tolist() == [True] * 2 + [False] * (N - 2)


LABELS = [(str(1 + 2 * i // N), *row) for i, row in enumerate(ROWS)]
ASKED = {
    "trials by number": (
        table("session,ap [mm],ml [mm]", [(s, *row) for s, _, *row in LABELS]), "session is 1 in some rows and then 2"
    ),
    "trials by word": (
        table("eyes,ap [mm],ml [mm]", [("open" if s == "1" else "closed", *row) for s, _, *row in LABELS]),
        "eyes is 'open' in some rows and 'closed' in others; if it tells trials apart, call it 'trial'",
    ),
    "axes one below the other": (
        table("axis,cop [mm]", [(axis, a) for a, m in zip(AP, ML, strict=True) for axis, a in (("ap", a), ("ml", m))]),
        "axis is 'ap' in some rows and 'ml' in others",
    ),
    "trials by times": (
        table(HEAD, [*ROWS[: N // 2], *ROWS[: N // 2]]), "times begin again in row 201, as of trials one below the"
    ),
    "times in no unit of time": (table("Zeit [Ticks],ap [mm],ml [mm]", ROWS), "times in 'Ticks'; expected s, ms,"),
    "times that are empty": (table("t,ap [mm],ml [mm]", [("", *row[1:]) for row in ROWS]), "t has no values; fill it"),
    "numbers of rows as times": (table("time,ap [mm],ml [mm]", whole()), "time rises by 1 from row to row"),
    "milliseconds without a unit": (table("t,ap [mm],ml [mm]", whole(10)), r"name it 't \[s\]' or 't \[ms\]'"),
    "microseconds without a unit": (table("t,ap [mm],ml [mm]", whole(1e4)), "t rises by 10000 from row to row"),
    "times of the day in whole seconds": (
        table("time,ap [mm],ml [mm]", [(f"00:00:{int(t):02d}", a, m) for t, a, m in ROWS]), "no column of times"
    ),
    "times of two trials side by side": (
        table("t1 [s],ap [mm],t2 [s],ml [mm]", [(t, a, 2 * t, m) for t, a, m in ROWS]),
        r"t1 lasts 3\.99 s and t2 7\.98 s; of two trials side by side, save each in a file of its own",
    ),
    "times of two trials side by side, of one name": (
        table("t,ap [mm],t,ml [mm]", [(t, a, 2 * t, m) for t, a, m in ROWS]), r"t lasts 3\.99 s and t 7\.98 s"
    ),
    "numbers with two units": (
        table("t [s],ap", [(t, f"{a:.2f} {'cm' if i == 7 else 'mm'}") for i, (t, a, _) in enumerate(ROWS)]),
        "ap: '.* mm' is no number; write the unit in the name",
    ),
    "numbers with another unit later": (
        table("t [s],ap", [(t, f"{a:.2f} {'cm' if i == 300 else 'mm'}") for i, (t, a, _) in enumerate(ROWS)]),
        "'.* cm' is not in mm, as the cells above it are",
    ),
    "numbers with another unit than their name": (
        table("t [s],ap [cm]", [(t, f"{a:.2f} mm") for t, a, _ in ROWS]), "cm in its name and mm behind its numbers"
    ),
    "a row of other units": (table(f"{HEAD}\ns,cm,mm", ROWS), r"ap \[mm\]: mm in its name and cm below it; correct"),
    "a word among numbers": (
        table(HEAD, [(t, "gap" if i == 3 else a, m) for i, (t, a, m) in enumerate(ROWS)]), "ap: 'gap' is no number"
    ),
    "fewer names than columns": (table("ap,ml", ROWS), "line 1 has 2 names, the rows below it have 3 columns"),
    "two tables": (table(HEAD, ROWS[:20]) + "\n" + table(HEAD, ROWS[20:]), "lines 2 to 21 are rows, and a table"),
    "commas of two kinds": (
        table("ap,ml", [(f"{i % 9},{i % 10}{i % 7}", f"{i % 8},{i % 7}{i % 4}") for i in range(N)]),
        "commas separate columns, or whole numbers from decimals",
    ),
    "thousands or decimals": (
        table("ap [µm];ml [µm]", [(micrometres(a, "."), micrometres(m, ".")) for _, a, m in ROWS], ";"),
        "has decimals or separated thousands, and no other column tells",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", ASKED)
def test_what_can_be_read_in_two_ways_is_asked_about(kind, tmp_path):
    text, words = ASKED[kind]
    (tmp_path / "sway.csv").write_text(text, encoding="utf-8")
    rate = None if "times" in kind or "seconds" in kind else RATE
    with pytest.raises(DataError, match=words):
        read_series(tmp_path / "sway.csv", rate=rate)


def test_what_changes_within_a_trial_that_has_a_label_is_asked_about_and_what_does_not_is_left_out(tmp_path):
    rows = [(s, "open" if s == "1" else "closed", *row) for s, *row in LABELS]
    (tmp_path / "sway.csv").write_text(table("trial,eyes," + HEAD, rows))
    for one, half in zip(read_long_table(tmp_path / "sway.csv"), (slice(N // 2), slice(N // 2, N)), strict=True):
        np.testing.assert_allclose(one.values[:, 0], AP[half])
        assert one.facts["left out"] == "left out: eyes, which is text"
    (tmp_path / "sway.csv").write_text(table("subject,eyes," + HEAD, [("S1", *row[1:]) for row in rows]))
    with pytest.raises(DataError, match="eyes is 'open' in some rows"):
        read_series(tmp_path / "sway.csv")
    assert read_series(tmp_path / "sway.csv", columns=["ap"]).names == ("ap",)


MARKERS = "Take Name,x\n\n,,Marker,Marker,Marker,Marker\n,,C7,C7,SACR,SACR\n,,Position,Position,Position,Position\n"
KEYS = "Rate,100,Hz\nt [s],COPx [mm],COPx [mm]\n"
BODIES = "Take Name,x\n\n,,B1,B1,B1,B2\n,,Rotation,Rotation,Position,Position\n"
SAME = {
    "a marker over its first column": (
        "Trajectories\n100\n,,S:C7,,S:SACR,\nFrame,Sub Frame,X,Y,X,Y\n,,mm,mm,mm,mm\n",
        ("S:C7.X", "S:C7.Y", "S:SACR.X", "S:SACR.Y"),
    ),
    "a marker over each column": (
        f"{MARKERS}Frame,Time (Seconds),X,Y,X,Y\n", ("C7.X", "C7.Y", "SACR.X", "SACR.Y")
    ),
    "what no row alone tells apart": (
        f"{BODIES}Frame,Time (Seconds),X,Y,X,X\n", ("B1.Rotation.X", "Y", "B1.Position.X", "B2.Position.X")
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SAME)
def test_names_that_stand_several_times_are_told_apart_by_those_above(kind, tmp_path):
    """Markers are called X, Y, Z, each below the name of its marker; they were refused as of one name."""
    head, names = SAME[kind]
    count = [str(i) for i in range(N)]
    clock = ["0"] * N if "Sub" in head else [f"{t:.2f}" for t in T]
    text = head + table(None, list(zip(count, clock, AP, ML, ML + 1, AP + 1, strict=True)))
    (tmp_path / "sway.csv").write_text(text)
    series = read_series(tmp_path / "sway.csv", rate=RATE if "Sub" in head else None)
    assert series.names == names
    np.testing.assert_allclose(series.values, np.column_stack([AP, ML, ML + 1, AP + 1]), atol=1e-4)


def test_keys_above_names_that_repeat_tell_nothing_apart(tmp_path):
    (tmp_path / "sway.csv").write_text(table(KEYS.strip(), ROWS))
    with pytest.raises(DataError, match="several signals are called COPx"):
        read_series(tmp_path / "sway.csv")


def test_columns_of_two_levels_are_told_apart_by_both(tmp_path):
    levels = pd.MultiIndex.from_product([["C7", "SACR"], ["x", "y"]])
    pd.DataFrame(np.column_stack([AP, ML, ML, AP]), columns=levels).to_csv(tmp_path / "sway.csv")
    series = read_series(tmp_path / "sway.csv", rate=RATE)
    assert series.names == ("C7.x", "C7.y", "SACR.x", "SACR.y")
    np.testing.assert_array_equal(series["SACR.y"], AP)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("suffix", [".parquet", ".npz"])
def test_numbers_as_text_are_no_labels_and_not_left_out(suffix, decimal, tmp_path):
    """The other column was measured in their place, with a note."""
    path = tmp_path / f"sway{suffix}"
    words = [f"{a:.4f}".replace(".", decimal) for a in AP]
    if suffix == ".npz":
        np.savez(path, t=T, ap=np.array(words), ml=ML)
    else:
        pq.write_table(pa.table({"t": T, "ap": words, "ml": ML}), path)
    with pytest.raises(DataError, match=f"ap: '{words[0]}' and others are numbers as text; save them as numbers"):
        read_series(path)
    assert read_series(path, columns=["ml"]).names == ("ml",)


@pytest.mark.parametrize("named", [True, False])
def test_a_column_of_instants_or_durations_has_the_times_wherever_it_stands(named, tmp_path):
    """pandas writes an index behind all columns; one without a name was taken for numbers of rows."""
    begin = pd.date_range("2026-03-01", periods=N, freq="10ms", name="when" if named else None)
    pd.DataFrame({"ap": AP}, index=begin).to_parquet(tmp_path / "sway.parquet")
    series = read_series(tmp_path / "sway.parquet")
    assert series.names == ("ap",)
    assert np.diff(series.t) == pytest.approx(1 / RATE, rel=1e-4)
    pd.DataFrame({"ap": AP}, index=T).to_parquet(tmp_path / "sway.parquet")
    with pytest.raises(DataError, match=r"__index_level_0__ rises by 0\.01 in every row"):
        read_series(tmp_path / "sway.parquet", rate=50.0)


def test_text_of_other_codes_is_read_in_labels(tmp_path):
    head = "Proband;Bedingung;Zeit [s];ap [mm];ml [mm]"
    rows = [("P1", "geöffnet" if s == "1" else "zu", *row) for s, *row in LABELS]
    (tmp_path / "sway.csv").write_bytes(table(head, rows, ";", ",").encode("cp1252"))
    found = read_long_table(tmp_path / "sway.csv")
    assert [one.facts["condition"] for one in found] == ["geöffnet", "zu"]


def test_a_rate_overrules_times_of_an_unknown_unit_and_no_others(tmp_path):
    (tmp_path / "sway.csv").write_text(table("time,ap [mm],ml [mm]", whole()))
    assert np.diff(read_series(tmp_path / "sway.csv", rate=RATE).t) == pytest.approx(1 / RATE)
    (tmp_path / "sway.csv").write_text(table("Zeit [s],ap [mm],ml [mm]", ROWS))
    assert np.diff(read_series(tmp_path / "sway.csv", rate=50.0).t) == pytest.approx(1 / RATE)


def test_times_of_the_day_are_counted_from_the_first(tmp_path):
    """Two seconds left out at the beginning are those of the recording, not those after midnight."""
    (tmp_path / "sway.csv").write_text(READ["times of the day"])
    assert read_series(tmp_path / "sway.csv", since=2.0).t == pytest.approx(T[200:])


@pytest.mark.parametrize("column", ["ap", "ml"])
def test_of_trials_side_by_side_with_other_times_none_is_read_by_those_of_the_first(column, tmp_path):
    """The second was measured with the times of the first, at twice its speed."""
    (tmp_path / "sway.csv").write_text(table("t1 [s],ap [mm],t2 [s],ml [mm]", [(t, a, 2 * t, m) for t, a, m in ROWS]))
    with pytest.raises(DataError, match=r"t1 lasts 3\.99 s and t2 7\.98 s"):
        read_series(tmp_path / "sway.csv", columns=[column])


QUOTIENTS = "speed mm/s,encoder counts/mm,N/mm,px/s"


def test_a_quotient_in_a_name_is_no_unit(tmp_path):
    """One of times, or of others in brackets, tells whether what stands behind a slash is a unit."""
    rows = [(a, m, a, m, t) for t, a, m in ROWS]
    for head, known in (
        (f"{QUOTIENTS},t [s]", tuple((name, "") for name in QUOTIENTS.split(","))),
        (
            "speed mm/s,v/(mm/s),N/mm,px/s,t/s",
            (("speed mm/s", ""), ("v", "mm/s"), ("N/mm", ""), ("px/s", "")),
        ),
    ):
        (tmp_path / "sway.csv").write_text(table(head, rows))
        series = read_series(tmp_path / "sway.csv")
        assert tuple(zip(series.names, series.units, strict=True)) == known
        assert np.diff(series.t) == pytest.approx(1 / RATE)


@pytest.mark.parametrize("first", ["No.", "N°", "Amostra", "Dauer"])
@pytest.mark.parametrize("step", [1.0, 1 / RATE])
def test_with_a_rate_a_column_that_counts_its_rows_is_none_of_sway(first, step, tmp_path):
    rows = [(f"{7 + i * step:.6g}", a, m) for i, (_, a, m) in enumerate(ROWS)]
    (tmp_path / "sway.csv").write_text(table(f"{first},ap [mm],ml [mm]", rows))
    series = read_series(tmp_path / "sway.csv", rate=RATE)
    assert series.names == ("ap", "ml")
    assert series.facts["left out"] == f"left out: {first}, which counts rows or time"


@pytest.mark.parametrize(("head", "cell"), [("time [samples]", "{}"), ("Time (frames)", "{}"), ("X_Value", "")])
def test_times_in_rows_or_without_values_take_the_rate(head, cell, tmp_path):
    rows = [(cell.format(i), a, m) for i, (_, a, m) in enumerate(ROWS)]
    (tmp_path / "sway.csv").write_text(table(f"{head},ap [mm],ml [mm]", rows))
    assert np.diff(read_series(tmp_path / "sway.csv", rate=RATE).t) == pytest.approx(1 / RATE)
    with pytest.raises(DataError, match="say with --rate how many rows a second has"):
        read_series(tmp_path / "sway.csv")


@pytest.mark.parametrize("name", ["Dauer", ""])
def test_times_that_nothing_names_are_asked_about_and_not_measured(name, tmp_path):
    """A rate was believed, and the times were measured as sway: half the speed, with a wrong rate."""
    (tmp_path / "sway.csv").write_text(table(f"{name},ap [mm],ml [mm]" if name else None, ROWS))
    with pytest.raises(DataError, match=rf"{name or 'column 1'} rises by 0\.01 in every row"):
        read_series(tmp_path / "sway.csv", rate=50.0)
    named = ["ap", "ml"] if name else ["column 2", "column 3"]
    assert read_series(tmp_path / "sway.csv", rate=50.0, columns=named).names == tuple(named)


def test_columns_of_parquet_are_read_by_what_they_mean(tmp_path):
    begin = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    columns = {
        "time": pa.array([begin + datetime.timedelta(milliseconds=10 * i) for i in range(N)]),
        "ap": pa.array([decimal.Decimal(f"{a:.4f}") for a in AP]),
        "ml": pa.array(ML.astype(np.float32)),
        "eyes": pa.array(["open"] * N),
    }
    pq.write_table(pa.table(columns), tmp_path / "sway.parquet")
    series = read_series(tmp_path / "sway.parquet")
    assert series.names == ("ap", "ml")
    assert np.diff(series.t) == pytest.approx(1 / RATE, rel=1e-4)
    np.testing.assert_allclose(series["ap"], AP)
    assert series.facts["left out"] == "left out: eyes, which is of type string"
    columns["time"] = pa.array([datetime.timedelta(milliseconds=10 * i) for i in range(N)])
    pq.write_table(pa.table(columns), tmp_path / "sway.parquet")
    assert read_series(tmp_path / "sway.parquet").t == pytest.approx(T)


def test_matrices_of_npz_are_columns_or_asked_about(tmp_path):
    np.savez(tmp_path / "sway.npz", t=T, ap=AP[:, None])
    np.testing.assert_array_equal(read_series(tmp_path / "sway.npz").values[:, 0], AP)
    np.savez(tmp_path / "sway.npz", t=T, ap=AP, both=np.column_stack([AP, ML]))
    with pytest.raises(DataError, match=r"both has shape \(400, 2\); save each column under a name of its own"):
        read_series(tmp_path / "sway.npz")


@pytest.mark.parametrize(
    ("name", "words"), [("a.xlsx", "as CSV"), ("a.MAT", "as npz"), ("a.trc", "as C3D"), ("a.gz", "unpack")]
)
def test_of_other_formats_one_line_says_what_to_do(name, words, tmp_path):
    (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(DataError, match=f"not a format that icmj reads; .*{words}"):
        read_series(tmp_path / name)


def test_numbers_within_frames_and_keys_before_a_table_are_no_sway(tmp_path):
    """A marker system counts rows within a frame, and writes names of markers for three columns each."""
    rows = [(str(i // 10), str(i % 10), *row[1:]) for i, row in enumerate(ROWS)]
    text = "Devices\n1000\n,,Plate - CoP,\nFrame,Sub Frame,ap,ml\n,,mm,mm\n" + table(None, rows)
    (tmp_path / "sway.csv").write_text(text)
    series = read_series(tmp_path / "sway.csv", rate=RATE)
    assert (series.names, series.units) == (("ap", "ml"), ("mm", "mm"))
    keys = "NO_OF_FRAMES\t400\nFREQUENCY\t100\nTIME_STAMP\t2020-01-01, 10:00:00\t3.5\nMARKER_NAMES\tC7\n"
    (tmp_path / "sway.tsv").write_text(keys + table(None, [(a, m, a + 900) for _, a, m in ROWS], "\t"))
    assert read_series(tmp_path / "sway.tsv", rate=RATE).names == ("C7.x", "C7.y", "C7.z")


def test_thousands_that_come_after_the_lines_that_are_looked_at_are_asked_about(tmp_path):
    """2595 µm were read as 2.595, because numbers below a thousand have no separator."""
    values = [5 * i - 400 for i in range(600)]
    rows = "".join(f"{10 * i};{value:,}\n".replace(",", ".") for i, value in enumerate(values))
    (tmp_path / "sway.csv").write_text(f"t [ms];ap [µm]\n{rows}", encoding="utf-8")
    with pytest.raises(DataError, match=r"'1\.000' has decimals or separated thousands"):
        read_series(tmp_path / "sway.csv")
    (tmp_path / "sway.csv").write_text(f"t [ms];ap [µm]\n{rows}".replace(".", ""), encoding="utf-8")
    assert read_series(tmp_path / "sway.csv")["ap"].tolist() == values
    still = "".join(f"{10 * i};{'0' if i < 300 else '1.250'}\n" for i in range(600))
    (tmp_path / "sway.csv").write_text(f"t [ms];ap [mm]\n{still}600000;0.125\n")
    assert read_series(tmp_path / "sway.csv")["ap"][[0, 300, 600]].tolist() == [0.0, 1.25, 0.125]


def test_columns_without_names_are_called_by_their_place(tmp_path):
    """One that is empty at first was dropped, and the next was called by its place."""
    rows = [(i % 7, "" if i < 300 else i % 5, "open", i % 3) for i in range(600)]
    (tmp_path / "sway.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    series = read_series(tmp_path / "sway.csv", rate=RATE)
    assert series.names == ("column 1", "column 2", "column 4")
    assert series["column 2"][300:].tolist() == [row[1] for row in rows[300:]]
    assert series["column 4"].tolist() == [row[3] for row in rows]
    assert series.facts["left out"] == "left out: column 3, which is text"


@pytest.mark.parametrize("rows", [60, N])
@pytest.mark.parametrize(("form", "unit"), [("{:.4f}", ""), ("{:.4e}", ""), ("{:.4f} mm", " mm")])
def test_a_last_line_that_ends_midway_is_left_out_wherever_it_ends(form, unit, rows, tmp_path):
    """Of 2.7091 there may be 2.7 left, which is a number as well; a cut between two digits of a column was believed."""
    lines = ["t [s],ap [mm],ml [mm]", *(",".join([f"{t:.2f}", *map(form.format, row)]) for t, *row in ROWS[:rows])]
    for left in range(1, len(lines[-1]) + 1):
        (tmp_path / "sway.csv").write_text("\n".join([*lines[:-1], lines[-1][:left]]))
        series = read_series(tmp_path / "sway.csv")
        whole = left == len(lines[-1])
        at = len(series) - 1
        if not np.isnan(series.values[at]).any():  # a line that ends at a separator lacks a value, which is told later
            np.testing.assert_allclose(series.values[at], [AP[at], ML[at]], atol=6e-5)
        if len(series) == rows - 1:
            assert series.remarks == ("left out: the last line, which ends midway",)
        assert len(series) == rows or not whole
        assert whole or len(series) == rows - 1 or lines[-1][left - 1] == ","


@pytest.mark.parametrize("rest", ["end of file", "mean,0.1,0.2", "29.99,x"])
def test_what_stands_below_a_table_is_no_line_that_ends_midway(rest, tmp_path):
    (tmp_path / "sway.csv").write_text(table(HEAD, ROWS) + rest)
    with pytest.raises(DataError, match="not a table of numbers"):
        read_series(tmp_path / "sway.csv")


@pytest.mark.parametrize("end", [0, -1])
def test_values_that_are_missing_at_an_end_are_left_out_and_told(end, tmp_path, shell):
    for rows, said in ((2, "left out: 2 rows at its {}, where ap has no value"), (51, "51 of 400 values are missing")):
        lost = range(rows) if end == 0 else range(N - rows, N)
        text = table(HEAD, [(t, "NaN" if i in lost else a, m) for i, (t, a, m) in enumerate(ROWS)])
        (tmp_path / "sway.csv").write_text(text)
        if rows == 2:
            told = shell.answers(["measure", str(tmp_path / "sway.csv"), "--json"])
            assert told["notices"] == [said.format("beginning" if end == 0 else "end")]
            kept = slice(2, None) if end == 0 else slice(None, -2)
            assert told["coordinates"][0]["rms"] == pytest.approx(AP[kept].std(), rel=1e-9)
        else:
            assert said in shell.refuses(["measure", str(tmp_path / "sway.csv")])
