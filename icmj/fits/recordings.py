"""Recordings of standing people as trials: front-to-back centre of pressure [m] at 100 Hz, or one line on why not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from icmj.base.array import Array, count_steps
from icmj.errors import DataError, FitError
from icmj.fits.family import DURATION, RATE
from icmj.fits.summaries import LEAST
from icmj.series.even_rows import expect_rate, resample_series
from icmj.series.long_table import label_of
from icmj.series.plausibility import STUCK, measure_longest_still, note_oddities
from icmj.series.reading import read_long_table
from icmj.series.series import EVEN, Series
from icmj.series.units import find_factor

NAMES = ("ap", "cop_ap", "copap", "cop.ap", "copx", "cop_x", "cop")
"""Names of a front-to-back centre of pressure, in small letters, that are looked for where no column is named."""
_SLOWEST = 40.0  # Hz: below this rate the fast measures are those of the interpolation
_LARGEST, _SMALLEST = 0.05, 1e-4  # m, RMS of a person who stands


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
        FitError: as :func:`icmj.fits.read_trials`.
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
