"""What is observed of a motion, and what is unknown of it.

The observation of a motion: times of events, with or without the outputs at them, or an output at many instants;
in memory, or in files.

The rhythm of a motion that has settled, or nearly: its open-loop interval, and whether it is mirrored, from events or
outputs.

The unknown: one field of the run file, or a named change, between two bounds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, make_splrep
from scipy.optimize import minimize_scalar

from icmj.base.array import Array, leading
from icmj.base.files import open_file
from icmj.case.case import Case, expect_theory, prepare
from icmj.errors import DataError, IcmjError, IdentificationError
from icmj.plant.body import Change
from icmj.runfile.schema import RunFile
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
NEAR = 0.1  # relative: intervals that agree so well may be on their way to a cycle
_LEAST = 3  # of them
EXACT = 1e-9  # relative: no interval is known better
_FAR = 10.0  # standard deviations of the error of a time: intervals differ by no more for it
_CLOSED = 0.02  # of the size of the output: what may be left of a motion that repeats itself
_NEAR = 0.5  # the same between two shifts that are looked at
SPAN = 0.4  # part of the record over which it has to


@dataclass(frozen=True)
class Rhythm:
    """A motion that has settled, or nearly.

    Attributes:
        interval: open-loop interval [s].
        sign: +1; −1 if each interval mirrors the one before; 0 where that was not observed.
        count: intervals that are near to it.
        sampled: whether it is the shift after which outputs repeat themselves.
    """

    interval: float
    sign: int
    count: int
    sampled: bool = False

    @property
    def readings(self) -> tuple[Rhythm, ...]:
        """What it may be: outputs that repeat themselves are mirrored twice, where half of it does not repeat yet."""
        if not self.sampled or self.sign < 0:
            return (self,)
        return self, replace(self, interval=self.interval / 2, sign=-1)


def rhythm(observed: Observed) -> Rhythm | None:
    """The rhythm at the end of a motion, or ``None`` where it has none."""
    return _rhythm_of_events(observed) if len(observed.times) else _rhythm_of_samples(observed)


def _rhythm_of_events(observed: Observed) -> Rhythm | None:
    intervals = np.diff(observed.times)
    slack = _FAR * observed.jitter
    good = 0
    # from the end on, as long as they agree with the last ones
    for first in range(len(intervals) - _LEAST, -1, -1):
        tail = intervals[first:]
        if np.ptp(tail) > NEAR * tail.mean() + slack:
            break
        good = len(tail)
    if not good:
        return None
    # the later half, to be as near to the cycle as may be; of a mirrored one intervals may alternate
    n = max(_LEAST, 2 * (good // 4))
    return Rhythm(float(intervals[-n:].mean()), _sign(observed.outputs), good)


def _sign(outputs: Array) -> int:
    """Whether successive events mirror each other, from the output that says it most clearly."""
    if not outputs.shape[1] or len(outputs) < 2:
        return 0
    last = outputs[-min(len(outputs), 6) :]
    same = np.sum(last[1:] * last[:-1], axis=0) / np.maximum(np.sum(last[1:] ** 2, axis=0), 1e-300)
    clearest = float(same[leading(same)])
    return 0 if abs(clearest) < 0.5 else int(np.sign(clearest))


def _rhythm_of_samples(observed: Observed) -> Rhythm | None:
    """The shift after which the outputs repeat, unchanged or mirrored, in the last part of the record."""
    t, y = observed.t, observed.y
    stated = bool(observed.reading or observed.timing)
    curve = _smooth(t, y) if stated else CubicSpline(t, y)
    end, span = t[-1], SPAN * (t[-1] - t[0])
    at = np.linspace(end - span, end, 800)
    now = curve(at)
    size = np.sqrt(np.mean((now - now.mean(axis=0)) ** 2))
    unsure = np.sqrt(np.mean(observed.unsure(now.std(axis=0)) ** 2))
    rate = np.sqrt(np.mean(curve(at, 1) ** 2))
    # what errors of readings and times leave of a motion that repeats itself
    left_over = np.sqrt(2 * (unsure**2 + (rate * observed.jitter) ** 2)) / size
    closed = float(np.hypot(_CLOSED, left_over if stated else 0.0))

    def left(shift: float, sign: int) -> float:
        return float(np.sqrt(np.mean((curve(at - shift) - sign * now) ** 2)) / size)

    shifts = np.arange(4 * (t[-1] - t[0]) / len(t), (t[-1] - t[0]) * (1 - SPAN) * 0.98, 2 * (t[-1] - t[0]) / len(t))
    found = [each for sign in (1, -1) if (each := _first(left, shifts, sign, closed)) is not None]
    if not found:
        return None
    shift, sign = min(found)
    return Rhythm(shift, sign, max(1, int(span / shift)), sampled=True)


def _smooth(t: Array, y: Array) -> CubicSpline:
    """The outputs smoothed by splines, whose residual matches the noise level estimated from third differences."""
    fine = np.linspace(t[0], t[-1], 4 * len(t))
    errors = np.std(np.diff(y, 3, axis=0), axis=0) / np.sqrt(20)
    smooth = (make_splrep(t, column, s=len(t) * error**2) for column, error in zip(y.T, errors, strict=True))
    return CubicSpline(fine, np.column_stack([each(fine) for each in smooth]))


def _first(left, shifts: Array, sign: int, closed: float) -> tuple[float, int] | None:  # type: ignore[no-untyped-def]
    """The first shift after which the outputs repeat themselves with this sign."""
    gap = np.array([left(shift, sign) for shift in shifts])
    apart = False
    for i in range(1, len(shifts) - 1):
        apart = apart or gap[i] > 10 * _CLOSED + closed  # near 0 every motion repeats itself
        if apart and gap[i] <= min(gap[i - 1], gap[i + 1]) and gap[i] < _NEAR:
            # errors of readings make a valley rough: its deepest place
            beyond = np.flatnonzero(gap[i:] > gap[i] + 2 * closed)
            valley = i + int(np.argmin(gap[i : i + int(beyond[0])] if len(beyond) else gap[i:-1]))
            bounds = (shifts[valley - 1], shifts[valley + 1])
            best = minimize_scalar(left, args=(sign,), bounds=bounds, method="bounded", options={"xatol": 1e-10})
            if best.fun < closed:
                return float(best.x), sign
    return None


def _part(curve: CubicSpline, at: Array, sign: int):  # type: ignore[no-untyped-def]
    now = curve(at)
    return lambda shift: float(np.mean((curve(at - shift) - sign * now) ** 2))


@dataclass(frozen=True)
class Unknown:
    """The parameter that is to be identified.

    Attributes:
        run: the run file; its own value of the parameter is not used.
        field: dotted key of the run file, such as ``actual.gain`` (b) or ``actual.rho`` (ρ); "" for a change.
        change: a change of the actual plant whose factor is sought, or ``None``.
        low, high: bounds of the search.
        longest: Δ up to which crossings are searched [s]; if ``None``, that of the run file.
    """

    run: RunFile
    field: str = "actual.gain"
    change: Change | None = None
    low: float = 0.5
    high: float = 1.5
    longest: float | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite([self.low, self.high]).all() and self.low < self.high):
            raise IdentificationError(f"between {self.low:g} and {self.high:g} there is no range to search")

    @property
    def name(self) -> str:
        """The name that is shown."""
        if self.change is not None:
            return f"factor on {self.change.what}{f' of {self.change.of}' if self.change.of else ''}"
        return {"actual.gain": "b", "actual.rho": "ρ"}.get(self.field, self.field)

    def at(self, value: float, **changes: Any) -> RunFile:
        """The run file with ``value`` for the unknown.

        Raises:
            RunFileError: if this value is not allowed.
        """
        if self.longest is not None:
            changes["analysis.delta_max"] = max(self.longest, self.run.analysis.delta_max)
        if self.change is None:
            return self.run.with_(**{self.field: float(value)}, **changes)
        same = (self.change.what, self.change.of)
        actual = self.run.actual
        tables = zip(actual.change, actual.changes, strict=True)
        kept = [table.model_dump(exclude_none=True) for table, of in tables if (of.what, of.of) != same]
        of = {} if self.change.of is None else {"of": self.change.of}
        deviation = {"what": self.change.what, **of, "factor": float(value)}
        return self.run.with_(**{"actual.change": [*kept, deviation]}, **changes)

    def case(self, value: float, like: Case | None = None, **changes: Any) -> Case | None:
        """The case with this value, or ``None`` if no case with an event rule can be prepared."""
        try:
            case = prepare(self.at(value, **changes), like=like)
            expect_theory(case, "identification")
        except IcmjError:
            return None
        return case

    def checked(self) -> Case:
        """The case in the middle of the range, to check that it can be prepared.

        Raises:
            IcmjError: if the run file or its models do not have the field or change.
        """
        case = prepare(self.at((self.low + self.high) / 2))
        expect_theory(case, "identification")
        return case
