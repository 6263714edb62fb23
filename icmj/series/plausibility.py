"""What no standing person's recording is: sentinels, lost markers, sway of a room's size, torques beyond anybody's.

Such values are measured as they are, as only who recorded them can tell, and are told with the likely cause.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.series.series import Series
from icmj.series.units import QUANTITIES, canonical

SENTINELS = (99.0, 999.0, 9999.0, 99999.0, 999999.0)
"""Sizes of numbers that exporters write where there is no value."""
_FAR = 3.0  # ranges of all other values that a sentinel, or a lost marker's 0, lies from them
WIDEST, STRONGEST = 0.3, 300.0
"""Range of a standing person's sway [m], about the length of a foot, and largest torque at a joint [N m]; ours."""


def doubt(series: Series) -> Series:
    """The series, with what is odd about its values among its facts (``odd``)."""
    said = [
        f"{name}: {words}"
        for name, unit, column in zip(series.names, series.units, series.values.T, strict=True)
        for words in _oddities(column[np.isfinite(column)], canonical(unit))
    ]
    return replace(series, facts={**series.facts, "odd": "; ".join(said)}) if said else series


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
        if apart > _FAR * float(np.ptp(others)) and apart > 0:
            far = True
            yield f"{odd:g} in {count} of {len(values)} rows, far from all others, as where values are missing"
    if far:
        return
    size, largest = float(np.ptp(values)), float(np.abs(values).max())
    if (metre := QUANTITIES["length"].get(unit)) is not None and size * metre > WIDEST:
        yield f"a range of {size * metre:.3g} m, and {WIDEST:g} m is much for who stands; is it sway, in this unit?"
    if (torque := QUANTITIES["torque"].get(unit)) is not None and largest * torque > STRONGEST:
        yield f"a torque of {largest * torque:.3g} N m, and {STRONGEST:g} N m is much for a person; is it in this unit?"
