"""A time series: some signals that share their times, each with a name and a unit.

Resampling to even times: recorded times are only nearly even, and rows at events are not.

Interpolation of piecewise smooth signals between recorded rows.

A controlled motion jumps, or bends, whenever new feedback, a delayed action or a push sets in. Across such an instant
nothing is interpolated: each piece between two of them has a cubic spline of its own (not-a-knot, so of fourth order in
the distance of the rows), which is extended to the piece's ends where there is no row.

At the instant itself one side is given, the same as in a row there: at an event the value before the reset, which
belongs to the interval that ends; at any other break the value from there on.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.base.numbers import MISSING, Card, WithCard, amount
from icmj.errors import DataError

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

EVEN = 1e-3
"""Share of a step that times may be off: rounded ones are, and those of a clock that counts seconds from 1970."""
MOST_SHOWN = 40  # signals in a notebook
# signals called x.ankle, x.knee are the variable x along the dimension state, and so on
DIMENSIONS = {
    "x": "state",
    "y": "output",
    "y_max": "output",
    "y_min": "output",
    "u": "input",
    "applied": "input",
    "x_o": "assumed_state",
    "x_h": "assumed_state",
    "push": "push_name",
    "cop": "axis",
    "load": "contact",
    "r": "channel",
}
STEADY = ("x", "y", "x_o")  # of these, those that bend where an input jumps, and do not jump
COUNTER = "interval"  # of a run's signals, the number of events before each row
SETTLED = "settled"  # the fact of a trial of an experiment that its beginning is left out already
REMARKS = {
    "odd": "",
    "load": "",
    "part": "",
    "left out": "",
    "resampled": "resampled by a ",
}  # facts that people are told, and the words before them


@dataclass(frozen=True, eq=False, repr=False)
class Series(WithCard):
    """Signals over time, with names and units.

    Attributes:
        t: times [s], strictly increasing, shape (N,).
        values: values of the signals, shape (N, w); NaN if a value is missing.
        names: unique names of the signals, length w.
        units: units of the signals, such as rad or N m; "" if unknown; length w.
        facts: further information about them, as text by topic.
        jumps: times of rows after which signals of a run jump [s]: where its ``interval``, the number of events before
            a row, rises.

    Raises:
        DataError: on construction, if shapes and names do not fit, or times do not increase.
    """

    t: Array
    values: Array
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    facts: dict[str, str] = field(default_factory=dict)
    jumps: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        t, values = np.asarray(self.t, dtype=float), np.asarray(self.values, dtype=float)
        names, units = tuple(self.names), tuple(self.units) or ("",) * len(self.names)
        if t.ndim != 1 or values.shape != (len(t), len(names)) or len(units) != len(names):
            raise DataError(
                f"times {t.shape}, values {values.shape}, {len(names)} names and {len(units)} units do not fit; "
                "expected (N,), (N, w), w and w"
            )
        see_names_differ(names)
        wrong = np.flatnonzero(~(np.diff(t) > 0))  # where one is not a number, too
        if len(wrong) or not np.isfinite(t[:1]).all() or not np.isfinite(t[-1:]).all():
            at = int(wrong[0]) + 1 if len(wrong) else 0
            raise DataError(f"times do not rise at row {at + 1}: {t[at]:g} s after {t[max(at - 1, 0)]:g} s")
        jumps = self.jumps
        if COUNTER in names and not units[names.index(COUNTER)]:
            jumps = t[:-1][_rises(values[:, names.index(COUNTER)])]
        for name, value in (("t", t), ("values", values), ("names", names), ("units", units), ("jumps", jumps)):
            object.__setattr__(self, name, value)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook: each signal with its smallest and largest value."""
        span = f"{len(self)} rows" + (f" from {self.t[0]:g} to {self.t[-1]:.6g} s" if len(self) else "")
        known = [column[np.isfinite(column)] for column in self.values.T]
        rows = tuple(
            (name, f"{amount(float(v.min()), unit)} to {amount(float(v.max()), unit)}" if len(v) else MISSING)
            for name, unit, v in zip(self.names[:MOST_SHOWN], self.units, known, strict=False)
        )
        more = f"and {len(self.names) - MOST_SHOWN} more signals" if len(self.names) > MOST_SHOWN else ""
        facts = ", ".join(f"{key} {value}" for key, value in self.facts.items())
        names = ", ".join(self.names[:3]) + (", ..." if len(self.names) > 3 else "")
        return Card(f"{span}, {len(self.names)} signals ({names})", rows, "; ".join(filter(None, (span, more, facts))))

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, name: str) -> Array:
        """One signal by its name, or by the end of it after a point where that is clear; shape (N,)."""
        return self.values[:, self.place(name)]

    def place(self, name: str) -> int:
        """The column of a signal.

        Raises:
            DataError: if there is no such signal, or several of this name.
        """
        return place(self.names, name)

    def chosen(self, names: Sequence[str]) -> Series:
        """Some of the signals, in this order.

        Raises:
            DataError: if there is no such signal.
        """
        at = [self.place(name) for name in names]
        return replace(
            self,
            values=self.values[:, at],
            names=tuple(self.names[i] for i in at),
            units=tuple(self.units[i] for i in at),
        )

    def since(self, t: float) -> Series:
        """The rows from ``t`` [s] on, to leave out the beginning; a row that rounding puts before it is one of them."""
        late = self.t >= t - (EVEN * float(np.median(np.diff(self.t))) if len(self) > 1 else 0.0)
        return replace(self, t=self.t[late], values=self.values[late])

    def until(self, t: float) -> Series:
        """The rows up to ``t`` [s], to leave out the end; a row that rounding puts behind it is one of them."""
        early = self.t <= t + (EVEN * float(np.median(np.diff(self.t))) if len(self) > 1 else 0.0)
        return replace(self, t=self.t[early], values=self.values[early])

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was done to recorded rows, or is odd about them, in words: those of its facts that say so."""
        return tuple(f"{words}{self.facts[key]}" for key, words in REMARKS.items() if key in self.facts)

    def to_pandas(self) -> DataFrame:
        """The series as a pandas ``DataFrame`` with the index ``t`` [s]; units by column are in ``attrs["units"]``.

        Raises:
            DataError: if pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise DataError("pandas is not installed; `pip install pandas`, or take the arrays of Series") from error
        frame = pandas.DataFrame(self.values, index=pandas.Index(self.t, name="t"), columns=list(self.names))
        frame.attrs = {"units": dict(zip(("t", *self.names), ("s", *self.units), strict=True)), **self.facts}
        return frame

    def to_xarray(self, along: str = "t") -> Dataset:
        """The series as an ``xarray.Dataset`` with the coordinate ``t`` [s] and units.

        Signals of a run become one variable for each kind: ``x`` with the dimensions (t, state), ``y`` (t, output),
        ``u`` and ``applied`` (t, input), ``x_o`` and ``x_h`` (t, assumed_state). Their names are coordinates, and so
        are their units, such as ``x_units``. If all signals of a variable have the same unit, its attribute ``units``
        contains it, too. Every other signal is a variable along t.

        Args:
            along: name of the dimension of the rows.

        Raises:
            DataError: if xarray is not installed.
        """
        return dataset(self.t, self.values, self.names, self.units, self.facts, along)

    @property
    def headers(self) -> tuple[str, ...]:
        """``t [s]`` and each name with its unit, such as ``ankle [rad]``; only the name if there is no unit."""
        return ("t [s]", *(header(name, unit) for name, unit in zip(self.names, self.units, strict=True)))


