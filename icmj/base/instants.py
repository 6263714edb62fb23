"""Instants that are one but for rounding, in compiled code.

What is due at an instant is computed in several ways: as a multiple of an interval, as an event's time and a delay, as
a number of the run file. Their sums are rounded, and whoever asks for a push at 0.1 s and for an event 0.1 s after the
start means the same instant, whatever the last bit says.
"""

from __future__ import annotations

from icmj.base.compilation import compiled

ONE_INSTANT = 1e-12
"""Instants this close [s] are one."""


@compiled
def one(instant, other):  # type: ignore[no-untyped-def]
    """The instant, or the ``other`` where the two are one [s]; either may be infinite."""
    return other if abs(instant - other) <= ONE_INSTANT else instant
