"""Recordings of standing people as trials: front-to-back centre of pressure [m] at 100 Hz, or one line on why not.

Summaries of one trial: what inference sees of a front-to-back centre of pressure, recorded or simulated.

The first six are measures of sway as :func:`icmj.measure_sway` defines them (docs/measures.md). The others are the
field's (Tietäväinen et al. 2017, Suzuki et al. 2020), of the centre of mass that belongs to the centre of pressure,
which is what ω₀²/(ω₀² + ω²) leaves of it, below 10 Hz, without its linear trend. They are the sizes of its position,
velocity and acceleration, the shares of |x|, |x'| and |x''| in bins up to three deviations, and the power at log-spaced
frequencies. Positive ones are taken as logarithms.
"""

from __future__ import annotations

import csv
import io
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, count_steps, is_between
from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.errors import DataError, FitError
from icmj.fitting.family import DURATION, RATE
from icmj.measurement import sway
from icmj.series.even_rows import expect_rate, resample_series
from icmj.series.long_table import label_of
from icmj.series.plausibility import STUCK, measure_longest_still, note_oddities
from icmj.series.reading import read_long_table
from icmj.series.series import EVEN, Series
from icmj.series.units import find_factor

_SIX = {
    "rms": "rms", "speed": "speed", "slope": "frequency.slope", "H short": "short.H", "H long": "long.H",
    "mean frequency": "frequency.mean",
}  # fmt: skip
MEASURES = tuple(_SIX)
"""The six measures of sway; units ``MEASURE_UNITS``."""
MEASURE_UNITS = ("m", "m/s", "", "", "", "Hz")
LEAST = 30.0  # s
_LOGS = np.array([True, True, False, False, False, True])
_OMEGA = 2.9  # rad/s, of a standing adult as an inverted pendulum: √(mgh/J)
_LOW_PASS = 10.0  # Hz
_BINS, _REACH = 8, 3.0  # bins of a histogram, and where they end, in deviations
_LINES = np.geomspace(0.1, 1.5, 10)  # Hz
_FLOOR = 1e-12
_SLOPES, _H = 12.0, 2.0  # what a slope and an H are cut at

SUMMARIES = (
    *(f"log {name}" if log else name for name, log in zip(MEASURES, _LOGS, strict=True)),
    *(f"log size of {what}" for what in ("x", "x'", "x''")),
    *(f"share of |{what}| in bin {i + 1}" for what in ("x", "x'", "x''") for i in range(_BINS)),
    *(f"log power at {f:.3g} Hz" for f in _LINES),
)
"""Names of the summaries, in their order."""


def summarise(cop: ArrayLike, rate: float = 100.0) -> Array:
    """The summaries of one trial.

    Args:
        cop: front-to-back centre of pressure [m], shape (N,), for at least 30 s.
        rate: samples per second [Hz].

    Returns:
        shape (s,), finite; named by ``SUMMARIES``.

    Raises:
        FitError: if it is too short, has values that are not finite, or does not move.
    """
    x = np.asarray(cop, dtype=float)
    if x.ndim != 1 or len(x) < count_steps(LEAST * rate):
        raise FitError(f"a trial of shape {x.shape} at {rate:g} Hz; expected at least {LEAST:g} s of one coordinate")
    if not np.isfinite(x).all():
        raise FitError("a trial contains values that are not finite")
    if not np.ptp(x) > 1e-9:
        raise FitError("a trial without any sway")
    return np.concatenate([_scale(_measures(x, rate)), _field(x, rate)])


def measures(summaries: ArrayLike) -> Array:
    """The six measures of sway in summaries, shape (..., 6): m, m/s, –, –, –, Hz."""
    six = np.asarray(summaries, dtype=float)[..., : len(MEASURES)]
    return np.where(_LOGS, np.exp(np.where(_LOGS, six, 0.0)), six)


def _measures(x: Array, rate: float) -> Array:
    series = Series(np.arange(len(x)) / rate, x[:, None], ("cop",), ("m",))
    found = {number.key: value for number, value in sway.measure_sway(series).coordinates[0].numbers.items()}
    if missing := [key for key in _SIX.values() if key not in found]:
        raise FitError(f"a fit is of {', '.join(_SIX.values())}, and there is no measure {', '.join(missing)}")
    return np.array([found[key] for key in _SIX.values()])