def _rises(count: Array) -> np.ndarray:
    """Mask of the rows, but the last, after which a count of events rises; none if it is no such count."""
    rises = np.diff(count) > 0
    whole = np.isfinite(count).all() and (count == np.rint(count)).all() and (np.diff(count) >= 0).all()
    return rises & bool(whole and 2 * rises.sum() < len(count))  # else it numbers the rows themselves


def steady(names: Sequence[str]) -> np.ndarray:
    """Mask of the names of signals that bend where an input jumps, and do not jump."""
    return np.array([name.split(".")[0] in STEADY for name in names], dtype=bool)


def place(names: Sequence[str], name: str) -> int:
    """Index of a name in ``names``: an exact match, or the only name with this ending after a point.

    Raises:
        DataError: if there is none, or there are several.
    """
    if name in names:
        return list(names).index(name)
    found = [i for i, whole in enumerate(names) if whole.endswith(f".{name}")]
    if len(found) == 1:
        return found[0]
    if found:
        raise DataError(f"{name!r} could be {' or '.join(names[i] for i in found)}; give the whole name")
    known = ", ".join(names[:40]) + (", ..." if len(names) > 40 else "")
    raise DataError(f"no column {name!r}; expected one of {known}")


def see_names_differ(names: Sequence[str]) -> None:
    """Check that the names of signals differ.

    Raises:
        DataError: if two have.
    """
    twice = sorted({name for name, count in Counter(names).items() if count > 1})
    if twice:
        raise DataError(f"several signals are called {', '.join(twice)}; give each a name of its own")


