"""Recordings as trials: what is read, in which unit, and what is refused in one line."""

import numpy as np
import pytest

from icmj import measure_sway, read_series, write_series
from icmj.cli.commands.fit import FitCommand, list_people
from icmj.errors import FitError
from icmj.fits.recording_tables import MOST, public_trials
from icmj.fits.recordings import read_trials
from icmj.fits.summaries import SUMMARIES, measures, summarise
from icmj.series.even_rows import resample_series
from icmj.series.series import Series


def sway(duration=60.0, rate=100.0, rms=4.0, seed=0):
    """Slow noise of this RMS."""
    rng, N = np.random.default_rng(seed), round(duration * rate)
    f = np.fft.rfftfreq(N, 1 / rate)
    lines = np.where(f > 0, 1 / (0.02 + f**2), 0) * np.exp(2j * np.pi * rng.random(len(f))) * (f < 5)
    x = np.fft.irfft(lines, N)
    return np.arange(N) / rate, rms * x / x.std()


def written(path, t, x, header):
    write_series(Series(t, x[:, None], *header), path)
    return path


def test_a_recording_is_read_in_metres_whatever_its_unit_and_rate(tmp_path, root):
    t, x = sway(rms=4.0)
    (one,) = read_trials(written(tmp_path / "a.csv", t, x, (("ap",), ("mm",))))
    np.testing.assert_allclose(one.cop, 1e-3 * x, rtol=0, atol=1e-9)
    (two,) = read_trials(written(tmp_path / "a.parquet", t, x / 10, (("COPx",), ("cm",))))
    np.testing.assert_allclose(two.cop, one.cop, atol=1e-9)
    fast = np.arange(60000) / 1000
    (three,) = read_trials(written(tmp_path / "f.parquet", fast, np.interp(fast, t, x), (("ap",), ("mm",))))
    assert three.cop.shape == (6000,)
    np.testing.assert_allclose(three.cop[100:-100], one.cop[100:-100], atol=2e-5)
    assert three.notes == ("resampled from 1000 to 100 Hz",)
    long = written(tmp_path / "l.parquet", *sway(duration=125.0), (("ap",), ("mm",)))
    assert [part.cop.shape for part in read_trials(long)] == [(6000,), (6000,)]
    (short,) = read_trials(written(tmp_path / "s.parquet", *sway(duration=40.0), (("ap",), ("mm",))))
    assert "40 s long" in short.notes[0]
    # a person, and the table's own way to measure
    person = root / "examples" / "standing.csv"
    (own,) = read_trials(person, rate=100.0)
    series = read_series(person, rate=100.0)
    sway_ = measure_sway(series).coordinates[series.names.index(own.name)]
    six = measures(summarise(own.cop))
    known = (sway_.rms / 100, sway_.speed / 100, sway_.frequencies.slope, sway_.diffusion.short.H)
    np.testing.assert_allclose(six[:4], known, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    {
        "short": (lambda t, x: (t[:2000], x[:2000], "mm"), r"20 s; expected at least 30 s"),
        "gap": (lambda t, x: (np.r_[t[:3000], t[3100:]], np.r_[x[:3000], x[3100:]], "mm"), "gap"),
        "missing": (lambda t, x: (t, np.where(np.arange(len(x)) == 7, np.nan, x), "mm"), "missing"),
        "stuck": (lambda t, x: (t, np.r_[x[:3000], [x[3000]] * 200, x[3200:]], "mm"), r"one value for 2 s from 30"),
        "cm called m": (lambda t, x: (t, x / 10, "m"), r"RMS of 0.4 m in m; .* probably wrong"),
        "m called mm": (lambda t, x: (t, x / 1000, "mm"), r"RMS of 0.004 mm in mm"),
        "no sway": (lambda t, x: (t, 0 * x, "mm"), "no sway at all"),
        "rad": (lambda t, x: (t, x, "rad"), "is in 'rad'; expected one of m, cm, mm"),
        "no unit": (lambda t, x: (t, x, ""), r"no unit; give one in the header, as 'ap \[cm\]'"),
        "slow": (lambda t, x: (t[::5], x[::5], "mm"), "20 rows a second; expected at least 40"),
    }.values(),
    ids=["short", "gap", "missing", "stuck", "cm", "m", "no", "rad", "unit", "slow"],
)
def test_what_is_no_trial_is_one_line(tmp_path, change, words):
    t, x, unit = change(*sway())
    path = written(tmp_path / "r.parquet", t, x, (("ap",), (unit,)))
    with pytest.raises(FitError, match=words) as caught:
        read_trials(path)
    assert str(caught.value).startswith(str(path))