def _scale(six: Array) -> Array:
    six = np.nan_to_num(six)
    cut = np.clip(six, [-np.inf, -np.inf, -_SLOPES, -_H, -_H, -np.inf], [np.inf, np.inf, _SLOPES, _H, _H, np.inf])
    return np.where(_LOGS, np.log(np.maximum(cut, _FLOOR)), cut)


def _field(x: Array, rate: float) -> Array:
    """The field's, of the centre of mass."""
    from scipy.fft import irfft, rfft, rfftfreq
    from scipy.signal import detrend

    N = len(x)
    edge = count_steps(rate)  # mirrored at both ends, where a jump would ring through velocity and acceleration
    straight = detrend(x)
    longer = np.concatenate(
        [2 * straight[0] - straight[edge:0:-1], straight, 2 * straight[-1] - straight[-2 : -edge - 2 : -1]]
    )
    omega = 2 * np.pi * rfftfreq(len(longer), 1 / rate)
    com = rfft(longer) * (_OMEGA**2 / (_OMEGA**2 + omega**2)) / np.sqrt(1 + (omega / (2 * np.pi * _LOW_PASS)) ** 8)
    motions = [irfft(com * (1j * omega) ** order, len(longer))[edge : edge + N] for order in range(3)]
    sizes = [float(motion.std()) for motion in motions]
    shares = []
    for motion, size in zip(motions, sizes, strict=True):
        reach = _REACH * max(size, _FLOOR)
        bins = np.minimum((np.abs(motion - motion.mean()) * (_BINS / reach)).astype(int), _BINS - 1)
        shares.append(np.bincount(bins, minlength=_BINS) / N)
    window = np.hanning(N)
    power = np.abs(rfft(motions[0] * window)) ** 2 / (rate * (window @ window))
    f = rfftfreq(N, 1 / rate)
    ratio = np.sqrt(_LINES[1] / _LINES[0])
    lines = [power[is_between(f, line / ratio, line * ratio)].mean() for line in _LINES]
    return np.concatenate([np.log(np.maximum(sizes, _FLOOR)), *shares, np.log(np.maximum(lines, _FLOOR**2))])


NAMES = ("ap", "cop_ap", "copap", "cop.ap", "copx", "cop_x", "cop")
"""Names of a front-to-back centre of pressure, in small letters, that are looked for where no column is named."""
INFO = "BDSinfo.txt"
_SLOWEST = 40.0  # Hz: below this rate the fast measures are those of the interpolation
_LARGEST, _SMALLEST = 0.05, 1e-4  # m, RMS of a person who stands
MOST = 10_000
"""Recordings that a table may list, and trials that they may hold: those of so many take half a gigabyte."""
_MOST_BYTES = 10_000_000  # of a table


@dataclass(frozen=True, eq=False)
class TrialOf:
    """One recorded trial of a person.

    Attributes:
        name: name of the trial, from its file and column.
        cop: front-to-back centre of pressure [m] at 100 Hz, shape (N,).
        notes: changes that were made to the recording.
        person, condition: what a long table calls them; "" where it does not.
    """

    name: str
    cop: Array
    notes: tuple[str, ...] = ()
    person: str = ""
    condition: str = ""

    @property
    def duration(self) -> float:
        """Duration of the trial [s]."""
        return len(self.cop) / RATE


def read_trials(
    path: Path | str,
    columns: Sequence[str] = (),
    *,
    unit: str | None = None,
    rate: float | None = None,
    since: float | None = None,
    until: float | None = None,
) -> tuple[TrialOf, ...]:
    """Read the trials in one file of any kind that :func:`icmj.series.read_long_table` reads; each column is one trial.

    Args:
        path: the file.
        columns: front-to-back centres of pressure; by default the column with such a name (``NAMES``, or a name that
            ends in ``_ap``), or the only column.
        unit: ``m``, ``cm`` or ``mm``, for a file that states no unit.
        rate: rows per second [Hz], for a file without times.
        since, until: times [s] before and after which rows are left out.

    Raises:
        FitError: one line that names the file, if it cannot be read, has no such column or unit, is too short, has
            gaps, or does not contain the sway of a standing person.
    """
    with _of(path):
        found = []
        for series in read_long_table(path, columns=columns, rate=rate, since=since, until=until):
            chosen, label = tuple(columns) or _guess_column(series), label_of(series)
            with _of(label):
                parts = [part for name in chosen for part in trials_of(expect_rate(series, rate), name, unit=unit)]
            person, condition = (series.facts.get(topic, "") for topic in ("person", "condition"))
            for part in parts:
                name = ", ".join(filter(None, (label, part.name)))
                found.append(replace(part, name=name, person=person, condition=condition))
        return tuple(found)