def header(name: str, unit: str) -> str:
    """``ankle [rad]``, or the name alone without a unit."""
    return f"{name} [{unit}]" if unit else name


def dataset(
    t: Array, values: Array, names: Sequence[str], units: Sequence[str], facts: Mapping[str, str], along: str
) -> Dataset:
    """The dataset; see :meth:`icmj.series.series.Series.to_xarray`."""
    try:
        import xarray
    except ImportError as error:
        raise DataError("xarray is not installed; `pip install xarray`, or take the arrays of Series") from error
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"t": (along, t, {"units": "s", "long_name": "time"})}
    for name, at in _variables(names).items():
        own = [units[i] for i in at]
        attributes = {"units": own[0]} if len(set(own)) == 1 else {}
        if names[at[0]] == name:
            taken = name in ("t", along, *DIMENSIONS.values())
            variables[f"{name}_signal" if taken else name] = (along, values[:, at[0]], attributes)
            continue
        labels, dimension = [names[i].split(".", 1)[1] for i in at], DIMENSIONS[name]
        if dimension in coordinates and list(coordinates[dimension][1]) != labels:
            dimension = f"{name}_name"  # of other signals than the variable before it
        coordinates[dimension] = (dimension, labels)
        coordinates[f"{name}_units"] = (dimension, own)
        variables[name] = ((along, dimension), values[:, at], attributes)
    return xarray.Dataset(variables, coordinates, dict(facts))


def _variables(names: Sequence[str]) -> dict[str, list[int]]:
    """The columns of each variable, in the order of the series."""
    found: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        kind = name.split(".", 1)[0]
        found.setdefault(kind if "." in name and kind in DIMENSIONS else name, []).append(i)
    return found


MOST_ROWS = 5e6  # of an even series; measuring two signals of so many takes a gigabyte and a half
LARGEST, LONGEST = 1e50, 1e12  # of a value, whatever its unit; of a step [s], and of its inverse
GAP = 2.5  # steps: a distance between rows beyond which nobody knows what was there
PASSED = 0.4  # of a lower rate, below which signals are taken over
_EDGE = 15  # rows by which a filter continues a record at its ends, SciPy's own number
_ROUGH = 0.25  # of a step: rounding to few digits leaves the mean rate as it is; a lost row moves others by half a step
_CLOSE = 0.1  # of the usual distance between rows: one this close to the row before it adds nothing but rounding


def evenly(t: Array, values: Array, step: float | None = None) -> tuple[Array, Array]:
    """Smooth signals at even times, by a cubic spline through their rows.

    Args:
        t: times of the rows [s], rising, shape (N,), N > 1.
        values: shape (N, w).
        step: between the times [s]; that of the rows by default (:func:`row_step`).

    Returns:
        times (M,) and values (M, w).
    """
    from scipy.interpolate import CubicSpline

    usual = row_step(t)
    step = usual if step is None else step
    kept = np.concatenate([[True], np.diff(t) > _CLOSE * usual])
    even = t[0] + step * np.arange(int((t[kept][-1] - t[0]) / step + EVEN) + 1)
    if len(even) == len(t) and np.abs(even - t).max() <= EVEN * step:
        return even, values
    return even, CubicSpline(t[kept], values[kept])(even)


def row_step(t: Array) -> float:
    """The step of rows [s], from as many of them as there are, because single times are rounded.

    Of rows that are even but for rounding, and for lost ones, it is what all take together; of others their usual
    distance, and where most crowd in few places (events without a least interval) a tenth of the mean one.

    Args:
        t: times [s], rising, shape (N,), N > 1.
    """
    span, usual = float(t[-1] - t[0]), float(np.median(np.diff(t)))
    for step in (span / (len(t) - 1), usual):
        place = np.rint((t - t[0]) / step)
        step = span / float(place[-1])
        if np.abs(t - t[0] - step * place).max() <= _ROUGH * step and np.diff(place).min() > 0:
            return step
    return max(usual, span / (10 * len(t)))


