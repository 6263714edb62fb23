"""The columns of a file that are read: which has the times, which are signals, and which are neither.

Times are found by names and units. A further column of times, and one that counts rows, is no signal: it is left out,
which is said. Times without a unit are seconds where rows are as close as people are recorded; else they are asked for.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.even_rows import step_of
from icmj.series.long_table import find_labels, split_rows
from icmj.series.plates import find_loads, leave_out_unloaded
from icmj.series.series import COUNTER, EVEN, Series, expect_names_differ, place
from icmj.series.units import SECONDS, is_unit
from icmj.series.unlabelled import refuse_second_trial, refuse_unknown_labels, refuse_unknown_numbers

MOST_NUMBERS = 12_000_000  # that are read, times among them; measuring them takes a gigabyte and a half
TIMES = ("t", "time", "times", "timestamp", "seconds", "x_value")  # the last of LabVIEW
"""Names of a column of times, whatever else is in the file."""
COUNTS = ("frame", "frames", "sub frame", "subframe", "sample", "samples", "index", "row", "item")  # of rows
LONGEST_STEP, SHORTEST_STEP = 0.3, 2e-5
"""Distances of rows beyond which times without a unit are not taken for seconds; ours: 3.3 Hz and 50 kHz."""
_WORDS = ("time", "zeit", "temps", "tiempo", "tempo", "tid", "tijd", "timestamp", "timestamps", "elapsed")
_LARGE = 1e300
_AGREES = 0.01  # share that the spans of two columns of times may differ by; ours
_EVEN = 1e-6  # of a step that differences may be off, beside rounding of the times to digits
_QUOTIENT = re.compile(r"(?P<name>.*?[^\s/,])\s*[/,]\s*(?P<open>\()?(?P<unit>[^\s,()\[\]]+)\)?")
_NAME = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")


def name_and_unit(header: str) -> tuple[str, str]:
    """``ankle [rad]`` and ``ankle (rad)`` are ``ankle`` in rad; without brackets the unit is "" ."""
    found = _NAME.fullmatch(one_line(header, 200))
    assert found is not None
    return found["name"], (found["unit"] or "").strip()


def bracket_units(headers: Sequence[str]) -> list[str]:
    """``t/s``, ``v/(mm/s)`` and ``ap, mm`` as ``t [s]``, ``v [mm/s]`` and ``ap [mm]``, where no header has brackets.

    A quotient of units, as in ``speed mm/s``, is none of these: what stands before the sign is no unit, and only times
    are in seconds.
    """
    found = [_QUOTIENT.fullmatch(header.strip()) for header in headers]
    if any(name_and_unit(header)[1] for header, quotient in zip(headers, found, strict=True) if not quotient):
        return list(headers)
    given = list(headers)
    for i, quotient in enumerate(found):
        if quotient is None:
            continue
        name, unit = quotient["name"], quotient["unit"]
        timed = unit.lower() not in SECONDS or _is_time(name) or name.lower() in TIMES
        if timed and is_unit(unit) and unit not in "-1" and (quotient["open"] or not is_unit(name.split()[-1])):
            given[i] = f"{name} [{unit}]"
    return given


@dataclass(frozen=True)
class Columns:
    """The columns of a file that are read: that of the times, if there is one, before the signals in their order.

    Attributes:
        at: their places in the file.
        names, units: of the signals.
        clock: name of the column of times; "" where there is none.
        second: what the times are in [s]; ``None`` where that is not known.
        rate: rows per second that were said [Hz], if any.
        beside: names and units of what is read behind the signals: the number of events before each row of a run, and
            vertical forces of plates.
        loads: names of the vertical forces of each centre of pressure.
        asked: whether the signals were asked for by name.
        left: what is left out of the file, with the reason.
    """

    at: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    clock: str
    second: float | None
    rate: float | None
    beside: tuple[tuple[str, str], ...] = ()
    loads: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    asked: bool = False
    left: tuple[str, ...] = ()

    def room(self, rows: int) -> Array:
        """An array for this number of rows.

        Raises:
            DataError: if they are more than can be read.
        """
        if rows * len(self.at) > MOST_NUMBERS:
            raise DataError(
                f"about {rows} rows of {len(self.at)} columns; expected at most {MOST_NUMBERS / 1e6:g} million "
                "numbers, name columns or cut it into parts"
            )
        return np.empty((rows, len(self.at)))

    def to_trials(self, data: Array, told: Sequence[tuple[str, Any]] = ()) -> tuple[Series, ...]:
        """The series of each trial from the data that were read; without labels there is one.

        Args:
            data: shape (N, columns).
            told: names and cells of the columns of labels (:mod:`icmj.series.long_table`) and of other text.

        Raises:
            DataError: if times do not rise, their unit has to be said, a row has no label, or another column may be one
                of labels.
        """
        topics = find_labels([name for name, _ in told])
        labels = [(topics[i], cells) for i, (_, cells) in enumerate(told) if i in topics]
        if self.clock or labels:  # rows that exporters leave empty at the end are none
            known = np.flatnonzero(~np.isnan(data).all(axis=1))
            data = data[: known[-1] + 1 if len(known) else 0]
        if self.clock and not labels:
            refuse_second_trial(data[:, 0])
        split = split_rows(labels, len(data))
        refuse_unknown_labels([one for i, one in enumerate(told) if i not in topics], [rows for _, rows in split])
        found = []
        for named, rows in split:
            try:
                series = self._to_series(data[rows])
            except DataError as error:
                words = (f"{topic} {word}" for topic, word in named.items())
                raise DataError(": ".join(filter(None, (", ".join(words), str(error))))) from error
            found.append(replace(series, facts={**named, **series.facts}))
        return tuple(found)

    def _to_series(self, data: Array) -> Series:
        t = self._times(data)
        data = data[:, 1:] if self.clock else data
        names, units = zip(*zip(self.names, self.units, strict=True), *self.beside, strict=True)
        whole = Series(t, data, names, units)
        self._refuse_other_times(whole)
        kept = leave_out_unloaded(whole, self.loads)
        if self.asked:
            return kept.chosen(self.names)
        signals, left = [], list(self.left)
        for i, name in enumerate(self.names):
            rises = _rises(data[:, i])
            timed = rises and (_is_time(name) or self.units[i].lower() in SECONDS)
            counted = rises == "evenly" and not self.units[i] and bool((data[:, i] == np.rint(data[:, i])).all())
            if _counts(name) or (self.clock and (timed or counted)):
                left.append(f"{name}, which counts rows or time")
            elif rises == "evenly" and not self.clock:
                step, rate = float(data[1, i] - data[0, i]), self.rate or 0.0
                if not self.units[i] and (step == 1 or abs(step * rate - 1) < EVEN):
                    left.append(f"{name}, which counts rows or time")
                    continue
                raise DataError(
                    f"{name} rises by {step:.6g} in every row, as times or numbers of rows do; name the times, as in "
                    "'t [s]', or the columns to read"
                )
            else:
                if not self.units[i] and name != COUNTER:
                    refuse_unknown_numbers(name, data[:, i])
                signals.append(name)
        if not signals:
            raise DataError("no column of numbers beside those that count rows")
        facts = {**kept.facts, "left out": f"left out: {'; '.join(left)}"} if left else kept.facts
        return replace(kept.chosen(signals), facts=facts)

    def _is_clock(self, name: str, unit: str) -> bool:
        return unit.lower() in SECONDS or (not unit and name == self.clock)

    def _refuse_other_times(self, whole: Series) -> None:
        """See that all columns of times go on alike, as each may be of the signals that stand beside it."""
        for name, unit in zip(whole.names, whole.units, strict=True) if self.clock and len(whole) else ():
            t = whole[name] * (SECONDS.get(unit.lower()) or self.second or 1.0)
            if self._is_clock(name, unit) and _rises(t) and abs(np.ptp(t) / np.ptp(whole.t) - 1) > _AGREES:
                raise DataError(
                    f"{self.clock} lasts {np.ptp(whole.t):.6g} s and {name} {np.ptp(t):.6g} s; of two trials side by "
                    "side, save each in a file of its own"
                )

    def _times(self, data: Array) -> Array:
        t = data[:, 0]
        if not self.clock or (self.rate is not None and not np.isfinite(t).any()):  # LabVIEW leaves them empty
            assert self.rate is not None
            return np.arange(len(data), dtype=float) * step_of(self.rate, 0)
        if len(t) and not np.isfinite(t).any():
            raise DataError(f"{self.clock} has no values; fill it, or say with --rate how many rows a second has")
        if self.second is not None:
            return t * self.second
        known = t[np.abs(t) < _LARGE]
        step = float(np.median(np.diff(known))) if len(known) > 1 else 0.0
        if not (step > LONGEST_STEP or 0 < step < SHORTEST_STEP):
            return t
        if self.rate is None or _rises(t) != "evenly":
            raise DataError(
                f"{self.clock} rises by {step:.6g} from row to row, and no unit says of what; name it '{self.clock} "
                f"[s]' or '{self.clock} [ms]', or say with --rate how many rows a second has"
            )
        return np.arange(len(data), dtype=float) * step_of(self.rate, 0)


def choose_columns(
    headers: Sequence[str],
    units: Sequence[str],
    columns: Sequence[str],
    rate: float | None,
    left: Sequence[str] = (),
    faults: Mapping[int, str] | None = None,
) -> Columns:
    """The columns to read of a file with these.

    Args:
        headers: names of its columns of numbers, some with units.
        units: units that the file states otherwise, or "".
        columns: names of the signals that are asked for; by default all.
        rate: rows per second [Hz], if it was said.
        left: what of the file is no column of numbers, with the reason.
        faults: what is no number in a column, by its place.

    Raises:
        DataError: if there are no times and no rate, no signal, no column of a name that is asked for, two of a name,
            or a column that is read has a fault.
    """
    named = [name_and_unit(header) for header in headers]
    names = [name or f"column {i + 1}" for i, (name, _) in enumerate(named)]
    units = [given or own for given, (_, own) in zip(units, named, strict=True)]
    clock = _find_clock(names, units)
    if clock is None and rate is None:
        for name, unit in zip(names, units, strict=True):
            if _is_time(name):
                _second_of(name, unit)
        raise DataError(f"no column of times ({', '.join(TIMES[:2])}); say with --rate how many rows a second has")
    second = None if clock is None else _second_of(names[clock], units[clock])
    kept = [i for i in range(len(names)) if i != clock]
    if not kept:
        raise DataError("no column of numbers beside the times")
    known = [names[i] for i in kept]
    expect_names_differ(known)
    needed = [i for i in kept if names[i] == COUNTER and not units[i]]
    loads = {kept[i]: [kept[at] for at in on] for i, on in find_loads(known, [units[i] for i in kept]).items()}
    if columns:
        kept = [kept[place(known, name)] for name in columns]
    loads = {i: on for i, on in loads.items() if i in kept}
    needed += [i for on in loads.values() for i in on]
    if clock is not None:
        clocks = (
            i for i, unit in enumerate(units) if unit.lower() in SECONDS or (not unit and names[i] == names[clock])
        )
        needed += [i for i in clocks if i != clock and i not in (faults or {})]
    beside = list(dict.fromkeys(i for i in needed if i not in kept))
    at = (*([] if clock is None else [clock]), *kept, *beside)
    for i in at:
        if i in (faults or {}):
            raise DataError(f"{names[i]}: {(faults or {})[i]!r} is no number; correct it, or name other columns")
    signals = [tuple(of[i] for i in kept) for of in (names, units)]
    of_plates = {names[i]: tuple(names[each] for each in on) for i, on in loads.items()}
    return Columns(
        at, signals[0], signals[1], "" if clock is None else names[clock], second, rate,
        tuple((names[i], units[i]) for i in beside), of_plates, bool(columns), tuple(left),
    )  # fmt: skip


def _find_clock(names: Sequence[str], units: Sequence[str]) -> int | None:
    """The place of the column of times: by its name, else by its unit where it stands first, else by a word in it."""
    exact = (i for i, name in enumerate(names) if name.lower() in TIMES)
    united = (i for i, unit in enumerate(units) if unit.lower() in SECONDS and (i == 0 or _is_time(names[i])))
    worded = (i for i, name in enumerate(names) if _is_time(name) and (not units[i] or units[i].lower() in SECONDS))
    return next((i for found in (exact, united, worded) for i in found), None)


def _counts(name: str) -> bool:
    return re.sub(r"[\W_]+", " ", name.lower()).strip() in COUNTS


def _is_time(name: str) -> bool:
    return bool(set(re.split(r"[\W\d_]+", name.lower())) & {*_WORDS, "seconds"})


def _second_of(name: str, unit: str) -> float | None:
    """What times are in [s], by their unit or the end of their name; ``None`` where neither tells.

    Raises:
        DataError: if the unit is none of time.
    """
    last = re.split(r"[\W_]+", name.lower())[-1]
    if unit.lower() in COUNTS:
        return None
    if unit and unit.lower() not in SECONDS:
        raise DataError(f"times in {unit!r}; expected s, ms, µs, ns or min")
    return SECONDS.get(unit.lower(), SECONDS.get(last) if last != name.lower() or last == "seconds" else None)


def _rises(values: Array) -> str:
    """``evenly`` if successive numbers differ by one step, but for rounding to digits; "" if they do not all rise."""
    # differences of larger numbers may overflow
    if len(values) < 3 or not (np.abs(values) < _LARGE).all() or not (np.diff(values) > 0).all():
        return ""
    steps = np.diff(values)
    step = (values[-1] - values[0]) / len(steps)
    off = np.abs(values - values[0] - step * np.arange(len(values))).max()
    return "evenly" if off <= max(_EVEN * step, 4 * np.spacing(np.abs(values).max())) or off < 0.1 * step else "rising"