EPOCH = 1.7e9  # s: a clock that counts from 1970 has times that are rounded to 0.24 microseconds


@pytest.mark.parametrize("begin", [0.0, -5.0, EPOCH + 0.3])
@pytest.mark.parametrize("rate", [40.0, 100.0, 1000.0])
def test_limits_are_not_decided_by_the_rounding_of_times(tmp_path, begin, rate):
    """30 s, 40 rows a second and 0.5 s of one value are allowed, wherever the clock begins."""
    _, x = sway(duration=31.0 if rate == 40 else 30.0, rate=rate)
    x[300 : 300 + round(0.5 * rate) + 1] = x[300]
    t = begin + np.arange(len(x)) / rate
    (one,) = read_trials(written(tmp_path / "r.parquet", t, x, (("ap",), ("mm",))))
    # a row at 0, and one each hundredth of a second up to the last row
    assert len(one.cop) == round((len(x) - 1) / rate * 100 - 0.5 + 1e-6) + 1


def test_what_is_too_short_after_it_was_resampled_is_refused_when_it_is_read(tmp_path):
    """The last of 1800 rows at 60 Hz is at 29.98 s, so that at 100 Hz there are 2999."""
    t, x = sway(duration=30.0, rate=60.0)
    with pytest.raises(FitError, match=r"ap: 29.99 s; expected at least 30 s"):
        read_trials(written(tmp_path / "r.parquet", t, x, (("ap",), ("mm",))))


@pytest.mark.parametrize("rate", [59.94, 60.0, 120.0])
def test_the_rate_of_times_that_are_written_to_milliseconds_is_their_mean_one(tmp_path, rate):
    """At 120 Hz their steps are of 8 and 9 ms, most of them of 8, which is 125 Hz."""
    t, x = sway(duration=60.0, rate=rate)
    (one,) = read_trials(written(tmp_path / "r.parquet", np.round(t, 3), x, (("ap",), ("mm",))))
    assert f"resampled from {rate:.4g} to 100 Hz" in one.notes
    assert resample_series(read_series(tmp_path / "r.parquet")).t[1] == pytest.approx(
        1 / rate, rel=1e-4
    )  # 1 ms in 60 s


def test_which_column_is_asked_where_it_is_not_clear(tmp_path):
    t, x = sway()
    path = tmp_path / "two.parquet"
    write_series(Series(t, np.column_stack([x, x]), ("left", "right"), ("mm", "mm")), path)
    with pytest.raises(FitError, match=r"which column is front to back\? There are left, right"):
        read_trials(path)
    assert [one.name for one in read_trials(path, ["left", "right"])] == ["left", "right"]


def test_the_public_data_set_is_read_from_its_own_files(tmp_path):
    head = "Time[s]\tFx[N]\tFy[N]\tFz[N]\tMx[Nm]\tMy[Nm]\tMz[Nm]\tCOPx[cm]\tCOPy[cm]\n"
    info = "Trial\tSubject\tVision\tSurface\tAge\tAgeGroup\n"
    for i, (person, vision) in enumerate((("1", "Open"), ("1", "Closed"), ("2", "Open"))):
        t, x = sway(rms=0.4, seed=i)
        rows = np.column_stack([t, np.ones((len(t), 6)), x, 2 * x])
        name = f"BDS{i + 1:05d}"
        info += f"{name}\t{person}\t{vision}\tFirm\t25.6\tYoung\n"
        if i < 2:
            lines = ("\t".join(f"{value:.6g}" for value in row) for row in rows)
            (tmp_path / f"{name}.txt").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "BDSinfo.txt").write_text(info, encoding="utf-8")
    trials = public_trials(tmp_path)
    assert [(one.person, one.vision, one.surface, one.group) for one in trials] == [
        ("1", "Open", "Firm", "Young"),
        ("1", "Closed", "Firm", "Young"),
    ]
    (read,) = read_trials(trials[1].file)
    np.testing.assert_allclose(read.cop, 1e-2 * sway(rms=0.4, seed=1)[1], atol=1e-7)
    people = list_people(FitCommand(model=("event",), table=tmp_path / "BDSinfo.txt"))
    assert [(one.label, one.group) for one in people] == [
        ("1, eyes open, firm", "Young"),
        ("1, eyes closed, firm", "Young"),
    ]
    np.testing.assert_array_equal(people[1].trials[0], read.cop)
    with pytest.raises(FitError, match="has none of the 1 files"):
        public_trials(tmp_path, [2])
    with pytest.raises(FitError, match="cannot be read"):
        public_trials(tmp_path / "nowhere")
    (tmp_path / "BDSinfo.txt").write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(FitError, match="no column Trial"):
        public_trials(tmp_path)


