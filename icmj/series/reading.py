"""Reading recordings and other time series from files of any format of the shelf (:mod:`icmj.series.formats`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from icmj.base.files import open_file
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.formats import FORMATS
from icmj.series.long_table import label_of
from icmj.series.series import Series

MOST_BYTES = 500_000_000


def read_series(
    path: Path | str,
    *,
    columns: Sequence[str] = (),
    rate: float | None = None,
    since: float | None = None,
    until: float | None = None,
) -> Series:
    """The time series in a file of one trial that :func:`icmj.write_series` or another program has written.

    The form of a CSV file is that in which most cells are numbers (:mod:`icmj.series.csv_table`): its separators,
    decimal sign, and the lines before the table. Names are read from above the first numbers, such as ``ankle [rad]``
    or ``ankle (rad)``, or with a row of units below them. Columns of text, of further times and of row numbers are left
    out, which the fact ``left out`` says. For files of OpenSim (``.mot``, ``.sto``), units follow from the header and
    from conventional names of columns. A C3D file has signals of four kinds: centres of pressure (``plate1.cop.x``) and
    forces (``plate1.force.z``) of force plates, points (``C7.x``), and analog channels by their labels; by default the
    first kind that it contains is read. Signals that are read together must have the same rate.

    Where the vertical force of a plate is among the columns of a table (``Fz``, ``plate1.force.z``), a centre of
    pressure is missing in rows in which it is below 20 N, as in a C3D file.

    Only the requested columns are read, and such forces; their size is checked before, from headers or the number of
    lines.

    Args:
        path: ``.parquet``, ``.npz``, ``.mot``, ``.sto``, ``.c3d``; any other file is read as CSV.
        columns: names of the signals, in this order; by default all.
        rate: rows per second [Hz], for a file without times, or with times whose unit nothing says.
        since, until: times [s] before and after which rows are left out; by default none.

    Raises:
        DataError: if the file cannot be read, is too large, contains no numbers or no such columns, has no rows from
            ``since`` to ``until``, its times are missing, do not increase or have a unit that has to be said, it can
            be read in two ways, or holds several trials; for C3D, if ezc3d is not installed.
    """
    trials = read_long_table(path, columns=columns, rate=rate, since=since, until=until)
    if len(trials) > 1:
        raise DataError(
            f"{path}: {len(trials)} trials one below the other ({label_of(trials[0])}; {label_of(trials[1])}"
            f"{'; ...' if len(trials) > 2 else ''}); save the one that is meant in a file of its own, or read all of "
            "them with icmj.series.read_long_table"
        )
    return trials[0]


def read_long_table(
    path: Path | str,
    *,
    columns: Sequence[str] = (),
    rate: float | None = None,
    since: float | None = None,
    until: float | None = None,
) -> tuple[Series, ...]:
    """The time series of each trial in a file, as :func:`icmj.read_series` reads them; of most files there is one.

    Trials stand one below the other in a long table: a column names the trial of each row, as ``trial`` or ``trial_id``
    does, or its ``condition``, or its ``person``, ``subject`` or ``participant``; or several columns together do. Their
    labels are the facts ``trial``, ``condition`` and ``person`` of each series; the times of each are its own.

    Args:
        path, columns, rate, since, until: as for :func:`icmj.read_series`.

    Raises:
        DataError: as :func:`icmj.read_series`; also if a row has no label.
    """
    path = Path(path)
    try:
        if (advice := ELSEWHERE.get(path.suffix.lower())) is not None:
            raise DataError(f"not a format that icmj reads; {advice}")
        with open_file(path, MOST_BYTES) as file:
            ours = (one for one in FORMATS if path.suffix.lower() in one.SUFFIXES)
            found: tuple[Series, ...] = next(ours, FORMATS[FORMATS.names[0]]).read(path, file, columns, rate)
            return tuple(cut_rows(one, since, until) for one in found)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 200)
        raise DataError(f"{one_line(path, 200)}: cannot be read ({reason})") from error


def cut_rows(series: Series, since: float | None, until: float | None) -> Series:
    """The rows from ``since`` to ``until`` [s], where they are given.

    Raises:
        DataError: if there are none.
    """
    kept = series if since is None else series.since(since)
    kept = kept if until is None else kept.until(until)
    if len(series) and not len(kept):
        begin, end = (f"{given:g}" if given is not None else "" for given in (since, until))
        asked = " ".join(filter(None, (begin and f"from {begin} s", end and f"until {end} s")))
        raise DataError(f"no rows {asked}; it has rows from {series.t[0]:g} to {series.t[-1]:g} s")
    return kept


_TABLE = "save its table as CSV, with names and units in the first row"
ELSEWHERE = {
    **dict.fromkeys((".xlsx", ".xls", ".ods"), _TABLE),
    **dict.fromkeys(
        (".mat", ".h5", ".hdf5", ".npy", ".pkl", ".json"),
        "save its arrays as npz (numpy.savez) or CSV, one column for each signal",
    ),
    **dict.fromkeys((".trc", ".anc", ".tdf", ".qtm"), "export it as C3D or as a table"),
    ".feather": "save it as Parquet",
    **dict.fromkeys((".zip", ".gz", ".7z"), "unpack it first"),
}
"""What to do with files of other formats, by suffix."""