def expect_rate(series: Series, rate: float | None) -> Series:
    """The series, whose rows are as far apart as a rate that was said [Hz], if one was.

    Raises:
        DataError: if they are not, as the rate of a file with times is not for others to say.
    """
    own = 1 / row_step(series.t) if len(series) > 1 else rate
    if rate is not None and own is not None and abs(own / rate - 1) > EVEN:
        raise DataError(f"has times, of {own:.6g} rows a second, where a rate of {rate:g} Hz was said; leave it out")
    return series


def even_series(series: Series, rate: float | None = None) -> Series:
    """``series`` at even times: as it is where its times are even already, else by a cubic spline through its rows.

    Of a run, by one spline for each open-loop interval. For a rate below that of its rows, what is faster than 0.4
    times the new rate is filtered out first, as it would appear as something slow (Butterworth, fourth order, run
    forward and backward); not so of a run, whose signals jump.

    Args:
        series: its values may not be missing.
        rate: rows per second [Hz]; that of the rows by default.

    Returns:
        The series, and among its facts ``resampled`` where it was.

    Raises:
        DataError: if values are missing, rows are too few, there is a gap between them, or the rate is unusable.
    """
    check_complete(series)
    steps = np.diff(series.t)
    usual = float(np.median(steps))
    widest = int(steps.argmax())
    if steps[widest] > GAP * usual:
        raise DataError(
            f"a gap of {steps[widest]:.4g} s after {series.t[widest]:.6g} s, where rows are {usual:.4g} s apart; "
            "measure a part without gaps"
        )
    mean = float(series.t[-1] - series.t[0]) / (len(series) - 1)
    off = np.abs(series.t - (series.t[0] + mean * np.arange(len(series)))).max()
    step = row_step(series.t) if rate is None else step_of(rate, float(series.t[-1] - series.t[0]))
    if off <= EVEN * mean and abs(step - mean) * (len(series) - 1) <= EVEN * max(step, mean):
        return replace(series, t=series.t[0] + mean * np.arange(len(series)))
    slower = ""
    if len(series.jumps):
        t = series.t[0] + step * np.arange(int((series.t[-1] - series.t[0]) / step + EVEN) + 1)
        t = np.minimum(t, series.t[-1])
        values = piecewise(series.t, series.values, t, jumps=series.jumps, steady=steady(series.names))
    else:
        t, values, own = series.t, series.values, row_step(series.t)
        if step > (1 + EVEN) * own:
            t, values = evenly(t, values, own)
            values, slower = _hold_back(values, PASSED * own / step), f", below {PASSED / step:.4g} Hz"
        t, values = evenly(t, values, step)
    facts = {**series.facts, "resampled": f"cubic spline at {1 / step:.6g} Hz{slower}"}
    return replace(series, t=t, values=values, facts=facts)


def _hold_back(values: Array, corner: float) -> Array:
    """Even signals without what is faster than ``corner``, in cycles a row."""
    from scipy.signal import butter, sosfiltfilt

    length = min(_EDGE, len(values) - 1)
    return np.asarray(sosfiltfilt(butter(4, corner, fs=1.0, output="sos"), values, axis=0, padlen=length), float)


def check_complete(series: Series, fewest: int = 2) -> None:
    """Check that there are rows with a finite number for every signal.

    Raises:
        DataError: if not.
    """
    if len(series) < fewest:
        raise DataError(f"{len(series)} rows; expected at least {fewest}")
    for name, column in zip(series.names, series.values.T, strict=True):
        missing = np.flatnonzero(~np.isfinite(column))
        if len(missing):
            why = f"; {series.facts['load']}" if "load" in series.facts else ""
            raise DataError(
                f"{name}: {len(missing)} of {len(column)} values are missing or not finite, the first at "
                f"{series.t[missing[0]]:.6g} s{why}; fill them or measure a part without them"
            )
        if (largest := np.abs(column).max()) > LARGEST:
            raise DataError(f"{name}: has a value of {largest:.2g}; expected at most {LARGEST:g}, whatever its unit")
    steps = np.diff(series.t)
    if len(steps) and not (np.median(steps) > 1 / LONGEST and steps.max() < LONGEST):
        raise DataError(f"rows are {steps.min():.2g} to {steps.max():.2g} s apart; are the times in seconds?")


