"""Observed motions from files: event times, one a line, or sampled outputs with their times."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from icmj.errors import DataError, IdentificationError
from icmj.identification.observed import Observed
from icmj.series.csv_shape import LONGEST
from icmj.series.reading import read_series

MOST_EVENTS = 1_000_000
_DEGREES = ("deg", "degree", "degrees", "°")


def read_observed(path: Path, outputs: tuple[str, ...]) -> Observed:
    """Read an observed motion from a file.

    Args:
        path: a file of numbers one a line (times of events [s], a line of text may stand above), or a file of time
            series (:func:`icmj.read_series`) with columns named as outputs of the plant; degrees are made radians.
        outputs: names of the plant's outputs.

    Raises:
        DataError, IdentificationError: if it cannot be read, or holds neither.
    """
    times = _single_column(path)
    try:
        if times is not None:
            return Observed.of_times(np.array(times))
        series = read_series(path)
        found = {name.removeprefix("y."): i for i, name in enumerate(series.names)}
        there = [name for name in outputs if name in found]
        if not there and len(series.names) == len(outputs):
            there, found = list(outputs), {name: i for i, name in enumerate(outputs)}
        if there != list(outputs):
            raise IdentificationError(
                f"has {', '.join(series.names[:8])}; expected the outputs of the plant, {', '.join(outputs)}"
            )
        columns = [found[name] for name in outputs]
        factor = [np.pi / 180 if series.units[i].lower() in _DEGREES else 1.0 for i in columns]
        return Observed.of_samples(series.t, series.values[:, columns] * factor)
    except IdentificationError as error:
        raise IdentificationError(f"{path}: {error}") from error


def _single_column(path: Path) -> list[float] | None:
    """Numbers one a line, or ``None`` where it is another kind of file."""
    if not path.is_file():
        return _missing(path)
    found: list[float] = []
    headed = False
    try:
        with path.open(encoding="utf-8-sig") as file:
            for line in filter(str.strip, iter(lambda: file.readline(LONGEST), "")):
                try:
                    found.append(float(line))
                except ValueError:
                    if found or headed:
                        return None
                    headed = True
                if len(found) > MOST_EVENTS:
                    raise DataError(f"{path}: more than {MOST_EVENTS} times of events; cut it into parts")
    except UnicodeDecodeError:
        return None
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return found or None


def _missing(path: Path) -> list[float] | None:
    raise DataError(f"{path}: no such file")
