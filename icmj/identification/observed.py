"""The observation of a motion, in memory or in files.

It has times of events, with or without the outputs at them, or an output at many instants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import TextIOWrapper
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.files import open_file
from icmj.errors import DataError, IdentificationError, prefix_errors
from icmj.series.csv_table import LONGEST_LINE
from icmj.series.reading import MOST_BYTES, read_series
from icmj.simulation.simulation import Simulation

FEWEST = 4  # events, or rows, below which nothing can be said
READING = 0.01  # of its size: standard deviation of the error of an output, if nothing is said of it
MOST_EVENTS = 1_000_000
_DEGREES = ("deg", "degree", "degrees", "°")


@dataclass(frozen=True, eq=False)
class Observed:
    """The observed part of a motion.

    Attributes:
        times: times of the events [s], increasing, shape (K,); empty if only outputs were observed.
        outputs: outputs at the events, shape (K, n_y); (K, 0) if they were not observed.
        t, y: times [s] and the outputs at these times, shapes (N,) and (N, n_y); empty if only events were observed.
        begin: start of the record [s]; the first interval is counted from here.
        whole: whether the record begins with the initial state of the run file.
        resolution: resolution of the times [s]: the sampling interval, or the last decimal of the times of events.
        timing, reading: standard deviations of the errors of times [s] and of outputs [their unit]. If ``None``, they
            are the rounding error of the resolution, and a hundredth of the size of each output.
    """

    times: Array
    outputs: Array
    t: Array
    y: Array
    begin: float = 0.0
    whole: bool = False
    resolution: float = 0.0
    timing: float | None = None
    reading: float | None = None

    def __post_init__(self) -> None:
        for name in ("timing", "reading"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise IdentificationError(f"{name} {value:g}: expected a standard deviation, 0 or greater")

    @property
    def intervals(self) -> Array:
        """Open-loop intervals [s]: all K of a whole record, otherwise the K − 1 between the events."""
        return np.diff(self.times, prepend=self.begin) if self.whole else np.diff(self.times)

    @property
    def jitter(self) -> float:
        """Standard deviation of the errors of its times [s]."""
        return self.resolution / np.sqrt(12) if self.timing is None else self.timing

    def unsure(self, size: Array) -> Array:
        """Standard deviation of the errors of outputs with these sizes, shape (n_y,) [their units]."""
        return READING * size if self.reading is None else np.full(len(size), self.reading)

    def with_errors(self, timing: float | None, reading: float | None) -> Observed:
        """The same motion with other standard deviations of its errors.

        Raises:
            IdentificationError: if one of them is negative or not finite.
        """
        return replace(self, timing=timing, reading=reading)

    @property
    def duration(self) -> float:
        """Duration of the observation [s]."""
        last = max(self.times[-1] if len(self.times) else 0.0, self.t[-1] if len(self.t) else 0.0)
        return float(last - self.begin)

    @classmethod
    def of_simulation(cls, simulation: Simulation) -> Observed:
        """The events of a run and the outputs at the events, from the initial state of its run file on."""
        times = simulation.events.t
        # every event is a row
        rows = np.clip(np.searchsorted(simulation.t, times), 0, len(simulation.t) - 1)
        return cls(times, simulation.y[rows], np.zeros(0), np.zeros((0, 0)), 0.0, True)

    @classmethod
    def of_times(cls, times: Array) -> Observed:
        """A motion of which only times of events [s] are known, from any part of it.

        Raises:
            IdentificationError: if the times do not increase or are not finite.
        """
        times = _rising(times, "event times")
        nothing = np.zeros((len(times), 0))
        return cls(times, nothing, np.zeros(0), np.zeros((0, 0)), float(times[0]), False, _resolution(times))

    @classmethod
    def of_samples(cls, t: Array, y: Array) -> Observed:
        """A motion of which outputs at many times are known, from any part of it; shapes (N,) and (N, n_y).

        Raises:
            IdentificationError: if times do not increase, or a value is not finite.
        """
        t, y = _rising(t, "instants"), np.asarray(y, float).reshape(len(t), -1)
        if not np.isfinite(y).all():
            raise IdentificationError("an output is not finite; leave out what was not measured")
        if not np.any(np.ptp(y, axis=0) > 0):
            raise IdentificationError("the outputs do not move")
        return cls(np.zeros(0), np.zeros((0, 0)), t, y, float(t[0]), False, float(np.median(np.diff(t))))


def _rising(times: Array, what: str) -> Array:
    times = np.asarray(times, float).ravel()
    if len(times) < FEWEST:
        raise IdentificationError(f"{len(times)} {what}; expected at least {FEWEST}")
    if not np.isfinite(times).all() or np.any(np.diff(times) <= 0):
        raise IdentificationError(f"{what} must rise and be finite")
    return times


def _resolution(times: Array) -> float:
    """The decimal that all times are rounded to [s]; 0 where there are more than nine."""
    for digits in range(9):
        if np.allclose(times, np.round(times, digits), rtol=0, atol=1e-12 * max(1.0, np.abs(times).max())):
            return float(10.0**-digits)
    return 0.0


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
    with prefix_errors(path):
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


def _single_column(path: Path) -> list[float] | None:
    """Numbers one a line, or ``None`` where it is another kind of file."""
    found: list[float] = []
    headed = False
    try:
        with TextIOWrapper(open_file(path, MOST_BYTES), encoding="utf-8-sig") as file:
            for line in filter(str.strip, iter(lambda: file.readline(LONGEST_LINE), "")):
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
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    return found or None


SETTLED = 1e-3  # relative: intervals that agree so well have settled
EXACT = 1e-9  # relative: no interval is known better