def trials_of(series: Series, column: str, *, unit: str | None = None) -> tuple[TrialOf, ...]:
    """The trials in one column of a series; more than 90 s are cut into pieces of 60 s, without what is left over.

    Raises:
        FitError: as :func:`icmj.fitting.read_trials`.
    """
    name = series.names[_place(series, column)]
    given = series.units[series.place(name)]
    if given and unit and given != unit:
        raise FitError(f"{name}: is in {given} by its header, and in {unit} as asked for; leave one out")
    known = given or unit
    if not known:
        raise FitError(_no_unit(name))
    with _of(name):
        metre = find_factor(known, "length", name)
        even = resample_series(series.chosen([name]))
    t, x = even.t, even.values[:, 0] * metre
    own = (len(t) - 1) / float(t[-1] - t[0])
    _refuse_short(name, len(t) / own, LEAST * (1 - EVEN))  # a rate is known as well as its times are
    if own < _SLOWEST * (1 - EVEN):
        raise FitError(f"{name}: {own:.3g} rows a second; expected at least {_SLOWEST:g}, better {RATE:g}")
    _see_it_stands(name, known, t, x, 1 / own)
    facts = note_oddities(even).facts
    notes = [facts[key] for key in ("load", "cut", "ends", "odd") if key in facts]
    if abs(own - RATE) > EVEN * RATE:
        notes.append(f"resampled from {own:.4g} to {RATE:g} Hz")
        x = resample_series(even, RATE).values[:, 0] * metre
    _refuse_short(name, len(x) / RATE)
    if len(x) > 1.5 * DURATION * RATE:
        size, pieces = round(DURATION * RATE), count_steps(len(x) / (DURATION * RATE))
        left = (len(x) - pieces * size) / RATE
        said = f"cut into {pieces} trials of {DURATION:g} s" if pieces > 1 else f"cut to its first {DURATION:g} s"
        notes.append(said + (f", without the last {left:.4g} s" if left > 0 else ""))
        parts = [x[i * size : (i + 1) * size] for i in range(pieces)]
        names = [f"{name}, part {i + 1}" for i in range(pieces)] if pieces > 1 else [name]
        return tuple(TrialOf(of, part, tuple(notes)) for of, part in zip(names, parts, strict=True))
    if abs(len(x) / RATE - DURATION) > 0.05 * DURATION:
        notes.append(
            f"{len(x) / RATE:.4g} s long, and simulated ones {DURATION:g} s: slow measures are not quite alike"
        )
    return (TrialOf(name, x, tuple(notes)),)


@dataclass(frozen=True)
class PublicTrial:
    """One trial of the public data set of Santos and Duarte (2016).

    Attributes:
        file: its text file.
        person: number of the person.
        vision, surface: ``Open`` or ``Closed``, ``Firm`` or ``Foam``.
        group: age group, ``Young`` or ``Old``; "" if the table has none.
    """

    file: Path
    person: str
    vision: str
    surface: str
    group: str = ""


def public_trials(folder: Path | str, people: Sequence[str | int] = ()) -> tuple[PublicTrial, ...]:
    """The trials in a folder with the text files of the public data set, as listed in its table ``BDSinfo.txt``.

    Each file, such as ``BDS00001.txt``, has the columns Time[s], forces, moments, COPx[cm] and COPy[cm]; x is front to
    back. :func:`icmj.fitting.read_trials` reads these files.

    Args:
        folder: folder with ``BDSinfo.txt`` and the files.
        people: numbers of the requested people; by default all people whose files are in the folder.

    Raises:
        FitError: if the table cannot be read, or none of its files is in the folder.
    """
    table, needed = Path(folder) / INFO, ("Trial", "Subject", "Vision", "Surface")
    names, rows = read_table(table, (*needed, "AgeGroup"), required=needed, delimiter="\t")
    missing = [name for name in needed if name not in names]
    if missing:
        raise FitError(f"{table}: no column {missing[0]}; expected the table of the data set, separated by tabs")
    wanted = {str(person) for person in people}
    found = tuple(
        PublicTrial(
            Path(folder) / f"{Path(row['Trial']).name}.txt",
            row["Subject"],
            row["Vision"],
            row["Surface"],
            row.get("AgeGroup", ""),
        )
        for row in rows
        if not wanted or row["Subject"] in wanted
    )
    there = tuple(one for one in found if os.path.isfile(one.file))  # no name of a file at all is none, too
    if not there:
        raise FitError(f"{folder}: has none of the {len(found)} files that {INFO} names")
    return there