def step_of(rate: float, duration: float) -> float:
    """The step [s] of a rate [Hz].

    Raises:
        DataError: if it is no rate, or gives more rows than can be kept.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise DataError(f"a rate must be positive and finite, got {rate:g} Hz")
    if rate * duration > MOST_ROWS:
        raise DataError(
            f"{rate:g} Hz over {duration:.4g} s are {rate * duration:.2g} rows; expected at most {MOST_ROWS:.0e}"
        )
    return 1 / rate


NEAR = 1e-9  # [s]: instants this close are one


def piecewise(
    t: Array,
    values: Array,
    at: Array,
    *,
    jumps: Array | None = None,
    after: Array | None = None,
    breaks: Array | None = None,
    bends: Array | None = None,
    steady: np.ndarray | None = None,
) -> Array:
    """Interpolate piecewise smooth signals from their rows, whose values are given where there is one.

    Args:
        t: times of the rows [s], increasing, shape (N,).
        values: values of the signals at the rows, shape (N, w). A NaN affects the values up to the neighbouring rows.
        at: times of the result [s], increasing, from t[0] to t[-1], shape (M,).
        jumps: times of jumps at rows, which contain the values before the jump [s], shape (K,).
        after: values right after each jump, NaN if unknown, shape (K, w).
        breaks: further times of jumps, which need not be times of rows [s]; a row there contains the values after it.
        bends: times at which all signals bend and none jumps, so that a row is of both sides [s].
        steady: mask of the signals that bend at jumps and breaks, too, and do not jump; shape (w,).

    Returns:
        The values at ``at``, shape (M, w).
    """
    # of rows at one instant but for rounding the last tells what is there
    kept = np.append(np.diff(t) > NEAR, True)
    t, values = t[kept], values[kept]
    none = np.zeros(0)
    jumps, breaks, bends = (none if of is None else np.asarray(of, float) for of in (jumps, breaks, bends))
    after = np.full((len(jumps), values.shape[1]), np.nan) if after is None else after
    steady = np.zeros(values.shape[1], dtype=bool) if steady is None else steady
    result = np.empty((len(at), values.shape[1]))
    for these, instants in (
        (~steady, (jumps, after[:, ~steady], breaks, bends)),
        (steady, (none, np.zeros((0, int(steady.sum()))), none, np.concatenate([jumps, breaks, bends]))),
    ):
        if these.any():
            result[:, these] = _by_pieces(t, values[:, these], at, *instants)
    row = np.minimum(np.searchsorted(t, at - NEAR), len(t) - 1)
    met = np.abs(t[row] - at) <= NEAR
    result[met] = values[row[met]]
    return result


_JUMP, _BREAK, _BEND = 0, 1, 2  # what a row tells there: the value before, after, or of both sides


def _by_pieces(t: Array, values: Array, at: Array, jumps: Array, after: Array, breaks: Array, bends: Array) -> Array:
    """A spline for each piece between two instants, through the rows of its own side."""
    bends = _apart_from(np.unique(bends[~_near(bends, np.concatenate([jumps, breaks]))]))
    bends = bends[(bends > t[0] + NEAR) & (bends < t[-1] - NEAR)]
    alone = bends[~_near(bends, t)]
    if len(alone):  # without a row, as in logs of before: what is there is known from the piece before
        known = _by_pieces(t, values, alone - 2 * NEAR, jumps, after, np.concatenate([breaks, bends]), bends[:0])
        place = np.searchsorted(t, alone)
        t, values = np.insert(t, place, alone), np.insert(values, place, known, axis=0)
    # what jumps at a break, too, is in the row of the jump already: that row tells nothing of the time before
    shared = _near(jumps, breaks)
    breaks = _apart_from(np.unique(breaks[~_near(breaks, jumps)]))
    inner = np.concatenate([jumps, breaks, bends])
    kind = np.repeat([_JUMP, _BREAK, _BEND], [len(jumps), len(breaks), len(bends)])
    order = np.argsort(inner, kind="stable")
    order = order[(inner[order] > t[0]) & (inner[order] < t[-1] + NEAR)]
    inner, kind = inner[order], kind[order]
    early, late = (np.searchsorted(t, inner + side) for side in (-NEAR, NEAR))
    apart = (kind == _BREAK) | ((kind == _JUMP) & np.append(shared, np.zeros(len(breaks) + len(bends), bool))[order])
    begins = np.append(0, np.where(kind == _JUMP, late, early))
    ends = np.append(np.where(apart, early, late), len(t))
    # after a jump without any row the next one is nearer than what was before, if what is right after it is not known
    empty = (begins == ends) & np.append(False, kind == _JUMP) & (np.append(late, 0) > np.append(early, 0))
    ends = np.where(empty, np.append(late, len(t)), ends)
    # where instants come faster than rows, a piece alone tells no slope, but rows of one side each are joined by lines
    single = (ends - begins == 1) & ~empty
    ends_it = single & np.append(np.abs(t[np.minimum(begins[:-1], len(t) - 1)] - inner) <= NEAR, True)
    beside = np.where(ends_it, np.append(False, single[:-1]), np.append(single[1:], False))
    dense = single & beside
    # of its results, those at a jump belong to the piece before it, and others to the one after
    cuts = np.concatenate([[0], np.searchsorted(at, inner + np.where(kind == _JUMP, NEAR, -NEAR)), [len(at)]])
    least = _CLOSE * float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    result = np.empty((len(at), values.shape[1]))
    for number, wanted in enumerate(pairwise(cuts)):
        if wanted[0] >= wanted[1]:
            continue
        here = slice(*wanted)
        begun = number and kind[number - 1] == _JUMP
        head = after[order[number - 1]] if begun else np.full(values.shape[1], np.nan)
        known = np.isfinite(head)
        for columns, with_head in ((known, True), (~known, False)):
            if columns.any():
                rows = slice(begins[number], begins[number] if with_head and empty[number] else ends[number])
                if dense[number] and not with_head:
                    rows = slice(rows.start - ends_it[number], rows.stop + (not ends_it[number]))
                times = np.append(inner[number - 1], t[rows]) if with_head else t[rows]
                through = np.vstack([head, values[rows]])[:, columns] if with_head else values[rows][:, columns]
                few = _apart(times, least)
                result[here, columns] = _smooth(times[few], through[few], at[here], t, values[:, columns])
    return result


def snap(times: Array, instants: Array) -> Array:
    """Times of rows, of which one that is an instant but for rounding is exactly that; both rising."""
    if not len(instants):
        return times
    place = np.clip(np.searchsorted(instants, times - NEAR), 0, len(instants) - 1)
    return np.where(np.abs(instants[place] - times) <= NEAR, instants[place], times)


def _near(times: Array, others: Array) -> np.ndarray:
    """Mask of the times at which there is one of the others, shape (N,), bool."""
    others = np.sort(others)
    return np.searchsorted(others, times + NEAR, side="right") > np.searchsorted(others, times - NEAR)


def _apart_from(times: Array) -> Array:
    """The first of all increasing times that are one."""
    return times[np.diff(times, prepend=-np.inf) > NEAR]


def _smooth(knots: Array, piece: Array, at: Array, t: Array, values: Array) -> Array:
    """A spline through the knots of one piece, or the value of its only one.

    Where a value is NaN, straight lines through the knots; where there are none, between all rows.
    """
    from scipy.interpolate import CubicSpline

    result = np.empty((len(at), piece.shape[1]))
    good = np.isfinite(piece).all(axis=0) & (len(knots) > 1)
    if good.any():
        result[:, good] = CubicSpline(knots, piece[:, good])(at)
    for i in np.flatnonzero(~good):
        result[:, i] = np.interp(at, knots, piece[:, i]) if len(knots) else np.interp(at, t, values[:, i])
    return result


def _apart(times: Array, least: float) -> Array:
    """Mask of times of which no two are closer than ``least``; the first and last are kept; shape (N,), bool."""
    kept = np.ones(len(times), dtype=bool)
    if len(times) > 2:
        kept[1:-1] = (np.diff(times)[:-1] >= least) & (times[-1] - times[1:-1] >= least)
    return kept
