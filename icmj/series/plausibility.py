"""What no standing person's recording is: sentinels, lost markers, trials stacked, forces in millimetres.

Such values are measured as they are, as only who recorded them can tell, and are told with the likely cause.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.series.columns import LONGEST_STEP, SHORTEST_STEP
from icmj.series.plates import is_centre
from icmj.series.series import Series
from icmj.series.units import QUANTITIES, canonicalise

SENTINELS = (99.0, 999.0, 9999.0, 99999.0, 999999.0)
"""Sizes of numbers that exporters write where there is no value."""
_FAR = 3.0  # ranges of all other values that a sentinel, or a lost marker's 0, lies from them
WIDEST, STRONGEST = 0.3, 300.0
"""Range of a standing person's sway [m], about the length of a foot, and largest torque at a joint [N m]; ours."""
NARROWEST = 1e-4
"""Range of what moves at all [m], beneath which a force plate sees nothing; ours."""
LEAST_RMS, MOST_RMS = 1e-3, 0.03
"""RMS of a centre of pressure of who stands quietly, in a minute [m]; ours. Of 102 recorded ones on firm ground (Santos
and Duarte 2016) it is 1.1 to 12 mm, and in none of their parts of 10 to 60 s below this bound in proportion; of 978
trials, old people on foam with closed eyes among them, the geometric mean of both directions is 1.4 to 17.6 mm.
"""
STUCK = 0.5
"""Longest time of one value between others [s]; ours: of 102 recorded centres of pressure none has more than 0.06 s."""
LEAP, SELDOM = 8.0, 5.0
"""How many times the step beneath which 99 of 100 are makes a step between rows a jump, and in how many seconds there
is no more than one [s]; ours: of 102 recorded centres of pressure none has a step of more than 4.9 times, and where two
of them are put one below the other, nineteen in twenty have."""
_AT_ONCE = 0.1  # s of a jump that a filter has made wider
_FORCE = re.compile(r"(.*[\W_\d])?(f|grf|force)[\W_]*\d*[\W_]*[xyz]?\d*", re.IGNORECASE)


def note_oddities(series: Series) -> Series:
    """The series, with what is odd about its values among its facts (``odd``)."""
    said: dict[str, list[str]] = {}  # names by what is said of them
    for name, unit, column in zip(series.names, map(canonicalise, series.units), series.values.T, strict=True):
        known = np.isfinite(column)
        t, values = series.t[known], column[known]
        words = [*_named_otherwise(name, unit), *_oddities(values, unit)]
        if not words and is_centre(name) and unit in QUANTITIES["length"]:
            words = [*_sways_otherwise(t, values * QUANTITIES["length"][unit])]
        if not words and unit not in (*QUANTITIES["force"], *QUANTITIES["torque"]) and not len(series.jumps):
            words = [*_stuck(t, values)] or [*_leaps(t, values)]
        for each in words:
            said.setdefault(each, []).append(name)
    told = [series.facts["odd"]] if "odd" in series.facts else []  # by who read it
    step = float(np.median(np.diff(series.t))) if len(series) > 1 else LONGEST_STEP
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        told.append(f"rows are {step:.3g} s apart, and those of people hardly ever; are the times in this unit?")
    told += [f"{', '.join(names)}: {words}" for words, names in said.items()]
    return replace(series, facts={**series.facts, "odd": "; ".join(told)}) if told else series


def measure_longest_still(t: Array, values: Array) -> tuple[float, float]:
    """How long a signal keeps one value at the most [s], between others, and since when [s]."""
    edges = np.concatenate([[0], 1 + np.flatnonzero(np.diff(values) != 0), [len(values)]])
    lasts = t[edges[1:] - 1] - t[edges[:-1]]
    at = int(np.argmax(lasts))
    return float(lasts[at]), float(t[edges[at]])


def _named_otherwise(name: str, unit: str) -> Iterator[str]:
    """Whether a name tells of another quantity than its unit."""
    if unit in QUANTITIES["length"] and _FORCE.fullmatch(name):
        yield f"a force by its name, and in {unit}; what is it?"


def _sways_otherwise(t: Array, values: Array) -> Iterator[str]:
    """Whether a centre of pressure [m] sways much less or much more than that of anybody who stands quietly."""
    span, rms = (float(t[-1] - t[0]), float(values.std())) if len(t) else (0.0, 0.0)
    if 0 < rms < LEAST_RMS * min(1.0, span / 60) or rms > MOST_RMS:
        yield (
            f"an RMS of {1e3 * rms:.2g} mm in {span:.3g} s, and those who stand quietly have 1 to 20 mm; is it in this "
            "unit, and without a drift?"
        )


def _leaps(t: Array, values: Array) -> Iterator[str]:
    """Jumps from one row to the next that no body makes: seams of trials, lost markers, single wrong rows."""
    if len(t) < 3:
        return
    steps = np.abs(np.diff(values))
    usual = float(np.quantile(steps, 0.99))
    at = np.flatnonzero(steps > LEAP * usual)
    if not usual > 0 or not len(at):
        return
    first = at[np.diff(t[at], prepend=-np.inf) > _AT_ONCE]
    if len(first) * SELDOM <= max(t[-1] - t[0], 2 * SELDOM):
        more = f", and {len(first) - 1} later" if len(first) > 1 else ""
        yield (
            f"a jump after {t[first[0]]:.6g} s{more}, such as no sway makes; are trials one below the other, or is a "
            "marker lost?"
        )


def _stuck(t: Array, values: Array) -> Iterator[str]:
    """One value for longer than anybody keeps still, but not from the beginning or to the end."""
    moving = np.flatnonzero(np.diff(values) != 0)
    inner = slice(moving[0] + 1, moving[-1] + 1) if len(moving) else slice(0)
    if len(t[inner]) and 2 * len(moving) > len(t):
        lasts, since = measure_longest_still(t[inner], values[inner])
        if lasts > STUCK:
            yield f"one value for {lasts:.2g} s from {since:.6g} s on, as where a gap is filled or a sensor at its end"


def _oddities(values: Array, unit: str) -> Iterator[str]:
    """What is odd about the finite values of a signal, in words."""
    if not len(values):
        return
    far = False
    for odd in np.intersect1d(values, [0.0, *SENTINELS, *(-size for size in SENTINELS)]):
        others = values[values != odd]
        count = len(values) - len(others)
        # some rows of one number, far from all others: of 0, what a marker or a plate has where it is not seen
        if not len(others) or (odd == 0 and count < 2) or len(others) < count:
            continue
        apart = max(float(others.min()) - odd, odd - float(others.max()))
        if apart > _FAR * (wide := float(np.ptp(others))) and apart > 0 and (odd or wide):  # a step is from 0
            far = True
            yield f"{odd:g} in {count} of {len(values)} rows, far from all others, as where values are missing"
    if far:
        return
    size, largest = float(np.ptp(values)), float(np.abs(values).max())
    if (metre := QUANTITIES["length"].get(unit)) is not None and size * metre > WIDEST:
        yield f"a range of {size * metre:.3g} m, and {WIDEST:g} m is much for who stands; is it sway, in this unit?"
    if metre is not None and 0 < size * metre < NARROWEST:
        yield f"a range of {size * metre:.2g} m, less than a force plate sees of who stands; is it in this unit?"
    if (torque := QUANTITIES["torque"].get(unit)) is not None and largest * torque > STRONGEST:
        yield f"a torque of {largest * torque:.3g} N m, and {STRONGEST:g} N m is much for a person; is it in this unit?"