def read_table(
    path: Path, columns: Sequence[str], *, required: Sequence[str], delimiter: str = ","
) -> tuple[tuple[str, ...], list[dict[str, str]]]:
    """The table of recordings in a text file: its header, and of each row the cells of some columns.

    Cells lose surrounding white space. Empty lines, and comments (#) before the header, are left out; cells that a
    short row lacks are empty.

    Args:
        path: a text file, whose first line names the columns.
        columns: those that are read, where the file has them.
        required: those of them that no row may lack.
        delimiter: between cells; those of a table with tabs have no quotes around them.

    Raises:
        FitError: one line that names the file and the line in it, if it cannot be read, is too large, names a column
            twice, or a row has more cells than the header or lacks one that is required.
    """
    tabs = delimiter == "\t"
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig", "replace" if tabs else "strict")
        quoting: Literal[0, 3] = csv.QUOTE_NONE if tabs else csv.QUOTE_MINIMAL
        lines = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, quoting=quoting, strict=True)
        head: list[str] = next(lines, [])
        while not tabs and head and head[0].startswith("#"):
            head = next(lines, [])
        names = tuple(cell.strip() for cell in head)
        twice = [name for name, count in Counter(names).items() if count > 1 and name in columns]
        if twice:
            raise FitError(f"{path}: has the column {twice[0]!r} twice")
        at = {name: names.index(name) for name in columns if name in names}
        rows = []
        for cells in lines:
            if not any(map(str.strip, cells)):
                continue
            where = f"{path}, line {lines.line_num}"
            if any(map(str.strip, cells[len(names) :])):
                raise FitError(f"{where}: has {len(cells)} cells, and the header {len(names)}")
            row = {name: cells[i].strip() if i < len(cells) else "" for name, i in at.items()}
            if not all(row[name] for name in required if name in row):
                raise FitError(f"{where}: lacks the {' or the '.join(required)}")
            rows.append(row)
            if len(rows) > MOST:
                raise FitError(f"{path}: lists more than {MOST} recordings; fit them in parts")
    except OSError as error:
        raise FitError(f"{path}: cannot be read ({error.strerror})") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise FitError(f"{path}: is not a table of text ({one_line(error, 100)})") from error
    return names, rows


def _refuse_short(name: str, duration: float, least: float = LEAST) -> None:
    if duration < least:
        raise FitError(f"{name}: {duration:.4g} s; expected at least {LEAST:g} s of standing")


def _see_it_stands(name: str, unit: str, t: Array, x: Array, step: float) -> None:
    """See that this is the sway of a person who stands, in its unit."""
    longest, since = measure_longest_still(t, x)
    rms = float(x.std())
    if rms < 1e-9:
        raise FitError(f"{name}: no sway at all; is it the right column?")
    if longest > STUCK + EVEN * step:
        raise FitError(f"{name}: one value for {longest:.2g} s from {since:.4g} s on, as a filled gap; cut it")
    if rms > _LARGEST:
        raise FitError(
            f"{name}: an RMS of {rms:.3g} m in {unit}; standing people have 1 to 20 mm, so the unit is probably wrong"
        )
    if rms < _SMALLEST:
        raise FitError(
            f"{name}: an RMS of {1e3 * rms:.3g} mm in {unit}; standing people have 1 to 20 mm, so the unit is "
            "probably wrong"
        )


def _guess_column(series: Series) -> tuple[str, ...]:
    """The column that is a front-to-back centre of pressure by its name."""
    small = [name.lower() for name in series.names]
    named = [name for name in NAMES if name in small]
    if named:
        return (series.names[small.index(named[0])],)
    ends = [name for name in series.names if name.lower().endswith("_ap")]
    if len(ends) == 1 or len(series.names) == 1:
        return (*ends, *series.names)[:1]
    raise FitError(f"which column is front to back? There are {', '.join(series.names[:12])}; name one")


def _place(series: Series, column: str) -> int:
    try:
        return series.place(column)
    except DataError as error:
        raise FitError(str(error)) from error


def _no_unit(name: str) -> str:
    return f"{name}: no unit; give one in the header, as '{name} [cm]', or with --unit"


@contextmanager
def _of(path: Path | str) -> Iterator[None]:
    """Errors within the block name the file once."""
    try:
        yield
    except (DataError, FitError) as error:
        words = str(error)
        raise FitError(words if words.startswith(str(path)) or not path else f"{path}: {words}") from error