INFO = "Trial\tSubject\tVision\tSurface\tAge\tAgeGroup\n"


@pytest.mark.parametrize(
    ("text", "words"),
    {
        "short": (INFO + "BDS1\t1\tOpen\tFirm\t25\tYoung\nBDS2\t1\n", "line 3: lacks the Trial or the Subject"),
        "cut": (INFO + "BDS1\t1\tOp", "line 2: lacks the Trial"),
        "empty": (INFO + "BDS1\t\tOpen\tFirm\n", "line 2: lacks the Trial or the Subject"),
        "long": (INFO + "BDS1\t1\tOpen\tFirm\t25\tYoung\tx\n", "line 2: has 7 cells, and the header 6"),
        "twice": (
            INFO.replace("Age\t", "Subject\t") + "BDS1\t1\tOpen\tFirm\t1\tOld\n",
            "has the column 'Subject' twice",
        ),
        "many": (INFO + "BDS1\t1\tOpen\tFirm\n" * (MOST + 1), f"lists more than {MOST} recordings"),
        "none": ("", "no column Trial"),
        "name": (INFO + "a\0b\t1\tOpen\tFirm\n" + "x" * 5000 + "\t1\tOpen\tFirm\n", "has none of the 2 files"),
        "long line": (INFO + "x" * 200_000 + "\t1\tOpen\tFirm\n", "field larger than field limit"),
    }.values(),
    ids=["short", "cut", "empty", "long", "twice", "many", "none", "name", "long line"],
)
def test_a_damaged_table_of_the_public_data_set_is_one_line(tmp_path, text, words):
    (tmp_path / "BDSinfo.txt").write_text(text, encoding="utf-8")
    with pytest.raises(FitError, match=words):
        public_trials(tmp_path)


def test_a_table_of_the_public_data_set_may_have_short_rows_and_words_of_any_kind(tmp_path):
    """A row may end before the age group, and a quotation mark in one must not swallow the rows after it."""
    for i in (1, 2, 3):
        (tmp_path / f"BDS{i}.txt").write_text("")
    (tmp_path / "BDSinfo.txt").write_bytes(
        b"\xef\xbb\xbfTrial \t Subject\tVision\tSurface\tIllness\tAgeGroup\nBDS1\t1\tOpen\tFirm\n"
        b'BDS2\t1\tOpen\tFirm\t"\tOld\n\nBDS3\t3\tOpen\tFirm\t\xe7\tYoung\t\t\r\n'
    )
    found = public_trials(tmp_path)
    assert [(one.file.name, one.person, one.group) for one in found] == [
        ("BDS1.txt", "1", ""), ("BDS2.txt", "1", "Old"), ("BDS3.txt", "3", "Young"),
    ]  # fmt: skip


def test_summaries_are_finite_whatever_stands_there():
    rng = np.random.default_rng(0)
    t = np.arange(3000) / 100
    for x in (
        1e-3 * np.sin(t),
        rng.standard_normal(3000) * 1e-3,
        np.cumsum(rng.standard_normal(3000)),
        1e-8 * t,
        t > 20,
    ):
        found = summarise(x)
        assert found.shape == (len(SUMMARIES),)
        assert np.isfinite(found).all()
        assert np.abs(found).max() < 100
    for wrong, words in (
        (np.zeros(3000), "without any sway"),
        (t[:100], "at least 30 s"),
        (np.full(3000, np.nan), "not finite"),
    ):
        with pytest.raises(FitError, match=words):
            summarise(wrong)
