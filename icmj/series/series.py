"""A time series: some signals that share their times, each with a name and a unit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.base.card import Card, WithCard
from icmj.base.numbers import MISSING, amount
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
    "cut": "",
    "ends": "",
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
        expect_names_differ(names)
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
        return make_dataset(self.t, self.values, self.names, self.units, self.facts, along)

    @property
    def headers(self) -> tuple[str, ...]:
        """``t [s]`` and each name with its unit, such as ``ankle [rad]``; only the name if there is no unit."""
        return ("t [s]", *(format_header(name, unit) for name, unit in zip(self.names, self.units, strict=True)))


def _rises(count: Array) -> np.ndarray:
    """Mask of the rows, but the last, after which a count of events rises; none if it is no such count."""
    rises = np.diff(count) > 0
    whole = np.isfinite(count).all() and (count == np.rint(count)).all() and (np.diff(count) >= 0).all()
    return rises & bool(whole and 2 * rises.sum() < len(count))  # else it numbers the rows themselves


def is_steady(names: Sequence[str]) -> np.ndarray:
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


def expect_names_differ(names: Sequence[str]) -> None:
    """Check that the names of signals differ.

    Raises:
        DataError: if two have.
    """
    twice = sorted({name for name, count in Counter(names).items() if count > 1})
    if twice:
        raise DataError(f"several signals are called {', '.join(twice)}; give each a name of its own")


def format_header(name: str, unit: str) -> str:
    """``ankle [rad]``, or the name alone without a unit."""
    return f"{name} [{unit}]" if unit else name


def make_dataset(
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
