"""Units of recorded quantities: what a column's unit means in SI, or one line that asks for it.

A number is read as a physical quantity only where its unit is known. A torque that is taken in N m though it is in
N mm gives a sway of metres, and nothing later can tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.series import Series

_TURN = np.pi / 180
_PREFIXES = {"": 1.0, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6}
_IN_WORDS = {"": 1.0, "centi": 1e-2, "zenti": 1e-2, "milli": 1e-3, "mili": 1e-3, "micro": 1e-6, "mikro": 1e-6}
_METRE = "metre metres meter meters metro metros"
_SECOND = "second seconds sekunde sekunden seconde secondes segundo segundos secondo secondi"
QUANTITIES: Mapping[str, Mapping[str, float]] = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": _TURN, "°": _TURN, "degrees": _TURN, "degree": _TURN},
    "length": {
        **{f"{p}m": size for p, size in _PREFIXES.items() if p != "k"},
        **{p + word: size for (p, size), word in product(_IN_WORDS.items(), _METRE.split())},
        **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    },
    "force": {f"{p}N": size for p, size in _PREFIXES.items() if p != "c"},
    "torque": {
        f"{p}N{sign}{q}m": a * b
        for (p, a), (q, b), sign in product(_PREFIXES.items(), _PREFIXES.items(), ("", "-"))
        if q in ("", "c", "m")
    },
}
"""Units of each quantity, without blanks and signs of multiplication, in rad, m, N or N m."""
_OF_TIME = {1.0: "s sec secs seg sek", 1e-3: "ms msec mseg msek", 1e-6: "us µs μs usec", 1e-9: "ns", 60.0: "min"}
SECONDS: Mapping[str, float] = {
    **{name: size for size, names in _OF_TIME.items() for name in names.split()},
    **{p + word: size for (p, size), word in product(_IN_WORDS.items(), _SECOND.split())},
}
"""Units of time, in small letters, in s."""
_OTHERS = ("-", "1", "%", "hz", "v", "mv", "kg", "g", "n/a", "a.u.", "au", "bw", "h")
_RATES = ("", "/s", "/s2", "/s^2", "/s²", "/kg")
_SHOWN = {"angle": ("rad", "deg"), "length": ("m", "cm", "mm"), "force": ("N", "kN"), "torque": ("N m", "N cm", "N mm")}
_PRODUCT = str.maketrans("", "", " ·⋅*.×")


def canonicalise(unit: str) -> str:
    """A unit without blanks and signs of multiplication, a word in small letters."""
    plain = unit.translate(_PRODUCT)
    return plain.lower() if plain.isalpha() and len(plain) > 4 else plain  # kNmm has four


def is_unit(words: str) -> bool:
    """Whether a field of a table is a unit, in brackets or not, or empty, as below a name without a unit."""
    plain = canonicalise(words.strip("[]() "))
    known = plain.lower() in SECONDS or plain.lower() in _OTHERS or not plain
    return known or any(
        plain.removesuffix(rate) in units and plain.endswith(rate) for units in QUANTITIES.values() for rate in _RATES
    )


def find_factor(unit: str, quantity: str, name: str) -> float:
    """What one ``unit`` of a quantity is in SI; ``N·mm``, ``N mm`` and ``Nmm`` are one unit.

    Args:
        unit: as a file states it; "" where it states none.
        quantity: a key of :data:`QUANTITIES`.
        name: of the signal, for the message.

    Raises:
        DataError: if there is no unit, or it is not one of this quantity.

    Example:
        >>> find_factor("N·mm", "torque", "ankle")
        0.001
    """
    known = QUANTITIES[quantity].get(canonicalise(unit))
    if known is None:
        said = f"is in {one_line(unit, 40)!r}" if unit else "has no unit"
        shown = _SHOWN[quantity]
        raise DataError(f"{name}: {said}; expected one of {', '.join(shown)}, as in '{name} [{shown[0]}]'")
    return known


def convert_to_si(series: Series, *quantities: str) -> Series:
    """Signals in rad, m, N or N m, one quantity for each.

    Raises:
        DataError: if a signal has no unit, or one of another quantity.
    """
    given = list(zip(series.units, quantities, series.names, strict=True))
    values = series.values * [find_factor(*one) for one in given]
    return replace(series, values=values, units=tuple(_SHOWN[quantity][0] for _, quantity, _ in given))
